"""Commands ``klack study`` and ``klack optimise``."""

import os
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from klack.analyses.ending import Ending
from klack.analyses.named import named
from klack.errors import require_positive
from klack.terminal.options import (
    WANTED_RESULT,
    CaseArgument,
    CheckSteps,
    Components,
    StudyPath,
    WantedResult,
    imported,
    require_files,
)
from klack.terminal.progress import PROGRESS_FILE

if TYPE_CHECKING:
    from collections.abc import Iterator

    from klack.analyses.study.record import StudyRecord
    from klack.case.any_case import CaseTree
    from klack.machine.progress import Progress

__all__ = ["optimise", "study"]

_Made = Annotated[
    int | None,
    Parameter(
        help="Instead of the design of the study: this number of manufactured valves, the case "
        "with the scatter of its section 'robust'.",
    ),
]
_Workers = Annotated[
    int | None,
    Parameter(
        name="--workers",
        help="Number of processes; it does not affect the results. [default: threads; all cores "
        "for many impacts, measures of the noise, or several geometries]",
    ),
]
_Dask = Annotated[
    str | None,
    Parameter(
        name="--dask",
        help="Compute on a cluster: address of a Dask scheduler (tcp://host:8786), or its "
        "scheduler file.",
    ),
]


def study(
    case: CaseArgument,
    /,
    *,
    study: StudyPath = None,
    made: _Made = None,
    workers: _Workers = None,
    dask: _Dask = None,
    check_steps: CheckSteps = None,
    component: Components = None,
    wanted: WantedResult = WANTED_RESULT,
) -> int:
    """Compute measures of a stroke or an impact at many points: ranges, designs, tolerances."""
    tree = _tree(case, component, check_steps)
    return _run("study.run:run_study", "study", tree, study, wanted, workers, dask, made)


def optimise(
    case: CaseArgument,
    /,
    *,
    study: StudyPath = None,
    workers: _Workers = None,
    dask: _Dask = None,
    check_steps: CheckSteps = None,
    component: Components = None,
    wanted: WantedResult = WANTED_RESULT,
) -> int:
    """Search the ranges of a study for the best points: one to four objectives, within bounds."""
    tree = _tree(case, component, check_steps)
    words = (tree, study, wanted, workers, dask)
    return _run("study.optimise:run_optimisation", "optimum", *words, is_search=True)


def _tree(case: Path, component: Components, check_steps: bool | None) -> "CaseTree":
    from klack.case.any_case import read_case_tree, tree_of
    from klack.case.rewriting import with_values

    own = imported(component)
    tree = read_case_tree(case, own)
    if check_steps is None:
        return tree
    value = "true" if check_steps else "false"
    return tree_of(with_values(tree, {("run", "check_steps"): value}), tree.path, own)


@contextmanager
def _live(progress: "Progress") -> "Iterator[dict[str, Any]]":
    """Shows points so far to the program that started this process, if any."""
    file = os.environ.get(PROGRESS_FILE)
    if not file:
        yield {}
        return
    from klack.analyses.study.live import LIVE, LiveRecord

    live = LiveRecord(Path(file).parent / LIVE, progress)
    try:
        yield {"live": live.offer}
    except KeyboardInterrupt:
        live.write()
        raise


def _run(
    run: str,
    name: str,
    tree: "CaseTree",
    file: Path | None,
    wanted: WantedResult,
    workers: int | None,
    dask: str | None,
    made: int | None = None,
    is_search: bool = False,
) -> int:
    if workers is not None:
        require_positive("--workers", workers, "processes")
    if file is not None:
        require_files("--study", [file])

    from klack.case.study_source import study_of

    checked = tree.any_case()
    source = study_of(checked, tree, file)
    if made is not None:
        source, name = source.made(made), "made"
    ending = Ending.of(wanted, f"{checked.name}-{name}")

    from klack.analyses.study.analysis import STUDY
    from klack.analyses.study.evaluation import point_log_form
    from klack.analyses.study.where import Where

    where = Where(threads=wanted.threads, workers=workers, dask=dask, is_free=True)
    with ending.resumable(point_log_form(checked, tree)[0]) as progress, _live(progress) as seen:
        page = None
        if is_search and ending.report:
            from klack.analyses.study.live import ProgressPage

            page = ProgressPage(ending.folder, progress)
            seen["seen"] = page.write
        record: StudyRecord = named(run)(
            checked, tree, source, folder=ending.folder, where=where, progress=progress, **seen
        )
    code = ending.end(STUDY, record)
    if page is not None:
        page.remove()
    return code
