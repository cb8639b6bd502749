"""Content of a study's report."""

import re
from collections.abc import Sequence
from math import isfinite, nan

import numpy as np

from klack.acoustics.wav import full_scale_of, level_statement, wav_bytes
from klack.analyses.page import page_of
from klack.analyses.sample import rank_correlation
from klack.analyses.study.figures import (
    effect_bars,
    front_charts,
    main_effect_charts,
    parallel_chart,
    scatter_chart,
    sensitivity_bars,
    surrogate_bars,
)
from klack.analyses.study.record import (
    Optimum,
    Sensitivity,
    StudyColumn,
    StudyRecord,
    StudySurrogate,
)
from klack.analyses.study.wording import (
    EFFECT_COLUMNS,
    MISSED_COLUMNS,
    SHARE_COLUMNS,
    SURROGATE_COLUMNS,
    alike,
    change,
    effect_cells,
    index_cells,
    largest_first,
    missed_cells,
    numberless,
    on_page,
    rate_text,
    short_labels,
    steps_texts,
    surrogate_cells,
    variant_words,
)
from klack.report.page import Content, NextStep, Section, Sound, Table
from klack.report.wording import count, signed, typeset
from klack.studies.fronts import spread_over

__all__ = ["study_content"]

_LISTED = 100
_OF_FRONT = 24
_MANY_ROWS = 1024
_FEWEST = 8


def study_content(record: StudyRecord) -> Content:
    """Texts, tables and figures of a study."""
    labels = short_labels(record)
    varying = [item for item in record.parameters if item.varies]
    related = {
        item.name: {
            of.name: found
            for of in varying
            if isfinite(found := rank_correlation(item.values, of.values))
        }
        for item in record.measures
        if record.count >= _FEWEST and record.optimum is None  # a search crowds about its front
    }
    keys = Table(
        columns=("key", "today", "values"),
        rows=tuple(
            (item.name, on_page(item, item.today), item.spread)
            for item in (*record.parameters, *record.linked)
        ),
    )
    sections = [
        *_optimum_sections(record, labels),
        Section(
            title="All points",
            charts=(parallel_chart(record, labels),) if varying else (),
        ),
        Section(
            title="What each measure depends on",
            charts=()
            if record.optimum is not None
            else tuple(
                scatter_chart(
                    record,
                    measure,
                    sorted(varying, key=lambda of: -abs(related[measure.name].get(of.name, 0.0)))[
                        :2
                    ],
                    labels,
                )
                for measure in record.measures
                if measure.varies and related.get(measure.name)
            ),
            tables=_related_table(record, varying, related, labels),
        ),
        _missed_section(record),
        _screening_section(record, labels),
        _sensitivity_section(record, labels),
        *_surrogate_sections(record, labels),
        Section(title="Parameters", tables=(keys,)),
        Section(title="Points", tables=_point_tables(record, labels), paragraphs=_left(record)),
    ]
    return page_of(
        record,
        f"{'Study' if record.optimum is None else 'Optimisation'}, {count(record.count)} points",
        subtitle=(variant_words(record), record.design),
        answer=_best_answer(record, labels) or _answer(record, varying, related, labels),
        numbers=_number_table(record),
        sections=sections,
        definitions=_DEFINITIONS,
        limits=(_OF_STROKES if not record.model else _OF_IMPACTS, *_LIMITS),
        next_steps=_next_steps(record),
    )


def _next_steps(record: StudyRecord) -> list[NextStep]:
    found = record.optimum
    best = [] if found is None or found.best < 0 else [found.best]
    return [
        *(
            NextStep(
                purpose="The case of the recommended point, to compute and to change.",
                command=f"klack export RESULT --to case --point {point}",
            )
            for point in best
        ),
        NextStep(
            purpose="All points as a table for other programs.",
            command="klack export RESULT --to csv --out tables",
        ),
    ]


def _answer(
    record: StudyRecord,
    varying: list[StudyColumn],
    related: dict[str, dict[str, float]],
    labels: dict[str, str],
) -> str:
    found = [f"{count(record.count)} points of {len(varying)} parameters."]
    for item in record.measures:
        known = item.values[np.isfinite(item.values)]
        if not known.size:
            continue
        name = labels[item.name]
        text = f"{name[0].upper()}{name[1:]}: {on_page(item, known.min())} to "
        text += on_page(item, known.max())
        if np.isfinite(item.today):
            text += f" (today {on_page(item, item.today)})"
        best = max(related.get(item.name, {}).items(), key=lambda two: abs(two[1]), default=None)
        if best is not None and abs(best[1]) > 0.5:
            way = "rises" if best[1] > 0 else "falls"
            text += f"; {way} with {labels[best[0]]}"
        found.append(text + ".")
    failed = int(record.failed.sum())
    if failed:
        found.append(f"{count(failed)} points could not be computed.")
    return " ".join(found)


def _best_answer(record: StudyRecord, labels: dict[str, str]) -> str:
    found = record.optimum
    if found is None or found.best < 0:
        return ""
    parts = []
    for item in record.measures:
        value = float(item.values[found.best])
        apart = change(item, value)
        text = f"{labels[item.name]} {on_page(item, value)}"
        parts.append(text if apart == "–" else f"{text} ({apart.replace('-', chr(8722))})")
    several = len(found.objectives) > 1
    chosen = f", the compromise of {count(found.front.size)} on the front" if several else ""
    start = f"Of {count(record.count)} points, point {found.best}{chosen}"
    if not found.feasible:
        start = f"No point meets all bounds. Of {count(record.count)} points the closest to them is"
        start += f" point {found.best}"
    return f"{start}: {', '.join(parts)}. In brackets: against today's case."


def _optimum_sections(record: StudyRecord, labels: dict[str, str]) -> tuple[Section, ...]:
    found = record.optimum
    if found is None or found.best < 0:
        return ()
    best = found.best
    rows = [
        (item.name, on_page(item, item.today), on_page(item, value), typeset(change(item, value)))
        for item in record.designed
        for value in [float(item.values[best])]
    ]
    told = [f"Bounds: {'; '.join(found.bounds)}." if found.bounds else "No bounds."]
    listed = spread_over(found.front, _OF_FRONT)
    front = Table(
        columns=("point", *(labels[name] for name in found.objectives), "parameters"),
        rows=tuple(_front_row(record, int(i), labels) for i in listed),
    )
    left: tuple[str, ...] = ()
    if listed.size < found.front.size:
        left = (
            f"{count(listed.size)} of the {count(found.front.size)} points of the front, evenly "
            "spread over their order by the first objective; the chart and the exported table have "
            "all of them.",
        )
    return (
        Section(
            title="The recommended point and today's case",
            paragraphs=tuple(told),
            tables=(Table(columns=("", "today", f"point {best}", "change"), rows=tuple(rows)),),
        ),
        Section(
            title="Front",
            charts=front_charts(record, found, labels),
            paragraphs=left,
            tables=(front,),
        ),
        _listen(record, found, labels),
    )


def _listen(record: StudyRecord, found: Optimum, labels: dict[str, str]) -> Section:
    if not record.sounds:
        return Section(title="Listen")
    scale = full_scale_of(*(item.pressure for item in record.sounds))
    players = []
    for item in record.sounds:
        title = "today" if item.point < 0 else f"point {item.point}"
        title += ", recommended" if item.point == found.best else ""
        values = []
        for name in found.objectives:
            of = record.measure(name)
            value = of.today if item.point < 0 else float(of.values[item.point])
            values.append(f"{labels[name]} {on_page(of, value)}")
        players.append(
            Sound(
                title=title,
                wav=wav_bytes(item.pressure, full_scale=scale),
                note=f"{', '.join(values)}.",
            )
        )
    return Section(
        title="Listen",
        paragraphs=(
            f"One click of each, all at one scale: {level_statement(scale)}. Points of the front "
            "are in the order of the first objective.",
        ),
        sounds=tuple(players),
    )


def _front_row(record: StudyRecord, place: int, labels: dict[str, str]) -> tuple[str, ...]:
    objectives = record.optimum.objectives if record.optimum else ()
    chosen = (record.measure(name) for name in objectives)
    values = (on_page(item, float(item.values[place])) for item in chosen)
    varied = (item for item in record.parameters if item.varies)
    words = (f"{labels[i.name]} {on_page(i, float(i.values[place]), 3)}" for i in varied)
    return (str(place), *values, ", ".join(words))


def _number_table(record: StudyRecord) -> Table:
    rows = []
    for item in record.measures:
        known = item.values[np.isfinite(item.values)]
        cells = ["–"] * 3
        if known.size:
            cells = [on_page(item, float(f(known))) for f in (np.min, np.median, np.max)]
        missing = record.count - known.size
        rows.append((item.name, on_page(item, item.today), *cells, count(missing)))
    return Table(
        columns=("", "today", "lowest", "median", "highest", "points without"), rows=tuple(rows)
    )


def _related_table(
    record: StudyRecord,
    varying: list[StudyColumn],
    related: dict[str, dict[str, float]],
    labels: dict[str, str],
) -> tuple[Table, ...]:
    known = [item for item in record.measures if related.get(item.name)]
    if not known or not varying:
        return ()
    rows = tuple(
        (labels[of.name], *(signed(related[item.name].get(of.name, nan), 2) for item in known))
        for of in varying
    )
    heads = ("rank correlation with", *(labels[item.name] for item in known))
    return (Table(columns=heads, rows=rows),)


def _missed_section(record: StudyRecord) -> Section:
    rows = tuple(missed_cells(item) for item in record.missed)
    return Section(
        title="Probability that a drawn valve misses a bound",
        tables=(Table(columns=MISSED_COLUMNS, rows=rows),) if rows else (),
    )


def _screening_section(record: StudyRecord, labels: dict[str, str]) -> Section:
    rows = [
        (labels[item.measure], labels[item.parameters[k]], *cells)
        for item in record.screenings
        for k in largest_first(item)
        for cells in [effect_cells(record.measure(item.measure), item, k, on_page)]
    ]
    return Section(
        title="How much each parameter changes",
        charts=tuple(
            effect_bars(record.measure(item.measure), item, labels)
            for item in record.screenings
            if np.isfinite(item.size).any()
        ),
        tables=(Table(columns=("measure", *EFFECT_COLUMNS), rows=tuple(rows)),) if rows else (),
    )


def _sensitivity_section(record: StudyRecord, labels: dict[str, str]) -> Section:
    known = [item for item in record.sensitivities if np.isfinite(item.total).any()]
    told = [
        f"{labels[item.measure]}: {item.reason}." for item in record.sensitivities if item.reason
    ]
    if any(item.rows < _MANY_ROWS for item in known):
        told.append(
            f"Fewer than {_MANY_ROWS} base points: intervals of single indices may be much too "
            "narrow."
        )
    told += [
        f"{labels[item.measure]}: {count(item.discarded)} base points were left out, because one "
        "of their points has no value: the shares refer to the rest."
        for item in record.sensitivities
        if item.discarded
    ]
    return Section(
        title="Which parameter causes the scatter",
        paragraphs=tuple(told),
        charts=tuple(sensitivity_bars(item, labels) for item in known),
        tables=_share_tables(known, labels),
    )


def _share_tables(
    items: Sequence[Sensitivity | StudySurrogate], labels: dict[str, str]
) -> tuple[Table, ...]:
    rows = tuple(
        (labels[item.measure], labels[name], *index_cells(item, k))
        for item in items
        for k, name in enumerate(item.parameters)
    )
    heads = ("measure", "parameter", *SHARE_COLUMNS)
    return (Table(columns=heads, rows=rows),) if rows else ()


def _surrogate_sections(record: StudyRecord, labels: dict[str, str]) -> tuple[Section, ...]:
    if not record.surrogates:
        return ()
    used = [item for item in record.surrogates if not item.reason]
    told = [
        "Each point is predicted from the others. Q2 is 1 for a perfect prediction and 0 for one "
        "that is no better than the mean of all points; errors are in the unit of the measure.",
        "No computed point is replaced: tables, bounds and fronts contain only computed points.",
        *(
            f"Nothing is derived from the surrogate of {labels[item.measure]}: {item.reason}."
            for item in record.surrogates
            if item.reason
        ),
    ]
    found = [
        Section(
            title="Surrogates: accuracy of their predictions",
            paragraphs=tuple(told),
            tables=(
                Table(
                    columns=SURROGATE_COLUMNS,
                    rows=tuple(
                        (
                            labels[item.measure],
                            *surrogate_cells(record.measure(item.measure), item, on_page),
                        )
                        for item in record.surrogates
                    ),
                ),
            ),
        )
    ]
    if used:
        found.append(
            Section(
                title="Surrogates: which parameter causes the scatter",
                charts=tuple(surrogate_bars(item, labels) for item in used),
                tables=_share_tables(used, labels),
            )
        )
        found.append(
            Section(
                title="Surrogates: main effects",
                charts=tuple(
                    chart for item in used for chart in main_effect_charts(record, item, labels)
                ),
                tables=_word_effects(record, used, labels),
            )
        )
    return tuple(found)


def _word_effects(
    record: StudyRecord, used: list[StudySurrogate], labels: dict[str, str]
) -> tuple[Table, ...]:
    rows = tuple(
        (
            labels[item.measure],
            labels[of.parameter],
            word,
            on_page(record.measure(item.measure), float(mean)),
        )
        for item in used
        for of in item.effects
        for word, mean in zip(of.words, of.mean, strict=False)
    )
    return (Table(columns=("measure", "parameter", "value", "mean"), rows=rows),) if rows else ()


def _point_tables(record: StudyRecord, labels: dict[str, str]) -> tuple[Table, ...]:
    """The points, their remarks as letters; below them each remark once."""
    shown = [item for item in record.columns if item.varies]
    points = range(min(record.count, _LISTED))
    failed = [record.failures[i].partition("\n")[0] for i in points]
    remarks = [[failed[i]] if failed[i] else _notes(record.notes[i]) for i in points]
    kinds = alike(remarks)
    letters = {kind: chr(ord("a") + k % 26) * (1 + k // 26) for k, kind in enumerate(kinds)}
    rows = []
    for i in points:
        cells = [on_page(item, float(item.values[i])) for item in shown]
        marks = ", ".join(dict.fromkeys(letters[numberless(text)] for text in remarks[i]))
        rows.append((str(i), *cells, f"failed: {marks}" if failed[i] else marks))
    columns = ("point", *(labels[item.name] for item in shown), "remark")
    last = None if kinds else -1
    found = [Table(columns=columns[:last], rows=tuple(row[:last] for row in rows))]
    if kinds:
        texts = []
        for kind, notes in kinds.items():
            note, times = notes.most_common(1)[0]
            same = f", {times} with these numbers" if len(notes) > 1 else ""
            texts.append((letters[kind], f"{notes.total()}{same}", note))
        found.append(Table(columns=("remark", "points", "text"), rows=tuple(texts)))
    return tuple(found)


def _notes(text: str) -> list[str]:
    """Notes of a point, each with its advice."""
    return re.split(r"\n(?!Try: )", text) if text else []


def _left(record: StudyRecord) -> tuple[str, ...]:
    text = [f"Model: {record.model}."] if record.model else []
    text += [*steps_texts(record), rate_text(record)]
    if record.count > _LISTED:
        text.append(
            f"The first {_LISTED} of {count(record.count)}; klack export writes all of them as CSV."
        )
    return tuple(text)


_DEFINITIONS: tuple[tuple[str, str], ...] = (
    ("today", "The case without changes, computed with the same measures."),
    (
        "rank correlation",
        "Spearman's coefficient: +1 if one always rises with the other, -1 if it always falls, "
        "near 0 if neither; a curve with a minimum within the range also has a small "
        "coefficient.",
    ),
    (
        "effect of a parameter",
        "Change of a measure when one parameter moves by half its range, extrapolated to the "
        "whole range by a straight line (Morris 1991). Size is the mean without signs "
        "(Campolongo et al. 2007). A scatter as large as the size indicates curvature and "
        "interactions.",
    ),
    (
        "probability of a missed bound",
        "Share of the drawn points that miss a bound; interval of Clopper and Pearson (1934) "
        "for independent draws. If none misses it, the one-sided bound of 95 %. Points without "
        "a value widen the interval: all of them may miss it, or none.",
    ),
    (
        "front",
        "Points that no other computed point improves in every objective at once; points that "
        "miss a bound are dominated by all points that meet the bounds (Deb's rule).",
    ),
    (
        "recommended point",
        "The point of the front nearest to the best value of every objective, scaled by the "
        "ranges of the front (Yu 1973). Another weighting of the objectives gives another point "
        "of the front.",
    ),
    (
        "shares of the variance",
        "Sobol's indices (I. M. Sobol 1993; A. Saltelli et al. 2010): the share of the variance "
        "of a measure over the given ranges that a parameter causes by itself, and the share "
        "that remains if all other parameters are fixed. The difference is its effect in "
        "interaction with others. Intervals cover 95 %, from resampling of the base points.",
    ),
    (
        "surrogate",
        "A function of the parameters, fitted to the computed points of one measure: polynomial "
        "chaos (Blatman and Sudret 2011) or Gaussian process (Rasmussen and Williams 2006). Its "
        "leave-one-out error is the error at each point, predicted by a fit to all others. "
        "Below Q2 = 0.9, or with too few points, nothing is derived from it. Intervals of its "
        "shares are the largest change that an error of this root mean square can cause.",
    ),
    (
        "main effect",
        "Mean of the surrogate over the distributions of all parameters except one.",
    ),
)

_OF_STROKES = (
    "Bounces",
    "After some bounces a stroke is chaotic: measures of late impacts scatter from point to "
    "point by more than their parameters explain.",
)
_OF_IMPACTS = (
    "One level",
    "All points are computed at one level, with the mesh of their case. A level in doubt, a "
    "coarse mesh and an error estimated above 2 % are noted at the points concerned.",
)
_LIMITS: tuple[tuple[str, str], ...] = (
    (
        "Points",
        "Nothing was computed between the points: a minimum of the table is the best of these "
        "points, not of the range. A surrogate gives an estimate there, with its error.",
    ),
)
