"""Pages of the documentation: their examples run, and they name what is there.

The page about studies: its commands run and print what it shows.

The page about clusters: its trial runs as a script, its recipes are Python.

The page about many points: its examples run and print what it shows.

Truth of its number: the work of the magnet and of the spring, as the page states it.

The page about exported models: its example runs, and it names what is there.

The page about meshes names all endings, and its example is a valid part of a case.

The examples on the page about measured files are read as the page says.

The pages about results and FMUs: their examples run, and their words fit the code.
"""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from math import sqrt
from pathlib import Path
from shutil import copy
from typing import Any

import pytest
from pages import blocks, printed
from quoted_output import compare
from ruamel.yaml import YAML
from scipy.io import loadmat

import klack
from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.record import ImpactStudy
from klack.case.geometry import Geometry
from klack.case.measurement import CaseMeasurement
from klack.cli.main import main
from klack.exchange.results.study_table import result_table
from klack.measurement.files.opening import open_recording
from klack.measurement.find_channels import find_channels
from klack.measurement.read_channels import read_channels
from klack.mechanics.imported_fmu import ImportedFmu
from klack.mesh.files.catalogue import MESH_FORMATS
from klack.network.declaration import NetworkSection

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to" / "studies.md").read_text(encoding="utf-8")
FILE = ROOT / "docs" / "how-to" / "small_study.yaml"
ROBUST = FILE.with_name("small_robust.yaml")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
QUOTED = [block for kind, block in BLOCKS if not kind and "klack " not in block]


def test_the_study_of_the_page_is_the_file_beside_it():
    """All but what the last step of the page adds."""
    shown, _, added, robust, impact, shots = (block for kind, block in BLOCKS if kind == "yaml")
    assert impact == FILE.with_name("impact_study.yaml").read_text(encoding="utf-8")
    assert shots == FILE.with_name("shots_study.yaml").read_text(encoding="utf-8")
    assert robust in ROBUST.read_text(encoding="utf-8")
    left = FILE.read_text(encoding="utf-8")
    for line in (shown + added).splitlines():
        assert line in left
        left = left.replace(line, "", 1)
    assert not left.split()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("place", "command", "design"),
    [
        (0, "study", "sobol"),
        (1, "study", "saltelli"),
        (3, "sensitivities", "sobol"),
        (4, "optimise", "sobol"),
    ],
)
def test_commands_print_what_the_page_shows(tmp_path, capsys, monkeypatch, place, command, design):
    monkeypatch.chdir(ROOT)
    file = tmp_path / "study.yaml"
    file.write_text(FILE.read_text().replace("kind: sobol", f"kind: {design}"))
    case = "docs/how-to/small_valve.yaml"
    kept = [] if command == "sensitivities" else ["--out", str(tmp_path / "out"), "--no-report"]
    kept += ["--no-check-steps"] if design == "saltelli" else []  # 640 strokes, the same numbers
    assert main([command, case, "--study", str(file), *kept]) == 0
    compare(QUOTED[place], capsys.readouterr().out, f"studies.md, block {place}")


@pytest.mark.slow
def test_surrogate_of_the_page(tmp_path, capsys, monkeypatch):
    """Round-off decides which of two close terms it takes: numbers to what its error tells."""
    monkeypatch.chdir(ROOT)
    asked = next(block for kind, block in BLOCKS if kind == "yaml" and "surrogate" in block)
    file = tmp_path / "study.yaml"
    text = FILE.read_text(encoding="utf-8")
    file.write_text(text.replace("  design: {kind: sobol, points: 128}\n", asked), encoding="utf-8")
    case, out = "docs/how-to/small_valve.yaml", str(tmp_path / "out")
    assert main(["study", case, "--study", str(file), "--no-report", "--out", out]) == 0
    told = capsys.readouterr().out
    titles = [line for line in QUOTED[2].splitlines() if line and not line.startswith(" ")]
    assert len(titles) == 2
    for line in titles:
        assert line in told
    _, force = klack.load_result(out).record.surrogates
    assert force.points == 64
    assert 1.0 - force.predictivity < 1e-4
    assert force.error < 0.5  # [N]
    for name, share in zip(force.parameters, force.first, strict=True):
        quoted = re.search(rf"{name} +(\d\.\d+) ", QUOTED[2])
        assert share == pytest.approx(float(quoted[1]), abs=0.003)


@pytest.mark.slow
def test_a_study_of_impacts_prints_what_the_page_shows(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    study = ["--study", "docs/how-to/impact_study.yaml", "--no-report", "--out", str(tmp_path)]
    assert main(["study", "demo-valve-axisymmetric", *study]) == 0
    compare(QUOTED[7], capsys.readouterr().out, "studies.md, impacts")


@pytest.mark.slow
def test_a_study_of_shots_prints_what_the_page_shows(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    study = ["--study", "docs/how-to/shots_study.yaml", "--no-report", "--out", str(tmp_path)]
    assert main(["study", "docs/how-to/guided_needle.yaml", *study]) == 0
    compare(QUOTED[8], capsys.readouterr().out, "studies.md, shots")


@pytest.mark.slow
def test_robust_optimum_and_the_valves_made_after_it(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    out, case = str(tmp_path / "out"), tmp_path / "case"
    asked = ["--study", str(ROBUST), "--no-report", "--out"]
    assert main(["optimise", "docs/how-to/small_valve.yaml", *asked, out]) == 0
    compare(QUOTED[5], capsys.readouterr().out, "studies.md, robust optimum")
    point = re.search(r"Point (\d+)", QUOTED[5])[1]
    assert main(["export", out, "--to", "case", "--point", point, "--out", str(case)]) == 0
    made = str(case / f"small_valve_point_{point}.yaml")
    capsys.readouterr()
    many = ["--made", "1024", "--no-check-steps"]  # the same numbers
    assert main(["study", made, *asked, str(tmp_path / "made"), *many]) == 0
    compare(QUOTED[6], capsys.readouterr().out, "studies.md, made valves")


@pytest.mark.slow
def test_half_of_the_valves_made_after_a_nominal_optimum_miss_its_bound(tmp_path):
    """Truth: counted; an optimum lies on its bound."""
    text = ROBUST.read_text(encoding="utf-8")
    nominal = tmp_path / "nominal.yaml"
    nominal.write_text(text[: text.index("  robust:")], encoding="utf-8")
    valve = ROOT / "docs" / "how-to" / "small_valve.yaml"
    record = klack.optimise(valve, nominal).record
    best, case = record.optimum.best, klack.load_case(valve)
    for item in (*record.parameters, *record.linked):
        if "." in item.name:
            case = case.with_value(item.name, f"{float(item.values[best])!r} {item.unit}")
    case = case.with_value("run.check_steps", "false")  # they are those of the nominal optimum
    missed = klack.run_study(case, ROBUST, made=256).record.missed[0].probability
    assert missed == pytest.approx(0.5, abs=0.05)
    quoted = re.search(r"ends at ([\d.]+) kN, and ([\d.]+) %", PAGE)
    force = next(item for item in record.measures if item.name == "opening.peak_force")
    assert float(quoted[1]) == pytest.approx(force.values[best] / 1e3, abs=0.002)
    assert float(quoted[2]) == pytest.approx(100.0 * missed, abs=1.0)


PAGE_CLUSTER = (ROOT / "docs" / "how-to" / "cluster.md").read_text(encoding="utf-8")
TRIAL, *RECIPES = re.findall(r"```python\n(.*?)```", PAGE_CLUSTER, re.DOTALL)


@pytest.mark.slow
def test_the_trial_prints_what_the_page_shows(tmp_path: Path):
    """In a script of its own: its processes read it again."""
    pytest.importorskip("distributed")
    script = tmp_path / "trial.py"
    script.write_text(
        TRIAL.replace('"small-study"', repr(str(tmp_path / "out"))).replace(
            "threads_per_worker=1", 'threads_per_worker=1, dashboard_address=":0"'
        )
    )
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=ROOT,
        env=os.environ,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    (quoted,) = re.findall(r"```\n(128 points.*?)```", PAGE_CLUSTER, re.DOTALL)
    assert done.stdout == quoted, done.stderr
    assert len(list((tmp_path / "out").glob("points-*.jsonl"))) == 1


def test_the_recipes_hand_a_client_to_a_study():
    assert len(RECIPES) == 2
    for recipe in RECIPES:
        compile(recipe, "cluster.md", "exec")
        assert re.search(r"klack\.run_study\(.*folder=.*dask=client\)", recipe)


PAGE_MANY = (ROOT / "docs" / "how-to" / "many-points.md").read_text(encoding="utf-8")
CODE = blocks(PAGE_MANY, "python")


def test_the_examples_of_the_page(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(ROOT)
    names: dict[str, Any] = {}
    (quoted,) = re.findall(r"```\n(small_valve, .*?)```", PAGE_MANY, re.DOTALL)
    compare(quoted, printed(CODE[0], "many-points.md", names), "many-points.md")

    speeds = dict(
        zip(names["table"][names["preload"]], names["table"]["opening.approach_speed"], strict=True)
    )
    for preload, speed in speeds.items():
        # 0.07 uJ of the spring in the seat come back: 2e-5 of the slowest one
        by_hand = sqrt(2.0 * ((35.0 - preload) * 100e-6 - 50e-6) / 3e-3)
        assert speed == pytest.approx(by_hand, rel=4e-4)
    written = re.search(r"=\n?\s*([\d.]+) m/s", PAGE_MANY)
    assert written is not None
    assert float(written[1]) == pytest.approx(speeds[16.0], abs=1e-4)

    for code in CODE[1:]:
        exec(compile(code, "many-points.md", "exec"), names)
        assert len(names["table"]) == 2
        assert not names["table"].failed.any()


PAGE_MATLAB = (Path(__file__).parents[2] / "docs/how-to/export-models.md").read_text(
    encoding="utf-8"
)


def test_example_of_the_page(tmp_path, monkeypatch, capsys):
    pytest.importorskip("control")
    (code,) = re.findall(r"```python\n(.*?)```", PAGE_MATLAB, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "export-models.md", "exec"), {})
    assert "['force_contact'] ['displacement_contact'" in capsys.readouterr().out
    written = {path.name for path in (tmp_path / "models").iterdir()}
    for name in ("needle_ss.m", "needle_mechss.m", "needle_block.m", "needle_A.txt", "needle.mo"):
        assert name in written
    assert "demo_valve_axisymmetric_pair_law.csv" in written
    p = loadmat("models/demo_valve_axisymmetric_pair.mat", simplify_cells=True)["klack"]
    (table,) = re.findall(
        r"\| field \| meaning \|\n\|---\|---\|\n(.*?)\n\n", PAGE_MATLAB, re.DOTALL
    )
    fields = [re.findall(r"`([A-Za-z]\w*)`", row.split("|")[1]) for row in table.splitlines()]
    named = {field for row in fields for field in row}
    assert named - {"contacts"} <= set(p)
    contact = re.search(r"`contacts\{i\}` \(pair\) \| (.*) \|", table)
    for field in re.findall(r"`(\w+)`", contact[1]):
        assert field in p["contacts"] or field == "film_..."


PAGE_MESH = (Path(__file__).parents[2] / "docs/how-to/bring-a-mesh.md").read_text()


def test_every_ending_is_in_the_table() -> None:
    assert set(re.findall(r"^\| (`\..*?) \|", PAGE_MESH, re.MULTILINE)) >= {"`.inp`", "`.msh`"}
    for ending in MESH_FORMATS:
        assert f"`{ending}`" in PAGE_MESH


def test_the_example_is_valid(tmp_path: Path) -> None:
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE_MESH, re.DOTALL)
    bodies = YAML(typ="safe").load(text)["bodies"]
    assert len(bodies) == 2
    for body in bodies.values():
        name = body["geometry"]["mesh"]["file"]
        (tmp_path / name).write_text("x")
        geometry = Geometry.model_validate(body["geometry"], context={"folder": tmp_path})
        assert geometry.mesh is not None
        assert geometry.mesh.unit == 1e-3


PAGE_MEASURED = (Path(__file__).parents[2] / "docs/how-to/measurement-files.md").read_text()
TABLES = re.findall(r"```csv\n(.*?)```", PAGE_MEASURED, re.DOTALL)
SECTIONS = re.findall(r"```yaml\n(.*?)```", PAGE_MEASURED, re.DOTALL)


def test_the_page_has_its_examples():
    assert len(TABLES) == 3
    assert len(SECTIONS) == 2


@pytest.mark.parametrize("text", TABLES)
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-16"])
def test_tables_are_the_same_measurement(tmp_path, text, encoding):
    (tmp_path / "a.csv").write_text(text, encoding=encoding)
    with open_recording(tmp_path / "a.csv") as recording:
        (found,) = find_channels(recording)
        series = read_channels(recording, found)
    assert series["lift"].step == pytest.approx(1e-5)
    assert series["lift"].values == pytest.approx([2e-8, 5e-8, 4e-8, 31e-8])
    assert series["current"].values == pytest.approx([0, 0.03, 0.06, 0.09])


@pytest.mark.parametrize("text", SECTIONS)
def test_sections_are_valid(text):
    section = CaseMeasurement.model_validate(YAML(typ="safe").load(text)["measurement"], context={})
    assert "lift" in section.channels


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
