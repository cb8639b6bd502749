"""Options that several commands share."""

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

from cyclopts import Parameter

from klack.errors import refuse_if, require_positive
from klack.terminal.output import require_json_target, write_json
from klack.terminal.tables import Notes, TextTable, print_table

if TYPE_CHECKING:
    from klack.network.component import Component

__all__ = [
    "SHOWN",
    "WANTED",
    "WANTED_RESULT",
    "CaseArgument",
    "CheckSteps",
    "Components",
    "Json",
    "Levels",
    "Out",
    "Shown",
    "StudyPath",
    "Wanted",
    "WantedResult",
    "imported",
    "require_files",
]


CaseArgument = Annotated[
    Path, Parameter(name="CASE", help="Case file (YAML), or the name of a shipped case.")
]
Json = Annotated[
    Path | None,
    Parameter(
        name="--json",
        allow_leading_hyphen=True,
        help="Write plain numbers in SI to this file; - for the terminal.",
    ),
]
Out = Annotated[
    Path | None,
    Parameter(name="--out", help="Folder for the results. [default: klack-results/NAME]"),
]
Report = Annotated[bool, Parameter(help="Write report.html and report.pdf.")]
Quiet = Annotated[
    bool, Parameter(name=["--quiet", "-q"], negative="", help="Print no progress and no tables.")
]
Threads = Annotated[
    int | None, Parameter(name="--threads", help="Processor cores to use. [default: all]")
]
StudyPath = Annotated[
    Path | None,
    Parameter(
        name="--study", help="File with a section 'study'. [default: the section of the case]"
    ),
]
CheckSteps = Annotated[
    bool | None,
    Parameter(
        name="--check-steps",
        help="Repeat every stroke with steps twice as long, and halve the steps where its first "
        "impacts change by more than half the promised accuracy. [default: as in the case, "
        "else yes; a search checks only its front; in three dimensions the two runs are "
        "only compared]",
    ),
]
Components = Annotated[
    list[str] | None,
    Parameter(
        name="--component",
        negative="",
        help="Class of your own, package.module:Class, that the case may name as a type; its "
        "module is executed. Repeat the option for several classes.",
    ),
]
Levels = Annotated[
    list[str] | None,
    Parameter(
        name="--level",
        consume_multiple=True,
        negative="",
        help="lumped, reduced, reduced-attachment, reduced-none, reduced-participation, "
        "interface, full; several (a,b,c) are compared. [default: as in the case]",
    ),
]


def imported(words: Sequence[str] | None) -> "tuple[type[Component], ...]":
    """Classes that the user named by ``--component``."""
    if not words:
        return ()

    from klack.network.catalogue import import_component

    return tuple(import_component(word) for word in words)


def require_threads(threads: int | None) -> None:
    """Refuse an impossible number of cores."""
    if threads is not None:
        require_positive("--threads", threads, "cores")


def require_files(option: str, files: Sequence[Path]) -> None:
    """Refuse missing files before the long work begins."""
    for file in files:
        refuse_if(
            not file.is_file(),
            f"{option} {file}",
            got="a folder" if file.is_dir() else "no such file",
            expected="a file",
            hint="check the spelling; the path is relative to the current folder.",
        )


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Shown:
    """Options ``--json`` and ``--quiet``; the target must be writable."""

    json: Json = None
    quiet: Quiet = False

    def __post_init__(self) -> None:
        """Check what was asked for."""
        require_json_target(self.json)

    @property
    def to_stderr(self) -> bool:
        """Whether the standard output is for JSON, or unused."""
        return self.quiet or str(self.json) == "-"

    @property
    def _stream(self) -> TextIO:
        return sys.stderr if self.to_stderr else sys.stdout

    def say(self, text: str) -> None:
        """Print a line, unless it shall be quiet."""
        if not self.quiet:
            print(text, file=self._stream)

    def note(self, notes: Iterable[str]) -> None:
        """Print doubts about a result, even when quiet."""
        for note in notes:
            print(f"Note: {note}", file=self._stream)

    def warn(self, notes: Iterable[str]) -> None:
        """Print notes on the input, apart from the output."""
        for note in notes:
            print(f"Note: {note}", file=sys.stderr)

    def show(self, items: Iterable[TextTable | Notes | str]) -> None:
        """Print tables, lines and notes."""
        for item in items:
            if isinstance(item, Notes):
                self.note(item.notes)
            elif isinstance(item, str):
                self.say(item)
            elif not self.quiet:
                print_table(
                    item.title, item.columns, item.rows, left=item.left, to_stderr=self.to_stderr
                )

    def write(self, numbers: Callable[[], Mapping[str, Any]]) -> None:
        """Write numbers as JSON, if they were asked for."""
        if self.json is not None:
            write_json(self.json, numbers())


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Wanted(Shown):
    """Options of every command that computes."""

    threads: Threads = None

    def __post_init__(self) -> None:
        """Check what was asked for."""
        super().__post_init__()
        require_threads(self.threads)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class WantedResult(Wanted):
    """Options of commands with a result and report."""

    report: Report = True
    out: Out = None


SHOWN, WANTED, WANTED_RESULT = Shown(), Wanted(), WantedResult()
"""Where no option says otherwise."""
