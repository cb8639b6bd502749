"""Truth: order of convergence over the step and over the segments."""

import numpy as np
import pytest

from klack.hydraulics.line_friction import KAGAWA, laminar_resistance, unsteady_terms
from klack.verification.single_line import End, exponential_decay, plain_line, ringing, run_line


@pytest.mark.parametrize("coarse", [1, 4])
def test_fractional_delay_is_of_second_order(coarse):
    delay, duration, omega = 1.0, 1.9, 2.0 * np.pi
    errors, counts = [], np.array([20, 40, 80, 160])
    for n in counts:
        step = delay / (n + 0.5) / coarse  # half a step left over: the worst case
        steps = int(duration / step / coarse)
        edges = step * coarse * np.arange(steps + 1)
        flow = -np.diff(np.cos(omega * edges)) / omega / (step * coarse)  # means of a sine
        row = plain_line(delay=delay, impedance=1.0)

        run = run_line(
            row, End(flow=flow), End(flow=0.0), step=step, lengths=np.full(steps, coarse)
        )

        late = np.maximum(edges - delay, 0.0)
        exact = -2.0 * np.diff(np.cos(omega * late)) / omega / (step * coarse)
        smooth = edges[:-1] > delay + 2.0 * step * coarse  # the sine starts with a kink
        errors.append(np.max(np.abs(run.pressure[smooth, 1] - exact[smooth])))

    order = -np.polyfit(np.log(counts), np.log(errors), 1)[0]

    assert order == pytest.approx(2.0, abs=0.15)


def test_lumps_approach_spread_friction_with_order_two():
    rho, speed, viscosity, length, radius = 870.0, 1370.0, 0.04, 0.06, 1.25e-3
    delay, nu = length / speed, viscosity / rho
    resistance = laminar_resistance(length, 2.0 * radius, viscosity)
    terms = unsteady_terms(
        KAGAWA, resistance=resistance, diameter=2.0 * radius, kinematic_viscosity=nu
    )
    exact = exponential_decay(KAGAWA, delay=delay, radius=radius, kinematic_viscosity=nu)
    counts, errors = np.array([2, 4, 8]), []
    for segments in counts:
        row = plain_line(
            delay=delay,
            impedance=rho * speed / (np.pi * radius**2),
            segments=int(segments),
            resistance=resistance,
            unsteady=terms,
        )
        step = delay / 1600
        run = run_line(
            row,
            End(pressure=0.0),
            End(flow=0.0),
            step=step,
            lengths=np.ones(round(30.0 * delay * 4.0 / step), int),
            pressure=[0.0, 1e5],
        )
        tone = ringing(run.time, run.pressure[:, 1], exact.imag / (2 * np.pi), apart=8 * delay)
        errors.append(abs(tone / exact - 1.0))

    assert errors[-1] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.4)
