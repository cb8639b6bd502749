"""Consistent unit systems of finite-element models, which their files do not state.

A model is consistent when its units of length, mass and time give all others: with mm, t and s a
force is in N and a pressure in MPa.
"""

from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import BeforeValidator, WithJsonSchema

from klack.errors import InputError, refuse_if

__all__ = ["UNIT_SYSTEMS", "UnitSystem", "UnitSystemName", "unit_system"]


@dataclass(frozen=True, slots=True)
class UnitSystem:
    """Units of a model in SI; ``name`` has length, mass and time: ``"mm t s"``."""

    name: str
    length: float
    mass: float
    time: float

    @property
    def force(self) -> float:
        """Unit of force [N]."""
        return self.mass * self.length / self.time**2

    @property
    def stiffness(self) -> float:
        """Unit of stiffness, force per length [N/m]."""
        return self.mass / self.time**2

    @property
    def pressure(self) -> float:
        """Unit of pressure, force per area [Pa]."""
        return self.mass / (self.length * self.time**2)

    @property
    def density(self) -> float:
        """Unit of density, mass per volume [kg/m^3]."""
        return self.mass / self.length**3


UNIT_SYSTEMS = {
    system.name: system
    for system in (
        UnitSystem("m kg s", 1.0, 1.0, 1.0),
        UnitSystem("mm t s", 1e-3, 1e3, 1.0),
        UnitSystem("mm kg ms", 1e-3, 1.0, 1e-3),
        UnitSystem("mm g ms", 1e-3, 1e-3, 1e-3),
        UnitSystem("mm kg s", 1e-3, 1.0, 1.0),
        UnitSystem("cm g s", 1e-2, 1e-3, 1.0),
        UnitSystem("um kg s", 1e-6, 1.0, 1.0),
        # pound-force, inch: the unit of mass is lbf s^2/in
        UnitSystem("in lbf s", 0.0254, 4.4482216152605 / 0.0254, 1.0),
        UnitSystem("ft slug s", 0.3048, 4.4482216152605 / 0.3048, 1.0),
    )
}
"""Unit systems by name."""


def unit_system(name: str, where: str = "units") -> UnitSystem:
    """Find a unit system by its name; spaces, commas and hyphens may separate its units.

    >>> unit_system("mm-t-s").force
    1.0
    """
    words = " ".join(str(name).replace("-", " ").replace(",", " ").replace("_", " ").split())
    refuse_if(
        words not in UNIT_SYSTEMS,
        where,
        got=f"'{name}'",
        expected=f"one of: {', '.join(UNIT_SYSTEMS)}",
        hint="use 'mm t s' for a model in mm, N and MPa, 'm kg s' for one in SI.",
    )
    return UNIT_SYSTEMS[words]


def _read(value: Any) -> UnitSystem:
    from klack.input.problem import CaseProblem

    if isinstance(value, UnitSystem):
        return value
    try:
        return unit_system(value)
    except InputError as error:
        raise CaseProblem((), got=error.got, expected=error.expected, hint=error.hint) from None


UnitSystemName = Annotated[
    UnitSystem,
    BeforeValidator(_read),
    WithJsonSchema({"type": "string", "enum": list(UNIT_SYSTEMS)}),
]
"""Field with the name of a unit system."""
