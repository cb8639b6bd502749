"""Texts of checks for the terminal and the page."""

from collections.abc import Sequence
from math import isfinite

from klack.verification.check import Check

__all__ = ["deviation_text", "headroom_text", "number_text", "summary", "tolerance_text"]


def summary(checks: Sequence[Check]) -> str:
    """Number of passed checks, and of wide tolerances without a reason."""
    passed = sum(check.passed for check in checks)
    wide = sum(check.is_wide for check in checks)
    return f"{passed} of {len(checks)} checks passed" + (
        f"; {wide} with a tolerance that is wide without a reason" if wide else ""
    )


def number_text(value: float) -> str:
    """Six digits, or ``none`` where there is no number."""
    return f"{value:.6g}" if isfinite(value) else "none"


def deviation_text(check: Check) -> str:
    """With sign, and with what it is: ``+1.2e-06 relative``, ``-3.0e-09 m``.

    >>> from klack.verification.check import compare
    >>> deviation_text(compare("a", "gap [m]", expected=0, computed=1e-9, tolerance=1, source=""))
    '+1.0e-09 m'
    """
    if not isfinite(check.deviation):
        return "none"
    value = f"{check.deviation:+.1e}" if check.deviation else "0"
    return f"{value} {check.deviation_unit}"


def tolerance_text(check: Check) -> str:
    """Largest accepted deviation, in the unit of the deviation."""
    return f"{check.tolerance:.1e}" if check.tolerance else "0"


def headroom_text(check: Check) -> str:
    """Tolerance over deviation, two digits: ``x 3.2``; ``exact`` where neither is above zero."""
    if not isfinite(check.headroom):
        return "none"
    if check.tolerance == 0:
        return "exact" if check.passed else "none"
    if check.headroom < 1000:
        return f"x {check.headroom:.2g}" if check.headroom < 100 else f"x {check.headroom:.0f}"
    return f"x {check.headroom:.0e}"
