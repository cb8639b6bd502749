"""Surface integrals and static rests of a structure against closed formulas."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from klack.acoustics.plate import Air
from klack.acoustics.radiation import power_transfer
from klack.elasticity.body import elastic_body
from klack.elasticity.eigen import Modes, eigenmodes
from klack.elasticity.statics import Flexibility
from klack.mesh.mesh import Mesh, outer_surface
from klack.reduction.damping import ModalDamping
from klack.reduction.ports import surface_port
from klack.reduction.structure import Structure, StructurePort, build_structure
from klack.verification.lattice import lattice_mesh
from klack.verification.reduction import LENGTH, RADIUS, STEEL_WITHOUT_POISSON
from klack.verification.vibration import STEEL, rod_structure

A, B, C = 3e-3, 2e-3, 5e-3  # [m]


def sounding(
    mesh: Mesh, field: np.ndarray, held: str, *surfaces: str, **extra: object
) -> Structure:
    """Structure whose only mode is a given displacement field, shape (n, dimension)."""
    body = elastic_body("body", mesh, {"solid": STEEL}, fixed_nodes=mesh.surface(held).nodes)
    modes = Modes(omega=np.array([1e5]), shapes=field.reshape(-1, 1))
    port = surface_port(mesh, surfaces[0], "z", name="port")
    return build_structure(
        body,
        modes=modes,
        damping=ModalDamping(ratio=0.01),
        ports=[StructurePort(port=port)],
        deflections=np.zeros((body.dof_count, 1)),
        surfaces=surfaces,
        **extra,  # type: ignore[arg-type]
    )


@pytest.mark.parametrize("family", ["tet10", "hex20", "wedge15", "tet4", "hex8"])
def test_integrals_over_the_faces_of_a_solid(family: str) -> None:
    """u_z = x y (quadratic families) or x, and u_x = z, over rectangles; exact in the elements."""
    mesh = lattice_mesh(family, [np.linspace(0, length, 3) for length in (A, B, C)])
    x, y, z = mesh.points.T
    quadratic = family in ("tet10", "hex20", "wedge15")
    height = x * y if quadratic else x
    field = np.column_stack([z, 0 * x, height])

    s = sounding(mesh, field, "bottom", "top", "left", "right")

    square = A**3 * B**3 / 9 if quadratic else A**3 * B / 3
    volume = A**2 * B**2 / 4 if quadratic else A**2 * B / 2
    assert s.group_names == ("top", "left", "right")
    assert s.group_area == pytest.approx([A * B, B * C, B * C], rel=1e-12)
    assert s.group_gram[0, 0, 0] == pytest.approx(square, rel=1e-12)
    assert s.group_gram[0, 0, -1] == pytest.approx(volume, rel=1e-12)  # against a unit axial motion
    assert s.group_gram[0, -1, -1] == pytest.approx(A * B, rel=1e-12)
    assert s.group_volume[0, 0] == pytest.approx(volume, rel=1e-12)
    assert s.group_gram[1:, 0, 0] == pytest.approx([B * C**3 / 3] * 2, rel=1e-12)
    assert s.group_volume[1:, 0] == pytest.approx([-B * C**2 / 2, B * C**2 / 2], rel=1e-12)
    assert np.abs(s.group_gram[1:, -1, -1]).max() < 1e-20 * A * B


def test_integrals_over_rings() -> None:
    """u_z = r^2 on the end, u_r = z on the side of a cylinder, dA = 2 pi r ds."""
    mesh = lattice_mesh("quad8", [np.linspace(0, A, 4), np.linspace(0, C, 5)])
    r, z = mesh.points.T

    s = sounding(mesh, np.column_stack([z, r**2]), "bottom", "top", "outer")

    pi = np.pi
    assert s.group_area == pytest.approx([pi * A**2, 2 * pi * A * C], rel=1e-12)
    assert s.group_gram[0, 0, 0] == pytest.approx(pi * A**6 / 3, rel=1e-12)
    assert s.group_volume[0, 0] == pytest.approx(pi * A**4 / 2, rel=1e-12)
    assert s.group_gram[1, 0, 0] == pytest.approx(2 * pi * A * C**3 / 3, rel=1e-12)
    assert s.group_volume[1, -1] == pytest.approx(0.0, abs=1e-18)


def test_a_sphere_that_oscillates_as_a_whole() -> None:
    """Integral of n_z^2 over a sphere: 4 pi a^2 / 3; lines on the axis have no area."""

    def ring(x: np.ndarray) -> np.ndarray:
        return np.column_stack([x[:, 0] * np.sin(x[:, 1]), -x[:, 0] * np.cos(x[:, 1])])

    mesh = lattice_mesh("quad8", [np.array([0.5 * A, A]), np.linspace(0, np.pi, 41)], ring)

    s = sounding(mesh, np.zeros_like(mesh.points), "inner", "outer", "bottom", "top")

    assert s.group_names == ("outer",)
    assert s.area == pytest.approx(4 * np.pi * A**2, rel=1e-6)  # parabolas instead of arcs
    assert s.group_gram[0, -1, -1] == pytest.approx(4 * np.pi * A**2 / 3, rel=1e-6)
    assert abs(s.group_volume[0, -1]) < 1e-12 * s.area


def test_means_over_faces_add_up_to_the_groups() -> None:
    mesh = lattice_mesh("tet10", [np.linspace(0, length, 3) for length in (A, B, C)])
    x, y, z = mesh.points.T
    s = sounding(mesh, np.column_stack([y * z, x * z, x * y]), "bottom", "top", "left")

    for g in range(2):
        own = s.face_group == g
        assert s.face_area[own].sum() == pytest.approx(s.group_area[g], rel=1e-12)
        volume = s.face_area[own] @ s.face_shapes[own].astype(float)
        assert volume == pytest.approx(s.group_volume[g, :1], rel=1e-6)  # single precision
    corners = s.points[s.faces]  # plane triangles
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    assert s.faces.shape[1] == 3
    assert area / 2 == pytest.approx(np.linalg.norm(s.face_area), rel=1e-12)


def test_a_face_counts_once() -> None:
    mesh = lattice_mesh("hex20", [np.linspace(0, length, 3) for length in (A, B, C)])
    mesh = replace(mesh, surfaces={**mesh.surfaces, "skin": outer_surface(mesh)})
    field = np.zeros((mesh.node_count, 3))
    whole = 2 * (A * B + B * C + A * C)

    twice = sounding(mesh, field, "bottom", "top", "skin")
    without = sounding(mesh, field, "bottom", "skin", left_out=("bottom", "left"))

    assert twice.group_area == pytest.approx([A * B, whole - A * B], rel=1e-12)
    assert without.group_area == pytest.approx([whole - A * B - B * C], rel=1e-12)


@pytest.mark.parametrize("modes", [1, 5, 12])
def test_static_motion_of_a_face_is_whole_for_any_number_of_modes(modes: int) -> None:
    """A rod pulled down at its free end by 1 N stretches by L / (E A)."""
    s = rod_structure(modes=modes)
    stretch = LENGTH / (STEEL_WITHOUT_POISSON.young * np.pi * RADIUS**2)

    end = s.face_group == s.group_names.index("bottom")
    modal = s.face_shapes[end].astype(float) @ (s.port_shapes[:, 0] / s.omega**2)
    moved = -(modal + s.face_residual[end, 0])  # the end faces down

    assert moved == pytest.approx(np.full(end.sum(), stretch), rel=1e-5)  # single precision
    assert s.static_compliance[0, 0] == pytest.approx(stretch, rel=1e-8)


def test_participation_of_a_rod() -> None:
    """Share of the mass in mode n of a held rod: 8 / (pi (2 n - 1))^2."""
    s = rod_structure(modes=4)

    share = s.participation**2 / s.mass

    odd = 2 * np.arange(1, 5) - 1
    assert share == pytest.approx(8 / (np.pi * odd) ** 2, rel=1e-4)  # mesh of 80 elements


@pytest.mark.parametrize(("modes", "most"), [(6, 5e-3), (20, 1e-4)])
def test_power_transfer_against_the_full_body(modes: int, most: float) -> None:
    """A thick ring with Poisson's ratio, loaded at its inner edge: direct harmonic solution."""
    mesh = lattice_mesh("quad8", [np.linspace(2e-3, 5e-3, 5), np.linspace(0, 8e-3, 9)])
    body = elastic_body("ring", mesh, {"solid": STEEL}, fixed_nodes=mesh.surface("bottom").nodes)
    port = surface_port(mesh, "inner", "z", name="port")
    with Flexibility(body) as flexibility:
        structure = build_structure(
            body,
            modes=eigenmodes(body, count=modes, flexibility=flexibility),
            damping=ModalDamping(ratio=0.0),
            ports=[StructurePort(port=port)],
            deflections=flexibility.solve(port.pattern[:, None]),
            surfaces=("top", "outer"),
        )
    frequency = np.array([2e3, 2e4, 8e4, 1.45e5])  # first modes at 163 and 248 kHz
    powers = power_transfer(structure, frequency, "port", efficiency="unity").values

    keep = body.free
    for f, computed in zip(frequency, powers.T, strict=True):
        omega = 2 * np.pi * f
        u = np.zeros(body.dof_count)
        dynamic = (body.K - omega**2 * body.M)[keep][:, keep]
        u[keep] = spsolve(dynamic.tocsc(), port.pattern[keep])
        exact = [_squares(mesh, name, omega * u) for name in ("top", "outer")]
        assert computed == pytest.approx(Air().impedance * np.array(exact), rel=most)


def _squares(mesh: Mesh, surface: str, u: np.ndarray) -> float:
    """Integral of the squared normal displacement over a flat or round surface."""
    total = 0.0
    normal = 1 if surface == "top" else 0
    xi, weight = np.polynomial.legendre.leggauss(5)
    shape = np.stack([xi * (xi - 1) / 2, xi * (xi + 1) / 2, 1 - xi**2], axis=1)  # ends, middle
    for block in mesh.surface(surface).blocks:
        for nodes in block.connectivity:
            r = shape @ mesh.points[nodes, 0]
            length = np.linalg.norm(mesh.points[nodes[1]] - mesh.points[nodes[0]])
            moved = shape @ u.reshape(-1, 2)[nodes, normal]
            total += float(np.sum(weight * moved**2 * 2 * np.pi * r) * length / 2)
    return total
