"""The commands of "Start in ten minutes" run, and the numbers quoted there are theirs.

Truth: the page; its numbers are our own stored output, so this detects a change and no more.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from klack.analyses.impact.analysis import IMPACT

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "start.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def run(commands: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run the lines of a block in a shell whose ``klack`` is the one under test."""
    program = f'klack() {{ "{sys.executable}" -m klack "$@"; }}\n'
    return subprocess.run(
        ["bash", "-c", f"set -e\n{program}{commands}"],
        cwd=folder,
        env={**os.environ, "NO_COLOR": "1", "COLUMNS": "200"},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_the_commands_run_and_give_the_quoted_numbers(tmp_path):
    (tmp_path / "cases").symlink_to(ROOT / "cases")
    first, own = blocks("sh")

    done = run(first, tmp_path)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "klack-results" / "demo-valve-axisymmetric"
    assert {"report.html", "report.pdf", "result.zarr"} <= {file.name for file in folder.iterdir()}
    which = r"(?: \(contact \d of \d\))?"
    row = rf"^([a-z-]+) +([\d.]+){which} +([\d.]+){which} +([\d.]+) +([\d.]+) "
    rows = re.findall(row, PAGE, re.MULTILINE)
    study = IMPACT.load(folder)
    assert {row[0] for row in rows} == set(study.levels)
    for level, peak, time, impulse, restitution in rows:
        measures = study.levels[level].measures
        # the last digits may differ with the version of the mesher
        assert measures.peak_force == pytest.approx(float(peak), rel=2e-3)
        assert measures.impulse * 1e3 == pytest.approx(float(impulse), rel=1e-3)
        assert measures.restitution == pytest.approx(float(restitution), abs=1e-3)
        if level != "reduced-attachment":  # it chatters
            assert measures.contact_time * 1e6 == pytest.approx(float(time), rel=5e-3)

    done = run(own, tmp_path)
    assert done.returncode == 0, done.stderr
    quoted = re.search(r"At 0\.5 m/s the peak is ([\d.]+) N", PAGE)
    assert quoted is not None
    numbers = json.loads((tmp_path / "numbers.json").read_text())["levels"]["reduced"]
    assert numbers["peak_force_N"] == pytest.approx(float(quoted[1]), rel=2e-3)

    done = run(blocks("sh-fails")[0], tmp_path)
    assert done.returncode == 2
    message = re.search(r"```\n(klack impact: my-valve.*?)```", PAGE, re.DOTALL)
    assert message is not None
    assert message[1].split() == done.stderr.split()


def test_every_command_of_the_page_exists():
    from klack.cli.commands import parser

    for name in set(re.findall(r"`klack (\w+)", PAGE)):
        parser[name]
