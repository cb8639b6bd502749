"""The page that compares the levels quotes what klack computes.

Truth: the page; its numbers are our own stored output, so this detects a change and no more.
The solid valve on the same page takes minutes and is not repeated here.
"""

import re
from pathlib import Path

import pytest

from klack.analyses.impact.run import run_impact
from klack.case import find_case, load_case
from klack.case.levels import LEVELS

PAGE = Path(__file__).parents[2] / "docs" / "theory" / "levels.md"


def number(cell: str) -> float:
    value = float(cell.split()[0])
    return value / 100.0 if cell.endswith("%") else value


@pytest.mark.slow
def test_the_axisymmetric_table_is_what_the_levels_give():
    text = PAGE.read_text(encoding="utf-8")
    table = text.split("**Axisymmetric**")[1].split("**Solid, centred**")[0]
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in table.splitlines()
        if line.startswith("| `")
    ]
    study = run_impact(
        load_case(find_case("demo-valve-axisymmetric")), levels=LEVELS, certify=False
    )
    full = study.levels["full"].measures
    said = re.search(r"full order: ([\d.]+) N, ([\d.]+) us", table)

    assert said is not None
    # the last digits may differ with the version of the mesher
    assert full.peak_force == pytest.approx(float(said[1]), rel=2e-3)
    assert full.contact_time * 1e6 == pytest.approx(float(said[2]), rel=2e-3)
    assert {row[0].strip("`") for row in rows} == set(LEVELS) - {"full"}
    for level, peak, time, impulse, restitution, history, bands in rows:
        computed = study.deviations[level.strip("`")]
        # as many digits as are printed; 0.03 % for the mesher
        near = {"rel": 0.03, "abs": 3e-4}
        assert computed.peak_force == pytest.approx(number(peak), **near)
        if time != "chatters":
            assert computed.contact_time == pytest.approx(number(time), **near)
        assert computed.impulse == pytest.approx(number(impulse), **near)
        assert computed.restitution == pytest.approx(number(restitution), **near)
        assert computed.history_l2 == pytest.approx(number(history), **near)
        assert computed.third_octave_max_dB == pytest.approx(number(bands), rel=0.03, abs=0.2)


def test_every_level_has_its_line_and_its_variants():
    text = PAGE.read_text(encoding="utf-8")

    for level in LEVELS:
        assert f"| `{level}` |" in text
