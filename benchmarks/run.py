"""Everything that klack promises about speed, measured.

``uv run --group dev python benchmarks/run.py`` runs it all.

Each part is a file of this folder and runs in a process of its own, so that its peak memory is its
own.  Results of former runs are not used: the cache of results is off.

A table goes to the terminal.  With ``--out FOLDER`` the folder gets ``numbers.json``, the figures,
and ``summary.md`` with both.  ``--quick`` takes smaller meshes and less than three minutes on two
quiet cores, all of it half an hour at most.  ``--compare OTHER.json`` says by which factor every
number has changed since a former run.  Numbers of a machine that is busy are worth little: the load
at the start of each part is written beside it.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from time import perf_counter
from typing import Any, get_args

from machine import describe_machine, peak_gigabytes
from number import Number, Size, number_of

__all__ = ["PARTS", "changes", "main", "measure"]

PARTS = {
    "start_up": "klack --help, import, first small impact, first stroke",
    "kernel": "the reduced time integration, beside its error",
    "modes": "the kernel over the number of modes",
    "limit": "bytes moved against the bandwidth of the machine",
    "reduced_peers": "solve_ivp, CVODE and FMPy on the same reduced model",
    "ngsolve_peer": "NGSolve: assembly and modes on the same mesh",
    "modal_peers": "SciPy with PARDISO, and CalculiX: factor and modes on the same mesh",
    "calculix": "CalculiX: an impact in 3-D on the same mesh",
    "growth": "every stage over degrees of freedom",
    "volumes": "the time loop over volumes, stops, bodies, contact points and duration",
    "stroke": "a whole valve in time; CVODE beside a small one",
    "stroke_off_axis": "a wet stroke in three dimensions, point by point",
    "many_strokes": "strokes per hour at many points, on threads",
    "study_workers": "points of a study on threads, processes and dask; new geometries per hour",
    "accuracy": "reduced against full order on the shipped cases",
    "reduction": "from a case to two reduced bodies",
    "big_body": "the same for a housing with ribs of up to a million degrees of freedom",
    "full_order": "the impact with every degree of freedom",
    "demo": "klack demo as a whole",
}
"""Parts in the order of a run, and what they measure."""


def measure(part: str, size: Size) -> list[Number]:
    """Measure one part in this process, and its peak memory."""
    found = import_module(part).numbers(size)
    return [*found, Number(name=f"part {part}: peak memory", value=peak_gigabytes(), unit="GB")]


def changes(now: list[Number], before: dict[str, Any]) -> list[str]:
    """Lines that lay the numbers of a former run beside those that it has as well."""
    lines = []
    for number in now:
        entry = before["numbers"].get(number.name)
        if entry is None or not entry["value"]:
            continue
        was = number_of(number.name, entry)
        values = f"{was.value:>11.4g}{number.value:>11.4g} {number.unit:<8}"
        lines.append(f"{number.name:<66}{values}{number.value / was.value:>7.3f}")
    return lines


def main(arguments: list[str] | None = None) -> int:
    """Measure all parts, print a table, write what was asked for."""
    args = _arguments(arguments)
    size: Size = "quick" if args.quick else args.size
    if args.write is not None:  # a process for one part
        _write(args.write, {number.name: number.entry() for number in measure(args.only[0], size)})
        return 0
    result: dict[str, Any] = {"machine": describe_machine(), "size": size, "parts": {}}
    numbers: list[Number] = []
    for part in args.only or PARTS:
        found, about = _in_own_process(part, size)
        result["parts"][part] = about
        print(f"\n{part}: {PARTS[part]} ({about['seconds']:.0f} s, load {about['load']:.1f})")
        print("\n".join(f"  {number.line()}" for number in found))
        if "left_out" in about:
            print(f"  {about['left_out']}")
        sys.stdout.flush()
        numbers += found
    result["numbers"] = {number.name: number.entry() for number in numbers}
    goals = [number for number in numbers if number.goal is not None]
    missed = [number for number in goals if not number.met]
    print(f"\n{len(goals) - len(missed)} goals met, {len(missed)} missed")
    print("\n".join(f"  {number.line()}" for number in missed))
    if args.compare is not None:
        print(f"\nbefore, now, now over before ({args.compare})")
        print("\n".join(changes(numbers, json.loads(args.compare.read_text()))))
    if args.json is not None:
        _write(args.json, result)
    if args.out is not None:
        from summary import write_summary

        write_summary(args.out, result)
        _write(args.out / "numbers.json", result)
        print(f"\n{args.out / 'summary.md'}")
    return int(any("left_out" in about for about in result["parts"].values()))


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="the short set: --size quick")
    parser.add_argument("--size", choices=get_args(Size), default="full")
    parser.add_argument(
        "--only", choices=tuple(PARTS), nargs="+", metavar="PART", help=f"of {', '.join(PARTS)}"
    )
    parser.add_argument("--json", type=Path, help="write all numbers to this file")
    parser.add_argument("--out", type=Path, help="folder for numbers, figures and summary")
    parser.add_argument("--compare", type=Path, help="numbers.json of a former run")
    parser.add_argument("--write", type=Path, help=argparse.SUPPRESS)
    return parser.parse_args(arguments)


def _in_own_process(part: str, size: Size) -> tuple[list[Number], dict[str, Any]]:
    """Numbers of a part, and how it was run; the run goes on without a part that fails."""
    load, begin = os.getloadavg()[0], perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "numbers.json"
        command = [sys.executable, str(Path(__file__).resolve()), "--only", part, "--size", size]
        run = subprocess.run(
            [*command, "--write", str(target)],
            capture_output=True,
            text=True,
            env=os.environ | {"KLACK_CACHE": "off"},
        )
        about = {"load": round(load, 2), "seconds": round(perf_counter() - begin, 1)}
        if run.returncode or not target.exists():
            last = (run.stderr.strip() or f"exit code {run.returncode}").splitlines()[-1]
            return [], about | {"left_out": f"failed: {last}"}
        entries = json.loads(target.read_text())
    found = [number_of(name, entry) for name, entry in entries.items()]
    return [replace(number, part=part) for number in found], about


def _write(path: Path, content: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(main())
