"""The page on warm-up says what the shipped case does; truth: its run and energy balance."""

import re
from pathlib import Path

import pytest

from klack.analyses.heat.run import run_heat
from klack.case.any_case import load_valve_case
from klack.case.reader import shipped_cases

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "warm-up.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def case():
    return load_valve_case(shipped_cases()["warm-valve"])


def rows(first: str) -> list[list[str]]:
    """Rows of the table whose head begins with a word."""
    table = re.search(rf"^\| {first} \|.*\n\|[-| ]+\|\n((?:\|.*\n)+)", PAGE, re.MULTILINE)
    assert table is not None
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table[1].splitlines()]


def number(cell: str) -> float:
    return float(cell.replace("−", "-").split()[0])


@pytest.mark.slow
def test_the_warm_up_of_the_page(case):
    study = run_heat(case)

    stated = rows("time")
    copper, body = (x.values - 273.15 for x in study.temperature[:2])
    numbers = {x.name: x.values for x in (*study.numbers, *study.values)}
    for row, i in ((stated[0], 0), (stated[-1], -1)):
        assert copper[i] == pytest.approx(number(row[1]), abs=0.1)
        assert body[i] == pytest.approx(number(row[2]), abs=0.1)
        assert 1e3 * numbers["closing delay"][i] == pytest.approx(number(row[3]), abs=2e-3)
        assert numbers["first peak at the seat"][i] == pytest.approx(number(row[4]), rel=5e-3)
        assert 1e6 * numbers["rebound"][i] == pytest.approx(number(row[5]), rel=1e-2)
        assert numbers["coil resistance"][i] == pytest.approx(number(row[6]), abs=6e-3)
        assert 1e6 * numbers["stop.gap"][i] == pytest.approx(number(row[7]), abs=0.1)
    assert study.end == "steady"
    heat, off = sum(study.supplied.values()), sum(study.given_off.values())
    assert heat == pytest.approx(off + sum(study.stored.values()), rel=1e-9)
    assert sum(study.unsent.values()) == pytest.approx(22.4, abs=0.1)


@pytest.mark.slow
def test_the_causes_of_the_page(case):
    temperatures = (243.15, 273.15, 333.15, 373.15, 393.15)

    study = run_heat(case, soak=temperatures)

    base = study.causes[0].numbers["closing delay"]
    assert 1e3 * base == pytest.approx(1.479, abs=1e-3)
    found = {
        (row.cause, row.state): 1e6 * (row.numbers["closing delay"] - base)
        for row in study.causes[1:]
    }
    names = ("copper", "viscosity", "density", "gaps", "all")
    states = [f"{T - 273.15:.6g} °C" for T in temperatures]
    for name, row in zip(names, rows("cause"), strict=False):
        for state, cell in zip(states, row[1:], strict=True):
            # half of the last digit, and rounding of other machines
            assert found[name, state] == pytest.approx(number(cell), abs=0.6)
    assert not any("is known from" in text for text in study.warnings)
