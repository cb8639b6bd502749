"""Damaged Abaqus files: an InputError or a mesh, never a traceback, never a flood of memory."""

import tracemalloc
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from klack.errors import InputError
from klack.mesh.files.abaqus.reader import read_abaqus

DATA = Path(__file__).parents[1] / "data"
BOX = (DATA / "block.inp").read_bytes()
RING = (DATA / "part.inp").read_bytes()
TWO = (
    b"*Part, name=a\n*Node\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*Element, type=C3D4, elset=e\n"
    b"1,1,2,3,4\n*Surface, name=s\ne, S1\n*Surface, name=n, type=NODE\n1,\n2,\n3,\n*End Part\n"
    b"*Assembly, name=A\n*Instance, name=i, part=a\n1.,2.,3.\n0.,0.,0.,1.,1.,1.,30.\n"
    b"*End Instance\n*Instance, name=j, part=a\n*End Instance\n*Nset, nset=m, instance=j\n1,\n"
    b"*Surface, name=u, combine=UNION\ni.s, j.s\n*Transform, nset=m\n1.,0.,0.,0.,1.,0.\n"
    b"*End Assembly\n*Element, type=S3, elset=k\n"
)
FILES = {"block": BOX, "part": RING, "two instances": TWO}

Generator = np.random.Generator


def truncated(raw: bytes, random: Generator) -> bytes:
    return raw[: random.integers(len(raw))]


def flipped(raw: bytes, random: Generator) -> bytes:
    changed = np.frombuffer(raw, dtype=np.uint8).copy()
    where = random.integers(len(raw), size=random.integers(1, 6))
    changed[where] ^= (1 << random.integers(8, size=len(where))).astype(np.uint8)
    return changed.tobytes()


def shuffled(raw: bytes, random: Generator) -> bytes:
    lines = raw.splitlines(keepends=True)
    first = random.integers(len(lines))
    part = lines[first : first + random.integers(2, 12)]
    lines[first : first + len(part)] = [part[i] for i in random.permutation(len(part))]
    return b"".join(lines)


def thinned(raw: bytes, random: Generator) -> bytes:
    lines = raw.splitlines(keepends=True)
    del lines[random.integers(len(lines))]
    return b"".join(lines)


def doubled(raw: bytes, random: Generator) -> bytes:
    lines = raw.splitlines(keepends=True)
    line = random.integers(len(lines))
    return b"".join([*lines[:line], lines[line], *lines[random.integers(len(lines)) :]])


def inflated(raw: bytes, random: Generator) -> bytes:
    """A number made huge, small, negative, or something else."""
    places = [i for i, sign in enumerate(raw) if chr(sign).isdigit()]
    place = places[random.integers(len(places))]
    other = [b"999999999999999", b"9" * 30, b"-1", b"0", b"1e308", b"nan", b",,", b" 1 ", b"*"]
    return raw[:place] + other[random.integers(len(other))] + raw[place + 1 :]


def noise(raw: bytes, random: Generator) -> bytes:
    place = random.integers(len(raw))
    return raw[:place] + random.bytes(int(random.integers(1, 200))) + raw[place:]


def printable_noise(raw: bytes, random: Generator) -> bytes:
    place = random.integers(len(raw))
    signs = np.frombuffer(b'*,=."\n\r\t -+0123456789ABCDEinpuset', dtype=np.uint8)
    return raw[:place] + random.choice(signs, 40).tobytes() + raw[place:]


DAMAGES = [truncated, flipped, shuffled, thinned, doubled, inflated, noise, printable_noise]


def read(path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            model = read_abaqus(path, 1e-3)
        except InputError:
            return
    mesh = model.mesh
    assert np.isfinite(mesh.points).all()
    for block in mesh.blocks:
        assert block.connectivity.min() >= 0
        assert block.connectivity.max() < mesh.node_count
    for surface in mesh.surfaces.values():
        assert surface.nodes.max() < mesh.node_count


@pytest.mark.parametrize("raw", FILES.values(), ids=FILES.keys())
@pytest.mark.parametrize("damage", DAMAGES, ids=[damage.__name__ for damage in DAMAGES])
def test_damaged_files(
    tmp_path: Path, raw: bytes, damage: Callable[[bytes, Generator], bytes]
) -> None:
    random = np.random.default_rng(len(raw))
    for _ in range(25):
        (tmp_path / "x.inp").write_bytes(damage(raw, random))
        read(tmp_path / "x.inp")


TET = (
    b"*NODE\n1,0,0,0\n2,1,0,0\n3,0,1,0\n4,0,0,1\n*ELEMENT, TYPE=C3D4, ELSET=e\n1,1,2,3,4\n"
    b"*NSET, NSET=a\n1, 2, 3, 4\n"
)
PART = b"*PART, NAME=p\n" + TET + b"*END PART\n"
FLOODS = {
    "commas": b"*NSET, NSET=s\n" + 300_000 * b",",
    "lines of commas": b"*NSET, NSET=s\n" + 50_000 * b",\n",
    "stars": 300_000 * b"*",
    "lines of stars": 10_000 * b"*\n",
    "comments": TET + 20_000 * b"**\n",
    "comments between": TET + b"*NSET, NSET=b\n" + 10_000 * b"1\n**\n",
    "empty lines": TET + 300_000 * b"\n",
    "ranges": TET + b"*NSET, NSET=s, GENERATE\n" + 2_000 * b"1, 999999999999999, 1\n",
    "sets of sets": TET + b"*NSET, NSET=s\n" + 20_000 * b"a\n",
    "many sets": TET + b"".join(b"*NSET, NSET=s%d\na\n" % i for i in range(2_000)),
    "one set often": TET + 2_000 * b"*NSET, NSET=s\na\n",
    "keywords": 10_000 * b"*A,B=C\n",
    "parameters": b"*NODE" + 6_000 * b", A=B",
    "no line ends": b"*NODE\n" + 60_000 * b"1,0,0,0,",
    "stars in a line": b"*HEADING\n" + 20_000 * (b"a" + 10 * b"*" + b"\n"),
    "quotes": TET + b"*NSET, NSET=b\n" + 100_000 * b'"',
    "instances": PART
    + b"".join(b"*INSTANCE, NAME=i%d, PART=p\n*END INSTANCE\n" % i for i in range(300)),
}


@pytest.mark.slow
@pytest.mark.parametrize("raw", FLOODS.values(), ids=FLOODS.keys())
def test_floods_take_no_memory(tmp_path, raw):
    (tmp_path / "x.inp").write_bytes(raw)
    tracemalloc.start()
    read(tmp_path / "x.inp")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()

    assert peak < 6_000_000 + 8 * len(raw)


def test_random_bytes(tmp_path):
    random = np.random.default_rng(3)
    for size in (0, 1, 2, 10, 1000, 100_000):
        for start in (b"", b"*", b"*NODE\n"):
            (tmp_path / "x.inp").write_bytes(start + random.bytes(size))
            with pytest.raises(InputError):
                read_abaqus(tmp_path / "x.inp", 1.0)


def test_large_block_stays_small_in_memory(tmp_path):
    """Node lines, 40 bytes each: the whole reading stays below four times the file."""
    lines = b"".join(b"%d, 1.23456789, 2.3456789, 3.45678901\n" % i for i in range(10, 100_000))
    (tmp_path / "x.inp").write_bytes(TET + b"*NODE, NSET=more\n" + lines)
    tracemalloc.start()
    model = read_abaqus(tmp_path / "x.inp", 1.0)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()

    assert model.mesh.node_count == 4
    assert peak < 4 * len(lines)


def test_folder_instead_of_a_file(tmp_path):
    (tmp_path / "x.inp").mkdir()
    with pytest.raises(InputError, match="no such file"):
        read_abaqus(tmp_path / "x.inp", 1.0)
