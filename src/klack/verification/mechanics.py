"""Mechanical components in the time loop: closed solutions of one and two masses."""

from collections.abc import Mapping, Sequence
from functools import partial
from math import exp, log, sqrt
from typing import Literal
from warnings import catch_warnings, simplefilter

import numpy as np
from numpy.typing import NDArray

from klack.mechanics.force import ConstantForce, ForceOverTime
from klack.mechanics.force_over_stroke import ForceOverStroke
from klack.mechanics.friction import GuideFriction
from klack.mechanics.gravity import STANDARD_GRAVITY, Gravity
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.checks import LooseBodyWarning
from klack.network.component import Component
from klack.network.network import Network
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.verification.check import Check, ComparedCurve, compare

__all__ = ["checks", "run_parts"]

GROUP = "mechanics"
MASS = 3e-3  # [kg]
NEWTON = "Newton's second law, closed form"

_check = partial(compare, GROUP)


def checks() -> list[Check]:
    """Motion under each component against its closed solution, and the energy balance."""
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
    with catch_warnings():  # most of these bodies fly freely, on purpose
        simplefilter("ignore", LooseBodyWarning)
        rows = Network(parts, connections).rows()
    return simulate_network(
        rows, duration=duration, step=step, coarse=1, record=10 * step, start=start
    )


def _alone(
    part: Component, *, speed: float, duration: float, step: float = 100e-9
) -> NetworkResult:
    """Run a mass of 3 g with one component at it."""
    port = next(iter(part.port_kinds()))
    parts = {"mass": RigidMass(mass=MASS, speed=speed), "part": part}
    return run_parts(parts, [["mass.body", f"part.{port}"]], duration, step)


def _place(result: NetworkResult) -> NDArray[np.float64]:
    return result.channels["mass.body displacement"].values


def _speed(result: NetworkResult) -> NDArray[np.float64]:
    return result.channels["mass velocity"].values


def _falls() -> list[Check]:
    fall = _alone(Gravity(), speed=0.1, duration=10e-3)
    t = fall.time[-1]
    drop = 0.1 * t - 0.5 * STANDARD_GRAVITY * t**2
    pulled = _alone(ConstantForce(force=40.0), speed=0.0, duration=1e-3)
    work = 0.5 * 40.0**2 / MASS * pulled.time[-1] ** 2
    return [
        # 30 000 to 500 000 additions, each to round-off
        _check("thrown mass, height after 10 ms [m]", drop, float(_place(fall)[-1]), 1e-11, NEWTON),
        _check(
            "mass pulled by 40 N, supplied work after 1 ms [J]",
            work,
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
        run = _alone(Spring(stiffness=k, preload=0.0), speed=v, duration=1e-3, step=step)
        exact = v / omega * np.sin(omega * run.time)
        errors.append(float(np.abs(_place(run) - exact).max() / (v / omega)))
    motion = ComparedCurve(
        x_label="time [ms]",
        y_label="displacement [um]",
        expected=(run.time * 1e3, exact * 1e6),
        computed=(run.time * 1e3, _place(run) * 1e6),
    )
    damped = _alone(Spring(stiffness=k, preload=0.0, damping=2.0), speed=v, duration=2e-3)
    zeta = 2.0 / (2.0 * sqrt(k * MASS))
    shifted = omega * sqrt(1.0 - zeta**2)
    envelope = v / shifted * np.exp(-zeta * omega * damped.time) * np.sin(shifted * damped.time)
    share = float(np.abs(_place(damped) - envelope).max() * omega / v)
    return [
        _check(
            "mass on a spring, order of its error in the step [-]",
            2.0,
            log(errors[0] / errors[1]) / log(2.0),
            1e-3,
            "discrete gradient: second order",
        ),
        _check(
            "mass on a spring, error over amplitude after 6.5 periods at 200 ns [-]",
            (omega * 200e-9) ** 2 / 12.0 * omega * 1e-3,
            errors[1],
            1e-3,
            "phase error (omega h)^2/12 of the implicit midpoint rule",
            motion,
        ),
        _check("the same, damped by 0.8 %: error over amplitude [-]", 0.0, share, 2e-4, NEWTON),
    ]


def _rubs() -> list[Check]:
    v, b = 0.5, 0.5
    viscous = _alone(GuideFriction(coulomb=0.0, viscous=b), speed=v, duration=6e-3)
    slowed = v * exp(-b * viscous.time[-1] / MASS)
    dry = _alone(GuideFriction(coulomb=0.8), speed=v, duration=4e-3)
    way = MASS * v**2 / (2.0 * 0.8)
    lost = dry.books.losses["part loss"]
    parts = {
        "mass": RigidMass(mass=MASS, speed=0.1),
        "pull": ForceOverTime(time=(1e-3, 2e-3), force=(0.0, 0.4999)),
        "guide": GuideFriction(coulomb=0.3, breakaway=0.5),
    }
    stopped = run_parts(parts, [["mass.body", "pull.end", "guide.body"]], 6e-3)
    held = _place(stopped)[stopped.time > 1e-3]
    return [
        _check(
            "viscous friction, speed after 6 ms [m/s]", slowed, _speed(viscous)[-1], 1e-9, NEWTON
        ),
        _check("dry friction, way to rest [m]", way, float(_place(dry)[-1]), 1e-11, NEWTON),
        _check("dry friction, loss [J]", 0.5 * MASS * v**2, lost, 5e-12, "all of it"),
        _check(
            "creep under 0.9998 of the breakaway friction in 4 ms [m]",
            0.0,
            float(np.ptp(held)),
            1e-15,
            "Coulomb: none",
        ),
    ]


def _pushed() -> list[Check]:
    pulse = ForceOverTime(time=(1e-4, 2.03e-4, 4e-4), force=(0.0, 60.0, 0.0))
    hit = _alone(pulse, speed=-0.2, duration=5e-4)
    after = -0.2 + 0.5 * 60.0 * 3e-4 / MASS
    latch = ForceOverStroke(stroke=(0.0, 20e-6, 70e-6), force=(0.0, -30.0, 0.0))
    escape = _alone(latch, speed=1.0, duration=2e-4)
    held = 2.0 / MASS * 0.5 * 30.0 * 70e-6
    return [
        _check("triangular pulse, speed after it [m/s]", after, _speed(hit)[-1], 1e-12, NEWTON),
        _check(
            "over the hill of a tabulated force, speed behind it [m/s]",
            sqrt(1.0 - held),
            _speed(escape)[-1],
            2e-13,
            "energy: area of a triangle",
        ),
    ]


def _two_bodies() -> list[Check]:
    parts = {
        "mass": RigidMass(mass=MASS, speed=0.5),
        "housing": RigidMass(mass=0.1),
        "spring": Spring(stiffness=5e6, preload=0.0),
    }
    connections = [["mass.body", "spring.end"], ["housing.body", "spring.base"]]
    run = run_parts(parts, connections, 1e-3)
    reduced = MASS * 0.1 / (MASS + 0.1)
    omega = sqrt(5e6 / reduced)
    exact = 0.5 / omega * np.sin(omega * run.time)
    way = _place(run) - run.channels["housing.body displacement"].values
    momentum = MASS * _speed(run) + 0.1 * run.channels["housing velocity"].values
    return [
        _check(
            "two masses on a spring, error of the length over amplitude [-]",
            0.0,
            float(np.abs(way - exact).max() * omega / 0.5),
            1e-4,
            "closed form of the reduced mass",
        ),
        _check(
            "two masses on a spring, drift of their momentum [-]",
            0.0,
            float(np.abs(momentum / (MASS * 0.5) - 1.0).max()),
            2e-13,
            "conservation",
        ),
    ]


def _balances() -> list[Check]:
    parts = {
        "mass": RigidMass(mass=MASS, speed=0.5),
        "spring": Spring(stiffness=5e3, preload=20.0, damping=0.2),
        "magnet": ForceOverTime(time=(0.0, 1e-3, 3e-3), force=(0.0, 60.0, 5.0)),
        "latch": ForceOverStroke(stroke=(0.0, 20e-6, 70e-6), force=(-8.0, -3.0, 0.0)),
        "guide": GuideFriction(coulomb=0.3, breakaway=0.5, viscous=0.1),
        "weight": Gravity(),
        "pull": ConstantForce(force=-2.0),
    }
    ports = ["spring.end", "magnet.end", "latch.end", "guide.body", "weight.body", "pull.end"]
    run = run_parts(parts, [["mass.body", *ports]], 4e-3)
    books = run.books
    return [
        _check(
            "all of them at one mass, energy residual over throughput [-]",
            0.0,
            books.relative_residual,
            2e-13,
            "energy balance: every element balances to round-off",
        )
    ]
