"""Worker processes, cores, the second process that compiles, and machines without a compiler.

Worker processes: what they answer, and what is said of those that die.

Cores of this process; truth = what the scheduler was told.

The second process that compiles while the first one does.

Truth: the processes that are started, and how they end.

A machine without a compiler leaves out the tests of the C core, and the run says so.
"""

import os
import subprocess
import sys
import time
from operator import neg
from pathlib import Path
from types import SimpleNamespace

import c_compiler
import pytest
from numba.core import event

from klack.analyses.workers import WorkerPool
from klack.errors import InputError
from klack.machine.compiling import ahead
from klack.machine.compiling.ahead import compiling_ahead
from klack.machine.cores import available_cores

DYING = """
import os, signal, sys, threading, time
def die():
    time.sleep(float(os.environ["DIES_AFTER"]))
    os.kill(os.getpid(), signal.SIGKILL)
if any("spawn_main" in word for word in sys.orig_argv):
    threading.Thread(target=die, daemon=True).start()
"""
PROGRAM = """
import time
from klack.analyses.workers import WorkerDied, WorkerPool
with WorkerPool(2, bytes(1_000_000)) as pool:
    for _ in range(2):
        try:
            list(pool.completed(time.sleep, [20.0] * 3))
        except WorkerDied as error:
            print(error)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.parametrize("seconds", [0.0, 0.1, 1.0])
@pytest.mark.slow
def test_a_worker_that_dies_at_any_time_is_an_error(seconds: float, tmp_path: Path):
    """Truth = what killed it: at its first moment, while it imports, and at work.

    More is shared than a pipe takes (64 kB): nobody may wait for a dead process to read it.
    """
    (tmp_path / "sitecustomize.py").write_text(DYING)
    places = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env={**os.environ, "PYTHONPATH": places, "DIES_AFTER": str(seconds)},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )

    assert done.returncode == 0, done.stderr
    assert done.stdout == "a worker process died by signal 9\n" * 2


@pytest.mark.slow
def test_every_item_is_computed_once_by_no_more_processes_than_items():
    with WorkerPool(2, None) as pool:
        assert dict(pool.completed(neg, [1])) == {1: -1}
        assert len(pool._processes) == 1
        found = list(pool.completed(neg, range(20)))
        assert len(pool._processes) == 2
        assert list(pool.completed(neg, [])) == []
    assert sorted(found) == [(i, -i) for i in range(20)]


@pytest.mark.slow
def test_an_error_of_the_work_names_its_place_and_answers_do_not_mix():
    """Those that were still on their way belong to what was given up."""
    with WorkerPool(2, None) as pool:
        with pytest.raises(TypeError, match="bad operand") as caught:
            list(pool.completed(neg, [1, "a word", *range(2, 9)]))
        assert "In a worker process:\nTraceback" in caught.value.__notes__[0]
        for item, found in pool.completed(neg, range(100, 110)):
            assert found == -item
            break
        assert sorted(pool.completed(neg, range(4))) == [(i, -i) for i in range(4)]


MORTAL = """
import os, signal
from pathlib import Path
def attempt(item):
    folder, deaths, value = item
    for k in range(deaths):
        try:
            Path(folder, f"{value}-{k}").touch(exist_ok=False)
        except FileExistsError:
            continue
        os.kill(os.getpid(), signal.SIGKILL)
    return -value
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
@pytest.mark.slow
def test_who_dies_is_replaced_and_its_item_tried_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Truth = the number of deaths: none is tried more often, nothing is lost or comes twice."""
    (tmp_path / "mortal_work.py").write_text(MORTAL)
    monkeypatch.syspath_prepend(tmp_path)
    from mortal_work import attempt  # type: ignore[import-not-found]

    items = [(str(tmp_path), deaths, value) for value, deaths in enumerate([0, 1, 3, 2, 0, 9, 0])]
    left = items.copy()
    with WorkerPool(2, None) as pool:
        found = dict(pool.answers(attempt, lambda _: left.pop(0) if left else None, 3))
        assert sorted(found) == sorted(items)
        for (_, deaths, value), answer in found.items():
            if deaths < 3:
                assert answer == -value
            else:
                assert str(answer) == "a worker process died by signal 9"
                assert len(list(tmp_path.glob(f"{value}-*"))) == 3
        assert sorted(pool.completed(neg, range(4))) == [(i, -i) for i in range(4)]
    sys.modules.pop("mortal_work")


def test_what_is_not_wanted_any_more_is_not_waited_for():
    begin = time.monotonic()
    with WorkerPool(2, None) as pool:
        for item, _ in pool.completed(time.sleep, [0.0, 90.0, 90.0]):
            assert item == 0.0
            break
    assert time.monotonic() - begin < 60


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="binds this process to one core")
def test_a_process_bound_to_one_core_has_one():
    before = os.sched_getaffinity(0)
    assert available_cores() == len(before)
    os.sched_setaffinity(0, {min(before)})
    try:
        assert available_cores() == 1
    finally:
        os.sched_setaffinity(0, before)


def test_where_the_scheduler_does_not_say_the_machine_counts(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert available_cores() == 1
    monkeypatch.setattr(os, "cpu_count", lambda: 8)
    assert available_cores() == 8


def compile_one(module="klack.simulation.network_kernel"):
    """What numba tells of a function that it compiles."""
    function = SimpleNamespace(py_func=SimpleNamespace(__module__=module))
    with event.trigger_event("numba:compile", data={"dispatcher": function}):
        pass


@pytest.fixture
def started(monkeypatch, tmp_path):
    """Processes that sleep instead of compiling."""
    processes = []

    def start(command, **options):
        assert command[0] == sys.executable
        assert command[-4:] == ["-m", "klack.warming", "loop", "rest"]
        processes.append(real([sys.executable, "-c", "import time; time.sleep(600)"], **options))
        return processes[-1]

    real = subprocess.Popen
    monkeypatch.setattr(ahead.subprocess, "Popen", start)
    monkeypatch.setattr(ahead, "available_cores", lambda: 2)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    return processes


def test_one_process_is_started_with_the_first_function_and_ends_with_the_block(started):
    with compiling_ahead(("loop", "rest")):
        assert started == []
        compile_one()
        compile_one()
        assert [process.poll() for process in started] == [None]
    assert len(started) == 1
    assert started[0].poll() is not None
    compile_one()
    assert len(started) == 1


def test_it_ends_when_the_work_fails(started):
    def work():
        with compiling_ahead(("loop", "rest")):
            compile_one()
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work()
    assert started[0].poll() is not None


def test_none_is_started_for_functions_of_others_nor_on_one_core(started):
    with compiling_ahead(("loop", "rest")):
        compile_one("numba.np.arrayobj")
    with compiling_ahead(("loop", "rest"), threads=1):
        compile_one()
    assert started == []


def test_none_is_started_without_a_store(started, monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    with compiling_ahead(("loop", "rest")):
        compile_one()
    assert started == []


def test_the_process_ends_when_the_one_that_started_it_has_gone(tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-P", "-m", "klack.warming", "loop"],
        stdin=subprocess.PIPE,
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
    )
    assert process.stdin is not None
    process.stdin.close()
    assert process.wait(timeout=120) == 0
    assert not list(tmp_path.rglob("run_network*"))


def test_a_missing_compiler_is_reported(monkeypatch):
    def none(platforms):
        raise InputError("x", got="no C compiler for it", expected="one", hint="install one.")

    monkeypatch.setattr(c_compiler, "require_compilers", none)
    monkeypatch.setattr(c_compiler.shutil, "which", lambda name: None)

    first, second = c_compiler.untested()

    assert first.startswith("C core not tested: no C compiler")
    assert "gcc is not installed" in second


def test_nothing_is_reported_where_all_is_there(monkeypatch):
    monkeypatch.setattr(c_compiler, "require_compilers", lambda platforms: None)
    monkeypatch.setattr(c_compiler.shutil, "which", lambda name: "/usr/bin/gcc")

    assert c_compiler.untested() == []
