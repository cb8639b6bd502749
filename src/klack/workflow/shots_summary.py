"""The few numbers of a study of shots that a script or a terminal wants."""

from math import isfinite
from typing import cast

import numpy as np

from klack.units import format_si
from klack.workflow.json_results import ShotJson, ShotsJson
from klack.workflow.shots_study import MEASURES, ShotColumns, ShotsStudy

__all__ = ["DISTRIBUTION_COLUMNS", "QUANTILES", "distribution_rows", "shots_to_json"]

DISTRIBUTION_COLUMNS = (
    "measure",
    "centred",
    "highest rebound",
    "mean",
    "standard deviation",
    "lowest",
    "median",
    "highest",
)

QUANTILES = (0.0, 0.05, 0.25, 0.5, 0.75, 0.95, 1.0)
"""Shares of the shots that stay below."""

_KEYS = {
    "restitution": "restitution",
    "rebound_height": "rebound_height_m",
    "peak_force": "peak_force_N",
    "contact_time": "contact_time_s",
    "impulse": "impulse_Ns",
    "eccentricity": "eccentricity_m",
    "direction": "direction_rad",
    "tilt": "tilt_rad",
    "tilt_direction": "tilt_direction_rad",
    "force": "force_N",
    "friction": "friction",
    "waviness": "waviness_m",
    "approach_speed": "approach_speed_m_s",
    "sub_contacts": "sub_contacts",
    "rocking": "rocking",
    "second_impact": "second_impact_s",
    "impacts": "impacts",
    "energy_residual": "energy_residual",
}
_WHOLE = ("sub_contacts", "impacts")


def shots_to_json(study: ShotsStudy) -> ShotsJson:
    """Plain numbers in SI, the unit in the key.

    Returns
    -------
    dict
        ``case``, ``seed``; ``centric`` and ``shots``: the numbers of the centred shot and of every
        other; ``highest``: index of the highest rebound; ``distribution``: per measure its mean,
        standard deviation and quantiles; ``rule``: highest rebound minus centred shot.  Numbers
        that do not exist (nan) are None.
    """
    rule = study.rule
    return {
        "schema": "klack-shots/1",
        "case": study.case,
        "klack": study.version,
        "seed": study.seed,
        "centric": _row(study.centric, 0),
        "shots": [_row(study.shots, i) for i in range(study.shots.count)],
        "highest": study.highest,
        "distribution": {
            _KEYS[measure.column]: _distribution(getattr(study.shots, measure.column))
            for measure in MEASURES
        },
        "rule": {
            "holds": rule.holds,
            "restitution_bias": _number(rule.restitution_bias),
            "rebound_height_bias": _number(rule.rebound_height_bias),
            "relative_restitution_bias": _number(rule.relative_restitution_bias),
            "relative_rebound_height_bias": _number(rule.relative_rebound_height_bias),
            "shots_at_least_as_high_as_centric": rule.rank,
            "sentence": rule.sentence,
        },
        "wall_time_s": _number(study.wall_time),
        "shot_time_s": _number(study.shot_time),
        "workers": study.workers,
        "resumed": study.resumed,
    }


def distribution_rows(study: ShotsStudy) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`DISTRIBUTION_COLUMNS`, one per measure, as text."""
    rows = []
    for measure in MEASURES:
        values = getattr(study.shots, measure.column)
        known = values[np.isfinite(values)]
        numbers = (
            float(getattr(study.centric, measure.column)[0]),
            float(values[study.highest]),
            float(np.mean(known)),
            float(np.std(known)),
            *(float(np.quantile(known, share)) for share in (0.0, 0.5, 1.0)),
        )
        rows.append((measure.name, *(_text(number, measure.unit) for number in numbers)))
    return tuple(rows)


def _row(columns: ShotColumns, index: int) -> ShotJson:
    row = columns.row(index)
    numbers = {
        key: int(row[name]) if name in _WHOLE else _number(row[name]) for name, key in _KEYS.items()
    }
    return cast(ShotJson, numbers)


def _distribution(values: np.ndarray) -> dict[str, float | None]:
    known = values[np.isfinite(values)]
    if not len(known):
        return dict.fromkeys(("mean", "standard_deviation"))
    quantiles = {f"quantile_{share:g}": float(np.quantile(known, share)) for share in QUANTILES}
    return {
        "mean": float(np.mean(known)),
        "standard_deviation": float(np.std(known)),
        **quantiles,
    }


def _number(value: float) -> float | None:
    """JSON knows no nan and no infinity."""
    return float(value) if isfinite(value) else None


def _text(value: float, unit: str) -> str:
    if not isfinite(value):
        return "–"
    return format_si(value, unit) if unit else f"{value:.4f}"
