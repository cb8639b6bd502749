r"""Closed outline of held bodies of revolution, and the normal motion of their fields on it.

What of the named surfaces can be seen from beside, along a ray outwards from the axis, is the
outside; bores, recesses of end faces, and whatever another body hides are not.  Its pieces are
joined by straight lines: over the mouth of a bore, over a mounting face, from body to body.  These
*covers* move with the support, and one next to an end face as that face does, so that a valve that
moves as a whole pushes no air out.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np

from klack.acoustics.boundary.revolved import Meridian
from klack.acoustics.boundary.triangles import Triangles
from klack.arrays import Floats, Ints, Matrix, Vector
from klack.bodies.reduction.structure import Structure
from klack.errors import InputError

__all__ = ["REST", "Outline", "not_closed", "revolved_outline"]

REST = "rest of the outside"
"""Name of what is no named surface of a body: covers, and other bodies that it takes along."""

_ACROSS = 12  # elements over the radius of an end
_MOST = 160  # elements
_STRAIGHT = 0.1  # rad within an element
_SAME = 1e-6  # of the extent
_FLAT = 0.9  # of a normal along the axis: an end face


@dataclass(frozen=True, kw_only=True, eq=False)
class Outline:
    """Closed surface in elements, and what moves it.

    Parameters
    ----------
    motions
        Normal motion (n, b) of the fields of each structure.
    groups
        Names by structure, ``body.surface``; at the end the covers.
    group (n,)
        Of each element.
    largest [m]
        Size of the largest element.
    """

    mesh: Meridian | Triangles
    motions: tuple[Matrix, ...]
    groups: tuple[str, ...]
    group: Ints
    largest: float

    @property
    def covered(self) -> float:
        """Share of the area that covers have [-]."""
        areas = self.mesh.areas
        return float(areas[self.group == len(self.groups) - 1].sum() / areas.sum())

    @property
    def name_of(self) -> dict[str, int]:
        """Index of each group."""
        return {name: i for i, name in enumerate(self.groups)}


@dataclass(frozen=True, kw_only=True, eq=False)
class _Pieces:
    """Straight pieces (f, 2, 2) of a way with the air to its right; -1: a cover."""

    ends: Floats
    structure: Ints
    face: Ints

    def chosen(self, which: Ints) -> "_Pieces":
        return _Pieces(
            ends=self.ends[which], structure=self.structure[which], face=self.face[which]
        )


def revolved_outline(structures: Sequence[Structure], size: float) -> Outline:
    """Outside of all held bodies together; InputError where they enclose nothing.

    Parameters
    ----------
    size [m]
        Largest element that the shortest wave allows.
    """
    pieces = _seen_from_beside(_pieces(structures))
    if not len(pieces.face):
        raise not_closed("no face that is visible from the side")
    way = _closed(_in_order(pieces))
    radius = float(way.ends[..., 0].max())
    length = float(np.hypot(*(way.ends[:, 1] - way.ends[:, 0]).T).sum())
    size = max(min(size, radius / _ACROSS), length / _MOST)
    return _outline(structures, way, size)


def _pieces(structures: Sequence[Structure]) -> _Pieces:
    ends = [own.points[own.faces] for own in structures]
    return _Pieces(
        ends=np.concatenate([np.empty((0, 2, 2)), *ends]),
        structure=np.repeat(np.arange(len(ends)), [len(part) for part in ends]),
        face=np.concatenate([np.empty(0, dtype=int), *(np.arange(len(part)) for part in ends)]),
    )


def _seen_from_beside(pieces: _Pieces) -> _Pieces:
    """Without pieces from which a ray away from the axis meets another one, or their own body."""
    (a, b), extent = np.moveaxis(pieces.ends, 1, 0), float(np.ptp(pieces.ends.reshape(-1, 2)))
    along = b - a
    length = np.hypot(*along.T)
    normal = np.column_stack([along[:, 1], -along[:, 0]]) / np.maximum(length, 1e-300)[:, None]
    r, z = ((a + b) / 2.0 + _SAME * extent * normal).T
    rise = np.where(along[:, 1] == 0.0, 1.0, along[:, 1])
    crosses = (a[:, 1] > z[:, None]) != (b[:, 1] > z[:, None])
    at = a[:, 0] + (z[:, None] - a[:, 1]) / rise * along[:, 0]
    hidden = np.any(crosses & (at > r[:, None]), axis=1)
    return pieces.chosen(np.flatnonzero(~hidden & (length > 0.0)))


def _in_order(pieces: _Pieces) -> list[_Pieces]:
    """Chains of pieces that share their ends, from the lower end of the axis to the upper one."""
    near = _SAME * float(np.ptp(pieces.ends.reshape(-1, 2)))
    start, end = pieces.ends[:, 0], pieces.ends[:, 1]
    gaps = np.linalg.norm(end[:, None] - start[None], axis=2)
    after = np.where(gaps.min(axis=1) < near, gaps.argmin(axis=1), -1)
    first = np.setdiff1d(np.arange(len(start)), after)
    chains = []
    for at in first:
        chain = [int(at)]
        while after[chain[-1]] >= 0 and len(chain) <= len(start):
            chain.append(int(after[chain[-1]]))
        chains.append(chain)

    def place(chain: list[int]) -> tuple[float, float]:
        one, other = start[chain[0]], end[chain[-1]]
        outwards = 1.0 if other[0] >= one[0] else -1.0
        return round(float(one[1] + other[1]) / near), outwards * float(one[0])

    return [pieces.chosen(np.array(chain)) for chain in sorted(chains, key=place)]


def _closed(chains: Sequence[_Pieces]) -> _Pieces:
    """One way from axis to axis, with covers between."""
    near = _SAME * float(np.ptp(np.concatenate([chain.ends for chain in chains]).reshape(-1, 2)))
    ends, structure, face = [], [], []

    def cover(one: Vector, other: Vector) -> None:
        if np.hypot(*(other - one)) > near:
            ends.append(np.array([[one, other]]))
            structure.append(np.array([-1]))
            face.append(np.array([-1]))

    here = chains[0].ends[0, 0] * (0.0, 1.0)
    for chain in chains:
        cover(here, chain.ends[0, 0])
        ends.append(chain.ends)
        structure.append(chain.structure)
        face.append(chain.face)
        here = chain.ends[-1, 1]
    cover(here, here * (0.0, 1.0))
    return _Pieces(
        ends=np.concatenate(ends), structure=np.concatenate(structure), face=np.concatenate(face)
    )


def _outline(structures: Sequence[Structure], way: _Pieces, size: float) -> Outline:
    groups = tuple(f"{own.name}.{name}" for own in structures for name in own.group_names)
    first = np.cumsum([0, *(len(own.group_names) for own in structures)])
    group = np.full(len(way.face), len(groups))
    for s, own in enumerate(structures):
        mine = way.structure == s
        group[mine] = first[s] + own.face_group[way.face[mine]]
    elements, parts = _elements(way, group, size)
    nodes = np.vstack([elements[:, 0], elements[-1:, 1]])
    nodes[[0, -1], 0] = 0.0
    _check_simple(nodes)
    try:
        mesh = Meridian(nodes=nodes)
    except InputError:
        raise not_closed("pieces that enclose nothing") from None
    motions = tuple(_motion(own, s, way, parts, mesh) for s, own in enumerate(structures))
    return Outline(
        mesh=mesh,
        motions=motions,
        groups=(*groups, REST),
        group=np.array([group[part[0]] for part in parts]),
        largest=float(mesh.lengths.max()),
    )


def _elements(way: _Pieces, group: Ints, size: float) -> tuple[Floats, list[Ints]]:
    """Elements (n, 2, 2): short pieces of one kind joined, long ones divided; pieces of each."""
    d = way.ends[:, 1] - way.ends[:, 0]
    length, turn = np.hypot(*d.T), np.unwrap(np.arctan2(d[:, 1], d[:, 0]))
    runs: list[list[int]] = []
    for i in range(len(length)):
        joined = (
            bool(runs)
            and group[i] == group[runs[-1][0]]
            and way.structure[i] == way.structure[runs[-1][0]]
            and abs(turn[i] - turn[runs[-1][0]]) < _STRAIGHT
        )
        if not joined:
            runs.append([i])
        else:
            runs[-1].append(i)
    ends: list[Matrix] = []
    parts: list[Ints] = []
    for run in runs:
        # as even as the pieces allow
        whole = np.cumsum(length[run])
        count = max(1, ceil(whole[-1] / size - 1e-6))
        if len(run) > 1:
            share = np.minimum((whole - length[run] / 2.0) * count / whole[-1], count - 1e-9)
            for n in np.unique(share.astype(int)):
                chosen = np.array(run)[share.astype(int) == n]
                _divided(way, chosen, size, ends, parts)
        else:
            _divided(way, np.array(run), size, ends, parts)
    return np.array(ends), parts


def _divided(
    way: _Pieces, chosen: Ints, size: float, ends: list[Matrix], parts: list[Ints]
) -> None:
    """Add one straight element over some pieces, in parts where it is too long."""
    one, other = way.ends[chosen[0], 0], way.ends[chosen[-1], 1]
    count = max(1, ceil(float(np.hypot(*(other - one))) / size - 0.5))
    for n in range(count):
        ends.append(one + (other - one) * np.array([[n / count], [(n + 1) / count]]))
        parts.append(chosen)


def _check_simple(nodes: Matrix) -> None:
    """Reject a way that crosses itself."""
    a, b = nodes[:-1], nodes[1:]

    def side(p: Matrix, q: Matrix, r: Matrix) -> Floats:
        u, v = q - p, r - p
        return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])

    one = side(a[:, None], b[:, None], a[None]) * side(a[:, None], b[:, None], b[None])
    other = one.T
    if np.any((one < 0.0) & (other < 0.0)):
        raise not_closed("pieces that joined by straight lines cross each other")


def _motion(own: Structure, s: int, way: _Pieces, parts: Sequence[Ints], mesh: Meridian) -> Matrix:
    """Normal motion (n, b) of all fields of a structure."""
    fields = np.hstack([own.face_shapes, own.face_residual]).astype(float)
    mean = np.zeros((len(parts), fields.shape[1] + 1))
    for n, part in enumerate(parts):
        if way.structure[part[0]] == s:
            faces = way.face[part]
            mean[n, :-1] = own.face_area[faces] @ fields[faces] / own.face_area[faces].sum()
    covers = np.array([way.structure[part[0]] == -1 for part in parts])
    nz = mesh.normals[:, 1]
    for n in np.flatnonzero(covers & (np.abs(nz) > _FLAT)).tolist():
        for step in (-1, 1):  # the next element on this body, if it faces the same way
            m = n
            while 0 <= m < len(parts) and covers[m]:
                m += step
            if 0 <= m < len(parts) and nz[m] * nz[n] > _FLAT**2:
                mean[n] = mean[m] * nz[n] / nz[m]
    mean[:, -1] = nz  # the body as a whole, covers and other bodies with it
    return mean


def not_closed(got: str) -> InputError:
    """What is said of surfaces that enclose nothing."""
    return InputError(
        "noise.radiation: elements",
        got=got,
        expected="named surfaces of the held bodies that enclose the valve, except for openings",
        hint="name its whole outside in noise.surfaces, or take radiation: piston.",
    )
