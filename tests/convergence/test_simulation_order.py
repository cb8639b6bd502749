"""Truth: rod on a spring as a piecewise linear system, propagated by its exact eigen-solution.

The reference finds touch and release by root finding and knows no time step.
"""

from math import sqrt

import numpy as np
import pytest
from scipy.optimize import brentq

from klack.contact.laws import HertzLaw, LinearLaw
from klack.simulation.bodies import fixed_body, rigid_mass_body, rod_body
from klack.simulation.impact import simulate
from klack.simulation.system import ContactPair, ReducedSystem

MODES, STIFFNESS, GAP, DURATION = 5, 20.0, 0.1, 6.0  # unit rod, unit speed


def rod_system(law, series=0.0):
    rod = rod_body("rod", length=1.0, area=1.0, young=1.0, density=1.0, elastic_modes=MODES)
    pair = ContactPair(
        body_a="rod",
        port_a="bottom",
        body_b="wall",
        port_b="contact",
        law=law,
        gap=GAP,
        series_compliance=series,
    )
    return ReducedSystem(bodies=(rod, fixed_body("wall")), contacts=(pair,))


def flow(K, origin):
    """Return the exact motion q'' = -K (q - origin) as a function of state and time."""
    values, V = np.linalg.eigh(K)
    w = np.sqrt(np.maximum(values, 0.0))
    w[w < 1e-6] = 0.0

    def move(state, t):
        a, b = V.T @ (state[0] - origin), V.T @ state[1]
        s = t * np.sinc(w * t / np.pi)
        q = a * np.cos(w * t) + b * s
        v = -w * np.sin(w * t) * a + b * np.cos(w * t)
        return V @ q + origin, V @ v

    return move


def exact_end(stiffness):
    """State of the rod at the end: flights and contacts with located events."""
    rod = rod_system(LinearLaw(1.0)).bodies[0]
    phi, K = rod.port_shapes[:, 0], np.diag(rod.omega**2)
    closed_K = K + stiffness * np.outer(phi, phi)
    origin = np.linalg.solve(closed_K, -stiffness * GAP * phi)  # rests where the spring is free
    open_flow, closed_flow = flow(K, np.zeros(phi.size)), flow(closed_K, origin)
    state = np.zeros(phi.size), np.eye(phi.size)[0] * -1.0
    t, closed = 0.0, False
    while True:
        move = closed_flow if closed else open_flow
        sign = -1.0 if closed else 1.0

        def gap(s, move=move, state=state, sign=sign):
            return sign * (GAP + phi @ move(state, s)[0])

        grid = np.linspace(0.0, DURATION - t, 4001)[1:]
        crossed = [i for i in range(1, grid.size) if gap(grid[i - 1]) > 0.0 >= gap(grid[i])]
        if not crossed:
            return move(state, DURATION - t)
        i = crossed[0]
        s = brentq(gap, grid[i - 1], grid[i], xtol=1e-15)
        state, t, closed = move(state, s), t + s, not closed


def error_norm(system, step, reference):
    record = simulate(system, velocities={"rod": -1.0}, step=step, duration=DURATION)
    omega = system.bodies[0].omega
    dq, dv = record.final_position[0] - reference[0], record.final_velocity[0] - reference[1]
    return sqrt(np.sum(dv**2) + np.sum((omega * dq) ** 2) + dq[0] ** 2)


def order(steps, errors):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


@pytest.mark.slow
def test_contact_scheme_is_of_second_order():
    reference = exact_end(STIFFNESS)
    steps = DURATION / np.array([750, 1500, 3000, 6000, 12000])
    errors = [error_norm(rod_system(LinearLaw(STIFFNESS)), step, reference) for step in steps]

    assert order(steps, errors) == pytest.approx(2.0, abs=0.1)
    assert errors[-1] < 1e-4


@pytest.mark.slow
def test_series_spring_keeps_the_order():
    """Linear law and series spring are together one linear spring, which the reference has."""
    series = 0.03
    reference = exact_end(STIFFNESS / (1.0 + STIFFNESS * series))
    steps = DURATION / np.array([750, 1500, 3000, 6000, 12000])
    system = rod_system(LinearLaw(STIFFNESS), series)
    errors = [error_norm(system, step, reference) for step in steps]

    # 0.2: the kink of the onset meets the grid differently each time
    assert order(steps, errors) == pytest.approx(2.0, abs=0.2)


def test_hertz_law_is_of_second_order():
    """Self-convergence on a sphere, whose end speed and place depend on the law's curvature."""
    pair = ContactPair(
        body_a="sphere",
        port_a="contact",
        body_b="wall",
        port_b="contact",
        law=HertzLaw(1.0),
        gap=0.05,
    )
    system = ReducedSystem(
        bodies=(rigid_mass_body("sphere", 1.0), fixed_body("wall")), contacts=(pair,)
    )

    def place(steps):
        record = simulate(system, velocities={"sphere": -1.0}, step=5.0 / steps, duration=5.0)
        return record.final_position[0][0]

    counts = np.array([125, 250, 500, 1000])
    fine = place(64000)
    errors = np.array([abs(place(n) - fine) for n in counts])

    assert order(5.0 / counts, errors) == pytest.approx(2.0, abs=0.1)
