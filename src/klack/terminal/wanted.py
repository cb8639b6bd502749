"""What the user wants of a command: how much on the terminal, what as JSON, where the results."""

import sys
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TextIO

from cyclopts import Parameter

from klack.terminal.options import Json, Out, Quiet, Report, Threads, require_threads
from klack.terminal.output import require_json_target, write_json
from klack.terminal.tables import Notes, TextTable, print_table

__all__ = [
    "SHOWN",
    "WANTED",
    "WANTED_RESULT",
    "Shown",
    "Wanted",
    "WantedResult",
]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Shown:
    """Options ``--json`` and ``--quiet``; the target is checked before the long work begins.

    Raises
    ------
    InputError
        If the target cannot be written.
    """

    json: Json = None
    quiet: Quiet = False

    def __post_init__(self) -> None:
        """Check what was asked for."""
        require_json_target(self.json)

    @property
    def to_stderr(self) -> bool:
        """Whether the standard output belongs to JSON, or to nobody."""
        return self.quiet or str(self.json) == "-"

    @property
    def _stream(self) -> TextIO:
        return sys.stderr if self.to_stderr else sys.stdout

    def say(self, text: str) -> None:
        """Print a line, unless it shall be quiet."""
        if not self.quiet:
            print(text, file=self._stream)

    def note(self, notes: Iterable[str]) -> None:
        """Print what makes a result doubtful or incomplete, also where it shall be quiet."""
        for note in notes:
            print(f"Note: {note}", file=self._stream)

    def warn(self, notes: Iterable[str]) -> None:
        """Print notes on what a command goes on with, apart from what it says itself."""
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
    """Options of every command that leaves a result with a report."""

    report: Report = True
    out: Out = None


SHOWN, WANTED, WANTED_RESULT = Shown(), Wanted(), WantedResult()
"""Where no option says otherwise."""
