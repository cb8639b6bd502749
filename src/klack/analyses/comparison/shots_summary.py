"""Measures and summary of shots beside drops."""

from collections.abc import Iterator
from math import isfinite
from typing import Annotated

import numpy as np
from pydantic import Field

from klack.analyses.analysis import Measured, StoredAnalysis
from klack.analyses.comparison.measures import DISTRIBUTION_MEASURES, DROPS_MEASURES
from klack.analyses.comparison.record import MeasuredDistribution, MeasuredShotsStudy
from klack.analyses.json_parts import (
    CASE,
    REJECTED,
    JsonForm,
    Key,
    Real,
    measured_keys,
    schema_key,
)
from klack.analyses.sample import moments
from klack.analyses.store import RecordFormat
from klack.terminal.tables import Notes, TextTable
from klack.units import format_si

__all__ = [
    "DROP_COLUMNS",
    "MEASURED_SHOTS",
    "bias_sentence",
    "drop_rows",
    "drop_rule",
    "drop_verdict",
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


_DISTRIBUTION = JsonForm(
    "DistributionJson",
    "One number of many drops, in the unit of its key.",
    Key("computed", _Sample, of=lambda d: _moments(d.computed, d.computed_highest)),
    Key("measured", _Sample, of=lambda d: _moments(d.measured, d.measured_highest)),
    *measured_keys(DISTRIBUTION_MEASURES),
)
_STUDY = JsonForm(
    "DropsJson",
    "``klack compare`` of shots.",
    schema_key("klack-compare-shots/1"),
    *CASE,
    Key("rejected", [REJECTED]),
    *measured_keys(DROPS_MEASURES),
    Key(
        "distribution",
        {str: _DISTRIBUTION},
        "By measure.",
        lambda study: {_KEYS.get(d.name, d.name): d for d in study.distributions},
    ),
    Key("verdict", str, of=lambda study: drop_verdict(study)),
    Key("bias", str, of=lambda study: bias_sentence(study)),
    Key("rule", str, "Rule of the verdict.", lambda study: drop_rule(study)),
)


def _told(study: MeasuredShotsStudy) -> Iterator[TextTable | Notes | str]:
    title = f"{study.title}: against {len(study.names)} measured drops"
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
    """Rule of the verdict."""
    return (
        "Rule: two distributions agree if shots of one and the same valve would differ more in "
        f"at least {100 * study.likely:g} of 100 repetitions (test of Kolmogorov and Smirnov)."
    )


def bias_sentence(study: MeasuredShotsStudy) -> str:
    """Error of taking the highest rebound for the centred impact."""
    count = len(study.names)
    found = []
    for d in study.distributions:
        text = _value(d.highest_bias, d.unit, sign=True)
        found.append(f"{text} in the {d.name} (highest measured: {_value(d.measured_highest, d)})")
    return (
        f"Taking the highest rebound of {count} shots for the centred impact is wrong, on "
        f"average over the computed shots, by {' and by '.join(found)}."
    )


def drop_rows(study: MeasuredShotsStudy) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`DROP_COLUMNS`: computed, measured, and centred."""
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


def _measured(study: MeasuredShotsStudy) -> Iterator[Measured]:
    yield "drops", study, DROPS_MEASURES
    for d in study.distributions:
        yield d.name, d, DISTRIBUTION_MEASURES


def _moments(values: np.ndarray, highest: float) -> dict[str, float | None]:
    return moments(values) | {"count": int(np.isfinite(values).sum()), "highest": highest}


def _value(value: float, of: MeasuredDistribution | str, *, sign: bool = False) -> str:
    unit = of if isinstance(of, str) else of.unit
    if not isfinite(value):
        return "–"
    plus = "+" if sign and value > 0.0 else ""
    return plus + (format_si(value, unit, 3) if unit else f"{value:.4f}")


MEASURED_SHOTS = StoredAnalysis(
    form=RecordFormat(
        name="klack measured shots",
        version=1,
        kind=MeasuredShotsStudy,
        command="klack compare RESULT --measurement",
        units={"time": "s", "lift": "m", "computed_time": "s", "computed_height": "m"},
    ),
    page="comparison.content:measured_shots_content",
    json=_STUDY.type,
    to_json=_STUDY.json,
    told=_told,
    measures={
        "measured drops": DROPS_MEASURES,
        "distribution against a measurement": DISTRIBUTION_MEASURES,
    },
    measured=_measured,
)
