"""One comparison of a computed number with a known one."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # the command line names the groups and must start quickly
    import numpy as np
    from numpy.typing import NDArray

__all__ = ["LARGEST_HEADROOM", "Check", "ComparedCurve", "compare"]

LARGEST_HEADROOM = 100.0
"""A tolerance that is more than so many times the deviation needs a reason."""

_UNIT = re.compile(r"\[([^\[\]]+)\]$")

_ROUND_OFF = 1e-15  # a few units in the last place; no deviation counts for less


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ComparedCurve:
    """The whole curve of which a check compares one number.

    Parameters
    ----------
    x_label, y_label : str
        With the unit: ``"time [us]"``.
    expected : tuple of two arrays, shapes (n,)
        Abscissae and values of the known curve (few points where a table is quoted).
    computed : tuple of two arrays, shapes (m,)
        The same of klack, on its own abscissae.
    x_log, y_log : bool
    """

    x_label: str
    y_label: str
    expected: tuple[NDArray[np.float64], NDArray[np.float64]]
    computed: tuple[NDArray[np.float64], NDArray[np.float64]]
    x_log: bool = False
    y_log: bool = False


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
    reason : str
        Why the tolerance is as wide as it is, where :attr:`headroom` is above
        :data:`LARGEST_HEADROOM`: the digits of a printed table, the scatter of a standard.
    curve : ComparedCurve, optional
        Where the number belongs to a curve; several checks may share one object.
    is_absolute : bool
        Whether ``deviation`` has the unit of the numbers.
    """

    group: str
    name: str
    expected: float
    computed: float
    deviation: float
    tolerance: float
    source: str
    reason: str = ""
    curve: ComparedCurve | None = None
    is_absolute: bool = False

    @property
    def passed(self) -> bool:
        """True when the deviation is within the tolerance (nan fails)."""
        return bool(abs(self.deviation) <= self.tolerance)

    @property
    def unit(self) -> str:
        """Unit in brackets at the end of the name; empty for pure numbers.

        >>> compare("a", "time [s]", expected=1, computed=1, tolerance=0, source="").unit
        's'
        """
        found = _UNIT.search(self.name)
        return "" if found is None or found[1] == "-" else found[1]

    @property
    def deviation_unit(self) -> str:
        """``"relative"``, the unit of an absolute deviation, or else ``"absolute"``."""
        if not self.is_absolute or "relative" in self.name or " over " in self.unit:
            return "relative"
        return self.unit or "absolute"

    @property
    def headroom(self) -> float:
        """Ratio of the tolerance to the present deviation.

        Deviations below round-off count as round-off; nan for a check that did not run.
        """
        return float(self.tolerance / max(abs(self.deviation), _ROUND_OFF))

    @property
    def is_wide(self) -> bool:
        """True where :data:`LARGEST_HEADROOM` is passed without a reason."""
        return self.headroom > LARGEST_HEADROOM and not self.reason


def compare(
    group: str,
    name: str,
    expected: float,
    computed: float,
    tolerance: float,
    source: str,
    curve: ComparedCurve | None = None,
    *,
    absolute: bool = False,
    reason: str = "",
) -> Check:
    """Build a :class:`Check`; relative unless ``absolute`` or the expected value is zero.

    A group with many checks names itself once: ``_check = partial(compare, GROUP)``.
    """
    difference = computed - expected
    is_absolute = absolute or expected == 0
    deviation = difference if is_absolute else difference / abs(expected)
    return Check(
        group=group,
        name=name,
        expected=float(expected),
        computed=float(computed),
        deviation=float(deviation),
        tolerance=tolerance,
        source=source,
        reason=reason,
        curve=curve,
        is_absolute=is_absolute,
    )
