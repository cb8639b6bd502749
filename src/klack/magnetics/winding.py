"""The winding of a coil."""

from typing import Annotated

from pydantic import AfterValidator

from klack.errors import require_positive
from klack.input.problem import refuse_key_if
from klack.units import Temperature

__all__ = [
    "COPPER_COEFFICIENT",
    "REFERENCE_TEMPERATURE",
    "WindingTemperature",
    "warm_resistance",
]

COPPER_COEFFICIENT = 3.93e-3
"""Relative rise of the resistance of copper [1/K] from 20 degC (IEC 60028)."""

REFERENCE_TEMPERATURE = 293.15
"""20 degC [K]: where resistances are given."""

_COLDEST, _MELTS = 73.15, 1357.77  # [K] copper follows its coefficient; ITS-90


def _of_copper(temperature: float) -> float:
    refuse_key_if(
        not _COLDEST <= temperature <= _MELTS,
        (),
        got=f"{temperature - 273.15:.4g} degC",
        expected="-200 degC, below which copper does not follow its coefficient, to 1085 degC, "
        "where it melts",
        hint="check the sign and the unit.",
    )
    return temperature


WindingTemperature = Annotated[Temperature, AfterValidator(_of_copper)]
"""Temperature [K] at which a winding of copper has its resistance."""


def warm_resistance(resistance: float, temperature: float) -> float:
    """Resistance [ohm] of a copper winding at a temperature [K], from that at 20 degC.

    Examples
    --------
    >>> round(warm_resistance(10.0, 393.15), 3)
    13.93
    """
    warm = resistance * (1.0 + COPPER_COEFFICIENT * (temperature - REFERENCE_TEMPERATURE))
    require_positive("winding: resistance at its temperature", warm, "ohm")
    return warm
