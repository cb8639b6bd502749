"""Checks of the contact space, the static contact and the local law."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np

from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.statics import Flexibility
from klack.contact.complementarity import solve_lcp
from klack.contact.local_law import consistent_law
from klack.contact.mortar import ContactSpace, contact_space
from klack.contact.pairing import face_geometry, project_to_surface
from klack.contact.statics import StaticContact, contact_compliance, static_contact
from klack.mesh.mesh import Mesh
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.lattice import STEEL, lattice_mesh

__all__ = [
    "STEEL",
    "IndentationProblem",
    "checks",
    "graded_line",
    "half_spaces",
    "parabola",
    "sphere_on_cone",
    "uniform_compression",
]


@dataclass(frozen=True, kw_only=True, eq=False)
class IndentationProblem:
    """Two bodies of revolution that act as half-spaces, and the contact points between them."""

    body_a: ElasticBody
    body_b: ElasticBody
    space: ContactSpace

    def compliance(self) -> np.ndarray:
        """Condensed compliance of the contact points [m/N]."""
        with Flexibility(self.body_a) as a, Flexibility(self.body_b) as b:
            return contact_compliance(self.space, a, b)

    def solve(self, max_force: float, count: int = 24) -> StaticContact:
        """Solve the static contact up to an axial force [N]."""
        return static_contact(self.space, self.compliance(), max_force, count)


def graded_line(size: float, fine: float, far: float, growth: float = 1.3) -> np.ndarray:
    """Cell borders from 0: cells of ``size`` up to ``fine``, then growing up to ``far`` [m]."""
    x = list(size * np.arange(round(fine / size) + 1))
    step = size
    while x[-1] < far:
        step *= growth
        x.append(x[-1] + step)
    return np.array(x)


def parabola(radius: float, limit: float) -> Callable[[np.ndarray], np.ndarray]:
    """Gap x^2/(2 radius), continued straight beyond a distance ``limit`` [m]."""

    def profile(x: np.ndarray) -> np.ndarray:
        near = np.minimum(np.abs(x), limit)
        return near**2 / (2.0 * radius) + (np.abs(x) - near) * limit / radius

    return profile


def half_spaces(
    profile: Callable[[np.ndarray], np.ndarray],
    *,
    contact: float,
    cells: tuple[int, int],
    ring: float = 0.0,
    family: str = "quad8",
    far: float = 1000.0,
    reach: float,
) -> IndentationProblem:
    """Two steel half-spaces of revolution with a gap ``profile(r - ring)`` [m] between them.

    Parameters
    ----------
    contact [m]
        Expected half width.
    cells
        Of a and of b per ``contact``.
    ring [m]
        0 for a contact on the axis.
    far
        Least size of the bodies over ``contact`` (on a ring twenty times ``ring``).
    reach [m]
    """
    size = max(far * contact, 20.0 * ring)
    bodies = []
    for sign, name, number in ((1.0, "upper", cells[0]), (-1.0, "lower", cells[1])):
        h = contact / number
        r = _radii(h, contact, ring, size)
        z = graded_line(h, contact, size)
        z = z if sign > 0 else -z[::-1]

        def shape(
            x: np.ndarray, sign: float = sign, end: float = float(np.abs(z).max())
        ) -> np.ndarray:
            lift = profile(x[:, 0] - ring) * (1.0 - x[:, 1] / end) if sign > 0 else 0.0
            return np.column_stack([x[:, 0], x[:, 1] + lift])

        mesh = lattice_mesh(family, [r, z], shape)
        bodies.append(
            elastic_body(
                name,
                mesh,
                {"solid": STEEL},
                fixed_nodes=mesh.surface("top" if sign > 0 else "bottom").nodes,
            )
        )
    a, b = bodies
    surfaces = a.mesh.surface("bottom"), b.mesh.surface("top")
    return IndentationProblem(
        body_a=a,
        body_b=b,
        space=contact_space(a.mesh, surfaces[0], b.mesh, surfaces[1], reach=reach),
    )


def _radii(h: float, contact: float, ring: float, size: float) -> np.ndarray:
    if ring == 0.0:
        return graded_line(h, 1.5 * contact, size)
    out = graded_line(h, 1.5 * contact, size)
    inward = ring - graded_line(h, 1.5 * contact, ring)
    inward = np.append(inward[inward > 3.0 * h], 0.0)
    return np.concatenate([inward[::-1], ring + out[1:]])


def uniform_compression(
    family_a: str, family_b: str, cells: tuple[int, int], *, skew: float = 0.0
) -> IndentationProblem:
    """Two unit cubes of steel on each other that can only be compressed uniformly.

    Rollers on both ends and on two sides.  An approach d gives the pressure E d/2 everywhere.

    Parameters
    ----------
    cells
        Per edge of a and of b; unequal ones do not match.
    skew [m]
        By which inner nodes of a are displaced sideways.
    """

    def shape(x: np.ndarray) -> np.ndarray:
        wave = skew * np.sin(np.pi * x[:, 0]) * np.sin(np.pi * x[:, 1])
        return x + wave[:, None] * np.array([1.0, 0.7, 0.0])

    bodies = []
    for family, number, low in ((family_a, cells[0], 1.0), (family_b, cells[1], 0.0)):
        side = np.linspace(0.0, 1.0, number + 1)
        mesh = lattice_mesh(family, [side, side, low + side], shape if low else lambda x: x)
        body = elastic_body("cube", mesh, {"solid": STEEL})
        end = mesh.surface("top" if low else "bottom").nodes
        rollers = (3 * end + 2, 3 * mesh.surface("left").nodes, 3 * mesh.surface("front").nodes + 1)
        bodies.append(
            ElasticBody(body.name, mesh, body.K, body.M, np.unique(np.concatenate(rollers)))
        )
    a, b = bodies
    surfaces = a.mesh.surface("bottom"), b.mesh.surface("top")
    return IndentationProblem(
        body_a=a, body_b=b, space=contact_space(a.mesh, surfaces[0], b.mesh, surfaces[1], reach=0.1)
    )


def sphere_on_cone(
    family: str, layers: tuple[int, int], *, h: float = 0.06e-3, radius: float = 1e-3
) -> tuple[Mesh, Mesh, Callable[[np.ndarray], np.ndarray]]:
    """Spherical shell that touches a conical one of 45 deg along a ring; a third of the circle.

    Returns the meshes, with the surfaces bottom and top, and the exact gaps [m] along the radius
    of points (n, 3) on the sphere.

    Parameters
    ----------
    layers
        Element borders around, for the sphere and the cone.
    h [m]
        Element size along the meridian.
    radius [m]
    """
    ring = radius / np.sqrt(2.0)

    def revolved(r: np.ndarray, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        return np.column_stack([r * np.cos(x[:, 1]), r * np.sin(x[:, 1]), z + x[:, 2]])

    def on_sphere(x: np.ndarray) -> np.ndarray:
        angle = np.pi / 4.0 + (x[:, 0] - ring) * np.sqrt(2.0) / radius
        return revolved(radius * np.sin(angle), x, -radius * np.cos(angle))

    def exact(x: np.ndarray) -> np.ndarray:
        n = x / np.linalg.norm(x, axis=1, keepdims=True)
        sine, cosine = np.hypot(n[:, 0], n[:, 1]), -n[:, 2]
        return np.sqrt(2.0) * radius / (sine + cosine) - radius

    r = ring + h / np.sqrt(2.0) * np.arange(-2, 3)
    skin = np.array([0.0, h])
    around = [np.linspace(0.0, 2.0 * np.pi / 3.0, n) for n in layers]
    cone = lattice_mesh(
        family,
        [r + 0.2 * h, around[1], skin - h],
        lambda x: revolved(x[:, 0], x, x[:, 0] - np.sqrt(2.0) * radius),
    )
    return lattice_mesh(family, [r, around[0], skin], on_sphere), cone, exact


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
    ladder, face = _force_curve(static), _pressure_curve(static, radius, peak)
    return [
        check(
            "sphere on half-space: force at the highest approach [N]",
            expected=_hertz_force(approach),
            computed=force,
            tolerance=2e-3,
            source=source,
            curve=ladder,
        ),
        check(
            "sphere on half-space: exponent of force over approach [-]",
            expected=1.5,
            computed=float(np.polyfit(*logs, 1)[0]),
            tolerance=1e-5,
            source=source,
            curve=ladder,
        ),
        check(
            "sphere on half-space: radius of the contact [m]",
            expected=radius,
            computed=static.half_width[-1],
            tolerance=5e-3,
            source=source,
            curve=face,
        ),
        check(
            "sphere on half-space: pressure halfway to the border [Pa]",
            expected=peak * np.sqrt(1.0 - (static.space.points[at, 0] / radius) ** 2),
            computed=static.pressures[-1, at] / static.space.area[at],
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
        check(
            "axial forces on both bodies cancel [relative to the force]",
            expected=0.0,
            computed=sum(axial) / axial[0],
            tolerance=5e-14,
            source="Newton's third law",
        ),
        check(
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
        check(
            "patch test, tetrahedra that do not match: force [N]",
            expected=expected,
            computed=static.force[-1],
            tolerance=1e-4,
            source=source,
        ),
        check(
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
    return check(
        "sphere on a cone: largest error of the gap between curved faces of 0.06 mm [m]",
        expected=0.0,
        computed=float(np.max(np.abs((met.gap - exact(position))[met.met]))),
        tolerance=0.5e-9,
        source="distance along the radius of the sphere to the cone of 45 deg",
    )


def _law_adds_up(static: StaticContact) -> Check:
    modal = 0.4 * static.approach[-1] / static.force[-1]
    local = consistent_law(static, modal)
    at = local.force[-5]
    indentation = np.interp(at, local.force, local.force_indentation)
    return check(
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
    return check(
        "complementarity problem of eight points: sum of the forces [N]",
        expected=float(trial.sum()),
        computed=float(lam.sum()),
        tolerance=5e-14,
        source="enumeration of all 256 active sets",
    )
