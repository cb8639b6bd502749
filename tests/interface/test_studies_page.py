"""The page about studies: its commands run and print what it shows."""

import re
from pathlib import Path

import pytest
from quoted_output import compare

import klack
from klack.cli.main import main

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
    assert main(["study", made, *asked, str(tmp_path / "made"), "--made", "1024"]) == 0
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
    missed = klack.run_study(case, ROBUST, made=1024).record.missed[0].probability
    assert missed == pytest.approx(0.5, abs=0.05)
    quoted = re.search(r"ends at ([\d.]+) kN, and ([\d.]+) %", PAGE)
    force = next(item for item in record.measures if item.name == "opening.peak_force")
    assert float(quoted[1]) == pytest.approx(force.values[best] / 1e3, abs=0.002)
    assert float(quoted[2]) == pytest.approx(100.0 * missed, abs=1.0)
