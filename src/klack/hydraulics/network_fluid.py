"""Fluid of a network for restrictions at set-up."""

import warnings

import numpy as np
from numpy.typing import NDArray

from klack.errors import AccuracyWarning, InputError
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.fluid_table import fluid_table
from klack.hydraulics.pressure_viscosity import CONSTANT, PressureViscosity
from klack.network.protocols import NetworkFluid
from klack.network.rows import Rows

__all__ = [
    "ambient_viscosity",
    "energy_table",
    "fixed_viscosity",
    "gas_is_slow",
    "network_fluid",
    "viscosity_law",
]


def network_fluid(rows: Rows) -> NetworkFluid:
    """Fluid of the network; InputError if it has none."""
    if rows.fluid is None:
        raise InputError(
            f"{rows.component or 'component'}: fluid",
            got="no fluid in the network",
            expected="a fluid, since this component contains it",
            hint="name one in the network section, e.g. fluid: {name: n-heptane}.",
        )
    return rows.fluid


def gas_is_slow(rows: Rows) -> bool:
    """Whether gas leaves and enters the fluid with time constants."""
    return isinstance(rows.fluid, Fluid) and rows.fluid.has_release_times


def energy_table(rows: Rows) -> NDArray[np.float64]:
    """Table of the pressure energy that flows carry.

    Where gas has time constants, this is that with all gas free: see
    :mod:`klack.hydraulics.gas_release`.
    """
    fluid = network_fluid(rows)
    if isinstance(fluid, Fluid) and fluid.has_release_times:
        fluid = fluid.all_free()
    return fluid_table(fluid, rows.ambient.pressure)


def ambient_viscosity(rows: Rows) -> tuple[NetworkFluid, float]:
    """Fluid and its dynamic viscosity [Pa s] at the ambient pressure, for restrictions.

    With a :func:`viscosity_law` it is that at one atmosphere, to which the law refers.  The rise
    with pressure is 0.1 to 0.2 % per bar in oils and less in fuels: below the accuracy of flow
    coefficients up to some tens of bar.
    """
    fluid = network_fluid(rows)
    if isinstance(fluid, Fluid) and fluid.viscosity_law is not None:
        return fluid, fluid.base_viscosity
    return fluid, float(fluid.viscosity(rows.ambient.pressure))


def fixed_viscosity(rows: Rows) -> tuple[NetworkFluid, float]:
    """As :func:`ambient_viscosity`, with a note that the restriction follows no viscosity law."""
    if viscosity_law(rows) is not CONSTANT:
        warnings.warn(
            f"{rows.component}: its laminar flow uses the viscosity at one atmosphere. The "
            "viscosity law of the fluid acts in orifices, seats, annuli, inertances, lines and "
            "films.",
            AccuracyWarning,
            stacklevel=2,
        )
    return ambient_viscosity(rows)


def viscosity_law(rows: Rows) -> PressureViscosity:
    """Law of the viscosity over pressure in restrictions, constant by default."""
    fluid = network_fluid(rows)
    return (isinstance(fluid, Fluid) and fluid.viscosity_law) or CONSTANT
