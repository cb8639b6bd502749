"""``klack calibrate``: fit parameters of a valve to measured strokes."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.analyses.calibration.motion import (
    Motion,
    MotionModel,
    StrokeModel,
    TrialPool,
    calibration_mark,
    channel_names,
    trial_log,
)
from klack.analyses.calibration.record import (
    CalibratedParameter,
    CalibrationStudy,
    FittedChannel,
    FittedImpact,
    ProfileCurve,
)
from klack.analyses.comparison.strokes import require_same_way
from klack.analyses.record import case_fields, run_fields
from klack.analyses.stroke.run import one_variant
from klack.assembling.modes import damping_of
from klack.assembling.valve import Valve, build_valve
from klack.case.any_case import CaseTree, read_valve_case
from klack.case.free_parameters import FreeParameter, free_parameters
from klack.case.key_path import written_at
from klack.case.measurement import CaseCalibration, CaseMeasurement
from klack.case.rewriting import moved_files, rewritten, written_quantity
from klack.case.spatial_consistency import require_axial
from klack.case.valve import ValveCase
from klack.case.valve_roles import ValveRoles, find_roles
from klack.errors import AccuracyWarning, InputError, refuse_if
from klack.input.problem import one_of
from klack.machine.cores import available_cores
from klack.machine.progress import Progress, silent
from klack.machine.stages import StageClock, collected_warnings, trial
from klack.measurement.channels import ROLES, LiftSensor
from klack.measurement.fit_window import (
    FitWindow,
    fit_windows,
    sample_weights,
    touch_shifts,
    window_taper,
)
from klack.measurement.fitting import Fit, Profile, fit_within_bounds, follow_profiles
from klack.measurement.impacts import measure_stroke
from klack.measurement.lift_sensor import sense, trigger_instant
from klack.measurement.shot_covariance import (
    ShotCovariance,
    identifiability,
    identifiability_warnings,
    noise_covariance,
    shot_covariance,
)
from klack.measurement.stroke_measures import StrokeSet
from klack.units import format_si

__all__ = ["CALIBRATED_NAME", "calibrated_text", "calibration_of", "run_calibration"]


Vector = NDArray[np.float64]
Impacts = Mapping[str, Sequence[float]]

_POOR = 3.0
"""Misfit above which the model does not explain the strokes."""
_HOPELESS = 10.0
"""Misfit above which the search begins again from the middle of the bounds."""
_LATER = 0.3e-3  # [s] that a computed stroke may trigger later than at the start
_FINER, _FINEST = 8.0, 0.1e-6  # records per sample, and their least spacing [s]
_REST = 0.3e-3  # [s] of rest on the opening stop after which a closing is repeatable
_FEW = 5  # strokes below which the errors are rough
_USUAL_ITERATIONS = 8
_STOPS = {"opening": "opening stop", "seat": "seat"}


def calibration_of(case: ValveCase) -> CaseCalibration:
    """Section ``calibration`` of a case; InputError without one."""
    if case.calibration is None:
        raise InputError(
            f"{case.path or 'case'}: calibration",
            got="no section 'calibration'",
            expected="the parameters to fit, with their bounds",
            hint="add e.g. 'calibration: {parameters: {preload: {key: "
            "network.components.spring.preload, lower: 8 N, upper: 16 N}}}'.",
        )
    return case.calibration


def run_calibration(
    tree: CaseTree,
    strokes: StrokeSet,
    *,
    folder: Path | None = None,
    workers: int | None = None,
    progress: Progress = silent,
    threads: int | None = None,
) -> CalibrationStudy:
    """Fit the parameters of the section ``calibration`` to measured strokes.

    Computed trials are kept in ``folder`` until the end; the same call resumes from them.
    ``workers`` are processes, by default as many as cores; ``threads`` those of factorisations.
    InputError also for a motion in three dimensions, strokes without the fitted channels, or a lift
    that goes down where the computed one goes up.
    """
    begin = perf_counter()
    case = tree.case()
    require_axial(case, "klack calibrate")
    section = calibration_of(case)
    parameters = free_parameters(case)
    _require_written(tree, parameters)
    _require_channels(strokes, section)
    measurement = case.measurement or CaseMeasurement()
    clock = StageClock(progress)
    workers = available_cores() if workers is None else workers
    mark = calibration_mark(case, strokes)
    with trial_log(folder, mark) as log, collected_warnings() as notes:
        resumed = len(log.done)
        valve, roles = build_valve(case, clock, threads=threads), find_roles(case)
        with trial():  # the fitted stroke warns
            first = one_variant(valve, roles, section.variant, clock)
        model = _motion_model(
            tree, parameters, strokes, measurement, valve, roles, first.variant.halvings
        )
        with TrialPool(model, workers, log) as pool:
            clock("first strokes", 0.0)
            shown = StrokeModel(
                parameters=parameters,
                pool=pool,
                sensor=measurement.sensor,
                trigger=measurement.trigger,
                zeroed=measurement.zero == "start",
                time=strokes.time,
                channels=section.channels,
                counted=np.ones(strokes.time.size, dtype=bool),
                duration=case.run.duration,
            )
            found, doubts = _calibrate(case, section, strokes, shown, clock)
            evaluations = len(pool.used)
            resumed = sum(key in pool.used for key in list(log.done)[:resumed])
        pairs = zip(parameters, found["parameters"], strict=True)
        values = [fitted.value for one, fitted in pairs if not one.of_sensor]
        _check_steps(model, valve, values, clock)
    return CalibrationStudy(
        **case_fields(case),
        **run_fields(begin, clock),
        profile_time=clock.spent(("profiles",)),
        source=strokes.source,
        strokes=tuple(stroke.name for stroke in strokes.strokes),
        rejected=tuple(f"{item.name}: {item.reason}" for item in strokes.rejected),
        variant=section.variant,
        warnings=(*strokes.notes, *notes, *doubts),
        time=strokes.time,
        evaluations=evaluations,
        resumed=resumed,
        workers=workers,
        **found,
    )


def _require_written(tree: CaseTree, parameters: Sequence[FreeParameter]) -> None:
    """Only keys in the file can get a calibrated value there."""
    for parameter in parameters:
        for place in parameter.places:
            if written_at(tree.data, place.key) is None:
                line = tree.lines.find(place.key, on_key=True)
                value = place.written(place.value)
                raise InputError(
                    f"{tree.path}:{line}: {place}",
                    got="nothing in the file (the default applies)",
                    expected=f"the start value of the parameter '{parameter.name}'",
                    hint=f"write '{place.key[-1]}: {value}' there.",
                )


def _require_channels(strokes: StrokeSet, section: CaseCalibration) -> None:
    for role in section.channels:
        refuse_if(
            role not in strokes.roles,
            strokes.source,
            got=f"strokes without the channel '{role}'",
            expected=f"the channels of calibration.channels ({one_of(section.channels)}); "
            f"found: {one_of(strokes.roles)}",
            hint="name it in measurement.channels, or fit only the lift.",
        )
    refuse_if(
        "lift" not in strokes.roles,
        strokes.source,
        got="strokes without lift",
        expected="the lift: impacts and windows are found in it",
        hint="name its channel in measurement.channels.",
    )


def _check_steps(
    model: MotionModel, valve: Valve, values: Sequence[float], progress: Progress
) -> None:
    """Warn of what ``klack stroke`` warns of, and of steps too long for the fitted ``values``."""
    case, network = model.at(values)
    valve = replace(valve, case=case, network=network)
    name, halvings = case.one_variant(model.variant), model.halvings
    last = one_variant(valve, model.roles, name, progress, halvings=halvings).variant
    if last.halvings > halvings:
        warnings.warn(
            f"the fitted stroke depends on its time steps more than the one at the start: it needs "
            f"them halved {last.halvings} times, and was fitted with {halvings}. Try: calibrate "
            "again from the fitted values.",
            AccuracyWarning,
            stacklevel=2,
        )


def _motion_model(
    tree: CaseTree,
    parameters: tuple[FreeParameter, ...],
    strokes: StrokeSet,
    measurement: CaseMeasurement,
    valve: Valve,
    roles: ValveRoles,
    halvings: int,
) -> MotionModel:
    case = valve.case
    section = calibration_of(case)
    trigger = measurement.trigger
    wanted = dict.fromkeys(["lift", *section.channels, *([trigger.channel] if trigger else [])])
    return MotionModel(
        tree=tree,
        parameters=tuple(p for p in parameters if not p.of_sensor),
        variant=section.variant,
        roles=roles,
        channels=channel_names(valve.network, roles, tuple(wanted), f"{case.path or 'case'}"),
        reduced={name: replace(body, recovery=None) for name, body in valve.reduced.items()},
        by_layers={
            name: body.damping - damping_of(case.bodies[name].damping).ratios(body.omega)
            for name, body in valve.reduced.items()
            if case.bodies[name].layers
        },
        laws=valve.laws,
        record=max(strokes.step / _FINER, _FINEST),
        halvings=halvings,
    )


def _calibrate(
    case: ValveCase,
    section: CaseCalibration,
    strokes: StrokeSet,
    whole: StrokeModel,
    clock: StageClock,
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Fit, judge and follow the parameters; ``whole`` computes all samples of a stroke.

    Returns fields of the record, and doubts.
    """
    parameters = whole.parameters
    start = np.array([p.start for p in parameters])
    at_start = whole.motion(start, whole.duration)
    before = whole.recorded(at_start, start)
    mean = strokes.matrix("lift").mean(axis=0)
    require_same_way(strokes.source, before["lift"], mean)
    measured = _impacts_of(strokes.time, mean, whole.sensor)
    if not any(measured.values()):  # nothing to be seen: take the model's
        measured = _computed_impacts(whole, at_start, start)
    time, lift = strokes.time, mean
    windows = fit_windows(time, strokes.matrix("lift"), measured, section.impacts)
    windows, restless = _repeatable(windows, measured, _computed_impacts(whole, at_start, start))
    taper = window_taper(time, windows)
    counted = taper > 0.0
    ends = max(window.last for window in windows) + _begin(whole, at_start, start) + _LATER
    model = replace(
        whole,
        counted=counted,
        duration=float(min(case.run.duration, np.ceil(ends / 1e-5) * 1e-5)),
    )
    matrices = {role: strokes.matrix(role) for role in section.channels}
    weight = {role: taper * sample_weights(x, strokes.step) for role, x in matrices.items()}
    data = np.concatenate([x.mean(axis=0)[counted] for x in matrices.values()])
    weights = np.concatenate([w[counted] for w in weight.values()])
    fit = _search(model, data, weights, model.scaled(start), strokes.count, taper, clock)

    residuals = np.concatenate([x[:, counted] for x in matrices.values()], axis=1) - fit.model
    covariance = (
        shot_covariance(fit.jacobian, weights, residuals)
        if strokes.count > 1
        else noise_covariance(fit.jacobian, weights, residuals[0])
    )
    seen = identifiability(fit.jacobian, weights)
    profiles = _profiles(model, data, weights, fit, covariance, section, clock)
    clock("last strokes", 0.0)
    values = model.unscaled(fit.z)
    at_end = whole.motion(values, whole.duration)
    after = whole.recorded(at_end, values)
    misfit = _misfit(fit.cost, strokes.count, taper, len(section.channels))
    impacts = _impacts(
        strokes,
        measured,
        _impacts_of(time, before["lift"], whole.sensor_of(start)),
        _impacts_of(time, after["lift"], whole.sensor_of(values)),
    )
    names = [p.name for p in parameters]
    doubts = (
        *restless,
        *_doubts(fit, misfit, strokes.count, len(names), impacts, windows),
        *identifiability_warnings(names, fit.z, seen, covariance),
    )
    fields = dict(
        parameters=_parameters(parameters, fit, covariance),
        correlation=covariance.correlation,
        design_correlation=seen.correlation,
        singular_values=seen.singular_values,
        channels=tuple(
            _channel(role, strokes.matrix(role), before[role], after[role], weight.get(role, taper))
            for role in dict.fromkeys(("lift", *section.channels))
        ),
        windows=windows,
        impacts=impacts,
        profiles=profiles,
        residual_rms=_rms(lift - after["lift"], counted),
        residual_rms_before=_rms(lift - before["lift"], counted),
        misfit=misfit,
        degrees=covariance.degrees,
        iterations=fit.iterations,
        converged=fit.converged,
    )
    return fields, doubts


def _repeatable(
    windows: tuple[FitWindow, ...], measured: Impacts, computed: Impacts
) -> tuple[tuple[FitWindow, ...], tuple[str, ...]]:
    """Leave the closing out if the needle still bounces on the opening stop when it begins.

    Bounces too low to be measured then decide when it closes; the sum of squares gets many minima.
    """
    if len(windows) < 2:
        return windows, ()
    opening, closing = windows
    ends = [impacts.get("seat", ()) for impacts in (measured, computed)]
    bounces = [
        instant
        for impacts, seat in zip((measured, computed), ends, strict=True)
        for instant in impacts.get("opening", ())
        if not any(opening.last < t < instant for t in seat)
    ]
    last = max(bounces, default=-np.inf)
    if last < closing.first - _REST:
        return windows, ()
    return (opening,), (
        f"The needle still bounces on the opening stop {1e3 * last:.3g} ms after the trigger, "
        "shortly before it closes: bounces too small to be measured determine that time, so "
        "only the opening was fitted. Try: a longer stroke, or the wet valve.",
    )


def _search(
    model: StrokeModel,
    data: Vector,
    weights: Vector,
    start: Vector,
    count: int,
    taper: Vector,
    clock: StageClock,
) -> Fit:
    """Search from the case; from the middle of the bounds if that leads nowhere."""

    def told(iteration: int) -> None:
        clock("fit", min(iteration / _USUAL_ITERATIONS, 0.95))

    clock("fit", 0.0)
    fit = fit_within_bounds(model, data, weights, start, progress=told)
    if _misfit(fit.cost, count, taper, len(model.channels)) > _HOPELESS:
        other = fit_within_bounds(model, data, weights, np.full(start.size, 0.5), progress=told)
        fit = other if other.cost < fit.cost else fit
    return fit


def _misfit(cost: float, count: int, taper: Vector, channels: int) -> float:
    return float(np.sqrt(count * cost / max(channels * taper.sum(), 1e-12)))


def _profiles(
    model: StrokeModel,
    data: Vector,
    weights: Vector,
    fit: Fit,
    covariance: ShotCovariance,
    section: CaseCalibration,
    clock: StageClock,
) -> tuple[ProfileCurve, ...]:
    names = [p.name for p in model.parameters]
    error = covariance.standard_error
    wanted = [
        i for i in map(names.index, dict.fromkeys(section.profile)) if 0.0 < error[i] < np.inf
    ]
    if not wanted:
        return ()
    clock("profiles", 0.0)
    found = follow_profiles(model, data, weights, fit, covariance, wanted)
    return tuple(_curve(model.parameters[profile.index], profile) for profile in found)


def _curve(parameter: FreeParameter, profile: Profile) -> ProfileCurve:
    span = parameter.upper - parameter.lower
    return ProfileCurve(
        name=parameter.name,
        values=parameter.lower + span * profile.z,
        excess=profile.excess,
        threshold=profile.threshold,
        lower=parameter.lower + span * profile.lower if profile.lower > 0.0 else -np.inf,
        upper=parameter.lower + span * profile.upper if profile.upper < 1.0 else np.inf,
    )


# --------------------------------------------------------------------------- impacts


def _impacts_of(time: Vector, lift: Vector, sensor: LiftSensor) -> Impacts:
    """Impact times on both stops [s], read off a lift."""
    found = measure_stroke(time, lift, sensor=sensor).impacts
    return {stop: [i.time for i in found if i.stop == stop] for stop in _STOPS}


def _computed_impacts(model: StrokeModel, motion: Motion, values: Vector) -> Impacts:
    """Impact times of the solver, from the trigger [s]."""
    begin = _begin(model, motion, values)
    return {stop: [t - begin for t in times] for stop, times in motion.impacts.items()}


def _begin(model: StrokeModel, motion: Motion, values: Vector) -> float:
    """When a computed stroke triggers [s]."""
    if model.trigger is None:
        return 0.0
    channel = motion.channels[model.trigger.channel].astype(np.float64)
    if model.trigger.channel == "lift":
        channel = sense(motion.time, channel, model.sensor_of(values))
    step = float(model.time[1] - model.time[0])
    return trigger_instant(motion.time, channel, model.trigger, step)


def _impacts(
    strokes: StrokeSet, measured: Impacts, before: Impacts, after: Impacts
) -> tuple[FittedImpact, ...]:
    runs = [measured, before, after]
    lifts = strokes.matrix("lift")
    openings = [_first(run, "opening", -np.inf) for run in runs]
    result = []
    for stop in _STOPS:
        since = [-np.inf if stop == "opening" or np.isnan(t) else t for t in openings]
        times = [_first(run, stop, t) for run, t in zip(runs, since, strict=True)]
        if not np.isfinite(times).any():
            continue
        scatter = np.nan
        if np.isfinite(times[0]) and strokes.count > 1:
            scatter = float(np.std(touch_shifts(strokes.time, lifts, times[0]), ddof=1))
        result.append(
            FittedImpact(
                stop=stop, measured=times[0], scatter=scatter, before=times[1], after=times[2]
            )
        )
    return tuple(result)


def _first(impacts: Impacts, stop: str, since: float) -> float:
    return float(next((t for t in impacts.get(stop, ()) if t > since), np.nan))


# --------------------------------------------------------------------------- numbers and words


def _parameters(
    parameters: Sequence[FreeParameter], fit: Fit, covariance: ShotCovariance
) -> tuple[CalibratedParameter, ...]:
    error, quantile = covariance.standard_error, covariance.quantile
    result = []
    for j, p in enumerate(parameters):
        span = p.upper - p.lower
        value, se = p.lower + span * float(fit.z[j]), span * float(error[j])
        result.append(
            CalibratedParameter(
                name=p.name,
                keys=tuple(str(place) for place in p.places),
                unit=p.unit,
                value=value,
                standard_error=se,
                lower_95=value - quantile * se,
                upper_95=value + quantile * se,
                start=p.start,
                lower=p.lower,
                upper=p.upper,
                strokes=value + span * covariance.estimates[:, j],
            )
        )
    return tuple(result)


def _channel(
    role: str, strokes: NDArray[np.float64], before: Vector, after: Vector, weight: Vector
) -> FittedChannel:
    low, high = np.quantile(strokes, (0.05, 0.95), axis=0)
    return FittedChannel(
        role=role,
        unit=next(kind.unit for name, kind in ROLES.items() if name == role),
        mean=strokes.mean(axis=0),
        low=low,
        high=high,
        before=before,
        after=after,
        weight=weight,
    )


def _rms(values: Vector, counted: NDArray[np.bool_]) -> float:
    return float(np.sqrt(np.mean(values[counted] ** 2)))


def _doubts(
    fit: Fit,
    misfit: float,
    count: int,
    parameters: int,
    impacts: Sequence[FittedImpact],
    windows: Sequence[FitWindow],
) -> list[str]:
    notes = []
    if not fit.converged:
        notes.append(
            f"The search stopped after {fit.iterations} iterations before convergence. "
            "Try: closer bounds, or fewer parameters."
        )
    if misfit > _POOR:
        notes.append(
            f"The model does not explain the strokes: the residual is {misfit:.1f} times the "
            "value that their scatter allows, so the intervals are too narrow. Check the "
            "residual over time; the cause lies outside the parameters."
        )
    if count == 1:
        notes.append(
            "A single stroke shows noise but no scatter between strokes: the true "
            "uncertainty is larger than the intervals. Measure ten strokes or more."
        )
    elif count < _FEW or count < parameters + 2:
        notes.append(
            f"{count} strokes give only a rough scatter of {parameters} parameters: the single "
            "errors are valid (with Student's t), the correlations are not. Measure ten strokes "
            "or more."
        )
    for impact in impacts:
        inside = [w for w in windows if w.first <= impact.measured <= w.last]
        if inside and not any(w.first <= impact.after <= w.last for w in inside):
            notes.append(
                f"The computed first impact on the {_STOPS[impact.stop]} lies outside the fitted "
                "window: the search did not find the measured stroke. Try: other start values."
            )
    return notes


CALIBRATED_NAME = "case_calibrated.yaml"


def calibrated_text(tree: CaseTree, study: CalibrationStudy, folder: Path) -> str:
    """Text of the case with the values found, for a file in ``folder``.

    Comments and order stay; files are named from the new place.  Errors as of
    :func:`klack.analyses.advice.advised_case.advised_text`.
    """
    found = {item.name: item for item in study.parameters}
    values = moved_files(tree, folder)
    lines = [
        f"Calibrated by klack {study.version}, {study.created[:10]}, to "
        f"{len(study.strokes)} strokes of {study.source}.",
        f"Made from {tree.path.name}; only these values were changed:",
    ]
    for parameter in free_parameters(tree.case()):
        item = found[parameter.name]
        for place in parameter.places:
            values[place.key] = written_quantity(tree, place, item.value)
        error = format_si(item.standard_error, item.unit, 2)
        lines.append(
            f"  {item.name} = {format_si(item.value, item.unit, 5)}, standard error {error} "
            f"({', '.join(item.keys)})"
        )
    text = rewritten(tree, values, "\n".join(lines))
    read_valve_case(text, folder / CALIBRATED_NAME, tree.components.values())
    return text
