"""Keys and entries of the cache.

Exact: what is read has the bits that were written, and whatever is done to the file, nothing else
is ever read.
"""

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of
from scipy.sparse import csr_array

from klack.assembling.generated_mesh import entry_of_mesh, mesh_of_entry
from klack.cache.content import content_key
from klack.cache.entry import DamagedEntry, Entry, read_entry, write_entry
from klack.cache.remember import origin
from klack.mesh.meridian import mesh_meridian
from klack.mesh.profile import Arc, Line, Profile
from klack.mesh.sizing import MeshSizing, Refinement

KEY = "a" * 64
SIZING = MeshSizing(
    size=1e-3,
    surfaces={"tip": 0.2e-3},
    refinements=(Refinement(position=(1e-3, 0.5e-3), size=0.1e-3, radius=0.2e-3),),
)
BALL = Profile(
    (0, 0), (Arc((2e-3, 2e-3), (0, 2e-3), "tip"), Line((0, 2e-3), "top"), Line((0, 0), "axis"))
)


def written(path: Path, entry: Entry, key: str = KEY) -> Path:
    with path.open("wb") as file:
        write_entry(file, key, entry)
    return path


def same(a: np.ndarray, b: np.ndarray) -> bool:
    """Type, shape, order of storage and bits."""
    order = [(x.flags.c_contiguous, x.flags.f_contiguous) for x in (a, b)]
    return (
        a.dtype == b.dtype
        and a.shape == b.shape
        and order[0] == order[1]
        and a.tobytes() == b.tobytes()
    )


SHAPES = arrays_of.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=5)
NUMBERS = st.one_of(
    *(
        arrays_of.arrays(dtype=kind, shape=SHAPES)
        for kind in (np.float64, np.float32, np.int64, np.int32, np.complex128, np.bool_)
    )
)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(array=NUMBERS, columns=st.booleans(), text=st.text(max_size=20))
def test_an_entry_comes_back_bit_by_bit(tmp_path_factory, array, columns, text):
    array = np.asfortranarray(array) if columns else array
    path = tmp_path_factory.mktemp("entry") / "entry"

    back = read_entry(written(path, Entry(arrays={"x": array, "y": array[:1]}, text=text)), KEY)

    assert list(back.arrays) == ["x", "y"]
    assert same(back.arrays["x"], array)
    assert back.text == text


def test_values_that_no_comparison_sees_keep_their_bits(tmp_path):
    odd = np.array([0.0, -0.0, np.nan, np.inf, 5e-324, np.nextafter(1.0, 2.0)])
    odd.view(np.int64)[2] ^= 0x2A  # a payload of the nan

    back = read_entry(written(tmp_path / "entry", Entry(arrays={"x": odd})), KEY)

    assert back.arrays["x"].tobytes() == odd.tobytes()


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> bytes:
    entry = Entry(arrays={"x": np.arange(6.0).reshape(2, 3), "n": np.arange(3)}, text="text")
    return written(tmp_path_factory.mktemp("whole") / "entry", entry).read_bytes()


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(data=st.data())
def test_any_changed_byte_is_noticed(tmp_path_factory, whole, data):
    place = data.draw(st.integers(0, len(whole) - 1))
    change = data.draw(st.integers(1, 255))
    damaged = bytearray(whole)
    damaged[place] ^= change
    path = tmp_path_factory.mktemp("damaged") / "entry"
    path.write_bytes(damaged)

    with pytest.raises(DamagedEntry):
        read_entry(path, KEY)


@pytest.mark.slow
def test_any_cut_or_addition_is_noticed(tmp_path, whole):
    path = tmp_path / "entry"
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        with pytest.raises(DamagedEntry):
            read_entry(path, KEY)
    path.write_bytes(whole + b"\0")
    with pytest.raises(DamagedEntry, match="do not fit"):
        read_entry(path, KEY)


def test_an_entry_of_another_key_is_refused(tmp_path):
    path = written(tmp_path / "entry", Entry(arrays={}), "b" * 64)

    with pytest.raises(DamagedEntry, match="another key"):
        read_entry(path, KEY)


@pytest.mark.parametrize(
    "table",
    [
        '[["x","<f8",[1000000000000],"C"]]',
        '[["x","<f8",[-1],"C"]]',
        '[["x","|O",[1],"C"]]',
        '[["x","<f8",[1e3],"C"]]',
        '[["x","<f8","abc","C"]]',
        '[["x","<f8",[9,9,9,9,9],"C"]]',
        "[[]]",
        "7",
    ],
)
def test_a_header_that_lies_takes_no_memory(tmp_path, whole, table):
    text = f'{{"key":"{KEY}","text":"","arrays":{table}}}'.encode()
    path = tmp_path / "entry"
    path.write_bytes(whole[:48] + struct.pack("<q", len(text)) + text)

    with pytest.raises(DamagedEntry):
        read_entry(path, KEY)


def test_a_mesh_comes_back_whole(tmp_path):
    mesh = mesh_meridian({"ball": BALL}, SIZING)

    back = mesh_of_entry(read_entry(written(tmp_path / "entry", entry_of_mesh(mesh)), KEY))

    assert content_key(back) == content_key(mesh)
    assert back.surface("tip").face_count == mesh.surface("tip").face_count > 0


VALUES = st.recursive(
    st.one_of(
        st.none(), st.booleans(), st.integers(), st.text(max_size=5), st.binary(max_size=5),
        st.floats(allow_nan=False),
    ),
    lambda inner: st.lists(inner, max_size=4)
    | st.dictionaries(st.text(max_size=3), inner, max_size=3),
    max_leaves=8,
)  # fmt: skip


def canonical(value: object) -> str:
    """Text that differs where values differ: 1, 1.0 and True are three."""
    return repr(value)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(a=VALUES, b=VALUES)
def test_keys_are_equal_for_equal_content_alone(a, b):
    assert (content_key(a) == content_key(b)) == (canonical(a) == canonical(b))


def test_arrays_count_with_type_shape_and_order_of_storage():
    x = np.arange(6.0)
    square = np.arange(4.0).reshape(2, 2)
    different = [
        x, x.astype(np.float32), x.reshape(2, 3), x.reshape(3, 2), x.view(np.int64),
        np.asfortranarray(x.reshape(2, 3)), -x, square, square.T, csr_array(square),
        csr_array(square.T), list(x),
    ]  # fmt: skip

    keys = [content_key(item) for item in different]

    assert len(set(keys)) == len(different)
    assert content_key(x[::-1][::-1]) == keys[0]


@pytest.mark.parametrize("value", [Path("mesh.step"), object(), {1, 2}, np.array([None])])
def test_what_has_no_content_has_no_key(value):
    with pytest.raises(TypeError, match="content_key"):
        content_key(value)


NUMBER = st.floats(0.01, 0.9).map(lambda share: share * 1e-3)


@settings(max_examples=60, deadline=None)
@given(
    change=st.one_of(
        NUMBER.map(lambda x: {"size": x}),
        NUMBER.map(lambda x: {"surfaces": {"tip": x}}),
        NUMBER.map(lambda x: {"grading": x / 1e-3}),
        NUMBER.map(lambda x: {"refinements": (replace(SIZING.refinements[0], radius=x),)}),
        st.just({"surfaces": {"top": 0.2e-3}}),
        st.just({"refinements": ()}),
    )
)
def test_every_part_of_a_sizing_is_in_its_key(change):
    other = replace(SIZING, **change)

    assert (content_key(other) == content_key(SIZING)) == (other == SIZING)


def test_the_origin_is_the_same_as_long_as_nothing_changes(monkeypatch):
    first = origin()
    origin.cache_clear()
    again = origin()
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    origin.cache_clear()
    other = origin()
    origin.cache_clear()

    assert first == again != other
