"""A calibration on disk; see :mod:`klack.workflow.record_store`."""

from pathlib import Path

from klack.workflow.calibration_study import CalibrationStudy
from klack.workflow.record_store import RecordFormat, load_record, save_record

__all__ = ["CALIBRATION_FORMAT", "load_calibration", "save_calibration"]

CALIBRATION_FORMAT = RecordFormat(
    name="klack calibration",
    version=1,
    kind=CalibrationStudy,
    command="klack calibrate",
    units={
        "time": "s",
        "correlation": "1",
        "design_correlation": "1",
        "singular_values": "1",
        "excess": "1",
    },
)
"""How a calibration is stored."""


def save_calibration(study: CalibrationStudy, folder: Path) -> Path:
    """Write ``folder/result.zarr``; an earlier result stays whole until the new one is complete.

    Returns
    -------
    Path
        Of the store.
    """
    return save_record(study, folder, CALIBRATION_FORMAT)


def load_calibration(folder: Path) -> CalibrationStudy:
    """Read what :func:`save_calibration` wrote.

    Parameters
    ----------
    folder : Path
        The folder given to :func:`save_calibration`, or the store itself.

    Raises
    ------
    InputError
        If there is no result, it comes from something else, or a part of it is missing.
    """
    study: CalibrationStudy = load_record(folder, CALIBRATION_FORMAT)
    return study
