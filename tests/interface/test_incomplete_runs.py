"""Truth: the same run up to the failure. What fails late keeps its record, and says so everywhere.

A number that is not finite is a failure, wherever it appears.
"""

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from klack.analyses.noise.source import _notes
from klack.analyses.stroke import run as stroke
from klack.analyses.stroke.analysis import STROKE
from klack.case.any_case import load_valve_case
from klack.cli.main import main
from klack.errors import ConvergenceError
from klack.mechanics.end_stop import EndStop
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.component import Component
from klack.network.network import Network
from klack.network.port import ELEMENT, Port
from klack.network.rows import Book, Channel, Rows
from klack.network.step_function import python_step
from klack.simulation.finite import require_finite
from klack.simulation.network_result import IncompleteRunError, NetworkResult
from klack.simulation.network_run import simulate_network

LATE = 30.03e-6  # [s]


class Faulty(Component):
    """Pushes with 40 N; from a given time on one of its outputs is wrong, or it fails."""

    type: ClassVar[str] = "faulty"
    ports: ClassVar[Mapping[str, Port]] = {"end": ELEMENT}
    wrong: str = "nothing"
    number: str = "0"  # a component takes no number that is not finite
    code: int = 0

    def add_rows(self, rows: Rows) -> None:
        places = {"force": 0, "state": 1, "energy": 2}

        def step(par: Any, state: Any, inp: Any, out: Any) -> int:
            out[0], out[1], out[2] = -40.0, state[0] + inp[1], -40.0 * (inp[3] - inp[2])
            if inp[0] + inp[1] <= LATE or self.wrong == "nothing":
                return 0
            if self.wrong in places:
                out[places[self.wrong]] = float(self.number)
            return self.code

        rows.element(
            python_step(step, parameters=1, states=1, inputs=4, outputs=3),
            ports=(rows.port("end"),),
            parameters=(0.0,),
            state=(0.0,),
            books=(Book("work", "supply"),),
            channels=(Channel("clock", "s", 0),),
            failures={7: "its wire is tired"},
        )


def run(wrong: str, number: str = "0", code: int = 0, **more: float) -> NetworkResult:
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=3e-3, points=("tip",)),
        "stop": EndStop(gap=2e-6, law={"kind": "linear", "stiffness": 1e9}, restitution=0.8),
        "weak": Spring(stiffness=1.0, preload=0.0),
        "culprit": Faulty(wrong=wrong, number=number, code=code),
    }
    joints = [["needle.tip", "stop.upper", "weak.end", "culprit.end"], ["stop.lower", "ground"]]
    given = {"duration": 200e-6, "step": 100e-9, "record": 1e-6} | more
    return simulate_network(Network(parts, joints).rows(), coarse=1, start="free", **given)


@pytest.fixture(scope="module")
def healthy() -> NetworkResult:
    return run("nothing")


def check_record(found: NetworkResult, healthy: NetworkResult) -> None:
    count = len(found.time)
    assert LATE - 1.6e-6 <= found.time[-1] <= LATE
    for name, channel in found.channels.items():
        assert np.array_equal(channel.values, healthy.channels[name].values[:count]), name
    over = [e for e in found.events if np.isfinite(e.separation_time)]
    assert over == list(healthy.events)[: len(over)]
    assert len(over) >= 1
    assert found.books.relative_residual < 1e-9


def test_a_step_that_fails_late_keeps_the_record(healthy):
    with pytest.raises(IncompleteRunError, match=r"culprit: its wire is tired, at 30") as caught:
        run("code", code=7)
    found = caught.value.result

    assert found.failure == str(caught.value)
    check_record(found, healthy)


@pytest.mark.parametrize("wrong", ["force", "state", "energy"])
@pytest.mark.parametrize("number", ["nan", "infinity"])
def test_a_number_that_is_none_stops_the_run(healthy, wrong, number):
    with pytest.raises(IncompleteRunError, match=r"culprit.*not a finite number at 3\d") as caught:
        run(wrong, number)

    found = caught.value.result
    if wrong != "energy":  # it is no channel: looked at once in a chunk
        check_record(found, healthy)
    assert all(np.all(np.isfinite(item.values)) for item in found.channels.values())


def test_a_failure_before_the_first_record_is_a_plain_one():
    with pytest.raises(ConvergenceError, match="not a finite number") as caught:
        run("force", "nan", record=50e-6)
    assert not isinstance(caught.value, IncompleteRunError)


@pytest.mark.parametrize("name", ["gap", "force"])
def test_a_record_names_its_first_number_that_is_none(name):
    record = {"force": np.ones((5, 2)), "gap": np.ones(5)}
    require_finite("run", 1e-6, record)
    record[name][3] = np.nan
    with pytest.raises(ConvergenceError, match=rf"run: {name} is not a finite number 3 us after"):
        require_finite("run", 1e-6, record)


CASE = """
klack: 1
title: Rigid valve
network:
  components:
    needle: {type: rigid-mass, mass: 3 g, points: [tip]}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    stop: {type: end-stop, gap: 40 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.5}
    spring: {type: spring, stiffness: 10 N/mm, preload: 11 N}
    magnet: {type: force-over-time, time: [0 us, 50 us], force: [0 N, 30 N]}
  connections:
    - [needle.tip, seat.upper, stop.lower, spring.end, magnet.end]
    - [ground, seat.lower]
    - [ground, stop.upper]
run: {duration: 1 ms, step: 0.1 us, record: 2 us, variants: [dry, dry-lumped]}
lumped: {stiffness: 1e9 N/m}
"""


@pytest.fixture
def case(tmp_path: Path) -> Path:
    path = tmp_path / "valve.yaml"
    path.write_text(CASE)
    return path


def failing_at(variant: int, time: float) -> Callable[..., NetworkResult]:
    """Let the n-th run of a study fail at a time."""
    count = 0
    complete = stroke.run_variant

    def run_variant(case: Any, rows: Rows, *arguments: Any, **more: Any) -> NetworkResult:
        nonlocal count
        count += 1
        if count == variant:
            run = case.run.model_copy(update={"duration": time})
            found = complete(case.model_copy(update={"run": run}), rows, *arguments, **more)
            from dataclasses import replace

            text = "magnet: it burnt, at 600 us.\nTry: less."
            raise IncompleteRunError(text, replace(found, failure=text))
        return complete(case, rows, *arguments, **more)

    return run_variant


@pytest.mark.slow
@pytest.mark.parametrize("failed", [1, 2])
def test_a_stroke_that_fails_late_is_written_and_marked(
    case: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys, failed
):
    monkeypatch.setattr(stroke, "run_variant", failing_at(failed, 0.6e-3))
    out, numbers = tmp_path / "out", tmp_path / "numbers.json"
    asked = ["--no-check-steps", "--out", str(out), "--json", str(numbers)]  # one run a variant
    code = main(["stroke", str(case), *asked])
    printed = capsys.readouterr()
    name = ("dry", "dry-lumped")[failed - 1]

    assert code == 1
    assert "klack stroke: magnet: it burnt, at 600 us." in printed.err
    note = f"'{name}' is incomplete, it ends at 600 us: magnet: it burnt"
    assert note in " ".join(printed.out.split())
    said = json.loads(numbers.read_text())["variants"]
    assert list(said) == ["dry", "dry-lumped"][:failed]
    assert [item["complete"] for item in said.values()] == [True, False][2 - failed :]
    assert said[name]["failure"].startswith("magnet: it burnt")
    assert said[name]["end_time_s"] == pytest.approx(0.6e-3, rel=1e-2)
    study = STROKE.load(out)
    assert study.variants[name].result.failure.startswith("magnet: it burnt")
    assert len(study.variants[name].result.events) == len(said[name]["events"])
    assert "is incomplete, it ends at" in (out / "report.html").read_text()
    assert any("is incomplete" in note for note in _notes(study.variants[name], None))


@pytest.mark.slow
def test_a_cut_fine_record_is_said_everywhere(
    case: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
):
    from klack.exchange.results.study_table import stroke_table
    from klack.simulation import network_recorder

    monkeypatch.setattr(network_recorder, "_MOST_FINE", 20)
    out, numbers = tmp_path / "out", tmp_path / "numbers.json"
    code = main(
        ["stroke", str(case), "--variant", "dry", "--out", str(out), "--json", str(numbers)]
    )
    printed = " ".join(capsys.readouterr().out.split())
    study = STROKE.load(out)
    record = study.variants["dry"].result.interfaces["stop"]
    end = float(record.time[-1] + record.step[-1])

    assert code == 0
    assert not record.complete
    assert sum(event.time > end for event in study.variants["dry"].result.events) >= 2
    assert "the record of the forces in fine steps is full and ends early: of " in printed
    assert "of 'stop' at" in printed
    assert json.loads(numbers.read_text())["fine_record_ends_s"]["stop"] == pytest.approx(end)
    assert "fine steps is full and ends early" in (out / "report.html").read_text()
    table = stroke_table(study)
    assert "is full and ends early" in table.about["warnings"]
    axis = next(axis for axis in table.runs[0].axes if axis.name == "stop_time")
    assert axis.meaning.endswith("truncated because the record was full")


def test_a_case_of_a_minute_is_accepted(tmp_path: Path):
    path = tmp_path / "valve.yaml"
    path.write_text(CASE.replace("duration: 1 ms", "duration: 60 s").replace("2 us", "100 us"))
    assert load_valve_case(path).run.duration == 60.0
