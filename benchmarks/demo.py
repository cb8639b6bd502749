"""The whole of ``klack demo``: from the drawing to the report, reduced and in full.

The first call starts with an empty cache of results, the second finds what the first has left.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from machine import peak_gigabytes
from number import Number, Size

__all__ = ["numbers"]

_COMMANDS = {
    "smallest": ["impact", "witness", "--level", "reduced,full"],
    "quick": ["impact", "demo-valve-axisymmetric", "--level", "reduced,full"],
    "full": ["demo", "--no-open"],
}


def numbers(size: Size) -> list[Number]:
    """Wall-clock and memory of the command in a process of its own."""
    words = _COMMANDS[size]
    name = " ".join(["klack", *words])
    with tempfile.TemporaryDirectory() as cache:
        seconds, off = _run(words, cache)
        peak = peak_gigabytes(children=True)
        again = _run(words, cache) if size != "smallest" else None
    found = [
        Number(
            name=f"{name}: time",
            value=seconds,
            unit="s",
            goal=120.0 if size == "full" else None,
            accuracy=off,
            accuracy_of="force history, reduced from full",
        ),
        Number(name=f"{name}: peak memory", value=peak, unit="GB"),
    ]
    if again is not None:
        found.append(
            Number(
                name=f"{name}: time of the second call",
                value=again[0],
                unit="s",
                accuracy=again[1],
                accuracy_of="force history, reduced from full",
            )
        )
    return found


def _run(words: list[str], cache: str) -> tuple[float, float]:
    """Seconds, and deviation of the reduced force history from the full one."""
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "numbers.json"
        command = [sys.executable, "-m", "klack", *words, "--quiet"]
        command += ["--out", str(Path(folder) / "out"), "--json", str(target)]
        begin = perf_counter()
        subprocess.run(
            command, check=True, capture_output=True, env=os.environ | {"KLACK_CACHE": cache}
        )
        seconds = perf_counter() - begin
        return seconds, json.loads(target.read_text())["deviations"]["reduced"]["history_l2"]
