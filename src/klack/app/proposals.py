"""Which faces of a new valve meet, and which one is held, proposed from its geometry.

The needle moves down along z until it touches: of all lines along z through both bodies, the
shortest ones from a face of the needle down to a face of the housing say which two meet.  Compared
are the coarse meshes for the picture, from points on either body: solids to :data:`_SLACK` of the
smaller one, half sections to round-off.  Of faces that are equally near, those that are so at the
most points meet, if all of it is one place.  Bodies that overlap by more than the slack, and faces
that are equally near at several places, get no proposal.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from klack.app.answers import Proposal
from klack.app.parts import Part
from klack.app.plan_review import overlap
from klack.bodies.elasticity.shape_functions import reference_nodes
from klack.contact.pairing import face_geometry, face_lattice, project_to_surface
from klack.mesh.mesh import FaceBlock, Mesh, Surface
from klack.units import format_si

__all__ = ["proposal"]

Floats = NDArray[np.float64]

_SLACK = 5e-4  # of the longest side of the smaller body: coarse meshes tell gaps apart
_ROUND = 1e-9  # [m] of drawings in mm with six digits
_FACING = 0.02  # least share along z of a normal that faces the other body; less is a wall
_LATTICE = 8  # points along a face of an element
# of such a face, from its rim: not what lies exactly beside a body; flat chords of round solids
_INWARDS = {2: 1e-7, 3: 0.02}
_APART = 0.01  # of the longest side of the smaller body: from there on it is another place
_FLAT = 1e-6  # of normals, and of the size of a body
_LARGE = 0.1  # of the largest flat outer face
_FARTHER = 1.02  # than the next one
_NO_CONTACT = "No contact faces are proposed:"
_NO_HELD = "no held face is proposed:"


def proposal(parts: Mapping[str, Part], model: str) -> Proposal:
    """Propose faces for needle and housing in a model, with the reason, or say why none."""
    needle, housing = parts["needle"], parts["housing"]
    side = min(needle.longest, housing.longest)
    resolved = _ROUND if needle.is_half(model) else _SLACK * side
    within = overlap(parts, 0.0)
    if within and overlap(parts, _SLACK * side):
        return Proposal(words=f"{_NO_CONTACT} the bodies overlap as drawn ({within}).")
    meshes = needle.picture_mesh(model), housing.picture_mesh(model)
    pairs = _pairs(_side(meshes[0], -1.0), _side(meshes[1], 1.0), _SLACK * side)
    if not pairs:
        words = (
            f"{_NO_CONTACT} no face of the housing lies below the needle along z. The needle is "
            "above, and the axis of motion is z, in both files."
        )
        return Proposal(words=words)
    gap = min(float(gaps.min()) for gaps, _ in pairs.values())
    zones = {pair: points[gaps < gap + resolved] for pair, (gaps, points) in pairs.items()}
    above, below = max(zones, key=lambda pair: len(zones[pair]))
    zone = KDTree(zones[above, below])
    apart = [
        pair
        for pair, points in zones.items()
        if len(points) and np.max(zone.query(points)[0]) > _APART * side
    ]
    if apart:
        every = " and ".join(f"needle.{a} on housing.{b}" for a, b in [(above, below), *apart[:3]])
        words = (
            f"{_NO_CONTACT} {every} are equally near along the axis, to "
            f"{format_si(resolved, 'm', 2)}. If they are one contact, give its faces one name in "
            "the CAD program."
        )
        return Proposal(words=words)
    how = "touching as drawn"
    if abs(gap) > resolved:
        how = f"{format_si(abs(gap), 'm', 2)} {'apart' if gap > 0.0 else 'overlapping'} as drawn"
    farther = [(gaps.min(), *pair) for pair, (gaps, _) in pairs.items() if not len(zones[pair])]
    if farther:
        other, a, b = min(farther)
        how += f" (next: needle.{a} on housing.{b}, {format_si(other, 'm', 2)})"
    place = zone.data.mean(axis=0)
    walls = [face.name for face in housing.facts.faces if face.place == "outside"]
    held, why = _held(meshes[1], walls if housing.is_half(model) else [], below, place)
    words = (
        f"Proposed from the geometry: needle.{above} hits housing.{below}, which are nearest along "
        f"the axis, {how}; {why}. Change what is otherwise."
    )
    return Proposal(needle_contact=above, housing_contact=below, held=held, words=words)


@dataclass(frozen=True, kw_only=True)
class _Side:
    """What of a mesh faces the other body.

    Parameters
    ----------
    surface
        All these faces of elements.
    names (f,)
        The face of the body that each belongs to.
    points (p, d) [m]
        On them, with the names they belong to.
    """

    mesh: Mesh
    surface: Surface
    names: NDArray[np.str_]
    points: Floats
    owners: NDArray[np.str_]


def _side(mesh: Mesh, up: float) -> _Side:
    """Faces of a mesh whose normals have the sign ``up`` along z."""
    blocks, names, points, owners = [], [], [], []
    for name, surface in mesh.surfaces.items():
        for block in surface.blocks:
            nodes = reference_nodes(block.family)
            inner = nodes + _INWARDS[mesh.points.shape[1]] * (nodes.mean(axis=0) - nodes)
            places = np.concatenate([face_lattice(block.family, _LATTICE), inner])
            found = face_geometry(mesh.points, block, places)
            facing = up * found.normal[..., -1] > _FACING
            some = facing.any(axis=1)
            blocks.append(FaceBlock(block.family, block.connectivity[some]))
            names += [name] * int(some.sum())
            points.append(found.position[facing])
            owners += [name] * len(points[-1])
    return _Side(
        mesh=mesh,
        surface=Surface("", tuple(blocks)),
        names=np.array(names, dtype=np.str_),
        points=np.concatenate(points),
        owners=np.array(owners, dtype=np.str_),
    )


_Pairs = dict[tuple[str, str], tuple[Floats, Floats]]


def _pairs(upper: _Side, lower: _Side, slack: float) -> _Pairs:
    """Gaps [m] of each pair of faces with nothing between, and their places."""
    found: dict[tuple[str, str], list[tuple[Floats, Floats]]] = {}
    for side, other, up in ((upper, lower, -1.0), (lower, upper, 1.0)):
        if not len(side.points) or not len(other.names):
            continue
        along = np.zeros_like(side.points)
        along[:, -1] = up
        met = project_to_surface(side.points, along, other.mesh, other.surface, deepest=slack)
        starts = np.cumsum([0, *(len(block.connectivity) for block in other.surface.blocks)])
        hit = np.where(met.met, other.names[starts[met.block] + met.face], "")
        for a, b in {*zip(side.owners[met.met], hit[met.met], strict=True)}:
            some = (side.owners == a) & (hit == b)
            pair = (str(a), str(b)) if side is upper else (str(b), str(a))
            found.setdefault(pair, []).append((met.gap[some], side.points[some]))
    return {
        pair: (np.concatenate([gaps for gaps, _ in sides]), np.concatenate([at for _, at in sides]))
        for pair, sides in found.items()
    }


def _held(housing: Mesh, walls: list[str], contact: str, place: Floats) -> tuple[str, str]:
    """Name of the large flat outer face farthest from a place, if there is one, and the reason.

    A straight line of a half section is a flat face; its ``walls`` come first, if there are any.
    """
    size = float(np.linalg.norm(np.ptp(housing.points, axis=0)))
    outer = []
    for name in walls or housing.surfaces:
        area, centre, normal = _flat(housing, housing.surface(name))
        outside = (housing.points - centre) @ normal
        if name != contact and area > 0.0 and outside.max() < _FLAT * size:
            outer.append((float(np.linalg.norm(centre - place)), area, name))
    largest = max((area for _, area, _ in outer), default=0.0)
    far = sorted((found for found in outer if found[1] >= _LARGE * largest), reverse=True)
    if not far:
        return "", f"{_NO_HELD} the housing has no flat outer face"
    if len(far) > 1 and far[0][0] < _FARTHER * far[1][0]:
        every = f"housing.{far[0][2]} and housing.{far[1][2]}"
        return "", f"{_NO_HELD} {every}, flat and outside, are equally far from there"
    return far[0][2], f"housing.{far[0][2]} is held, the outer face farthest from there"


def _flat(mesh: Mesh, surface: Surface) -> tuple[float, Floats, Floats]:
    """Area, centre and normal of a flat surface; no area for another one."""
    found = [face_geometry(mesh.points, b, face_lattice(b.family, 4)) for b in surface.blocks]
    stretch = np.concatenate([f.stretch.ravel() for f in found])
    d = mesh.points.shape[1]
    normals = np.concatenate([f.normal.reshape(-1, d) for f in found])
    positions = np.concatenate([f.position.reshape(-1, d) for f in found])
    centre = np.average(positions, axis=0, weights=stretch)
    is_flat = np.max(np.abs(normals - normals[0])) < _FLAT
    return is_flat * float(stretch.sum()), centre, normals[0]
