"""klack stroke --steady through main(argv).

Truth: the spring of a small valve by hand, the force of one magnetic gap, and the words that are
promised for what cannot be.
"""

import csv
import json
import re
from math import pi
from pathlib import Path

import pytest
from quoted_output import compare

from klack.analyses.operating_point.analysis import OPERATING_POINT
from klack.cli.main import main

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
CASE = (HOW_TO / "held_open.yaml").read_text(encoding="utf-8")


@pytest.fixture(autouse=True)
def _case():
    Path("valve.yaml").write_text(CASE)


def stroke(*words: str) -> int:
    return main(["stroke", "valve.yaml", *words])


def test_one_point_is_a_table_a_file_and_numbers(capsys):
    assert stroke("--steady", "--current", "1 A", "--json", "numbers.json", "--no-report") == 0

    told = capsys.readouterr().out
    for words in (
        "Operating point, dry: coil at 1 A",
        "static stiffness",
        "forces on each free body",
    ):
        assert words in told
    numbers = json.loads(Path("numbers.json").read_text())
    found = {(x["component"], x["quantity"]): x for x in numbers["quantities"]}
    pull = 4e-7 * pi * pi * 3e-3**2 * 100.0**2 / (2.0 * 150e-6**2)
    force = found["coil", "armature force"]
    assert force["unit"] == "N"
    assert force["values"][0] == pytest.approx(pull, rel=1e-3)  # the seat gives way a little
    assert numbers["residuals"]["force_N"][0] < 1e-10
    assert numbers["current_A"] == {"coil": 1.0}
    folder = Path("klack-results/valve-steady")
    rows = list(csv.reader((folder / "operating-point.csv").open()))
    assert rows[0] == ["component", "quantity", "value", "unit"]
    assert ["coil", "current", "1.0", "A"] in rows
    stored = OPERATING_POINT.load(folder)
    assert stored.quantity("coil current").values.tolist() == [1.0]
    assert stored.swept == ()


def test_a_sweep_leaves_curves_and_a_report(capsys):
    words = ("--sweep", "lift", "0 um", "90 um", "4", "--sweep", "current", "0 A", "2 A", "3")
    assert stroke("--steady", *words, "--show", "coil armature force", "--out", "out") == 0

    assert "12 points" in capsys.readouterr().out
    names = {path.name for path in Path("out").iterdir()}
    assert {"coil-armature-force-over-lift.svg", "coil-armature-force-over-lift.png"} <= names
    assert {"operating-point.csv", "report.html", "report.pdf", "result.zarr"} <= names
    rows = list(csv.DictReader(Path("out/operating-point.csv").open()))
    assert len(rows) == 12
    assert float(rows[5]["lift [m]"]) == pytest.approx(30e-6)
    assert float(rows[5]["current [A]"]) == 1.0
    assert "Characteristic curves" in Path("out/report.html").read_text()


def test_the_far_point_is_told_and_asked_for(capsys):
    assert stroke("--steady", "--voltage", "coil=3.2 V", "--from", "far", "--no-report") == 0

    told = capsys.readouterr().out
    assert "Note: more than one operating point: 'needle.tip' at 100.2 um here" in told


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--current", "1 A"), "--current: got a value without --steady"),
        (("--steady", "--over", "coil force"), "--over: got a value without --sweep"),
        (("--steady", "--duration", "1 ms"), "--duration: got a value together with --steady"),
        (("--steady", "--current", "1"), "unit"),
        (("--steady", "--current", "-1 A"), "got -1 A, expected 0 A or more"),
        (("--steady", "--lift", "-1 mm"), "got -1 mm, expected"),
        (("--steady", "--sweep", "lift", "-90 um", "0 um", "1"), "2 or more"),
        (("--steady", "--variant", "dry,dry"), "2 variants together with --steady"),
        (("--steady", "--sweep", "lift", "0 um", "90 um", "1"), "2 or more"),
        (("--steady", "--sweep", "lift", "0 um", "90 um", "3", "--show", "coil"), "did you mean"),
    ],
)
def test_what_cannot_be_is_one_message(words, said, capsys):
    assert stroke(*words) == 2

    assert said in capsys.readouterr().err


@pytest.mark.slow
def test_the_page_quotes_what_is_printed(capsys):
    """The table, the note, and the currents between which the needle lifts and drops."""
    page = (HOW_TO / "operating-point.md").read_text(encoding="utf-8")
    table, note = re.findall(r"```\n((?:component|Note).*?)```", page, re.DOTALL)

    assert stroke("--steady", "--current", "1.6 A", "--no-report") == 0
    printed = capsys.readouterr().out
    compare(table, printed, "operating-point.md")
    compare(note, printed, "operating-point.md")
    open_at = {}
    for origin in ("start", "far"):
        words = ("--sweep", "current", "0.5 A", "2.5 A", "9", "--from", origin, "--out", origin)
        assert stroke("--steady", *words, "--no-report") == 0
        is_open = {
            float(row["current [A]"]): float(row["needle tip displacement [m]"]) > 50e-6
            for row in csv.DictReader(Path(origin, "operating-point.csv").open())
        }
        open_at[origin] = min(current for current, opened in is_open.items() if opened)
    assert open_at == {"start": 2.0, "far": 0.75}
    assert "lifts between 1.75 A and 2 A" in " ".join(page.split()).replace("needle lifts", "lifts")
    assert "stays open down to 0.75 A" in " ".join(page.split())


def test_a_sweep_that_fits_no_point_is_an_error_of_the_input(capsys):
    sweep = ("--sweep", "current", "0 A", "1 A", "2")
    assert main(["stroke", str(HOW_TO / "relief_on_pipe.yaml"), "--steady", *sweep]) == 2

    assert "--current: got a valve without a coil" in capsys.readouterr().err
    assert not Path("klack-results").exists()
