"""Finite elements against exact elasticity: vibration, bending, thick cylinder, rods, beam."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from klack.elasticity.body import ElasticBody, elastic_body
from klack.elasticity.eigen import eigenmodes, rigid_frequencies
from klack.elasticity.factorization import available_backends
from klack.elasticity.loads import traction_load
from klack.elasticity.statics import Flexibility
from klack.materials import Material
from klack.mesh.mesh import Mesh
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.fourier_orders import fourier_checks
from klack.verification.lattice import lattice_mesh

__all__ = ["checks"]

_GROUP = "elasticity"
_STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
_BAR = Material(name="bar", young=210e9, poisson=0.0, density=7850.0)
_RADIUS, _LENGTH = 2e-3, 30e-3

_RITZ = (
    "exact 3-D elasticity by Ritz (Legendre in z, regular polynomials in r), converged to 1e-8; "
    "free steel cylinder D4 x L30 mm, E = 210 GPa, nu = 0.3, rho = 7850 kg/m^3"
)
_AXIAL = {1: 86117.56, 2: 171706.49, 4: 338712.02, 8: 623091.92, 12: 752468.26}
"""Circumferential order 0: number of the mode -> frequency [Hz]."""
_AXIAL_TOLERANCE = {1: 1e-6, 2: 5e-8, 4: 2e-6, 8: 2e-5, 12: 1e-4}
"""Error of the mesh, which grows with the fourth power of the wave number."""
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
        *_free_rod(),
        *_bent_beam(),
        *_solvers(),
    ]


def _axisymmetric_cylinder() -> Iterator[Check]:
    lines = [np.linspace(0.0, _RADIUS, 7), np.linspace(0.0, _LENGTH, 91)]
    body = elastic_body("cylinder", lattice_mesh("quad8", lines), {"solid": _STEEL})
    frequency = eigenmodes(body, count=max(_AXIAL)).frequency
    numbers = np.array(list(_AXIAL))
    curve = ComparedCurve(
        x_label="number of the axisymmetric mode [-]",
        y_label="frequency [kHz]",
        expected=(numbers, np.array(list(_AXIAL.values())) / 1e3),
        computed=(numbers, frequency[numbers - 1] / 1e3),
    )
    for number, exact in _AXIAL.items():
        yield compare(
            _GROUP,
            f"free cylinder, axisymmetric mode {number}, quad8 6 x 90 [Hz]",
            expected=exact,
            computed=frequency[number - 1],
            tolerance=_AXIAL_TOLERANCE[number],
            source=_RITZ,
            curve=curve,
        )


def _solid_cylinder() -> Iterator[Check]:
    body = elastic_body("cylinder", _round_bar("hex20"), {"solid": _STEEL})
    frequency = eigenmodes(body, count=8).frequency
    for number, exact in _BENDING.items():
        pair = np.sort(frequency[np.argsort(np.abs(frequency / exact - 1))[:2]])
        yield compare(
            _GROUP,
            f"free cylinder, bending mode {number}, hex20 4 x 4 x 16 [Hz]",
            expected=exact,
            computed=float(pair.mean()),
            tolerance=1e-3,
            source=_RITZ,
        )
    yield compare(
        _GROUP,
        "free cylinder, highest of the six rigid modes [Hz]",
        expected=0.0,
        computed=float(rigid_frequencies(body).max()),
        tolerance=0.1,
        source="a free body has six modes of frequency zero",
    )


def _round_bar(family: str) -> Mesh:
    """Square bar 4 x 4 x 16 whose cross section is mapped onto the disc."""

    def rounded(points: NDArray[np.float64]) -> NDArray[np.float64]:
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
    lines = [np.geomspace(inner, outer, 13), np.linspace(0.0, 2e-3, 3)]
    mesh = lattice_mesh("quad8", lines)
    body = elastic_body("tube", mesh, {"solid": _STEEL})
    load = traction_load(mesh, mesh.surface("inner"), lambda x, n: -pressure * n)
    with Flexibility(body) as flexibility:
        u = flexibility.solve(load)[0::2]
    scale = pressure * inner**2 / (_STEEL.young * (outer**2 - inner**2))

    def lame(r: NDArray[np.float64]) -> NDArray[np.float64]:
        return scale * ((1 - _STEEL.poisson) * r + (1 + _STEEL.poisson) * outer**2 / r)

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
        yield compare(
            _GROUP,
            f"open tube under 100 MPa inside, radial displacement of the {name} wall [m]",
            expected=float(lame(np.array(r))),
            computed=float(u[mesh.surface(name).nodes].mean()),
            tolerance=1e-5,
            source="Lame 1852: u = p a^2/(E (b^2 - a^2)) ((1 - nu) r + (1 + nu) b^2/r)",
            curve=curve,
        )


def _free_rod() -> Iterator[Check]:
    radius = 0.3e-3
    lines = [np.array([0.0, radius]), np.linspace(0.0, _LENGTH, 81)]
    mesh = lattice_mesh("quad8", lines)
    body = elastic_body("rod", mesh, {"solid": _BAR})
    area = np.pi * radius**2
    unit = traction_load(mesh, mesh.surface("top"), lambda x, n: n / area)
    spring = _BAR.young * area / _LENGTH
    with Flexibility(body) as flexibility:
        static = float(unit @ flexibility.solve(unit))
        modes = eigenmodes(body, count=max(_RESIDUAL), flexibility=flexibility)
    yield compare(
        _GROUP,
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
        yield compare(
            _GROUP,
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
        yield compare(
            _GROUP,
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
    body = elastic_body("block", mesh, {"solid": _STEEL}, fixed_nodes=mesh.surface("bottom").nodes)
    load = traction_load(mesh, mesh.surface("top"), lambda x, n: 1e6 * n)
    answers = {name: _answer(body, load, name) for name in available_backends()}
    reference = answers["superlu"]
    for name, answer in answers.items():
        if name != "superlu":
            yield compare(
                _GROUP,
                f"direct solver {name} against superlu, largest difference of displacement",
                expected=0.0,
                computed=float(np.abs(answer - reference).max() / np.abs(reference).max()),
                tolerance=5e-12,
                source="the same linear system, another factorisation",
            )


def _answer(body: ElasticBody, load: NDArray[np.float64], backend: str) -> NDArray[np.float64]:
    with Flexibility(body, backend=backend) as flexibility:  # type: ignore[arg-type]
        return flexibility.solve(load)
