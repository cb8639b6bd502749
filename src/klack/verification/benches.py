"""Benches of many checks: a network in steps of one length, a step of one branch."""

from collections.abc import Mapping, Sequence
from typing import Any
from warnings import catch_warnings, simplefilter

import numpy as np

from klack.hydraulics.fluid_library import library_fluid
from klack.network.catalogue import component_class
from klack.network.checks import LooseBodyWarning
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Ambient, BranchRow, Rows
from klack.network.step_function import evaluate
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network

__all__ = [
    "AMBIENT",
    "BAR",
    "HEPTANE",
    "MU_HEPTANE",
    "MU_OIL",
    "OIL",
    "RHO_HEPTANE",
    "RHO_OIL",
    "branch_of",
    "branch_step",
    "component",
    "crossings",
    "last",
    "run_network",
]

AMBIENT = Ambient()
BAR = 1e5
HEPTANE = library_fluid("n-heptane").at(293.15)
OIL = library_fluid("ISO VG 46").at(313.15)
RHO_HEPTANE, RHO_OIL = (float(fluid.density(AMBIENT.pressure)) for fluid in (HEPTANE, OIL))
MU_HEPTANE, MU_OIL = (float(fluid.viscosity(AMBIENT.pressure)) for fluid in (HEPTANE, OIL))


def component(word: str, **numbers: Any) -> Any:
    """A component by its word in case files, numbers in SI."""
    return component_class(word)(**numbers)


def run_network(
    parts: Mapping[str, Any],
    joints: Sequence[Sequence[str]],
    *,
    still: bool = False,
    fluid: Any = None,
    gas: Any = None,
    **run: Any,
) -> NetworkResult:
    """Run a network in surroundings of one atmosphere and 20 degC; bodies may fly freely.

    ``still`` adds a mass on a spring that nothing touches, as every network has a body. ``run``
    goes to :func:`simulate_network`; by default, all steps have one length and bodies start free.
    """
    own: dict[str, Component] = {}
    if still:
        own = {
            "needle": component("rigid-mass", mass=1e-3),
            "spring": component("spring", stiffness=1e4, preload=0.0),
        }
        joints = [["needle.body", "spring.end"], *joints]
    with catch_warnings():
        simplefilter("ignore", LooseBodyWarning)
        rows = Network(own | dict(parts), joints, fluid=fluid, gas=gas).rows()
    known: dict[str, Any] = {"coarse": 1, "start": "free"}
    return simulate_network(rows, **known | run)


def crossings(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Times at which a record rises through zero, straight between its samples."""
    k = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0))
    return np.asarray(time[k] - values[k] * np.diff(time)[k] / np.diff(values)[k])


def last(result: NetworkResult, name: str) -> float:
    """Last value of a channel."""
    return float(result.channels[name].values[-1])


def branch_of(part: Component, number: int = 0) -> BranchRow:
    """One branch of a part between two nodes, a needle and the ground."""
    rows = Rows(
        ambient=AMBIENT,
        fluid=OIL,
        component="part",
        handles={"a": 1, "b": 2, "fluid": 1, "needle": 0, "spool": 0, "body": -1},
    )
    part.add_rows(rows)
    return rows.branches[number]


def branch_step(
    row: BranchRow,
    p_a: float,
    p_b: float,
    *,
    t: float = 0.0,
    h: float = 1e-6,
    state: Sequence[float] | np.ndarray | None = None,
    ports: Sequence[float] = (),
) -> np.ndarray:
    """Results of one step: flow, slopes, forces, next state, energies."""
    start = row.state if state is None else state
    return evaluate(
        row.step,
        row.parameters,
        start,
        [t, h, p_a, p_b, RHO_OIL, RHO_OIL, *ports],
        3 + len(row.ports) + row.state.size + len(row.books),
    )[1]
