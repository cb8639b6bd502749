"""A closed contact that swings, in macro steps in which its force rises and falls.

Truth: exact motion of two modes on a linear spring; the order of the error; conservation of energy.
"""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.force import ForceOverTime
from klack.mechanics.rigid_mass import RigidMass
from klack.network.component import Component
from klack.network.network import Network
from klack.simulation.bodies import rod_body
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.simulation.step_sizes import StepSizes

STIFFNESS, SERIES = 3e7, 1e-8  # [N/m], [m/N]
PRESSED, LESS, WITHIN = 30.0, 9.0, 1e-6  # [N], [N] less from the start on, in so long a time [s]
DURATION = 1e-3
ROD = rod_body(
    "rod", length=0.08, area=6e-6, young=2.1e11, density=7850.0, elastic_modes=1, damping=0.0
)


def swing(law: dict[str, Any], step: float, series: float = 0.0) -> NetworkResult:
    """A rod of two modes pressed onto a stop, and soon less."""
    parts: dict[str, Component] = {
        "rod": FlexibleBody.of(ROD),
        "stop": EndStop(gap=0.0, law=law, series_compliance=series),
        "load": ForceOverTime(
            time=(0.0, WITHIN, 1.0), force=(-PRESSED, LESS - PRESSED, LESS - PRESSED)
        ),
    }
    nodes = [["rod.bottom", "stop.upper"], ["stop.lower", "ground"], ["rod.top", "load.end"]]
    return simulate_network(
        Network(parts, nodes).rows(),
        duration=DURATION,
        sizes=StepSizes(step=step, coarse=64, near=16, middle=4),
        record=64 * step,
    )


def free_swings(time: NDArray[np.float64], stiffness: float) -> NDArray[np.float64]:
    """All motions of the rod on a linear spring under a constant load, one a column."""
    bottom = np.asarray(ROD.port_shapes)[:, ROD.port_names.index("bottom")]
    square = np.linalg.eigvalsh(np.diag(ROD.omega**2) + stiffness * np.outer(bottom, bottom))
    angles = np.outer(time, np.sqrt(square))
    return np.column_stack([np.ones(len(time)), np.cos(angles), np.sin(angles)])


@pytest.mark.parametrize("series", [0.0, SERIES])
def test_two_modes_on_a_linear_spring_swing_exactly_but_for_a_fourth_order(series):
    errors = []
    for step in (10e-9, 5e-9):
        result = swing({"kind": "linear", "stiffness": STIFFNESS}, step, series)
        way, time = result.channels["rod.bottom displacement"].values, result.time
        early, late = (time > 10e-6) & (time < 0.15e-3), time > 0.85e-3
        swings = free_swings(time, 1.0 / (1.0 / STIFFNESS + series))
        found, *_ = np.linalg.lstsq(swings[early], way[early], rcond=None)

        assert result.steps.flight > 0.8 * DURATION / (64 * step)  # one macro step after another
        assert np.ptp(way) > 0.2 * abs(way[0])
        errors.append(np.abs(way - swings @ found)[late].max() / np.ptp(way))
    assert errors[0] < 2e-5
    assert errors[1] < errors[0] / 12.0  # 16 in short steps


def test_a_mass_rebounds_when_it_must():
    """Exact: half a sine.  A mean force in sub-steps of 80 ns keeps it closed for 0.5 ns more."""
    mass, stiffness, speed, gap = 2e-3, 2e8, 1.0, 10e-6
    parts: dict[str, Component] = {
        "mass": RigidMass(mass=mass, points=("tip",), speed=-speed),
        "stop": EndStop(gap=gap, law={"kind": "linear", "stiffness": stiffness}),
    }
    nodes = [["mass.tip", "stop.upper"], ["stop.lower", "ground"]]
    result = simulate_network(Network(parts, nodes).rows(), duration=40e-6, start="free")

    leaves = gap / speed + np.pi * np.sqrt(mass / stiffness)
    late = result.time[-1] - (result.channels["mass.tip displacement"].values[-1] + gap) / speed
    assert result.steps.sub_fine == 0
    assert late == pytest.approx(leaves, abs=0.05e-9)


@pytest.mark.parametrize(
    "law",
    [
        {"kind": "linear", "stiffness": STIFFNESS},
        {"kind": "hertz", "radius": 5e-3, "modulus": 1.15e11},
        {
            "kind": "table",
            "indentation": [0.0, 5e-7, 1e-6, 2e-6, 4e-6],
            "force": [0, 9, 25, 80, 260],
        },
    ],
    ids=["linear", "hertz", "table"],
)
def test_nothing_is_lost_whatever_the_law(law):
    result = swing(law, 20e-9)
    late = result.time > 5e-6
    force = result.channels["stop contact force"].values[late]

    assert np.ptp(force) > 0.3 * force.mean()
    assert abs(result.books.relative_residual) < 1e-12
    # the load is constant but for the first microsecond: no force gives more than its mean does
    swung = 0.5 * 0.5 * LESS * np.ptp(result.channels["rod.bottom displacement"].values)
    assert abs(result.books.supplies["forces that change within steps"]) < 1e-3 * swung
