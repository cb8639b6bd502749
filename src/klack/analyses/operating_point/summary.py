"""Operating points for scripts and terminals."""

from collections.abc import Iterator, Mapping
from math import isfinite
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from typing_extensions import TypedDict

from klack.analyses.json_parts import OwnComponents, Real, Version
from klack.analyses.operating_point.record import OperatingPoints, PointQuantity
from klack.analyses.study.wording import number_text
from klack.terminal.tables import TextTable
from klack.units import format_si

__all__ = [
    "OperatingPointJson",
    "operating_point_to_json",
    "operating_point_told",
    "residual_rows",
    "shown_quantities",
]

_TOLD = 40
"""Points of a sweep on a terminal."""
_MAIN = 6
"""Quantities of a sweep on a terminal."""


class SweptJson(TypedDict):
    """What a sweep changes."""

    unit: Annotated[str, Field(description="SI; 1 for a pure number.")]
    values: list[float]


class QuantityJson(TypedDict):
    """One quantity of a component."""

    component: str
    quantity: str
    unit: Annotated[str, Field(description="SI.")]
    values: Annotated[list[Real], Field(description="One per point; null where there is none.")]


class LeftJson(TypedDict):
    """What is left of the balances at each point."""

    force_N: Annotated[list[Real], Field(description="Largest on a free body.")]
    volume_flow_m3_s: Annotated[list[Real], Field(description="Largest into a volume.")]
    voltage_V: Annotated[list[Real], Field(description="Largest at a coil.")]


class OperatingPointJson(TypedDict):
    """``klack stroke --steady``."""

    schema: Literal["klack-stroke-steady/1"]
    case: str
    klack: Version
    own_components: OwnComponents
    variant: str
    needle: Annotated[str, Field(description="Point whose displacement is the lift.")]
    started_from: Annotated[Literal["start", "far"], Field(description="Place of the bodies.")]
    current_A: Annotated[dict[str, float], Field(description="By coil, of the first point.")]
    swept: Annotated[dict[str, SweptJson], Field(description="By name; empty for one point.")]
    quantities: list[QuantityJson]
    residuals: LeftJson
    failures: Annotated[list[str], Field(description="Why there is no point; else empty.")]
    doubts: Annotated[list[str], Field(description="What has to be known of each point.")]
    cpu_time_s: Annotated[Real, Field(description="Of all points, without bodies and laws.")]
    wall_time_s: Real
    warnings: list[str]


def operating_point_to_json(record: OperatingPoints) -> dict[str, Any]:
    """Plain numbers in SI."""
    return {
        "schema": "klack-stroke-steady/1",
        "case": record.case,
        "klack": record.version,
        "own_components": dict(record.own_components),
        "variant": record.variant,
        "needle": record.needle,
        "started_from": record.origin,
        "current_A": dict(record.drive),
        "swept": {
            item.name: {"unit": item.unit, "values": item.values.tolist()} for item in record.swept
        },
        "quantities": [
            {
                "component": item.component,
                "quantity": item.quantity,
                "unit": item.unit,
                "values": _plain(item.values),
            }
            for item in record.quantities
        ],
        "residuals": {
            "force_N": _plain(record.force_left),
            "volume_flow_m3_s": _plain(record.flow_left),
            "voltage_V": _plain(record.voltage_left),
        },
        "failures": list(record.failures),
        "doubts": list(record.doubts),
        "cpu_time_s": record.cpu_time,
        "wall_time_s": record.wall_time,
        "warnings": list(record.warnings),
    }


def _plain(values: NDArray[np.float64]) -> list[float | None]:
    return [float(x) if isfinite(x) else None for x in values]


def operating_point_told(record: OperatingPoints) -> Iterator[TextTable | str]:
    """What a terminal shows: the table of one point, or the main quantities along a sweep."""
    drive = ", ".join(f"{name} at {format_si(i, 'A')}" for name, i in record.drive.items())
    title = f"{record.variant}: " + (drive or "no coil")
    if not record.swept:
        yield TextTable(
            title=f"Operating point, {title}",
            columns=("component", "quantity", "value"),
            rows=[
                (item.component, item.quantity, number_text(float(item.values[0]), item.unit, 6))
                for item in record.quantities
            ],
            left=2,
        )
    else:
        shown = shown_quantities(record)[:_MAIN]
        heads = [*(x.short for x in record.swept), *(x.name for x in shown)]
        yield TextTable(
            title=f"Operating points, {title} at the first one",
            columns=("", *heads),
            rows=[
                (
                    "" if record.found[i] else "not found",
                    *(number_text(float(x.values[i]), x.unit, 5) for x in record.swept),
                    *(
                        number_text(float(x.values[i]), x.unit, 5)
                        if np.isfinite(x.values[i])
                        else "–"
                        for x in shown
                    ),
                )
                for i in range(min(record.count, _TOLD))
            ],
        )
        if record.count > _TOLD:
            yield f"The first {_TOLD} of {record.count} points; all of them are in the CSV file."
    yield TextTable(
        title="Residuals, the largest of each kind",
        columns=("balance", "left"),
        rows=residual_rows(record),
    )
    yield (
        f"{record.count} point{'s' if record.count > 1 else ''} in "
        f"{format_si(record.cpu_time, 's', 3)} of processor time."
    )


def residual_rows(record: OperatingPoints) -> list[tuple[str, str]]:
    """Balances, and what is left of them at the worst point."""
    found = record.found
    rows: Mapping[str, tuple[NDArray[np.float64], str]] = {
        "forces on each free body": (record.force_left, "N"),
        "volume flows of each volume": (record.flow_left, "m^3/s"),
        "voltage of each coil": (record.voltage_left, "V"),
    }
    return [
        (name, f"{float(np.max(values[found])):.1e} {unit}")
        for name, (values, unit) in rows.items()
    ]


def shown_quantities(record: OperatingPoints) -> list[PointQuantity]:
    """Quantities that change along a sweep, the main ones first.

    The lift, what holds the needle, magnets, flows, pressures, then all others.
    """
    component, _, point = record.needle.partition(".")
    order = (
        lambda x: x.component == component and x.quantity == f"{point} displacement",
        lambda x: x.quantity == "holding force",
        lambda x: x.quantity == "armature force",
        lambda x: x.quantity.endswith("volume flow"),
        lambda x: x.quantity == "pressure",
        lambda x: x.quantity == "current",
        lambda x: x.quantity == "flux",
    )

    def rank(item: PointQuantity) -> int:
        return next((i for i, is_it in enumerate(order) if is_it(item)), len(order))

    changing = [x for x in record.quantities if _changes(x) and x.quantity != "base force"]
    swept = [item.values for item in record.swept]
    new = [x for x in changing if not any(_same(x.values, values) for values in swept)]
    return sorted(new, key=rank)


def _same(one: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
    """Whether a quantity is nothing but what was swept."""
    known = np.isfinite(one)
    return bool(np.allclose(one[known], other[known], rtol=1e-9, atol=0.0))


def _changes(item: PointQuantity) -> bool:
    known = item.values[np.isfinite(item.values)]
    if known.size < 2:
        return False
    return bool(np.ptp(known) > 1e-9 * np.max(np.abs(known)))
