"""Compiled parts of a macro step of bodies that meet point by point, beside their fine steps."""

from typing import NamedTuple

import numpy as np

from klack.arrays import Cube, Index, Matrix, Vector
from klack.machine.compiling.jit import FAST, njit
from klack.simulation.network_arrays import AHEAD, BEGIN, GUESS, MISSED, Y1
from klack.transient.interface_arrays import DEBT, GUIDE, Record

__all__ = ["StopRows", "StopState", "film_changes", "repair", "tell_stops"]


_LITTLE = 0.1  # of the height of a film counts where it has no force yet
_BEARING = 0.25  # as much as this counts a change in the guide, whose film damps motion out


@njit(_nrt=False, error_model="numpy", fastmath=FAST)
def film_changes(
    rows: Cube,
    offset: Matrix,
    lowest: Vector,
    reach: Vector,
    room: Vector,
    inertia: Vector,
    films: Matrix,
    shaft: Matrix,
    across: Cube,
    q: Vector,
    v: Vector,
    H: float,
) -> float:
    """Largest change of the height of a film over a macro step, over what is left of it.

    Parameters
    ----------
    rows, offset, lowest, reach, room, films
        Of :class:`klack.transient.interface_arrays.Films` and ``State``.
    inertia (k,) [1/kg]
        Inverse of the one that the lift of each film moves.
    shaft, across
        ``offset`` and ``traces`` of the guide.
    H [s]
    """
    most = 0.0
    for k in range(len(lowest)):
        lift, rise, x, y = offset[k, 0], 0.0, 0.0, 0.0
        for i in range(len(q)):
            lift += rows[k, 0, i] * q[i]
            rise += rows[k, 0, i] * v[i]
            x += rows[k, 1, i] * v[i]
            y += rows[k, 2, i] * v[i]
        lift = max(lift, 0.0) + lowest[k]
        way = abs(rise) + reach[k] * np.sqrt(x * x + y * y)
        # work of the film over its height, of the kinetic energy: errors of the force,
        # second order in the change of height, act on so much of the motion
        work, felt = 2.0 * abs(films[k, 0]) * lift * inertia[k], 1.0
        if way > 0.0:
            felt = min(1.0, max(work / way**2, _LITTLE**2))
        most = max(most, np.sqrt(felt) * way * H / lift)
    for k in range(len(room)):
        x, y, along, aside = shaft[k, 0], shaft[k, 1], 0.0, 0.0
        for i in range(len(q)):
            x += across[k, 0, i] * q[i]
            y += across[k, 1, i] * q[i]
            along += across[k, 0, i] * v[i]
            aside += across[k, 1, i] * v[i]
        way = np.sqrt(along * along + aside * aside)
        most = max(most, _BEARING * way * H / (room[k] - np.sqrt(x * x + y * y)))
    return most


@njit(_nrt=False, error_model="numpy", fastmath=FAST)
def repair(
    omega: Vector,
    B1: Vector,
    B2: Vector,
    P: Matrix,
    at: Vector,
    push: Vector,
    q: Vector,
    v: Vector,
    lam: Vector,
    traces: Matrix,
    guided: Matrix,
    across: Cube,
    books: Vector,
    dq: Vector,
) -> float:
    """Let what was missed act; the energy that bodies got beyond what was given to them [J].

    Parameters
    ----------
    omega, B1, B2, q, v (M,)
        Modes, their response to a force over the step, and their state, changed in place.
    P (M, ports)
        Shapes of the ports.
    at
        Rows of the network.
    push (M,)
        Forces across the axis.
    lam, traces
        Contact forces and rows of the points.
    guided, across
        Forces of the guide and ``traces`` of its heights.
    dq (M,)
        Out: what the modes are moved by.
    """
    energy, ports = 0.0, P.shape[1]
    for i in range(len(q)):
        kick = 0.0
        for p in range(ports):
            kick += P[i, p] * at[MISSED + p]
        dq[i] = B1[i] * kick
        dv, square = B2[i] * kick, omega[i] * omega[i]
        energy += square * q[i] * dq[i] + v[i] * dv
        energy += 0.5 * (square * dq[i] * dq[i] + dv * dv) - push[i] * dq[i]
        q[i] += dq[i]
        v[i] += dv
    contact, held = 0.0, 0.0
    for k in range(len(lam)):
        if lam[k] > 0.0:
            moved = 0.0
            for i in range(len(dq)):
                moved += traces[k, i] * dq[i]
            contact += lam[k] * moved
    for k in range(len(guided)):
        for c in range(2):
            if guided[k, c] != 0.0:
                moved = 0.0
                for i in range(len(dq)):
                    moved += across[k, c, i] * dq[i]
                held += guided[k, c] * moved
    books[DEBT] += 0.5 * contact
    books[GUIDE] -= held
    for p in range(ports):
        way = at[Y1 + p] - at[BEGIN + p]
        energy -= at[MISSED + p] * (way + at[AHEAD + p]) + at[GUESS + p] * at[AHEAD + p]
    return energy - contact - held


class StopRows(NamedTuple):
    """Stops as the network has them, and their contact points."""

    row: Index  # (c,) interface of the network
    span: Index  # (c, 2) first point, and the one behind the last
    film: Index  # (c,) place among the recorded films, -1 without
    side: Vector  # (c,) sign of the axial force of a contact that is pressed
    slope: Vector  # (c,) gap per gap along the axis, of cones
    felt: Vector  # (c,) [N] from which on a film is felt
    upper: Index  # (c,) ports of the network
    lower: Index  # (c,)
    traces: Matrix  # (n, M)
    ports: Matrix  # (M, ports)


class StopState(NamedTuple):
    """What the network has of its stops, changed in place."""

    gap0: Vector
    gap: Vector
    sums: Vector
    peaks: Vector
    fine: Cube
    filled: Index
    closed: Vector  # (c,) fine step since which a stop is closed; nan while open
    force: Vector  # (c,) [N] axial force of the last step in which points were looked at
    last: Vector  # (c,) [N] axial force of the last step


@njit(_nrt=False, error_model="numpy")
def tell_stops(
    stops: StopRows,
    out: StopState,
    record: Record,
    first: int,
    times: tuple[float, float, float],
    q: Vector,
    lam: Vector,
    gap0: Vector,
    points: bool,
) -> None:
    """Take in the steps of a record.

    Parameters
    ----------
    first
        Place of the interfaces in the sums.
    times [s]
        Start of the record, length of its steps, and of a fine step.
    q, lam, gap0
        Modes, forces and gaps of the points at its end.
    points
        Whether they were looked at.
    """
    t, h, fine = times
    steps = len(record.force)
    for c in range(len(stops.row)):
        row, side, film = stops.row[c], stops.side[c], stops.film[c]
        upper, lower = 0.0, 0.0
        for i in range(len(q)):
            if stops.upper[c] < stops.ports.shape[1]:
                upper += stops.ports[i, stops.upper[c]] * q[i]
            if stops.lower[c] < stops.ports.shape[1]:
                lower += stops.ports[i, stops.lower[c]] * q[i]
        out.gap[row] = out.gap0[row] + upper - lower
        carries = False
        for k in range(stops.span[c, 0], stops.span[c, 1]):
            carries = carries or lam[k] > 0.0
        place, room = out.filled[row], out.fine.shape[1]
        total, most, squeezed, acted, force, told = 0.0, 0.0, 0.0, False, 0.0, 0
        for i in range(steps + 1):
            before, force, pressed = acted, 0.0, 0.0
            if i < steps:
                if len(record.stops) and side * record.stops[i, c, 1] > 0.0:
                    force = side * record.stops[i, c, 0]
                if film >= 0:
                    pressed = record.film[i, film]
                out.last[c] = force
            acted = force > 0.0
            total, most, squeezed = total + force, max(most, force), squeezed + pressed
            if i < steps:
                tells = acted or before or abs(pressed) > stops.felt[c]
            else:  # a step without force ends a contact
                tells = before and not carries
            if not tells:
                continue
            if place + told < room:
                into = out.fine[row, place + told]
                if i == steps:
                    gap = _least_gap(stops, c, gap0, q)
                elif points and (acted or len(stops.row) <= 2):  # the least of all is its own
                    gap = record.gap[i]
                else:
                    gap = _least_gap(stops, c, gap0, record.places[i])
                into[0], into[1], into[2], into[3] = t + i * h, h, force, pressed
                into[4], into[5] = gap / stops.slope[c], np.nan
            told += 1
        out.sums[first + 2 * row + 1] += h * squeezed
        if told:
            out.filled[row] = place + told
            out.sums[first + 2 * row] += h * total
            out.peaks[row] = max(out.peaks[row], most)
        if points:
            out.force[c] = out.last[c]
            if not carries:
                out.closed[c] = np.nan
            elif np.isnan(out.closed[c]):
                out.closed[c] = np.round(t / fine)


@njit(_nrt=False, error_model="numpy", fastmath=FAST)
def _least_gap(stops: StopRows, c: int, gap0: Vector, q: Vector) -> float:
    """Smallest gap of the points of a stop [m]."""
    least = np.inf
    for k in range(stops.span[c, 0], stops.span[c, 1]):
        gap = gap0[k]
        for i in range(len(q)):
            gap += stops.traces[k, i] * q[i]
        least = min(least, gap)
    return least
