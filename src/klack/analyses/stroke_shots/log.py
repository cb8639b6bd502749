"""Finished strokes on disk while others still run; see :mod:`klack.analyses.unfinished`."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from klack.analyses.stroke_shots.one_stroke import StrokeOutcome
from klack.analyses.unfinished import LogForm, UnfinishedLog, fingerprint
from klack.case.valve import ValveCase

__all__ = ["STROKE_LOG", "StrokeKey", "StrokeLog", "strokes_mark"]

StrokeKey = tuple[str, int]
"""Variant and number of a stroke."""
StrokeLog = UnfinishedLog[StrokeKey, StrokeOutcome]


def strokes_mark(case: ValveCase, seed: int, threads: int | None) -> str:
    """Digest of all that decides the numbers of a stroke."""
    files = (path.read_bytes() for path in case.component_files.values())
    own = (f"{name} {digest}".encode() for name, digest in case.own_components.items())
    run = case.run.model_dump_json().encode()
    return fingerprint(case, (run, str(seed).encode(), str(threads).encode(), *own, *files))


def _data(key: StrokeKey, outcome: StrokeOutcome) -> Mapping[str, Any]:
    return {
        "variant": outcome.variant,
        "label": outcome.label,
        "index": outcome.index,
        "stroke": outcome.stroke,
        "stops": outcome.stops,
        "lift": outcome.lift.tolist(),
        "end": outcome.end.tolist(),
        "failure": outcome.failure,
        "doubts": list(outcome.doubts),
    }


def _outcome(data: Mapping[str, Any]) -> tuple[StrokeKey, StrokeOutcome]:
    outcome = StrokeOutcome(
        variant=str(data["variant"]),
        label=str(data["label"]),
        index=int(data["index"]),
        stroke={str(key): float(value) for key, value in data["stroke"].items()},
        stops={
            str(stop): {str(key): float(value) for key, value in numbers.items()}
            for stop, numbers in data["stops"].items()
        },
        lift=np.array(data["lift"], dtype=np.float32),
        end=np.array(data["end"], dtype=float),
        failure=str(data["failure"]),
        doubts=tuple(map(str, data["doubts"])),
    )
    return (outcome.variant, outcome.index), outcome


STROKE_LOG = LogForm(
    file="strokes.unfinished.jsonl",
    format="klack strokes 1",
    parts="finished strokes",
    data=_data,
    read=_outcome,
)
"""How finished strokes are kept."""
