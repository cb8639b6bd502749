"""The winding of a coil."""

from klack.errors import require_positive

__all__ = ["COPPER_COEFFICIENT", "REFERENCE_TEMPERATURE", "warm_resistance"]

COPPER_COEFFICIENT = 3.93e-3
"""Relative rise of the resistance of copper [1/K] from 20 degC (IEC 60028)."""

REFERENCE_TEMPERATURE = 293.15
"""20 degC [K]: where resistances are given."""


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
