"""Truth: closed solutions of a column of fluid, and tables read by hand."""

from math import exp, pi

import numpy as np
import pytest

from klack.hydraulics.chamber import Chamber
from klack.hydraulics.flow_source import FlowSource
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.fluid_table import fluid_at, fluid_table
from klack.hydraulics.inertance import Inertance
from klack.hydraulics.land_face import LandFace
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.network.rows import Ambient, Rows
from klack.network.step_function import evaluate

BAR, H = 1e5, 20e-9
AMBIENT = Ambient()
HEPTANE = library_fluid("n-heptane").at(293.15)
TABLE = fluid_table(HEPTANE, AMBIENT.pressure)
RHO = float(HEPTANE.density(AMBIENT.pressure))


def energy(pressure):
    return fluid_at(TABLE, pressure, 0)[2]


def rows_of(component, **handles):
    rows = Rows(ambient=AMBIENT, fluid=HEPTANE, component="part", handles=handles)
    component.add_rows(rows)
    return rows


def step(row, state, p_a, p_b, t=0.0, h=H):
    inputs = [t, h, p_a, p_b, float(HEPTANE.density(p_a)), float(HEPTANE.density(p_b))]
    outputs = 3 + row.state.size + len(row.books)
    status, out = evaluate(row.step, row.parameters, state, inputs, outputs)
    assert status == 0
    return out


def column(**numbers):
    numbers = {"length": 6e-3, "diameter": 1.2e-3, **numbers}
    return rows_of(Inertance(**numbers), a=1, b=2).branches[0]


def run_column(row, p_a, p_b, steps, h, flow=0.0):
    state = [flow, 0.0, 0.0]
    for _ in range(steps):
        out = step(row, state, p_a, p_b, h=h)
        state = out[3:6]
    return out


def test_column_without_friction_gains_flow_evenly():
    area = pi / 4 * 1.2e-3**2
    end = run_column(column(friction="none"), 6 * BAR, BAR, 100, 1e-6)

    exact = RHO * area / 6e-3 * (energy(6 * BAR) - energy(BAR)) * 1e-4
    assert end[3] == pytest.approx(exact, rel=1e-12)
    # against the textbook's dp A/l: compressibility, dp/(2K)
    assert end[3] == pytest.approx(5 * BAR * area / 6e-3 * 1e-4, rel=1e-3)


def test_column_with_friction_settles_at_hagen_poiseuille_with_order_two():
    row = column(diameter=0.1e-3)
    viscosity = float(HEPTANE.viscosity(AMBIENT.pressure))
    rate = 32 * viscosity / (RHO * 0.1e-3**2)  # of the decay: R/I
    head = energy(1.2 * BAR) - energy(BAR)
    settled = RHO**2 * head * pi * 0.1e-3**4 / (128 * viscosity * 6e-3)
    duration = 2 / rate

    counts = np.array([10, 20, 40])
    ends = [run_column(row, 1.2 * BAR, BAR, n, duration / n)[3] for n in counts]
    errors = np.array(ends) - settled * (1 - exp(-2))

    assert run_column(row, 1.2 * BAR, BAR, 200, 0.1 / rate)[0] == pytest.approx(settled, rel=1e-7)
    order = -np.polyfit(np.log(counts), np.log(np.abs(errors)), 1)[0]
    assert order == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("h", [20e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("flow", [0.0, 2e-3])
def test_slopes_of_a_column_are_derivatives(h, flow):
    row = column()
    dp = 10.0
    up = step(row, [flow, 0, 0], 6 * BAR + dp, 2 * BAR, h=h)[0]
    down = step(row, [flow, 0, 0], 6 * BAR - dp, 2 * BAR, h=h)[0]
    back = step(row, [flow, 0, 0], 6 * BAR, 2 * BAR + dp, h=h)[0]
    forth = step(row, [flow, 0, 0], 6 * BAR, 2 * BAR - dp, h=h)[0]

    out = step(row, [flow, 0, 0], 6 * BAR, 2 * BAR, h=h)
    # at 20 ns the flow hardly answers: the difference keeps five digits
    assert out[1] == pytest.approx((up - down) / (2 * dp), rel=1e-5)
    assert out[2] == pytest.approx((back - forth) / (2 * dp), rel=1e-5)


def test_column_reads_its_store_at_the_start():
    out = step(column(), [1e-3, 0.0, 0.0], 6 * BAR, BAR, h=0.0)

    inertia = 6e-3 / (RHO * pi / 4 * 1.2e-3**2)
    assert out[0] == 1e-3
    assert out[-1] == pytest.approx(0.5 * inertia * 1e-6, rel=1e-12)


FLOW = 2e-6  # [m^3/s]


@pytest.mark.parametrize(
    ("numbers", "at", "expected"),
    [
        ({"flow": FLOW}, 1.0, FLOW),
        ({"flow": 0.0, "step": {"to": FLOW, "at": 1e-3, "rise": 1e-4}}, 0.9e-3, 0.0),
        ({"flow": 0.0, "step": {"to": FLOW, "at": 1e-3, "rise": 1e-4}}, 1.025e-3, 0.25 * FLOW),
        ({"flow": 0.0, "step": {"to": FLOW, "at": 1e-3, "rise": 1e-4}}, 7e-3, FLOW),
        ({"table": {"time": [1e-3, 2e-3, 4e-3], "flow": [1e-6, 3e-6, -1e-6]}}, 0.0, 1e-6),
        ({"table": {"time": [1e-3, 2e-3, 4e-3], "flow": [1e-6, 3e-6, -1e-6]}}, 3e-3, 1e-6),
        ({"table": {"time": [1e-3, 2e-3, 4e-3], "flow": [1e-6, 3e-6, -1e-6]}}, 9e-3, -1e-6),
    ],
)
@pytest.mark.parametrize("interval", [0.0, 1.0])
def test_flow_source_follows_its_history(numbers, at, expected, interval):
    row = rows_of(FlowSource(**numbers), a=0, b=1).branches[0]
    start = [min(interval, row.parameters[1] - 1), 0.0, 0.0]

    mdot, by_a, by_b = step(row, start, BAR, 6 * BAR, t=at - 0.5 * H)[:3]

    assert mdot == pytest.approx(RHO * expected, rel=1e-9, abs=1e-15)
    assert (by_a, by_b) == (0.0, 0.0)


def test_pump_supplies_what_the_fluid_gains():
    row = rows_of(FlowSource(flow=FLOW), a=0, b=1).branches[0]

    out = step(row, row.state, AMBIENT.pressure, 6 * BAR)

    assert row.books[0].kind == "supply"
    assert out[-1] == pytest.approx(RHO * FLOW * energy(6 * BAR) * H, rel=1e-14)
    # about Q dp: compressibility, dp/(2K)
    assert out[-1] == pytest.approx(FLOW * (6 * BAR - AMBIENT.pressure) * H, rel=1e-3)


@pytest.mark.parametrize(
    ("numbers", "time", "pressure"),
    [
        ({"pressure": 6e5}, [0.0], [6e5]),
        (
            {"pressure": 1e5, "step": {"to": 6e5, "at": 1e-3, "rise": 1e-5}},
            [1e-3, 1.01e-3],
            [1e5, 6e5],
        ),
        ({"table": {"time": [0.0, 1.0], "pressure": [1e5, 2e5]}}, [0.0, 1.0], [1e5, 2e5]),
    ],
)
def test_pressure_source_hands_its_history_to_the_node(numbers, time, pressure):
    node = rows_of(PressureSource(**numbers), fluid=3).nodes[3]

    assert node.volume == 0.0
    np.testing.assert_allclose(node.time, time, rtol=1e-15)
    np.testing.assert_array_equal(node.pressure, pressure)


@pytest.mark.parametrize(("pressure", "expected"), [(None, AMBIENT.pressure), (6e5, 6e5)])
def test_chamber_starts_at_its_pressure_or_that_of_the_surroundings(pressure, expected):
    node = rows_of(Chamber(volume=50e-9, pressure=pressure), fluid=3).nodes[3]

    assert (node.volume, *node.pressure) == (50e-9, expected)


@pytest.mark.parametrize(("direction", "sign"), [("opening", 1.0), ("closing", -1.0)])
def test_faces_push_where_they_look(direction, sign):
    ring = rows_of(
        PressureFace(direction=direction, outer_diameter=4e-3, inner_diameter=1.5e-3),
        fluid=2,
        body=5,
    ).walls[0]
    disc = rows_of(PressureFace(direction=direction, area=1e-5), fluid=2, body=5).walls[0]
    land = rows_of(
        LandFace(direction=direction, inner_diameter=1.5e-3, outer_diameter=4e-3),
        inside=1,
        outside=2,
        body=5,
    ).walls

    area = pi / 4 * (4e-3**2 - 1.5e-3**2)
    assert ring.area == pytest.approx(sign * area, rel=1e-14)
    assert (ring.node, ring.port, disc.area) == (2, 5, sign * 1e-5)
    assert [wall.node for wall in land] == [1, 2]
    assert sum(wall.area for wall in land) == pytest.approx(sign * area, rel=1e-14)
