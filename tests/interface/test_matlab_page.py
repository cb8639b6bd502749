"""The page about exported models: its example runs, and it names what is there."""

import re
from pathlib import Path

import pytest
from scipy.io import loadmat

PAGE = (Path(__file__).parents[2] / "docs/how-to/export-models.md").read_text(encoding="utf-8")


def test_example_of_the_page(tmp_path, monkeypatch, capsys):
    pytest.importorskip("control")
    (code,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(compile(code, "export-models.md", "exec"), {})
    assert "['force_contact'] ['displacement_contact'" in capsys.readouterr().out
    written = {path.name for path in (tmp_path / "models").iterdir()}
    for name in ("needle_ss.m", "needle_mechss.m", "needle_block.m", "needle_A.txt", "needle.mo"):
        assert name in written
    assert "demo_valve_axisymmetric_pair_law.csv" in written
    p = loadmat("models/demo_valve_axisymmetric_pair.mat", simplify_cells=True)["klack"]
    (table,) = re.findall(r"\| field \| meaning \|\n\|---\|---\|\n(.*?)\n\n", PAGE, re.DOTALL)
    fields = [re.findall(r"`([A-Za-z]\w*)`", row.split("|")[1]) for row in table.splitlines()]
    named = {field for row in fields for field in row}
    assert named - {"contacts"} <= set(p)
    contact = re.search(r"`contacts\{i\}` \(pair\) \| (.*) \|", table)
    for field in re.findall(r"`(\w+)`", contact[1]):
        assert field in p["contacts"] or field == "film_..."
