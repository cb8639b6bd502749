"""Gas of a network for its components, and the rows that they all add."""

from klack.errors import InputError
from klack.hydraulics.gas.gas import Gas
from klack.hydraulics.gas.gas_element import close_gas
from klack.network.gas_rows import GasBranchRow, GasSourceRow
from klack.network.rows import AMBIENT, Rows

__all__ = ["add_restriction", "network_gas"]


def network_gas(rows: Rows) -> Gas:
    """Gas of the network; the surroundings are a source of it.  InputError if there is none."""
    if not isinstance(rows.gas, Gas):
        raise InputError(
            f"{rows.component or 'component'}: gas",
            got="no gas in the network",
            expected="a gas, since this component contains it",
            hint="name one in the network section, e.g. gas: air.",
        )
    rows.closing["gas"] = close_gas
    if AMBIENT not in rows.gas_rows.sources:
        rows.gas_rows.sources[AMBIENT] = GasSourceRow(
            component="ambient",
            time=(0.0,),
            pressure=(rows.ambient.pressure,),
            temperature=rows.ambient.temperature,
        )
    return rows.gas


def add_restriction(rows: Rows, law: tuple[float, ...], **lift: object) -> None:
    """Add a branch between the ports ``a`` and ``b``."""
    rows.gas_rows.branches.append(
        GasBranchRow(
            component=rows.component,
            a=rows.port("a"),
            b=rows.port("b"),
            law=law,
            **lift,  # type: ignore[arg-type]
        )
    )
