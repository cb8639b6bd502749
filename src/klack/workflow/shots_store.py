"""A study of shots on disk; see :mod:`klack.workflow.record_store`.

``result.zarr/study/shots/restitution`` holds one number per shot.
"""

from pathlib import Path

from klack.workflow.record_store import RecordFormat, load_record, save_record
from klack.workflow.shots_study import ShotsStudy

__all__ = ["SHOTS_FORMAT", "load_shots", "save_shots"]

SHOTS_FORMAT = RecordFormat(
    name="klack shots study",
    version=1,
    kind=ShotsStudy,
    command="klack shots",
    units={
        "eccentricity": "m",
        "direction": "rad",
        "tilt": "rad",
        "tilt_direction": "rad",
        "force": "N",
        "friction": "1",
        "waviness": "m",
        "approach_speed": "m/s",
        "restitution": "1",
        "rebound_height": "m",
        "peak_force": "N",
        "contact_time": "s",
        "impulse": "N s",
        "sub_contacts": "1",
        "rocking": "1",
        "second_impact": "s",
        "impacts": "1",
        "energy_residual": "1",
        "time": "s",
        "force_time": "s",
        "height": "m",
        "points": "m",
        "area": "m^2",
        "point_force": "N",
    },
)
"""How a study of shots is stored."""


def save_shots(study: ShotsStudy, folder: Path) -> Path:
    """Write ``folder/result.zarr``; an earlier result stays whole until the new one is complete.

    Returns
    -------
    Path
        Of the store.
    """
    return save_record(study, folder, SHOTS_FORMAT)


def load_shots(folder: Path) -> ShotsStudy:
    """Read what :func:`save_shots` wrote.

    Parameters
    ----------
    folder : Path
        The folder given to :func:`save_shots`, or the store itself.

    Raises
    ------
    InputError
        If there is no result, it comes from something else, or a part of it is missing.
    """
    study: ShotsStudy = load_record(folder, SHOTS_FORMAT)
    return study
