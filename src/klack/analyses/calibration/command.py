"""Command ``klack calibrate``."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from klack.analyses.ending import Ending
from klack.errors import require_positive
from klack.terminal.options import (
    WANTED_RESULT,
    CaseArgument,
    Components,
    WantedResult,
    imported,
    require_files,
)

__all__ = ["calibrate"]

_Files = Annotated[
    list[Path],
    Parameter(
        name="--measurement",
        negative="",
        help="Recording of strokes: CSV, MDF4, TDMS, UFF, HDF5, MATLAB; repeat the option for "
        "several files.",
    ),
]
_Strokes = Annotated[int | None, Parameter(name="--strokes", help="Fit only the first N strokes.")]
_Workers = Annotated[
    int | None,
    Parameter(
        name="--workers",
        help="Number of processes; it does not affect the results. [default: all cores]",
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
    wanted: WantedResult = WANTED_RESULT,
) -> int:
    """Fit parameters of a valve to measured strokes, with their uncertainty."""
    from dataclasses import replace

    require_files("--measurement", measurement)
    for option, number, unit in (("--strokes", strokes, "strokes"), ("--workers", workers, "")):
        if number is not None:
            require_positive(option, number, unit)

    from klack.case.any_case import read_case_tree

    tree = read_case_tree(case, imported(component))
    checked = tree.case()

    from klack.analyses.calibration.run import calibration_of, run_calibration

    fitted = calibration_of(checked).channels
    ending = Ending.of(wanted, f"{checked.name}-calibration")

    from klack.analyses.calibration.analysis import CALIBRATION
    from klack.analyses.calibration.motion import TRIAL_LOG
    from klack.analyses.calibration.run import CALIBRATED_NAME, calibrated_text
    from klack.measurement.loading import load_stroke_set

    def calibrated(stage: Path) -> tuple[str, ...]:
        text = calibrated_text(tree, study, ending.folder)
        (stage / CALIBRATED_NAME).write_text(text, encoding="utf-8")
        return (CALIBRATED_NAME,)

    with ending.resumable(TRIAL_LOG) as progress:
        measured = load_stroke_set(
            measurement,
            checked.measurement,
            lambda share: progress("measurement", share),
            roles=("lift", *fitted),
        )
        if strokes is not None:
            measured = replace(measured, strokes=measured.strokes[:strokes])
        study = run_calibration(
            tree,
            measured,
            folder=ending.folder,
            workers=workers,
            progress=progress,
            threads=wanted.threads,
        )
    return ending.end(CALIBRATION, study, beside=calibrated, unfinished=TRIAL_LOG)
