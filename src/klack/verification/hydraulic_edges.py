"""Spool edges, fittings, elastic walls and junctions of lines against closed formulas."""

from functools import partial
from itertools import pairwise
from math import cos, log10, pi, radians, sqrt

import numpy as np

from klack.hydraulics.chamber import Chamber
from klack.hydraulics.flow_force import FlowForce
from klack.hydraulics.line import Line
from klack.hydraulics.pipe_friction import PipeFriction
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_loss import PressureLoss
from klack.hydraulics.pressure_source import PressureSource, PressureStep
from klack.hydraulics.spool_edge import SpoolEdge
from klack.hydraulics.wall_compliance import Wall, tube_compliance
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.simulation.network_run import simulate_network
from klack.verification.branch_step import branch_of, branch_step
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.supply_networks import OIL

__all__ = ["edges"]

AMBIENT = Ambient()
RHO = float(OIL.density(AMBIENT.pressure))
MU = float(OIL.viscosity(AMBIENT.pressure))
BAR = 1e5

_check = partial(compare, "hydraulic-parts")


def edges() -> list[Check]:
    """Spool edge, pressure loss, friction of a pipe, walls, junction."""
    return [*_spool(), *_loss(), *_pipe(), *_walls(), *_swing(), *_junction()]


def _spool() -> list[Check]:
    d, c, lap = 6e-3, 4e-6, 0.2e-3
    part = SpoolEdge(
        diameter=d,
        radial_clearance=c,
        overlap=lap,
        direction="opening",
        cavitation=None,
        critical_flow_number=1e-8,
        flow_force=FlowForce(velocity_coefficient=0.98),
    )
    row = branch_of(part)

    def at(opening: float, p_a: float = 50e5, p_b: float = 20e5) -> np.ndarray:
        y = opening + lap
        return branch_step(row, p_a, p_b, ports=(y, y, 0.0, 0.0))

    def area(opening: float) -> float:
        return pi * d * sqrt(opening**2 + c**2)

    openings = np.linspace(-20e-6, 30e-6, 101)
    slot = 12 * MU / (pi * d * c**3)

    def series(x: float) -> float:
        """Root of the quadratic for an edge and a slot in series [l/min]."""
        a, b = slot * max(-x, 0.0), RHO / (2 * (0.7 * area(max(x, 0.0))) ** 2)
        return float(np.roots([b, a, -30e5]).max()) * 6e4

    curve = ComparedCurve(
        x_label="opening [um]",
        y_label="flow [l/min]",
        expected=(openings * 1e6, np.array([series(x) for x in openings])),
        computed=(openings * 1e6, np.array([at(x)[0] / RHO * 6e4 for x in openings])),
    )
    far, wide = at(-lap), at(0.2e-3, 60e5, 10e5)
    return [
        _check(
            "spool edge 3 um open, clearance 4 um, area [m^2]",
            pi * d * 5e-6,
            float(at(3e-6)[6]),
            1e-12,
            "Merritt 1967, sec. 5-6: w sqrt(x^2 + c^2), 3-4-5",
            curve,
            reason="the opening is a difference of positions of 0.2 mm",
        ),
        _check(
            "spool edge 10 um closed, flow [m^3/s]",
            series(-10e-6) / 6e4,
            float(at(-10e-6)[0]) / RHO,
            2e-9,
            "roots of a Q + b Q^2: slot and edge in series",
            curve,
        ),
        _check(
            "spool edge 0.2 mm closed, leakage per pressure [m^3/(s Pa)]",
            pi * d * c**3 / (12 * MU * lap),
            float(far[0]) / RHO / 30e5,
            1e-3,
            "Blackburn, Reethof & Shearer 1960: pi d c^3/(12 mu L)",
        ),
        _check(
            "spool edge 0.2 mm open, 50 bar, force of the jet [N]",
            -2 * 0.7 * 0.98 * area(0.2e-3) * 50e5 * cos(radians(69.0)) * 200 / sqrt(200**2 + 4**2),
            float(wide[3]),
            2e-10,
            "Merritt 1967, ch. 5: 2 C_q C_v A dp cos(69 deg), closing",
        ),
    ]


def _loss() -> list[Check]:
    bore, area = 10e-3, pi / 4 * 1e-4
    elbow = branch_of(PressureLoss(diameter=bore, coefficient=0.25, laminar_coefficient=800.0))

    def known(drop: float) -> float:
        """Flow by bisection of the loss of Hooper [m^3/s]."""
        low, high = 0.0, sqrt(2 * drop / (0.25 * RHO))
        for _ in range(200):
            v = 0.5 * (low + high)
            zeta = 800 * MU / (RHO * v * bore) + 0.25
            low, high = (v, high) if zeta * RHO / 2 * v * v < drop else (low, v)
        return v * area

    small, large = pi / 4 * (5e-3) ** 2, pi / 4 * (8e-3) ** 2
    step_up = PressureLoss(area=small, coefficient=(1 - small / large) ** 2)
    free = branch_of(step_up.model_copy(update={"laminar_coefficient": 1e-9}))
    v1 = float(branch_step(free, 3e5, 1e5)[0]) / RHO / small
    drops = np.geomspace(1.0, 1e6, 61)
    curve = ComparedCurve(
        x_label="pressure drop [Pa]",
        y_label="flow [l/min]",
        expected=(drops, np.array([known(x) for x in drops]) * 6e4),
        computed=(
            drops,
            np.array([branch_step(elbow, 5e6 + x, 5e6)[0] for x in drops]) / RHO * 6e4,
        ),
        x_log=True,
        y_log=True,
    )
    return [
        _check(
            f"elbow of 90 degrees at {drop:g} Pa, flow [m^3/s]",
            known(drop),
            float(branch_step(elbow, drop, 0.0)[0]) / RHO,
            5e-14,
            "Hooper 1981: K = 800/Re + 0.25, by bisection",
            curve,
        )
        for drop in (10.0, 1e5)
    ] + [
        _check(
            "sudden expansion from 5 to 8 mm at 2 bar, loss of the momentum balance [Pa]",
            2e5,
            RHO / 2 * (v1 - v1 * small / large) ** 2,
            1e-12,
            "Borda and Carnot: rho/2 (v_1 - v_2)^2",
            reason="the laminar term is 1e-9, not zero",
        )
    ]


def _pipe() -> list[Check]:
    D, L = 10e-3, 2.0

    def friction_factor(reynolds: float, rough: float) -> float:
        """Colebrook's law by fixed-point iteration; laminar below 2300."""
        if reynolds < 2300:
            return 64 / reynolds
        f = 0.02
        for _ in range(100):
            f = (2 * log10(rough / 3.7 + 2.51 / (reynolds * sqrt(f)))) ** -2
        return f

    def drop(reynolds: float, rough: float) -> float:
        speed = reynolds * MU / (RHO * D)
        return friction_factor(reynolds, rough) * L / D * RHO / 2 * speed**2

    def found(reynolds: float, rough: float) -> float:
        row = branch_of(PipeFriction(length=L, diameter=D, roughness=rough * D))
        return float(branch_step(row, drop(reynolds, rough), 0.0)[3])

    low, high = np.geomspace(300, 2250, 15), np.geomspace(4050, 1e7, 40)
    numbers = np.concatenate((low, high))
    curve = ComparedCurve(
        x_label="Reynolds number [-]",
        y_label="pressure drop [Pa]",
        expected=(numbers, np.array([drop(x, 1e-3) for x in numbers])),
        computed=(
            np.array([found(x, 1e-3) for x in numbers]),
            np.array([drop(x, 1e-3) for x in numbers]),
        ),
        x_log=True,
        y_log=True,
    )
    out = [
        _check(
            f"pipe at the pressure drop of Re = {reynolds:.0f}, roughness {rough:g} D, Reynolds "
            "number [-]",
            reynolds,
            found(reynolds, rough),
            4e-14,
            source,
            curve,
        )
        for reynolds, rough, source in (
            (1000.0, 0.0, "Hagen-Poiseuille: f = 64/Re"),
            (1e5, 0.0, "Colebrook 1939, by iteration"),
            (1e6, 1e-3, "Colebrook 1939, by iteration"),
        )
    ]
    for reynolds, rough, moody in ((1e5, 0.0, 0.0180), (1e6, 1e-3, 0.0199)):
        speed = reynolds * MU / (RHO * D)
        row = branch_of(PipeFriction(length=L, diameter=D, roughness=rough * D))
        pressure = moody * L / D * RHO / 2 * speed**2
        out.append(
            _check(
                f"pipe at f = {moody:g} of the Moody diagram, roughness {rough:g} D, Reynolds "
                "number [-]",
                reynolds,
                float(branch_step(row, pressure, 0.0)[3]),
                5e-3,
                "Moody 1944: read to three digits",
            )
        )
    return out


def _walls() -> list[Check]:
    D, s, E, nu = 10e-3, 2e-3, 210e9, 0.3
    out = []
    for ends, c in (("closed", 1 - nu / 2), ("fixed", 1 - nu**2), ("sliding", 1.0)):
        thick = 2 * s / D * (1 + nu) + D / (D + s) * c
        area = Wall(diameter=D, thickness=s, modulus=E, poisson=nu, ends=ends).area_compliance  # type: ignore[arg-type]
        out.append(
            _check(
                f"tube of 2 mm about a bore of 10 mm, ends {ends}, growth of its area times "
                "E s/D [-]",
                thick,
                area * E * s / D,
                5e-14,
                "Wylie & Streeter 1993, ch. 1: 2 s/D (1 + nu) + D c/(D + s)",
            )
        )
    thin = sum(tube_compliance(D, 1e-8, E, nu, "closed"))
    out.append(
        _check(
            "thin closed tube, growth of its volume times E s/D [-]",
            1.25 - nu,
            thin * E * 1e-8 / D,
            1e-5,
            "membrane: 5/4 - nu",
        )
    )
    hose = Line(length=1.0, diameter=D, pressure=50e5, wall=Wall(bulk_modulus=6e8))
    K, rho = float(OIL.bulk_modulus(50e5)), float(OIL.density(50e5))
    out.append(
        _check(
            "hose of 0.6 GPa, wave speed [m/s]",
            sqrt(1 / (1 / K + 1 / 6e8) / rho),
            hose.wave_speed(OIL),
            5e-14,
            "1/K_eff = 1/K + 1/K_wall",
        )
    )
    return out


def _swing() -> list[Check]:
    """A needle on fluid and wall: a quarter of a period."""
    area, volume, mass, wall = 1e-5, 1e-7, 3e-3, 2e9
    bulk = 1 / (1 / float(OIL.bulk_modulus(AMBIENT.pressure)) + 1 / wall)
    omega, wh = sqrt(bulk * area**2 / (volume * mass)), 5e-3
    network = Network(
        {
            "needle": RigidMass(mass=mass, speed=1e-3),
            "face": PressureFace(direction="opening", area=area),
            "room": Chamber(volume=volume, pressure=AMBIENT.pressure, wall=Wall(bulk_modulus=wall)),
        },
        [["needle.body", "face.body"], ["face.fluid", "room.fluid"]],
        AMBIENT,
        OIL,
    )
    result = simulate_network(
        network.rows(),
        duration=5 * 2 * pi / omega,
        step=wh / omega,
        coarse=1,
        record=wh / omega,
        start="free",
    )
    y, t = result.channels["needle.body displacement"].values, result.time
    rising = np.flatnonzero((y[:-1] < 0) & (y[1:] >= 0))
    cross = t[rising] - y[rising] * np.diff(t)[rising] / np.diff(y)[rising]
    peaks = [np.abs(y[i:j]).max() for i, j in pairwise(rising)]
    damping = np.log(peaks[0] / peaks[-1]) / (2 * pi * (len(peaks) - 1))
    share = bulk / wall
    return [
        _check(
            "needle on a chamber with a wall of 2 GPa, angular frequency [rad/s]",
            omega,
            float(2 * pi * (len(cross) - 1) / (cross[-1] - cross[0])),
            1e-4,
            "sqrt(K_eff A^2/(V m)), omega h = 5e-3",
        ),
        _check(
            "needle on a chamber with a wall of 2 GPa, numerical damping ratio [-]",
            0.01 * wh / 2 + share * wh / 4,
            float(damping),
            0.05,
            "omega h/4 times the share of the wall, counted as loss",
        ),
    ]


def _junction() -> list[Check]:
    """A step of pressure runs from one line into two others."""
    start, jump, bore = 50 * BAR, 1 * BAR, 4e-3
    line = Line(length=1.0, diameter=bore, pressure=start, friction="none")
    thick = Line(length=1.0, diameter=2 * bore, pressure=start, friction="none")
    delay = line.echo_time(OIL) / 2
    out = []
    for name, third, transmitted in (("equal", line, 2 / 3), ("larger", thick, 2 / (1 + 1 + 4))):
        parts: dict[str, Component] = {
            "needle": RigidMass(mass=1e-3),
            "spring": Spring(stiffness=1e4, preload=0.0),
            "first": line,
            "second": line,
            "third": third,
            "crossing": Chamber(volume=1e-9, pressure=start),
            "rail": PressureSource(
                pressure=start, step=PressureStep(to=start + jump, at=0.0, rise=1e-6)
            ),
            "end": PressureSource(pressure=start),
            "other": PressureSource(pressure=start),
        }
        joints = [
            ["needle.body", "spring.end"],
            ["rail.fluid", "first.a"],
            ["first.b", "crossing.fluid", "second.a", "third.a"],
            ["second.b", "end.fluid"],
            ["third.b", "other.fluid"],
        ]
        result = simulate_network(
            Network(parts, joints, AMBIENT, OIL).rows(),
            duration=2.0 * delay,
            step=1e-6,
            coarse=1,
            record=1e-6,
        )
        p = result.channels["crossing pressure"].values
        known = np.where(result.time > delay + 0.5e-6, transmitted * jump, 0.0)
        curve = ComparedCurve(
            x_label="time [ms]",
            y_label="rise of pressure [bar]",
            expected=(result.time * 1e3, known / BAR),
            computed=(result.time * 1e3, (p - start) / BAR),
        )
        k = int(np.argmin(np.abs(result.time - 1.8 * delay)))
        out.append(
            _check(
                f"junction of three lines, the third {name}: transmitted step of pressure [-]",
                transmitted,
                float((p[k] - start) / jump),
                1e-3,
                "Wylie & Streeter 1993: 2 (A_1/a_1)/sum(A/a)",
                curve,
            )
        )
    return out
