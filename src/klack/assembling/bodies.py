"""From a case to meshed, placed and supported elastic bodies."""

import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from klack.assembling.assembled_bodies import assembled_from_matrices, node_mesh
from klack.assembling.bolts import bolted_joints
from klack.assembling.face_form import form_of_faces, layer_of_faces
from klack.assembling.fits import press_fits
from klack.assembling.gauges import place_gauges
from klack.assembling.generated_mesh import (
    coarsest_sound,
    meshed_for_case,
    meshed_profiles,
    meshed_step,
)
from klack.assembling.given_shapes import require_given_shapes, tell_effort
from klack.assembling.held_nodes import held_nodes
from klack.assembling.layers import layers_of
from klack.assembling.placement import Touch, first_touch_of_meshes, first_touch_of_profiles
from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.gauges.gauge import Gauge
from klack.case.bodies import CaseBody, CaseFile, SurfaceName, joints_told_at
from klack.case.geometry import MeshSettings
from klack.case.schema import Case
from klack.case.surface_names import place_of
from klack.contact.asperity_layer import AsperityLayer
from klack.contact.face_form import FaceForm
from klack.contact.mortar import contact_space, touching_shift
from klack.contact.pairing import axial_distance, curved_faces
from klack.contact.ray_cutting import CurvedFaces
from klack.contact.surface_edges import SurfaceEdges, surface_edges, turned_away
from klack.errors import AccuracyWarning, InputError
from klack.input.problem import Key
from klack.machine.progress import Progress
from klack.mesh.files.mesh_file import read_mesh_file
from klack.mesh.mesh import Mesh, Surface, solid_at
from klack.mesh.parting import parted
from klack.mesh.quality import PoorElementError
from klack.mesh.rigid import Pose
from klack.mesh.sizing import MeshSizing, Refinement
from klack.units import format_si

__all__ = [
    "BodyPair",
    "PlacedMeshes",
    "Places",
    "assemble_body",
    "build_bodies",
    "find_touch",
    "mesh_body",
    "named_contact",
    "place_meshes",
    "wanted_sizes",
    "warn_far_touch",
    "with_size",
]

C = TypeVar("C", bound=CaseFile)

Places = tuple[tuple[float, ...], ...]
"""Where meshes are refined: (r, z) or (x, y, z) [m]."""

_SAME_HEIGHT = 5e-4  # of the narrower surface; clearances that differ by less belong to one touch
_SAFE_SHARE = 0.5  # of the extent of a refinement; the rest is for the width of the contact


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyPair:
    """The two bodies of a case, placed for the start of the motion: the moving one is the upper.

    Parameters
    ----------
    pose
        Of the upper body from its drawing.
    form
        Of both faces, not in the meshes.
    layer
        Of both faces.
    slave
        Side of the contact points; None: the finer one.
    """

    upper: ElasticBody
    lower: ElasticBody
    upper_surface: Surface
    lower_surface: Surface
    pose: Pose
    gauges: tuple[Gauge, ...] = ()
    form: FaceForm | None = None
    layer: AsperityLayer | None = None
    slave: Literal["b"] | None = None

    @property
    def shift(self) -> float:
        """Translation of the upper body along z from its drawing [m]."""
        return float(self.pose.shift[2])

    @property
    def unknowns(self) -> int:
        """Of both bodies."""
        return self.upper.dof_count + self.lower.dof_count

    @cached_property
    def solids(self) -> tuple[str, str]:
        """Solids of the upper and lower surface."""
        return (
            solid_at(self.upper.mesh, self.upper_surface),
            solid_at(self.lower.mesh, self.lower_surface),
        )

    @cached_property
    def faces(self) -> tuple[CurvedFaces, CurvedFaces]:
        """Faces of both surfaces, ready to be cut by lines."""
        return (
            curved_faces(self.upper.mesh, self.upper_surface),
            curved_faces(self.lower.mesh, self.lower_surface),
        )

    @cached_property
    def edges(self) -> tuple[SurfaceEdges, SurfaceEdges]:
        """Edges of both surfaces."""
        return (
            surface_edges(self.upper.mesh, self.upper_surface),
            surface_edges(self.lower.mesh, self.lower_surface),
        )

    @cached_property
    def sharp_edges(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Edges of both surfaces that are corners towards the other."""
        upper, lower = self.edges
        return (
            upper.corners & turned_away(upper, self.lower.mesh, self.lower_surface),
            lower.corners & turned_away(lower, self.upper.mesh, self.upper_surface),
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedMeshes:
    """Meshes of both bodies, placed for the start; nothing is assembled.

    Parameters
    ----------
    pose
        Of the upper body from its drawing.
    form
        Of both faces, not in the meshes.
    touch
        As drawn; None where no mesh is refined there.
    """

    upper: Mesh
    lower: Mesh
    upper_surface: Surface
    lower_surface: Surface
    pose: Pose
    form: FaceForm | None
    touch: Touch | None


def place_meshes(case: Case, progress: Progress) -> PlacedMeshes:
    """Mesh both bodies and place the upper one; rejects bodies that penetrate as drawn."""
    _require_surfaces(case)
    case.require_pair("this computation")
    progress("mesh", 0.0)
    shapes = require_given_shapes(
        case, lambda name: mesh_body(case.bodies[name], name, ()), progress
    )
    moving, stop = case.contact.moving, case.contact.stop
    with named_contact(case, ("contact", "between"), moving, stop):
        touch = find_touch(case.bodies, moving, stop)
    places = {
        moving.body: _places_of_moving_body(case, touch),
        stop.body: touch.lower if touch else (),
    }
    tell_effort(case, shapes, wanted_sizes(case.bodies, places), progress)

    def places_at(name: str, size: float) -> Places:
        other = with_size(case, name, size)
        found = find_touch(other.bodies, moving, stop)
        if name == moving.body:
            return _places_of_moving_body(other, found)
        return found.lower if found else ()

    meshes = []
    for i, name in enumerate((moving.body, stop.body)):
        progress("mesh", i / 2)
        meshes.append(mesh_body(case.bodies[name], name, places[name], partial(places_at, name)))
    upper, lower = meshes
    upper_surface, lower_surface = upper.surface(moving.surface), lower.surface(stop.surface)
    with named_contact(case, ("contact", "between"), moving, stop):
        pose, form = _pose(case, upper, upper_surface, lower, lower_surface, touch)
    upper = upper.moved(pose.shift[2:] * [0.0, 1.0]) if upper.dimension == 2 else upper.placed(pose)
    _check_refinement(case, upper, upper_surface, lower, lower_surface, touch, pose, form)
    progress("mesh", 1.0)
    return PlacedMeshes(
        upper=upper,
        lower=lower,
        upper_surface=upper_surface,
        lower_surface=lower_surface,
        pose=pose,
        form=form,
        touch=touch,
    )


def build_bodies(case: Case, progress: Progress) -> BodyPair:
    """Mesh and place as :func:`place_meshes`, and assemble stiffness and mass."""
    placed = place_meshes(case, progress)
    moving, stop = case.contact.moving, case.contact.stop
    upper, lower, pose = placed.upper, placed.lower, placed.pose
    progress("assemble", 0.0)
    bodies = []
    for i, (name, mesh) in enumerate(((moving.body, upper), (stop.body, lower))):
        bodies.append(assemble_body(case, name, mesh))
        progress("assemble", (i + 1) / 2)
    return BodyPair(
        upper=bodies[0],
        lower=bodies[1],
        upper_surface=placed.upper_surface,
        lower_surface=placed.lower_surface,
        pose=pose,
        gauges=place_gauges(case, {moving.body: (upper, pose), stop.body: (lower, None)}),
        form=placed.form,
        layer=layer_of_faces(case, upper, placed.upper_surface, lower, placed.lower_surface),
        slave=None if case.dimension == 2 or case.motion.is_straight else "b",
    )


def _require_surfaces(case: Case) -> None:
    for name, body in case.bodies.items():
        if not body.has_surfaces:
            raise InputError(
                f"{case.path or 'case'}: bodies.{name}",
                got="a reduced model, or nodes without elements",
                expected="bodies with meshed surfaces",
                hint="'klack impact', 'klack reduce' and 'klack export' take such bodies.",
            )


def _places_of_moving_body(case: Case, touch: Touch | None) -> Places:
    """First touches of the moving body with either stop, as drawn."""
    places = touch.upper if touch else ()
    if case.opposite is not None:
        stop, moving = case.opposite.stop, case.opposite.moving
        with named_contact(case, ("opposite", "between"), stop, moving):
            above = find_touch(case.bodies, stop, moving)
        places += above.lower if above else ()
    return places


@contextmanager
def named_contact(
    case: CaseFile, key: Key, upper: SurfaceName, lower: SurfaceName
) -> Iterator[None]:
    """Give errors of surfaces that do not meet their place in the case."""
    try:
        yield
    except InputError as error:
        if not error.where.startswith("contact of"):
            raise
        raise InputError(
            f"{place_of(case, key, on_key=False)}: {upper} on {lower}",
            got=error.got,
            expected=error.expected,
            hint=error.hint,
        ) from error


def find_touch(
    bodies: Mapping[str, CaseBody], upper: SurfaceName, lower: SurfaceName
) -> Touch | None:
    """First touch of two surfaces; None where neither body is refined there."""
    pair = (bodies[upper.body], bodies[lower.body])
    extents = [body.mesh.contact.extent for body in pair if body.mesh and body.mesh.contact]
    if not extents:
        return None
    above, below = (body.geometry.profile for body in pair)
    if above is not None and below is not None:
        return first_touch_of_profiles(
            above.profiles().values(), upper.surface, below.profiles().values(), lower.surface
        )
    # a first mesh without refinement tells where to refine
    meshes = [mesh_body(bodies[name], name) for name in (upper.body, lower.body)]
    return first_touch_of_meshes(
        meshes[0],
        meshes[0].surface(upper.surface),
        meshes[1],
        meshes[1].surface(lower.surface),
        tolerance=min(extents) / 5.0,
    )


def assemble_body(case: CaseFile, name: str, mesh: Mesh) -> ElasticBody:
    """Stiffness and mass of a body, assembled or given, with its supports.

    Warns
    -----
    AccuracyWarning
        Of materials that no solid has (:attr:`klack.materials.material.Material.question`), and of
        press fits and bolts (:attr:`klack.assembling.fits.PressFit.doubts`).
    """
    body = case.bodies[name]
    if body.matrices is not None:
        return assembled_from_matrices(case, name, mesh)
    materials = case.materials_of(name, mesh.solids)
    for material in materials.values():
        if material.question is not None:
            warnings.warn(material.question, AccuracyWarning, stacklevel=2)
    fits, bolts = press_fits(case, name), bolted_joints(case, name)
    for doubt in (*(d for fit in fits for d in fit.doubts), *(d for b in bolts for d in b.doubts)):
        warnings.warn(doubt, AccuracyWarning, stacklevel=2)
    return elastic_body(
        name,
        mesh,
        materials,
        fixed_nodes=held_nodes(body, mesh),
        layers=layers_of(case, name),
    )


def with_size(case: C, name: str, size: float) -> C:
    """Same case with another general element size [m] of a body."""
    body = case.bodies[name]
    if body.mesh is None:
        return case
    changed = body.model_copy(update={"mesh": body.mesh.model_copy(update={"size": size})})
    return case.model_copy(update={"bodies": {**case.bodies, name: changed}})


def mesh_body(
    body: CaseBody,
    name: str,
    places: Places | None = None,
    places_at: Callable[[float], Places] | None = None,
) -> Mesh:
    """Mesh one body, parted at its layers.

    Parameters
    ----------
    places [m]
        Of refinements.  Without, a first mesh to look at: finer than wanted where its elements
        would be poor.
    places_at
        Places of a case with another general size [m].
    """
    whole = _whole_mesh(body, name, places, places_at)
    with joints_told_at("bodies", name, "layers"):
        return parted(whole, body.layers or ())[0]


def _whole_mesh(
    body: CaseBody,
    name: str,
    places: Places | None,
    places_at: Callable[[float], Places] | None,
) -> Mesh:
    geometry = body.geometry
    if geometry.nodes is not None:
        return node_mesh(geometry.nodes, geometry.dimension, f"bodies.{name}.geometry.nodes")[0]
    if geometry.mesh is not None:
        solids = tuple(body.material) if isinstance(body.material, dict) else None
        given = geometry.mesh
        mesh = read_mesh_file(
            given.file, given.unit, solids=solids, solids_only=given.solids_only
        ).mesh
        _require_dimension(geometry.mesh.file, mesh, geometry.dimension)
        return mesh
    if body.mesh is None:  # refused by the schema already
        raise InputError(
            f"bodies.{name}", got="no element sizes", expected="mesh", hint="add mesh: {size: ...}."
        )
    if geometry.step is not None:
        step = geometry.step

        def mesher(sizing: MeshSizing) -> Mesh:
            return meshed_step(step, sizing)

        return _meshed(name, body.mesh, mesher, places, places_at)
    if geometry.profile is None:
        raise InputError(
            f"bodies.{name}.geometry", got="no shape", expected="a profile", hint="draw one."
        )
    profiles = geometry.profile.profiles()
    model, layers = geometry.model or "axisymmetric", geometry.layers

    def of_profiles(sizing: MeshSizing) -> Mesh:
        return meshed_profiles(profiles, sizing, model, layers)

    rings = None if places is None else tuple(_ring(at) for at in places)
    return _meshed(name, body.mesh, of_profiles, rings, None)


def _meshed(
    name: str,
    settings: MeshSettings,
    mesher: Callable[[MeshSizing], Mesh],
    places: Places | None,
    places_at: Callable[[float], Places] | None,
) -> Mesh:
    """Mesh in the sizes of the case; without places, a first mesh."""
    if places is None:
        with suppress(PoorElementError):  # the message comes from below
            return coarsest_sound(_sizing(settings, ()), mesher)
    sizing = _sizing(settings, places or ())
    if places_at is None:
        return meshed_for_case(name, sizing, mesher)

    def at_size(size: float) -> MeshSizing:
        return replace(_sizing(settings, places_at(size)), size=size)

    return meshed_for_case(name, sizing, mesher, at_size)


def wanted_sizes(
    bodies: Mapping[str, CaseBody], places: Mapping[str, Places]
) -> dict[str, MeshSizing]:
    """Element sizes of the bodies that klack meshes, refined at places."""
    return {
        name: _sizing(settings, own)
        for name, own in places.items()
        if (settings := bodies[name].mesh) is not None
    }


def _ring(place: tuple[float, ...]) -> tuple[float, ...]:
    """Ring (r, z) through a place."""
    return (float(np.hypot(place[0], place[1])), place[2]) if len(place) == 3 else place


def _require_dimension(file: Path, mesh: Mesh, dimension: int) -> None:
    if mesh.dimension != dimension:
        kind = {2: "axisymmetric", 3: "three-dimensional"}
        raise InputError(
            str(file),
            got=f"{kind[mesh.dimension]} elements",
            expected=f"{kind[dimension]} elements",
            hint="add 'model: axisymmetric' to the geometry of a half-section mesh.",
        )


def _sizing(settings: MeshSettings, places: Places) -> MeshSizing:
    refinements: tuple[Refinement, ...] = ()
    if settings.contact is not None:
        refinements = tuple(
            Refinement(position=at, size=settings.contact.size, radius=settings.contact.extent)
            for at in places
        )
    return MeshSizing(
        size=settings.size,
        surfaces=settings.surfaces,
        refinements=refinements,
        grading=settings.grading,
    )


def _shift(
    case: Case, upper: Mesh, surface: Surface, lower: Mesh, other: Surface, form: FaceForm | None
) -> float:
    """Translation of the upper body along z [m] to the gap of the case."""
    if case.contact.gap is not None:
        return touching_shift(upper, surface, lower, other, form) + case.contact.gap
    distance = axial_distance(upper, surface, lower, other)
    if distance < 0:
        raise InputError(
            f"{case.path or 'case'}: contact",
            got=f"bodies that overlap by {-distance * 1e6:.4g} um as drawn",
            expected="a distance of 0 or more between the two surfaces",
            hint="give contact.gap (for example 0 um): the upper body is then moved there.",
        )
    return 0.0


def _pose(
    case: Case, upper: Mesh, surface: Surface, lower: Mesh, other: Surface, touch: Touch | None
) -> tuple[Pose, FaceForm | None]:
    """Tilt the upper body, shift it sideways, and move it along z to the gap of the case.

    With the form of its face. Axisymmetric bodies stay on the axis, see
    :mod:`klack.assembling.off_axis`.
    """
    placement = case.motion.placement
    about, aside, lean = np.zeros(3), np.zeros(3), np.zeros(3)
    if not placement.is_centred and upper.dimension == 3:
        about[2] = _touch_height(upper, surface, lower, other, touch)
        aside = placement.eccentricity * _towards(placement.direction)
        # z x d: the upper end leans towards d
        lean = placement.tilt * np.cross([0.0, 0.0, 1.0], _towards(placement.tilt_direction))
        upper = upper.placed(Pose(rotation=lean, about=about, shift=aside))
    form = form_of_faces(case, upper, surface, lower, other)
    shift = _shift(case, upper, surface, lower, other, form)
    return Pose(rotation=lean, about=about, shift=aside + np.array([0.0, 0.0, shift])), form


def _towards(angle: float) -> np.ndarray:
    return np.array([np.cos(angle), np.sin(angle), 0.0])


def _touch_height(
    upper: Mesh, surface: Surface, lower: Mesh, other: Surface, touch: Touch | None
) -> float:
    """Height z [m] of first touch when centred, in the drawing of the upper body."""
    if touch is None or not touch.upper:
        width = min(
            float(np.max(np.ptp(mesh.points[of.nodes][:, :2], axis=0)))
            for mesh, of in ((upper, surface), (lower, other))
        )
        touch = first_touch_of_meshes(upper, surface, lower, other, tolerance=_SAME_HEIGHT * width)
    return float(np.mean([place[-1] for place in touch.upper]))


def _check_refinement(
    case: Case,
    upper: Mesh,
    surface: Surface,
    lower: Mesh,
    other: Surface,
    touch: Touch | None,
    pose: Pose,
    form: FaceForm | None,
) -> None:
    """Warn when the first touch leaves the fine meshes."""
    if case.motion.placement.is_centred or touch is None or not touch.upper:
        return
    if upper.dimension == 2:  # where they touch off-axis, the contact points on rings tell
        return
    space = contact_space(upper, surface, lower, other, form=form)
    facing = space.axial > 1e-6
    at = space.points[facing][np.argmin(space.gap[facing] / space.axial[facing])]
    sides = (
        (case.contact.moving.body, case.moving_body, touch.upper, pose.drawn(at)),
        (case.contact.stop.body, case.stop_body, touch.lower, at),
    )
    for name, body, places, point in sides:
        if body.mesh is None or body.mesh.contact is None:
            continue
        extent = body.mesh.contact.extent
        turned = body.geometry.profile is not None
        first = _ring(tuple(point)) if turned else tuple(point)
        rings = [_ring(place) if turned else place for place in places]
        away = min(float(np.linalg.norm(np.subtract(first, ring))) for ring in rings)
        warn_far_touch(name, away, extent)


def warn_far_touch(name: str, away: float, extent: float) -> None:
    """Warn where a body touches far from its finest mesh.

    Parameters
    ----------
    away [m]
        From the refinement.
    extent [m]
        Of the refinement.
    """
    if away > _SAFE_SHARE * extent:
        warnings.warn(
            f"'{name}' touches first {format_si(away, 'm', 2)} away from its finest "
            f"mesh; the refinement reaches {format_si(extent, 'm', 2)}. Try: an extent of "
            f"{format_si(1.2 * away / _SAFE_SHARE, 'm', 2)} in bodies.{name}.mesh.contact, or "
            "a smaller placement.",
            AccuracyWarning,
            stacklevel=2,
        )
