"""Derivatives of a stroke for scripts and terminals."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

from pydantic import Field
from typing_extensions import TypedDict

from klack.analyses.json_parts import Real, Version
from klack.analyses.sensitivities.record import MeasureSlopes, SensitivityRecord, SlopeParameter
from klack.analyses.study.wording import shown_unit
from klack.terminal.tables import TextTable
from klack.units import format_si, is_level

__all__ = ["SensitivitiesJson", "sensitivities_to_json", "sensitivities_told"]


class SlopeParameterJson(TypedDict):
    """A parameter."""

    unit: Annotated[str, Field(description="SI; 1 for a pure number.")]
    value: float


class SlopeJson(TypedDict):
    """Derivative of a measure with a parameter."""

    derivative: Annotated[Real, Field(description="Unit of the measure per unit of the parameter.")]
    elasticity: Annotated[
        Real,
        Field(description="Relative change of the measure over the parameter's; not of a level."),
    ]


class MeasureSlopesJson(TypedDict):
    """A measure and its derivatives."""

    unit: str
    value: Real
    slopes: Annotated[dict[str, SlopeJson], Field(description="By parameter.")]
    predicted: Annotated[
        Real, Field(description="Change with all parameters in the check, by the derivatives.")
    ]
    secant: Annotated[Real, Field(description="The same from two runs.")]
    deviation: Annotated[
        Real,
        Field(description="Difference of both over the root of the summed squares of the parts."),
    ]
    doubtful: Annotated[bool, Field(description="Whether the two runs tell something else.")]


class ImpactSlopeJson(TypedDict):
    """An impact, and how strongly its time answers."""

    stop: str
    number: int
    time_s: float
    growth_s: Annotated[
        float, Field(description="Root of the summed squares of parameter times derivative.")
    ]
    deviation: Real
    doubtful: bool


class SensitivitiesJson(TypedDict):
    """``klack sensitivities``."""

    schema: Literal["klack-sensitivities/1"]
    case: str
    klack: Version
    variant: str
    parameters: dict[str, SlopeParameterJson]
    measures: dict[str, MeasureSlopesJson]
    impacts: list[ImpactSlopeJson]
    method: Annotated[
        Literal["tangents", "differences"],
        Field(description="Exact, or by impacts with changed parameters."),
    ]
    check_share: Annotated[float, Field(description="Change of each parameter; 0 unchecked.")]
    wall_time_s: Real
    derivatives_cpu_time_s: Real
    run_cpu_time_s: Annotated[Real, Field(description="Of one stroke without derivatives.")]
    warnings: list[str]


def sensitivities_to_json(record: SensitivityRecord) -> dict[str, Any]:
    """Plain numbers in SI."""
    return {
        "schema": "klack-sensitivities/1",
        "case": record.case,
        "klack": record.version,
        "variant": record.variant,
        "parameters": {
            item.name: {"unit": item.unit, "value": item.value} for item in record.parameters
        },
        "measures": {item.name: _measure(item, record.parameters) for item in record.measures},
        "impacts": [
            {
                "stop": item.stop,
                "number": item.number,
                "time_s": item.time,
                "growth_s": item.growth,
                "deviation": item.deviation,
                "doubtful": item.is_doubtful,
            }
            for item in record.impacts
        ],
        "method": "differences" if record.by_differences else "tangents",
        "check_share": record.share,
        "wall_time_s": record.wall_time,
        "derivatives_cpu_time_s": record.runs_time,
        "run_cpu_time_s": record.run_time or None,
        "warnings": list(record.warnings),
    }


def _measure(item: MeasureSlopes, parameters: tuple[SlopeParameter, ...]) -> dict[str, Any]:
    return {
        "unit": item.unit,
        "value": item.value,
        "slopes": {
            parameter.name: {
                "derivative": item.slopes[k],
                "elasticity": item.elasticity(k, parameter),
            }
            for k, parameter in enumerate(parameters)
        },
        "predicted": item.predicted,
        "secant": item.secant,
        "deviation": item.deviation,
        "doubtful": item.is_doubtful,
    }


def sensitivities_told(record: SensitivityRecord) -> Iterator[TextTable | str]:
    """What a terminal shows: for each measure its derivatives, then the check and the impacts."""
    for item in record.measures:
        value = "no value" if item.value is None else _quantity(item.value, item.unit)
        yield TextTable(
            title=f"{item.name}: {value}",
            columns=("parameter", "value", "change per +1 %", "elasticity", "derivative (SI)"),
            rows=[
                (
                    parameter.name,
                    _quantity(parameter.value, parameter.unit),
                    _change(item, k, parameter),
                    _plain(item.elasticity(k, parameter), "+.4f"),
                    _plain(item.slopes[k], "+.6g"),
                )
                for k, parameter in enumerate(record.parameters)
            ],
        )
    if record.share:
        yield TextTable(
            title=f"Check: all parameters changed together by {record.share:.0%}, with + and - in "
            "turn, in two runs",
            columns=("measure", "by derivatives", "by the runs", "deviation"),
            rows=[
                (
                    item.name,
                    "–" if item.predicted is None else _quantity(item.predicted, item.unit),
                    "–" if item.secant is None else _quantity(item.secant, item.unit),
                    "–" if item.deviation is None else f"{100.0 * item.deviation:.2g} %",
                )
                for item in record.measures
            ],
        )
    if record.by_differences:
        yield (
            "Derivatives by differences of impacts with each parameter changed by 1 % and 2 %: the "
            "contact of an impact is solved anew for each speed and shape."
        )
    else:
        yield _impact_table(record)
    if record.run_time > 0.0:
        yield (
            f"{len(record.parameters)} parameters took as long as "
            f"{record.runs_time / record.run_time:.1f} runs."
        )


def _impact_table(record: SensitivityRecord) -> TextTable:
    return TextTable(
        title="Impacts, and how strongly their times answer",
        columns=("impact", "time", "root of summed squares", "deviation"),
        rows=[
            (
                f"{item.stop} {item.number}",
                format_si(item.time, "s", 5),
                format_si(item.growth, "s", 3),
                "–" if item.deviation is None else f"{100.0 * item.deviation:.2g} %",
            )
            for item in record.impacts
        ],
    )


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
