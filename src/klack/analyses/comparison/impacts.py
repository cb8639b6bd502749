"""An output of an impact beside recordings of the same sensor."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from klack.analyses.comparison.calculix import level_of
from klack.analyses.comparison.impacts_record import ComparedPulse, MeasuredImpactStudy
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.record import case_fields, run_fields
from klack.bodies.gauges.gauge import GaugeKind, GaugeRecord
from klack.errors import AccuracyWarning, InputError, refuse_if
from klack.machine.progress import Progress, silent
from klack.machine.stages import StageClock, collected_warnings
from klack.measurement.files.opening import open_recording
from klack.measurement.pulse import Pulse, fit_pulse, measure_pulse
from klack.measurement.recording import ChannelInfo, Recording, some_names
from klack.measurement.unit_text import no_unit, plain_unit, unit_factor
from klack.signals.low_pass import LowPass
from klack.units import LENGTH, PRESSURE, SPEED

__all__ = ["compare_impact", "gauge_of"]

Floats = NDArray[np.float64]

_KINDS = {"displacement": LENGTH, "velocity": SPEED, "stress": PRESSURE}
_STRAINS = {
    **dict.fromkeys(("um/m", "microstrain", "ustrain", "ue", "με", "uε", "ppm"), 1e-6),
    **dict.fromkeys(("mm/m", "millistrain"), 1e-3),
    **dict.fromkeys(("m/m", "strain", "1"), 1.0),
    "%": 1e-2,
}
_MARGIN = 0.3  # of the length, shown before the front and behind the end
_POINTS = 2000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Record:
    name: str
    channel: str
    time: Floats
    values: Floats
    pulse: Pulse
    absolute: bool


def compare_impact(
    study: ImpactStudy,
    paths: Sequence[Path],
    *,
    level: str,
    output: str | None = None,
    channel: str | None = None,
    low_pass: LowPass | None = None,
    known_speed: bool = False,
    progress: Progress = silent,
) -> MeasuredImpactStudy:
    """Compare an output of an impact with measured pulses.

    Parameters
    ----------
    paths
        Recordings of repeated shots.
    output, channel
        Needed where the case, or a recording, has several.
    low_pass
        Instead of that of the output.
    known_speed
        The recordings are absolute at a known speed: no factor is fitted.

    Raises
    ------
    InputError
        Also for a record without a pulse with front, plateau and end.
    """
    begin = perf_counter()
    clock = StageClock(progress)
    gauge = gauge_of(study, level, output)
    sensor = gauge.low_pass if low_pass is None else low_pass
    shown = gauge.exact if sensor is None else sensor(gauge.exact, gauge.step)
    where = f"result of case '{study.case}': output '{gauge.name}'"
    computed = measure_pulse(gauge.time, shown, where)
    with collected_warnings() as notes:
        clock("read recordings", 0.0)
        records = [_read(path, gauge.kind, channel, known_speed) for path in paths]
        clock("compare pulses", 0.0)
        pulses = [_compared(record, gauge.time, shown, computed, known_speed) for record in records]
    time = _axis(computed)
    rows = np.array(
        [_on_axis(record, pulse, time) for record, pulse in zip(records, pulses, strict=True)]
    )
    aside = "" if sensor is None else f", {sensor.words}"
    return MeasuredImpactStudy(
        **case_fields(study),
        **run_fields(begin, clock),
        level=level,
        output=gauge.name,
        label=f"{gauge.kind} of {gauge.body} {gauge.place}{aside}",
        unit=gauge.unit,
        speed=study.speed,
        pulses=tuple(pulses),
        time=time - computed.front,
        measured=rows.astype(np.float32),
        middle=np.median(rows, axis=0),
        low=np.quantile(rows, 0.05, axis=0),
        high=np.quantile(rows, 0.95, axis=0),
        computed=computed.sign * (np.interp(time, gauge.time, shown) - computed.rest),
        notes=tuple(dict.fromkeys(notes)),
    )


def gauge_of(study: ImpactStudy, level: str, output: str | None) -> GaugeRecord:
    """Output of a level by name; the only one by default."""
    gauges = {record.name: record for record in level_of(study, level).gauges}
    refuse_if(
        not gauges,
        f"result of case '{study.case}', level '{level}'",
        got="no outputs",
        expected="an output at the position of the measuring sensor",
        hint="add the section 'outputs' to the case, and run klack impact again.",
    )
    if output is None and len(gauges) == 1:
        return next(iter(gauges.values()))
    if output not in gauges:
        raise InputError(
            "--output",
            got="several outputs, but no name" if output is None else f"'{output}'",
            expected=f"one of: {', '.join(gauges)}",
            hint=f"--output {next(iter(gauges))}.",
        )
    return gauges[output]


def _compared(
    record: _Record, time: Floats, shown: Floats, computed: Pulse, known_speed: bool
) -> ComparedPulse:
    fit = fit_pulse(
        record.time,
        record.values,
        record.pulse,
        time,
        shown,
        computed,
        factor=1.0 if known_speed else None,
    )
    return ComparedPulse(
        name=record.name,
        channel=record.channel,
        measured=record.pulse,
        computed=computed,
        factor=fit.factor,
        fitted=not known_speed,
        shift=fit.shift,
        rms=fit.rms,
        absolute=record.absolute,
    )


def _axis(computed: Pulse) -> Floats:
    margin = _MARGIN * computed.length
    return np.linspace(computed.front - margin, computed.end + margin, _POINTS)


def _on_axis(record: _Record, pulse: ComparedPulse, time: Floats) -> Floats:
    values = np.interp(time - pulse.shift, record.time, record.values)
    return np.asarray(record.pulse.sign * (values - record.pulse.rest) / pulse.factor)


# ------------------------------------------------------------------------ reading


def _read(path: Path, kind: GaugeKind, channel: str | None, absolute: bool) -> _Record:
    with open_recording(path) as recording:
        info = _channel(recording, channel)
        refuse_if(
            absolute and info.unapplied,
            f"{path.name}: {info.name}",
            got=f"a scale that klack does not know: {info.unapplied}",
            expected="values in the unit of the channel",
            hint="without --known-speed a factor is fitted.",
        )
        factor = _factor(path, info, kind)
        recording.time_base(info.name)  # refuses times that do not rise, with their row
        time, values = recording.read(info.name)
        known = np.isfinite(values)
        if not np.all(known):
            first = recording.place(info.name, int(np.argmin(known)))
            warnings.warn(
                f"{path.name}: {np.count_nonzero(~known)} missing values of '{info.name}' left "
                f"out, the first at {first}.",
                AccuracyWarning,
                stacklevel=2,
            )
    time, values = time[known], factor * values[known]
    where = f"{path.name}: {info.name}"
    pulse = measure_pulse(time, values, where)
    label = info.label or info.name
    return _Record(
        name=path.name,
        channel=label,
        time=time,
        values=values,
        pulse=pulse,
        absolute=not (no_unit(info.unit) or info.unapplied),
    )


def _channel(recording: Recording, name: str | None) -> ChannelInfo:
    if name is not None:
        return recording.channel(name)
    if len(recording.channels) == 1:
        return recording.channels[0]
    raise InputError(
        f"{recording.path.name}: channels",
        got=f"{len(recording.channels)} channels and no name",
        expected=f"one of: {some_names(recording.channels)}",
        hint=f"--channel {recording.channels[0].name}.",
    )


def _factor(path: Path, info: ChannelInfo, kind: GaugeKind) -> float:
    """From the unit of the file to SI; no unit counts as SI."""
    if no_unit(info.unit):
        return 1.0
    where = f"{path.name}: {info.name}"
    if kind != "strain":
        return unit_factor(info.unit, _KINDS[kind], where).factor
    unit = plain_unit(info.unit)
    refuse_if(
        unit not in _STRAINS,
        where,
        got=f"the unit '{info.unit}'",
        expected=f"a unit of a strain: {', '.join(_STRAINS)}",
        hint="check that it is the right channel; the voltage of a bridge needs its factor.",
    )
    return _STRAINS[unit]
