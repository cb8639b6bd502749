"""Hydraulic components against closed formulas.

Truth: closed formulas of valves by characteristic, accumulators, tables of areas and pumps.

Truth: closed solutions of a column of fluid, and tables read by hand.
"""

from itertools import pairwise
from math import exp, pi, sin, sqrt, tan

import numpy as np
import pytest
from scipy.integrate import quad

from klack.errors import AccuracyWarning
from klack.hydraulics.accumulator import Accumulator
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.check_valve import CheckValve
from klack.hydraulics.flow_source import FlowSource
from klack.hydraulics.fluid_choice import FluidChoice
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.fluid_store import gas_store
from klack.hydraulics.fluid_table import fluid_at, fluid_table
from klack.hydraulics.inertance import Inertance
from klack.hydraulics.land_face import LandFace
from klack.hydraulics.opening import opening_flow
from klack.hydraulics.orifice import Orifice, orifice_step
from klack.hydraulics.pipe_friction import PipeFriction
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.pulsating_flow import PulsatingFlow
from klack.hydraulics.pump import Pump, swept_share
from klack.hydraulics.relief_valve import ReliefValve
from klack.hydraulics.variable_orifice import VariableOrifice
from klack.network.rows import Ambient, Rows
from klack.network.step_function import evaluate

BAR = 1e5
AMBIENT = Ambient()
OIL = library_fluid("ISO VG 46").at(313.15)
RHO = float(OIL.density(AMBIENT.pressure))
MU = float(OIL.viscosity(AMBIENT.pressure))
P_V = OIL.vapour_pressure
HANDLES = {"a": 1, "b": 2, "fluid": 1, "needle": 0, "body": -1}


def row_of(part, number=0):
    rows = Rows(ambient=AMBIENT, fluid=OIL, component="part", handles=HANDLES)
    part.add_rows(rows)
    return rows.branches[number]


def step(row, p_a, p_b, t=0.0, h=1e-6, state=None, ports=(), rho=(RHO, RHO)):
    status, out = evaluate(
        row.step,
        row.parameters,
        row.state if state is None else state,
        [t, h, p_a, p_b, *rho, *ports],
        3 + len(row.ports) + row.state.size + len(row.books),
    )
    assert status == 0
    return out


def settled(row, p_a, p_b, **numbers):
    """Step once with a state from a step before."""
    out = step(row, p_a, p_b, **numbers)
    begin = 3 + len(row.ports)
    return step(row, p_a, p_b, state=out[begin : begin + row.state.size], **numbers)


def slopes_by_differences(row, p_a, p_b, state=None, change=10.0, **numbers):
    by = []
    for da, db in ((change, 0.0), (0.0, change)):
        up = step(row, p_a + da, p_b + db, state=state, **numbers)[0]
        down = step(row, p_a - da, p_b - db, state=state, **numbers)[0]
        by.append((up - down) / (2 * change))
    return by


def test_parts_without_a_viscosity_law_say_so():
    oil = FluidChoice(name="ISO VG 46", viscosity_law="barus").at(313.15)
    rows = Rows(ambient=AMBIENT, fluid=oil, component="pipe", handles=HANDLES)
    with pytest.warns(AccuracyWarning, match="pipe: its laminar flow uses the viscosity at one"):
        PipeFriction(diameter=3e-3, length=1.0).add_rows(rows)


# ---- openings -------------------------------------------------------------------------------


@pytest.mark.parametrize("contraction", [0.0, 0.62])
@pytest.mark.parametrize(("p_a", "p_b"), [(50e5, 49.99e5), (50e5, 1e5), (1e5, 50e5), (2e5, 2e5)])
def test_an_opening_is_an_orifice_of_its_area(p_a, p_b, contraction):
    area, number = 2e-6, 2.0 / (MU * 100.0)
    found = opening_flow(p_a, p_b, RHO, RHO, area, 0.65, number, contraction, P_V)

    hole = Orifice(
        area=area, discharge=0.65, critical_flow_number=100.0, cavitation=contraction or None
    )
    _, known = evaluate(orifice_step, hole.parameters(MU, P_V), [], [0, 1, p_a, p_b, RHO, RHO], 3)
    np.testing.assert_allclose(found[:3], known, rtol=1e-14)
    up, down = (
        abs(opening_flow(p_a, p_b, RHO, RHO, area * s, 0.65, number, contraction, P_V)[0])
        for s in (1 + 1e-5, 1 - 1e-5)
    )
    # central difference of a smooth function: square of the relative step
    assert found[3] == pytest.approx((up - down) / (2e-5 * area), rel=1e-8, abs=1e-12)


# ---- check valve ----------------------------------------------------------------------------


CHECK = CheckValve(
    cracking_pressure=0.5 * BAR, open_pressure=2.5 * BAR, diameter=6e-3, cavitation=None
)


@pytest.mark.parametrize(
    ("drop", "share"), [(-50.0, 0.0), (0.4, 0.0), (0.5, 0.0), (1.5, 0.5), (2.5, 1.0), (60.0, 1.0)]
)
def test_check_valve_opens_between_two_pressures(drop, share):
    out = step(row_of(CHECK), (60.0 + drop) * BAR, 60.0 * BAR)

    area = share * pi / 4 * 6e-3**2
    assert out[3] == pytest.approx(area, rel=1e-9, abs=1e-15)
    # more than 100 times the critical flow number: tanh is 1
    assert out[0] == pytest.approx(0.7 * area * sqrt(2 * RHO * max(drop, 0.0) * BAR), rel=1e-8)


@pytest.mark.parametrize("drop", [-5e4, 5.1e4, 6e4, 1.5e5, 2.4e5, 3e5])
def test_slopes_of_a_check_valve_are_derivatives_with_their_signs(drop):
    row = row_of(CHECK.model_copy(update={"leak_area": 1e-9}))
    out = step(row, 60e5 + drop, 60e5)

    by_a, by_b = slopes_by_differences(row, 60e5 + drop, 60e5)
    np.testing.assert_allclose(out[1:3], [by_a, by_b], rtol=1e-4)  # (10 Pa / 1 kPa)^2
    assert out[1] > 0.0 > out[2]
    assert out[0] * drop > 0.0


# ---- relief valve ---------------------------------------------------------------------------


SET, RATED, FLOW = 100 * BAR, 110 * BAR, 40 / 60000
RELIEF = {
    "set_pressure": SET,
    "rated_pressure": RATED,
    "rated_flow": FLOW,
    "diameter": 3e-3,
    "cavitation": None,
}


@pytest.mark.parametrize("drop", [-200.0, 50.0, 100.0, 100.5, 105.0, 110.0, 111.5])
def test_relief_flow_rises_straight_from_the_set_pressure(drop):
    out = step(row_of(ReliefValve(**RELIEF)), 1e5 + drop * BAR, 1e5)

    line = FLOW * max(drop - 100.0, 0.0) / 10.0
    # tanh of 2 lambda/lambda_c = 5 to 30: 1e-4 where it is least open
    assert out[0] / RHO == pytest.approx(line, rel=1e-3 if drop < 101 else 1e-8, abs=1e-12)


def test_relief_valve_fully_open_is_an_orifice():
    out = step(row_of(ReliefValve(**RELIEF)), 301 * BAR, BAR)

    assert out[0] == pytest.approx(0.7 * pi / 4 * 9e-6 * sqrt(2 * RHO * 300 * BAR), rel=1e-12)


@pytest.mark.parametrize("drop", [101.0, 108.0, 300.0])
@pytest.mark.parametrize("lag", [0.0, 3e-6])
def test_slopes_of_a_relief_valve_are_derivatives(drop, lag):
    row = row_of(ReliefValve(**RELIEF, time_constant=lag))
    state = step(row, 1e5 + 104 * BAR, 1e5)[3:6]
    out = step(row, 1e5 + drop * BAR, 1e5, state=state)

    by = slopes_by_differences(row, 1e5 + drop * BAR, 1e5, state=state, change=100.0)
    np.testing.assert_allclose(out[1:3], by, rtol=1e-6)


def test_hysteresis_is_a_play_of_the_pressure():
    valve = ReliefValve(**RELIEF, hysteresis=3 * BAR)
    row, state, areas = row_of(valve), None, []
    for drop in (106.0, 108.0, 106.5, 105.1, 105.0, 103.0, 104.0, 106.0, 106.1, 98.0):
        out = step(row, 1e5 + drop * BAR, 1e5, state=state)
        state = out[3:6]
        areas.append(out[4])

    def area(drop):
        k = valve.area_slope(RHO)
        return k * max(drop - 100.0, 0.0) * BAR / sqrt(drop * BAR)

    known = [106, 108, 108, 108, 108, 106, 106, 106, 106.1]
    np.testing.assert_allclose(areas[:9], [area(x) for x in known], rtol=1e-12)
    assert areas[9] == pytest.approx(area(101.0), rel=1e-12)


def test_lag_of_a_relief_valve_is_exponential_at_any_step():
    tau = 2e-3
    valve = ReliefValve(**RELIEF, time_constant=tau)
    row = row_of(valve)
    state = step(row, 1e5 + 104 * BAR, 1e5)[3:6]
    start, steps = state[1], 7
    for _ in range(steps):
        state = step(row, 1e5 + 108 * BAR, 1e5, h=0.5e-3, state=state)[3:6]
    end = valve.area_slope(RHO) * 8 * BAR / sqrt(108 * BAR)

    assert state[1] == pytest.approx(end + (start - end) * np.exp(-steps * 0.5e-3 / tau), rel=1e-13)


def test_a_relief_valve_has_no_lag_before_time_zero():
    row = row_of(ReliefValve(**RELIEF, time_constant=1.0, hysteresis=1e5))
    state = step(row, 1e5 + 109 * BAR, 1e5)[3:6]

    out = step(row, 1e5 + 104 * BAR, 1e5, t=-1e-9, h=1e-9, state=state)

    assert out[0] / RHO == pytest.approx(0.4 * FLOW, rel=1e-6)


# ---- accumulator ----------------------------------------------------------------------------


@pytest.mark.parametrize("exponent", [1.0, 1.2, 1.4, 1.8])
def test_gas_is_polytropic_and_its_energy_is_the_work_of_the_pressure(exponent):
    p0, whole, least, ambient = 60e5, 1e-3, 0.2e-3, 1e5

    def volume(p):
        return gas_store(p, ambient, p0, whole, exponent, least)[0]

    for p in (61e5, 100e5, 300e5):
        found, slope, energy = gas_store(p, ambient, p0, whole, exponent, least)
        gas = whole - found
        if gas > least:
            assert p * gas**exponent == pytest.approx(p0 * whole**exponent, rel=1e-13)
            assert slope == pytest.approx((volume(p + 100) - volume(p - 100)) / 200, rel=1e-7)
        work = quad(lambda v: p0 * (whole / (whole - v)) ** exponent - ambient, 0.0, found)[0]
        assert energy == pytest.approx(work, rel=1e-11)
    assert gas_store(60e5, ambient, p0, whole, exponent, least) == (0.0, 0.0, 0.0)


def test_a_full_accumulator_is_rigid():
    volume, slope, energy = gas_store(2000e5, 1e5, 60e5, 1e-3, 1.4, 0.25e-3)

    assert (volume, slope) == (0.75e-3, 0.0)
    assert energy == gas_store(60e5 * 4**1.4 * (1 + 1e-9), 1e5, 60e5, 1e-3, 1.4, 0.25e-3)[2]


@pytest.mark.parametrize("inlet", [None, 1e-3, 20e-3])
def test_what_flows_into_an_accumulator_is_what_it_holds(inlet):
    part = Accumulator(volume=1e-4, precharge=60e5, inlet_diameter=inlet)
    row, table = row_of(part), fluid_table(OIL, AMBIENT.pressure)
    state, mass, lost, stored = None, 0.0, [], None
    for p in np.exp(np.random.default_rng(3).uniform(np.log(30e5), np.log(400e5), 300)):
        rho, _, g, _ = fluid_at(table, p, 0)
        out = step(row, p, 1e5, h=1e-4, state=state, rho=(rho, RHO))
        held, _, _ = gas_store(out[3], AMBIENT.pressure, 60e5, 1e-4, 1.4, 1e-5)
        inside = fluid_at(table, out[3], 0)[0] * held
        if state is None:
            mass = inside
        else:
            mass += out[0] * 1e-4
            lost.append(g * out[0] * 1e-4 - (out[7] - stored))
        assert inside == pytest.approx(mass, rel=1e-10, abs=1e-15)
        assert out[4] == pytest.approx(1e-4 - held, rel=1e-14)
        state, stored = out[3:7], out[7]

    assert min(lost) >= -1e-9 * max(lost)  # round-off of some 100 J


@pytest.mark.parametrize("inlet", [None, 0.5e-3, 2e-3])
@pytest.mark.parametrize("p", [50e5, 61e5, 90e5, 150e5])
def test_slope_of_an_accumulator_is_the_derivative(inlet, p):
    row = row_of(Accumulator(volume=1e-4, precharge=60e5, inlet_diameter=inlet))
    state = [80e5, 0.0, 0.0, 1.0]
    out = step(row, p, 1e5, state=state)

    # the fluid table is smooth to 1e-10, its slope over 2 kPa to 1e-5
    by_a, by_b = slopes_by_differences(row, p, 1e5, state=state, change=1e3)
    assert out[1] == pytest.approx(by_a, rel=2e-4, abs=1e-15)
    assert by_b == 0.0
    if inlet is not None:
        hole = Orifice(diameter=inlet, discharge=0.7, critical_flow_number=100, cavitation=None)
        _, known = evaluate(
            orifice_step, hole.parameters(MU, P_V), [], [0, 1, p, out[3], RHO, RHO], 3
        )
        # the density behind is that inside, up to 1 % more
        assert out[0] == pytest.approx(known[0], rel=1e-2, abs=1e-9)


# ---- variable orifice -----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("x", "area"), [(-1.0, 0.0), (0.0, 0.0), (1.0, 0.5), (2.0, 1.0), (3.5, 2.5), (4, 3), (9, 3)]
)
@pytest.mark.parametrize("kind", ["time", "lift"])
def test_variable_orifice_follows_its_table(kind, x, area):
    scale = {"time": 1e-3, "lift": 1e-4}[kind]
    part = VariableOrifice(
        **{kind: [0.0, 2 * scale, 4 * scale]}, area=[0.0, 1e-6, 3e-6], cavitation=None
    )
    row = row_of(part)
    if kind == "time":
        out = step(row, 50e5, 20e5, t=x * scale - 5e-7)
    else:
        out = step(row, 50e5, 20e5, ports=(x * scale + 5e-6, x * scale - 3e-6, 1e-6, 1e-6))
        assert out[3] == out[4] == 0.0

    assert out[-1] == pytest.approx(area * 1e-6, rel=1e-9, abs=1e-20)
    assert out[0] == pytest.approx(0.7 * area * 1e-6 * sqrt(2 * RHO * 30e5), rel=1e-8, abs=1e-20)


def test_variable_orifice_finds_its_interval_from_any_other():
    part = VariableOrifice(time=[0.0, 1.0, 2.0, 3.0], area=[1e-6, 3e-6, 2e-6, 4e-6])
    row = row_of(part)
    for t in (-1.0, 0.3, 1.7, 2.0, 2.9, 5.0):
        for place in (0.0, 1.0, 2.0):
            out = step(row, 2e5, 1e5, t=t, h=0.0, state=[place, 0.0])
            assert out[-1] == pytest.approx(np.interp(t, part.time, part.area), rel=1e-14)


# ---- pump and pulsation ---------------------------------------------------------------------


@pytest.mark.parametrize("pistons", [1, 2, 3, 6, 7, 9, 10])
def test_one_turn_of_a_pump_delivers_its_displacement(pistons):
    rng = np.random.default_rng(pistons)
    for steps in (1, 7, 1000):
        cuts = np.sort(rng.uniform(0.0, 2 * pi, steps - 1))
        ends = np.concatenate(([0.0], cuts, [2 * pi]))
        total = sum(swept_share(0.3 + a, b - a, pistons) for a, b in pairwise(ends))
        assert total == pytest.approx(1.0, rel=1e-12)
    assert swept_share(5.0, 6 * pi, pistons) == pytest.approx(3.0, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("pistons", [2, 3, 5, 6, 7, 9, 10, 11])
def test_ripple_of_a_pump_has_its_order_and_size(pistons):
    part = Pump(displacement=10e-6, speed=25.0, pistons=pistons, phase=0.1)
    row, n = row_of(part), 2520
    h = 1 / 25.0 / n
    flow = np.array([step(row, 1e5, 1e5, t=k * h, h=h)[5] for k in range(n)])

    assert flow.mean() == pytest.approx(250e-6, rel=1e-12)
    order = 2 * pistons if pistons % 2 else pistons
    spectrum = np.abs(np.fft.rfft(flow))[1:]
    assert 1 + np.argmax(spectrum) == order
    z = pistons
    spread = pi / (2 * z) * tan(pi / (4 * z)) if z % 2 else pi / z * tan(pi / (2 * z))
    # means over 1/2520 of a turn round the corners off
    assert np.ptp(flow) / flow.mean() == pytest.approx(spread, rel=3e-2)
    apart = pi / z if z % 2 else 2 * pi / z  # of the shaft between two largest flows
    high = 0.5 * apart / sin(0.5 * apart)
    now = [step(row, 1e5, 1e5, t=k * h, h=0.0)[5] / 250e-6 for k in range(n)]
    assert max(now) == pytest.approx(high, rel=1e-4)
    assert min(now) == pytest.approx(high - spread, rel=1e-2, abs=2e-3)


def test_a_pump_draws_in_the_density_before_it_and_leaks_by_its_efficiency():
    part = Pump(displacement=10e-6, speed=25.0, volumetric_efficiency=0.9, rated_pressure=200 * BAR)
    out = step(row_of(part), 30e5, 130e5)
    leak = step(row_of(part, 1), 30e5, 130e5)

    assert out[0] == pytest.approx(float(OIL.density(30e5)) * 250e-6, rel=1e-9)
    assert leak[0] == pytest.approx(-RHO * 250e-6 * 0.1 * 0.5, rel=1e-12)
    assert leak[1] == -leak[2] > 0.0


def test_a_pulsation_is_averaged_over_the_step():
    sines = [
        {"frequency": 250.0, "amplitude": 2e-5, "phase": 0.4},
        {"frequency": 1750.0, "amplitude": 1e-5},
    ]
    row = row_of(PulsatingFlow(mean=3e-4, harmonics=sines))

    def flow(t):
        return 3e-4 + 2e-5 * sin(2 * pi * 250 * t + 0.4) + 1e-5 * sin(2 * pi * 1750 * t)

    for h in (1e-6, 1e-3, 4e-3):
        out = step(row, 1e5, 90e5, t=1.3e-3, h=h)
        mean = quad(flow, 1.3e-3, 1.3e-3 + h, epsabs=0, epsrel=1e-12)[0] / h
        assert out[0] == pytest.approx(RHO * mean, rel=1e-12)
    assert step(row, 1e5, 90e5, t=1.3e-3, h=0.0)[0] == pytest.approx(RHO * flow(1.3e-3), rel=1e-13)
    assert step(row, 1e5, 90e5, t=-1e-6)[0] == pytest.approx(RHO * 3e-4, rel=1e-13)


BAR_SOURCES, H = 1e5, 20e-9
HEPTANE = library_fluid("n-heptane").at(293.15)
TABLE = fluid_table(HEPTANE, AMBIENT.pressure)
RHO_SOURCES = float(HEPTANE.density(AMBIENT.pressure))


def energy(pressure):
    return fluid_at(TABLE, pressure, 0)[2]


def rows_of(component, **handles):
    rows = Rows(ambient=AMBIENT, fluid=HEPTANE, component="part", handles=handles)
    component.add_rows(rows)
    return rows


def step_sources(row, state, p_a, p_b, t=0.0, h=H):
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
        out = step_sources(row, state, p_a, p_b, h=h)
        state = out[3:6]
    return out


def test_column_without_friction_gains_flow_evenly():
    area = pi / 4 * 1.2e-3**2
    end = run_column(column(friction="none"), 6 * BAR_SOURCES, BAR_SOURCES, 100, 1e-6)

    exact = RHO_SOURCES * area / 6e-3 * (energy(6 * BAR_SOURCES) - energy(BAR_SOURCES)) * 1e-4
    assert end[3] == pytest.approx(exact, rel=1e-12)
    # against the textbook's dp A/l: compressibility, dp/(2K)
    assert end[3] == pytest.approx(5 * BAR_SOURCES * area / 6e-3 * 1e-4, rel=1e-3)


def test_column_with_friction_settles_at_hagen_poiseuille_with_order_two():
    row = column(diameter=0.1e-3)
    viscosity = float(HEPTANE.viscosity(AMBIENT.pressure))
    rate = 32 * viscosity / (RHO_SOURCES * 0.1e-3**2)  # of the decay: R/I
    head = energy(1.2 * BAR_SOURCES) - energy(BAR_SOURCES)
    settled = RHO_SOURCES**2 * head * pi * 0.1e-3**4 / (128 * viscosity * 6e-3)
    duration = 2 / rate

    counts = np.array([10, 20, 40])
    ends = [run_column(row, 1.2 * BAR_SOURCES, BAR_SOURCES, n, duration / n)[3] for n in counts]
    errors = np.array(ends) - settled * (1 - exp(-2))

    assert run_column(row, 1.2 * BAR_SOURCES, BAR_SOURCES, 200, 0.1 / rate)[0] == pytest.approx(
        settled, rel=1e-7
    )
    order = -np.polyfit(np.log(counts), np.log(np.abs(errors)), 1)[0]
    assert order == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("h", [20e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("flow", [0.0, 2e-3])
def test_slopes_of_a_column_are_derivatives(h, flow):
    row = column()
    dp = 10.0
    up = step_sources(row, [flow, 0, 0], 6 * BAR_SOURCES + dp, 2 * BAR_SOURCES, h=h)[0]
    down = step_sources(row, [flow, 0, 0], 6 * BAR_SOURCES - dp, 2 * BAR_SOURCES, h=h)[0]
    back = step_sources(row, [flow, 0, 0], 6 * BAR_SOURCES, 2 * BAR_SOURCES + dp, h=h)[0]
    forth = step_sources(row, [flow, 0, 0], 6 * BAR_SOURCES, 2 * BAR_SOURCES - dp, h=h)[0]

    out = step_sources(row, [flow, 0, 0], 6 * BAR_SOURCES, 2 * BAR_SOURCES, h=h)
    # at 20 ns the flow hardly answers: the difference keeps five digits
    assert out[1] == pytest.approx((up - down) / (2 * dp), rel=1e-5)
    assert out[2] == pytest.approx((back - forth) / (2 * dp), rel=1e-5)


def test_column_reads_its_store_at_the_start():
    out = step_sources(column(), [1e-3, 0.0, 0.0], 6 * BAR_SOURCES, BAR_SOURCES, h=0.0)

    inertia = 6e-3 / (RHO_SOURCES * pi / 4 * 1.2e-3**2)
    assert out[0] == 1e-3
    assert out[-1] == pytest.approx(0.5 * inertia * 1e-6, rel=1e-12)


FLOW_SOURCES = 2e-6  # [m^3/s]


@pytest.mark.parametrize(
    ("numbers", "at", "expected"),
    [
        ({"flow": FLOW_SOURCES}, 1.0, FLOW_SOURCES),
        ({"flow": 0.0, "step": {"to": FLOW_SOURCES, "at": 1e-3, "rise": 1e-4}}, 0.9e-3, 0.0),
        (
            {"flow": 0.0, "step": {"to": FLOW_SOURCES, "at": 1e-3, "rise": 1e-4}},
            1.025e-3,
            0.25 * FLOW_SOURCES,
        ),
        ({"flow": 0.0, "step": {"to": FLOW_SOURCES, "at": 1e-3, "rise": 1e-4}}, 7e-3, FLOW_SOURCES),
        ({"table": {"time": [1e-3, 2e-3, 4e-3], "flow": [1e-6, 3e-6, -1e-6]}}, 0.0, 1e-6),
        ({"table": {"time": [1e-3, 2e-3, 4e-3], "flow": [1e-6, 3e-6, -1e-6]}}, 3e-3, 1e-6),
        ({"table": {"time": [1e-3, 2e-3, 4e-3], "flow": [1e-6, 3e-6, -1e-6]}}, 9e-3, -1e-6),
    ],
)
@pytest.mark.parametrize("interval", [0.0, 1.0])
def test_flow_source_follows_its_history(numbers, at, expected, interval):
    row = rows_of(FlowSource(**numbers), a=0, b=1).branches[0]
    start = [min(interval, row.parameters[1] - 1), 0.0, 0.0]

    mdot, by_a, by_b = step_sources(row, start, BAR_SOURCES, 6 * BAR_SOURCES, t=at - 0.5 * H)[:3]

    assert mdot == pytest.approx(RHO_SOURCES * expected, rel=1e-9, abs=1e-15)
    assert (by_a, by_b) == (0.0, 0.0)


def test_pump_supplies_what_the_fluid_gains():
    row = rows_of(FlowSource(flow=FLOW_SOURCES), a=0, b=1).branches[0]

    out = step_sources(row, row.state, AMBIENT.pressure, 6 * BAR_SOURCES)

    assert row.books[0].kind == "supply"
    assert out[-1] == pytest.approx(
        RHO_SOURCES * FLOW_SOURCES * energy(6 * BAR_SOURCES) * H, rel=1e-14
    )
    # about Q dp: compressibility, dp/(2K)
    assert out[-1] == pytest.approx(
        FLOW_SOURCES * (6 * BAR_SOURCES - AMBIENT.pressure) * H, rel=1e-3
    )


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
