"""Run whole commands on cases whose numbers were changed at random, and judge what they say.

``python command_campaign.py FOLDER COUNT SEED``; a program of its own.  Small coarse cases are
changed in what they mean, not in how they are written: numbers of any size, parts that are missing,
references to something else.  One case in twenty is taken as it comes, the others are drawn until
the reader takes them.  Each goes through ``impact``, ``reduce``, ``inspect`` or ``stroke`` in
another process, with a time limit.  Prints one JSON object: for each command how often there was an
answer (and how often one with a note), an error (exit code 2), a failed run (exit code 1), and
under ``wrong`` everything else: internal errors, hangs, warnings of Python, numbers that are none
beside exit code 0, and energy residuals above 1e-6 without a note.
"""

import copy
import json
import os
import random
import re
import select
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

DATA = Path(__file__).parent
ROOT = DATA.parents[1]
PATIENCE = 60.0  # s; usual is one
NO_NUMBER = re.compile(r"(?<![\w./-])[+-]?(nan|inf|infinity)\b(?!\w)", re.IGNORECASE)
QUANTITY = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)( ?\S.*)?")
# numbers that say how long a run takes: they stay near what they are
COSTLY = {"size", "contact", "surfaces", "extent", "layers", "duration", "step", "reduced_step",
          "full_step", "record", "coarse", "points", "pool"}  # fmt: skip
RESIDUAL = 1e-6


def sources() -> dict[str, dict]:
    """Small cases by name: those of the tests, and shipped ones that are made coarse and short."""

    def read(path: str) -> dict:
        text = (ROOT / path).read_text(encoding="utf-8")
        return json.loads(json.dumps(YAML(typ="safe", pure=True).load(text)))

    found = {
        "rods": read("tests/data/tiny_rods.yaml"),
        "ball": read("tests/data/small_ball.yaml"),
        "needle": read("cases/demo-valve-axisymmetric/case.yaml"),
        "small valve": read("docs/how-to/small_valve.yaml"),
        "demo stroke": read("cases/demo-stroke/case.yaml"),
    }
    for body in found["needle"]["bodies"].values():
        body["mesh"] = {"size": "2 mm", "contact": {"size": "0.02 mm", "extent": "0.045 mm"}}
    found["needle"]["reduction"]["modes"] = {"needle": {"count": 8}, "housing": {"count": 8}}
    for body in found["demo stroke"]["bodies"].values():
        body["mesh"] = {"size": "3 mm"}
    found["demo stroke"]["run"] |= {"duration": "0.2 ms", "step": "100 ns"}
    found["small valve"]["run"] |= {"duration": "0.5 ms", "step": "50 ns"}
    magnet = found["small valve"]["network"]["components"]["magnet"]
    magnet["time"] = ["10 us", "11 us", "250 us", "251 us"]
    return found


def words_of(command: str, name: str) -> list[str]:
    """Command line after the name of the case."""
    if command == "impact":
        return ["--level", "reduced", "--no-report", "--no-certify", "--out", "out"]
    if command == "stroke":
        variant = "wet-lumped" if name == "demo stroke" else "wet,dry"
        return ["--variant", variant, "--no-report", "--out", "out"]
    return ["--out", "out"] if command == "reduce" else []


PLAN = [
    *(("impact", name) for name in ("rods", "ball", "needle", "ball")),
    *(("stroke", name) for name in ("small valve", "demo stroke", "small valve", "small valve")),
    *(("reduce", name) for name in ("rods", "needle")),
    *(("inspect", name) for name in ("ball", "small valve")),
]


# --------------------------------------------------------------------------- what is changed


def places(tree: Any, path: tuple = ()) -> Iterator[tuple]:
    """Paths of all values and sections."""
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
        yield (*path, key)
        if isinstance(value, dict | list):
            yield from places(value, (*path, key))


def parent(tree: Any, path: tuple) -> Any:
    for key in path[:-1]:
        tree = tree[key]
    return tree


def number(value: object) -> re.Match | None:
    return None if isinstance(value, bool) else QUANTITY.fullmatch(str(value))


def readable(tree: dict, draw: random.Random) -> dict:
    """Change a case, mostly so that the reader takes it."""
    from klack.case.any_case import read_any_case
    from klack.errors import InputError

    for _ in range(100):
        made = changed(tree, draw)
        if draw.random() < 0.05:
            return made
        try:
            read_any_case(json.dumps(made), Path("case.yaml"))
        except InputError:
            continue
        return made
    return tree


def changed(tree: dict, draw: random.Random) -> dict:
    """Change one to four things of a case."""
    tree = copy.deepcopy(tree)
    for _ in range(draw.randint(1, 4)):
        every = [path for path in places(tree) if path[0] not in ("klack", "title", "description")]
        numbers = [path for path in every if number(parent(tree, path)[path[-1]])]
        words = [
            path
            for path in every
            if isinstance(word := parent(tree, path)[path[-1]], str) and not number(word)
        ]
        how = draw.choices(("scale", "drop", "word"), weights=(14, 3, 1))[0]
        if how == "scale":
            scale(tree, draw.choice(numbers), draw)
        elif how == "drop":
            path = draw.choice([path for path in every if len(path) > 2])
            del parent(tree, path)[path[-1]]
        else:
            a, b = draw.sample(words, 2)
            parent(tree, a)[a[-1]] = parent(tree, b)[b[-1]]
    return tree


def scale(tree: dict, path: tuple, draw: random.Random) -> None:
    """Give a number another size or sign."""
    section, key = parent(tree, path), path[-1]
    match = number(section[key])
    assert match is not None
    if COSTLY & {part for part in path if isinstance(part, str)} and path[0] in ("bodies", "run"):
        factor = 10 ** draw.uniform(-0.15, 0.5)
    elif draw.random() < 0.5:
        factor = 10 ** draw.uniform(-1, 1)
    else:
        factor = draw.choice([0.0, -1.0, 1e3, 1e-3, 1e6, 1e-6, 10 ** draw.uniform(-9, 9)])
    value = float(match[1]) * factor
    if isinstance(section[key], str):
        section[key] = f"{value:.6g}{match[2] or ''}"
    else:
        section[key] = round(value) if isinstance(section[key], int) else float(f"{value:.6g}")


# --------------------------------------------------------------------------- what comes out


class Worker:
    """A process that runs one command after the other; a new one after a hang or a death."""

    def __init__(self) -> None:
        self.process: subprocess.Popen[bytes] | None = None

    def run(self, words: list[str], folder: Path) -> int | None:
        """Exit code of a command, that of the worker if it died of it; None if it does not end."""
        if self.process is None:
            self.process = subprocess.Popen(
                [sys.executable, __file__, "serve"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                start_new_session=True,
            )
        process = self.process
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(json.dumps([str(folder), words]).encode() + b"\n")
        process.stdin.flush()
        if not select.select([process.stdout], [], [], PATIENCE)[0]:
            self.end()
            return None
        answer = process.stdout.readline()
        if answer:
            return int(answer)
        self.process = None
        return process.wait()

    def end(self) -> None:
        if self.process is not None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
            self.process = None


def serve() -> None:
    """Run the commands that come line by line; their words go to a file in their folder."""
    from klack.cli.main import main

    answers = os.dup(1)
    for line in sys.stdin:
        folder, words = json.loads(line)
        os.chdir(folder)
        log = os.open("words.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(log, 1)
        os.dup2(log, 2)
        os.close(log)
        code = main(words)
        sys.stdout.flush()
        os.write(answers, f"{code}\n".encode())


def values(tree: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
        if isinstance(value, dict | list):
            yield from values(value, f"{path}.{key}")
        else:
            yield f"{path}.{key}", value


def faults(code: int | None, said: str, made: Path) -> list[str]:
    """What a command may never do."""
    if code is None:
        return ["hang"]
    found = []
    if code not in (0, 1, 2):
        found.append(f"exit code {code}")
    if "Traceback (most recent" in said or "internal error" in said:
        found.append("traceback")
    if re.search(r"\w+Warning: ", said):
        found.append("warning of Python")
    if code == 0 and NO_NUMBER.search(said):
        found.append("no number in the words")
    if made.exists():
        numbers = dict(values(json.loads(made.read_text())))
        odd = [key for key, value in numbers.items() if value != value or abs_of(value) == 1e999]
        if odd and code == 0:
            found.append(f"no number in {odd[:3]}")
        large = [
            key
            for key, value in numbers.items()
            if "residual" in key and (value is None or abs_of(value) > RESIDUAL)
        ]
        if large and code == 0 and "energy" not in notes(said):
            found.append(f"residual without a word: {large[:3]}")
    elif code == 0:
        found.append("no JSON")
    return found


def abs_of(value: object) -> float:
    return abs(value) if isinstance(value, int | float) else 0.0


def notes(said: str) -> str:
    return "\n".join(line for line in said.splitlines() if re.search(r"\bnote:", line, re.I))


def campaign(folder: Path, count: int, seed: str) -> dict:
    cases, worker = sources(), Worker()
    for command, name in dict.fromkeys(PLAN[:count]):  # compile, outside of the limit
        place = folder / "warm"
        place.mkdir()
        (place / "case.yaml").write_text(json.dumps(cases[name]))
        words = [command, "case.yaml", *words_of(command, name), "--json", "made.json"]
        assert worker.run(words, place) in (0, None), (command, name)
        shutil.rmtree(place)
    found: dict = {command: Counter() for command, _ in PLAN}
    wrong = []
    for index in range(count):
        draw = random.Random(f"{seed}-{index}")
        command, name = PLAN[index % len(PLAN)]
        place = folder / "now"
        place.mkdir()
        (place / "case.yaml").write_text(json.dumps(readable(cases[name], draw), indent=1))
        words = [command, "case.yaml", *words_of(command, name), "--json", "made.json"]
        began = time.monotonic()
        code = worker.run(words, place)
        said = (place / "words.txt").read_text(errors="replace")
        bad = faults(code, said, place / "made.json")
        kind = {0: "answer", 1: "failed run", 2: "error"}.get(code, "other")  # type: ignore[arg-type]
        found[command][kind] += 1
        if code == 0 and notes(said):
            found[command]["of these with a note"] += 1
        if bad:
            wrong.append({"draw": index, "command": command, "case": name, "faults": bad})
            shutil.copytree(place, folder / f"wrong-{index}")
        line = f"{index} {command} {name}: {code} {time.monotonic() - began:.1f} s {bad or ''}\n"
        with (folder / "log.txt").open("a") as log:
            log.write(line + (said[:600] + "\n" if code in (1, 2) else ""))
        shutil.rmtree(place)
    worker.end()
    return {**{command: dict(counts) for command, counts in found.items()}, "wrong": wrong}


def main() -> None:
    if sys.argv[1] == "serve":
        return serve()
    folder = Path(sys.argv[1]).absolute()
    folder.mkdir(parents=True)
    os.environ |= {"KLACK_CACHE": "off", "OMP_NUM_THREADS": "1"}
    print(json.dumps(campaign(folder, int(sys.argv[2]), sys.argv[3]), indent=1))


if __name__ == "__main__":
    main()
