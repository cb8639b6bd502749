"""The page of all checks says what the code checks; truth: names, tolerances, sources in the code.

The numbers on the page come from one run.  All its rows are compared with a run of all checks in
CI, by ``docs/conformance_page.py --check``; here what that comparison finds, in a group that takes
no time.
"""

import json
import re
import sys
from pathlib import Path

import pytest

from klack.cli.main import main
from klack.verification import COVERS, GROUPS

DOCS = Path(__file__).parents[2] / "docs"
TEXT = (DOCS / "reference" / "conformance.md").read_text(encoding="utf-8")
GROUP = "spectra"


@pytest.fixture(scope="module")
def script():
    sys.path.insert(0, str(DOCS))
    try:
        import conformance_page
    finally:
        sys.path.remove(str(DOCS))
    return conformance_page


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Of the checks of one group, as ``klack verify`` writes it."""
    file = tmp_path_factory.mktemp("run") / "checks.json"
    assert main(["verify", "--group", GROUP, "--quiet", "--json", str(file)]) == 0
    return json.loads(file.read_text())


@pytest.fixture
def section():
    """What the page has of this group."""
    found = re.search(rf"^## {GROUP}$.*?(?=^## |\Z)", TEXT, re.M | re.S)
    assert found is not None
    return found[0]


def test_page_has_every_group_and_what_it_covers():
    titles = re.findall(r"^## (.*)\n\n(.*)$", TEXT, re.M)

    assert dict(titles) == {group: COVERS[group] for group in GROUPS}


def test_page_lists_the_checks_of_a_run(script, run, section):
    assert script.differences(section, run) == []
    assert len(script.listed(section)) == len(run["checks"]) > 0


def test_what_the_page_lacks_or_has_alone_is_found(script, run, section):
    rows = [line for line in section.splitlines() if line.startswith("| ")]
    name = rows[1][2:].split(" | ")[0]

    assert script.differences(section.replace(rows[1] + "\n", ""), run) == [
        f"not on the page: {GROUP}: {name}"
    ]
    more = section.replace(rows[1], rows[1] + "\n" + rows[1].replace(name, "another one"))
    assert script.differences(more, run) == [f"only on the page: {GROUP}: another one"]


def test_a_solver_that_is_not_installed_may_stand_on_the_page_alone(script, run, section):
    rows = [line for line in section.splitlines() if line.startswith("| ")]
    name = rows[1][2:].split(" | ")[0]
    more = section.replace(rows[1], rows[1] + "\n" + rows[1].replace(name, "direct solver of it"))

    assert script.differences(more, run) == []


@pytest.mark.parametrize("changed", [("tolerance", 0.5), ("source", "a book"), ("reason", "so")])
def test_another_tolerance_or_source_is_found(script, run, section, changed):
    key, value = changed
    first = {**run["checks"][0], key: value}
    found = script.differences(section, {**run, "checks": [first, *run["checks"][1:]]})

    assert [line.partition(": the page has")[0] for line in found] == [
        f"{GROUP}: {script.plain(first['name'])}"
    ]
