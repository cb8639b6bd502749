"""A noise study on disk; see :mod:`klack.workflow.record_store`.

``result.zarr/study/designs/0/sound/pressure/values`` is the sound pressure of one click.
"""

from pathlib import Path

from klack.workflow.noise_study import NoiseStudy
from klack.workflow.record_store import RecordFormat, load_record, save_record

__all__ = ["NOISE_FORMAT", "load_noise", "save_noise"]

NOISE_FORMAT = RecordFormat(
    name="klack noise study",
    version=1,
    kind=NoiseStudy,
    command="klack noise",
    units={
        "frequency": "Hz",
        "level": "dB re 1 uN s",
        "net_share": "1",
        "middle": "Hz",
        "low": "Hz",
        "high": "Hz",
        "injected": "J",
        "mobility": "m/(N s)",
        "area": "m^2",
        "radiated": "J",
        "upper_bound": "J",
        "points": "m",
        "velocity": "m/s",
        "time": "s",
        "loudness": "sone",
        "energy": "N^2 s, or Pa^2 s of a sound",
    },
)
"""How a noise study is stored; the unit of a time series stands beside its step."""


def save_noise(study: NoiseStudy, folder: Path) -> Path:
    """Write ``folder/result.zarr``; an earlier result stays whole until the new one is complete.

    Returns
    -------
    Path
        Of the store.
    """
    return save_record(study, folder, NOISE_FORMAT)


def load_noise(folder: Path) -> NoiseStudy:
    """Read what :func:`save_noise` wrote.

    Parameters
    ----------
    folder : Path
        The folder given to :func:`save_noise`, or the store itself.

    Raises
    ------
    InputError
        If there is no result, it comes from something else, or a part of it is missing.
    """
    study: NoiseStudy = load_record(folder, NOISE_FORMAT)
    return study
