"""Damaged STEP files: solids or one clear error; OpenCASCADE itself breaks on one in six.

Longer: ``KLACK_LONG=50``, another ``KLACK_SEED=2``.
"""

import os
import random
import re
import subprocess
from pathlib import Path

import pytest

from klack.errors import InputError
from klack.mesh import step_trial
from klack.mesh.solid import read_step
from klack.mesh.step_trial import require_readable_step

LONGER = int(os.environ.get("KLACK_LONG", "1"))
SEED = int(os.environ.get("KLACK_SEED", "1"))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    from netgen.occ import Box, Cylinder, Pnt, Z

    path = tmp_path_factory.mktemp("step") / "part.step"
    part = Box(Pnt(0, 0, 0), Pnt(1, 1, 1)) + Cylinder(Pnt(0.5, 0.5, 0), Z, r=0.3, h=2)
    part.WriteStep(str(path))
    return path.read_bytes()


def damaged(raw: bytes, draw: random.Random) -> bytes:
    """Change some digits or bytes, leave a line out, cut the end off, or change one number."""
    data = bytearray(raw)
    how = draw.choice(["digits", "bytes", "line", "cut", "number"])
    if how == "line":
        lines = raw.split(b"\n")
        del lines[draw.randrange(len(lines))]
        return b"\n".join(lines)
    if how == "cut":
        return raw[: draw.randrange(len(raw))]
    if how == "number":
        place = draw.choice(list(re.finditer(rb"-?\d+\.\d*", raw)))
        value = draw.choice([b"nan", b"1e300", b"0.", b"-1.", b"inf"])
        return raw[: place.start()] + value + raw[place.end() :]
    places = [i for i, sign in enumerate(raw) if how == "bytes" or chr(sign).isdigit()]
    for place in draw.sample(places, draw.randint(1, 5)):
        data[place] = draw.randrange(256) if how == "bytes" else ord(draw.choice("0123456789"))
    return bytes(data)


@pytest.mark.slow
def test_damaged_files(whole: bytes, tmp_path: Path):
    """Unread, one of them would end the process of these tests."""
    draw = random.Random(SEED)
    path = tmp_path / "part.step"
    refused = 0
    for _ in range(10 * LONGER):
        path.write_bytes(damaged(whole, draw))
        try:
            assert read_step(path).solids
        except InputError:
            refused += 1
    assert 0 < refused


def test_a_lost_or_doubled_entity_is_named(whole: bytes, tmp_path: Path):
    """Of each that another one names; OpenCASCADE makes some other solid of what is left."""
    path, lines = tmp_path / "part.step", whole.split(b"\n")
    entities = {n: line for n, line in enumerate(lines) if line.startswith(b"#")}
    found = 0
    for n, line in entities.items():
        number = line.partition(b" ")[0]
        if not re.search(number + rb"[,)]", whole):
            continue
        found += 1
        path.write_bytes(b"\n".join(lines[:n] + lines[n + 1 :]))
        with pytest.raises(InputError, match=f"entity {number.decode()} is missing"):
            require_readable_step(path)
    assert found > 100
    path.write_bytes(b"\n".join([*lines[:n], line, *lines[n:]]))
    with pytest.raises(InputError, match=f"entity {number.decode()} is defined twice"):
        require_readable_step(path)


def test_a_face_without_area_is_refused(tmp_path: Path):
    """As one wrong digit makes it in the seam of a bore; the other faces keep theirs."""
    from netgen.occ import Cylinder, Pnt, Z

    path = tmp_path / "part.step"
    (Cylinder(Pnt(0, 0, 0), Z, r=3, h=10) - Cylinder(Pnt(0, 0, -1), Z, r=1, h=5)).WriteStep(
        str(path)
    )
    assert len(read_step(path).faces) == 5
    text = path.read_text()
    seam = "#82 = CARTESIAN_POINT('',(0.,0.,0.));"
    assert seam in text
    path.write_text(text.replace(seam, seam.replace("(0.", "(5.")))
    with pytest.raises(InputError, match=r"face 'face\d' with zero area"):
        read_step(path)


def test_a_break_of_the_reader_is_an_error(whole: bytes, tmp_path: Path, monkeypatch):
    path = tmp_path / "part.step"
    path.write_bytes(whole)
    monkeypatch.setattr(step_trial, "_PROGRAM", "import os\nos.abort()")
    with pytest.raises(InputError, match="crashes on it"):
        read_step(path)


def test_a_file_that_is_read_for_ever_is_an_error(tmp_path: Path, monkeypatch):
    monkeypatch.setattr(step_trial, "_PROGRAM", "import time\ntime.sleep(60)")
    path = tmp_path / "part.step"
    path.touch()
    with pytest.raises(InputError, match=r"longer than 0\.2 s"):
        require_readable_step(path, patience=0.2)


@pytest.mark.slow
def test_a_file_is_tried_once_until_it_changes(whole: bytes, tmp_path: Path, monkeypatch):
    """Truth = number of processes started, counted."""
    starts, run = [], subprocess.run

    def counted(words, **options):
        starts.append(words[-1])
        return run(words, **options)

    monkeypatch.setattr(step_trial.subprocess, "run", counted)
    path = tmp_path / "part.step"
    path.write_bytes(whole)
    for _ in range(3):
        assert read_step(path).solids
    assert starts == [str(path)]

    later = path.stat().st_mtime_ns + 1_000_000_000
    os.utime(path, ns=(later, later))  # written again with as many bytes
    read_step(path)
    (tmp_path / "other.step").write_bytes(whole)
    os.utime(tmp_path / "other.step", ns=(later, later))
    (tmp_path / "other.step").replace(path)  # another file of the same size and time
    read_step(path)
    assert len(starts) == 3

    monkeypatch.setattr(step_trial, "_PROGRAM", "import os\nos.abort()")
    path.write_bytes(whole + b"\n")
    for _ in range(2):  # refused files are not remembered
        with pytest.raises(InputError, match="crashes on it"):
            read_step(path)
    assert len(starts) == 5


def test_the_trial_is_silent_and_starts_nothing_else(whole: bytes, tmp_path: Path, capfd):
    path = tmp_path / "-part;touch hacked.step"
    path.write_bytes(whole)
    require_readable_step(path)
    assert capfd.readouterr() == ("", "")
    assert [item.name for item in tmp_path.iterdir()] == [path.name]
