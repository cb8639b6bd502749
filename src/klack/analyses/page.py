"""Page of a record: the common parts of every report."""

from collections.abc import Iterable, Mapping
from datetime import datetime

from klack.analyses.record import AnyRecord
from klack.report.page import Content, NextStep, Section, Table
from klack.report.wording import own_code, quantity

__all__ = ["page_of", "stage_table"]


def page_of(
    record: AnyRecord,
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
    record : CaseRecord or the record of several cases
    kind : str
        What was computed.
    subtitle : iterable of str
        What else stands before date and version.
    answer : str
        In one paragraph.
    numbers : Table
        The key numbers.
    sections : iterable of Section
    definitions, limits : tuple of (term, text)
    next_steps : iterable of NextStep
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
        sections=tuple(section for section in every if _has_something(section)),
        definitions=definitions,
        limits=limits,
        case_text=record.case_text,
        versions=", ".join([made, *libraries, *own_code(record.own_components)]),
        next_steps=tuple(next_steps),
    )


def stage_table(stage_times: Mapping[str, float], wall_time: float) -> Table:
    """Wall time of every stage of a record, and of the whole."""
    rows = [(name, quantity(value, "s", 3)) for name, value in stage_times.items()]
    rows.append(("whole study", quantity(wall_time, "s", 3)))
    return Table(columns=("stage", "time"), rows=tuple(rows))


def _date_text(created: str) -> str:
    """``2025-01-31T12:00:00+00:00`` as ``2025-01-31 12:00 UTC``; other text as it came."""
    try:
        moment = datetime.fromisoformat(created)
    except ValueError:
        return created
    return f"{moment:%Y-%m-%d %H:%M} {moment.tzname() or ''}".strip()


def _has_something(section: Section) -> bool:
    return bool(
        section.paragraphs or section.picture or section.charts or section.tables or section.sounds
    )
