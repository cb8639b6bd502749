"""Finished shots on disk while others still run, so that an interrupted study goes on.

A text file: the first line says what was computed, each further one holds one shot as JSON.  It is
only read by the same klack for the same case and seed; otherwise it starts anew.
"""

import json
import os
from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

import klack
from klack.case.schema import Case
from klack.errors import InputError
from klack.workflow.shot_run import ShotOutcome

__all__ = ["LOG_NAME", "ShotLog", "fingerprint", "finish_log", "logged_shots"]

LOG_NAME = "shots.unfinished.jsonl"
_FORMAT = "klack shots 1"


class ShotLog:
    """Finished shots of one study in a file; those of an earlier, interrupted run are there.

    Parameters
    ----------
    folder : Path or None
        Made if it does not exist; None keeps the shots in memory only.
    mark : str
        What :func:`fingerprint` says.  A file with another one is written over.
    """

    def __init__(self, folder: Path | None, mark: str) -> None:
        self.done: dict[int, ShotOutcome] = {}
        self.path = folder / LOG_NAME if folder is not None else None
        if self.path is None:
            return
        header = json.dumps({"format": _FORMAT, "fingerprint": mark}) + "\n"
        try:
            lines = self.path.read_bytes().split(b"\n") if self.path.is_file() else []
            whole = len(header)
            if lines and lines[0] + b"\n" == header.encode():
                for line in lines[1:-1]:  # what follows the last end of line was cut off
                    outcome = _outcome(line)
                    if outcome is None:
                        break
                    self.done[outcome.index] = outcome
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
                expected="a place for finished shots",
                hint="check the folder given to --out and the space that is left.",
            ) from error

    def add(self, outcome: ShotOutcome) -> None:
        """Keep a finished shot."""
        self.done[outcome.index] = outcome
        if self.path is None:
            return
        with self.path.open("a", encoding="utf-8") as file:
            file.write(_line(outcome))
            file.flush()
            os.fsync(file.fileno())


def logged_shots(folder: Path) -> int:
    """How many finished shots the file in a folder holds."""
    path = folder / LOG_NAME
    return max(path.read_bytes().count(b"\n") - 1, 0) if path.is_file() else 0


def finish_log(folder: Path) -> None:
    """Remove the file: the study is complete and stored elsewhere."""
    (folder / LOG_NAME).unlink(missing_ok=True)


def fingerprint(case: Case, seed: int, threads: int | None) -> str:
    """Digest of all that decides the numbers of a shot: case, files, seed, klack, libraries."""
    digest = sha256()
    for part in (klack.__version__, str(seed), str(threads), case.source):
        digest.update(part.encode() + b"\0")
    for body in case.bodies.values():
        for source in (body.geometry.mesh, body.geometry.step):
            if source is not None:
                digest.update(source.file.read_bytes() + b"\0")
    for library in (np,):
        digest.update(library.__version__.encode())
    # klack itself, as it is on this machine
    for file in sorted(Path(klack.__file__).parent.rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _line(outcome: ShotOutcome) -> str:
    # a float32 is a double, and the shortest text of a double is read back exactly
    data = {
        "index": outcome.index,
        "numbers": outcome.numbers,
        "height": outcome.height.tolist(),
        "force": outcome.force.tolist(),
        "approach": outcome.approach,
    }
    return json.dumps(data) + "\n"


def _outcome(line: bytes) -> ShotOutcome | None:
    """Shot of one line; None for a line that is damaged."""
    try:
        data: Mapping[str, Any] = json.loads(line)
        return ShotOutcome(
            index=int(data["index"]),
            numbers={str(key): float(value) for key, value in data["numbers"].items()},
            height=np.array(data["height"], dtype=np.float32),
            force=np.array(data["force"], dtype=np.float32),
            approach=float(data["approach"]),
        )
    except (ValueError, KeyError, TypeError, AttributeError):
        return None
