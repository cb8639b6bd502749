"""Shots of whole strokes in the case of a valve: truth = the text, and the line of each mistake."""

from pathlib import Path

import numpy as np
import pytest
from shots_valve import GUIDE, valve_case, valve_text

from klack.analyses.stroke_shots.one_stroke import Starts, shots_of_valve
from klack.case.any_case import load_valve_case, read_valve_case
from klack.case.distribution import Distribution
from klack.cli.main import main
from klack.errors import InputError

HEIGHT, CENTRE = -0.9e-3, np.array([0.0, 0.0, 14e-3])
SHOTS = "shots: {count: 3}"


def starts(shots: str = SHOTS, seed: int = 1, guide: str = GUIDE) -> Starts:
    return Starts(case=valve_case(shots, guide=guide), seed=seed, height=HEIGHT, centre=CENTRE)


def axis_at(start, z: float) -> np.ndarray:
    return start.aside + start.lean * (z - HEIGHT)


def test_shots_arrive_in_si():
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
    plain, drawn = ([starts(t).drawn(k) for k in range(200)] for t in (SHOTS, text))

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


MISTAKES = [
    ("shots: {count: 0}", GUIDE, "shots.count", "1 or more"),
    ("shots: {seed: -1}", GUIDE, "shots.seed", "0 or more"),
    ("shots: {carry: 1}", GUIDE, "shots.carry", "true"),
    ("shots: {impacts: 3}", GUIDE, "shots.impacts", "count"),
    ("shots: {tilt: 0.01 deg}", GUIDE, "shots.tilt", "eccentricity"),
    ("shots: {friction: 7}", GUIDE, "shots.friction", "at most"),
    (SHOTS, "", "shots", "guide"),
    (f"placement: {{seed: 3}}\n{SHOTS}", GUIDE, "placement", "shots.seed"),
    (
        "placement: {seed: 3}\nshots: {carry: true, eccentricity: 1 um, tilt: 0 deg}",
        GUIDE,
        "shots.eccentricity",
        "placement",
    ),
]


@pytest.mark.parametrize(("shots", "guide", "key", "words"), MISTAKES)
def test_mistakes_are_named_with_key_and_way_out(shots, guide, key, words):
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

    axial = read_valve_case(text.replace(SHOTS, ""), Path("valve.yaml"))
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
