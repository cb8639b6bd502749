"""What pages read of cases and results, in its own process."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from klack.acoustics.force_bands import force_bands
from klack.acoustics.wav import full_scale_of, level_statement, wav_bytes
from klack.analyses.catalogue import analysis_in
from klack.analyses.contact_doubts import MeshedContact, contact_doubt
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.noise.body import Transfers
from klack.analyses.noise.run import click_sounds
from klack.analyses.noise.source import sources_of
from klack.analyses.stroke.record import StrokeStudy
from klack.analyses.study.point_case import case_of_point
from klack.analyses.study.record import StudyRecord
from klack.app.answers import (
    Answer,
    Number,
    ResultCard,
)
from klack.app.explorer import (
    Curves,
    force_levels,
    impact_curves,
    impact_numbers,
    level_numbers,
    stroke_curves,
    stroke_numbers,
)
from klack.app.network_view import added_component, catalogue, edited, network_view
from klack.app.study_points import StudyPoints, points_json
from klack.app.texts import (
    checked_text,
    differing_inputs,
    exchanged_text,
    is_read_text,
    study_offer,
    study_problem,
    study_text,
)
from klack.errors import InputError, KlackError
from klack.signals.sampled import TimeSeries

__all__ = ["Reader"]

_MOST_NUMBERS = 5


class Reader:
    """Checks texts, summarises cases and results, compares results, reads studies."""

    def __init__(self) -> None:
        self._points = StudyPoints()

    check = staticmethod(checked_text)
    exchange = staticmethod(exchanged_text)
    is_read = staticmethod(is_read_text)
    network = staticmethod(network_view)
    catalogue = staticmethod(catalogue)
    edited = staticmethod(edited)
    added = staticmethod(added_component)
    study_problem = staticmethod(study_problem)
    study_offer = staticmethod(study_offer)
    study_text = staticmethod(study_text)

    def card(self, folder: str) -> ResultCard:
        """A stored result in short.

        Raises
        ------
        InputError
            For a damaged one.
        """
        analysis = analysis_in(Path(folder))
        record = analysis.load(Path(folder))
        return ResultCard(
            command=analysis.form.command,
            title=getattr(record, "title", "") or getattr(record, "case", ""),
            case=getattr(record, "case", ""),
            created=str(getattr(record, "created", "")),
            numbers=_numbers(record)[:_MOST_NUMBERS],
            doubts=_doubts(record),
            compares=isinstance(record, ImpactStudy | StrokeStudy),
            has_points=isinstance(record, StudyRecord),
        )

    def require_study(self, folder: str) -> None:
        """Refuse a result that has no points."""
        form = analysis_in(Path(folder)).form
        if form.kind is not StudyRecord:
            raise InputError(
                f"result {folder}",
                got=f"a result of {form.command}",
                expected="one of klack study or klack optimise, which have points",
                hint="choose one with Points in the list of results.",
            )

    def points(self, folder: str) -> bytes:
        """See :func:`klack.app.study_points.points_json`."""
        return points_json(self._points.record(folder))

    def point_case(self, folder: str, point: int, near: str, study: str) -> tuple[str, str]:
        """Name and text of the case of a point."""
        return case_of_point(self._points.record(folder), point, Path(near), study)

    def study_of(self, folder: str) -> tuple[str, str]:
        """Name and text of the case of a study."""
        record = self._points.record(folder)
        return record.case, record.case_text

    def compare(self, first: str, second: str) -> tuple[Answer, Answer]:
        """Two results of one kind, with their clicks to one full scale.

        InputError for two that cannot be compared, before they are read.
        """
        analyses = [analysis_in(Path(folder)) for folder in (first, second)]
        kinds = {analysis.form.kind for analysis in analyses}
        if len(kinds) != 1 or not kinds <= {ImpactStudy, StrokeStudy}:
            kind, another = (analysis.form.command for analysis in analyses)
            raise InputError(
                "these two results cannot be compared",
                got=f"one of {kind} and one of {another}",
                expected="two of klack impact, or two of klack stroke",
                hint="tick compare at two of one kind in the list of results.",
            )
        records = [
            analysis.load(Path(folder))
            for analysis, folder in zip(analyses, (first, second), strict=True)
        ]
        found = [_answer(record) for record in records]
        known = [pressure for _, pressures in found for pressure in pressures.values()]
        scale = full_scale_of(*known) if known else 1.0
        words = level_statement(scale) if known else ""
        one, other = (
            replace(
                answer,
                ears=tuple(pressures),
                ear_wavs=tuple(wav_bytes(p, full_scale=scale) for p in pressures.values()),
                scale=words,
            )
            for answer, pressures in found
        )
        inputs = differing_inputs(*(record.case_text for record in records))
        return one, replace(other, inputs=inputs)


def _doubts(record: Any) -> tuple[str, ...]:
    contacts: Sequence[MeshedContact] = ()
    if isinstance(record, ImpactStudy):
        contacts = (record.contact,)
    elif isinstance(record, StrokeStudy):
        contacts = record.stops
    return (*getattr(record, "warnings", ()), *filter(None, map(contact_doubt, contacts)))


def _numbers(record: Any) -> tuple[Number, ...]:
    if isinstance(record, ImpactStudy):
        return impact_numbers(record.levels[record.reference])
    if isinstance(record, StrokeStudy):
        return stroke_numbers(record.reference, record.channels)
    if isinstance(record, StudyRecord):
        return (
            Number(key="points", name="points", unit="", value=record.count),
            Number(key="failed", name="failed", unit="", value=int(record.failed.sum())),
        )
    return ()


def _answer(record: ImpactStudy | StrokeStudy) -> tuple[Answer, dict[str, TimeSeries]]:
    doubts = list(_doubts(record))
    pressures: dict[str, TimeSeries] = {}
    bands, levels = np.zeros(0), np.zeros(0)
    try:
        source = sources_of(record)[0]
        pressures = click_sounds(source, Transfers())
        found = [force_bands(stop.force) for stop in source.stops]
        bands = found[0].middle
        levels = force_levels(found)
    except KlackError as error:
        doubts.append(f"No sound: {error}")
        source = None
    curves: Curves
    if isinstance(record, ImpactStudy):
        curves = impact_curves(record.levels[record.reference])
        unit, run = "us", f"level {record.reference}"
    else:
        stops = () if source is None else source.stops
        curves = stroke_curves(record.reference, record.channels, stops)
        unit, run = "ms", f"variant {record.reference.name}"
    answer = Answer(
        force=curves[0],
        lift=curves[1],
        time_unit=unit,
        bands=bands,
        levels=levels,
        numbers=(*_numbers(record), *level_numbers(next(iter(pressures.values()), None))),
        doubts=tuple(doubts),
        run=run,
    )
    return answer, pressures
