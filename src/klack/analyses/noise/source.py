"""Forces and bodies for a noise study."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError
from ruamel.yaml import YAML

from klack.acoustics.comparison import first_impact
from klack.analyses.catalogue import analysis_in
from klack.analyses.contact_doubts import contact_doubt
from klack.analyses.impact.record import ContactSummary, ImpactStudy, LevelResult
from klack.analyses.impact.run import run_impact
from klack.analyses.impact.yielding_level import SMALL_YIELD, yield_share
from klack.analyses.incomplete import failure_notes
from klack.analyses.noise.force import (
    before_impact,
    first_part,
    impact_force,
    interrupted_impact,
    stop_forces,
)
from klack.analyses.noise.machine import check_machine, mounted
from klack.analyses.noise.reactions import HeldForces, forces_of_impact, forces_of_stroke
from klack.analyses.stroke.record import StopSummary, StrokeStudy, StrokeVariant
from klack.analyses.stroke.run import run_stroke
from klack.assembling.body_summary import BodySummary
from klack.assembling.structures import IMPACT_STOP
from klack.bodies.reduction.structure import Structure
from klack.case.bodies import CaseMaterial
from klack.case.levels import LEVELS, VARIANTS
from klack.case.noise import CaseNoise
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.errors import InputError, refuse_if
from klack.input.problem import CaseProblem, nearest, one_of
from klack.machine.progress import Progress, silent
from klack.signals.sampled import TimeSeries
from klack.simulation.network_result import ImpactEvent, NetworkResult

__all__ = [
    "NoiseSource",
    "SourceStop",
    "held_forces",
    "impact_sources",
    "load_sources",
    "net_force",
    "run_sources",
    "stroke_sources",
]

_OBLIQUE = (
    "the body was hit obliquely: only the force along the axis makes this sound; the force "
    "across it is left out. Try: an impact without motion.sideways_speed and motion.spin."
)

_HEARD = 0.1  # of the fastest impact: slower ones have less than 1 % of its energy
_AROUND = 5.0  # contact times shown on each side of the strongest impact


@dataclass(frozen=True, kw_only=True, eq=False)
class SourceStop:
    """Force of one stop: all of it, and its strongest impact."""

    name: str
    force: TimeSeries
    strongest: TimeSeries
    impacts: int


@dataclass(frozen=True, kw_only=True, eq=False)
class NoiseSource:
    """One run that makes noise.

    Parameters
    ----------
    kind
        ``"impact"`` or ``"stroke"``.
    run, label
        Variant or level, and in words.
    held
        All forces on held bodies with their reactions, if mounts are described.
    speed [m/s]
        Of the fastest impact.
    net [N]
        Mass times acceleration of the needle, means over records: all forces on it. None where it
        is the contact force (a needle that only falls), or unknown.
    kept_up_to [Hz]
        Lowest of the bodies' highest kept modes; nan for rigid ones.
    given
        Whether the case has a section ``noise``.
    """

    kind: str
    case: str
    title: str
    case_text: str
    run: str
    label: str
    stops: tuple[SourceStop, ...]
    structures: tuple[Structure, ...]
    kept_up_to: float
    noise: CaseNoise
    given: bool
    materials: Mapping[str, CaseMaterial]
    net: TimeSeries | None = None
    held: HeldForces | None = None
    speed: float = 0.0
    notes: tuple[str, ...] = ()
    own_components: Mapping[str, str] = field(default_factory=dict)


# --------------------------------------------------------------------------- from disk, from cases


def load_sources(folder: Path, names: Sequence[str] = ()) -> tuple[NoiseSource, ...]:
    """Take forces and bodies from a stored result of an impact or a stroke.

    ``names`` are levels, by default the best, or variants, by default the first.
    """
    analysis = analysis_in(folder)
    if analysis.form.kind not in (ImpactStudy, StrokeStudy):
        raise _no_source(f"result {folder}", f"a {analysis.form.name}")
    return sources_of(analysis.load(folder), names)


def sources_of(record: object, names: Sequence[str] = ()) -> tuple[NoiseSource, ...]:
    """Take forces and bodies from the record of an impact or a stroke."""
    if isinstance(record, ImpactStudy):
        return impact_sources(record, names)
    if isinstance(record, StrokeStudy):
        return stroke_sources(record, names)
    raise _no_source("noise", f"a {type(record).__name__}")


def _no_source(where: str, got: str) -> InputError:
    return InputError(
        where,
        got=got,
        expected="the result of an impact or a stroke",
        hint="give the folder that klack impact or klack stroke names at the end.",
    )


def run_sources(
    case: Case | ValveCase,
    names: Sequence[str] = (),
    *,
    progress: Progress = silent,
    threads: int | None = None,
) -> tuple[NoiseSource, ...]:
    """Run a case and take forces and bodies from it.

    ``names`` are levels, by default ``reduced``, or variants, by default the first.
    """
    if all(
        body.matrices is None for body in case.bodies.values()
    ):  # else mounts move along z alone
        check_machine(case.noise, case.materials)
    if isinstance(case, ValveCase):
        variants = tuple(names) or case.run.variants[:1]
        stroke = run_stroke(case, variants=variants, progress=progress, threads=threads)
        return _with_notes(stroke_sources(stroke, tuple(names)), case)
    case.require_pair("noise")
    levels = case.require_levels(tuple(names) or ("reduced",))
    # transfer functions are not asked for here, and take longer than all the rest
    case = case.model_copy(update={"run": case.run.model_copy(update={"transfer": None})})
    impact = run_impact(case, levels=levels, certify=False, progress=progress, threads=threads)
    return _with_notes(impact_sources(impact, tuple(names)), case)


def _with_notes(sources: Sequence[NoiseSource], case: Case | ValveCase) -> tuple[NoiseSource, ...]:
    return tuple(replace(source, notes=(*source.notes, *case.input_notes)) for source in sources)


# --------------------------------------------------------------------------- impacts


def impact_sources(
    study: ImpactStudy, levels: Sequence[str] = (), case: Case | None = None
) -> tuple[NoiseSource, ...]:
    """Forces of an impact at some levels; of the best level without.

    The structure is that of the reduced level, whichever level the force comes from.  The section
    ``noise`` and the materials are those of the text of the study, or of ``case``.
    """
    refuse_if(
        study.is_row,
        "noise",
        got="an impact of three bodies in a row",
        expected="an impact of two bodies, or a stroke",
        hint="run the three bodies as a stroke: klack stroke, then klack noise.",
    )
    _require_structures(study)
    wanted = tuple(levels) or (study.reference,)
    failed = [f"The impact is incomplete: {note}" for note in failure_notes(study.failures)]
    noise, given, materials = _noise_of(study, case)
    found = []
    for name in wanted:
        _require("level", name, study.levels, study.why_missing(name))
        result = study.levels[name]
        touched = bool(np.any(result.history.force > 0.0))
        force = impact_force(result.history)
        found.append(
            NoiseSource(
                kind="impact",
                case=study.case,
                title=study.title or study.case,
                case_text=study.case_text,
                run=name,
                label=result.label,
                stops=(
                    SourceStop(
                        name=IMPACT_STOP,
                        force=force,
                        strongest=first_impact(result.history) if touched else force,
                        impacts=1 if touched else 0,
                    ),
                ),
                structures=study.structures,
                kept_up_to=float("nan") if name == "lumped" else _kept_up_to(study.bodies),
                noise=noise,
                given=given,
                materials=materials,
                held=forces_of_impact(mounted(study.structures, noise, study.case), force)
                if noise.mounts
                else None,
                speed=study.speed,
                notes=(
                    *failed,
                    *(f"level '{name}': {doubt}" for doubt in result.doubts),
                    *_yield_notes(result),
                    *([] if result.oblique is None else [_OBLIQUE]),
                    *_contact_notes([study.contact] if name != "lumped" else ()),
                ),
            )
        )
    return tuple(found)


# --------------------------------------------------------------------------- strokes


def stroke_sources(
    study: StrokeStudy, variants: Sequence[str] = (), case: ValveCase | None = None
) -> tuple[NoiseSource, ...]:
    """Forces of all stops of a stroke, in some variants; in the first one without.

    ``case`` as for :func:`impact_sources`.
    """
    _require_structures(study)
    wanted = tuple(variants) or (study.reference.name,)
    noise, given, materials = _noise_of(study, case)
    found = []
    for name in wanted:
        _require("variant", name, study.variants)
        variant = study.variants[name]
        _require_stops(study.case, variant)
        followed, cut = first_part(variant.result)
        variant = replace(variant, result=followed)
        net = net_force(study, variant)
        last = interrupted_impact(variant.result.events, net)
        found.append(
            NoiseSource(
                kind="stroke",
                case=study.case,
                title=study.title or study.case,
                case_text=study.case_text,
                run=name,
                label=variant.label,
                stops=_stops(study, variant, last),
                structures=study.structures,
                kept_up_to=_kept_up_to(study.bodies) if variant.flexible else float("nan"),
                noise=noise,
                given=given,
                materials=materials,
                net=net if net is None else before_impact(net, last),
                held=held_forces(study, variant, noise, last),
                speed=max((event.approach_speed for event in variant.result.events), default=0.0),
                notes=(
                    *filter(None, [cut]),
                    *_notes(variant, last),
                    *_contact_notes(study.stops if variant.flexible else ()),
                ),
                own_components=study.own_components,
            )
        )
    return tuple(found)


def held_forces(
    study: StrokeStudy, variant: StrokeVariant, noise: CaseNoise, last: ImpactEvent | None
) -> HeldForces | None:
    """All forces on held bodies up to an impact in which the run ends; None without mounts."""
    if not noise.mounts:
        return None
    structures = mounted(study.structures, noise, study.case)
    return forces_of_stroke(
        structures,
        variant,
        noise,
        until=None if last is None else last.time,
    )


def _stops(
    study: StrokeStudy, variant: StrokeVariant, last: ImpactEvent | None
) -> tuple[SourceStop, ...]:
    """Stops, the opening stop first; without the interrupted impact."""
    order = dict.fromkeys(
        name for name in (study.channels.opening_stop, study.channels.seat) if name
    )
    forces = {name: before_impact(f, last) for name, f in stop_forces(variant.result).items()}
    result = []
    for name in order | dict.fromkeys(forces):
        if name in forces:
            events = [event for event in variant.impacts(name) if event is not last]
            result.append(
                SourceStop(
                    name=name,
                    force=forces[name],
                    strongest=_strongest(forces[name], events),
                    impacts=len(events),
                )
            )
    return tuple(result)


def _strongest(force: TimeSeries, events: Sequence[ImpactEvent]) -> TimeSeries:
    """Force about the highest impact, between its neighbours; time from its touch."""
    if not events:
        return force
    k = int(np.argmax([event.peak_force for event in events]))
    event = events[k]
    begin = event.time - _AROUND * event.contact_time
    end = event.time + (1.0 + _AROUND) * event.contact_time
    if k > 0:
        begin = max(begin, 0.5 * (_end(events[k - 1]) + event.time))
    if k + 1 < len(events):
        end = min(end, 0.5 * (_end(event) + events[k + 1].time))
    edge = force.start - 0.5 * force.step
    first = max(0, round((begin - edge) / force.step))
    last = min(force.values.size, max(first + 2, round((end - edge) / force.step)))
    return TimeSeries(
        step=force.step,
        values=force.values[first:last],
        unit=force.unit,
        start=force.start + first * force.step - event.time,
        name=force.name,
    )


def _end(event: ImpactEvent) -> float:
    if np.isfinite(event.separation_time):
        return event.separation_time
    return event.time + event.contact_time


def net_force(study: StrokeStudy, variant: StrokeVariant) -> TimeSeries | None:
    """Mass times acceleration [N] of the needle's centre of mass, in records."""
    masses = [body.mass for body in study.bodies if body.name == study.needle]
    speed = variant.channel(study.channels.velocity)
    if not masses or speed is None:
        return None
    time = variant.result.time
    step = float(time[1] - time[0])
    force = masses[0] * np.diff(speed.values) / step
    return TimeSeries(
        step=step, values=force, unit="N", start=float(time[0]) + 0.5 * step, name="net force"
    )


def _notes(variant: StrokeVariant, last: ImpactEvent | None) -> tuple[str, ...]:
    result: NetworkResult = variant.result
    found = []
    fastest = max((event.approach_speed for event in result.events), default=0.0)
    if last is not None and last.approach_speed > _HEARD * fastest:
        found.append(
            f"The run ends in an impact on '{last.stop}' at {last.approach_speed:.2g} m/s, which "
            f"is left out (the fastest has {fastest:.2g} m/s); increase run.duration to include "
            "the whole impact."
        )
    if result.failure:
        found.append(f"The stroke is incomplete: {' '.join(result.failure.split())}")
    incomplete = [stop for stop, record in result.interfaces.items() if not record.complete]
    if incomplete:
        found.append(
            f"The fine record of {one_of(incomplete)} is not complete: its latest impacts are "
            "known only as means over the records."
        )
    return tuple(found)


# --------------------------------------------------------------------------- what both share


def _contact_notes(contacts: Sequence[ContactSummary | StopSummary]) -> tuple[str, ...]:
    return tuple(filter(None, map(contact_doubt, contacts)))


def _yield_notes(result: LevelResult) -> tuple[str, ...]:
    """Note that faces were new, where yield exceeds what elastic levels may miss."""
    share = yield_share(result)
    if share < SMALL_YIELD:
        return ()
    return (
        f"The impact is the first on new faces: yielding dissipates {100 * share:.2g} % of the "
        "energy, and later impacts are harder. Try: klack impact with run.run_in, and the noise "
        "of the worn.yaml that it writes.",
    )


def _require_structures(study: ImpactStudy | StrokeStudy) -> None:
    held = [body.name for body in study.bodies if body.support != "free"]
    refuse_if(
        held and not study.structures,
        f"result of case {study.case}",
        got=f"no modes and surfaces of {one_of(held)}, as written by an earlier version of klack",
        expected="a result with modes and surfaces",
        hint="run the case again, then klack noise.",
    )


def _require_stops(case: str, variant: StrokeVariant) -> None:
    refuse_if(
        not variant.result.interfaces,
        f"result of case {case}",
        got=f"no end stop in '{variant.name}'",
        expected="a valve whose needle hits a stop",
        hint="add an end-stop to the network: the noise comes from its force.",
    )


def _require(what: str, name: str, held: Mapping[str, object], why: str = "") -> None:
    if name in held:
        return
    hint = nearest(name, held, f"run the case with --{what} {name} first.")
    if what == "level" and name in VARIANTS:
        hint = f"impacts have levels, strokes have variants: --level {next(iter(held))}."
    elif what == "variant" and name in LEVELS:
        hint = f"strokes have variants, impacts have levels: --variant {next(iter(held))}."
    raise InputError(
        what,
        got=f"'{name}', which is not in the result{why}",
        expected=f"one of: {one_of(held)}",
        hint=hint,
    )


def _kept_up_to(bodies: Sequence[BodySummary]) -> float:
    tops = [float(body.frequencies[-1]) for body in bodies if body.frequencies.size]
    return min(tops, default=float("nan"))


def _noise_of(
    study: ImpactStudy | StrokeStudy, case: Case | ValveCase | None
) -> tuple[CaseNoise, bool, Mapping[str, CaseMaterial]]:
    if case is not None:
        return case.noise or CaseNoise(), case.noise is not None, case.materials
    data = YAML(typ="safe").load(
        study.case_text
    )  # faster than the reader of cases, which knows the lines
    given = data.get("noise") is not None
    noise = _section(data["noise"], study) if given else CaseNoise()
    materials = {
        key: CaseMaterial.model_validate(value)
        for key, value in (data.get("materials") or {}).items()
    }
    return noise, given, materials


def _section(data: Any, study: ImpactStudy | StrokeStudy) -> CaseNoise:
    """The section of a stored case; its files lie where they lay."""
    try:
        return CaseNoise.model_validate(data, context={"folder": Path(study.case_folder)})
    except ValidationError as error:
        problem = error.errors()[0].get("ctx", {}).get("error")
        if not isinstance(problem, CaseProblem):
            raise
        raise InputError(
            f"result of case {study.case}: noise",
            got=problem.got,
            expected=problem.expected,
            hint="files of the machine must be where they were when the case ran; run klack "
            "noise on the case itself.",
        ) from None
