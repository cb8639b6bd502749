"""Parts that bolts press together: pressure, stiffness, load factor, and what opens.

Truth: tubes and blocks in closed form, k = A / (l1/E1 + l2/E2), exact with faces that slide;
superposition on the glued body with the bolt as a spring; proportion to the preload; convergence of
a joint that opens, and the same joint against a rigid face by symmetry; the lever of two feet; the
half section of solids.
"""

from dataclasses import replace

import numpy as np
import pytest
from draws import each

from klack.assembling.bolts import BoltedJoint
from klack.bodies.elasticity.body import elastic_body
from klack.bodies.elasticity.loads import traction_load
from klack.contact.bolted_joint import clamped_state
from klack.errors import InputError
from klack.materials.material import Material
from klack.mesh.joint import flat_joint
from klack.mesh.meridian import mesh_meridian
from klack.mesh.occ import revolved_solids
from klack.mesh.profile import Line, Profile
from klack.mesh.rigid import Pose, rotation_matrix
from klack.mesh.sizing import MeshSizing
from klack.mesh.solid import mesh_step
from klack.mesh.solid_joint import flat_solid_joint
from klack.verification.lattice import STEEL

IRON = Material(name="iron", young=120e9, poisson=0.25, density=7300.0)
ENDS = ("head", "foot")


def outline(*corners):
    """Straight edges to (r, z, name); the last corner is the first."""
    return Profile(corners[-1][:2], tuple(Line((r, z), name) for r, z, name in corners))


def tubes(inside, outside, low, high):
    """Two tubes of these lengths on each other, from z = 0 up."""
    top = low + high
    return {
        "low": outline((outside, 0.0, "foot"), (outside, low, "side"), (inside, low, "joint"),
                       (inside, 0.0, "bore")),
        "high": outline((outside, low, "joint"), (outside, top, "rim"), (inside, top, "head"),
                        (inside, low, "hole")),
    }  # fmt: skip


def plates(thick=4e-3):
    """Two discs of 2 to 15 mm, pressed from 2 to 4 mm: the joint opens outside."""
    a, head, rim = 2e-3, 4e-3, 15e-3
    return {
        "low": outline((head, 0.0, "foot"), (rim, 0.0, "under"), (rim, thick, "side"),
                       (a, thick, "joint"), (a, 0.0, "bore")),
        "high": outline((rim, thick, "joint"), (rim, 2 * thick, "edge"), (head, 2 * thick, "over"),
                        (a, 2 * thick, "head"), (a, thick, "hole")),
    }  # fmt: skip


def clamped(profiles, materials, size, preload=1000.0, ends=ENDS, finer=None):
    joint = flat_joint(profiles, "joint", ends)
    surfaces = {} if finer is None else {"joint": finer}
    mesh = mesh_meridian(profiles, MeshSizing(size=size, surfaces=surfaces))
    return clamped_state(mesh, materials, joint, preload), joint, mesh


def test_random_tubes_have_the_stiffness_and_pressure_of_the_closed_form():
    """Uniform stress is in the elements: round-off of the solver, 1e-9."""
    random = np.random.default_rng(7)
    for _ in range(8):
        inside = random.choice([0.0, random.uniform(0.5e-3, 5e-3)])
        outside = inside + random.uniform(1e-3, 8e-3)
        low, high = random.uniform(1e-3, 15e-3, 2)
        one, other = (
            replace(STEEL, young=random.uniform(50e9, 400e9), poisson=random.uniform(0.0, 0.4))
            for _ in range(2)
        )
        preload = 10.0 ** random.uniform(0.0, 5.0)
        state, _, _ = clamped(
            tubes(inside, outside, low, high), {"low": one, "high": other}, 1e-3, preload
        )

        area = np.pi * (outside**2 - inside**2)
        assert state.area.sum() == pytest.approx(area, rel=1e-12)
        assert state.stiffness == pytest.approx(
            area / (low / one.young + high / other.young), rel=1e-9
        )
        assert state.distance == pytest.approx(low + high, rel=1e-12)
        assert state.pressure[state.area > 0.0] == pytest.approx(preload / area, rel=1e-9)
        assert state.open_share == 0.0
        assert list(state.stress.values()) == pytest.approx([preload / area] * 2, rel=1e-7)


def test_a_force_below_the_lifting_force_changes_the_bolts_by_the_load_factor():
    """Truth: the glued body with the bolts as a spring between both ends, without Poisson's ratio.

    Faces that slide and faces that are glued are then one: round-off, 1e-9.
    """
    profiles = tubes(2e-3, 5e-3, 4e-3, 7e-3)
    materials = {"low": replace(STEEL, poisson=0.0), "high": replace(IRON, poisson=0.0)}
    state, joint, mesh = clamped(profiles, materials, 1e-3)
    bolts = _joint(state, joint, bolt_stiffness=1.3 * state.stiffness)

    body = elastic_body("tubes", mesh, materials)
    pull = np.zeros(body.dof_count)
    for end, sign in (("head", 1.0), ("foot", -1.0)):
        load = traction_load(mesh, mesh.surface(end), lambda x, n: x * 0.0 + [0.0, 1.0])
        pull += sign * load / load.sum()
    K = body.K.toarray() + bolts.bolt_stiffness * np.outer(pull, pull)
    free = np.delete(np.arange(body.dof_count), 1)  # along the axis
    u = np.zeros(body.dof_count)
    outside = 0.9 * bolts.lifting_force
    u[free] = np.linalg.solve(K[np.ix_(free, free)], outside * pull[free])

    more = bolts.bolt_stiffness * (pull @ u)
    assert more == pytest.approx(bolts.load_factor * outside, rel=1e-9)
    assert bolts.preload + more - outside > 0.0  # still pressed
    lifted = bolts.lifting_force
    assert bolts.preload + bolts.load_factor * lifted == pytest.approx(lifted, rel=1e-12)


def _joint(state, joint, **more):
    """Of a preload of 1000 N."""
    given = {
        "body": "tubes", "joint": joint.name, "lower": "low", "upper": "high", "ends": ENDS,
        "count": 1, "area": state.area.sum(), "distance": state.distance, "preload": 1000.0,
        "length": state.distance, "bolt_stress": 1e8, "bolt_yield": None, "pressure": 1e7,
        "least_pressure": 1e7, "largest_pressure": 1e7, "open_share": 0.0, "stress": {},
        "yield_stress": {}, "bolt_stiffness": 1e9, "part_stiffness": state.stiffness,
    }  # fmt: skip
    return BoltedJoint(**(given | more))


def test_plates_open_outside_and_converge():
    """Halved elements: stiffness to 5e-3, the touching radius to one element of the joint.

    All forces push, their sum is the preload, and all is proportional to it: round-off.
    """
    coarse, fine = (
        clamped(plates(), {"low": STEEL, "high": STEEL}, size)[0] for size in (1e-3, 0.5e-3)
    )
    for state in (coarse, fine):
        assert (state.pressure * state.area).sum() == pytest.approx(1000.0, rel=1e-12)
        assert state.pressure.min() == 0.0
        radius = state.middle[:, 0]
        assert (state.closed == (radius <= radius[state.closed].max())).all()
    assert fine.stiffness == pytest.approx(coarse.stiffness, rel=5e-3)
    edge = [state.middle[:, 0][state.closed].max() for state in (coarse, fine)]
    assert abs(edge[1] - edge[0]) <= 0.5e-3
    assert 4e-3 < edge[1] < 8e-3  # within a cone of 45 degrees from under the head

    more = clamped(plates(), {"low": STEEL, "high": STEEL}, 1e-3, preload=5e4)[0]
    assert more.stiffness == coarse.stiffness
    assert more.pressure == pytest.approx(50.0 * coarse.pressure, rel=1e-12)
    assert more.stress["low"] == pytest.approx(50.0 * coarse.stress["low"], rel=1e-12)


def test_equal_plates_are_pressed_as_one_on_a_rigid_face():
    """Symmetry: a plate of a far stiffer material below is rigid, half of the approach is left.

    The mesher places other nodes below: 2e-3, and 1e-4 for a modulus of 1e4 times.
    """
    both = clamped(plates(), {"low": STEEL, "high": STEEL}, 0.5e-3)[0]
    rigid = replace(STEEL, young=1e4 * STEEL.young)
    one = clamped(plates(), {"low": rigid, "high": STEEL}, 0.5e-3)[0]

    assert one.stiffness == pytest.approx(2.0 * both.stiffness, rel=2e-3)
    assert one.open_share == pytest.approx(both.open_share, abs=0.03)  # one node of the joint


def test_a_thread_on_a_cylinder_pulls_as_a_far_face_does():
    """Saint-Venant: one radius beyond a thread on the outside the stress of a thin tube is even.

    The stiffness lies between those of the tubes to the near and to the far end of the thread.
    """
    profiles = tubes(4.5e-3, 5e-3, 6e-3, 4e-3)
    profiles["high"] = outline(
        (5e-3, 6e-3, "joint"), (5e-3, 16e-3, "rim"), (5e-3, 20e-3, "thread"),
        (4.5e-3, 20e-3, "top"), (4.5e-3, 6e-3, "hole"),
    )  # fmt: skip
    state, _, _ = clamped(profiles, {"low": STEEL, "high": STEEL}, 0.25e-3, ends=("foot", "thread"))
    assert state.pressure == pytest.approx(1000.0 / state.area.sum(), rel=0.02)
    short, long = (state.area.sum() * STEEL.young / length for length in (16e-3, 20e-3))
    assert long < state.stiffness < short
    assert state.distance == pytest.approx(18e-3, rel=1e-9)


def solid(folder, shapes, sizes, turn, ends=ENDS, size=1e-3):
    """State of a STEP file of these shapes, named by face, turned in space."""
    from netgen.occ import Compound

    Compound(shapes).WriteStep(str(folder / "parts.step"))
    mesh = mesh_step(folder / "parts.step", MeshSizing(size=size, grading=0.3, surfaces=sizes))
    pose = Pose(rotation=np.asarray(turn), about=np.zeros(3), shift=np.array([0.01, 0.0, 0.03]))
    mesh = mesh.placed(pose)
    joint = flat_solid_joint(mesh, "joint", ends)
    return clamped_state(mesh, {"low": STEEL, "high": IRON}, joint, 1000.0), joint


def block(low, high, name, **faces):
    """Box between two corners [mm]; faces by side: top, bottom."""
    from netgen.occ import Box, Pnt, Z

    box = Box(Pnt(*low), Pnt(*high))
    box.solids.name = name
    for side, face in faces.items():
        (box.faces.Max(Z) if side == "top" else box.faces.Min(Z)).name = face
    return box


@each("turn", [(0.0, 0.0, 0.0), (0.7, -1.9, 0.4), (0.0, 3.0, 0.0)])
def test_blocks_of_a_step_file_have_the_stiffness_and_pressure_of_the_closed_form(tmp_path, turn):
    """Uniform stress is in the elements: round-off of the solver, 1e-9."""
    low = block((0, 0, 0), (3, 2, 4), "low", bottom="foot", top="joint")
    high = block((0, 0, 4), (3, 2, 7), "high", bottom="joint", top="head")
    state, joint = solid(tmp_path, [low, high], {}, turn)

    area = 6e-6
    up = rotation_matrix(np.asarray(turn))[:, 2] @ joint.normal
    assert abs(up) == pytest.approx(1.0, rel=1e-12)
    assert joint.solids == (("low", "high") if up > 0.0 else ("high", "low"))
    assert joint.length == pytest.approx(2 * area / 10e-3, rel=1e-9)
    assert state.area.sum() == pytest.approx(area, rel=1e-9)
    assert state.distance == pytest.approx(7e-3, rel=1e-9)
    assert state.stiffness == pytest.approx(
        area / (4e-3 / STEEL.young + 3e-3 / IRON.young), rel=1e-9
    )
    assert state.pressure == pytest.approx(1000.0 / area, rel=1e-9)
    assert state.closed.all()
    assert list(state.stress.values()) == pytest.approx([1000.0 / area] * 2, rel=1e-6)


def bridge(foot_from=8, under=(2, 4)):
    """A bar on two feet of one name; the bolt presses it between them, from the left foot on."""
    low = block((0, 0, 0), (10, 2, 2), "low")
    low = low + block((under[0], 0, -1), (under[1], 2, 0), "low", bottom="foot")
    low.solids.name = "low"
    high = block((0, 0, 3), (10, 2, 5), "high")
    head = block((2, 0, 5), (4, 2, 6), "high", top="head")
    feet = [block((x, 0, 2), (x + 2, 2, 3), "high", bottom="joint") for x in (0, foot_from)]
    high = high + head + feet[0] + feet[1]
    high.solids.name = "high"
    return [low, high]


def test_two_feet_share_the_preload_by_their_levers(tmp_path):
    """Statics: pressure and bolt act in one line, to 1e-12 m.

    The bolt is 1 to 3 mm from the near foot and 5 to 7 mm from the far one: 5/8 to 7/8 of it.
    """
    state, joint = solid(tmp_path, bridge(), {}, (0.3, 0.2, -0.8), size=0.7e-3)

    force = state.pressure * state.area
    bolt = Pose(
        rotation=np.array([0.3, 0.2, -0.8]), about=np.zeros(3), shift=np.array([0.01, 0.0, 0.03])
    ).of(np.array([3e-3, 1e-3, 2e-3]))
    assert force.sum() == pytest.approx(1000.0, rel=1e-12)
    assert joint.across @ (force @ state.middle / 1000.0 - bolt) == pytest.approx(0.0, abs=1e-12)
    near = np.linalg.norm(state.middle - bolt, axis=1) < 4e-3
    assert 625.0 < force[near].sum() < 875.0


@pytest.mark.slow
@each("seed", [1])
def test_random_plates_of_a_step_file_are_those_of_the_half_section(tmp_path, seed):
    """Truth: the drawn parts, some of which open; stiffness 3 %, open share 6 % of the face."""
    random = np.random.default_rng(seed)
    a, b = random.uniform(1e-3, 3e-3), random.uniform(8e-3, 12e-3)
    head, rim = a + 0.3 * (b - a), a + random.uniform(0.5, 0.8) * (b - a)
    low, high = random.uniform(3e-3, 8e-3, 2)
    top = low + high
    profiles = {
        "low": outline((head, 0.0, "mid"), (rim, 0.0, "foot"), (b, 0.0, "under"), (b, low, "side"),
                       (a, low, "joint"), (a, 0.0, "bore")),
        "high": outline((b, low, "joint"), (b, top, "edge"), (rim, top, "over"),
                        (a, top, "head"), (a, low, "hole")),
    }  # fmt: skip
    fine = {"joint": (b - a) / 24, "head": (rim - a) / 12, "foot": (rim - head) / 12}
    joint = flat_joint(profiles, "joint", ENDS)
    mesh = mesh_meridian(profiles, MeshSizing(size=(b - a) / 8, surfaces=fine))
    drawn = clamped_state(mesh, {"low": STEEL, "high": IRON}, joint, 1000.0)

    coarse = {"joint": (b - a) / 8, "head": (rim - a) / 6, "foot": (rim - head) / 4}
    found, turned = solid(
        tmp_path, revolved_solids(profiles), coarse, random.normal(size=3), size=(b - a) / 4
    )
    assert turned.length == pytest.approx(joint.length, rel=1e-2)
    assert found.stiffness == pytest.approx(drawn.stiffness, rel=0.03)
    assert found.open_share == pytest.approx(drawn.open_share, abs=0.06)
    assert found.pressure.max() == pytest.approx(drawn.pressure.max(), rel=0.1)


def test_faces_and_ends_that_cannot_press_are_one_error(tmp_path):
    """A round face, a bolt beside its ends, one beside all feet, and a foot without the name."""
    nameless = bridge()
    for face in nameless[1].faces:
        face.name = "other" if face.name == "joint" and face.center.x > 5 else face.name
    cases = (
        (nameless, ENDS, "a part of the flat face where 'low' and 'high' meet"),
        (bridge(), ("head", "nut"), "'nut' is no outer face.*here: .*foot"),
        (bridge(under=(4, 6)), ENDS, r"their middles are 2 mm apart across the bolts"),
        (bridge(foot_from=0), ENDS, "beside the face where they touch"),
    )
    for shapes, ends, words in cases:
        with pytest.raises(InputError, match=rf"joint 'joint': got .*{words}"):
            solid(tmp_path, shapes, {}, (0.1, 0.0, 0.0), ends, size=2e-3)
    profiles = tubes(1e-3, 2e-3, 2e-3, 2e-3)
    profiles["high"] = outline((3e-3, 0.0, "ring"), (3e-3, 2e-3, "rim"), (2e-3, 2e-3, "head"),
                               (2e-3, 0.0, "joint"))  # fmt: skip
    profiles["low"] = outline((2e-3, 0.0, "foot"), (2e-3, 2e-3, "joint"), (1e-3, 2e-3, "top"),
                              (1e-3, 0.0, "bore"))  # fmt: skip
    with pytest.raises(InputError, match="joint 'joint': got faces that are not one plane"):
        solid(tmp_path, revolved_solids(profiles), {}, (0.1, 0.0, 0.0))


def test_ends_that_cannot_press_are_refused():
    """On one side, facing the joint, and edges of no part or of two."""
    profiles = plates()
    for ends, message in (
        (("head", "over"), r"joint 'joint'.*the same side of the joint"),
        (("head", "joint"), "'joint' is not a straight edge of one part"),
        (("head", "nut"), "'nut' is not a straight edge of one part"),
    ):
        with pytest.raises(InputError, match=message):
            clamped(profiles, dict.fromkeys(profiles, STEEL), 1e-3, ends=ends)

    profiles["high"] = outline(
        (8e-3, 4e-3, "joint"), (8e-3, 5e-3, "neck"), (15e-3, 5e-3, "back"), (15e-3, 8e-3, "edge"),
        (2e-3, 8e-3, "head"), (2e-3, 4e-3, "hole"),
    )  # fmt: skip
    profiles["low"] = outline(
        (8e-3, 0.0, "foot"), (8e-3, 4e-3, "side"), (2e-3, 4e-3, "joint"), (2e-3, 0.0, "bore"),
    )  # fmt: skip
    with pytest.raises(InputError, match="'back', a face towards the joint"):
        clamped(profiles, dict.fromkeys(profiles, STEEL), 1e-3, ends=("back", "foot"))


@each(
    ("change", "words"),
    [
        ({"length": 11.0}, "a length of 11 m between ends that are 11 mm apart"),
        ({"bolt_stress": 2e9}, "the bolts yield: 2 GPa is above that of class 12.9"),
        ({"bolt_stress": 7e8, "bolt_yield": 6e8}, "the bolts yield: 700 MPa is above their yield"),
        ({"open_share": 0.3}, "30 % of the joint is open under the preload"),
        ({"stress": {"low": 3e8}, "yield_stress": {"low": 2e8}}, "'low' yields: 300 MPa"),
        ({"peak": 501.0}, "the joint may open: contact forces may pull at it with up to 1 kN"),
    ],
)
def test_each_doubt_has_its_words(change, words):
    profiles = tubes(2e-3, 5e-3, 4e-3, 7e-3)
    state, joint, _ = clamped(profiles, {"low": STEEL, "high": IRON}, 2e-3)

    assert not _joint(state, joint).doubts
    assert not _joint(state, joint, peak=499.0).doubts
    (doubt,) = _joint(state, joint, **change).doubts
    assert doubt.startswith("bolts tubes.joint: ")
    assert words in doubt
