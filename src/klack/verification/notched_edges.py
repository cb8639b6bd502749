"""Metering notches of spool edges: areas by search and quadrature, flows written apart."""

from functools import partial
from math import atan, cos, inf, pi, radians, sin, sqrt

import numpy as np
from scipy.integrate import quad, solve_ivp
from scipy.optimize import minimize_scalar

from klack.hydraulics.chamber import Chamber
from klack.hydraulics.flow_force import FlowForce
from klack.hydraulics.notch import Notch, notch_opening
from klack.hydraulics.spool_edge import SpoolEdge
from klack.mechanics.prescribed_motion import PrescribedMotion
from klack.network.network import Network
from klack.network.rows import Ambient
from klack.simulation.network_run import simulate_network
from klack.verification.branch_step import branch_of, branch_step
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.supply_networks import OIL

__all__ = ["notched_edges"]

AMBIENT = Ambient()
RHO = float(OIL.density(AMBIENT.pressure))
MU = float(OIL.viscosity(AMBIENT.pressure))
D, C, WIDTH, DEPTH, LENGTH = 8e-3, 4e-6, 1e-3, 0.4e-3, 0.9e-3
SOURCE = "elementary geometry: exit and throat, the smaller one, by quadrature of the outline"

_check = partial(compare, "hydraulic-parts")


def notched_edges() -> list[Check]:
    """Areas, limits, leakage, friction, jet, and a chamber that empties through notches."""
    return [*_areas(), *_limits(), *_laminar(), *_jet(), *_emptying()]


def _notch(shape: str, **changed: float) -> Notch:
    sizes: dict[str, float] = {"width": WIDTH, "length": LENGTH, "depth": DEPTH, **changed}
    if shape == "hole":
        sizes.pop("depth")
    return Notch(shape=shape, count=4, **sizes)  # type: ignore[arg-type]


def _area(notch: Notch, x: float) -> float:
    """Narrowest section of one notch without clearance, as klack has it [m^2]."""
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
        last = np.arccos(1.0 - end / r)
        root = quad(lambda a: 2.0 * (r * sin(a)) ** 2, 0.0, last, epsabs=0.0, epsrel=1e-13)[0]
        return float(root) + (max(s - r, 0.0) * WIDTH if shape == "round" else 0.0)
    kept = partial(_outline, shape, length=length)
    return float(quad(kept, 0.0, s, epsabs=0.0, epsrel=1e-13)[0])


def _section(s: float, phi: float) -> float:
    """Plane section of the triangular notch through the edge of the sleeve, tilted by ``phi``."""
    slope = DEPTH / LENGTH
    reach = s * slope / (cos(phi) + slope * sin(phi))  # from the edge to the bottom

    def across(v: float) -> float:
        xi, depth = s - v * sin(phi), v * cos(phi)
        return WIDTH * (xi / LENGTH - depth / DEPTH)  # width of the V at that depth

    return float(quad(across, 0.0, reach, epsabs=0.0, epsrel=1e-12)[0])


def _strips(x: float) -> float:
    """Shortest distances from the edge of the sleeve to the bottom of a V, over its width."""

    def distance(q: float) -> float:
        depth, length = DEPTH * q, LENGTH * q
        found = minimize_scalar(
            lambda z: (x + length * z) ** 2 + (depth * (1.0 - z)) ** 2,
            bounds=(0.0, 1.0),
            method="bounded",
            options={"xatol": 1e-14},
        )
        ends = min(x * x + depth * depth, (x + length) ** 2)
        return sqrt(min(float(found.fun), ends))

    kink = min(x * LENGTH / DEPTH**2, 1.0)
    parts = [(0.0, kink), (kink, 1.0)]
    return WIDTH * sum(float(quad(distance, *ends, epsrel=1e-10)[0]) for ends in parts)


def _areas() -> list[Check]:
    out = []
    for shape, x, length in (
        ("rectangular", -0.7e-3, LENGTH),
        ("rectangular", -0.1e-3, LENGTH),
        ("round", -0.75e-3, LENGTH),
        ("round", -0.2e-3, LENGTH),
        ("hole", -0.5e-3, 1.2e-3),
        ("hole", 0.3e-3, 1.2e-3),
    ):
        s = x + length
        throat = inf if shape == "hole" else DEPTH * _outline(shape, s)
        known = min(_exit(shape, min(s, length), length), throat)
        found = _area(_notch(shape, length=length), x)
        name = f"{shape}: tip {1e3 * s:.2g} mm uncovered, narrowest section [m^2]"
        out.append(_check(name, known, found, 5e-14, SOURCE))
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
        out.append(
            _check(
                f"triangular notch, {where}, narrowest section [m^2]",
                _narrowest(x),
                _area(notch, x),
                5e-14,
                "smallest plane section; beyond the edge shortest distances over strips: by search",
                curve,
            )
        )
    return out


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
    given = {"cavitation": None, "critical_flow_number": 1e-9, "notches": notches}
    return SpoolEdge.model_validate({**known, **given, **changed})


def _flow(part: SpoolEdge, y: float, drop: float = 30e5) -> float:
    """Volume flow at the displacement ``y`` [m^3/s]."""
    return float(branch_step(branch_of(part), 20e5 + drop, 20e5, ports=(y, y, 0.0, 0.0))[0]) / RHO


def _limits() -> list[Check]:
    notch = _notch("rectangular")
    x = -LENGTH + 60e-6
    narrow = _edge(width=4 * WIDTH, overlap=-LENGTH)
    rest = _edge(width=pi * D - 4 * WIDTH)
    far = 200 * DEPTH
    return [
        _check(
            "edge with rectangular notches of 2 mm depth, open by 60 um: flow [m^3/s]",
            _flow(narrow, x) + _flow(rest, x),
            _flow(_edge(_notch("rectangular", depth=2e-3)), x),
            1e-4,
            "two edges in parallel, of the width of the notches and of the rest",
        ),
        _check(
            "rectangular notches, edge open by 80 mm: flow over that of the whole edge [-]",
            1.0 + 4 * WIDTH / (pi * D) * (sqrt(far**2 + DEPTH**2) / far - 1.0),
            _flow(_edge(notch), far) / _flow(_edge(), far),
            4e-13,
            "b sqrt(x^2 + t^2) tends to b x",
        ),
        _check(
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
        part = _edge(_notch(shape), critical_flow_number=100.0, overlap=lap)
        entry = 100.0 * C / (96 * 0.7)  # length of gap that resists as the edge does

        def strip(u: float, kind: str = shape, entry: float = entry) -> float:
            """One over the length of gap before the tip, ``u`` from its middle."""
            r = 0.5 * WIDTH
            behind = {"rectangular": 0.0, "triangular": LENGTH * u / r}
            root = r - sqrt(max(r * r - u * u, 0.0))
            return 1.0 / (lap - LENGTH + behind.get(kind, root) + entry)

        tip = 8 * quad(strip, 0.0, 0.5 * WIDTH, epsabs=0.0, epsrel=1e-13)[0]
        land = (pi * D - 4 * WIDTH) / (lap + entry)
        out.append(
            _check(
                f"{shape} notches covered by 0.3 mm: leakage [m^3/s]",
                C**3 / (12 * MU) * (land + tip) * drop,
                _flow(part, 0.0, drop),
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

        along = 12 * MU * quad(channel, s, LENGTH, epsabs=0.0, epsrel=1e-12)[0]
        known = 4 / along * 1.0
        part = _edge(_notch(shape, depth=shallow), width=4 * WIDTH, eccentricity=0.0)
        out.append(
            _check(
                f"{shape} notches of 30 um depth, tip 0.55 mm uncovered, 1 Pa: flow [m^3/s]",
                known,
                _flow(part, x, 1.0) - _flank(shape, x),
                4e-7,
                "slot of the local width and depth, by quadrature",
            )
        )
    return out


def _flank(shape: str, x: float) -> float:
    """Leakage at 1 Pa through the covered flank of a V, counted from the clearance [m^3/s]."""
    if shape != "triangular":
        return 0.0
    r = 0.5 * WIDTH
    open_to = r * (x + LENGTH) / LENGTH
    strips = quad(lambda u: 1.0 / (LENGTH * (u - open_to) / r + C), open_to, r)[0]
    return 8 * C**3 / (12 * MU) * strips


def _jet() -> list[Check]:
    part = _edge(_notch("triangular"), flow_force=FlowForce(velocity_coefficient=0.98))
    x, drop, cq = -0.3e-3, 50e5, 0.7
    s = x + LENGTH
    out = branch_step(branch_of(part), 20e5 + drop, 20e5, ports=(x, x, 0.0, 0.0))
    area = _narrowest(x)
    clear = sqrt(area**2 + (_outline("triangular", s) * C) ** 2)
    # drop = a Q + b Q^2 of one notch: friction along it, and its narrowest section
    along = quad(lambda xi: 4 * LENGTH**4 / (WIDTH * DEPTH**3 * xi**4), s, LENGTH, epsrel=1e-12)[0]
    square = RHO / (2 * (cq * clear) ** 2)
    flow = float(np.roots([square, 12 * MU * along, -drop]).max())
    force = 4 * RHO * flow * (0.98 * flow / (cq * clear)) * cos(radians(69.0)) * area / clear
    return [
        _check(
            "triangular notches at 50 bar, force of the jets [N]",
            -force,
            float(out[3]),
            5e-11,
            "Merritt 1967, ch. 5: rho Q v cos(69 deg), closing",
        ),
        _check(
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
    network = Network(
        {
            "spool": PrescribedMotion(
                time=(0.0, end), displacement=(0.0, speed * end), between="straight"
            ),
            "room": Chamber(volume=volume, pressure=start),
            "edge": part,
        },
        [["spool.body", "edge.spool"], ["room.fluid", "edge.a"], ["edge.b", "ambient"]],
        AMBIENT,
        OIL,
    )
    result = simulate_network(
        network.rows(), duration=end, step=0.5e-6, coarse=1, record=10e-6, start="free"
    )

    def outflow(t: float, pressure: float) -> float:
        """Mass flow through both kinds of notches and their gaps [kg/s]."""
        x, drop = speed * t - lap, pressure - AMBIENT.pressure
        s, density = x + LENGTH, float(OIL.density(pressure))
        flank = (
            WIDTH / LENGTH * np.log((min(LENGTH - s, LENGTH) + C - min(s, 0.0)) / (C - min(s, 0.0)))
        )
        total = 4 * C**3 * flank / (12 * MU) * drop
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
            clear = sqrt(area**2 + (width * C) ** 2)
            a, b = 12 * MU * along, density / (2 * (0.7 * clear) ** 2)
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
    curve = ComparedCurve(
        x_label="time [ms]",
        y_label="pressure [bar]",
        expected=(time * 1e3, apart / 1e5),
        computed=(time * 1e3, found / 1e5),
    )
    return [
        _check(
            "chamber that empties through notches, largest deviation over 100 bar [relative]",
            0.0,
            float(np.abs(found - apart).max() / start),
            5e-5,
            "the same equations integrated apart by SciPy (DOP853, 1e-9)",
            curve,
        ),
        _check(
            "chamber that empties through notches, energy residual [-]",
            0.0,
            result.books.relative_residual,
            5e-14,
            "conservation of energy",
        ),
    ]
