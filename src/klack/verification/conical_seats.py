"""Conical seats: mantles and acting areas by a search over both contours, two seats in series."""

from collections.abc import Callable, Iterator
from math import cos, pi, radians, sin, sqrt, tan

import numpy as np
from scipy.optimize import brentq, minimize, minimize_scalar

from klack.hydraulics.conical_seat import ConicalSeat
from klack.hydraulics.flow_force import FlowForce
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Rows
from klack.simulation.operating_point import operating_point
from klack.verification.benches import (
    AMBIENT,
    OIL,
    RHO_OIL,
    branch_of,
    branch_step,
    component,
    run_network,
)
from klack.verification.check import Check, ComparedCurve, check

__all__ = ["acting_areas", "conical_seats", "smallest_mantle"]


Piece = Callable[[float], np.ndarray]


_LOWER, _UPPER, _EDGE = 0.6e-3, 1.1e-3, 0.8e-3  # radii of seat and edge [m]
_SEAT, _TIP, _SHANK = radians(30.0), radians(38.0), radians(8.0)
_RHO, _WIDTH = 60e-6, 80e-6
_CHAMFERS = {"steep chamfer": radians(22.0), "blunt chamfer": radians(34.0)}
_SEARCH = "search over all pairs of points of both contours (SciPy, Nelder-Mead)"


def _seat(**keys: object) -> ConicalSeat:
    given = {
        "half_angle": _SEAT,
        "lower_diameter": 2 * _LOWER,
        "upper_diameter": 2 * _UPPER,
        "edge_diameter": 2 * _EDGE,
        "tip_half_angle": _TIP,
        "shank_half_angle": _SHANK,
    }
    return ConicalSeat.model_validate(given | keys)


def _straight(p: np.ndarray, q: np.ndarray) -> Piece:
    return lambda u: p + u * (q - p)


def needle_pieces(kind: str) -> list[Piece]:
    """Pieces of the contour, drawn apart; the corner of both cones at height 0."""
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

    def arc(u: float) -> np.ndarray:
        angle = _TIP + u * (_SHANK - _TIP)
        return centre + _RHO * np.array([cos(angle), -sin(angle)])

    return [_straight(apex, arc(0.0)), arc, _straight(arc(1.0), far)]


def smallest_mantle(kind: str, lift: float, upper: float = _UPPER) -> tuple[float, float]:
    """Area [m^2] of the smallest mantle by search, and sealing radius [m]."""
    pieces = needle_pieces(kind)
    seat = _straight(np.array([_LOWER, 0.0]), np.array([upper, (upper - _LOWER) / tan(_SEAT)]))
    normal = np.array([cos(_SEAT), -sin(_SEAT)])
    sealing, level = 0.0, -np.inf
    for piece in pieces:

        def inwards(u: np.ndarray, at: Piece = piece) -> float:
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

        def area(uv: np.ndarray, at: Piece = piece) -> float:
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
    part, narrow = _seat(), _seat(upper_diameter=1.7e-3)
    curve, tiny = _curve(part), 0.1e-6
    close = _seat(upper_diameter=1.68e-3, tip_half_angle=pi / 4)
    return [
        check(
            "needle edge on a cone 0.1 um open, area [m^2]",
            pi * tiny * sin(_SEAT) * (2 * _EDGE + tiny * sin(_SEAT) * cos(_SEAT)),
            part.opening(tiny)[0],
            1e-9,
            "mantle along the normal of the seat, pi x sin(al) (d + x sin(al) cos(al)); the "
            "smallest one is tilted by q = h sin(al)/d and smaller by q^2/2, 1.2e-10",
        ),
        check(
            "the same 0.2 mm open, area at the edge [m^2]",
            smallest_mantle("sharp", 200e-6)[0],
            part.opening(200e-6)[0],
            1e-13,
            _SEARCH,
            curve,
        ),
        check(
            "0.4 mm open, area at the lower end of the seat [m^2]",
            smallest_mantle("sharp", 400e-6)[0],
            part.opening(400e-6)[0],
            1e-13,
            _SEARCH,
            curve,
        ),
        check(
            "0.17 mm open, area at an upper end of 1.7 mm [m^2]",
            smallest_mantle("sharp", 170e-6, 0.85e-3)[0],
            narrow.opening(170e-6)[0],
            1e-13,
            _SEARCH,
        ),
        check(
            "edge of 1.6 mm, 40 um inside and 30 um above an upper end of 1.68 mm, area [m^2]",
            pi * 1.64e-3 * 50e-6,
            close.opening(30e-6 + 40e-6 / tan(_SEAT))[0],
            1e-13,
            "frustum pi (r_1 + r_2) s, 3-4-5",
        ),
    ]


def _rounded() -> list[Check]:
    part = _seat(edge_radius=_RHO)
    area, radius = smallest_mantle("rounded", 100e-6)
    return [
        check(
            "edge rounded with 60 um, 0.1 mm open, area [m^2]",
            area,
            part.opening(100e-6)[0],
            1e-13,
            _SEARCH,
        ),
        check(
            "the same 0.3 mm open [m^2]",
            smallest_mantle("rounded", 300e-6)[0],
            part.opening(300e-6)[0],
            1e-13,
            _SEARCH,
        ),
        check(
            "its sealing diameter [m]",
            2 * radius,
            part.sealing_diameter,
            1e-8,
            "point of the contour farthest along the normal of the seat, by search",
            reason="a search finds a place of an extremum to the root of round-off",
        ),
    ]


def _chamfered() -> Iterator[Check]:
    for kind, angle in _CHAMFERS.items():
        part = _seat(chamfer_half_angle=angle, chamfer_width=_WIDTH)
        area, radius = smallest_mantle(kind, 200e-6)
        yield from [
            check(
                f"{kind} of 80 um, 0.2 mm open, area [m^2]",
                area,
                part.opening(200e-6)[0],
                1e-13,
                _SEARCH,
            ),
            check(
                f"{kind}, sealing diameter [m]",
                2 * radius,
                part.sealing_diameter,
                1e-13,
                "point of the contour farthest along the normal of the seat, by search",
            ),
        ]


def _flow() -> list[Check]:
    out = branch_step(
        branch_of(_seat(critical_flow_number=1e-8, cavitation=None, flow_force=FlowForce())),
        60e5,
        10e5,
        ports=(200e-6, 200e-6, 0.0, 0.0),
    )
    area = smallest_mantle("sharp", 200e-6)[0]
    return [
        check(
            "needle edge 0.2 mm open, 50 bar, flow [kg/s]",
            0.7 * area * sqrt(2 * RHO_OIL * 50e5),
            float(out[0]),
            1e-9,
            "Merritt 1967, ch. 3: C_q A sqrt(2 rho dp)",
            reason="the laminar part has a flow number of 1e-8",
        ),
        check(
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
    alone = _seat(edge_diameter=d_2, tip_half_angle=pi / 2)
    law = {"critical_flow_number": 1e-8, "cavitation": None}
    first = _seat(lift=50e-6, **law)
    second = _seat(lift=50e-6 + behind, edge_diameter=d_2, **law)
    supply = 50e5
    run = run_network(
        {
            "needle": component("rigid-mass", mass=1e-3),
            "spring": component("spring", stiffness=1e4, preload=0.0),
            "supply": component("pressure-source", pressure=supply),
            "upper": first,
            "between": component("chamber", volume=1e-9),
            "lower": second,
        },
        [
            ["needle.body", "spring.end", "upper.needle", "lower.needle"],
            ["supply.fluid", "upper.a"],
            ["upper.b", "between.fluid", "lower.a"],
            ["lower.b", "ambient"],
        ],
        fluid=OIL,
        duration=20e-6,
        step=20e-9,
        record=1e-6,
    )
    a_1, a_2 = first.opening(50e-6)[0], second.opening(50e-6 + behind)[0]
    low = 101325.0

    def excess(p: float) -> float:
        into = a_1**2 * float(OIL.density(supply)) * (supply - p)
        return into - a_2**2 * float(OIL.density(p)) * (p - low)

    return [
        check(
            "blunt end of the tip as second edge, 0.4 mm open, area [m^2]",
            alone.opening(400e-6 + behind)[0],
            _seat(tip_diameter=d_2).opening(400e-6)[0],
            1e-13,
            "that edge alone, higher by (d_1 - d_2)/2 (cot(al) - cot(be))",
        ),
        check(
            "double seat, pressure between both edges [Pa]",
            brentq(excess, low, supply, xtol=1e-6),
            float(run.channels["between pressure"].values[-1]),
            5e-10,
            "orifices in series: rho_1 A_1^2 (p_1 - p) = rho A_2^2 (p - p_2)",
        ),
    ]


_BORE = pi * _LOWER**2
_SEARCH_ACTING = (
    "Merritt 1967, ch. 3: three sections in series, each by search (SciPy, Nelder-Mead)"
)


def acting_areas() -> list[Check]:
    """Acting area over the lift, where a needle rests, virtual work, and a run."""
    return [*_areas(), *_rest(), *_work(), *_run()]


def _part_acting(**keys: object) -> ConicalSeat:
    return _seat(critical_flow_number=1e-6, cavitation=None, **keys)


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

    def mantle(p: np.ndarray, q: np.ndarray) -> float:
        return 1e6 * pi * float((p[0] + q[0]) * np.hypot(*(p - q)))

    best, r_upper = np.inf, 0.0
    for piece in above:
        for corner in ((0.01, 0.3), (0.01, 0.9), (0.5, 0.5)):

            def area(uv: np.ndarray, at: Piece = piece) -> float:
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
    shares = np.array([1e-6 * best, 1e-6 * float(low.fun), _BORE]) ** -2.0
    return pi * float(
        shares @ np.array([r_upper**2, float(tip(low.x)[0]) ** 2, 0.0]) / shares.sum()
    )


def _areas() -> Iterator[Check]:
    for kind, part in (("sharp", _part_acting()), ("rounded", _part_acting(edge_radius=_RHO))):
        lifts, few = np.linspace(0.0, 600e-6, 121), np.linspace(0.0, 600e-6, 9)
        curve = ComparedCurve(
            x_label="lift [um]",
            y_label="acting area [mm^2]",
            expected=(few * 1e6, np.array([_searched(kind, x) for x in few]) * 1e6),
            computed=(lifts * 1e6, np.array([part.acting_area(x) for x in lifts]) * 1e6),
        )
        yield from [
            check(
                f"{kind} needle edge on a cone, {1e6 * x:g} um open: acting area [m^2]",
                _searched(kind, x),
                part.acting_area(x),
                tolerance,
                _SEARCH_ACTING,
                curve,
            )
            for x, tolerance in ((40e-6, 5e-10 if kind == "sharp" else 5e-8), (300e-6, 2e-7))
        ]
    closed = _part_acting(edge_radius=_RHO)
    yield check(
        "rounded needle edge, closed: acting area [m^2]",
        pi / 4 * closed.sealing_diameter**2,
        closed.acting_area(0.0),
        1e-14,
        "area within the circle of contact",
    )


def _between(
    seat: ConicalSeat, needle: RigidMass, spring: Spring, room: Component, sac: Component
) -> tuple[dict[str, Component], list[list[str]]]:
    """Needle on its seat between two pressures, with faces that follow the acting area."""
    seal = seat.sealing_diameter
    parts: dict[str, Component] = {
        "needle": needle,
        "spring": spring,
        "room": room,
        "sac": sac,
        "seat": seat,
        "outside": component(
            "pressure-face", direction="opening", outer_diameter=3e-3, inner_diameter=seal
        ),
        "inside": component("pressure-face", direction="opening", outer_diameter=seal),
    }
    return parts, [
        ["needle.body", "spring.end", "seat.needle", "outside.body", "inside.body"],
        ["room.fluid", "seat.a", "outside.fluid"],
        ["sac.fluid", "seat.b", "inside.fluid"],
    ]


def _rest() -> list[Check]:
    """A needle that floats on its spring between two pressures."""
    stiffness, preload, guide, high, low = 4e5, 20.0, 3e-3, 60e5, 20e5
    seat = _part_acting(tip_side="b")
    parts, joints = _between(
        seat,
        RigidMass(mass=2e-3),
        Spring(stiffness=stiffness, preload=preload),
        component("pressure-source", pressure=high),
        component("pressure-source", pressure=low),
    )
    point = operating_point(Network(parts, joints, AMBIENT, OIL).rows())

    def left(x: float) -> float:
        area = _searched("sharp", x)
        push = (high - AMBIENT.pressure) * (pi / 4 * guide**2 - area)
        return push + (low - AMBIENT.pressure) * area - preload - stiffness * x

    fixed = (
        (high - low) * pi / 4 * (guide**2 - seat.sealing_diameter**2)
        + (low - 101325) * pi / 4 * guide**2
    ) - 20
    return [
        check(
            "needle on a spring between 60 and 20 bar, faces follow: lift [m]",
            float(brentq(left, 1e-9, 200e-6, xtol=1e-15)),
            point.value("needle.body displacement"),
            2e-9,
            "balance of forces with the acting area by search (SciPy brentq); with faces that keep "
            f"the sealing diameter {1e6 * fixed / stiffness:.4g} um",
        )
    ]


def _work() -> list[Check]:
    part = _part_acting(tip_side="a")
    face = component("pressure-face", direction="opening", outer_diameter=part.sealing_diameter)
    rows = Rows(
        ambient=AMBIENT,
        fluid=OIL,
        component="part",
        handles={"a": 1, "b": 2, "needle": 0, "body": -1},
        partners={"a": (face,)},
    )
    part.add_rows(rows)
    (row,) = rows.branches
    x, h, v = 80e-6, 1e-8, 0.7
    high, low = 50e5, 10e5

    def out(speed: float) -> np.ndarray:
        way = 0.5 * h * speed
        return branch_step(row, low, high, h=h, ports=(x - way, x + way, 0.0, 0.0))

    force = pi / 4 * part.sealing_diameter**2 - part.acting_area(x)
    return [
        check(
            "needle at 0.7 m/s, 40 bar: work of the fluid that the acting area moves [W]",
            float(out(v)[3]) * v,
            float(out(v)[0] - out(0.0)[0]) / RHO_OIL * (low - high),
            2e-11,
            "virtual work: F dx = dp dV",
        ),
        check(
            "the same, force of the shift, tip at port a under the lower pressure [N]",
            force * (high - low),
            float(out(0.0)[3]),
            5e-14,
            "(S(0) - S(x)) (p_shank - p_tip), opening",
        ),
    ]


def _run() -> list[Check]:
    """A needle that swings between two chambers."""
    result = run_network(
        *_between(
            _part_acting(tip_side="b", lift=60e-6),
            RigidMass(mass=2e-3, speed=0.2),
            Spring(stiffness=4e5, preload=15.0),
            component("chamber", volume=50e-9, pressure=60e5),
            component("chamber", volume=5e-9, pressure=20e5),
        ),
        fluid=OIL,
        duration=0.5e-3,
        step=0.1e-6,
        record=1e-6,
    )
    return [
        check(
            "needle that swings between two chambers, faces follow: energy residual [-]",
            0.0,
            result.books.relative_residual,
            1e-11,
            "conservation of energy",
        )
    ]
