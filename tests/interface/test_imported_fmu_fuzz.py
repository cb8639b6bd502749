"""Tampered FMUs and MATLAB files, read and run: one clear error or an answer, no crash, no hang.

Truth: the law of the FMU and the numbers in the file.  Longer: ``KLACK_LONG=25``, ``KLACK_SEED=2``;
the counts stand in docs/reference/safety.md.
"""

import os
import random
import time
import zipfile
from collections import Counter
from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from scipy.sparse import csc_array

from klack.bodies.model_files.matrices import read_matrix
from klack.errors import ConvergenceError, InputError
from klack.measurement.files.opening import open_recording
from klack.mechanics.fmu_file import inspect_fmu
from klack.mechanics.fmu_slave import FmuSlave
from klack.mechanics.imported_fmu import ImportedFmu

pytestmark = pytest.mark.filterwarnings("ignore:Duplicate name")

LONGER = int(os.environ.get("KLACK_LONG", "1"))
SEED = int(os.environ.get("KLACK_SEED", "1"))
LIMIT = 0.5  # [s] of a call
HANG = 60.0  # [s] of everything with one file, on a machine with other work

Build = Callable[..., Path]


def bent(raw: bytes, draw: random.Random) -> bytes:
    """Bytes with some of them changed, cut off, doubled, or drawn anew."""
    how = draw.choice(["flip", "flip", "cut", "hole", "noise", "twice", "swap"])
    data = bytearray(raw)
    if how == "flip":
        for _ in range(draw.choice([1, 1, 8, 200])):
            data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
    at, end = sorted(draw.randrange(len(data) + 1) for _ in range(2))
    if how == "cut":
        del data[at:]
    elif how == "hole":
        data[at:end] = bytes(end - at)
    elif how == "noise":
        data[at:end] = draw.randbytes(end - at)
    elif how == "twice":
        data[at:at] = data[at:end]
    elif how == "swap":
        data = data[at:] + data[:at]
    return bytes(data)


WORDS = [
    *(b"0 -1 99999999999999999999 nan 1e400 2.0 3.0 x F true ../../x /etc/passwd").split(),
    *(b"", b"a" * 70_000, b"\xff\xfe", b"&lol;", b"<!--", b"]]>", b"modelDescription.xml"),
]


def bent_words(text: bytes, draw: random.Random) -> bytes:
    """A description with values of attributes exchanged, lines shuffled, or an entity bomb."""
    parts = text.split(b'"')
    for _ in range(draw.choice([1, 1, 3, 20])):
        parts[draw.randrange(len(parts) // 2) * 2 + 1] = draw.choice(WORDS)
    text = b'"'.join(parts)
    how = draw.randrange(6)
    if how == 0:
        lines = text.splitlines()
        draw.shuffle(lines)
        return b"\n".join(lines)
    if how == 1:
        entities = b'<!ENTITY a "lol">' + b"".join(
            b'<!ENTITY %c "%s">' % (c + 1, b"&%c;" % c * 10) for c in range(97, 107)
        )
        bomb = b"<!DOCTYPE z [" + entities + b"]>"
        return text.replace(b"?>", b"?>" + bomb, 1).replace(b'"x"', b'"&k;"')
    return text


def tampered(source: Path, target: Path, draw: random.Random) -> str:
    """Write a tampered copy; what was tampered with."""
    what = draw.choice(["archive", "description", "library", "library", "names"])
    if what == "archive":
        target.write_bytes(bent(source.read_bytes(), draw))
        return what
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w", draw.choice([0, 8])) as new:
        for name in old.namelist():
            data = old.read(name)
            if what == "description" and name.endswith(".xml"):
                data = bent_words(data, draw) if draw.random() < 0.7 else bent(data, draw)
            elif what == "library" and name.endswith(".so"):
                data = bent(data, draw)
            elif what == "names" and draw.random() < 0.7:
                wrong = [
                    "../x",
                    "/x",
                    "resources/../../x",
                    name + "/",
                    "a\\b",
                    "C:x",
                    "",
                    name * 40,
                ]
                name = draw.choice(wrong)
            new.writestr(name or ".", data)
    return what


def outcome(path: Path) -> str:
    """What comes of describing it and of running five steps."""
    given = {"coupling_step": 1e-6, "displacement": "x", "velocity": "v", "force": "F"}
    try:
        inspect_fmu(path)
        part = ImportedFmu(file=path, time_limit=LIMIT, **given)
        slave = FmuSlave(part._description(), part._wiring(), LIMIT)
        try:
            slave.begin()
            slave.force(1e-3, 0.1)
            slave.run()
            forces = [slave.advance(k * 1e-6, 1e-6, 1e-3, 0.1) for k in range(5)]
        finally:
            slave.close()
    except InputError as error:
        return "refused" if error.got and error.hint else "refused without a hint"
    except ConvergenceError as error:
        words = ("crashed", "ended its process", "did not answer", "answered with", "failed")
        named = path.name in str(error)
        return next(word for word in words if word in str(error) and named)
    return "right" if np.allclose(forces, -1.0, rtol=1e-9) else "another number"


@pytest.mark.parametrize("version", [2, 3])
def test_tampered_fmus(version: int, spring_damper_fmu: Build, tmp_path: Path):
    source, draw = spring_damper_fmu(version), random.Random(SEED + version)
    path, counts = tmp_path / "bent.fmu", Counter()
    for k in range(10 * LONGER):
        what = tampered(source, path, draw)
        os.utime(path, (k, k))  # descriptions are remembered by time and size
        begun = time.monotonic()
        counts[what, outcome(path)] += 1
        assert time.monotonic() - begun < HANG
    print(sum(counts.values()), sorted(counts.items()))
    assert sum(count for (_, came), count in counts.items() if came == "refused") >= 2 * LONGER
    assert not any(came == "refused without a hint" for _, came in counts)
    assert not (tmp_path.parent / "x").exists()


def written(compressed: bool, draw: random.Random) -> bytes:
    stream = BytesIO()
    values = {
        "K": csc_array(np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 2.0]])),
        "time": np.linspace(0.0, 1e-3, 30)[:, None],
        "lift": np.array([[draw.random()] for _ in range(30)]),
        "about": {"text": "needle", "cells": np.array(["a", 1.0], dtype=object)},
    }
    scipy.io.savemat(stream, values, do_compression=compressed)
    return stream.getvalue()


def test_tampered_files_of_matlab(tmp_path: Path):
    draw, path, counts = random.Random(SEED), tmp_path / "bent.mat", Counter()
    for k in range(40 * LONGER):
        path.write_bytes(bent(written(k % 2 == 0, draw), draw))
        begun = time.monotonic()
        for reader in (lambda: read_matrix(path, name="K"), lambda: open_recording(path)):
            try:
                reader()
                counts["read"] += 1
            except InputError:
                counts["refused"] += 1
        assert time.monotonic() - begun < HANG
    print(counts)
    assert counts["refused"] > 20 * LONGER
