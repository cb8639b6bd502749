"""Convergence with the step, through boost, peak, fall, two-point hold and decay."""

import numpy as np

from klack.magnetics.peak_hold import PeakHold
from klack.verification.drivers import injector, opening, run_coil

DRIVER = PeakHold(
    boost_voltage=65.0,
    peak_current=10.0,
    supply_voltage=14.0,
    hold_current=3.0,
    hold_band=1.0,
    end=150e-6,
    decay=50.0,
).program()


def values(steps):
    step = 200e-6 / steps
    r = run_coil(
        injector(),
        DRIVER,
        resistance=0.8,
        gap=100e-6,
        step=step,
        lift=opening(200e-6, step),
    )
    return np.array([r.flux[-1], r.work, r.electric])


def test_long_steps_are_cut_where_the_fluxes_bend():
    """Saturation, switchings, eddy currents; uncut, the supply is 30 times as far off."""
    errors = np.abs(values(156) / values(128000) - 1.0)  # steps of 1.28 us

    assert np.all(errors < [1e-4, 3e-4, 3e-4])


def test_flux_work_and_supply_converge():
    """Uncut steps have order two; the error allowed of cut ones falls with the square."""
    counts = np.array([400, 800, 1600, 3200])
    errors = np.abs(np.array([values(n) / values(128000) - 1.0 for n in counts]))

    orders = -np.polyfit(np.log(counts), np.log(errors), 1)[0]

    # switchings fall anywhere inside the steps: the constant wobbles, the order does not
    assert np.all(orders > 1.3)
    assert np.all(errors[-1] < 2.5e-6)  # uncut steps of 62.5 ns: 2e-6 to 1.3e-5
