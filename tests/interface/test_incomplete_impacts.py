"""Truth: the same levels run without the one that fails, and what the page on safety promises."""

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.comparison.calculix import level_of
from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.run import run_impact
from klack.analyses.incomplete import IncompleteImpactError
from klack.analyses.noise.source import impact_sources, load_sources
from klack.case import load_case
from klack.cli.main import main
from klack.contact.complementarity import ComplementaritySolver
from klack.errors import ConvergenceError, InputError
from klack.transient import full_order, interface_run

pytestmark = pytest.mark.slow

CASE = Path(__file__).parents[1] / "data" / "small_ball.yaml"
SAID = "level 'full' failed and has no results: simulate_full_order: step"


class Impatient(ComplementaritySolver):
    """Gives up where the points that carry are not those of the step before."""

    def __init__(self, A: np.ndarray) -> None:
        super().__init__(A)
        self.round_limit = 1


@contextmanager
def impatience() -> Iterator[None]:
    """Let the full order fail."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(full_order, "ComplementaritySolver", Impatient)
        yield


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Result of ``klack impact``, in which the full order has failed."""
    folder: Path = tmp_path_factory.mktemp("incomplete")
    numbers = folder / "numbers.json"
    options = ["--no-report", "--out", str(folder), "--json", str(numbers), "--quiet"]
    with impatience():
        assert main(["impact", str(CASE), "--level", "reduced,interface,full", *options]) == 1
    return folder


def test_levels_that_did_not_fail_are_kept_to_the_last_bit(stored):
    study = IMPACT.load(stored)
    healthy = run_impact(load_case(CASE), levels=("reduced", "interface"))

    assert list(study.levels) == list(healthy.levels)
    for name, level in healthy.levels.items():
        kept = study.levels[name].history
        assert np.array_equal(kept.force, level.history.force), name
        assert np.array_equal(kept.velocity_a, level.history.velocity_a), name
    assert study.reference == healthy.reference == "interface"
    assert study.deviations.keys() == healthy.deviations.keys()
    assert study.warnings[1:] == healthy.warnings


def test_numbers_name_the_level_that_failed(stored):
    said = json.loads((stored / "numbers.json").read_text())

    assert said["complete"] is False
    assert list(said["failures"]) == ["full"]
    assert "no active set found in 1 rounds" in said["failures"]["full"]
    assert list(said["levels"]) == ["reduced", "interface"]
    assert said["warnings"][0].startswith(SAID)


def test_terminal_and_exit_code(capsys, tmp_path):
    with impatience():
        code = main(["impact", str(CASE), "--no-report", "--out", str(tmp_path / "out")])
    printed = capsys.readouterr()

    assert code == 1
    assert "peak force [N]" in printed.out
    assert f"Note: {SAID}" in printed.out
    assert f"klack impact: {SAID}" in printed.err
    assert (tmp_path / "out" / "result.zarr").is_dir()


def test_report_of_an_incomplete_result(stored, tmp_path, capsys):
    assert main(["report", str(stored), "--out", str(tmp_path)]) == 0

    assert f"Note: {SAID}" in capsys.readouterr().err
    page = (tmp_path / "report.html").read_text()
    assert "failed and has no results: simulate_full_order" in page
    assert "only available at level &#39;full&#39;, which failed" in page.replace("'", "&#39;")


def test_export_of_an_incomplete_result(stored, tmp_path, capsys):
    assert main(["export", str(stored), "--to", "csv", "--out", str(tmp_path)]) == 0

    assert f"Note: {SAID}" in capsys.readouterr().err
    said = "".join(path.read_text() for path in tmp_path.rglob("*.json"))
    said += "".join(path.read_text() for path in tmp_path.rglob("*.csv"))
    assert SAID in said
    assert list(tmp_path.glob("*interface*"))


def test_noise_and_comparison_of_an_incomplete_result(stored):
    (source,) = load_sources(stored)
    assert source.run == "interface"
    assert source.notes == (f"The impact is incomplete: {IMPACT.load(stored).warnings[0]}",)

    why = re.escape("it failed (simulate_full_order: step")
    with pytest.raises(InputError, match=why):
        load_sources(stored, ("full",))
    with pytest.raises(InputError, match=why):
        level_of(IMPACT.load(stored), "full")


def test_noise_says_what_speaks_against_the_contact(stored):
    study = IMPACT.load(stored)
    contact = replace(study.contact, doubts=("it lies on a sharp edge",))

    (source,) = impact_sources(replace(study, contact=contact))

    said = "The contact ball.tip on block.face cannot be relied on: it lies on a sharp edge."
    assert source.notes[-1] == said


def test_a_level_that_fails_costs_no_later_one(monkeypatch):
    monkeypatch.setattr(interface_run, "march", lambda steps, *_: (0, interface_run.FAILED))

    with pytest.raises(IncompleteImpactError, match="no contact forces found") as caught:
        run_impact(load_case(CASE), levels=("interface", "full"))

    study = caught.value.study
    assert (list(study.levels), list(study.failures)) == (["full"], ["interface"])


def test_without_any_level_the_error_is_a_plain_one():
    with impatience(), pytest.raises(ConvergenceError, match="step") as caught:
        run_impact(load_case(CASE), levels=("full",))
    assert not isinstance(caught.value, IncompleteImpactError)
