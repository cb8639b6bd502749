"""``klack calibrate``: fit chosen numbers of a valve to measured strokes."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.cli.notes import print_notes
from klack.cli.options import (
    CaseArgument,
    Components,
    Json,
    Out,
    Quiet,
    Threads,
    imported,
    require_files,
    require_threads,
)
from klack.cli.output import require_folder, require_json_target, write_json
from klack.cli.progress import show_progress
from klack.cli.reports import REPORTS, write_result
from klack.cli.tables import print_table

if TYPE_CHECKING:
    from klack.workflow.calibration_study import CalibrationStudy

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

    require_json_target(json)
    require_threads(threads)
    require_files("--measurement", measurement)
    for option, number, unit in (("--strokes", strokes, "strokes"), ("--workers", workers, "")):
        if number is not None:
            require_positive(option, number, unit)

    from klack.case.case_tree import read_case_tree
    from klack.case.shipped import find_case
    from klack.workflow.calibration import calibration_of, run_calibration

    tree = read_case_tree(find_case(case), imported(component))
    checked = tree.case()
    fitted = calibration_of(checked).channels
    folder = out if out is not None else Path("klack-results") / f"{checked.name}-calibration"
    require_folder(folder)

    from klack.measurement.loading import load_stroke_set
    from klack.workflow.calibrated_case import CALIBRATED_NAME, calibrated_text
    from klack.workflow.calibration_log import TRIAL_LOG
    from klack.workflow.calibration_store import save_calibration
    from klack.workflow.calibration_summary import calibration_to_json

    def save(study: "CalibrationStudy", stage: Path) -> None:
        save_calibration(study, stage)
        text = calibrated_text(tree, study, folder)
        (stage / CALIBRATED_NAME).write_text(text, encoding="utf-8")

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
            stop.add_note(f"{kept}, the same command goes on.")
            raise
        failure = write_result(
            study, folder, save, report=report, progress=progress, unfinished=TRIAL_LOG
        )
    if not quiet:
        made = report and failure is None
        _print_study(study, folder, made, to_stderr=str(json) == "-")
    else:
        print_notes(study.warnings, to_stderr=True)
    if json is not None:
        write_json(json, calibration_to_json(study))
    if failure:
        raise failure
    return 0


def _print_study(study: "CalibrationStudy", folder: Path, report: bool, *, to_stderr: bool) -> None:
    from klack.workflow.calibrated_case import CALIBRATED_NAME
    from klack.workflow.calibration_summary import PARAMETER_COLUMNS, parameter_rows

    title = f"{study.title}: {len(study.strokes)} strokes, {study.variant}"
    print_table(title, PARAMETER_COLUMNS, parameter_rows(study), to_stderr=to_stderr)
    stream = sys.stderr if to_stderr else sys.stdout
    print(
        f"Lift inside the windows: {1e6 * study.residual_rms:.3g} um rms from the mean stroke "
        f"({1e6 * study.residual_rms_before:.3g} um before).",
        file=stream,
    )
    print_notes(study.warnings, to_stderr=to_stderr)
    made = ["result.zarr", CALIBRATED_NAME, *(REPORTS if report else ())]
    print(f"Results in {folder}: {', '.join(made)}", file=stream)
