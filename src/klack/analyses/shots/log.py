"""Finished shots on disk while others still run; see :mod:`klack.analyses.unfinished`."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import klack
from klack.analyses.shots.one_shot import ShotOutcome
from klack.analyses.unfinished import LogForm, UnfinishedLog, fingerprint
from klack.case.schema import Case

__all__ = ["SHOT_LOG", "ShotLog", "shot_log", "shots_mark"]

ShotLog = UnfinishedLog[int, ShotOutcome]
"""Shots by their number."""


def shot_log(folder: Path | None, mark: str) -> ShotLog:
    """Open the log of a study in a folder; in memory without one."""
    return UnfinishedLog(SHOT_LOG, folder, mark)


def shots_mark(case: Case, seed: int, threads: int | None) -> str:
    """Digest of all that decides the numbers of a shot: case, files, seed, klack, libraries."""
    words = (klack.__version__, str(seed), str(threads), case.source, np.__version__)
    return fingerprint(case.bodies.values(), (word.encode() for word in words))


def _line(index: int, outcome: ShotOutcome) -> str:
    # a float32 is a double, and the shortest text of a double is read back exactly
    data = {
        "index": index,
        "numbers": outcome.numbers,
        "height": outcome.height.tolist(),
        "force": outcome.force.tolist(),
        "approach": outcome.approach,
    }
    return json.dumps(data)


def _outcome(line: bytes) -> tuple[int, ShotOutcome] | None:
    try:
        data: Mapping[str, Any] = json.loads(line)
        outcome = ShotOutcome(
            index=int(data["index"]),
            numbers={str(key): float(value) for key, value in data["numbers"].items()},
            height=np.array(data["height"], dtype=np.float32),
            force=np.array(data["force"], dtype=np.float32),
            approach=float(data["approach"]),
        )
        return outcome.index, outcome
    except (ValueError, KeyError, TypeError, AttributeError):
        return None


SHOT_LOG = LogForm(
    file="shots.unfinished.jsonl",
    format="klack shots 1",
    parts="finished shots",
    line=_line,
    read=_outcome,
)
"""How finished shots are kept."""
