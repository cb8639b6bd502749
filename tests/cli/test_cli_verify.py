"""``klack verify``: a mistake shows, on the terminal and on the page; truth: made-up checks."""

import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from klack.cli.main import main
from klack.verification import COVERS, GROUPS, Check, ComparedCurve, compare, run_checks


def play(monkeypatch: pytest.MonkeyPatch, group: str, checks: Callable[[], list[Check]]) -> None:
    module = ModuleType(f"klack.verification.{group}")
    module.checks = checks  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)


def check(computed: float = 2.0, name: str = "speed [m/s]", **more) -> Check:
    known = {"expected": 2.0, "tolerance": 0.1, "source": "a closed formula"}
    return compare("impact", name, computed=computed, **(known | more))


def page_of(monkeypatch, checks: list[Check], code: int) -> str:
    play(monkeypatch, "impact", lambda: checks)
    assert main(["verify", "--group", "impact", "--html", "page.html", "-q"]) == code
    return Path("page.html").read_text(encoding="utf-8")


def rows_of(page: str) -> list[str]:
    return re.findall(r'<tr id="check-\d+".*?</tr>', page, re.S)


# ------------------------------------------------------------------ the page


def test_page_of_passed_checks_is_not_red(monkeypatch):
    page = page_of(monkeypatch, [check(2.05), check(1.95)], 0)

    assert '<p class="verdict">2 of 2 checks passed</p>' in page
    assert 'class="failed"' not in page
    assert len(rows_of(page)) == 2
    assert COVERS["impact"] in page
    for words in ("python", "numpy", "scipy", "numba", "solvers", "threads", "UTC"):
        assert words in page.split("</dl>")[0]


def test_failed_check_makes_the_page_red(monkeypatch):
    page = page_of(monkeypatch, [check(2.05), check(2.3)], 1)

    assert '<p class="verdict failed">1 of 2 checks passed</p>' in page
    good, bad = rows_of(page)
    assert 'class="failed"' in bad
    assert "FAILED" in bad
    assert "FAILED" not in good
    assert "+1.5e-01 <small>relative" in bad
    assert "x 0.67" in bad


def test_tolerance_that_is_wide_without_a_reason_is_counted(monkeypatch):
    wide, said = check(2.0001), check(2.0001, reason="the table has two digits")
    page = page_of(monkeypatch, [wide, said], 0)

    assert "1 with a tolerance that is wide without a reason" in page
    assert [row.count('data-wide="1"') for row in rows_of(page)] == [1, 0]
    assert "the table has two digits" in rows_of(page)[1]


def test_words_of_checks_are_words_on_the_page(monkeypatch):
    evil = "<script>alert('x')</script> & \"quotes\""
    page = page_of(monkeypatch, [check(name=evil, source=evil, reason=evil)], 0)

    assert "<script>alert" not in page
    assert page.count("&lt;script&gt;alert") == 3
    assert page.count("<script>") == 1  # the one of the page


def test_page_asks_for_nothing_from_anywhere(monkeypatch):
    curve = ComparedCurve(
        x_label="time [us]",
        y_label="force [N]",
        expected=(np.arange(5.0), np.arange(5.0)),
        computed=(np.arange(5.0), np.arange(5.0)),
    )
    page = page_of(monkeypatch, [check(curve=curve)], 0)

    assert "default-src 'none'" in page
    links = re.findall(r'(?:src|href)="([^"]{1,12})', page)
    assert len(links) > 3
    assert all(link.startswith(("#", "data:image")) for link in links)


def test_curve_of_several_checks_is_drawn_once(monkeypatch):
    x = np.linspace(0.0, 1.0, 50)
    curve, other = (
        ComparedCurve(
            x_label="time [us]", y_label="force [N]", expected=(x, x), computed=(x, x + shift)
        )
        for shift in (0.1, 0.2)
    )
    checks = [check(curve=curve), check(), check(name="again [N]", curve=curve), check(curve=other)]
    page = page_of(monkeypatch, checks, 0)

    figures = re.findall(r"<figure.*?</figure>", page, re.S)
    assert len(figures) == 2
    assert 'data-checks="1 3 "' in figures[0]
    linked = [re.findall(r'href="#(impact-\d)"', row) for row in rows_of(page)]
    assert linked == [["impact-1"], [], ["impact-1"], ["impact-2"]]


@pytest.mark.parametrize("error", [KeyboardInterrupt, MemoryError])
def test_interruption_leaves_the_page_as_it_was(error, monkeypatch):
    Path("page.html").write_text("old")

    def stop(*_: object) -> str:
        raise error

    play(monkeypatch, "impact", lambda: [check()])
    monkeypatch.setattr("klack.verification.page.render_page", stop)

    assert main(["verify", "--group", "impact", "--html", "page.html", "-q"]) in (2, 130)
    assert Path("page.html").read_text() == "old"
    assert [path.name for path in Path.cwd().iterdir()] == ["page.html"]


def test_place_that_cannot_be_written_is_refused_before_the_work(monkeypatch, capsys):
    ran = []
    play(monkeypatch, "impact", lambda: ran.append(1) or [check()])

    assert main(["verify", "--group", "impact", "--html", "no/such/page.html"]) == 2
    assert "--html no/such/page.html" in capsys.readouterr().err
    assert ran == []


# ------------------------------------------------------------------ groups that stop


def test_mistake_in_a_group_is_one_failed_check_that_says_where(monkeypatch, capsys):
    def mistaken() -> list[Check]:
        raise ZeroDivisionError("division by zero")

    play(monkeypatch, "impact", mistaken)
    play(monkeypatch, "spectra", lambda: [check()])

    code = main(
        ["verify", "--group", "impact", "spectra", "--json", "all.json", "--html", "x.html"]
    )

    assert code == 1
    stopped, other = json.loads(Path("all.json").read_text())["checks"]
    assert stopped["name"] == "runs to its end (ZeroDivisionError: division by zero)"
    assert "test_cli_verify.py:" in stopped["reason"]
    assert not stopped["passed"]
    assert stopped["headroom"] is None
    assert other["passed"]
    assert "FAILED" in capsys.readouterr().out
    assert 'class="verdict failed"' in Path("x.html").read_text(encoding="utf-8")


def test_interruption_is_no_failed_check(monkeypatch):
    def interrupted() -> list[Check]:
        raise KeyboardInterrupt

    play(monkeypatch, "impact", interrupted)

    with pytest.raises(KeyboardInterrupt):
        run_checks(["impact"])


# ------------------------------------------------------------------ the terminal and JSON


def test_lines_fit_a_terminal_of_100_columns(monkeypatch, capsys):
    long = "a name that goes on " * 8 + "[m/s]"
    play(monkeypatch, "impact", lambda: [check(name=long, source=long), check(2.3, name=long)])

    for option in ((), ("--all",)):
        assert main(["verify", "--group", "impact", *option]) == 1
        out = capsys.readouterr().out
        assert max(map(len, out.splitlines())) <= 100
        assert "expected 2, computed 2.3, deviation +1.5e-01 relative, tolerance 1.0e-01" in out


def test_only_what_deserves_a_look_is_printed_in_full(monkeypatch, capsys):
    checks = [check(2.0 + 0.019 * k, name=f"check {k} [N]") for k in range(12)]
    play(monkeypatch, "impact", lambda: checks)

    assert main(["verify", "--group", "impact"]) == 1
    out = capsys.readouterr().out
    shown = [k for k in range(12) if f"check {k} [N]" in out]
    assert shown == [6, 7, 8, 9, 10, 11]  # one failed, five close to their tolerance

    assert main(["verify", "--group", "impact", "--all"]) == 1
    out = capsys.readouterr().out
    assert all(f"check {k} [N]" in out for k in range(12))


def test_json_says_headroom_reason_and_conditions(monkeypatch):
    checks = [check(2.05), check(2.0001), check(2.0001, reason="two digits")]
    play(monkeypatch, "impact", lambda: checks)

    assert main(["verify", "--group", "impact", "--json", "all.json", "-q"]) == 0
    written = json.loads(Path("all.json").read_text())

    assert [one["wide"] for one in written["checks"]] == [False, True, False]
    assert written["checks"][0]["headroom"] == pytest.approx(4.0, rel=1e-9)
    assert written["checks"][2]["reason"] == "two digits"
    assert {"klack", "date", "python", "numpy", "solvers", "threads"} <= set(written["about"])


def test_list_names_every_group_without_heavy_imports():
    code = (
        "import sys; from klack.cli.main import main; code = main(['verify', '--list']); "
        "print({'numpy', 'scipy', 'numba', 'matplotlib'} & set(sys.modules), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)

    assert done.stderr == "set()\n"
    starts = [line.split()[0] for line in done.stdout.splitlines() if not line.startswith(" ")]
    assert starts == list(GROUPS)


@pytest.mark.parametrize(
    ("name", "expected", "absolute", "words"),
    [
        ("time [s]", 2.0, False, "relative"),
        ("time [s]", 2.0, True, "s"),
        ("time [s]", 0.0, False, "s"),
        ("restitution [-]", 0.5, True, "absolute"),
        ("largest error [relative]", 0.0, False, "relative"),
        ("largest relative deviation", 0.0, False, "relative"),
        ("numbers that differ", 0.0, False, "absolute"),
    ],
)
def test_deviation_says_what_it_is(name, expected, absolute, words):
    found = check(expected + 0.01, name=name, expected=expected, absolute=absolute)

    assert found.deviation_unit == words
