"""Layers between two solids of a body: stiffness, loss, limits.

Truth: two rods on a spring in closed form (waves along, and of torsion), with a complex stiffness
for the loss; rigid jumps, whose work is stiffness times area; the glued body and the free parts.
"""

from dataclasses import replace

import numpy as np
import pytest
from draws import each
from scipy.optimize import brentq

from klack.analyses.noise.body import ASSUMED_DAMPING
from klack.analyses.noise.body import damped as noisy
from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.fourier_body import fourier_body
from klack.bodies.elasticity.layer import Layer
from klack.bodies.reduction.damping import (
    LossFactor,
    ModalDamping,
    RayleighDamping,
    damping_ratios,
)
from klack.bodies.reduction.structure import build_structure
from klack.errors import InputError
from klack.materials.material import Material
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import ElementBlock, outer_surface
from klack.mesh.parting import parted
from klack.mesh.profile import Line, Profile
from klack.mesh.sizing import MeshSizing
from klack.mesh.swept import sweep
from klack.transient.body_damping import body_damping
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=200e9, poisson=0.0, density=8000.0)
BRASS = Material(name="brass", young=100e9, poisson=0.0, density=8500.0)
RADIUS, LENGTHS = 1e-3, (8e-3, 12e-3)


def layer(normal=2e13, across=1e13, loss=0.0, **more):
    """One stiffness and loss factor at all frequencies."""
    table = np.array([[1.0, normal, across, loss]])
    return Layer(name="joint", **{"table": table, "frequency": 1.0, **more})


def rods(size=0.5e-3):
    """Two round rods, one above the other, parted at their joint."""
    profiles = {}
    for name, low, high in (("lower", -LENGTHS[0], 0.0), ("upper", 0.0, LENGTHS[1])):
        edges = (
            Line((RADIUS, low), "joint" if low == 0.0 else "bottom"),
            Line((RADIUS, high), "side"),
            Line((0.0, high), "joint" if high == 0.0 else "top"),
            Line((0.0, low), "axis"),
        )
        profiles[name] = Profile((0.0, low), edges)
    return mesh_meridian(profiles, MeshSizing(size=size))


def equation_of(stiffness, moduli):
    """Zero at the angular frequencies of two free rods on a spring per area [N/m^3].

    With D = -E q tan(q l) of each, k (D1 + D2) + D1 D2 = 0, multiplied by both cosines.
    """

    def equation(omega):
        one, two = (
            (E * q * np.sin(q * length), np.cos(q * length))
            for E, material, length in zip(moduli, (STEEL, BRASS), LENGTHS, strict=True)
            for q in [omega * np.sqrt(material.density / E)]
        )
        return stiffness * (one[0] * two[1] + two[0] * one[1]) - one[0] * two[0]

    return equation


def rods_on_a_spring(stiffness, moduli=None):
    """Angular frequencies of the rods."""
    equation = equation_of(stiffness, moduli or YOUNG)
    grid = np.linspace(2e3, 3e6, 6000)
    values = equation(grid)
    at = np.flatnonzero(values[1:] * values[:-1] < 0.0)
    return np.array([brentq(equation, grid[k], grid[k + 1], xtol=1e-9) for k in at])


def damped(omega, stiffness, loss):
    """Loss factor of a mode with the complex stiffness: twice Im over Re of its frequency."""
    equation = equation_of(stiffness * (1.0 + 1j * loss), YOUNG)
    w = complex(omega)
    for _ in range(30):
        step = 1e-4 * omega
        w -= equation(w) / ((equation(w + step) - equation(w - step)) / (2.0 * step))
    return 2.0 * w.imag / w.real


MATERIALS = {"lower": STEEL, "upper": BRASS}
YOUNG = (STEEL.young, BRASS.young)
SHEAR = (STEEL.shear_modulus, BRASS.shear_modulus)


@each("stiffness", [1e11, 2e13, 1e15])
def test_rods_on_a_layer_have_the_frequencies_of_rods_on_a_spring(stiffness):
    """Without Poisson's ratio a rod is exactly one-dimensional; the rest is the mesh.

    It has 16 elements to the shortest wave, and errors go with the fourth power.
    """
    body = elastic_body("rods", parted(rods(), ["joint"])[0], MATERIALS, layers=[layer(stiffness)])
    exact = rods_on_a_spring(stiffness)
    assert eigenmodes(body, count=4).omega == pytest.approx(exact[:4], rel=2e-5)


def test_rods_in_torsion_have_the_stiffness_across():
    """The same equation with shear moduli, in Fourier order 0, whose torsion it is."""
    mesh, _ = parted(rods(), ["joint"])
    body = fourier_body("rods", mesh, MATERIALS, order=0, layers=[layer(1e15, 1e13)])
    modes = eigenmodes(body, count=20)
    radial, _, axial = np.abs(body.amplitudes(modes.shapes)).max(axis=0)
    turns = np.maximum(radial, axial) < 1e-3 * np.abs(modes.shapes).max(axis=0)
    exact = rods_on_a_spring(1e13, SHEAR)
    assert modes.omega[turns][:3] == pytest.approx(exact[:3], rel=1e-4)


@each("family", ["hex20", "tet10"])
def test_square_rods_of_solids_have_the_same_frequencies(family):
    """Axial modes of a thin bar of solids, two materials, among its others."""
    across = np.linspace(-0.25e-3, 0.25e-3, 2)
    mesh = lattice_mesh(family, [across, across, np.linspace(-LENGTHS[0], LENGTHS[1], 21)])
    (block,) = mesh.blocks
    upper = mesh.points[block.connectivity].mean(axis=1)[:, 2] > 0.0
    blocks = [ElementBlock(family, block.connectivity[at], name)
              for name, at in (("lower", ~upper), ("upper", upper))]  # fmt: skip
    joint = np.flatnonzero(np.abs(mesh.points[:, 2]) < 1e-9)
    mesh = replace(mesh, blocks=tuple(blocks), node_sets={"joint": joint})
    body = elastic_body("rods", parted(mesh, ["joint"])[0], MATERIALS, layers=[layer(2e13, 1e15)])
    modes = eigenmodes(body, max_frequency=200e3)
    axial = np.einsum("im,im->m", modes.shapes[2::3], (body.M @ modes.shapes)[2::3]) > 0.99
    exact = rods_on_a_spring(2e13)
    assert modes.omega[axial][:2] == pytest.approx(exact[:2], rel=1e-4)


def test_the_loss_of_a_mode_is_that_of_the_complex_stiffness():
    """First order in the loss factor: its error is of the third power (0.1 ** 2 of it)."""
    stiffness, loss = 2e13, 0.1
    body = elastic_body(
        "rods", parted(rods(), ["joint"])[0], MATERIALS, layers=[layer(stiffness, loss=loss)]
    )
    modes = eigenmodes(body, count=4)
    exact = [damped(w, stiffness, loss) for w in rods_on_a_spring(stiffness)[:4]]
    ratios = damping_ratios(LossFactor(eta=0.0), body, modes.omega, modes.shapes)
    assert 2.0 * ratios == pytest.approx(exact, rel=1e-2)
    both = damping_ratios(LossFactor(eta=0.02), body, modes.omega, modes.shapes)
    assert both == pytest.approx(ratios + 0.01, rel=1e-12)
    full = body_damping(RayleighDamping(alpha=3.0, beta=1e-9), modes, body)
    assert full.rate == pytest.approx(2.0 * ratios * modes.omega, rel=1e-12)
    assert (full.alpha, full.beta) == (3.0, 1e-9)


@each(("own", "expected"), [(0.0, ASSUMED_DAMPING), (1e-4, 1e-4)])
def test_the_assumed_damping_of_sound_is_beside_the_loss_of_layers(own, expected):
    """A layer damps the modes that strain it; a body without damping rings in all others."""
    mesh, _ = parted(rods(), ["joint"])
    held = mesh.surface("bottom").nodes
    body = elastic_body(
        "rods", mesh, MATERIALS, fixed_nodes=held, layers=[layer(1e13, 1e13, loss=1e-7)]
    )
    modes = eigenmodes(body, count=4)
    structure = build_structure(
        body,
        modes=modes,
        damping=ModalDamping(ratio=own),
        ports=[],
        deflections=np.zeros((body.dof_count, 0)),
        surfaces=["side"],
    )
    lost = 0.5 * body.layers[0].loss(modes.omega, modes.shapes)
    sounding = noisy(structure)
    assert sounding.damping == pytest.approx(expected + lost, rel=1e-12)
    assert (sounding is structure) == (own > 0.0)
    assert noisy(sounding) is sounding


def test_stiffness_at_other_frequencies_shifts_modes_as_the_closed_form():
    """A table that grows with the frequency: shift to first order against rods on that spring."""
    table = np.array([[1e3, 1.9e13, 1e13, 0.0], [1e6, 2.1e13, 1e13, 0.3]])
    given = layer(table=table, frequency=30e3)
    body = elastic_body("rods", parted(rods(), ["joint"])[0], MATERIALS, layers=[given])
    modes = eigenmodes(body, count=4)
    taken = float(given.at(30e3)[0])
    (one,) = body.layers
    for i, frequency in enumerate(modes.frequency):
        at = float(given.at(frequency)[0])
        exact = rods_on_a_spring(at)[i] / rods_on_a_spring(taken)[i] - 1.0
        assert one.shift(modes.omega, modes.shapes)[i] == pytest.approx(exact, rel=0.05, abs=1e-9)
    # loss at the frequency of each mode, linear in the logarithm
    share = sum(one.shares(modes.omega, modes.shapes))
    eta = 0.3 * np.log(modes.frequency / 1e3) / np.log(1e3)
    assert one.loss(modes.omega, modes.shapes) == pytest.approx(eta * share, rel=1e-12)
    assert list(given.covers(np.array([999.0, 1e3, 1e6, 1.1e6]))) == [False, True, True, False]


def test_a_stiff_layer_is_glue_and_a_soft_one_leaves_free_parts():
    """Deviation from the glued body as 1/k; free parts, and one mode of both masses."""
    mesh = rods()
    glued = eigenmodes(elastic_body("rods", mesh, MATERIALS), count=4).omega
    found = []
    for stiffness in (1e17, 1e18):
        body = elastic_body(
            "rods", parted(mesh, ["joint"])[0], MATERIALS, layers=[layer(stiffness, stiffness)]
        )
        found.append(np.abs(eigenmodes(body, count=4).omega / glued - 1.0).max())
    assert found[0] < 2e-3
    assert found[1] == pytest.approx(found[0] / 10.0, rel=0.02)
    body = elastic_body("rods", parted(mesh, ["joint"])[0], MATERIALS, layers=[layer(1e8, 1e8)])
    area = np.pi * RADIUS**2
    masses = [m.density * area * length for m, length in zip((STEEL, BRASS), LENGTHS, strict=True)]
    free = [
        n * np.pi * np.sqrt(m.young / m.density) / length
        for m, length in zip((STEEL, BRASS), LENGTHS, strict=True)
        for n in (1, 2)
    ]
    expected = [np.sqrt(1e8 * area * sum(1 / m for m in masses)), *sorted(free)[:2]]
    assert eigenmodes(body, count=3).omega == pytest.approx(expected, rel=1e-4)


def sleeve(model):
    """A ring round a shaft, parted at the cylinder between them."""
    parts = {
        "shaft": [(0.0, 0.0), (1e-3, 0.0), (1e-3, 2e-3), (0.0, 2e-3)],
        "ring": [(1e-3, 0.0), (2e-3, 0.0), (2e-3, 2e-3), (1e-3, 2e-3)],
    }
    names = {
        "shaft": ["bottom", "joint", "top", "axis"],
        "ring": ["below", "rim", "above", "joint"],
    }
    profiles = {
        solid: Profile(
            corners[0],
            tuple(
                Line(end, name)
                for end, name in zip([*corners[1:], corners[0]], names[solid], strict=True)
            ),
        )
        for solid, corners in parts.items()
    }
    mesh = mesh_meridian(profiles, MeshSizing(size=0.7e-3))
    return parted(sweep(mesh, 24) if model == "swept" else mesh, ["joint"])[0]


def work(body, motion, mesh):
    """Work of the layer when the ring moves as told [N/m]: twice its energy."""
    per_node = body.K.shape[0] // mesh.node_count
    own = np.unique(
        np.concatenate([b.connectivity.ravel() for b in mesh.blocks if b.solid == "ring"])
    )
    u = np.zeros((mesh.node_count, per_node))
    u[own] = motion(mesh.points[own])
    return float(u.ravel() @ body.layers[0].matrix @ u.ravel())


def test_a_rigid_jump_does_the_work_of_stiffness_times_area():
    """A shift along the axis slides on the cylinder; one across it presses on half, slides on half.

    The swept model has curved faces of 15 degrees (1e-3).
    """
    k_n, k_t = 3e12, 1e12
    area = 2 * np.pi * 1e-3 * 2e-3
    steels = {"shaft": STEEL, "ring": STEEL}
    mesh = sleeve("half")
    axial = elastic_body("s", mesh, steels, layers=[layer(k_n, k_t)])
    assert work(axial, lambda x: [0.0, 1.0], mesh) == pytest.approx(k_t * area, rel=1e-12)
    assert axial.layers[0].area == pytest.approx(area, rel=1e-12)
    for order, motion, exact in (
        (0, lambda x: [0.0, 0.0, 1.0], k_t * area),
        (0, lambda x: np.outer(x[:, 0], [-0.5, 0.5, 0.0]), k_t * area * 1e-3**2),
        (1, lambda x: [1.0, 0.0, 0.0], 0.5 * (k_n + k_t) * area),
    ):
        body = fourier_body("s", mesh, steels, order=order, layers=[layer(k_n, k_t)])
        assert work(body, motion, mesh) == pytest.approx(exact, rel=1e-12)
    mesh = sleeve("swept")
    solid = elastic_body("s", mesh, steels, layers=[layer(k_n, k_t)])
    assert work(solid, lambda x: [0.0, 0.0, 1.0], mesh) == pytest.approx(k_t * area, rel=1e-3)
    assert work(solid, lambda x: [1.0, 0.0, 0.0], mesh) == pytest.approx(
        0.5 * (k_n + k_t) * area, rel=1e-3
    )


def test_a_parted_mesh_keeps_surfaces_sets_and_skin():
    """The joint is no outer surface; each surface keeps its places; a glued rim stays one."""
    mesh = rods()
    apart, _ = parted(mesh, ["joint"])
    assert apart.node_count == mesh.node_count + len(mesh.node_sets["joint"])
    assert outer_surface(apart).face_count == outer_surface(mesh).face_count
    for name, surface in mesh.surfaces.items():
        for old, new in zip(surface.blocks, apart.surfaces[name].blocks, strict=True):
            assert np.array_equal(mesh.points[old.connectivity], apart.points[new.connectivity])
    pair = apart.pairs["joint"]
    for one, other in zip(pair.first, pair.second, strict=True):
        assert np.array_equal(apart.points[one.connectivity], apart.points[other.connectivity])
        assert not np.isin(one.connectivity, other.connectivity).any()
    # a third part round the joint joins both: its corner stays one node
    low = Profile(
        (0.0, 0.0),
        (
            Line((1.0, 0.0), "a"),
            Line((1.0, 1.0), "b"),
            Line((0.0, 1.0), "joint"),
            Line((0.0, 0.0), "c"),
        ),
    )
    high = Profile(
        (0.0, 1.0),
        (
            Line((1.0, 1.0), "joint"),
            Line((1.0, 2.0), "d"),
            Line((0.0, 2.0), "e"),
            Line((0.0, 1.0), "f"),
        ),
    )
    round_it = Profile(
        (1.0, 0.0),
        (
            Line((2.0, 0.0), "g"),
            Line((2.0, 2.0), "h"),
            Line((1.0, 2.0), "i"),
            Line((1.0, 1.0), "d"),
            Line((1.0, 0.0), "b"),
        ),
    )
    mesh = mesh_meridian({"low": low, "high": high, "round": round_it}, MeshSizing(size=0.5))
    apart, _ = parted(mesh, ["joint"])
    assert apart.node_count == mesh.node_count + len(mesh.node_sets["joint"]) - 1


def test_layers_that_cannot_be_are_refused():
    """No such faces, faces of three solids, a layer like steel of no thickness, one like air."""
    mesh = rods()
    with pytest.raises(
        InputError, match=r"joint .seam.: got a name of no face between two solids.*here: joint"
    ):
        parted(mesh, ["seam"])
    for numbers, said in (
        ((1e24, 1e13), "normal stiffness .* times as stiff"),
        ((1.0, 1e13), "normal stiffness .* times as soft"),
        ((1e13, 1.0), "tangential stiffness .* times as soft"),
    ):
        with pytest.raises(InputError, match=r"bodies\.rods\.layers\.joint: got a " + said):
            elastic_body("rods", parted(mesh, ["joint"])[0], MATERIALS, layers=[layer(*numbers)])
