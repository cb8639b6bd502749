"""Truth: conservation. The books of every run of ``klack impact`` are judged, and named.

The warm-up of the interface level meets no contact: what a run owes when it is cut off within one
is nobody's mistake.
"""

from pathlib import Path

import pytest

from klack.analyses.impact import interface_level
from klack.analyses.impact.run import run_impact
from klack.case import load_case
from klack.simulation import energy_balance
from klack.transient import interface_run

pytestmark = pytest.mark.slow

CASE = Path(__file__).parents[1] / "data" / "tiny_rods.yaml"


@pytest.fixture
def judged(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, float, float]]:
    """Every judged run: solver, residual, least loss."""
    found: list[tuple[str, float, float]] = []
    check = energy_balance.check_energy_balance

    def keep(run, residual, least_loss, **how):
        found.append((run, residual, least_loss))
        check(run, residual, least_loss, **how)

    monkeypatch.setattr(energy_balance, "check_energy_balance", keep)
    return found


def test_the_warm_up_of_the_interface_level_touches_nothing(judged, monkeypatch):
    """Exactly no residual, where the run itself leaves round-off and what it owes."""
    runs = []
    simulate = interface_level.simulate_interface

    def watched(*args, **how):
        runs.append(simulate(*args, **how))
        return runs[-1]

    monkeypatch.setattr(interface_level, "simulate_interface", watched)
    run_impact(load_case(CASE), levels=["interface"], certify=False)

    warm_up, run = runs
    assert (warm_up.steps, warm_up.steps_in_contact) == (1, 0)
    assert run.steps_in_contact > 100
    assert [name for name, *_ in judged].count("simulate_interface") == 2
    # the motion of one step: round-off
    assert abs(warm_up.energy.residual) < 1e-14


@pytest.mark.usefixtures("as_for_a_user")
def test_a_note_says_which_run_it_is_about(monkeypatch):
    """The interface level is asked three times: as a level, and twice for the estimate."""
    monkeypatch.setattr(interface_run, "_BALANCE", -1.0)  # nothing is good enough
    study = run_impact(load_case(CASE), levels=["reduced", "interface"])

    notes = [note for note in study.warnings if "energy balance" in note]
    begins = sorted({note.split(": simulate_interface")[0] for note in notes})
    assert begins == [
        "error estimate, 15 modes",
        "error estimate, 30 modes",
        "level 'interface'",
    ]
