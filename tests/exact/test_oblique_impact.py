"""Bodies that start sideways or with a spin: momentum, symmetry, gross slip, sticking."""

import re
from dataclasses import replace
from functools import cache
from math import pi
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.full_level import simulate_in_full
from klack.analyses.impact.interface_level import build_interface, run_interface
from klack.analyses.impact.record import LevelResult
from klack.analyses.impact.run import impact_bodies, run_impact
from klack.analyses.impact.wording import answer
from klack.assembling.problem import ContactProblem, contact_problem
from klack.assembling.reduced_pair import first_stiffness, own_pair
from klack.bodies.elasticity.eigen import Modes
from klack.case import find_case
from klack.case.reader import read_case
from klack.case.schema import Case
from klack.contact.friction import Friction
from klack.errors import InputError
from klack.machine.progress import silent
from klack.transient.interface_model import InterfaceModel
from klack.verification.friction import ring_restitution

pytestmark = pytest.mark.slow

BODY = """
    geometry:
      model: swept
      layers: 8
      profile:
        unit: mm
        parts:
          {name}: {{start: {start}, edges: [{edges}, {{close: true, name: axis}}]}}
    material: steel
    mesh: {{size: 1.5 mm, contact: {{size: {size} mm, extent: 0.2 mm}}}}
"""
SPHERE = BODY.format(
    name="sphere",
    start="[0, 0]",
    edges="{arc: [2, 2], centre: [0, 2], name: tip}, {arc: [0, 4], centre: [0, 2], name: top}",
    size=0.05,
)
PLATE = BODY.format(
    name="plate",
    start="[0, -4]",
    edges="{line: [4, -4], name: foot}, {line: [4, 0], name: side}, {line: [0, 0], name: face}",
    size=0.04,
)
TEXT = f"""klack: 1
title: Sphere on a plate
materials:
  steel: {{young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}}
bodies:
  sphere:{SPHERE}
  plate:{PLATE}    fixed: [{{surface: foot}}]
contact: {{between: [sphere.tip, plate.face], gap: 0 um, friction: 0.1}}
motion: {{speed: 0.5 m/s, sideways_speed: 0.2 m/s}}
reduction: {{modes: {{sphere: {{count: 6}}, plate: {{count: 20}}}}}}
run: {{levels: [interface], duration: 30 us, interface_step: 60 ns}}
"""
RADIUS = 2e-3


@cache
def bodies() -> tuple[ContactProblem, InterfaceModel]:
    case = read_case(TEXT, Path("sphere.yaml"))
    placed = impact_bodies(case, levels=["interface"], certify=False)
    problem = contact_problem(case, placed.placed, silent)
    own = own_pair(problem, placed.pools, stiffness=first_stiffness(problem))
    return problem, build_interface(problem, placed.pools, ports=own.ports)


def moving(sideways: float = 0.0, **more) -> Case:
    case = bodies()[0].case
    motion = case.motion.model_copy(update={"sideways_speed": sideways, **more})
    return case.model_copy(update={"motion": motion})


def hit(sideways: float = 0.0, mu: float = 0.1, **more) -> LevelResult:
    problem, model = bodies()
    case = moving(sideways, **more)
    law = Friction.coulomb(mu)
    model = replace(model, friction=(law,)) if mu else model.without_friction()
    return run_interface(replace(problem, case=case), model, None, setup_time=0.0)


def after(level: LevelResult) -> np.ndarray:
    assert level.oblique is not None
    return np.concatenate([level.oblique.velocity_after, level.oblique.spin_after])


def test_without_friction_the_plate_takes_nothing_sideways():
    """Newton; the force is that of the straight impact."""
    straight, oblique = hit(mu=0.0), hit(0.7, mu=0.0)
    assert after(oblique)[:2] == pytest.approx([0.7, 0.0], abs=7e-10)
    np.testing.assert_allclose(
        oblique.history.force, straight.history.force, atol=1e-9 * straight.history.force.max()
    )


def test_gross_slip_has_coulombs_impulse_and_the_arm_of_the_radius():
    """J_t = mu J, and I w = R J_t: the contact stays below the centre while the sphere turns."""
    level = hit(3.0, mu=0.05)
    found, body = level.oblique, bodies()[0].pair.upper
    assert found is not None
    assert found.impulse_ratio == pytest.approx(0.05, rel=1e-4)
    taken = body.mass * (3.0 - found.velocity_after[0])
    assert found.spin_after[1] * body.inertia[1, 1] == pytest.approx(RADIUS * taken, rel=1.5e-3)


@pytest.mark.parametrize("mu", [0.1, 2.0])
def test_moment_of_momentum_about_the_touch(mu):
    """Forces in the plane of contact have no moment about it, however the points stick.

    0.0006 left; points that turn with the sphere miss it by 0.0035 and 0.0095.
    """
    level, body = hit(0.2, mu=mu), bodies()[0].pair.upper
    v, w = after(level)[0], after(level)[4]
    assert w * body.inertia[1, 1] == pytest.approx(RADIUS * body.mass * (0.2 - v), rel=1.5e-3)


MAW = ((0.5, 0.0478318), (1.0, -0.0596967), (2.0, -0.83721), (3.0, -1.37968), (5.0, -0.764706))


@pytest.mark.parametrize(("before", "truth"), MAW)
def test_oblique_impact_of_like_bodies(before, truth):
    """Maw, Barber & Fawcett 1976; the tolerance is that of three elements over the radius."""
    unit = 0.1 / (1.4 / 1.7) * 0.5
    found = after(hit(before * unit))
    assert (found[0] - RADIUS * found[4]) / unit == pytest.approx(truth, abs=0.05)


def test_a_rolling_sphere_rolls_on():
    """No slip, no tangential force between like materials."""
    level = hit(0.2, spin=(0.0, 0.2 / RADIUS, 0.0))
    assert after(level)[0] == pytest.approx(0.2, rel=1e-3)
    assert after(level)[4] == pytest.approx(0.2 / RADIUS, rel=1e-3)


def test_mirrored_and_turned_motion():
    """Bodies of eight layers: a half and a quarter of a turn are symmetries of both meshes."""
    v, w = np.split(after(hit(0.2)), 2)
    for angle in (pi, pi / 2.0):
        c, s = np.cos(angle), np.sin(angle)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        turned_v, turned_w = np.split(after(hit(0.2, sideways_direction=angle)), 2)
        np.testing.assert_allclose(turned_v, turn @ v, atol=1e-6)
        np.testing.assert_allclose(turned_w, turn @ w, atol=1e-6 / RADIUS)


def test_reversed_spin_mirrors_the_motion():
    first, back = (after(hit(spin=(0.0, sign * 150.0, 0.0))) for sign in (1.0, -1.0))
    assert first[0] > 0.05
    np.testing.assert_allclose(back[[0, 4]], -first[[0, 4]], rtol=1e-5)
    np.testing.assert_allclose(back[2], first[2], rtol=1e-6)


def test_spin_about_the_normal_is_slowed_without_a_push():
    """A disc of friction has a moment about its axis and no resultant."""
    found = after(hit(spin=(0.0, 0.0, 500.0)))
    assert 0.0 < found[5] < 500.0
    np.testing.assert_allclose(found[:2], 0.0, atol=1e-6)


def test_an_impact_from_end_to_end(tmp_path):
    """Numbers of the record in JSON, on the terminal and in the report."""
    study = run_impact(bodies()[0].case, levels=["interface"], certify=False)
    level = study.levels["interface"]
    assert level.oblique is not None
    json = IMPACT.to_json(study)["levels"]["interface"]["oblique"]
    assert json["tangential_restitution"] == pytest.approx(after(level)[0] / 0.2, rel=1e-12)
    assert json["spin_y_after_rad_s"] == after(level)[4]
    # a sphere of 4 mm keeps next to nothing of a slow impact
    assert 0.0 <= level.measures.vibration_share < 0.01
    assert "sideways speed" in answer(study)
    told = [part for part in IMPACT.told(study) if not isinstance(part, str)]
    assert "Across the axis" in [table.title for table in told]
    assert study.contact.stuck is not None
    # equal spheres have (2 - nu)/(2 (1 - nu)) = 1.214 (Mindlin); the bulk of both adds to each
    assert study.contact.stuck.tangential / study.contact.stuck.normal == pytest.approx(
        1.7 / 1.4, rel=0.05
    )
    assert abs(study.contact.stuck.coupling) < 1e-3 * study.contact.stuck.normal


def test_a_curved_lower_face_is_doubted_by_as_much_as_it_is_wrong():
    """Two rigid spheres on Hertz's law, mu = 0.05, by LSODA: 0.0432 and 0.920; klack 0.0568, 1.080.

    Over a flat face nothing is doubted, however fast.
    """
    ball = BODY.format(
        name="ball",
        start="[0, -4]",
        edges="{arc: [2, -2], centre: [0, -2], name: foot}, {arc: [0, 0], centre: [0, -2], "
        "name: face}",
        size=0.04,
    )
    text = (
        TEXT.replace(PLATE, ball)
        .replace("0.2 m/s", "3 m/s")
        .replace("friction: 0.1", "friction: 0.05")
    )
    case = read_case(text, Path("spheres.yaml"))
    level = run_impact(case, levels=["interface"], certify=False).levels["interface"]
    told = next(doubt for doubt in level.doubts if "curved lower face" in doubt)
    tilt, other = map(float, re.findall(r"by about ([\d.]+) .* by ([\d.]+)\. Try", told)[0])
    assert level.oblique is not None
    assert level.oblique.impulse_ratio - 0.0432 == pytest.approx(tilt, rel=0.05)
    assert level.measures.restitution - 0.920 == pytest.approx(other, rel=0.05)
    assert not hit(3.0, mu=0.05).doubts


def test_a_flight_before_the_impact_changes_nothing():
    """The plate is the same everywhere: only the phase of the step is another, 1e-4 of it.

    Slip at the distance of the drawn bodies would make the impulse ratio of 0.02 m/s twice as much.
    """
    for speed in (0.2, 0.02):
        text = TEXT.replace("0.2 m/s", f"{speed} m/s")
        flown = text.replace("gap: 0 um", "gap: 100 um").replace("30 us", "240 us")
        near, far = (
            run_impact(read_case(one, Path("sphere.yaml")), levels=["interface"], certify=False)
            for one in (text, flown)
        )
        unit = np.repeat([1.0, 1.0 / RADIUS], 3)  # of a velocity, of a spin
        there, here = (after(one.levels["interface"]) / unit for one in (far, near))
        np.testing.assert_allclose(there, here, rtol=1e-3, atol=1e-5)
        assert near.contact.stuck is not None
        assert far.contact.stuck is not None
        assert far.contact.stuck.tangential == pytest.approx(
            near.contact.stuck.tangential, rel=1e-6
        )


def test_a_fast_spin_reaches_further_than_the_static_contact():
    """Points that are added have the gaps of a body that turns, too; the turn is doubted."""
    problem, _ = bodies()
    case = moving(spin=(0.0, 1e5, 0.0))
    level = run_impact(case, levels=["interface"], certify=False).levels["interface"]
    assert problem.space.count < len(level.pressure.area)
    assert "the body turns by" in level.doubts[0]


@pytest.mark.parametrize(
    ("new", "says"),
    [
        ("sideways_speed: 0.2 m/s", "motion.sideways_speed: got the level 'reduced' of a body"),
        ("spin: [0, 3 rad/s, 0]", "motion.spin: got the level 'reduced' of a body with 3 rad/s"),
    ],
)
def test_levels_along_the_axis_are_refused(new, says):
    case = read_case(TEXT.replace("sideways_speed: 0.2 m/s", new), Path("sphere.yaml"))
    with pytest.raises(InputError, match=re.escape(says)) as refused:
        run_impact(case, levels=["reduced"])
    assert "in a study: level: interface" in str(refused.value)


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ("shots: {count: 2, force: {uniform: [0 N, 1 N]}}", "or 'shots'"),
        ("run: {duration: 30 us, levels: [interface], impacts: 3}", "or 'run_in'"),
    ],
)
def test_what_starts_along_the_axis_is_refused(more, says):
    text = TEXT[: TEXT.index("run:")] if more.startswith("run") else TEXT
    with pytest.raises(InputError, match=says):
        read_case(f"{text}{more}\n", Path("sphere.yaml"))


@pytest.mark.parametrize(
    ("spin", "about_y"),
    [
        ("30 rpm", None),
        ("= v / (2 mm) * 1 rad", 100.0),
        ("= 2 * pi * f * 1 rad", 6.0 * pi),
        ("= 60 rad/s / 2", 30.0),
        ("= 30 rpm", None),  # a rate, half a turn in a second
        ("= v / (2 mm)", None),
    ],
)
def test_a_spin_is_in_radians(spin, about_y):
    """Half a turn in a second is never half a radian."""
    text = TEXT.replace("sideways_speed: 0.2 m/s", f"spin: [0, {spin}, 0]")
    text += "parameters: {v: 0.2 m/s, f: 3 Hz}\n"
    if about_y is None:
        with pytest.raises(InputError, match="angular velocity"):
            read_case(text, Path("sphere.yaml"))
    else:
        read = read_case(text, Path("sphere.yaml"))
        assert read.motion.spin[1] == pytest.approx(about_y, rel=1e-14)


def test_full_order_takes_the_same_motion():
    """Every degree of freedom against modes, on one mesh: 0.01 of restitution, 2 % of the spin."""
    problem, _ = bodies()
    case = moving(0.2, spin=(0.0, -40.0, 0.0))
    reduced = hit(0.2, spin=(0.0, -40.0, 0.0))
    kept = {
        body.name: Modes(np.zeros(0), np.zeros((body.dof_count, 0)))
        for body in (problem.pair.upper, problem.pair.lower)
    }
    full = simulate_in_full(replace(problem, case=case), kept=kept, progress=silent, threads=1)
    v, w = np.split(full.rigid_velocity, 2)
    assert v[0] == pytest.approx(after(reduced)[0], abs=2e-3)
    assert w[1] == pytest.approx(after(reduced)[4], rel=0.02)


def valve(size: str, **contact) -> Case:
    text = find_case("demo-valve-axisymmetric").read_text(encoding="utf-8")
    case = read_case(text.replace("size: 0.004 mm", f"size: {size}"), Path("needle.yaml"))
    return case.model_copy(update={"contact": case.contact.model_copy(update=contact)})


@pytest.mark.parametrize(("mu", "tolerance"), [(0.08, 0.005), (0.25, 0.009)])
def test_three_compliances_give_the_restitution_of_a_cone(mu, tolerance):
    """Closed form with the coupling; it has no partial slip within the width, 0.004 and 0.007.

    Without the coupling it is 0.04 and 0.08 off.
    """
    smooth, found = (
        run_impact(valve("0.004 mm", friction=one), levels=["interface"], certify=False)
        for one in (0.0, mu)
    )
    restitution = [one.levels["interface"].measures.restitution for one in (smooth, found)]
    share, c = restitution[1] / restitution[0], found.contact.stuck
    assert c is not None
    three = c.normal, c.tangential, c.coupling
    assert share == pytest.approx(ring_restitution(pi / 4.0, mu, *three), abs=tolerance)
    assert share - ring_restitution(pi / 4.0, mu, *three[:2], 0.0) > 0.03


def test_a_needle_that_moves_sideways_into_its_seat():
    """Half sections move in every way at the interface level: mirrored motions, spin about z."""
    case = valve("0.012 mm", friction=0.1, angles=12)

    def moved(**motion) -> np.ndarray:
        one = case.model_copy(update={"motion": case.motion.model_copy(update=motion)})
        return after(run_impact(one, levels=["interface"], certify=False).levels["interface"])

    there, back = moved(sideways_speed=0.02), moved(sideways_speed=0.02, sideways_direction=pi)
    np.testing.assert_allclose(back[[0, 4]], -there[[0, 4]], rtol=1e-5)
    np.testing.assert_allclose(back[2], there[2], rtol=1e-6)
    turning = moved(spin=(0.0, 0.0, 50.0))
    assert 0.0 < turning[5] < 50.0
    np.testing.assert_allclose(turning[:2], 0.0, atol=1e-8)
