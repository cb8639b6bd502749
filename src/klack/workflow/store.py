"""An impact study on disk; see :mod:`klack.workflow.record_store`.

``result.zarr/study/levels/full/history/force`` is the force of the full-order run in newtons.
"""

from pathlib import Path

from klack.reduction.structure import STRUCTURE_UNITS
from klack.workflow.record_store import RESULT_NAME, RecordFormat, load_record, save_record
from klack.workflow.study import ImpactStudy

__all__ = ["IMPACT_FORMAT", "RESULT_NAME", "load_study", "save_study"]

_UNITS = {
    **STRUCTURE_UNITS,
    "time": "s",
    "force": "N",
    "peak_force": "N",
    "external_force": "N",
    "gap": "m",
    "approach": "m",
    "indentation": "m",
    "area": "m^2",
    "velocity_a": "m/s",
    "velocity_b": "m/s",
    "displacement_a": "m",
    "displacement_b": "m",
    "frequency": "Hz",
    "frequencies": "Hz",
    "energy": "J",
    "modal": "J",
    "points": "m",
    "point_force": "N",
    "displacement": "m",
    "magnitude": "m",
    "share": "1",
}

IMPACT_FORMAT = RecordFormat(
    name="klack impact study",
    version=1,
    kind=ImpactStudy,
    command="klack impact",
    units=_UNITS,
)
"""How an impact study is stored."""


def save_study(study: ImpactStudy, folder: Path) -> Path:
    """Write ``folder/result.zarr``; an earlier result stays whole until the new one is complete.

    Returns
    -------
    Path
        Of the store.
    """
    return save_record(study, folder, IMPACT_FORMAT)


def load_study(folder: Path) -> ImpactStudy:
    """Read what :func:`save_study` wrote.

    Parameters
    ----------
    folder : Path
        The folder given to :func:`save_study`, or the store itself.

    Raises
    ------
    InputError
        If there is no result, it comes from something else, or a part of it is missing.
    """
    study: ImpactStudy = load_record(folder, IMPACT_FORMAT)
    return study
