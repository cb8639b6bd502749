"""Keys of shots and of what is off-axis.

Keys of placement, guide and shots: truth = the numbers in the text, the line of a mistake.

Shots of whole strokes in the case of a valve: truth = the text, and the line of each mistake.

Magnet and seat across the axis, in the case of a valve: truth = the text of each mistake.

Cases of half sections with motion: three-dimensional: what is refused, and with which words.

A noise section that names what the case does not have is refused before anything runs.
"""

from math import pi
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from doubts import doubts
from scipy import stats
from shots_valve import GUIDE, valve_case, valve_text

import klack
from klack.analyses.stroke.axis import guide_of
from klack.analyses.stroke_shots.one_stroke import Starts, shots_of_valve
from klack.assembling.valve import build_valve
from klack.case import find_case, load_case, read_case
from klack.case.any_case import load_valve_case, read_any_case, read_valve_case
from klack.case.distribution import Distribution
from klack.case.key_path import quantity_at, split_path
from klack.cli.main import main
from klack.errors import InputError
from klack.input.problem import CaseProblem

DATA = Path(__file__).parents[1] / "data" / "case" / "drawn.yaml"
TEXT = DATA.read_text(encoding="utf-8")
HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
GUIDE_SHOTS = "guide: {surface: shaft, heights: [6 mm, 13 mm], clearance: 4 um}\n"
SHOTS = "shots: {count: 20, seed: 7}\n"


def case(more: str = "", old: str = "", new: str = ""):
    text = TEXT + more
    assert text.count(old) >= 1
    return read_case(text.replace(old, new, 1) if old else text, Path("valve.yaml"))


def complaint(more: str = "", old: str = "", new: str = "") -> InputError:
    with pytest.raises(InputError) as caught:
        case(more, old, new)
    return caught.value


def flat() -> tuple[str, str]:
    """Both bodies of the case as half sections."""
    return "model: swept\n      layers: 18", "model: axisymmetric"


def test_placement_arrives_in_si():
    motion = case(
        "",
        "motion: {",
        "motion: {placement: {eccentricity: 1.5 um, direction: 90 deg, tilt: 0.05 deg}, ",
    ).motion

    assert motion.placement.eccentricity == 1.5e-6
    assert motion.placement.direction == pytest.approx(pi / 2)
    assert motion.placement.tilt == pytest.approx(0.05 * pi / 180)
    assert motion.placement.tilt_direction == 0.0
    assert not motion.placement.is_centred
    assert load_case(DATA).motion.placement.is_centred
    assert motion.closing_force == 10.0


def test_guide_arrives_in_si():
    guide = case(GUIDE_SHOTS).guide

    assert guide.heights == (6e-3, 13e-3)
    assert guide.clearance == 4e-6
    assert guide.law.kind == "consistent"
    assert guide.law.bore is None
    assert (guide.friction, guide.viscous) == (0.0, 0.0)
    stiff = GUIDE_SHOTS.replace("}", ", law: {kind: linear, stiffness: 100 N/um}, friction: 0.1}")
    assert case(stiff).guide.law.stiffness == 1e8


def test_shots_arrive_in_si():
    text = """
shots:
  eccentricity: {uniform: [0 um, 3 um]}
  tilt: {rayleigh: 0.01 deg}
  force: {normal: [10 N, 500 mN]}
  waviness: {rms: 0.1 um, harmonics: [2, 6]}
"""
    shots = case(text).shots

    assert (shots.count, shots.seed, shots.impacts, shots.step) == (50, 1, 4, 40e-9)
    assert shots.eccentricity == Distribution("uniform", 0.0, 3e-6)
    assert shots.tilt.first == pytest.approx(0.01 * pi / 180)
    assert shots.force == Distribution("normal", 10.0, 0.5)
    assert shots.waviness.rms == Distribution("fixed", 1e-7)
    assert shots.waviness.harmonics == (2, 6)
    assert shots.friction is None


def test_interface_level_has_its_own_step():
    run = case("", "run: {", "run: {levels: [interface], interface_step: 50 ns, ").run

    assert run.levels == ("interface",)
    assert run.interface_step == 50e-9
    assert load_case(DATA).run.interface_step == 40e-9
    error = complaint("", "run: {", "run: {levels: [interface], interface_step: 50 us, ")
    assert "interface_step" in error.got
    # a step that no level uses is nobody's business
    case("", "run: {", "run: {levels: [reduced], interface_step: 50 us, ")


@pytest.mark.parametrize(
    ("distribution", "truth"),
    [
        (Distribution("uniform", 1.0, 3.0), stats.uniform(1.0, 2.0)),
        (Distribution("rayleigh", 2.0), stats.rayleigh(scale=2.0)),
        (Distribution("normal", 5.0, 0.5), stats.norm(5.0, 0.5)),
        (Distribution("normal", 1.0, 2.0), stats.truncnorm(-0.5, np.inf, loc=1.0, scale=2.0)),
    ],
)
def test_quantiles_are_those_of_the_distribution(distribution, truth):
    shares = np.array([0.0, 1e-9, 0.01, 0.3, 0.5, 0.9, 0.999])
    values = [distribution.quantile(share) for share in shares]

    # the truth reaches down to minus infinity where nothing is cut off
    assert values == pytest.approx(np.maximum(truth.ppf(shares), 0.0), rel=1e-9, abs=1e-12)
    assert min(values) >= 0.0


def test_fixed_values_do_not_vary():
    assert Distribution("fixed", 3.0).quantile(0.7) == 3.0
    assert Distribution("normal", 3.0, 0.0).quantile(0.7) == 3.0
    assert Distribution("fixed", 2e-6).text("m") == "2 um"
    assert Distribution("uniform", 1e-6, 3e-6).text("m") == "uniform between 1 um and 3 um"


MISTAKES = [
    # more text, replaced text, its replacement, key, words in what was expected or tried
    ("", "motion: {", "motion: {placement: {eccentricity: 1}, ", "eccentricity", "um"),
    ("", "motion: {", "motion: {placement: {eccentricity: -1 um}, ", "eccentricity", "0 or more"),
    ("", "motion: {", "motion: {placement: {tilt: 6 deg}, ", "tilt", "or less"),
    ("", "motion: {", "motion: {placement: {tilt_angle: 6 deg}, ", "tilt_angle", "tilt"),
    (GUIDE_SHOTS, "shaft, h", "shift, h", "guide.surface", "did you mean 'shaft'"),
    (GUIDE_SHOTS, "[6 mm, 13 mm]", "[6 mm]", "guide.heights", "at least 2"),
    (GUIDE_SHOTS, "[6 mm, 13 mm]", "[13 mm, 6 mm]", "guide.heights[1]", "rise"),
    (GUIDE_SHOTS, "[6 mm, 13 mm]", "[6 mm, 21 mm]", "guide.heights[1]", "2.4 mm to 20 mm"),
    (GUIDE_SHOTS, "4 um", "0 um", "guide.clearance", "above 0"),
    (GUIDE_SHOTS, "4 um}", "4 um, friction: -0.1}", "guide.friction", "0 or more"),
    (GUIDE_SHOTS, "4 um}", "4 um, law: {kind: lineer}}", "guide.law.kind", "did you mean 'linear'"),
    (GUIDE_SHOTS, "4 um}", "4 um, law: {kind: linear}}", "guide.law", "stiffness"),
    (SHOTS, "", "", "shots", "guide"),
    (GUIDE_SHOTS + SHOTS, "seed: 7", "seed: -7", "shots.seed", "0 or more"),
    (GUIDE_SHOTS + SHOTS, "seed: 7", "tilt: 0.01 deg", "shots.tilt", "eccentricity"),
    (GUIDE_SHOTS + SHOTS, "seed: 7", "force: {normal: [1 N]}", "shots.force.normal", "mean"),
    (GUIDE_SHOTS + SHOTS, "seed: 7", "force: {normal: [1 N, 2]}", "shots.force.normal[1]", "unit"),
    (GUIDE_SHOTS + SHOTS, "seed: 7", "force: {uniform: [2 N, 1 N]}", "shots.force.uniform", "swap"),
    (
        GUIDE_SHOTS + SHOTS,
        "seed: 7",
        "force: {unifrom: [2 N, 1 N]}",
        "shots.force.unifrom",
        "uniform",
    ),
    (
        GUIDE_SHOTS + SHOTS,
        "seed: 7",
        "force: {rayleigh: [2 N, 1 N]}",
        "shots.force.rayleigh",
        "scale",
    ),
    (GUIDE_SHOTS + SHOTS, "seed: 7", "force: -1 N", "shots.force", "0 or more"),
    (GUIDE_SHOTS + SHOTS, "seed: 7", "impacts: 1", "shots.impacts", "2 or more"),
    (GUIDE_SHOTS + SHOTS, "seed: 7", "duration: 1 us", "shots.duration", "100 to"),
    (
        GUIDE_SHOTS + SHOTS,
        "seed: 7",
        "waviness: {rms: 0, harmonics: [1, 4]}",
        "shots.waviness.harmonics",
        "eccentricity",
    ),
    ("shots: {friction: 0.1}\n", "", "", "shots.friction", "guide"),
]


@pytest.mark.parametrize(("more", "old", "new", "key", "words"), MISTAKES)
def test_mistakes_are_named_with_key_and_way_out(more, old, new, key, words):
    error = complaint(more, old, new)

    assert error.where.startswith("valve.yaml:")
    assert error.where.endswith(key)
    assert words in f"{error.expected} {error.hint}"


@pytest.mark.parametrize(
    ("more", "key"),
    [
        (GUIDE_SHOTS, "guide"),
        ("shots: {force: {normal: [10 N, 1 N]}}\n", "shots"),
    ],
)
def test_half_sections_have_no_guide_and_no_shots(more, key):
    text = (TEXT + more).replace(*flat()).replace(", sectors: {count: 3, width: 40 deg}", "")
    with pytest.raises(InputError) as caught:
        read_case(text, Path("valve.yaml"))

    assert caught.value.where.endswith(key)
    assert "model: swept" in caught.value.hint


def test_numbers_of_distributions_have_paths():
    """As the file has them: one number, or the entries of its distribution."""
    case = klack.load_case(HOW_TO / "guided_needle.yaml")
    assert case.value("shots.force") == {"uniform": (0.8, 1.2)}
    assert case.with_value("shots.force.uniform.1", "1.4 N").value("shots.force.uniform.1") == 1.4
    assert quantity_at(case.checked, split_path("shots.waviness.rms")).parse("0.3 um") == 3e-7
    with pytest.raises(InputError, match="expected 0 or more"):
        quantity_at(case.checked, split_path("shots.waviness.rms")).parse("-1 um")
    with pytest.raises(CaseProblem) as problem:
        quantity_at(case.checked, split_path("shots.force"))
    assert problem.value.hint.endswith("such as shots.force.uniform.0.")


HEIGHT, CENTRE = -0.9e-3, np.array([0.0, 0.0, 14e-3])
SHOTS_STROKE = "shots: {count: 3}"


def starts(shots: str = SHOTS_STROKE, seed: int = 1, guide: str = GUIDE) -> Starts:
    return Starts(
        case=valve_case(shots, guide=guide), seed=seed, height=HEIGHT, centres={"needle": CENTRE}
    )


def axis_at(start, z: float) -> np.ndarray:
    return start.aside + start.lean * (z - HEIGHT)


def test_shots_arrive_in_si_stroke():
    shots = valve_case("shots: {count: 7, carry: true, friction: {uniform: [0.05, 0.15]}}").shots

    assert (shots.count, shots.seed, shots.carry) == (7, 1, True)
    assert shots.friction == Distribution("uniform", 0.05, 0.15)
    assert not shots.draws_position
    assert valve_case("shots: {}").shots.count == 50


@pytest.mark.slow
def test_starts_fill_the_guide_and_depend_on_seed_and_number_alone():
    """Uniform over a disc of radius c: half of all within c/sqrt(2), none beyond c."""
    drawn = [starts().drawn(index) for index in range(200)]
    for z in (4e-3, 13e-3):
        off = np.hypot(*np.array([axis_at(start, z) for start in drawn]).T)
        assert off.max() <= 4e-6
        assert np.mean(off < 4e-6 / np.sqrt(2)) == pytest.approx(0.5, abs=0.1)  # 3 sigma
    again, other = starts().drawn(7), starts(seed=2).drawn(7)
    assert np.array_equal(again.placement, drawn[7].placement)
    assert not np.allclose(other.placement, drawn[7].placement)


def test_the_placement_moves_the_axis_to_where_it_was_drawn():
    """Truth: the axis is a straight line through the centre of mass, tilted by the rotation."""
    start = starts().drawn(2)
    t, lean = start.placement[:2], np.array([start.placement[4], -start.placement[3]])

    assert lean == pytest.approx(start.lean, rel=1e-12)
    # sine and tangent of half a milliradian are alike to 1e-7
    assert t + (HEIGHT - CENTRE[2]) * lean == pytest.approx(start.aside, rel=1e-5)


def test_the_next_stroke_of_a_row_starts_where_the_last_one_ended():
    end = np.array([1e-6, -2e-6, 3e-7, 2e-5, -1e-5, 4e-4])
    start = starts("shots: {carry: true}").after(3, end)

    assert start.placement[:2] == pytest.approx(end[:2], abs=1e-13)
    assert start.placement[3:] == pytest.approx(end[3:], rel=1e-12)
    assert abs(start.placement[2]) < 1e-11  # along the axis it starts as the case says
    assert (start.friction, start.index) == (0.1, 3)


@pytest.mark.slow
def test_friction_of_the_faces_is_drawn_beside_all_else():
    """In its range, with its mean in the centred stroke; other draws stay, and none is nan."""
    text = "shots: {count: 3, contact_friction: {uniform: [0.1, 0.3]}}"
    plain, drawn = ([starts(t).drawn(k) for k in range(200)] for t in (SHOTS_STROKE, text))

    found = np.array([start.contact_friction for start in drawn])
    assert np.all((found >= 0.1) & (found <= 0.3))
    assert found.mean() == pytest.approx(0.2, abs=0.2 / np.sqrt(12 * 200) * 3)  # 3 sigma
    assert starts(text).centred().contact_friction == pytest.approx(0.2)
    for one, other in zip(plain, drawn, strict=True):
        assert np.isnan(one.contact_friction)
        assert np.array_equal(one.placement, other.placement)
    with pytest.raises(InputError, match="at most 2 in every shot"):
        starts("shots: {contact_friction: {uniform: [1, 3]}}")


def test_friction_and_position_can_be_drawn():
    text = "shots: {eccentricity: 1 um, tilt: 0.001 deg, friction: {uniform: [0.1, 0.2]}}"
    drawn = [starts(text).drawn(index) for index in range(20)]

    assert [np.hypot(*start.aside) for start in drawn] == pytest.approx([1e-6] * 20)
    frictions = {start.friction for start in drawn}
    assert len(frictions) == 20
    assert all(0.1 <= friction <= 0.2 for friction in frictions)
    with pytest.raises(InputError, match="left the guide"):
        starts("shots: {eccentricity: 9 um, tilt: 0 deg}").drawn(0)


def test_the_first_stroke_of_a_row_may_start_from_a_placement():
    text = "placement: {eccentricity: 1 um}\nshots: {carry: true}"
    assert starts(text).drawn(0).aside == pytest.approx([1e-6, 0.0])
    assert starts(text).centred().friction == 0.0


MISTAKES_STROKE = [
    ("shots: {count: 0}", GUIDE, "shots.count", "1 or more"),
    ("shots: {seed: -1}", GUIDE, "shots.seed", "0 or more"),
    ("shots: {carry: 1}", GUIDE, "shots.carry", "true"),
    ("shots: {impacts: 3}", GUIDE, "shots.impacts", "count"),
    ("shots: {tilt: 0.01 deg}", GUIDE, "shots.tilt", "eccentricity"),
    ("shots: {friction: 7}", GUIDE, "shots.friction", "at most"),
    (SHOTS_STROKE, "", "shots", "guide"),
    (f"placement: {{seed: 3}}\n{SHOTS_STROKE}", GUIDE, "placement", "shots.seed"),
    (
        "placement: {seed: 3}\nshots: {carry: true, eccentricity: 1 um, tilt: 0 deg}",
        GUIDE,
        "shots.eccentricity",
        "placement",
    ),
]


@pytest.mark.parametrize(("shots", "guide", "key", "words"), MISTAKES_STROKE)
def test_mistakes_are_named_with_key_and_way_out_stroke(shots, guide, key, words):
    with pytest.raises(InputError) as caught:
        valve_case(shots, guide=guide)

    assert caught.value.where.endswith(key)
    assert words in f"{caught.value.expected} {caught.value.hint}"


def test_shots_along_the_axis_are_refused():
    text = valve_text().replace("motion: three-dimensional\n", "").replace(GUIDE, "")
    with pytest.raises(InputError) as caught:
        read_valve_case(text, Path("valve.yaml"))
    assert caught.value.where.endswith("shots")
    assert "three-dimensional" in caught.value.expected

    axial = read_valve_case(text.replace(SHOTS_STROKE, ""), Path("valve.yaml"))
    with pytest.raises(InputError, match="axial") as caught:
        shots_of_valve(axial)
    assert "three-dimensional" in caught.value.hint
    with pytest.raises(InputError, match="no section 'shots'"):
        shots_of_valve(valve_case(""))


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["--shots", "0"], "--shots"),
        (["--variant", "wet-lumped"], "lumped"),
        (["--variant", "damp"], "variant"),
    ],
)
def test_mistakes_of_the_command_are_refused_before_the_long_work(
    words, part, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "valve.yaml").write_text(valve_text())

    assert main(["shots", "valve.yaml", *words]) == 2
    error = capsys.readouterr().err
    assert part in error
    assert "Try:" in error
    assert not (tmp_path / "klack-results").exists()


def test_drops_have_no_variant(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)

    assert main(["shots", "demo-shots", "--variant", "dry"]) == 2
    assert "--variant" in capsys.readouterr().err


def test_the_case_of_the_page_is_the_one_quoted_there():
    folder = Path(__file__).parents[2] / "docs" / "how-to"
    page, file = (folder / "shots.md").read_text(), folder / "guided_stroke.yaml"
    block = page.partition("```yaml-part\n")[2].partition("```")[0].splitlines()

    assert set(block) <= set(file.read_text().splitlines())
    case = load_valve_case(file)
    assert (case.shots.count, case.run.variants) == (50, ("wet", "dry"))


FILE = Path(__file__).parents[2] / "docs" / "how-to" / "guided_magnet.yaml"
TEXT_OFF_AXIS = FILE.read_text(encoding="utf-8")
BORE = "off_axis: {height: 16.75 mm, eccentricity: 20 um}"
ALONG = (
    ("motion: three-dimensional\n", ""),
    ("guide: {surface", "#"),
    ("shots: {count", "#"),
)


def read(*changes):
    text = TEXT_OFF_AXIS
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return read_valve_case(text, FILE)


def test_parts_that_act_across_the_axis_are_known():
    case = read()

    coil, seat = (case.network.components[name] for name in ("coil", "restriction"))
    ring, pole = coil.off_axis_parts()
    assert ring.heights == pytest.approx((15e-3, 18.5e-3))
    assert ring.room == pytest.approx(180e-6)
    assert (ring.port, pole.port) == ("armature", "armature")
    assert [part.heights for part in seat.off_axis_parts()] == [(-0.884e-3,)]
    assert not case.network.components["supply"].off_axis_parts()
    assert seat.off_axis.inside == "b"


def test_the_guide_bounds_the_axis_where_the_ring_is():
    """At opposite walls, 4 um at 4 mm and -4 um at 13 mm: 4 (1 + 2 * 5.5/9) um at 18.5 mm."""
    guide = read().guide

    assert guide.largest_eccentricity(18.5e-3) == pytest.approx(4e-6 * (1.0 + 11.0 / 9.0))
    assert guide.largest_eccentricity(8e-3) == pytest.approx(4e-6)


NARROW = "          clearance: 200 um\n"
RING = "        - radius: 5 mm\n" + NARROW + "          length: 3.5 mm\n"
GIVEN = "        - {permeance: 600 nH, off_axis: {height: 16.75 mm}}"
SEAT = "      off_axis: {height: -0.884 mm}\n"
POLE = "pole.pole_face, coil.armature]\n    - [driver.terminals, coil"
MISTAKES_OFF_AXIS = {
    "axial ring": (ALONG, ("'off_axis' with motion: axial", "motion: three-dimensional")),
    "axial pole": (
        (*ALONG, (f"          {BORE}\n", ""), (SEAT, "")),
        ("poles[0].tilts", "with motion: axial"),
    ),
    "bore aside": (
        ((BORE, BORE.replace("20 um", "192 um")),),
        ("8 um of clearance around the armature", "aside by 8.889 um", "touch the iron"),
    ),
    "narrow ring": (
        ((NARROW, NARROW.replace("200", "8")), (", eccentricity: 20 um", "")),
        ("8 um of clearance around the armature",),
    ),
    "bore beyond": (
        ((BORE, BORE.replace("20 um", "0.2 mm")),),
        ("200 um in a clearance of 200 um", "less than the clearance"),
    ),
    "no height": (((BORE, "off_axis: {eccentricity: 20 um}"),), ("no key 'height'",)),
    "permeance": (
        ((RING, ""), (f"          {BORE}", GIVEN)),
        ("off_axis together with permeance",),
    ),
    "elsewhere": (
        (("coil.armature, top_face", "top_face"), ("driver.terminals, coil", POLE)),
        ("'coil.armature', which is not connected to 'needle'",),
    ),
    "inside": (((SEAT, SEAT.replace("}", ", inside: c}")),), ("restriction.off_axis.inside",)),
}


@pytest.mark.parametrize(("changes", "words"), MISTAKES_OFF_AXIS.values(), ids=MISTAKES_OFF_AXIS)
def test_a_mistake_is_told(changes, words):
    with pytest.raises(InputError) as caught:
        read(*changes)
    for word in words:
        assert word in str(caught.value)
    assert "Try:" in str(caught.value)


CASE = Path(__file__).parents[2] / "docs" / "how-to" / "half_section_stroke.yaml"
HALF = CASE.read_text(encoding="utf-8")
GUIDE_HALF = next(line + "\n" for line in HALF.splitlines() if line.startswith("guide:"))
COARSE = HALF.replace("0.02 mm, e", "0.1 mm, e").replace("angles: 24", "angles: 8")
ALONG_HALF = HALF.replace("motion: three-dimensional\n", "").replace(GUIDE_HALF, "")
LAW = "law: {kind: consistent}"
FLAT, SWEPT = "model: axisymmetric", "model: swept\n      layers: 8"


def read_half(text):
    return read_valve_case(text, CASE)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (ALONG_HALF.replace("placement: {seed: 3}\n", ""), "angles: got angles of rings"),
        (HALF.replace(FLAT, SWEPT), "angles: got angles of bodies of three dimensions"),
        (
            HALF.replace(FLAT, SWEPT, 1),
            "an axisymmetric 'housing' and a three-dimensional 'needle'",
        ),
        (HALF.replace("angles: 24", "angles: 5"), "angles: got 5"),
        (HALF.replace(LAW, f"restitution: 0.5, {LAW}", 1), "restitution: got 0.5 with motion"),
        (
            HALF.replace(LAW, f"series_compliance: 2 um/kN, {LAW}", 1),
            "series_compliance: got 2e-09 m/N together with a consistent law",
        ),
    ],
)
def test_what_contradicts_itself_is_told_with_its_bodies(text, expected):
    with pytest.raises(InputError, match=expected) as caught:
        read_half(text)
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
        build_valve(read_half(wide))
    assert "guide.clearance" in str(caught.value)


@pytest.mark.slow
def test_bodies_without_a_mode_of_order_1_are_named():
    few = COARSE.replace("needle: {count: 12}", "needle: {count: 1}")
    with doubts() as told:
        valve = build_valve(read_half(few))
    assert [text for text in told if "keeps no elastic mode of order 1" in text] == [
        "'needle' keeps no elastic mode of order 1: across its axis it moves as a rigid "
        "body, and deforms only statically. Try: more modes in reduction.modes.needle."
    ]
    needle = valve.reduced["needle"]
    assert (needle.rigid_count, needle.mode_count) == (6, 7)


def test_a_report_reads_a_guide_with_a_film():
    text = HALF.replace("friction: 0.1}", "friction: 0.1, film: {length: 1.5 mm}}")
    assert guide_of(SimpleNamespace(case_text=text)).film.length == pytest.approx(1.5e-3, rel=1e-12)


SHIPPED = ("demo-stroke", "demo-valve-axisymmetric")


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize(
    ("section", "message"),
    [
        ("surfaces: [needle.tip]", r"noise.surfaces.*got 'needle.tip', but 'needle'"),
        ("surfaces: [housing.outsid]", r"surface of housing 'outsid'"),
        ("surfaces: [housng.outside]", r"unknown body 'housng'"),
        ("plate: {thickness: 1 mm, area: 0.5 m^2, material: tin}", r"unknown material 'tin'"),
    ],
)
def test_what_the_case_does_not_have(name: str, section: str, message: str) -> None:
    lines = find_case(name).read_text(encoding="utf-8").splitlines()
    own = [i for i, line in enumerate(lines) if line.startswith("noise:")]
    for first in own:  # up to the next section
        later = range(first + 1, len(lines))
        last = next((i for i in later if lines[i][:1].isalpha()), len(lines))
        del lines[first:last]
    text = "\n".join([*lines, "noise:", f"  {section}", ""])

    with pytest.raises(InputError, match=message):
        read_any_case(text, Path("case.yaml"))


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_cases_are_read(name: str) -> None:
    path = find_case(name)

    assert read_any_case(path.read_text(encoding="utf-8"), path).name == name


def test_a_forgotten_support_is_asked_for() -> None:
    """Without 'fixed' the sound of the housing is no question about its surfaces."""
    held = "    fixed:\n      - surface: rim\n"
    impact = find_case("demo-valve-axisymmetric").read_text(encoding="utf-8")
    assert held in impact
    with pytest.raises(InputError, match=r"bodies.housing: got no key 'fixed'.*"):
        read_any_case(impact.replace(held, ""), Path("case.yaml"))


def test_a_forgotten_support_of_a_valve_is_asked_for() -> None:
    stroke = find_case("demo-stroke").read_text(encoding="utf-8")
    start = stroke.index("    fixed:")
    end = stroke.index("\n    ", stroke.index("surface:", start))
    loose = stroke[:start] + stroke[end + 1 :]
    with pytest.raises(InputError, match=r"hold the others \(fixed: "):
        read_any_case(loose, Path("case.yaml"))
    named = loose.replace("\nrun:\n", "\nrun:\n  lift: needle.tip\n")
    assert named != loose
    with pytest.raises(InputError, match=r"bodies.housing: got no key 'fixed'.*"):
        read_any_case(named, Path("case.yaml"))


TWO = (CASE.parent / "armature_off_axis.yaml").read_text(encoding="utf-8")
BORE = "armature: {surface: rim, heights"
LEDGE = "    fixed: [{surface: bottom}]\n"


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ((BORE, "pole: {surface: rim, heights"), r"guides\.pole: got a guide of 'pole'"),
        ((BORE, "needle: {surface: rim, heights"), r"guides\.needle.*'guide'"),
        ((BORE, "armature: {on: pole.bore, surface: rim, heights"), r"guides\.armature\.on"),
        ((BORE, "armature: {on: armature.rim, surface: rim, heights"), r"guides\.armature\.on"),
        (
            ("placement: {seed: 3}", "shots: {count: 3, carry: true}"),
            r"shots\.carry: .*2 moving bodies",
        ),
    ],
)
def test_what_two_bodies_cannot_have_is_told_before_meshing(change, expected):
    assert TWO.count(change[0]) == 1, change
    with pytest.raises(InputError, match=f"(?s){expected}") as caught:
        read_valve_case(TWO.replace(*change), CASE.parent / "armature_off_axis.yaml")
    assert "Try:" in str(caught.value)
