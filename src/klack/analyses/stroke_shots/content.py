"""Content of a report of many strokes before its layout: the same texts for screen and paper."""

from collections.abc import Callable

import numpy as np

from klack.analyses.measures import Measure
from klack.analyses.page import page_of
from klack.analyses.schematic_section import schematic_section
from klack.analyses.stroke_shots.analysis import (
    RATIO_COLUMNS,
    correlation_rows,
    ratio_rows,
)
from klack.analyses.stroke_shots.figures import histograms, lift_chart, rebound_chart, touch_map
from klack.analyses.stroke_shots.record import (
    AT_TOUCH,
    COMPARED,
    RESULTS,
    Row,
    StrokeShotsStudy,
    VariantShots,
    highest_rebound,
)
from klack.analyses.stroke_shots.scatter import scattered
from klack.analyses.stroke_shots.wording import highest_answers, ratio_answers, scatter_answers
from klack.report.page import Content, Section, Table
from klack.report.wording import count, power, quantity, sentence

__all__ = ["stroke_shots_content"]

_LISTED = 100
"""Strokes in a table; the result holds all of them."""


def stroke_shots_content(study: StrokeShotsStudy) -> Content:
    """Texts, tables and figures of a study."""
    stops = tuple(next(iter(study.variants.values())).stops)
    charts = [rebound_chart(study, stop) for stop in stops]
    answers = [
        sentence(text) for text in (*highest_answers(study, _printed), *ratio_answers(study))
    ]
    sections = [
        Section(
            title="Scatter",
            paragraphs=tuple(sentence(text) for text in scatter_answers(study, _printed)),
            picture=histograms(study),
        ),
        _wet_against_dry(study),
        Section(
            title="Rebound and eccentricity",
            charts=tuple(chart for chart in charts if chart is not None),
        ),
        Section(title="Placement at touch", picture=touch_map(study)),
        Section(
            title="What the scatter goes with",
            paragraphs=(
                "Rank correlation over the strokes: +1 and \N{MINUS SIGN}1 for one that always "
                "rises or falls with the other, about 0 without any connection, a dash where fewer "
                "than five strokes have both values or one of them is constant. Measures of the "
                "whole stroke are compared with the position at the first touch of "
                f"'{stops[0]}'.",
            ),
            tables=tuple(_correlations(name, v) for name, v in study.variants.items()),
        ),
        Section(title="Lift", charts=(lift_chart(study),)),
        schematic_section(study.schematic),
        _drawn(study),
        Section(
            title="All strokes",
            paragraphs=_listed_note(study),
            tables=tuple(
                _strokes(name, shots, stop)
                for name, shots in study.variants.items()
                for stop in stops
            ),
        ),
    ]
    kind = "in a row" if study.carry else "independent"
    return page_of(
        study,
        f"{study.count} strokes, {kind}",
        subtitle=(f"seed {study.seed}", ", ".join(study.variants)),
        answer=" ".join(answers),
        numbers=_numbers(study),
        sections=sections,
        definitions=_definitions(),
        limits=_limits(study),
    )


# --------------------------------------------------------------------------- sections


def _wet_against_dry(study: StrokeShotsStudy) -> Section:
    rows = ratio_rows(study, _printed)
    table = Table(columns=RATIO_COLUMNS, rows=rows)
    return Section(title="Scatter wet against dry", tables=(table,) if rows else ())


def _correlations(name: str, shots: VariantShots) -> Table:
    heads, rows = correlation_rows(shots)
    minus = tuple(tuple(cell.replace("-", "\N{MINUS SIGN}") for cell in row[1:]) for row in rows)
    return Table(
        columns=(name, *heads[1:]),
        rows=tuple((row[0], *cells) for row, cells in zip(rows, minus, strict=True)),
    )


def _drawn(study: StrokeShotsStudy) -> Section:
    facts = [
        ("seed", str(study.seed)),
        (
            "start",
            "where the stroke before has left the needle" if study.carry else "drawn anew",
        ),
        ("guide", study.guide),
        ("mass of the needle", quantity(study.mass, "kg")),
        ("length of a stroke", quantity(study.duration, "s", 3)),
        *((f"contact points of '{stop}'", count(n)) for stop, n in study.points.items()),
        *((f"variant {name}", shots.label) for name, shots in study.variants.items()),
        (
            "computing time of the strokes",
            f"{quantity(study.stroke_time, 's', 3)} on {study.workers} "
            f"process{'es' if study.workers != 1 else ''}",
        ),
    ]
    if study.resumed:
        facts.append(("resumed from an interrupted run", f"{count(study.resumed)} strokes"))
    return Section(
        title="Distributions",
        tables=(
            Table(columns=("what varies", "drawn from"), rows=tuple(study.distributions.items())),
            Table(columns=("what all strokes share", ""), rows=tuple(facts)),
        ),
    )


def _listed_note(study: StrokeShotsStudy) -> tuple[str, ...]:
    if study.count <= _LISTED:
        return ()
    return (f"The first {_LISTED} of {count(study.count)} strokes.",)


_Cell = Callable[[Row, Row], str]


def _strokes(name: str, shots: VariantShots, stop: str) -> Table:
    """One row per stroke with its first impact on a stop, the centred one first."""
    columns = shots.stops[stop]
    best = highest_rebound(shots, stop)
    heads = (
        f"{name}\n'{stop}'",
        "start\n[µm]",
        "touch\n[µm]",
        "towards\n[°]",
        "tilt\n[°]",
        "towards\n[°]",
        "speed\n[m/s]",
        "peak\n[N]",
        "contact\n[µs]",
        "restitution",
        "rebound\n[µm]",
        "impacts",
        "residual",
    )
    rows = [("centred", *_cells(shots.centric.row(0), shots.centric_stops[stop].row(0)))]
    for i in range(min(shots.strokes.count, _LISTED)):
        mark = "\nhighest" if best is not None and i == best.stroke else ""
        mark += "\nfailed" if str(i) in shots.failures else ""
        rows.append((f"{i}{mark}", *_cells(shots.strokes.row(i), columns.row(i))))
    return Table(columns=heads, rows=tuple(rows))


def _cells(stroke: Row, first: Row) -> tuple[str, ...]:
    return (
        _plain(1e6 * stroke["eccentricity"], 2),
        _plain(1e6 * first["eccentricity"], 2),
        _angle(first["direction"]),
        _plain(float(np.degrees(first["tilt"])), 4),
        _angle(first["tilt_direction"]),
        _plain(first["approach_speed"], 4),
        _plain(first["peak_force"], 1),
        _plain(1e6 * first["contact_time"], 2),
        _plain(first["restitution"], 4),
        _plain(1e6 * first["rebound_height"], 2),
        _plain(first["impacts"], 0),
        power(stroke["energy_residual"]) if np.isfinite(stroke["energy_residual"]) else "–",
    )


def _printed(value: float, unit: str, digits: int) -> str:
    return quantity(value, unit, digits) if unit != "1" else _plain(value, 4)


def _plain(value: float, decimals: int) -> str:
    if not np.isfinite(value):
        return "–"
    return f"{value:.{decimals}f}".replace("-", "\N{MINUS SIGN}")


def _angle(value: float) -> str:
    return f"{round(np.degrees(value)) % 360}" if np.isfinite(value) else "–"


# --------------------------------------------------------------------------- numbers


def _numbers(study: StrokeShotsStudy) -> Table:
    """Centred stroke, mean and standard deviation of every variant."""
    parts = {name: {item.key: item for item in scattered(v)} for name, v in study.variants.items()}
    keys = dict.fromkeys(key for items in parts.values() for key in items)
    rows = []
    for key in keys:
        cells: list[str] = []
        for items in parts.values():
            item = items.get(key)
            if item is None:
                cells += ["–"] * 3
                continue
            known = item.values[np.isfinite(item.values)]
            printed = item.measure.printed
            cells += [
                printed(item.centric),
                printed(float(np.mean(known))),
                printed(float(np.std(known))),
            ]
        rows.append((next(i[key].name for i in parts.values() if key in i), *cells))
    worst = [f"{np.nanmax(v.strokes.energy_residual):.1e}" for v in study.variants.values()]
    flat = [cell for text in worst for cell in ("", text.replace("-", "\N{MINUS SIGN}"), "")]
    rows.append(("energy residual, largest", *flat))
    heads = [
        f"{name}: {words}" if len(parts) > 1 else words
        for name in parts
        for words in ("centred", "mean", "standard deviation")
    ]
    return Table(columns=("", *heads), rows=tuple(rows))


def _definitions() -> tuple[tuple[str, str], ...]:
    shown: tuple[Measure[Row], ...] = (*RESULTS, *AT_TOUCH, *COMPARED)
    return (
        *((item.name, item.definition) for item in shown),
        (
            "centred",
            "The stroke that starts centred and upright, without Coulomb friction in the guide.",
        ),
        (
            "95 % interval of a ratio of standard deviations",
            "From 2000 samples drawn with repetition from the strokes.",
        ),
    )


def _limits(study: StrokeShotsStudy) -> tuple[tuple[str, str], ...]:
    found = [
        (
            "Physics",
            "Linear elastic bodies with small deformations, faces that are smooth but for Coulomb "
            "friction where it is given, a rigid bore of the guide unless its law says otherwise; "
            "magnet, spring and fluid act along the axis.",
        ),
        (
            "Chance",
            "Off-axis strokes are chaotic: after three impacts on the seat, differences of "
            "round-off decide. Distributions do not depend on it, single late bounces do.",
        ),
    ]
    if study.carry:
        found.append(
            (
                "In a row",
                "Strokes one after another are not independent: intervals are then too narrow.",
            )
        )
    return tuple(found)
