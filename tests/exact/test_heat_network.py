"""Heat networks: exact inverses, exact steps, and what has no answer.

Truth: rational arithmetic, the matrix exponential of SciPy, closed forms.
"""

from fractions import Fraction
from math import inf

import numpy as np
import pytest
from scipy.linalg import expm

from klack.errors import ConvergenceError, InputError
from klack.network.component import Component
from klack.network.network import Network
from klack.thermal.conductance import Conductance
from klack.thermal.convection import Convection
from klack.thermal.fixed_temperature import FixedTemperature
from klack.thermal.heat_capacity import HeatCapacity
from klack.thermal.heat_network import HeatNetwork, heat_network
from klack.thermal.heat_source import HeatSource, HeatTable
from klack.thermal.heat_step import grounded_inverse, heat_step, steady_temperature
from klack.thermal.radiation import Radiation
from klack.thermal.slow_warm_up import SlowSettings, warm_up


def made(parts: dict[str, Component], connections: list[list[str]]) -> HeatNetwork:
    found = heat_network(Network(parts, connections))
    assert found is not None
    return found


def node(**keys: float) -> HeatNetwork:
    parts = {"part": HeatCapacity(**keys), "path": Conductance(conductance=0.5)}
    return made(parts, [["part.node", "path.a"], ["path.b", "ambient"]])


def test_the_inverse_is_exact_in_every_entry_over_thirty_decades():
    """Truth: the same elimination in rational numbers."""
    draw = np.random.default_rng(3)
    count = 6
    links = 10.0 ** draw.uniform(-15, 15, (count, count))
    links = np.triu(links, 1) + np.triu(links, 1).T
    ground = np.zeros(count)
    ground[2] = 1e-12

    found = grounded_inverse(links, ground)

    exact = [
        [
            Fraction(float(ground[i])) + sum(Fraction(float(x)) for x in links[i])
            if i == j
            else -Fraction(float(links[i, j]))
            for j in range(count)
        ]
        for i in range(count)
    ]
    identity = [[Fraction(int(i == j)) for j in range(count)] for i in range(count)]
    for k in range(count):
        pivot = exact[k][k]
        for i in range(count):
            if i != k:
                share = exact[i][k] / pivot
                exact[i] = [a - share * b for a, b in zip(exact[i], exact[k], strict=True)]
                identity[i] = [a - share * b for a, b in zip(identity[i], identity[k], strict=True)]
    expected = [[float(x / exact[i][i]) for x in identity[i]] for i in range(count)]
    np.testing.assert_allclose(found, expected, rtol=1e-13)


@pytest.mark.parametrize("length", [1e-4, 0.3, 20.0, 1e4])
def test_a_step_is_that_of_the_matrix_exponential(length):
    """Four nodes, one of them without capacity, two known temperatures, heat that changes."""
    parts = {
        "a": HeatCapacity(capacity=4.0, temperature=350.0),
        "b": HeatCapacity(mass=0.1, specific_heat=300.0, temperature=280.0),
        "c": HeatCapacity(capacity=0.7),
        "none": HeatCapacity(capacity=0.0),
        "bath": FixedTemperature(temperature=330.0),
        "ab": Conductance(conductance=0.8),
        "bn": Conductance(conductance=2.0),
        "nc": Conductance(conductance=0.4),
        "air": Convection(coefficient=10.0, area=0.03),
        "wall": Conductance(conductance=0.2),
    }
    network = made(
        parts,
        [
            ["a.node", "ab.a", "air.surface"],
            ["ab.b", "b.node", "bn.a"],
            ["bn.b", "none.node", "nc.a"],
            ["nc.b", "c.node", "wall.a"],
            ["wall.b", "bath.node"],
        ],
    )
    assert network.names == ("a", "b", "none", "c")
    first, last = np.array([1.0, 2.0, -0.5, 0.7]), np.array([3.0, 0.0, 0.5, 0.1])
    start = network.start.copy()
    links = network.links(start)

    found = heat_step(network, links, start, (first, last), length)

    G = np.diag(links.between.sum(axis=1) + links.to_fixed.sum(axis=1)) - links.between
    known = links.to_fixed @ network.fixed
    s, f = [0, 1, 3], [2]
    down = np.linalg.solve(G[np.ix_(f, f)], G[np.ix_(f, s)])
    A = G[np.ix_(s, s)] - G[np.ix_(s, f)] @ down

    def pushed(q):  # what drives the nodes with capacity
        return (q + known)[s] - G[np.ix_(s, f)] @ np.linalg.solve(G[np.ix_(f, f)], (q + known)[f])

    C = network.capacity[s]
    big = np.zeros((5, 5))
    big[:3, :3] = -A / C[:, None]
    big[:3, 3], big[:3, 4] = pushed(first) / C, (pushed(last) - pushed(first)) / C / length
    big[4, 3] = 1.0
    slow = (expm(big * length) @ np.concatenate((start[s], [1.0, 0.0])))[:3]
    fast = np.linalg.solve(G[np.ix_(f, f)], (last + known)[f]) - down @ slow
    np.testing.assert_allclose(found.temperature[s], slow, rtol=1e-11)
    np.testing.assert_allclose(found.temperature[f], fast, rtol=1e-11)
    moved = np.abs(found.supplied).sum() + np.abs(found.given_off).sum()
    moved += np.abs(found.stored).sum()
    assert abs(found.residual) < 1e-9 * moved


def test_nodes_without_path_and_heat_come_to_their_mean():
    parts = {
        "a": HeatCapacity(capacity=1.0, temperature=400.0),
        "b": HeatCapacity(capacity=3.0, temperature=300.0),
        "ab": Conductance(conductance=1e6),
    }
    network = made(parts, [["a.node", "ab.a"], ["ab.b", "b.node"]])
    links = network.links(network.start)

    found = steady_temperature(network, links, network.start, np.zeros(2))

    assert found == pytest.approx([325.0, 325.0], rel=1e-12)
    assert steady_temperature(network, links, network.start, np.array([1.0, 0.0])) is None


def test_capacities_at_one_node_add_up():
    parts = {
        "a": HeatCapacity(capacity=1.0),
        "b": HeatCapacity(capacity=3.0),
        "path": Conductance(conductance=0.5),
    }
    network = made(parts, [["a.node", "b.node", "path.a"], ["path.b", "ambient"]])

    assert network.capacity.tolist() == [4.0]
    assert network.node_of == {"a": 0, "b": 0}


def test_the_secant_of_radiation_is_exact():
    parts = {"a": HeatCapacity(capacity=1.0), "skin": Radiation(emissivity=1.0, area=1.0)}
    network = made(parts, [["a.node", "skin.surface"]])

    flow = network.links(np.array([400.0])).to_fixed[0, 0] * (400.0 - 293.15)

    assert flow == pytest.approx(5.670374419e-8 * (400.0**4 - 293.15**4), rel=1e-13)


def test_a_halved_tolerance_lowers_the_error():
    """Copper at constant current against its closed form; the step is of second order."""
    errors = []
    for tolerance in (0.4, 0.1, 0.025):
        settings = SlowSettings(tolerance=tolerance, spacing=500.0, duration=300.0)
        network = node(capacity=100.0)
        found = warm_up(
            network, lambda T: np.array([40.0 * (1.0 + 3.93e-3 * (T[0] - 293.15))]), settings
        )
        left = 0.5 - 40.0 * 3.93e-3
        exact = 40.0 / left * -np.expm1(-300.0 * left / 100.0)
        errors.append(abs(float(found.points[-1].temperature[0]) - 293.15 - exact))

    assert errors[2] < errors[1] < errors[0] < 0.4
    assert errors[2] < 0.2 * errors[0]


def test_a_step_ends_at_every_corner_of_a_table():
    table = HeatTable(time=(3.0, 3.5, 9.0), power=(0.0, 6.0, 6.0))
    parts = {
        "part": HeatCapacity(capacity=100.0),
        "path": Conductance(conductance=0.5),
        "heater": HeatSource(table=table),
    }
    network = made(parts, [["part.node", "path.a", "heater.node"], ["path.b", "ambient"]])

    found = warm_up(network, lambda T: np.zeros(1), SlowSettings(duration=20.0))

    assert {3.0, 3.5, 9.0, 20.0} <= {point.time for point in found.points}
    assert found.supplied[0] == pytest.approx(0.5 * 6.0 * 0.5 + 6.0 * 16.5, rel=1e-12)


def test_heat_without_a_way_out_is_refused_unless_it_ends():
    network = made({"part": HeatCapacity(capacity=2.0)}, [])

    with pytest.raises(InputError, match="4 W into 'part', without a path to ambient"):
        warm_up(network, lambda T: np.full(1, 4.0))
    found = warm_up(network, lambda T: np.full(1, 4.0), SlowSettings(duration=10.0))

    assert found.points[-1].temperature[0] == pytest.approx(293.15 + 20.0, rel=1e-13)
    assert found.end == "duration"


def test_a_network_without_capacity_is_at_its_steady_state_at_once():
    network = node(capacity=0.0)

    found = warm_up(network, lambda T: np.full(1, 4.0))

    assert found.points[0].temperature[0] == pytest.approx(293.15 + 8.0, rel=1e-12)
    assert (found.end, found.points[-1].time) == ("steady", inf)


def test_nothing_determines_a_node_without_capacity_and_path():
    with pytest.raises(InputError, match="'part': nothing there stores heat, and no path"):
        made({"part": HeatCapacity(capacity=0.0)}, [])


@pytest.mark.slow
def test_heat_that_jumps_with_the_temperature_is_said(monkeypatch):
    """A heat without a fixed point: above 300 K none, below it enough for 310 K."""
    monkeypatch.setattr("klack.thermal.slow_warm_up._MOST_POINTS", 100)

    with pytest.raises(ConvergenceError, match="100 strokes reached only"):
        warm_up(node(capacity=1.0), lambda T: np.full(1, 8.0 if T[0] < 300.0 else 0.0))


def test_a_network_without_thermal_components_has_no_heat_network():
    assert heat_network(Network({}, [])) is None
