"""Tamper with stored results and entries of the cache, and look at what klack makes of them.

``python tampered_stores.py RESULT FOLDER COUNT SEED``: a result of ``klack impact``, an empty
folder.  Whoever tampers here also repairs the checksums, as an attacker would: half of the changes
keep them right.  Prints one JSON object: how many changes were refused, read with the very numbers
that were stored, or read with others although a checksum says so; and everything else, which is
wrong.
"""

import json
import os
import random
import shutil
import sys
import time
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np

PATIENCE = 30.0  # s
ODD = (None, True, -1, 0, 10**30, 1e308, "NaN", "Infinity", "", "x" * 5000, [], {}, [[]], "..")


def changed_words(value: Any, draw: random.Random) -> Any:
    """Replace, remove or double one part of plain data, anywhere in it."""
    if isinstance(value, dict) and value and draw.random() < 0.85:
        key = draw.choice(list(value))
        how = draw.random()
        if how < 0.15:
            return {name: item for name, item in value.items() if name != key}
        if how < 0.25:
            return {**value, draw.choice(["..", "a/b", "", "values"]): value[key]}
        return {**value, key: changed_words(value[key], draw)}
    if isinstance(value, list) and value and draw.random() < 0.85:
        i = draw.randrange(len(value))
        return [*value[:i], changed_words(value[i], draw), *value[i + 1 :]]
    if isinstance(value, (int, float)) and draw.random() < 0.5:
        return draw.choice([value * 2, -value, value + 1, 10**12, float(value) * 1.0001])
    return draw.choice(ODD)


def tamper(store: Path, draw: random.Random) -> str:
    """Change one thing; with right checksums where the change is in words of a group."""
    files = sorted(path for path in store.rglob("*") if path.is_file())
    file = draw.choice(files)
    how = draw.choice(["bytes", "cut", "gone", "words", "signed", "special", "numbers"])
    if how in ("words", "signed", "numbers"):
        file = draw.choice([path for path in files if path.name == "zarr.json"])
        about = json.loads(file.read_text())
        if how == "numbers":
            about = changed_shape(about, draw)
        elif how == "signed" and isinstance(about.get("attributes", {}).get("values"), dict):
            words = about["attributes"]
            words["values"] = changed_words(words["values"], draw)
            text = json.dumps([words["values"], words["order"]], sort_keys=True)
            words["crc32"] = crc32(text.encode())
        else:
            about = changed_words(about, draw)
        file.write_text(json.dumps(about))
    elif how == "special":
        file.unlink()
        draw.choice([os.mkfifo, os.mkdir, lambda path: os.symlink("/dev/zero", path)])(file)
    elif how == "gone":
        file.unlink()
    else:
        raw = bytearray(file.read_bytes())
        if how == "cut":
            raw = raw[: draw.randrange(len(raw) + 1)]
        for _ in range(draw.randrange(1, 20) if raw else 0):
            raw[draw.randrange(len(raw))] = draw.randrange(256)
        file.write_bytes(raw)
    return f"{how} {file.relative_to(store)}"


def changed_shape(about: Any, draw: random.Random) -> Any:
    """Give an array another shape, type or filling."""
    if about.get("node_type") != "array":
        return changed_words(about, draw)
    shape = draw.choice([[10**12], [10**6, 10**6], [0], [-1], [2**63], [1] * 70, about["shape"]])
    about["shape"] = shape
    if draw.random() < 0.5:
        about["chunk_grid"]["configuration"]["chunk_shape"] = shape
    if draw.random() < 0.3:
        about["data_type"] = draw.choice(["float32", "int64", "object", "bytes", "complex128"])
    if draw.random() < 0.3:
        about["fill_value"] = draw.choice(["NaN", "Infinity", 0, 1e308, None])
    return about


def in_a_child(act: Any) -> tuple[str, str]:
    """What a function says, from a process that must end by itself."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (20 * 10**9, 20 * 10**9))
        code = 1
        try:
            os.close(reader)
            os.write(writer, act().encode()[:4000])
            code = 0
        except BaseException as error:
            os.write(writer, f"traceback {type(error).__name__}: {error}".encode()[:4000])
        finally:
            os._exit(code)
    os.close(writer)
    begin = time.monotonic()
    while not os.waitid(os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT):
        if time.monotonic() - begin > PATIENCE:
            os.kill(child, 9)
            break
        time.sleep(0.002)
    with os.fdopen(reader) as stream:
        said = stream.read()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    return ("hang" if code == -9 else "died" if code not in (0, 1) else said.split()[0]), said


def digest(study: Any) -> str:
    from klack.analyses.impact.analysis import IMPACT

    return json.dumps(IMPACT.to_json(study), sort_keys=True)


def look(result: Path, whole: str) -> str:
    """Read a result as the commands do."""
    from klack.analyses.catalogue import load_result
    from klack.errors import KlackError

    try:
        study = load_result(result)
        return "same" if digest(study) == whole else "other"
    except KlackError as error:
        return "traceback in a message" if "Traceback" in str(error) else f"refused {error}"


def stores(result: Path, folder: Path, count: int, draw: random.Random) -> dict:
    from klack.analyses.catalogue import load_result

    whole = digest(load_result(result))
    found: dict = {"wrong": []}
    for _ in range(count):
        copy = folder / "copy"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(result, copy)
        what = tamper(copy / "result.zarr", draw)
        kind, said = in_a_child(lambda copy=copy: look(copy, whole))
        found[kind] = found.get(kind, 0) + 1
        if kind not in ("refused", "same") and not (kind == "other" and what.startswith("signed")):
            found["wrong"].append(f"{what}: {said}")
    return found


def entries(folder: Path, count: int, draw: random.Random) -> dict:
    """Entries of the cache: the stored numbers or none."""
    from klack.machine.cache.entry import Entry
    from klack.machine.cache.result_cache import ResultCache

    cache, key = ResultCache(folder / "cache", 10**9), "0" * 64
    array = np.random.default_rng(1).normal(size=(40, 30))
    cache.store(key, Entry(arrays={"x": array, "n": np.arange(50)}, text="words"))
    (path,) = cache.folder.glob("*.entry")
    raw = path.read_bytes()
    found: dict = {"wrong": []}

    def load() -> str:
        entry = cache.load(key, "test")
        if entry is None:
            return "refused"
        return "same" if entry.arrays["x"].tobytes() == array.tobytes() else "other"

    for _ in range(count):
        path.unlink(missing_ok=True)
        how = draw.choice(["bytes", "cut", "header", "pipe", "link", "longer"])
        if how == "pipe":
            os.mkfifo(path)
        elif how == "link":
            path.symlink_to("/dev/zero")
        else:
            new = bytearray(raw)
            if how == "cut":
                new = new[: draw.randrange(len(new))]
            elif how == "longer":
                new += draw.randbytes(draw.randrange(1, 100))
            else:
                last = 600 if how == "header" else len(new)
                for _ in range(draw.randrange(1, 10)):
                    new[draw.randrange(last)] = draw.randrange(256)
            path.write_bytes(new)
        kind, said = in_a_child(load)
        found[kind] = found.get(kind, 0) + 1
        if kind not in ("refused", "same"):
            found["wrong"].append(f"{how}: {said}")
    return found


def main() -> None:
    result, folder = Path(sys.argv[1]), Path(sys.argv[2])
    count, draw = int(sys.argv[3]), random.Random(int(sys.argv[4]))
    from crash_points import warm

    warm()
    folder.mkdir(parents=True, exist_ok=True)
    found = {"stores": stores(result, folder, count, draw)}
    found["entries"] = entries(folder, count, draw)
    print(json.dumps(found))


if __name__ == "__main__":
    main()
