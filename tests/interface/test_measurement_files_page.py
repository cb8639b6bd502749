"""The examples on the page about measured files are read as the page says."""

import re
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from klack.case.measurement import CaseMeasurement
from klack.measurement.find_channels import find_channels
from klack.measurement.read_channels import read_channels
from klack.measurement.recording import open_recording

PAGE = (Path(__file__).parents[2] / "docs/how-to/measurement-files.md").read_text()
TABLES = re.findall(r"```csv\n(.*?)```", PAGE, re.DOTALL)
SECTIONS = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)


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
