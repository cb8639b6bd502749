"""Computed trials on disk while a calibration still runs, so that an interrupted one goes on.

A text file: the first line says what is calibrated to what, each further one holds one trial as
JSON.  The same command asks for the same trials again, finds them here and comes to where it was.
"""

import json
import os
from base64 import b64decode, b64encode
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

import klack
from klack.case.valve import ValveCase
from klack.errors import InputError
from klack.measurement.stroke_set import StrokeSet
from klack.workflow.calibration_motion import Motion

__all__ = ["LOG_NAME", "TrialKey", "TrialLog", "fingerprint", "finish_log", "logged_trials"]

LOG_NAME = "calibration.unfinished.jsonl"
_FORMAT = "klack calibration 1"

TrialKey = tuple[float, ...]
"""Duration [s] and parameter values [SI], to the last bit."""


class TrialLog:
    """Computed trials of one calibration; those of an earlier, interrupted run are there.

    Parameters
    ----------
    folder : Path or None
        Made if it does not exist; None keeps the trials in memory only.
    mark : str
        What :func:`fingerprint` says.  A file with another one is written over.
    """

    def __init__(self, folder: Path | None, mark: str) -> None:
        self.done: dict[TrialKey, Motion] = {}
        self.path = folder / LOG_NAME if folder is not None else None
        if self.path is None:
            return
        header = json.dumps({"format": _FORMAT, "fingerprint": mark}) + "\n"
        try:
            lines = self.path.read_bytes().split(b"\n") if self.path.is_file() else []
            whole = len(header)
            if lines and lines[0] + b"\n" == header.encode():
                for line in lines[1:-1]:  # what follows the last end of line was cut off
                    trial = _trial(line)
                    if trial is None:
                        break
                    self.done[trial[0]] = trial[1]
                    whole += len(line) + 1
                with self.path.open("r+b") as file:
                    file.truncate(whole)
                return
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self.path.write_text(header, encoding="utf-8")
        except OSError as error:
            raise InputError(
                str(self.path),
                got=f"a file that cannot be written ({error.strerror})",
                expected="a place for computed trials",
                hint="check the folder given to --out and the space that is left.",
            ) from error

    def add(self, key: TrialKey, motion: Motion) -> None:
        """Keep a computed trial."""
        self.done[key] = motion
        if self.path is None:
            return
        with self.path.open("a", encoding="utf-8") as file:
            file.write(_line(key, motion))
            file.flush()
            os.fsync(file.fileno())


def logged_trials(folder: Path) -> int:
    """How many trials the file in a folder holds."""
    path = folder / LOG_NAME
    return max(path.read_bytes().count(b"\n") - 1, 0) if path.is_file() else 0


def finish_log(folder: Path) -> None:
    """Remove the file: the calibration is complete and stored elsewhere."""
    (folder / LOG_NAME).unlink(missing_ok=True)


def fingerprint(case: ValveCase, strokes: StrokeSet) -> str:
    """Digest of all that decides a trial: case, its files, measured strokes, klack, libraries."""
    digest = sha256()
    for part in (klack.__version__, np.__version__, case.source):
        digest.update(part.encode() + b"\0")
    for body in case.bodies.values():
        for source in (body.geometry.mesh, body.geometry.step):
            if source is not None:
                digest.update(source.file.read_bytes() + b"\0")
    digest.update(strokes.time.tobytes())
    for stroke in strokes.strokes:
        for role, values in stroke.values.items():
            digest.update(role.encode() + b"\0" + np.ascontiguousarray(values).tobytes())
    # klack itself, as it is on this machine
    for file in sorted(Path(klack.__file__).parent.rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()


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
    return json.dumps(data) + "\n"


def _trial(line: bytes) -> tuple[TrialKey, Motion] | None:
    """Trial of one line; None for a line that is damaged."""
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
