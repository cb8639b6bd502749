"""Views of cases, meshes and results; nothing is solved."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack import __version__
from klack.analyses.impact.body_picture import section_lines
from klack.analyses.impact.record import BodyPicture, ImpactStudy
from klack.analyses.inspection import Inspected, Row, expanded_rows, inspect_bodies, meeting_rows
from klack.analyses.stroke.record import StrokeStudy, StrokeVariant
from klack.assembling.bodies import place_meshes
from klack.assembling.body_row import row_as_valve
from klack.assembling.held_nodes import held_nodes
from klack.assembling.touch_ring import TouchingSide, goes_round, touch_ring
from klack.assembling.valve import mesh_valve_bodies
from klack.case.any_case import read_valve_case
from klack.case.bodies import CaseBody, CaseFile
from klack.case.reader import read_case
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.errors import InputError
from klack.machine.progress import Progress, silent
from klack.mesh.mesh import Mesh
from klack.mesh.quality import edge_lengths
from klack.mesh.rigid import Pose
from klack.mesh.skin import skin_of_mesh
from klack.network.component import Component
from klack.report.looks import thinned
from klack.schematic.picture import schematic_svg
from klack.units import format_si
from klack.viewer.view import BodyView, ContactView, Curve, Facts, MotionView, View

__all__ = ["body_view", "view_of_case", "view_of_mesh", "view_of_result"]


def view_of_case(case: Case | ValveCase, progress: Progress = silent) -> View:
    """Bodies of a case in their places, with their supports, contacts and network."""
    if isinstance(case, Case) and not case.has_surfaces:
        raise InputError(
            f"{case.path or 'case'}: bodies",
            got="reduced models, or nodes without elements",
            expected="bodies with surfaces",
            hint="klack inspect lists what is in such a case.",
        )
    told = dict(inspect_bodies(case))
    view = View(
        name=case.name,
        title=case.title or case.name,
        source=f"case {case.name}",
        description=case.description.strip(),
        version=__version__,
        bodies=(),
        facts=_facts(case, told),
    )
    if isinstance(case, ValveCase):
        return _valve_view(case, view, told, progress)
    if case.backing is not None:
        return _valve_view(row_as_valve(case), view, told, progress)
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
    pose = placed.pose
    if placed.upper.dimension == 2:  # drawn upright on the axis
        pose = Pose.along_z(float(pose.shift[2]))
    bodies = _bodies(case, meshes, told, {moving.body: pose})
    return replace(view, bodies=bodies, contacts=(contact,), notes=_raised(moving.body, pose))


_RAISED = 0.5e-6  # [m]; five digits of a place do not show less


def _raised(name: str, pose: Pose) -> tuple[str, ...]:
    rise = float(pose.shift[2])
    if abs(rise) < _RAISED:
        return ()
    way = f"{format_si(abs(rise), 'm', 3)} {'above' if rise > 0 else 'below'}".replace("um", "µm")
    return (f"{name} is shown {way} its drawn position; numbers next to it refer to the drawing.",)


def _facts(case: CaseFile, told: Mapping[str, Inspected]) -> Facts:
    rows = (*expanded_rows(case), *meeting_rows(case, told))
    return tuple((title.removeprefix("case: "), each) for title, each in rows)


def _valve_view(
    case: ValveCase, view: View, told: Mapping[str, Inspected], progress: Progress
) -> View:
    notes, drawn = [], {}
    shaped = {name for name, body in case.bodies.items() if body.has_surfaces}
    if shaped == set(case.bodies) and shaped:
        drawn = mesh_valve_bodies(case, progress)
    elif case.bodies:
        notes.append(
            "Bodies without surfaces (reduced models, nodes without elements) are not drawn."
        )
    else:
        notes.append(
            "All bodies of this valve are rigid masses without a shape: only its network is shown."
        )
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
        notes.append("Bodies stand as drawn; gaps of the stops come from the network.")
    return replace(
        view,
        bodies=_bodies(case, drawn, told),
        contacts=tuple(contacts),
        schematic=schematic_svg(case.network.network(), ""),
        notes=tuple(notes),
    )


def view_of_mesh(mesh: Mesh, source: str, rows: tuple[Row, ...], note: str = "") -> View:
    """The body of a mesh or CAD file, as it is; ``rows`` of ``inspect_file``."""
    name = Path(source).stem
    body = body_view(name, mesh, np.empty(0, dtype=np.int64), _mesh_words(mesh))
    return View(
        name=name,
        title=source,
        source=source,
        description="",
        version=__version__,
        bodies=(replace(body, rows=rows),),
        notes=(note,) if note else (),
    )


def _bodies(
    case: CaseFile,
    meshes: Mapping[str, Mesh],
    told: Mapping[str, Inspected],
    poses: Mapping[str, Pose] = MappingProxyType({}),
) -> tuple[BodyView, ...]:
    """Bodies with what is told of them; ``poses`` of those that do not stand as drawn."""
    found = []
    for name, mesh in meshes.items():
        given, pose = case.bodies[name], poses.get(name, _AS_DRAWN)
        words = f"{_source(given)}; {_mesh_words(mesh)}"
        body = body_view(name, mesh, held_nodes(given, mesh), words)
        centre = told[name].centre
        at = None if centre is None else pose.of(centre)
        found.append(replace(body, rows=told[name].rows, centre=at))
    return tuple(found)


_AS_DRAWN = Pose.along_z(0.0)


def body_view(name: str, mesh: Mesh, held: NDArray[np.int64], about: str) -> BodyView:
    """A body as its mesh is; ``held`` are nodes."""
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
    """Where two centred bodies touch first; ``gap`` is that of the case, or None."""
    ring, clearance = touch_ring(upper, lower)
    return ContactView(
        name=name,
        upper=names[0],
        lower=names[1],
        ring=ring,
        closed=goes_round(ring),
        gap=clearance if gap is None else gap,
    )


Floats = NDArray[np.float64]

_BYTES = 3_600_000
"""For all mode shapes of a page; base64 makes a third more of them."""

_COLUMNS = 400  # of a history


def view_of_result(
    study: Any,
    folder: Path,
    components: Iterable[type[Component]] = (),
    progress: Progress = silent,
) -> View:
    """What a page shows of a result of ``klack impact`` or ``klack stroke``.

    Files that the case names are looked for beside ``folder``, that of the result.  InputError for
    other results, which have no bodies.
    """
    if isinstance(study, ImpactStudy):
        return _impact_view(study, folder, progress)
    if isinstance(study, StrokeStudy):
        return _stroke_view(study, folder, components, progress)
    raise InputError(
        str(folder),
        got=f"a stored {type(study).__name__}",
        expected="the result of klack impact or klack stroke",
        hint="klack report shows the others; klack show takes their case.",
    )


def _named(view: View, study: ImpactStudy | StrokeStudy, folder: Path) -> View:
    return replace(
        view,
        name=folder.absolute().name,
        title=study.title or study.case,
        source=f"result {folder.name} of case {study.case}, computed by klack {study.version}",
        description=study.description,
    )


def _place_of_case(study: ImpactStudy | StrokeStudy, folder: Path) -> Path:
    return folder.absolute() / f"{study.case}.yaml"


# --------------------------------------------------------------------------- impact


def _impact_view(study: ImpactStudy, folder: Path, progress: Progress) -> View:
    notes = []
    if study.pictures:
        kept, left_out = _kept_shapes(study.pictures)
        told, facts = _told(study, folder)
        bodies = tuple(
            replace(
                _pictured(study, one, kept[one.body]),
                rows=told[one.body].rows if one.body in told else (),
            )
            for one in study.pictures
        )
        contacts = _touching(study)
        view = View(
            name="",
            title="",
            source="",
            description="",
            version=__version__,
            bodies=bodies,
            contacts=contacts,
            facts=facts,
        )
        if left_out:
            notes.append(
                f"{left_out} of the highest modes are left out, to limit the page to a few "
                "megabytes."
            )
        if not any(body.motion and body.motion.amplitude.size for body in bodies):
            notes.append("The level 'reduced' was not computed, so the impact is not animated.")
    else:
        case = read_case(study.case_text, _place_of_case(study, folder))
        view = view_of_case(case, progress)
        notes.append("This result holds no mode shapes: run klack impact again to see them.")
    time = next((one.instants for one in study.pictures if one.instants.size), np.empty(0))
    if any(one.stress.size for one in study.pictures):
        level = "full" if "full" in study.levels else "reduced"
        notes.append(
            f"The stress at the highest force comes from the level {level}, at the nodes of the "
            "surface."
        )
    return replace(
        _named(view, study, folder),
        time=time,
        transfer=_transfer(study),
        histories=_impact_histories(study),
        notes=(*view.notes, *notes),
    )


def _told(study: ImpactStudy, folder: Path) -> tuple[dict[str, Inspected], Facts]:
    """As of ``klack inspect``; nothing where files of the case are not beside the result."""
    try:
        case = read_case(study.case_text, _place_of_case(study, folder))
        told = dict(inspect_bodies(case))
    except InputError:
        return {}, ()
    return told, _facts(case, told)


def _kept_shapes(pictures: tuple[BodyPicture, ...]) -> tuple[dict[str, NDArray[np.int64]], int]:
    """Shapes of each body that fit into a page, the lowest modes first, and how many do not."""
    total = sum(one.shapes.nbytes for one in pictures)
    share, kept, left_out = min(1.0, _BYTES / max(total, 1)), {}, 0
    for one in pictures:
        elastic = np.flatnonzero(one.frequency > 0)
        order = elastic[np.argsort(one.frequency[elastic], kind="stable")]
        others = np.flatnonzero(~(one.frequency > 0))
        room = max(int(share * len(one.frequency)) - len(others), 1)
        chosen = order[:room]
        left_out += len(order) - len(chosen)
        kept[one.body] = np.sort(np.concatenate([others, chosen]))
    return kept, left_out


def _pictured(study: ImpactStudy, one: BodyPicture, kept: NDArray[np.int64]) -> BodyView:
    summary = next((body for body in study.bodies if body.name == one.body), None)
    about = "" if summary is None else f"{summary.source}; {summary.nodes} nodes, {summary.support}"
    return BodyView(
        name=one.body,
        about=about,
        skin=one.skin,
        held=one.held,
        section=one.section,
        finest=one.finest,
        motion=MotionView(
            shapes=one.shapes[kept],
            scale=one.scale[kept],
            frequency=one.frequency[kept],
            amplitude=one.amplitude[:, kept] if one.amplitude.size else one.amplitude,
            stress=one.stress,
            node=one.node,
        ),
    )


def _touching(study: ImpactStudy) -> tuple[ContactView, ...]:
    upper, _, lower = study.contact.surfaces.partition(" on ")
    ring = study.pictures[1].touch
    return (
        ContactView(
            name="contact",
            upper=upper,
            lower=lower,
            ring=ring,
            closed=goes_round(ring),
            gap=study.gap,
        ),
    )


def _transfer(study: ImpactStudy) -> tuple[Curve, ...]:
    return tuple(
        Curve(
            name=one.labels[0],
            x=one.frequencies * 1e-3,
            y=np.abs(one.curves[0]),
            x_unit="kHz",
            y_unit="m/N",
            body=one.body,
        )
        for one in study.transfer
    )


def _impact_histories(study: ImpactStudy) -> tuple[Curve, ...]:
    level = study.levels.get("reduced") or study.levels[study.reference]
    history = level.history
    curves = [
        _history("contact force", history.time, history.force, 1.0, "N"),
    ]
    if history.displacement_a.size:
        curves.append(
            _history(
                f"{study.bodies[0].name} displacement",
                history.edges,
                history.displacement_a,
                1e6,
                "µm",
            )
        )
    return tuple(curves)


def _history(name: str, time: Floats, values: Floats, factor: float, unit: str) -> Curve:
    x, y = thinned(time, np.asarray(values, dtype=float), columns=_COLUMNS)
    return Curve(name=name, x=x * 1e6, y=y * factor, x_unit="µs", y_unit=unit)


# --------------------------------------------------------------------------- stroke


def _stroke_view(
    study: StrokeStudy, folder: Path, components: Iterable[type[Component]], progress: Progress
) -> View:
    given = tuple(components)
    variant = next(iter(study.variants.values()))
    lift = variant.channel(study.channels.lift)
    try:
        case = read_valve_case(study.case_text, _place_of_case(study, folder), given)
    except InputError as error:
        if not study.schematic or not set(study.own_components) <= {kind.type for kind in given}:
            raise
        return _without_case(study, folder, variant, str(error))
    view = _named(view_of_case(case, progress), study, folder)
    if lift is None:
        return view
    needle = getattr(case.network.components.get(study.needle), "body", study.needle)
    travel = np.asarray(lift.values, dtype=float)
    note = (
        f"Variant {variant.name}: {variant.label}. The needle moves as {study.channels.lift}; "
        "deformations and modes are in results of klack impact."
    )
    return replace(
        view,
        bodies=tuple(
            replace(body, travel=travel) if body.name == needle else body for body in view.bodies
        ),
        time=variant.result.time,
        histories=_stroke_histories(study, variant),
        notes=(*view.notes, note),
    )


def _without_case(study: StrokeStudy, folder: Path, variant: StrokeVariant, error: str) -> View:
    """What the result itself holds, where a file that its case names is missing."""
    view = View(
        name="",
        title="",
        source="",
        description="",
        version=__version__,
        bodies=(),
        schematic=study.schematic,
        time=variant.result.time,
        histories=_stroke_histories(study, variant),
        notes=(
            "The case of this result cannot be read, so bodies are not shown: "
            f"{error.splitlines()[0]}",
        ),
    )
    return _named(view, study, folder)


def _stroke_histories(study: StrokeStudy, variant: StrokeVariant) -> tuple[Curve, ...]:
    wanted = [(study.channels.lift, "lift", 1e6, "µm")]
    wanted += [(f"{stop.name} peak force", f"{stop.name} force", 1.0, "N") for stop in study.stops]
    found = [(variant.channel(name), words, factor, unit) for name, words, factor, unit in wanted]
    return tuple(
        _history(words, variant.result.time, channel.values, factor, unit)
        for channel, words, factor, unit in found
        if channel is not None
    )
