"""Lines that a study tells: doubts by their kind, and how long it will take."""

import pytest

from klack.analyses.study import live
from klack.analyses.study.asked_points import PointRow
from klack.analyses.study.evaluation import row_warnings
from klack.analyses.study.live import Pace, duration_text


def row(*notes):
    return PointRow((1.0,), notes=notes)


def test_notes_that_differ_in_numbers_only_are_told_once():
    rows = [row("only 18 % left", "slow"), row("only 19.5 % left"), row("only 18 % left"), row()]
    assert row_warnings(rows, row(), ()) == (
        "3 of 4 points, with other numbers: only 18 % left",
        "1 of 4 points: slow",
    )


def test_a_note_counts_once_for_a_point():
    assert row_warnings([row("a 1", "a 2")], row(), ()) == ("1 of 1 points: a 2",)


class _Heard:
    def __init__(self):
        self.lines = []

    def __call__(self, stage, fraction):
        pass

    def remark(self, line):
        self.lines.append(line)


def test_pace_counts_what_is_computed_and_what_is_left(monkeypatch):
    """Truth: 100 points computed in 10 s are 36 000 in an hour; 300 more take 30 s."""
    now = 0.0
    monkeypatch.setattr(live, "perf_counter", lambda: now)
    heard = _Heard()
    told = Pace(heard, 500)
    now = 4.0
    told.tell(190, 90)
    now = 10.0
    told.tell(200, 100, "best so far point 7")
    now = 11.0
    told.tell(250, 150)
    now = 60.0
    told.tell(500, 400)
    assert heard.lines == ["200 of 500 points, 3.6e+04 in an hour, 30 s left; best so far point 7"]


@pytest.mark.parametrize(
    ("seconds", "text"), [(12.3, "12 s"), (150.0, "2 min"), (6000.0, "1 h 40 min")]
)
def test_durations(seconds, text):
    assert duration_text(seconds) == text


def test_lines_of_nothing_computed_have_no_rate(monkeypatch):
    now = 0.0
    monkeypatch.setattr(live, "perf_counter", lambda: now)
    heard = _Heard()
    told = Pace(heard, 10)
    now = 9.0
    told.tell(4, 0)
    assert heard.lines == ["4 of 10 points"]
