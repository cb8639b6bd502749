"""The recipes of CONTRIBUTING.md are done here, step by step, as they stand there.

Truth: the exact answer of what the recipe makes, and the files that the pages name.
"""

import ast
import importlib.util
import re
import sys
from math import exp
from pathlib import Path

import pytest

from klack.case.valve_reader import load_valve_case
from klack.network import catalogue
from klack.network.network import Network
from klack.simulation.network_run import simulate_network

pytestmark = pytest.mark.filterwarnings("ignore::klack.network.checks.LooseBodyWarning")

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
ARCHITECTURE = (ROOT / "docs" / "project" / "architecture.md").read_text(encoding="utf-8")


def blocks(recipe: str, language: str) -> list[str]:
    """Code of a recipe, without the indent of the list that it stands in."""
    section = PAGE.split(f"## Recipe: {recipe}\n")[1].split("\n## ")[0]
    found = re.findall(rf"^( *)```{language}\n(.*?)^ *```$", section, re.DOTALL | re.MULTILINE)
    return [re.sub(rf"^{indent}", "", code, flags=re.MULTILINE) for indent, code in found]


def module(name: str, source: str, folder: Path, patch: pytest.MonkeyPatch):
    """The code of a recipe as the module that it would be in klack."""
    file = folder / f"{name.rsplit('.')[-1]}.py"
    file.write_text(source, encoding="utf-8")
    spec = importlib.util.spec_from_file_location(name, file)
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    patch.setitem(sys.modules, name, made)
    spec.loader.exec_module(made)
    return made


CASE = """
klack: 1
title: A needle in a dashpot
network:
  components:
    needle: {{type: rigid-mass, mass: 3 g, speed: 1 m/s}}
    {line}
  connections:
    - [needle.body, damper.body]
run: {{duration: 2 ms, step: 0.2 us, coarse: 1, record: 10 us, variants: [dry]}}
"""


def test_the_recipe_of_a_component(tmp_path, monkeypatch):
    """One file and one line; then 3 g slow down by exp(-c t/m), to order (h c/m)^2 = 2e-8."""
    source, line = blocks("a component", "python")
    (words,) = blocks("a component", "yaml-part")
    entry = ast.literal_eval(f"({line})")[0]
    module(entry[1].rpartition(".")[0], source, tmp_path, monkeypatch)
    monkeypatch.setattr(catalogue, "COMPONENTS", (*catalogue.COMPONENTS, entry))
    (tmp_path / "case.yaml").write_text(CASE.format(line=words.strip()))

    case = load_valve_case(tmp_path / "case.yaml")
    network = Network(case.network.components, case.network.connections)
    result = simulate_network(
        network.rows(), duration=2e-3, step=200e-9, coarse=1, record=10e-6, start="free"
    )

    assert case.network.components["damper"].damping == 2.0
    speed = result.channels["needle velocity"].values[-1]
    assert speed == pytest.approx(exp(-2.0 * 2e-3 / 3e-3), rel=1e-7)
    assert result.books.relative_residual < 1e-12


def test_files_that_the_pages_name_are_there():
    package = ROOT / "src" / "klack"
    named = set(re.findall(r"`([\w/]+\.py)`", ARCHITECTURE + PAGE))
    places = [ROOT, ROOT / "src", package]
    missing = {name for name in named if not any((place / name).exists() for place in places)}

    assert len(named) > 15
    assert missing == {"mechanics/dashpot.py"}  # the recipe makes it


def test_names_of_the_way_of_a_load_pattern_are_where_the_page_says():
    """A name after a file is made in that file: ``file``, ``name``."""
    pairs = re.findall(r"`([\w/]+\.py)`,\s+`(\w+)", ARCHITECTURE)

    assert len(pairs) >= 6
    for file, name in pairs:
        text = (ROOT / "src" / "klack" / file).read_text(encoding="utf-8")
        assert re.search(rf"^(?:class|def) {name}\b", text, re.MULTILINE), (file, name)


@pytest.mark.parametrize("folder", ["exact", "convergence", "conservation", "reference", "cli"])
def test_folders_of_tests_are_explained(folder):
    assert (ROOT / "tests" / folder).is_dir()
    assert f"`tests/{folder}`" in PAGE
