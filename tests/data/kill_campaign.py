"""Kill commands with SIGKILL at random moments, half of them while they write.

``python kill_campaign.py FOLDER COUNT SEED [COMMAND ...]``; a program of its own, since it forks.
Each command writes in turn one of two results that differ, so that a mixture of both is seen.  Of
each pair of kills one comes at a random time of the run, one at a random time after a stage has
appeared beside the results.  Prints one JSON object: for each command how many kills met a running
process, how many of these while a stage was there, and everything that was not as it should be.
"""

import json
import os
import random
import shutil
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path

DATA = Path(__file__).parent
NEEDLE = DATA.parents[1] / "docs" / "how-to" / "guided_needle.yaml"
PATIENCE = 300.0  # s


def forked(act: Callable[[], object]) -> int:
    """Process that does something, without a word, and ends with its code."""
    child = os.fork()
    if child:
        return child
    code = 1
    try:
        log = os.open("words.txt", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.dup2(log, 1)
        os.dup2(log, 2)
        found = act()
        code = found if isinstance(found, int) else 0
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        os._exit(code)


def ended(child: int) -> int:
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def run(words: list[str]) -> int:
    from klack.cli.main import main

    return ended(forked(lambda: main(words)))


# --------------------------------------------------------------------------- what is killed


def prepare() -> None:
    """Cases and results that differ, and commands that have filled the cache."""
    sys.path.insert(0, str(DATA.parent))
    from rigid_valve import write_bench

    text = (DATA / "tiny_rods.yaml").read_text()
    for name, speed in (("a", "1 m/s"), ("b", "2 m/s")):
        Path(name).mkdir()
        Path(name, "rods.yaml").write_text(text.replace("1 m/s", speed))
        words = ["impact", f"{name}/rods.yaml", "--no-certify", "--no-report", "-q"]
        assert run([*words, "--out", f"result-{name}"]) == 0
    Path("bench").mkdir()
    write_bench(Path("bench").absolute(), 3, 2)
    Path("bench/b.yaml").write_text(Path("bench/valve.yaml").read_text() + "\n# another text\n")


def words_of(command: str, name: str) -> list[str]:
    """Arguments that write the result ``a`` or ``b``."""
    calibrated = "bench/valve.yaml" if name == "a" else "bench/b.yaml"
    strokes = ["--measurement", "bench/strokes.csv", "--workers", "1"]
    one = ("--workers", "1", "--threads", "1")
    seed = "1" if name == "a" else "2"
    return {
        "impact": ["impact", f"{name}/rods.yaml", "--no-certify", "--no-report"],
        "noise": ["noise", f"result-{name}", "--no-report"],
        "shots": ["shots", str(NEEDLE), "--shots", "2", *one, "--seed", seed, "--no-report"],
        "calibrate": ["calibrate", calibrated, *strokes, "--no-report"],
        "csv": ["export", f"result-{name}", "--to", "csv"],
        "netcdf": ["export", f"result-{name}", "--to", "netcdf"],
        "report": ["report", f"result-{name}"],
    }[command]


def contents(folder: Path) -> dict[str, bytes]:
    """Files in their place by name; of stores, the numbers without times of the clock."""
    found = {}
    for path in sorted(folder.rglob("*")):
        name = str(path.relative_to(folder))
        if path.is_file() and not name.startswith(".klack-"):
            found[name] = path.read_bytes()
    return found


def kind(out: Path, command: str, whole: dict[str, dict[str, bytes]]) -> str:
    """Which of the two results stands in a folder: a, b, none or mixed."""
    from klack.analyses.catalogue import load_result
    from klack.analyses.ending import is_result
    from klack.analyses.noise.analysis import NOISE
    from klack.errors import InputError
    from klack.files.whole import completed

    there = contents(completed(out))
    logs = {name: there.pop(name) for name in list(there) if "unfinished" in name}
    if not there:
        return "none"
    if command in ("csv", "netcdf", "report"):
        return next((name for name in "ab" if there == whole[name]), "mixed")
    names = {name.split("/")[0] for name in there}
    if names != {name.split("/")[0] for name in whole["a"]} or not is_result(out):
        return f"mixed: {sorted(names)}, {sorted(logs)}"
    try:
        study = load_result(out)
    except InputError as error:
        return f"mixed: {error}"
    beside = {n: d for n, d in there.items() if not n.startswith("result.zarr")}
    for name in "ab":
        of_it = {n: d for n, d in whole[name].items() if not n.startswith("result.zarr")}
        case = words_of(command, name)[1]
        if command in ("impact", "calibrate"):
            same = study.case_text == Path(case).read_text()
        elif command == "shots":
            same = study.seed == {"a": 1, "b": 2}[name]
        else:
            reference = load_result(Path(f"{command}-{name}"))
            same = NOISE.to_json(study) == NOISE.to_json(reference)
        if same and (command == "calibrate" or beside == of_it):
            return name
    return "mixed"


def campaign(command: str, count: int, draw: random.Random) -> dict:
    from klack.cli.main import main

    whole, duration, writing_time = {}, 0.0, 0.0
    for name in "ab":
        begin = time.monotonic()
        words = [*words_of(command, name), "-q", "--out", f"{command}-{name}"]
        child = forked(lambda words=words: main(words))
        first = None
        while not os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT):
            if first is None and any(Path(f"{command}-{name}").glob(".klack-*")):
                first = time.monotonic()
            time.sleep(0.001)
        assert ended(child) == 0, (command, name, Path("words.txt").read_text()[-2000:])
        duration = time.monotonic() - begin
        writing_time = time.monotonic() - (first or begin)
        whole[name] = contents(Path(f"{command}-{name}"))
    out = Path(f"{command}-out")
    run([*words_of(command, "a"), "-q", "--out", str(out)])
    found: dict = {"kills": 0, "while_writing": 0, "wrong": [], "new": 0, "old": 0}
    before = "a"
    while found["kills"] < count:
        name = "b" if before == "a" else "a"
        aimed = found["kills"] % 2 == 1
        began = time.monotonic()
        words = [*words_of(command, name), "-q", "--out", str(out)]
        child = forked(lambda words=words: main(words))
        wait = draw.random() * (writing_time if aimed else duration)
        while time.monotonic() - began < PATIENCE:
            if aimed and any(out.glob(".klack-*")):
                time.sleep(wait)
                break
            if not aimed and time.monotonic() - began > wait:
                break
            if os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT):
                break
            time.sleep(0.0005)
        os.kill(child, signal.SIGKILL)
        writing = any(out.glob(".klack-*"))
        code = ended(child)
        if code == -signal.SIGKILL:
            found["kills"] += 1
            found["while_writing"] += writing
        elif code != 0:
            found["wrong"].append(f"exit code {code}")
        reader, writer = os.pipe()
        look = forked(lambda w=writer: os.write(w, kind(out, command, whole).encode()) and 0)
        os.close(writer)
        with os.fdopen(reader) as stream:
            after = stream.read()
        ended(look)
        if after not in (before, name):
            found["wrong"].append(f"kill {found['kills']}: {after!r} after {before} and {name}")
            run(words)
            after = name
        found["old" if after == before else "new"] += 1
        before = after
    code = run([*words_of(command, "a"), "-q", "--out", str(out)])
    if code or set(contents(out)) != set(whole["a"]) or list(out.glob(".klack-*")):
        found["wrong"].append(f"at the end: {code}, {sorted(os.listdir(out))}")
    return found


def main() -> None:
    folder, count, seed = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    folder.mkdir(parents=True)
    os.chdir(folder)
    os.environ["KLACK_CACHE"] = str(folder.absolute() / "cache")
    sys.path.insert(0, str(DATA))
    from crash_points import warm

    warm()
    prepare()
    commands = sys.argv[4:] or ["impact", "noise", "shots", "calibrate", "csv", "netcdf", "report"]
    draw = random.Random(seed)
    found = {}
    for name in commands:
        found[name] = campaign(name, count, draw)
        print(name, found[name], file=sys.stderr, flush=True)
    print(json.dumps(found))
    shutil.rmtree("cache", ignore_errors=True)


if __name__ == "__main__":
    main()
