r"""Which level of an impact can be relied on, by time step and record.

A step of the full order or of a contact law sees the first touch only at its end.  Measured on
three impacts (docs, *full order*): with n steps per contact the peak force is low by up to
:math:`40 / n^2`, so 100 steps keep half a per cent with a margin.  The trapezoidal rule of the full
order also lengthens the periods of the bodies by :math:`(\omega h)^2 / 12`, which 26 steps per
period keep below half a per cent; modal levels are exact there.

Where faces meet all at once, a large part of the force rises faster than the highest kept modes can
follow: the faces press against the static remainder of these modes, which is a spring without mass,
and the force overshoots and rings however many modes there are.  Bodies with every degree of
freedom carry the front away.  Gaps, speed and kept modes tell this before any level runs.
"""

from collections.abc import Iterable, Iterator, Mapping
from math import isfinite, sqrt

import numpy as np

from klack.analyses.impact.record import LevelResult
from klack.assembling.bodies import BodyPair
from klack.assembling.problem import ContactProblem
from klack.assembling.reduced_pair import ReducedPair
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.case.schema import Case
from klack.contact.history import ImpactHistory
from klack.contact.restitution import Deviation, ImpactMeasures, find_contacts
from klack.contact.statics import StaticContact
from klack.contact.touch_shape import area_at_once, front_pressure
from klack.materials.material import Material
from klack.units import format_si

__all__ = [
    "DISAGREEMENT",
    "STEPS_PER_CONTACT",
    "best_level",
    "disagreement",
    "doubt_modal_levels",
    "doubts_of",
    "doubts_of_history",
    "flat_doubt",
    "flat_for_modes",
    "flat_for_reduced",
    "trust_notes",
]


DISAGREEMENT = 0.02
"""Largest difference [-] of two levels that say the same."""

STEPS_PER_CONTACT = 100
"""Fewest steps of a contact whose force is known."""

_STEPS_OF_RISE = 5  # from a tenth to half of the peak; a half sine of 100 steps takes 13
_STEPS_PER_PERIOD = 2.0 * np.pi / sqrt(12.0 * 0.005)
_CARRIES = 0.05  # share of the impulse from which a contact has to be resolved
_RINGS = 0.01  # share of the initial energy from which a mode has to be resolved

_BEST = ("full", "interface", "reduced")
_ALTERNATIVES = ("interface", "reduced", "reduced-participation")
_KEYS = {"full": "run.full_step", "interface": "run.interface_step"}


def best_level(results: Mapping[str, LevelResult]) -> str:
    """Level whose numbers are the answer: the finest one that nothing speaks against.

    The lumped model and variants of the reduced one are never better than another.
    """
    variants = [name for name in results if name.startswith("reduced")]
    known = [name for name in (*_BEST, *variants, *results) if name in results]
    sound = [name for name in known if not results[name].doubts and name != "lumped"]
    return next(iter([*sound, *known]))


def disagreement(deviation: Deviation) -> float:
    """Largest difference in peak force, contact time, impulse and restitution [-]."""
    numbers = (
        deviation.peak_force,
        deviation.contact_time,
        deviation.impulse,
        deviation.restitution,
    )
    return max((abs(value) for value in numbers if isfinite(value)), default=0.0)


def trust_notes(
    results: Mapping[str, LevelResult], answer: str, deviations: Mapping[str, Deviation]
) -> tuple[str, ...]:
    """Objections to levels, the level of the answer, and the levels it corrects.

    ``answer`` is the best level, from which the deviations are.
    """
    doubted: dict[str, list[str]] = {}
    for name, result in results.items():
        for doubt in result.doubts:
            doubted.setdefault(doubt, []).append(name)
    notes = [f"{_named(names)}: {doubt}" for doubt, names in doubted.items()]
    notes += [
        f"level '{name}': {doubt}" for name in results for doubt in _lost_waves(results[name])
    ]
    finer = [name for name in _BEST[: _rank(answer)] if name in results]
    if results[answer].doubts and len(results) > 1:
        notes.append("no level can be a reference: no deviations are given.")
    elif finer:
        notes.append(
            f"the answer is from level '{answer}'; {_named(finer)} is not a reference, see above."
        )
    others = {name: result for name, result in results.items() if name != answer}
    second = best_level(others) if others else answer
    for name in dict.fromkeys((*_ALTERNATIVES, second)):
        if (
            name in deviations
            and name != "lumped"
            and disagreement(deviations[name]) > DISAGREEMENT
        ):
            notes.append(_verdict(name, deviations[name], answer, results[answer]))
    return tuple(notes)


_UNSETTLED = 0.1
"""Of its highest value: what the upper modes of a sensor may add.

Where they add less and modes reach 1.5 over the contact time, a sensor is off by about as much at
most: on a struck rod by 3 % under a ball and 11 % under a half sine, on rock by 6 %."""

_LOBE = 1.5
"""Over the contact time: the spectrum of a half sine is below an eighth of its impulse above."""


def _lost_waves(result: LevelResult) -> Iterator[str]:
    """Doubts about sensors, by body: their waves may be shorter than those of the kept modes."""
    time = result.measures.contact_time
    unsettled = [
        gauge
        for gauge in result.gauges
        if gauge.kept_up_to * time < _LOBE or gauge.upper_share > _UNSETTLED
    ]
    for body in dict.fromkeys(gauge.body for gauge in unsettled):
        here = [gauge for gauge in unsettled if gauge.body == body]
        kept = max(gauge.kept_up_to for gauge in here)
        share = max(gauge.upper_share for gauge in here)
        needed = format_si(max(2.0 * _LOBE / time, 1.5 * kept), "Hz", 2)
        yield (
            f"{' and '.join(repr(gauge.name) for gauge in here)} may move before the wave "
            f"arrives, and its peak may differ: a contact of {format_si(time, 's', 3)} sends "
            f"waves through '{body}' that are shorter than its kept modes, which end at "
            f"{format_si(kept, 'Hz', 3)}; modes above 0.7 of that contribute {100.0 * share:.0f} "
            f"% of the highest value. Try: level full, or reduction.modes.{body}: {{frequency: "
            f"{needed}}}."
        )


def _rank(level: str) -> int:
    return _BEST.index(level) if level in _BEST else len(_BEST)


def _named(names: list[str]) -> str:
    return f"level{'s' * (len(names) > 1)} {', '.join(repr(name) for name in names)}"


def _verdict(name: str, apart: Deviation, answer: str, best: LevelResult) -> str:
    return (
        f"level '{name}' deviates by {100 * apart.peak_force:+.1f} % in peak force, "
        f"{100 * apart.contact_time:+.1f} % in contact time and {apart.restitution:+.4f} in "
        f"restitution from level '{answer}' ({best.label}). The answer is from level '{answer}', "
        f"not from level '{name}'."
    )


def doubts_of(result: LevelResult) -> tuple[str, ...]:
    """Reasons why a level cannot measure others; see :func:`doubts_of_history`."""
    return doubts_of_history(
        result.history,
        result.measures,
        step=result.step,
        key=_KEYS.get(result.level, "run.reduced_step"),
        periods=_periods(result) if result.level == "full" else np.zeros(0),
    )


def doubts_of_history(
    history: ImpactHistory,
    measures: ImpactMeasures,
    *,
    step: float,
    key: str,
    periods: np.ndarray,
) -> tuple[str, ...]:
    """Reasons why a run cannot measure others, with what to try.

    Parameters
    ----------
    key
        Where a case gives the step.
    periods [s]
        Of ringing modes that the time integration does not take exactly.
    """
    if measures.cut_off:
        return (
            "the run ends before separation: peak force, contact time, impulse, spectrum and "
            "sound are incomplete, and there is no restitution. Try: a longer run.duration, two "
            "to three times the contact time.",
        )
    shortest = _shortest_contact(history, measures)
    if shortest < STEPS_PER_CONTACT * step:
        return (
            f"the time step is too coarse: {shortest / step:.3g} steps of {format_si(step, 's')} "
            f"in a contact of {format_si(shortest, 's', 3)}; {STEPS_PER_CONTACT} keep the peak "
            f"force within 0.5 %. Try: {key}: {_rounded(shortest / STEPS_PER_CONTACT)}.",
        )
    period = float(np.min(periods, initial=np.inf))
    if period < _STEPS_PER_PERIOD * step:
        return (
            f"the time step is too coarse: {period / step:.3g} steps of {format_si(step, 's')} in "
            f"a vibration of {format_si(1.0 / period, 'Hz', 3)} with part of the energy; "
            f"{_STEPS_PER_PERIOD:.0f} keep its period within 0.5 %. Try: {key}: "
            f"{_rounded(period / _STEPS_PER_PERIOD)}.",
        )
    if (rise := _rise(history, measures)) < _STEPS_OF_RISE * step:
        return (
            f"the force rises within {rise / step:.2g} steps of {format_si(step, 's')}, as for "
            "flat faces that meet all at once: its peak depends on step and mesh, impulse and "
            f"restitution hardly do. Try: {key}: {_rounded(step / 4)}, and check whether the "
            "peak converges.",
        )
    return ()


def _shortest_contact(history: ImpactHistory, measures: ImpactMeasures) -> float:
    """Duration of the shortest contact of the first impact that carries a share of it [s].

    Where there are so many that none does, of those that carry as much as the largest.
    """
    phases = _phases(history, measures)
    carried = [float(np.sum(history.force[p.first : p.last])) * history.step for p in phases]
    least = min(_CARRIES * measures.impulse, max(carried))
    return min(p.duration for p, J in zip(phases, carried, strict=True) if J >= least)


def _rise(history: ImpactHistory, measures: ImpactMeasures) -> float:
    """Time [s] that the force takes from a tenth to half of the peak."""
    strongest = _phases(history, measures)[measures.strongest - 1]
    force = history.force[strongest.first : strongest.last]
    top = float(force.max())
    return float(np.argmax(force >= 0.5 * top) - np.argmax(force >= 0.1 * top)) * history.step


def _phases(history: ImpactHistory, measures: ImpactMeasures) -> list:
    return list(find_contacts(history)[: measures.sub_contacts])


def _periods(result: LevelResult) -> np.ndarray:
    initial = result.history.ledger.initial
    frequency = [item.frequency[item.energy > _RINGS * initial] for item in result.modal_energy]
    return 1.0 / np.concatenate([np.zeros(0), *frequency])


def _rounded(step: float) -> str:
    """Time step below the one given, in two digits."""
    power = 10.0 ** (np.floor(np.log10(step)) - 1)
    return format_si(float(np.floor(step / power) * power), "s", 2)


_SHARE = 0.2
"""Of the highest quasi-static force: a front within one shortest period of the kept modes.

From here on their force rings.  Two bars with a crown (docs, *contact*): the peak of the interface
level is off by 18 % at a share of 0.36 and by 3 % at 0.18."""


def flat_for_reduced(problem: ContactProblem, kept: ReducedPair) -> str:
    """Doubt about the reduced level, for faces that meet all at once."""
    highest = (float(body.frequencies.max(initial=0.0)) for body in (kept.upper, kept.lower))
    return flat_doubt(problem.case, problem.pair, problem.static, highest)


def flat_for_modes(problem: ContactProblem, modes: Iterable[Modes]) -> str:
    """Doubt about the interface level with these modes of the bodies."""
    highest = (float(one.frequency.max(initial=0.0)) for one in modes)
    return flat_doubt(problem.case, problem.pair, problem.static, highest)


def flat_doubt(case: Case, pair: BodyPair, static: StaticContact, highest: Iterable[float]) -> str:
    """Doubt about faces that meet all at once, for the highest kept frequencies [Hz]."""
    speed = case.motion.speed
    bodies = (pair.upper, pair.lower)
    materials = [_material(case, *one) for one in zip(bodies, pair.solids, strict=True)]
    period = max((1.0 / one for one in highest if one > 0.0), default=0.0)
    if None in materials or period == 0.0:
        return ""
    pressure = front_pressure(speed, *(one for one in materials if one is not None))
    layer = 0.0 if pair.layer is None else pair.layer.closure_at(pressure)
    area = area_at_once(static.space, speed * period - layer)
    front = area * pressure
    if front < _SHARE * static.max_force:
        return ""
    contact = case.contact
    if case.backing is not None:
        advice = "Try: faces with their real crown in the drawing, or more modes."
    elif contact.has_form or contact.roughness is not None:
        advice = (
            "Try: more modes, or level full; the form of the faces in the case closes "
            "within that time."
        )
    else:
        advice = (
            "Try: real faces (contact.crown, waviness, tilt, roughness; ground ends deviate by "
            "0.2 to 5 um), more modes, or level full."
        )
    return (
        f"{1e6 * area:.3g} mm^2 of the faces meet all at once, within the shortest period of the "
        f"kept modes ({format_si(period, 's', 2)}): the force rises by about "
        f"{format_si(front, 'N', 2)} in that time, and rise and peak depend on the number of "
        f"modes. {advice}"
    )


def doubt_modal_levels(
    results: Mapping[str, LevelResult], *, reduced: str, interface: str
) -> dict[str, LevelResult]:
    """Add these doubts, if any, to modal levels."""
    doubts = {name: reduced if name.startswith("reduced") else "" for name in results}
    doubts["interface"] = interface
    return {name: result.doubted(doubts[name]) for name, result in results.items()}


def _material(case: Case, body: ElasticBody, solid: str) -> Material | None:
    if case.bodies[body.name].material is None:
        return None
    return case.materials_of(body.name, body.mesh.solids)[solid]
