"""Computed strokes beside measured ones: the same trigger, the same sensor, the same readings.

The computed lift is shown as the sensor would show it, counted from the same crossing of the same
channel as the measured strokes, and put on their grid.  Velocity and impacts are read off both
alike, so that what a differentiator or a fit takes away is taken from both.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import hypot, isfinite, nan, sqrt
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from klack.analyses.comparison.record import (
    IMPACT_NUMBERS,
    Compared,
    ComparedImpact,
    ComparedVariant,
    HighestShot,
    MeasuredStrokeStudy,
)
from klack.analyses.record import case_fields, run_fields
from klack.analyses.stroke.record import StrokeStudy, StrokeVariant
from klack.case.measurement import CaseMeasurement
from klack.errors import InputError, refuse_if
from klack.machine.progress import Progress, silent
from klack.machine.stages import StageClock, collected_warnings
from klack.measurement.channels import LIFT_ALONE, LiftSensor, Trigger
from klack.measurement.differentiation import velocity_of
from klack.measurement.impacts import fit_flights
from klack.measurement.lift_sensor import recorded_stroke, trigger_instant
from klack.measurement.loading import load_stroke_set
from klack.measurement.set_measures import highest_rebound, measure_strokes
from klack.measurement.stroke_measures import MeasuredImpact, Stop, StrokeMeasures, StrokeSet
from klack.units import format_si

__all__ = ["EXCELLENT", "FAIR", "compare_numbers", "compare_strokes", "sensor_words"]

Floats = NDArray[np.float64]

EXCELLENT, FAIR = 2.0, 5.0
"""Differences over the scatter up to which an agreement has these names."""
_NOTICED = 0.05
"""Share of the fastest approach below which an impact does not count."""
_REACHED = 0.1
"""Share of the way that may be missing at the opening stop."""
_BY_DRAWING = (
    "The needle never rests on the opening stop in some strokes; there its level is the level "
    "of the seat plus the lift in the drawing."
)
_REPLICAS, _SEED = 16, 1
"""Noisy copies of the computed lift: their median has a third of the reading error of one."""
_FEWEST_SHOTS = 3
_STOPS: tuple[Stop, ...] = ("opening", "seat")
_AGAINST = -0.5  # correlation


def compare_strokes(
    study: StrokeStudy,
    measurements: Mapping[str, Sequence[Path]],
    section: CaseMeasurement | None,
    *,
    case_text: str | None = None,
    progress: Progress = silent,
) -> MeasuredStrokeStudy:
    """Compare the variants of a stroke study with their measured sets.

    ``measurements`` are files of one set for each variant.  Without a ``section``, channels are
    found by their names, each recording is one stroke, and the sensor is perfect; ``case_text`` is
    its case, if not that of the study.
    """
    begin = perf_counter()
    used = CaseMeasurement() if section is None else section
    clock = StageClock(progress)
    variants = {}
    with collected_warnings() as notes:
        for name, paths in measurements.items():
            variant = _variant(study, name)
            clock(f"read {name}", 0.0)
            strokes = load_stroke_set(paths, used, roles=LIFT_ALONE)
            clock(f"compare {name}", 0.0)
            variants[name] = _compare(study, variant, strokes, used)
    return MeasuredStrokeStudy(
        **case_fields(study, case_text),
        **run_fields(begin, clock),
        trigger=_trigger_words(used.trigger),
        sensor=sensor_words(used.sensor),
        zero=used.zero,
        point=study.channels.lift.removesuffix(" displacement"),
        variants=variants,
        excellent=EXCELLENT,
        fair=FAIR,
        warnings=tuple(notes),
    )


def _variant(study: StrokeStudy, name: str) -> StrokeVariant:
    refuse_if(
        name not in study.variants,
        f"--measurement {name}=...",
        got=f"a result without the variant '{name}'",
        expected=f"one of: {', '.join(study.variants)}",
        hint=f"run `klack stroke {study.case} --variant {name}` first, or name another variant.",
    )
    return study.variants[name]


# --------------------------------------------------------------------------- one variant


def _compare(
    study: StrokeStudy, variant: StrokeVariant, strokes: StrokeSet, section: CaseMeasurement
) -> ComparedVariant:
    time, computed = _computed_lift(study, variant, strokes.time, section)
    lift = strokes.matrix("lift")[:, : time.size]
    estimate = velocity_of(time, lift, bandwidth=section.velocity_bandwidth)
    speed = velocity_of(time, computed, bandwidth=estimate.bandwidth)
    low, median, high = _band(lift)
    require_same_way(strokes.source, computed, median)
    slow, middle, fast = _band(estimate.velocity)
    sensor = section.sensor
    if section.zero == "start":
        sensor = sensor.model_copy(update={"offset": 0.0})
    copies = _REPLICAS if len(lift) >= _FEWEST_SHOTS else len(lift)  # a set, or single strokes
    noisy = _as_noisy(computed, estimate.lift_noise, copies)
    model, readings = (_read(time, rows, sensor, study.lift) for rows in (noisy, lift))
    notes = strokes.notes
    if any(reading.by_drawing for reading in (*model, *readings)):
        notes = (*notes, _BY_DRAWING)
    return ComparedVariant(
        variant=variant.name,
        label=variant.label,
        source=strokes.source,
        count=strokes.count,
        rejected=strokes.rejected,
        notes=notes,
        time=time,
        lift=lift.astype(np.float32),
        velocity=estimate.velocity.astype(np.float32),
        lift_median=median,
        lift_low=low,
        lift_high=high,
        velocity_median=middle,
        velocity_low=slow,
        velocity_high=fast,
        computed_lift=computed,
        computed_velocity=speed.velocity,
        velocity_bandwidth=estimate.bandwidth,
        velocity_noise=estimate.noise,
        lift_rms=_rms(computed - median),
        velocity_rms=_rms(speed.velocity - middle),
        lift_scatter=_scatter(lift, median),
        velocity_scatter=_scatter(estimate.velocity, middle),
        way=compare_numbers(
            [item.travel for item in model],
            [item.travel for item in readings],
            [item.measures.level_se for item in readings],
        ),
        impacts=_impacts(model, readings, strokes.step),
        highest=_highest([stroke.name for stroke in strokes.strokes], readings),
    )


def require_same_way(source: str, computed: Floats, measured: Floats) -> None:
    """Refuse a lift that goes down where the computed one goes up: correlated by less than -0.5."""
    if float(np.ptp(computed)) == 0.0 or float(np.ptp(measured)) == 0.0:
        return
    together = float(np.corrcoef(computed, measured)[0, 1])
    refuse_if(
        together < _AGAINST,
        f"{source}: lift",
        got=f"a lift that moves against the computed one (correlation {together:.2f})",
        expected="a lift that grows as the valve opens",
        hint="if the sign of the sensor is reversed, state it in the case: measurement: "
        "{channels: {lift: {name: NAME, scale: -1}}}.",
    )


@dataclass(frozen=True, kw_only=True)
class _Reading:
    """Numbers of one stroke; ``by_drawing``: the opening stop is put by the drawing."""

    measures: StrokeMeasures
    moves: float
    by_drawing: bool

    @property
    def travel(self) -> float:
        """Between the stops [m]; nan unless the needle rested on both."""
        return nan if self.by_drawing else self.measures.lift

    def on(self, stop: Stop) -> tuple[MeasuredImpact, ...]:
        """Impacts on a stop after the first motion, without trembling at rest."""
        hits = [hit for hit in self.measures.on(stop) if hit.time > self.moves]
        known = (hit.approach_speed for hit in self.measures.impacts)
        fastest = max((speed for speed in known if isfinite(speed)), default=0.0)
        real = [i for i, hit in enumerate(hits) if hit.approach_speed > _NOTICED * fastest]
        return tuple(hits[real[0] : real[-1] + 1]) if real else ()


def _read(time: Floats, lifts: Floats, sensor: LiftSensor, way: float | None) -> list[_Reading]:
    """Readings of a set; the drawing gives the opening stop on which a needle never rests."""
    fits, drawn = [], []
    for lift in lifts:
        fit = fit_flights(time, lift, sensor=sensor)
        seat, highest = fit.levels.get("seat"), float(np.max(lift)) - sensor.offset
        drawn.append(False)
        if (
            seat is not None
            and "opening" not in fit.levels
            and way is not None
            and highest > (1.0 - _REACHED) * way
        ):
            fit = fit_flights(time, lift, sensor=sensor, seat=seat, opening=seat + way)
            drawn[-1] = True
        fits.append(fit)
    half = 0.5 * (np.min(lifts, axis=1) + np.max(lifts, axis=1))
    moves = time[np.argmax(lifts > half[:, None], axis=1)]
    return [
        _Reading(measures=measures, moves=float(first), by_drawing=by_drawing)
        for measures, first, by_drawing in zip(measure_strokes(fits), moves, drawn, strict=True)
    ]


def _as_noisy(lift: Floats, noise: float, count: int) -> Floats:
    """Computed lift with the noise of the measured one, several times.

    A reading fits longer stretches where there is more noise, and what these bend changes the
    result: both sides must have the same.
    """
    random = np.random.default_rng(_SEED)
    return lift + noise * random.standard_normal((count, lift.size))


def _computed_lift(
    study: StrokeStudy, variant: StrokeVariant, time: Floats, section: CaseMeasurement
) -> tuple[Floats, Floats]:
    """Grid up to the end of the computation, and the lift as the sensor shows it.

    Before the computation the valve rests.
    """
    result, trigger = variant.result, section.trigger
    lift = result.channels[study.channels.lift].values
    channels = {"lift": lift - lift[0]}
    begin = 0.0
    if trigger is not None:
        triggering = channels.setdefault(trigger.channel, _of_role(study, variant, trigger.channel))
        step = float(time[1] - time[0])
        begin = trigger_instant(result.time, triggering, trigger, step)
    grid = time[time <= result.time[-1] - begin]
    shown = recorded_stroke(
        result.time,
        channels,
        grid,
        sensor=section.sensor,
        trigger=trigger,
        zeroed=section.zero == "start",
    )
    return grid, shown["lift"]


def _of_role(study: StrokeStudy, variant: StrokeVariant, role: str) -> Floats:
    names = {
        "lift": (study.channels.lift,),
        "velocity": (study.channels.lift_velocity,),
        "current": study.channels.current,
        "voltage": study.channels.voltage,
        "force": study.channels.magnetic_force,
        "pressure": study.channels.pressures,
    }.get(role, ())
    for name in names:
        data = variant.channel(name)
        if data is not None:
            return data.values
    raise InputError(
        "measurement.trigger.channel",
        got=f"'{role}', which the variant '{variant.name}' does not compute",
        expected="a channel of the model: lift, velocity, current, voltage, pressure",
        hint="trigger on lift: channel: lift, share: 20 %.",
    )


def _band(records: Floats) -> tuple[Floats, Floats, Floats]:
    """5 %, median and 95 % of the strokes at every time."""
    low, median, high = np.quantile(records, (0.05, 0.5, 0.95), axis=0)
    return low, median, high


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _scatter(records: Floats, median: Floats) -> float:
    return _rms(records - median) if len(records) > 1 else nan


# --------------------------------------------------------------------------- impacts


def _impacts(
    model: Sequence[_Reading], readings: Sequence[_Reading], step: float
) -> tuple[ComparedImpact, ...]:
    found = []
    for stop in _STOPS:
        computed, measured = ([item.on(stop) for item in side] for side in (model, readings))
        for i in range(max(map(len, computed))):
            ours, theirs = ([h[i] for h in side if len(h) > i] for side in (computed, measured))
            if 2 * len(ours) < len(model) or 2 * len(theirs) < len(readings) or not theirs:
                break
            found.append(_impact(stop, i + 1, ours, theirs, step))
    return tuple(sorted(found, key=lambda item: item.time.computed))


def _highest(names: Sequence[str], readings: Sequence[_Reading]) -> tuple[HighestShot, ...]:
    """Stroke with the highest first rebound from each stop, of three or more."""
    found = []
    for stop in _STOPS:
        hits = [reading.on(stop) for reading in readings]
        firsts = [hit[0] if hit else None for hit in hits]
        values, errors = (
            np.array([getattr(hit, name) if hit else nan for hit in firsts])
            for name in ("rebound_height", "rebound_height_se")
        )
        if np.count_nonzero(np.isfinite(values)) < _FEWEST_SHOTS:
            continue
        best = highest_rebound(values, errors)
        bounces = [sum(hit.rebound_height > 0.0 for hit in of_stroke) for of_stroke in hits]
        shot = firsts[best.index]
        assert shot is not None  # its rebound is the highest
        found.append(
            HighestShot(
                stop=stop,
                stroke=names[best.index],
                count=best.count,
                rebound_height=best.value,
                rebound_height_error=best.error,
                restitution=shot.restitution,
                restitution_error=shot.restitution_se,
                by_reading=best.normal_excess,
                above_median=best.above_median,
                bounces=float(np.median(bounces)),
            )
        )
    return tuple(found)


def _impact(
    stop: Stop,
    number: int,
    ours: Sequence[MeasuredImpact],
    theirs: Sequence[MeasuredImpact],
    step: float,
) -> ComparedImpact:
    """Numbers of one impact; times are no better than the sampled trigger."""
    sampled = {"time": step / sqrt(12.0)}
    numbers = {
        field: compare_numbers(
            [getattr(hit, field) for hit in ours],
            [getattr(hit, field) for hit in theirs],
            [hypot(getattr(hit, _ERRORS[field]), sampled.get(field, 0.0)) for hit in theirs],
        )
        for field in IMPACT_NUMBERS
    }
    return ComparedImpact(stop=stop, number=number, **numbers)


_ERRORS = {
    "time": "time_se",
    "approach_speed": "approach_se",
    "restitution": "restitution_se",
    "rebound_height": "rebound_height_se",
}


def compare_numbers(
    readings: Sequence[float], values: Iterable[float], errors: Iterable[float]
) -> Compared:
    """One computed number beside that of several strokes; nan are left out."""
    ours = [value for value in readings if isfinite(value)]
    computed = float(np.median(ours)) if ours else nan
    both = np.array([(v, e) for v, e in zip(values, errors, strict=True) if isfinite(v)])
    if not both.size:
        return Compared(computed=computed, measured=nan, scatter=nan, error=nan, count=0)
    known, error = both[:, 0], float(np.median(both[:, 1]))
    return Compared(
        computed=computed,
        measured=float(np.median(known)),
        scatter=float(np.std(known, ddof=1)) if known.size > 1 else nan,
        error=error,
        count=int(known.size),
    )


# --------------------------------------------------------------------------- words


def _trigger_words(trigger: Trigger | None) -> str:
    if trigger is None:
        return "none: each recording is one stroke from its first sample"
    at = trigger.level or f"{100 * trigger.share_of_way:g} % of its way"
    return f"{trigger.channel} {trigger.slope} through {at}"


def sensor_words(sensor: LiftSensor) -> str:
    """A lift sensor in one line."""
    if sensor.bandwidth is None:
        words = ["unlimited bandwidth"]
    else:
        words = [f"bandwidth {format_si(sensor.bandwidth, 'Hz')} (order {sensor.order})"]
    if sensor.sensitivity != 1.0:
        words.append(f"sensitivity {sensor.sensitivity:g}")
    if sensor.offset != 0.0:
        words.append(f"offset {format_si(sensor.offset, 'm')}")
    if sensor.resolution > 0.0:
        words.append(f"resolution {format_si(sensor.resolution, 'm')}")
    return ", ".join(words)
