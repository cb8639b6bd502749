"""The view of a case or of a mesh; nothing is solved, bodies are meshed where they are not yet."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack import __version__
from klack.analyses.impact.body_picture import section_lines
from klack.assembling.bodies import place_meshes
from klack.assembling.held_nodes import held_nodes
from klack.assembling.touch_ring import TouchingSide, goes_round, touch_ring
from klack.assembling.valve import mesh_valve_bodies
from klack.case.bodies import CaseBody, CaseFile
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.errors import InputError
from klack.mesh.mesh import Mesh
from klack.mesh.quality import edge_lengths
from klack.mesh.skin import skin_of_mesh
from klack.progress import Progress, silent
from klack.schematic.picture import schematic_svg
from klack.units import format_si
from klack.viewer.view import BodyView, ContactView, View

__all__ = ["body_view", "view_of_case", "view_of_mesh"]


def view_of_case(case: Case | ValveCase, progress: Progress = silent) -> View:
    """Bodies of a case in their places, with their supports, contacts and network.

    Parameters
    ----------
    case : Case or ValveCase
    progress : callable
    """
    view = View(
        name=case.name,
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
        TouchingSide(case.moving_body, placed.upper, moving.surface),
        TouchingSide(case.stop_body, placed.lower, stop.surface),
        (str(moving), str(stop)),
        case.contact.gap,
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
            sides = [
                TouchingSide(case.bodies[side.body], drawn[side.body], side.surface)
                for side in (stop.upper, stop.lower)
            ]
            gap = getattr(case.network.components[name], "gap", None)
            names = (str(stop.upper), str(stop.lower))
            contacts.append(_contact(name, sides[0], sides[1], names, gap))
    if drawn:
        notes.append("Bodies stand as drawn; gaps of the stops are those of the network.")
    return replace(
        view,
        bodies=_bodies(case, drawn),
        contacts=tuple(contacts),
        schematic=schematic_svg(case.network.network(), ""),
        notes=tuple(notes),
    )


def view_of_mesh(mesh: Mesh, source: str, note: str = "") -> View:
    """The body of a mesh or CAD file, as it is."""
    name = Path(source).stem
    return View(
        name=name,
        title=source,
        source=source,
        description="",
        version=__version__,
        bodies=(body_view(name, mesh, np.empty(0, dtype=np.int64), _mesh_words(mesh)),),
        notes=(note,) if note else (),
    )


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
        section=section_lines(mesh, name),
        finest=float(edge_lengths(mesh).min()),
    )


def _source(body: CaseBody) -> str:
    geometry = body.geometry
    if geometry.mesh is not None:
        return f"mesh file {geometry.mesh.file.name}"
    if geometry.step is not None:
        return f"STEP file {geometry.step.file.name}"
    layers = f" in {geometry.layers} layers" if geometry.layers else ""
    return f"profile, {geometry.model}{layers}"


def _mesh_words(mesh: Mesh) -> str:
    finest = format_si(float(edge_lengths(mesh).min()), "m", 2).replace("um", "µm")
    return f"{mesh.node_count} nodes, {mesh.element_count} elements, shortest side {finest}"


def _contact(
    name: str, upper: TouchingSide, lower: TouchingSide, names: tuple[str, str], gap: float | None
) -> ContactView:
    """Where two bodies touch first when they are centred; ``gap`` is that of the case, or None."""
    ring, clearance = touch_ring(upper, lower)
    return ContactView(
        name=name,
        upper=names[0],
        lower=names[1],
        ring=ring,
        closed=goes_round(ring),
        gap=clearance if gap is None else gap,
    )
