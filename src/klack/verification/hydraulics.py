"""Restrictions, chambers and faces: limits, geometry, and small valves run over time."""

from collections.abc import Iterator, Sequence
from itertools import pairwise
from math import cos, hypot, log, pi, sin, sqrt
from typing import Any

import numpy as np
from scipy.integrate import quad

from klack.hydraulics.annulus import Annulus, eccentricity_factor
from klack.hydraulics.flow_force import FlowForce
from klack.hydraulics.land_face import land_areas
from klack.hydraulics.orifice import Orifice, orifice_flow
from klack.hydraulics.seat import Seat, ball_opening, cone_opening, gap_flow, seat_step
from klack.network.step_function import evaluate
from klack.simulation.network_result import NetworkResult
from klack.verification.benches import (
    AMBIENT,
    HEPTANE,
    MU_HEPTANE,
    RHO_HEPTANE,
    component,
    crossings,
    run_network,
)
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.off_axis_gaps import off_axis_seats

__all__ = ["checks"]

BULK = float(HEPTANE.bulk_modulus(AMBIENT.pressure))
RADIUS, LIFT, ANGLE = 0.75e-3, 60e-6, 0.8  # of the seats: [m], [m], [rad]


def checks() -> list[Check]:
    """Return the checks."""
    return [
        *_orifice(),
        *_gap(),
        *_seats(),
        *off_axis_seats(),
        _jet(),
        *_annulus(),
        _land(),
        *_spring_of_fluid(),
        _emptying(),
        _resonator(),
    ]


def _orifice() -> list[Check]:
    size, drop = 0.5e-3, 5e5
    area = pi / 4 * size**2

    def flow(p_a: float, p_b: float, **numbers: Any) -> tuple[float, float, float]:
        part = Orifice(diameter=size, **numbers)
        return orifice_flow(
            p_a,
            p_b,
            RHO_HEPTANE,
            RHO_HEPTANE,
            *part.parameters(MU_HEPTANE, HEPTANE.vapour_pressure),
        )

    head = 6e5 - HEPTANE.vapour_pressure
    return [
        check(
            "orifice at 5 bar, mass flow [kg/s]",
            expected=0.7 * area * sqrt(2 * RHO_HEPTANE * drop),
            computed=flow(6e5, 1e5, cavitation=None)[0],
            tolerance=5e-14,
            source="Merritt 1967, sec. 3-3: C_q A sqrt(2 rho dp)",
        ),
        check(
            "orifice at rest, slope of the mass flow [kg/(s Pa)]",
            expected=RHO_HEPTANE * 4 * 0.7 * area * size / (1000 * MU_HEPTANE),
            computed=flow(1e5, 1e5)[1],
            tolerance=5e-14,
            source="4 C_q A D/(lambda_c mu)",
        ),
        check(
            "thin hole at 1e-9 Pa, volume flow [m^3/s]",
            expected=size**3 * 1e-9 / (24 * MU_HEPTANE),
            computed=flow(1e-9, 0.0, critical_flow_number=24 * pi * 0.7, cavitation=None)[0]
            / RHO_HEPTANE,
            tolerance=5e-8,
            source="Sampson 1891: D^3 dp/(24 mu), with lambda_c = 24 pi C_q = 52.8",
        ),
        check(
            "cavitating orifice at 6 bar, mass flow [kg/s]",
            expected=0.6 * area * sqrt(2 * RHO_HEPTANE * head),
            computed=flow(6e5, 1e3, cavitation=0.6)[0],
            tolerance=5e-14,
            source="Nurick 1976: C_c A sqrt(2 rho (p - p_v))",
        ),
    ]


def _gap() -> list[Check]:
    worst = 0.0
    for a in (1e9, 1e12, 1e16):
        for b in (1e12, 1e17, 1e20):
            for drop in (-5e5, 1e-3, 1.0, 5e5, 1e8):
                Q, _ = gap_flow(drop, a, b)
                worst = max(worst, abs((a * Q + b * Q * abs(Q)) / drop - 1.0))
    return [
        check(
            "gap and edge in series, pressure drop of the flow it gives [-]",
            expected=0.0,
            computed=worst,
            tolerance=5e-14,
            source="inverse of a Q + b Q|Q|, 45 cases over 8 decades",
        ),
        check(
            "gap alone, flow at 0.1 mPa [m^3/s]",
            expected=1e-16,
            computed=gap_flow(1e-4, 1e12, 1e17)[0],
            tolerance=5e-10,
            source="dp/a",
        ),
        check(
            "edge alone, flow at 5 bar [m^3/s]",
            expected=sqrt(5e5 / 1e17),
            computed=gap_flow(5e5, 1e3, 1e17)[0],
            tolerance=1e-7,
            source="sqrt(dp/b)",
        ),
    ]


def _mantle(foot: Sequence[float]) -> float:
    """Area of the cone mantle between the edge of the seat and a foot (radius, height)."""
    return pi * (RADIUS + foot[0]) * hypot(RADIUS - foot[0], foot[1])


def _seats() -> list[Check]:
    R = 1e-3
    x0 = sqrt(R**2 - RADIUS**2)

    def cone_foot(lift: float) -> tuple[float, float]:
        along = lift * cos(ANGLE)  # from the raised cone's point over the edge to the foot
        return (RADIUS - along * sin(ANGLE), lift - along * cos(ANGLE))

    def ball_foot(lift: float) -> tuple[float, float]:
        far = hypot(RADIUS, x0 + lift)
        return (R * RADIUS / far, (x0 + lift) * (1 - R / far))

    width, low = 0.2e-3, 0.3e-6
    land = Seat(
        shape="flat", diameter=2 * RADIUS, land_width=width, critical_flow_number=1e-3
    ).parameters(MU_HEPTANE, HEPTANE.vapour_pressure)
    viscous = evaluate(
        seat_step,
        land,
        [0.0] * 5,
        [0.0, 1e-8, 1e5 + 1.0, 1e5, RHO_HEPTANE, RHO_HEPTANE, low, low, 0.0, 0.0],
        10,
    )[1][0]
    geometry = "mantle between the edge and its foot on the other surface"
    lifts = np.linspace(2e-6, 150e-6, 75)
    cone, ball = (
        ComparedCurve(
            x_label="lift [um]",
            y_label="area [mm^2]",
            expected=(lifts * 1e6, np.array([_mantle(foot_at(y)) for y in lifts]) * 1e6),
            computed=(lifts * 1e6, np.array([area_at(y) for y in lifts]) * 1e6),
        )
        for foot_at, area_at in (
            (cone_foot, lambda y: cone_opening(y, RADIUS, sin(ANGLE), cos(ANGLE))[0]),
            (ball_foot, lambda y: ball_opening(y, RADIUS, R, x0)[0]),
        )
    )
    return [
        check(
            "cone, 60 um open, area [m^2]",
            expected=_mantle(cone_foot(LIFT)),
            computed=cone_opening(LIFT, RADIUS, sin(ANGLE), cos(ANGLE))[0],
            tolerance=5e-14,
            source=geometry,
            curve=cone,
        ),
        check(
            "ball, 60 um open, area [m^2]",
            expected=_mantle(ball_foot(LIFT)),
            computed=ball_opening(LIFT, RADIUS, R, x0)[0],
            tolerance=1e-13,
            source=geometry,
            curve=ball,
        ),
        check(
            "land of 0.2 mm, 0.3 um open, mass flow at 1 Pa [kg/s]",
            expected=RHO_HEPTANE * pi * 2 * RADIUS * low**3 / (12 * MU_HEPTANE * width),
            computed=float(viscous),
            tolerance=1e-6,
            source="plane slot, pi d h^3 dp/(12 mu w)",
        ),
    ]


def _jet() -> Check:
    seat = Seat(
        shape="cone",
        diameter=2 * RADIUS,
        half_angle=ANGLE,
        cavitation=None,
        critical_flow_number=1e-3,
        flow_force=FlowForce(velocity_coefficient=0.98),
    )
    _, out = evaluate(
        seat_step,
        seat.parameters(MU_HEPTANE, 0.0),
        [0.0] * 5,
        [0.0, 1e-8, 6e5, 1e5, RHO_HEPTANE, RHO_HEPTANE, LIFT, LIFT, 0.0, 0.0],
        10,
    )
    return check(
        "force of the jet at 5 bar [N]",
        expected=-2 * 0.7 * 0.98 * float(out[6]) * 5e5 * cos(ANGLE),
        computed=float(out[3]),
        tolerance=1e-6,
        source="Merritt 1967, ch. 5: 2 C_q C_v A dp cos(theta), closing",
    )


def _annulus() -> Iterator[Check]:
    d, length, c, eps = 4e-3, 10e-3, 5e-6, 0.5
    shear = quad(lambda t: 1 / (1 + eps * cos(t)), 0, 2 * pi)[0] / (2 * pi)
    guide = Annulus(diameter=d, length=length, clearance=c, eccentricity=eps)
    yield from [
        check(
            f"annulus of eccentricity {eccentricity:g}, leak over the concentric one [-]",
            expected=factor,
            computed=eccentricity_factor(eccentricity),
            tolerance=5e-14,
            source="Blackburn, Reethof & Shearer 1960: 1 + 1.5 eps^2",
        )
        for eccentricity, factor in ((0.0, 1.0), (0.5, 1.375), (1.0, 2.5))
    ]
    yield check(
        "eccentric annulus, leak per pressure [m^3/(s Pa)]",
        expected=pi * d * c**3 / (12 * MU_HEPTANE * length) * 1.375,
        computed=guide.conductance(MU_HEPTANE),
        tolerance=5e-14,
        source="plane slot around the circumference",
    )
    yield check(
        "eccentric annulus, drag per speed [N s/m]",
        expected=MU_HEPTANE * pi * d * length / c * shear,
        computed=guide.drag(MU_HEPTANE),
        tolerance=5e-14,
        source="quadrature of the shear around the circumference",
    )


def _land() -> Check:
    r1, r2, p1, p2 = 0.5e-3, 0.75e-3, 6e5, 1e5
    inside, outside = land_areas(r1, r2)

    def ring(r: float) -> float:
        return 2 * pi * r * (p1 + (p2 - p1) * log(r / r1) / log(r2 / r1))

    return check(
        "land between 6 and 1 bar, force [N]",
        expected=quad(ring, r1, r2, epsabs=0.0)[0],
        computed=inside * p1 + outside * p2,
        tolerance=5e-14,
        source="quadrature of the logarithmic pressure (Reynolds 1886)",
    )


def _spring_of_fluid() -> list[Check]:
    area, volume, mass = 1e-5, 1e-7, 3e-3
    omega = sqrt(BULK * area**2 / (volume * mass))

    def run(speed: float, step: float, turns: float) -> NetworkResult:
        return run_network(
            {
                "needle": component("rigid-mass", mass=mass, speed=speed),
                "face": component("pressure-face", direction="opening", area=area),
                "room": component("chamber", volume=volume),
            },
            [["needle.body", "face.body"], ["face.fluid", "room.fluid"]],
            fluid=HEPTANE,
            duration=turns * 2 * pi / omega,
            step=step,
            record=step,
        )

    wh = 5e-3
    still = run(1e-4, wh / omega, 5)
    y, t = still.channels["needle.body displacement"].values, still.time
    rising = np.flatnonzero((y[:-1] < 0) & (y[1:] >= 0))
    cross = crossings(t, y)
    peaks = [np.abs(y[i:j]).max() for i, j in pairwise(rising)]
    p = still.channels["room pressure"].values
    hard = run(-1.0, 0.01 / omega, 0.45)
    y_hard = hard.channels["needle.body displacement"].values
    mass_held = (volume + area * y_hard) * HEPTANE.density(hard.channels["room pressure"].values)
    return [
        check(
            "needle on a chamber, angular frequency [rad/s]",
            expected=omega,
            computed=float(2 * pi * (len(cross) - 1) / (cross[-1] - cross[0])),
            tolerance=1e-5,
            source="sqrt(K A^2/(V m)), omega h = 5e-3; a scheme of second order",
        ),
        check(
            "needle on a chamber, numerical damping ratio [-]",
            expected=0.01 * wh / 2,
            computed=log(peaks[0] / peaks[-1]) / (2 * pi * (len(peaks) - 1)),
            tolerance=2e-3,
            source="0.51 of the end in the pressure that acts: 0.01 omega h/2, counted as loss",
        ),
        check(
            "small compression, pressure over K dV/V [-]",
            expected=1.0,
            computed=float((p.max() - p[0]) / (-BULK * area * y.min() / volume)),
            tolerance=1e-4,
            source="definition of the bulk modulus; its rise with pressure",
        ),
        check(
            "needle at 1 m/s into a chamber, mass of its fluid, largest drift [-]",
            expected=0.0,
            computed=float(np.abs(mass_held / mass_held[0] - 1.0).max()),
            tolerance=2e-10,
            source="conservation: V rho(p) = m; square of the last Newton step",
        ),
        check(
            "needle at 1 m/s into a chamber, energy residual [-]",
            expected=0.0,
            computed=hard.books.relative_residual,
            tolerance=1e-9,
            source="conservation: kinetic energy, pressure energy, loss",
        ),
    ]


def _emptying() -> Check:
    size, volume = 20e-6, 1e-9
    area = pi / 4 * size**2
    slope = 4 * 0.7 * area * size / (1e6 * MU_HEPTANE)  # laminar far beyond this drop
    tau = volume / (BULK * slope)
    result = run_network(
        {
            "room": component("chamber", volume=volume, pressure=AMBIENT.pressure + 1e3),
            "hole": Orifice(diameter=size, critical_flow_number=1e6),
        },
        [["room.fluid", "hole.a"], ["hole.b", "ambient"]],
        still=True,
        fluid=HEPTANE,
        duration=tau,
        step=1e-4 * tau,
        record=1e-4 * tau,
    )
    p = result.channels["room pressure"].values - AMBIENT.pressure
    k = int(np.argmin(np.abs(result.time - tau)))
    return check(
        "chamber that empties through a laminar hole, pressure at tau [Pa]",
        expected=1e3 * float(np.exp(-result.time[k] / tau)),
        computed=float(p[k]),
        tolerance=2e-4,
        source="exp(-t/tau), tau = V/(K dQ/dp); implicit Euler: h/(2 tau) = 5e-5",
        curve=ComparedCurve(
            x_label="time over tau [-]",
            y_label="pressure above ambient [Pa]",
            expected=(result.time / tau, 1e3 * np.exp(-result.time / tau)),
            computed=(result.time / tau, p),
        ),
    )


def _resonator() -> Check:
    length, size, volume = 5e-3, 1e-3, 50e-9
    area = pi / 4 * size**2
    omega = sqrt(BULK * area / (RHO_HEPTANE * length * volume))
    result = run_network(
        {
            "tank": component("pressure-source", pressure=AMBIENT.pressure),
            "neck": component("inertance", length=length, diameter=size, friction="none"),
            "room": component("chamber", volume=volume, pressure=AMBIENT.pressure + 1e3),
        },
        [["tank.fluid", "neck.a"], ["neck.b", "room.fluid"]],
        still=True,
        fluid=HEPTANE,
        duration=5 * 2 * pi / omega,
        step=5e-3 / omega,
        record=5e-3 / omega,
    )
    cross = crossings(result.time, result.channels["neck mass flow"].values)
    return check(
        "chamber with a neck, angular frequency [rad/s]",
        expected=omega,
        computed=float(2 * pi * (len(cross) - 1) / (cross[-1] - cross[0])),
        tolerance=1e-5,
        source="Helmholtz: sqrt(K A/(rho l V)), omega h = 5e-3",
    )
