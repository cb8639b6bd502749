"""Checks of the full-order impact."""

from math import pi

import numpy as np
from numpy.typing import NDArray

from klack.transient.result import FullOrderResult
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.hertz_pulse import hertz_force
from klack.verification.impacts import (
    STEEL,
    bulk_wave_speed,
    drop_blocked_bar,
    drop_rod,
    drop_sphere,
    plateau,
)

__all__ = ["checks"]

_GROUP = "transient"
_SPEED = 0.5  # [m/s]
_AREA = 1e-4  # [m^2]
_ELEMENTS = 200


def checks() -> list[Check]:
    """Return all checks of the full-order impact."""
    return [*_rod_on_wall(), *_two_rods(), *_blocked_bar(), *_sphere_on_block()]


def _rod_on_wall() -> list[Check]:
    length = 0.03
    impedance = STEEL.density * STEEL.bar_wave_speed * _AREA
    contact_time = 2.0 * length / STEEL.bar_wave_speed
    run = drop_rod(length, elements=_ELEMENTS)
    other = drop_rod(length, elements=_ELEMENTS, scheme="massless")
    history = run.history
    curve = _square_pulse(run, impedance * _SPEED, contact_time)
    source = "bar on rigid wall, one-dimensional wave equation: "
    return [
        compare(
            _GROUP,
            "rod on rigid wall: force [N]",
            expected=impedance * _SPEED,
            computed=plateau(run, contact_time),
            tolerance=1e-5,
            source=source + "F = rho c A v",
            curve=curve,
        ),
        compare(
            _GROUP,
            "rod on rigid wall: contact time [s]",
            expected=contact_time,
            computed=_contact_time(run),
            tolerance=1e-2,
            source=source + "T = 2 L / c; dispersion smears the front",
            curve=curve,
        ),
        compare(
            _GROUP,
            "rod on rigid wall: restitution",
            expected=1.0,
            computed=history.velocity_a[-1] / _SPEED,
            tolerance=1.5e-2,
            source=source + "e = 1; falls short by the dispersed tail of the front",
        ),
        compare(
            _GROUP,
            "rod on rigid wall: impulse against change of momentum [N s]",
            expected=history.mass_a * (history.velocity_a[-1] + _SPEED),
            computed=history.impulse,
            tolerance=5e-14,
            source="Newton's second law",
        ),
        compare(
            _GROUP,
            "rod on rigid wall: energy residual over impact energy",
            expected=0.0,
            computed=history.ledger.residual,
            tolerance=5e-14,
            source="energy theorem of the scheme: losses -lam.g0 and -2 mu.g1 / h^2 are counted",
        ),
        compare(
            _GROUP,
            "rod on rigid wall: impulse, massless against contact-stabilised [N s]",
            expected=history.impulse,
            computed=other.history.impulse,
            tolerance=5e-3,
            source="two schemes for one continuous problem",
        ),
    ]


def _two_rods() -> list[Check]:
    length = 0.02
    impedance = STEEL.density * STEEL.bar_wave_speed * _AREA
    contact_time = 2.0 * length / STEEL.bar_wave_speed
    run = drop_rod(length, 2.0 * length, elements=_ELEMENTS)
    unequal = drop_rod(length, 2.0 * length, elements=_ELEMENTS, other_area=3.0 * _AREA)
    history = run.history
    parting = history.velocity_a[-1] - history.velocity_b[-1]
    source = "St Venant; Goldsmith 1960, ch. 2: "
    return [
        compare(
            _GROUP,
            "two rods 1:2: force [N]",
            expected=0.5 * impedance * _SPEED,
            computed=plateau(run, contact_time),
            tolerance=1e-5,
            source=source + "F = rho c A v / 2",
            curve=_square_pulse(run, 0.5 * impedance * _SPEED, contact_time),
        ),
        compare(
            _GROUP,
            "two rods 1:2: restitution",
            expected=0.5,
            computed=parting / _SPEED,
            tolerance=2e-2,
            source=source + "e = L1 / L2",
        ),
        compare(
            _GROUP,
            "rods of areas 1:3: force [N]",
            expected=0.75 * impedance * _SPEED,
            computed=plateau(unequal, contact_time),
            tolerance=1e-5,
            source=source + "F = v Z1 Z2 / (Z1 + Z2)",
            curve=_square_pulse(unequal, 0.75 * impedance * _SPEED, contact_time),
        ),
    ]


def _blocked_bar() -> list[Check]:
    length, speed = 0.03, _SPEED
    c = bulk_wave_speed(STEEL)
    run = drop_blocked_bar(length, 60, speed)
    return [
        compare(
            _GROUP,
            "bar without lateral strain on rigid wall, axisymmetric: force [N]",
            expected=STEEL.density * c * pi * 2e-3**2 * speed,
            computed=plateau(run, 2.0 * length / c),
            tolerance=1e-3,
            source="F = rho c_p A v, c_p^2 = E (1-nu) / (rho (1+nu) (1-2nu))",
            curve=_square_pulse(run, STEEL.density * c * pi * 2e-3**2 * speed, 2.0 * length / c),
        )
    ]


def _sphere_on_block() -> list[Check]:
    """Sphere of 4 mm on a block so large that no echo returns in time."""
    run = drop_sphere(radius=50e-3, height=50e-3, bulk=3e-3, speed=_SPEED)
    history = run.history
    peak, contact_time = 30.4775197, 15.8774048e-6
    since = _since_touch(run)
    curve = ComparedCurve(
        x_label="time since first touch [us]",
        y_label="force [N]",
        expected=(since * 1e6, hertz_force(since, duration=contact_time, peak=peak)),
        computed=(since * 1e6, history.force),
    )
    return [
        compare(
            _GROUP,
            "steel sphere on thick steel block, 0.5 m/s: share of energy radiated, 1 - e^2",
            expected=4.4152e-3,
            computed=1.0 - (history.velocity_a[-1] / _SPEED) ** 2,
            tolerance=5e-2,
            source="Hertz force radiated into a half-space: Hunter 1957; Miller & Pursey 1955",
        ),
        compare(
            _GROUP,
            "steel sphere D4 on thick steel block, 0.5 m/s: peak force [N]",
            expected=peak,
            computed=float(np.max(history.force)),
            tolerance=1e-2,
            source="Hertz 1882 (quasi-static; contact radius 1/27 of the sphere's)",
            curve=curve,
        ),
        compare(
            _GROUP,
            "steel sphere D4 on thick steel block, 0.5 m/s: contact time [s]",
            expected=contact_time,
            computed=_contact_time(run),
            tolerance=1e-2,
            source="Hertz 1882, T = 2.9433 delta_max / v",
            curve=curve,
        ),
        compare(
            _GROUP,
            "steel sphere on thick steel block: energy lost by the scheme",
            expected=0.0,
            computed=run.energy_loss,
            tolerance=1e-4,
            source="Deuflhard, Krause & Ertel 2008: the loss vanishes with the step",
        ),
    ]


def _since_touch(run: FullOrderResult) -> NDArray[np.float64]:
    history = run.history
    first = int(np.argmax(history.force > 0))
    return np.asarray(history.time - history.time[first] + 0.5 * history.step)


def _square_pulse(run: FullOrderResult, height: float, duration: float) -> ComparedCurve:
    since = _since_touch(run)
    on = (since > 0.0) & (since < duration)
    return ComparedCurve(
        x_label="time since first touch [us]",
        y_label="force [N]",
        expected=(since * 1e6, np.where(on, height, 0.0)),
        computed=(since * 1e6, run.history.force),
    )


def _contact_time(run: FullOrderResult) -> float:
    return float(np.count_nonzero(run.history.force > 0) * run.history.step)
