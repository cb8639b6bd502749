"""The fluid of a network, as restrictions need it at set-up."""

from klack.errors import InputError
from klack.network.protocols import NetworkFluid
from klack.network.rows import Rows

__all__ = ["ambient_viscosity", "network_fluid"]


def network_fluid(rows: Rows) -> NetworkFluid:
    """Return the fluid; raise :class:`InputError` if the network has none."""
    if rows.fluid is None:
        raise InputError(
            f"{rows.component or 'component'}: fluid",
            got="no fluid in the network",
            expected="a fluid, since this component carries or holds some",
            hint="name one in the network section, e.g. fluid: {name: n-heptane}.",
        )
    return rows.fluid


def ambient_viscosity(rows: Rows) -> tuple[NetworkFluid, float]:
    """Fluid and its dynamic viscosity [Pa s] at the ambient pressure.

    Restrictions keep this one: the rise with pressure is 0.1 to 0.2 % per bar in oils and less in
    fuels, below the accuracy of their flow coefficients.
    """
    fluid = network_fluid(rows)
    return fluid, float(fluid.viscosity(rows.ambient.pressure))
