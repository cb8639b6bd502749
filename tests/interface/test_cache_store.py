"""The cache: keys, entries, and its folder under stress.

Keys and entries of the cache.

Exact: what is read has the bits that were written, and whatever is done to the file, nothing else
is ever read.

The folder of the cache under stress.

Exact: a stored result comes back with its bits or not at all, whatever other processes, a full disk
or a kill do to the folder.
"""

import errno
import os
import signal
import struct
import subprocess
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of
from scipy.sparse import csr_array

from klack.assembling.generated_mesh import entry_of_mesh, mesh_of_entry
from klack.errors import CacheWarning, InputError
from klack.machine.cache.content import content_key
from klack.machine.cache.entry import DamagedEntry, Entry, read_entry, write_entry
from klack.machine.cache.remember import origin, remembered, source_files
from klack.machine.cache.result_cache import ResultCache, result_cache
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


def test_sources_that_are_not_there_change_no_key_in_silence(tmp_path):
    """A folder that was moved would drop out of the key; then edits of it were not noticed."""
    (tmp_path / "empty").mkdir()
    for name in ("empty", "none", "none.py"):
        with pytest.raises(FileNotFoundError, match="no source of klack"):
            source_files(tmp_path / name)


LARGE = 10**9

SQUARES = """
import sys, time
from pathlib import Path
import numpy as np
from klack.machine.cache.entry import Entry
from klack.machine.cache.remember import remembered
from klack.machine.cache.result_cache import ResultCache
cache = ResultCache(Path(sys.argv[1]), 10**9)
print("ready", flush=True)
sys.stdin.readline()
for turn in range(int(sys.argv[2])):
    for n in range(20):
        x = remembered(cache, "squares", (n,), lambda: np.arange(2000.0 + n) ** 2,
                       pack=lambda x: Entry(arrays={"x": x}), unpack=lambda e: e.arrays["x"])
        assert np.array_equal(x, np.arange(2000.0 + n) ** 2)
print(cache.served["squares"], cache.missed["squares"], flush=True)
"""


def squares(cache: ResultCache | None, n: int, calls: list[int]) -> np.ndarray:
    def compute() -> np.ndarray:
        calls.append(n)
        return np.arange(1000.0 + n) ** 2

    return remembered(
        cache,
        "squares",
        (n,),
        compute,
        pack=lambda x: Entry(arrays={"x": x}),
        unpack=lambda entry: entry.arrays["x"],
    )


def started(folder: Path, turns: int) -> subprocess.Popen:
    command = [sys.executable, "-W", "error", "-c", SQUARES, str(folder), str(turns)]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "ready\n"
    return process


def test_a_result_is_computed_once(tmp_path):
    calls: list[int] = []
    first = squares(ResultCache(tmp_path / "c", LARGE), 3, calls)
    again = squares(ResultCache(tmp_path / "c", LARGE), 3, calls)
    none = squares(None, 3, calls)

    assert calls == [3, 3]  # the last one without a cache
    assert first.tobytes() == again.tobytes() == none.tobytes()


@pytest.mark.slow
@settings(max_examples=100, deadline=None)
@given(data=st.data())
def test_damage_is_repaired(tmp_path_factory, data):
    folder, calls = tmp_path_factory.mktemp("c"), []
    expected = squares(ResultCache(folder, LARGE), 3, calls)
    (path,) = folder.glob("*.entry")
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(content[: data.draw(st.integers(0, len(content)))])

    found = squares(ResultCache(folder, LARGE), 3, calls)
    once_more = squares(ResultCache(folder, LARGE), 3, calls)

    assert found.tobytes() == once_more.tobytes() == expected.tobytes()
    assert len(calls) <= 2


def test_an_entry_of_another_purpose_is_replaced(tmp_path):
    cache, calls = ResultCache(tmp_path, LARGE), []
    expected = squares(cache, 3, calls)
    (path,) = tmp_path.glob("*.entry")
    cache.store(path.stem, Entry(arrays={}))

    assert squares(cache, 3, calls).tobytes() == expected.tobytes()
    assert squares(cache, 3, calls).tobytes() == expected.tobytes()
    assert calls == [3, 3]


def test_what_was_not_used_for_longest_goes_first(tmp_path):
    cache, calls = ResultCache(tmp_path, 40_000), []  # an entry takes 8 kB: four fit
    for n in range(4):
        squares(cache, n, calls)
        for path in tmp_path.glob("*.entry"):  # an hour each
            os.utime(path, (path.stat().st_atime, path.stat().st_mtime - 3600))
    squares(cache, 0, calls)  # used
    for n in (4, 5):
        squares(cache, n, calls)

    assert cache.content().size <= 40_000
    calls.clear()
    for n in (0, 3, 4, 5):
        squares(cache, n, calls)
    assert calls == []
    squares(cache, 1, calls)
    assert calls == [1]


def test_the_limit_holds_at_every_moment_though_not_every_entry_makes_it_look(
    tmp_path, monkeypatch
):
    """Truth = the limit.  A look costs 10 us for each file that is there: 0.3 s for 30 000."""
    looks: list[int] = []
    look = ResultCache._files
    monkeypatch.setattr(ResultCache, "_files", lambda self: looks.append(1) or look(self))
    for limit, most in ((LARGE, 1), (1_000_000, 150)):
        cache = ResultCache(tmp_path / str(limit), limit)
        looks.clear()
        for n in range(200):  # 8 kB each
            squares(cache, n, [])
            if limit < LARGE:
                assert sum(path.stat().st_size for path in cache.folder.glob("*.entry")) <= limit
        assert len(looks) <= most


def test_only_files_of_klack_are_deleted(tmp_path):
    calls: list[int] = []
    foreign = [tmp_path / name for name in ("notes.txt", "a.entry", "new-x.part")]
    for path in foreign:
        path.write_text("keep me")
    outside = tmp_path.parent / f"{tmp_path.name}-outside"
    outside.write_text("keep me")
    (tmp_path / f"{content_key('link')}.entry").symlink_to(outside)
    cache = ResultCache(tmp_path, 1)
    squares(cache, 1, calls)  # above the limit at once
    cache.clear()

    assert [path.read_text() for path in [*foreign, outside]] == ["keep me"] * 4


def test_unfinished_files_of_killed_runs_go_after_an_hour(tmp_path):
    old, new = tmp_path / "new-old.entry.part", tmp_path / "new-new.entry.part"
    old.write_bytes(b"half")
    new.write_bytes(b"half")
    os.utime(old, (0, time.time() - 4000))
    squares(ResultCache(tmp_path, LARGE), 1, [])

    assert not old.exists()
    assert new.exists()  # somebody may be writing it


@pytest.mark.slow
def test_two_processes_on_one_empty_cache(tmp_path):
    """Both meet the same empty folder at once; both are right, nothing unfinished is left."""
    processes = [started(tmp_path / "deep" / "cache", 3) for _ in range(2)]
    for process in processes:
        process.stdin.write("go\n")
        process.stdin.flush()
    for process in processes:
        out, error = process.communicate(timeout=300)
        assert process.returncode == 0, error
        _, missed = map(int, out.split())
        assert missed <= 20

    names = {path.suffix for path in (tmp_path / "deep" / "cache").iterdir()}
    assert names == {".entry", ".TAG"}
    assert len(list((tmp_path / "deep" / "cache").glob("*.entry"))) == 20


def test_deleting_while_another_process_reads(tmp_path):
    reader = started(tmp_path / "c", 30)
    reader.stdin.write("go\n")
    reader.stdin.flush()
    cache = ResultCache(tmp_path / "c", LARGE)
    cleared = 0
    while reader.poll() is None:
        cleared += cache.clear().count
        time.sleep(0.005)

    assert reader.returncode == 0, reader.stderr.read()
    assert cleared > 0


def test_what_others_delete_again_and_again_is_not_kept_and_costs_no_note(tmp_path, monkeypatch):
    cache = ResultCache(tmp_path / "c", LARGE)
    with monkeypatch.context() as patch:

        def delete_before(part: Path, place: Path) -> None:
            cache.clear()
            os.rename(part, place)

        patch.setattr(os, "replace", delete_before)
        assert notes_of(cache) == []
        assert cache.content().count == 0
    assert notes_of(cache) == []
    assert cache.content().count == 2


KILLED = SQUARES.replace(
    'print("ready", flush=True)',
    """
import klack.machine.cache.result_cache as module
def slow(file, key, entry):
    file.write(b"klack cache 1")
    file.flush()
    print("writing", flush=True)
    time.sleep(60)
module.write_entry = slow
print("ready", flush=True)
""",
)


def test_a_kill_while_writing_leaves_no_half_entry(tmp_path):
    command = [sys.executable, "-c", KILLED, str(tmp_path), "1"]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        process.stdin.write("go\n")
        process.stdin.flush()
        assert process.stdout.readline() == "ready\n"
        assert process.stdout.readline() == "writing\n"
        process.send_signal(signal.SIGKILL)
    calls: list[int] = []

    assert len(list(tmp_path.glob("*.part"))) == 1
    assert not list(tmp_path.glob("*.entry"))
    squares(ResultCache(tmp_path, LARGE), 1, calls)
    assert calls == [1]


def notes_of(cache: ResultCache) -> list[str]:
    calls: list[int] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for n in (1, 2, 1):
            assert squares(cache, n, calls).tobytes() == (np.arange(1000.0 + n) ** 2).tobytes()
    return [str(item.message) for item in caught if item.category is CacheWarning]


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EACCES, errno.EDQUOT])
def test_a_folder_that_cannot_be_written_costs_one_note(tmp_path, monkeypatch, number):
    def refuse(*_: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("klack.machine.cache.result_cache.write_entry", refuse)

    notes = notes_of(ResultCache(tmp_path, LARGE))

    assert len(notes) == 1
    assert os.strerror(number) in notes[0]
    assert "KLACK_CACHE" in notes[0]
    assert not list(tmp_path.glob("*.part"))


def test_a_folder_that_is_a_file_costs_one_note(tmp_path):
    (tmp_path / "file").write_text("mine")

    assert len(notes_of(ResultCache(tmp_path / "file" / "cache", LARGE))) == 1
    assert (tmp_path / "file").read_text() == "mine"


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 32 kB, where mounting is allowed."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=32k", "none", str(folder)],
        capture_output=True,
        check=False,
    )
    if mounted.returncode:
        pytest.skip("mounting is not allowed here")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


def test_a_full_disk_costs_one_note(small_disk):
    (small_disk / "filled").write_bytes(bytes(28 * 1024))
    notes = notes_of(ResultCache(small_disk, LARGE))

    assert len(notes) == 1
    assert os.strerror(errno.ENOSPC) in notes[0]
    assert [path.name for path in small_disk.iterdir()] == ["filled"]


def test_a_disk_that_has_become_read_only_is_still_read(small_disk):
    expected = squares(ResultCache(small_disk, LARGE), 1, [])
    subprocess.run(["mount", "-o", "remount,ro", str(small_disk)], check=True)
    calls: list[int] = []
    cache = ResultCache(small_disk, LARGE)

    assert squares(cache, 1, calls).tobytes() == expected.tobytes()
    assert calls == []
    assert len(notes_of(cache)) == 1


def test_the_environment_says_where(tmp_path, monkeypatch):
    monkeypatch.setenv("KLACK_CACHE", str(tmp_path / "here"))
    monkeypatch.setenv("KLACK_CACHE_SIZE", "1.5 GB")
    here = result_cache()
    assert here is not None
    assert (here.folder, here.limit) == (tmp_path / "here", 1_500_000_000)
    assert not here.folder.exists()  # nothing stored yet

    monkeypatch.delenv("KLACK_CACHE_SIZE")
    assert result_cache().limit == 5_000_000_000
    monkeypatch.setenv("KLACK_CACHE", "OFF")
    assert result_cache() is None
    monkeypatch.delenv("KLACK_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert result_cache().folder == tmp_path / "xdg" / "klack" / "results"


@pytest.mark.parametrize("size", ["much", "-1", "3 furlongs", "1e3000", "nan"])
def test_a_size_that_is_none_is_refused(monkeypatch, tmp_path, size):
    monkeypatch.setenv("KLACK_CACHE", str(tmp_path))
    monkeypatch.setenv("KLACK_CACHE_SIZE", size)

    with pytest.raises(InputError, match=r"KLACK_CACHE_SIZE.*expected a size"):
        result_cache()


def test_a_user_without_a_home_has_no_cache(monkeypatch):
    """A user that the system does not know, such as one of a container: '~' stays '~'."""
    for name in ("KLACK_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr("os.path.expanduser", lambda path: path)
    monkeypatch.chdir("/")

    assert result_cache() is None
