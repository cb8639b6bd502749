"""Where within a piece an event lies: false position, halving the value of the end that stays.

Source: Dowell and Jarratt, BIT 11 (1971) 168, the Illinois rule.
"""

from klack.machine.compiling.jit import inner

__all__ = ["LOCATED", "between", "narrowed"]

LOCATED = 1e-12
"""Share of the current, and of the piece, to which instants within a step are found."""


@inner(error_model="numpy", forceinline=True)
def between(low: float, high: float, f_low: float, f_high: float, length: float) -> float:
    """Zero of the straight line through both ends of the bracket, within it."""
    guess = (low * f_high - high * f_low) / (f_high - f_low)
    return min(max(guess, low + 1e-3 * LOCATED * length), high)


@inner(error_model="numpy", forceinline=True)
def narrowed(
    low: float, high: float, f_low: float, f_high: float, side: int, size: float, f: float
) -> tuple[float, float, float, float, int]:
    """Both ends, their values, and which end ``f`` at ``size`` replaced (1 high, -1 low).

    The value of an end that stays twice is halved, so that it moves too.
    """
    if f * f_high > 0.0:
        return low, size, 0.5 * f_low if side == 1 else f_low, f, 1
    return size, high, f, 0.5 * f_high if side == -1 else f_high, -1
