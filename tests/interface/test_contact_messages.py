"""What is asked and said about contacts, meshes, sizes, materials and laws.

What a user reads when two surfaces cannot be in contact, and what is warned of.

Impossible laws are refused with a text that says what to do.

Sizes that a case asks for and no mesher can do: the message names the key, and a size that does.

Truth: the mesher itself, asked with the size of the hint.

Mistakes that show when a case is computed: where they are told.

Truth: the line of the case in which the key stands.

Materials that no solid has are asked about; truth = handbook values of solids, and usual slips.

Moduli and densities: Kaye and Laby, Tables of Physical and Chemical Constants, 16th ed. (1995).

Bodies of an unusual size are asked about, once; truth: sizes drawn here, and the words.

A needle valve is 0.1 mm to 1 m long; a STEP file in the wrong unit is a thousand times off.
"""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
import yaml

from klack.analyses.linearisation.run import run_linearisation
from klack.analyses.operating_point.run import run_operating_points
from klack.analyses.stroke.run import run_stroke
from klack.assembling.bodies import mesh_body, place_meshes
from klack.assembling.generated_mesh import coarsest_sound, meshed_for_case
from klack.assembling.given_shapes import require_given_shapes, require_usual_sizes
from klack.assembling.valve import mesh_valve_bodies
from klack.case import find_case, load_case, read_case
from klack.case.any_case import load_any_case, load_valve_case, read_valve_case, tree_of
from klack.case.valve import ValveCase
from klack.cli.main import main
from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw, gonthier_coefficient
from klack.contact.mortar import contact_space, touching_shift
from klack.contact.statics import COARSE, size_over_half_width, static_contact
from klack.contact.submodel import local_stiffness
from klack.errors import AccuracyWarning, InputError
from klack.exchange.case_models import case_models
from klack.machine import memory
from klack.machine.progress import silent
from klack.materials.material import Material
from klack.mesh.meridian import mesh_meridian
from klack.mesh.mesh import Mesh, Surface
from klack.mesh.profile import Line, Profile
from klack.mesh.quality import PoorElementError
from klack.mesh.sizing import MeshSizing, Refinement
from klack.mesh.solid import mesh_step, write_step_revolved
from klack.units import LENGTH, parse_quantity
from klack.verification.contact import half_spaces, parabola, sphere_on_cone

RADIUS, WIDTH = 40e-3, 100e-6


def sphere(cells=(6, 5), reach_in_widths=1.6):
    return half_spaces(
        parabola(RADIUS, 4 * WIDTH),
        contact=WIDTH,
        cells=cells,
        far=100,
        reach=(reach_in_widths * WIDTH) ** 2 / (2 * RADIUS),
    )


@pytest.fixture(scope="module")
def shells():
    return sphere_on_cone("hex20", (14, 12))[:2]


@pytest.mark.parametrize("sides", [("top", "top"), ("bottom", "bottom"), ("right", "left")])
def test_surfaces_that_do_not_face_each_other(shells, sides):
    a, b = shells
    with pytest.raises(InputError, match="face each other"):
        contact_space(a, a.surface(sides[0]), b, b.surface(sides[1]), reach=1e-6)


def test_placing_surfaces_that_miss_each_other(shells):
    a, b = shells
    aside = a.moved(np.array([5e-3, 0, 0]))
    with pytest.raises(InputError, match="face each other"):
        touching_shift(aside, aside.surface("bottom"), b, b.surface("top"))


def test_solid_against_axisymmetric(shells):
    a, _ = shells
    b = sphere().body_b.mesh
    with pytest.raises(InputError, match="dimension 3 against one of 2"):
        contact_space(a, a.surface("bottom"), b, b.surface("top"))


def test_empty_surface_and_negative_reach(shells):
    a, b = shells
    with pytest.raises(InputError, match="'nothing' without faces"):
        contact_space(a, Surface("nothing", ()), b, b.surface("top"))
    with pytest.raises(InputError, match="reach"):
        contact_space(a, a.surface("bottom"), b, b.surface("top"), reach=-1e-6)


def test_contact_that_grows_to_the_rim():
    problem = sphere(reach_in_widths=0.6)

    with pytest.raises(InputError, match=r"edge of the candidate points above .* N") as caught:
        problem.solve(4.0)
    hint = re.search(r"'reach: (\S+) um', under contact", str(caught.value))
    assert hint
    wider = half_spaces(
        parabola(RADIUS, 4 * WIDTH),
        contact=WIDTH,
        cells=(6, 5),
        far=100,
        reach=1e-6 * float(hint[1]),
    )
    assert wider.solve(4.0).max_force == pytest.approx(4.0, rel=0.02)  # what is advised suffices


def test_automatic_reach_holds_the_contact():
    problem = sphere()
    a, b = problem.body_a.mesh, problem.body_b.mesh

    space = contact_space(a, a.surface("bottom"), b, b.surface("top"))

    assert problem.space.count < space.count <= 400


def test_elements_over_half_width_tell_a_coarse_contact():
    problem = sphere(cells=(3, 2))
    C = problem.compliance()

    assert size_over_half_width(static_contact(problem.space, C, 3.8)) < 1.0
    assert size_over_half_width(static_contact(problem.space, C, 0.05)) > COARSE


def test_restricted_space_gives_the_same_contact():
    problem = sphere()
    C = problem.compliance()
    full = static_contact(problem.space, C, 2.0)
    keep = (full.pressures[-1] > 0) | (problem.space.points[:, 0] < 1.2 * WIDTH)

    part = static_contact(problem.space.restricted(keep), C[np.ix_(keep, keep)], 2.0)

    assert 0 < keep.sum() < problem.space.count
    np.testing.assert_allclose(part.force, full.force, rtol=1e-9)
    carrying = full.pressures[-1] > 0
    cut, C = problem.space.restricted(carrying), C[np.ix_(carrying, carrying)]
    with pytest.raises(InputError, match="edge of the candidate"):
        static_contact(cut, C, 2.5)


def test_pattern_has_a_resultant_of_one_newton():
    problem = sphere()
    static = problem.solve(2.0)

    on_a, on_b = static.load_patterns(1.3)

    assert on_a[1::2].sum() == pytest.approx(1.0, rel=1e-12)
    assert on_b[1::2].sum() == pytest.approx(-1.0, rel=1e-12)
    with pytest.raises(InputError, match="end of the ladder"):
        static.pattern_at(3.0)


def test_submodel_is_stiffer_than_the_bodies_and_softens_with_its_size():
    problem = sphere()
    static = problem.solve(2.0)
    upper = static.force > 0.5 * static.max_force
    whole = np.polyfit(static.approach[upper], static.force[upper], 1)[0]

    small, large = (
        local_stiffness(static, problem.body_a, problem.body_b, size=n * WIDTH) for n in (4, 16)
    )

    assert small.stiffness > large.stiffness > whole
    # the far field of a point load yields like 1/size
    assert large.stiffness == pytest.approx(whole, rel=0.1)
    assert small.fit_range == (0.5 * static.max_force, static.max_force)
    with pytest.raises(InputError, match="size"):
        local_stiffness(static, problem.body_a, problem.body_b, size=1.0)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: LinearLaw(0.0), r"LinearLaw.stiffness: got 0 N/m"),
        (lambda: LinearLaw(float("nan")), r"got nan N/m"),
        (lambda: HertzLaw(1e9, exponent=0.5), r"HertzLaw.exponent: got 0.5"),
        (lambda: TableLaw([1e-6, 2e-6], [1.0]), r"2 indentations and 1 forces"),
        (lambda: TableLaw([2e-6, 1e-6], [1.0, 2.0]), r"strictly increasing"),
        (lambda: TableLaw([1e-6, 2e-6], [2.0, 2.0]), r"strictly increasing"),
        (lambda: TableLaw([0.0, 1e-6], [1.0, 2.0]), r"from \(0, 0\)"),
        (lambda: TableLaw(np.array([]), np.array([])), r"at least one"),
        (lambda: HuntCrossley(LinearLaw(1.0), -0.1), r"HuntCrossley.dissipation"),
        (lambda: HuntCrossley(HuntCrossley(LinearLaw(1.0), 0.1), 0.1), r"another HuntCrossley"),
        (lambda: gonthier_coefficient(0.0), r"restitution: got 0"),
        (lambda: gonthier_coefficient(1.2), r"restitution: got 1.2"),
    ],
)
def test_refused(make, text):
    with pytest.raises(InputError, match=text):
        make()


RODS = (Path(__file__).parents[1] / "data" / "tiny_rods.yaml").read_text(encoding="utf-8")
PIN = Profile((0, 0), (Line((1e-3, 0)), Line((1e-3, 4e-3)), Line((0, 4e-3)), Line((0, 0))))


def needs(limit: float):
    """Mesher that fails, as netgen does at a round face, above a size."""

    def mesher(sizing: MeshSizing) -> Mesh:
        if sizing.size > limit:
            error = PoorElementError(
                "mesh_step: pin.step: element 7 (tet10)", got="-0.1", expected="above 0", hint="-"
            )
            error.elements = 200
            raise error
        return mesh_meridian({"pin": PIN}, sizing)

    return mesher


def test_a_size_that_is_too_coarse_is_named_with_one_that_does():
    """Of 2 mm the shares 0.7 and 0.5 are tried; 1.2 mm is the limit."""
    mesher = needs(1.2e-3)
    with pytest.raises(InputError) as caught:
        meshed_for_case("pin", MeshSizing(size=2e-3), mesher)

    text = str(caught.value)
    assert text.startswith("bodies.pin.mesh.size: mesh_step: pin.step: element 7 (tet10): got 2 mm")
    found = re.search(r"bodies\.pin\.mesh\.size: (\S+ \S+) \(tested", caught.value.hint)
    assert found is not None
    size = parse_quantity(found[1], LENGTH, "size")
    assert size == pytest.approx(1e-3, rel=1e-12)
    mesher(MeshSizing(size=size))


@pytest.mark.slow
def test_a_thin_walled_tube_of_a_step_file(tmp_path: Path):
    """Wall of 0.2 mm, radius 3 mm: curved elements of 1 mm turn inside out."""
    tube = Profile(
        (2.8e-3, 0), (Line((3e-3, 0)), Line((3e-3, 5e-3)), Line((2.8e-3, 5e-3)), Line((2.8e-3, 0)))
    )
    write_step_revolved({"tube": tube}, tmp_path / "tube.step")

    def mesher(sizing: MeshSizing) -> Mesh:
        return mesh_step(tmp_path / "tube.step", sizing)

    with pytest.raises(InputError) as caught:
        meshed_for_case("tube", MeshSizing(size=2e-3), mesher)

    assert caught.value.where.startswith("bodies.tube.mesh.size: mesh_step: ")
    found = re.search(r"bodies\.tube\.mesh\.size: (\S+ \S+) \(tested", caught.value.hint)
    assert found is not None, caught.value.hint
    assert parse_quantity(found[1], LENGTH, "size") < 1.5e-3


def test_what_is_called_tried_had_the_refinements_of_the_run():
    """A size that changes where the bodies touch: the refinement there needs still smaller ones.

    Without its refinement the first finer size, 1.4 mm, does.
    """
    tried: list[MeshSizing] = []

    def at_size(size: float) -> MeshSizing:
        return MeshSizing(size=size, refinements=(Refinement(position=(1e-3, size), size=1e-4),))

    def mesher(sizing: MeshSizing) -> Mesh:
        tried.append(sizing)
        return needs(0.8e-3 if sizing.refinements else 1.5e-3)(replace(sizing, refinements=()))

    with pytest.raises(InputError) as caught:
        meshed_for_case("pin", at_size(2e-3), mesher, at_size)

    assert "bodies.pin.mesh.size: 700 um (tested, the shape meshes)" in caught.value.hint
    assert tried[-1] == at_size(0.7e-3)


def test_a_valve_has_the_places_of_its_stops_at_every_size(monkeypatch):
    """Drawn bodies touch where their drawing says, whatever the size of their elements."""
    seen = {}

    def no_mesh(body, name, places=None, places_at=None):
        seen[name] = places, places_at(2.0 * body.mesh.size)

    monkeypatch.setattr("klack.assembling.valve.mesh_body", no_mesh)
    mesh_valve_bodies(load_any_case(find_case("demo-stroke")), silent)

    assert seen
    for places, again in seen.values():
        assert len(places) > 0
        assert again == places


def test_a_first_mesh_is_as_coarse_as_its_elements_allow():
    """Of 2 mm the shares 0.7 and 0.5 are tried; 1.2 mm is the limit."""
    mesh = coarsest_sound(MeshSizing(size=2e-3), needs(1.2e-3))
    same = mesh_meridian({"pin": PIN}, MeshSizing(size=1e-3))
    assert (mesh.points == same.points).all()
    with pytest.raises(PoorElementError):
        coarsest_sound(MeshSizing(size=2e-3), needs(0.01e-3))


def test_faces_that_do_not_meet_are_told_with_place_and_bodies():
    """A face of radius 0 to 2 mm, and one that begins at 3 mm."""
    text = RODS.replace(
        "mesh: {size: 1 mm}", "mesh: {size: 1 mm, contact: {size: 50 um, extent: 50 um}}"
    )
    text = text.replace("start: [0, -40]", "start: [3, -40]")
    text = text.replace("line: [2, -40]", "line: [5, -40]").replace(
        "line: [2, 0], name: side", "line: [5, 0], name: side"
    )
    text = text.replace("line: [0, 0], name: end", "line: [3, 0], name: end").replace(
        "name: axis", "name: bore"
    )
    with pytest.raises(InputError) as caught:
        place_meshes(read_case(text, Path("rods.yaml")), silent)

    assert str(caught.value).startswith(
        "rods.yaml:37: contact.between: short.end on long.end: got radii 0 to 2 mm over 3 to 5 mm"
    )


def test_without_a_size_that_does_the_hint_says_what_to_look_at():
    with pytest.raises(InputError) as caught:
        meshed_for_case("pin", MeshSizing(size=2e-3), needs(0.05e-3))
    assert "below the radius of the smallest round face" in caught.value.hint
    assert "bodies.pin.mesh.grading below 0.3" in caught.value.hint


@pytest.mark.parametrize("setting", ["size", "contact.size"])
def test_too_many_elements_are_refused_by_the_key_of_the_case(setting, monkeypatch):
    monkeypatch.setattr(memory, "_WORTH_A_LOOK", 0.0)
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=50e3))
    monkeypatch.setenv("KLACK_CACHE", "off")
    body = load_case(find_case("demo-valve-axisymmetric")).bodies["needle"]
    places = ((0.4e-3, -0.4e-3),) if setting == "contact.size" else ()

    with pytest.raises(InputError) as caught:
        mesh_body(body, "needle", places)

    # the finest of the two makes the most elements
    assert caught.value.where == f"bodies.needle.mesh.{setting}"
    assert f"a bodies.needle.mesh.{setting} of" in caught.value.hint


CASE = """\
klack: 1
title: two rooms at one node
network:
  fluid: n-heptane
  components:
    m: {type: rigid-mass, mass: 1 kg, points: [p]}
    s: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}, restitution: 0.1}
    k: {type: spring, stiffness: 1 N/mm, preload: 100 N}
    supply: {type: pressure-source, pressure: 5 bar}
    o: {type: orifice, diameter: 0.1 mm}
    c: {type: chamber, volume: 10 mm^3, pressure: 5 bar}
    d: {type: chamber, volume: 10 mm^3, pressure: 6 bar}
  connections:
    - [supply.fluid, o.a]
    - [o.b, c.fluid, d.fluid]
    - [m.p, s.upper, k.end]
    - [s.lower, ground]
run: {duration: 0.1 ms, step: 20 ns, record: 1 us, variants: [wet], lift: m.p}
"""
LINE = CASE.replace("o: {type: orifice, diameter: 0.1 mm}", "o: {type: line, length: 1 mm,\n"
    "        diameter: 1 mm, pressure: 0.01 bar}").replace("6 bar", "5 bar")  # fmt: skip


def line_of(text, words):
    return next(n for n, line in enumerate(text.splitlines(), 1) if words in line)


@pytest.mark.parametrize(
    "compute",
    [
        run_stroke,
        run_linearisation,
        case_models,
        lambda case: run_operating_points(case, tree_of(case.source, case.path)),
    ],
    ids=["stroke", "linearise", "export", "steady"],
)
@pytest.mark.parametrize(
    ("text", "words", "key"),
    [
        (CASE, "6 bar", "network.components.d: got 6 bar at the start where 'c' has 5 bar"),
        (LINE, "0.01 bar", "network.components.o.pressure: got 0.01 bar"),
    ],
    ids=["section", "key"],
)
def test_errors_of_a_network_name_file_and_line(compute, text, words, key):
    case = read_valve_case(text, Path("valve.yaml"))
    with pytest.raises(InputError) as caught:
        compute(case)

    assert str(caught.value).startswith(f"valve.yaml:{line_of(text, words)}: {key}")


def test_errors_in_a_part_name_the_file_of_the_part(tmp_path):
    part = (
        "klack: 1\npart: room\nports: {a: c.fluid}\ncomponents:\n"
        "  c: {type: chamber, volume: 1 mm^3,\n      pressure: 7 bar}\nconnections: []\n"
    )
    (tmp_path / "room.yaml").write_text(part)
    text = CASE.replace("network:", "include: [{file: room.yaml, as: room}]\nnetwork:")
    text = text.replace("d.fluid", "room.a").replace(
        "    d: {type: chamber, volume: 10 mm^3, pressure: 6 bar}\n", ""
    )
    (tmp_path / "valve.yaml").write_text(text)
    with pytest.raises(InputError) as caught:
        run_stroke(load_valve_case(tmp_path / "valve.yaml"))

    found = re.match(r"(.*): components\.c \(of 'room'\): got 7 bar", str(caught.value))
    assert found, str(caught.value)
    assert found[1] == f"{tmp_path / 'room.yaml'}:{line_of(part, 'type: chamber')}"


def test_a_case_made_in_python_has_no_line():
    made = ValveCase.model_validate(yaml.safe_load(CASE))
    with pytest.raises(InputError, match=r"^components\.d: got"):
        run_stroke(made)


DATA = Path(__file__).parents[1] / "data"
SOLIDS = {  # Pa, kg/m^3
    "steel": (210e9, 7850.0),
    "aluminium": (70e9, 2700.0),
    "lead": (16e9, 11_340.0),
    "tungsten carbide": (620e9, 14_900.0),
    "beryllium": (300e9, 1850.0),
    "sapphire": (430e9, 3980.0),
    "diamond": (1050e9, 3515.0),
    "gold": (78e9, 19_300.0),
    "PTFE": (0.4e9, 2200.0),
    "rubber": (2e6, 1100.0),
}
SLIPS = {
    "MPa for GPa": (210e6, 7850.0),
    "GPa read as Pa": (210.0, 7850.0),
    "g/cm^3 read as kg/m^3": (210e9, 7.85),
    "t/mm^3 and MPa as SI": (2.1e5, 7.85e-9),
    "kg/m^3 read as g/cm^3": (210e9, 7.85e6),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_not_questioned(name: str):
    young, density = SOLIDS[name]
    assert Material(name=name, young=young, poisson=0.3, density=density).question is None


@pytest.mark.parametrize("slip", SLIPS)
def test_slips_of_units_are(slip: str):
    young, density = SLIPS[slip]
    asked = Material(name="st", young=young, poisson=0.3, density=density).question
    assert asked is not None
    assert "check both units" in asked


@pytest.mark.slow
def test_such_a_material_is_refused_until_it_is_confirmed_and_then_noted_once(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    text = (DATA / "tiny_rods.yaml").read_text()
    assert "young: 210 GPa" in text
    case = tmp_path / "soft.yaml"
    soft = text.replace("young: 210 GPa", "young: 210 MPa")
    case.write_text(soft)
    assert main(["impact", str(case)]) == 2
    refused = "".join(capsys.readouterr())
    assert "soft.yaml:4: materials.steel: got a Young's modulus of 0.21 GPa at 7850" in refused
    assert "'unusual: true' at the top of the case" in refused

    case.write_text(f"unusual: true\n{soft}")
    assert main(["impact", str(case), "--no-report", "--no-certify"]) == 0

    assert " ".join("".join(capsys.readouterr()).split()).count("would carry waves at 164 m/s") == 1


MODEL = "      model: axisymmetric\n"


def rods(unit: str = "mm", extent: str = ""):
    """Rods of 20 and 40 units; ``extent`` confirms the size of the long one."""
    head, tail = RODS.replace("unit: mm", f"unit: {unit}").split("\n  long:\n")
    if extent:
        tail = tail.replace(MODEL, f"{MODEL}      extent: {extent}\n", 1)
    return read_case(f"{head}\n  long:\n{tail}", Path("rods.yaml"))


def no_mesh(name: str):
    raise AssertionError(f"nothing may be read for '{name}'")


@pytest.mark.parametrize("unit", ["mm", "cm"])
def test_usual_sizes_pass(unit):
    require_given_shapes(rods(unit), no_mesh)


@pytest.mark.parametrize(("unit", "size"), [("m", "40 m"), ("um", "40 um")])
def test_a_drawing_in_the_wrong_unit_is_asked_about(unit, size):
    with pytest.raises(InputError) as caught:
        require_given_shapes(rods(unit), no_mesh)

    text = str(caught.value)
    assert "rods.yaml:22: bodies.long.geometry" in text
    assert f"a body 'long' of {size}" in text
    assert f"geometry: {{extent: {size}}}" in caught.value.hint


@pytest.mark.parametrize("unit", ["m", "um"])
def test_what_the_question_proposes_is_taken(unit):
    require_given_shapes(rods(unit, f"40 {unit}"), no_mesh)


def test_a_case_that_is_unusual_as_a_whole_is_noted():
    text = RODS.replace("unit: mm", "unit: m").replace("klack: 1", "klack: 1\nunusual: true")
    with pytest.warns(AccuracyWarning, match="bodies.long: 40 m is an unusual size"):
        require_given_shapes(read_case(text, Path("rods.yaml")), no_mesh)


def test_a_confirmation_of_another_size_is_refused():
    with pytest.raises(InputError, match=r"geometry.extent: got an extent of 40 mm, expected 40 m"):
        require_given_shapes(rods("m", "40 mm"), no_mesh)


@pytest.mark.parametrize(
    ("short", "long", "asked"),
    [(5e-3, 0.4, None), (5e-3, 0.6, "short"), (3e-3, 0.9, "short"), (0.9, 3e-3, "long")],
)
def test_sizes_that_differ_a_hundredfold(short, long, asked):
    sizes = {"short": short, "long": long}
    if asked is None:
        require_usual_sizes(rods(), sizes)
        return
    with pytest.raises(InputError, match=f"a body '{asked}' of .* bodies of similar size"):
        require_usual_sizes(rods(), sizes)


def test_both_have_to_be_confirmed_where_they_differ():
    sizes = {"short": 0.3e-3, "long": 40e-3}
    with pytest.raises(InputError, match="a body 'short'"):
        require_usual_sizes(rods(extent="40 mm"), sizes)


@pytest.mark.slow
def test_a_step_file_in_metres(tmp_path):
    """A part drawn as 20 mm, whose file counts them as metres; and its names come along."""
    from netgen.occ import Box, Pnt

    for name, low, high in (("up", 0, 20_000), ("down", -20_000, 0)):
        Box(Pnt(-5000, -5000, low), Pnt(5000, 5000, high)).WriteStep(str(tmp_path / f"{name}.step"))
    text = RODS.split("bodies:\n")[0] + "bodies:\n"
    for name in ("up", "down"):
        text += (
            f"  {name}:\n    geometry: {{step: {{file: {name}.step}}}}\n"
            "    material: steel\n    mesh: {size: 1 mm}\n"
        )
    text += "contact: {between: [up.face5, down.face6], gap: 0 um}\n"
    text += "motion: {speed: 1 m/s}\nrun: {levels: [reduced], duration: 20 us}\n"
    case = read_case(text, tmp_path / "boxes.yaml")
    with pytest.raises(InputError, match=r"a body 'up' of 20 m"):
        require_given_shapes(case, no_mesh)


def test_a_command_asks_before_it_meshes(tmp_path, capsys):
    (tmp_path / "rods.yaml").write_text(RODS.replace("unit: mm", "unit: m"), encoding="utf-8")
    words = ["impact", str(tmp_path / "rods.yaml"), "--no-report", "--out", str(tmp_path / "out")]

    assert main(words) == 2
    assert "check the unit of its shape;" in capsys.readouterr().err
