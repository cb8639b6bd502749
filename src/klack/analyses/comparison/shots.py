"""Computed shots beside measured drops: two distributions, and the highest rebound of each.

Both are read off the height over time, from smooth flights before and after the first impact. The
restitution of ``klack shots`` is another number: it holds at the end of the impact, before friction
in the guide takes its share of the rebound.

The highest of m shots is a random number with a bias of its own.  Drawn from n computed shots in
rising order of their rebound, the i-th is the highest of m with the probability

.. math:: w_i = (i/n)^m - ((i-1)/n)^m ,

which gives the mean that the highest of as many computed shots as were measured would have.
"""

from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from time import perf_counter

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.analyses.comparison.record import MeasuredDistribution, MeasuredShotsStudy
from klack.analyses.comparison.strokes import compare_numbers, sensor_words
from klack.analyses.measures import Measure
from klack.analyses.record import case_fields, run_fields
from klack.analyses.shots.record import FIRST_IMPACT, Shot, ShotColumns, ShotsStudy, ShotTraces
from klack.case.measurement import CaseMeasurement
from klack.errors import InputError
from klack.machine.progress import Progress, silent
from klack.machine.stages import StageClock, collected_warnings
from klack.measurement.channels import LIFT_ALONE
from klack.measurement.impacts import measure_stroke
from klack.measurement.loading import load_stroke_set
from klack.measurement.stroke_measures import MeasuredImpact, Rejection, StrokeSet

__all__ = ["LIKELY", "compare_shots", "mean_of_highest"]

Floats = NDArray[np.float64]

LIKELY = 0.05
"""Significance from which two distributions are called alike."""
_FEWEST = 3
_FALL = 0.25e-3  # [s] before first touch, added to a computed height


def compare_shots(
    study: ShotsStudy,
    paths: Sequence[Path],
    section: CaseMeasurement | None,
    *,
    case_text: str | None = None,
    progress: Progress = silent,
) -> MeasuredShotsStudy:
    """Compare the shots of a study with measured drops of the same valve.

    Parameters
    ----------
    section
        With ``zero: none`` the lift counts from first touch; else the needle must rest on its seat
        somewhere.
    case_text
        Case of ``section``, if not that of the study.

    Raises
    ------
    InputError
        Also for fewer than three readable drops.
    """
    begin = perf_counter()
    used = CaseMeasurement() if section is None else section
    clock = StageClock(progress)
    with collected_warnings() as notes:
        clock("read drops", 0.0)
        drops = load_stroke_set(paths, used, roles=LIFT_ALONE)
        clock("compare drops", 0.0)
        names, impacts, unread = _first_impacts(drops, used)
        computed = _computed_impacts(study, study.shots, study.shot_traces)
        centred = _computed_impacts(study, study.centric, study.centric_traces)
        time, lift = _since_touch(drops, names, impacts)
    return MeasuredShotsStudy(
        **case_fields(study, case_text),
        **run_fields(begin, clock),
        source=drops.source,
        names=names,
        rejected=(*drops.rejected, *unread),
        notes=drops.notes,
        sensor=sensor_words(used.sensor),
        approach_speed=compare_numbers(
            [float(np.mean(study.shots.approach_speed))],
            [hit.approach_speed for hit in impacts],
            [hit.approach_se for hit in impacts],
        ),
        distributions=tuple(
            _distribution(kind, computed, centred[0], impacts) for kind in FIRST_IMPACT[:2]
        ),
        time=time,
        lift=lift,
        computed_time=study.shot_traces.time,
        computed_height=study.shot_traces.height,
        likely=LIKELY,
        warnings=tuple(notes),
    )


def mean_of_highest(values: Floats, heights: Floats, count: int) -> float:
    """Mean value of the shot with the highest rebound, among any ``count`` of the given ones.

    Shots without a value or a height are left out.

    >>> x = np.array([1.0, 2.0])
    >>> mean_of_highest(x, x, 2)  # 11, 12, 21, 22
    1.75
    """
    known = np.isfinite(values) & np.isfinite(heights)
    order = np.argsort(heights[known], kind="stable")
    rank = np.arange(order.size + 1) / max(order.size, 1)
    return float(np.diff(rank**count) @ values[known][order]) if order.size else float("nan")


def _first_impacts(
    drops: StrokeSet, section: CaseMeasurement
) -> tuple[tuple[str, ...], tuple[MeasuredImpact, ...], tuple[Rejection, ...]]:
    """First impact of each drop; those without a rebound are discarded."""
    names, impacts, unread = [], [], []
    sensor = section.sensor
    if section.zero == "start":
        sensor = sensor.model_copy(update={"offset": 0.0})
    seat = 0.0 if section.zero == "none" else None
    for drop in drops.strokes:
        measures = measure_stroke(
            drops.time, drop.values["lift"], seat=seat, opening=float("nan"), sensor=sensor
        )
        hit = measures.first("seat")
        if hit is not None and isfinite(hit.restitution) and isfinite(hit.rebound_height):
            names.append(drop.name)
            impacts.append(hit)
        else:
            why = "; ".join(measures.notes) or "no impact with a complete rebound"
            unread.append(Rejection(name=drop.name, reason=why))
    if len(impacts) < _FEWEST:
        raise InputError(
            f"measurement {drops.source}",
            got=f"{len(impacts)} of {drops.count} drops with an impact and a complete rebound"
            + (f" ({unread[0].name}: {unread[0].reason})" if unread else ""),
            expected=f"at least {_FEWEST}",
            hint="with 'measurement: {zero: none}' the lift is measured from first touch; "
            "otherwise the needle must come to rest on its seat in the record; for a sensor of "
            "reversed sign set scale: -1 in measurement.channels.lift.",
        )
    return tuple(names), tuple(impacts), tuple(unread)


def _since_touch(
    drops: StrokeSet, names: Sequence[str], impacts: Sequence[MeasuredImpact]
) -> tuple[Floats, NDArray[np.float32]]:
    used = {drop.name: drop.values["lift"] for drop in drops.strokes}
    first = max(drops.time[0] - hit.time for hit in impacts)
    last = min(drops.time[-1] - hit.time for hit in impacts)
    grid = np.arange(first, last, drops.step)
    rows = [
        np.interp(grid, drops.time - hit.time, used[name])
        for name, hit in zip(names, impacts, strict=True)
    ]
    return grid, np.array(rows, dtype=np.float32)


def _computed_impacts(
    study: ShotsStudy, shots: ShotColumns, traces: ShotTraces
) -> tuple[MeasuredImpact | None, ...]:
    """First impact of each computed shot, read off its height like a drop."""
    return tuple(
        _computed_impact(
            traces.time,
            traces.height[i].astype(float),
            float(shots.approach_speed[i]),
            float(shots.force[i]) / study.mass,
        )
        for i in range(shots.count)
    )


def _computed_impact(
    time: Floats, height: Floats, speed: float, deceleration: float
) -> MeasuredImpact | None:
    """First impact of a height from first touch on; the fall before it is added."""
    step = float(time[1] - time[0])
    known = int(np.argmax(np.isnan(height))) if np.isnan(height).any() else height.size
    length = min(_FALL, 0.8 * speed / deceleration if deceleration > 0.0 else _FALL)
    before = -step * np.arange(round(length / step), 0, -1)
    fall = -speed * before - 0.5 * deceleration * before**2
    measures = measure_stroke(
        np.concatenate([before, time[:known]]),
        np.concatenate([fall, height[:known]]),
        seat=0.0,
        opening=float("nan"),
    )
    return measures.first("seat")


def _distribution(
    kind: Measure[Shot],
    computed: Sequence[MeasuredImpact | None],
    centred: MeasuredImpact | None,
    impacts: Sequence[MeasuredImpact],
) -> MeasuredDistribution:
    values, heights = _numbers(computed, kind.key), _numbers(computed, "rebound_height")
    measured, risen = _numbers(impacts, kind.key), _numbers(impacts, "rebound_height")
    test = scipy.stats.ks_2samp(values[np.isfinite(values)], measured)
    return MeasuredDistribution(
        name=kind.name,
        unit="" if kind.unit == "1" else kind.unit,
        computed=values,
        measured=measured,
        error=float(np.median(_numbers(impacts, f"{kind.key}_se"))),
        computed_highest=float(values[np.nanargmax(heights)]),
        measured_highest=float(measured[np.nanargmax(risen)]),
        centred=float(_numbers([centred], kind.key)[0]),
        expected_highest=mean_of_highest(values, heights, len(impacts)),
        statistic=float(test.statistic),
        significance=float(test.pvalue),
    )


def _numbers(impacts: Sequence[MeasuredImpact | None], field: str) -> Floats:
    return np.array([float("nan") if hit is None else getattr(hit, field) for hit in impacts])
