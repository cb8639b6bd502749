"""Finite elements against exact elasticity: vibration, bending, tubes, rods, Fourier orders."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import csr_array, eye_array, kron

from klack.bodies.elasticity.assembly import assemble, assemble_order
from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.eigen import eigenmodes, rigid_frequencies
from klack.bodies.elasticity.factorization import available_backends
from klack.bodies.elasticity.fourier_body import FourierBody, fourier_body
from klack.bodies.elasticity.layer import Layer
from klack.bodies.elasticity.loads import order_load, traction_load
from klack.bodies.elasticity.press_fit import pressed_state
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.elasticity.stress import work_of_stress
from klack.materials.material import Material
from klack.mesh.joint import cylinder_joint
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import Mesh
from klack.mesh.parting import parted
from klack.mesh.profile import Line, Profile
from klack.mesh.sizing import MeshSizing
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.lattice import STEEL, lattice_mesh

__all__ = ["checks", "free_bar_frequencies"]


_BAR = Material(name="bar", young=210e9, poisson=0.0, density=7850.0)
_RADIUS, _LENGTH = 2e-3, 30e-3
_STRETCH = 1e-3

_RITZ = (
    "exact 3-D elasticity by Ritz (Legendre in z, regular polynomials in r), converged to 1e-8; "
    "free steel cylinder D4 x L30 mm, E = 210 GPa, nu = 0.3, rho = 7850 kg/m^3"
)
_AXIAL = {1: 86117.56, 2: 171706.49, 4: 338712.02, 8: 623091.92, 12: 752468.26}
"""Circumferential order 0: number of the mode -> frequency [Hz]."""
_AXIAL_TOLERANCE = {1: 1e-6, 2: 5e-8, 4: 2e-6, 8: 2e-5, 12: 1e-4}
"""Mesh error, of the fourth power of the wave number."""
_BENDING = {1: 19587.12, 2: 50362.64, 3: 90819.01}
"""Circumferential order 1; each is a pair."""
_RESIDUAL = {1: 0.13069097, 5: 0.03674371, 10: 0.01928473}
"""Residual flexibility of a free-free rod after N modes, in L / (E A)."""


def checks() -> list[Check]:
    """Run all checks of this group."""
    return [
        *_axisymmetric_cylinder(),
        *_solid_cylinder(),
        *fourier_checks(),
        *_thick_cylinder(),
        *_press_fit(),
        *_layer(),
        *_free_rod(),
        *_bent_beam(),
        *_solvers(),
    ]


def _axisymmetric_cylinder() -> Iterator[Check]:
    body = elastic_body(
        "cylinder",
        lattice_mesh("quad8", [np.linspace(0.0, _RADIUS, 7), np.linspace(0.0, _LENGTH, 91)]),
        {"solid": STEEL},
    )
    frequency = eigenmodes(body, count=max(_AXIAL)).frequency
    numbers = np.array(list(_AXIAL))
    curve = ComparedCurve(
        x_label="number of the axisymmetric mode [-]",
        y_label="frequency [kHz]",
        expected=(numbers, np.array(list(_AXIAL.values())) / 1e3),
        computed=(numbers, frequency[numbers - 1] / 1e3),
    )
    for number, exact in _AXIAL.items():
        yield check(
            f"free cylinder, axisymmetric mode {number}, quad8 6 x 90 [Hz]",
            expected=exact,
            computed=frequency[number - 1],
            tolerance=_AXIAL_TOLERANCE[number],
            source=_RITZ,
            curve=curve,
        )


def _solid_cylinder() -> Iterator[Check]:
    body = elastic_body("cylinder", _round_bar("hex20"), {"solid": STEEL})
    frequency = eigenmodes(body, count=8).frequency
    for number, exact in _BENDING.items():
        pair = np.sort(frequency[np.argsort(np.abs(frequency / exact - 1))[:2]])
        yield check(
            f"free cylinder, bending mode {number}, hex20 4 x 4 x 16 [Hz]",
            expected=exact,
            computed=float(pair.mean()),
            tolerance=1e-3,
            source=_RITZ,
        )
    yield check(
        "free cylinder, highest of the six rigid modes [Hz]",
        expected=0.0,
        computed=float(rigid_frequencies(body).max()),
        tolerance=0.1,
        source="a free body has six modes of frequency zero",
    )


def _round_bar(family: str) -> Mesh:
    """Square bar 4 x 4 x 16 whose cross section is mapped onto the disc."""

    def rounded(points: np.ndarray) -> np.ndarray:
        x, y, z = points.T
        return np.stack([x * np.sqrt(1 - y**2 / 2), y * np.sqrt(1 - x**2 / 2), z], axis=1) * (
            _RADIUS,
            _RADIUS,
            _LENGTH,
        )

    across = np.linspace(-1.0, 1.0, 5)
    return lattice_mesh(family, [across, across, np.linspace(0.0, 1.0, 17)], rounded)


def _thick_cylinder() -> Iterator[Check]:
    inner, outer, pressure = 1e-3, 3e-3, 100e6
    mesh = lattice_mesh("quad8", [np.geomspace(inner, outer, 13), np.linspace(0.0, 2e-3, 3)])
    body = elastic_body("tube", mesh, {"solid": STEEL})
    load = traction_load(mesh, mesh.surface("inner"), lambda x, n: -pressure * n)
    with Flexibility(body) as flexibility:
        u = flexibility.solve(load)[0::2]
    scale = pressure * inner**2 / (STEEL.young * (outer**2 - inner**2))

    def lame(r: np.ndarray) -> np.ndarray:
        return scale * ((1 - STEEL.poisson) * r + (1 + STEEL.poisson) * outer**2 / r)

    nodes = mesh.surface("bottom").nodes
    nodes = nodes[np.argsort(mesh.points[nodes, 0])]
    wall = mesh.points[nodes, 0]
    curve = ComparedCurve(
        x_label="radius [mm]",
        y_label="radial displacement [um]",
        expected=(wall * 1e3, lame(wall) * 1e6),
        computed=(wall * 1e3, u[nodes] * 1e6),
    )
    for name, r in (("inner", inner), ("outer", outer)):
        yield check(
            f"open tube under 100 MPa inside, radial displacement of the {name} wall [m]",
            expected=float(lame(np.array(r))),
            computed=float(u[mesh.surface(name).nodes].mean()),
            tolerance=1e-5,
            source="Lame 1852: u = p a^2/(E (b^2 - a^2)) ((1 - nu) r + (1 + nu) b^2/r)",
            curve=curve,
        )


def _press_fit() -> Iterator[Check]:
    """A hollow steel shaft in a ring of iron of the same length, 4 um on the diameter."""
    inside, joint, outside, height, overlap = 1e-3, 2e-3, 4e-3, 3e-3, 2e-6

    def drawn(a: float, b: float, inner: str, outer: str) -> Profile:
        ends = ((b, 0.0, "bottom"), (b, height, outer), (a, height, "top"), (a, 0.0, inner))
        return Profile((a, 0.0), tuple(Line((r, z), name) for r, z, name in ends))

    profiles = {
        "shaft": drawn(inside, joint, "bore", "joint"),
        "ring": drawn(joint, outside, "joint", "rim"),
    }
    materials = {"shaft": STEEL, "ring": replace(_BAR, young=120e9, poisson=0.25)}
    mesh = mesh_meridian(profiles, MeshSizing(size=0.15e-3))
    state = pressed_state(mesh, materials, [cylinder_joint(profiles, "joint")], [overlap])
    (found,) = state.joints
    shaft, ring = materials["shaft"], materials["ring"]
    wide = (outside**2 + joint**2) / (outside**2 - joint**2)
    narrow = (joint**2 + inside**2) / (joint**2 - inside**2)
    soft = (narrow - shaft.poisson) / shaft.young + (wide + ring.poisson) / ring.young
    pressure = overlap / (joint * soft)
    source = "Lame 1852, plane stress: p = overlap / (R (c_shaft + c_ring))"
    yield check(
        "press fit of two materials, mean pressure [Pa]",
        expected=pressure,
        computed=found.force / (2 * np.pi * joint * height),
        tolerance=1e-5,
        source=source,
    )
    yield check(
        "press fit of two materials, largest equivalent stress of the ring [Pa]",
        expected=pressure * np.sqrt(wide**2 + wide + 1),
        computed=state.stress["ring"],
        tolerance=1e-2,
        source=f"{source}; hoop stress p (b^2 + R^2)/(b^2 - R^2), radial -p",
    )


def _layer() -> Iterator[Check]:
    """Two equal rods of length l on a layer: E q tan(q l) = 2 k in modes that strain it."""
    radius, length, stiffness, loss = 0.3e-3, _LENGTH / 2, 1e13, 0.05
    profiles = {}
    for name, low, high in (("lower", -length, 0.0), ("upper", 0.0, length)):
        edges = (
            Line((radius, low), "" if low else "joint"),
            Line((radius, high), "side"),
            Line((0.0, high), "" if high else "joint"),
            Line((0.0, low), "axis"),
        )
        profiles[name] = Profile((0.0, low), edges)
    mesh, _ = parted(mesh_meridian(profiles, MeshSizing(size=radius)), ["joint"])
    given = Layer(name="joint", table=np.array([[1.0, stiffness, stiffness, loss]]), frequency=1.0)
    body = elastic_body("rods", mesh, dict.fromkeys(profiles, _BAR), layers=[given])
    modes = eigenmodes(body, count=1)
    x = brentq(lambda x: _BAR.young * x * np.tan(x) - 2 * stiffness * length, 1e-6, 1.5707)
    source = "waves in a rod, E q tan(q l) = 2 k"
    yield check(
        "two rods on a layer, first frequency [Hz]",
        expected=x / length * np.sqrt(_BAR.young / _BAR.density) / (2 * np.pi),
        computed=float(modes.frequency[0]),
        tolerance=1e-9,
        source=source,
    )
    # share of energy in the layer: derivative of the frequency by the stiffness
    share = 2.0 / (1.0 + 2.0 * x / np.sin(2.0 * x))
    yield check(
        "two rods on a layer, loss factor of the first mode [-]",
        expected=loss * share,
        computed=float(body.layers[0].loss(modes.omega, modes.shapes)[0]),
        tolerance=3e-8,
        source=f"{source}; loss factor times 2 dln w / dln k (Johnson & Kienholz 1982)",
    )


def _free_rod() -> Iterator[Check]:
    radius = 0.3e-3
    mesh = lattice_mesh("quad8", [np.array([0.0, radius]), np.linspace(0.0, _LENGTH, 81)])
    body = elastic_body("rod", mesh, {"solid": _BAR})
    area = np.pi * radius**2
    unit = traction_load(mesh, mesh.surface("top"), lambda x, n: n / area)
    spring = _BAR.young * area / _LENGTH
    with Flexibility(body) as flexibility:
        static = float(unit @ flexibility.solve(unit))
        modes = eigenmodes(body, count=max(_RESIDUAL), flexibility=flexibility)
    pulled = (mesh.points * [0.0, _STRETCH]).ravel()
    shift = work_of_stress(mesh, {"solid": _BAR}, pulled, modes.shapes) / (2 * modes.omega**2)
    yield check(
        "free-free rod under tension, shift of its first frequency over strain [-]",
        expected=0.5,
        computed=float(shift[0]) / _STRETCH,
        tolerance=1e-11,
        source="a wave sees E + sigma: half of sigma / E to first order (Poisson's ratio 0)",
    )
    yield check(
        "free-free rod, elastic static compliance of its end [L/(E A)]",
        expected=1 / 3,
        computed=static * spring,
        tolerance=1e-11,
        source="-cot(k L)/(E A k) + 1/(m w^2) at w = 0: L/(3 E A)",
    )
    carried = np.cumsum((unit @ modes.shapes) ** 2 / modes.omega**2)
    kept = np.arange(1.0, max(_RESIDUAL) + 1.0)
    curve = ComparedCurve(
        x_label="number of modes [-]",
        y_label="missing compliance [L/(E A)]",
        expected=(kept, 1 / 3 - 2 / np.pi**2 * np.cumsum(1 / kept**2)),
        computed=(kept, (static - carried) * spring),
        y_log=True,
    )
    for count, exact in _RESIDUAL.items():
        yield check(
            f"free-free rod, compliance of its end that {count} modes miss [L/(E A)]",
            expected=exact,
            computed=(static - float(carried[count - 1])) * spring,
            tolerance=1e-4,
            source="L/(E A) (1/3 - 2/pi^2 sum of 1/n^2, n = 1..N)",
            reason="one tolerance for 1, 5 and 10 modes; the error grows with the wave number",
            curve=curve,
        )


def _bent_beam() -> Iterator[Check]:
    """Pure bending without Poisson's ratio is a quadratic field: exact in quadratic elements."""
    height, length, curvature = 1e-3, 10e-3, 0.1
    across = np.array([-height / 2, 0.0, height / 2])
    for family in ("tet10", "hex20", "wedge15"):
        mesh = lattice_mesh(family, [across, across, np.linspace(0.0, length, 6)])
        body = elastic_body("beam", mesh, {"solid": _BAR}, fixed_nodes=mesh.surface("bottom").nodes)
        load = traction_load(
            mesh, mesh.surface("top"), lambda x, n: _BAR.young * curvature * x[:, :1] * n
        )
        with Flexibility(body) as flexibility:
            u = flexibility.solve(load).reshape(-1, 3)
        middle = np.argmin(np.linalg.norm(mesh.points - (0.0, 0.0, length), axis=1))
        yield check(
            f"beam in pure bending, deflection of its end, {family} [m]",
            expected=-curvature * length**2 / 2,
            computed=float(u[middle, 0]),
            tolerance=5e-10,
            source="Euler-Bernoulli, M L^2/(2 E I), exact for nu = 0",
            reason="round-off of the solution; one tolerance for all element families",
        )


def _solvers() -> Iterator[Check]:
    across, along = np.linspace(0.0, 1e-3, 4), np.linspace(0.0, 3e-3, 8)
    mesh = lattice_mesh("tet10", [across, across, along])
    body = elastic_body("block", mesh, {"solid": STEEL}, fixed_nodes=mesh.surface("bottom").nodes)
    load = traction_load(mesh, mesh.surface("top"), lambda x, n: 1e6 * n)
    answers = {name: _answer(body, load, name) for name in available_backends()}
    reference = answers["superlu"]
    for name, answer in answers.items():
        if name != "superlu":
            yield check(
                f"direct solver {name} against superlu, largest difference of displacement",
                expected=0.0,
                computed=float(np.abs(answer - reference).max() / np.abs(reference).max()),
                tolerance=5e-12,
                source="the same linear system, another factorisation",
            )


def _answer(body: ElasticBody, load: np.ndarray, backend: str) -> np.ndarray:
    with Flexibility(body, backend=backend) as flexibility:  # type: ignore[arg-type]
        return flexibility.solve(load)


_RITZ_ORDER = (
    "exact 3-D elasticity by Ritz (Legendre in z, regular polynomials in r), converged to 1e-7; "
    "free steel cylinder D4 x L30 mm, E = 210 GPa, nu = 0.3, rho = 7850 kg/m^3"
)
_BENDING_ORDER = {1: 19587.12, 2: 50362.64, 4: 137162.74, 8: 343817.26, 16: 564352.88}
"""Circumferential order 1: number of the mode -> frequency [Hz]."""
_BENDING_TOLERANCE = {1: 2e-6, 2: 4e-6, 4: 1e-5, 8: 5e-5, 16: 1e-4}
_OVAL = 543997.25
"""Circumferential order 2, mode 1 [Hz]."""


def fourier_checks() -> Iterator[Check]:
    """Bending, order 2, torsion, statics, and the axisymmetric body as order 0."""
    mesh = _cylinder(_RADIUS, _LENGTH, 6, 90)
    yield from _bending(_body(mesh, 1))
    yield from _other_orders(mesh)
    yield from _order_zero(mesh)
    yield from _pure_bending()
    yield from _slender()


def _cylinder(radius: float, length: float, across: int, along: int) -> Mesh:
    return lattice_mesh(
        "quad8", [np.linspace(0.0, radius, across + 1), np.linspace(0.0, length, along + 1)]
    )


def _body(mesh: Mesh, order: int) -> FourierBody:
    return fourier_body("cylinder", mesh, {"solid": STEEL}, order=order)


def _bending(body: FourierBody) -> Iterator[Check]:
    frequency = eigenmodes(body, count=max(_BENDING_ORDER)).frequency
    numbers = np.array(list(_BENDING_ORDER))
    curve = ComparedCurve(
        x_label="number of the bending mode [-]",
        y_label="frequency [kHz]",
        expected=(numbers, np.array(list(_BENDING_ORDER.values())) / 1e3),
        computed=(np.arange(1.0, len(frequency) + 1.0), frequency / 1e3),
    )
    for number, exact in _BENDING_ORDER.items():
        yield check(
            f"free cylinder in Fourier order 1, bending mode {number}, quad8 6 x 90 [Hz]",
            expected=exact,
            computed=float(frequency[number - 1]),
            tolerance=_BENDING_TOLERANCE[number],
            source=_RITZ_ORDER,
            curve=curve,
        )
    yield check(
        "free cylinder in order 1, higher of the two rigid modes [Hz]",
        expected=0.0,
        computed=float(rigid_frequencies(body).max()),
        tolerance=0.1,
        source="a shift and a rotation have the frequency zero",
    )


def _other_orders(mesh: Mesh) -> Iterator[Check]:
    yield check(
        "free cylinder in Fourier order 2, mode 1, quad8 6 x 90 [Hz]",
        expected=_OVAL,
        computed=float(eigenmodes(_body(mesh, 2), count=1).frequency[0]),
        tolerance=1e-4,
        source=_RITZ_ORDER,
    )
    yield check(
        "free cylinder in order 0, torsion mode 1, quad8 6 x 90 [Hz]",
        expected=float(np.sqrt(STEEL.shear_modulus / STEEL.density) / (2 * _LENGTH)),
        computed=float(eigenmodes(_body(mesh, 0), count=1).frequency[0]),
        tolerance=5e-9,
        source="sqrt(G / rho) / (2 L)",
    )


def _order_zero(mesh: Mesh) -> Iterator[Check]:
    materials = {"solid": STEEL}
    K, M = assemble_order(mesh, materials, 0)
    # U = a + b and V = b - a = 0
    node = np.array([[0.5, 0.0], [0.5, 0.0], [0.0, 1.0]])
    axial = csr_array(kron(eye_array(mesh.node_count), node))
    for name, found, expected in zip(
        ("stiffness", "mass"), (K, M), assemble(mesh, materials), strict=True
    ):
        yield check(
            f"order 0 without torsion against the axisymmetric {name}, largest difference",
            expected=0.0,
            computed=float(abs(axial.T @ found @ axial - expected).max() / abs(expected).max()),
            tolerance=1e-14,
            source="the same integrals",
        )


def _pure_bending() -> Iterator[Check]:
    """End moments on a free cylinder: quadratic elements have the field."""
    mesh = _cylinder(_RADIUS, _LENGTH, 2, 6)
    body = _body(mesh, 1)
    inertia = np.pi * _RADIUS**4 / 4

    def unit_moment(x: np.ndarray, n: np.ndarray) -> np.ndarray:
        return x[:, :1] / inertia * n[:, 1:] * [0.0, 0.0, 1.0]

    load = order_load(mesh, mesh.surface("bottom"), unit_moment, 1)
    load = load + order_load(mesh, mesh.surface("top"), unit_moment, 1)
    with Flexibility(body) as flexibility:
        angle = float(load @ flexibility.solve(load))
    yield check(
        "free cylinder between end moments, order 1: angle of its ends [L/(E I)]",
        expected=1.0,
        computed=angle * STEEL.young * inertia / _LENGTH,
        tolerance=5e-11,
        source="Saint-Venant, pure bending of a bar: M L/(E I), for any Poisson's ratio",
    )


def _slender() -> Iterator[Check]:
    radius, length = 1e-3, 60e-3
    frequency = eigenmodes(_body(_cylinder(radius, length, 3, 240), 1), count=2).frequency
    _, timoshenko = free_bar_frequencies(STEEL, radius, length)
    for number in (1, 2):
        yield check(
            f"free bar 30 diameters long, order 1, bending mode {number} [Hz]",
            expected=float(timoshenko[number - 1]),
            computed=float(frequency[number - 1]),
            tolerance=5e-6,
            source="Timoshenko beam (Huang 1961), shear coefficient of Hutchinson 2001",
        )


_ROOTS = (4.730040744862704, 7.853204624095838, 10.995607838001671)
"""cos x cosh x = 1: three modes."""


def free_bar_frequencies(
    material: Material, radius: float, length: float
) -> tuple[np.ndarray, np.ndarray]:
    r"""First three frequencies (3,) [Hz] after Euler-Bernoulli, and after Timoshenko.

    Frequency equation of the free beam with shear and rotary inertia: Huang 1961. Shear
    coefficient of the circle: Hutchinson 2001, :math:`6 (1 + \nu)^2 / (7 + 12 \nu + 4 \nu^2)`.

    Parameters
    ----------
    radius, length [m]
        At least 15 radii long: roots of shorter bars are not searched for.
    """
    nu = material.poisson
    shear = 6.0 * (1.0 + nu) ** 2 / (7.0 + 12.0 * nu + 4.0 * nu**2)
    r2 = (radius / (2.0 * length)) ** 2
    s2 = material.young / (shear * material.shear_modulus) * r2
    unit = np.sqrt(material.young / material.density) * radius / (2.0 * length**2) / (2.0 * np.pi)

    def determinant(b: float) -> float:
        root = np.sqrt((r2 - s2) ** 2 + 4.0 / b**2)
        alpha, beta = (b * np.sqrt((root - sign * (r2 + s2)) / 2.0) for sign in (1.0, -1.0))
        slope = b / np.sqrt(1.0 - b**2 * r2 * s2) * (b**2 * r2 * (r2 - s2) ** 2 + 3.0 * r2 - s2)
        # divided by cosh, which is large
        shared = slope * np.tanh(alpha) * np.sin(beta)
        return float(2.0 / np.cosh(alpha) - 2.0 * np.cos(beta) + shared)

    euler = np.array(_ROOTS) ** 2
    timoshenko = [brentq(determinant, 0.75 * x, 1.001 * x, xtol=1e-12) for x in euler]
    return unit * euler, unit * np.array(timoshenko)
