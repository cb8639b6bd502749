"""Magnet and seat across the axis, in the case of a valve: truth = the text of each mistake."""

from pathlib import Path

import pytest

from klack.case.any_case import read_valve_case
from klack.errors import InputError

FILE = Path(__file__).parents[2] / "docs" / "how-to" / "guided_magnet.yaml"
TEXT = FILE.read_text(encoding="utf-8")
BORE = "off_axis: {height: 16.75 mm, eccentricity: 20 um}"
ALONG = (
    ("motion: three-dimensional\n", ""),
    ("guide: {surface", "#"),
    ("shots: {count", "#"),
)


def read(*changes):
    text = TEXT
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
MISTAKES = {
    "axial ring": (ALONG, ("'off_axis' with motion: axial", "motion: three-dimensional")),
    "axial pole": (
        (*ALONG, (f"          {BORE}\n", ""), (SEAT, "")),
        ("poles[0].tilts", "with motion: axial"),
    ),
    "bore aside": (
        ((BORE, BORE.replace("20 um", "192 um")),),
        ("8 um of room around the armature", "8.889 um aside", "touch the iron"),
    ),
    "narrow ring": (
        ((NARROW, NARROW.replace("200", "8")), (", eccentricity: 20 um", "")),
        ("8 um of room around the armature",),
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


@pytest.mark.parametrize(("changes", "words"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_told(changes, words):
    with pytest.raises(InputError) as caught:
        read(*changes)
    for word in words:
        assert word in str(caught.value)
    assert "Try:" in str(caught.value)
