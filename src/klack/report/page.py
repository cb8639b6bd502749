"""Content of a report before its layout: the same texts for screen and paper.

Each renderer escapes this plain text in its own way, because titles, names and the text of the case
come from the user.
"""

import re
import shlex
from dataclasses import dataclass, replace
from typing import Self

from klack.report.chart import AnyChart
from klack.report.one_unit import in_one_unit
from klack.report.wording import spelled

__all__ = ["Content", "NextStep", "Picture", "Section", "Sound", "Table"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """Header and rows of text; the first column names the row.

    What follows a line break in a cell is printed smaller.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    def spelled(self) -> Self:
        """The same with one unit per column, and units and powers as pages spell them."""
        rows = tuple(tuple(map(spelled, row)) for row in in_one_unit(self.rows))
        return replace(self, columns=tuple(map(spelled, self.columns)), rows=rows)


@dataclass(frozen=True, slots=True)
class Picture:
    """Image (SVG) and its caption."""

    image: bytes
    note: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Sound:
    """Sound (WAV; empty if too long for a page) and its caption."""

    title: str
    wav: bytes
    note: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """A heading with what belongs under it.

    A ``wide`` picture keeps its size on the screen, and has its own page at the end of the paper,
    in landscape if it is wider than high.
    """

    title: str
    paragraphs: tuple[str, ...] = ()
    sounds: tuple[Sound, ...] = ()
    picture: Picture | None = None
    wide: bool = False
    charts: tuple[AnyChart, ...] = ()
    tables: tuple[Table, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class NextStep:
    """What can be done with a result next: why, and the command.

    In the command ``RESULT`` stands for the folder of the result and ``CASE`` for what it was
    computed from; :meth:`Content.placed` writes them.
    """

    purpose: str
    command: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    """All of a report.

    Parameters
    ----------
    numbers
        The key numbers per level.
    definitions, limits : tuple of (term, text)
    """

    title: str
    subtitle: str
    description: str
    answer: str
    numbers: Table
    warnings: tuple[str, ...]
    sections: tuple[Section, ...]
    definitions: tuple[tuple[str, str], ...]
    limits: tuple[tuple[str, str], ...]
    case_text: str
    versions: str
    next_steps: tuple[NextStep, ...] = ()

    def spelled(self) -> Self:
        """The same with units and powers as pages spell them; the case stays as it is written."""

        def terms(items: tuple[tuple[str, str], ...]) -> tuple[tuple[str, str], ...]:
            return tuple((term, spelled(text)) for term, text in items)

        sections = tuple(
            replace(
                section,
                paragraphs=tuple(map(spelled, section.paragraphs)),
                charts=tuple(replace(c, note=spelled(c.note)) for c in section.charts),
                tables=tuple(table.spelled() for table in section.tables),
            )
            for section in self.sections
        )
        return replace(
            self,
            answer=spelled(self.answer),
            numbers=self.numbers.spelled(),
            warnings=tuple(map(spelled, self.warnings)),
            sections=sections,
            definitions=terms(self.definitions),
            limits=terms(self.limits),
        )

    def placed(self, *, result: str = "", case: str = "") -> Self:
        """Write folder and case, as typed at a terminal, into the next steps.

        Steps that need one that is not known (empty) are left out.
        """
        known = {"RESULT": result, "CASE": case}

        def command(step: NextStep) -> str:
            return re.sub("RESULT|CASE", lambda word: shlex.quote(known[word[0]]), step.command)

        steps = tuple(
            replace(step, command=command(step))
            for step in self.next_steps
            if all(known[word] for word in re.findall("RESULT|CASE", step.command))
        )
        return replace(self, next_steps=steps)
