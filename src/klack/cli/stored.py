"""Stored results, of whichever kind."""

from pathlib import Path
from typing import TYPE_CHECKING

from klack.whole_file import completed

if TYPE_CHECKING:
    from klack.report.study_content import Study

__all__ = ["is_result", "load_stored"]


def is_result(path: Path) -> bool:
    """Tell a folder with a result, or a store itself, from a case."""
    return (completed(path) / "result.zarr").is_dir() or (path / "zarr.json").is_file()


def load_stored(result: Path) -> "Study":
    """Read whichever kind of study the store holds.

    Raises
    ------
    InputError
        If there is no result, or a part of it is missing.
    """
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
