"""Order two in the step, through boost, peak, fall, two-point hold and decay."""

import numpy as np
import pytest

from klack.magnetics.peak_hold import PeakHold
from klack.verification.drivers import injector, opening
from klack.verification.single_coil import run_coil

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


def test_flux_work_and_supply_converge_with_order_two():
    counts = np.array([400, 800, 1600, 3200])
    errors = np.abs([values(n) - values(128000) for n in counts])

    orders = -np.polyfit(np.log(counts), np.log(errors), 1)[0]

    # switchings fall anywhere inside the steps: the constant wobbles, the order does not
    assert orders == pytest.approx([2.0, 2.0, 2.0], abs=0.2)
