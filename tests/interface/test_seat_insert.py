"""Three bodies in a row: needle, seat insert and housing; the numbers of the page."""

import re

import pytest
from pages import HOW_TO

import klack
from klack.case.valve_roles import find_roles
from klack.errors import InputError

CASE = HOW_TO / "seat_insert.yaml"
# clamped with [N], first touch [us], speed [m/s], peak on the seat [N], force on the ledge [N]
ROW = r"^\| (\d+) N \| ([\d.]+) us \| ([\d.]+) m/s \| (\d+) N \| [\d.]+ m/s \| (\d+) to (\d+) N"
ROWS = re.findall(ROW, (HOW_TO / "seat-insert.md").read_text("utf-8"), flags=re.MULTILINE)


@pytest.mark.slow
@pytest.mark.parametrize("row", ROWS, ids=lambda row: f"{row[0]} N")
def test_a_clamped_insert_moves_as_the_page_says(row):
    """One unit of the last digit; the energy of all three bodies balances."""
    clamp, touch, speed, peak, least, largest = map(float, row)
    case = klack.load_case(CASE).with_value("network.components.sleeve.preload", f"{clamp} N")
    assert find_roles(case.checked).seat == "seat"
    record = klack.run_stroke(case, ["dry"]).record
    result = record.reference.result

    first = next(event for event in result.events if event.stop == "seat")
    assert 1e6 * first.time == pytest.approx(touch, abs=0.1)
    assert first.approach_speed == pytest.approx(speed, abs=1e-3)
    assert first.peak_force == pytest.approx(peak, abs=1.0)
    ledge = result.channels["foot contact force"].values
    assert ledge.min() == pytest.approx(least, abs=1.0)
    assert ledge.max() == pytest.approx(largest, abs=1.0)
    assert any(event.stop == "foot" for event in result.events) == (least == 0.0)
    assert result.books.relative_residual < 1e-11
    assert not any("seat" in note for note in record.warnings)


def test_the_page_has_a_clamp_that_holds_and_one_that_does_not():
    assert {row[4] == "0" for row in ROWS} == {True, False}


@pytest.mark.slow
def test_without_the_key_the_lowest_stop_is_the_seat_and_the_stroke_says_so(tmp_path):
    text = CASE.read_text("utf-8").replace(", seat: seat}", "}").replace("0.6 ms", "0.1 ms")
    (tmp_path / "case.yaml").write_text(text, "utf-8")
    case = klack.load_case(tmp_path / "case.yaml")
    assert (find_roles(case.checked).seat, find_roles(case.checked).own_seat) == ("foot", "seat")
    (note,) = klack.run_stroke(case, ["dry"]).record.warnings
    assert "'needle' opened at 'seat', and the body below stayed on 'foot'" in note
    assert "run: {seat: seat}" in note


@pytest.mark.parametrize("name", ["stop", "foot", "sleeve", "nothing"])
def test_the_seat_is_a_stop_below_the_body_of_the_lift(tmp_path, name):
    text = CASE.read_text("utf-8").replace(", seat: seat}", f", seat: {name}}}")
    (tmp_path / "case.yaml").write_text(text, "utf-8")
    with pytest.raises(InputError, match=f"run.seat: got '{name}', expected .*'needle': .*seat"):
        klack.load_case(tmp_path / "case.yaml")


TWO_SEATS = """
klack: 1
title: Two seats
network:
  components:
    needle: {type: rigid-mass, mass: 3 g, points: [inner, outer, top]}
    one: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e8 N/m}}
    two: {type: end-stop, gap: 1 um, law: {kind: linear, stiffness: 1e8 N/m}}
    stop: {type: end-stop, gap: 50 um, law: {kind: linear, stiffness: 1e8 N/m}}
    spring: {type: spring, stiffness: 10 N/mm, preload: 12 N}
    magnet: {type: force-over-time, time: [10 us, 60 us], force: [60 N, 0 N]}
  connections:
    - [needle.inner, one.upper]
    - [needle.outer, two.upper]
    - [one.lower, two.lower, ground]
    - [needle.top, spring.end, magnet.end, stop.lower]
    - [ground, stop.upper]
run: {duration: 1 ms, variants: [dry], seat: NAME}
"""


def on_two_seats(folder, name):
    (folder / "case.yaml").write_text(TWO_SEATS.replace("NAME", name), "utf-8")
    return klack.load_case(folder / "case.yaml")


def test_the_lift_is_that_of_the_point_at_the_named_seat(tmp_path):
    """A needle on two seats: the default point of the lift follows the key."""
    for name, point in (("one", "inner"), ("two", "outer")):
        roles = find_roles(on_two_seats(tmp_path, name).checked)
        assert (roles.seat, roles.point) == (name, point)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["one", "two"])
def test_a_needle_closes_when_it_touches_the_named_seat(tmp_path, name):
    """Also where that is not the stop that ends its travel, which it touches before."""
    variant = klack.run_stroke(on_two_seats(tmp_path, name), ["dry"]).record.reference
    touches = [event.time for event in variant.result.events if event.stop == name]
    assert variant.closing_time == touches[0]
    assert variant.times[0].closing.stop == name
