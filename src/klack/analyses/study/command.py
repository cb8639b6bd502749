"""``klack study`` and ``klack optimise``: a valve at many points of its parameter space."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.analyses.ending import Ending
from klack.terminal.options import CaseArgument, Components, imported, require_files
from klack.terminal.wanted import WANTED_RESULT, WantedResult

if TYPE_CHECKING:
    from collections.abc import Callable

    from klack.analyses.study.record import StudyRecord

__all__ = ["optimise", "study"]

_File = Annotated[
    Path | None,
    Parameter(
        name="--study",
        help="File with a section 'study'. [default: that of the case]",
    ),
]


def study(
    case: CaseArgument,
    /,
    *,
    study: _File = None,
    component: Components = None,
    wanted: WantedResult = WANTED_RESULT,
) -> int:
    """Compute measures of a stroke at many points: ranges, designs, distributions of parameters."""
    from klack.analyses.study.run import run_study

    return _run(run_study, "study", case, study, component, wanted)


def optimise(
    case: CaseArgument,
    /,
    *,
    study: _File = None,
    component: Components = None,
    wanted: WantedResult = WANTED_RESULT,
) -> int:
    """Search the ranges of a study for the best points: one to four objectives, within bounds."""
    from klack.analyses.study.optimise import run_optimisation

    return _run(run_optimisation, "optimum", case, study, component, wanted)


def _run(
    run: "Callable[..., StudyRecord]",
    name: str,
    case: Path,
    file: Path | None,
    component: Components,
    wanted: WantedResult,
) -> int:
    if file is not None:
        require_files("--study", [file])

    from klack.analyses.study.analysis import STUDY
    from klack.analyses.study.log import point_log_form
    from klack.case.case_tree import read_case_tree
    from klack.case.shipped import find_case
    from klack.case.study_source import study_of

    tree = read_case_tree(find_case(case), imported(component))
    checked = tree.case()
    source = study_of(checked, tree, file)
    ending = Ending.of(wanted, f"{checked.name}-{name}")
    with ending.resumable(point_log_form(checked, tree)[0]) as progress:
        record = run(
            checked, tree, source, folder=ending.folder, threads=wanted.threads, progress=progress
        )
    return ending.end(STUDY, record)
