"""A fluid from a file of properties. Truth: the rows of the file, equations of state, identities.

tests/data/fluid_dodecane.csv: n-dodecane, 0 to 100 degC and 1 to 500 bar (its head names the
sources).
"""

from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.integrate import quad

from klack.errors import AccuracyWarning, InputError
from klack.hydraulics.fluid_choice import FluidChoice
from klack.hydraulics.property_table import read_property_table

DATA = Path(__file__).parents[1] / "data"
TEXT = (DATA / "fluid_dodecane.csv").read_text()
HEAD = "temperature [degC], pressure [bar], density [kg/m^3], dynamic viscosity [mPa*s]"
ROWS = "20, 1, 749, 1.5\n20, 100, 756, 1.7\n"


def read(table, folder=DATA, **more) -> FluidChoice:
    return FluidChoice.model_validate({"table": table, **more}, context={"folder": folder})


def problem(folder: Path, text: str) -> str:
    (folder / "mine.csv").write_text(text)
    with pytest.raises(ValidationError) as caught:
        read("mine.csv", folder)
    return str(caught.value.errors()[0]["ctx"]["error"])


def test_a_file_next_to_the_case_is_a_fluid():
    fluid = read("fluid_dodecane.csv").at(313.15)
    assert fluid.name == "fluid_dodecane"
    # row of 40 degC and 1 bar
    row = [
        float(x) for x in next(x for x in TEXT.splitlines() if x.startswith("40, 1,")).split(",")
    ]
    assert float(fluid.density(1e5)) == pytest.approx(row[2], rel=1e-12)
    assert float(fluid.sound_speed(1e5)) == pytest.approx(row[3], rel=1e-12)
    assert float(fluid.viscosity(1e5)) == pytest.approx(1e-3 * row[4], rel=2e-2)  # exponential
    assert fluid.vapour_pressure == pytest.approx(row[5], rel=1e-12)


@pytest.mark.parametrize(
    ("kelvin", "speed"), [(303.15, 1260.937), (343.15, 1110.330)]
)  # CoolProp 8.0.0 at 1 bar, between the rows
def test_between_its_temperatures_it_is_smooth(kelvin, speed):
    fluid = read("fluid_dodecane.csv").at(kelvin)
    assert float(fluid.sound_speed(1e5)) == pytest.approx(speed, rel=1e-5)  # of the cubic


def test_density_and_stiffness_belong_together():
    liquid = read("fluid_dodecane.csv").at(303.15).liquid
    p = np.linspace(1e5, 700e5, 400)
    assert np.all(np.diff(liquid.density(p)) > 0.0)
    places = [x for x in liquid.kinks if 1e5 < x < 480e5]
    strain = quad(lambda x: 1.0 / float(liquid.bulk_modulus(x)), 1e5, 480e5, points=places)[0]
    ratio = float(liquid.density(480e5) / liquid.density(1e5))
    assert np.log(ratio) == pytest.approx(strain, rel=1e-9)
    speed = np.sqrt(liquid.bulk_modulus(p) / liquid.density(p))
    assert np.all(np.diff(speed[p < 500e5]) > 0.0)


def test_its_range_is_stated_and_other_temperatures_are_refused():
    choice = read("fluid_dodecane.csv")
    known = choice.at(313.15).pressure_range
    assert 500e5 < known.highest < 525e5
    assert "goes from 1 to 500 bar" in known.source
    with pytest.raises(InputError, match=r"got 120 degC, expected 0 to 100 degC"):
        choice.at(393.15)


def test_one_temperature_without_stiffness_is_enough(tmp_path):
    (tmp_path / "mine.csv").write_text(
        f"# bench\n{HEAD.replace(',', ';')}\n20;1;749;1.5\n20;100;756;1.7"
    )
    choice = read("mine.csv", tmp_path, name="ours", gas_fraction="0.1 %")
    fluid = choice.at(293.15)
    assert fluid.name == "ours"
    assert fluid.gas.fraction == 1e-3
    secant = 99e5 / (756.0 - 749.0)
    assert float(fluid.liquid.bulk_modulus(50e5)) == pytest.approx(
        secant * float(fluid.liquid.density(50e5)), rel=1e-9
    )
    with pytest.raises(InputError, match="got 40 degC, expected 20 to 20 degC"):
        choice.at(313.15)


def test_a_viscosity_that_is_no_exponential_is_a_visible_doubt(tmp_path):
    (tmp_path / "mine.csv").write_text(f"{HEAD}\n{ROWS}20, 200, 762, 5\n")
    with pytest.warns(AccuracyWarning, match=r"'mine.csv'.* at 20 degC .* 1 to 200 bar"):
        read("mine.csv", tmp_path).at(293.15)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (f"{HEAD}\n20, 1, 749, 1.5\n20, 100, 748, 1.7\n", "rise with pressure"),
        (f"{HEAD}\n20, 1, 749, 1.5\n40, 100, 756, 1.7\n", "every pressure once"),
        (f"{HEAD}\n{ROWS}20, 100, 756, 1.7\n", "every pressure once"),
        (f"{HEAD}\n20, 1, 749, 1.5\n", "at least two pressures"),
        (f"{HEAD}\n20, 0, 749, 1.5\n20, 100, 756, 1.7\n", "pressures are absolute"),
        (f"{HEAD}\n20, 1, 749, abc\n", "mine.csv':2"),
        (f"{HEAD}\n20, 1, 749\n", "4 finite numbers"),
        (f"{HEAD}\n20, 1, nan, 1.5\n", "4 finite numbers"),
        (HEAD, "no rows"),
        ("", "no rows"),
        (HEAD.replace("density", "weight") + "\n" + ROWS, "the column 'weight [kg/m^3]'"),
        (HEAD.replace("[mPa*s]", "[mm^2/s]") + "\n" + ROWS, "the unit 'mm^2/s'"),
        (HEAD.replace(" [bar]", "") + "\n" + ROWS, "the unit ''"),
        ("temperature [degC], pressure [bar], density [kg/m^3]\n20, 1, 749\n", "no column dynamic"),
        (HEAD + ", density [kg/m^3]\n20, 1, 749, 1.5, 749\n", "twice"),
        (
            f"{HEAD}, bulk modulus [GPa]\n20, 1, 749, 1.5, 0.13\n20, 100, 756, 1.7, 0.14\n",
            "as much",
        ),
        (
            f"{HEAD}, sound speed [m/s], bulk modulus [GPa]\n"
            "20, 1, 749, 1.5, 1300, 1.1\n20, 100, 756, 1.7, 1350, 1.2\n",
            "K = rho c^2 to 1 %",
        ),
        (
            f"{HEAD}, vapour pressure [Pa]\n20, 1, 749, 1.5, 10\n20, 100, 756, 1.7, 20\n",
            "changes with pressure",
        ),
    ],
)
def test_what_is_no_liquid_is_told(tmp_path, text, told):
    (tmp_path / "mine.csv").unlink(missing_ok=True)
    message = problem(tmp_path, text if text.strip() else "\n")
    assert told in message
    assert "mine.csv" in message


def test_the_file_of_the_documentation_is_a_fluid(tmp_path):
    page = (Path(__file__).parents[2] / "docs" / "theory" / "fluids.md").read_text()
    text = page.split("## Fluids from a file")[1].split("```\n")[2]
    (tmp_path / "my_fluid.csv").write_text(text)
    fluid = read("my_fluid.csv", tmp_path).at(293.15)
    assert float(fluid.sound_speed(500e5)) == pytest.approx(1555.0, rel=1e-2)  # on the isentrope


def test_paths_follow_the_rules_of_other_files(tmp_path):
    (tmp_path / "large.csv").write_bytes(b"#" * 5_000_001)
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    for name, words in (
        ("nothing.csv", "does not exist"),
        (".", "a folder"),
        ("large.csv", "at most 5 MB"),
        ("binary.csv", "no text"),
    ):
        with pytest.raises(ValidationError, match=words):
            read(name, tmp_path)
    with pytest.raises(ValidationError, match="the file has them"):
        read("fluid_dodecane.csv", viscosity="1 mPa*s")


def test_celsius_and_kelvin_are_one_temperature(tmp_path):
    (tmp_path / "mine.csv").write_text(
        f"{HEAD}\n{ROWS}".replace("degC", "K").replace("20,", "293.15,")
    )
    assert read_property_table(tmp_path / "mine.csv").temperature == pytest.approx([293.15])
