"""Forces and gaps of the stops of bodies that meet point by point, in the words of the network."""

from collections.abc import Mapping, Sequence

import numpy as np

from klack.arrays import Matrix, Vector
from klack.simulation.network_arrays import Recording, Scratch
from klack.simulation.network_compile import CompiledNetwork
from klack.transient.interface_arrays import Record
from klack.transient.interface_model import InterfaceModel
from klack.transient.ring_arcs import ArcWatch

__all__ = ["StopRecord"]


class StopRecord:
    """What a macro step tells of each stop.

    Parameters
    ----------
    network : CompiledNetwork
    model : InterfaceModel
    ports : array, shape (M, ports)
        Shapes of the ports of the bodies.
    rows : sequence of int
        Interface of the network at each of ``model.contacts``.
    films : mapping of int to int
        Place among the recorded films of an interface that has one.
    arcs : ArcWatch or None
    step : float [s]
        Fine step.

    Attributes
    ----------
    side : array, shape (contacts,)
        1 where the force on the needle is upwards, -1 where downwards.
    closed : array, shape (contacts,)
        Fine step since which a stop is closed; nan while open.
    force : array, shape (contacts,) [N]
        Axial force of the last step.
    """

    def __init__(
        self,
        network: CompiledNetwork,
        model: InterfaceModel,
        ports: Matrix,
        rows: Sequence[int],
        films: Mapping[int, int],
        arcs: ArcWatch | None,
        step: float,
    ) -> None:
        self._network, self._model, self._ports = network, model, ports
        self._rows, self._films, self._arcs, self._step = rows, films, arcs, step
        self.closed, self.force = np.full(len(rows), np.nan), np.zeros(len(rows))
        axial = [model.axial[first:last] for _, first, last in model.contacts]
        self.side = np.array([np.sign(np.sum(part)) for part in axial])
        # gap per gap along the axis, of cones
        self._slope = np.array([np.mean(np.abs(part)) for part in axial])

    def tell(
        self,
        c: int,
        recording: Recording,
        scratch: Scratch,
        record: Record,
        t: float,
        h: float,
        q: Vector,
        lam: Vector,
        gap0: Vector,
        *,
        points: bool,
    ) -> None:
        """Take in the steps of contact ``c`` in a record from ``t`` on, of length ``h`` [s].

        ``q``, ``lam``, ``gap0``: modes, forces and gaps of the points at its end; ``points``:
        whether points were looked at.
        """
        network, row = self._network, self._rows[c]
        state, faces = network.interface_state, network.interfaces
        first = int(network.elements.port0[network.elements.rows]) + network.branches.rows
        here = slice(*self._model.contacts[c][1:])
        y, lam = np.append(self._ports.T @ q, 0.0), lam[here]
        state.gap[row] = faces.gap0[row] + y[faces.upper[row]] - y[faces.lower[row]]
        film = self._films.get(row)
        pressed = np.zeros(len(record.force)) if film is None else record.film[:, film]
        scratch.sums[first + 2 * row + 1] += h * float(np.sum(pressed))
        of_pressure = record.pressed if len(record.pressed) else record.force
        force = np.where(self.side[c] * of_pressure > 0.0, self.side[c] * record.force, 0.0)
        acted = np.append(force > 0.0, False)
        told = acted.copy()
        told[1:] |= acted[:-1]  # a step without force ends a contact
        told[-1] &= not np.any(lam > 0.0)
        told[:-1] |= np.abs(pressed) > faces.film_felt[row]
        if self._arcs is not None:
            self._arcs.see(c, float(force[-1]), lam)
        if points:
            self.force[c] = force[-1]
            if not np.any(lam > 0.0):
                self.closed[c] = np.nan
            elif np.isnan(self.closed[c]):
                self.closed[c] = round(t / self._step)
        rows = np.flatnonzero(told)
        if not len(rows):
            return
        place = int(recording.filled[row])
        end = min(place + len(rows), recording.fine.shape[1])
        some, into = rows[: end - place], recording.fine[row, place:end]
        gap0, traces = gap0[here], self._model.traces[here]
        gaps = record.gap
        if not points:
            gaps = np.min(gap0 + record.places @ traces.T, axis=1)
        smallest = float(np.min(gap0 + traces @ q))
        into[:, 0], into[:, 1] = t + some * h, h
        into[:, 2] = np.append(force, 0.0)[some]
        into[:, 3] = np.append(pressed, 0.0)[some]
        into[:, 4] = np.append(gaps, smallest)[some] / self._slope[c]
        into[:, 5] = np.nan
        recording.filled[row] = place + len(rows)
        scratch.sums[first + 2 * row] += h * float(np.sum(force))
        scratch.peaks[row] = max(float(scratch.peaks[row]), float(force.max()))
