r"""Contact points between two meshes that do not match: mortar hats on curved quadratic faces.

Each node k of the *slave* surface (the finer one) carries a multiplier with a hat
:math:`\psi_k`, linear on the pieces into which the nodes cut a quadratic face (four triangles of a
6-node face, two halves of a 3-node line).  Its gap is the mean

.. math::
    g_k = \frac{1}{A_k} \int \psi_k \, g \, dA, \qquad A_k = \int \psi_k \, dA, \qquad
    g = n \cdot (x_m - x_s) ,

taken on the *curved* faces, with :math:`x_m` on the master along the outward slave normal *n*
(:mod:`klack.contact.pairing`).  For small displacements

.. math:: g = g_0 + G_a u_a + G_b u_b, \qquad f_a = G_a^T \lambda, \quad f_b = G_b^T \lambda,
    \qquad \lambda_k \ge 0 \text{ in N}, \quad p_k = \lambda_k / A_k .

A gap above zero is open and the forces push the bodies apart. Gap and force have the same weights,
and an integration point that meets no master face is left out of all three integrals: a rigid
translation of both bodies changes no gap and the resultants cancel exactly.

These multipliers pass the patch test; nodes as contact points do not, and dual hats have negative
weights on quadratic faces, which create energy in impacts (Popp et al. 2012 on the latter).

No package for mortar weights was found that Python could call on two free meshes.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array

from klack.bodies.elasticity.shape_functions import reference_nodes, shape_functions
from klack.contact.face_form import FaceForm
from klack.contact.pairing import (
    FaceGeometry,
    Projection,
    axial_distance,
    face_gaps,
    face_geometry,
    face_thickness,
    project_to_surface,
)
from klack.errors import ConvergenceError, InputError, refuse_if
from klack.mesh.mesh import FaceBlock, Mesh, Surface

__all__ = [
    "COVERED",
    "ContactSpace",
    "HatQuadrature",
    "around_rows",
    "contact_space",
    "hat_quadrature",
    "tangent_rows",
    "touching_shift",
]

_POINTS_BY_COST = {2: 400, 3: 1000}
"""Contact points that an automatic reach aims at, by dimension."""

_WALL = 0.9
"""Cosine between normal and radial direction from which a face is a wall."""

_CENTRAL = 3.0
"""Element sizes from the axis up to which hats count as around it."""

_LOWEST = 32
"""Hats that give the excess of their mean gap over the gap at the node."""

_ON_AXIS = 1e-6
"""Share of the element size at which a hat is on the axis."""

COVERED = 0.05
"""Least share of a hat that has to face the master."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactSpace:
    """Gaps and forces of the contact points between body a (needle, above) and body b.

    ``gap + G_a u_a + G_b u_b`` are the gaps, ``G_a.T lam`` and ``G_b.T lam`` the nodal forces.

    Parameters
    ----------
    G_a, G_b (nc, dofs of a), (nc, dofs of b) [-]
    gap (nc,) [m]
        Initial weighted gaps.
    area (nc,) [m^2]
        Of each hat; axisymmetric: of the whole ring.
    points (nc, dimension) [m]
        Of the slave nodes.
    axial (nc,) [-]
        Change of the gaps per translation of a along +z; ``axial @ lam`` is the axial force that
        pushes a to +z and b to -z.
    rim (nc,)
        Hats at the border of the candidates: a neighbour exceeds ``reach``. None may ever carry a
        force.
    size (nc,) [m]
        Element size across the contact (mean shortest extent of the slave faces).
    slave
        Side of the hats, the finer one.
    nodes (nc,)
        Slave nodes.
    reach [m]
        Largest gap of a candidate above the smallest.
    clearance [m]
        Distance that a moves rigidly to -z until the surfaces touch. The weighted gaps close a
        little later (:attr:`touch`), by about h^2/(50 R) on elements of size h and surfaces of
        relative radius R.
    beyond [m]
        No omitted point has a smaller gap. While the bodies approach by less, a contact at the rim
        is complete all the same: elements may be wider than the reach.
    entry (nc,) [m]
        Reach from which each point is a candidate.
    """

    G_a: csr_array
    G_b: csr_array
    gap: NDArray[np.float64]
    area: NDArray[np.float64]
    points: NDArray[np.float64]
    axial: NDArray[np.float64]
    rim: NDArray[np.bool_]
    size: NDArray[np.float64]
    slave: Literal["a", "b"]
    nodes: NDArray[np.int64]
    reach: float
    clearance: float
    entry: NDArray[np.float64]
    beyond: float = -np.inf

    @property
    def count(self) -> int:
        """Number of contact points."""
        return len(self.gap)

    @property
    def dimension(self) -> int:
        """3, or 2 for axisymmetric bodies."""
        return int(self.points.shape[1])

    @property
    def touch(self) -> float:
        """Distance [m] that a moves rigidly to -z until the first weighted gap closes."""
        facing = self.axial > 1e-6
        refuse_if(
            not np.any(facing),
            "contact space: touch",
            got="contact points whose gap does not change with the axial position",
            expected="surfaces that face each other along the axis of motion z",
            hint="check the orientation of the geometry; the axis of motion is z.",
        )
        return float(np.min(self.gap[facing] / self.axial[facing]))

    def shifted(self, distance: float) -> Self:
        """Same contact points with a moved rigidly along +z by a small ``distance`` [m].

        First order; rebuild the space after moves not small against the element size.
        """
        return replace(
            self,
            gap=self.gap + distance * self.axial,
            clearance=self.clearance + distance,
            beyond=self.beyond + distance * float(np.min(self.axial)),
        )

    def complete_at(self, travel: float) -> bool:
        """Whether no omitted point can have closed after a moved by ``travel`` [m] to -z.

        The deformation under contact forces only opens the gaps of points without a force.
        """
        return travel * float(np.max(self.axial)) < self.beyond

    def restricted(self, keep: NDArray[np.bool_]) -> Self:
        """Contact points ``keep`` alone, shape (nc,); the new border becomes the rim."""
        keep = np.asarray(keep, dtype=bool)
        # two hats are neighbours when they share slave nodes
        G = self.G_a if self.slave == "a" else self.G_b
        shared = abs(G) @ (abs(G).T @ (~keep).astype(float))
        rim = self.rim | (shared > 0)
        return replace(
            self,
            **{name: getattr(self, name)[keep] for name in _ROWS if name != "rim"},
            rim=rim[keep],
            beyond=min(self.beyond, float(np.min(self.gap[~keep], initial=np.inf))),
        )


_ROWS = ("G_a", "G_b", "gap", "area", "points", "axial", "rim", "size", "nodes", "entry")


def contact_space(
    mesh_a: Mesh,
    surface_a: Surface,
    mesh_b: Mesh,
    surface_b: Surface,
    *,
    reach: float | None = None,
    slave: Literal["a", "b"] | None = None,
    form: FaceForm | None = None,
) -> ContactSpace:
    """Contact points between surfaces that face each other: needle a, stop or seat b.

    Parameters
    ----------
    reach [m]
        Largest gap of a contact point above the smallest; somewhat more than the largest expected
        approach, so that the contact never grows to the rim.  Default by cost: the faces with the
        smallest gaps, up to about 400 contact points (axisymmetric) or 1000 (solid).
    slave
        Side of the multipliers; default: that with the smaller elements across the contact.
    """
    _check_pair(mesh_a, surface_a, mesh_b, surface_b, reach)
    sides = {"a": (mesh_a, surface_a), "b": (mesh_b, surface_b)}
    others = {"a": sides["b"], "b": sides["a"]}
    looked_at = ("a", "b") if slave is None else (slave,)
    gaps = {side: face_gaps(*sides[side], *others[side], form) for side in looked_at}
    _not_facing_if(not all(np.any(np.isfinite(gap)) for gap in gaps.values()), surface_a, surface_b)
    floor = min(float(np.nanmin(gap)) for gap in gaps.values())
    if reach is None:
        points = _POINTS_BY_COST[mesh_a.dimension]
        limit = min(_reach_by_cost(gap, points) for gap in gaps.values())
    else:
        limit = floor + reach
    if slave is None:
        slave = _finer(sides, gaps, limit)
    limit = max(limit, float(np.nanmin(gaps[slave])))  # a coarse side may be sampled farther away
    return _build(sides, slave, gaps[slave], limit, floor, form)


def _check_pair(
    mesh_a: Mesh, surface_a: Surface, mesh_b: Mesh, surface_b: Surface, reach: float | None
) -> None:
    where = f"contact of surface '{surface_a.name}' with surface '{surface_b.name}'"
    refuse_if(
        mesh_a.dimension != mesh_b.dimension,
        where,
        got=f"a mesh of dimension {mesh_a.dimension} against one of {mesh_b.dimension}",
        expected="two solids or two axisymmetric bodies",
        hint="model both bodies in the same way.",
    )
    for surface in (surface_a, surface_b):
        refuse_if(
            surface.face_count == 0,
            where,
            got=f"surface '{surface.name}' without faces",
            expected="at least one face",
            hint="name the faces of the contact in the geometry.",
        )
    if reach is not None and not reach > 0:
        raise InputError(
            f"{where}: reach",
            got=f"{reach:g} m",
            expected="a length above 0 m",
            hint="use about twice the largest expected approach, some micrometres.",
        )


def _reach_by_cost(gaps: NDArray[np.float64], points: int) -> float:
    """Gap up to which the faces carry about ``points`` hats (two per face at most)."""
    finite = np.sort(gaps[np.isfinite(gaps)])
    return float(finite[min(points // 2, len(finite)) - 1])


def _finer(
    sides: dict[str, tuple[Mesh, Surface]], gaps: dict[str, NDArray[np.float64]], limit: float
) -> Literal["a", "b"]:
    """Side with the smaller elements within reach; a when they are alike."""
    size: dict[str, float] = {}
    for side in sides:
        near = np.isfinite(gaps[side]) & (gaps[side] <= limit)
        near[np.nanargmin(gaps[side])] = True
        size[side] = float(np.median(face_thickness(*sides[side])[near]))
    return "b" if size["b"] < 0.95 * size["a"] else "a"


@dataclass(frozen=True, slots=True)
class _Piece:
    """Part of a reference face on which the hats are smooth."""

    nodes: tuple[int, ...]
    xi: NDArray[np.float64]
    weight: NDArray[np.float64]
    hats: NDArray[np.float64]


_PIECES: dict[str, tuple[tuple[int, ...], ...]] = {
    "line2": ((0, 1),),
    "line3": ((0, 2), (2, 1)),
    "tri3": ((0, 1, 2),),
    "tri6": ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    "quad4": ((0, 1, 2, 3),),
    "quad8": ((0, 4, 7), (4, 1, 5), (5, 2, 6), (6, 3, 7), (4, 5, 6, 7)),
}
"""Nodes of the pieces of every face: lines, triangles, quads."""


def _pieces(family: str) -> list[_Piece]:
    """Integration points and linear hats on every piece of a face."""
    corner = reference_nodes(family)
    pieces = []
    for nodes in _PIECES[family]:
        shape = {2: "line2", 3: "tri3", 4: "quad4"}[len(nodes)]
        xi, weight = _rule(shape)
        hats, slopes = shape_functions(shape, xi)
        jacobian = np.einsum("qnk,nd->qkd", slopes, corner[list(nodes)])
        stretch = np.abs(np.linalg.det(jacobian))
        pieces.append(_Piece(nodes, hats @ corner[list(nodes)], weight * stretch, hats))
    return pieces


def _rule(shape: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Eight points on a line, six on a triangle (degree 4), four times four on a quad."""
    if shape == "line2":
        x, w = np.polynomial.legendre.leggauss(8)
        return x[:, None], w
    if shape == "quad4":
        x, w = np.polynomial.legendre.leggauss(4)
        return np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2), np.outer(w, w).ravel()
    # Dunavant 1985, degree 4, six points
    orbits = ((0.445948490915965, 0.223381589678011), (0.091576213509771, 0.109951743655322))
    nodes = [p for c, _ in orbits for p in ((c, c), (1.0 - 2.0 * c, c), (c, 1.0 - 2.0 * c))]
    return np.array(nodes), np.repeat([weight / 2.0 for _, weight in orbits], 3)


_Entries = tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]


class _Sums:
    """Integrals over the slave faces, collected per slave node, and the entries of both matrices.

    Of the hat: covered and full area, gap, squared distance from the node (spread); of its square
    (narrow): the same.
    """

    def __init__(self, dimension: int, count: int) -> None:
        self.dimension = dimension
        self.covered, self.full, self.gap, self.spread = np.zeros((4, count))
        self.narrow, self.narrow_gap, self.narrow_spread = np.zeros((3, count))
        self.slave: list[_Entries] = []
        self.master: list[_Entries] = []


def _build(
    sides: dict[str, tuple[Mesh, Surface]],
    slave: Literal["a", "b"],
    gaps: NDArray[np.float64],
    limit: float,
    floor: float,
    form: FaceForm | None,
) -> ContactSpace:
    """Contact points up to a gap; ``gaps`` of the faces of the slave side."""
    mesh, surface = sides[slave]
    near = np.isfinite(gaps) & (gaps <= limit)
    inner = _part(surface, near).nodes
    ring = _faces_at(surface, inner)
    sums = _Sums(mesh.dimension, mesh.node_count)
    master = sides["b" if slave == "a" else "a"]
    for part in _facing(mesh, _part(surface, ring), master):
        _integrate(sums, mesh, part, master[1], form)
    closest = _closest_face(mesh, surface, gaps)
    return _assemble(sides, slave, sums, inner, ring, closest, limit, floor)


def _closest_face(mesh: Mesh, surface: Surface, gaps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Smallest gap of the faces at each node [m]."""
    found = np.full(mesh.node_count, np.inf)
    start = 0
    for block in surface.blocks:
        part = gaps[start : start + len(block.connectivity)]
        start += len(block.connectivity)
        np.fmin.at(found, block.connectivity, part[:, None])
    return found


def _part(surface: Surface, faces: NDArray[np.bool_]) -> Surface:
    start, blocks = 0, []
    for block in surface.blocks:
        chosen = block.connectivity[faces[start : start + len(block.connectivity)]]
        start += len(block.connectivity)
        blocks.append(FaceBlock(block.family, chosen))
    return Surface(surface.name, tuple(block for block in blocks if len(block.connectivity)))


def _faces_at(surface: Surface, nodes: NDArray[np.int64]) -> NDArray[np.bool_]:
    parts = [np.isin(block.connectivity, nodes).any(axis=1) for block in surface.blocks]
    return np.concatenate(parts)


class _Facing(NamedTuple):
    """A piece of every face of a block, at integration points (f, q) and hats (f, hats)."""

    faces: FaceBlock
    piece: _Piece
    at: FaceGeometry
    hats: NDArray[np.int64]
    whole: NDArray[np.float64]
    met: Projection

    @property
    def share(self) -> NDArray[np.float64]:
        """psi_k dA where the other side is met, shape (f, q, hats) [m^2]."""
        return np.where(self.met.met.reshape(*self.whole.shape[:2], 1), self.whole, 0.0)

    @property
    def gap(self) -> NDArray[np.float64]:
        """Gap of the meshes, shape (f, q) [m]; zero where nothing is met."""
        return np.where(self.met.met, self.met.gap, 0.0).reshape(self.whole.shape[:2])


def _facing(mesh: Mesh, surface: Surface, master: tuple[Mesh, Surface]) -> Iterator[_Facing]:
    """Pieces of the slave faces, with what they meet on the master."""
    for block in surface.blocks:
        for piece in _pieces(block.family):
            at, hats, share = _shares(mesh, block, piece)
            position, normal = (x.reshape(-1, mesh.dimension) for x in (at.position, at.normal))
            met = project_to_surface(position, normal, *master)
            yield _Facing(block, piece, at, hats, share, met)


def _integrate(
    sums: _Sums, mesh: Mesh, part: _Facing, master: Surface, form: FaceForm | None
) -> None:
    """Add the integrals of one piece of every face."""
    at, hats, share = part.at, part.hats, part.share
    f, q, d = at.position.shape
    position, normal = at.position.reshape(f * q, d), at.normal.reshape(f * q, d)
    np.add.at(sums.full, hats, part.whole.sum(axis=1))
    np.add.at(sums.covered, hats, share.sum(axis=1))
    gap = np.nan_to_num(part.met.gap) + (0.0 if form is None else form.gaps(position, normal))
    gap = gap.reshape(f, q, 1)
    np.add.at(sums.gap, hats, (share * gap).sum(axis=1))
    narrow = share * part.piece.hats
    square = np.sum((at.position[:, :, None] - mesh.points[hats][:, None]) ** 2, axis=3)
    np.add.at(sums.narrow, hats, narrow.sum(axis=1))
    np.add.at(sums.narrow_gap, hats, (narrow * gap).sum(axis=1))
    np.add.at(sums.spread, hats, (share * square).sum(axis=1))
    np.add.at(sums.narrow_spread, hats, (narrow * square).sum(axis=1))
    N, _ = shape_functions(part.faces.family, part.piece.xi)
    value = -np.einsum("fqk,qn,fqd->fknd", share, N, at.normal)
    _store(sums.slave, d, hats[:, :, None], part.faces.connectivity[:, None, :], value)
    flat = share.reshape(f * q, -1)
    along = np.broadcast_to(normal[:, None], (*flat.shape, d))
    _store_master(sums.master, np.repeat(hats, q, axis=0), flat, along, part.met, master)


def _shares(
    mesh: Mesh, faces: FaceBlock, piece: _Piece
) -> tuple[FaceGeometry, NDArray[np.int64], NDArray[np.float64]]:
    """Integration points of one piece of every face, hats (f, hats), psi_k dA (f, q, hats)."""
    at = face_geometry(mesh.points, faces, piece.xi)
    weight = at.stretch * piece.weight  # dA
    return at, faces.connectivity[:, piece.nodes], weight[:, :, None] * piece.hats


def _numbers(count: int, nodes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Hat at each of ``count`` nodes; -1 where there is none."""
    number = np.full(count, -1)
    number[nodes] = np.arange(len(nodes))
    return number


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HatQuadrature:
    r"""Integration points of all hats of a contact space, on the slave side.

    .. math:: A_k = \sum_p W_{kp}, \qquad g_k = \frac{1}{A_k} \sum_p W_{kp}\, g_p

    over the points that meet the master.

    Parameters
    ----------
    position, normal (p, d) [m], [-]
        Of the slave faces, outward.
    weight (nc, p) [m^2]
        Hat times area, W.
    """

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    weight: csr_array


def hat_quadrature(space: ContactSpace, mesh: Mesh, surface: Surface) -> HatQuadrature:
    """Integration points of the hats; mesh and surface are those of the slave side."""
    number = _numbers(mesh.node_count, space.nodes)
    positions, normals, entries, count = [], [], [], 0
    for block in _part(surface, _faces_at(surface, space.nodes)).blocks:
        for piece in _pieces(block.family):
            at, hats, share = _shares(mesh, block, piece)
            f, q, d = at.position.shape
            positions.append(at.position.reshape(f * q, d))
            normals.append(at.normal.reshape(f * q, d))
            column = (count + np.arange(f * q)).reshape(f, q, 1)
            row, column, _ = np.broadcast_arrays(number[hats][:, None], column, share)
            kept = row >= 0
            entries.append((row[kept], column[kept], share[kept]))
            count += f * q
    row, column, value = (np.concatenate(part) for part in zip(*entries, strict=True))
    return HatQuadrature(
        position=np.concatenate(positions),
        normal=np.concatenate(normals),
        weight=coo_array((value, (row, column)), shape=(space.count, count)).tocsr(),
    )


def _numbered(
    space: ContactSpace, sides: dict[str, tuple[Mesh, Surface]]
) -> tuple[str, float, Iterator[tuple[_Facing, NDArray[np.int64]]]]:
    """Side of the master, sign of the slave (+: a), pieces of its faces and their hats (f, hats).

    Numbered as in ``space``, -1 for none.
    """
    other = "b" if space.slave == "a" else "a"
    mesh, surface = sides[space.slave]
    number = _numbers(mesh.node_count, space.nodes)
    near = _part(surface, _faces_at(surface, space.nodes))
    parts = ((part, number[part.hats]) for part in _facing(mesh, near, sides[other]))
    return other, 1.0 if space.slave == "a" else -1.0, parts


def _gap_at_touch(part: _Facing, sign: float, space: ContactSpace) -> NDArray[np.float64]:
    """Gap (f, q) [m] once the bodies touch, wherever their meshes are drawn along z."""
    flight = space.clearance if np.isfinite(space.clearance) else 0.0
    return part.gap + sign * flight * part.at.normal[..., -1]


def tangent_rows(
    space: ContactSpace, mesh_a: Mesh, surface_a: Surface, mesh_b: Mesh, surface_b: Surface
) -> tuple[csr_array, csr_array]:
    r"""Displacement of a past b at the contact points, with the hats and weights of their gaps.

    .. math:: s_k = \frac{1}{A_k} \int \psi_k \, [t \cdot (u_a - u_b)
        \mp g \, n \cdot \partial u_s / \partial t] \, dA = T_a u_a + T_b u_b

    so that tangential forces :math:`T_a^T \lambda_t`, :math:`T_b^T \lambda_t` on the bodies
    cancel, and so do their moments: across a gap *g* (that of the meshes
    once they touch) the normal of the slave
    side *s* (-: a, +: b) turns with its surface, and both bodies turned as one do not slip.
    Axisymmetric bodies have one direction *t*, along the meridian and away from the axis of motion
    (along it on walls); solids have a second one round it (the first is along x where hats
    surround it). Each is taken in the tangential plane of every integration point. The hat at the
    axis of bodies of revolution has an empty row: it cannot slip.

    Returns
    -------
    T_a, T_b (ways nc, dofs of a), (ways nc, dofs of b) [-]
        All points in the first direction, then in the second.
    """
    sides = {"a": (mesh_a, surface_a), "b": (mesh_b, surface_b)}
    other, sign, parts = _numbered(space, sides)
    mesh = sides[space.slave][0]
    central = np.linalg.norm(space.points[:, :-1], axis=1) < _CENTRAL * space.size
    entries: dict[str, list[_Entries]] = {space.slave: [], other: []}
    for part, rows in parts:
        at, share, nodes = part.at, part.share, part.faces.connectivity[:, None]
        q, d = at.position.shape[1:]
        N, dN = shape_functions(part.faces.family, part.piece.xi)
        base, gap = _dual_tangents(mesh, part.faces, dN), _gap_at_touch(part, sign, space)
        towards = _away_from_axis(at.position[:, :, None], central[rows][:, None])
        for way, t in enumerate(_tangents(at.normal[:, :, None], towards)):
            value = sign * np.einsum("fqk,qn,fqkd->fknd", share, N, t)
            turned = np.einsum("qni,fqid,fqkd->fqkn", dN, base, t)
            value -= sign * np.einsum("fqk,fq,fqkn,fqd->fknd", share, gap, turned, at.normal)
            own = np.where(rows < 0, -1, rows + way * space.count)
            _store(entries[space.slave], d, own[:, :, None], nodes, value)
            own, flat = np.repeat(own, q, axis=0), -sign * share.reshape(-1, share.shape[2])
            along = t.reshape(len(flat), -1, d)
            _store_master(entries[other], own, flat, along, part.met, sides[other][1])
    area = np.tile(space.area, mesh.dimension - 1)
    T_a, T_b = (_scaled(entries[side], area, sides[side][0].dof_count) for side in ("a", "b"))
    if mesh.dimension == 2:
        still = diags_array((space.points[:, 0] > _ON_AXIS * space.size).astype(float))
        T_a, T_b = csr_array(still @ T_a), csr_array(still @ T_b)
    return T_a, T_b


def around_rows(
    space: ContactSpace, mesh_a: Mesh, surface_a: Surface, mesh_b: Mesh, surface_b: Surface
) -> tuple[tuple[csr_array, csr_array], tuple[csr_array, csr_array]]:
    r"""Displacement of a past b round the ring, of bodies of revolution in a Fourier order.

    The second direction of :func:`tangent_rows`, in the same sense. With the slave side *s* in the
    order *n*, and the normal in the half section,

    .. math:: n \cdot \frac{1}{r} \frac{\partial u_s}{\partial \theta}
        = - \frac{1}{r} \big[ n_r V + n\, (n_r U + n_z W) \big] \sin n \theta ,

    so a row reads V, and *n* times a row on U and W.

    Returns
    -------
    around, turned (nc, nodes), (nc, 2 nodes) [-]
        Rows on V, and rows on U and W that count n times, each of a and of b.
    """
    sides = {"a": (mesh_a, surface_a), "b": (mesh_b, surface_b)}
    other, sign, parts = _numbered(space, sides)
    (mesh, _), (other_mesh, other_surface) = sides[space.slave], sides[other]
    around: dict[str, list[_Entries]] = {space.slave: [], other: []}
    turned: list[_Entries] = []
    for part, rows in parts:
        at, share, nodes = part.at, part.share, part.faces.connectivity[:, None]
        q, d = at.position.shape[1:]
        N, _ = shape_functions(part.faces.family, part.piece.xi)
        bend = _gap_at_touch(part, sign, space) / np.maximum(
            at.position[..., 0], np.finfo(float).tiny
        )
        away = np.broadcast_to(np.eye(d)[0], at.normal.shape)
        (first,) = _tangents(at.normal, away)
        # normal x first, as of a solid: along +theta or against it
        sense = at.normal[..., 1] * first[..., 0] - at.normal[..., 0] * first[..., 1]
        share = sign * sense[..., None] * share
        own = share * (1.0 + bend * at.normal[..., 0])[..., None]
        value = np.einsum("fqk,qn->fkn", own, N)[..., None]
        _store(around[space.slave], 1, rows[:, :, None], nodes, value)
        value = np.einsum("fqk,fq,qn,fqd->fknd", share, bend, N, at.normal)
        _store(turned, d, rows[:, :, None], nodes, value)
        flat = -share.reshape(-1, share.shape[2])
        along = np.ones((*flat.shape, 1))
        rows = np.repeat(rows, q, axis=0)
        _store_master(around[other], rows, flat, along, part.met, other_surface)
    V = {side: _scaled(around[side], space.area, sides[side][0].node_count) for side in sides}
    UW = {
        space.slave: _scaled(turned, space.area, mesh.dof_count),
        other: csr_array((space.count, other_mesh.dof_count)),
    }
    return (V["a"], V["b"]), (UW["a"], UW["b"])


def _dual_tangents(mesh: Mesh, block: FaceBlock, dN: NDArray[np.float64]) -> NDArray[np.float64]:
    """Gradients of the reference coordinates along faces, shape (f, q, d - 1, d) [1/m]."""
    along = np.einsum("qni,fnd->fqid", dN, mesh.points[block.connectivity])
    metric = np.einsum("fqid,fqjd->fqij", along, along)
    return np.asarray(np.linalg.solve(metric, along))


def _away_from_axis(points: NDArray[np.float64], central: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Unit vectors away from z, shape (..., d); along x for hats around it."""
    shape = np.broadcast_shapes(points.shape[:-1], central.shape)
    away = np.array(np.broadcast_to(points, (*shape, points.shape[-1])))
    away[..., -1] = 0.0
    size = np.linalg.norm(away, axis=-1)
    along_x = np.broadcast_to(central, shape) | (size == 0.0)
    away[along_x] = np.eye(points.shape[-1])[0]
    size[along_x] = 1.0
    return np.asarray(away / size[..., None])


def _tangents(
    normal: NDArray[np.float64], towards: NDArray[np.float64]
) -> tuple[NDArray[np.float64], ...]:
    """Directions at right angles to normals, each (..., d)."""
    d = normal.shape[-1]
    is_wall = np.abs(np.sum(normal * towards, axis=-1, keepdims=True)) > _WALL
    wanted = np.where(is_wall, np.eye(d)[-1], towards)
    if d == 2:
        along = np.stack([-normal[..., 1], normal[..., 0]], axis=-1)
        way = np.sum(along * wanted, axis=-1, keepdims=True)
        return (np.where(way < 0.0, -along, along),)
    first = wanted - np.sum(wanted * normal, axis=-1, keepdims=True) * normal
    first = first / np.linalg.norm(first, axis=-1, keepdims=True)
    return first, np.cross(normal, first)


def _scaled(parts: list[_Entries], area: NDArray[np.float64], columns: int) -> csr_array:
    """Matrix of the entries, rows over the area of their hat, without rows below zero."""
    row, column, value = (np.concatenate(part) for part in zip(*parts, strict=True))
    kept = row >= 0
    scaled = value[kept] / area[row[kept]]
    return coo_array((scaled, (row[kept], column[kept])), shape=(len(area), columns)).tocsr()


def _store_master(
    entries: list[_Entries],
    rows: NDArray[np.int64],
    share: NDArray[np.float64],
    along: NDArray[np.float64],
    met: Projection,
    surface: Surface,
) -> None:
    """Shares of the hats along directions (points, hats, d), over the met nodes."""
    for number, block in enumerate(surface.blocks):
        point = np.flatnonzero(met.block == number)
        if not len(point):
            continue
        N, _ = shape_functions(block.family, met.xi[point])
        value = np.einsum("pk,pn,pkd->pknd", share[point], N, along[point])
        nodes = block.connectivity[met.face[point]]
        _store(entries, along.shape[-1], rows[point][:, :, None], nodes[:, None, :], value)


def _store(
    entries: list[_Entries],
    dimension: int,
    rows: NDArray[np.int64],
    nodes: NDArray[np.int64],
    value: NDArray[np.float64],
) -> None:
    dofs = dimension * nodes[..., None] + np.arange(dimension)
    row, column, _ = np.broadcast_arrays(rows[..., None], dofs, value)
    entries.append((row.ravel(), column.ravel(), value.ravel()))


def _assemble(
    sides: dict[str, tuple[Mesh, Surface]],
    slave: Literal["a", "b"],
    sums: _Sums,
    inner: NDArray[np.int64],
    ring: NDArray[np.bool_],
    closest: NDArray[np.float64],
    limit: float,
    floor: float,
) -> ContactSpace:
    mesh, surface = sides[slave]
    full = np.where(sums.full > 0, sums.full, 1.0)
    facing = sums.covered > COVERED * full
    gap = sums.gap / np.where(facing, sums.covered, 1.0)
    inside = np.zeros(mesh.node_count, dtype=bool)
    inside[inner] = True
    candidate = inside & facing & (gap <= limit)
    if not np.any(candidate):  # the nearest hat alone, on a mesh far coarser than the reach
        candidate = inside & facing & (gap <= np.min(gap[inside & facing], initial=np.inf))
    nodes = np.flatnonzero(candidate)
    number = _numbers(mesh.node_count, nodes)
    area = sums.covered[nodes]
    matrices = {}
    for side, parts in ((slave, sums.slave), ("b" if slave == "a" else "a", sums.master)):
        numbered = [(number[row], column, value) for row, column, value in parts]
        matrices[side] = _scaled(numbered, area, sides[side][0].dof_count)
    left_out = facing & ~candidate & (gap > limit)
    axial = matrices["a"] @ np.tile(np.eye(mesh.dimension)[-1], sides["a"][0].node_count)
    return ContactSpace(
        G_a=matrices["a"],
        G_b=matrices["b"],
        gap=gap[nodes],
        area=area,
        points=mesh.points[nodes],
        axial=axial,
        rim=_touches(surface, ring, left_out, mesh.node_count)[nodes],
        size=_node_size(mesh, surface)[nodes],
        slave=slave,
        nodes=nodes,
        reach=limit - floor,
        clearance=_clearance(sums, nodes, axial),
        beyond=limit,
        entry=np.maximum(gap, closest)[nodes] - floor,
    )


def _clearance(sums: _Sums, nodes: NDArray[np.int64], axial: NDArray[np.float64]) -> float:
    """Axial distance of the surfaces where they touch first [m].

    The mean gap over a hat exceeds that at its node by curvature times mean square distance.  The
    means over the hat and over its square tell the two apart; the difference is averaged over the
    hats that touch first.  Gaps at single points would not do: the mixed cubic term that a 6-node
    face lacks makes them wiggle by some nanometres, on swept meshes of few layers by a hundred.
    """
    area, narrow = sums.covered[nodes], sums.narrow[nodes]
    mean, narrow_mean = sums.gap[nodes] / area, sums.narrow_gap[nodes] / narrow
    spread, narrow_spread = sums.spread[nodes] / area, sums.narrow_spread[nodes] / narrow
    whole = area > 0.99 * sums.full[nodes]
    excess = np.where(whole, (mean - narrow_mean) * spread / (spread - narrow_spread), 0.0)
    facing = np.flatnonzero(axial > 1e-6)
    if not len(facing):
        return float("inf")
    lift, excess = mean[facing] / axial[facing], excess[facing] / axial[facing]
    order = np.argsort(lift, kind="stable")
    window = lift[order[0]] + float(np.median(np.abs(excess[order[:_LOWEST]])))
    return float(lift[order[0]] - np.mean(excess[lift <= window]))


def _touches(
    surface: Surface, faces: NDArray[np.bool_], marked: NDArray[np.bool_], count: int
) -> NDArray[np.bool_]:
    """Nodes that share one of ``faces`` with a marked node."""
    result = np.zeros(count, dtype=bool)
    for block in _part(surface, faces).blocks:
        result[block.connectivity[marked[block.connectivity].any(axis=1)]] = True
    return result


def _node_size(mesh: Mesh, surface: Surface) -> NDArray[np.float64]:
    """Mean thickness of the faces at each node [m]."""
    thickness = face_thickness(mesh, surface)
    total, count = np.zeros(mesh.node_count), np.zeros(mesh.node_count)
    start = 0
    for block in surface.blocks:
        part = thickness[start : start + len(block.connectivity)]
        start += len(block.connectivity)
        np.add.at(total, block.connectivity, part[:, None])
        np.add.at(count, block.connectivity, 1.0)
    return total / np.maximum(count, 1.0)


def touching_shift(
    mesh_a: Mesh,
    surface_a: Surface,
    mesh_b: Mesh,
    surface_b: Surface,
    form: FaceForm | None = None,
) -> float:
    """Translation of a along z [m] after which the smallest weighted gap is zero.

    Lines along z give a first place; the weighted gaps are rebuilt after every move, since points
    slide along the other surface.

    Raises
    ------
    ConvergenceError
        After 30 moves.
    """
    shift = -axial_distance(mesh_a, surface_a, mesh_b, surface_b)
    _not_facing_if(not np.isfinite(shift), surface_a, surface_b)
    along = np.zeros(mesh_a.dimension)
    slave: Literal["a", "b"] | None = None
    slope, before, moved = 1.0, 0.0, 0.0
    for _ in range(30):
        along[-1] = shift
        space = contact_space(
            mesh_a.moved(along), surface_a, mesh_b, surface_b, slave=slave, form=form
        )
        if slave is None:  # only the faces at the touching place matter from now on
            slave = space.slave
            if slave == "a":
                surface_a = _part(surface_a, _faces_at(surface_a, space.nodes))
            else:
                surface_b = _part(surface_b, _faces_at(surface_b, space.nodes))
        elif moved:
            # between surfaces at an angle the gaps close faster than a rigid move along z tells
            slope = min(max((space.touch - before) / moved, 0.5), 100.0)
        before, moved = space.touch, -space.touch / slope
        shift += moved
        if abs(space.touch) <= 1e-12:
            return shift
    raise ConvergenceError(
        f"contact: placing surface '{surface_a.name}' on '{surface_b.name}' did not converge, "
        f"the last shift was {space.touch * 1e6:.3g} um.\n"
        "Try: a finer mesh on the contact surfaces."
    )


def _not_facing_if(wrong: object, surface_a: Surface, surface_b: Surface) -> None:
    refuse_if(
        wrong,
        f"contact of surface '{surface_a.name}' with surface '{surface_b.name}'",
        got="no line along a surface normal that meets the front of the other surface",
        expected="two surfaces that face each other",
        hint="check the names of the two surfaces, their units, their overlap and the axis z.",
    )
