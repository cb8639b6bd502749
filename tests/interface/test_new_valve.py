"""From STEP files or drawings to a case; truth: the drawings that went in, and hand formulas."""

import asyncio
import json
import re
from dataclasses import replace
from math import pi, sqrt
from pathlib import Path

import pytest

from klack.analyses.impact.run import run_impact
from klack.app.folder import OpenFolder
from klack.app.guard import LARGEST_UPLOAD
from klack.app.parts import outline_of_table, part_of_step, part_of_table
from klack.app.plan_review import review
from klack.app.proposals import proposal
from klack.app.state import Uploads
from klack.app.valve_plan import BODIES, EXAMPLES, Plans, ValvePlan
from klack.case.any_case import load_any_case
from klack.case.reader import find_case, read_case
from klack.errors import InputError
from klack.mesh.profile import Profile
from klack.mesh.solid import write_step_revolved
from klack.mesh.step_profile import NotTurnedError, profiles_of_step

PLAN = ValvePlan(
    source="table",
    needle_table=EXAMPLES["needle"],
    housing_table=EXAMPLES["housing"],
    needle_contact="tip",
    housing_contact="seat",
    held=("rim",),
)


@pytest.fixture(scope="module")
def drawn() -> dict[str, Profile]:
    """Half sections of the shipped demo valve."""
    return {
        name: next(iter(body.geometry.profile.profiles().values()))
        for name, body in load_any_case(find_case("demo-valve-axisymmetric")).bodies.items()
    }


@pytest.fixture(scope="module")
def steps(drawn, tmp_path_factory) -> Path:
    """STEP files of these bodies, turned by OpenCASCADE."""
    place = tmp_path_factory.mktemp("cad")
    for name, profile in drawn.items():
        write_step_revolved({name: profile}, place / f"{name}.step")
    return place


@pytest.fixture(scope="module")
def tables():
    return {body: part_of_table(body, EXAMPLES[body]) for body in BODIES}


def edges_of(profile: Profile) -> set[tuple]:
    """Edges of an outline, wherever it starts: ends, centre and name, to 1e-12 m."""

    def plain(point):
        return None if point is None else tuple(round(x, 12) + 0.0 for x in point)

    return {
        (
            plain(c.start),
            plain(c.end),
            plain(c.centre),
            "" if c.end[0] == c.start[0] == 0 else c.name,
        )
        for c in profile.curves
    }


def graded(found, grade: str) -> dict[str, str]:
    return {f.what: f.words for f in found.findings if f.grade == grade}


# --------------------------------------------------------------------------- half sections


@pytest.mark.parametrize("name", BODIES)
def test_the_half_section_of_a_step_file_is_the_drawing_it_was_turned_from(name, drawn, steps):
    (found,) = profiles_of_step(steps / f"{name}.step").values()

    assert edges_of(found) == edges_of(drawn[name])
    assert found.volume == pytest.approx(drawn[name].volume, rel=1e-12)


@pytest.mark.slow
def test_parts_that_are_not_turned_stay_solids_and_say_why(tmp_path):
    from netgen.occ import Box, Cylinder, Pnt, Z

    rod = Cylinder(Pnt(0, 0, 0), Z, r=2, h=5)
    cuts = {
        "hole beside the plane": Cylinder(Pnt(0, 1, -1), Z, r=0.05, h=9),
        "flat": Box(Pnt(-3, 1.9, 1), Pnt(3, 3, 2)),
    }
    for name, cut in cuts.items():
        (rod - cut).WriteStep(str(tmp_path / "part.step"))
        with pytest.raises(NotTurnedError) as caught:
            profiles_of_step(tmp_path / "part.step")
        assert "differs by" in caught.value.got, name

    part = part_of_step("needle", tmp_path / "part.step")
    assert part.profiles is None
    assert part.facts.not_turned
    assert not part.facts.faces
    assert len(part.facts.solid_faces) > 3


def test_names_that_a_case_cannot_hold_are_made_plain(steps, tmp_path):
    text = (steps / "needle.step").read_text()
    named = text.replace("'tip'", "'the tip <script>'").replace("'taper'", "'the tip  script '")
    (tmp_path / "needle.step").write_text(named)

    names = part_of_step("needle", tmp_path / "needle.step").faces("half")
    assert names[:2] == ("the_tip_script_", "the_tip_script__2")
    assert all(re.fullmatch(r"[A-Za-z_][A-Za-z0-9_-]*", name) for name in names)


# --------------------------------------------------------------------------- drawings


@pytest.mark.parametrize("name", BODIES)
def test_the_example_is_the_demo_valve(name, drawn, tables):
    assert edges_of(tables[name].profiles[name]) == edges_of(drawn[name])


def test_signs_between_numbers_are_read_as_programs_write_them():
    rows = [("0", "0", ""), ("1,5", "0", "foot"), ("1,5", "2,25", "side"), ("0", "2,25", "top")]
    german = "\n".join(";".join(row) for row in rows)
    tabs = "\n".join("\t".join(row) for row in rows)
    plain = "r, z, surface\n" + "\n".join(
        ", ".join(cell.replace(",", ".") for cell in row) for row in rows
    )

    outline = outline_of_table("needle", plain)
    assert outline["edges"][1] == {"line": [1.5, 2.25], "name": "side"}
    assert outline["edges"][-1] == {"close": True, "name": "axis"}
    assert outline_of_table("needle", german)["edges"] == outline["edges"]
    assert outline_of_table("needle", tabs)["edges"] == outline["edges"]


@pytest.mark.parametrize(
    ("text", "where", "got"),
    [
        ("", "drawing of the needle", "0 corners"),
        ("0, 0\n1, 0, a\n1, x, b\n0, 1, c", "row 3", "'x'"),
        ("0, 0\n1, 0, a\n1, nan, b\n0, 1, c", "row 3", "'nan'"),
        ("0, 0\n1, 0, <script>\n1, 1, b\n0, 1, c", "row 2", "<script>"),
        ("0, 0, start\n1, 0, a\n1, 1, b\n0, 1, c", "row 1", "'start'"),
        ("0, 0\n1, 0, a, 5\n1, 1, b\n0, 1, c", "row 2", "''"),
        ("0, 0\n1, 0, a\n1, 1, b, 0, 0, 9\n0, 1, c", "row 3", "6 columns"),
        ("0, 0\n" + "1, 1\n" * 600, "row 501", "more than 500"),
        ("0, 0\n2, 2, a\n2, 0, b\n0, 2, c", "drawing of the needle", "common point"),
        ("-1, 0\n2, 0, a\n2, 1, b\n-1, 1, c", "drawing of the needle", "r"),
    ],
)
def test_a_row_that_is_none_is_named(text, where, got):
    with pytest.raises(InputError) as caught:
        part_of_table("needle", text)

    assert where in caught.value.where
    assert got in caught.value.got


# --------------------------------------------------------------------------- checks and case


def test_the_example_is_good_and_its_numbers_are_those_of_hand_formulas(tables, tmp_path):
    found = review(PLAN, tables, tmp_path / "case.yaml")

    assert {f.grade for f in found.findings} == {"good"}
    # a sphere of 0.6 mm in a cone of 45 degrees touches at r = 0.6 mm sin 45 deg
    words = graded(found, "good")
    assert f"radius {0.6 / sqrt(2):.3g} mm at z {-0.6 / sqrt(2):.3g} mm" in words["first touch"]
    # Hertz: cylinder of 0.6 mm on a flat, under the force that stops the needle as a rod
    young, poisson, density, height = 220e9, 0.28, 7730.0, 20e-3
    volume = tables["needle"].profiles["needle"].volume
    force = 0.3 * sqrt(density * volume * young * volume) / height + 2 * 10.0
    modulus = young / (2 * (1 - poisson**2))
    load = force / (2 * pi * 0.6e-3 / sqrt(2))
    width = sqrt(4 * load * 0.6e-3 / (pi * modulus))
    assert f"half width about {1e6 * width:.2g} um" in words["first touch"]
    assert f"needle {1e3 * density * volume:.4g} g" in words["mass"]
    size = float(re.search(r"contact: \{size: ([\d.]+) um", found.text).group(1))
    assert size == pytest.approx(0.2e6 * width, rel=0.01)  # two digits


def test_the_case_of_a_drawing_is_valid_and_holds_the_drawing(tables, drawn, tmp_path):
    found = review(replace(PLAN, name="a-valve"), tables, tmp_path / "case.yaml")

    case = read_case(found.text, tmp_path / "case.yaml")
    assert case.title == "a-valve"
    assert found.steps == ()
    for name in BODIES:
        (profile,) = case.bodies[name].geometry.profile.profiles().values()
        assert edges_of(profile) == edges_of(drawn[name])
    assert (str(case.contact.moving), str(case.contact.stop)) == ("needle.tip", "housing.seat")
    assert case.bodies["housing"].fixed[0].surface == "rim"
    assert case.bodies["needle"].fixed is None
    assert case.motion.speed == 0.3
    assert case.noise.plate.thickness == 1.5e-3


def test_a_solid_keeps_its_step_file_beside_the_case(steps, tmp_path):
    parts = {body: part_of_step(body, steps / f"{body}.step") for body in BODIES}
    plan = replace(PLAN, source="step", model="solid", needle_label="évil\n'\": {a}.step")

    found = review(plan, parts, tmp_path / "case.yaml")

    assert found.steps == BODIES
    for body in BODIES:
        (tmp_path / f"{body}.step").write_bytes((steps / f"{body}.step").read_bytes())
    case = read_case(found.text, tmp_path / "case.yaml")
    assert case.bodies["needle"].geometry.step.file == tmp_path / "needle.step"


def test_the_written_case_runs(tables, drawn, tmp_path):
    text = review(PLAN, tables, tmp_path / "case.yaml").text

    study = run_impact(read_case(text, tmp_path / "case.yaml"), levels=("reduced",), certify=False)

    level = study.levels["reduced"]
    mass = 7730.0 * drawn["needle"].volume
    # impulse: change of the momentum, and what the closing force adds while they touch
    change = mass * 0.3 * (1.0 + level.measures.restitution) + 10.0 * level.measures.contact_time
    assert level.measures.impulse == pytest.approx(change, rel=2e-3)


def scaled(text: str, factor: float) -> str:
    """A drawing in another unit: every number times a factor."""
    return re.sub(r"-?\d+\.?\d*", lambda m: f"{float(m.group()) * factor:.9g}", text)


def raised(text: str, by: float) -> str:
    """A drawing moved along z."""
    rows = []
    for line in text.splitlines()[1:]:
        cells = [cell.strip() for cell in line.split(",")]
        for k in (1, 4):
            if len(cells) > k:
                cells[k] = f"{float(cells[k]) + by:.9g}"
        rows.append(", ".join(cells))
    return "\n".join(rows)


@pytest.mark.parametrize(
    ("change", "what", "grade", "words"),
    [
        ({"held": ()}, "support", "error", "the housing is not held"),
        ({"held": ("seat",)}, "support", "error", "contact face is held"),
        ({"needle_contact": ""}, "contact face of the needle", "error", "none"),
        ({"needle_contact": "top"}, "overlap", "error", "in common"),
        ({"housing_contact": "outside"}, "contact faces", "error", "face each other"),
        ({"speed": "3 mm"}, "speed", "error", "speed"),
        ({"speed": "0 m/s"}, "speed", "error", "0 m/s"),
        ({"speed": "nan m/s"}, "speed", "error", "nan"),
        ({"speed": "300 m/s"}, "speed", "error", "300"),
        ({"speed": "30 m/s"}, "speed", "doubt", "30"),
        ({"gap": "-1 um"}, "gap", "error", "-1 um"),
        ({"force": "0 N"}, "static hold", "doubt", "nothing closes"),
        ({"needle_contact": "taper", "housing_contact": "seat"}, "overlap", "error", "in common"),
    ],
    ids=lambda value: str(value)[:40],
)
def test_each_mistake_is_found_with_what_to_do(change, what, grade, words, tables, tmp_path):
    found = review(replace(PLAN, **change), tables, tmp_path / "case.yaml")

    assert words in graded(found, grade)[what]
    assert next(f for f in found.findings if f.what == what).advice
    assert bool(found.text) == ("error" not in {f.grade for f in found.findings})


@pytest.mark.parametrize(
    ("factor", "grade"), [(1e-3, "error"), (0.03, "doubt"), (25.4, "doubt"), (1000.0, "error")]
)
def test_a_wrong_unit_is_seen(factor, grade, tmp_path):
    parts = {body: part_of_table(body, scaled(EXAMPLES[body], factor)) for body in BODIES}

    assert "units" in graded(review(PLAN, parts, tmp_path / "case.yaml"), grade)


def test_a_needle_drawn_elsewhere_is_moved_to_the_touch(tables, tmp_path):
    for by, word in ((0.5, "500 um apart"), (-0.5, "500 um overlapping")):
        needle = part_of_table("needle", raised(EXAMPLES["needle"], by))
        found = review(PLAN, {**tables, "needle": needle}, tmp_path / "case.yaml")
        assert word in graded(found, "good")["gap"]
        assert "touch only at the contact faces" in graded(found, "good")["overlap"]


def test_a_sharp_edge_that_touches_is_in_doubt(tables, tmp_path):
    cone = "0, -0.3\n0.3, -0.3, face\n1, 2, cone\n1, 9, shaft\n0, 9, top"
    parts = {**tables, "needle": part_of_table("needle", cone)}

    found = review(replace(PLAN, needle_contact="face"), parts, tmp_path / "case.yaml")

    assert "sharp edge, needle.face at r 0.3 mm" in graded(found, "doubt")["first touch"]


# --------------------------------------------------------------------------- what is kept


def test_a_plan_survives_and_a_damaged_one_begins_anew(tmp_path):
    plans = Plans(OpenFolder(tmp_path))
    assert plans.load() == ValvePlan()
    plan = replace(PLAN, step=3, name="other")
    plans.keep(plan)
    assert Plans(OpenFolder(tmp_path)).load() == plan

    (file,) = (tmp_path / ".klack-app").iterdir()
    kept = json.loads(file.read_text())
    file.write_text(json.dumps(kept | {"step": 99, "held": 7, "speed": ["x"], "unknown": 1}))
    found = plans.load()
    assert (found.step, found.held, found.speed) == (5, (), "0.3 m/s")
    file.write_text("{")
    assert plans.load() == ValvePlan()
    plans.forget()
    assert plans.load() == ValvePlan()
    with pytest.raises(InputError, match="characters"):
        plans.keep(replace(plan, needle_table="0" * 100_001))


def test_a_body_has_one_contact_face_and_a_face_one_role():
    plan = PLAN.with_role("housing", "floor", "contact")
    assert plan.housing_contact == "floor"
    plan = plan.with_role("housing", "rim", "radiating")
    assert (plan.held, plan.radiating) == ((), ("rim",))
    plan = plan.with_role("housing", "floor", "held").with_role("needle", "tip", "")
    assert plan.roles == {"housing.rim": "radiating", "housing.floor": "held"}
    kept = PLAN.with_faces({"needle": ("tip",), "housing": ("seat",)})
    assert (kept.needle_contact, kept.housing_contact, kept.held) == ("tip", "seat", ())


@pytest.mark.parametrize("source", ["table", "step", "raised"])
def test_the_faces_of_the_demo_valve_are_proposed_from_its_geometry(source, tables, steps):
    """A ball of 0.6 mm drawn in its cone of 90 degrees touches it to the digits of the drawing."""
    parts = dict(tables)
    if source == "step":
        parts = {body: part_of_step(body, steps / f"{body}.step") for body in BODIES}
    if source == "raised":
        parts["needle"] = part_of_table("needle", raised(EXAMPLES["needle"], 0.1))
    found = proposal(parts, "half")

    assert ValvePlan().with_proposal(found).roles == PLAN.roles
    assert ("100 um apart" in found.words) is (source == "raised")


def test_of_equally_near_faces_one_place_gets_a_proposal_and_two_get_none():
    """Both gaps are drawn as 0.1 mm: a foot over a land and its chamfer, a flange over a step."""

    def found(needle: str, housing: str):
        outlines = {"needle": f"0, 0.1\n2, 0.1, foot\n{needle}0, 9, top"}
        outlines["housing"] = f"0.5, -4\n5, -4, low\n{housing}1, 0, land\n0.5, -0.5, chamfer"
        return proposal(
            {body: part_of_table(body, rows) for body, rows in outlines.items()}, "half"
        )

    one = found("2, 9, shaft\n", "5, 0, out\n")
    two = found(
        "2, 2.1, shaft\n3, 2.1, flange\n3, 9, rim\n", "5, 2, out\n2.5, 2, step\n2.5, 0, wall\n"
    )

    assert (one.needle_contact, one.housing_contact, one.held) == ("foot", "land", "out")
    assert "100 um apart as drawn" in one.words
    assert two.words.startswith("No contact faces are proposed: ")
    assert "needle.flange on housing.step" in two.words
    assert (two.needle_contact, two.housing_contact, two.held) == ("", "", "")


def pins_and_pads(place: Path, gaps) -> dict:
    """Parts whose ``pin1``, ``pin2`` ..., balls of 1 mm, hang above ``pad1``, ``pad2`` ... [mm]."""
    from netgen.occ import Box, Cylinder, Pnt, Sphere, Z

    needle, housing = Box(Pnt(0, 0, 20), Pnt(60, 6, 24)), Box(Pnt(0, 0, -4), Pnt(60, 6, 0))
    housing.faces.Min(Z).name = "base"
    for k, gap in enumerate(gaps, 1):
        x, top = 5.0 * k, 10.0 + k
        pad = Cylinder(Pnt(x, 3, 0), Z, r=2.0, h=top)
        middle = Pnt(x, 3, top + gap + 1)
        pin = Sphere(middle, 1.0)
        pad.faces.Max(Z).name, pin.faces[0].name = f"pad{k}", f"pin{k}"
        needle = needle + pin + Cylinder(middle, Z, r=0.8, h=20 - middle.z)
        housing = housing + pad
    for body, shape in zip(BODIES, (needle, housing), strict=True):
        shape.WriteStep(str(place / f"{body}.step"))
    return {body: part_of_step(body, place / f"{body}.step") for body in BODIES}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("gaps", "faces", "words"),
    [
        (
            (0.5, 0.0),
            ("pin2", "pad2", "base"),
            "touching as drawn (next: needle.pin1 on housing.pad1, 500 um)",
        ),
        ((0.1, 0.1), ("", "", ""), "are equally near along the axis"),
        ((0.5, -0.2), ("", "", ""), "overlap as drawn (0.117 mm^3 in common, at z 11.8 to 12 mm)"),
    ],
)
def test_faces_of_solids_are_proposed_or_not_as_they_were_drawn(gaps, faces, words, tmp_path):
    """Gaps as drawn, to 5e-4 of a side; a cap 0.2 mm high has pi h^2 (3 R - h) / 3 in common."""
    found = proposal(pins_and_pads(tmp_path, gaps), "solid")

    assert (found.needle_contact, found.housing_contact, found.held) == faces
    assert words in found.words


@pytest.mark.slow
def test_solids_without_one_pair_or_one_flat_end_say_so(tmp_path):
    from netgen.occ import Box, Pnt, Sphere, Z

    parts = pins_and_pads(tmp_path, (0.1,))
    upside_down = proposal({"needle": parts["housing"], "housing": parts["needle"]}, "solid")
    ball = Sphere(Pnt(10, 3, 0), 8.0) - Box(Pnt(0, -9, 3), Pnt(20, 15, 9))
    ball.faces.Max(Z).name = "flat"
    ball.WriteStep(str(tmp_path / "ball.step"))
    on_ball = proposal(
        {**parts, "housing": part_of_step("housing", tmp_path / "ball.step")}, "solid"
    )

    assert upside_down.words.startswith("No contact faces are proposed: no face of the housing")
    assert (on_ball.needle_contact, on_ball.housing_contact, on_ball.held) == ("pin1", "flat", "")
    assert "no held face is proposed: the housing has no flat outer face" in on_ball.words


def test_faces_are_called_by_their_place(tables):
    places = {
        f"{body}.{face.name}": face.place
        for body, part in tables.items()
        for face in part.facts.faces
    }

    assert places["housing.bottom"] == "bottom"
    assert (places["housing.rim"], places["housing.bore"]) == ("outside", "bore")
    assert (places["needle.tip"], places["housing.seat"], places["housing.floor"]) == (
        "ball",
        "hollow cone",
        "shoulder",
    )


async def _parts(*parts: bytes):
    for part in parts:
        yield part


def test_an_upload_is_kept_as_a_whole_or_not_at_all(tmp_path, monkeypatch):
    folder = OpenFolder(tmp_path)
    uploads = Uploads(folder)
    good = b"ISO-10303-21;\nHEADER;"
    names = [asyncio.run(uploads.take(_parts(good[:5], good[5:]))) for _ in range(14)]
    assert folder.read(names[-1]) == good
    home = tmp_path / ".klack-app" / "uploads"
    assert len(list(home.iterdir())) == 12

    for bad in ((), (b"PK\x03\x04",), (b"<script>",)):
        with pytest.raises(InputError, match="STEP file"):
            asyncio.run(uploads.take(_parts(*bad)))
    monkeypatch.setattr("klack.app.state.LARGEST_UPLOAD", 30)
    with pytest.raises(InputError, match="more than"):
        asyncio.run(uploads.take(_parts(good, good)))
    assert len(list(home.iterdir())) == 12
    assert LARGEST_UPLOAD == 64 * 2**20


def test_a_case_folder_is_made_with_all_files_or_none(tmp_path):
    folder = OpenFolder(tmp_path)
    folder.make_folder("valve", {"case.yaml": b"klack: 1\n", "needle.step": b"ISO"})
    assert sorted(p.name for p in (tmp_path / "valve").iterdir()) == ["case.yaml", "needle.step"]

    with pytest.raises(InputError, match="already exists"):
        folder.make_folder("valve", {"case.yaml": b"other"})
    with pytest.raises(TypeError):
        folder.make_folder("half", {"case.yaml": b"klack: 1\n", "needle.step": "no bytes"})
    for name in ("../out", "a/../../out", "", "a\0b"):
        with pytest.raises(InputError):
            folder.make_folder(name, {"case.yaml": b""})
    assert [p.name for p in tmp_path.iterdir()] == ["valve"]
    assert folder.look().steps == ("valve/needle.step",)
    for name in ("../x", "a b", "", ".hidden", "<script>", "x" * 62):
        with pytest.raises(InputError):
            replace(PLAN, name=name).require_name()
