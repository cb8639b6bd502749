"""An imported FMU against the native component of the same law, over the coupling step.

Truth: the native spring and damper; orders of explicit coupling (hold 1, linear 2); the energy that
holding a spring force makes, k/2 (dy)^2 per exchange, in closed form.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from energy_ledger import allowed

from klack.errors import InputError
from klack.mechanics.force import ConstantForce
from klack.mechanics.imported_fmu import ImportedFmu
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.component import Component
from klack.network.network import Network
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network

pytestmark = pytest.mark.filterwarnings("ignore::klack.network.checks.LooseBodyWarning")

MASS, STIFFNESS, DAMPING, SPEED = 3e-3, 4e4, 2.0, 0.5  # a period of 1.7 ms
STEP, DURATION = 0.5e-6, 1e-3
Build = Callable[..., Path]


@pytest.fixture(autouse=True)
def coupling_may_make_energy() -> Iterator[None]:
    """Let the coupling give energy, which is what these tests measure: up to 6 % at large steps."""
    with allowed("simulate_network", 0.1):
        yield


def swing(part: Component, *, duration: float = DURATION, **options: object) -> NetworkResult:
    """Needle that is thrown into a spring."""
    parts = {"needle": RigidMass(mass=MASS, speed=SPEED), "part": part}
    network = Network(parts, [["needle.body", "part.end"]])
    given: dict = {"step": STEP, "coarse": 1, "record": 8 * STEP, "start": "free"} | options
    return simulate_network(network.rows(), duration=duration, **given)


def imported(fmu: Path, steps: int, extrapolation: str = "linear", damping: float = DAMPING):
    return ImportedFmu(
        file=fmu,
        coupling_step=steps * STEP,
        displacement="x",
        velocity="v",
        force="F",
        parameters={"k": STIFFNESS, "c": damping},
        extrapolation=extrapolation,
    )


def deviation(result: NetworkResult, native: NetworkResult) -> float:
    """Largest difference of the displacement over its largest value."""
    name = "needle.body displacement"
    a, b = result.channels[name].values, native.channels[name].values
    return float(np.abs(a - b).max() / np.abs(b).max())


@pytest.mark.slow
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize(
    ("extrapolation", "order", "damped", "finest"),
    [
        ("hold", 1, DAMPING, 5e-3),
        ("linear", 2, 0.0, 1e-4),
        # the velocity of the last interval is half an interval old
        ("linear", 1, DAMPING, 5e-3),
    ],
)
def test_the_motion_converges_to_that_of_the_native_part(
    version: int,
    extrapolation: str,
    order: int,
    damped: float,
    finest: float,
    spring_damper_fmu: Build,
):
    native = swing(Spring(stiffness=STIFFNESS, preload=0.0, damping=damped))

    errors = [
        deviation(swing(imported(spring_damper_fmu(version), steps, extrapolation, damped)), native)
        for steps in (16, 8, 4)
    ]

    slope = np.polyfit(np.log([16, 8, 4]), np.log(errors), 1)[0]
    assert slope == pytest.approx(order, abs=0.1)
    assert errors[-1] < finest


@pytest.mark.slow
@pytest.mark.parametrize(("extrapolation", "order"), [("hold", 1), ("linear", 2)])
def test_the_energy_error_falls_with_the_coupling_step(
    extrapolation: str, order: int, spring_damper_fmu: Build
):
    errors = []
    for steps in (16, 8, 4):
        books = swing(imported(spring_damper_fmu(), steps, extrapolation, 0.0)).books
        errors.append(books.losses["part coupling error"])
        assert books.relative_residual < 1e-9  # left by the forces of a step

    slope = np.polyfit(np.log([16, 8, 4]), np.log(np.abs(errors)), 1)[0]
    assert slope == pytest.approx(order, abs=0.1)
    assert abs(errors[-1]) < {"hold": 2e-2, "linear": 2e-4}[extrapolation] * MASS * SPEED**2 / 2


def test_holding_a_spring_force_makes_energy_as_computed_by_hand(spring_damper_fmu: Build):
    """Of each exchange k/2 (y_1 - y_0)^2, from the recorded displacements."""
    steps = 8
    result = swing(imported(spring_damper_fmu(), steps, "hold", 0.0), record=steps * STEP)

    y = result.channels["needle.body displacement"].values
    # the last interval has no exchange at its end
    made = 0.5 * STIFFNESS * np.sum(np.diff(y[:-1]) ** 2)
    assert result.books.losses["part coupling error"] == pytest.approx(-made, rel=1e-9)
    # what the FMU did by its own account: minus the energy of its spring
    assert result.books.supplies["part work"] + made == pytest.approx(
        -0.5 * STIFFNESS * y[-2] ** 2
        + made
        + result.channels["part force of the FMU"].values[-1] * (y[-1] - y[-2]),
        rel=1e-9,
    )


def test_work_is_that_of_the_needle(spring_damper_fmu: Build):
    """Kinetic energy of the needle = supply less loss, and both are there."""
    result = swing(imported(spring_damper_fmu(), 4))
    books = result.books

    speed = result.channels["needle velocity"].values
    change = 0.5 * MASS * (speed[-1] ** 2 - speed[0] ** 2)
    gained = books.supplies["part work"] - books.losses["part coupling error"]
    assert gained == pytest.approx(change, rel=1e-9)
    assert change < -1e-5  # the damper took something


def test_coarse_steps_meet_the_points_of_exchange(spring_damper_fmu: Build):
    """Exchanges at whole coarse steps: as good as with fine steps, and never twice."""
    native = swing(Spring(stiffness=STIFFNESS, preload=0.0, damping=0.0))
    fine = swing(imported(spring_damper_fmu(), 16, damping=0.0))
    coarse = swing(imported(spring_damper_fmu(), 16, damping=0.0), coarse=16, record=16 * STEP)

    assert coarse.coarse_steps > 0
    assert deviation(fine, native) < 1e-3
    last = coarse.channels["needle.body displacement"].values[-1]
    assert last == pytest.approx(native.channels["needle.body displacement"].values[-1], rel=2e-3)


def test_a_coupling_step_below_the_time_step_is_refused(spring_damper_fmu: Build):
    with pytest.raises(InputError, match=r"coarse: 1"):
        swing(imported(spring_damper_fmu(), 4), coarse=16, record=16 * STEP)


def test_an_fmu_of_even_steps_gets_even_steps(spring_damper_fmu: Build):
    fmu = spring_damper_fmu(variable=False)

    swing(imported(fmu, 4), duration=1e-4)
    part = imported(fmu, 4).model_copy(update={"coupling_step": 3.5 * STEP})
    with pytest.raises(InputError, match="whole steps of the time loop"):
        swing(part, duration=1e-4)


def test_a_static_start_finds_the_rest_of_the_spring(spring_damper_fmu: Build):
    """2 N on a stiff spring of 100 N/um: 20 nm, and the needle stays there."""
    stiff = {"k": 1e8, "c": 0.0}
    parts = {
        "needle": RigidMass(mass=MASS),
        "part": imported(spring_damper_fmu(), 1).model_copy(update={"parameters": stiff}),
        "push": ConstantForce(force=2.0),
    }
    rows = Network(parts, [["needle.body", "part.end", "push.end"]]).rows()

    for _ in range(2):  # the same rows again: a new instance
        result = simulate_network(rows, duration=1e-4, step=STEP, coarse=1, record=8 * STEP)

        y = result.channels["needle.body displacement"].values
        np.testing.assert_allclose(y, 2e-8, rtol=1e-6)


def test_two_ports_take_opposite_forces(spring_damper_fmu: Build):
    """A spring between two free masses: momentum stays, at the frequency of the reduced mass."""
    parts = {
        "needle": RigidMass(mass=MASS, speed=SPEED),
        "frame": RigidMass(mass=MASS),
        "part": imported(spring_damper_fmu(), 2, damping=0.0),
    }
    rows = Network(parts, [["needle.body", "part.end"], ["frame.body", "part.base"]]).rows()
    half_period = np.pi * np.sqrt(0.5 * MASS / STIFFNESS)

    result = simulate_network(
        rows, duration=half_period, step=STEP, coarse=1, record=STEP, start="free"
    )

    needle, frame = (result.channels[f"{name} velocity"].values for name in ("needle", "frame"))
    np.testing.assert_allclose(needle + frame, SPEED, rtol=1e-12)
    assert frame[-1] == pytest.approx(SPEED, rel=1e-4)  # all momentum handed over
