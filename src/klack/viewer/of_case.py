"""The view of a case or of a mesh; nothing is solved, bodies are meshed where they are not yet."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack import __version__
from klack.analyses.impact.section import section_picture
from klack.assembling.bodies import place_meshes
from klack.assembling.held_nodes import held_nodes
from klack.assembling.placement import Touch, first_touch_of_meshes, first_touch_of_profiles
from klack.assembling.valve import mesh_valve_bodies
from klack.case.bodies import CaseBody, CaseFile, SurfaceName
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.errors import InputError
from klack.mesh.mesh import Mesh
from klack.mesh.quality import edge_lengths
from klack.progress import Progress, silent
from klack.schematic.picture import schematic_svg
from klack.units import format_si
from klack.viewer.skin import skin_of_mesh
from klack.viewer.view import BodyView, ContactView, View

__all__ = ["body_view", "view_of_case", "view_of_meshes"]

Floats = NDArray[np.float64]

_RING = 90  # points of a ring of first touch
_SAME_HEIGHT = 5e-4  # of the width of the bodies: clearances that differ by less are one touch


def view_of_case(case: Case | ValveCase, progress: Progress = silent) -> View:
    """Bodies of a case in their places, with their supports, contacts and network.

    Parameters
    ----------
    case : Case or ValveCase
    progress : callable
    """
    view = View(
        title=case.title or case.name,
        source=f"case {case.name}",
        description=case.description.strip(),
        version=__version__,
        bodies=(),
    )
    if isinstance(case, ValveCase):
        return _valve_view(case, view, progress)
    if not case.has_surfaces:
        raise InputError(
            f"{case.path or 'case'}: bodies",
            got="reduced models, or nodes without elements",
            expected="bodies with surfaces",
            hint="klack inspect tells what is in such a case.",
        )
    placed = place_meshes(case, progress)
    moving, stop = case.contact.moving, case.contact.stop
    meshes = {moving.body: placed.upper, stop.body: placed.lower}
    contact = _contact(
        "contact",
        (moving, placed.upper, case.moving_body),
        (stop, placed.lower, case.stop_body),
        gap=case.contact.gap,
    )
    return replace(view, bodies=_bodies(case, meshes), contacts=(contact,))


def _valve_view(case: ValveCase, view: View, progress: Progress) -> View:
    notes, drawn = [], {}
    shaped = {name for name, body in case.bodies.items() if body.has_surfaces}
    if shaped == set(case.bodies) and shaped:
        drawn = mesh_valve_bodies(case, progress)
    elif case.bodies:
        notes.append("Bodies without surfaces (reduced models, nodes alone) are not drawn.")
    else:
        notes.append("All bodies of this valve are rigid masses without a shape: its network only.")
    contacts = []
    for name, stop in case.stops.items():
        if stop.upper.body in drawn and stop.lower.body in drawn:
            contacts.append(
                _contact(
                    name,
                    (stop.upper, drawn[stop.upper.body], case.bodies[stop.upper.body]),
                    (stop.lower, drawn[stop.lower.body], case.bodies[stop.lower.body]),
                    gap=getattr(case.network.components[name], "gap", None),
                )
            )
    if drawn:
        notes.append("Bodies stand as drawn; gaps of the stops are those of the network.")
    return replace(
        view,
        bodies=_bodies(case, drawn),
        contacts=tuple(contacts),
        schematic=schematic_svg(case.network.network(), ""),
        notes=tuple(notes),
    )


def view_of_meshes(meshes: Mapping[str, Mesh], source: str) -> View:
    """Bodies of mesh or CAD files, as they are."""
    bodies = tuple(
        body_view(name, mesh, np.empty(0, dtype=np.int64), _mesh_words(mesh))
        for name, mesh in meshes.items()
    )
    return View(title=source, source=source, description="", version=__version__, bodies=bodies)


def _bodies(case: CaseFile, meshes: Mapping[str, Mesh]) -> tuple[BodyView, ...]:
    found = []
    for name, mesh in meshes.items():
        given = case.bodies[name]
        words = f"{_source(given)}; {_mesh_words(mesh)}"
        found.append(body_view(name, mesh, held_nodes(given, mesh), words))
    return tuple(found)


def body_view(name: str, mesh: Mesh, held: NDArray[np.int64], about: str) -> BodyView:
    """A body as its mesh is.

    Parameters
    ----------
    name : str
    mesh : Mesh
    held : int array
        Nodes.
    about : str
    """
    skin = skin_of_mesh(mesh)
    is_held = np.zeros(mesh.node_count, dtype=bool)
    is_held[held] = True
    return BodyView(
        name=name,
        about=about,
        skin=skin,
        held=is_held[skin.node],
        section=_section(mesh, name),
        finest=float(edge_lengths(mesh).min()),
    )


def _section(mesh: Mesh, name: str) -> Floats:
    """Sides of elements in the plane y = 0, on both sides of the axis; none where it misses."""
    sides = []
    for sign in (1.0, -1.0):
        turned = mesh if mesh.dimension == 2 else replace(mesh, points=mesh.points * [sign, sign, 1])
        try:
            cut = section_picture(turned, np.zeros(mesh.dof_count), 0.0, name)
        except InputError:
            continue
        r, z = cut.points[cut.edges].transpose(2, 0, 1)
        sides.append(np.stack([sign * r, 0.0 * r, z], axis=2))
    return np.concatenate([np.empty((0, 2, 3)), *sides])


def _source(body: CaseBody) -> str:
    geometry = body.geometry
    if geometry.mesh is not None:
        return f"mesh file {geometry.mesh.file.name}"
    if geometry.step is not None:
        return f"STEP file {geometry.step.file.name}"
    layers = f" in {geometry.layers} layers" if geometry.layers else ""
    return f"profile, {geometry.model}{layers}"


def _mesh_words(mesh: Mesh) -> str:
    finest = format_si(float(edge_lengths(mesh).min()), "m", 2)
    return f"{mesh.node_count} nodes, {mesh.element_count} elements, shortest side {finest}"


def _contact(
    name: str,
    upper: tuple[SurfaceName, Mesh, CaseBody],
    lower: tuple[SurfaceName, Mesh, CaseBody],
    *,
    gap: float | None,
) -> ContactView:
    """Where two bodies touch first when they are centred; ``gap`` is that of the case, or None."""
    touch = _touch(upper, lower)
    ring = np.array(touch.lower, dtype=float)
    if len(ring) and ring.shape[1] == 2:
        turn = np.linspace(0.0, 2.0 * np.pi, _RING, endpoint=False)
        r, z = ring[0]
        ring = np.column_stack([r * np.cos(turn), r * np.sin(turn), np.full(_RING, z)])
    ring = ring.reshape(-1, 3)
    ring = ring[np.argsort(np.arctan2(ring[:, 1], ring[:, 0]))]
    return ContactView(
        name=name,
        upper=str(upper[0]),
        lower=str(lower[0]),
        ring=ring,
        closed=len(ring) > 40,
        gap=touch.clearance if gap is None else gap,
    )


def _touch(
    upper: tuple[SurfaceName, Mesh, CaseBody], lower: tuple[SurfaceName, Mesh, CaseBody]
) -> Touch:
    (name_a, mesh_a, body_a), (name_b, mesh_b, body_b) = upper, lower
    above, below = body_a.geometry.profile, body_b.geometry.profile
    if above is not None and below is not None:
        profiles = above.profiles().values(), below.profiles().values()
        return first_touch_of_profiles(profiles[0], name_a.surface, profiles[1], name_b.surface)
    if mesh_a.dimension == 2 or mesh_b.dimension == 2:
        return Touch((), (), 0.0)
    surfaces = mesh_a.surface(name_a.surface), mesh_b.surface(name_b.surface)
    width = min(
        float(np.max(np.ptp(mesh.points[of.nodes][:, :2], axis=0)))
        for mesh, of in zip((mesh_a, mesh_b), surfaces, strict=True)
    )
    return first_touch_of_meshes(
        mesh_a, surfaces[0], mesh_b, surfaces[1], tolerance=_SAME_HEIGHT * width
    )
