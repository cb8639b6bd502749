"""Impacts of one stroke from its lift alone.

1. Levels of rest on the stops, given or found, and turns of the smoothed lift at these levels
   (:mod:`klack.measurement.stop_levels`).
2. The raw lift of each flight, without the time in which the sensor still shows the impact before,
   is fitted by a polynomial of the least degree (2, 3 or 4) that the next coefficient does not
   improve significantly; of a flight that comes from elsewhere, by the longest stretch before the
   touch that agrees with all shorter ones (Lepski 1991).
3. A short flight defines its acceleration, and with it its speeds, badly.  Flights of one stop are
   driven by nearly the same force, so each is given the mean acceleration of the others, with a
   variance that holds their scatter beyond their own errors (random effects, DerSimonian & Laird
   1986, eq. 7); where they do differ, nothing changes.
4. First touch, release and speeds are where the fits meet the level of the stop.

A line instead of the parabola would be wrong by half the acceleration times its length: 0.1 m/s
for 50 us at 4000 m/s^2.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from klack.errors import refuse_if
from klack.measurement.channels import LiftSensor
from klack.measurement.flight import Crossing, Flight, correlation_factor, fit_flight
from klack.measurement.flight_train import FlightTrain, join_flights
from klack.measurement.lift_sensor import sensor_poles, sensor_polynomial
from klack.measurement.stop_levels import SmoothLift, Touch, find_levels, find_touches, smooth_lift
from klack.measurement.stroke_measures import FlightShape, MeasuredImpact, Stop, StrokeMeasures
from klack.measurement.time_base import uniform_step

__all__ = ["FittedStroke", "fit_flights", "measure_stroke", "read_flights"]

_SETTLED = 4.0  # time constants of the sensor after which it shows nothing of an impact
_FEWEST = 9  # samples of a flight that is fitted
_SIGNIFICANT = 3.0  # standard errors of a rebound height that is seen
_AGREES = 3.0  # standard errors within which nested stretches agree
_UNDER_WAY = 0.15  # of the fastest speed before a touch: the flight to it has begun
_OWN_NOISE = 60e-6  # [s] before a touch, from which the noise of an approach is taken
_SHARE = 0.5  # of the guard, by which the samples of a flight may grow in one round
_ROUNDS = 8  # of finding touch and release, each of which bounds the samples of the other
_SHORTEST = 30e-6  # [s] stretch before a first touch
_GROWTH = 1.25
_FLOOR = 1e-6  # of the lift: no fit is better than this
_NAN = float("nan")


@dataclass(frozen=True, kw_only=True, eq=False)
class _Record:
    time: NDArray[np.float64]
    lift: NDArray[np.float64]
    smooth: SmoothLift
    levels: Mapping[Stop, float]
    level_se: Mapping[Stop, float]
    sensor: NDArray[np.float64]
    settle: float
    floor: float
    correlation: float = 1.0
    noise: float | None = None


@dataclass(frozen=True, kw_only=True)
class _Ends:
    """A fitted flight, its release from one stop, its touch of the next."""

    flight: Flight
    release: Crossing | None
    touch: Crossing | None


@dataclass(frozen=True, kw_only=True, eq=False)
class FittedStroke:
    """Impacts found, each flight fitted alone; see :func:`fit_flights`."""

    record: _Record
    touches: tuple[Touch, ...]
    fits: list[_Ends | None]
    notes: tuple[str, ...]

    @property
    def levels(self) -> Mapping[Stop, float]:
        """Lift at the stops that are known [m]."""
        return self.record.levels


def measure_stroke(
    time: NDArray[np.float64],
    lift: NDArray[np.float64],
    *,
    seat: float | None = None,
    opening: float | None = None,
    sensor: LiftSensor | None = None,
) -> StrokeMeasures:
    """Read impacts, speeds, restitution, rebound heights and periods off one lift.

    Measured and computed lift are read in the same way, single drops too. Without a touch there
    are no impacts.

    Parameters
    ----------
    time (n,) [s]
        Uniform.
    lift (n,) [m]
        Rising while the valve opens; as the sensor, if any, shows it.
    seat, opening [m]
        True lift at which the needle touches the stops; default: where it rests; ``nan`` for a
        stop that does not exist.
    sensor
        Its sensitivity and offset are taken out, its low pass is undone in the fits.
    """
    return read_flights(fit_flights(time, lift, seat=seat, opening=opening, sensor=sensor))


def fit_flights(
    time: NDArray[np.float64],
    lift: NDArray[np.float64],
    *,
    seat: float | None = None,
    opening: float | None = None,
    sensor: LiftSensor | None = None,
) -> FittedStroke:
    """First half of :func:`measure_stroke`: find the impacts, fit each flight alone."""
    record, notes = _prepare(time, lift, seat, opening, sensor)
    touches = find_touches(record.smooth, record.levels)
    fits = _fit_all(record, touches)
    while (ghost := _ghost(record, touches, fits)) is not None:
        touches = touches[:ghost] + touches[ghost + 1 :]
        fits = _fit_all(record, touches)
    factor = correlation_factor(tuple(f.flight.residuals for f in fits if f is not None))
    record = replace(record, correlation=factor, noise=_noise(fits))
    return FittedStroke(record=record, touches=touches, fits=_fit_all(record, touches), notes=notes)


def read_flights(
    fitted: FittedStroke, shapes: Mapping[Stop, FlightShape] | None = None
) -> StrokeMeasures:
    """Second half of :func:`measure_stroke`: flights on each stop together.

    ``shapes`` by stop, from other strokes of the same valve
    (:func:`klack.measurement.set_measures.measure_strokes`).
    """
    record, touches = fitted.record, fitted.touches
    trains = _joined(record, touches, fitted.fits, shapes or {})
    noise = _noise(fitted.fits)
    return StrokeMeasures(
        impacts=_impacts(record, touches, trains),
        seat_level=record.levels.get("seat", _NAN),
        opening_level=record.levels.get("opening", _NAN),
        level_se=max(record.level_se.values(), default=_NAN),
        noise=record.smooth.noise if noise is None else noise,
        least_height=record.smooth.least_height,
        notes=fitted.notes,
        shapes={
            touches[run.start].stop: train.shape for run, train in trains if train.shape is not None
        },
    )


def _prepare(
    time: NDArray[np.float64],
    lift: NDArray[np.float64],
    seat: float | None,
    opening: float | None,
    sensor: LiftSensor | None,
) -> tuple[_Record, tuple[str, ...]]:
    step = uniform_step(time, "measure_stroke: time")
    shown = np.asarray(lift, dtype=np.float64)
    refuse_if(
        shown.shape != time.shape or not np.all(np.isfinite(shown)) or np.ptp(shown) == 0.0,
        "measure_stroke: lift",
        got=f"{shown.shape} values, {int(np.sum(~np.isfinite(shown)))} of them missing"
        if shown.size and np.ptp(shown) != 0.0
        else "a lift that never changes",
        expected=f"{time.size} finite values that move",
        hint="check the channel, and cut the record to one stroke.",
    )
    used = LiftSensor() if sensor is None else sensor
    true = (shown - used.offset) / used.sensitivity
    smooth = smooth_lift(time, true)
    found = find_levels(time, true, smooth)
    levels: dict[Stop, float] = {}
    errors: dict[Stop, float] = {}
    notes: list[str] = []
    for stop, given, rest, error in (
        ("seat", seat, found.seat, found.seat_se),
        ("opening", opening, found.opening, found.opening_se),
    ):
        name: Stop = "seat" if stop == "seat" else "opening"
        if given is not None:
            if np.isfinite(given):
                levels[name], errors[name] = float(given), 0.0
        elif np.isfinite(rest):
            levels[name], errors[name] = rest, error
        else:
            notes.append(f"the needle never rests near the {name} stop; its level is unknown")
    poles = sensor_poles(used)
    slowest = 1.0 / float(np.min(-poles.real)) if poles.size else 0.0
    record = _Record(
        time=time,
        lift=true,
        smooth=smooth,
        levels=levels,
        level_se=errors,
        sensor=sensor_polynomial(used),
        settle=max(_SETTLED * slowest, step),
        floor=max(
            _FLOOR * float(np.ptp(true)), used.resolution / used.sensitivity / float(np.sqrt(12.0))
        ),
    )
    return record, tuple(notes)


def _fit_all(record: _Record, touches: tuple[Touch, ...]) -> list[_Ends | None]:
    """Fits of the flights that end at each touch."""
    out: list[_Ends | None] = []
    for k, after in enumerate(touches):
        before = touches[k - 1] if k else None
        if before is not None and before.stop == after.stop and before.rebounds:
            out.append(_bounce(record, before, after))
        else:
            out.append(_approach(record, before, after))
    return out


def _bounce(record: _Record, before: Touch, after: Touch) -> _Ends | None:
    """Flight from a stop back to it.

    Its samples reach to the release and touch of the former fit, a part of the guard at a time: a
    fit to few samples knows neither well, and might take in the contact itself.
    """
    t = record.time
    release, touch = float(t[before.index]), float(t[after.index])
    guard = min(record.smooth.half * (t[1] - t[0]) + record.settle, 0.2 * (touch - release))
    ends = _whole(record, before.stop, release + guard, touch - guard)
    for _ in range(_ROUNDS):
        if ends is None or ends.release is None or ends.touch is None:
            return ends
        first = max(ends.release.time + record.settle, ends.flight.first - _SHARE * guard)
        last = min(ends.touch.time, ends.flight.last + _SHARE * guard)
        middle = 0.5 * (release + touch)
        if not (release - guard < first < middle < last < touch + guard):
            return ends
        window = _window(record, first, last)
        if window is None or _same(window[0], ends.flight):
            return ends
        better = _whole(record, before.stop, first, last)
        if better is None or better.release is None or better.touch is None:
            return ends
        ends = better
    return ends


def _same(time: NDArray[np.float64], flight: Flight) -> bool:
    return bool(time[0] == flight.first and time[-1] == flight.last)


def _whole(record: _Record, stop: Stop, first: float, last: float) -> _Ends | None:
    window = _window(record, first, last)
    if window is None:
        return None
    plain = _fit(record, *window, 2)
    if plain.acceleration == 0.0:
        return _with_ends(record, stop, plain)
    top = plain.reference - float(plain.coefficients[1]) / plain.acceleration
    times, lag = window[0], sum(record.sensor[1:2])
    if not times[2] < top < times[-3] - lag:  # all samples shown on one side tell no friction
        return _with_ends(record, stop, plain)
    return _with_ends(record, stop, _fit(record, *window, 2, top))


def _with_ends(record: _Record, stop: Stop, flight: Flight) -> _Ends:
    level, error = record.levels[stop], record.level_se[stop]
    return _Ends(
        flight=flight,
        release=flight.crossing(level, error, flight.first),
        touch=flight.crossing(level, error, flight.last),
    )


def _fit(
    record: _Record,
    time: NDArray[np.float64],
    lift: NDArray[np.float64],
    degree: int,
    turning_point: float | None = None,
) -> Flight:
    return fit_flight(
        time,
        lift,
        degree,
        sensor=record.sensor,
        turning_point=turning_point,
        correlation=record.correlation,
        floor=record.floor,
        noise=record.noise,
    )


def _window(
    record: _Record, first: float, last: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    a, b = np.searchsorted(record.time, [first, last])
    if b - a < _FEWEST:
        return None
    return record.time[a:b], record.lift[a:b]


def _approach(record: _Record, before: Touch | None, after: Touch) -> _Ends | None:
    """First approach: from the other stop, or from the start of the record."""
    t = record.time
    touch = float(t[after.index])
    guard = record.smooth.half * float(t[1] - t[0])
    start = float(t[0]) if before is None else float(t[before.index]) + guard + record.settle
    start = max(start, _under_way(record, after))
    ends = _longest_stretch(record, after.stop, start, touch - guard)
    for _ in range(_ROUNDS):
        if ends is None or ends.touch is None or abs(ends.touch.time - touch) > 2.0 * guard:
            return ends
        window = _window(record, ends.flight.first, ends.touch.time)
        if window is None or _same(window[0], ends.flight):
            return ends
        better = _longest_stretch(record, after.stop, start, ends.touch.time)
        if better is None:
            return ends
        ends = better
    return ends


def _under_way(record: _Record, touch: Touch) -> float:
    """Time from which the needle approaches with 15 % of its fastest speed."""
    towards = -record.smooth.velocity[: touch.index] * (1.0 if touch.stop == "seat" else -1.0)
    last = towards[max(0, touch.index - 4 * record.smooth.half) :]
    slow = np.flatnonzero(towards < _UNDER_WAY * float(np.max(last, initial=0.0)))
    # the turn itself is slow again
    slow = slow[slow < touch.index - 2 * record.smooth.half]
    return float(record.time[slow[-1]]) if slow.size else float(record.time[0])


def _longest_stretch(record: _Record, stop: Stop, start: float, end: float) -> _Ends | None:
    """Most precise stretch to a time that agrees with all shorter ones."""
    step = float(record.time[1] - record.time[0])
    noise = _own_noise(record, max(start, end - max(_OWN_NOISE, 24.0 * step)), end)
    best: tuple[float, _Ends] | None = None
    for degree in (2, 3):
        tried: list[tuple[float, float]] = []
        length = max(_SHORTEST * (degree - 1), (_FEWEST + 6 * (degree - 2)) * step)
        while (length := min(length, end - start)) > 0.0:
            window = _window(record, end - length, end)
            ends = None
            if window is not None:
                flight = _known_noise(_fit(record, *window, degree), noise)
                ends = _with_ends(record, stop, flight)
            if ends is not None and ends.touch is not None:
                v, error = ends.touch.velocity, ends.touch.velocity_se
                if not all(_agree(v, error, *other) for other in tried):
                    break
                tried.append((v, error))
                if best is None or error < best[0]:
                    best = error, ends
            if length >= end - start:
                break
            length *= _GROWTH
    return None if best is None else best[1]


def _agree(value: float, error: float, shorter: float, its_error: float) -> bool:
    """Whether nested estimates differ by no more than noise of the shorter one."""
    own = np.sqrt(max(its_error**2 - error**2, 0.0))
    return bool(abs(value - shorter) <= _AGREES * float(own) + 0.1 * error)


def _own_noise(record: _Record, first: float, last: float) -> float:
    """Standard deviation before a touch, about a cubic, of long means."""
    window = _window(record, first, last)
    if window is None:
        return record.smooth.noise
    residuals = _fit(replace(record, noise=None), *window, 3).residuals
    free = max(residuals.size - 4, 1)
    spread = float(np.sqrt(residuals @ residuals / free))
    return max(spread, record.floor) * float(np.sqrt(record.correlation))


def _known_noise(flight: Flight, noise: float) -> Flight:
    """The same fit with the covariance of a known noise."""
    free = flight.residuals.size - flight.coefficients.size
    used = flight.scale
    return replace(flight, covariance=flight.covariance * (noise / used) ** 2) if free else flight


def _ghost(record: _Record, touches: tuple[Touch, ...], fits: list[_Ends | None]) -> int | None:
    """Last touch before which the needle was not seen to fly; None if none.

    Vibration and noise turn the lift as well, but without a parabola that rises and comes back.
    """
    for k in range(len(touches) - 1, 0, -1):
        fit = fits[k]
        if touches[k].stop != touches[k - 1].stop or fit is None:
            continue
        away = 1.0 if touches[k].stop == "seat" else -1.0
        window = _window(record, fit.flight.first, fit.flight.last + 1e-3 * record.settle)
        if window is None:
            continue
        plain = _fit(record, *window, 2)
        middle, gradient = plain.derivative(plain.reference, 0)
        error = float(np.sqrt(gradient @ plain.covariance @ gradient))
        height = away * (middle - record.levels[touches[k].stop])
        falls = away * plain.acceleration < 0.0
        if not falls or height < max(_SIGNIFICANT * error, 0.5 * record.smooth.least_height):
            return k
    return None


def _noise(fits: list[_Ends | None]) -> float | None:
    residuals = [fit.flight.residuals for fit in fits if fit is not None]
    if not residuals:
        return None
    free = sum(max(r.size - 5, 1) for r in residuals)
    return float(np.sqrt(sum(float(r @ r) for r in residuals) / free))


def _joined(
    record: _Record,
    touches: tuple[Touch, ...],
    fits: list[_Ends | None],
    shapes: Mapping[Stop, FlightShape],
) -> list[tuple[range, FlightTrain]]:
    """Runs of impacts on one stop, their flights estimated together."""
    out = []
    first = 0
    for k in range(1, len(touches) + 1):
        if k < len(touches) and touches[k].stop == touches[first].stop:
            continue
        stop = touches[first].stop
        flights = tuple(None if fit is None else fit.flight for fit in fits[first:k])
        away = 1.0 if stop == "seat" else -1.0
        level, error = record.levels[stop], record.level_se[stop]
        train = join_flights(flights, level, error, away, shapes.get(stop))
        out.append((range(first, k), train))
        first = k
    return out


def _impacts(
    record: _Record, touches: tuple[Touch, ...], trains: list[tuple[range, FlightTrain]]
) -> tuple[MeasuredImpact, ...]:
    out = [_impact(record, touches[k], train, k - run.start) for run, train in trains for k in run]
    return tuple(_with_periods(out))


def _impact(record: _Record, touch: Touch, train: FlightTrain, k: int) -> MeasuredImpact:
    away = 1.0 if touch.stop == "seat" else -1.0
    step = float(record.time[1] - record.time[0])
    arrival, release = train.touches[k], train.releases[k]
    v, v_se = (-away * arrival.velocity, arrival.velocity_se) if arrival else (_NAN, _NAN)
    w, w_se = (away * release.velocity, release.velocity_se) if release else (_NAN, _NAN)
    height, height_se = _NAN, _NAN
    last = k + 1 == len(train.flights)
    leaving = None if last else train.flights[k + 1]
    if leaving is not None and leaving.turns:
        top, top_se = leaving.top()
        height, height_se = away * (top - train.level), float(np.hypot(top_se, train.level_se))
    e, e_se = w / v, train.restitution_se[k]
    ends = touch.index + 4 * record.smooth.half >= record.time.size  # before it could rebound
    if last and not ends:
        fall = abs(arrival.acceleration) if arrival else _NAN
        w, w_se = 0.0, float(np.sqrt(2.0 * fall * record.smooth.least_height))
        height, height_se = 0.0, record.smooth.least_height
        e, e_se = 0.0 * v, w_se / v
    return MeasuredImpact(
        stop=touch.stop,
        time=arrival.time if arrival else float(record.time[touch.index]),
        time_se=arrival.time_se if arrival else record.smooth.half * step,
        release=release.time if release else _NAN,
        release_se=release.time_se if release else _NAN,
        approach_speed=v,
        approach_se=v_se,
        rebound_speed=w,
        rebound_se=w_se,
        restitution=e,
        restitution_se=e_se,
        rebound_height=height,
        rebound_height_se=height_se,
        period=_NAN,
        period_se=_NAN,
        acceleration=-away * release.acceleration if release else _NAN,
    )


def _with_periods(impacts: list[MeasuredImpact]) -> list[MeasuredImpact]:
    out = []
    for k, impact in enumerate(impacts):
        following = impacts[k + 1] if k + 1 < len(impacts) else None
        if following is not None and following.stop == impact.stop:
            impact = replace(
                impact,
                period=following.time - impact.time,
                period_se=float(np.hypot(following.time_se, impact.time_se)),
            )
        out.append(impact)
    return out
