"""Comparisons with measurements on disk; see :mod:`klack.workflow.record_store`."""

from pathlib import Path

from klack.workflow.measured_shots_study import MeasuredShotsStudy
from klack.workflow.measured_study import MeasuredStrokeStudy
from klack.workflow.record_store import RecordFormat, load_record, save_record

__all__ = [
    "MEASURED_SHOTS_FORMAT",
    "MEASURED_STROKES_FORMAT",
    "load_measured_shots",
    "load_measured_strokes",
    "save_measured_shots",
    "save_measured_strokes",
]

_COMMAND = "klack compare RESULT --measurement"

MEASURED_STROKES_FORMAT = RecordFormat(
    name="klack measured strokes",
    version=1,
    kind=MeasuredStrokeStudy,
    command=_COMMAND,
    units={
        "time": "s",
        **dict.fromkeys(("lift", "lift_median", "lift_low", "lift_high", "computed_lift"), "m"),
        **dict.fromkeys(
            (
                "velocity",
                "velocity_median",
                "velocity_low",
                "velocity_high",
                "computed_velocity",
            ),
            "m/s",
        ),
    },
)
"""How strokes beside their measurement are stored."""

MEASURED_SHOTS_FORMAT = RecordFormat(
    name="klack measured shots",
    version=1,
    kind=MeasuredShotsStudy,
    command=_COMMAND,
    units={"time": "s", "lift": "m", "computed_time": "s", "computed_height": "m"},
)
"""How shots beside measured drops are stored."""


def save_measured_strokes(study: MeasuredStrokeStudy, folder: Path) -> Path:
    """Write ``folder/result.zarr``; an earlier result stays whole until the new one is complete."""
    return save_record(study, folder, MEASURED_STROKES_FORMAT)


def load_measured_strokes(folder: Path) -> MeasuredStrokeStudy:
    """Read what :func:`save_measured_strokes` wrote; :class:`InputError` if that is not there."""
    study: MeasuredStrokeStudy = load_record(folder, MEASURED_STROKES_FORMAT)
    return study


def save_measured_shots(study: MeasuredShotsStudy, folder: Path) -> Path:
    """Write ``folder/result.zarr``; an earlier result stays whole until the new one is complete."""
    return save_record(study, folder, MEASURED_SHOTS_FORMAT)


def load_measured_shots(folder: Path) -> MeasuredShotsStudy:
    """Read what :func:`save_measured_shots` wrote; :class:`InputError` if that is not there."""
    study: MeasuredShotsStudy = load_record(folder, MEASURED_SHOTS_FORMAT)
    return study
