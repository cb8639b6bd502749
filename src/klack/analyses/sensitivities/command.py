"""Command ``klack sensitivities``."""

from typing import Annotated

from cyclopts import Parameter

from klack.analyses.ending import Ending
from klack.terminal.options import (
    WANTED_RESULT,
    CaseArgument,
    Components,
    StudyPath,
    WantedResult,
    imported,
    require_files,
)
from klack.terminal.progress import show_progress

__all__ = ["sensitivities"]

_Names = Annotated[
    list[str] | None,
    Parameter(
        name="--parameter",
        consume_multiple=True,
        negative="",
        help="Keys of the case, network.components.spring.preload, or parameters of the study. "
        "[default: as in the study]",
    ),
]
_Measures = Annotated[
    list[str] | None,
    Parameter(
        name="--measure",
        consume_multiple=True,
        negative="",
        help="closing_time, seat.peak_force, ... [default: as in the study, or the main ones]",
    ),
]
_Variant = Annotated[
    str | None, Parameter(name="--variant", help="Variant of the stroke. [default: the first one]")
]
_Level = Annotated[
    str | None, Parameter(name="--level", help="Level of an impact. [default: reduced]")
]
_Check = Annotated[
    bool, Parameter(name="--check", help="Compare with strokes with all parameters changed by 1 %.")
]


def sensitivities(
    case: CaseArgument,
    /,
    *,
    study: StudyPath = None,
    parameter: _Names = None,
    measure: _Measures = None,
    variant: _Variant = None,
    level: _Level = None,
    check: _Check = True,
    component: Components = None,
    wanted: WantedResult = WANTED_RESULT,
) -> int:
    """Derivatives by parameters: of a stroke with exact tangents, of an impact with differences."""
    if study is not None:
        require_files("--study", [study])

    with show_progress(wanted.quiet):
        from klack.case.any_case import read_case_tree
        from klack.case.study_source import study_if_any

        tree = read_case_tree(case, imported(component))
        checked = tree.any_case()
        source = study_if_any(checked, tree, study)

        from klack.analyses.sensitivities.analysis import SENSITIVITIES
        from klack.analyses.sensitivities.differences import sensitivities_of
        from klack.case.valve import ValveCase
        from klack.machine.compiling.ahead import compiling_ahead

    ending = Ending.of(wanted, f"{checked.name}-sensitivities")
    # derivatives are compiled here, what the check of a stroke needs beside them
    ahead = ("loop",) if isinstance(checked, ValveCase) else ("levels",)
    with show_progress(wanted.quiet) as progress, compiling_ahead(ahead, wanted.threads):
        record = sensitivities_of(checked, variant, level)(
            checked,
            tree,
            source,
            parameters=parameter or (),
            measures=measure or (),
            check=check,
            threads=wanted.threads,
            progress=progress,
        )
    return ending.end(SENSITIVITIES, record)
