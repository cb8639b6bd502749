"""The store of compiled functions: what is loaded, what is compiled anew, and who waits for whom.

Truth: the results of plain Python, and the number of functions that numba compiles.
"""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

CALLED = """
from klack.machine.compiling.jit import inner
SCALE = {scale}

@inner
def part(x):
    return SCALE * x
"""
CALLS = """
from klack.machine.compiling.jit import njit
import called

@njit
def whole(x):
    {text}return part(x, ) + {added}

part = called.part
"""
RUN = """
import json, os, sys, warnings
sys.path.insert(0, {folder!r})
from klack.warming.run import counted
from numba.core import event
warnings.simplefilter("always")
import calls
if "FILE_LIMIT" in os.environ:
    import resource
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(os.environ["FILE_LIMIT"]),) * 2)
with counted() as count, warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    value = calls.whole(2.0)
print(json.dumps([value, COUNT[0], [str(one.message) for one in said]]))
"""
COUNTING = """
COUNT = [0]
class L(event.Listener):
    def on_start(self, event): COUNT[0] += 1
    def on_end(self, event): pass
event.register("numba:compile", L())
"""


@pytest.fixture
def program(tmp_path):
    write(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def once(tmp_path_factory):
    """A program that has run once."""
    folder = tmp_path_factory.mktemp("once")
    write(folder)
    assert end(start(folder)) == [7.0, 2, []]
    return folder


@pytest.fixture
def compiled_program(once, program):
    """A program with the store of one that has run once."""
    shutil.copytree(once / "store", program / "store")
    return program


def write(folder: Path, scale: float = 3.0, text: str = "", added: float = 1.0) -> None:
    (folder / "called.py").write_text(CALLED.format(scale=scale))
    (folder / "calls.py").write_text(CALLS.format(text=text, added=added))
    script = RUN.format(folder=str(folder)).replace("import calls\n", COUNTING + "import calls\n")
    (folder / "run.py").write_text(script)


def start(folder: Path, **env: str) -> "subprocess.Popen[str]":
    # Python knows a source by its second and its size: one written anew at once has old bytecode.
    own = {"NUMBA_CACHE_DIR": str(folder / "store"), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.Popen(
        [sys.executable, str(folder / "run.py")],
        env=os.environ | own | env,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def end(process: "subprocess.Popen[str]") -> list:
    out, problem = process.communicate(timeout=300)
    assert process.returncode == 0, problem
    return json.loads(out)


def files(folder: Path, kind: str = "*.code") -> list[Path]:
    return sorted((folder / "store" / "klack-compiled").glob(kind))


@pytest.mark.slow
def test_a_second_process_compiles_nothing(program):
    assert end(start(program)) == [7.0, 2, []]
    assert end(start(program)) == [7.0, 0, []]
    assert len(files(program)) == 2
    assert files(program, "*.lock") == files(program, "*.part") == []
    assert (program / "store" / "klack-compiled").stat().st_mode & 0o077 == 0


@pytest.mark.slow
def test_code_from_another_file_is_never_stale(compiled_program):
    """Numba itself would give 7 again: it looks at the file of the caller only."""
    program = compiled_program

    write(program, scale=5.0)

    assert end(start(program)) == [11.0, 2, []]


@pytest.mark.slow
def test_an_inner_function_from_the_store_is_linked_into_a_new_caller(compiled_program):
    program = compiled_program

    write(program, added=2.0)

    assert end(start(program)) == [8.0, 1, []]


LONG = """
from klack.machine.compiling.jit import inner

@inner
def long(x):
    y = 0.0
{lines}    return y

@inner
def short(x):
    return long(x) + 1.0

@inner
def part(x):
    y = short(x) - long(x + 1.0)
{lines}    return y
"""
LENGTHS = """
from klack.machine.compiling.compilers import InnerCode
found = {}
plain = InnerCode.serialize_using_object_code
def noted(self):
    stored = plain(self)
    found[self.name] = self.is_short
    return stored
InnerCode.serialize_using_object_code = noted
"""


@pytest.mark.slow
def test_long_inner_functions_are_optimised_without_their_callers(program):
    """They are linked in beside them, also from the store; truth: plain Python."""
    lines = "".join(f"    if x > {k}.5:\n        y = x * y - {k}.25\n" for k in range(60))
    text = LONG.format(lines=lines)
    plain: dict = {"inner": lambda function: function}
    exec(text[text.index("@inner") :], plain)
    script = (program / "run.py").read_text().replace("import calls\n", LENGTHS + "import calls\n")
    script = script.replace("[str(one.message) for one in said]", "found")
    shorts = {"long": False, "short": True, "part": False}
    for added, compiled, found in ((1.0, 4, shorts), (3.0, 1, {})):
        write(program, added=added)
        (program / "called.py").write_text(text)
        (program / "run.py").write_text(script)
        value = pytest.approx(plain["part"](2.0) + added, rel=1e-12)
        assert end(start(program)) == [value, compiled, found]


@pytest.mark.slow
@pytest.mark.parametrize("kinds", ["float, float", "float, int"])
def test_fields_that_change_places_are_other_code(program, kinds):
    """Truth: the field that the function names; uniform named tuples are a type of their own."""
    first, second = kinds.split(", ")
    for fields in (f"a: {first}; b: {second}", f"b: {first}; a: {second}"):
        (program / "calls.py").write_text(
            "from typing import NamedTuple\nfrom klack.machine.compiling.jit import njit\n"
            f"class Pair(NamedTuple): {fields}\n"
            "@njit\ndef given(pair):\n    return 1.0 * pair.a\n"
            f"def whole(x):\n    return given(Pair(x, {second}(5)))\n"
        )
        assert end(start(program)) == [2.0 if fields[0] == "a" else 5.0, 1, []]


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="looks for the machine code of Linux")
def test_only_entries_have_machine_code(compiled_program):
    inner, entry = (file.read_bytes() for file in files(compiled_program))

    assert b"\x7fELF" not in inner
    assert b"\x7fELF" in entry


@pytest.mark.slow
def test_a_text_that_changes_compiles_nothing(program):
    write(program, text='"""One."""\n    ')
    assert end(start(program)) == [7.0, 2, []]

    write(program, text='"""Two."""\n    ')

    assert end(start(program)) == [7.0, 0, []]


@pytest.mark.slow
def test_two_processes_that_start_together_compile_each_function_once(program):
    both = [start(program), start(program)]
    (one, compiled, _), (other, also_compiled, _) = (end(process) for process in both)

    assert one == other == 7.0
    assert compiled + also_compiled == 2
    assert files(program, "*.lock") == []


@pytest.mark.slow
def test_code_of_another_processor_is_not_run(compiled_program):
    """It is left where it is: machines may share a home."""
    program = compiled_program
    assert end(start(program, NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES=""))[:2] == [7.0, 2]
    assert len(files(program)) == 4
    assert end(start(program)) == [7.0, 0, []]


NOT_PICKLED = b"klack code 1\n" + hashlib.sha256(b"code").digest() + b"code"


@pytest.mark.slow
@pytest.mark.parametrize("damage", [b"", b"klack code 1\n", b"klack code 0\n", NOT_PICKLED, None])
def test_damaged_code_is_compiled_again(compiled_program, damage):
    program = compiled_program
    for file in files(program):
        content = bytearray(file.read_bytes())
        content[len(content) // 2] ^= 1
        file.write_bytes(bytes(content) if damage is None else damage)

    assert end(start(program))[:2] == [7.0, 2]
    assert end(start(program)) == [7.0, 0, []]


@pytest.mark.slow
def test_code_that_others_may_write_is_not_run(compiled_program):
    program = compiled_program
    files(program)[0].parent.chmod(0o777)

    value, compiled, said = end(start(program))

    assert (value, compiled) == (7.0, 2)
    assert "other users may write to it" in said[0]
    assert len(said) == 1


def _writes_everywhere(folder: Path) -> bool:
    closed = folder / "closed"
    closed.mkdir(mode=0o500)
    return os.access(closed, os.W_OK)


def test_a_read_only_store_is_read(program, tmp_path):
    if _writes_everywhere(tmp_path):
        pytest.skip("nothing is read-only for the administrator")
    end(start(program))
    folder = files(program)[0].parent
    folder.chmod(0o500)
    try:
        assert end(start(program)) == [7.0, 0, []]
        write(program, scale=5.0)
        value, compiled, said = end(start(program))
    finally:
        folder.chmod(0o700)
    assert (value, compiled) == (11.0, 2)
    assert "read-only" in said[0]


@pytest.mark.slow
def test_a_full_disk_is_one_warning(program):
    """As a limit of the size of files, which the system reports in the same way."""
    value, compiled, said = end(start(program, FILE_LIMIT="100"))

    assert (value, compiled) == (7.0, 2)
    assert len(said) == 1
    assert "compiled functions are not cached" in said[0]
    assert files(program, "*") == []
    assert end(start(program)) == [7.0, 2, []]


@pytest.mark.slow
def test_without_a_folder_everything_works(program):
    (program / "store").write_text("a file")

    value, compiled, said = end(start(program))

    assert (value, compiled) == (7.0, 2)
    assert len(said) == 1
    assert "compiled functions are not cached" in said[0]


def test_a_killed_process_leaves_no_lock_behind(program, tmp_path):
    """Its lock file stays, but the system has given the lock back."""
    from klack.machine.compiling.turn import take_turn

    lock, done = tmp_path / "f.lock", tmp_path / "f.code"
    text = (
        "import sys, time; from pathlib import Path\n"
        "from klack.machine.compiling.turn import take_turn\n"
        f"turn = take_turn(Path({str(lock)!r}), Path({str(done)!r})); print('has it', flush=True)\n"
        "time.sleep(600)"
    )
    other = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE)
    assert other.stdout is not None
    assert other.stdout.readline() == b"has it\n"
    other.kill()
    other.wait()

    assert lock.exists()
    turn = take_turn(lock, done, patience=10.0)
    assert turn is not None
    turn.end()
    assert not lock.exists()


@pytest.mark.slow
def test_a_function_that_cannot_be_compiled_says_so_each_time(program):
    """The second try must not wait for the lock of the first."""
    (program / "run.py").write_text(f"""
import sys
sys.path.insert(0, {str(program)!r})
import calls
for _ in range(2):
    try:
        calls.whole("text")
    except Exception as error:
        print(type(error).__name__)
""")
    process = start(program)
    try:
        told, _ = process.communicate(timeout=120)
    finally:
        process.kill()
    assert told.split() == ["TypingError"] * 2


def test_who_waits_too_long_compiles_itself(tmp_path):
    from klack.machine.compiling.turn import take_turn

    lock, done = tmp_path / "f.lock", tmp_path / "f.code"
    first = take_turn(lock, done)
    second = take_turn(lock, done, patience=0.1)
    assert first is not None
    assert second is not None
    second.end()
    assert lock.exists()  # still that of the first
    done.touch()
    assert take_turn(lock, done) is None
    first.end()


def test_an_old_lock_is_not_waited_for(tmp_path, monkeypatch):
    """That of a process that was stopped, in the functions within one that was waited for."""
    from klack.machine.compiling import turn

    lock, done = tmp_path / "f.lock", tmp_path / "f.code"
    lock.touch()
    os.utime(lock, (0.0, 0.0))  # left by a process that was killed
    first = turn.take_turn(lock, done)
    assert first is not None
    assert lock.stat().st_mtime > 0.0  # its time begins now
    os.utime(lock, (0.0, 0.0))
    monkeypatch.setattr(turn.time, "sleep", lambda seconds: pytest.fail("waits"))
    assert turn.take_turn(lock, done) is not None
    first.end()


@pytest.mark.slow
def test_a_plain_impact_does_not_compile_what_it_does_not_have(tmp_path):
    """On the axis, elastic, smooth, without friction: time loops of both levels, an empty store.

    What is compiled follows from types: less optimised, it takes half as long.
    """
    program = "from klack.warming.small_impact import plain_impacts; plain_impacts()"
    subprocess.run(
        [sys.executable, "-c", program],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_OPT": "1"},
        check=True,
    )
    compiled = {file.name.rpartition("-")[0] for file in tmp_path.glob("*/*.code")}
    assert {"single_contact.run_one_contact", "interface_kernel.march"} <= compiled
    assert "active_set.solve_active" in compiled
    absent = {"rubbing", "closed_points", "yielding_points", "rough_points", "guide_friction"}
    absent |= {"guide_films", "tilting_films", "guide_film"}
    assert not {name for name in compiled if name.partition(".")[0] in absent}


def test_no_function_goes_past_the_store():
    root = Path(__file__).parents[2] / "src" / "klack"
    for file in root.rglob("*.py"):
        if file.parent.name != "compiling":
            assert "numba import njit" not in file.read_text("utf-8"), file
            assert "numba.njit" not in file.read_text("utf-8").replace(":func:`numba.njit`", "")
