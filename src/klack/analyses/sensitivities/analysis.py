"""Derivatives in words and numbers, and on disk."""

from collections.abc import Iterator, Mapping
from operator import itemgetter
from typing import Literal, NamedTuple

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.json_parts import CASE, JsonForm, Key, Real, by_name, schema_key
from klack.analyses.sensitivities.record import MeasureSlopes, SensitivityRecord, SlopeParameter
from klack.analyses.store import RecordFormat
from klack.analyses.study.wording import shown_unit
from klack.terminal.tables import TextTable
from klack.units import format_si, is_level

__all__ = [
    "CHECK_HEADS",
    "IMPACT_HEADS",
    "SENSITIVITIES",
    "SLOPE_HEADS",
    "check_rows",
    "impact_rows",
    "measure_title",
    "sensitivities_told",
    "slope_rows",
]

SLOPE_HEADS = ("parameter", "value", "change per +1 %", "elasticity", "derivative (SI)")
CHECK_HEADS = ("measure", "by derivatives", "by the runs", "deviation")
IMPACT_HEADS = ("impact", "time", "root of summed squares", "deviation")

_PARAMETER = JsonForm(
    "SlopeParameterJson",
    "A parameter.",
    Key("unit", str, "SI; 1 for a pure number."),
    Key("value", float),
)
_SLOPE = JsonForm(
    "SlopeJson",
    "Derivative of a measure with respect to a parameter.",
    Key("derivative", Real, "Unit of the measure per unit of the parameter.", itemgetter(0)),
    Key(
        "elasticity",
        Real,
        "Relative change of the measure over that of the parameter; not for a level.",
        itemgetter(1),
    ),
)


class _Sloped(NamedTuple):
    measure: MeasureSlopes
    slopes: Mapping[str, tuple[float | None, float | None]]


def _sloped(record: SensitivityRecord) -> dict[str, _Sloped]:
    return {
        item.name: _Sloped(
            item,
            {
                parameter.name: (item.slopes[k], item.elasticity(k, parameter))
                for k, parameter in enumerate(record.parameters)
            },
        )
        for item in record.measures
    }


_MEASURE = JsonForm(
    "MeasureSlopesJson",
    "A measure and its derivatives.",
    Key("unit", str, of="measure.unit"),
    Key("value", Real, of="measure.value"),
    Key("slopes", {str: _SLOPE}, "By parameter."),
    Key(
        "predicted",
        Real,
        "Change with all parameters in the check, predicted by the derivatives.",
        "measure.predicted",
    ),
    Key("secant", Real, "The same from two runs.", "measure.secant"),
    Key(
        "deviation",
        Real,
        "Difference of the two over the root of the summed squares of the parts.",
        "measure.deviation",
    ),
    Key(
        "doubtful",
        bool,
        "Whether the two runs disagree with the derivatives.",
        "measure.is_doubtful",
    ),
)
_IMPACT = JsonForm(
    "ImpactSlopeJson",
    "An impact, and the sensitivity of its time.",
    Key("stop", str),
    Key("number", int),
    Key("time_s", float, of="time"),
    Key("growth_s", float, "Root of the summed squares of parameter times derivative.", "growth"),
    Key("deviation", Real),
    Key("doubtful", bool, of="is_doubtful"),
)
_RECORD = JsonForm(
    "SensitivitiesJson",
    "``klack sensitivities``.",
    schema_key("klack-sensitivities/1"),
    *CASE,
    Key("variant", str),
    Key("parameters", {str: _PARAMETER}, of=by_name("parameters")),
    Key("measures", {str: _MEASURE}, of=_sloped),
    Key("impacts", [_IMPACT]),
    Key(
        "method",
        Literal["tangents", "differences"],
        "Exact tangents, or differences of impacts with changed parameters.",
        lambda record: "differences" if record.by_differences else "tangents",
    ),
    Key("check_share", float, "Change of each parameter; 0 unchecked.", "share"),
    Key("wall_time_s", Real, of="wall_time"),
    Key("derivatives_cpu_time_s", Real, of="runs_time"),
    Key(
        "run_cpu_time_s",
        Real,
        "Time of one stroke without derivatives.",
        lambda record: record.run_time or None,
    ),
    Key("warnings", list[str]),
)


def sensitivities_told(record: SensitivityRecord) -> Iterator[TextTable | str]:
    """Derivatives of each measure, then the check and the impacts."""
    for item in record.measures:
        yield TextTable(
            title=measure_title(item), columns=SLOPE_HEADS, rows=slope_rows(record, item)
        )
    if record.share:
        yield TextTable(
            title=f"Check: all parameters changed together by {record.share:.0%}, with + and - in "
            "turn, in two runs",
            columns=CHECK_HEADS,
            rows=check_rows(record),
        )
    if record.by_differences:
        yield (
            "Derivatives by differences of impacts with each parameter changed by 1 % and 2 %: "
            "the contact of an impact is solved again for each speed and shape."
        )
    else:
        yield TextTable(
            title="Impacts, and the sensitivity of their times",
            columns=IMPACT_HEADS,
            rows=impact_rows(record),
        )
    if record.run_time > 0.0:
        yield (
            f"{len(record.parameters)} parameters took as long as "
            f"{record.runs_time / record.run_time:.1f} runs."
        )


def measure_title(item: MeasureSlopes) -> str:
    """Name of a measure with its value."""
    value = "no value" if item.value is None else _quantity(item.value, item.unit)
    return f"{item.name}: {value}"


def slope_rows(record: SensitivityRecord, item: MeasureSlopes) -> list[tuple[str, ...]]:
    """Parameters of a measure, as :data:`SLOPE_HEADS`."""
    return [
        (
            parameter.name,
            _quantity(parameter.value, parameter.unit),
            _change(item, k, parameter),
            _plain(item.elasticity(k, parameter), "+.4f"),
            _plain(item.slopes[k], "+.6g"),
        )
        for k, parameter in enumerate(record.parameters)
    ]


def check_rows(record: SensitivityRecord) -> list[tuple[str, ...]]:
    """Changes of all measures, as :data:`CHECK_HEADS`."""
    return [
        (
            item.name,
            "–" if item.predicted is None else _quantity(item.predicted, item.unit),
            "–" if item.secant is None else _quantity(item.secant, item.unit),
            _share(item.deviation),
        )
        for item in record.measures
    ]


def impact_rows(record: SensitivityRecord) -> list[tuple[str, ...]]:
    """Impacts, as :data:`IMPACT_HEADS`."""
    return [
        (
            f"{item.stop} {item.number}",
            format_si(item.time, "s", 5),
            format_si(item.growth, "s", 3),
            _share(item.deviation),
        )
        for item in record.impacts
    ]


def _share(value: float | None) -> str:
    return "–" if value is None else f"{100.0 * value:.2g} %"


def _quantity(value: float, unit: str) -> str:
    if is_level(unit):
        return f"{value:.4g} {unit}"
    shown, factor = shown_unit(unit)
    return format_si(factor * value, shown, 4)


def _plain(value: float | None, form: str) -> str:
    return "–" if value is None else format(value, form)


def _change(item: MeasureSlopes, k: int, parameter: SlopeParameter) -> str:
    slope = item.slopes[k]
    if slope is None or parameter.value == 0.0:
        return "–"
    return _quantity(0.01 * abs(parameter.value) * slope, item.unit)


SENSITIVITIES = StoredAnalysis(
    form=RecordFormat(
        name="klack sensitivities",
        version=1,
        kind=SensitivityRecord,
        command="klack sensitivities CASE",
        units={},
    ),
    page="sensitivities.content:sensitivities_content",
    json=_RECORD.type,
    to_json=_RECORD.json,
    told=sensitivities_told,
)
