"""One impact of three bodies in a row: a needle on an insert that may leave its housing.

The bodies and laws are those of a stroke (:mod:`klack.assembling.body_row`), the march that of any
impact, with two contacts.  The interface level and the full order have one contact below the body
that moves, so there is nothing to estimate the error with.
"""

from collections.abc import Iterator
from dataclasses import replace
from time import perf_counter

import numpy as np

from klack.analyses.impact.contact_check import ContactCheck, check_contact
from klack.analyses.impact.levels import law_summary, level_result
from klack.analyses.impact.record import (
    BackingContact,
    ContactSummary,
    ImpactStudy,
    LawSummary,
    LevelResult,
)
from klack.analyses.impact.trust import flat_doubt, trust_notes
from klack.analyses.record import case_fields, run_fields
from klack.assembling.body_row import BACKING, CONTACT, BodyRow, build_row
from klack.assembling.body_summary import BodySummary, summarise_body
from klack.assembling.bolts import struck_bolts
from klack.assembling.fits import press_fits
from klack.bodies.reduction.reduced_body import elastic_count
from klack.case.bodies import SurfaceName
from klack.case.schema import Case
from klack.contact.history import ImpactHistory
from klack.machine.cache.result_cache import result_cache
from klack.machine.progress import Progress
from klack.machine.stages import StageClock, collected_warnings
from klack.simulation.impact import SystemRecord, simulate
from klack.units import format_si

__all__ = ["run_three_bodies"]

_LEVEL = "reduced"
_WITH_PRELOAD = "initial kinetic and preload"
_SPEEDED_UP = (
    "the needle leaves faster than it arrived: it follows the struck body, pushed by the "
    "closing forces, until the body behind throws both back. Its restitution includes all of "
    "this."
)
_NO_ESTIMATE = (
    "only the level 'reduced' supports three bodies. Try: twice as many modes "
    "(reduction.modes), and compare."
)


def run_three_bodies(case: Case, *, progress: Progress, threads: int | None = None) -> ImpactStudy:
    """Compute one impact of three bodies at the level ``reduced``."""
    begin = perf_counter()
    clock = StageClock(progress, result_cache())
    with collected_warnings() as notes:
        row = build_row(case, clock, threads=threads)
        clock("reduced", 0.0)
        level = _run(case, row, clock.spent(("factorise", "static contact", "modes", "reduced")))
        assert level.backing is not None
        peaks = {CONTACT: level.measures.peak_force, BACKING: level.backing.peak_force}
        checks = {name: _check(row, name, peak) for name, peak in peaks.items() if peak > 0.0}
        if level.measures.restitution > 1.0:
            level = level.doubted(_SPEEDED_UP)
        results = {_LEVEL: level.doubted(*_doubts(case, row, checks, peaks))}
        clock("reduced", 1.0)
    bolts = struck_bolts(case, max(peaks.values()))
    return ImpactStudy(
        **case_fields(case),
        speed=case.motion.speed,
        gap=case.contact.gap or 0.0,
        **run_fields(begin, clock),
        bodies=_bodies(row),
        contact=_contact(row, checks[CONTACT]),
        law=_law(row, peaks[CONTACT]),
        levels=results,
        reference=_LEVEL,
        deviations={},
        fits=tuple(fit for name in case.bodies for fit in press_fits(case, name)),
        bolts=bolts,
        layers=row.valve.layers,
        warnings=(
            *dict.fromkeys(map(_at_section, notes)),
            *filter(None, (joint.opening_doubt for joint in bolts)),
            *_early_opening(row, results[_LEVEL]),
            *trust_notes(results, _LEVEL, {}),
        ),
        estimate_doubt=_NO_ESTIMATE,
    )


def _run(case: Case, row: BodyRow, setup_time: float) -> LevelResult:
    step, moving = case.run.reduced_step, case.contact.moving.body

    def run(duration: float) -> SystemRecord:
        speeds = {moving: -case.motion.speed}
        return simulate(row.system, velocities=speeds, step=step, duration=duration)

    run(4 * step)  # compiles, so that the time below is that of the run
    begin = perf_counter()
    record = run(case.run.duration)
    wall_time = perf_counter() - begin
    bodies = row.system.bodies
    counts = " + ".join(str(elastic_count(body)) for body in bodies)
    result = level_result(
        _of_needle(record.impact(0)),
        level=_LEVEL,
        label=f"reduced, {counts} modes",
        dofs=sum(body.mode_count for body in bodies),
        step=step,
        wall_time=wall_time,
        setup_time=setup_time,
    )
    assert case.backing is not None
    # energy in the bodies below is vibration, motion and what their contact and clamp store
    energies = dict(result.energies)
    if case.backing.preload:
        energies = {_WITH_PRELOAD: energies.pop(next(iter(energies))), **energies}
    return replace(
        result,
        energies=energies,
        measures=replace(result.measures, vibration_share=float("nan")),
        backing=BackingContact(
            surfaces=_surfaces(row, BACKING),
            preload=case.backing.preload,
            history=record.impact(1),
        ),
    )


def _at_section(note: str) -> str:
    """A note on a stop of the valve, at the section of the impact."""
    for name in (CONTACT, BACKING):
        note = note.replace(f"stop '{name}': contact: ", f"{name}: ")
    return note


def _of_needle(history: ImpactHistory) -> ImpactHistory:
    """Speeds before and after the impact are those of the needle: below it is no single body."""
    return replace(history, velocity_b=np.zeros(history.velocity_b.size), mass_b=np.inf)


def _surfaces(row: BodyRow, stop: str) -> str:
    upper, lower = row.valve.case.stops[stop].between
    return f"{upper} on {lower}"


def _check(row: BodyRow, stop: str, peak: float) -> ContactCheck:
    contact = row.contact(stop)
    force = min(peak, contact.closing.max_force)
    return check_contact(row.valve.case, contact.pair, contact.closing, force, _surfaces(row, stop))


def _doubts(
    case: Case, row: BodyRow, checks: dict[str, ContactCheck], peaks: dict[str, float]
) -> Iterator[str]:
    assert case.backing is not None
    for name, peak in peaks.items():
        contact, surfaces = row.contact(name), _surfaces(row, name)
        if peak > contact.closing.max_force:
            yield (
                f"{surfaces} is pressed with {format_si(peak, 'N', 3)}, beyond the "
                f"{format_si(contact.closing.max_force, 'N', 3)} of its static contact, where "
                "its law continues as a straight line. Try: a shorter run, or klack stroke with "
                "stops.speed and force of this contact."
            )
        if contact.loops is not None:
            yield (
                f"the faces {surfaces} yield, which the laws of several contacts do not include. "
                "Try: klack stroke of the same bodies."
            )
        if name == BACKING:
            yield from (
                f"{surfaces}: {doubt}" for doubt in (checks[name].doubts if name in checks else ())
            )
        if peak > 0.0 and (name == CONTACT or not case.backing.preload):
            pair = contact.pair
            kept = (row.valve.reduced[body.name] for body in (pair.upper, pair.lower))
            highest = (float(body.frequencies.max(initial=0.0)) for body in kept)
            if doubt := flat_doubt(case, pair, contact.closing, highest):
                yield f"{surfaces}: {doubt}"


def _early_opening(row: BodyRow, level: LevelResult) -> Iterator[str]:
    """A contact below that opens before the kept modes can have carried the blow to it."""
    below = level.backing
    assert below is not None
    pair = row.contact(BACKING).pair
    highest = float(row.valve.reduced[pair.upper.name].frequencies.max(initial=0.0))
    touched = float(level.history.edges[np.argmax(level.history.force > 0.0)])
    after = below.lift_off - touched
    if highest * after < 1.0:  # False for nan: it stays closed
        yield (
            f"{below.surfaces} opens {format_si(after, 's', 2)} after the needle touches, within "
            f"the shortest period of the kept modes of '{pair.upper.name}' "
            f"({format_si(1.0 / highest, 's', 2)}): at such short times the omitted modes "
            "matter, and the opening time is accurate only to that period. Try: more modes "
            f"(reduction.modes.{pair.upper.name}), and compare."
        )


def _bodies(row: BodyRow) -> tuple[BodySummary, ...]:
    """From the needle down; the share of the compliance is that of the upper contact of each."""
    sides: list[SurfaceName] = [*row.valve.case.stops[CONTACT].between]
    sides.append(row.valve.case.stops[BACKING].between[1])
    found = []
    for side in sides:
        reduced = row.valve.reduced[side.body]
        share = float(reduced.compliance_share[reduced.port_index(side.surface)])
        body = row.valve.bodies[side.body]
        found.append(summarise_body(row.valve.case, body, reduced, compliance_share=share))
    return tuple(found)


def _contact(row: BodyRow, check: ContactCheck) -> ContactSummary:
    static = row.contact(CONTACT).closing
    return ContactSummary(
        surfaces=_surfaces(row, CONTACT),
        points=static.space.count,
        half_width=check.half_width,
        size_ratio=check.size_ratio,
        points_across=check.points_across,
        doubts=check.doubts,
        needed_yield=check.needed_yield,
        approach=static.approach,
        force=static.force,
        area=static.area,
    )


def _law(row: BodyRow, peak: float) -> LawSummary:
    local = row.valve.laws[CONTACT].local
    return law_summary(
        "consistent",
        np.append(0.0, local.force_indentation),
        np.append(0.0, local.force),
        np.append(np.nan, local.share),
        peak,
    )
