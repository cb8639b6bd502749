"""One comparison of a computed number with a known one."""

from dataclasses import dataclass

__all__ = ["Check", "compare"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """A verdict that anyone can recompute.

    Parameters
    ----------
    group, name : str
        Domain (``"elasticity"``) and what is compared (one line, with the unit).
    expected, computed : float
    deviation : float
        Relative to ``expected``, or absolute where ``expected`` is zero or ``absolute`` was asked.
    tolerance : float
        Largest accepted magnitude of ``deviation``.
    source : str
        Author, year, equation or table; or the closed formula.
    """

    group: str
    name: str
    expected: float
    computed: float
    deviation: float
    tolerance: float
    source: str

    @property
    def passed(self) -> bool:
        """True when the deviation is within the tolerance (nan fails)."""
        return bool(abs(self.deviation) <= self.tolerance)


def compare(
    group: str,
    name: str,
    *,
    expected: float,
    computed: float,
    tolerance: float,
    source: str,
    absolute: bool = False,
) -> Check:
    """Build a :class:`Check`; relative unless ``absolute`` or the expected value is zero."""
    difference = computed - expected
    deviation = difference if absolute or expected == 0 else difference / abs(expected)
    return Check(
        group=group,
        name=name,
        expected=float(expected),
        computed=float(computed),
        deviation=float(deviation),
        tolerance=tolerance,
        source=source,
    )
