"""Mechanical components in the time loop: closed solutions of one and two masses."""

from collections.abc import Mapping, Sequence
from math import exp, log, sqrt
from typing import Literal

import numpy as np

from klack.mechanics.gravity import STANDARD_GRAVITY, Gravity
from klack.network.component import Component
from klack.simulation.network_result import NetworkResult
from klack.verification.benches import component, run_network
from klack.verification.check import Check, ComparedCurve, check

__all__ = ["alone", "checks", "place", "run_parts"]

MASS = 3e-3  # [kg]
NEWTON = "Newton's second law, closed form"


def checks() -> list[Check]:
    """Return the checks."""
    return [
        *_falls(),
        *_oscillates(),
        *_rubs(),
        *_pushed(),
        *_two_bodies(),
        *_balances(),
    ]


def run_parts(
    parts: Mapping[str, Component],
    connections: Sequence[Sequence[str]],
    duration: float,
    step: float = 100e-9,
    start: Literal["rest", "free"] = "free",
) -> NetworkResult:
    """Run a network of parts in fine steps alone."""
    return run_network(
        parts, connections, duration=duration, step=step, record=10 * step, start=start
    )


def alone(part: Component, *, speed: float, duration: float, step: float = 100e-9) -> NetworkResult:
    """Run a mass of 3 g with one component at it."""
    port = next(iter(part.port_kinds()))
    return run_parts(
        {"mass": component("rigid-mass", mass=MASS, speed=speed), "part": part},
        [["mass.body", f"part.{port}"]],
        duration,
        step,
    )


def place(result: NetworkResult) -> np.ndarray:
    """Displacement of the mass [m]."""
    return result.channels["mass.body displacement"].values


def _speed(result: NetworkResult) -> np.ndarray:
    return result.channels["mass velocity"].values


def _falls() -> list[Check]:
    fall = alone(Gravity(), speed=0.1, duration=10e-3)
    t = fall.time[-1]
    pulled = alone(component("constant-force", force=40.0), speed=0.0, duration=1e-3)
    return [
        # 30 000 to 500 000 additions, each to round-off
        check(
            "thrown mass, height after 10 ms [m]",
            0.1 * t - 0.5 * STANDARD_GRAVITY * t**2,
            float(place(fall)[-1]),
            1e-11,
            NEWTON,
        ),
        check(
            "mass pulled by 40 N, supplied work after 1 ms [J]",
            0.5 * 40.0**2 / MASS * pulled.time[-1] ** 2,
            pulled.books.supplies["part work"],
            1e-12,
            NEWTON,
        ),
    ]


def _oscillates() -> list[Check]:
    k, v = 5e6, 0.5
    omega = sqrt(k / MASS)
    errors = []
    for step in (400e-9, 200e-9):
        run = alone(
            component("spring", stiffness=k, preload=0.0), speed=v, duration=1e-3, step=step
        )
        exact = v / omega * np.sin(omega * run.time)
        errors.append(float(np.abs(place(run) - exact).max() / (v / omega)))
    damped = alone(
        component("spring", stiffness=k, preload=0.0, damping=2.0), speed=v, duration=2e-3
    )
    zeta = 2.0 / (2.0 * sqrt(k * MASS))
    shifted = omega * sqrt(1.0 - zeta**2)
    envelope = v / shifted * np.exp(-zeta * omega * damped.time) * np.sin(shifted * damped.time)
    return [
        check(
            "mass on a spring, order of its error in the step [-]",
            2.0,
            log(errors[0] / errors[1]) / log(2.0),
            1e-3,
            "discrete gradient: second order",
        ),
        check(
            "mass on a spring, error over amplitude after 6.5 periods at 200 ns [-]",
            (omega * 200e-9) ** 2 / 12.0 * omega * 1e-3,
            errors[1],
            1e-3,
            "phase error (omega h)^2/12 of the implicit midpoint rule",
            ComparedCurve(
                x_label="time [ms]",
                y_label="displacement [um]",
                expected=(run.time * 1e3, exact * 1e6),
                computed=(run.time * 1e3, place(run) * 1e6),
            ),
        ),
        check(
            "the same, damped by 0.8 %: error over amplitude [-]",
            0.0,
            float(np.abs(place(damped) - envelope).max() * omega / v),
            2e-4,
            NEWTON,
        ),
    ]


def _rubs() -> list[Check]:
    v, b = 0.5, 0.5
    viscous = alone(component("guide-friction", coulomb=0.0, viscous=b), speed=v, duration=6e-3)
    dry = alone(component("guide-friction", coulomb=0.8), speed=v, duration=4e-3)
    stopped = run_parts(
        {
            "mass": component("rigid-mass", mass=MASS, speed=0.1),
            "pull": component("force-over-time", time=(1e-3, 2e-3), force=(0.0, 0.4999)),
            "guide": component("guide-friction", coulomb=0.3, breakaway=0.5),
        },
        [["mass.body", "pull.end", "guide.body"]],
        6e-3,
    )
    return [
        check(
            "viscous friction, speed after 6 ms [m/s]",
            v * exp(-b * viscous.time[-1] / MASS),
            _speed(viscous)[-1],
            1e-9,
            NEWTON,
        ),
        check(
            "dry friction, way to rest [m]",
            MASS * v**2 / (2.0 * 0.8),
            float(place(dry)[-1]),
            1e-11,
            NEWTON,
        ),
        check(
            "dry friction, loss [J]",
            0.5 * MASS * v**2,
            dry.books.losses["part loss"],
            5e-12,
            "all of it",
        ),
        check(
            "creep under 0.9998 of the breakaway friction in 4 ms [m]",
            0.0,
            float(np.ptp(place(stopped)[stopped.time > 1e-3])),
            1e-15,
            "Coulomb: none",
        ),
    ]


def _pushed() -> list[Check]:
    pulse = component("force-over-time", time=(1e-4, 2.03e-4, 4e-4), force=(0.0, 60.0, 0.0))
    latch = component("force-over-stroke", stroke=(0.0, 20e-6, 70e-6), force=(0.0, -30.0, 0.0))
    held = 2.0 / MASS * 0.5 * 30.0 * 70e-6
    return [
        check(
            "triangular pulse, speed after it [m/s]",
            -0.2 + 0.5 * 60.0 * 3e-4 / MASS,
            _speed(alone(pulse, speed=-0.2, duration=5e-4))[-1],
            1e-12,
            NEWTON,
        ),
        check(
            "over the hill of a tabulated force, speed behind it [m/s]",
            sqrt(1.0 - held),
            _speed(alone(latch, speed=1.0, duration=2e-4))[-1],
            2e-13,
            "energy: area of a triangle",
        ),
    ]


def _two_bodies() -> list[Check]:
    run = run_parts(
        {
            "mass": component("rigid-mass", mass=MASS, speed=0.5),
            "housing": component("rigid-mass", mass=0.1),
            "spring": component("spring", stiffness=5e6, preload=0.0),
        },
        [["mass.body", "spring.end"], ["housing.body", "spring.base"]],
        1e-3,
    )
    reduced = MASS * 0.1 / (MASS + 0.1)
    omega = sqrt(5e6 / reduced)
    exact = 0.5 / omega * np.sin(omega * run.time)
    way = place(run) - run.channels["housing.body displacement"].values
    momentum = MASS * _speed(run) + 0.1 * run.channels["housing velocity"].values
    return [
        check(
            "two masses on a spring, error of the length over amplitude [-]",
            0.0,
            float(np.abs(way - exact).max() * omega / 0.5),
            1e-4,
            "closed form of the reduced mass",
        ),
        check(
            "two masses on a spring, drift of their momentum [-]",
            0.0,
            float(np.abs(momentum / (MASS * 0.5) - 1.0).max()),
            2e-13,
            "conservation",
        ),
    ]


def _balances() -> list[Check]:
    ports = ["spring.end", "magnet.end", "latch.end", "guide.body", "weight.body", "pull.end"]
    run = run_parts(
        {
            "mass": component("rigid-mass", mass=MASS, speed=0.5),
            "spring": component("spring", stiffness=5e3, preload=20.0, damping=0.2),
            "magnet": component("force-over-time", time=(0.0, 1e-3, 3e-3), force=(0.0, 60.0, 5.0)),
            "latch": component(
                "force-over-stroke", stroke=(0.0, 20e-6, 70e-6), force=(-8.0, -3.0, 0.0)
            ),
            "guide": component("guide-friction", coulomb=0.3, breakaway=0.5, viscous=0.1),
            "weight": Gravity(),
            "pull": component("constant-force", force=-2.0),
        },
        [["mass.body", *ports]],
        4e-3,
    )
    return [
        check(
            "all of them at one mass, energy residual over throughput [-]",
            0.0,
            run.books.relative_residual,
            2e-13,
            "energy balance: every element balances to round-off",
        )
    ]
