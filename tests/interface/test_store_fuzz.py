"""Damaged stores of results: one clear error or the right numbers, and bounded memory.

Truth: the study that was stored.  Longer: ``KLACK_LONG=50``, another ``KLACK_SEED=2``.
"""

import json
import os
import pickle
import random
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.store import RESULT_NAME
from klack.bodies.reduction.reduced_body import read_arrays
from klack.errors import InputError

LONGER = int(os.environ.get("KLACK_LONG", "1"))
SEED = int(os.environ.get("KLACK_SEED", "1"))


@pytest.fixture(scope="module")
def stored(lonely_study: ImpactStudy, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stored")
    IMPACT.save(lonely_study, folder)
    return folder


def words(study: ImpactStudy) -> bytes:
    """Give all of a study, arrays included, to the last bit."""
    return pickle.dumps(study)


def damage(raw: bytes, draw: random.Random) -> bytes:
    how = draw.choice(["flip", "digit", "cut", "empty", "noise", "zeros", "twice"])
    at = draw.randrange(max(len(raw), 1))
    if how == "flip" and raw:
        return raw[:at] + bytes([raw[at] ^ (1 << draw.randrange(8))]) + raw[at + 1 :]
    if how == "digit":
        places = [i for i, letter in enumerate(raw) if chr(letter).isdigit()]
        if places:
            at = draw.choice(places)
            return raw[:at] + draw.choice("0123456789").encode() + raw[at + 1 :]
    if how == "cut":
        return raw[:at]
    if how == "noise":
        return draw.randbytes(len(raw))
    if how == "zeros":
        return bytes(len(raw))
    return raw + raw if how == "twice" else b""


def test_damaged_bytes(stored: Path, tmp_path: Path):
    whole = words(IMPACT.load(stored))
    files = sorted(path for path in (stored / RESULT_NAME).rglob("*") if path.is_file())
    draw = random.Random(SEED)
    copy = tmp_path / "copy"
    shutil.copytree(stored, copy)
    refused = 0
    for _ in range(40 * LONGER):
        file = draw.choice(files)
        other = copy / file.relative_to(stored)
        other.write_bytes(damage(file.read_bytes(), draw))
        found = None
        try:
            found = IMPACT.load(copy)
        except InputError:
            refused += 1
        assert found is None or words(found) == whole, (file, other.read_bytes()[:300])
        shutil.copy(file, other)
    assert refused > 20 * LONGER


def changed(stored: Path, target: Path, change: object) -> Path:
    """Copy a store, and change the description of its first array of forces."""
    assert callable(change)
    shutil.copytree(stored, target)
    file = next(target.rglob("force/zarr.json"))
    about = json.loads(file.read_text())
    change(about)
    file.write_text(json.dumps(about))
    return target


def test_the_same_bytes_of_another_type_or_shape_are_refused(stored: Path, tmp_path: Path):
    """The checksum of the bytes alone would take them."""

    def whole_numbers(about: dict) -> None:
        about["data_type"] = "int64"
        about["fill_value"] = 0

    def table(about: dict) -> None:
        count = about["shape"][0]
        about["shape"] = [count // 2, 2]
        about["chunk_grid"]["configuration"]["chunk_shape"] = [count // 2, 2]

    for change in (whole_numbers, table):
        with pytest.raises(InputError):
            IMPACT.load(changed(stored, tmp_path / change.__name__, change))


@pytest.mark.skipif(sys.platform == "win32", reason="limits of a process")
def test_a_huge_array_takes_no_memory(stored: Path, tmp_path: Path):
    """The file says 8 TB and has a few bytes of them."""

    def huge(about: dict) -> None:
        about["shape"] = [10**12]
        about["chunk_grid"]["configuration"]["chunk_shape"] = [10**12]

    folder = changed(stored, tmp_path / "huge", huge)
    with pytest.raises(InputError, match=r"more than 4 GB"):
        IMPACT.load(folder)


def test_names_that_lead_out_of_the_store_are_refused(stored: Path, tmp_path: Path):
    shutil.copytree(stored, tmp_path / "out")
    file = tmp_path / "out" / RESULT_NAME / "study" / "zarr.json"
    text = file.read_text()
    name = json.loads(text)["attributes"]["order"][-1]
    for other in ("..", "../../..", "/etc", "a/../../b"):
        file.write_text(text.replace(f'"{name}"', json.dumps(other)))
        with pytest.raises(InputError):
            IMPACT.load(tmp_path / "out")


class Bomb:
    """What a pickle could do."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple:
        return os.mkdir, (str(self.path),)


def test_no_pickle_is_opened(tmp_path: Path):
    np = pytest.importorskip("numpy")
    objects = np.array([Bomb(tmp_path / "hacked")], dtype=object)
    path = tmp_path / "body.npz"
    np.savez(path, format=objects, version=objects)
    with pytest.raises(InputError, match="unreadable"):
        read_arrays(path, "klack.reduced_body", 1, [])
    path.write_bytes(pickle.dumps(objects))
    with pytest.raises(InputError):
        read_arrays(path, "klack.reduced_body", 1, [])
    assert not (tmp_path / "hacked").exists()


def test_a_pickle_in_a_measurement_is_not_opened(tmp_path: Path):
    """HDF5, MATLAB and CSV readers meet a pickle under their own ending."""
    from klack.measurement.files.opening import open_recording

    raw = pickle.dumps([Bomb(tmp_path / "hacked")])
    for ending in ("csv", "h5", "mat", "mf4", "tdms", "uff", "npz", "npy", "txt"):
        path = tmp_path / f"strokes.{ending}"
        path.write_bytes(raw)
        with pytest.raises(InputError):
            open_recording(path)
    assert not (tmp_path / "hacked").exists()


@pytest.mark.slow
def test_the_commands_refuse_a_damaged_result(stored: Path, tmp_path: Path):
    shutil.copytree(stored, tmp_path / "r")
    chunk = next((tmp_path / "r").rglob("force/c/0"))
    chunk.write_bytes(chunk.read_bytes()[:-3])
    for command in (["report", "r"], ["export", "r", "--to", "csv"], ["noise", "r"]):
        done = subprocess.run(
            [sys.executable, "-m", "klack", *command],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 2, done.stderr
        assert "Traceback" not in done.stderr
        assert "result" in done.stderr
        assert sorted(path.name for path in (tmp_path / "r").iterdir()) == [RESULT_NAME]
