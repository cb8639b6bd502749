"""What is doubted about a contact: its mesh, its yield stress.

What a mesh alone cannot tell of its contact: width, sharp edges, ends of the named surface.

Truth: Hertz's laws (Johnson 1985, 4.22 and 4.45) and the contact of a mesh that resolves it; angles
and names of the drawing.

What a contact says of its yield; truth: yield stresses of steels, 0.2 to 2.4 GPa.

What leaves out the yield stress of a material says so.
"""

import warnings
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType, SimpleNamespace

import numpy as np
import pytest
from doubts import doubts

from klack.analyses.contact_doubts import elastic_above
from klack.analyses.impact.contact_check import (
    FEWEST_POINTS,
    ContactCheck,
    check_contact,
    ends_reached,
)
from klack.analyses.impact.recovered_motion import recovered_motion
from klack.analyses.impact.run import run_impact
from klack.analyses.noise.source import impact_sources
from klack.analyses.reduction.run import run_reduce
from klack.assembling.problem import build_problem
from klack.assembling.yielding import tell_elastic
from klack.case import load_case, read_case
from klack.case.schema import Case
from klack.contact.statics import COARSE
from klack.contact.surface_edges import surface_edges
from klack.errors import AccuracyWarning
from klack.exchange.case_models import case_models
from klack.machine.progress import silent
from klack.mesh.meridian import mesh_meridian
from klack.mesh.profile import Arc, Line, Profile
from klack.mesh.sizing import MeshSizing
from klack.mesh.solid import mesh_revolved

CASE = """
klack: 1
title: Small needle
materials: {{steel: {{young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}}}}
bodies:
  needle:
    geometry:
      model: axisymmetric
      profile: {{unit: mm, parts: {{needle: {{start: {start}, edges: [{needle}, {{line: [1, 4]}},
        {{line: [0, 4]}}, {{close: true}}]}}}}}}
    material: steel
    mesh: {{size: 0.5 mm, grading: 0.5, contact: {{size: {size} mm, extent: {extent} mm}}}}
  housing:
    geometry:
      model: axisymmetric
      profile: {{unit: mm, parts: {{housing: {{start: {seat_start}, edges: [{seat}]}}}}}}
    material: steel
    mesh: {{size: 0.5 mm, grading: 0.5, contact: {{size: {size} mm, extent: {extent} mm}}}}
    fixed: [{{surface: outside}}]
contact: {{between: [needle.tip, housing.seat], gap: 0 um}}
motion: {{speed: {speed} m/s}}
reduction: {{modes: {{needle: {{count: 4}}, housing: {{count: 4}}}}}}
run: {{duration: 12 us, levels: [interface]}}
"""
BALL = "{arc: [1, 1], centre: [0, 1], name: tip}"
FLAT = (
    "{line: [2.5, -2]}, {line: [2.5, 0], name: outside}, {line: [0, 0], name: seat}, {close: true}"
)
CONE = (
    "{line: [2.5, -2.5]}, {line: [2.5, 0], name: outside}, {line: [1.2, 0]}, "
    "{line: [0.2, -1.0], name: seat}, {close: true}"
)
SHARP = (  # a bore with a square edge, met by a cone
    "{line: [2.5, -2]}, {line: [2.5, 0], name: outside}, {line: [0.5, 0], name: seat}, "
    "{close: true}"
)
ROUNDED = (
    "{line: [2.5, -2]}, {line: [2.5, 0], name: outside}, {line: [0.55, 0]}, "
    "{arc: [0.5, -0.05], centre: [0.55, -0.05], name: seat}, {close: true}"
)
POINTED = "{line: [0.2, 0]}, {line: [1, 0.8], name: tip}"
CROWNED = "{line: [0.2, 0]}, {arc: [1, 0.8], centre: [-2.4, 3.4], name: tip}"


def case(needle: str, seat: str, size: float, *, extent: float = 0.0, speed: float = 0.3) -> Case:
    starts = {FLAT: "[0, -2]", CONE: "[0.2, -2.5]"}
    text = CASE.format(
        start="[0, 0]",
        needle=needle,
        seat=seat,
        seat_start=starts.get(seat, "[0.5, -2]"),
        size=size,
        extent=max(extent, 2.0 * size),
        speed=speed,
    )
    return read_case(text, Path("small.yaml"))


def checked(asked: Case, force: float = 5.0) -> tuple[ContactCheck, list[str]]:
    """Check the static contact at a force, and return what was said."""
    problem = build_problem(asked, silent)
    force = min(force, problem.static.max_force)
    with doubts() as said:
        found = check_contact(asked, problem.pair, problem.static, force, "tip on seat")
    problem.close()
    return found, said


@pytest.mark.slow
@pytest.mark.parametrize(
    ("needle", "seat", "size"),
    [
        pytest.param(BALL, FLAT, 0.4, id="sphere on a plane"),
        pytest.param(BALL, CONE, 0.3, id="sphere on a cone"),
        pytest.param(POINTED, ROUNDED, 0.1, id="cone on a torus"),
        pytest.param(CROWNED, ROUNDED, 0.1, id="crowned cone on a torus"),
    ],
)
def test_one_round_of_refinement_is_enough(needle, seat, size):
    """A mesh that resolves nothing names the size that the next one needs.

    Tolerance of the width: the curvature on elements as long as the radius, and finite slopes.
    """
    coarse, said = checked(case(needle, seat, size))
    assert coarse.size_ratio > COARSE
    assert len(said) == 1
    assert "refine both contact surfaces to" in said[0]
    advised = 0.5 * coarse.expected

    fine, said = checked(case(needle, seat, 1e3 * advised, extent=3e3 * coarse.expected))

    assert said == []
    assert fine.doubts == ()
    assert fine.size_ratio < 1.2
    assert fine.points_across >= FEWEST_POINTS
    assert coarse.expected == pytest.approx(fine.half_width, rel=0.25)
    assert fine.expected == pytest.approx(fine.half_width, rel=0.08)


@pytest.mark.parametrize("size", [0.03, 0.014])
def test_a_sharp_edge_is_told_whatever_the_mesh(size):
    found, said = checked(case(POINTED, SHARP, size))

    assert found.doubts[0] == "it lies on a sharp edge"
    assert np.isnan(found.expected)
    assert len(said) == 1  # and no size of elements
    assert "sharp edge of 'housing' (housing.seat, at (0.5, 0) mm, 90 deg)" in said[0]
    assert "give the edge its real radius" in said[0]


def edged(angle: float) -> str:
    """Needle of two cones that meet at an edge [deg], half of it to either side of the seat."""
    half = np.radians(angle / 2.0)
    low = 0.7 * np.tan(np.pi / 4.0 - half)
    high = low + 0.3 * np.tan(np.pi / 4.0 + half)
    return f"{{line: [0.7, {low:.12f}], name: tip}}, {{line: [1, {high:.12f}], name: tip}}"


EDGE = "contact: an edge of 'needle' lies in it (needle.tip, at (0.7, "


@pytest.mark.parametrize(("angle", "size"), [(1.0, 0.005), (5.0, 0.001), (15.0, 0.0002)])
def test_an_edge_within_the_contact_costs_pressure_and_yield_not_the_force(angle, size):
    found, said = checked(case(edged(angle), CONE, size, extent=10.0 * size, speed=1.0), 60.0)

    assert len(said) == 1
    assert said[0].startswith(EDGE)
    assert f", {180.0 - angle:g} deg)" in said[0]
    assert found.doubts == ()
    assert np.isnan(found.needed_yield)


@pytest.mark.parametrize("needle", [edged(0.5), BALL], ids=["half a degree", "arc"])
def test_a_face_without_edges_keeps_its_yield(needle):
    found, said = checked(case(needle, CONE, 0.01, extent=0.1, speed=1.0), 60.0)

    assert said == []
    assert found.needed_yield > 0.0


@pytest.mark.slow
def test_the_force_on_an_edge_converges_and_its_pressure_does_not():
    """A wedge in contact with a half-plane has a pressure like log 1/r (Johnson 1985, 5.2)."""
    forces, pressures = [], []
    for size in (0.001, 0.0005, 0.00025):
        problem = build_problem(case(edged(10.0), CONE, size, extent=0.01, speed=1.0), silent)
        static = problem.static
        forces.append(float(np.interp(1e-6, static.approach, static.force)))
        lam = static.pattern_at(60.0) * 60.0
        pressures.append(float(np.max(lam / static.space.area)))
        problem.close()

    assert forces[1] == pytest.approx(forces[2], rel=5e-3)
    assert abs(forces[1] - forces[2]) < abs(forces[0] - forces[2])
    assert pressures[1] > 1.05 * pressures[0]
    assert pressures[2] > 1.05 * pressures[1]


def test_a_flat_face_with_edges_is_no_sharp_edge():
    flat = "{line: [1, 0], name: tip}"

    found, said = checked(case(flat, FLAT, 0.1, speed=0.05))

    assert said == []
    assert "it lies on a sharp edge" not in found.doubts


def split(at: float) -> str:
    """Ball whose named arc ends at an angle from the axis [rad]."""
    r, z = np.sin(at), 1.0 - np.cos(at)
    return (
        f"{{arc: [{r:.12f}, {z:.12f}], centre: [0, 1], name: tip}}, "
        "{arc: [1, 1], centre: [0, 1], name: flank}"
    )


@pytest.mark.slow
def test_a_contact_over_the_end_of_the_named_surface_names_the_next_one():
    """A sphere touches a cone of 45 degrees at 45 degrees; its named arc ends there."""
    whole, none = checked(case(BALL, CONE, 0.005, extent=0.05), 20.0)
    half, said = checked(case(split(np.pi / 4), CONE, 0.005, extent=0.05), 20.0)

    assert whole.doubts == ()
    assert none == []
    assert "it reaches the edge of a named surface" in half.doubts
    assert len(said) == 1
    assert "edge of 'needle.tip'" in said[0]
    assert "add 'needle.flank' to 'tip'" in said[0]


def test_an_end_beside_the_contact_is_not_told():
    found, said = checked(case(split(np.pi / 4 + 0.12), CONE, 0.005, extent=0.05), 20.0)

    assert said == []
    assert found.doubts == ()


@pytest.mark.slow
@pytest.mark.parametrize("level", ["interface", "full"])
def test_levels_with_contact_points_tell_the_end_as_well(level):
    asked = case(split(np.pi / 4), CONE, 0.005, extent=0.05)
    problem = build_problem(asked, silent)
    study = run_impact(asked, levels=(level,))
    unseen = ContactCheck(half_width=1e-5, size_ratio=0.5, points_across=9, expected=1e-5)

    with pytest.warns(AccuracyWarning, match=rf"level '{level}': .*add 'needle\.flank'"):
        seen = ends_reached(unseen, problem.pair, problem.space, study.levels, "tip on seat")

    assert seen.doubts == ("it reaches the edge of a named surface",)
    blind = {level: replace(study.levels[level], pressure=None)}
    assert ends_reached(unseen, problem.pair, problem.space, blind, "") is unseen
    assert any("add 'needle.flank'" in note for note in study.warnings)
    assert set(seen.doubts) <= set(study.contact.doubts)


HALF = Profile(
    (0, 0),
    (
        Arc((0.5e-3, 1e-3 * (1 - np.sqrt(0.75))), (0, 1e-3), "tip"),
        Arc((1e-3, 1e-3), (0, 1e-3), ""),
        Line((0, 1e-3), "top"),
        Line((0, 0), "axis"),
    ),
)


@pytest.mark.slow
@pytest.mark.parametrize("mesher", [mesh_meridian, mesh_revolved])
def test_edges_of_a_drawing_come_back_from_its_mesh(mesher):
    """A tip that goes on smoothly without a name, and a top that ends at a right angle."""
    mesh = mesher({"ball": HALF}, MeshSizing(size=0.3e-3))

    tip, top = (surface_edges(mesh, mesh.surface(name)) for name in ("tip", "top"))

    assert tip.ends.any()
    assert not tip.corners.any()
    assert None not in tip.neighbour  # facets of an arc are no edges
    assert set(tip.neighbour) <= {"", "face1", "face2", "face3"}
    radius = np.linalg.norm(tip.line[tip.ends, 0, :-1], axis=1)
    np.testing.assert_allclose(radius, 0.5e-3, rtol=1e-6)
    assert top.corners.any()
    assert not top.ends.any()
    np.testing.assert_allclose(np.degrees(top.angle[top.corners]), 90.0, atol=6.0)


@pytest.mark.parametrize("angle", [0.5, 5.0])
def test_straight_facets_of_an_arc_are_no_edges(angle):
    """Their edges, of some degrees each, are alike."""
    mesh = mesh_meridian({"ball": HALF}, MeshSizing(size=np.radians(angle) * 1e-3))
    points = mesh.points.copy()
    for block in mesh.surface("tip").blocks:
        first, last, middle = block.connectivity.T
        points[middle] = 0.5 * (points[first] + points[last])

    faceted = replace(mesh, points=points)

    assert None not in surface_edges(faceted, faceted.surface("tip")).neighbour


def test_a_set_of_faces_in_a_mesh_is_known_by_its_name():
    mesh = mesh_meridian({"ball": HALF}, MeshSizing(size=0.3e-3))
    rest = surface_edges(mesh, mesh.surface("tip"))
    (number,) = np.flatnonzero(rest.ends)
    assert rest.neighbour[number] == ""
    profile = Profile(
        HALF.start, (HALF.edges[0], replace(HALF.edges[1], name="SET-2"), *HALF.edges[2:])
    )

    named = mesh_meridian({"ball": profile}, MeshSizing(size=0.3e-3))

    surfaces = MappingProxyType(dict(named.surfaces))
    ends = surface_edges(replace(named, surfaces=surfaces), named.surface("tip"))
    assert ends.neighbour == ("SET-2",)


@pytest.mark.parametrize(
    ("needed", "words"),
    [
        (0.4e9, "stay elastic if the yield stress is at least about 400 MPa"),
        (
            5.5e9,
            "would yield: to stay elastic they need a yield stress of 5.5 GPa, and hardened "
            "steel has",
        ),
        (float("nan"), ""),
    ],
)
def test_a_yield_stress_that_no_steel_has_is_no_comfort(needed, words):
    contact = SimpleNamespace(surfaces="needle.tip on housing.seat", needed_yield=needed)

    said = elastic_above(contact)  # type: ignore[arg-type]

    assert words in said
    assert ("Try: 'yield'" in said) == (needed > 2.5e9)


SPHERES = Path(__file__).parents[1] / "data" / "case" / "yielding_spheres.yaml"


def _quiet(*_):
    pass


@pytest.mark.slow
def test_reduced_bodies_exports_and_recovered_motion_say_that_they_are_elastic():
    case = load_case(SPHERES)
    with pytest.warns(AccuracyWarning, match="reduced bodies are those of elastic .* 'steel'"):
        run_reduce(case)
    with pytest.warns(AccuracyWarning, match="exported models are those of elastic bodies"):
        case_models(case)
    with pytest.warns(AccuracyWarning, match="recovered motion is that of elastic bodies"):
        list(recovered_motion(build_problem(case, _quiet), [0], _quiet))


def test_elastic_materials_say_nothing():
    text = SPHERES.read_text("utf-8")
    given = ", yield: 280 MPa, hardening: {isotropic: 1 GPa}"
    assert given in text
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tell_elastic(read_case(text.replace(given, ""), SPHERES), "these are")


@pytest.mark.slow
def test_noise_of_an_impact_says_that_its_faces_were_new():
    """Truth: the share of the energy in the balance of the impact."""
    study = run_impact(load_case(SPHERES), levels=["reduced"], certify=False)
    energies = study.levels["reduced"].energies
    share = energies["plastic"] / energies["initial kinetic"]

    (source,) = impact_sources(study)

    told = [note for note in source.notes if "first on new faces" in note]
    assert len(told) == 1
    assert f"dissipates {100 * share:.2g} % of the energy" in told[0]
    worn = replace(study.levels["reduced"], energies=energies | {"plastic": 0.0})
    (after,) = impact_sources(replace(study, levels={"reduced": worn}))
    assert not any("new faces" in note for note in after.notes)
