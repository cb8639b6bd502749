"""Finished shots on disk while others still run; see :mod:`klack.analyses.unfinished`."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from klack.analyses.shots.one_shot import ShotOutcome
from klack.analyses.unfinished import LogForm, UnfinishedLog, fingerprint
from klack.case.schema import Case

__all__ = ["SHOT_LOG", "ShotLog", "shot_log", "shots_mark"]

ShotLog = UnfinishedLog[int, ShotOutcome]
"""Shots by their number."""


def shots_mark(case: Case, seed: int, threads: int | None) -> str:
    """Digest of all that decides the numbers of a shot."""
    return fingerprint(case, (str(seed).encode(), str(threads).encode()))


def _data(index: int, outcome: ShotOutcome) -> Mapping[str, Any]:
    more: dict[str, Any] = {"doubts": list(outcome.doubts)} if outcome.doubts else {}
    if len(outcome.worn):
        more["worn"] = outcome.worn.tolist()
    return {
        "index": index,
        "numbers": outcome.numbers,
        "height": outcome.height.tolist(),
        "force": outcome.force.tolist(),
        "approach": outcome.approach,
    } | more


def _outcome(data: Mapping[str, Any]) -> tuple[int, ShotOutcome]:
    outcome = ShotOutcome(
        index=int(data["index"]),
        numbers={str(key): float(value) for key, value in data["numbers"].items()},
        height=np.array(data["height"], dtype=np.float32),
        force=np.array(data["force"], dtype=np.float32),
        approach=float(data["approach"]),
        doubts=tuple(map(str, data.get("doubts", ()))),
        worn=np.array(data.get("worn", ()), dtype=float),
    )
    return outcome.index, outcome


SHOT_LOG = LogForm(
    file="shots.unfinished.jsonl",
    format="klack shots 1",
    parts="finished shots",
    data=_data,
    read=_outcome,
)
"""How finished shots are kept."""
shot_log = SHOT_LOG.open
