"""Operating points in words and numbers, and on disk.

``result.zarr/study/quantities/0/values`` is the first quantity at every point.
"""

from collections.abc import Iterator, Mapping
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.json_parts import CASE, OWN_COMPONENTS, JsonForm, Key, Real, by_name, schema_key
from klack.analyses.operating_point.record import OperatingPoints, PointQuantity
from klack.analyses.store import RecordFormat
from klack.analyses.study.wording import number_text
from klack.terminal.tables import TextTable
from klack.units import format_si

__all__ = ["OPERATING_POINT", "residual_rows", "shown_quantities"]


_TOLD = 40
_MAIN = 6


_SWEPT = JsonForm(
    "SweptJson",
    "Quantity changed by a sweep.",
    Key("unit", str, "SI; 1 for a pure number."),
    Key("values", list[float]),
)
_QUANTITY = JsonForm(
    "QuantityJson",
    "One quantity of a component.",
    Key("component", str),
    Key("quantity", str),
    Key("unit", str, "SI."),
    Key("values", list[Real], "One per point; null where there is none."),
)
_LEFT = JsonForm(
    "LeftJson",
    "Residuals of the balances at each point.",
    Key("force_N", list[Real], "Largest force on a free body.", "force_left"),
    Key("volume_flow_m3_s", list[Real], "Largest flow into a volume.", "flow_left"),
    Key("voltage_V", list[Real], "Largest voltage at a coil.", "voltage_left"),
)
OPERATING_POINTS = JsonForm(
    "OperatingPointJson",
    "``klack stroke --steady``.",
    schema_key("klack-stroke-steady/1"),
    *CASE,
    OWN_COMPONENTS,
    Key("variant", str),
    Key("needle", str, "Point whose displacement is the lift."),
    Key("started_from", Literal["start", "far"], "Positions of the bodies.", "origin"),
    Key("current_A", dict[str, float], "Current by coil, of the first point.", "drive"),
    Key(
        "swept",
        {str: _SWEPT},
        "By name; empty for one point.",
        by_name("swept"),
    ),
    Key("quantities", [_QUANTITY]),
    Key("residuals", _LEFT, of=lambda record: record),
    Key("failures", list[str], "Reason why there is no point; otherwise empty."),
    Key("doubts", list[str], "Doubts about each point."),
    Key("cpu_time_s", Real, "Of all points, without bodies and laws.", "cpu_time"),
    Key("wall_time_s", Real, of="wall_time"),
    Key("warnings", list[str]),
)


def operating_point_told(record: OperatingPoints) -> Iterator[TextTable | str]:
    """The table of one point, or the main quantities along a sweep."""
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
    """Balances, and their residuals at the worst point."""
    found = record.found
    rows: Mapping[str, tuple[NDArray[np.float64], str]] = {
        "forces on each free body": (record.force_left, "N"),
        "volume flows of each volume": (record.flow_left, "m^3/s"),
        "voltage of each coil": (record.voltage_left, "V"),
    }
    return [
        (name, format_si(float(np.max(values[found])), unit, 2))
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
    known = np.isfinite(one)
    return bool(np.allclose(one[known], other[known], rtol=1e-9, atol=0.0))


def _changes(item: PointQuantity) -> bool:
    known = item.values[np.isfinite(item.values)]
    if known.size < 2:
        return False
    return bool(np.ptp(known) > 1e-9 * np.max(np.abs(known)))


OPERATING_POINT = StoredAnalysis(
    form=RecordFormat(
        name="klack operating points",
        version=1,
        kind=OperatingPoints,
        command="klack stroke CASE --steady",
        units={"force_left": "N", "flow_left": "m^3/s", "voltage_left": "V"},
    ),
    page="operating_point.content:operating_point_content",
    json=OPERATING_POINTS.type,
    to_json=OPERATING_POINTS.json,
    told=operating_point_told,
)
