"""Warm-ups in words and numbers, and on disk.

``result.zarr/study/temperature/0/values`` is the temperature of the first node at every point.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import isfinite
from typing import Any, Literal

import numpy as np

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.heat.heated_stroke import ASPECTS
from klack.analyses.heat.record import CauseRow, HeatStudy, WarmColumn
from klack.analyses.json_parts import CASE, OWN_COMPONENTS, JsonForm, Key, Real, by_name, schema_key
from klack.analyses.store import RecordFormat
from klack.report.wording import listed, quantity
from klack.terminal.tables import TextTable
from klack.units import format_si

__all__ = ["HEAT", "answer", "cause_words", "cell", "main_columns", "rows_of_causes", "time_cell"]


_ZERO_CELSIUS = 273.15
_NOISE = 1e-9  # of the base: the rounding of a difference
_TOLD = 40


_COLUMN = JsonForm(
    "HeatColumnJson",
    "One quantity of all points.",
    Key("unit", str, "SI; 1 for a pure number."),
    Key("values", list[Real], "One per point; null where there is none."),
    module=__name__,
)
_CAUSE = JsonForm(
    "CauseJson",
    "A stroke with one cause at temperatures other than the base.",
    Key("state", str, "At which temperatures."),
    Key("cause", str, "base, one cause, or all of them."),
    Key("numbers", dict[str, Real], "SI, by the names of 'strokes'."),
)


def _values(name: str) -> Callable[[HeatStudy], dict[str, Any]]:
    return lambda record: {x.name: x.values for x in getattr(record, name)}


HEAT_FORM = JsonForm(
    "HeatJson",
    "``klack heat``.",
    schema_key("klack-heat/1"),
    *CASE,
    OWN_COMPONENTS,
    Key("variant", str),
    Key("period_s", float, of="period"),
    Key(
        "end",
        Literal["steady", "duration", "runaway", "hot", "soaked"],
        "How it ended; soaked: strokes at given temperatures.",
    ),
    Key("gain", Real, "At 1 or more there is no steady state."),
    Key("time_s", list[Real], "null for the steady state.", "time"),
    Key("temperature_K", dict[str, list[Real]], "By node.", _values("temperature")),
    Key("heat_W", dict[str, list[Real]], "Mean heat of the strokes.", _values("heat")),
    Key("strokes", {str: _COLUMN}, "Delays and peaks.", by_name("numbers")),
    Key("values", {str: _COLUMN}, "Resistances and gaps.", by_name("values")),
    Key("causes", [_CAUSE]),
    Key("supplied_J", dict[str, float], "Heat into each node.", "supplied"),
    Key("stored_J", dict[str, float], of="stored"),
    Key("given_off_J", dict[str, float], "Heat to each known temperature.", "given_off"),
    Key("energy_residual", float),
    Key("unsent_W", dict[str, float], "Losses that warm no node.", "unsent"),
    Key("stroke_count", int, of="strokes"),
    Key("repeats", int, "Steps that were done again."),
    Key("cpu_time_s", float, of="cpu_time"),
    Key("wall_time_s", float, of="wall_time"),
    Key("warnings", list[str]),
)


def heat_told(record: HeatStudy) -> Iterator[TextTable | str]:
    """Points, causes, and the energy balance."""
    shown = main_columns(record)
    yield TextTable(
        title=f"Strokes, {record.variant}"
        if record.end == "soaked"
        else f"Warm-up, {record.variant}, a stroke every {format_si(record.period, 's')}",
        columns=(*(() if record.end == "soaked" else ("time",)), *(x.name for x in shown)),
        rows=[
            (
                *(() if record.end == "soaked" else (time_cell(record.time[i]),)),
                *(cell(x.values[i], x.unit) for x in shown),
            )
            for i in range(min(len(record.time), _TOLD))
        ],
    )
    if len(record.time) > _TOLD:
        yield f"The first {_TOLD} of {len(record.time)} points; all of them are in the CSV file."
    yield TextTable(
        title="Causes: change against the base, with only one at a time at the temperatures of "
        "the state",
        columns=("state", "cause", *record.causes[0].numbers),
        rows=rows_of_causes(record),
        left=2,
    )
    yield answer(record)


def main_columns(record: HeatStudy) -> tuple[WarmColumn, ...]:
    """Columns for people: temperatures, then numbers and values that some stroke has.

    Of gaps that are the same at every point, the first one.
    """
    known: list[WarmColumn] = []
    for x in (*record.numbers, *record.values):
        same = any(x.unit == y.unit and np.array_equal(x.values, y.values) for y in known)
        if np.isfinite(x.values).any() and not same:
            known.append(x)
    return (*record.temperature, *known)


def cell(value: float, unit: str, *, page: bool = False) -> str:
    """A number for a terminal or a page; temperatures in degrees Celsius."""
    if not isfinite(value):
        return "–"
    if unit == "K":
        return f"{value - _ZERO_CELSIUS:.1f} °C"
    if unit == "1":
        return f"{value:.4f}"
    return quantity(float(value), unit) if page else format_si(float(value), unit, 4)


def time_cell(value: float) -> str:
    """A moment of a warm-up."""
    if not isfinite(value):
        return "steady"
    return f"{value:.1f} s" if value < 600.0 else f"{value / 60.0:.1f} min"


def rows_of_causes(record: HeatStudy, *, page: bool = False) -> list[tuple[str, ...]]:
    """Base, changes by each cause and by all together, and what the sum misses."""
    units = {x.name: x.unit for x in record.numbers}
    base = record.causes[0].numbers
    first = (cell(x, units[name], page=page) for name, x in base.items())
    rows = [(record.causes[0].state, "base", *first)]

    def changed(name: str, value: float) -> str:
        noise = abs(value) < _NOISE * abs(base[name])
        return "0" if noise else _change(value, units[name], page=page)

    for state in dict.fromkeys(row.state for row in record.causes[1:]):
        group = [row for row in record.causes[1:] if row.state == state]
        alone = [row for row in group if row.cause != "all"]
        for row in group:
            cells = (changed(name, row.numbers[name] - base[name]) for name in units)
            rows.append((state, cause_words(row.cause), *cells))
        cells = (changed(name, _beyond(group[-1], alone, base, name)) for name in units)
        rows.append((state, "beyond their sum", *cells))
    return rows


def _beyond(
    whole: CauseRow, alone: Sequence[CauseRow], base: Mapping[str, float], name: str
) -> float:
    parts = sum(row.numbers[name] - base[name] for row in alone)
    return whole.numbers[name] - base[name] - parts


def cause_words(cause: str) -> str:
    """What a cause is."""
    words = {str(aspect): text for aspect, text in ASPECTS.items()}
    return {**words, "all": "all together"}.get(cause, cause)


def _change(value: float, unit: str, *, page: bool) -> str:
    if not isfinite(value):
        return "–"
    size = abs(value)
    if unit == "1":
        shown = f"{size:.4f}"
    else:
        shown = quantity(size, unit, 3) if page else format_si(size, unit, 3)
    return f"{'+' if value >= 0.0 else '−' if page else '-'}{shown}"


def answer(record: HeatStudy) -> str:
    """The result in a paragraph."""
    strokes = f"{record.strokes} strokes in {format_si(record.cpu_time, 's', 3)} of processor time."
    if record.end == "soaked":
        return f"{len(record.time)} temperatures of the whole valve, {strokes}"
    last = float(record.time[np.isfinite(record.time)][-1])
    hottest = max(record.temperature, key=lambda x: float(x.values[-1]))
    at = f"'{hottest.name}' is hottest, at {cell(hottest.values[-1], 'K')}"
    ends = {
        "steady": f"steady after {time_cell(last)}: {at}",
        "duration": f"the duration ends after {time_cell(last)}: {at}",
        "runaway": f"thermal runaway: there is no steady state. From {time_cell(last)} the heat "
        f"grows {record.gain:.3g} times as fast with the temperature as it is given off; then "
        f"{at}. --duration continues beyond that",
        "hot": f"no steady state below 2000 K: after {time_cell(last)} {at}",
    }
    unsent = ""
    if record.unsent:
        total = format_si(sum(record.unsent.values()), "W", 3)
        unsent = f" Losses of {total} warm no node: {listed(_largest(record))}."
    heat, given, kept = (
        format_si(sum(x.values()), "J", 4)
        for x in (record.supplied, record.given_off, record.stored)
    )
    return (
        f"Warm-up: {ends[record.end]}. Of {heat} of heat {given} were given off and {kept} stored; "
        f"residual {record.energy_residual:.0e}.{unsent} {strokes}"
    )


def _largest(record: HeatStudy, most: int = 3) -> list[str]:
    found = sorted(record.unsent.items(), key=lambda item: -abs(item[1]))
    words = [f"'{name}' {format_si(power, 'W', 3)}" for name, power in found[:most]]
    return words + (["others"] if len(found) > most else [])


HEAT = StoredAnalysis(
    form=RecordFormat(
        name="klack heat", version=1, kind=HeatStudy, command="klack heat", units={"time": "s"}
    ),
    page="heat.content:heat_content",
    json=HEAT_FORM.type,
    to_json=HEAT_FORM.json,
    told=heat_told,
)
