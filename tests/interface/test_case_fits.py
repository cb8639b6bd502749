"""Press fits in a case: what is refused, what is doubted, where they are shown.

Truth: one clear error or doubt for each mistake; the numbers themselves are in
``tests/exact/test_press_fit.py``.
"""

from dataclasses import replace

import pytest
from draws import each
from pages import HOW_TO, blocks, changed_case, numbers
from ruamel.yaml import YAML

from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.content import report_content
from klack.analyses.impact.run import run_impact
from klack.analyses.inspection import inspect_case
from klack.assembling.fits import press_fits
from klack.case import load_case
from klack.errors import InputError
from klack.mesh.solid import write_step_revolved

NEEDLE = ("bodies", "needle")
FIT = (*NEEDLE, "fits", "joint")
PARTS = (*NEEDLE, "geometry", "profile", "parts")


def changed(folder, *changes):
    """The case of the page with values in other places; None removes a key."""
    return changed_case(folder, "pressed_armature.yaml", *changes)


@each(
    ("changes", "message"),
    [
        ([(*FIT, "interference", "-8 um")], r"fits\.joint\.interference: got .*-8 um"),
        ([(*FIT, "friction", -0.1)], r"fits\.joint\.friction: got .*-0\.1"),
        ([(*FIT, "friction", 12)], r"fits\.joint\.friction: got 12, expected a value 2 or less"),
        ([(*FIT, "friction", None)], r"fits\.joint: got no key 'friction'"),
        ([(*FIT, "interference", "8 N")], r"fits\.joint\.interference: got"),
        ([(*NEEDLE, "fits", {"joints": {"interference": "8 um", "friction": 0.1}})],
         r"fits\.joints: .*of no part.*two parts share \(here: joint\)"),
        ([(*NEEDLE, "fits", {"shaft": {"interference": "8 um", "friction": 0.1}})],
         r"fits\.shaft: .*of 'needle'"),
        ([(*PARTS, "armature", "edges", 3, {"line": [2.5, 15], "name": "bore"})],
         r"fits\.joint: .*of 'needle'"),
        # the armature ends below the needle
        ([(*PARTS, "armature", "edges", 1, {"line": [5, 19], "name": "disc_rim"}),
          (*PARTS, "armature", "edges", 2, {"line": [2.5, 19], "name": "disc_top"})],
         r"fits\.joint: .*different ends.*same two ends"),
        # a cone
        ([(*PARTS, "needle", "edges", 3, {"line": [2.4, 19.4], "name": "joint"}),
          (*PARTS, "armature", "edges", 2, {"line": [2.4, 19.4], "name": "disc_top"})],
         r"fits\.joint: .*not parallel to the axis.*a cylinder"),
        ([(*NEEDLE, "fits", {"axis": {"interference": "8 um", "friction": 0.1}}),
          (*PARTS, "armature", "edges", 0, {"line": [5, 15], "name": "axis"})],
         r"fits\.axis: .*an edge on the axis"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_fit_is_one_error_with_its_place(tmp_path, changes, message):
    with pytest.raises(InputError, match=r"case\.yaml:\d+: bodies\.needle\." + message):
        changed(tmp_path, *changes)


def test_parts_that_another_one_joins_are_one_error_with_its_place(tmp_path):
    """It is found only with the mesh, and names the line of the joint all the same."""
    lid = [
        {"line": [2.5, 19.4], "name": "top"},
        {"line": [5, 19.4], "name": "disc_top"},
        {"line": [5, 20], "name": "rim"},
        {"line": [0, 20], "name": "lid_top"},
        {"close": True, "name": "lid_axis"},
    ]
    case = changed(
        tmp_path,
        (*PARTS, "lid", {"start": [0, 19.4], "edges": lid}),
        (*NEEDLE, "material", "steel"),
    )
    place = r"case\.yaml:\d+: bodies\.needle\.fits\.joint: "
    with pytest.raises(InputError, match=place + ".*glued to each other by other parts"):
        press_fits(case, "needle")


def test_a_body_that_is_not_drawn_has_no_fits(tmp_path):
    """A finished mesh."""
    (tmp_path / "a.inp").write_text("")
    geometry = {"mesh": {"file": "a.inp", "unit": "mm"}}
    with pytest.raises(InputError, match=r"bodies\.needle\.fits: got a press fit of a body "):
        changed(tmp_path, (*NEEDLE, "geometry", geometry))


def test_a_step_file_of_the_parts_has_the_fit_of_the_drawn_ones(tmp_path):
    """Truth: the half section. Elements of a quarter of the radius: 0.5 %, stresses 2 %."""
    (drawn,) = press_fits(load_case(HOW_TO / "pressed_armature.yaml"), "needle")
    profile = load_case(HOW_TO / "pressed_armature.yaml").bodies["needle"].geometry.profile
    write_step_revolved(profile.profiles(), tmp_path / "needle.step")
    step = (
        (*NEEDLE, "geometry", {"step": {"file": "needle.step"}}),
        (*NEEDLE, "mesh", {"size": "1.5 mm", "grading": 0.3}),
        ("bodies", "housing", "geometry", "model", "solid"),
    )
    case = changed(tmp_path, *step)
    (fit,) = press_fits(case, "needle")

    assert (fit.inner, fit.outer) == ("needle", "armature")
    assert (fit.radius, fit.length) == pytest.approx((2.5e-3, 4.4e-3), rel=1e-8)
    assert (fit.pressure, fit.force) == pytest.approx((drawn.pressure, drawn.force), rel=5e-3)
    assert fit.stress == pytest.approx(drawn.stress, rel=0.02)
    assert not fit.doubts
    rows = dict(inspect_case(case))["needle"]
    told = [content for what, name, content in rows if (what, name) == ("press fit", "joint")]
    assert told[0].startswith("joint: armature on needle, diameter 5 mm, length 4.4 mm")
    other = {"seam": {"interference": "4 um", "friction": 0.12}}
    with pytest.raises(InputError, match=r"case\.yaml:\d+: bodies\.needle\.fits\.seam: .*joint"):
        press_fits(changed(tmp_path, *step, (*NEEDLE, "fits", other)), "needle")


def test_doubtful_fits_are_told(tmp_path):
    """More than a thousandth of the diameter, and a part that yields; the drawn case has none."""
    assert not [doubt for fit in press_fits(load_case(HOW_TO / "pressed_armature.yaml"), "needle")
                for doubt in fit.doubts]  # fmt: skip

    (fit,) = press_fits(changed(tmp_path, (*FIT, "interference", "8 um")), "needle")

    large, soft = fit.doubts
    assert "an interference of 8 um is more than a thousandth of the diameter, 5 mm" in large
    assert "'armature' yields" in soft
    assert "280 MPa" in soft
    (opens,) = replace(fit, interference=4e-6, least_pressure=-1e6, yield_stress={}).doubts
    assert "the joint opens: its pressure would be -1 MPa at one place" in opens


def test_a_fit_stands_in_the_inspection():
    rows = dict(inspect_case(load_case(HOW_TO / "pressed_armature.yaml")))["needle"]
    told = [content for what, name, content in rows if (what, name) == ("press fit", "joint")]

    (fit,) = press_fits(load_case(HOW_TO / "pressed_armature.yaml"), "needle")
    assert told[0].startswith("joint: armature on needle, diameter 5 mm, length 4.4 mm")
    assert told[1] == "interference on the diameter: 4 um"
    assert [line.split(":")[0] for line in told[2:4]] == [
        "mean pressure",
        "least, largest pressure",
    ]
    assert fit.axial_force == pytest.approx(0.12 * fit.force, rel=1e-12)
    assert fit.torque == pytest.approx(fit.axial_force * 2.5e-3, rel=1e-12)


def test_the_page_shows_what_the_case_has():
    """Truth: the page; 0.5 % for versions of the mesher."""
    page = (HOW_TO / "two-materials.md").read_text(encoding="utf-8")
    (block,) = blocks(page, "yaml-part")
    yaml = YAML(typ="safe")
    case = yaml.load(HOW_TO / "pressed_armature.yaml")
    (fit,) = press_fits(load_case(HOW_TO / "pressed_armature.yaml"), "needle")

    assert yaml.load(block)["fits"] == case["bodies"]["needle"]["fits"]
    shown = numbers(page, r"mean pressure: ([\d.]+) MPa.*holds, friction 0.12: ([\d.]+) N along")
    assert shown == pytest.approx([fit.pressure / 1e6, fit.axial_force], rel=5e-3)


@pytest.mark.slow
def test_an_impact_shows_its_fits_and_is_that_of_the_glued_body(tmp_path):
    """To the bit: the stress of a fit is left out of the impact."""
    fitted = run_impact(changed(tmp_path), levels=("reduced",), certify=False)
    glued = run_impact(
        changed(tmp_path, (*NEEDLE, "fits", None)), levels=("reduced",), certify=False
    )

    one, other = (study.levels["reduced"].history for study in (fitted, glued))
    assert one.force.tobytes() == other.force.tobytes()
    assert one.velocity_a.tobytes() == other.velocity_a.tobytes()
    (told,) = IMPACT.to_json(fitted)["fits"]
    assert told["joint"] == "joint"
    assert told["interference_m"] == 4e-6
    assert IMPACT.to_json(glued)["fits"] == []
    heads = [table.columns for part in report_content(fitted).sections for table in part.tables]
    assert ("press fit", "needle.joint") in heads
    assert glued.warnings == fitted.warnings


@pytest.mark.slow
def test_a_part_that_yields_away_from_the_contact_leaves_it_elastic(tmp_path):
    """To the bit: only the pressed armature has a yield stress, 15 mm from the faces."""
    hard = ("materials", "hard_steel", "yield", None)
    soft = ("materials", "soft_iron", "yield", None)

    one, other = (
        run_impact(changed(tmp_path, *changes), levels=("reduced",), certify=False)
        for changes in ([hard], [hard, soft])
    )

    one, other = (study.levels["reduced"].history.force for study in (one, other))
    assert one.tobytes() == other.tobytes()
