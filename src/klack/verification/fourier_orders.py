"""Bodies of revolution in Fourier orders around their axis, for the group of elasticity."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array, kron

from klack.elasticity.assembly import assemble, assemble_order
from klack.elasticity.eigen import eigenmodes, rigid_frequencies
from klack.elasticity.fourier_body import FourierBody, fourier_body
from klack.elasticity.loads import order_load
from klack.elasticity.statics import Flexibility
from klack.materials import Material
from klack.mesh.mesh import Mesh
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.lattice import lattice_mesh
from klack.verification.timoshenko_beam import free_bar_frequencies

__all__ = ["fourier_checks"]

_GROUP = "elasticity"
_STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
_RADIUS, _LENGTH = 2e-3, 30e-3

_RITZ = (
    "exact 3-D elasticity by Ritz (Legendre in z, regular polynomials in r), converged to 1e-7; "
    "free steel cylinder D4 x L30 mm, E = 210 GPa, nu = 0.3, rho = 7850 kg/m^3"
)
_BENDING = {1: 19587.12, 2: 50362.64, 4: 137162.74, 8: 343817.26, 16: 564352.88}
"""Circumferential order 1: number of the mode -> frequency [Hz]."""
_BENDING_TOLERANCE = {1: 2e-6, 2: 4e-6, 4: 1e-5, 8: 5e-5, 16: 1e-4}
"""Error of the mesh."""
_OVAL = 543997.25
"""Circumferential order 2, mode 1 [Hz]."""


def fourier_checks() -> Iterator[Check]:
    """Bending, order 2, torsion, statics, and the axisymmetric body as order 0."""
    mesh = _cylinder(_RADIUS, _LENGTH, 6, 90)
    bending = _body(mesh, 1)
    yield from _bending(bending)
    yield from _other_orders(mesh)
    yield from _order_zero(mesh)
    yield from _pure_bending()
    yield from _slender()


def _cylinder(radius: float, length: float, across: int, along: int) -> Mesh:
    lines = [np.linspace(0.0, radius, across + 1), np.linspace(0.0, length, along + 1)]
    return lattice_mesh("quad8", lines)


def _body(mesh: Mesh, order: int) -> FourierBody:
    return fourier_body("cylinder", mesh, {"solid": _STEEL}, order=order)


def _bending(body: FourierBody) -> Iterator[Check]:
    frequency = eigenmodes(body, count=max(_BENDING)).frequency
    numbers = np.array(list(_BENDING))
    curve = ComparedCurve(
        x_label="number of the bending mode [-]",
        y_label="frequency [kHz]",
        expected=(numbers, np.array(list(_BENDING.values())) / 1e3),
        computed=(np.arange(1.0, len(frequency) + 1.0), frequency / 1e3),
    )
    for number, exact in _BENDING.items():
        yield compare(
            _GROUP,
            f"free cylinder in Fourier order 1, bending mode {number}, quad8 6 x 90 [Hz]",
            expected=exact,
            computed=float(frequency[number - 1]),
            tolerance=_BENDING_TOLERANCE[number],
            source=_RITZ,
            curve=curve,
        )
    yield compare(
        _GROUP,
        "free cylinder in order 1, higher of the two rigid modes [Hz]",
        expected=0.0,
        computed=float(rigid_frequencies(body).max()),
        tolerance=0.1,
        source="a shift and a rotation have the frequency zero",
    )


def _other_orders(mesh: Mesh) -> Iterator[Check]:
    yield compare(
        _GROUP,
        "free cylinder in Fourier order 2, mode 1, quad8 6 x 90 [Hz]",
        expected=_OVAL,
        computed=float(eigenmodes(_body(mesh, 2), count=1).frequency[0]),
        tolerance=1e-4,
        source=_RITZ,
    )
    yield compare(
        _GROUP,
        "free cylinder in order 0, torsion mode 1, quad8 6 x 90 [Hz]",
        expected=float(np.sqrt(_STEEL.shear_modulus / _STEEL.density) / (2 * _LENGTH)),
        computed=float(eigenmodes(_body(mesh, 0), count=1).frequency[0]),
        tolerance=5e-9,
        source="sqrt(G / rho) / (2 L)",
    )


def _order_zero(mesh: Mesh) -> Iterator[Check]:
    materials = {"solid": _STEEL}
    K, M = assemble_order(mesh, materials, 0)
    # U = a + b and V = b - a = 0
    node = np.array([[0.5, 0.0], [0.5, 0.0], [0.0, 1.0]])
    axial = csr_array(kron(eye_array(mesh.node_count), node))
    names = ("stiffness", "mass")
    for name, found, expected in zip(names, (K, M), assemble(mesh, materials), strict=True):
        difference = abs(axial.T @ found @ axial - expected).max() / abs(expected).max()
        yield compare(
            _GROUP,
            f"order 0 without torsion against the axisymmetric {name}, largest difference",
            expected=0.0,
            computed=float(difference),
            tolerance=1e-14,
            source="the same integrals",
        )


def _pure_bending() -> Iterator[Check]:
    """End moments on a free cylinder: quadratic elements have the field."""
    mesh = _cylinder(_RADIUS, _LENGTH, 2, 6)
    body = _body(mesh, 1)
    inertia = np.pi * _RADIUS**4 / 4

    def unit_moment(x: NDArray[np.float64], n: NDArray[np.float64]) -> NDArray[np.float64]:
        return x[:, :1] / inertia * n[:, 1:] * [0.0, 0.0, 1.0]

    load = order_load(mesh, mesh.surface("bottom"), unit_moment, 1)
    load = load + order_load(mesh, mesh.surface("top"), unit_moment, 1)
    with Flexibility(body) as flexibility:
        angle = float(load @ flexibility.solve(load))
    yield compare(
        _GROUP,
        "free cylinder between end moments, order 1: angle of its ends [L/(E I)]",
        expected=1.0,
        computed=angle * _STEEL.young * inertia / _LENGTH,
        tolerance=5e-11,
        source="Saint-Venant, pure bending of a bar: M L/(E I), for any Poisson's ratio",
    )


def _slender() -> Iterator[Check]:
    radius, length = 1e-3, 60e-3
    mesh = _cylinder(radius, length, 3, 240)
    frequency = eigenmodes(_body(mesh, 1), count=2).frequency
    _, timoshenko = free_bar_frequencies(_STEEL, radius, length)
    for number in (1, 2):
        yield compare(
            _GROUP,
            f"free bar 30 diameters long, order 1, bending mode {number} [Hz]",
            expected=float(timoshenko[number - 1]),
            computed=float(frequency[number - 1]),
            tolerance=5e-6,
            source="Timoshenko beam (Huang 1961), shear coefficient of Hutchinson 2001",
        )
