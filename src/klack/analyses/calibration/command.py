"""``klack calibrate``: fit chosen numbers of a valve to measured strokes."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from klack.analyses.ending import Wanted
from klack.terminal.options import (
    CaseArgument,
    Components,
    Json,
    Out,
    Quiet,
    Threads,
    imported,
    require_files,
)
from klack.terminal.progress import show_progress

__all__ = ["calibrate"]

_Files = Annotated[
    list[Path],
    Parameter(
        name="--measurement",
        negative="",
        help="Recording of strokes: CSV, MDF4, TDMS, UFF, HDF5, MATLAB; several times for several "
        "files.",
    ),
]
_Strokes = Annotated[
    int | None, Parameter(name="--strokes", help="Fit only the first so many strokes.")
]
_Workers = Annotated[
    int | None,
    Parameter(
        name="--workers", help="Processes; the numbers do not depend on it. [default: all cores]"
    ),
]


def calibrate(
    case: CaseArgument,
    /,
    *,
    measurement: _Files,
    strokes: _Strokes = None,
    workers: _Workers = None,
    component: Components = None,
    report: Annotated[bool, Parameter(help="Write report.html and report.pdf.")] = True,
    out: Out = None,
    json: Json = None,
    threads: Threads = None,
    quiet: Quiet = False,
) -> int:
    """Fit parameters of a valve to measured strokes, with their uncertainty."""
    from dataclasses import replace

    from klack.errors import require_positive

    wanted = Wanted(json=json, quiet=quiet, threads=threads)
    require_files("--measurement", measurement)
    for option, number, unit in (("--strokes", strokes, "strokes"), ("--workers", workers, "")):
        if number is not None:
            require_positive(option, number, unit)

    from klack.analyses.calibration.run import calibration_of, run_calibration
    from klack.case.case_tree import read_case_tree
    from klack.case.shipped import find_case

    tree = read_case_tree(find_case(case), imported(component))
    checked = tree.case()
    fitted = calibration_of(checked).channels
    folder = out if out is not None else Path("klack-results") / f"{checked.name}-calibration"
    ending = wanted.into(folder, report=report)

    from klack.analyses.calibration.analysis import CALIBRATION
    from klack.analyses.calibration.calibrated_case import CALIBRATED_NAME, calibrated_text
    from klack.analyses.calibration.log import TRIAL_LOG
    from klack.measurement.loading import load_stroke_set

    def calibrated(stage: Path) -> tuple[str, ...]:
        text = calibrated_text(tree, study, folder)
        (stage / CALIBRATED_NAME).write_text(text, encoding="utf-8")
        return (CALIBRATED_NAME,)

    with show_progress(quiet) as progress:
        try:
            measured = load_stroke_set(
                measurement,
                checked.measurement,
                lambda share: progress("measurement", share),
                roles=("lift", *fitted),
            )
            study = run_calibration(
                tree,
                measured
                if strokes is None
                else replace(measured, strokes=measured.strokes[:strokes]),
                folder=folder,
                workers=workers,
                progress=progress,
                threads=threads,
            )
        except KeyboardInterrupt as stop:
            count = TRIAL_LOG.count(folder)
            kept = f"{count} computed strokes are kept in {folder / TRIAL_LOG.file}"
            stop.add_note(f"{kept}, the same command resumes.")
            raise
    return ending.end(CALIBRATION, study, beside=calibrated, unfinished=TRIAL_LOG)
