"""Finished strokes of a warm-up on disk; see :mod:`klack.analyses.unfinished`."""

from collections.abc import Mapping
from typing import Any

from klack.analyses.heat.heated_stroke import HeatedStroke
from klack.analyses.unfinished import LogForm, UnfinishedLog, fingerprint
from klack.case.valve import ValveCase

__all__ = ["HEAT_LOG", "HeatLog", "heat_mark"]

HeatLog = UnfinishedLog[str, HeatedStroke]
"""Strokes by their temperatures."""


def heat_mark(case: ValveCase, threads: int | None) -> str:
    """Digest of all that decides the numbers of a stroke."""
    files = (path.read_bytes() for path in case.component_files.values())
    own = (f"{name} {digest}".encode() for name, digest in case.own_components.items())
    run = case.run.model_dump_json().encode()
    return fingerprint(case, (run, str(threads).encode(), *own, *files))


def _data(key: str, stroke: HeatedStroke) -> Mapping[str, Any]:
    return {
        "key": key,
        "losses": dict(stroke.losses),
        "numbers": dict(stroke.numbers),
        "values": {name: list(value) for name, value in stroke.values.items()},
        "doubts": list(stroke.doubts),
    }


def _stroke(data: Mapping[str, Any]) -> tuple[str, HeatedStroke]:
    return str(data["key"]), HeatedStroke(
        losses={str(name): float(value) for name, value in data["losses"].items()},
        numbers={str(name): float(value) for name, value in data["numbers"].items()},
        values={str(name): (float(v), str(unit)) for name, (v, unit) in data["values"].items()},
        doubts=tuple(map(str, data["doubts"])),
    )


HEAT_LOG = LogForm(
    file="heat.unfinished.jsonl",
    format="klack heat 1",
    parts="finished strokes",
    data=_data,
    read=_stroke,
)
"""How finished strokes are kept."""
