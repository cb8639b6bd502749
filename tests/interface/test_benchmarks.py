"""Every part of the benchmarks on its smallest size, so that none of them rots; no time is checked.

Truth: what a number claims beside its time (other programs on the same equations, energy), and the
files that a run leaves.
"""

import json
import shutil
import sys
from collections.abc import Iterator
from importlib import import_module
from math import isfinite
from pathlib import Path
from types import ModuleType

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
LONG = (
    "accuracy",
    "big_body",
    "calculix",
    "demo",
    "full_order",
    "growth",
    "modal_peers",
    "ngsolve_peer",
)
PARTS = (
    *("start_up", "kernel", "modes", "limit", "reduced_peers", "stroke", "many_strokes"),
    "volumes",
    "stroke_off_axis",
    "reduction",
    "study_workers",
    *(pytest.param(name, marks=pytest.mark.slow) for name in LONG),
)


@pytest.fixture(scope="module", autouse=True)
def benchmarks() -> Iterator[None]:
    """The folder on the path; its modules, which have short names, are forgotten afterwards."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        yield
    for path in BENCHMARKS.glob("*.py"):
        sys.modules.pop(path.stem, None)


@pytest.fixture(scope="module")
def run() -> ModuleType:
    return import_module("run")


@pytest.mark.slow
@pytest.mark.parametrize("part", PARTS)
def test_part(part, run):
    if part == "calculix" and shutil.which("ccx") is None:
        pytest.skip("CalculiX (ccx) is not installed")

    numbers = run.measure(part, "smallest")

    names = [number.name for number in numbers]
    assert len(names) > 1
    assert len(set(names)) == len(names)
    for number in numbers:
        assert number.unit, number.name
        # slopes of times that a busy machine has turned round are nan; everything else is a number
        slope = "exponent" in number.name or "kernel" in number.name
        assert isfinite(number.value) or slope, number.name
        assert (number.accuracy is None) == (not number.accuracy_of), number.name
        assert (number.at is None) or number.series, number.name
    _check_what_was_timed(part, {number.name: number for number in numbers})


def _check_what_was_timed(part, numbers):
    beside = {name: number.accuracy for name, number in numbers.items()}
    if part == "ngsolve_peer":  # the same space of functions, two programs
        assert beside["NGSolve over klack: assembly"] < 1e-8
        assert beside["ARPACK of scipy on klack's factor over klack: 5 modes"] < 1e-8
    elif part == "modal_peers":  # one mesh; CalculiX integrates mass with four points
        spread = {name.split(" over ")[0]: error for name, error in beside.items() if error}
        assert spread["SciPy with pypardiso"] < 1e-8
        assert spread.get("CalculiX", 0.0) < 0.1
    elif part == "reduced_peers":  # "at equal accuracy" has to be true
        errors = [error for name, error in beside.items() if error is not None]
        assert errors[0] < 1e-3
        assert max(errors[1:]) <= errors[0]
    elif part == "kernel":
        assert numbers["kernel, 20 ns against 1.25 ns, peak force"].value < 1e-3
        assert numbers["kernel, 20 ns against 1.25 ns, energy residual"].value < 1e-9
    elif part == "calculix":  # a coarse mesh in long steps
        assert beside["CalculiX over klack: impact of the witness"] < 0.15


def test_all_parts_are_tested(run):
    tested = {part if isinstance(part, str) else part.values[0] for part in PARTS}

    assert tested == set(run.PARTS)
    assert all((BENCHMARKS / f"{part}.py").exists() for part in tested)


@pytest.mark.slow
def test_run_leaves_numbers_figures_and_a_page(run, tmp_path, capsys):
    out = tmp_path / "out"

    assert run.main(["--size", "smallest", "--only", "modes", "--out", str(out)]) == 0

    result = json.loads((out / "numbers.json").read_text())
    assert set(result) == {"machine", "size", "parts", "numbers"}
    assert {"commit", "processor", "cores", "versions"} <= set(result["machine"])
    entry = result["numbers"]["kernel, 10 modes, flight"]
    assert entry["unit"] == "ns/step"
    assert entry["accuracy"] < 1e-9  # energy residual
    assert result["numbers"]["part modes: peak memory"]["value"] > 0.05
    assert "| kernel, 10 modes, flight |" in (out / "summary.md").read_text()
    assert "kernel, 10 modes, flight" in capsys.readouterr().out


def test_run_is_laid_beside_a_former_one(run):
    number = import_module("number").Number(name="a", value=3.0, unit="s")
    before = {"numbers": {"a": {"value": 2.0, "unit": "s", "of a later version": 1}}}

    (line,) = run.changes([number], before)

    assert line.split() == ["a", "2", "3", "s", "1.500"]


def test_a_part_that_fails_is_named_and_the_run_goes_on(run, monkeypatch, capsys):
    monkeypatch.setitem(run.PARTS, "no_such_part", "a part without a file")

    assert run.main(["--size", "smallest", "--only", "no_such_part"]) == 1

    assert "failed: " in capsys.readouterr().out


@pytest.mark.slow
def test_page_names_missed_goals_first_and_draws_what_it_can(tmp_path):
    Number = import_module("number").Number
    numbers = [
        Number(name="met", value=1.0, unit="s", goal=2.0),
        Number(name="missed", value=3.0, unit="s", goal=2.0),
        Number(name="at least", value=3.0, unit="-", goal=2.0, at_least=True),
        *(
            Number(name=f"stage {x}", value=x, unit="s", series="stage", at=x, part="growth")
            for x in (1e4, 1e5)
        ),
        Number(name="other over klack", value=0.5, unit="-", series="ratio", part="calculix"),
        Number(name="triad", value=10.0, unit="GB/s", series="bandwidth", at=1e3, part="limit"),
        Number(name="loop", value=5.0, unit="GB/s", series="rate", at=1e3, part="limit"),
    ]
    machine = {
        **{"time": "now", "processor": "p", "cores": 2, "memory_GB": 1, "system": "s"},
        **{"python": "3", "versions": {"klack": "1"}, "commit": "abc", "load": 0},
    }
    result = {
        "machine": machine,
        "size": "quick",
        "parts": {"calculix": {"load": 0, "seconds": 1, "left_out": "no ccx"}},
        "numbers": {number.name: number.entry() for number in numbers},
    }

    import_module("summary").write_summary(tmp_path, result)

    page = (tmp_path / "summary.md").read_text()
    assert page.index("| missed |") < page.index("| met |")
    assert "2 met, 1 missed" in page
    assert {path.name for path in tmp_path.glob("*.svg")} == {
        *("growth.svg", "ratios.svg", "bandwidth.svg"),
    }
