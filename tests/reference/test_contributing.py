"""The recipes of CONTRIBUTING.md are done here, step by step, as they stand there.

Truth: the exact answer of what the recipe makes, and the files that the pages name.
"""

import ast
import importlib.util
import json
import re
import subprocess
import sys
from math import exp, pi, radians, tan
from pathlib import Path
from types import ModuleType
from typing import ClassVar

import numpy as np
import pytest

from klack.case.any_case import load_valve_case
from klack.cli.main import main
from klack.errors import InputError
from klack.mechanics.end_stop import EndStop
from klack.mesh.files import catalogue as mesh_catalogue
from klack.mesh.files.mesh_file import read_mesh_file
from klack.network import catalogue
from klack.network.network import Network
from klack.report.wording import quantity
from klack.simulation.network_run import simulate_network
from klack.verification.drivers import linear_coil, run_coil
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


def test_the_recipe_of_a_coil_driver(tmp_path, monkeypatch):
    """One file and one line; without resistance the current has the slopes u/L and the corner.

    Instants of switching are located to 1e-12 of the current.
    """
    source, line = blocks("a coil driver", "python")
    entry = ast.literal_eval(line)
    made = module(entry[1].rpartition(".")[0], source, tmp_path, monkeypatch)
    monkeypatch.setattr(catalogue, "COMPONENTS", (*catalogue.COMPONENTS, entry))
    kind = catalogue.component_class("two-voltages")
    assert kind is made.TwoVoltages
    driver = kind(high=60.0, peak=10.0, low=2.0, start=3e-6, end=150e-6, decay=60.0)

    run = run_coil(
        linear_coil(),
        driver.program(),
        resistance=1e-14,
        gap=1e-4,
        step=1e-6,
        lift=np.zeros(201),
    )

    inductance = 60.0**2 * (1 / 2e7 + 1 / 2e8)  # of linear_coil()
    top = 3e-6 + inductance * 10.0 / 60.0
    assert 10e-6 < top < 140e-6
    end = 10.0 + 2.0 * (150e-6 - top) / inductance
    bends = [0.0, 3e-6, top, 150e-6, 150e-6 + end * inductance / 60.0, 1.0]
    exact = np.interp(run.time, bends, [0.0, 0.0, 10.0, end, 0.0, 0.0])
    np.testing.assert_allclose(run.current, exact, atol=1e-8 * end)


CONE = """
klack: 1
title: A cone that falls on a face
network:
  components:
    needle: {{type: rigid-mass, mass: 3 g, speed: -1 m/s}}
    seat: {{type: end-stop-of-the-recipe, gap: 1 um, {law}}}
  connections: [[needle.body, seat.upper], [seat.lower, ground]]
run: {{duration: 0.2 ms, step: 10 ns, coarse: 1, record: 1 us, variants: [dry]}}
"""


def test_the_recipe_of_a_contact_law(tmp_path, monkeypatch):
    """One class and its name in the union; a mass rebounds from it as by its first integral.

    Truth: ``m v^2 / 2 = K d^3 / 3`` at the turning point.  The peak is a mean over a
    step of h = 10 ns, (h/T)^2 = 4e-8 below it, with T = 49 us of contact and a factor of pi^2/24 to
    pi^2/6.
    """
    (code,) = blocks("a contact law of an end stop", "python")
    (words,) = blocks("a contact law of an end stop", "yaml-part")
    text = (ROOT / "src/klack/mechanics/stop_law.py").read_text(encoding="utf-8")
    text = text.replace("\nStopLaw = ", f"\n{code}\nStopLaw = ").replace(
        "    ConsistentStopLaw | Lin", "    ConeStopLaw | ConsistentStopLaw | Lin"
    )
    text = text.replace("from math import ", "from math import pi, tan, ")
    text = text.replace("from klack.units import ", "from klack.units import Angle, ")
    laws = module("klack.mechanics.stop_law_of_the_recipe", text, tmp_path, monkeypatch)
    name = "klack.mechanics.end_stop_of_the_recipe"
    stop = ModuleType(name)
    stop.Stop = type(
        "Stop",
        (EndStop,),
        {
            "__module__": name,
            "__doc__": EndStop.__doc__,
            "__annotations__": {"type": ClassVar[str], "law": laws.StopLaw},
            "type": "end-stop-of-the-recipe",
        },
    )
    monkeypatch.setitem(sys.modules, name, stop)
    entry = ("end-stop-of-the-recipe", f"{name}.Stop")
    monkeypatch.setattr(catalogue, "COMPONENTS", (*catalogue.COMPONENTS, entry))
    (tmp_path / "case.yaml").write_text(CONE.format(law=words.strip()))

    case = load_valve_case(tmp_path / "case.yaml")
    network = Network(case.network.components, case.network.connections)
    result = simulate_network(network.rows(), duration=0.2e-3, step=10e-9, coarse=1, record=1e-6)

    stiffness = 2.0 * 115e9 / (pi * tan(radians(5.0)))
    depth = (1.5 * 3e-3 / stiffness) ** (1 / 3)
    (event,) = result.events
    assert event.peak_force == pytest.approx(stiffness * depth**2, rel=1e-6)
    assert event.restitution == pytest.approx(1.0, rel=1e-9)
    assert abs(result.books.residual) < 1e-12 * result.books.scale


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


RODS = ROOT / "tests" / "data" / "tiny_rods.yaml"
EVERYWHERE = """
import json
from klack.analyses.catalogue import load_result, analysis_in
from pathlib import Path
from pydantic import TypeAdapter

folder = Path("result")
analysis, record = analysis_in(folder), load_result(folder)
(table, *_) = analysis.told(record)
content = analysis.content(record)
print(json.dumps({
    "told": dict(zip(table.columns, table.rows[0])),
    "json": analysis.to_json(record),
    "answer": content.answer,
    "page": dict(content.numbers.rows),
    "glossary": dict(content.definitions),
    "schema": TypeAdapter(analysis.json).json_schema(),
}))
"""


def python(code: str, folder: Path) -> dict:
    """What a Python of its own prints as the last line, as JSON."""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.slow
def test_the_recipe_of_a_measure(tmp_path, monkeypatch):
    """One entry in one file; then tables, JSON, schema, report and glossary have it."""
    (entry,) = blocks("a measure", "python")
    monkeypatch.chdir(tmp_path)
    words = ["--level", "reduced", "--no-certify", "--no-report", "--out", "result", "-q"]
    assert main(["impact", str(RODS), *words]) == 0
    source = ROOT / "src" / "klack" / "analyses" / "impact" / "measures.py"
    text, end = source.read_text(encoding="utf-8"), ')\n"""In the order of JSON'
    assert text.count(end) == 1
    changed = tmp_path / "measures.py"
    changed.write_text(text.replace(end, f"    {entry.rstrip()},\n{end}"), encoding="utf-8")

    found = python(REPLACED.format(file=str(changed)) + EVERYWHERE, tmp_path)

    level = found["json"]["levels"]["reduced"]
    mean = level["impulse_Ns"] / level["total_contact_time_s"]
    assert level["mean_force_N"] == pytest.approx(mean, rel=1e-12)
    assert found["told"]["mean force [N]"] == f"{mean:.2f}"
    assert found["page"]["mean force"].split() == quantity(mean, "N").split()
    words = found["glossary"]["mean force"]
    assert words == "Impulse over the time from first touch to the end of the last contact."
    described = found["schema"]["$defs"]["LevelJson"]["properties"]["mean_force_N"]
    assert described["description"] == words


REPLACED = """
import sys
from importlib.util import module_from_spec, spec_from_file_location
spec = spec_from_file_location("klack.analyses.impact.measures", {file!r})
sys.modules[spec.name] = module_from_spec(spec)
spec.loader.exec_module(sys.modules[spec.name])
"""
ADDED = """
import klack.analyses
klack.analyses.__path__.append({folder!r})
from klack.analyses import catalogue
from klack.analyses.catalogue import Entry
catalogue.ANALYSES = (*catalogue.ANALYSES, {line})
from klack.cli.main import main
words = ["--out", "result", "--json", "numbers.json", "--no-report"]
assert main(["flight", {case!r}, *words]) == 0
"""


@pytest.mark.slow
def test_the_recipe_of_an_analysis(tmp_path):
    """One folder and one line; then there is a command, and what it leaves behind is read.

    Truth: 3 um at 1.5 m/s are 2 us.
    """
    analysis, command, line = blocks("an analysis", "python")
    folder = tmp_path / "more" / "flight"
    folder.mkdir(parents=True)
    (folder / "__init__.py").write_text("")
    (folder / "analysis.py").write_text(analysis, encoding="utf-8")
    (folder / "command.py").write_text(command, encoding="utf-8")
    case = tmp_path / "rods.yaml"
    text = RODS.read_text(encoding="utf-8")
    case.write_text(
        text.replace("gap: 0 um", "gap: 3 um").replace("speed: 1 m/s", "speed: 1.5 m/s")
    )

    code = ADDED.format(folder=str(folder.parent), line=line.strip(), case=str(case))
    found = python(code + EVERYWHERE, tmp_path)

    assert found["told"] == {"case": "rods", "flight time [us]": "2.000"}
    assert found["json"]["flight_time_s"] == pytest.approx(2e-6, rel=1e-12)
    assert found["json"] == json.loads((tmp_path / "numbers.json").read_text())
    assert found["page"]["flight time"].split() == ["2.000", "µs"]
    assert found["glossary"]["flight time"] == "Gap over speed."
    assert found["schema"]["properties"]["flight_time_s"]["description"] == "Gap over speed."
    assert found["answer"].split() == ["The", "needle", "flies", "for", "2.000", "µs."]


def test_files_that_the_pages_name_are_there():
    package = ROOT / "src" / "klack"
    named = set(re.findall(r"`([\w/]+\.py)`", ARCHITECTURE + PAGE))
    places = [ROOT, ROOT / "src", package]
    missing = {name for name in named if not any((place / name).exists() for place in places)}

    assert len(named) > 15
    # the recipes make them
    assert missing == {
        "magnetics/two_voltages.py",
        "mechanics/dashpot.py",
        "mesh/files/medit/reader.py",
        "flight/analysis.py",
        "flight/command.py",
    }


def test_names_that_stand_after_a_file_are_made_there():
    """A name after a file is made in that file: ``file``, ``name``."""
    pairs = re.findall(r"`([\w/]+\.py)`,\s+`(\w+)", ARCHITECTURE)

    assert len(pairs) >= 6
    for file, name in pairs:
        text = (ROOT / "src" / "klack" / file).read_text(encoding="utf-8")
        assert re.search(rf"^(?:(?:class|def) {name}\b|{name}\b.* = )", text, re.MULTILINE), (
            file,
            name,
        )


@pytest.mark.parametrize("folder", ["exact", "convergence", "conservation", "reference", "cli"])
def test_folders_of_tests_are_explained(folder):
    assert (ROOT / "tests" / folder).is_dir()
    assert f"`tests/{folder}`" in PAGE
