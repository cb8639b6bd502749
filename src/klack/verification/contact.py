"""Checks of the contact space, the static contact and the local law."""

from itertools import product

import numpy as np

from klack.contact.complementarity import solve_lcp
from klack.contact.local_law import consistent_law
from klack.contact.pairing import face_geometry, project_to_surface
from klack.contact.statics import StaticContact
from klack.elasticity.statics import Flexibility
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.indentation import (
    STEEL,
    IndentationProblem,
    half_spaces,
    parabola,
    sphere_on_cone,
    uniform_compression,
)

__all__ = ["checks"]

_GROUP = "contact"
_RADIUS, _HALF_WIDTH = 40e-3, 100e-6  # a/R = 1/400, so that Hertz' small slopes hold to 1e-3
_MODULUS = STEEL.plane_strain_modulus / 2.0


def checks() -> list[Check]:
    """Return all checks of the contact."""
    problem = half_spaces(
        parabola(_RADIUS, 4.0 * _HALF_WIDTH),
        contact=_HALF_WIDTH,
        cells=(16, 12),
        reach=(1.45 * _HALF_WIDTH) ** 2 / (2.0 * _RADIUS),
    )
    static = problem.solve(_hertz_force(_HALF_WIDTH**2 / _RADIUS))
    return [
        *_hertz(static),
        *_balance(problem, static),
        *_patch_test(),
        _curved_gap(),
        _law_adds_up(static),
        _enumeration(),
    ]


def _hertz_force(approach: float) -> float:
    return 4.0 / 3.0 * _MODULUS * np.sqrt(_RADIUS) * approach**1.5


def _hertz(static: StaticContact) -> list[Check]:
    source = "Hertz 1882; Johnson 1985, eq. 4.22-4.24, P = 4/3 E* sqrt(R) d^1.5"
    approach, force = static.approach[-1], static.force[-1]
    upper = static.half_width > 0.25 * _HALF_WIDTH
    logs = np.log(static.approach[upper]), np.log(static.force[upper])
    radius = float(np.cbrt(3.0 * force * _RADIUS / (4.0 * _MODULUS)))
    peak = 1.5 * force / (np.pi * radius**2)
    at = int(np.argmin(np.abs(static.space.points[:, 0] - 0.5 * radius)))
    place = static.space.points[at, 0]
    pressure = static.pressures[-1, at] / static.space.area[at]
    ladder, face = _force_curve(static), _pressure_curve(static, radius, peak)
    return [
        compare(
            _GROUP,
            "sphere on half-space: force at the highest approach [N]",
            expected=_hertz_force(approach),
            computed=force,
            tolerance=2e-3,
            source=source,
            curve=ladder,
        ),
        compare(
            _GROUP,
            "sphere on half-space: exponent of force over approach [-]",
            expected=1.5,
            computed=float(np.polyfit(*logs, 1)[0]),
            tolerance=1e-5,
            source=source,
            curve=ladder,
        ),
        compare(
            _GROUP,
            "sphere on half-space: radius of the contact [m]",
            expected=radius,
            computed=static.half_width[-1],
            tolerance=5e-3,
            source=source,
            curve=face,
        ),
        compare(
            _GROUP,
            "sphere on half-space: pressure halfway to the border [Pa]",
            expected=peak * np.sqrt(1.0 - (place / radius) ** 2),
            computed=pressure,
            tolerance=1e-2,
            source=source,
            curve=face,
        ),
    ]


def _force_curve(static: StaticContact) -> ComparedCurve:
    approach = static.approach * 1e9
    return ComparedCurve(
        x_label="approach [nm]",
        y_label="force [N]",
        expected=(approach, np.array([_hertz_force(d) for d in static.approach])),
        computed=(approach, static.force),
        x_log=True,
        y_log=True,
    )


def _pressure_curve(static: StaticContact, radius: float, peak: float) -> ComparedCurve:
    """Over the radius, at the highest force."""
    order = np.argsort(static.space.points[:, 0])
    place = static.space.points[order, 0]
    near = place < 1.4 * radius
    place, order = place[near], order[near]
    inside = np.sqrt(np.maximum(1.0 - (place / radius) ** 2, 0.0))
    return ComparedCurve(
        x_label="radius [um]",
        y_label="pressure [MPa]",
        expected=(place * 1e6, peak * inside / 1e6),
        computed=(place * 1e6, static.pressures[-1, order] / static.space.area[order] / 1e6),
    )


def _balance(problem: IndentationProblem, static: StaticContact) -> list[Check]:
    space, lam = static.space, static.pressures[-1]
    axial = [float((G.T @ lam)[1::2].sum()) for G in (space.G_a, space.G_b)]
    with Flexibility(problem.body_a) as flexibility:
        raw = space.G_a @ flexibility.solve(space.G_a.T.toarray())
    return [
        compare(
            _GROUP,
            "axial forces on both bodies cancel [relative to the force]",
            expected=0.0,
            computed=sum(axial) / axial[0],
            tolerance=5e-14,
            source="Newton's third law",
        ),
        compare(
            _GROUP,
            "contact compliance is symmetric [largest asymmetry over largest entry]",
            expected=0.0,
            computed=float(np.max(np.abs(raw - raw.T)) / np.max(np.abs(raw))),
            tolerance=5e-14,
            source="Maxwell-Betti reciprocity",
        ),
    ]


def _patch_test() -> list[Check]:
    problem = uniform_compression("tet10", "tet10", (3, 4), skew=0.03)
    static = problem.solve(1e9, count=2)
    expected = STEEL.young * static.approach[-1] / 2.0
    pressure = static.pressures[-1] / static.space.area
    source = "uniform compression of two cubes, p = E d / (2 L)"
    return [
        compare(
            _GROUP,
            "patch test, tetrahedra that do not match: force [N]",
            expected=expected,
            computed=static.force[-1],
            tolerance=1e-4,
            source=source,
        ),
        compare(
            _GROUP,
            "patch test: largest deviation of the pressure [relative]",
            expected=0.0,
            computed=float(np.max(np.abs(pressure / expected - 1.0))),
            tolerance=0.08,
            source=source,
        ),
    ]


def _curved_gap() -> Check:
    """Sphere of radius 1 mm on a conical seat, elements of 0.06 mm."""
    mesh, seat, exact = sphere_on_cone("hex20", (26, 24))
    xi = np.array([(x, y) for x in (-0.9, -0.4, 0.3, 0.8) for y in (-0.7, -0.1, 0.6)])
    at = face_geometry(mesh.points, mesh.surface("bottom").blocks[0], xi)
    position, normal = at.position.reshape(-1, 3), at.normal.reshape(-1, 3)
    met = project_to_surface(position, normal, seat, seat.surface("top"))
    error = (met.gap - exact(position))[met.met]
    return compare(
        _GROUP,
        "sphere on a cone: largest error of the gap between curved faces of 0.06 mm [m]",
        expected=0.0,
        computed=float(np.max(np.abs(error))),
        tolerance=0.5e-9,
        source="distance along the radius of the sphere to the cone of 45 deg",
    )


def _law_adds_up(static: StaticContact) -> Check:
    modal = 0.4 * static.approach[-1] / static.force[-1]
    local = consistent_law(static, modal)
    at = local.force[-5]
    indentation = np.interp(at, local.force, local.force_indentation)
    return compare(
        _GROUP,
        "local law plus modes give the static approach back [m]",
        expected=float(np.interp(at, static.force, static.approach)),
        computed=float(indentation + at * modal),
        tolerance=5e-14,
        source="definition: local indentation = approach - force * modal compliance",
    )


def _enumeration() -> Check:
    """All 2^8 active sets of a random problem against the active-set iteration."""
    rng = np.random.default_rng(7)
    B = rng.standard_normal((8, 8))
    A, q = B @ B.T + np.eye(8), rng.standard_normal(8)
    lam, _, _ = solve_lcp(A, q)
    for choice in product((False, True), repeat=8):
        active = np.array(choice)
        trial = np.zeros(8)
        trial[active] = np.linalg.solve(A[np.ix_(active, active)], -q[active])
        if trial.min() >= 0.0 and (q + A @ trial).min() >= -1e-12:
            break
    return compare(
        _GROUP,
        "complementarity problem of eight points: sum of the forces [N]",
        expected=float(trial.sum()),
        computed=float(lam.sum()),
        tolerance=5e-14,
        source="enumeration of all 256 active sets",
    )
