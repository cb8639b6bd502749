"""``klack shots``: many drops of one valve, and the centred one."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from klack.analyses.impact.levels import pressure_record
from klack.analyses.impact.record import PressureRecord
from klack.analyses.record import case_fields, run_fields
from klack.analyses.shots.checked_step import CheckedStep, in_checked_steps, step_doubt
from klack.analyses.shots.draw import (
    ShotDraw,
    centric_draw,
    closing_force,
    draw_shot,
    face_friction,
    runs_asked,
    shots_of,
)
from klack.analyses.shots.model import ShotModel, build_shots
from klack.analyses.shots.one_shot import (
    ShotLog,
    ShotOutcome,
    ShotSetup,
    run_shot,
    shot_log,
    shots_mark,
    simulate_shot,
    traces_of,
)
from klack.analyses.shots.record import RuleVerdict, ShotColumns, ShotsStudy
from klack.analyses.workers import LoggedWork, answer, grouped_doubts, unwrapped
from klack.assembling.bolts import opening_doubts
from klack.case.guide import CaseGuide, LinearGuideLaw
from klack.case.placed_errors import tells_place
from klack.case.schema import Case
from klack.case.shots import Shots, StrokeShots
from klack.errors import ConvergenceError
from klack.machine.cache.result_cache import result_cache
from klack.machine.progress import Progress, SoFar, drawn, silent
from klack.machine.stages import StageClock, collected_warnings, trial
from klack.units import format_si

__all__ = [
    "DroppedShots",
    "drop_shots",
    "friction_in_words",
    "guide_in_words",
    "highest_of",
    "judge_rule",
    "position_in_words",
    "run_shots",
    "run_shots_on",
    "shot_doubts",
]

Worn = NDArray[np.float64]

_RULE_HOLDS = 0.01
_LARGE_RESIDUAL = 1e-3
_CHATTERS = 3
"""Contacts of an impact from which its restitution may depend on any step."""


@tells_place
def run_shots(
    case: Case,
    *,
    count: int | None = None,
    seed: int | None = None,
    workers: int | None = None,
    folder: Path | None = None,
    progress: Progress = silent,
    threads: int | None = None,
) -> ShotsStudy:
    """Draw and compute many shots of one valve.

    ``count`` and ``seed`` are those of the case by default, ``workers`` as many processes as cores.
    Finished shots are kept in ``folder``, so that an interrupted run resumes.  InputError also for
    a contact that leaves the contact points.
    """
    begin = perf_counter()
    stated = shots_of(case)
    count, seed, workers = runs_asked(stated, count, seed, workers, "shots")
    clock = StageClock(progress, result_cache())
    mark = shots_mark(case, seed, threads)
    with shot_log(folder, mark) as log, collected_warnings() as notes:
        model = build_shots(case, clock, threads=threads)
        resumed = sum(index in log.done for index in range(count))
        dropped = drop_shots(case, model, count, seed, workers, log, clock)
        outcomes, shots, setup = dropped.outcomes, dropped.shots, dropped.checked.setup
        highest = highest_of(shots)
        if highest is None:
            raise ConvergenceError(
                "shots: no shot reached the top of a rebound after a clear separation.\n"
                "Try: a longer shots.duration, or another closing force: rebounds of less than "
                "50 us belong to one impact."
            )
        lowest = int(np.nanargmin(shots.restitution))
        pictured = {
            "centric": (centric_draw(case), dropped.worn_before(count)),
            "highest": (dropped.draws[highest], dropped.worn_before(highest)),
            "lowest": (dropped.draws[lowest], dropped.worn_before(lowest)),
        }
        with trial():  # once more what has told its doubts
            pressures = _pressures(setup, pictured)
        clock("shots", 1.0)
    return ShotsStudy(
        **case_fields(case),
        **run_fields(begin, clock),
        shot_time=clock.spent(("shots",)),
        seed=seed,
        workers=workers,
        resumed=resumed,
        speed=case.motion.speed,
        start_height=setup.start_height,
        step=setup.step,
        halvings=dropped.checked.halvings,
        step_change=dropped.checked.change,
        distributions=_distributions(case),
        surfaces=f"{case.contact.moving} on {case.contact.stop}",
        guide=guide_in_words(case.guide),
        faces=_faces_in_words(case),
        layer="" if case.contact.roughness is None else case.contact.roughness.in_words,
        mass=setup.model.mass,
        modes=model.modes,
        points=setup.model.count,
        approach=max(outcome.approach for outcome in (*outcomes, dropped.alone)),
        shots=shots,
        centric=dropped.centric,
        shot_traces=traces_of(setup, outcomes),
        centric_traces=traces_of(setup, [dropped.alone]),
        highest=highest,
        rule=judge_rule(shots, dropped.centric, highest),
        pressures=pressures,
        warnings=(
            *dict.fromkeys([*model.notes, *notes]),
            *_unfinished(shots),
            *_worn(shots),
            *shot_doubts(case, dropped),
        ),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class DroppedShots:
    """Computed shots of a model, and ``alone`` the centred one.

    Faces that yield are for that one as the last of the others has left them.
    """

    checked: CheckedStep
    draws: tuple[ShotDraw, ...]
    outcomes: tuple[ShotOutcome, ...]
    alone: ShotOutcome

    @cached_property
    def shots(self) -> ShotColumns:
        """Numbers of the shots as columns."""
        return ShotColumns.of([item.numbers for item in self.outcomes])

    def worn_before(self, index: int) -> Worn | None:
        """Set of the faces [m] before a shot; None for new or elastic ones."""
        worn = self.outcomes[index - 1].worn if index > 0 else np.zeros(0)
        return worn if len(worn) else None

    @cached_property
    def centric(self) -> ShotColumns:
        """Columns of the centred shot, one row."""
        return ShotColumns.of([self.alone.numbers])


def drop_shots(
    case: Case,
    model: ShotModel,
    count: int,
    seed: int,
    workers: int,
    log: ShotLog,
    progress: Progress,
) -> DroppedShots:
    """Draw shots, compute those missing in the log, and the centred one."""
    draws = [draw_shot(case, seed, index, model.touch_height) for index in range(count)]
    centric = centric_draw(case)
    checked = in_checked_steps(model.setup, (centric, draws[0]), progress)
    setup, (alone, first) = checked.setup, checked.outcomes
    progress("shots", 0.0)
    if 0 not in log.done:
        log.add(0, first)
    if setup.model.limit is not None:
        outcomes = _one_after_another(setup, draws, log, progress)
        alone = run_shot(setup, centric, outcomes[-1].worn)
    else:
        run_shots_on(workers, setup, draws, log, progress)
        outcomes = tuple(log.done[draw.index] for draw in draws)
    found = DroppedShots(checked=checked, draws=tuple(draws), outcomes=outcomes, alone=alone)
    most = int(np.argmax(found.shots.sub_contacts))
    if most == 0 or found.shots.sub_contacts[most] < _CHATTERS:
        return found
    doubt = step_doubt(setup, draws[most], outcomes[most], found.worn_before(most))
    return replace(
        found, checked=replace(checked, doubt="; ".join(filter(None, (checked.doubt, doubt))))
    )


def _one_after_another(
    setup: ShotSetup, draws: Sequence[ShotDraw], log: ShotLog, progress: Progress
) -> tuple[ShotOutcome, ...]:
    """Shots on yielding faces, as those before have left them."""
    outcomes: list[ShotOutcome] = []
    for draw in draws:
        worn = outcomes[-1].worn if outcomes else None
        if draw.index not in log.done:
            found = answer(partial(run_shot, setup, draw, worn))
            log.add(draw.index, unwrapped(f"shot {draw.index}", found))
        outcomes.append(log.done[draw.index])
        progress("shots", len(outcomes) / len(draws))
        drawn(progress, partial(_so_far, log))
    return tuple(outcomes)


def run_shots_on(
    workers: int, setup: ShotSetup, draws: Sequence[ShotDraw], log: ShotLog, progress: Progress
) -> None:
    """Add missing shots to the log; an error names the first that fails."""
    with LoggedWork(run_shot, setup, workers, log, "shot {}".format, fewest=3) as work:
        progress("shots", len(log.done) / len(draws))
        for _ in work.completed({draw.index: draw for draw in draws}):
            progress("shots", len(log.done) / len(draws))
            drawn(progress, partial(_so_far, log))


def _so_far(log: ShotLog) -> list[SoFar]:
    """Rebound and peak force of the shots that are done, by their numbers."""
    done = [log.done[index] for index in sorted(log.done)]
    shot = np.array([outcome.index for outcome in done])
    return [
        SoFar(
            title=title,
            x=shot,
            y=factor * np.array([outcome.numbers[key] for outcome in done]),
            x_label="shot",
            dots=True,
        )
        for title, key, factor in (
            ("rebound [um]", "rebound_height", 1e6),
            ("peak force [N]", "peak_force", 1.0),
        )
    ]


def judge_rule(shots: ShotColumns, centric: ShotColumns, highest: int) -> RuleVerdict:
    """Compare the shot with the highest rebound with the centred one.

    Measurements cannot centre a needle; they take the highest rebound of many shots for the centred
    one.  That is right as long as everything off centre costs rebound, and wrong where something
    that varies (the closing force, for one) lifts single shots above the centred one.
    """
    e, h = float(shots.restitution[highest]), float(shots.rebound_height[highest])
    aside = float(shots.eccentricity[highest])
    e0, h0 = float(centric.restitution[0]), float(centric.rebound_height[0])
    restitution, height = e / e0 - 1.0, h / h0 - 1.0
    holds = abs(restitution) < _RULE_HOLDS
    found = (
        f"Of {shots.count} shots, shot {highest}, {format_si(aside, 'm', 2)} off-axis, "
        f"rebounds highest: {format_si(h, 'm', 3)} at a restitution of {e:.4f}; "
        f"the centred shot has {format_si(h0, 'm', 3)} and {e0:.4f}."
    )
    verdict = (
        f"Taking the highest rebound of {shots.count} for the centred one is "
        f"{'right' if holds else 'wrong'} for this valve: the restitution is wrong by "
        f"{100.0 * restitution:+.2f} % and the rebound height by {100.0 * height:+.1f} %."
    )
    return RuleVerdict(
        restitution_bias=e - e0,
        rebound_height_bias=h - h0,
        relative_restitution_bias=restitution,
        relative_rebound_height_bias=height,
        rank=int(np.sum(shots.rebound_height >= h0)),
        holds=holds,
        sentence=f"{found} {verdict}",
    )


def highest_of(shots: ShotColumns) -> int | None:
    """Row with the highest rebound; None if none reached its top."""
    complete = np.isfinite(shots.rebound_height) & np.isfinite(shots.restitution)
    if not np.any(complete):
        return None
    return int(np.argmax(np.where(complete, shots.rebound_height, -np.inf)))


def _pressures(
    setup: ShotSetup, pictured: Mapping[str, tuple[ShotDraw, Worn | None]]
) -> dict[str, PressureRecord]:
    records = {}
    for name, (draw, worn) in pictured.items():
        result = simulate_shot(setup, draw, impacts=1, points=True, worn=worn)
        first = result.impacts[0]
        record = pressure_record(
            first.history, first.point_force, setup.model.points, setup.model.area
        )
        if record is not None:
            records[name] = record
    return records


def _worn(shots: ShotColumns) -> Iterator[str]:
    if np.any(shots.plastic_loss):
        yield (
            "the faces yield: every shot meets them as left by the previous shots, the centred "
            f"shot after the last. They dissipate {100 * float(shots.plastic_loss[0]):.2g} % of "
            f"the energy of the first shot and {100 * float(shots.plastic_loss[-1]):.2g} % of "
            "the energy of the last; the permanent set is up to "
            f"{format_si(float(shots.deepest_set[-1]), 'm', 3)} deep."
        )


def _distributions(case: Case) -> dict[str, str]:
    shots = shots_of(case)
    words = {
        "closing force": closing_force(case).text("N"),
        **position_in_words(shots, case.guide),
        **friction_in_words(shots, case.guide),
    }
    if shots.contact_friction is not None:
        words["friction between the faces"] = shots.contact_friction.text("")
    if shots.waviness is not None:
        low, high = shots.waviness.harmonics
        words["waviness"] = f"{shots.waviness.rms.text('m')}; {low} to {high} waves around the ring"
    return words


def _faces_in_words(case: Case) -> str:
    faces = case.contact.faces.scaled(face_friction(case).mean)
    if faces.is_none:
        return ""
    drawn = shots_of(case).contact_friction
    if drawn is None or drawn.is_fixed:
        text = f"coefficient {faces.kinetic:.4g}"
    else:
        text = f"coefficient drawn, mean {faces.kinetic:.4g}"
    if faces.is_constant:
        return text
    share = "" if faces.kinetic == 0.0 else f" ({faces.static / faces.kinetic:.3g} times)"
    text += f"; {faces.static:.4g}{share} while they stick"
    if faces.speed > 0.0:
        text += f", decaying over {format_si(faces.speed, 'm/s')}"
    return text


def position_in_words(shots: Shots | StrokeShots, guide: CaseGuide | None) -> dict[str, str]:
    """Distributions of the position at the start."""
    given = (("eccentricity", shots.eccentricity, "m"), ("tilt", shots.tilt, "rad"))
    words = {name: size.text(unit) for name, size, unit in given if size is not None}
    if not words and guide is not None:
        words["eccentricity and tilt"] = (
            f"axis uniformly within the clearance of {format_si(guide.clearance, 'm')} at "
            "the lowest and the highest guiding height"
        )
    return words


def friction_in_words(shots: Shots | StrokeShots, guide: CaseGuide | None) -> dict[str, str]:
    """Distribution of the friction in a guide."""
    own = format_si(guide.friction, "") if guide is not None else ""
    text = own if shots.friction is None else shots.friction.text("")
    return {"friction in the guide": text} if text else {}


def guide_in_words(guide: CaseGuide | None) -> str:
    """Guide in words; empty without one."""
    if guide is None:
        return ""
    heights = " and ".join(format_si(height, "m") for height in guide.heights)
    law = guide.law
    if isinstance(law, LinearGuideLaw):
        stiffness = f"{format_si(law.stiffness, 'N/m')}"
    else:
        bore = "rigid bore" if law.bore is None else f"bore of {format_si(law.bore, 'N/m')}"
        stiffness = f"elastic shaft in a {bore}"
    text = f"{guide.surface} at {heights}, clearance {format_si(guide.clearance, 'm')}, {stiffness}"
    if guide.viscous > 0.0:
        text += f", drag {format_si(guide.viscous, 'N s/m')}"
    return text


def _unfinished(shots: ShotColumns) -> tuple[str, ...]:
    unfinished = int(np.sum(~np.isfinite(shots.rebound_height)))
    if not unfinished:
        return ()
    return (
        f"{unfinished} of {shots.count} shots ended before the top of their rebound and have "
        "no rebound height. Try: a longer shots.duration.",
    )


def shot_doubts(case: Case, dropped: DroppedShots) -> tuple[str, ...]:
    """Doubts of single shots, like ones once; energy from nowhere, and joints that may open."""
    notes = [dropped.checked.doubt] if dropped.checked.doubt else []
    notes += [f"The centred shot: {doubt}" for doubt in dropped.alone.doubts]
    notes += grouped_doubts(((item.index, item.doubts) for item in dropped.outcomes), "shots")
    residual = float(np.max(np.abs(dropped.shots.energy_residual)))
    if residual > _LARGE_RESIDUAL:
        notes.append(
            f"The energy balance of one shot has a residual of {residual:.1e}. Try: a "
            "shorter shots.step."
        )
    peaks = (*dropped.shots.peak_force, *dropped.centric.peak_force)
    return (*notes, *opening_doubts(case, peaks))
