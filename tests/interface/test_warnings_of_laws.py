"""What is said of a local law that is left little: once for each model, with its name."""

from pathlib import Path

import pytest

from klack.analyses.impact.run import run_impact
from klack.assembling.valve import build_valve
from klack.case import load_case
from klack.case.any_case import load_valve_case
from klack.contact import local_law
from klack.machine.stages import collected_warnings

pytestmark = pytest.mark.slow

CASES = Path(__file__).parents[1] / "data" / "case"


@pytest.fixture(autouse=True)
def _every_law_is_doubtful(monkeypatch):
    monkeypatch.setattr(local_law, "_FAIR_SHARE", 2.0)
    monkeypatch.setenv("KLACK_CACHE", "off")


def test_an_impact_says_it_once_for_each_model():
    notes = run_impact(load_case(CASES / "crown.yaml"), levels=["reduced"]).warnings

    told = [note.partition(": contact: only")[0] for note in notes if "static compliance" in note]
    assert told[0] == "modes of the case"
    assert len(set(told)) == len(told)
    assert all(name.startswith(("modes of the case", "error estimate")) for name in told)


def test_a_valve_says_it_once_for_each_stop():
    with collected_warnings() as notes:
        build_valve(load_valve_case(CASES / "stroke.yaml"))

    told = [note.partition(": contact: only")[0] for note in notes if "static compliance" in note]
    assert sorted(told) == ["stop 'opening'", "stop 'seat'"]
