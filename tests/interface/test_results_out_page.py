"""The pages about results and FMUs: their examples run, and their words fit the code."""

import re
from collections.abc import Callable
from pathlib import Path
from shutil import copy

import pytest
from ruamel.yaml import YAML

from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.record import ImpactStudy
from klack.case.measurement import CaseMeasurement
from klack.exchange.results.study_table import result_table
from klack.mechanics.imported_fmu import ImportedFmu
from klack.network.declaration import NetworkSection

DOCS = Path(__file__).parents[2] / "docs/how-to"
RESULTS = (DOCS / "export-results.md").read_text()
FMU = (DOCS / "use-an-fmu.md").read_text()
PYTHON = re.findall(r"```python\n(.*?)```", RESULTS, re.DOTALL)


def test_a_stored_result_goes_out_as_the_page_says(
    impact_study: ImpactStudy, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """The page loads a stroke; an impact goes the same way."""
    pytest.importorskip("h5netcdf")
    monkeypatch.chdir(tmp_path)
    IMPACT.save(impact_study, tmp_path / "klack-results/demo-stroke")

    exec(compile(PYTHON[0], "export-results.md", "exec"), {})

    assert (tmp_path / "stroke.nc").is_file()


@pytest.mark.slow
def test_the_film_of_the_page_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)

    exec(compile(PYTHON[1], "export-results.md", "exec"), {})

    assert (tmp_path / "film/demo-valve-axisymmetric_reduced.pvd").is_file()
    assert len(list(tmp_path.glob("film/*/needle_*.vtu"))) == 20


def test_the_functions_of_the_page_exist():
    from importlib import import_module

    named = re.findall(r"`(\w+)\.(write_\w+)`", RESULTS)
    assert len(named) == 5
    for module, function in named:
        assert callable(getattr(import_module(f"klack.exchange.results.{module}"), function))


def test_the_axes_of_the_page_are_those_of_the_table(impact_study: ImpactStudy):
    table = result_table(impact_study)

    assert {axis.name for axis in table.run("reduced").axes} >= {
        "time",
        "time_edge",
        "frequency_needle",
    }
    assert "transfer-needle" in [run.name for run in table.runs]


def test_the_measurement_of_the_page_is_valid():
    (text,) = re.findall(r"```yaml\n(.*?)```", RESULTS, re.DOTALL)

    section = CaseMeasurement.model_validate(YAML(typ="safe").load(text)["measurement"], context={})

    assert section.channels["lift"].name == "wet/needle.tip displacement"


def test_the_network_of_the_page_is_valid(spring_damper_fmu: Callable[..., Path], tmp_path: Path):
    copy(spring_damper_fmu(), tmp_path / "damper.fmu")
    (text,) = re.findall(r"```yaml-part\n(.*?)```", FMU, re.DOTALL)
    context = {"path": tmp_path / "case.yaml", "folder": tmp_path}

    section = NetworkSection.model_validate(YAML(typ="safe").load(text)["network"], context=context)

    part = section.components["damper"]
    assert isinstance(part, ImportedFmu)
    assert part.coupling_step == 1.6e-6
    assert part.parameters == {"k": 1000.0, "c": 2.0}


def test_the_page_lists_every_key():
    keys = re.findall(r"^\| `(\w+)` \|", FMU, re.MULTILINE)

    assert keys == list(ImportedFmu.model_fields)
