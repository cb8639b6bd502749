"""The view of a stored result: what it holds of bodies, modes and motion."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack import __version__
from klack.analyses.impact.record import BodyPicture, ImpactStudy
from klack.analyses.stroke.record import StrokeStudy, StrokeVariant
from klack.assembling.touch_ring import goes_round
from klack.case.any_case import read_valve_case
from klack.case.reader import read_case
from klack.errors import InputError
from klack.network.component import Component
from klack.progress import Progress, silent
from klack.report.looks import thinned
from klack.viewer.of_case import view_of_case
from klack.viewer.view import BodyView, ContactView, Curve, MotionView, View

__all__ = ["view_of_result"]

Floats = NDArray[np.float64]

_BYTES = 3_600_000
"""Of all mode shapes of a page; base64 makes a third more of them."""

_COLUMNS = 400  # of a history


def view_of_result(
    study: Any,
    folder: Path,
    components: Iterable[type[Component]] = (),
    progress: Progress = silent,
) -> View:
    """What a page shows of a result of ``klack impact`` or ``klack stroke``.

    Parameters
    ----------
    study : ImpactStudy or StrokeStudy
    folder : Path
        Of the result; files that its case names are looked for beside it.
    components : iterable of type
        Component classes of the user.
    progress : callable

    Raises
    ------
    InputError
        For other results, which have no bodies.
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
    """Where files are looked for that the case of a result names."""
    return folder.absolute() / f"{study.case}.yaml"


# --------------------------------------------------------------------------- impact


def _impact_view(study: ImpactStudy, folder: Path, progress: Progress) -> View:
    notes = []
    if study.pictures:
        kept, left_out = _kept_shapes(study.pictures)
        bodies = tuple(_pictured(study, one, kept[one.body]) for one in study.pictures)
        contacts = _touching(study)
        view = View(
            name="",
            title="",
            source="",
            description="",
            version=__version__,
            bodies=bodies,
            contacts=contacts,
        )
        if left_out:
            notes.append(
                f"{left_out} of the highest modes are left out, for a page of a few megabytes."
            )
        if not any(body.motion and body.motion.amplitude.size for body in bodies):
            notes.append("The level reduced was not computed: the impact does not move here.")
    else:
        case = read_case(study.case_text, _place_of_case(study, folder))
        view = view_of_case(case, progress)
        notes.append("This result holds no mode shapes: run klack impact again to see them.")
    time = next((one.instants for one in study.pictures if one.instants.size), np.empty(0))
    if any(one.stress.size for one in study.pictures):
        level = "full" if "full" in study.levels else "reduced"
        notes.append(
            f"The stress at the highest force is that of the level {level}, at the nodes of the "
            "surface."
        )
    return replace(
        _named(view, study, folder),
        time=time,
        transfer=_transfer(study),
        histories=_impact_histories(study),
        notes=(*view.notes, *notes),
    )


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
    """What the result itself holds, where a file that its case names does not lie beside it."""
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
            "The case of this result cannot be read beside the result, so that bodies are not "
            f"shown: {error.splitlines()[0]}",
        ),
    )
    return _named(view, study, folder)


def _stroke_histories(study: StrokeStudy, variant: StrokeVariant) -> tuple[Curve, ...]:
    """Lift, and the force of each stop."""
    wanted = [(study.channels.lift, "lift", 1e6, "µm")]
    wanted += [(f"{stop.name} peak force", f"{stop.name} force", 1.0, "N") for stop in study.stops]
    found = [(variant.channel(name), words, factor, unit) for name, words, factor, unit in wanted]
    return tuple(
        _history(words, variant.result.time, channel.values, factor, unit)
        for channel, words, factor, unit in found
        if channel is not None
    )
