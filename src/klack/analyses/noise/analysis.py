"""A noise study on disk; see :mod:`klack.analyses.store`.

``result.zarr/study/designs/0/sound/pressure/values`` is the sound pressure of one click.
"""

from klack.analyses.analysis import Analysis
from klack.analyses.noise.record import NoiseStudy
from klack.analyses.noise.summary import noise_to_json, noise_told
from klack.analyses.store import RecordFormat
from klack.report.page import Content

__all__ = ["NOISE"]


def _noise_content(study: NoiseStudy) -> Content:
    from klack.analyses.noise.content import noise_content

    return noise_content(study)


NOISE = Analysis(
    form=RecordFormat(
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
    ),
    content=_noise_content,
    to_json=noise_to_json,
    told=noise_told,
)
