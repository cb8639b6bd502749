"""How every command ends that asks for an analysis: result, report, tables, JSON, exit."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO, TypeVar

from klack.analyses.result_folder import REPORTS, write_result
from klack.progress import Progress
from klack.terminal.notes import print_notes
from klack.terminal.options import require_threads
from klack.terminal.output import require_folder, require_json_target, write_json
from klack.terminal.progress import show_progress
from klack.terminal.tables import print_table

if TYPE_CHECKING:
    from klack.analyses.analysis import Analysis, StoredAnalysis
    from klack.analyses.record import AnyRecord
    from klack.analyses.unfinished import LogForm

__all__ = ["Ending", "Wanted"]

Kept = TypeVar("Kept")
Stored = TypeVar("Stored", bound="AnyRecord")


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What the user wants to see of a record; targets are checked before the long work begins.

    Parameters
    ----------
    json : Path or None
        Where the numbers go; ``-`` is the standard output.
    quiet : bool
        Neither progress nor tables: notes only.
    threads : int or None
        Cores that may compute.

    Raises
    ------
    InputError
        If the target cannot be written, or the cores cannot be.
    """

    json: Path | None
    quiet: bool
    threads: int | None = None

    def __post_init__(self) -> None:
        """Check what was asked for."""
        require_json_target(self.json)
        require_threads(self.threads)

    @property
    def _to_stderr(self) -> bool:
        return self.quiet or str(self.json) == "-"

    @property
    def _stream(self) -> TextIO:
        return sys.stderr if self._to_stderr else sys.stdout

    def into(self, folder: Path | None, name: str = "", *, report: bool) -> "Ending":
        """The ending of an analysis that is stored, in a folder of that name without another."""
        return Ending(
            json=self.json,
            quiet=self.quiet,
            threads=self.threads,
            folder=Path("klack-results") / name if folder is None else folder,
            report=report,
        )

    def say(self, text: str) -> None:
        """Print a line, unless it shall be quiet."""
        if not self.quiet:
            print(text, file=self._stream)

    def note(self, notes: Iterable[str]) -> None:
        """Print what makes a result doubtful, also where it shall be quiet."""
        print_notes(notes, to_stderr=self._to_stderr)

    def tell(self, analysis: "Analysis[Kept]", record: Kept) -> None:
        """Print tables, lines and notes of a record."""
        from klack.analyses.analysis import Notes

        for item in analysis.told(record):
            if isinstance(item, Notes):
                self.note(item.notes)
            elif isinstance(item, str):
                self.say(item)
            elif not self.quiet:
                print_table(
                    item.title,
                    item.columns,
                    item.rows,
                    left=item.left,
                    to_stderr=self._to_stderr,
                )

    def write(self, analysis: "Analysis[Kept]", record: Kept) -> None:
        """Write the numbers of a record, if they were asked for."""
        if self.json is not None:
            write_json(self.json, analysis.to_json(record))


@dataclass(frozen=True, kw_only=True)
class Ending(Wanted):
    """What the user wants of a record that is stored.

    Parameters
    ----------
    folder : Path
    report : bool
        Whether pages are written.
    """

    folder: Path
    report: bool

    def __post_init__(self) -> None:
        """Check the folder; the rest was checked before."""
        require_folder(self.folder)

    @contextmanager
    def resumable(self, log: "LogForm[Any, Any]") -> Iterator[Progress]:
        """Show progress; who stops it hears what is kept."""
        with show_progress(self.quiet) as progress:
            try:
                yield progress
            except KeyboardInterrupt as stop:
                kept = f"{log.count(self.folder)} {log.parts} are kept in {self.folder / log.file}"
                stop.add_note(f"{kept}, the same command resumes.")
                raise

    def end(
        self,
        analysis: "StoredAnalysis[Stored]",
        record: Stored,
        *,
        beside: Callable[[Path], tuple[str, ...]] | None = None,
        unfinished: "LogForm[Any, Any] | None" = None,
        incomplete: Exception | None = None,
    ) -> int:
        """Write and tell a record; return the exit code.

        Parameters
        ----------
        analysis : StoredAnalysis
        record : Record
        beside : callable, optional
            Writes further files into a folder, and returns their names.
        unfinished : LogForm, optional
            Finished parts that are not needed any more once the result stands.
        incomplete : Exception, optional
            Raised at the end: why the record is not all that was asked for.
        """
        from klack.stages import stages_with_cached

        names: list[str] = []

        def save(stage: Path) -> None:
            analysis.save(record, stage)
            if beside is not None:
                names.extend(beside(stage))

        with show_progress(self.quiet) as progress:
            failure = write_result(
                self.folder,
                save,
                page=(lambda: analysis.content(record)) if self.report else None,
                progress=progress,
                unfinished=unfinished,
            )
        self.tell(analysis, record)
        self.note(record.warnings)
        if cached := stages_with_cached(record.stage_times):
            self.say(f"With cached results (klack cache): {', '.join(cached)}")
        made = ["result.zarr", *names, *(REPORTS if self.report and failure is None else ())]
        self.say(f"Results in {self.folder}: {', '.join(made)}")
        self.write(analysis, record)
        if error := incomplete or failure:
            raise error
        return 0
