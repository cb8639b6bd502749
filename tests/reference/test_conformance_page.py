"""The page of all checks says what the code checks; truth: names, tolerances, sources in the code.

The numbers on the page come from one run and are made anew in CI; here only what must not differ
between machines is compared.  Groups that take long are marked so; ``exchange`` is held to its own
page, which has its own test.
"""

import re
import sys
from pathlib import Path

import pytest
from energy_ledger import allowed

from klack.verification import COVERS, GROUPS, Check, run_checks

DOCS = Path(__file__).parents[2] / "docs"
PAGE = DOCS / "reference" / "conformance.md"
LONG = (
    "elasticity",
    "contact",
    "transient",
    "interface",
    "sound",
    "measurement",
    "measured",
    "plasticity",
    "friction",
    "films",
    "drivers",
)
# passed over where a solver is not installed
OPTIONAL = re.compile("direct solver ")


@pytest.fixture(scope="module")
def plain():
    sys.path.insert(0, str(DOCS))
    try:
        from conformance_page import plain
    finally:
        sys.path.remove(str(DOCS))
    return plain


def listed(group: str) -> dict[str, tuple[str, str]]:
    """Name -> tolerance and source of the rows of one group."""
    text = PAGE.read_text(encoding="utf-8")
    section = re.search(rf"^## {group}$(.*?)(?=^## |\Z)", text, re.M | re.S)
    assert section is not None, f"no table of {group}"
    lines = [line for line in section[1].splitlines() if line.startswith("| ")]
    rows = [re.split(r"(?<!\\) \| ", line[2:-2]) for line in lines[1:]]
    assert rows
    assert all(len(row) == 7 for row in rows)
    return {row[0]: (row[4], row[6]) for row in rows}


def written(check: Check, plain) -> tuple[str, str]:
    reason = f"; *{plain(check.reason)}*" if check.reason else ""
    return f"{check.tolerance:.1e}" if check.tolerance else "0", plain(check.source) + reason


@pytest.mark.parametrize(
    "group",
    [
        pytest.param(group, marks=pytest.mark.slow) if group in LONG else group
        for group in GROUPS
        if group != "exchange"
    ],
)
def test_page_lists_the_checks_of_a_group(group, plain):
    # the order of an error is seen in steps of 400 ns: forces that settle to 1 pm leave 4e-8
    with allowed("simulate_network", 1e-7):
        checks = run_checks([group])
    rows = listed(group)

    assert [check.name for check in checks if not check.passed] == []
    assert {plain(check.name): written(check, plain) for check in checks}.items() <= rows.items()
    missing = set(rows) - {plain(check.name) for check in checks}
    assert [name for name in missing if not OPTIONAL.match(name)] == []


def test_page_lists_what_the_page_of_round_trips_lists(plain):
    rows = re.findall(
        r"^\| (.*) \| [^|]+ \| ([^|]+) \|$",
        (DOCS / "reference" / "exchange.md").read_text(encoding="utf-8"),
        re.M,
    )
    theirs = {plain(name): allowed for name, allowed in rows if allowed[0].isdigit()}

    ours = {name: f"{float(allowed):.0e}" for name, (allowed, _) in listed("exchange").items()}

    assert len(theirs) > 30
    assert ours == theirs


def test_page_has_every_group_once_with_its_sentence():
    text = PAGE.read_text(encoding="utf-8")

    assert re.findall(r"^## ([\w-]+)$", text, re.M) == list(GROUPS)
    assert all(sentence in text for sentence in COVERS.values())
    assert "FAILED" not in text
