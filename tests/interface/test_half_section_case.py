"""Cases of half sections with motion: three-dimensional: what is refused, and with which words."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from doubts import doubts

from klack.analyses.stroke.axis import guide_of
from klack.assembling.valve import build_valve
from klack.case.any_case import read_valve_case
from klack.errors import InputError

CASE = Path(__file__).parents[2] / "docs" / "how-to" / "half_section_stroke.yaml"
HALF = CASE.read_text(encoding="utf-8")
GUIDE = next(line + "\n" for line in HALF.splitlines() if line.startswith("guide:"))
COARSE = HALF.replace("0.02 mm, e", "0.1 mm, e").replace("angles: 24", "angles: 8")
ALONG = HALF.replace("motion: three-dimensional\n", "").replace(GUIDE, "")
FLAT, SWEPT = "model: axisymmetric", "model: swept\n      layers: 8"


def read(text):
    return read_valve_case(text, CASE)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (ALONG.replace("placement: {seed: 3}\n", ""), "angles: got angles of rings"),
        (HALF.replace(FLAT, SWEPT), "angles: got angles of bodies of three dimensions"),
        (
            HALF.replace(FLAT, SWEPT, 1),
            "an axisymmetric 'housing' and a three-dimensional 'needle'",
        ),
        (HALF.replace("angles: 24", "angles: 5"), "angles: got 5"),
        (
            HALF.replace("seat: {between", "seat: {friction: 0.1, between"),
            "friction between the faces of axisymmetric bodies",
        ),
    ],
)
def test_what_contradicts_itself_is_told_with_its_bodies(text, expected):
    with pytest.raises(InputError, match=expected) as caught:
        read(text)
    assert "Try:" in str(caught.value)


def test_matrices_of_a_motion_along_the_axis_are_no_body_in_three_dimensions(tmp_path):
    for name in ("K.mtx", "M.mtx", "n.msh"):
        (tmp_path / name).write_text("", encoding="utf-8")
    start = HALF.index("    geometry:\n", HALF.index("  pole:\n    geometry"))
    end = HALF.index("    fixed:", start)
    pole = (
        "    geometry: {mesh: {file: n.msh, unit: mm}, model: axisymmetric}\n"
        "    matrices: {stiffness: K.mtx, mass: M.mtx, units: mm t s}\n"
    )
    text = HALF[:start] + pole + HALF[end:]
    with pytest.raises(InputError, match="pole") as caught:
        read_valve_case(text, tmp_path / "case.yaml")
    assert "axial motion of 'pole'" in str(caught.value)


@pytest.mark.slow
def test_a_wide_guide_names_the_stop_that_it_brings_to_the_axis():
    wide = COARSE.replace("clearance: 4 um", "clearance: 60 um")
    with pytest.raises(InputError, match="stop 'seat': points on rings") as caught:
        build_valve(read(wide))
    assert "guide.clearance" in str(caught.value)


@pytest.mark.slow
def test_bodies_without_a_mode_of_order_1_are_named():
    few = COARSE.replace("needle: {count: 12}", "needle: {count: 1}")
    with doubts() as told:
        valve = build_valve(read(few))
    assert [text for text in told if "keeps no elastic mode of order 1" in text] == [
        "'needle' keeps no elastic mode of order 1: across its axis it moves as a rigid body, and "
        "yields statically. Try: more modes in reduction.modes.needle."
    ]
    needle = valve.reduced["needle"]
    assert (needle.rigid_count, needle.mode_count) == (6, 7)


def test_a_report_reads_a_guide_with_a_film():
    text = HALF.replace("friction: 0.1}", "friction: 0.1, film: {length: 1.5 mm}}")
    assert guide_of(SimpleNamespace(case_text=text)).film.length == pytest.approx(1.5e-3, rel=1e-12)
