"""Curves of a run before its end; truth: the channels of its result, and what was drawn."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from klack.analyses.shots.run import _so_far as shots_so_far
from klack.analyses.stroke.run import run_stroke
from klack.analyses.stroke_shots.one_stroke import CENTRED
from klack.analyses.stroke_shots.run import _so_far as strokes_so_far
from klack.app.folder import OpenFolder
from klack.app.jobs import Jobs
from klack.case.any_case import load_valve_case
from klack.machine.progress import SoFar, StageProgress, drawn, silent
from klack.terminal import progress as terminal
from klack.terminal.progress import CURVES_FILE, PROGRESS_FILE, show_progress

VALVE = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"


class Drawings:
    """A reporter that draws whenever it may."""

    def __init__(self) -> None:
        self.all: list[list[SoFar]] = []

    def __call__(self, stage: str, fraction: float) -> None: ...

    def drawn(self, curves) -> None:
        self.all.append([SoFar(**vars(one) | {"y": one.y.copy()}) for one in curves()])


def test_curves_of_a_stroke_are_the_beginning_of_its_channels(tmp_path):
    """Lift in um and peak forces in N: the same numbers, only their units differ."""
    case = tmp_path / "case.yaml"
    case.write_text(VALVE.read_text().replace("run: {", "run: {check_steps: false, "))
    reporter = Drawings()
    study = run_stroke(load_valve_case(case), variants=["dry"], progress=reporter)
    (variant,) = study.variants.values()
    curves = [drawing for drawing in reporter.all if drawing]
    assert curves
    for lift, *forces in curves:
        count = lift.x.size
        assert lift.title == f"{variant.name}: lift [um]"
        np.testing.assert_allclose(lift.x, 1e3 * variant.result.time[:count], rtol=1e-12)
        values = variant.channel(study.channels.lift).values
        np.testing.assert_allclose(lift.y, 1e6 * values[:count], rtol=1e-12)
        assert {one.name for one in forces} == {stop.name for stop in study.stops}
        for one in forces:
            values = variant.channel(f"{one.name} peak force").values
            np.testing.assert_array_equal(one.y, values[:count])
    assert lift.x.size == variant.result.time.size  # the last one is whole


def folder_of_job(root: Path) -> Path:
    place = root / ".klack-app" / "jobs" / "20260101-000000-0123abcd"
    place.mkdir(parents=True)
    return place


def test_a_run_of_the_application_draws_into_its_folder_and_a_page_reads_it(tmp_path, monkeypatch):
    """A peak of one sample among 10 000 is still there in 300 columns; others are rounded off."""
    place = folder_of_job(tmp_path)
    monkeypatch.setenv(PROGRESS_FILE, str(place / "progress.json"))
    monkeypatch.setattr(terminal, "_DRAWN", 0.0)
    x = np.arange(10_000.0)
    curve = SoFar(title="force [N]", name="seat", x=x, y=np.where(x == 4321, 7.0, 0.0), x_label="t")
    with show_progress() as progress:
        StageProgress(progress, "run")(0.5)
        StageProgress(progress, "run").drawn(lambda: [curve])
    (found,) = Jobs(OpenFolder(tmp_path)).curves(place.name)
    assert (found.title, found.name, found.x_label, found.dots) == ("force [N]", "seat", "t", False)
    assert found.x.size < 700
    assert found.x[found.y == 7.0] == [4321.0]
    assert json.loads((place / "progress.json").read_text())["stage"] == "run"


def test_curves_are_not_made_where_nobody_draws_nor_sooner_than_a_second(tmp_path, monkeypatch):
    def never() -> list[SoFar]:
        raise AssertionError

    drawn(silent, never)
    StageProgress(silent, "run").drawn(never)
    monkeypatch.setenv(PROGRESS_FILE, str(tmp_path / "progress.json"))
    monkeypatch.setattr(terminal, "_DRAWN", 1e6)
    with show_progress() as progress:
        drawn(progress, never)
    assert not (tmp_path / CURVES_FILE).exists()


@pytest.mark.parametrize(
    "told",
    [
        "no JSON",
        '{"curves": 5}',
        '{"curves": [{"title": "a"}]}',
        '{"curves": [{"title": "a", "name": "", "x_label": "", "dots": 0, "x": [1], "y": [1, 2]}]}',
        '{"curves": [{"title": "a", "name": "", "x_label": "", "dots": 0, "x": 1, "y": 2}]}',
    ],
)
def test_a_damaged_file_draws_nothing(told, tmp_path):
    place = folder_of_job(tmp_path)
    (place / CURVES_FILE).write_text(told)
    assert Jobs(OpenFolder(tmp_path)).curves(place.name) == ()


def test_shots_and_strokes_are_dots_by_their_numbers_without_the_centred_one():
    """Whatever order they end in; what is drawn is what each has as its result."""
    done = {i: SimpleNamespace(index=i, numbers=_numbers(i)) for i in (2, 0)}
    rebound, force = shots_so_far(SimpleNamespace(done=done))
    assert (rebound.x.tolist(), rebound.y.tolist()) == ([0, 2], pytest.approx([10, 12]))
    assert force.y.tolist() == [100.0, 102.0]
    assert force.dots

    log = SimpleNamespace(
        done={("dry", i): SimpleNamespace(stops={"seat": _numbers(i)}) for i in (2, CENTRED, 0)}
    )
    (peaks,) = strokes_so_far(log)
    assert (peaks.name, peaks.x.tolist(), peaks.y.tolist()) == ("seat (dry)", [0, 2], [100, 102])


def _numbers(index: int) -> dict[str, float]:
    return {"rebound_height": (10.0 + index) * 1e-6, "peak_force": 100.0 + index}
