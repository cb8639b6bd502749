"""Random valves out of the whole catalogue through the command line: how each of them ends.

``uv run --group dev python benchmarks/random_catalogue.py --count 200`` draws valves in which every
component type but the FMU occurs, runs ``klack stroke`` on each, once more with half the step, and
``klack stroke --steady`` and ``klack linearise`` on every third; ``--seed`` begins elsewhere,
``--only N`` prints one case.  It counts how they end: in an answer, in one with a note, in an error
of the input (exit code 2), in a run that stopped (1).  A fault is an internal error, a stop that
does not say at which component and when, an energy residual above 1e-9 or a first impact on a stop
that changes with the step without a note on it; each is printed.
"""

import argparse
import json
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any

import yaml
from drawn_catalogue import Drawn, draw

from klack.cli.main import main as klack

__all__ = ["ending", "main", "tells_where_and_when", "written"]

_RESIDUAL = 1e-9  # of the energy throughput
_TIME, _PEAK = 5e-8, 5e-4  # [s], [-]: what is promised of the first impact on a stop


def written(drawn: Drawn, folder: Path) -> Path:
    """Write a draw and its parts into a folder; the path of the case."""
    for name, text in drawn.parts.items():
        (folder / name).write_text(text)
    case = folder / "case.yaml"
    case.write_text(drawn.text)
    return case


def _told(command: str, case: Path, *words: str) -> tuple[int, dict[str, Any], str]:
    """Exit code, JSON and messages of one command."""
    found, said = case.with_name("found.json"), StringIO()
    found.unlink(missing_ok=True)
    fixed = ("--no-report", "--quiet", "--json", str(found), "--out", str(case.with_name("out")))
    with redirect_stdout(StringIO()), redirect_stderr(said):
        code = klack([command, str(case), *fixed, *words])
    data = json.loads(found.read_text()) if found.exists() else {}
    return code, data, said.getvalue().strip()


def tells_where_and_when(words: str, components: Iterable[str]) -> bool:
    """Whether the message of a run that stopped names a component, a time, and what to try."""
    message = words.partition("klack stroke: ")[2]
    when = re.search(r"(at|after) -?[\d.]+ [num]?s\b|[\d.]+ [num]?s after|at the start", message)
    where = any(re.search(rf"\b{re.escape(name)}\b", message) for name in components)
    return where and when is not None and "Try: " in message


def ending(case: Path, *, more: bool) -> tuple[str, str]:
    """How a case ends: ``answer``, ``note``, ``error``, ``stopped`` or ``fault``, and its words.

    Parameters
    ----------
    case : Path
    more : bool
        Operating point and linear model as well.
    """
    others = [_told("stroke", case, "--steady"), _told("linearise", case)] if more else []
    code, found, said = _told("stroke", case)
    for wrong, _, words in ((code, found, said), *others):
        if wrong not in (0, 1, 2) or (wrong and "Try: " not in words and "expected" not in words):
            return "fault", words[-500:]
    if code == 1:
        components = yaml.safe_load(case.read_text())["network"]["components"]
        told = tells_where_and_when(said, components)
        return "stopped" if told else "fault", said
    if code:
        return "error", said
    step = f"{0.5e9 * found['step_s']:.12g} ns"
    apart = _apart(found, _told("stroke", case, "--step", step)[1])
    if not found["energy_residual"] <= _RESIDUAL and not said:
        return "fault", f"energy residual {found['energy_residual']:.2g}"
    if any(f"first impact on '{stop}'" not in said for stop in apart):
        return "fault", "; ".join(apart.values())
    return ("note" if said else "answer"), " ".join([said, *apart.values()]).strip()


def _apart(one: dict[str, Any], other: dict[str, Any]) -> dict[str, str]:
    """How the first impact on a stop differs with half the step, by stops where it does."""
    first: dict[str, Any] = {}
    for event in one["events"]:
        first.setdefault(event["stop"], event)
    words: dict[str, str] = {}
    for stop, event in first.items():
        twin = next((e for e in other.get("events", ()) if e["stop"] == stop), None)
        if twin is None:
            words[stop] = f"{stop} is not touched with half the step"
            continue
        late = abs(event["time_s"] - twin["time_s"])
        peak = abs(event["peak_force_N"] / (twin["peak_force_N"] or 1.0) - 1.0)
        if late > _TIME or peak > _PEAK:
            words[stop] = f"{stop} with half the step: {late:.1e} s later, peak {peak:.1e} off"
    return words


def main() -> int:
    """Run draws; 1 if one of them is a fault."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int)
    chosen = parser.parse_args()
    seeds = range(chosen.seed, chosen.seed + chosen.count)
    if chosen.only is not None:
        sys.stdout.write(draw(chosen.only).text + "\n")
        seeds = range(chosen.only, chosen.only + 1)
    ends, types = Counter[str](), Counter[str]()
    for seed in seeds:
        with tempfile.TemporaryDirectory() as folder:
            drawn = draw(seed)
            types.update(set(drawn.types))
            end, words = ending(written(drawn, Path(folder)), more=seed % 3 == 0)
        ends[end] += 1
        if end in ("fault", "stopped") or chosen.only is not None:
            sys.stdout.write(f"{seed}: {end}: {' '.join(words.split())[:400]}\n")
            sys.stdout.flush()
    told = ", ".join(f"{count} {end}" for end, count in ends.most_common())
    sys.stdout.write(f"{len(seeds)} valves of {len(types)} component types: {told}\n")
    return int(ends["fault"] > 0)


if __name__ == "__main__":
    raise SystemExit(main())
