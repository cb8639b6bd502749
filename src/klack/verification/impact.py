"""Reduced impacts against closed and tabulated solutions."""

from collections.abc import Iterator
from math import gamma, pi, sqrt

import numpy as np

from klack.contact.laws import HertzLaw, HuntCrossley, gonthier_coefficient
from klack.contact.restitution import measure_impact
from klack.verification.bouncing_bar import bouncing_bar_checks
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.one_dimension import (
    BAR_SPEED,
    DENSITY,
    NEEDLE_AREA,
    hertz_force,
    mass_on_law,
    needle_on_spring,
    sphere_on_rod,
    st_venant_rods,
)

__all__ = ["checks"]


# kappa, restitution, peak force over Z v, first separation [L/c]
NEEDLE_ON_SPRING = (
    (0.5, 0.999382, 0.663972, 4.80330),
    (1.0, 0.974081, 0.869142, 3.63660),
    (3.0, 0.982917, 0.997523, 2.55920),
    (11.37, 0.995452, 1.000000, 2.14760),
)
NEEDLE_SOURCE = (
    "exact delay relation v_end = v0 - (F(t) + 2 sum F(t - 2jL/c))/Z, Runge-Kutta, step L/(10000 c)"
)
# kappa, elastic modes, static spring, peak force over Z v, restitution
TRUNCATED = (
    (1.0, 5, False, 0.8778, 0.97318),
    (11.37, 10, False, 1.0489, 0.99721),
    (11.37, 10, True, 1.0292, 0.99586),
    (11.37, 20, True, 1.0075, 0.99548),
)
TRUNCATED_SOURCE = "rod with N exact modes, velocity Verlet with steps below 2e-5 L/c"
# lambda, restitution, peak force [m v/T0]
ZENER = ((0.1, 0.8433394, 1.0355460), (0.5, 0.4368953, 0.7502314), (1.0, 0.1841229, 0.5561609))
ZENER_SOURCE = "Zener 1941, s'' + (1 + lambda d/dt) s^1.5 = 0, integrated with tolerance 1e-11"


def checks() -> list[Check]:
    """Return the checks."""
    return [
        *_hertz(),
        *_gonthier(),
        *_st_venant(),
        *_needle_on_spring(),
        *_modal_convergence(),
        *_zener(),
        *bouncing_bar_checks("full", 200, 6e-3, 5e-3),
        *bouncing_bar_checks("interface", 160, 5e-3, 5e-4),
        *bouncing_bar_checks("reduced", 320, 3e-3, 5e-4),
    ]


def _hertz() -> list[Check]:
    mass, speed, K = 1e-3, 0.5, 4.0 / 3.0 * 115.4e9 * sqrt(2e-3)
    depth = (5.0 * mass * speed**2 / (4.0 * K)) ** 0.4
    duration = 4.0 * sqrt(pi) / 5.0 * gamma(0.4) / gamma(0.9) * depth / speed
    history = mass_on_law(mass, HertzLaw(K), speed=speed, step=2e-9, duration=1.2 * duration)
    m = measure_impact(history)
    since = history.time - 0.02 * 1.2 * duration  # its gap is closed by then
    curve = ComparedCurve(
        x_label="time since first touch [us]",
        y_label="force [N]",
        expected=(since * 1e6, hertz_force(since, duration=duration, peak=K * depth**1.5)),
        computed=(since * 1e6, history.force),
    )
    where = "Johnson 1985, section 11.4, sphere of 1 g and R = 2 mm on a plane at 0.5 m/s"
    return [
        check(
            "Hertz contact time [s]",
            expected=duration,
            computed=m.contact_time,
            tolerance=2e-7,
            source=where,
            curve=curve,
        ),
        check(
            "Hertz peak force [N]",
            expected=K * depth**1.5,
            computed=m.peak_force,
            tolerance=1e-6,
            source=where,
            curve=curve,
        ),
        check(
            "Hertz restitution [-]",
            expected=1.0,
            computed=m.restitution,
            tolerance=5e-13,
            source="elastic law",
        ),
    ]


def _gonthier() -> Iterator[Check]:
    for e in (0.3, 0.9):
        m = measure_impact(
            mass_on_law(
                1e-3,
                HuntCrossley(HertzLaw(7e9), gonthier_coefficient(e)),
                speed=0.5,
                step=10e-9,
                duration=1e-3,
            )
        )
        yield check(
            f"restitution {e:g} prescribed for rigid bodies [-]",
            expected=e,
            computed=m.restitution,
            tolerance=1e-6,
            source="Gonthier et al. 2004, eq. 29",
        )


def _st_venant() -> list[Check]:
    Z = DENSITY * BAR_SPEED * NEEDLE_AREA
    source = "St Venant; Goldsmith 1960, section 3.2: rods of equal section, lengths 1:2"
    soft, hard = st_venant_rods(1e9, 320, step=10e-9), st_venant_rods(1e12, 320, step=5e-9)
    m = measure_impact(hard)
    inside = (soft.time > 6e-6) & (soft.time < 14e-6)
    coarse = measure_impact(st_venant_rods(1e9, 20, step=10e-9))
    touch = 0.1e-6  # [s] its gap of 0.1 um at 1 m/s
    along = (soft.time - touch) * 1e6
    curve = ComparedCurve(
        x_label="time since first touch [us]",
        y_label="force [N]",
        expected=(along, np.where((along > 0.0) & (along < 0.08 / BAR_SPEED * 1e6), 0.5 * Z, 0.0)),
        computed=(along, soft.force),
    )
    return [
        check(
            "force plateau of two rods, Z v/2 [N]",
            expected=0.5 * Z,
            computed=float(np.mean(soft.force[inside])),
            tolerance=2e-9,
            source=source,
            curve=curve,
        ),
        check(
            "restitution of two rods, L1/L2 [-]",
            expected=0.5,
            computed=m.restitution,
            tolerance=2e-3,
            source=source,
        ),
        check(
            "contact time of two rods, 2 L1/c [s]",
            expected=0.08 / BAR_SPEED,
            computed=m.contact_time,
            tolerance=2e-3,
            source=source,
        ),
        check(
            "restitution of two rods joined by 1e9 N/m, 20 + 40 modes [-]",
            expected=measure_impact(soft).restitution,
            computed=coarse.restitution,
            tolerance=2e-3,
            source="the same with 320 + 640 modes",
            absolute=True,
        ),
    ]


def _needle_on_spring() -> Iterator[Check]:
    for kappa, restitution, peak, separation in NEEDLE_ON_SPRING:
        m = measure_impact(needle_on_spring(kappa, 200, static_spring=True))
        for what, expected, computed, tolerance, absolute in (
            ("restitution [-]", restitution, m.restitution, 2e-6, True),
            ("peak force [Z v]", peak, m.peak_force, 2e-4, False),
            ("contact time [L/c]", separation, m.contact_time, 5e-5, False),
        ):
            yield check(
                f"needle on a spring, kL/EA = {kappa:g}: {what}",
                expected=expected,
                computed=computed,
                tolerance=tolerance,
                source=NEEDLE_SOURCE,
                absolute=absolute,
                reason="stiffer springs need more of the 200 modes; one tolerance for all",
            )


def _modal_convergence() -> Iterator[Check]:
    for kappa, modes, static_spring, peak, restitution in TRUNCATED:
        history = needle_on_spring(kappa, modes, static_spring=static_spring, step=1e-3)
        kind = "with static spring" if static_spring else "truncated"
        name = f"needle on a spring, kL/EA = {kappa:g}, {modes} modes {kind}"
        yield check(
            f"{name}: peak force [Z v]",
            expected=peak,
            computed=measure_impact(history).peak_force,
            tolerance=1e-4,
            source=TRUNCATED_SOURCE,
        )
        yield check(
            f"{name}: restitution [-]",
            expected=restitution,
            computed=abs(float(history.velocity_a[-1])),
            tolerance=1e-5,
            source=TRUNCATED_SOURCE,
            absolute=True,
        )


def _zener() -> Iterator[Check]:
    runs = [measure_impact(sphere_on_rod(row[0])) for row in ZENER]
    table = np.array(ZENER).T
    rebound, force = (
        ComparedCurve(
            x_label="inelasticity lambda [-]",
            y_label=label,
            expected=(table[0], expected),
            computed=(table[0], np.array(computed)),
        )
        for label, expected, computed in (
            ("restitution [-]", table[1], [m.restitution for m in runs]),
            ("peak force [m v/T0]", table[2], [m.peak_force for m in runs]),
        )
    )
    for (inelasticity, restitution, peak), m in zip(ZENER, runs, strict=True):
        yield check(
            f"sphere on a long rod, lambda = {inelasticity:g}: restitution [-]",
            expected=restitution,
            computed=m.restitution,
            tolerance=2e-6,
            source=ZENER_SOURCE,
            absolute=True,
            curve=rebound,
        )
        yield check(
            f"sphere on a long rod, lambda = {inelasticity:g}: peak force [m v/T0]",
            expected=peak,
            computed=m.peak_force,
            tolerance=2e-6,
            source=ZENER_SOURCE,
            curve=force,
        )
