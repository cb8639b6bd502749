"""Commands of klack beside those of a former commit: time, processor time, numbers.

``uv run --group dev python benchmarks/beside_commit.py COMMIT`` clones that commit and the present
one into a temporary folder, builds the environment of each as a user does (``uv sync``), and runs
the commands of ``ROWS`` in turn, here and there, so that both see the same machine.  Wanted: two
quiet cores; ``--repeat`` takes the smallest of several, ``--only WORD`` some of the rows.

Before a row the stores of compiled code and of results hold what ``finds`` says: nothing, the code
that the same command has left, or both.  The time to the answer ends with the first line that holds
a peak force.  Where a command writes numbers, the largest relative deviation stands beside them.
"""

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from time import perf_counter
from typing import Any, Literal

__all__ = ["ROWS", "Row", "Spent", "main"]

ROOT = Path(__file__).resolve().parents[1]
_ONE_MASS = """klack: 1
title: A mass on a spring
network:
  components:
    mass: {type: rigid-mass, mass: 3 g, points: [end]}
    spring: {type: spring, stiffness: 10 N/mm, preload: 0 N}
    damper: {type: damper, damping: 1 N*s/m}
  connections: [[mass.end, spring.end, damper.body]]
run: {duration: 1 ms}
"""
_LOAD = "import klack; klack.load_result('kept/result')"


@dataclass(frozen=True, kw_only=True)
class Row:
    """A command, and what the stores hold before it."""

    name: str
    words: tuple[str, ...]
    finds: Literal["nothing", "code", "both"]
    writes: bool = True
    code: int = 0


def _impact(case: str, level: str) -> tuple[str, ...]:
    return ("klack", "impact", case, "--level", level)


_DEMO = ("klack", "demo", "--no-open")
_STROKE = ("klack", "stroke", "demo-stroke")
_SPATIAL = ("klack", "stroke", "docs/how-to/guided_stroke.yaml", "--variant", "wet")
_SLOPES = ("klack", "sensitivities", "docs/how-to/small_valve.yaml", "--parameter")
_SPRING = "network.components.spring.preload"
ROWS = (
    Row(name="demo, nothing stored", words=_DEMO, finds="nothing"),
    Row(name="demo, code stored", words=_DEMO, finds="code"),
    Row(name="stroke, nothing stored", words=_STROKE, finds="nothing"),
    Row(name="stroke, second call", words=_STROKE, finds="both"),
    Row(name="stroke in space, nothing stored", words=_SPATIAL, finds="nothing"),
    Row(name="stroke in space, code stored", words=_SPATIAL, finds="code"),
    Row(name="two rods, second call", words=_impact("two-rods", "reduced"), finds="both"),
    Row(name="sensitivities, warm", words=(*_SLOPES, _SPRING), finds="both"),
    Row(name="linearise, warm", words=("klack", "linearise", "one-mass.yaml"), finds="both"),
    *(
        Row(
            name=f"misspelt key, {kind}",
            words=("klack", kind, f"wrong-{kind}.yaml"),
            finds="both",
            writes=False,
            code=2,
        )
        for kind in ("impact", "stroke")
    ),
    Row(name="load_result", words=("python", "-c", _LOAD), finds="both", writes=False),
    Row(name="klack --version", words=("klack", "--version"), finds="both", writes=False),
)
"""Commands by name; ``warm`` ones find what ``klack warm`` has left."""


@dataclass(frozen=True)
class Spent:
    """Wall-clock, that until the answer, processor time of all processes [s]; the numbers."""

    wall: float
    answer: float
    processor: float
    numbers: Mapping[str, float]


def main() -> int:
    """Measure and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("commit")
    parser.add_argument("--only", nargs="+", default=[""], metavar="WORD")
    parser.add_argument("--repeat", type=int, default=1)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="klack-beside-") as name:
        places = [_checkout(Path(name), commit) for commit in (args.commit, "HEAD")]
        head = f"{'':36}{'wall [s]':>18}{'to the answer':>18}{'processor [s]':>18}{'ratio':>7}"
        print(head + "   numbers", flush=True)
        for row in (row for row in ROWS if any(word in row.name for word in args.only)):
            for place in places:
                _prepare(place, row)
            rounds = [[_run(place, row) for place in places] for _ in range(args.repeat)]
            best = [min(runs, key=lambda run: run.wall) for runs in zip(*rounds, strict=True)]
            print(_line(row, *best), flush=True)
    return 0


def _checkout(folder: Path, commit: str) -> Path:
    place = folder / ("now" if commit == "HEAD" else "before")
    subprocess.run(["git", "clone", "--quiet", str(ROOT), str(place)], check=True)
    subprocess.run(["git", "checkout", "--quiet", commit], check=True, cwd=place)
    subprocess.run(["uv", "sync", "--quiet"], check=True, cwd=place)
    (place / "one-mass.yaml").write_text(_ONE_MASS)
    for kind, case in (("impact", "demo-valve-axisymmetric"), ("stroke", "demo-stroke")):
        text = (place / "cases" / case / "case.yaml").read_text()
        (place / f"wrong-{kind}.yaml").write_text(text.replace("\nrun:", "\nrum:"))
    return place


def _prepare(place: Path, row: Row) -> None:
    """Fill the stores as the row wants them; what is not measured is not timed."""
    if "warm" in row.name:
        _call(place, ("klack", "warm"))
    elif row.name == "load_result":
        _call(place, (*_impact("demo-valve-axisymmetric", "reduced"), "--out", "kept/result"))
    elif row.finds != "nothing":
        _run(place, row)


def _run(place: Path, row: Row) -> Spent:
    if row.finds == "nothing":
        shutil.rmtree(place / "stored-code", ignore_errors=True)
    if row.finds != "both":
        shutil.rmtree(place / "stored-results", ignore_errors=True)
    target = place / "numbers.json"
    target.unlink(missing_ok=True)
    words = (*row.words, "--json", str(target), "--out", "out") if row.writes else row.words
    spent = _call(place, words, code=row.code)
    numbers = dict(_numbers(json.loads(target.read_text()))) if row.writes else {}
    return Spent(*spent, numbers)


def _call(place: Path, words: tuple[str, ...], *, code: int = 0) -> tuple[float, float, float]:
    """Wall-clock, wall-clock until a peak force is told, processor time."""
    stores = {"NUMBA_CACHE_DIR": "stored-code", "KLACK_CACHE": "stored-results"}
    stores = {name: str(place / folder) for name, folder in stores.items()}
    given = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"} | stores
    before, begin, answer = getrusage(RUSAGE_CHILDREN), perf_counter(), 0.0
    command = [str(place / ".venv" / "bin" / words[0]), *words[1:]]
    with subprocess.Popen(
        command, cwd=place, env=given, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if not answer and "peak force" in line:
                answer = perf_counter() - begin
    wall, after = perf_counter() - begin, getrusage(RUSAGE_CHILDREN)
    if process.returncode != code:
        raise SystemExit(f"{' '.join(command)}: exit code {process.returncode}, expected {code}")
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return wall, answer, spent


def _numbers(value: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """All numbers of a JSON but its times and residuals."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            if not any(word in key for word in ("wall", "time_s", "residual", "seconds")):
                yield from _numbers(inner, f"{path}/{key}")
    elif isinstance(value, list):
        for place, inner in enumerate(value):
            yield from _numbers(inner, f"{path}/{place}")
    elif isinstance(value, float):
        yield path, value


def _line(row: Row, before: Spent, now: Spent) -> str:
    shared = before.numbers.keys() & now.numbers.keys()
    off = max(
        (
            abs(before.numbers[key] - now.numbers[key]) / max(abs(before.numbers[key]), 1e-30)
            for key in shared
        ),
        default=0.0,
    )
    cells = [
        f"{getattr(before, name):9.2f}{getattr(now, name):9.2f}"
        for name in ("wall", "answer", "processor")
    ]
    told = f"   {len(shared)} within {off:.0e}" if shared else ""
    return f"{row.name:36}{''.join(cells)}{before.wall / now.wall:7.2f}{told}"


if __name__ == "__main__":
    sys.exit(main())
