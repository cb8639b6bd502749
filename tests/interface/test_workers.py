"""Worker processes: what they answer, and what is said of those that die."""

import os
import subprocess
import sys
import time
from operator import neg
from pathlib import Path

import pytest

from klack.analyses.workers import WorkerPool

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
