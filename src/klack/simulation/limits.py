"""Ranges of laws while a network runs: a departure is warned of once, a gross one stops the run.

Only records are looked at, not steps: an excursion shorter than a record may be missed.
"""

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Matrix, Vector
from klack.errors import AccuracyWarning, ConvergenceError
from klack.network.ranges import limits_of, range_text, value_text
from klack.network.rows import LimitRow
from klack.simulation.network_compile import CompiledNetwork
from klack.units import format_si

__all__ = ["Limits"]


@dataclass(frozen=True, slots=True)
class _Watched:
    """A limit, and the columns of the records that its quantity is a sum of."""

    limit: LimitRow
    columns: NDArray[np.int64]
    weights: Vector

    def values(self, points: Matrix) -> Vector:
        """Quantity in some records, shape (n,)."""
        if self.columns.size == 1:
            return self.limit.start + points[:, self.columns[0]] * self.weights[0]
        return np.asarray(self.limit.start + points[:, self.columns] @ self.weights)


class Limits:
    """Watches all ranges of a network.

    Parameters
    ----------
    columns
        Names of the recorded columns: see :func:`klack.simulation.network_record.record_points`.
    """

    def __init__(self, network: CompiledNetwork, columns: list[str]) -> None:
        self._told: set[str] = set()
        ports = len(network.ports)
        pressures = 2 * ports + sum(row.body.rigid_count > 0 for row in network.rows.bodies)
        self._watched: list[_Watched] = []
        for limit in limits_of(network.rows):
            weights = np.zeros(len(columns))
            for handle, factor in limit.ports:
                place = network.port_of[handle]
                if place < ports:  # the last one is the ground
                    weights[place] += factor
            if limit.node is not None:
                weights[pressures + network.node_order.index(limit.node)] = 1.0
            if limit.channel:
                weights[columns.index(limit.channel)] = 1.0
            used = np.flatnonzero(weights)
            self._watched.append(_Watched(limit, used, weights[used]))

    def left(self, points: Matrix, time: Vector) -> tuple[int, ConvergenceError] | None:
        """First record in which a quantity has left what can be computed with, and the error."""
        found: tuple[int, ConvergenceError] | None = None
        for watched in self._watched:
            limit, values = watched.limit, watched.values(points)
            low, high = limit.usable
            gone = np.flatnonzero((values <= low) | (values > high))
            if gone.size and (found is None or gone[0] < found[0]):
                place = int(gone[0])
                found = place, _stop(limit, float(values[place]), float(time[place]))
        return found

    def tell(self, points: Matrix, time: Vector) -> None:
        """Warn of ranges that are left in some records, once for each law."""
        for watched in self._watched:
            limit, values = watched.limit, watched.values(points)
            if limit.at_start and time[0] > 0.0:
                continue
            low, high = limit.valid[0] - limit.slack, limit.valid[1] + limit.slack
            out = np.flatnonzero((values < low) | (values > high))
            if out.size and limit.law not in self._told:
                self._told.add(limit.law)
                warnings.warn(_warning(limit, values, time, int(out[0])), AccuracyWarning, 3)


def _warning(limit: LimitRow, values: Vector, time: Vector, first: int) -> str:
    low, high = limit.valid
    beyond = np.maximum(low - values, values - high)
    worst = int(np.nanargmax(beyond))
    furthest = value_text(float(values[worst]), limit.unit)
    begins = value_text(float(values[first]), limit.unit)
    if begins != furthest:
        furthest = f"{begins}, later {furthest}"
    return (
        f"'{limit.component}': {_when(float(time[first]), 4)} the {limit.quantity} leaves "
        f"the range of {limit.law}, {range_text(limit)}: it is {furthest}. "
        f"{limit.effect(float(values[worst]))}\nTry: {limit.advice}"
    )


def _when(time: float, digits: int) -> str:
    return f"at {format_si(time, 's', digits)}" if time > 0.0 else "at the start"


def _stop(limit: LimitRow, value: float, time: float) -> ConvergenceError:
    return ConvergenceError(
        f"{limit.component}: the {limit.quantity} is {value_text(value, limit.unit)} "
        f"{_when(time, 6)}, far outside the range of {limit.law}, {range_text(limit)}.\n"
        f"Try: {limit.advice}"
    )
