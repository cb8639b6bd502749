"""Common ending of commands with a record: result, report, tables, JSON, exit."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from klack.cli.notes import print_notes
from klack.cli.output import require_folder, require_json_target, write_json
from klack.cli.progress import show_progress
from klack.cli.reports import REPORTS, write_result
from klack.cli.tables import print_table

if TYPE_CHECKING:
    from klack.analyses.analysis import Analysis
    from klack.analyses.record import AnyRecord
    from klack.analyses.unfinished import LogForm

__all__ = ["Ending"]

Kept = TypeVar("Kept", bound="AnyRecord")


@dataclass(frozen=True, slots=True, kw_only=True)
class Ending:
    """Requested outputs of a record.

    Parameters
    ----------
    folder : Path
    report : bool
        Whether pages are written.
    json : Path or None
        Where the numbers go; ``-`` is the standard output.
    quiet : bool
        Neither progress nor tables: notes only.
    """

    folder: Path
    report: bool
    json: Path | None
    quiet: bool

    def require_possible(self) -> None:
        """Refuse targets that cannot be written to, before the long work begins."""
        require_json_target(self.json)
        require_folder(self.folder)

    def end(
        self,
        analysis: "Analysis[Kept]",
        record: Kept,
        *,
        beside: Callable[[Path], tuple[str, ...]] | None = None,
        unfinished: "LogForm[Any, Any] | None" = None,
        incomplete: Exception | None = None,
    ) -> int:
        """Write and print a record; return the exit code.

        Parameters
        ----------
        analysis : Analysis
        record : Record
        beside : callable, optional
            Writes further files into a folder, and returns their names.
        unfinished : LogForm, optional
            Finished parts that are not needed any more once the result stands.
        incomplete : Exception, optional
            Raised at the end: why the record is not all that was asked for.
        """
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
        self._tell(analysis, record)
        if not self.quiet:
            made = ["result.zarr", *names, *(REPORTS if self.report and failure is None else ())]
            print(f"Results in {self.folder}: {', '.join(made)}", file=self._stream)
        if self.json is not None:
            write_json(self.json, analysis.to_json(record))
        if error := incomplete or failure:
            raise error
        return 0

    @property
    def _stream(self) -> Any:
        return sys.stderr if str(self.json) == "-" else sys.stdout

    def _tell(self, analysis: "Analysis[Kept]", record: Kept) -> None:
        from klack.analyses.analysis import Notes, TextTable
        from klack.stages import stages_with_cached

        to_stderr = self.quiet or str(self.json) == "-"
        for item in analysis.told(record):
            if isinstance(item, Notes):
                print_notes(item.notes, to_stderr=to_stderr)
            elif self.quiet:
                continue
            elif isinstance(item, TextTable):
                print_table(
                    item.title, item.columns, item.rows, left=item.left, to_stderr=to_stderr
                )
            else:
                print(item, file=self._stream)
        print_notes(record.warnings, to_stderr=to_stderr)
        cached = stages_with_cached(record.stage_times)
        if cached and not self.quiet:
            print(f"With cached results (klack cache): {', '.join(cached)}", file=self._stream)
