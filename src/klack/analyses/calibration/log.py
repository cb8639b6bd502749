"""Computed trials on disk while a calibration still runs; see :mod:`klack.analyses.unfinished`.

The same command asks for the same trials again, finds them here and comes to where it was.
"""

from base64 import b64decode, b64encode
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from klack.analyses.calibration.motion import Motion
from klack.analyses.unfinished import LogForm, UnfinishedLog, fingerprint
from klack.case.valve import ValveCase
from klack.measurement.stroke_set import StrokeSet

__all__ = ["TRIAL_LOG", "TrialKey", "TrialLog", "calibration_mark", "trial_log"]

TrialKey = tuple[float, ...]
"""Duration [s] and parameter values [SI], to the last bit."""

TrialLog = UnfinishedLog[TrialKey, Motion]
"""Computed trials by duration and values."""


def calibration_mark(case: ValveCase, strokes: StrokeSet) -> str:
    """Digest of all that decides a trial: the case and the measured strokes."""
    return fingerprint(case, _deciding(case, strokes))


def _deciding(case: ValveCase, strokes: StrokeSet) -> Iterator[bytes]:
    for name, digest in case.own_components.items():
        yield f"{name} {digest}".encode()
    yield strokes.time.tobytes()
    for stroke in strokes.strokes:
        for role, values in stroke.values.items():
            yield role.encode()
            yield np.ascontiguousarray(values).tobytes()


def _data(key: TrialKey, motion: Motion) -> Mapping[str, Any]:
    return {
        "trial": list(key),
        "step": motion.step,
        "channels": {
            role: b64encode(values.astype("<f4").tobytes()).decode()
            for role, values in motion.channels.items()
        },
        "impacts": {stop: list(times) for stop, times in motion.impacts.items()},
    }


def _trial(data: Mapping[str, Any]) -> tuple[TrialKey, Motion]:
    motion = Motion(
        step=float(data["step"]),
        channels={
            str(role): np.frombuffer(b64decode(text, validate=True), dtype="<f4")
            for role, text in data["channels"].items()
        },
        impacts={str(stop): tuple(map(float, t)) for stop, t in data["impacts"].items()},
    )
    return tuple(map(float, data["trial"])), motion


TRIAL_LOG = LogForm(
    file="calibration.unfinished.jsonl",
    format="klack calibration 1",
    parts="computed strokes",
    data=_data,
    read=_trial,
)
"""How computed trials are kept."""
trial_log = TRIAL_LOG.open
