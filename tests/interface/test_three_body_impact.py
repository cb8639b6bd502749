"""``klack impact`` of three bodies in a row: the numbers of the page, a stroke, and refusals.

Truth: the loop of a stroke with the same bodies and laws, which marches them on its own.
"""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from pages import HOW_TO

import klack
from klack.analyses.impact.analysis import IMPACT
from klack.assembling.body_row import build_row
from klack.case import read_case
from klack.cli.main import main
from klack.contact.restitution import measure_impact
from klack.errors import InputError
from klack.machine.progress import silent
from klack.simulation.impact import simulate
from klack.simulation.network_run import simulate_network

CASE = HOW_TO / "seat_insert_impact.yaml"
TEXT = CASE.read_text("utf-8")
PAGE = (HOW_TO / "seat-insert.md").read_text("utf-8")


@pytest.fixture(scope="module")
def row():
    return build_row(klack.load_case(CASE).checked, silent)


def moved(system, preload):
    """The row with another preload of its second contact, and its clamp."""
    first, second = system.contacts
    springs = tuple(
        replace(one, preload=preload) if one.port == "shoulder" else one for one in system.springs
    )
    return replace(system, contacts=(first, replace(second, preload=preload)), springs=springs)


def test_a_stroke_of_the_same_bodies_gives_the_same_impact(row):
    """Peaks to 0.1 %, times to 0.05 us; the stroke starts with its own static equilibrium."""
    run = simulate_network(row.valve.network.rows(), duration=30e-6, step=10e-9, coarse=1)
    seat, foot = run.interfaces["contact"], run.interfaces["backing"]
    preload = float(foot.contact_force[0])
    assert 450 < preload < 500  # the clamp gives way by the sink of the insert
    record = simulate(
        moved(row.system, preload), velocities={"needle": -1.6}, step=10e-9, duration=30e-6
    )
    (event,) = [one for one in run.events if one.stop == "contact"]
    found = measure_impact(record.impact(0))

    assert found.peak_force == pytest.approx(event.peak_force, rel=1e-3)
    assert found.contact_time == pytest.approx(event.contact_time, abs=5e-8)
    assert record.force[:, 1].max() == pytest.approx(foot.contact_force.max(), rel=1e-3)
    assert record.force[:, 1].min() == pytest.approx(foot.contact_force.min(), rel=1e-3)
    assert found.impulse == pytest.approx((seat.contact_force * seat.step).sum(), rel=1e-3)
    assert abs(record.ledger.residual) < 1e-12


# insert, peak [N], contact time [us], restitution, force on the ledge, lifts at, apart, gap
LINE = (
    r"^\| (clamped with (\d+) N|loose|loose, 2 um.*?) \| ([\d.]+) N \| ([\d.]+) us \| ([\d.]+) "
    r"\| (\d+) to (\d+) N \| ([\d.]*)[ us]*\| ([\d.]*)[ us]*\| ([\d.]*)"
)
LINES = re.findall(LINE, PAGE, flags=re.MULTILINE)
CLAMP = re.search(r"  clamp: .*\n", TEXT).group()


SHAFT = """              - {line: [1.25, 20], name: shaft}
              - {line: [0, 20], name: top}
              - {close: true, name: axis}
    material: steel
"""
BONDED = """              - {line: [1.25, 10], name: shaft}
              - {line: [0, 10], name: joint}
              - {close: true, name: axis}
          head:
            start: [0, 10]
            edges:
              - {line: [1.25, 10], name: joint}
              - {line: [1.25, 20], name: head}
              - {line: [0, 20], name: top}
              - {close: true, name: head_axis}
    material: steel
    layers: {joint: {normal: 20 kN/mm^3, tangential: 5 kN/mm^3, loss_factor: 0.2}}
"""


def test_a_layer_of_one_of_them_is_shown(tmp_path):
    (tmp_path / "case.yaml").write_text(TEXT.replace(SHAFT, BONDED), "utf-8")
    study = klack.run_impact(tmp_path / "case.yaml", ["reduced"]).record
    (layer,) = IMPACT.to_json(study)["layers"]
    assert (layer["body"], layer["layer"]) == ("needle", "joint")
    assert max(layer["energy_share"]) > 0.1


def test_the_page_has_the_case_and_its_numbers(tmp_path):
    """One unit of the last digit, all of them from one mesh."""
    assert len(LINES) == 6
    for words, preload, *numbers in LINES:
        text = TEXT.replace("500 N", f"{preload} N") if preload else TEXT
        if not preload:
            text = text.replace(CLAMP, "  gap: 2 um\n" if "2 um" in words else "")
        (tmp_path / "case.yaml").write_text(text, "utf-8")
        study = klack.run_impact(tmp_path / "case.yaml", ["reduced"]).record
        level = study.levels["reduced"]
        peak, time, restitution, least, largest, lift, apart, gap = (
            float(number) if number else 0.0 for number in numbers
        )
        assert level.measures.peak_force == pytest.approx(peak, abs=0.1)
        assert 1e6 * level.measures.contact_time == pytest.approx(time, abs=0.01)
        assert level.measures.restitution == pytest.approx(restitution, abs=1e-4)
        below = level.backing
        assert below.least_force == pytest.approx(least, abs=1.0)
        assert below.peak_force == pytest.approx(largest, abs=1.0)
        assert (below.lift_off == below.lift_off) == (lift > 0.0)
        if lift:
            assert 1e6 * below.lift_off == pytest.approx(lift, abs=0.03)
        assert 1e6 * below.open_time == pytest.approx(apart, abs=0.1)
        assert 1e6 * below.largest_gap == pytest.approx(gap, abs=2e-3)
        assert abs(level.energy_residual) < 1e-12
        assert not study.estimates_settled
        # a crown of 1 um on a foot that hits its ledge
        flat = any("meet all at once" in doubt for doubt in level.doubts)
        assert flat == (not preload)


def test_a_result_is_stored_shown_and_has_no_sound(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["impact", str(CASE), "--out", "out", "--json", "out.json", "--quiet"]) == 0
    found = json.loads(Path("out.json").read_text("utf-8"))["levels"]["reduced"]
    stored = klack.load_result("out")
    assert (
        found["backing"]["backing_peak_force_N"]
        == stored.record.levels["reduced"].backing.peak_force
    )
    assert "lift_off_s" in found["backing"]
    assert found["backing"]["lift_off_s"] is None
    page = Path("out/report.html").read_text("utf-8")
    assert "Forces on both sides of the struck body" in page
    assert "carries 306" in page
    assert "--level reduced,full" not in page
    assert main(["show", "out", "--out", "page.html"]) == 0
    assert "3 bodies, 2 contacts" in capsys.readouterr().out
    assert main(["inspect", str(CASE)]) == 0
    assert "insert.foot on housing.ledge: clamped with 500 N" in capsys.readouterr().out
    others = (["noise", "out"], ["noise", str(CASE)], ["advise", str(CASE)], ["reduce", str(CASE)])
    compared = (["compare", "out", way, "out.json"] for way in ("--measurement", "--calculix"))
    for command in (*others, *compared):
        assert main(command) == 2
        assert "three bodies in a row" in capsys.readouterr().err


@pytest.mark.slow  # loops of faces that yield take half a minute on a busy core
def test_yield_is_a_doubt(tmp_path):
    text = TEXT.replace("7850 kg/m^3", "7850 kg/m^3, yield: 500 MPa")
    (tmp_path / "case.yaml").write_text(text, "utf-8")
    level = klack.run_impact(tmp_path / "case.yaml", ["reduced"]).record.levels["reduced"]
    assert any("faces needle.tip on insert.seat yield" in doubt for doubt in level.doubts)


def test_closing_forces_that_speed_the_needle_up_are_a_doubt(tmp_path):
    """It follows the loose insert down and is thrown back with it: a restitution of 2.9."""
    text = TEXT.replace(CLAMP, "  gap: 10 um\n").replace("1.6 m/s", "0.3 m/s, force: 40 N")
    text = text.replace("60 us", "100 us")
    (tmp_path / "case.yaml").write_text(text, "utf-8")
    level = klack.run_impact(tmp_path / "case.yaml", ["reduced"]).record.levels["reduced"]
    assert level.measures.restitution > 1.0
    assert any("leaves faster than it arrived" in doubt for doubt in level.doubts)


@pytest.mark.parametrize(("preload", "noted"), [("1 mN", True), ("500 N", False)])
def test_a_contact_that_opens_before_its_modes_can_tell_is_noted(tmp_path, preload, noted):
    """The wave needs 0.3 us from the seat to the foot; with 1 mN the modes open it in less."""
    (tmp_path / "case.yaml").write_text(TEXT.replace("500 N", preload), "utf-8")
    study = klack.run_impact(tmp_path / "case.yaml", ["reduced"]).record
    found = [note for note in study.warnings if "within the shortest period" in note]
    assert len(found) == noted
    assert all(note.startswith("insert.foot on housing.ledge opens") for note in found)


def refused(text, *, match):
    with pytest.raises(InputError, match=match) as caught:
        read_case(text, CASE)
    return str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        ("levels: [reduced]", "levels: [reduced, full]", r"run.levels: got other levels"),
        ("run: {duration: 60 us, levels: [reduced]}", "run: {duration: 60 us}", "other levels"),
        ("insert.foot, housing.ledge]", "insert.seat, housing.ledge]", "another surface of 'ins"),
        ("insert.foot, housing.ledge]", "housing.ledge, insert.foot]", "another surface of 'ins"),
        ("insert.foot, housing.ledge]", "insert.fot, housing.ledge]", "did you mean 'foot'"),
        ("surface: shoulder", "surface: foot", "a separate surface"),
        ("surface: shoulder", "surface: sholder", "did you mean 'shoulder'"),
        ("    fixed: [{surface: rim}]\n", "", "a surface that carries the preload"),
        ("backing:\n", "backing:\n  gap: 1 um\n", "the clamp closes it"),
        ("gap: 0.1 um}", "gap: 0.1 um, friction: 0.1}", "friction of the faces, and a body"),
        ("gap: 0.1 um}", "gap: 0.1 um, crown: 1 um}", "a crown, and a body behind"),
        ("motion: {", "noise: {}\nmotion: {", "noise, and a body behind"),
        ("motion: {", "motion: {placement: {tilt: 0.1 deg}, ", "motion off-axis"),
        ("preload: 500 N", "preload: 0 N", "above 0"),
        (", gap: 0.1 um}", "}", "contact: got no gap between"),
    ],
)
def test_what_three_bodies_cannot_have_is_refused_at_its_line(old, new, match):
    assert old in TEXT
    text = refused(TEXT.replace(old, new), match=match)
    assert re.search(r"seat_insert_impact.yaml:\d+: ", text)
    assert "Try: " in text


def test_surfaces_that_do_not_meet_are_refused_at_their_line(tmp_path):
    path = tmp_path / "case.yaml"
    path.write_text(TEXT.replace("housing.ledge]", "housing.rim]"), "utf-8")
    with pytest.raises(InputError, match=r"case.yaml:67: backing.between: insert.foot on housing"):
        klack.run_impact(path, ["reduced"])


def test_a_third_body_without_the_section_is_told_what_to_write():
    text = TEXT[: TEXT.index("backing:")] + TEXT[TEXT.index("motion:") :]
    told = refused(text, match="got 3 bodies .needle, insert, housing., expected exactly two")
    assert "'backing: {between: [insert.SURFACE, housing.SURFACE]}'" in told


def test_notes_name_sections_of_the_impact_and_only_contacts_that_met(tmp_path):
    """A ledge 1 mm away is not reached, and with 60 modes has little left for its local law."""
    text = TEXT.replace(CLAMP, "  gap: 1 mm\n").replace("{count: 12}", "{count: 60}")
    (tmp_path / "case.yaml").write_text(text, "utf-8")
    study = klack.run_impact(tmp_path / "case.yaml", ["reduced"]).record
    (found,) = study.levels.values()
    assert found.backing.peak_force == 0.0
    (note,) = study.warnings
    assert re.match(r"backing: only [\d.]+ % of the static compliance", note)
    assert not found.doubts


@pytest.mark.parametrize("level", ["lumped", "interface", "full", "reduced-none"])
def test_other_levels_and_commands_refuse_before_meshing(level):
    case = read_case(TEXT.replace("motion: {", "lumped: {stiffness: 1e9 N/m}\nmotion: {"), CASE)
    with pytest.raises(InputError, match=r"three bodies in a row, expected .*--level reduced"):
        case.require_levels([level])
