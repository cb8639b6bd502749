"""A stop is a stop wherever it comes; truth = the exit codes that shells know."""

import ctypes
import signal
import time
from collections.abc import Iterator

import pytest

import klack.cli.main


def _stopped_in_a_callback(number: int) -> None:
    """As a signal comes while LLVM calls back: ctypes lets no exception through."""
    callback = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(number))
    callback()


@pytest.fixture
def heard() -> Iterator[None]:
    """Ctrl-C is heard also where the tests were started in the background, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heard")
@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)], ids=("Ctrl-C", "SIGTERM")
)
@pytest.mark.parametrize("goes_on", [True, False], ids=("goes on", "fails"))
def test_a_stop_that_a_library_drops_is_a_stop(number, code, goes_on, monkeypatch, capfd):
    def run(arguments: list[str], name: str) -> int:
        _stopped_in_a_callback(number)
        if not goes_on:
            raise RuntimeError("no compiled object yet")
        for _ in range(1000):
            time.sleep(0.01)
        return 0

    monkeypatch.setattr(klack.cli.main, "_run", run)
    handlers = [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]

    assert klack.cli.main.main(["stroke"]) == code
    assert capfd.readouterr().err == "klack stroke: stopped; no partial files are left.\n"
    assert handlers == [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]


def test_an_error_without_a_stop_stays_an_internal_error(monkeypatch, capfd):
    def run(arguments: list[str], name: str) -> int:
        raise RuntimeError("no compiled object yet")

    monkeypatch.setattr(klack.cli.main, "_run", run)

    assert klack.cli.main.main(["stroke"]) == 70
    assert "please report" in capfd.readouterr().err
