"""What the pages read of cases and results, in a process of its own."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from klack.acoustics.force_bands import force_bands
from klack.acoustics.signal_statistics import sound_statistics
from klack.acoustics.third_octave import ENERGY_REFERENCE
from klack.acoustics.wav import full_scale_of, level_statement, wav_bytes
from klack.analyses.catalogue import analysis_in
from klack.analyses.contact_doubts import MeshedContact, contact_doubt
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.noise.body import Transfers
from klack.analyses.noise.run import click_sound
from klack.analyses.noise.source import sources_of
from klack.analyses.stroke.record import StrokeStudy
from klack.analyses.study.point_case import case_of_point
from klack.analyses.study.record import StudyRecord
from klack.app.answers import (
    Answer,
    Checked,
    Curve,
    Number,
    ResultCard,
    StudyChoice,
    StudyOffer,
)
from klack.app.curves import drawn, enveloped, impact_numbers, stroke_numbers, travelled
from klack.app.form import checked_text, exchanged_text
from klack.app.study_points import StudyPoints, points_json
from klack.app.study_texts import study_offer, study_problem, study_text
from klack.errors import InputError, KlackError
from klack.input.problem import Key
from klack.signals import TimeSeries

__all__ = ["Reader"]

_MOST_NUMBERS = 5


class Reader:
    """Checks texts, tells cases and results in short, compares two results, reads studies."""

    def __init__(self) -> None:
        self._points = StudyPoints()

    def check(self, text: str, path: str, has_form: bool = True) -> Checked:
        """See :func:`klack.app.form.checked_text`."""
        return checked_text(text, path, has_form=has_form)

    def exchange(self, text: str, path: str, place: Key, written: str) -> str:
        """See :func:`klack.app.form.exchanged_text`."""
        return exchanged_text(text, path, place, written)

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
        """Refuse a result that has no points.

        Raises
        ------
        InputError
            For one of another command.
        """
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
        """Name and text of the case of a point, see :func:`case_of_point`."""
        return case_of_point(self._points.record(folder), point, Path(near), study)

    def study_of(self, folder: str) -> tuple[str, str]:
        """Name and text of the case that a study was made of."""
        record = self._points.record(folder)
        return record.case, record.case_text

    def study_problem(self, text: str, path: str, case_text: str, case_path: str) -> Checked:
        """See :func:`klack.app.study_texts.study_problem`."""
        return study_problem(text, path, case_text, case_path)

    def study_offer(self, text: str, path: str) -> StudyOffer:
        """See :func:`klack.app.study_texts.study_offer`."""
        return study_offer(text, path)

    def study_text(self, choice: StudyChoice, case_text: str, case_path: str) -> str:
        """See :func:`klack.app.study_texts.study_text`."""
        return study_text(choice, case_text, case_path)

    def compare(self, first: str, second: str) -> tuple[Answer, Answer]:
        """Two results of one kind, with their clicks to one full scale.

        Raises
        ------
        InputError
            For two that cannot be compared, told before they are read.
        """
        analyses = [analysis_in(Path(folder)) for folder in (first, second)]
        kinds = {analysis.form.kind for analysis in analyses}
        if len(kinds) != 1 or not kinds <= {ImpactStudy, StrokeStudy}:
            one, other = (analysis.form.command for analysis in analyses)
            raise InputError(
                "these two results cannot be compared",
                got=f"one of {one} and one of {other}",
                expected="two of klack impact, or two of klack stroke",
                hint="tick compare at two of one kind in the list of results.",
            )
        found = [
            _answer(analysis.load(Path(folder)))
            for analysis, folder in zip(analyses, (first, second), strict=True)
        ]
        pressures = [pressure for _, pressure in found]
        known = [pressure for pressure in pressures if pressure is not None]
        scale = full_scale_of(*known) if known else 1.0
        wavs = [b"" if p is None else wav_bytes(p, full_scale=scale) for p in pressures]
        answers = [
            _with_sound(answer, wav, wavs[0], level_statement(scale) if known else "")
            for (answer, _), wav in zip(found, wavs, strict=True)
        ]
        return answers[0], answers[1]


def _with_sound(answer: Answer, wav: bytes, ghost: bytes, scale: str) -> Answer:
    return replace(answer, wav=wav, ghost_wav=ghost, scale=scale)


def _doubts(record: Any) -> tuple[str, ...]:
    """Warnings of a record, and what speaks against its contacts."""
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


def _answer(record: ImpactStudy | StrokeStudy) -> tuple[Answer, TimeSeries | None]:
    """Curves, numbers and click of the answer of a result."""
    doubts = list(_doubts(record))
    pressure, bands, levels = None, np.zeros(0), np.zeros(0)
    try:
        source = sources_of(record)[0]
        pressure = click_sound(source, Transfers())
        found = [force_bands(stop.force) for stop in source.stops]
        bands = found[0].middle
        energy = np.sum([band.energy for band in found], axis=0)
        levels = 10.0 * np.log10(np.maximum(energy, 1e-30) / ENERGY_REFERENCE)
    except KlackError as error:
        doubts.append(f"No sound: {error}")
        source = None
    force: tuple[Curve, ...]
    lift: tuple[Curve, ...]
    if isinstance(record, ImpactStudy):
        history = record.levels[record.reference].history
        force = (Curve.scaled("contact force", *drawn(history.time, history.force), 1e6, 1.0),)
        lift = (Curve.scaled("needle", *drawn(*travelled(history)), 1e6, 1e6),)
        unit, run = "us", f"level {record.reference}"
    else:
        variant = record.reference
        run = f"variant {variant.name}"
        force = tuple(
            Curve.scaled(stop.name, *enveloped(stop.force), 1e3, 1.0)
            for stop in (source.stops if source is not None else ())
        )
        channel = variant.channel(record.channels.lift)
        lift = (
            ()
            if channel is None
            else (Curve.scaled("lift", *drawn(variant.result.time, channel.values), 1e3, 1e6),)
        )
        unit = "ms"
    level = (
        ()
        if pressure is None
        else (
            Number(
                key="level",
                name="sound exposure level",
                unit="dB(A)",
                value=sound_statistics(pressure).exposure_level_A,
                difference="dB",
            ),
        )
    )
    answer = Answer(
        force=force,
        lift=lift,
        time_unit=unit,
        bands=bands,
        levels=levels,
        numbers=(*_numbers(record), *level),
        doubts=tuple(doubts),
        run=run,
    )
    return answer, pressure
