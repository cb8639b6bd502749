"""The second process that compiles while the first one does.

Truth: the processes that are started, and how they end.
"""

import os
import subprocess
import sys
from types import SimpleNamespace

import pytest
from numba.core import event

from klack.compiling import ahead
from klack.compiling.ahead import compiling_ahead


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
