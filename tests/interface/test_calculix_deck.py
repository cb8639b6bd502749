"""The deck of CalculiX, read back by klack's own Abaqus reader: the same bodies, nothing lost.

Truth: the meshes, materials and supports that went in; the flight before the first touch by hand.
"""

from dataclasses import replace
from math import sqrt
from pathlib import Path

import numpy as np
import pytest

from klack.assembling.bodies import build_bodies
from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.case import find_case, load_case
from klack.case.guide import CaseGuide
from klack.contact.pairing import axial_distance, face_geometry, project_to_surface
from klack.errors import AccuracyWarning, InputError
from klack.exchange import calculix_case
from klack.exchange.calculix_case import calculix_impact, calculix_settings
from klack.exchange.calculix_deck import (
    CalculixImpact,
    CalculixSettings,
    deck_lines,
    default_penalty,
    start_of_flight,
    write_deck,
)
from klack.machine.progress import silent
from klack.materials.material import Material
from klack.mesh.files.abaqus.reader import read_abaqus
from klack.mesh.files.mesh_model import MeshModel
from klack.mesh.mesh import Mesh, Surface
from klack.verification.lattice import lattice_mesh
from klack.verification.transient import needle_over_seat

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
BRASS = Material(name="brass", young=105e9, poisson=0.34, density=8400.0)
SETTINGS = CalculixSettings(step=50e-9, duration=2e-6, penalty=1e17)


def bar(name: str, family: str, low: float, high: float, *, held: bool, solid: str) -> ElasticBody:
    lines = [np.linspace(-0.5e-3, 0.5e-3, 3), np.linspace(-0.4e-3, 0.4e-3, 2)]
    mesh = lattice_mesh(family, [*lines, np.linspace(low, high, 3)], solid=solid)
    nodes = mesh.surface("bottom").nodes if held else ()
    return elastic_body(name, mesh, {solid: BRASS if held else STEEL}, fixed_nodes=nodes)


def impact(family: str = "tet10", *, distance: float = 3e-6, **more: float) -> CalculixImpact:
    upper = bar("needle", family, distance, 2e-3, held=False, solid="stem")
    lower = bar("seat", family, -1e-3, 0.0, held=True, solid="ring")
    return CalculixImpact(
        title="Two bars",
        upper=upper,
        lower=lower,
        upper_surface=upper.mesh.surface("bottom"),
        lower_surface=lower.mesh.surface("top"),
        materials={"needle": {"stem": STEEL}, "seat": {"ring": BRASS}},
        speed=0.5,
        **more,
    )


def read_back(deck: Path, impact: CalculixImpact, settings: CalculixSettings) -> MeshModel:
    write_deck(impact, settings, deck)
    return read_abaqus(deck, 1e-3)


def faces(points: np.ndarray, surface: Surface) -> np.ndarray:
    """Centres of the faces in a fixed order, [mm] rounded."""
    centres = [points[block.connectivity].mean(axis=1) for block in surface.blocks]
    rounded = np.round(1e3 * np.concatenate(centres), 6)
    return rounded[np.lexsort(rounded.T)]


@pytest.mark.parametrize("family", ["tet4", "tet10", "hex8", "hex20", "wedge6", "wedge15"])
def test_the_deck_holds_both_bodies(family, tmp_path):
    bodies = impact(family)

    model = read_back(tmp_path / "two.inp", bodies, SETTINGS)

    shift, _ = start_of_flight(bodies, SETTINGS.step)
    above, below = bodies.upper.mesh.moved(np.array([0, 0, shift])), bodies.lower.mesh
    points = np.concatenate([above.points, below.points])
    np.testing.assert_allclose(model.mesh.points, points, rtol=0, atol=1e-15)
    assert model.mesh.solids == ("UPPER_1", "LOWER_1")
    for block, mesh, first in zip(
        model.mesh.blocks, (above, below), (0, above.node_count), strict=True
    ):
        assert block.family == family
        np.testing.assert_array_equal(block.connectivity - first, mesh.blocks[0].connectivity)
    for name, mesh, surface in (
        ("UPPER_CONTACT", above, bodies.upper_surface),
        ("LOWER_CONTACT", below, bodies.lower_surface),
    ):
        np.testing.assert_array_equal(
            faces(model.mesh.points, model.mesh.surface(name)), faces(mesh.points, surface)
        )
    np.testing.assert_array_equal(
        model.mesh.node_sets["LOWER_FIXED"] - above.node_count, below.surface("bottom").nodes
    )


def test_materials_and_masses_survive_the_units(tmp_path):
    bodies = impact()

    model = read_back(tmp_path / "two.inp", bodies, SETTINGS)

    for solid, material in (("UPPER_1", STEEL), ("LOWER_1", BRASS)):
        read = model.materials[model.sections[solid]]
        for key, unit in (("young", 1e6), ("poisson", 1.0), ("density", 1e12)):  # t, mm, s
            assert unit * getattr(read, key) == pytest.approx(getattr(material, key), rel=1e-12)
    assert bodies.upper.mass == pytest.approx(7850 * 1e-3 * 0.8e-3 * 1.997e-3, rel=1e-12)


def test_several_solids_keep_their_own_sections(tmp_path):
    bodies = impact()
    block = bodies.upper.mesh.blocks[0]
    half = len(block.connectivity) // 2
    parts = (
        replace(block, connectivity=block.connectivity[:half], solid="stem, lower"),
        replace(block, connectivity=block.connectivity[half:], solid="stem"),
    )
    mesh = replace(bodies.upper.mesh, blocks=parts)
    materials = {"stem": BRASS, "stem, lower": STEEL}
    body = elastic_body("needle", mesh, materials)
    bodies = replace(
        bodies, upper=body, materials={"needle": materials, "seat": bodies.materials["seat"]}
    )

    model = read_back(tmp_path / "two.inp", bodies, SETTINGS)

    assert model.mesh.solids == ("UPPER_1", "UPPER_2", "LOWER_1")
    assert model.materials["UPPER_2"].young == pytest.approx(105e3, rel=1e-12)
    assert len(model.mesh.blocks[0].connectivity) == half


def test_the_flight_lasts_two_steps_from_any_placement():
    for distance in (3e-6, 0.0, -20e-9):
        bodies = impact(distance=distance)

        shift, speed = start_of_flight(bodies, 50e-9)

        placed = bodies.upper.mesh.moved(np.array([0, 0, shift]))
        gap = axial_distance(placed, bodies.upper_surface, bodies.lower.mesh, bodies.lower_surface)
        assert gap == pytest.approx(2 * 50e-9 * 0.5, rel=1e-6)  # coordinates of 2 mm, round-off
        assert speed == 0.5


@pytest.mark.slow
def test_no_point_of_a_waving_ring_overlaps_at_the_start():
    """Between the nodes of 12 layers the faces wave: random points, not those that were sampled."""
    upper, lower, _ = needle_over_seat(size=25e-6, bulk=1e-3, layers=12)
    bodies = CalculixImpact(
        title="Ring",
        upper=upper,
        lower=lower,
        upper_surface=upper.mesh.surface("tip"),
        lower_surface=lower.mesh.surface("cone"),
        materials={body.name: {"solid": STEEL} for body in (upper, lower)},
        speed=0.5,
    )

    shift, _ = start_of_flight(bodies, 50e-9)

    xi = np.random.default_rng(1).dirichlet(np.ones(3), 200)[:, :2]
    (block,) = bodies.upper_surface.blocks
    placed = upper.mesh.points + np.array([0.0, 0.0, shift])
    points = face_geometry(placed, block, xi).position.reshape(-1, 3)
    down = np.tile([0.0, 0.0, -1.0], (len(points), 1))
    gap = project_to_surface(points, down, lower.mesh, bodies.lower_surface, deepest=np.inf).gap
    assert np.nanmin(gap) == pytest.approx(2 * 50e-9 * 0.5, rel=0.1)


def test_a_force_starts_where_the_case_says_or_gives_back_its_work():
    far = impact(distance=3e-6, closing_force=4.0)
    assert start_of_flight(far, 50e-9) == (0.0, 0.5)

    near = impact(distance=0.0, closing_force=4.0)
    shift, speed = start_of_flight(near, 50e-9)

    assert shift == pytest.approx(50e-9, rel=1e-6)
    gained = 0.5 * near.upper.mass * (0.5**2 - speed**2)
    assert gained == pytest.approx(4.0 * shift, rel=1e-6)
    assert sqrt(0.5**2 - 2 * 4.0 / near.upper.mass * shift) == pytest.approx(speed, rel=1e-9)


def test_the_motion_is_in_millimetres():
    text = list(deck_lines(impact(closing_force=40.0), SETTINGS))

    assert "UPPER_NODES, 3, -500" in text
    load = next(line for line in text if "GRAV" in line)
    mass = 7850 * 1e-3 * 0.8e-3 * 1.997e-3
    assert float(load.split(",")[2]) == pytest.approx(40.0 / mass * 1e3, rel=1e-9)
    assert load.endswith("0., 0., -1.")
    assert text[text.index("*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR") + 1] == "100000000,"
    assert "*DYNAMIC, DIRECT, ALPHA=-0.05, SOLVER=ITERATIVE SCALING" in text
    assert "5e-08, 2e-06" in text


def test_the_proposed_penalty_adds_a_three_hundredth():
    """300 E*/h, E* of steel on brass and h = 0.4 mm sqrt(2) / 2 at most: by hand."""
    bodies = impact("hex20")

    stiffness = 1 / ((1 - 0.3**2) / 210e9 + (1 - 0.34**2) / 105e9)
    assert default_penalty(bodies) == pytest.approx(300 * stiffness / 0.5e-3, rel=1e-6)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"step": 0.0}, "step"),
        ({"penalty": float("nan")}, "penalty"),
        ({"duration": 1e-9}, "one step"),
    ],
)
def test_settings_that_cannot_be(values, words):
    with pytest.raises(InputError, match=words):
        replace(SETTINGS, **values)


def test_bodies_that_cannot_be():
    bodies = impact()
    with pytest.raises(InputError, match="an upper body that is held"):
        list(deck_lines(replace(bodies, upper=bodies.lower, lower=bodies.upper), SETTINGS))
    sideways = replace(bodies, upper_surface=bodies.upper.mesh.surface("left"))
    with pytest.raises(InputError, match="no line along z"):
        list(deck_lines(sideways, SETTINGS))
    with pytest.raises(InputError, match="shorter step"):
        list(deck_lines(impact(distance=0.0, closing_force=1e9), SETTINGS))


def test_axisymmetric_cases_are_refused_before_any_mesh():
    def nothing(stage: str, fraction: float) -> None:
        raise AssertionError("began to work")

    with pytest.raises(InputError, match="model: swept"):
        calculix_impact(load_case(find_case("demo-valve-axisymmetric")), nothing)


@pytest.fixture(scope="module")
def witness():
    """Bodies of the witness case, which neither its guide nor its friction changes."""
    return build_bodies(load_case(find_case("witness")), silent)


@pytest.fixture
def built(witness, monkeypatch):
    monkeypatch.setattr(calculix_case, "build_bodies", lambda case, progress: witness)


@pytest.mark.slow
@pytest.mark.usefixtures("built")
def test_a_guide_is_left_out_with_a_note():
    case = load_case(find_case("witness"))
    guide = CaseGuide(surface="shaft", heights=("1 mm", "2 mm"), clearance="5 um")
    with pytest.warns(AccuracyWarning, match="left out of the deck, as in the full order: guide"):
        calculix_impact(case.model_copy(update={"guide": guide}), silent)


@pytest.mark.slow
@pytest.mark.usefixtures("built")
@pytest.mark.parametrize(
    ("contact", "words"),
    [
        ({"friction": 0.1}, r"friction 0\.1 is regularised .* every slip speed\.$"),
        (
            {"friction": 0.1, "static_friction": 0.2, "stribeck_speed": 0.01},
            r"left out: contact\.static_friction 0\.2, stribeck_speed 10 mm/s\.$",
        ),
        ({"static_friction": 0.2}, r"the deck has no friction .*static_friction 0\.2\.$"),
    ],
)
def test_friction_says_what_is_another_law(contact, words):
    case = load_case(find_case("witness"))
    rough = case.contact.model_copy(update=contact)
    with pytest.warns(AccuracyWarning, match=words):
        bodies = calculix_impact(case.model_copy(update={"contact": rough}), silent)
    assert bodies.friction == contact.get("friction", 0.0)


def test_friction_adds_its_lines_alone():
    """Stick slope by hand, 1e8 MPa/mm / 30; all other lines are those without friction."""
    smooth, rough = (list(deck_lines(impact(friction=mu), SETTINGS)) for mu in (0.0, 0.1))

    at = rough.index("*FRICTION")
    assert rough[at + 1] == "0.1, 3333333.33333"
    assert rough[at - 4].startswith("** stick slope: penalty times 0.0333")
    assert "by up to 3 times their overclosure" in rough[at - 3]
    del rough[at - 4 : at + 2]
    begin = next(i for i, line in enumerate(rough) if line.startswith("** ballast"))
    end = rough.index("*SOLID SECTION, ELSET=BALLAST, MATERIAL=BALLAST")
    del rough[begin : end + 1]
    rough.remove("BALLAST_NODES, 3, -500")
    solver = next(i for i, line in enumerate(smooth) if line.startswith("*DYNAMIC"))
    assert smooth[solver].endswith("SOLVER=ITERATIVE SCALING")
    smooth[solver] = smooth[solver].replace("ITERATIVE SCALING", "SPOOLES")
    assert rough == smooth


def test_the_ballast_of_friction_is_heavy_and_far(tmp_path):
    """A thousand times the mass of the upper body, beside both bodies."""
    bodies = impact(friction=0.1)

    model = read_back(tmp_path / "two.inp", bodies, SETTINGS)

    points, first = model.mesh.points, model.mesh.node_count - 8
    cube, others = points[first:], points[:first]
    assert cube[:, 0].min() > others[:, 0].max() + 1e-3
    volume = np.prod(np.ptp(cube, axis=0))
    density = 1e12 * model.materials[model.sections["BALLAST"]].density
    assert density * volume == pytest.approx(1e3 * bodies.upper.mass, rel=1e-9)


def test_the_witness_case_becomes_a_deck(tmp_path):
    case = load_case(find_case("witness"))
    bodies = calculix_impact(case, silent)
    settings = calculix_settings(case, bodies)

    model = read_back(tmp_path / "witness.inp", bodies, settings)

    assert (settings.step, settings.duration) == (case.run.full_step, case.run.duration)
    mesh: Mesh = model.mesh
    assert mesh.node_count == bodies.upper.mesh.node_count + bodies.lower.mesh.node_count
    upper = mesh.surface("UPPER_CONTACT")
    assert upper.face_count == bodies.upper_surface.face_count
    # outwards is down for the tip of a needle
    tip = mesh.points[upper.blocks[0].connectivity[:, :3]]
    normals = np.cross(tip[:, 1] - tip[:, 0], tip[:, 2] - tip[:, 0])
    assert np.all(normals[:, 2] < 0)
