"""The few numbers of shots beside measured drops that a script or a terminal wants."""

from collections.abc import Iterator
from math import isfinite
from typing import Annotated, Any, Literal, cast

import numpy as np
from pydantic import Field
from typing_extensions import TypedDict

from klack.analyses.analysis import Measured
from klack.analyses.comparison.measures import DISTRIBUTION_MEASURES, DROPS_MEASURES
from klack.analyses.comparison.shots_record import MeasuredDistribution, MeasuredShotsStudy
from klack.analyses.json_parts import Real, RejectedJson, Version
from klack.analyses.measures import json_of, number_or_none, with_measures
from klack.analyses.sample import moments
from klack.terminal.tables import Notes, TextTable
from klack.units import format_si

__all__ = [
    "DROP_COLUMNS",
    "DropsJson",
    "bias_sentence",
    "drop_rows",
    "drop_rule",
    "drop_verdict",
    "drops_measured",
    "measured_shots_to_json",
    "measured_shots_told",
]

DROP_COLUMNS = ("measure", "", "median", "5 %", "95 %", "highest rebound", "shots")

_KEYS = {"restitution": "restitution", "rebound height": "rebound_height_m"}


_Sample = Annotated[
    dict[str, Real],
    Field(
        description="count, mean, standard_deviation, standard_error (of the mean), quantiles, "
        "highest."
    ),
]


@with_measures(DISTRIBUTION_MEASURES)
class DistributionJson(TypedDict):
    """One number of many drops, in the unit of its key."""

    computed: _Sample
    measured: _Sample


@with_measures(DROPS_MEASURES)
class DropsJson(TypedDict):
    """``klack compare`` of shots."""

    schema: Literal["klack-compare-shots/1"]
    case: str
    klack: Version
    rejected: list[RejectedJson]
    distribution: Annotated[dict[str, DistributionJson], Field(description="By measure.")]
    verdict: str
    bias: str
    rule: Annotated[str, Field(description="How the verdict is found.")]


def measured_shots_told(study: MeasuredShotsStudy) -> Iterator[TextTable | Notes | str]:
    """What a terminal shows: both distributions, and what follows from them."""
    title = f"{study.title}: beside {len(study.names)} measured drops"
    yield TextTable(title=title, columns=DROP_COLUMNS, rows=drop_rows(study), left=2)
    for item in study.rejected:
        yield f"Discarded: {item.name}: {item.reason}"
    yield from (drop_verdict(study), bias_sentence(study), drop_rule(study))
    yield Notes(study.notes)


def drop_verdict(study: MeasuredShotsStudy) -> str:
    """Say whether both distributions are alike."""
    apart = [d for d in study.distributions if d.significance < study.likely]
    both = f"{len(study.names)} measured drops"
    if not apart:
        return f"The distributions of the computed shots and of {both} agree."
    words = " and ".join(
        f"the {d.name} (by {100 * d.statistic:.0f} % of the shots at their largest difference)"
        for d in apart
    )
    return f"The distributions of the computed shots and of {both} differ in {words}."


def drop_rule(study: MeasuredShotsStudy) -> str:
    """How the verdict is found."""
    return (
        "Rule: two distributions agree if shots of one and the same valve would differ more in "
        f"at least {100 * study.likely:g} of 100 repetitions (test of Kolmogorov and Smirnov)."
    )


def bias_sentence(study: MeasuredShotsStudy) -> str:
    """Say what taking the highest rebound for the centred impact gets wrong."""
    count = len(study.names)
    found = []
    for d in study.distributions:
        text = _value(d.highest_bias, d.unit, sign=True)
        found.append(f"{text} in the {d.name} (highest measured: {_value(d.measured_highest, d)})")
    return (
        f"Taking the highest rebound of {count} shots for the centred impact is off, on average "
        f"over the computed shots, by {' and by '.join(found)}."
    )


def drop_rows(study: MeasuredShotsStudy) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`DROP_COLUMNS`: each measure computed, measured, and centred."""
    rows: list[tuple[str, ...]] = []
    for d in study.distributions:
        for name, values, highest in (
            ("computed", d.computed, d.computed_highest),
            ("measured", d.measured, d.measured_highest),
        ):
            known = values[np.isfinite(values)]
            middle = (_value(float(np.quantile(known, share)), d) for share in (0.5, 0.05, 0.95))
            rows.append((d.name, name, *middle, _value(highest, d), str(known.size)))
        rows.append((d.name, "centred, computed", _value(d.centred, d), "", "", "", ""))
        rows.append((d.name, "reading error", _value(d.error, d), "", "", "", ""))
    return tuple(rows)


def measured_shots_to_json(study: MeasuredShotsStudy) -> DropsJson:
    """Plain numbers in SI, the unit in the key.

    Returns
    -------
    dict
        ``case``; per measure: quantiles, mean and standard deviation computed and measured,
        ``highest``, ``centred``, the expected highest of as many shots and its ``bias``, the
        statistic and significance of the test; ``verdict``.  Numbers that do not exist (nan) are
        None.
    """
    found: Any = {
        "schema": "klack-compare-shots/1",
        "case": study.case,
        "klack": study.version,
        "rejected": [{"name": item.name, "reason": item.reason} for item in study.rejected],
        **json_of(DROPS_MEASURES, study),
        "distribution": {_KEYS.get(d.name, d.name): _distribution(d) for d in study.distributions},
        "verdict": drop_verdict(study),
        "bias": bias_sentence(study),
        "rule": drop_rule(study),
    }
    return cast(DropsJson, found)


def drops_measured(study: MeasuredShotsStudy) -> Iterator[Measured]:
    """All drops and each of their distributions with their measures."""
    yield "drops", study, DROPS_MEASURES
    for d in study.distributions:
        yield d.name, d, DISTRIBUTION_MEASURES


def _distribution(d: MeasuredDistribution) -> dict[str, Any]:
    return {
        "computed": _moments(d.computed, d.computed_highest),
        "measured": _moments(d.measured, d.measured_highest),
        **json_of(DISTRIBUTION_MEASURES, d),
    }


def _moments(values: np.ndarray, highest: float) -> dict[str, float | None]:
    known = {"count": int(np.isfinite(values).sum()), "highest": number_or_none(highest)}
    return moments(values) | known


def _value(value: float, of: MeasuredDistribution | str, *, sign: bool = False) -> str:
    unit = of if isinstance(of, str) else of.unit
    if not isfinite(value):
        return "–"
    plus = "+" if sign and value > 0.0 else ""
    return plus + (format_si(value, unit, 3) if unit else f"{value:.4f}")
