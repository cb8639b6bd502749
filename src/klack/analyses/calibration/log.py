"""Computed trials on disk while a calibration still runs; see :mod:`klack.analyses.unfinished`.

The same command asks for the same trials again, finds them here and comes to where it was.
"""

import json
from base64 import b64decode, b64encode
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import klack
from klack.analyses.calibration.motion import Motion
from klack.analyses.unfinished import LogForm, UnfinishedLog, fingerprint
from klack.case.valve import ValveCase
from klack.measurement.stroke_set import StrokeSet

__all__ = ["TRIAL_LOG", "TrialKey", "TrialLog", "calibration_mark", "trial_log"]

TrialKey = tuple[float, ...]
"""Duration [s] and parameter values [SI], to the last bit."""

TrialLog = UnfinishedLog[TrialKey, Motion]
"""Computed trials by duration and values."""


def trial_log(folder: Path | None, mark: str) -> TrialLog:
    """Open the log of a calibration in a folder; in memory without one."""
    return UnfinishedLog(TRIAL_LOG, folder, mark)


def calibration_mark(case: ValveCase, strokes: StrokeSet) -> str:
    """Digest of all that decides a trial: case, its files, measured strokes, klack, libraries."""
    return fingerprint(case.bodies.values(), _deciding(case, strokes))


def _deciding(case: ValveCase, strokes: StrokeSet) -> Iterator[bytes]:
    for word in (klack.__version__, np.__version__, case.source):
        yield word.encode()
    for name, digest in case.own_components.items():
        yield f"{name} {digest}".encode()
    yield strokes.time.tobytes()
    for stroke in strokes.strokes:
        for role, values in stroke.values.items():
            yield role.encode()
            yield np.ascontiguousarray(values).tobytes()


def _line(key: TrialKey, motion: Motion) -> str:
    # the shortest text of a double is read back exactly
    data = {
        "trial": list(key),
        "step": motion.step,
        "channels": {
            role: b64encode(values.astype("<f4").tobytes()).decode()
            for role, values in motion.channels.items()
        },
        "impacts": {stop: list(times) for stop, times in motion.impacts.items()},
    }
    return json.dumps(data)


def _trial(line: bytes) -> tuple[TrialKey, Motion] | None:
    try:
        data: dict[str, Any] = json.loads(line)
        motion = Motion(
            step=float(data["step"]),
            channels={
                str(role): np.frombuffer(b64decode(text, validate=True), dtype="<f4")
                for role, text in data["channels"].items()
            },
            impacts={str(stop): tuple(map(float, t)) for stop, t in data["impacts"].items()},
        )
        return tuple(map(float, data["trial"])), motion
    except (ValueError, KeyError, TypeError, AttributeError):
        return None


TRIAL_LOG = LogForm(
    file="calibration.unfinished.jsonl",
    format="klack calibration 1",
    parts="computed strokes",
    line=_line,
    read=_trial,
)
"""How computed trials are kept."""
