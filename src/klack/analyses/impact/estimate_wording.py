"""Accuracy of a reduced level: its estimated error, and the true one where known."""

from collections.abc import Sequence
from math import isfinite

from klack.analyses.impact.measures import DEVIATION_MEASURES
from klack.analyses.impact.record import ImpactStudy
from klack.contact.restitution import Deviation

__all__ = [
    "ESTIMATE_COLUMNS",
    "FAIR",
    "GOOD",
    "estimate_rows",
    "estimate_sentence",
    "worst_error",
]

_SHOWN = DEVIATION_MEASURES[:5]
ESTIMATE_COLUMNS = ("", *(measure.name for measure in _SHOWN))

GOOD, FAIR = 0.01, 0.05
"""The largest error up to which a level counts as good, and as fair."""


def estimate_rows(study: ImpactStudy) -> tuple[tuple[str, ...], ...]:
    """One row per reduced level; the true deviation from the full order in small letters."""
    rows = []
    for name, estimate in study.estimates.items():
        cells = _numbers(estimate)
        true = _true(study, name)
        if true is not None:
            pairs = zip(cells, _numbers(true), strict=True)
            cells = [f"{cell}\ntrue: {other}" for cell, other in pairs]
        label = study.levels[name].label if name in study.levels else name
        rows.append((label, *cells))
    return tuple(rows)


def estimate_sentence(study: ImpactStudy) -> str:
    """Sentence on whether the reduced level can be used here; empty without an estimate."""
    if not study.estimates:
        return ""
    name = "reduced" if "reduced" in study.estimates else next(iter(study.estimates))
    estimate, true = study.estimates[name], _true(study, name)
    text = (
        f"Compared with one run of the {study.estimate_basis}, at the same condition, the "
        f"'{name}' level is off by {_off(estimate)}: {_verdict(estimate, study.contact.doubts)}."
    )
    if true is not None:
        text += f" Compared with the full order, which was run too, it is off by {_off(true)}."
    return text


def _true(study: ImpactStudy, name: str) -> Deviation | None:
    return study.deviations.get(name) if study.reference == "full" else None


def _numbers(deviation: Deviation) -> list[str]:
    return [measure.on_page(deviation) for measure in _SHOWN]


def _off(deviation: Deviation) -> str:
    peak, time, impulse, restitution, _ = _numbers(deviation)
    return (
        f"{peak} in peak force, {time} in contact time, {impulse} in impulse and {restitution} in "
        "restitution"
    )


def worst_error(deviation: Deviation) -> float:
    """Largest of the errors in peak force, contact time, impulse and restitution [-]."""
    errors = (
        deviation.peak_force,
        deviation.contact_time,
        deviation.impulse,
        deviation.restitution,
    )
    return max((abs(value) for value in errors if isfinite(value)), default=0.0)


def _verdict(deviation: Deviation, doubts: Sequence[str]) -> str:
    """Judge the largest of the four errors, unless the contact itself is in doubt."""
    if doubts:
        return (
            "both share the same contact, which cannot be relied on, because "
            f"{' and '.join(doubts)}"
        )
    worst = worst_error(deviation)
    if worst <= GOOD:
        return "good enough to rely on"
    if worst <= FAIR:
        return "good enough for comparisons, not for the last per cent"
    return "too large an error; use the interface level for this condition"
