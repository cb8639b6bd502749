"""Drivers of coils: switching, boost capacitor, output stage.

Without resistance every current is a chain of straight lines, whatever the driver does.

Boost capacitor and output stage; truth: energy balance, limits by hand, numbers of the page.
"""

import re
from pathlib import Path

import numpy as np
import pytest
from draws import each
from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

from klack.case.any_case import load_valve_case, read_valve_case
from klack.errors import ConvergenceError, InputError
from klack.magnetics.boost_driver import BoostDriver, Shot
from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.drive_profile import DriveProfile
from klack.magnetics.driver import DriveProgram, DriveState, Switch, When
from klack.magnetics.flux_step import flux_numbers, flux_state, magnet_step
from klack.magnetics.peak_hold import PeakHold
from klack.magnetics.pwm import PulseWidth
from klack.magnetics.reluctance import LinearReluctance
from klack.magnetics.remanent_start import remanent_state
from klack.magnetics.two_point import TwoPoint
from klack.magnetics.voltage_step import VoltageStep
from klack.magnetics.voltage_table import VoltageTable
from klack.network.rows import Book
from klack.network.step_function import evaluate
from klack.simulation.network_run import simulate_network
from klack.verification.drivers import injector, linear_coil, run_coil
from klack.verification.output_stage import random_driver, run_stage

SHORT = 1e-14  # [ohm]
TURNS, MAIN, LEAK = 60.0, 2e7, 2e8
INDUCTANCE = TURNS**2 * (1 / MAIN + 1 / LEAK)  # [H] of linear_coil()


def run(driver, *, steps, step, resistance=SHORT, eddy=0.0):
    return run_coil(
        linear_coil(eddy),
        driver.program() if hasattr(driver, "program") else driver,
        resistance=resistance,
        gap=1e-4,
        step=step,
        lift=np.zeros(steps + 1),
    )


@settings(max_examples=25, deadline=None)
@given(
    voltage=st.floats(5.0, 60.0),
    freewheel=st.floats(0.5, 20.0),
    lower=st.floats(0.5, 5.0),
    band=st.floats(0.05, 1.0),
    step=st.floats(0.1e-6, 2e-6),
)
def test_two_point_control_is_a_saw(voltage, freewheel, lower, band, step):
    upper = lower + band
    first, up, down = (x * INDUCTANCE for x in (upper / voltage, band / voltage, band / freewheel))
    if up + down < 0.2 * step:
        return  # more than the guard against chatter allows

    r = run(
        TwoPoint(voltage=voltage, upper=upper, lower=lower, freewheel=freewheel),
        steps=400,
        step=step,
    )

    phase = (r.time - first) % (up + down)
    saw = np.where(phase < down, upper - freewheel * phase / INDUCTANCE, 0.0)
    saw = np.where(phase >= down, lower + voltage * (phase - down) / INDUCTANCE, saw)
    saw = np.where(r.time < first, voltage * r.time / INDUCTANCE, saw)
    # instants are located to 1e-12 of the current; thousands of switchings add up
    np.testing.assert_allclose(r.current, saw, atol=1e-8 * upper)


def test_peak_hold_goes_through_its_states_at_the_exact_instants():
    L = INDUCTANCE
    driver = PeakHold(
        boost_voltage=65.0,
        peak_current=10.0,
        supply_voltage=14.0,
        hold_current=3.0,
        hold_band=1.0,
        peak_until=60e-6,
        start=7e-6,
        end=400e-6,
        freewheel=12.0,
        decay=50.0,
        fall="decay",
    )
    r = run(driver, steps=500, step=1e-6)

    top = 7e-6 + L * 10.0 / 65.0
    assert r.current[r.time < 7e-6].max() == 0.0
    at = np.interp(top - 1e-6, r.time, r.current)
    assert at == pytest.approx(10.0 - 65.0 * 1e-6 / L, rel=1e-9)
    # peak held above 9 A; then 50 V against it, down to 3.5 A; then freewheeling
    peak = r.current[int(top / 1e-6) + 1 : 61]
    assert 9.0 <= peak.min() < peak.max() <= 10.0
    begin = float(r.current[60])
    down = 60e-6 + (begin - 3.5) * L / 50.0
    k = int(np.flatnonzero(r.time > down)[0])
    assert r.current[k] == pytest.approx(3.5 - 12.0 * (r.time[k] - down) / L, rel=1e-9)
    hold = r.current[k:401]
    assert hold.min() >= 2.5 * (1 - 1e-12)
    assert r.current[-1] == 0.0
    assert set(r.state) == set(range(8))


def test_repetition_does_not_drift():
    # 300 cycles of 10.01 us at steps of 1 us: the last pulse is where the clock says
    r = run(
        VoltageStep(voltage=12.0, end=3e-6, repeat_every=10.01e-6, decay=12.0),
        steps=3003,
        step=1e-6,
    )

    top = 12.0 * 3e-6 / INDUCTANCE
    begin = 299 * 10.01e-6
    k = np.flatnonzero((r.time > begin) & (r.time < begin + 3e-6))
    assert r.current[k] == pytest.approx(12.0 * (r.time[k] - begin) / INDUCTANCE, abs=1e-9 * top)


def test_pulse_width_has_one_pair_of_switchings_per_period():
    r = run(
        PulseWidth(voltage=12.0, period=50e-6, duty=0.25, freewheel=0.5, start=5e-6, end=2e-3),
        steps=23000,
        step=0.1e-6,
        resistance=1.0,
    )

    assert len(r.switches()) == 1 + 2 * 40 - 1 + 1  # start, 40 periods less the last, end
    settled = (r.time > 1.5e-3) & (r.time < 2e-3)
    # mean current = mean voltage / R
    assert r.current[settled].mean() == pytest.approx(0.25 * 12.0 - 0.75 * 0.5, rel=1e-3)


@pytest.mark.parametrize("step", [0.3e-6, 1.1e-6, 7e-6])
def test_voltage_table_gives_its_integral(step):
    table = VoltageTable(
        time=(1e-6, 2.5e-6, 2.5e-6, 6.2e-6, 9e-6), voltage=(0.0, 20.0, -8.0, 3.0, 0.0)
    )
    r = run(table, steps=int(12e-6 / step) + 1, step=step)

    area = 0.5 * 1.5 * 20.0 + 0.5 * 3.7 * (-8.0 + 3.0) + 0.5 * 2.8 * 3.0
    assert r.current[-1] == pytest.approx(area * 1e-6 / INDUCTANCE, rel=1e-12)


def test_diode_lets_no_current_turn_negative_and_opens_the_coil():
    r = run(VoltageStep(voltage=12.0, end=100e-6, decay=40.0), steps=3000, step=0.1e-6, eddy=1250.0)

    assert r.current.min() == 0.0
    off = np.flatnonzero((r.time > 150e-6) & (r.current == 0.0))
    assert off.size > 1000
    # open: the terminals see what the falling main flux induces, not the driver
    induced = TURNS * np.diff(r.flux)[off[1:-1]] / 0.1e-6
    np.testing.assert_allclose(r.voltage[off[1:-1]], induced, rtol=1e-6)
    assert np.all(r.voltage[off[1:-1]] > -40.0)


def test_open_coil_is_connected_again_when_it_induces_less_than_the_driver_offers():
    # a large shorted turn drives the coil below -3 V after the fast decay; then a diode of 0.5 V
    states = (
        DriveState("on", 12.0, (Switch(When.TIME, 100e-6, "fast"),)),
        DriveState("fast", -60.0, (Switch(When.TIME, 125e-6, "slow"),)),
        DriveState("slow", -0.5),
    )
    r = run(DriveProgram(states), steps=2000, step=0.1e-6, eddy=1250.0, resistance=0.5)

    blocked = (r.time > 115e-6) & (r.time < 125e-6)
    later = r.time > 130e-6
    assert r.current[blocked].max() == 0.0
    assert r.voltage[1150] < -0.5
    assert r.current[later].max() > 0.1


def test_shorted_turn_alone_relaxes_with_its_time_constant():
    r = run(
        VoltageStep(voltage=12.0, end=50e-6, decay=80.0),
        steps=4000,
        step=50e-9,
        eddy=500.0,
        resistance=0.5,
    )
    a, b = 1500, 3900

    assert np.all(r.current[a:] == 0.0)
    rate = np.log(r.flux[a] / r.flux[b]) / (r.time[b] - r.time[a])
    assert rate == pytest.approx(MAIN / 500.0, rel=1e-6)  # (h rate)^2/12 = 3e-7


def test_chatter_is_refused_with_words():
    with pytest.raises(ConvergenceError, match="switches more than 30 times in one step"):
        run(TwoPoint(voltage=60.0, upper=2.001, lower=2.0, freewheel=60.0), steps=100, step=5e-6)


def test_six_loops_give_the_same_as_two():
    """A main path split into parallel tubes that are one tube together."""
    branches = [
        MagneticBranch(name=f"m{k}", law=LinearReluctance(5 * MAIN), turns=TURNS) for k in range(5)
    ]
    leak = MagneticBranch(name="leak", law=LinearReluctance(LEAK), turns=TURNS)
    split = MagneticCircuit(branches=(*branches, leak), loops=np.eye(6), main="leak")
    driver = TwoPoint(voltage=12.0, upper=3.0, lower=2.0, freewheel=6.0).program()

    runs = [
        run_coil(c, driver, resistance=0.7, gap=1e-4, step=1e-6, lift=np.zeros(300))
        for c in (split, linear_coil())
    ]

    np.testing.assert_allclose(runs[0].current, runs[1].current, rtol=1e-11, atol=1e-12)


def test_nothing_is_divided_by_a_step_of_zero_length():
    par = flux_numbers(
        linear_coil(), resistance=1.0, driver=VoltageStep(voltage=5.0).program(), gap=1e-4
    )
    state = flux_state(par, [3e-6, 2e-6])

    status, out = evaluate(
        magnet_step, par, state, [0.0, 0.0, 0.0, 0.0, 0.0, 0.0], 2 + state.size + 4
    )

    assert status == 0
    assert np.all(np.isfinite(out))
    assert out[2 + state.size + 3] == pytest.approx(0.5 * (MAIN * 9e-12 + LEAK * 4e-12), rel=1e-14)


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(
    level=st.floats(2.0, 8.0),
    band=st.floats(0.1, 1.0),
    freewheel=st.floats(0.5, 20.0),
    step=st.floats(0.1e-6, 2e-6),
)
def test_even_profile_is_two_point_control(level, band, freewheel, step):
    """Truth: exact; the same switching by two components."""
    upper, lower = level + 0.5 * band, level - 0.5 * band
    if band * INDUCTANCE * (1 / 40.0 + 1 / freewheel) < 0.2 * step:
        return  # more than the guard against chatter allows
    two = TwoPoint(voltage=40.0, upper=upper, lower=lower, freewheel=freewheel)
    profile = DriveProfile(
        time=(0.0, 1.0),
        current=(level, level),
        supply_voltage=40.0,
        band=band,
        freewheel=freewheel,
    )

    runs = [run(driver, steps=400, step=step, resistance=0.5) for driver in (two, profile)]

    np.testing.assert_allclose(runs[1].current, runs[0].current, atol=1e-9 * upper)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    knots=st.lists(
        st.tuples(st.floats(8e-6, 40e-6), st.sampled_from([0.0, 1.0, 2.0, 4.0])),
        min_size=2,
        max_size=7,
    ),
    jump=st.booleans(),
    step=st.floats(0.1e-6, 2e-6),
)
def test_current_of_a_profile_is_a_chain_of_straight_lines(knots, jump, step):
    """Truth: exact; the switching by hand, from one straight line to the next."""
    time = np.concatenate(([3e-6], 3e-6 + np.cumsum([k[0] for k in knots])))
    current = np.array([0.0, *(k[1] for k in knots)])
    if jump:
        time = np.append(time, time[-1])
        current = np.append(current, 1.0 if current[-1] != 1.0 else 2.0)
        time, current = np.append(time, time[-1] + 30e-6), np.append(current, current[-1])
    if not current.any():
        return
    up, slow, fast, band = 40.0, 2.0, 30.0, 0.3
    driver = DriveProfile(
        time=tuple(time),
        current=tuple(current),
        supply_voltage=up,
        band=band,
        freewheel=slow,
        decay=fast,
    )
    end = time[-1] + 20e-6

    r = run(driver, steps=int(end / step), step=step)

    at, value = _followed(time, current, up, slow, fast, band, end)
    np.testing.assert_allclose(r.current, np.interp(r.time, at, value), atol=1e-7)


def _followed(time, target, up, slow, fast, band, end):
    """Corners of the current that follows a target through a coil without resistance."""
    volts = {"on": up, "slow": -slow, "fast": -fast, "off": -fast}
    t, i, state = 0.0, 0.0, "off"
    corners = [(t, i)]
    while t < end:
        later = time[time > t + 1e-15]
        until = min(later[0], end) if later.size else end
        if t < time[0] or t >= time[-1]:
            state, a, b = "off", 0.0, 0.0
        else:
            k = int(np.searchsorted(time, t, side="right")) - 1
            a = float(np.interp(t, time[k : k + 2], target[k : k + 2]))
            b = float(target[k + 1])
            zero = target[k] == 0.0 and target[k + 1] == 0.0
            state = "off" if zero else ("on" if state == "off" else state)
        slope_of_target = (b - a) / (until - t)
        for _ in range(3):
            excess = i - a
            if state == "on" and excess >= band / 2 - 1e-12:
                state = "slow"
            if state == "slow" and excess <= -band / 2 + 1e-12:
                state = "on"
            elif state == "slow" and excess >= band - 1e-12:
                state = "fast"
            if state == "fast" and excess <= band / 2 + 1e-12:
                state = "slow"
        slope = volts[state] / INDUCTANCE
        if i <= 0.0 and slope < 0.0:
            i, slope = 0.0, 0.0
        goals = {"on": [0.5], "slow": [-0.5, 1.0], "fast": [0.5], "off": []}[state]
        lasts = until - t
        if slope < 0.0:
            lasts = min(lasts, i / -slope)
        for goal in goals:
            closing = slope - slope_of_target
            gap = a + goal * band - i
            if closing != 0.0 and gap / closing > 1e-15:
                lasts = min(lasts, gap / closing)
        i = max(i + slope * lasts, 0.0) if i + slope * lasts > 1e-13 else 0.0
        t = until if lasts == until - t else t + lasts
        corners.append((t, i))
    return np.array(corners).T


def test_profile_of_a_voltage_gives_its_integral_and_no_negative_current():
    profile = DriveProfile(
        time=(1e-6, 3e-6, 3e-6, 9e-6), voltage=(0.0, 20.0, 10.0, 10.0), decay=30.0
    )
    r = run(profile, steps=600, step=0.1e-6)

    area = 0.5 * 2e-6 * 20.0 + 6e-6 * 10.0
    assert r.current.max() == pytest.approx(area / INDUCTANCE, rel=1e-9)
    gone = 9e-6 + area / 30.0
    falling = (r.time > 9e-6) & (r.time < gone)
    expected = (area - 30.0 * (r.time[falling] - 9e-6)) / INDUCTANCE
    np.testing.assert_allclose(r.current[falling], expected, atol=1e-9)
    assert np.all(r.current[r.time > gone + 1e-7] == 0.0)


def test_repeated_profile_does_not_drift():
    r = run(
        DriveProfile(
            time=(0.0, 0.0, 4e-6, 4e-6),
            voltage=(0.0, 12.0, 12.0, 0.0),
            decay=12.0,
            repeat_every=10.01e-6,
        ),
        steps=3003,
        step=1e-6,
    )

    begin = 299 * 10.01e-6
    k = np.flatnonzero((r.time > begin) & (r.time < begin + 4e-6))
    top = 12.0 * 4e-6 / INDUCTANCE
    assert r.current[k] == pytest.approx(12.0 * (r.time[k] - begin) / INDUCTANCE, abs=1e-9 * top)


HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
PAGE = " ".join((HOW_TO / "boost-capacitor.md").read_text(encoding="utf-8").split())
USUAL = {
    "battery": 14.0,
    "capacitance": 20e-6,
    "boost_voltage": 65.0,
    "recharge_power": 10.0,
    "peak_current": 10.0,
    "hold_current": 3.0,
    "hold_band": 1.0,
    "shots": (Shot(start=0.0, end=0.5e-3), Shot(start=0.6e-3, end=0.9e-3)),
}


@pytest.fixture(scope="module")
def case():
    return load_valve_case(HOW_TO / "boost_driver.yaml")


@pytest.fixture(scope="module")
def result(case):
    return simulate_network(case.network.network().rows(), duration=case.run.duration, record=1e-6)


@pytest.mark.slow
@each("seed", range(20, 32))
@each("step", [1e-7, 1.28e-6, 10e-6])
def test_random_stages_balance_at_any_step(seed, step):
    plant = injector() if seed % 2 else linear_coil()
    time = step * np.arange(round(0.9e-3 / step) + 1)
    lift = 60e-6 * np.clip((time - 0.1e-3) / 0.2e-3, 0.0, 1.0)
    if step < 1e-6:  # a part of it is enough
        lift = lift[:1500]

    run = run_stage(
        plant, random_driver(seed), step=step, duration=step * (lift.size - 1), lift=lift
    )

    assert run.residual < 1e-11
    for name in ("ohmic", "eddy", "switches", "diodes", "clamp", "converter"):
        assert run.energies[name] >= -1e-15
    assert np.all(run.current >= 0.0)
    assert np.all(run.capacitor >= 0.0)


@pytest.mark.slow
def test_a_capacitor_that_is_empty_at_the_start_leaves_the_boost_to_the_battery():
    driver = BoostDriver(**USUAL | {"start_voltage": 5.0, "recharge_power": 0.0})

    run = run_stage(linear_coil(), driver, step=1e-6, duration=0.1e-3)

    assert run.capacitor[-1] == 5.0
    rate = 0.5 / (60.0**2 * (1 / 2e7 + 1 / 2e8))
    assert run.current[-1] == pytest.approx(13.3 / 0.5 * (1 - np.exp(-0.1e-3 * rate)), rel=1e-6)


@pytest.mark.slow
def test_recuperation_may_raise_the_capacitor_above_its_nominal_voltage():
    late = (Shot(start=40e-3, end=41e-3),)
    driver = BoostDriver(**USUAL | {"shots": late})

    run = run_stage(linear_coil(), driver, step=1e-6, duration=0.2e-3, current=8.0)

    assert run.capacitor[-1] > 66.0
    assert run.energies["converter"] == 0.0
    assert run.energies["capacitor"] > 0.0


def test_states_of_the_second_shot_have_times_of_their_own():
    program = BoostDriver(**USUAL | {"peak_duration": 0.1e-3, "repeat_every": 2e-3}).program()

    states = {state.name: state for state in program.states}
    assert states["off"].switches[0].value == 0.6e-3
    assert states["off"].switches[0].to == "boost-2"
    assert states["off-2"].switches[0].new_cycle
    (leave,) = [s for s in states["peak-off-2"].switches if s.to == "fall-2"]
    assert (leave.when, leave.value) == (When.TIME, pytest.approx(0.7e-3))
    assert program.stage is not None
    assert program.stage.paths["boost"].empty == (pytest.approx(13.3), "supply")


COMPLAINTS = {
    "boost below battery": ({"boost_voltage": 12.0}, "more than the battery, 14 V"),
    "band": ({"hold_band": 7.0}, "less than twice the hold current"),
    "peak": ({"peak_current": 3.2}, "a current above the band of the hold"),
    "clamp": ({"decay": "clamp"}, "the Zener or avalanche voltage of the clamp"),
    "overlap": (
        {"shots": (Shot(start=0.0, end=0.5e-3), Shot(start=0.4e-3, end=0.9e-3))},
        "a start from 500 us on",
    ),
    "backwards": ({"shots": (Shot(start=0.5e-3, end=0.4e-3),)}, "an end after it"),
    "peak too long": ({"peak_duration": 0.4e-3}, "less than the 300 us of a shot"),
    "period": ({"repeat_every": 0.8e-3}, "at least 900 us"),
    "none": ({"shots": ()}, "at least 1 item"),
    "no capacitor": ({"capacitance": 0.0}, "greater than 0"),
}


@pytest.mark.parametrize("name", COMPLAINTS)
def test_a_complaint_says_what_is_wrong(name):
    change, text = COMPLAINTS[name]

    with pytest.raises(InputError, match=re.escape(text)):
        BoostDriver(**USUAL | change)


def test_only_a_coil_behind_a_stage_has_its_entries(case):
    rows = case.network.network().rows()
    labels = [book.label for row in rows.elements for book in row.books]

    assert {"battery", "switches", "diodes", "clamp", "converter", "capacitor"} <= set(labels)
    assert Book("electric", "supply") not in [b for row in rows.elements for b in row.books]


IRON = "{material: X6Cr17, length: 30 mm, area: 34 mm^2}"
LOOP = (
    "{material: X6Cr17, length: 30 mm, area: 34 mm^2, "
    "hysteresis: {coercivity: 300 A/m, initial_permeability: 150}}"
)
EDDY = (
    "      eddy: [{conductivity: 1.5 MS/m, length: 18 mm, radius: 3.5 mm, slots: 0.3, terms: 3, "
    "permeability: 500}]\n    driver:\n"
)
MAP = """    coil:
      type: force-map-solenoid
      resistance: 0.5 ohm
      gap: 80 um
      current: [0 A, 4 A, 20 A]
      gaps: [10 um, 40 um, 80 um, 120 um]
      linkage:
        - [0 mWb, 0 mWb, 0 mWb, 0 mWb]
        - [1.6 mWb, 1 mWb, 0.6667 mWb, 0.5 mWb]
        - [8 mWb, 5 mWb, 3.3333 mWb, 2.5 mWb]
"""


@pytest.mark.slow
@pytest.mark.parametrize("coil", ["hysteresis", "eddy", "map"])
def test_other_coils_balance_behind_a_stage(coil):
    text = (HOW_TO / "boost_driver.yaml").read_text(encoding="utf-8")
    if coil == "hysteresis":
        changed = text.replace(IRON, LOOP)
    elif coil == "eddy":
        changed = text.replace("    driver:\n", EDDY)
    else:
        changed = text[: text.index("    coil:")] + MAP + text[text.index("    driver:") :]
    assert changed != text

    case = read_valve_case(changed, HOW_TO / "changed.yaml")
    run = simulate_network(case.network.network().rows(), duration=1.6e-3, record=2e-6)

    assert run.books.relative_residual < 1e-11
    assert run.channels["coil current"].values.max() == pytest.approx(12.0, rel=0.05)
    assert run.channels["coil capacitor voltage"].values.min() < 55.0
    if coil == "hysteresis":
        assert run.books.losses["coil hysteresis"] > 0.0


@pytest.mark.slow
def test_a_run_in_two_parts_is_the_run_of_the_whole_time(case):
    rows, keys = case.network.network().rows(), {"record": 2e-6, "coarse": 10, "step": 20e-9}

    whole = simulate_network(rows, duration=0.9e-3, **keys)
    first = simulate_network(rows, duration=0.6e-3, **keys)
    second = simulate_network(rows, duration=0.3e-3, state=first.state, **keys)

    for name in ("coil capacitor voltage", "coil current", "needle.tip displacement"):
        joined = np.concatenate((first.channels[name].values, second.channels[name].values[1:]))
        np.testing.assert_array_equal(joined, whole.channels[name].values, err_msg=name)


def test_the_page_shows_the_driver_of_the_case():
    whole = YAML(typ="safe").load(HOW_TO / "boost_driver.yaml")["network"]["components"]
    text = (HOW_TO / "boost-capacitor.md").read_text(encoding="utf-8")
    block = re.findall(r"```yaml-part\n(.*?)```", text, re.DOTALL)[0]
    assert YAML(typ="safe").load(block)["driver"] == whole["driver"]


@pytest.mark.slow
def test_the_second_shot_is_late_as_the_page_says(result):
    assert result.books.relative_residual < 1e-11
    found = re.search(r"as in the case \| ([\d.]+) V \| ([\d.]+) us \| ([\d.]+) us", PAGE)
    assert found is not None
    voltage, time, late = (float(number) for number in found.groups())
    capacitor = result.channels["coil capacitor voltage"].values
    at = np.argmin(np.abs(result.time - 0.7e-3))
    assert capacitor[at] == pytest.approx(voltage, abs=0.1)
    assert capacitor[result.time < 0.4e-3].min() == pytest.approx(
        float(re.search(r"from 65 V to ([\d.]+) V", PAGE)[1]), abs=0.1
    )
    opened = [e.time for e in result.events if e.stop == "opening" and e.approach_speed > 0.5]
    first, second = opened[0] - 0.1e-3, opened[1] - 0.7e-3
    assert 1e6 * second == pytest.approx(time, abs=0.1)
    assert 1e6 * (second - first) == pytest.approx(late, abs=0.1)


@pytest.mark.slow
def test_the_energies_are_those_of_the_page(result):
    found = re.search(
        r"The battery supplies ([\d.]+) mJ. The coil turns ([\d.]+) mJ of them into heat, the "
        r"diodes ([\d.]+) mJ, the switches ([\d.]+) mJ and the converter ([\d.]+) mJ",
        PAGE,
    )
    assert found is not None
    battery, ohmic, diodes, switches, converter = (float(x) * 1e-3 for x in found.groups())
    losses = result.books.losses
    assert result.books.supplies["coil battery"] == pytest.approx(battery, abs=0.2e-3)
    for name, value in (
        ("ohmic", ohmic),
        ("diodes", diodes),
        ("switches", switches),
        ("converter", converter),
    ):
        assert losses[f"coil {name}"] == pytest.approx(value, abs=0.1e-3)


def test_a_magnet_with_remanence_starts_so_behind_a_stage():
    text = (HOW_TO / "boost_driver.yaml").read_text(encoding="utf-8").replace(IRON, LOOP)
    text = text.replace("    coil:\n", "    coil:\n      start: remanent\n")
    network = read_valve_case(text, HOW_TO / "remanent.yaml").network.network()
    (coil,) = (row for row in network.rows().elements if row.component == "coil")

    circuit, gap = network.components["coil"].circuit(), float(coil.parameters[2])
    fluxes, stops = remanent_state(circuit, current=0.0, gap=gap)

    assert coil.state[-2] == 65.0  # the capacitor
    assert list(coil.state[-2 - len(stops) : -2]) == list(stops)
    assert coil.state[-1] == np.abs(fluxes).max() > 0.0
