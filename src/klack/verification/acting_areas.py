"""Pressure faces that follow the acting diameter of a conical seat: search, rest, virtual work."""

from functools import partial
from math import cos, pi, radians, sin, tan

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize, minimize_scalar

from klack.hydraulics.chamber import Chamber
from klack.hydraulics.conical_seat import ConicalSeat
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Rows
from klack.simulation.network_run import simulate_network
from klack.simulation.operating_point import operating_point
from klack.verification.branch_step import AMBIENT, RHO, branch_step
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.conical_seats import Piece, needle_pieces
from klack.verification.supply_networks import OIL

__all__ = ["acting_areas"]

Vector = NDArray[np.float64]

_LOWER, _UPPER, _EDGE = 0.6e-3, 1.1e-3, 0.8e-3  # radii of seat and edge [m]
_SEAT, _TIP, _SHANK, _ROUNDING = radians(30.0), radians(38.0), radians(8.0), 60e-6
_BORE = pi * _LOWER**2
_SEARCH = "Merritt 1967, ch. 3: three sections in series, each by search (SciPy, Nelder-Mead)"

_check = partial(compare, "hydraulic-parts")


def acting_areas() -> list[Check]:
    """Acting area over the lift, where a needle rests, virtual work, and a run."""
    return [*_areas(), *_rest(), *_work(), *_run()]


def _part(**keys: object) -> ConicalSeat:
    given = {
        "half_angle": _SEAT,
        "lower_diameter": 2 * _LOWER,
        "upper_diameter": 2 * _UPPER,
        "edge_diameter": 2 * _EDGE,
        "tip_half_angle": _TIP,
        "shank_half_angle": _SHANK,
        "critical_flow_number": 1e-6,
        "cavitation": None,
    }
    return ConicalSeat.model_validate(given | keys)


def _searched(kind: str, lift: float) -> float:
    """Acting area from the narrowest sections of both parts of the contour [m^2]."""
    tip, *above = needle_pieces(kind)
    if kind == "sharp":
        seal, level = _EDGE, _EDGE * cos(_SEAT)
    else:  # where the arc has the tangent of the seat
        arc = above[0]
        u = (_TIP - _SEAT) / (_TIP - _SHANK)
        seal, level = float(arc(u)[0]), float(arc(u) @ np.array([cos(_SEAT), -sin(_SEAT)]))
    up = np.array([0.0, (level - _LOWER * cos(_SEAT)) / sin(_SEAT) + lift])
    ends = np.array([[_LOWER, 0.0], [_UPPER, (_UPPER - _LOWER) / tan(_SEAT)]])
    if lift == 0.0:
        return pi * seal**2

    def mantle(p: Vector, q: Vector) -> float:
        return 1e6 * pi * float((p[0] + q[0]) * np.hypot(*(p - q)))

    best, r_upper = np.inf, 0.0
    for piece in above:
        for corner in ((0.01, 0.3), (0.01, 0.9), (0.5, 0.5)):

            def area(uv: Vector, at: Piece = piece) -> float:
                return mantle(at(uv[0]) + up, ends[0] + uv[1] * (ends[1] - ends[0]))

            found = minimize(
                area,
                list(corner),
                bounds=[(0.0, 1.0)] * 2,
                method="Nelder-Mead",
                options={"xatol": 1e-12, "fatol": 1e-16, "maxiter": 4000, "maxfev": 8000},
            )
            if found.fun < best:
                best, r_upper = float(found.fun), float(piece(found.x[0])[0])
    low = minimize_scalar(
        lambda u: mantle(tip(u) + up, ends[0]),
        bounds=(0.0, 1.0),
        method="bounded",
        options={"xatol": 1e-12},
    )
    r_lower = float(tip(low.x)[0])
    shares = np.array([1e-6 * best, 1e-6 * float(low.fun), _BORE]) ** -2.0
    return pi * float(shares @ np.array([r_upper**2, r_lower**2, 0.0]) / shares.sum())


def _areas() -> list[Check]:
    out = []
    for kind, part in (("sharp", _part()), ("rounded", _part(edge_radius=_ROUNDING))):
        lifts, few = np.linspace(0.0, 600e-6, 121), np.linspace(0.0, 600e-6, 9)
        curve = ComparedCurve(
            x_label="lift [um]",
            y_label="acting area [mm^2]",
            expected=(few * 1e6, np.array([_searched(kind, x) for x in few]) * 1e6),
            computed=(lifts * 1e6, np.array([part.acting_area(x) for x in lifts]) * 1e6),
        )
        out += [
            _check(
                f"{kind} needle edge on a cone, {1e6 * x:g} um open: acting area [m^2]",
                _searched(kind, x),
                part.acting_area(x),
                tolerance,
                _SEARCH,
                curve,
            )
            for x, tolerance in ((40e-6, 5e-10 if kind == "sharp" else 5e-8), (300e-6, 2e-7))
        ]
    closed = _part(edge_radius=_ROUNDING)
    out.append(
        _check(
            "rounded needle edge, closed: acting area [m^2]",
            pi / 4 * closed.sealing_diameter**2,
            closed.acting_area(0.0),
            1e-14,
            "area within the circle of contact",
        )
    )
    return out


def _rest() -> list[Check]:
    """A needle that floats on its spring between two pressures."""
    stiffness, preload, guide, high, low = 4e5, 20.0, 3e-3, 60e5, 20e5
    seat = _part(tip_side="b")
    seal = seat.sealing_diameter
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=2e-3),
        "spring": Spring(stiffness=stiffness, preload=preload),
        "rail": PressureSource(pressure=high),
        "sac": PressureSource(pressure=low),
        "seat": seat,
        "outside": PressureFace(direction="opening", outer_diameter=guide, inner_diameter=seal),
        "inside": PressureFace(direction="opening", outer_diameter=seal),
    }
    joints = [
        ["needle.body", "spring.end", "seat.needle", "outside.body", "inside.body"],
        ["rail.fluid", "seat.a", "outside.fluid"],
        ["sac.fluid", "seat.b", "inside.fluid"],
    ]
    point = operating_point(Network(parts, joints, AMBIENT, OIL).rows())

    def left(x: float) -> float:
        area = _searched("sharp", x)
        push = (high - AMBIENT.pressure) * (pi / 4 * guide**2 - area)
        return push + (low - AMBIENT.pressure) * area - preload - stiffness * x

    known = float(brentq(left, 1e-9, 200e-6, xtol=1e-15))
    fixed = ((high - low) * pi / 4 * (guide**2 - seal**2) + (low - 101325) * pi / 4 * guide**2) - 20
    return [
        _check(
            "needle on a spring between 60 and 20 bar, faces follow: lift [m]",
            known,
            point.value("needle.body displacement"),
            2e-9,
            "balance of forces with the acting area by search (SciPy brentq); with faces that keep "
            f"the sealing diameter {1e6 * fixed / stiffness:.4g} um",
        )
    ]


def _work() -> list[Check]:
    part = _part(tip_side="a")
    handles = {"a": 1, "b": 2, "needle": 0, "body": -1}
    face = PressureFace(direction="opening", outer_diameter=part.sealing_diameter)
    rows = Rows(
        ambient=AMBIENT, fluid=OIL, component="part", handles=handles, partners={"a": (face,)}
    )
    part.add_rows(rows)
    (row,) = rows.branches
    x, h, v = 80e-6, 1e-8, 0.7
    high, low = 50e5, 10e5

    def out(speed: float) -> Vector:
        way = 0.5 * h * speed
        return branch_step(row, low, high, h=h, ports=(x - way, x + way, 0.0, 0.0))

    force = pi / 4 * part.sealing_diameter**2 - part.acting_area(x)
    return [
        _check(
            "needle at 0.7 m/s, 40 bar: work of the fluid that the acting area moves [W]",
            float(out(v)[3]) * v,
            float(out(v)[0] - out(0.0)[0]) / RHO * (low - high),
            2e-11,
            "virtual work: F dx = dp dV",
        ),
        _check(
            "the same, force of the shift, tip at port a under the lower pressure [N]",
            force * (high - low),
            float(out(0.0)[3]),
            5e-14,
            "(S(0) - S(x)) (p_shank - p_tip), opening",
        ),
    ]


def _run() -> list[Check]:
    """A needle that swings between two chambers."""
    seat = _part(tip_side="b", lift=60e-6)
    seal = seat.sealing_diameter
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=2e-3, speed=0.2),
        "spring": Spring(stiffness=4e5, preload=15.0),
        "room": Chamber(volume=50e-9, pressure=60e5),
        "sac": Chamber(volume=5e-9, pressure=20e5),
        "seat": seat,
        "outside": PressureFace(direction="opening", outer_diameter=3e-3, inner_diameter=seal),
        "inside": PressureFace(direction="opening", outer_diameter=seal),
    }
    joints = [
        ["needle.body", "spring.end", "seat.needle", "outside.body", "inside.body"],
        ["room.fluid", "seat.a", "outside.fluid"],
        ["sac.fluid", "seat.b", "inside.fluid"],
    ]
    result = simulate_network(
        Network(parts, joints, AMBIENT, OIL).rows(),
        duration=0.5e-3,
        step=0.1e-6,
        coarse=1,
        record=1e-6,
        start="free",
    )
    return [
        _check(
            "needle that swings between two chambers, faces follow: energy residual [-]",
            0.0,
            result.books.relative_residual,
            1e-11,
            "conservation of energy",
        )
    ]
