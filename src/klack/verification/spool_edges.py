"""Spool edges with notches, fittings, elastic walls and junctions against closed formulas."""

from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from math import atan, cos, inf, log10, pi, radians, sin, sqrt

import numpy as np
from scipy.integrate import quad, solve_ivp
from scipy.optimize import minimize_scalar

from klack.hydraulics.flow_force import FlowForce
from klack.hydraulics.notch import Notch, notch_opening
from klack.hydraulics.pressure_source import PressureSource, PressureStep
from klack.hydraulics.spool_edge import SpoolEdge
from klack.hydraulics.wall_compliance import Wall, tube_compliance
from klack.verification.benches import (
    AMBIENT,
    BAR,
    MU_OIL,
    OIL,
    RHO_OIL,
    branch_of,
    branch_step,
    component,
    crossings,
    run_network,
)
from klack.verification.check import Check, ComparedCurve, check

__all__ = ["edges", "notched_edges"]


def edges() -> list[Check]:
    """Return the checks."""
    return [*_spool(), *_loss(), *_pipe(), *_walls(), *_swing(), *_junction()]


def _spool() -> list[Check]:
    d, c, lap = 6e-3, 4e-6, 0.2e-3
    part = component(
        "spool-edge",
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
    slot = 12 * MU_OIL / (pi * d * c**3)

    def series(x: float) -> float:
        """Edge and slot in series, by a quadratic [l/min]."""
        a, b = slot * max(-x, 0.0), RHO_OIL / (2 * (0.7 * area(max(x, 0.0))) ** 2)
        return float(np.roots([b, a, -30e5]).max()) * 6e4

    curve = ComparedCurve(
        x_label="opening [um]",
        y_label="flow [l/min]",
        expected=(openings * 1e6, np.array([series(x) for x in openings])),
        computed=(openings * 1e6, np.array([at(x)[0] / RHO_OIL * 6e4 for x in openings])),
    )
    far, wide = at(-lap), at(0.2e-3, 60e5, 10e5)
    return [
        check(
            "spool edge 3 um open, clearance 4 um, area [m^2]",
            pi * d * 5e-6,
            float(at(3e-6)[6]),
            1e-12,
            "Merritt 1967, sec. 5-6: w sqrt(x^2 + c^2), 3-4-5",
            curve,
            reason="the opening is a difference of positions of 0.2 mm",
        ),
        check(
            "spool edge 10 um closed, flow [m^3/s]",
            series(-10e-6) / 6e4,
            float(at(-10e-6)[0]) / RHO_OIL,
            2e-9,
            "roots of a Q + b Q^2: slot and edge in series",
            curve,
        ),
        check(
            "spool edge 0.2 mm closed, leakage per pressure [m^3/(s Pa)]",
            pi * d * c**3 / (12 * MU_OIL * lap),
            float(far[0]) / RHO_OIL / 30e5,
            1e-3,
            "Blackburn, Reethof & Shearer 1960: pi d c^3/(12 mu L)",
        ),
        check(
            "spool edge 0.2 mm open, 50 bar, force of the jet [N]",
            -2 * 0.7 * 0.98 * area(0.2e-3) * 50e5 * cos(radians(69.0)) * 200 / sqrt(200**2 + 4**2),
            float(wide[3]),
            2e-10,
            "Merritt 1967, ch. 5: 2 C_q C_v A dp cos(69 deg), closing",
        ),
    ]


def _loss() -> list[Check]:
    bore, area = 10e-3, pi / 4 * 1e-4
    elbow = branch_of(
        component("pressure-loss", diameter=bore, coefficient=0.25, laminar_coefficient=800.0)
    )

    def known(drop: float) -> float:
        """Flow by bisection of the loss of Hooper [m^3/s]."""
        low, high = 0.0, sqrt(2 * drop / (0.25 * RHO_OIL))
        for _ in range(200):
            v = 0.5 * (low + high)
            zeta = 800 * MU_OIL / (RHO_OIL * v * bore) + 0.25
            low, high = (v, high) if zeta * RHO_OIL / 2 * v * v < drop else (low, v)
        return v * area

    small, large = pi / 4 * (5e-3) ** 2, pi / 4 * (8e-3) ** 2
    step_up = component("pressure-loss", area=small, coefficient=(1 - small / large) ** 2)
    v1 = (
        float(
            branch_step(
                branch_of(step_up.model_copy(update={"laminar_coefficient": 1e-9})), 3e5, 1e5
            )[0]
        )
        / RHO_OIL
        / small
    )
    drops = np.geomspace(1.0, 1e6, 61)
    curve = ComparedCurve(
        x_label="pressure drop [Pa]",
        y_label="flow [l/min]",
        expected=(drops, np.array([known(x) for x in drops]) * 6e4),
        computed=(
            drops,
            np.array([branch_step(elbow, 5e6 + x, 5e6)[0] for x in drops]) / RHO_OIL * 6e4,
        ),
        x_log=True,
        y_log=True,
    )
    return [
        check(
            f"elbow of 90 degrees at {drop:g} Pa, flow [m^3/s]",
            known(drop),
            float(branch_step(elbow, drop, 0.0)[0]) / RHO_OIL,
            5e-14,
            "Hooper 1981: K = 800/Re + 0.25, by bisection",
            curve,
        )
        for drop in (10.0, 1e5)
    ] + [
        check(
            "sudden expansion from 5 to 8 mm at 2 bar, loss of the momentum balance [Pa]",
            2e5,
            RHO_OIL / 2 * (v1 - v1 * small / large) ** 2,
            1e-12,
            "Borda and Carnot: rho/2 (v_1 - v_2)^2",
            reason="the laminar term is 1e-9, not zero",
        )
    ]


def _pipe() -> Iterator[Check]:
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
        speed = reynolds * MU_OIL / (RHO_OIL * D)
        return friction_factor(reynolds, rough) * L / D * RHO_OIL / 2 * speed**2

    def found(reynolds: float, rough: float) -> float:
        row = branch_of(component("pipe-friction", length=L, diameter=D, roughness=rough * D))
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
    yield from [
        check(
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
        speed = reynolds * MU_OIL / (RHO_OIL * D)
        row = branch_of(component("pipe-friction", length=L, diameter=D, roughness=rough * D))
        yield check(
            f"pipe at f = {moody:g} of the Moody diagram, roughness {rough:g} D, Reynolds "
            "number [-]",
            reynolds,
            float(branch_step(row, moody * L / D * RHO_OIL / 2 * speed**2, 0.0)[3]),
            5e-3,
            "Moody 1944: read to three digits",
        )


def _walls() -> Iterator[Check]:
    D, s, E, nu = 10e-3, 2e-3, 210e9, 0.3
    for ends, c in (("closed", 1 - nu / 2), ("fixed", 1 - nu**2), ("sliding", 1.0)):
        area = Wall(diameter=D, thickness=s, modulus=E, poisson=nu, ends=ends).area_compliance  # type: ignore[arg-type]
        yield check(
            f"tube of 2 mm about a bore of 10 mm, ends {ends}, growth of its area times E s/D [-]",
            2 * s / D * (1 + nu) + D / (D + s) * c,
            area * E * s / D,
            5e-14,
            "Wylie & Streeter 1993, ch. 1: 2 s/D (1 + nu) + D c/(D + s)",
        )
    thin = sum(tube_compliance(D, 1e-8, E, nu, "closed"))
    yield check(
        "thin closed tube, growth of its volume times E s/D [-]",
        1.25 - nu,
        thin * E * 1e-8 / D,
        1e-5,
        "membrane: 5/4 - nu",
    )
    hose = component("line", length=1.0, diameter=D, pressure=50e5, wall=Wall(bulk_modulus=6e8))
    K, rho = float(OIL.bulk_modulus(50e5)), float(OIL.density(50e5))
    yield check(
        "hose of 0.6 GPa, wave speed [m/s]",
        sqrt(1 / (1 / K + 1 / 6e8) / rho),
        hose.wave_speed(OIL),
        5e-14,
        "1/K_eff = 1/K + 1/K_wall",
    )


def _swing() -> list[Check]:
    """A needle on fluid and wall: a quarter of a period."""
    area, volume, mass, wall = 1e-5, 1e-7, 3e-3, 2e9
    bulk = 1 / (1 / float(OIL.bulk_modulus(AMBIENT.pressure)) + 1 / wall)
    omega, wh = sqrt(bulk * area**2 / (volume * mass)), 5e-3
    result = run_network(
        {
            "needle": component("rigid-mass", mass=mass, speed=1e-3),
            "face": component("pressure-face", direction="opening", area=area),
            "room": component(
                "chamber", volume=volume, pressure=AMBIENT.pressure, wall=Wall(bulk_modulus=wall)
            ),
        },
        [["needle.body", "face.body"], ["face.fluid", "room.fluid"]],
        fluid=OIL,
        duration=5 * 2 * pi / omega,
        step=wh / omega,
        record=wh / omega,
    )
    y, t = result.channels["needle.body displacement"].values, result.time
    rising = np.flatnonzero((y[:-1] < 0) & (y[1:] >= 0))
    cross = crossings(t, y)
    peaks = [np.abs(y[i:j]).max() for i, j in pairwise(rising)]
    share = bulk / wall
    return [
        check(
            "needle on a chamber with a wall of 2 GPa, angular frequency [rad/s]",
            omega,
            float(2 * pi * (len(cross) - 1) / (cross[-1] - cross[0])),
            1e-4,
            "sqrt(K_eff A^2/(V m)), omega h = 5e-3",
        ),
        check(
            "needle on a chamber with a wall of 2 GPa, numerical damping ratio [-]",
            0.01 * wh / 2 + share * wh / 4,
            float(np.log(peaks[0] / peaks[-1]) / (2 * pi * (len(peaks) - 1))),
            0.05,
            "omega h/4 times the share of the wall, counted as loss",
        ),
    ]


def _junction() -> Iterator[Check]:
    """A step of pressure runs from one line into two others."""
    start, jump, bore = 50 * BAR, 1 * BAR, 4e-3
    line = component("line", length=1.0, diameter=bore, pressure=start, friction="none")
    thick = component("line", length=1.0, diameter=2 * bore, pressure=start, friction="none")
    delay = line.echo_time(OIL) / 2
    for name, third, transmitted in (("equal", line, 2 / 3), ("larger", thick, 2 / (1 + 1 + 4))):
        result = run_network(
            {
                "first": line,
                "second": line,
                "third": third,
                "crossing": component("chamber", volume=1e-9, pressure=start),
                "rail": PressureSource(
                    pressure=start, step=PressureStep(to=start + jump, at=0.0, rise=1e-6)
                ),
                "end": PressureSource(pressure=start),
                "other": PressureSource(pressure=start),
            },
            [
                ["rail.fluid", "first.a"],
                ["first.b", "crossing.fluid", "second.a", "third.a"],
                ["second.b", "end.fluid"],
                ["third.b", "other.fluid"],
            ],
            still=True,
            fluid=OIL,
            duration=2.0 * delay,
            step=1e-6,
            record=1e-6,
            start="rest",
        )
        p = result.channels["crossing pressure"].values
        known = np.where(result.time > delay + 0.5e-6, transmitted * jump, 0.0)
        k = int(np.argmin(np.abs(result.time - 1.8 * delay)))
        yield check(
            f"junction of three lines, the third {name}: transmitted step of pressure [-]",
            transmitted,
            float((p[k] - start) / jump),
            1e-3,
            "Wylie & Streeter 1993: 2 (A_1/a_1)/sum(A/a)",
            ComparedCurve(
                x_label="time [ms]",
                y_label="rise of pressure [bar]",
                expected=(result.time * 1e3, known / BAR),
                computed=(result.time * 1e3, (p - start) / BAR),
            ),
        )


D, C, WIDTH, DEPTH, LENGTH = 8e-3, 4e-6, 1e-3, 0.4e-3, 0.9e-3
SOURCE = "elementary geometry: exit and throat, the smaller one, by quadrature of the outline"


def notched_edges() -> list[Check]:
    """Return the checks of notches."""
    return [*_areas(), *_limits(), *_laminar(), *_jet(), *_emptying()]


def _notch(shape: str, **changed: float) -> Notch:
    sizes: dict[str, float] = {"width": WIDTH, "length": LENGTH, "depth": DEPTH, **changed}
    if shape == "hole":
        sizes.pop("depth")
    return Notch(shape=shape, count=4, **sizes)  # type: ignore[arg-type]


def _area(notch: Notch, x: float) -> float:
    """Narrowest section of one notch without clearance, of klack [m^2]."""
    return float(notch_opening(np.array(notch.numbers), 0, x, C, C)[1])


def _outline(shape: str, xi: float, width: float = WIDTH, length: float = LENGTH) -> float:
    """Width of an outline at the distance ``xi`` from its tip [m]."""
    if shape == "rectangular":
        return width
    if shape == "triangular":
        return width * xi / length
    from_centre = 0.5 * width - xi
    if shape == "round" and from_centre < 0.0:
        return width
    return 2.0 * sqrt(max(0.25 * width * width - from_centre * from_centre, 0.0))


def _exit(shape: str, s: float, length: float) -> float:
    """Outline beyond the edge of the sleeve [m^2]; the root of a circle by its angle."""
    r = 0.5 * WIDTH
    if shape in ("round", "hole"):
        end = min(s, r if shape == "round" else WIDTH)
        root = quad(
            lambda a: 2.0 * (r * sin(a)) ** 2,
            0.0,
            np.arccos(1.0 - end / r),
            epsabs=0.0,
            epsrel=1e-13,
        )[0]
        return float(root) + (max(s - r, 0.0) * WIDTH if shape == "round" else 0.0)
    return float(quad(partial(_outline, shape, length=length), 0.0, s, epsabs=0.0, epsrel=1e-13)[0])


def _section(s: float, phi: float) -> float:
    """Plane section of the triangular notch through the edge, tilted by ``phi``."""
    slope = DEPTH / LENGTH
    reach = s * slope / (cos(phi) + slope * sin(phi))  # from the edge to the bottom

    def across(v: float) -> float:
        xi, depth = s - v * sin(phi), v * cos(phi)
        return WIDTH * (xi / LENGTH - depth / DEPTH)  # width of the V at that depth

    return float(quad(across, 0.0, reach, epsabs=0.0, epsrel=1e-12)[0])


def _strips(x: float) -> float:
    """Shortest distances from the edge to the bottom of a V, over its width."""

    def distance(q: float) -> float:
        depth, length = DEPTH * q, LENGTH * q
        found = minimize_scalar(
            lambda z: (x + length * z) ** 2 + (depth * (1.0 - z)) ** 2,
            bounds=(0.0, 1.0),
            method="bounded",
            options={"xatol": 1e-14},
        )
        return sqrt(min(float(found.fun), min(x * x + depth * depth, (x + length) ** 2)))

    kink = min(x * LENGTH / DEPTH**2, 1.0)
    parts = [(0.0, kink), (kink, 1.0)]
    return WIDTH * sum(float(quad(distance, *ends, epsrel=1e-10)[0]) for ends in parts)


def _areas() -> Iterator[Check]:
    for shape, x, length in (
        ("rectangular", -0.7e-3, LENGTH),
        ("rectangular", -0.1e-3, LENGTH),
        ("round", -0.75e-3, LENGTH),
        ("round", -0.2e-3, LENGTH),
        ("hole", -0.5e-3, 1.2e-3),
        ("hole", 0.3e-3, 1.2e-3),
    ):
        s = x + length
        known = min(
            _exit(shape, min(s, length), length),
            inf if shape == "hole" else DEPTH * _outline(shape, s),
        )
        yield check(
            f"{shape}: tip {1e3 * s:.2g} mm uncovered, narrowest section [m^2]",
            known,
            _area(_notch(shape, length=length), x),
            5e-14,
            SOURCE,
        )
    notch = _notch("triangular")
    openings = np.linspace(-0.85e-3, 0.6e-3, 59)
    curve = ComparedCurve(
        x_label="opening of the edge [mm]",
        y_label="narrowest section of a triangular notch [mm^2]",
        expected=(openings * 1e3, np.array([_narrowest(x) for x in openings]) * 1e6),
        computed=(openings * 1e3, np.array([_area(notch, x) for x in openings]) * 1e6),
    )
    for x in (-0.6e-3, -0.05e-3, 0.04e-3, 0.4e-3):
        where = f"edge {'covered' if x < 0 else 'open'} by {1e3 * abs(x):g} mm"
        yield check(
            f"triangular notch, {where}, narrowest section [m^2]",
            _narrowest(x),
            _area(notch, x),
            5e-14,
            "smallest plane section; beyond the edge shortest distances over strips: by search",
            curve,
        )


def _narrowest(x: float) -> float:
    if x >= 0.0:
        return _strips(x)
    found = minimize_scalar(
        lambda phi: _section(x + LENGTH, phi),
        bounds=(0.0, pi / 2),
        method="bounded",
        options={"xatol": 1e-9},
    )
    return float(found.fun)


def _edge(*notches: Notch, **changed: object) -> SpoolEdge:
    known = {"diameter": D, "radial_clearance": C, "overlap": 0.0, "direction": "opening"}
    return SpoolEdge.model_validate(
        {
            **known,
            **{"cavitation": None, "critical_flow_number": 1e-9, "notches": notches},
            **changed,
        }
    )


def _flow(part: SpoolEdge, y: float, drop: float = 30e5) -> float:
    return (
        float(branch_step(branch_of(part), 20e5 + drop, 20e5, ports=(y, y, 0.0, 0.0))[0]) / RHO_OIL
    )


def _limits() -> list[Check]:
    notch = _notch("rectangular")
    x = -LENGTH + 60e-6
    far = 200 * DEPTH
    return [
        check(
            "edge with rectangular notches of 2 mm depth, open by 60 um: flow [m^3/s]",
            _flow(_edge(width=4 * WIDTH, overlap=-LENGTH), x)
            + _flow(_edge(width=pi * D - 4 * WIDTH), x),
            _flow(_edge(_notch("rectangular", depth=2e-3)), x),
            1e-4,
            "two edges in parallel, of the width of the notches and of the rest",
        ),
        check(
            "rectangular notches, edge open by 80 mm: flow over that of the whole edge [-]",
            1.0 + 4 * WIDTH / (pi * D) * (sqrt(far**2 + DEPTH**2) / far - 1.0),
            _flow(_edge(notch), far) / _flow(_edge(), far),
            4e-13,
            "b sqrt(x^2 + t^2) tends to b x",
        ),
        check(
            "the same, mirrored: flow [m^3/s]",
            _flow(_edge(notch), -0.3e-3),
            _flow(_edge(notch, direction="closing"), 0.3e-3),
            1e-15,
            "symmetry",
        ),
    ]


def _laminar() -> list[Check]:
    out = []
    lap, drop = 1.2e-3, 1.0  # small enough that nothing is turbulent [m], [Pa]
    for shape in ("rectangular", "triangular", "round"):
        entry = 100.0 * C / (96 * 0.7)  # length of gap that resists as the edge does

        def strip(u: float, kind: str = shape, entry: float = entry) -> float:
            """One over the length of gap before the tip, ``u`` from its middle."""
            r = 0.5 * WIDTH
            behind = {"rectangular": 0.0, "triangular": LENGTH * u / r}
            return 1.0 / (
                lap - LENGTH + behind.get(kind, r - sqrt(max(r * r - u * u, 0.0))) + entry
            )

        tip = 8 * quad(strip, 0.0, 0.5 * WIDTH, epsabs=0.0, epsrel=1e-13)[0]
        land = (pi * D - 4 * WIDTH) / (lap + entry)
        out.append(
            check(
                f"{shape} notches covered by 0.3 mm: leakage [m^3/s]",
                C**3 / (12 * MU_OIL) * (land + tip) * drop,
                _flow(_edge(_notch(shape), critical_flow_number=100.0, overlap=lap), 0.0, drop),
                2e-5 if shape == "rectangular" else 4e-11,
                "12 mu l/(w c^3) with the edge in series, strip by strip, by quadrature",
            )
        )
    return out + _friction()


def _friction() -> list[Check]:
    """Laminar flow along shallow notches; the rest of the edge is left out."""
    out = []
    shallow, x = 30e-6, -0.35e-3
    s = x + LENGTH
    for shape in ("rectangular", "triangular", "round"):

        def channel(xi: float, kind: str = shape) -> float:
            """One over width and depth cubed."""
            depth = shallow * xi / LENGTH
            cube = 0.25 * depth**3 if kind == "triangular" else (shallow + C) ** 3
            return 1.0 / (_outline(kind, xi) * cube)

        along = 12 * MU_OIL * quad(channel, s, LENGTH, epsabs=0.0, epsrel=1e-12)[0]
        out.append(
            check(
                f"{shape} notches of 30 um depth, tip 0.55 mm uncovered, 1 Pa: flow [m^3/s]",
                4 / along * 1.0,
                _flow(
                    _edge(_notch(shape, depth=shallow), width=4 * WIDTH, eccentricity=0.0), x, 1.0
                )
                - _flank(shape, x),
                4e-7,
                "slot of the local width and depth, by quadrature",
            )
        )
    return out


def _flank(shape: str, x: float) -> float:
    """Leakage at 1 Pa through the covered flank of a V [m^3/s]."""
    if shape != "triangular":
        return 0.0
    r = 0.5 * WIDTH
    open_to = r * (x + LENGTH) / LENGTH
    strips = quad(lambda u: 1.0 / (LENGTH * (u - open_to) / r + C), open_to, r)[0]
    return 8 * C**3 / (12 * MU_OIL) * strips


def _jet() -> list[Check]:
    part = _edge(_notch("triangular"), flow_force=FlowForce(velocity_coefficient=0.98))
    x, drop, cq = -0.3e-3, 50e5, 0.7
    s = x + LENGTH
    out = branch_step(branch_of(part), 20e5 + drop, 20e5, ports=(x, x, 0.0, 0.0))
    area = _narrowest(x)
    clear = sqrt(area**2 + (_outline("triangular", s) * C) ** 2)
    # drop = a Q + b Q^2 of one notch: friction along it, and its narrowest section
    along = quad(lambda xi: 4 * LENGTH**4 / (WIDTH * DEPTH**3 * xi**4), s, LENGTH, epsrel=1e-12)[0]
    square = RHO_OIL / (2 * (cq * clear) ** 2)
    flow = float(np.roots([square, 12 * MU_OIL * along, -drop]).max())
    force = 4 * RHO_OIL * flow * (0.98 * flow / (cq * clear)) * cos(radians(69.0)) * area / clear
    return [
        check(
            "triangular notches at 50 bar, force of the jets [N]",
            -force,
            float(out[3]),
            5e-11,
            "Merritt 1967, ch. 5: rho Q v cos(69 deg), closing",
        ),
        check(
            "triangular notch, narrowest section over the exit [-]",
            sin(atan(DEPTH / LENGTH)),
            _area(_notch("triangular"), x) / (0.5 * WIDTH * s**2 / LENGTH),
            1e-14,
            "sine of the slope of the bottom, tan = depth over length",
        ),
    ]


def _emptying() -> list[Check]:
    """A chamber at 100 bar empties while a spool with notches opens."""
    volume, start, lap, speed, end = 20e-6, 100e5, 1.0e-3, 0.6, 1.4e-3
    shapes = ("rectangular", "triangular")
    part = _edge(*(_notch(shape) for shape in shapes), overlap=lap, width=8 * WIDTH)
    result = run_network(
        {
            "spool": component(
                "prescribed-motion",
                time=(0.0, end),
                displacement=(0.0, speed * end),
                between="straight",
            ),
            "room": component("chamber", volume=volume, pressure=start),
            "edge": part,
        },
        [["spool.body", "edge.spool"], ["room.fluid", "edge.a"], ["edge.b", "ambient"]],
        fluid=OIL,
        duration=end,
        step=0.5e-6,
        record=10e-6,
    )

    def outflow(t: float, pressure: float) -> float:
        """Mass flow through both kinds of notches and their gaps [kg/s]."""
        x, drop = speed * t - lap, pressure - AMBIENT.pressure
        s, density = x + LENGTH, float(OIL.density(pressure))
        flank = (
            WIDTH / LENGTH * np.log((min(LENGTH - s, LENGTH) + C - min(s, 0.0)) / (C - min(s, 0.0)))
        )
        total = 4 * C**3 * flank / (12 * MU_OIL) * drop
        for shape in shapes:
            width = _outline(shape, max(s, 0.0))
            area, along = (
                WIDTH * min(max(s, 0.0), DEPTH),
                min(-x, LENGTH) / (WIDTH * (DEPTH + C) ** 3),
            )
            along += max(-s, 0.0) / (WIDTH * C**3)
            if shape == "triangular":
                if s <= 0.0:
                    continue
                area = 0.5 * width * s * sin(atan(DEPTH / LENGTH))
                along = 4 * LENGTH / (3 * WIDTH * DEPTH**3) * ((LENGTH / s) ** 3 - 1)
            a, b = (
                12 * MU_OIL * along,
                density / (2 * (0.7 * sqrt(area**2 + (width * C) ** 2)) ** 2),
            )
            total += 4 * 2 * drop / (a + sqrt(a * a + 4 * b * drop))
        return density * total

    def rate(t: float, p: np.ndarray) -> np.ndarray:
        step = 1e3
        slope = float(OIL.density(p[0] + step) - OIL.density(p[0] - step)) / (2 * step)
        return np.array([-outflow(t, p[0]) / (volume * slope)])

    time = result.time
    apart = solve_ivp(
        rate, (0.0, end), [start], method="DOP853", t_eval=time, rtol=1e-9, max_step=10e-6
    ).y[0]
    found = result.channels["room pressure"].values
    return [
        check(
            "chamber that empties through notches, largest deviation over 100 bar [relative]",
            0.0,
            float(np.abs(found - apart).max() / start),
            5e-5,
            "the same equations integrated apart by SciPy (DOP853, 1e-9)",
            ComparedCurve(
                x_label="time [ms]",
                y_label="pressure [bar]",
                expected=(time * 1e3, apart / 1e5),
                computed=(time * 1e3, found / 1e5),
            ),
        ),
        check(
            "chamber that empties through notches, energy residual [-]",
            0.0,
            result.books.relative_residual,
            5e-14,
            "conservation of energy",
        ),
    ]
