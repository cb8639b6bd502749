"""A noise study on disk; see :mod:`klack.analyses.store`.

``result.zarr/study/designs/0/sound/pressure/values`` is the sound pressure of one click.
"""

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.noise.measures import BODY_MEASURES, DESIGN_MEASURES, STOP_MEASURES
from klack.analyses.noise.record import NoiseStudy
from klack.analyses.noise.summary import NoiseJson, noise_measured, noise_to_json, noise_told
from klack.analyses.store import RecordFormat

__all__ = ["NOISE"]


NOISE = StoredAnalysis(
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
    page="noise.content:noise_content",
    json=NoiseJson,
    to_json=noise_to_json,
    told=noise_told,
    measures={
        "design and its noise": DESIGN_MEASURES,
        "stop and its force": STOP_MEASURES,
        "body that vibrates": BODY_MEASURES,
    },
    measured=noise_measured,
)
