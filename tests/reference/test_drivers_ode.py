"""The same coil as a textbook differential equation, solved by scipy with its own events."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from klack.magnetics.driver import DriveProgram, DriveState, Switch, When
from klack.verification.drivers import injector, run_coil

R, GAP, TURNS = 0.8, 100e-6, 60.0
CIRCUIT = injector()
GAP_LAW, IRON, LEAK = (branch.law for branch in CIRCUIT.branches)
EDDY = CIRCUIT.branches[0].eddy


def lift(t):
    return 40e-6 * (1.0 - np.cos(2e4 * t))


def current(y):
    return float(LEAK.mmf(y[1], 0.0)) / TURNS


def rates(voltage):
    def right(t, y):
        i = current(y)
        main = (TURNS * i - float(GAP_LAW.mmf(y[0], GAP - lift(t)) + IRON.mmf(y[0], 0.0))) / EDDY
        return [main, (voltage - R * i) / TURNS - main]

    return right


def phase(voltage, begin, y, level, direction):
    """Integrate until the current crosses a level; time and fluxes there."""

    def event(t, y):
        return current(y) - level

    event.terminal, event.direction = True, direction
    run = solve_ivp(
        rates(voltage), (begin, 400e-6), y, method="DOP853", rtol=1e-11, atol=1e-18, events=event
    )
    return run.t[-1], run.y[:, -1]


def test_peak_and_fall_against_dop853():
    states = (
        DriveState("boost", 65.0, (Switch(When.CURRENT_ABOVE, 10.0, "fall"),)),
        DriveState("fall", -0.7, (Switch(When.CURRENT_BELOW, 3.0, "decay"),)),
        DriveState("decay", -50.0),
    )
    top, y = phase(65.0, 0.0, [0.0, 0.0], 10.0, 1)
    low, y = phase(-0.7, top, y, 3.0, -1)
    end, y = phase(-50.0, low, y, 0.0, -1)

    step = 5e-9
    steps = round(end / step) + 50
    r = run_coil(
        CIRCUIT,
        DriveProgram(states),
        resistance=R,
        gap=GAP,
        step=step,
        lift=lift(step * np.arange(steps + 1)),
    )

    # a parabola through the last three records before each instant finds it
    for instant, level, state in ((top, 10.0, 0), (low, 3.0, 1)):
        k = int(np.flatnonzero(r.state == state)[-1])
        curve = np.polynomial.Polynomial.fit(r.current[k - 2 : k + 1], [-2.0, -1.0, 0.0], 2)
        assert r.time[k] + step * curve(level) == pytest.approx(instant, abs=1e-12)
    k = int(np.flatnonzero((r.time > low) & (r.current == 0.0))[0])
    assert r.time[k - 1] - 1e-12 < end < r.time[k] + 1e-12
    # what is left of the main flux; it falls by its share of one step until the next record
    assert r.flux[k] == pytest.approx(y[0], rel=2e-3)
    before = solve_ivp(
        rates(-50.0), (low, r.time[k - 5]), phase(-0.7, top, phase(65.0, 0.0, [0, 0], 10.0, 1)[1],
        3.0, -1)[1], method="DOP853", rtol=1e-11, atol=1e-18,
    )  # fmt: skip
    assert r.flux[k - 5] == pytest.approx(before.y[0, -1], rel=1e-5)
