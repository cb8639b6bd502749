"""A terminal shows from the first second on what goes on; truth: what a pseudo-terminal gets."""

import os
import select
import sys
import time

import pytest

pty = pytest.importorskip("pty")

from klack.terminal.progress import show_progress  # noqa: E402


class Screen:
    """A terminal whose text can be waited for."""

    def __init__(self) -> None:
        self.ours, theirs = pty.openpty()
        self.stream = os.fdopen(theirs, "w")
        self.text = ""

    def shows(self, words: str, patience: float = 20.0) -> bool:
        """Wait until the words are there."""
        end = time.monotonic() + patience
        while words not in self.text and time.monotonic() < end:
            if select.select([self.ours], [], [], 0.1)[0]:
                self.text += os.read(self.ours, 65536).decode(errors="ignore")
        return words in self.text

    def close(self) -> None:
        self.stream.close()
        os.close(self.ours)


@pytest.fixture
def screen(monkeypatch):
    screen = Screen()
    monkeypatch.setenv("TERM", "xterm")
    yield screen
    screen.close()


def shown_on(screen: Screen, monkeypatch: pytest.MonkeyPatch, **options: bool):
    monkeypatch.setattr(sys, "stderr", screen.stream)  # not in the fixture: pytest has its own
    return show_progress(**options)


@pytest.mark.slow
def test_it_shows_before_anything_reports(screen, monkeypatch):
    with shown_on(screen, monkeypatch):
        assert screen.shows("starting")  # nobody has called it


@pytest.mark.slow
def test_a_stage_is_shown_when_it_begins(screen, monkeypatch):
    with shown_on(screen, monkeypatch) as progress:
        assert screen.shows("starting")
        progress("mesh", 0.0)
        assert screen.shows("mesh")  # and nothing more is called: it is meshing


@pytest.mark.slow
def test_compiling_is_called_so(screen, monkeypatch):
    from numba.core import event

    with shown_on(screen, monkeypatch) as progress:
        assert screen.shows("starting")
        progress("run", 0.0)
        with event.trigger_event("numba:compile"):
            assert screen.shows("run: compiling (once)")
        progress("run", 0.5)
        assert screen.shows("50 %")
        assert "compiling" not in screen.text.rsplit("50 %", 1)[0].rsplit("run", 1)[-1]


@pytest.mark.slow
def test_waiting_for_another_process_is_told_as_waiting(screen, monkeypatch):
    from numba.core import event

    with shown_on(screen, monkeypatch) as progress:
        assert screen.shows("starting")
        progress("run", 0.0)
        with event.trigger_event("numba:compile"):  # of a function that calls the other's
            with event.trigger_event("klack:wait"):
                assert screen.shows("run: waiting while another process compiles")
            assert screen.shows("run: compiling (once)")


def test_lines_tell_compiling_and_waiting_once_each(capsys):
    from numba.core import event

    with show_progress() as progress:
        progress("run", 0.0)
        for kind in ("klack:wait", "numba:compile", "klack:wait"):
            with event.trigger_event(kind):
                pass

    told = [line.partition(";")[0] for line in capsys.readouterr().err.splitlines()]
    assert told == ["waiting while another process compiles", "compiling (once)"]


def test_a_stage_that_lasts_is_told_at_its_beginning_and_again(monkeypatch, capsys):
    """Nothing is called meanwhile: a factorisation reports nothing for minutes."""
    for name, short in (("_LASTS", 0.05), ("_AGAIN", 0.1), ("_OFTEN", 0.01)):
        monkeypatch.setattr(f"klack.terminal.progress.{name}", short)
    told = ""
    with show_progress() as progress:
        progress("static contact", 0.25)
        end = time.monotonic() + 20.0
        while told.count("so far") < 2 and time.monotonic() < end:
            time.sleep(0.02)
            told += capsys.readouterr().err

    first, again, *_ = told.splitlines()
    assert first == "static contact ..."
    assert again.startswith("static contact: ")
    assert again.endswith("s so far, 25 %")


def test_a_short_command_leaves_the_screen_alone(screen, monkeypatch):
    with shown_on(screen, monkeypatch) as progress:
        progress("mesh", 1.0)
    assert not screen.shows("mesh", patience=0.3)


@pytest.mark.slow
def test_quiet_shows_nothing(screen, monkeypatch):
    with shown_on(screen, monkeypatch, quiet=True) as progress:
        progress("mesh", 1.0)
        assert not screen.shows("mesh", patience=0.7)
