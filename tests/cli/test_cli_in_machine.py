"""A shipped valve in its machine through main(argv): tables, JSON, sounds, files, stored results.

Truth: power of all parts, the blocked force of the source, two ways to one exposure (spectrum and
time), the same from a stored stroke, and a softer joint that is quieter.
"""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from klack.acoustics.source_files import read_source
from klack.analyses.noise.analysis import NOISE
from klack.analyses.noise.content import noise_content
from klack.case.reader import find_case
from klack.cli.main import main

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Stroke of the case to 1.5 ms past the end of its drive; the same valve on a rubber ring."""
    folder = tmp_path_factory.mktemp("machine")
    text = find_case("demo-mounted").read_text(encoding="utf-8").replace("12 ms", "4 ms")
    (folder / "rigid.yaml").write_text(text, encoding="utf-8")
    soft = "  elements: {flange: {stiffness: {z: 1 N/um}, damping: {z: 20 N*s/m}}}\n  receiver:"
    (folder / "soft.yaml").write_text(text.replace("  receiver:", soft), encoding="utf-8")
    words = ["-q", "--no-report", "--out", str(folder / "stroke")]
    assert main(["stroke", str(folder / "rigid.yaml"), *words]) == 0
    return folder


@pytest.fixture(scope="module")
def told(folder: Path) -> dict:
    """JSON of the noise of the stored stroke, with a virtual test and a report."""
    words = ["--virtual-test", "--json", str(folder / "a.json"), "-q", "--out", str(folder / "a")]
    assert main(["noise", str(folder / "stroke"), *words]) == 0
    return json.loads((folder / "a.json").read_text(encoding="utf-8"))


def test_numbers_of_the_machine(told: dict) -> None:
    """Balance at every line, shares that make one, a test that finds the source again."""
    machine = told["machine"]
    assert machine["balance"] <= 1e-9
    assert machine["energy_J"] > 0.0
    assert machine["energy_J"] == pytest.approx(told["support_energy_J"], rel=1e-12)
    z = machine["freedoms"]["flange.z"]
    assert z["energy_into_machine_J"] == pytest.approx(machine["energy_J"], rel=1e-3)
    assert np.sum(z["energy_J"]) == pytest.approx(z["energy_into_machine_J"], rel=0.05)
    assert z["blocked_force_beside_level_dB"] > z["force_on_machine_level_dB"]
    paths = machine["ears"]["listener"]["paths"]
    assert sum(path["path_share"] for path in paths.values()) == pytest.approx(1.0, rel=1e-9)
    test = machine["virtual_test"]
    assert test["deviation"] < 1e-9
    found = test["freedoms"]["flange.z"]
    assert found["blocked_force_in_situ_level_dB"] == pytest.approx(
        found["blocked_force_of_source_level_dB"], abs=1e-6
    )
    # the same exposure by lines of the spectrum, and over time
    ear = machine["ears"]["listener"]
    assert ear["ear_exposure_level_dBA"] == pytest.approx(told["sound_exposure_level_dBA"], abs=0.1)
    assert ear["loudness_max_sone"] == told["loudness_max_sone"]
    assert 0.01 < machine["motion_ratio"] < 1.0
    assert any("of the speed of its needle" in text for text in told["warnings"])
    assert any(text.startswith("flange.x, flange.y, flange.rz: ") for text in told["warnings"])


def test_files_and_report_of_the_machine(folder: Path, told: dict) -> None:
    """The source as it was, sounds to one scale, the section of the report."""
    assert told["machine"] is not None
    for name in ("click.wav", "pattern.wav", "source.uff", "report.html", "report.pdf"):
        assert (folder / "a" / name).stat().st_size > 0
    study = NOISE.load(folder / "a")
    source = study.reference.at_mounts.source()
    again = read_source(folder / "a" / "source.nc")
    assert again.freedoms == source.freedoms
    for name in ("frequency", "free_velocity", "blocked_force", "mobility"):
        assert np.array_equal(getattr(again, name), getattr(source, name))
    content = noise_content(study)
    (section,) = [part for part in content.sections if part.title == "In the machine"]
    assert [chart.name for chart in section.charts] == [
        "machine-force", "machine-energy", "paths-listener", "paths",
    ]  # fmt: skip
    assert len(section.tables) == 3
    assert "At 'listener' one click" in content.answer


def test_two_designs_in_one_machine(folder: Path, told: dict, capsys) -> None:
    """The case itself, without a stored stroke, beside the valve on a rubber ring."""
    words = ["--json", str(folder / "b.json"), "--no-report", "--out", str(folder / "b")]
    cases = [str(folder / f"{name}.yaml") for name in ("rigid", "soft")]
    assert main(["noise", *cases, *words]) == 0
    both = json.loads((folder / "b.json").read_text(encoding="utf-8"))["designs"]
    rigid, soft = both["rigid"], both["soft"]
    assert rigid["sound_exposure_level_dBA"] == pytest.approx(
        told["sound_exposure_level_dBA"], abs=1e-6
    )
    assert rigid["machine"]["energy_J"] == pytest.approx(told["machine"]["energy_J"], rel=1e-9)
    assert soft["sound_exposure_level_dBA"] < rigid["sound_exposure_level_dBA"] - 6.0
    assert soft["machine"]["element_loss_J"] > 0.0
    assert soft["machine"]["balance"] <= 1e-9
    printed = capsys.readouterr().out
    assert re.search(r"^ *soft - ", printed, re.MULTILINE)
    assert "rigid: Paths to the ears" in printed
    assert {path.name for path in (folder / "b").glob("*.wav")} == {
        f"{what}-{name}.wav" for what in ("click", "pattern") for name in ("rigid", "soft")
    }


def test_a_test_without_a_machine(folder: Path, capsys) -> None:
    """One error and exit code 2; so has a machine that is not known everywhere."""
    assert main(["noise", "demo-valve-axisymmetric", "--virtual-test", "-q"]) == 2
    assert "a virtual test without a machine" in capsys.readouterr().err
    text = (folder / "rigid.yaml").read_text(encoding="utf-8")
    (folder / "broken.yaml").write_text(text.replace(", flange.rz: blocked", ""), encoding="utf-8")
    assert main(["noise", str(folder / "broken.yaml"), "-q"]) == 2
    error = capsys.readouterr().err
    assert "no response of the receiver at flange.rz" in error
    assert "blocked" in error
