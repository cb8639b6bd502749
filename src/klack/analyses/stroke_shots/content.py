"""Content and figures of a report of many strokes."""

from math import ceil
from textwrap import fill

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray

from klack.analyses.page import page_of, schematic_section
from klack.analyses.shots.wording import degrees, drawn_section, length_unit, plain
from klack.analyses.stroke_shots.analysis import RATIO_COLUMNS, correlation_rows, ratio_rows
from klack.analyses.stroke_shots.record import (
    AT_TOUCH,
    COMPARED,
    RESULTS,
    Row,
    StrokeShotsStudy,
    VariantShots,
    highest_rebound,
)
from klack.analyses.stroke_shots.scatter import (
    Scattered,
    highest_answers,
    ratio_answers,
    scatter_answers,
    scattered,
)
from klack.report.chart import COLOURS, AxisSpec, Chart, Colour, Curve, Panel, dots
from klack.report.page import Content, Picture, Section, Table
from klack.report.printed import STYLE, svg
from klack.report.wording import count, power, printed_unit, quantity, sentence

__all__ = ["stroke_shots_content"]


Floats = NDArray[np.float64]

VARIANT_COLOURS: dict[str, Colour] = {"wet": "blue", "dry": "green"}
_MOST_TRACES = 60


def rebound_chart(study: StrokeShotsStudy, stop: str) -> Chart | None:
    """Rebound height and restitution over the eccentricity at touch."""
    every = [shots.stops[stop] for shots in study.variants.values()]
    if not any(np.isfinite(columns.eccentricity).any() for columns in every):
        return None
    unit, factor = length_unit(np.concatenate([columns.eccentricity for columns in every]))
    heights = np.concatenate([columns.rebound_height for columns in every])
    height_unit, height_factor = length_unit(heights)
    panels = [_panel(study, stop, factor, "restitution", "restitution", "", 1.0)]
    if np.isfinite(heights).any():
        args = ("rebound_height", "rebound height", height_unit, height_factor)
        panels.insert(0, _panel(study, stop, factor, *args))
    return Chart(
        name=f"rebound-{stop}",
        title=f"Rebound from '{stop}' over the eccentricity at touch",
        x=AxisSpec(label="eccentricity at first touch", unit=unit),
        panels=tuple(panels),
        note="Every point is one stroke. Large: the stroke that starts centred; red: the highest "
        "rebound.",
    )


def _panel(
    study: StrokeShotsStudy,
    stop: str,
    factor: float,
    column: str,
    label: str,
    unit: str,
    scale: float,
) -> Panel:
    curves: list[Curve] = []
    for name, shots in study.variants.items():
        columns, alone = shots.stops[stop], shots.centric_stops[stop]
        x, y = factor * columns.eccentricity, scale * getattr(columns, column)
        colour = VARIANT_COLOURS.get(name, "black")
        words = (f"{name}, stroke {i}" for i in range(len(x)))
        curves.append(dots(x, y, name, colour, 1.4, words))
        best = highest_rebound(shots, stop)
        if best is not None and np.isfinite(y[best.stroke]):
            top = f"{name}, highest, stroke {best.stroke}"
            curves.append(dots(x[best.stroke], y[best.stroke], top, "red", 2.0, [top]))
        middle = scale * float(getattr(alone, column)[0])
        if np.isfinite(middle):
            begun, start = f"{name}, started centred", factor * float(alone.eccentricity[0])
            curves.append(dots(start, middle, begun, colour, 3.0, [begun]))
    return Panel(y=AxisSpec(label=label, unit=unit), curves=tuple(curves))


def lift_chart(study: StrokeShotsStudy) -> Chart:
    """Lift over time of every stroke, a panel for each variant."""
    panels = []
    for name, shots in study.variants.items():
        colour = VARIANT_COLOURS.get(name, "black")
        thin = [
            Curve(
                x=1e3 * shots.time,
                y=1e6 * np.asarray(shots.lift[i], dtype=float),
                label="" if i else f"{name}, all strokes",
                colour="sky" if name == "wet" else colour,
                width=0.6,
                listed=not i,
            )
            for i in range(min(shots.strokes.count, _MOST_TRACES))
        ]
        alone = Curve(
            x=1e3 * shots.time,
            y=1e6 * np.asarray(shots.centric_lift, dtype=float),
            label=f"{name}, started centred",
            colour="black",
            style="dashed",
            width=1.6,
        )
        panels.append(Panel(y=AxisSpec(label="lift", unit="µm"), curves=(*thin, alone)))
    extra = study.count - _MOST_TRACES
    return Chart(
        name="lift",
        title="Lift over time",
        x=AxisSpec(label="time", unit="ms"),
        panels=tuple(panels),
        note="Displacement of the point at which the lift is measured."
        + (f" The first {_MOST_TRACES} strokes are drawn." if extra > 0 else ""),
    )


_SHOWN = ("peak_force", "contact_time", "rebound_height", "restitution")
_OF_STROKE = ("closing_time", "injected_energy", "radiated_energy")
_ACROSS = 3
_TITLE_LETTERS = 26
_LEVER = 3e-3  # [m] of the lines that show the tilt


def histograms(study: StrokeShotsStudy) -> Picture | None:
    """Histograms of each measure and variant."""
    found: dict[str, dict[str, Scattered]] = {}
    for name, shots in study.variants.items():
        for item in scattered(shots):
            wanted = _SHOWN if item.stop else _OF_STROKE
            if item.measure.key in wanted and np.isfinite(item.values).sum() > 1:
                found.setdefault(item.key, {})[name] = item
    if not found:
        return None
    with rc_context(STYLE):
        rows = ceil(len(found) / _ACROSS)
        figure = Figure(figsize=(6.7, 1.75 * rows + 0.4), layout="constrained")
        axes = figure.subplots(rows, _ACROSS, squeeze=False).ravel()
        for axis, items in zip(axes, found.values(), strict=False):
            _histogram(axis, items)
        for axis in axes[len(found) :]:
            axis.set_axis_off()
        handles = [
            axes[0].plot([], [], color=COLOURS[VARIANT_COLOURS.get(name, "black")])[0]
            for name in study.variants
        ]
        figure.legend(handles, list(study.variants), loc="outside upper left", ncols=2)
        return Picture(
            svg(figure),
            f"Number of the {study.count} strokes in each class. Dashed: the stroke that starts "
            "centred.",
        )


def _histogram(axis, items: dict[str, Scattered]) -> None:  # type: ignore[no-untyped-def]
    first = next(iter(items.values()))
    every = np.concatenate([item.values for item in items.values()])
    every = every[np.isfinite(every)]
    unit, factor = printed_unit(every, "" if first.measure.unit == "1" else first.measure.unit)
    low, high = float(every.min()), float(every.max())
    if high <= low:
        low, high = low - 0.5 * abs(low or 1.0), high + 0.5 * abs(high or 1.0)
    edges = np.linspace(low, high, 1 + max(6, ceil(1.5 * np.sqrt(len(every) / len(items)))))
    for name, item in items.items():
        colour = COLOURS[VARIANT_COLOURS.get(name, "black")]
        values = item.values[np.isfinite(item.values)]
        counts, _ = np.histogram(values, bins=edges)
        axis.stairs(counts, factor * edges, color=colour, fill=True, alpha=0.25)
        axis.stairs(counts, factor * edges, color=colour, linewidth=1.4)
        if np.isfinite(item.centric):
            axis.axvline(factor * item.centric, color=colour, linewidth=1.0, linestyle="--")
    axis.set_title(fill(first.name, _TITLE_LETTERS), loc="left")
    axis.set_xlabel(unit and f"[{unit}]")
    axis.set_ylabel("strokes")
    axis.locator_params(axis="x", nbins=4)
    axis.locator_params(axis="y", nbins=4, integer=True)


def touch_map(study: StrokeShotsStudy) -> Picture | None:
    """Axis at first touch of each stop, from above."""
    stops = [
        stop
        for stop in next(iter(study.variants.values())).stops
        if any(np.isfinite(v.stops[stop].eccentricity).any() for v in study.variants.values())
    ]
    if not stops:
        return None
    with rc_context(STYLE):
        figure = Figure(figsize=(6.7, 3.7), layout="constrained")
        for axis, stop in zip(figure.subplots(1, len(stops), squeeze=False)[0], stops, strict=True):
            _touch_panel(axis, study, stop)
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper left", ncols=3)
        return Picture(
            svg(figure),
            "Every dot is the axis of the needle at the height of the stop when a stroke first "
            "touches it; the line leads to its position 3 mm above. Circle: limit of the guide "
            "for the axis of a rigid needle.",
        )


def _touch_panel(axis, study: StrokeShotsStudy, stop: str) -> None:  # type: ignore[no-untyped-def]
    radius = 1e6 * study.largest_eccentricity.get(stop, 0.0)
    axis.add_patch(Circle((0.0, 0.0), radius, fill=False, edgecolor=COLOURS["grey"], linewidth=1.0))
    farthest = radius
    for name, shots in study.variants.items():
        columns = shots.stops[stop]
        colour = COLOURS[VARIANT_COLOURS.get(name, "black")]
        x, y = _plane(1e6 * columns.eccentricity, columns.direction)
        u, v = _plane(1e6 * _LEVER * columns.tilt, columns.tilt_direction)
        axis.quiver(
            x,
            y,
            u,
            v,
            angles="xy",
            scale_units="xy",
            scale=1.0,
            color=colour,
            alpha=0.45,
            width=0.004,
            headwidth=0.0,
            headlength=0.0,
            headaxislength=0.0,
        )
        axis.scatter(x, y, s=12.0, color=colour, linewidths=0.0, zorder=3, label=name)
        best = highest_rebound(shots, stop)
        if best is not None:
            axis.scatter(
                x[best.stroke],
                y[best.stroke],
                s=70.0,
                facecolors="none",
                edgecolors=colour,
                linewidths=1.6,
                zorder=4,
                label=f"{name}, highest rebound",
            )
        farthest = max(farthest, float(np.nanmax(columns.eccentricity, initial=0.0)) * 1e6)
    axis.axhline(0.0, color=COLOURS["grey"], linewidth=0.5)
    axis.axvline(0.0, color=COLOURS["grey"], linewidth=0.5)
    axis.set_aspect("equal")
    axis.set_xlim(-1.12 * farthest, 1.12 * farthest)
    axis.set_ylim(-1.12 * farthest, 1.12 * farthest)
    axis.set_title(f"'{stop}'", loc="left")
    axis.set_xlabel("x [µm]")
    axis.set_ylabel("y [µm]")


def _plane(
    length: NDArray[np.float64], angle: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return length * np.cos(angle), length * np.sin(angle)


_LISTED = 100


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
        _related(study, stops[0]),
        Section(title="Lift", charts=(lift_chart(study),)),
        schematic_section(study.schematic),
        _drawn(study),
        Section(
            title="All strokes",
            paragraphs=()
            if study.count <= _LISTED
            else (f"The first {_LISTED} of {count(study.count)} strokes.",),
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
        definitions=_DEFINITIONS,
        limits=_limits(study),
    )


# --------------------------------------------------------------------------- sections


def _wet_against_dry(study: StrokeShotsStudy) -> Section:
    rows = ratio_rows(study, _printed)
    table = Table(columns=RATIO_COLUMNS, rows=rows)
    return Section(title="Scatter wet against dry", tables=(table,) if rows else ())


def _related(study: StrokeShotsStudy, stop: str) -> Section:
    """Correlations; none of few strokes, which have dashes only."""
    tables = [_correlations(name, shots) for name, shots in study.variants.items()]
    if all(cell == "–" for table in tables for row in table.rows for cell in row[1:]):
        return Section(title="")
    return Section(
        title="Correlations of the scatter",
        paragraphs=(
            "Rank correlation over the strokes: +1 and \N{MINUS SIGN}1 for one that always "
            "rises or falls with the other, about 0 without any relation, a dash where fewer "
            "than five strokes have both values or one of them is constant. Measures of the "
            f"whole stroke are compared with the position at the first touch of '{stop}'.",
        ),
        tables=tuple(tables),
    )


def _correlations(name: str, shots: VariantShots) -> Table:
    heads, rows = correlation_rows(shots)
    minus = tuple(tuple(cell.replace("-", "\N{MINUS SIGN}") for cell in row[1:]) for row in rows)
    return Table(
        columns=(name, *heads[1:]),
        rows=tuple((row[0], *cells) for row, cells in zip(rows, minus, strict=True)),
    )


def _drawn(study: StrokeShotsStudy) -> Section:
    facts = (
        ("start", "where the previous stroke left the needle" if study.carry else "drawn anew"),
        ("guide", study.guide),
        ("mass of the needle", quantity(study.mass, "kg")),
        ("length of a stroke", quantity(study.duration, "s", 3)),
        *((f"contact points of '{stop}'", count(n)) for stop, n in study.points.items()),
        *((f"variant {name}", shots.label) for name, shots in study.variants.items()),
    )
    return drawn_section(study, facts, "strokes", study.stroke_time)


def _strokes(name: str, shots: VariantShots, stop: str) -> Table:
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
        plain(1e6 * stroke["eccentricity"], 2),
        plain(1e6 * first["eccentricity"], 2),
        degrees(first["direction"]),
        plain(float(np.degrees(first["tilt"])), 4),
        degrees(first["tilt_direction"]),
        plain(first["approach_speed"], 4),
        plain(first["peak_force"], 1),
        plain(1e6 * first["contact_time"], 2),
        plain(first["restitution"], 4),
        plain(1e6 * first["rebound_height"], 2),
        plain(first["impacts"], 0),
        power(stroke["energy_residual"]) if np.isfinite(stroke["energy_residual"]) else "–",
    )


def _printed(value: float, unit: str, digits: int) -> str:
    return quantity(value, unit, digits) if unit != "1" else plain(value, 4)


# --------------------------------------------------------------------------- numbers


def _numbers(study: StrokeShotsStudy) -> Table:
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


_DEFINITIONS = (
    *((item.name, item.definition) for item in (*RESULTS, *AT_TOUCH, *COMPARED)),
    (
        "centred",
        "The stroke that starts centred and upright, without Coulomb friction in the guide.",
    ),
    (
        "95 % interval of a ratio of standard deviations",
        "From 2000 bootstrap samples of the strokes.",
    ),
)


_IN_A_ROW = (
    "In a row",
    "Strokes one after another are not independent: intervals are then too narrow.",
)


def _limits(study: StrokeShotsStudy) -> tuple[tuple[str, str], ...]:
    return (
        (
            "Physics",
            "Linear elastic bodies with small deformations, faces that are smooth except for "
            "Coulomb friction where it is given, a rigid bore of the guide unless its law says "
            "otherwise; magnet, spring and fluid act along the axis.",
        ),
        (
            "Chance",
            "Off-axis strokes are chaotic: after three impacts on the seat they depend on "
            "round-off. Distributions do not depend on it, single late bounces do.",
        ),
        *(() if not study.carry else (_IN_A_ROW,)),
    )
