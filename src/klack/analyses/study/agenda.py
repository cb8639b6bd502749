"""Points that are left, in an order that keeps those with the same bodies at the same worker."""

from collections import deque
from collections.abc import Sequence

__all__ = ["Agenda"]


class Agenda:
    """Hands points out.

    A worker gets the next points of the bodies that it has; then bodies that no worker has begun
    with; then those that others have begun with the longest ago.

    Parameters
    ----------
    groups : sequence of sequence of int
        Places of the points that share their bodies.
    """

    def __init__(self, groups: Sequence[Sequence[int]]) -> None:
        self._groups = [deque(group) for group in groups]
        self._open = deque(range(len(groups)))
        self._last: dict[object, int] = {}
        self.left = sum(map(len, self._groups))

    def take(self, worker: object = None, most: int = 1) -> tuple[int, ...]:
        """Next points for a worker, all with the same bodies; none if no point is left.

        Parameters
        ----------
        worker : object
            Compared with those of other calls; None for one that has no bodies yet.
        most : int
            Points at a time.
        """
        group = self._group_for(worker)
        if group is None:
            return ()
        if worker is not None:
            self._last[worker] = group
        left = self._groups[group]
        taken = tuple(left.popleft() for _ in range(min(most, len(left))))
        self.left -= len(taken)
        return taken

    def _group_for(self, worker: object) -> int | None:
        last = self._last.get(worker)
        if last is not None and self._groups[last]:
            return last
        while self._open:
            group = self._open.popleft()
            if self._groups[group]:
                self._open.append(group)
                return group
        return None
