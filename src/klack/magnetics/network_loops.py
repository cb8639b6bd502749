"""From magnetic nodes to loops: a network of flux tubes as a :class:`MagneticCircuit`.

A spanning tree joins the nodes; each other tube closes a loop with the tree, and its flux is the
loop flux, so that the fluxes into every node add up to zero.  The tree takes tubes in their order
of preference: the last ones become loops of their own, whose flux a run can record.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from klack.errors import InputError, refuse_if
from klack.magnetics.circuit import MOST_LOOPS, MagneticBranch, MagneticCircuit

__all__ = ["Tube", "circuit_of_network", "loop_names"]

_SINGULAR = 1e-12  # of the largest reluctance of a loop


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tube:
    """A branch between two nodes; its flux counts from ``start`` to ``end``.

    The spanning tree takes the tubes by ``rank``.
    """

    branch: MagneticBranch
    start: str
    end: str
    rank: int = 0


def circuit_of_network(tubes: Sequence[Tube], main: str, gap: float) -> MagneticCircuit:
    """Circuit; ``main`` names the branch whose flux is recorded as *the* flux.

    Parameters
    ----------
    gap [m]
        Working gap at which every loop has to have a reluctance.

    Raises
    ------
    InputError
        For loose nodes, parts that are not joined, loops without reluctance, too many loops.
    """
    tree, chords = _spanning_tree(tubes)
    refuse_if(
        not 1 <= len(chords) <= MOST_LOOPS,
        "magnetic network",
        got=f"{len(chords)} independent loops"
        + (f": {', '.join(tubes[k].branch.name for k in chords)}" if chords else ""),
        expected=f"1 to {MOST_LOOPS}",
        hint="join parallel elements or leave out small leakages; an eddy ladder of n terms "
        "counts as n - 1 loops.",
    )
    loops = np.zeros((len(tubes), len(chords)), dtype=np.int64)
    for column, k in enumerate(chords):
        loops[k, column] = 1
        for other, sign in _way(tubes, tree, tubes[k].end, tubes[k].start):
            loops[other, column] = sign
    idle = [tube.branch.name for tube, row in zip(tubes, loops, strict=True) if not np.any(row)]
    refuse_if(
        idle,
        "magnetic network",
        got=f"no flux through {', '.join(idle)}: no path leads back from there",
        expected="every element in a closed path",
        hint="check the names of the nodes in 'between'; a node needs at least two elements.",
    )
    circuit = MagneticCircuit(branches=tuple(tube.branch for tube in tubes), loops=loops, main=main)
    _require_reluctance(circuit, gap)
    return circuit


def loop_names(circuit: MagneticCircuit) -> tuple[str, ...]:
    """Branch of each loop flux."""
    names = []
    for column in range(circuit.loops.shape[1]):
        unit = np.zeros(circuit.loops.shape[1])
        unit[column] = 1.0
        own = [k for k, row in enumerate(circuit.loops) if np.array_equal(row, unit)]
        names.append(circuit.branches[own[-1]].name)
    return tuple(names)


def _spanning_tree(tubes: Sequence[Tube]) -> tuple[list[int], list[int]]:
    group = {node: node for tube in tubes for node in (tube.start, tube.end)}

    def head(node: str) -> str:
        while group[node] != node:
            node = group[node]
        return node

    tree, chords = [], []
    for k in sorted(range(len(tubes)), key=lambda k: tubes[k].rank):
        a, b = head(tubes[k].start), head(tubes[k].end)
        if a == b:
            chords.append(k)
        else:
            group[a] = b
            tree.append(k)
    heads = sorted({head(node) for node in group})
    if len(heads) > 1:
        parts = [sorted(node for node in group if head(node) == h) for h in heads]
        raise InputError(
            "magnetic network",
            got=f"{len(parts)} parts that are not joined: {'; '.join(map(', '.join, parts))}",
            expected="one network",
            hint="check the names of the nodes in 'between'.",
        )
    return tree, chords


def _way(tubes: Sequence[Tube], tree: Sequence[int], start: str, end: str) -> list[tuple[int, int]]:
    """Tubes of the tree from one node to another, and +1 where they point along the way."""
    came: dict[str, tuple[str, int, int]] = {start: ("", -1, 0)}
    waiting = [start]
    while waiting:
        node = waiting.pop()
        for k in tree:
            for a, b, sign in (
                (tubes[k].start, tubes[k].end, 1),
                (tubes[k].end, tubes[k].start, -1),
            ):
                if a == node and b not in came:
                    came[b] = (a, k, sign)
                    waiting.append(b)
    way = []
    while end != start:
        end, k, sign = came[end]
        way.append((k, sign))
    return way


def _require_reluctance(circuit: MagneticCircuit, gap: float) -> None:
    """Reject loops through coils and eddy terms only, which any flux would pass."""
    C = circuit.loops
    slope = circuit.slope(np.zeros(C.shape[0]), gap)
    values, vectors = np.linalg.eigh((C.T * slope) @ C)
    if values[0] <= _SINGULAR * values[-1]:
        flux = np.abs(C @ vectors[:, 0])
        names = [b.name for b, f in zip(circuit.branches, flux, strict=True) if f > 1e-6]
        raise InputError(
            "magnetic network",
            got=f"a loop without reluctance, through {', '.join(names)}",
            expected="iron, a gap, a leakage or a magnet in every loop",
            hint="put coils and damping windings in series with the element that they enclose.",
        )
