"""Press fits of drawn parts and STEP solids, and the stiffness that their stress gives to modes.

Truth: Lame's thick cylinders of one length with free ends (plane stress), exact at any length;
reciprocity of two joints (Betti); the work of closed fields for the stiffness of an initial stress;
CalculiX on the same mesh.
"""

import subprocess
from dataclasses import replace

import numpy as np
import pytest
from draws import each

from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.press_fit import pressed_state
from klack.bodies.elasticity.stress import work_of_stress
from klack.errors import InputError
from klack.exchange.calculix_run import find_calculix
from klack.materials.material import Material
from klack.mesh.joint import cylinder_joint
from klack.mesh.meridian import mesh_meridian
from klack.mesh.profile import Line, Profile
from klack.mesh.rigid import Pose
from klack.mesh.sizing import MeshSizing
from klack.mesh.solid import mesh_step, write_step_revolved
from klack.mesh.solid_joint import solid_joint
from klack.verification.lattice import STEEL, lattice_mesh

IRON = Material(name="iron", young=120e9, poisson=0.25, density=7300.0)
BAR = replace(STEEL, poisson=0.0)


def ring(inside, outside, low, high, inner="bore", outer="rim"):
    """Rectangle of a half section; a bore of radius 0 is the axis."""
    return Profile(
        (inside, low),
        (
            Line((outside, low), "bottom"),
            Line((outside, high), outer),
            Line((inside, high), "top"),
            Line((inside, low), inner),
        ),
    )


def lame(radii, materials, overlap):
    """Pressure of two cylinders in plane stress (Lame 1852), overlap on the radius."""
    (a, R, b), (one, other) = radii, materials
    inside = ((R**2 + a**2) / (R**2 - a**2) - one.poisson) / one.young
    outside = ((b**2 + R**2) / (b**2 - R**2) + other.poisson) / other.young
    return overlap / (R * (inside + outside))


def pressed(profiles, materials, overlaps, size):
    """State of joints of these names and overlaps."""
    joints = [cylinder_joint(profiles, name) for name in overlaps]
    mesh = mesh_meridian(profiles, MeshSizing(size=size))
    return pressed_state(mesh, materials, joints, list(overlaps.values())), joints, mesh


def two_rings(radii, height):
    a, R, b = radii
    return {
        "shaft": ring(a, R, 0.0, height, outer="joint"),
        "hub": ring(R, b, 0.0, height, inner="joint"),
    }


@pytest.mark.slow
@each(
    ("radii", "height"),
    [((0.0, 2e-3, 4e-3), 3e-3), ((1e-3, 2e-3, 2.6e-3), 1e-3), ((1.5e-3, 2e-3, 6e-3), 2e-3)],
)
def test_two_cylinders_have_the_pressure_and_stress_of_lame(radii, height):
    """The pressure converges with the fourth power of the size, nodal stresses with the square.

    Halved sizes: an error of the pressure 16 times smaller on regular meshes; these are not nested,
    5 times is asked for.
    """
    overlap = 1e-6
    materials = {"shaft": STEEL, "hub": IRON}
    exact = lame(radii, (STEEL, IRON), overlap)
    a, R, b = radii
    hoop = exact * (b**2 + R**2) / (b**2 - R**2)
    equivalent = np.sqrt(hoop**2 + hoop * exact + exact**2)
    errors = []
    for size in (0.25e-3, 0.125e-3):
        state, (joint,), _ = pressed(two_rings(radii, height), materials, {"joint": overlap}, size)
        (found,) = state.joints
        mean = found.force / (2 * np.pi * joint.radius * joint.length)
        errors.append(
            (
                abs(mean / exact - 1),
                np.abs(found.pressure / exact - 1).max(),
                abs(state.stress["hub"] / equivalent - 1),
            )
        )
        assert found.away.all()  # both parts end where the joint ends
    coarse, fine = np.array(errors)
    assert fine[0] < max(coarse[0] / 5, 1e-9)
    assert fine[0] < 2e-5
    assert fine[1] < 2e-3
    assert fine[2] < 0.01
    if a == 0.0:  # a solid shaft has sigma_r = sigma_theta = -p all over
        assert state.stress["shaft"] == pytest.approx(exact, rel=5e-3)


def stepped():
    """A long hollow shaft in a bush in a short sleeve, whose radii are 1, 2, 3 and 5 mm."""
    return {
        "shaft": Profile(
            (1e-3, -2e-3),
            (
                Line((2e-3, -2e-3), "foot"),
                Line((2e-3, 0.0), "shank"),
                Line((2e-3, 4e-3), "first"),
                Line((1e-3, 4e-3), "head"),
                Line((1e-3, -2e-3), "bore"),
            ),
        ),
        "bush": Profile(
            (2e-3, 0.0),
            (
                Line((3e-3, 0.0), "under"),
                Line((3e-3, 1e-3), "collar"),
                Line((3e-3, 3e-3), "second"),
                Line((3e-3, 4e-3), "neck"),
                Line((2e-3, 4e-3), "over"),
                Line((2e-3, 0.0), "first"),
            ),
        ),
        "sleeve": ring(3e-3, 5e-3, 1e-3, 3e-3, inner="second"),
    }


PARTS = {"shaft": STEEL, "bush": IRON, "sleeve": STEEL}


def test_two_joints_are_reciprocal_and_nothing_pulls_along_them():
    """Betti: the force of one overlap on the other joint is that of the other on the first."""
    forces = []
    for overlaps in ({"first": 1e-6, "second": 0.0}, {"first": 0.0, "second": 1e-6}):
        state, _, _ = pressed(stepped(), PARTS, overlaps, 0.4e-3)
        forces.append([joint.force for joint in state.joints])
    both, _, _ = pressed(stepped(), PARTS, {"first": 1e-6, "second": 1e-6}, 0.4e-3)

    assert forces[0][1] == pytest.approx(forces[1][0], rel=1e-9)  # round-off of the solver
    assert 0.0 < forces[0][1] < forces[0][0]  # the shaft widens the bush in its sleeve
    assert [joint.force for joint in both.joints] == pytest.approx(np.sum(forces, axis=0), rel=1e-9)


def test_a_joint_that_a_sleeve_squeezes_opens_at_its_ends():
    """A ring that is squeezed in its middle springs out beyond: without overlap the joint pulls."""
    state, _, _ = pressed(stepped(), PARTS, {"first": 1e-7, "second": 1e-6}, 0.2e-3)

    first, second = state.joints
    assert first.height[first.pressure.argmin()] in (first.height[0], first.height[-1])
    assert first.pressure.min() < 0.0 < first.force
    assert second.pressure.min() > 0.0


def test_a_fit_does_not_depend_on_where_it_is_drawn():
    """Truth: symmetry.  The mesher places other nodes, so 1e-3 of the pressure."""
    here, there = (
        pressed(
            {
                "shaft": ring(0.0, 2e-3, z, z + 3e-3, outer="joint"),
                "hub": ring(2e-3, 4e-3, z, z + 3e-3, inner="joint"),
            },
            {"shaft": STEEL, "hub": IRON},
            {"joint": 1e-6},
            0.4e-3,
        )[0].joints[0]
        for z in (0.0, 50e-3)
    )
    assert there.force == pytest.approx(here.force, rel=1e-3)


def test_without_overlap_there_is_no_stress():
    state, _, _ = pressed(stepped(), PARTS, {"first": 0.0, "second": 0.0}, 0.4e-3)

    assert not state.displacement.any()
    assert all(not joint.pressure.any() and joint.force == 0.0 for joint in state.joints)


def hub_on_shaft(low=2e-3, high=5e-3):
    """A short hub on a long solid shaft."""
    return {
        "shaft": Profile(
            (0.0, 0.0),
            (
                Line((2e-3, 0.0), "foot"),
                Line((2e-3, low), "lower"),
                Line((2e-3, high), "joint"),
                Line((2e-3, 8e-3), "upper"),
                Line((0.0, 8e-3), "head"),
                Line((0.0, 0.0), "axis"),
            ),
        ),
        "hub": ring(2e-3, 4e-3, low, high, inner="joint"),
    }


@pytest.mark.slow
def test_the_sharp_ends_of_a_joint_are_left_out():
    """The shaft continues: the pressure there grows without limit as elements shrink.

    Away from the ends it converges, up to where its largest side of an element lies, 4 % here; the
    largest of all rises by 15 % for each halved size.
    """
    found = []
    for size in (0.2e-3, 0.1e-3):
        state, (joint,), _ = pressed(
            hub_on_shaft(), {"shaft": STEEL, "hub": STEEL}, {"joint": 1e-6}, size
        )
        (one,) = state.joints
        ends = np.minimum(one.height - 2e-3, 5e-3 - one.height)
        assert one.away.tolist() == (ends > 0.1 * joint.length).tolist()
        found.append((one.pressure[one.away].max(), one.pressure.max(), state.stress["hub"]))
    coarse, fine = np.array(found)
    assert fine[0] == pytest.approx(coarse[0], rel=0.05)
    assert fine[1] > 1.1 * coarse[1]
    assert fine[2] == pytest.approx(coarse[2], rel=0.04)
    plane = lame((0.0, 2e-3, 4e-3), (STEEL, STEEL), 1e-6)
    assert fine[0] > plane  # the shaft beyond the hub supports it


def pressed_solid(folder, profiles, materials, overlaps, sizing, turn=0.0):
    """State of the same parts as a STEP file, turned about an axis beside them [rad]."""
    write_step_revolved(profiles, folder / "parts.step")
    mesh = mesh_step(folder / "parts.step", sizing)
    if turn:
        axis = turn * np.array([0.6, 0.8, 0.0])
        mesh = mesh.placed(
            Pose(rotation=axis, about=np.zeros(3), shift=np.array([1e-2, 0.0, 3e-2]))
        )
    joints = [solid_joint(mesh, name) for name in overlaps]
    return pressed_state(mesh, materials, joints, list(overlaps.values())), joints


@each("seed", range(3))
def test_tubes_of_a_step_file_have_the_pressure_of_lame(tmp_path, seed):
    """Random tubes, anywhere in space: radius and length are those of the file.

    Tolerances are for elements of a quarter of the radius: mean pressure 0.5 %, that of single
    sides 10 %, stresses 3 %.
    """
    rng = np.random.default_rng(seed)
    R, overlap = 2e-3, 1e-6
    a, b, height = R * rng.uniform(0.3, 0.7), R * rng.uniform(1.4, 2.5), R * rng.uniform(0.6, 1.5)
    materials = {"shaft": STEEL, "hub": IRON}
    sizing = MeshSizing(size=0.5e-3, grading=0.3)
    state, (joint,) = pressed_solid(
        tmp_path, two_rings((a, R, b), height), materials, {"joint": overlap}, sizing, turn=0.7
    )

    exact = lame((a, R, b), (STEEL, IRON), overlap)
    hoop = exact * (b**2 + R**2) / (b**2 - R**2)
    (found,) = state.joints
    assert joint.solids == ("shaft", "hub")
    assert (joint.radius, joint.length) == pytest.approx((R, height), rel=1e-8)
    assert found.area == pytest.approx(2 * np.pi * R * height, rel=1e-4)
    assert found.force / found.area == pytest.approx(exact, rel=5e-3)
    assert found.pressure == pytest.approx(exact, rel=0.1)
    assert found.away.all()  # both parts end where the joint ends
    assert state.stress["hub"] == pytest.approx(
        np.sqrt(hoop**2 + hoop * exact + exact**2), rel=0.03
    )


def test_two_joints_of_solids_are_those_of_the_half_section(tmp_path):
    """Truth: the drawn parts. Forces to 1 %; sharp ends are found at the same heights."""
    overlaps = {"first": 1e-6, "second": 5e-7}
    drawn, _, _ = pressed(stepped(), PARTS, overlaps, 0.1e-3)
    sizing = MeshSizing(size=1e-3, grading=0.3, surfaces=dict.fromkeys(overlaps, 0.5e-3))
    solid, _ = pressed_solid(tmp_path, stepped(), PARTS, overlaps, sizing)

    for one, other in zip(drawn.joints, solid.joints, strict=True):
        assert other.force == pytest.approx(one.force, rel=0.01)
        assert not other.away.all()
        assert np.ptp(other.height[other.away]) < np.ptp(other.height)


def test_faces_that_cannot_be_pressed_are_one_error(tmp_path):
    """A flat face, a cone, and a cylinder that leaves the next one of its parts alone."""
    cone = {
        "shaft": Profile(
            (0.0, 0.0),
            (
                Line((2e-3, 0.0), "bottom"),
                Line((1.8e-3, 2e-3), "joint"),
                Line((0.0, 2e-3), "top"),
                Line((0.0, 0.0), "axis"),
            ),
        ),
        "hub": Profile(
            (2e-3, 0.0),
            (
                Line((4e-3, 0.0), "bottom"),
                Line((4e-3, 2e-3), "rim"),
                Line((1.8e-3, 2e-3), "top"),
                Line((2e-3, 0.0), "joint"),
            ),
        ),
    }
    stacked = {
        "shaft": ring(1e-3, 3e-3, 0.0, 1e-3),
        "hub": Profile(
            (1e-3, 1e-3),
            (
                Line((3e-3, 1e-3), "joint"),
                Line((3e-3, 2e-3), "rim"),
                Line((1e-3, 2e-3), "top"),
                Line((1e-3, 1e-3), "bore"),
            ),
        ),
    }
    below = stacked["shaft"]
    stacked["shaft"] = replace(
        below, edges=(*below.edges[:2], replace(below.edges[2], name="joint"), below.edges[3])
    )
    sizing = MeshSizing(size=1e-3)
    materials = {"shaft": STEEL, "hub": STEEL}
    for profiles, got in ((cone, "faces that do not form one cylinder"), (stacked, "a flat face")):
        with pytest.raises(InputError, match=rf"joint 'joint': got .*{got}"):
            pressed_solid(tmp_path, profiles, materials, {"joint": 1e-6}, sizing)
    with pytest.raises(InputError, match=r"joint 'seam': got a name of no face"):
        pressed_solid(tmp_path, stacked, materials, {"seam": 1e-6}, sizing)


def test_parts_that_are_glued_otherwise_are_refused():
    """A cap across shaft and hub holds both; two names of one cylinder share a corner."""
    profiles = two_rings((1e-3, 2e-3, 3e-3), 2e-3)
    profiles["cap"] = Profile(
        (1e-3, 2e-3),
        (
            Line((2e-3, 2e-3), "top"),
            Line((3e-3, 2e-3), "top"),
            Line((3e-3, 3e-3), "edge"),
            Line((1e-3, 3e-3), "lid"),
            Line((1e-3, 2e-3), "hole"),
        ),
    )
    materials = dict.fromkeys(profiles, STEEL)
    with pytest.raises(InputError, match=r"joint 'joint'.*glued to each other by other parts"):
        pressed(profiles, materials, {"joint": 1e-6}, 0.4e-3)

    parts = {
        "shaft": Profile(
            (1e-3, 0.0),
            (
                Line((2e-3, 0.0), "bottom"),
                Line((2e-3, 1e-3), "low"),
                Line((2e-3, 2e-3), "high"),
                Line((1e-3, 2e-3), "top"),
                Line((1e-3, 0.0), "bore"),
            ),
        ),
        "hub": Profile(
            (3e-3, 0.0),
            (
                Line((3e-3, 2e-3), "rim"),
                Line((2e-3, 2e-3), "top"),
                Line((2e-3, 1e-3), "high"),
                Line((2e-3, 0.0), "low"),
                Line((3e-3, 0.0), "bottom"),
            ),
        ),
    }
    with pytest.raises(InputError, match="joints that meet in a corner"):
        pressed(parts, dict.fromkeys(parts, STEEL), {"low": 1e-6, "high": 2e-6}, 0.4e-3)
    with pytest.raises(InputError, match=r"joint 'low': got only part of the faces where"):
        pressed(parts, dict.fromkeys(parts, STEEL), {"low": 1e-6}, 0.4e-3)


def test_a_bar_under_tension_vibrates_faster():
    """Without Poisson's ratio an axial wave sees E + sigma: the shift is sigma / 2 E, exactly."""
    mesh = lattice_mesh("quad8", [np.array([0.0, 0.3e-3]), np.linspace(0.0, 30e-3, 41)])
    modes = eigenmodes(elastic_body("bar", mesh, {"solid": BAR}), count=3)
    strain = 1e-3
    u = (mesh.points * [0.0, strain]).ravel()

    work = work_of_stress(mesh, {"solid": BAR}, u, modes.shapes)

    # r is still: phi_r of a bar without Poisson's ratio is round-off of the modes
    assert work / (2 * modes.omega**2) == pytest.approx([strain / 2] * 3, rel=1e-9)


def test_a_beam_under_tension_has_the_work_of_its_slope():
    """Sections that stay plane: N int w'^2 + sigma I int w''^2, a field of hex20; round-off."""
    height, length, strain = 1e-3, 20e-3, 1e-3
    across = np.linspace(-height / 2, height / 2, 3)
    mesh = lattice_mesh("hex20", [across, across, np.linspace(0.0, length, 9)])
    x, _, z = mesh.points.T
    shape = np.column_stack([z**2, np.zeros_like(z), -2 * x * z])  # w = z^2, u_z = -x w'
    u = mesh.points * [0.0, 0.0, strain]

    (work,) = work_of_stress(mesh, {"solid": BAR}, u.ravel(), shape.reshape(-1, 1))

    sigma = BAR.young * strain
    area, inertia = height**2, height**4 / 12
    assert work == pytest.approx(
        sigma * (area * 4 * length**3 / 3 + inertia * 4 * length), rel=1e-9
    )


def test_a_ring_under_hoop_stress_has_the_work_of_its_growth():
    """A thin ring that breathes: sigma_theta (u / R)^2 times its volume, and sigma_r of none."""
    mesh = lattice_mesh("quad8", [np.linspace(1e-3, 3e-3, 9), np.array([0.0, 1e-3])])
    growth = (mesh.points * [1e-3, 0.0]).ravel()  # u_r = 1e-3 r: sigma_r = sigma_theta = E 1e-3
    breathing = np.column_stack([np.ones(mesh.node_count), np.zeros(mesh.node_count)])

    (work,) = work_of_stress(mesh, {"solid": BAR}, growth, breathing.reshape(-1, 1))

    # u_r = 1 has no gradient in r: what is left is sigma / r^2, 2 pi h sigma ln(b/a)
    exact = 2 * np.pi * 1e-3 * BAR.young * 1e-3 * np.log(3.0)
    assert work == pytest.approx(exact, rel=1e-6)  # 1/r by 3 points across 8 elements


@pytest.mark.slow
@pytest.mark.skipif(find_calculix() is None, reason="CalculiX is not installed")
def test_a_hub_on_a_shaft_moves_as_in_calculix(tmp_path):
    """Reference: CalculiX with the same jump as equations of its nodes, on the same mesh.

    Its ring is a wedge of one element, its circle a parabola: 1e-3 of the largest displacement.
    """
    materials = {"shaft": STEEL, "hub": IRON}
    state, _, _ = pressed(hub_on_shaft(), materials, {"joint": 1e-6}, 0.3e-3)
    (tmp_path / "fit.inp").write_text(_deck(state, materials, 1e-6))
    done = subprocess.run(
        [find_calculix(), "fit"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:]

    other = np.zeros((state.mesh.node_count + 1, 2))
    for line in (tmp_path / "fit.dat").read_text().splitlines():
        words = line.split()
        if len(words) == 4 and words[0].isdigit():
            other[int(words[0]) - 1] = float(words[1]), float(words[2])
    mine = state.displacement.reshape(-1, 2)
    assert np.abs(mine).max() > 0.4e-6
    assert np.abs(mine - other[:-1]).max() < 1e-3 * np.abs(mine).max()


def _deck(state, materials, overlap):
    """Input of CalculiX: one equation per pair of nodes on the joint, with a node that moves."""
    mesh = state.mesh
    lines = ["*NODE"]
    lines += [f"{i + 1}, {r:.12e}, {z:.12e}, 0." for i, (r, z) in enumerate(mesh.points)]
    last = mesh.node_count + 1
    lines += [f"{last}, 0., 0., 0."]
    count = 0
    for block in mesh.blocks:
        lines.append(f"*ELEMENT, TYPE=CAX6, ELSET={block.solid.upper()}")
        for nodes in block.connectivity + 1:
            count += 1
            lines.append(f"{count}, " + ", ".join(map(str, nodes)))
    for solid, material in materials.items():
        lines += [f"*MATERIAL, NAME={solid.upper()}", "*ELASTIC"]
        lines += [f"{material.young:.6e}, {material.poisson}"]
        lines += [f"*SOLID SECTION, ELSET={solid.upper()}, MATERIAL={solid.upper()}"]
    hub, shaft = (
        np.unique(block.connectivity)
        for solid in ("hub", "shaft")
        for block in mesh.blocks
        if block.solid == solid
    )
    for outer in hub:
        for inner in shaft[state.nodes[shaft] == state.nodes[outer]]:
            lines += ["*EQUATION", "3", f"{outer + 1},1,1., {inner + 1},1,-1., {last},1,-1."]
    lines += ["*NSET, NSET=ALL, GENERATE", f"1, {mesh.node_count}"]
    lines += ["*STEP", "*STATIC", "*BOUNDARY", f"{last},1,1,{overlap:.12e}"]
    lines += [f"{i + 1},1,1" for i in np.flatnonzero(mesh.points[:, 0] == 0.0)]
    lines += [f"{nodes[0] + 1},2,2" for nodes in (hub, shaft)]
    lines += ["*NODE PRINT, NSET=ALL", "U", "*END STEP"]
    return "\n".join(lines) + "\n"
