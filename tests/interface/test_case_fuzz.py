"""Damaged and hostile case files: a case, or one clear error in bounded time and memory.

Every shipped case is changed as text (lines, indentation, numbers, bytes) and as a tree (each value
in turn becomes something nasty; numbers, units, keys, references and types change).
Longer: ``KLACK_LONG=100``, another ``KLACK_SEED=2``.
"""

import json
import os
import random
import resource
import shutil
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from mutated_cases import NASTY, changed, leaves, mutated
from ruamel.yaml import YAML

from klack.case import shipped_cases
from klack.case.any_case import load_any_case, read_any_case
from klack.errors import InputError

LONGER = int(os.environ.get("KLACK_LONG", "1"))
SEED = int(os.environ.get("KLACK_SEED", "1"))
HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
CASES = [*shipped_cases().values(), *sorted(HOW_TO.glob("*.yaml"))]
PATIENCE = 20.0  # s of processor time, on a slow machine; usual are 0.05 s


def outcome(read: Any) -> None:
    """Read; only our own error may come out, with a place, and it may not take for ever."""
    begin = time.process_time()
    said: InputError | None = None
    try:
        read()
    except InputError as error:
        said = error
    if said is not None:
        assert all((said.where, said.got, said.expected, said.hint))
        assert "valve.yaml" in said.where or "(of '" in said.where, str(said)  # of a part
        assert len(str(said)) < 3000, str(said)
    assert time.process_time() - begin < PATIENCE


@pytest.mark.slow
@pytest.mark.parametrize("path", CASES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_each_value_becomes_something_nasty(path: Path):
    """Not all pairs of value and place in every run: another ten for each case."""
    tree = YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
    places = list(leaves(tree))
    draw = random.Random(f"{path}{SEED}")
    for _ in range(12 * LONGER):
        text = changed(tree, draw.choice(places), draw.choice(NASTY))
        outcome(lambda text=text: read_any_case(text, path.with_name("valve.yaml")))


@pytest.mark.slow
def test_each_key_goes_or_comes_twice():
    path = shipped_cases()["demo-stroke"]
    tree = YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
    draw = random.Random(SEED)
    for place in draw.sample(list(leaves(tree)), min(20 * LONGER, 150)):
        whole = json.loads(json.dumps(tree))
        section = whole
        for key in place[:-1]:
            section = section[key]
        value = section.pop(place[-1])
        outcome(lambda whole=whole: read_any_case(json.dumps(whole), path.with_name("valve.yaml")))
        if isinstance(section, dict):
            section[f"{place[-1]}x"] = value
            outcome(lambda w=whole: read_any_case(json.dumps(w), path.with_name("valve.yaml")))


@pytest.mark.slow
@pytest.mark.parametrize("batch", range(4))
def test_mutated_cases(batch: int, tmp_path: Path):
    """Bytes, lines, values, numbers, units, keys, references, types; see mutated_cases.py."""
    draw = random.Random(f"{SEED}-{batch}")
    sources = [path.read_bytes() for path in CASES]
    for k, path in enumerate(CASES):
        shutil.copytree(path.parent, tmp_path / str(k), ignore=shutil.ignore_patterns("*.md"))
    for _ in range(25 * LONGER):
        k = draw.randrange(len(CASES))
        path = tmp_path / str(k) / "valve.yaml"
        path.write_bytes(mutated(sources[k], draw))
        outcome(lambda path=path: load_any_case(path))


@pytest.mark.parametrize("name", ["a" * 5_000, "b/" * 3_000, "case.yaml/x"])
def test_a_file_name_that_the_system_refuses_is_one_error(name: str):
    """Truth = the key of the case in the message, whatever the system says about the name."""
    path = shipped_cases()["needle-from-inp"]
    tree = YAML(typ="safe", pure=True).load(path.read_text(encoding="utf-8"))
    place = next(place for place in leaves(tree) if place[-1] == "file")
    with pytest.raises(InputError, match=r"file: got '[^\n]*file that") as caught:
        read_any_case(changed(tree, place, name), path.with_name("case.yaml"))
    assert len(str(caught.value)) < 1500


HOSTILE = {
    "laughs": "a: &a [x, x, x, x, x, x, x, x, x]\n"
    + "".join(f"{b}: &{b} [{', '.join(['*' + a] * 9)}]\n" for a, b in pairwise("abcdefghi")),
    "merged laughs": "a: &a {k0: 1}\n"
    + "".join(
        f"{b}: &{b}\n  <<: [{', '.join(['*' + a] * 9)}]\n  k{b}: {{<<: *{a}}}\n"
        for a, b in pairwise("abcdefghijklmnopqrstuvwx")
    ),
    "itself": "a: &a\n  b: *a\n",
    "itself merged": "a: &a {<<: *a}\n",
    "open brackets": "klack: 1\nx: " + "[" * 5_000,
    "point far away": "bodies: {a: {geometry: {profile: {parts: {a: {centre: [0, 1e308]}}}}}}\n",
    "long speed": "motion: {speed: " + "9" * 400 + "}\n",
    "deep lists": "a: " + "[" * 20_000,
    "deep closed lists": "a: " + "[" * 3_000 + "]" * 3_000,
    "deep blocks": "".join(f"{' ' * i}a:\n" for i in range(900)),
    "long key": "? " + "k" * 500_000 + "\n: 1\n",
    "long number": "klack: " + "9" * 400_000,
    "long number in hex": "klack: 0x" + "f" * 400_000,
    "long fraction": "klack: 0." + "1" * 400_000,
    "long quantity": "motion: {speed: '" + "9" * 400_000 + " m/s'}",
    "many keys": "".join(f"k{i}: 1\n" for i in range(60_000)),
    "many documents": "---\na: 1\n" * 50_000,
    "comments": "# \n" * 300_000 + "klack: 1\n",
    "anchors": "".join(f"- &a{i} 1\n" for i in range(50_000)),
    "code": 'klack: !!python/object/apply:os.system ["touch hacked"]\n',
    "new code": 'klack: !!python/object/new:os.system ["touch hacked"]\n',
    "module": "klack: !!python/module:antigravity\n",
    "directive": "%TAG ! tag:yaml.org,2002:python/\n---\nklack: !object/apply:os.abort []\n",
    "colons": "a" + ": b" * 100_000,
    "quotes": "a: '" + "''" * 200_000,
    "spaces": "a:" + " " * 900_000 + "1",
    "tabs": "a:\n" + "\t" * 900_000 + "b: 1",
    "folded": "a: >\n" + "  x\n\n" * 100_000,
}


def confined() -> None:
    """Half a gigabyte beyond the program itself, and a minute."""
    resource.setrlimit(resource.RLIMIT_AS, (2 * 2**30, 2 * 2**30))
    resource.setrlimit(resource.RLIMIT_CPU, (120, 120))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="limits of a process")
def test_hostile_files_in_a_confined_process(tmp_path: Path):
    """Bombs of aliases, depth and length, and tags that would run code."""
    for name, text in HOSTILE.items():
        (tmp_path / f"{name}.yaml").write_text(text[:990_000], encoding="utf-8")
    (tmp_path / "too large.yaml").write_bytes(b"klack: 1\n" * 1_200_000)
    program = (
        "import sys, time, pathlib\n"
        "from klack.case.any_case import load_any_case\n"
        "from klack.errors import InputError\n"
        "for path in sorted(pathlib.Path('.').glob('*.yaml')):\n"
        "    begin = time.process_time()\n"
        "    try:\n"
        "        load_any_case(path)\n"
        "        print(path, 'READ')\n"
        "    except InputError as error:\n"
        "        assert path.name in error.where and len(str(error)) < 3000, str(error)[:500]\n"
        "    except Exception as error:\n"
        "        print(path, 'READ', repr(error)[:200])\n"
        "    took = time.process_time() - begin\n"
        "    print(path.stem, f'{took:.1f}', 'SLOW' if took > 20 else '')\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        preexec_fn=confined,
        env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )

    assert done.returncode == 0, done.stderr[-2000:] + done.stdout[-300:]
    assert "READ" not in done.stdout, done.stdout
    assert len(done.stdout.splitlines()) == len(HOSTILE) + 1
    assert "SLOW" not in done.stdout, done.stdout
    assert not (tmp_path / "hacked").exists()


def test_half_a_letter_is_no_text():
    """A lone surrogate, which JSON and YAML can write and no file name or terminal can take."""
    text = CASES[0].read_text(encoding="utf-8")
    for put in ('"\\ud800"', '"a\\0b"'):
        with pytest.raises(InputError, match="without such characters"):
            read_any_case(text.replace("klack: 1", f"klack: {put}", 1), Path("valve.yaml"))


@pytest.mark.parametrize(
    ("line", "words"), [("%YAML 3.0", "another version"), ("[[[[1]]]]: 1", "as a key")]
)
def test_what_the_parser_stumbles_over_is_no_yaml(line, words):
    """Found by long runs: it raised KeyError and TypeError of its own."""
    with pytest.raises(InputError, match=words):
        read_any_case(f"klack: 1\n{line}\ntitle: x\n", Path("valve.yaml"))
