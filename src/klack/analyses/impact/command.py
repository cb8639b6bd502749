"""Command ``klack impact``."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from klack import __version__
from klack.analyses.ending import Ending
from klack.terminal.options import WANTED_RESULT, CaseArgument, Levels, WantedResult
from klack.terminal.progress import show_progress

__all__ = ["impact", "run_case"]


def impact(
    case: CaseArgument,
    /,
    *,
    level: Levels = None,
    certify: Annotated[
        bool,
        Parameter(
            help="Estimate the error of reduced levels by one run at the interface level, with "
            "twice as many modes."
        ),
    ] = True,
    wanted: WantedResult = WANTED_RESULT,
) -> int:
    """Compute one impact; several levels are compared with each other."""
    # both "--level a,b" and "--level a --level b"
    levels = [name for item in level or () for name in item.split(",") if name]
    run_case(case, levels, wanted, certify=certify)
    return 0


def run_case(case: Path, level: list[str], wanted: WantedResult, *, certify: bool = True) -> Path:
    """Run a case, write and print the results; return their folder."""
    from klack.case import load_case

    with show_progress(wanted.quiet):
        checked = load_case(case)
        levels = checked.require_levels(level if level else checked.run.levels)
        ending = Ending.of(wanted, checked.name, case=case)

        from klack.analyses.impact.analysis import IMPACT
        from klack.analyses.impact.run import run_impact
        from klack.analyses.impact.running_in import WORN, worn_text
        from klack.analyses.incomplete import IncompleteImpactError
        from klack.machine.compiling.ahead import compiling_ahead

    incomplete: Exception | None = None
    with show_progress(wanted.quiet) as progress, compiling_ahead(("levels",), wanted.threads):
        try:
            study = run_impact(
                checked, levels=levels, certify=certify, progress=progress, threads=wanted.threads
            )
        except IncompleteImpactError as error:
            study, incomplete = error.study, error

    def worn(stage: Path) -> tuple[str, ...]:
        found = study.running_in
        if found is None or checked.path is None or found.level != "reduced":
            return ()
        text = worn_text(checked.source, checked.path, found, ending.folder, __version__)
        (stage / WORN).write_text(text, "utf-8")
        return (WORN,)

    ending.end(IMPACT, study, incomplete=incomplete, beside=worn)
    return ending.folder
