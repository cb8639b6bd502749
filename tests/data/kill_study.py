"""Kill ``klack study --workers 2`` and its workers with SIGKILL at random moments.

``python kill_study.py FOLDER COUNT SEED``: COUNT kills of the command, each followed by the same
command, and COUNT kills of workers of one more run.  Half of them come at a random time after the
start, while processes import and read, half after a random number of further points.  Prints one
JSON object: kills that met a running process, processes that outlived their command, and whether
the log of both has the lines of a run that nothing interrupted, each once.
"""

import json
import random
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import psutil

SMALL = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"
STUDY = """klack: 1
study:
  parameters:
    network.components.spring.preload: {from: 10 N, to: 14 N}
    network.components.needle.mass: {normal: {mean: 3 g, sd: 0.1 g}}
  measures: [opening_time, opening.peak_force]
  design: {points: POINTS}
  variant: dry
"""
START = 5.0  # [s] of a command, about
PATIENCE = 300.0  # [s]


def started(folder: Path, points: int) -> subprocess.Popen[bytes]:
    folder.mkdir(exist_ok=True)
    study = folder / "study.yaml"
    study.write_text(STUDY.replace("POINTS", str(points)))
    words = ["study", str(SMALL), "--study", str(study), "--workers", "2", "-q", "--no-report"]
    return subprocess.Popen(
        [sys.executable, "-m", "klack", *words, "--out", str(folder / "out")],
        stderr=(folder / "words.txt").open("ab"),
    )


def lines(folder: Path) -> list[str]:
    return [line for file in folder.glob("out/points-*") for line in file.read_text().splitlines()]


def wait_for(reached: Callable[[], bool]) -> bool:
    end = time.monotonic() + PATIENCE
    while not reached():
        if time.monotonic() > end:
            return False
        time.sleep(0.003)
    return True


def is_alive(process: psutil.Process) -> bool:
    return process.is_running() and process.status() != psutil.STATUS_ZOMBIE


def moment(
    command: subprocess.Popen[bytes],
    folder: Path,
    draw: random.Random,
    after_points: bool = False,
) -> None:
    """Wait for a random moment: of a start, or among the points."""
    of_start = draw.random() < 0.5
    if of_start and not after_points:
        time.sleep(draw.uniform(0.0, START))
        return
    wanted = len(lines(folder)) + draw.randrange(1, 20)
    wait_for(lambda: len(lines(folder)) >= wanted or command.poll() is not None)
    time.sleep(draw.uniform(0.0, 1.0 if of_start else 0.02))


def kill_commands(folder: Path, points: int, count: int, draw: random.Random) -> dict[str, int]:
    met = outlived = 0
    for _ in range(count):
        command = started(folder, points)
        moment(command, folder, draw)
        left = psutil.Process(command.pid).children(recursive=True)
        met += command.poll() is None
        command.kill()
        command.wait()
        end = time.monotonic() + 20.0
        while any(map(is_alive, left)) and time.monotonic() < end:
            time.sleep(0.01)
        outlived += sum(map(is_alive, left))
    assert started(folder, points).wait(PATIENCE) == 0, (folder / "words.txt").read_text()
    return {"met": met, "outlived": outlived}


def kill_workers(folder: Path, points: int, count: int, draw: random.Random) -> dict[str, int]:
    met = 0
    command = started(folder, points)
    while met < count and command.poll() is None:
        moment(command, folder, draw, after_points=True)
        try:
            found = [
                process
                for process in psutil.Process(command.pid).children()
                if "spawn_main" in " ".join(process.cmdline())
            ]
            if found:
                draw.choice(found).kill()
                met += 1
        except psutil.NoSuchProcess:
            continue
    assert command.wait(PATIENCE) == 0, (folder / "words.txt").read_text()
    return {"met": met}


def main() -> None:
    folder, count, draw = Path(sys.argv[1]), int(sys.argv[2]), random.Random(int(sys.argv[3]))
    points = 1 << (60 * count).bit_length()
    folder.mkdir(exist_ok=True)
    assert started(folder / "whole", points).wait(PATIENCE) == 0
    whole = sorted(lines(folder / "whole"))
    found = {
        "points": points,
        "commands": kill_commands(folder / "commands", points, count, draw),
        "workers": kill_workers(folder / "workers", points, count, draw),
    }
    same = {name: sorted(lines(folder / name)) == whole for name in ("commands", "workers")}
    once = len(set(whole)) == len(whole) == points + 2
    print(json.dumps(found | {"same": same, "each once": once}))


if __name__ == "__main__":
    main()
