"""Points while they come: kept, counted, told."""

import warnings
from collections.abc import Callable

from klack.analyses.study.point_row import PointRow
from klack.closing import Closing
from klack.progress import Progress
from klack.stages import show

__all__ = ["Tally"]

_STAGE = "points"


class Tally(Closing):
    """Hands rows on as they come, and shows their warnings at the end, each once.

    Parameters
    ----------
    whole : int
        Points of the study.
    wanted : int
        Of them, those that are not known yet.
    keep : callable
        Gets the place of a point and its row.
    progress : callable
    """

    def __init__(
        self,
        whole: int,
        wanted: int,
        keep: Callable[[int, PointRow], None],
        progress: Progress,
    ) -> None:
        self._whole, self._done = whole, whole - wanted
        self._keep, self._progress = keep, progress
        self._others: dict[str, warnings.WarningMessage] = {}

    def __call__(self, place: int, row: PointRow) -> None:
        """Take the row of a point."""
        self._keep(place, row)
        self._done += 1
        self._others.update({str(item.message): item for item in row.others})

    def tell(self) -> None:
        """Report the share of the points that are done."""
        self._progress(_STAGE, self._done / self._whole)

    def close(self) -> None:
        """Show the warnings that are no doubts about numbers."""
        show(self._others.values())
