"""Damaged recordings of every format: numbers, or one clear error, in bounded time and memory.

Longer: ``KLACK_LONG=50``, another ``KLACK_SEED=2``.
"""

import json
import os
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest

LONGER = int(os.environ.get("KLACK_LONG", "1"))
SEED = int(os.environ.get("KLACK_SEED", "1"))
DATA = Path(__file__).parents[1] / "data"


def whole_files(folder: Path) -> None:
    """Write the recordings of another test, in all their formats."""
    place = Path(__file__).with_name("test_measurement_formats.py")
    spec = spec_from_file_location("formats", place)
    assert spec is not None
    assert spec.loader is not None
    formats = module_from_spec(spec)
    spec.loader.exec_module(formats)
    formats.COUNT = 40
    formats.TIME = formats.TIME[:40]
    for name, (values, unit) in list(formats.FILE.items()):
        formats.FILE[name] = (values[:40], unit)
    for name, (writer, *_) in FORMS.items():
        getattr(formats, writer)(folder / name)


FORMS = {
    "a.csv": ("csv",),
    "b.mf4": ("mdf",),
    "c.mdf": ("mdf3",),
    "d.mf4": ("mdf4_compressed",),
    "e.tdms": ("tdms",),
    "f.uff": ("uff",),
    "g.uff": ("uff_binary",),
    "h.h5": ("hdf5",),
    "i.mat": ("matlab",),
    "j.mat": ("matlab_structures",),
    "k.mat": ("matlab_73",),
}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="limits of a process")
def test_damaged_recordings(tmp_path: Path):
    folder = tmp_path / "whole"
    folder.mkdir()
    whole_files(folder)
    program = [sys.executable, str(DATA / "damaged_recordings.py"), str(folder)]
    done = subprocess.run(
        [*program, str(SEED), str(10 * LONGER)],
        env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )

    assert done.returncode == 0, done.stderr[-1500:]
    found = json.loads(done.stdout.splitlines()[-1])
    assert found["faults"] == []
    assert found["slowest"] < 10.0
    assert found["refused"] > 3 * len(FORMS) * LONGER
