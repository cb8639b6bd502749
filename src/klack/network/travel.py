"""How far the stops let the bodies of a network go: before any time passes."""

from collections.abc import Iterable
from math import inf

import numpy as np
from scipy.optimize import linprog

from klack.network.rows import GROUND, Rows

__all__ = ["Travel"]


class Travel:
    r"""Greatest and smallest value of a sum of displacements that no stop forbids.

    Rigid bodies along one axis, each with one displacement :math:`y_b`; held ones and the ground
    stay.  Every contact that has a law keeps its gap open,
    :math:`g_0 + y_\text{upper} - y_\text{lower} \ge 0`, which leaves a linear programme; a chain of
    bodies that push each other is therefore one stop for all of them.

    Limits: contacts as rigid, without tilt; springs and films stop nothing.

    Parameters
    ----------
    rows : Rows
    """

    def __init__(self, rows: Rows) -> None:
        free = [row for row in rows.bodies if row.body.rigid_count > 0]
        self._body = {handle: i for i, row in enumerate(free) for handle in row.ports}
        self._names: list[str] = []
        self._gaps: list[float] = []
        coefficients: list[np.ndarray] = []
        for row in rows.interfaces:
            closing = self._sum([(row.lower, 1.0), (row.upper, -1.0)], len(free))
            if row.law is not None and np.any(closing):
                self._names.append(row.component)
                self._gaps.append(row.gap)
                coefficients.append(closing)
        self._closing = np.array(coefficients).reshape(-1, len(free))

    def _sum(self, ports: Iterable[tuple[int, float]], count: int) -> np.ndarray:
        """Coefficients over the displacements of the free bodies."""
        total = np.zeros(count)
        for port, factor in ports:
            body = self._body.get(port) if port != GROUND else None
            if body is not None:
                total[body] += factor
        return total

    def highest(self, ports: Iterable[tuple[int, float]]) -> tuple[float, tuple[str, ...]]:
        """Greatest ``sum(factor * displacement)`` and the stops that bound it.

        Parameters
        ----------
        ports : iterable of (int, float)
            Handle of a port and its factor.

        Returns
        -------
        float
            Infinity where no stop bounds it.
        tuple of str
            Components, in their order.
        """
        wanted = self._sum(ports, self._closing.shape[1])
        if not np.any(wanted):
            return 0.0, ()
        if not self._gaps:
            return inf, ()
        scale = max(max(self._gaps), 1e-6)  # lengths of a valve are below the solver's tolerance
        found = linprog(
            -wanted / np.abs(wanted).max(),
            A_ub=self._closing,
            b_ub=np.array(self._gaps) / scale,
            bounds=(None, None),
        )
        if found.fun is None or found.status != 0:
            return inf, ()
        bounding = np.abs(found.ineqlin.marginals) > 1e-9
        names = tuple(name for name, is_met in zip(self._names, bounding, strict=True) if is_met)
        return float(-found.fun * scale * np.abs(wanted).max()), names

    def lowest(self, ports: Iterable[tuple[int, float]]) -> tuple[float, tuple[str, ...]]:
        """Smallest ``sum(factor * displacement)`` and the stops; minus infinity without."""
        value, names = self.highest([(port, -factor) for port, factor in ports])
        return -value, names
