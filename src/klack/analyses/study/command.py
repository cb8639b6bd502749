"""``klack study``: the measures of a valve at many points of its parameter space."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from klack.analyses.ending import Ending
from klack.terminal.options import CaseArgument, Components, imported, require_files
from klack.terminal.wanted import WANTED_RESULT, WantedResult

__all__ = ["study"]

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
    if study is not None:
        require_files("--study", [study])

    from klack.analyses.study.analysis import STUDY
    from klack.analyses.study.log import point_log_form
    from klack.analyses.study.run import run_study
    from klack.case.case_tree import read_case_tree
    from klack.case.shipped import find_case
    from klack.case.study_source import study_of

    tree = read_case_tree(find_case(case), imported(component))
    checked = tree.case()
    source = study_of(checked, tree, study)
    ending = Ending.of(wanted, f"{checked.name}-study")
    with ending.resumable(point_log_form(checked, tree)[0]) as progress:
        record = run_study(
            checked,
            tree,
            source,
            folder=ending.folder,
            threads=wanted.threads,
            progress=progress,
        )
    return ending.end(STUDY, record)
