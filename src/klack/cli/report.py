"""``klack report``: the report of a stored result, of whichever kind."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.cli.options import Quiet
from klack.cli.output import require_folder, staged_folder

if TYPE_CHECKING:
    from klack.report.study_content import Study

__all__ = ["report"]


def report(
    result: Annotated[
        Path,
        Parameter(name="RESULT", help="Folder that another command of klack wrote."),
    ],
    /,
    *,
    out: Annotated[
        Path | None, Parameter(name="--out", help="Folder for the report. [default: RESULT]")
    ] = None,
    quiet: Quiet = False,
) -> int:
    """Write report.html and report.pdf of a stored result."""
    from klack.cli.reports import REPORTS, write_reports

    folder = out if out is not None else result
    study = _load(result)
    require_folder(folder)
    with staged_folder(folder) as stage:
        write_reports(study, stage)
    if not quiet:
        print(f"Report in {folder}: {', '.join(REPORTS)}")
    return 0


def _load(result: Path) -> "Study":
    """Read whichever kind of study the store holds."""
    from klack.workflow.calibration_store import CALIBRATION_FORMAT, load_calibration
    from klack.workflow.measured_store import (
        MEASURED_SHOTS_FORMAT,
        MEASURED_STROKES_FORMAT,
        load_measured_shots,
        load_measured_strokes,
    )
    from klack.workflow.noise_store import NOISE_FORMAT, load_noise
    from klack.workflow.record_store import stored_format
    from klack.workflow.shots_store import SHOTS_FORMAT, load_shots
    from klack.workflow.store import load_study
    from klack.workflow.stroke_store import STROKE_FORMAT, load_stroke

    name = stored_format(result)
    if name == STROKE_FORMAT.name:
        return load_stroke(result)
    if name == MEASURED_STROKES_FORMAT.name:
        return load_measured_strokes(result)
    if name == MEASURED_SHOTS_FORMAT.name:
        return load_measured_shots(result)
    if name == NOISE_FORMAT.name:
        return load_noise(result)
    if name == CALIBRATION_FORMAT.name:
        return load_calibration(result)
    return load_shots(result) if name == SHOTS_FORMAT.name else load_study(result)
