r"""A magnetic circuit as flat numbers for the compiled step.

Branches with the same flux are one: their reluctances, eddy terms and magnetisation curves add up
exactly, as piecewise cubics on the union of their intervals; a solenoid of ten tubes often becomes
two or three.

The current must follow from the fluxes alone.  Where a loop has no eddy term,

.. math:: i = \frac{v^T C^T \Theta(\varphi, x)}{v^T n}, \qquad C^T S C\,v = 0 ,

with the turns ``n`` linked with each loop.  Without such a loop the current would jump with the
voltage, and a two-point driver would switch in every step.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from klack.arrays import Vector
from klack.errors import refuse_if
from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.hysteresis import STOPS_PER_PART, IronStops
from klack.magnetics.reluctance import GapReluctance, IronReluctance, LinearReluctance

__all__ = [
    "BRANCH_SIZE",
    "HEADER",
    "MAP",
    "MOST_STOPS",
    "MOST_TUBES",
    "SETTLES",
    "STOPS",
    "circuit_numbers",
    "current_weights",
    "free_directions",
    "free_loops",
    "tubes_of",
]


HEADER = 12
"""Numbers in front of a plant; see :func:`circuit_numbers`."""

MAP = 7
"""Header number that tells a map from a circuit."""

BRANCH_SIZE = 8
"""Numbers of a branch in front of its row of loops."""

MOST_TUBES = 18
"""Most different branch fluxes."""

MOST_STOPS = 64
"""Most stops of hysteretic iron."""

STOPS = 8
"""Number of the header that counts the stops."""

SETTLES = 9
"""Header number of the place of the directions without eddy currents, or 0."""

CLOSE = 1e-8
"""Newton step, over the flux at which the iron's curve ends, whose square is round-off."""

_SAFE = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class _Tube:
    """Branches of equal flux: ``mmf = (R + R_gap(x)) flux + iron(flux) - remanence + S dflux/dt``.

    ``gap`` and ``iron`` are rows of six numbers, empty where there is none.
    """

    row: Vector
    eddy: float
    reluctance: float
    remanence: float
    gap: Vector
    iron: Vector
    weight: float
    stops: tuple[IronStops, ...]


def current_weights(circuit: MagneticCircuit) -> Vector:
    """Weights ``w`` of the branch mmfs in the current, ``i = w @ mmf``; shape (n_branches,) [-].

    Raises
    ------
    InputError
        If every loop around the coil encloses eddy currents.
    """
    C, n = circuit.loops.astype(float), circuit.loop_turns
    S = C.T @ (circuit.eddy[:, None] * C)
    free = [k for k in range(n.size) if n[k] != 0.0 and not np.any(S[k])]
    if free:  # a plain leakage loop; the one through the fewest branches
        v = np.zeros(n.size)
        v[min(free, key=lambda k: np.count_nonzero(C[:, k]))] = 1.0
    else:
        values, vectors = np.linalg.eigh(S)
        null = vectors[:, values <= _SAFE * values[-1]]
        v = null @ (null.T @ n)
        v[np.abs(v) < _SAFE * np.max(np.abs(v), initial=0.0)] = 0.0
    refuse_if(
        not abs(v @ n) > _SAFE * np.linalg.norm(n) * np.linalg.norm(v),
        "magnetic circuit",
        got="eddy currents in every loop that the coil drives",
        expected="a leakage path around the coil without an eddy term",
        hint="add a leakage branch (5 to 15 % of the main permeance) in a loop of its own.",
    )
    return np.asarray(C @ v / (v @ n), dtype=float)


@lru_cache(maxsize=100)
def circuit_numbers(circuit: MagneticCircuit) -> Vector:
    """Flat circuit for :mod:`klack.magnetics.flux_kernel`.

    ``[loops, tubes, most iterations (1 if linear), main tube, sign of its flux, accepted change
    of a loop flux, whether two loops share one gap, whether it is a map, number of stops, table
    of directions without eddy currents (:func:`free_directions`), 2 spare]``, the turns of each
    loop, then per tube ``eddy, reluctance, remanence, gap table, iron table, weight in the
    current, table of stops, its first stop`` and its row of loops, then the tables (of stops:
    :mod:`klack.magnetics.stop_kernel`). Offsets of tables count from the start; 0 says that
    there is none.
    """
    tubes, main, sign = tubes_of(circuit)
    refuse_if(
        len(tubes) > MOST_TUBES,
        "magnetic circuit",
        got=f"{len(tubes)} different branch fluxes",
        expected=f"at most {MOST_TUBES}",
        hint="put branches that carry the same flux in series in one loop.",
    )
    stops = sum(part.share.size for tube in tubes for part in tube.stops)
    refuse_if(
        stops > MOST_STOPS,
        "magnetic circuit: hysteresis",
        got=f"{sum(len(tube.stops) for tube in tubes)} parts of iron with hysteresis",
        expected=f"at most {MOST_STOPS // STOPS_PER_PART}",
        hint="join parts of one material, or give hysteresis to the largest parts only.",
    )
    loops = circuit.loops.shape[1]
    head = np.zeros(HEADER)
    linear = all(tube.iron.size == 0 for tube in tubes)
    head[:5] = loops, len(tubes), 1 if linear else 40, main, sign
    head[6] = loops == 2 and [tube.gap.size > 0 for tube in tubes] == [True] + [False] * (
        len(tubes) - 1
    )
    if stops:
        head[6], head[STOPS] = 0.0, stops
    limits = [tube.iron[-1, 0] / np.sum(np.abs(tube.row)) for tube in tubes if tube.iron.size]
    head[5] = CLOSE * min(limits, default=0.0)
    offset = HEADER + loops + len(tubes) * (BRANCH_SIZE + loops)
    blocks, tables, first = [], [], 0
    for tube in tubes:
        starts = []
        for rows in (tube.gap, tube.iron):
            starts.append(offset if rows.size else 0)
            if rows.size:
                tables.append(np.append(float(rows.shape[0]), rows.ravel()))
                offset += tables[-1].size
        hysteresis = [0.0, 0.0]
        if tube.stops:
            hysteresis = [float(offset + sum(part.width.size for part in tube.stops)), float(first)]
            parts = [float(len(tube.stops))]
            for part in tube.stops:
                parts += [float(part.share.size), float(offset)]
                parts += np.column_stack((part.stiffness, part.share)).ravel().tolist()
                tables.append(part.width)
                offset += part.width.size
                first += part.share.size
            tables.append(np.array(parts))
            offset += len(parts)
        numbers = [tube.eddy, tube.reluctance, tube.remanence, *starts, tube.weight, *hysteresis]
        blocks.append(np.concatenate((numbers, tube.row)))
    directions = free_directions(circuit)
    touched = [tube for tube in tubes if np.any(np.abs(directions @ tube.row) > _SAFE)]
    if any(tube.gap.size or tube.iron.size or tube.remanence for tube in touched):
        head[SETTLES] = offset  # else they always balance
        tables.append(np.append(float(directions.shape[0] - 1), directions.ravel()))
    flat = np.concatenate((head, circuit.loop_turns, *blocks, *tables))
    flat.flags.writeable = False  # kept, because strokes of one valve share it
    return flat


def free_directions(circuit: MagneticCircuit) -> Vector:
    """Changes of the loop fluxes that no eddy term opposes, shape (k, n_loops).

    Only the last one changes the linkage of the coil.
    """
    n, null = circuit.loop_turns, free_loops(circuit)
    along = null.T @ n
    q, _ = np.linalg.qr(np.column_stack((along, np.eye(along.size))))
    return np.asarray((null @ np.column_stack((q[:, 1:], q[:, :1]))).T)


def free_loops(circuit: MagneticCircuit) -> Vector:
    """Independent directions of the loop fluxes without eddy currents, shape (n_loops, k)."""
    C = circuit.loops.astype(float)
    values, vectors = np.linalg.eigh(C.T @ (circuit.eddy[:, None] * C))
    if values[-1] > 0.0:
        return np.asarray(vectors[:, values <= _SAFE * values[-1]])
    return np.eye(C.shape[1])


def tubes_of(circuit: MagneticCircuit) -> tuple[list[_Tube], int, float]:
    """Tubes, the one of the main branch, and the sign of the main flux in it."""
    weights = current_weights(circuit)
    groups: dict[tuple[int, ...], list[tuple[float, int]]] = {}
    for k, row in enumerate(circuit.loops):
        if np.any(row):
            sign = 1.0 if row[np.flatnonzero(row)[0]] > 0 else -1.0
            key = tuple(int(c) for c in sign * row)
            groups.setdefault(key, []).append((sign, k))
    tubes, main = [], (0, 0.0)
    for j, (row, members) in enumerate(groups.items()):
        branches = [(sign, circuit.branches[k]) for sign, k in members]
        # the weight is that of the loops, so equal up to the sign within a tube
        sign, k = members[0]
        tubes.append(_tube(np.array(row, dtype=float), branches, sign * float(weights[k])))
        for sign, k in members:
            if circuit.branches[k].name == circuit.main:
                main = (j, sign)
    order = sorted(range(len(tubes)), key=lambda j: tubes[j].gap.size == 0)  # gaps first
    return [tubes[j] for j in order], order.index(main[0]), main[1]


def _tube(row: Vector, branches: list[tuple[float, MagneticBranch]], weight: float) -> _Tube:
    reluctance, gaps, irons = 0.0, [], []
    for _, branch in branches:
        law = branch.law
        if isinstance(law, LinearReluctance):
            reluctance += law.reluctance
        elif isinstance(law, GapReluctance):
            gaps.append(law.rows)
        elif isinstance(law, IronReluctance):
            irons.append(law.rows)
    return _Tube(
        row=row,
        eddy=sum(branch.eddy for _, branch in branches),
        reluctance=reluctance,
        remanence=sum(sign * branch.remanence for sign, branch in branches),
        gap=_sum_of_cubics(gaps),
        iron=_sum_of_cubics(irons),
        weight=weight,
        stops=tuple(branch.stops for _, branch in branches if branch.stops is not None),
    )


def _sum_of_cubics(tables: list[Vector]) -> Vector:
    """Sum of piecewise cubics (start, value, three factors, integral) on all their intervals."""
    if not tables:
        return np.zeros((0, 6))
    starts = np.unique(np.concatenate([table[:, 0] for table in tables]))
    out = np.zeros((starts.size, 6))
    out[:, 0] = starts
    for table in tables:
        i = np.clip(np.searchsorted(table[:, 0], starts, side="right") - 1, 0, None)
        s = starts - table[i, 0]
        y, a, b, c, w = table[i, 1:].T
        out[:, 1] += y + s * (a + s * (b + s * c))
        out[:, 2] += a + s * (2 * b + s * 3 * c)
        out[:, 3] += b + 3 * c * s
        out[:, 4] += c
        out[:, 5] += w + s * (y + s * (a / 2 + s * (b / 3 + s * c / 4)))
    return out
