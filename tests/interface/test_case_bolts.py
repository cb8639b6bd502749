"""Bolted joints in a case: what is refused, what is doubted, where they are shown.

Truth: one clear error or doubt for each mistake; the numbers themselves are in
``tests/exact/test_bolted_joint.py``.
"""

import numpy as np
import pytest
from draws import each
from pages import HOW_TO, blocks, changed_case, numbers
from ruamel.yaml import YAML

from klack import run_many
from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.content import report_content
from klack.analyses.impact.run import run_impact
from klack.analyses.inspection import inspect_case
from klack.analyses.stroke.run import run_stroke
from klack.assembling.bolts import bolted_joints, struck_bolts
from klack.case import load_case
from klack.case.any_case import load_valve_case
from klack.errors import InputError
from klack.mesh.solid import write_step_revolved

CASE = "bolted_nozzle.yaml"
HOUSING = ("bodies", "housing")
BOLTS = (*HOUSING, "bolts")
FLANGE = (*BOLTS, "flange")
PARTS = (*HOUSING, "geometry", "profile", "parts")
GOOD = {
    "ends": ["shoulder", "thread"], "preload": "5 kN", "area": "100 mm^2", "length": "8.5 mm",
    "modulus": "210 GPa",
}  # fmt: skip


def changed(folder, *changes):
    return changed_case(folder, CASE, *changes)


@each(
    ("changes", "message"),
    [
        ([(*FLANGE, "preload", "-5 kN")], r"bolts\.flange\.preload: got .*-5 kN"),
        ([(*FLANGE, "preload", "5 kPa")], r"bolts\.flange\.preload: got"),
        ([(*FLANGE, "area", "0 mm^2")], r"bolts\.flange\.area: got .*0 mm"),
        ([(*FLANGE, "length", None)], r"bolts\.flange: got no key 'length'"),
        ([(*FLANGE, "count", 0)], r"bolts\.flange\.count: got .*0"),
        ([(*FLANGE, "ends", ["shoulder"])], r"bolts\.flange\.ends"),
        ([(*FLANGE, "ends", ["shoulder", "head"])],
         r"bolts\.flange: .*'head' is not a straight edge of one part"),
        ([(*FLANGE, "ends", ["flange", "thread"])], r"'flange' is not a straight edge of one part"),
        ([(*BOLTS, {"shoulder": GOOD})], r"bolts\.shoulder: .*of 'nozzle'.*\(here: flange\)"),
        ([(*BOLTS, {"flange": GOOD, "neck": GOOD})], r"bolts: got"),
        ([(*HOUSING, "fits", {"flange": {"interference": "1 um", "friction": 0.1}})],
         r"fits\.flange: .*not parallel to the axis"),
        ([(*HOUSING, "layers", {"flange": {"normal": "2 N/mm^3", "tangential": "1 N/mm^3"}})],
         r"bolts: got bolts beside layers"),
        # a cone
        ([(*PARTS, "nozzle", "edges", 4, {"line": [5, 3.2], "name": "flange"}),
          (*PARTS, "body", "start", [5, 3.2])],
         r"bolts\.flange: .*not perpendicular to the axis.*a flat face"),
    ],
)  # fmt: skip
def test_a_mistake_in_bolts_is_one_error_with_its_place(tmp_path, changes, message):
    with pytest.raises(InputError, match=r"case\.yaml:\d+: bodies\.housing\.(.*)?" + message):
        changed(tmp_path, *changes)


def test_ends_that_cannot_press_are_one_error_with_its_place(tmp_path):
    """It is found only with the mesh, and names the line of the joint all the same."""
    case = changed(tmp_path, (*FLANGE, "ends", ["land", "thread"]))
    place = r"case\.yaml:\d+: bodies\.housing\.bolts\.flange: "
    with pytest.raises(InputError, match=place + ".*the same side of the joint"):
        bolted_joints(case, "housing")


def test_a_finished_mesh_has_no_bolts(tmp_path):
    (tmp_path / "a.inp").write_text("")
    geometry = {"mesh": {"file": "a.inp", "unit": "mm"}}
    with pytest.raises(InputError, match=r"bodies\.housing\.bolts: got bolts of a body that is"):
        changed(tmp_path, (*HOUSING, "geometry", geometry))


@pytest.mark.slow
def test_a_step_file_of_the_parts_has_the_bolts_of_the_drawn_ones(tmp_path):
    """Truth: the half section. Elements of half a wall: stiffness, pressures 3 %, stress 10 %."""
    drawn_case = load_case(HOW_TO / CASE)
    (drawn,) = bolted_joints(drawn_case, "housing")
    profile = drawn_case.bodies["housing"].geometry.profile
    write_step_revolved(profile.profiles(), tmp_path / "housing.step")
    step = (
        (*HOUSING, "geometry", {"step": {"file": "housing.step"}}),
        (*HOUSING, "mesh", {"size": "1.5 mm"}),
        ("bodies", "needle", "geometry", "model", "solid"),
    )
    case = changed(tmp_path, *step)
    (joint,) = bolted_joints(case, "housing")

    assert (joint.lower, joint.upper) == ("nozzle", "body")
    assert (joint.area, joint.distance) == pytest.approx((drawn.area, drawn.distance), rel=1e-3)
    assert joint.pressure == pytest.approx(drawn.pressure, rel=1e-3)
    assert (joint.part_stiffness, joint.least_pressure, joint.largest_pressure) == pytest.approx(
        (drawn.part_stiffness, drawn.least_pressure, drawn.largest_pressure), rel=0.03
    )
    assert joint.stress == pytest.approx(drawn.stress, rel=0.1)
    assert not joint.open_share
    assert not joint.doubts
    rows = dict(inspect_case(case))["housing"]
    told = [content for what, name, content in rows if (what, name) == ("bolts", "flange")]
    assert told == [f"{what}: {text}" for what, text in joint.rows()]

    wrong = changed(tmp_path, *step, (*FLANGE, "ends", ["shoulder", "head"]))
    place = r"case\.yaml:\d+: bodies\.housing\.bolts\.flange: "
    with pytest.raises(InputError, match=place + ".*'head' is no outer face.*here: .*thread"):
        bolted_joints(wrong, "housing")


def test_random_bolts_end_in_the_closed_form_or_in_a_doubt(tmp_path):
    """Stiffness n E A / L, load factor, lifting force; all else is proportional to the preload."""
    (drawn,) = bolted_joints(changed(tmp_path), "housing")
    assert not drawn.doubts
    random = np.random.default_rng(3)
    for _ in range(12):
        force, area, length = (10.0 ** random.uniform((1, 0, 0), (5, 2.5, 2))).tolist()
        count, young = int(random.integers(1, 9)), float(random.uniform(60.0, 220.0))
        case = changed(
            tmp_path,
            (*BOLTS, {"flange": {
                "ends": ["thread", "shoulder"], "preload": f"{force!r} N",
                "area": f"{area!r} mm^2", "length": f"{length!r} mm",
                "modulus": f"{young!r} GPa", "count": count,
            }}),
        )  # fmt: skip
        (joint,) = bolted_joints(case, "housing")
        stiffness = count * young * 1e9 * area * 1e-6 / (length * 1e-3)
        assert joint.bolt_stiffness == pytest.approx(stiffness, rel=1e-12)
        assert joint.part_stiffness == pytest.approx(drawn.part_stiffness, rel=1e-9)
        assert joint.lifting_force == pytest.approx(
            count * force * (1.0 + stiffness / drawn.part_stiffness), rel=1e-9
        )
        scale = count * force / drawn.preload
        assert joint.largest_pressure == pytest.approx(scale * drawn.largest_pressure, rel=1e-9)
        bad = (
            not 0.5 <= length * 1e-3 / joint.distance <= 3.0,
            force / area * 1e6 > 1.1e9,
            scale * drawn.stress["nozzle"] > 1.8e9,
            scale * drawn.stress["body"] > 0.6e9,
        )
        assert len(joint.doubts) == sum(bad)


def test_an_impact_that_may_open_the_joint_is_a_doubt():
    """Twice the peak force against the preload, 5 kN."""
    case = load_case(HOW_TO / CASE)
    (safe,) = struck_bolts(case, 2499.0)
    (doubtful,) = struck_bolts(case, 2501.0)
    assert not safe.opens
    assert not safe.doubts
    assert dict(safe.rows())["largest pull in the impact"].endswith("the joint stays closed")
    assert doubtful.doubts == (doubtful.opening_doubt,)
    assert dict(doubtful.rows())["largest pull in the impact"].endswith("the joint may open")


def test_the_page_shows_what_the_case_has():
    """Truth: the page; 0.5 % for versions of the mesher."""
    page = (HOW_TO / "bolted-joint.md").read_text(encoding="utf-8")
    (block,) = blocks(page, "yaml-part")
    yaml = YAML(typ="safe")
    case = load_case(HOW_TO / CASE)
    (joint,) = bolted_joints(case, "housing")

    assert yaml.load(block)["bolts"] == yaml.load(HOW_TO / CASE)["bodies"]["housing"]["bolts"]
    shown = numbers(page, r"mean pressure: ([\d.]+) MPa.*load factor: ([\d.]+) .*at: ([\d.]+) kN")
    assert shown == pytest.approx(
        [joint.pressure / 1e6, joint.load_factor, joint.lifting_force / 1e3], rel=5e-3
    )
    rows = dict(inspect_case(case))["housing"]
    told = [content for what, name, content in rows if (what, name) == ("bolts", "flange")]
    assert told == [f"{what}: {text}" for what, text in joint.rows()]


@pytest.mark.slow
def test_an_impact_shows_its_bolts_and_is_that_of_the_glued_body(tmp_path):
    """To the bit; a preload of 200 N is below twice the peak force."""
    loose = run_impact(
        changed(tmp_path, (*FLANGE, "preload", "200 N")), levels=("reduced",), certify=False
    )
    glued = run_impact(
        changed(tmp_path, (*HOUSING, "bolts", None)), levels=("reduced",), certify=False
    )

    one, other = (study.levels["reduced"].history for study in (loose, glued))
    assert one.force.tobytes() == other.force.tobytes()
    (told,) = IMPACT.to_json(loose)["bolts"]
    peak = loose.levels["reduced"].measures.peak_force
    assert told["carried_N"] == pytest.approx(2.0 * peak, rel=1e-12)
    assert told["opens"]
    assert IMPACT.to_json(glued)["bolts"] == []
    heads = [table.columns for part in report_content(loose).sections for table in part.tables]
    assert ("bolts", "housing.flange") in heads
    (more,) = [note for note in loose.warnings if note not in glued.warnings]
    assert "housing.flange: the joint may open" in more


STROKE = """stops:
  seat: {between: [needle.tip, housing.seat], speed: 1 m/s, force: 20 N}
reduction: {modes: {needle: {count: 4}, housing: {count: 4}}}
network:
  components:
    needle: {type: flexible-body, body: needle, points: [tip, top]}
    housing: {type: flexible-body, body: housing, points: [seat]}
    seat: {type: end-stop, gap: 0 um, law: {kind: consistent}}
    magnet: {type: force-over-time, time: [0 us, 1 us, 50 us, 51 us], force: [0 N, 30 N, 30 N, 0 N]}
    spring: {type: spring, stiffness: 10 N/mm, preload: 12 N}
  connections:
    - [needle.tip, seat.upper]
    - [housing.seat, seat.lower]
    - [needle.top, spring.end, magnet.end]
run: {duration: 0.3 ms, variants: [dry], lift: needle.tip}
"""


@pytest.mark.slow
def test_a_stroke_that_may_open_the_joint_has_the_same_doubt(tmp_path):
    text = (HOW_TO / CASE).read_text("utf-8").partition("contact:\n  between")[0] + STROKE
    for preload, opens in (("5 kN", False), ("20 N", True)):
        (tmp_path / "case.yaml").write_text(text.replace("5 kN\n", f"{preload}\n"), "utf-8")
        found = run_stroke(load_valve_case(tmp_path / "case.yaml"))
        (event,) = found.variants["dry"].result.events[:1]
        assert event.peak_force > 10.0  # so twice of it is more than 20 N
        assert any("the joint may open" in note for note in found.warnings) == opens

    preloads = {"bodies.housing.bolts.flange.preload": ["5 kN", "20 N"]}
    points = run_many(tmp_path / "case.yaml", preloads, ["seat.peak_force"])
    told = [any("the joint may open" in note for note in notes) for notes in points.warnings]
    assert told == [False, True]
