"""Common parts of reports."""

import csv
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime
from io import StringIO
from pathlib import Path
from xml.etree import ElementTree

from klack.analyses.record import Record
from klack.files.whole import whole_file
from klack.report.page import Content, NextStep, Picture, Section, Table
from klack.report.wording import own_code, quantity

__all__ = ["page_of", "schematic_section", "stage_table", "write_table"]


def page_of(
    record: Record,
    kind: str,
    *,
    subtitle: Iterable[str] = (),
    answer: str,
    numbers: Table,
    sections: Iterable[Section],
    definitions: tuple[tuple[str, str], ...],
    limits: tuple[tuple[str, str], ...],
    next_steps: Iterable[NextStep] = (),
) -> Content:
    """Put the sections of a record between its title and its versions; empty ones are left out.

    Parameters
    ----------
    kind
        What was computed.
    subtitle
        Before date and version.
    answer
        One paragraph.
    definitions, limits
        Terms and texts.
    """
    made = f"klack {record.version}"
    heading = (kind, f"case {record.case}", *subtitle, _date_text(record.created), made)
    libraries = [f"{name} {version}" for name, version in record.versions.items()]
    computing = stage_table(record.stage_times, record.wall_time)
    every = (*sections, Section(title="Computing time", tables=(computing,)))
    return Content(
        title=record.title or record.case,
        subtitle=" · ".join(heading),
        description=record.description,
        answer=answer,
        numbers=numbers,
        warnings=record.warnings,
        sections=tuple(
            section
            for section in every
            if section.paragraphs
            or section.picture
            or section.charts
            or section.tables
            or section.sounds
        ),
        definitions=definitions,
        limits=limits,
        case_text=record.case_text,
        versions=", ".join([made, *libraries, *own_code(record.own_components)]),
        next_steps=tuple(next_steps),
    ).spelled()


def stage_table(stage_times: Mapping[str, float], wall_time: float) -> Table:
    """Wall time of every stage and of the whole."""
    rows = [(name, quantity(value, "s", 3)) for name, value in stage_times.items()]
    rows.append(("whole study", quantity(wall_time, "s", 3)))
    return Table(columns=("stage", "time"), rows=tuple(rows))


def write_table(file: Path, rows: Iterable[Sequence[str]]) -> None:
    """Write rows of text as CSV, heads first."""
    text = StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    with whole_file(file) as part:
        part.write_text(text.getvalue(), encoding="utf-8", newline="")


def _date_text(created: str) -> str:
    """``2025-01-31T12:00:00+00:00`` as ``2025-01-31 12:00 UTC``; other text unchanged."""
    try:
        moment = datetime.fromisoformat(created)
    except ValueError:
        return created
    return f"{moment:%Y-%m-%d %H:%M} {moment.tzname() or ''}".strip()


_NOTE = (
    "The network of the case: chambers, restrictions and lines of the fluid on the left, bodies "
    "in the middle, springs, forces and stops on the right, magnets and drivers next to them. "
    "(0) is the state at the start. A dashed ring is a port in no connection."
)
_TITLE = "Schematic"


def schematic_section(picture: str) -> Section:
    """Stored schematic; empty for results of an earlier klack."""
    if not picture:
        return Section(title=_TITLE)
    try:
        ElementTree.fromstring(picture)
    except ElementTree.ParseError:
        text = "The picture in this result is damaged; klack show draws it again from the case."
        return Section(title=_TITLE, paragraphs=(text,))
    return Section(title=_TITLE, picture=Picture(picture.encode(), _NOTE), wide=True)
