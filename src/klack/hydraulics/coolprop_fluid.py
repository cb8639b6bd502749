"""Pure fluids from the equations of state of CoolProp, ``CoolProp:n-Dodecane``; an optional extra.

The equation of state is tabulated once along the isentrope that starts at the temperature of the
run and one atmosphere (or just above the vapour pressure, where that is higher), up to 2500 bar or
the end of the equation, as :class:`~klack.hydraulics.property_table.CompressedLiquid`.  The
viscosity is one exponential over pressure, least squares up to 350 bar at constant temperature, as
for the pure fluids of the library.

Limits: pure fluids; no freezing under pressure; the viscosity above 350 bar, see
:mod:`~klack.hydraulics.pressure_viscosity`.
Source: Bell, Wronski, Quoilin and Lemort, Ind. Eng. Chem. Res. 53 (2014) 2498.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from klack.errors import InputError, MissingExtraError, refuse_if
from klack.hydraulics.fluid_definition import FluidDefinition, FluidState
from klack.hydraulics.liquid import ATMOSPHERE
from klack.hydraulics.property_table import CompressedLiquid
from klack.materials.sourced import Constant

__all__ = ["coolprop_fluid", "is_coolprop_name"]

_PREFIX = "coolprop:"
_TOP = 2500e5  # [Pa]
_LEAST = 100e5  # [Pa] up to which an equation must hold to be of use
_POINTS = 80
_VISCOUS_TOP = 350e5  # [Pa]
_ABOVE_BOILING = 1.02
_HIGHEST_SHARE = 0.95  # of the critical temperature, above which it is hardly a liquid


def is_coolprop_name(name: str) -> bool:
    """Whether a name asks for a fluid of CoolProp.

    Examples
    --------
    >>> is_coolprop_name("CoolProp:n-Dodecane"), is_coolprop_name("n-dodecane")
    (True, False)
    """
    return name.lower().startswith(_PREFIX)


def coolprop_fluid(name: str) -> FluidDefinition:
    """Fluid of a name ``CoolProp:FLUID``, with the spelling of CoolProp.

    Raises
    ------
    MissingExtraError
        Without CoolProp.
    InputError
        For a fluid that it does not have, or not with a viscosity.
    """
    state = _state(name)
    import CoolProp

    return FluidDefinition(
        name=name,
        properties=EquationOfState(name=name),
        constants=(
            Constant(
                label="equation of state and viscosity",
                value=float(state.molar_mass()),
                unit="kg/mol",
                source=f"CoolProp {CoolProp.__version__}, {name.partition(':')[2].strip()}",
                verified=True,
            ),
        ),
        lowest_temperature=float(state.Tmin()),
        highest_temperature=min(float(state.Tmax()), _HIGHEST_SHARE * float(state.T_critical())),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class EquationOfState:
    """Properties of a fluid of CoolProp; ``name`` has the prefix."""

    name: str

    def at(self, temperature: float) -> FluidState:
        """Properties at a temperature [K], along its isentrope."""
        return _tabulated(self.name, temperature)


def _state(name: str) -> Any:
    try:
        import CoolProp
    except ImportError as error:
        raise MissingExtraError("CoolProp", f"The fluid '{name}'", "coolprop") from error
    fluid = name.partition(":")[2].strip()
    try:
        return CoolProp.AbstractState("HEOS", fluid)
    except ValueError:
        raise InputError(
            "fluid: name",
            got=f"'{name}'",
            expected="CoolProp: and a pure fluid as CoolProp spells it",
            hint="e.g. CoolProp:n-Heptane, CoolProp:n-Dodecane or CoolProp:Water.",
        ) from None


@lru_cache(maxsize=50)
def _tabulated(name: str, temperature: float) -> FluidState:
    """State of the fluid; some 160 evaluations of the equation."""
    import CoolProp

    state = _state(name)
    state.update(CoolProp.QT_INPUTS, 0.0, temperature)
    boiling = float(state.p())
    state.update(CoolProp.QT_INPUTS, 1.0, temperature)
    vapour = float(state.rhomass())
    start = max(ATMOSPHERE, _ABOVE_BOILING * boiling)
    state.update(CoolProp.PT_INPUTS, start, temperature)
    entropy = float(state.smass())
    top = min(_TOP, float(state.pmax()))
    pressure, density, fall = [], [], []
    for p in start + (top - start) * np.linspace(0.0, 1.0, _POINTS) ** 2:
        try:
            state.update(CoolProp.PSmass_INPUTS, float(p), entropy)
            rho, c = float(state.rhomass()), float(state.speed_sound())
        except ValueError:  # the equation ends here, and so does the range
            break
        pressure.append(float(p))
        density.append(rho)
        fall.append(1.0 / (rho * c * c))
    refuse_if(
        not pressure or pressure[-1] < _LEAST,
        f"fluid '{name}': temperature",
        got=f"{temperature - 273.15:g} degC, where its equation of state does not extend to "
        f"{_LEAST / 1e5:g} bar",
        expected="a liquid",
        hint="choose another temperature or fluid.",
    )
    base, slope = _viscosity(state, name, temperature, start)
    return FluidState(
        liquid=CompressedLiquid(name, pressure, density[0], fall),
        viscosity=base,
        pressure_viscosity=slope,
        vapour_pressure=boiling,
        vapour_density=vapour,
    )


def _viscosity(state: Any, name: str, temperature: float, start: float) -> tuple[float, float]:
    import CoolProp

    pressure = np.linspace(start, _VISCOUS_TOP, 20)
    values = []
    for p in pressure:
        try:
            state.update(CoolProp.PT_INPUTS, float(p), temperature)
            values.append(float(state.viscosity()))
        except ValueError:
            raise InputError(
                "fluid: name",
                got=f"'{name}', of which CoolProp has no viscosity at "
                f"{temperature - 273.15:g} degC and {p / 1e5:.4g} bar",
                expected="a fluid with a viscosity",
                hint="write its properties to a file and give the file as table.",
            ) from None
    slope, base = np.polyfit(pressure - ATMOSPHERE, np.log(values), 1)
    return float(np.exp(base)), float(slope)
