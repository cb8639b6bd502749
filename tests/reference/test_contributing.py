"""The recipes of CONTRIBUTING.md are done here, step by step, as they stand there.

Truth: the exact answer of what the recipe makes, and the files that the pages name.
"""

import ast
import importlib.util
import re
import sys
from math import exp
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from klack.case.valve_reader import load_valve_case
from klack.errors import InputError
from klack.mesh.files import catalogue as mesh_catalogue
from klack.mesh.files.mesh_file import read_mesh_file
from klack.network import catalogue
from klack.network.network import Network
from klack.simulation.network_run import simulate_network
from klack.verification.lattice import lattice_mesh

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
    entry = ast.literal_eval(line)
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


def medit(mesh) -> str:
    """Text of a Medit file with a mesh in millimetres; its bottom is labelled 5."""
    (block,), (bottom,) = mesh.blocks, mesh.surface("bottom").blocks
    tables = {
        "Vertices": np.column_stack([mesh.points * 1e3, np.zeros(mesh.node_count)]),
        "Tetrahedra": np.insert(block.connectivity + 1, 4, 1, axis=1),
        "Triangles": np.insert(bottom.connectivity + 1, 3, 5, axis=1),
    }
    text = "MeshVersionFormatted 2\nDimension 3\n"
    for name, rows in tables.items():
        lines = "\n".join(" ".join(f"{x:.17g}" for x in row) for row in rows)
        text += f"{name}\n{len(rows)}\n{lines}\n"
    return text + "End\n"


@pytest.fixture
def medit_format(tmp_path, monkeypatch):
    """One folder with a reader, and one line in the catalogue."""
    source, line = blocks("a mesh format", "python")
    call = ast.parse(line, mode="eval").body
    assert isinstance(call, ast.Call)
    entry = mesh_catalogue.MeshFormat(*map(ast.literal_eval, call.args))
    name = f"klack.mesh.files.{entry.path.rpartition('.')[0]}"
    made = module(name, source, tmp_path, monkeypatch)
    parent = ModuleType(name.rpartition(".")[0])
    monkeypatch.setattr(parent, "reader", made, raising=False)
    monkeypatch.setitem(sys.modules, parent.__name__, parent)
    monkeypatch.setattr(mesh_catalogue, "FORMATS", (*mesh_catalogue.FORMATS, entry))
    for ending in entry.endings:
        monkeypatch.setitem(mesh_catalogue.MESH_FORMATS, ending, entry.program)


def test_the_recipe_of_a_mesh_format(medit_format, tmp_path):
    """A body goes out and comes back: the same points, elements and bottom, to the last bit."""
    line = np.array([0.0, 0.3, 1.0]) * 1e-3
    body = lattice_mesh("tet4", [line, 2.0 * line, line])
    file = tmp_path / "body.mesh"
    file.write_text(medit(body))

    model = read_mesh_file(file, 1e-3)

    np.testing.assert_allclose(model.mesh.points, body.points, rtol=1e-15, atol=0.0)
    assert [block.solid for block in model.mesh.blocks] == ["material_1"]
    np.testing.assert_array_equal(model.mesh.blocks[0].connectivity, body.blocks[0].connectivity)
    bottom = model.mesh.surface("surface_5")
    assert bottom.face_count == body.surface("bottom").face_count == 8
    assert set(bottom.nodes) == set(body.surface("bottom").nodes)


@pytest.mark.parametrize("damage", ["Tetrahedra\n48\n", "Vertices\n27\n"])
def test_the_recipe_of_a_mesh_format_refuses_a_damaged_file(damage, medit_format, tmp_path):
    line = np.array([0.0, 0.3, 1.0]) * 1e-3
    whole = medit(lattice_mesh("tet4", [line, line, line]))
    file = tmp_path / "body.mesh"
    file.write_text(whole.split(damage)[0] + damage + "1 2 three")
    assert damage in whole

    with pytest.raises(InputError, match="cut off"):
        read_mesh_file(file, 1e-3)
    with pytest.raises(InputError, match="unit of length"):
        read_mesh_file(file, None)


def test_files_that_the_pages_name_are_there():
    package = ROOT / "src" / "klack"
    named = set(re.findall(r"`([\w/]+\.py)`", ARCHITECTURE + PAGE))
    places = [ROOT, ROOT / "src", package]
    missing = {name for name in named if not any((place / name).exists() for place in places)}

    assert len(named) > 15
    # the recipes make them
    assert missing == {"mechanics/dashpot.py", "mesh/files/medit/reader.py"}


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
