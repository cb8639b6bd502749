"""Progress reports of a long step."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # numpy takes a quarter of a second
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "PointCount",
    "Progress",
    "SoFar",
    "StageProgress",
    "counted",
    "drawn",
    "duration_text",
    "per_hour",
    "remark",
    "silent",
]

Progress = Callable[[str, float], None]
"""Called with stage and fraction, 0 to 1."""


def remark(progress: Progress, line: str) -> None:
    """Show a line with the progress, if the reporter has ``remark``."""
    show = getattr(progress, "remark", None)
    if show is not None:
        show(line)


@dataclass(frozen=True, kw_only=True)
class PointCount:
    """Progress of an evaluation of points.

    Parameters
    ----------
    left [s]
        At the rate so far; None before there is one.
    best
        The best point so far, in words; empty without one.
    """

    done: int
    most: int
    left: float | None = None
    best: str = ""


def counted(progress: Progress, count: PointCount) -> None:
    """Show done points, if the reporter has ``counted``."""
    show = getattr(progress, "counted", None)
    if show is not None:
        show(count)


@dataclass(frozen=True, kw_only=True, eq=False)
class SoFar:
    """A curve of work that is not at its end.

    Parameters
    ----------
    title
        What is drawn, with its unit; curves of one title share a chart.
    x, y (n,)
        In the units of the labels.
    x_label
        With its unit.
    name
        Of the curve in its chart.
    dots
        Points without a line.
    """

    title: str
    x: "NDArray[np.float64]"
    y: "NDArray[np.float64]"
    x_label: str
    name: str = ""
    dots: bool = False


def drawn(progress: object, curves: Callable[[], Sequence[SoFar]]) -> None:
    """Draw curves so far, if the reporter has ``drawn``; it makes them once a second at most."""
    draw = getattr(progress, "drawn", None)
    if draw is not None:
        draw(curves)


class StageProgress:
    """Progress of one stage, called with its fraction; what is drawn goes to the same reporter."""

    def __init__(self, progress: Progress, stage: str) -> None:
        self._progress, self._stage = progress, stage

    def __call__(self, fraction: float) -> None:
        """Report it of the stage."""
        self._progress(self._stage, fraction)

    def drawn(self, curves: Callable[[], Sequence[SoFar]]) -> None:
        """See :func:`drawn`."""
        drawn(self._progress, curves)


def silent(stage: str, fraction: float) -> None:
    """No progress report."""


def per_hour(rate: float) -> str:
    """How many in an hour, at a rate per second, to three digits and without a power of ten.

    >>> per_hour(2.4391), per_hour(0.00214)
    ('8 780 in an hour', '7.7 in an hour')
    """
    found = float(f"{3600.0 * rate:.3g}")
    text = f"{found:,.0f}".replace(",", " ") if found >= 100.0 else f"{found:g}"
    return f"{text} in an hour"


def duration_text(seconds: float) -> str:
    """``1 h 40 min``, ``5 min``, ``40 s``: to two digits or so."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"
