"""A stroke study on disk; see :mod:`klack.workflow.record_store`.

``result.zarr/study/variants/wet/result/channels/coil current/values`` is the current of the wet
run; its unit stands beside it as ``unit``.
"""

from dataclasses import replace
from math import isfinite
from pathlib import Path

from klack.reduction.structure import STRUCTURE_UNITS
from klack.workflow.record_store import RecordFormat, load_record, save_record
from klack.workflow.stroke_study import StrokeStudy

__all__ = ["STROKE_FORMAT", "load_stroke", "save_stroke"]

STROKE_FORMAT = RecordFormat(
    name="klack stroke study",
    version=1,
    kind=StrokeStudy,
    command="klack stroke",
    units={
        **STRUCTURE_UNITS,
        "time": "s",
        "step": "s",
        "contact_force": "N",
        "film_force": "N",
        "gap": "m",
        "indentation": "m",
        "force": "N",
        "share": "1",
        "approach": "m",
        "static_force": "N",
        "area": "m^2",
        "frequencies": "Hz",
        "approach_speed": "m/s",
        "peak_force": "N",
        "peak_time": "s",
        "contact_time": "s",
        "separation_time": "s",
        "impulse": "N s",
        "restitution": "1",
        "energy_loss": "J",
    },
    tables=("events",),
)
"""How a stroke study is stored."""


def save_stroke(study: StrokeStudy, folder: Path) -> Path:
    """Write ``folder/result.zarr``; an earlier result stays whole until the new one is complete.

    Returns
    -------
    Path
        Of the store.
    """
    return save_record(study, folder, STROKE_FORMAT)


def load_stroke(folder: Path) -> StrokeStudy:
    """Read what :func:`save_stroke` wrote.

    Parameters
    ----------
    folder : Path
        The folder given to :func:`save_stroke`, or the store itself.

    Raises
    ------
    InputError
        If there is no result, it comes from something else, or a part of it is missing.
    """
    study: StrokeStudy = load_record(folder, STROKE_FORMAT)
    return replace(study, lift=_known(study.lift), switch_off=_known(study.switch_off))


def _known(value: float | None) -> float | None:
    """None for the nan with which earlier versions said that there is none."""
    return value if value is not None and isfinite(value) else None
