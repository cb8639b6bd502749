r"""Linear equations of the mass balances of all volumes, along the links between them.

What a pressure pushes out of a volume fills another.  Off its diagonal the matrix is below zero,
and the sum of a column, what that pressure changes in all volumes together, is above zero.  Kept
are these sums and, for both ways of every *link* between two volumes, what flows into one for the
pressure of the other, as numbers above zero.  Pivots follow from them by sums alone (Grassmann,
Taksar & Heyman 1985), without the diagonal: even a wide channel between two almost empty volumes,
whose storage is less than the round-off of its flow, is solved.

No pivot is chosen by size, so that the order follows from the structure alone: first the volume
with the fewest links left (minimum degree: Tinney & Walker 1967; George & Liu 1989).  A tree gets
no link by elimination, a ring less than one for each volume.  Of volumes with equally few links the
one that was changed longest ago comes first, for which a processor does not wait: a chain is
eliminated from both ends.
"""

from functools import lru_cache
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from klack.arrays import Index
from klack.machine.compiling.jit import inner

__all__ = ["Links", "clear_links", "find_links", "solve_mass_balance"]


class Links(NamedTuple):
    """Where numbers of the mass balance lie, from its order of elimination.

    The number at ``2 l`` of link ``l``, between a volume and one that is eliminated later, is what
    the pressure of the later one pushes into the first; the one at ``2 l + 1`` the reverse.
    """

    volumes: int
    order: Index  # (volumes,) as they are eliminated
    first_link: Index  # (volumes + 1,) in this order: links to volumes that come later
    later: Index  # (links,) these volumes
    filled: Index  # by elimination: for each pair of links of a volume the place between their ends
    place: Index  # (2 n,) of each pair that was given: into its first volume, into its second


@lru_cache(maxsize=64)
def find_links(volumes: int, pairs: tuple[tuple[int, int], ...]) -> Links:
    """Order of elimination and places of the links, found once for each structure.

    Parameters
    ----------
    pairs
        Of nodes that exchange mass.  A node with itself, or beyond the volumes, has the place
        behind all links, which nothing reads.
    """
    beside: list[set[int]] = [set() for _ in range(volumes)]
    inside = [a != b and max(a, b) < volumes for a, b in pairs]
    for (a, b), known in zip(pairs, inside, strict=True):
        if known:
            beside[a].add(b)
            beside[b].add(a)
    left, waits = set(range(volumes)), [0] * volumes
    order, later = list[int](), list[set[int]]()
    while left:
        k = min(left, key=lambda i: (len(beside[i]), waits[i], i))
        left.remove(k)
        order.append(k)
        later.append(beside[k])
        for i in beside[k]:
            beside[i] = (beside[i] | beside[k]) - {i, k}
            waits[i] = len(order)
    turn = {k: s for s, k in enumerate(order)}
    lists = [sorted(found, key=turn.__getitem__) for found in later]
    links = [(k, i) for k, found in zip(order, lists, strict=True) for i in found]
    place = {link: 2 * number for number, link in enumerate(links)}
    place |= {(i, k): where + 1 for (k, i), where in place.items()}
    behind = 2 * len(links)
    return Links(
        volumes=volumes,
        order=np.array(order, np.int64),
        first_link=np.cumsum([0, *map(len, lists)], dtype=np.int64),
        later=np.array([i for _, i in links], np.int64),
        filled=np.array(
            [place[pair] for ends in lists for pair in combinations(ends, 2)], np.int64
        ),
        place=np.array(
            [
                place[pair] if known else behind
                for (a, b), known in zip(pairs, inside, strict=True)
                for pair in ((a, b), (b, a))
            ],
            np.int64,
        ),
    )


@inner(_nrt=False, error_model="numpy", forceinline=True)
def clear_links(nodes: Any, into: Any) -> None:
    """Begin with no flow over any link."""
    for at in range(2 * nodes.first_link[nodes.volumes]):
        into[at] = 0.0


@inner(_nrt=False, error_model="numpy", forceinline=True)
def solve_mass_balance(nodes: Any, into: Any, own: Any, r: Any) -> None:
    """Solve in place for the right-hand side ``r``.

    Parameters
    ----------
    nodes
        With the fields of :class:`Links`.
    into
        What flows over each link for a pressure, both ways; overwritten.
    own
        Sums of the columns; overwritten.
    """
    order, first_link, later = nodes.order, nodes.first_link, nodes.later
    fill = 0
    for s in range(nodes.volumes):
        k, begin, end = order[s], first_link[s], first_link[s + 1]
        pivot = own[k]
        for e in range(begin, end):
            pivot += into[2 * e + 1]
        inverse = 1.0 / pivot
        share, carried = own[k] * inverse, r[k] * inverse
        own[k] = inverse
        for e in range(begin, end):
            i, out, back = later[e], into[2 * e + 1], into[2 * e] * inverse
            own[i] += into[2 * e] * share
            r[i] += out * carried
            out *= inverse
            for f in range(e + 1, end):
                at = nodes.filled[fill]
                into[at] += out * into[2 * f]
                into[at + 1] += back * into[2 * f + 1]
                fill += 1
    for s in range(nodes.volumes - 1, -1, -1):
        k = order[s]
        total = r[k]
        for e in range(first_link[s], first_link[s + 1]):
            total += into[2 * e] * r[later[e]]
        r[k] = total * own[k]
