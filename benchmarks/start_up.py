"""Time until klack answers: its help, its import, a first small impact, a first stroke, a page.

The page is that of ``klack app`` on an empty folder, in Chromium without a display that runs
already; it is left out where there is none.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter

import psutil
from number import Number, Size

__all__ = ["numbers"]

_CASES = Path(__file__).parents[1] / "cases"
_KLACK = [sys.executable, "-m", "klack"]


def numbers(size: Size) -> list[Number]:
    """Wall-clock of fresh processes; the interpreter's own start is part of all but the import."""
    repeats = {"smallest": 1, "quick": 2, "full": 7}[size]
    bare = _best([sys.executable, "-c", "pass"], repeats)
    found = [
        Number(name="klack --help", value=_best([*_KLACK, "--help"], repeats), unit="s", goal=0.5),
        Number(
            name="import klack",
            value=max(_best([sys.executable, "-c", "import klack"], repeats) - bare, 0.0),
            unit="s",
            goal=0.3,
        ),
    ]
    found += _processor(repeats)
    if size != "smallest":
        impact = [*_KLACK, "impact", "two-rods", "--level", "reduced", "--quiet"]
        name = "klack impact two-rods, reduced, with the report"
        found.append(Number(name=name, value=_with_output(impact, repeats), unit="s"))
        found += _pages(repeats)
    if size == "full":
        with tempfile.TemporaryDirectory() as cache:
            seconds = _with_output(impact, 1, NUMBA_CACHE_DIR=cache)
        found.append(Number(name="the same with nothing compiled yet", value=seconds, unit="s"))
        found += _strokes(repeats)
    return found


def _processor(repeats: int) -> list[Number]:
    """Processor time of short commands, everything compiled."""
    with tempfile.TemporaryDirectory() as folder:
        out, case = Path(folder) / "out", Path(folder) / "case.yaml"
        given = _CASES / "demo-stroke" / "case.yaml"
        case.write_text(f"netwerk: {{}}\n{given.read_text('utf-8')}", "utf-8")
        impact = [*_KLACK, "impact", "two-rods", "--level", "reduced", "--quiet", "--out", str(out)]
        load = f"import klack; klack.load_result({str(out)!r})"
        rows = {
            "klack --version": ([*_KLACK, "--version"], 0.15),
            "a misspelt key of a stroke": ([*_KLACK, "stroke", str(case)], 1.0),
            "klack impact two-rods, reduced": (impact, 3.0),
            "import klack, load_result of an impact": ([sys.executable, "-c", load], 1.5),
        }
        return [
            Number(
                name=f"{name}, processor time", value=_spent(words, repeats), unit="s", goal=goal
            )
            for name, (words, goal) in rows.items()
        ]


def _spent(command: list[str], repeats: int) -> float:
    """Least processor time [s] of a process and those that it starts."""
    spent = []
    for _ in range(repeats + 1):  # the first one compiles
        before = os.times()
        subprocess.run(command, check=False, capture_output=True)
        after = os.times()
        spent.append(sum(after[2:4]) - sum(before[2:4]))
    return min(spent[1:])


def _pages(repeats: int) -> list[Number]:
    """From the command to the first page, drawn with all that is on it."""
    program = shutil.which("chromium")
    if program is None or not all(map(find_spec, ("nicegui", "playwright"))):
        return []
    from playwright.sync_api import sync_playwright

    walls, spent = [], []
    with sync_playwright() as library, tempfile.TemporaryDirectory() as folder:
        browser = library.chromium.launch(executable_path=program, args=["--no-sandbox"])
        for _ in range(repeats + 1):  # the first one warms the caches of the machine
            page = browser.new_page()
            begin = perf_counter()
            with subprocess.Popen(
                [*_KLACK, "app", folder, "--no-open"], stdout=subprocess.PIPE, text=True
            ) as server:
                assert server.stdout is not None
                address = next(line.strip() for line in server.stdout if "http://" in line)
                page.goto(address)
                page.wait_for_selector("text=No case file")
                walls.append(perf_counter() - begin)
                used = psutil.Process(server.pid).cpu_times()
                spent.append(used.user + used.system)
                server.terminate()
            page.close()
        browser.close()
    name = "klack app, first page drawn"
    return [
        Number(name=name, value=min(walls[1:]), unit="s", goal=3.0),
        Number(name=f"{name}, processor time of the server", value=min(spent[1:]), unit="s"),
    ]


def _strokes(repeats: int) -> list[Number]:
    """The first stroke of an account, which meshes and compiles, and those after it."""
    stroke = [*_KLACK, "stroke", "demo-stroke", "--variant", "wet", "--quiet"]
    bare = [*stroke, "--no-report"]
    with tempfile.TemporaryDirectory() as cache:
        variables = {"NUMBA_CACHE_DIR": cache, "KLACK_CACHE": str(Path(cache) / "results")}
        first = _with_output(bare, 1, **variables)
        second = _with_output(bare, repeats, **variables)
        reported = _with_output(stroke, repeats, **variables)
    name = "klack stroke demo-stroke, wet"
    return [
        Number(name=f"{name}, nothing compiled yet", value=first, unit="s", goal=30.0),
        Number(name=f"{name}, second call", value=second, unit="s", goal=5.0),
        Number(name=f"{name}, second call with the report", value=reported, unit="s"),
    ]


def _best(command: list[str], repeats: int, **variables: str) -> float:
    best = float("inf")
    for _ in range(repeats):
        begin = perf_counter()
        subprocess.run(command, check=True, capture_output=True, env=os.environ | variables)
        best = min(best, perf_counter() - begin)
    return best


def _with_output(command: list[str], repeats: int, **variables: str) -> float:
    with tempfile.TemporaryDirectory() as folder:
        return _best([*command, "--out", str(Path(folder) / "out")], repeats, **variables)
