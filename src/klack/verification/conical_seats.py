"""Conical seats: mantles against a search over both contours, and two seats in series."""

from collections.abc import Callable
from functools import partial
from math import cos, pi, radians, sin, sqrt, tan

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize

from klack.hydraulics.chamber import Chamber
from klack.hydraulics.conical_seat import ConicalSeat
from klack.hydraulics.flow_force import FlowForce
from klack.hydraulics.pressure_source import PressureSource
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.simulation.network_run import simulate_network
from klack.verification.branch_step import RHO, branch_of, branch_step
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.supply_networks import OIL

__all__ = ["Piece", "conical_seats", "needle_pieces", "smallest_mantle"]

Vector = NDArray[np.float64]
Piece = Callable[[float], Vector]

_check = partial(compare, "hydraulic-parts")

_LOWER, _UPPER, _EDGE = 0.6e-3, 1.1e-3, 0.8e-3  # radii of seat and edge [m]
_SEAT, _TIP, _SHANK = radians(30.0), radians(38.0), radians(8.0)
_RHO, _WIDTH = 60e-6, 80e-6
_CHAMFERS = {"steep chamfer": radians(22.0), "blunt chamfer": radians(34.0)}
_SEARCH = "search over all pairs of points of both contours (SciPy, Nelder-Mead)"


def _part(**keys: object) -> ConicalSeat:
    given = {
        "half_angle": _SEAT,
        "lower_diameter": 2 * _LOWER,
        "upper_diameter": 2 * _UPPER,
        "edge_diameter": 2 * _EDGE,
        "tip_half_angle": _TIP,
        "shank_half_angle": _SHANK,
    }
    return ConicalSeat.model_validate(given | keys)


def _straight(p: Vector, q: Vector) -> Piece:
    return lambda u: p + u * (q - p)


def needle_pieces(kind: str) -> list[Piece]:
    """Pieces of the contour, the corner of both cones at height 0, drawn apart."""
    tip, shank = np.array([sin(_TIP), cos(_TIP)]), np.array([sin(_SHANK), cos(_SHANK)])
    edge = np.array([_EDGE, 0.0])
    apex, far = edge - _EDGE / sin(_TIP) * tip, edge + 10e-3 * shank
    if kind == "sharp":
        return [_straight(apex, edge), _straight(edge, far)]
    if kind in _CHAMFERS:
        way = np.array([sin(_CHAMFERS[kind]), cos(_CHAMFERS[kind])])
        below, above = np.linalg.solve(np.stack([tip, shank], axis=1), _WIDTH * way)
        low, high = edge - below * tip, edge + above * shank
        return [_straight(apex, low), _straight(low, high), _straight(high, far)]
    # the centre is as far from both lines: r cos(angle) - z sin(angle) is the distance outwards
    rows = np.array([[cos(_TIP), -sin(_TIP)], [cos(_SHANK), -sin(_SHANK)]])
    centre = np.linalg.solve(rows, rows @ edge - _RHO)

    def arc(u: float) -> Vector:
        angle = _TIP + u * (_SHANK - _TIP)
        return centre + _RHO * np.array([cos(angle), -sin(angle)])

    return [_straight(apex, arc(0.0)), arc, _straight(arc(1.0), far)]


def smallest_mantle(kind: str, lift: float, upper: float = _UPPER) -> tuple[float, float]:
    """Area [m^2] of the smallest mantle by search, and the radius [m] where the needle seals."""
    pieces = needle_pieces(kind)
    seat = _straight(np.array([_LOWER, 0.0]), np.array([upper, (upper - _LOWER) / tan(_SEAT)]))
    normal = np.array([cos(_SEAT), -sin(_SEAT)])
    sealing, level = 0.0, -np.inf
    for piece in pieces:

        def inwards(u: Vector, at: Piece = piece) -> float:
            return -1e3 * float(at(u[0]) @ normal)

        found = minimize(
            inwards,
            [0.5],
            bounds=[(0.0, 1.0)],
            method="Nelder-Mead",
            options={"xatol": 1e-12, "fatol": 0.0},
        )
        if -found.fun > level:
            sealing, level = float(piece(found.x[0])[0]), -found.fun
    up = (level * 1e-3 - _LOWER * cos(_SEAT)) / sin(_SEAT) + lift
    grid = np.linspace(0.0, 1.0, 41)
    best = np.inf
    for piece in pieces:

        def area(uv: Vector, at: Piece = piece) -> float:
            p, q = at(uv[0]) + np.array([0.0, up]), seat(uv[1])
            return 1e6 * pi * float((p[0] + q[0]) * np.hypot(*(p - q)))

        values = np.array([[area(np.array([u, v])) for v in grid] for u in grid])
        i, j = np.unravel_index(values.argmin(), values.shape)
        found = minimize(
            area,
            [grid[i], grid[j]],
            bounds=[(0.0, 1.0)] * 2,
            method="Nelder-Mead",
            options={"xatol": 1e-11, "fatol": 1e-16, "maxiter": 4000, "maxfev": 8000},
        )
        best = min(best, found.fun)
    return best * 1e-6, sealing


def conical_seats() -> list[Check]:
    """Areas over the lift, sealing diameters, flow and jet, two seats in series."""
    return [*_sharp(), *_rounded(), *_chamfered(), *_flow(), *_double()]


def _curve(part: ConicalSeat) -> ComparedCurve:
    lifts, few = np.linspace(0.0, 600e-6, 121), np.linspace(60e-6, 600e-6, 10)
    return ComparedCurve(
        x_label="lift [um]",
        y_label="area [mm^2]",
        expected=(few * 1e6, np.array([smallest_mantle("sharp", x)[0] for x in few]) * 1e6),
        computed=(lifts * 1e6, np.array([part.opening(x)[0] for x in lifts]) * 1e6),
    )


def _sharp() -> list[Check]:
    part, narrow = _part(), _part(upper_diameter=1.7e-3)
    curve, tiny = _curve(part), 0.1e-6
    close = _part(upper_diameter=1.68e-3, tip_half_angle=pi / 4)
    return [
        _check(
            "needle edge on a cone 0.1 um open, area [m^2]",
            pi * tiny * sin(_SEAT) * (2 * _EDGE + tiny * sin(_SEAT) * cos(_SEAT)),
            part.opening(tiny)[0],
            1e-9,
            "mantle along the normal of the seat, pi x sin(al) (d + x sin(al) cos(al)); the "
            "smallest one is tilted by q = h sin(al)/d and smaller by q^2/2, 1.2e-10",
        ),
        _check(
            "the same 0.2 mm open, area at the edge [m^2]",
            smallest_mantle("sharp", 200e-6)[0],
            part.opening(200e-6)[0],
            1e-13,
            _SEARCH,
            curve,
        ),
        _check(
            "0.4 mm open, area at the lower end of the seat [m^2]",
            smallest_mantle("sharp", 400e-6)[0],
            part.opening(400e-6)[0],
            1e-13,
            _SEARCH,
            curve,
        ),
        _check(
            "0.17 mm open, area at an upper end of 1.7 mm [m^2]",
            smallest_mantle("sharp", 170e-6, 0.85e-3)[0],
            narrow.opening(170e-6)[0],
            1e-13,
            _SEARCH,
        ),
        _check(
            "edge of 1.6 mm, 40 um inside and 30 um above an upper end of 1.68 mm, area [m^2]",
            pi * 1.64e-3 * 50e-6,
            close.opening(30e-6 + 40e-6 / tan(_SEAT))[0],
            1e-13,
            "frustum pi (r_1 + r_2) s, 3-4-5",
        ),
    ]


def _rounded() -> list[Check]:
    part = _part(edge_radius=_RHO)
    area, radius = smallest_mantle("rounded", 100e-6)
    return [
        _check(
            "edge rounded with 60 um, 0.1 mm open, area [m^2]",
            area,
            part.opening(100e-6)[0],
            1e-13,
            _SEARCH,
        ),
        _check(
            "the same 0.3 mm open [m^2]",
            smallest_mantle("rounded", 300e-6)[0],
            part.opening(300e-6)[0],
            1e-13,
            _SEARCH,
        ),
        _check(
            "its sealing diameter [m]",
            2 * radius,
            part.sealing_diameter,
            1e-8,
            "point of the contour farthest along the normal of the seat, by search",
            reason="a search finds a place of an extremum to the root of round-off",
        ),
    ]


def _chamfered() -> list[Check]:
    found = []
    for kind, angle in _CHAMFERS.items():
        part = _part(chamfer_half_angle=angle, chamfer_width=_WIDTH)
        area, radius = smallest_mantle(kind, 200e-6)
        found += [
            _check(
                f"{kind} of 80 um, 0.2 mm open, area [m^2]",
                area,
                part.opening(200e-6)[0],
                1e-13,
                _SEARCH,
            ),
            _check(
                f"{kind}, sealing diameter [m]",
                2 * radius,
                part.sealing_diameter,
                1e-13,
                "point of the contour farthest along the normal of the seat, by search",
            ),
        ]
    return found


def _flow() -> list[Check]:
    part = _part(critical_flow_number=1e-8, cavitation=None, flow_force=FlowForce())
    out = branch_step(branch_of(part), 60e5, 10e5, ports=(200e-6, 200e-6, 0.0, 0.0))
    area = smallest_mantle("sharp", 200e-6)[0]
    return [
        _check(
            "needle edge 0.2 mm open, 50 bar, flow [kg/s]",
            0.7 * area * sqrt(2 * RHO * 50e5),
            float(out[0]),
            1e-9,
            "Merritt 1967, ch. 3: C_q A sqrt(2 rho dp)",
            reason="the laminar part has a flow number of 1e-8",
        ),
        _check(
            "its jet force [N]",
            -2 * 0.7 * 0.98 * area * 50e5 * cos(_SEAT),
            float(out[3]),
            1e-9,
            "Merritt 1967, ch. 5: 2 C_q C_v A dp cos(al), closing",
            reason="the laminar part has a flow number of 1e-8",
        ),
    ]


def _double() -> list[Check]:
    """Two edges on one tip: gap of the second one, pressure between both at rest."""
    d_2 = 1.3e-3
    behind = 0.5 * (2 * _EDGE - d_2) * (1 / tan(_SEAT) - 1 / tan(_TIP))  # gap along the axis
    both = _part(tip_diameter=d_2)
    alone = _part(edge_diameter=d_2, tip_half_angle=pi / 2)
    law = {"critical_flow_number": 1e-8, "cavitation": None}
    first = _part(lift=50e-6, **law)
    second = _part(lift=50e-6 + behind, edge_diameter=d_2, **law)
    supply = 50e5
    network = Network(
        {
            "needle": RigidMass(mass=1e-3),
            "spring": Spring(stiffness=1e4, preload=0.0),
            "supply": PressureSource(pressure=supply),
            "upper": first,
            "between": Chamber(volume=1e-9),
            "lower": second,
        },
        [
            ["needle.body", "spring.end", "upper.needle", "lower.needle"],
            ["supply.fluid", "upper.a"],
            ["upper.b", "between.fluid", "lower.a"],
            ["lower.b", "ambient"],
        ],
        fluid=OIL,
    )
    run = simulate_network(
        network.rows(), duration=20e-6, step=20e-9, coarse=1, record=1e-6, start="free"
    )
    a_1, a_2 = first.opening(50e-6)[0], second.opening(50e-6 + behind)[0]
    low = 101325.0

    def excess(p: float) -> float:
        into = a_1**2 * float(OIL.density(supply)) * (supply - p)
        return into - a_2**2 * float(OIL.density(p)) * (p - low)

    return [
        _check(
            "blunt end of the tip as second edge, 0.4 mm open, area [m^2]",
            alone.opening(400e-6 + behind)[0],
            both.opening(400e-6)[0],
            1e-13,
            "that edge alone, higher by (d_1 - d_2)/2 (cot(al) - cot(be))",
        ),
        _check(
            "double seat, pressure between both edges [Pa]",
            brentq(excess, low, supply, xtol=1e-6),
            float(run.channels["between pressure"].values[-1]),
            5e-10,
            "orifices in series: rho_1 A_1^2 (p_1 - p) = rho A_2^2 (p - p_2)",
        ),
    ]
