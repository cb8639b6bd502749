"""Accuracy of a reduced level: its estimated error, and the true one where known."""

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
    """One row per level, and how far it may be off; the true deviation from the full order."""
    rows = []
    for name, estimate in study.estimates.items():
        cells = _numbers(estimate)
        if within := study.estimate_margins.get(name):
            margins = (text.removeprefix("+") for text in _numbers(within))
            cells = [f"{cell} ± {margin}" for cell, margin in zip(cells, margins, strict=True)]
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
    steps = ""
    if "full" in study.estimates:
        steps = f"The steps of the full order put it off by {_off(study.estimates['full'])}."
    reduced = [name for name in study.estimates if name != "full"]
    if not reduced:
        return f"{steps} So says the {study.estimate_basis}."
    name = "reduced" if "reduced" in reduced else reduced[0]
    estimate, true = study.estimates[name], _true(study, name)
    text = (
        f"Compared with one run of the {study.estimate_basis}, at the same condition, the "
        f"'{name}' level is off by {_off(estimate)}: {_verdict(study, name)}."
    )
    if true is not None:
        text += f" Compared with the full order, which was run too, it is off by {_off(true)}."
    return f"{text} {steps}".rstrip()


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


def worst_error(study: ImpactStudy, level: str) -> float:
    """Largest error in peak force, contact time, impulse and restitution, at worst [-]."""
    known = (study.estimates[level], study.estimate_margins.get(level))
    parts = [
        [abs(getattr(one, key)) for one in known if one is not None]
        for key in ("peak_force", "contact_time", "impulse", "restitution")
    ]
    return max(sum(size for size in sizes if isfinite(size)) for sizes in parts)


def _verdict(study: ImpactStudy, level: str) -> str:
    """Judge the largest of the four errors, unless the contact itself is in doubt."""
    if doubts := study.contact.doubts:
        return (
            "both share the same contact, which cannot be relied on, because "
            f"{' and '.join(doubts)}"
        )
    worst = worst_error(study, level)
    if worst <= GOOD:
        return "good enough to rely on"
    if worst <= FAIR:
        return "good enough for comparisons, not for the last per cent"
    return "too large an error; use the interface level for this condition"
