"""The example on the page about FMUs runs as the page says."""

from pathlib import Path

import pytest
from c_compiler import needs_compiler
from pages import blocks, printed

from klack.case import find_case, load_case
from klack.exchange.case_models import case_models
from klack.exchange.fmu.build import build_fmu
from klack.exchange.fmu.variables import fmu_variables

pytest.importorskip("fmpy")

PAGE = (Path(__file__).parents[2] / "docs/how-to/export-fmu.md").read_text()
(EXAMPLE,) = blocks(PAGE, "python")


@pytest.fixture(scope="module")
def pair():
    return case_models(load_case(find_case("demo-valve-axisymmetric"))).pair


@pytest.mark.slow
@needs_compiler
def test_example_prints_what_the_page_says(pair, tmp_path, monkeypatch):
    build_fmu(pair, tmp_path / f"{pair.name}.fmu", fmi=2, platforms=("linux64",))
    monkeypatch.chdir(tmp_path)

    assert printed(EXAMPLE, "export-fmu.md").strip() in EXAMPLE


def test_page_names_every_variable(pair):
    for variable in fmu_variables(pair):
        if variable.causality != "local":
            assert f"`{variable.name}`" in PAGE
