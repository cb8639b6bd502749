"""Parts that bolts press together: pressure, stiffness, load factor, and what opens.

Truth: tubes in closed form, k = A / (l1/E1 + l2/E2), exact with faces that slide; superposition on
the glued body with the bolt as a spring; proportion to the preload; convergence of a joint that
opens, and the same joint against a rigid face by symmetry.
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
from klack.mesh.profile import Line, Profile
from klack.mesh.sizing import MeshSizing
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
        state, joint, _ = clamped(
            tubes(inside, outside, low, high), {"low": one, "high": other}, 1e-3, preload
        )

        area = np.pi * (outside**2 - inside**2)
        assert joint.area == pytest.approx(area, rel=1e-12)
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
        "count": 1, "area": joint.area, "distance": state.distance, "preload": 1000.0,
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
        assert (state.closed == (state.radius <= state.radius[state.closed].max())).all()
    assert fine.stiffness == pytest.approx(coarse.stiffness, rel=5e-3)
    edge = [state.radius[state.closed].max() for state in (coarse, fine)]
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
    state, joint, _ = clamped(
        profiles, {"low": STEEL, "high": STEEL}, 0.25e-3, ends=("foot", "thread")
    )
    assert state.pressure == pytest.approx(1000.0 / joint.area, rel=0.02)
    short, long = (joint.area * STEEL.young / length for length in (16e-3, 20e-3))
    assert long < state.stiffness < short
    assert state.distance == pytest.approx(18e-3, rel=1e-9)


def test_ends_that_cannot_press_are_refused():
    """On one side, facing the joint, and edges of no part or of two."""
    profiles = plates()
    for ends, message in (
        (("head", "over"), r"bolts\.joint.*the same side of the joint"),
        (("head", "joint"), "'joint' is no straight edge of one part"),
        (("head", "nut"), "'nut' is no straight edge of one part"),
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
