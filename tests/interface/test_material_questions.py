"""Materials that no solid has are asked about; truth = handbook values of solids, and usual slips.

Moduli and densities: Kaye and Laby, Tables of Physical and Chemical Constants, 16th ed. (1995).
"""

from pathlib import Path

import pytest

from klack.cli.main import main
from klack.materials import Material

DATA = Path(__file__).parents[1] / "data"
SOLIDS = {  # Pa, kg/m^3
    "steel": (210e9, 7850.0),
    "aluminium": (70e9, 2700.0),
    "lead": (16e9, 11_340.0),
    "tungsten carbide": (620e9, 14_900.0),
    "beryllium": (300e9, 1850.0),
    "sapphire": (430e9, 3980.0),
    "diamond": (1050e9, 3515.0),
    "gold": (78e9, 19_300.0),
    "PTFE": (0.4e9, 2200.0),
    "rubber": (2e6, 1100.0),
}
SLIPS = {
    "MPa for GPa": (210e6, 7850.0),
    "GPa read as Pa": (210.0, 7850.0),
    "g/cm^3 read as kg/m^3": (210e9, 7.85),
    "t/mm^3 and MPa as SI": (2.1e5, 7.85e-9),
    "kg/m^3 read as g/cm^3": (210e9, 7.85e6),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_solids_are_not_questioned(name: str):
    young, density = SOLIDS[name]
    assert Material(name=name, young=young, poisson=0.3, density=density).question is None


@pytest.mark.parametrize("slip", SLIPS)
def test_slips_of_units_are(slip: str):
    young, density = SLIPS[slip]
    asked = Material(name="st", young=young, poisson=0.3, density=density).question
    assert asked is not None
    assert "check both units" in asked


@pytest.mark.slow
def test_such_a_material_is_refused_until_it_is_confirmed_and_then_noted_once(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    text = (DATA / "tiny_rods.yaml").read_text()
    assert "young: 210 GPa" in text
    case = tmp_path / "soft.yaml"
    soft = text.replace("young: 210 GPa", "young: 210 MPa")
    case.write_text(soft)
    assert main(["impact", str(case)]) == 2
    refused = "".join(capsys.readouterr())
    assert "soft.yaml:4: materials.steel: got a Young's modulus of 0.21 GPa at 7850" in refused
    assert "'unusual: true' at the head of the case" in refused

    case.write_text(f"unusual: true\n{soft}")
    assert main(["impact", str(case), "--no-report", "--no-certify"]) == 0

    assert " ".join("".join(capsys.readouterr()).split()).count("would carry waves at 164 m/s") == 1
