"""What the commands do with a finished study: truth = the study that is put in."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from klack.analyses.impact.analysis import IMPACT
from klack.cli.main import main

DRAWN = Path(__file__).parents[1] / "data" / "case" / "drawn.yaml"


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def asked(monkeypatch, impact_study):
    """Replace the calculation by a finished study; tell what it was asked for."""
    got = SimpleNamespace(study=impact_study)

    def run_impact(case, *, levels, certify, progress, threads):
        got.case, got.levels, got.threads = case, levels, threads
        got.certify = certify
        progress("mesh", 1.0)
        return got.study

    module = ModuleType("klack.analyses.impact.run")
    module.run_impact = run_impact
    monkeypatch.setitem(sys.modules, "klack.analyses.impact.run", module)
    return got


@pytest.fixture
def quick_report(monkeypatch):
    """Write a word instead of a report, which takes seconds to draw."""
    for name in ("html.write_report", "pdf.write_pdf"):
        monkeypatch.setattr(f"klack.report.{name}", lambda page, path: path.write_text(page.title))


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.slow
def test_impact_writes_result_report_and_numbers(asked, capsys):
    assert main(["impact", str(DRAWN), "--level", "full", "reduced", "--json", "numbers.json"]) == 0
    folder = Path("klack-results/drawn")
    assert names(folder) == ["report.html", "report.pdf", "result.zarr"]
    assert (folder / "report.html").read_text().lstrip().startswith("<!")
    assert (folder / "report.pdf").read_bytes().startswith(b"%PDF")
    assert (asked.case.title, asked.threads) == ("Two turned bodies", None)
    assert asked.levels == ("reduced", "full")
    out = capsys.readouterr().out
    assert "peak force [N]" in out
    assert "Results in klack-results/drawn: result.zarr, report.html, report.pdf" in out
    numbers = json.loads(Path("numbers.json").read_text())
    peak = asked.study.levels["full"].measures.peak_force
    assert numbers["levels"]["full"]["peak_force_N"] == pytest.approx(peak, rel=1e-12)
    assert IMPACT.load(folder).levels["full"].measures.peak_force == peak


def test_options_of_impact(asked, capsys):
    options = ["--no-report", "--out", "x/y", "--threads", "2", "-q", "--json", "-"]
    assert main(["impact", str(DRAWN), "--level", "lumped", *options]) == 0

    assert names(Path("x/y")) == ["result.zarr"]
    assert (asked.levels, asked.threads) == (("lumped",), 2)
    out, err = capsys.readouterr()
    assert json.loads(out)["case"] == "demo"
    assert err == "Note: the contact of the made-up study is coarse\n"  # quiet, but not about that


@pytest.mark.parametrize(("option", "expected"), [((), True), (("--no-certify",), False)])
def test_the_error_is_estimated_unless_told_otherwise(asked, option, expected):
    assert main(["impact", "two-rods", "--no-report", "--quiet", *option]) == 0
    assert asked.certify is expected


def test_levels_come_from_the_case_if_none_are_asked_for(asked):
    assert main(["impact", str(DRAWN), "--no-report", "-q"]) == 0

    assert asked.levels == ("reduced", "full")


@pytest.mark.slow
def test_demo_runs_the_shipped_valve(asked, quick_report, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr("klack.cli.commands._has_display", lambda: True)
    Path("demo-valve").write_text("a file of the same name in the working folder")

    assert main(["demo", "-q"]) == 0
    assert main(["demo", "-q", "--no-open"]) == 0

    assert asked.case.name == "demo-valve"
    assert asked.levels == ("reduced", "full")
    assert opened == [Path("klack-results/demo-valve/report.html").resolve().as_uri()]


@pytest.mark.slow
def test_report_is_written_again_from_the_store(asked, quick_report, capsys):
    assert main(["impact", str(DRAWN), "--no-report", "-q", "--out", "r"]) == 0

    assert main(["report", "r"]) == 0
    assert main(["report", "r", "--out", "elsewhere", "-q"]) == 0

    assert names(Path("r")) == ["report.html", "report.pdf", "result.zarr"]
    assert names(Path("elsewhere")) == ["report.html", "report.pdf"]
    assert "Report in r: report.html, report.pdf" in capsys.readouterr().out


@pytest.mark.slow
def test_the_answer_is_told_before_its_report_is_made(asked, quick_report, monkeypatch, capsys):
    said = []

    def written(content, path):
        said.append(capsys.readouterr().out)
        path.write_text("page")

    monkeypatch.setattr("klack.report.html.write_report", written)
    assert main(["impact", str(DRAWN), "--out", "r"]) == 0

    assert "peak force" in said[0]
    assert capsys.readouterr().out == "Results in r: result.zarr, report.html, report.pdf\n"


@pytest.mark.slow
def test_ctrl_c_while_the_report_is_written_keeps_the_result(
    asked, quick_report, monkeypatch, capsys
):
    assert main(["impact", str(DRAWN), "-q", "--out", "r"]) == 0
    before = IMPACT.load(Path("r")).created

    def interrupted(study, path):
        path.write_text("half")
        raise KeyboardInterrupt

    monkeypatch.setattr("klack.report.html.write_report", interrupted)
    asked.study = replace(asked.study, created="later")
    assert main(["impact", str(DRAWN), "-q", "--out", "r"]) == 130

    assert names(Path("r")) == ["result.zarr"]  # and no report of the run before
    assert IMPACT.load(Path("r")).created == "later" != before
    assert "stopped; the result is in r; klack report r" in capsys.readouterr().err


@pytest.mark.slow
def test_a_bug_in_a_report_does_not_cost_the_calculation(asked, quick_report, monkeypatch, capsys):
    assert main(["impact", str(DRAWN), "-q", "--out", "r"]) == 0
    monkeypatch.setattr("klack.report.pdf.write_pdf", lambda study, path: 1 / 0)

    assert main(["impact", str(DRAWN), "--out", "r"]) == 70

    assert names(Path("r")) == ["result.zarr"]  # and no report of the run before
    out, err = capsys.readouterr()
    assert "Results in r: result.zarr\n" in out
    assert "ZeroDivisionError" in err
