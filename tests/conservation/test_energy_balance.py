"""Truth: conservation. Every run of the suite is judged; a run out of balance tells its user."""

import warnings
from pathlib import Path

import energy_ledger
import numpy as np
import pytest

from klack import energy_balance
from klack.contact.laws import LinearLaw
from klack.errors import AccuracyWarning, ConvergenceError
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation import impact
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.network_result import EnergyBooks
from klack.simulation.network_run import simulate_network
from klack.simulation.system import ContactPair, ReducedSystem

SOLVERS = {
    "simulate": "simulation/impact.py",
    "simulate_network": "simulation/network_run.py",
    "simulate_full_order": "transient/full_order.py",
    "simulate_interface": "transient/interface_run.py",
}


def bounce() -> None:
    pair = ContactPair(
        body_a="a", port_a="contact", body_b="b", port_b="contact", law=LinearLaw(1e9), gap=1e-6
    )
    system = ReducedSystem(bodies=(rigid_mass_body("a", 1e-3), fixed_body("b")), contacts=(pair,))
    impact.simulate_impact(system, speed=0.5, duration=20e-6)


@pytest.fixture
def leaking(monkeypatch: pytest.MonkeyPatch) -> None:
    """A kernel that loses a millionth of the speed in its last step."""
    run = impact.run_one_contact

    def spoiled(*arguments):
        status = run(*arguments)
        arguments[2][:] *= 1.0 - 1e-6
        return status

    monkeypatch.setattr(impact, "run_one_contact", spoiled)


def swing(periods: float) -> EnergyBooks:
    """Let 3 g swing on 5 kN/mm for some periods of 154 us."""
    parts = {"mass": RigidMass(mass=3e-3, speed=0.5), "part": Spring(stiffness=5e6, preload=0.0)}
    duration = periods * 2.0 * np.pi * np.sqrt(3e-3 / 5e6)
    rows = Network(parts, [["mass.body", "part.end"]]).rows()
    return simulate_network(
        rows, duration=duration, step=100e-9, coarse=1, record=1e-6, start="free"
    ).books


@pytest.mark.parametrize("periods", [2.0, 2.25])
def test_whole_periods_turn_their_energy_over(periods):
    """The stores at both ends of whole periods are alike, yet all energy went to and fro."""
    books = swing(periods)
    energy = 0.5 * 3e-3 * 0.5**2

    assert books.scale == pytest.approx(energy, rel=1e-9)
    # round-off of a record: the run ends up to 1 us late
    share = np.sin(2.0 * np.pi * periods) ** 2
    assert books.throughput == pytest.approx(share * energy, abs=2e-2 * energy)


def test_a_leak_of_a_millionth_fails_the_test_that_ran_it(leaking):
    with pytest.raises(AssertionError, match=r"a_leak_of_a_millionth.*a run of simulate leaves"):
        bounce()


def test_a_leak_can_be_allowed(leaking):
    with energy_ledger.allowed("simulate", 1e-5):
        bounce()
    with pytest.raises(AssertionError):
        bounce()


@pytest.mark.usefixtures("as_for_a_user")
def test_a_user_is_warned_of_a_leak(leaking):
    with pytest.warns(AccuracyWarning, match=r"simulate: the energy balance does not close by 2"):
        bounce()


@pytest.mark.usefixtures("as_for_a_user")
def test_a_user_is_not_warned_without_a_leak():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bounce()


@pytest.mark.usefixtures("as_for_a_user")
@pytest.mark.parametrize(
    ("residual", "least_loss", "words"),
    [
        (0.0, -1e-3, r"has a loss that returned 1\.0e-03 of it"),
        (-2e-9, 0.0, r"does not close by 2\.0e-09 of the energy throughput, more than the 1e-09"),
    ],
)
def test_what_a_user_is_told(residual, least_loss, words):
    with pytest.warns(AccuracyWarning, match=words):
        energy_balance.check_energy_balance("run", residual, least_loss, limit=1e-9, advice="x")


@pytest.mark.usefixtures("as_for_a_user")
@pytest.mark.parametrize("numbers", [(float("nan"), 0.0), (0.0, float("nan")), (float("inf"), 0.0)])
def test_energy_that_is_no_number_is_a_failure(numbers):
    with pytest.raises(ConvergenceError, match="energy of this run is not a finite number"):
        energy_balance.check_energy_balance("run", *numbers, limit=1e-9, advice="x")


def test_every_solver_is_judged():
    """Each hands its books over, and the suite knows a limit for each."""
    folder = Path(energy_balance.__file__).parent
    for name, file in SOLVERS.items():
        assert f'check_energy_balance(\n        "{name}"' in (folder / file).read_text(), name
    assert set(energy_ledger.LIMITS) == set(SOLVERS)
    calls = [path for path in folder.rglob("*.py") if "check_energy_balance(" in path.read_text()]
    assert len(calls) == len(SOLVERS) + 1


def test_worker_processes_judge_as_well():
    """A run in a process of a pool fails in the same words."""
    with energy_ledger.workers.WorkerPool(1, None) as pool:
        found = dict(pool.completed(energy_ledger.name_of_the_judge, ["a run"]))
    assert found == {"a run": "judge"}
