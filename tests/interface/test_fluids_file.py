"""Fluids of a case, by name and from files.

What a case file may say of a fluid, and what it is told when that cannot be used.

A fluid from a file of properties. Truth: the rows of the file, equations of state, identities.

tests/data/fluid_dodecane.csv: n-dodecane, 0 to 100 degC and 1 to 500 bar (its head names the
sources).
"""

from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError
from ruamel.yaml import YAML
from scipy.integrate import quad

from klack.case.any_case import read_valve_case
from klack.errors import AccuracyWarning, ConvergenceError, InputError
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.fluid_choice import FluidChoice
from klack.hydraulics.fluid_definition import FluidDefinition
from klack.hydraulics.fluid_library import FLUIDS, find_fluid, library_fluid
from klack.hydraulics.fluid_table import fluid_table
from klack.hydraulics.liquid import Murnaghan, TabulatedLiquid
from klack.hydraulics.mixture import EntrainedGas, Vapour
from klack.hydraulics.property_table import read_property_table

OWN = {"name": "T16", "density": "780 kg/m^3", "bulk_modulus": "1.2 GPa", "viscosity": "1 mPa*s"}


def read(value) -> FluidChoice:
    """As a file is read: every number needs its unit."""
    return FluidChoice.model_validate(value, context={})


def problem(value) -> InputError:
    with pytest.raises(ValidationError) as caught:
        read(value)
    cause = caught.value.errors()[0].get("ctx", {}).get("error")
    assert isinstance(cause, InputError)
    return cause


@pytest.mark.parametrize("text", ["n-heptane", "N-Heptane", "n heptane", {"name": "nheptane"}])
def test_a_name_is_enough(text):
    fluid = read(text).at(293.15)
    assert isinstance(fluid, Fluid)
    assert fluid.name == "n-heptane"
    assert float(fluid.sound_speed(6e5)) == pytest.approx(1152.99, rel=1e-4)


def test_gas_is_mixed_in():
    fluid = read({"name": "ISO 4113", "gas_fraction": "0.1 %", "gas_exponent": 1.2}).at(300.0)
    assert fluid.gas == EntrainedGas(fraction=1e-3, exponent=1.2)
    assert fluid.temperature == 300.0


def test_few_numbers_make_a_fluid():
    fluid = read(OWN | {"viscosity_pressure": "1000 bar", "vapour_pressure": "1 kPa"}).at(320.0)
    assert float(fluid.density(101_325.0)) == pytest.approx(780.0, rel=1e-12)
    assert float(fluid.bulk_modulus(101_325.0)) == pytest.approx(1.2e9, rel=1e-12)
    assert float(fluid.viscosity(1e8 + 101_325.0)) == pytest.approx(1e-3 * np.e, rel=1e-12)
    assert fluid.vapour_pressure == 1e3


def test_sound_speed_and_kinematic_viscosity_do_as_well():
    own = {"name": "T16", "density": "780 kg/m^3", "sound_speed": "1200 m/s"}
    fluid = read(own | {"kinematic_viscosity": "2 mm^2/s"}).at(293.15)
    assert float(fluid.sound_speed(101_325.0)) == pytest.approx(1200.0, rel=1e-12)
    assert float(fluid.viscosity(101_325.0)) == pytest.approx(2e-6 * 780.0, rel=1e-12)


def test_a_table_makes_a_fluid():
    table = {
        "pressure": ["1 bar", "10 bar", "200 bar"],
        "density": ["684 kg/m^3", "684.7 kg/m^3", "698.4 kg/m^3"],
    }
    fluid = read({"name": "T16", "table": table, "viscosity": "0.4 mPa*s"}).at(293.15)
    assert float(fluid.density(1e6)) == pytest.approx(684.7, rel=1e-12)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("n-heptan", "did you mean 'n-heptane'?"),
        ({"name": "T16"}, "add density, viscosity and bulk_modulus"),
        ({"name": "water", "density": "990 kg/m^3"}, "my-water"),
        ({k: v for k, v in OWN.items() if k != "viscosity"}, "viscosity"),
        ({k: v for k, v in OWN.items() if k != "bulk_modulus"}, "the stiffness"),
        (OWN | {"sound_speed": "1200 m/s"}, "bulk_modulus and sound_speed together"),
        (OWN | {"bulk_modulus": "5 bar"}, "check the unit"),
        (OWN | {"release_pressure": "1 bar"}, "leave both out"),
        (OWN | {"release_time": "1 ms"}, "only one of the two times"),
        (OWN | {"release_time": "1 ms", "absorption_time": "5 s"}, "no release_pressure"),
        (OWN | {"release_pressure": "2 bar", "saturation_pressure": "1 bar"}, "leave both out"),
        (OWN | {"density": 780}, "add a unit"),
        (OWN | {"densty": 780}, "did you mean 'density'?"),
        (
            {
                "name": "T16",
                "viscosity": "1 mPa*s",
                "table": {
                    "pressure": ["1 bar", "2 bar"],
                    "density": ["800 kg/m^3", "799 kg/m^3"],
                },
            },
            "both strictly increasing",
        ),
    ],
)
def test_what_cannot_be_used_is_told(value, text):
    assert text in str(problem(value))


def test_unknown_names_and_temperatures_are_told():
    assert find_fluid("T16") is None
    with pytest.raises(InputError, match="did you mean 'ISO VG 46'"):
        library_fluid("ISO VG 64")
    with pytest.raises(InputError, match=r"got 150 degC, expected 0 to 140 degC"):
        FLUIDS["water"].at(423.15)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: EntrainedGas(fraction=1.0), "below 1"),
        (lambda: EntrainedGas(exponent=0.5), "isothermal"),
        (lambda: EntrainedGas(saturation_pressure=1e5), "both or none"),
        (lambda: Vapour(pressure=0.0, density=1.0), "above 0 Pa"),
        (lambda: TabulatedLiquid([1e5], [800.0]), "at least two"),
        (lambda: Murnaghan(density_at_reference=800.0, bulk_modulus_at_reference=1e5), "above 0"),
        (lambda: FLUIDS["water"].at(293.15, gas_fraction=-0.1), "share of the volume"),
    ],
)
def test_fluids_refuse_what_has_no_meaning(make, text):
    with pytest.raises(InputError, match=text):
        make()


def test_a_heavy_vapour_is_refused():
    with pytest.raises(InputError, match="vapour density"):
        read(OWN | {"vapour_density": "900 kg/m^3"}).at(293.15)


def test_a_table_that_never_settles_says_where():
    class Rough:
        kinks = ()

        def density(self, pressure):
            return 800.0 + np.floor(np.asarray(pressure, dtype=float) / 1e3) * 1e-3

        def bulk_modulus(self, pressure):
            return np.full_like(np.asarray(pressure, dtype=float), 1e9)

    fluid = Fluid(
        name="stairs",
        temperature=293.15,
        liquid=Rough(),
        base_viscosity=1e-3,
        vapour=Vapour(pressure=10.0, density=4e-4),
    )
    with pytest.raises(ConvergenceError, match=r"'stairs' has not converged .* Pa"):
        fluid_table(fluid, 101_325.0)


def test_a_definition_can_be_written_in_python():
    class Air:
        def at(self, temperature):
            return FLUIDS["water"].properties.at(temperature)

    own = FluidDefinition(name="mine", properties=Air())
    assert float(own.at(293.15).density(1e5)) == pytest.approx(998.2, rel=1e-4)
    assert not own.verified  # nothing is known of its sources


def test_the_fluids_of_the_documentation_can_be_read():
    page = (Path(__file__).parents[2] / "docs" / "theory" / "fluids.md").read_text()
    block = page.split("## The library")[1].split("```yaml\n")[1].split("```")[0]
    texts = ["fluid:" + part for part in block.split("fluid:")[1:]]
    fluids = [read(YAML(typ="safe").load(text)["fluid"]).at(293.15) for text in texts]
    assert [fluid.name for fluid in fluids] == ["n-heptane", "ISO 4113", "ours", "ours"]
    assert float(fluids[3].sound_speed(5e6)) == pytest.approx(1240.0, rel=0.05)


@pytest.mark.parametrize(
    ("fluid", "ambient", "place"),
    [
        ("water", "ambient: {temperature: 170 degC}", r"network\.ambient\.temperature: got 170"),
        ("{name: generic mineral oil, viscosity_law: barus}", "", r"network\.fluid: got barus"),
    ],
)
def test_a_fluid_that_does_not_fit_its_network_is_told_at_its_key(fluid, ambient, place):
    text = f"""
klack: 1
title: A pipe
network:
  {ambient}
  fluid: {fluid}
  components:
    needle: {{type: rigid-mass, mass: 3 g}}
    spring: {{type: spring, stiffness: 1 N/mm, preload: 0 N}}
  connections: [[needle.body, spring.end]]
run: {{duration: 1 ms}}
"""
    with pytest.raises(InputError, match=place + r".*, of fluid '(water|generic mineral oil)'"):
        read_valve_case(text, Path("case.yaml"))


DATA = Path(__file__).parents[1] / "data"
TEXT = (DATA / "fluid_dodecane.csv").read_text()
HEAD = "temperature [degC], pressure [bar], density [kg/m^3], dynamic viscosity [mPa*s]"
ROWS = "20, 1, 749, 1.5\n20, 100, 756, 1.7\n"


def read_file(table, folder=DATA, **more) -> FluidChoice:
    return FluidChoice.model_validate({"table": table, **more}, context={"folder": folder})


def problem_file(folder: Path, text: str) -> str:
    (folder / "mine.csv").write_text(text)
    with pytest.raises(ValidationError) as caught:
        read_file("mine.csv", folder)
    return str(caught.value.errors()[0]["ctx"]["error"])


def test_a_file_next_to_the_case_is_a_fluid():
    fluid = read_file("fluid_dodecane.csv").at(313.15)
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
    fluid = read_file("fluid_dodecane.csv").at(kelvin)
    assert float(fluid.sound_speed(1e5)) == pytest.approx(speed, rel=1e-5)  # of the cubic


def test_density_and_stiffness_belong_together():
    liquid = read_file("fluid_dodecane.csv").at(303.15).liquid
    p = np.linspace(1e5, 700e5, 400)
    assert np.all(np.diff(liquid.density(p)) > 0.0)
    places = [x for x in liquid.kinks if 1e5 < x < 480e5]
    strain = quad(lambda x: 1.0 / float(liquid.bulk_modulus(x)), 1e5, 480e5, points=places)[0]
    ratio = float(liquid.density(480e5) / liquid.density(1e5))
    assert np.log(ratio) == pytest.approx(strain, rel=1e-9)
    speed = np.sqrt(liquid.bulk_modulus(p) / liquid.density(p))
    assert np.all(np.diff(speed[p < 500e5]) > 0.0)


def test_its_range_is_stated_and_other_temperatures_are_refused():
    choice = read_file("fluid_dodecane.csv")
    known = choice.at(313.15).pressure_range
    assert 500e5 < known.highest < 525e5
    assert "covers 1 to 500 bar" in known.source
    with pytest.raises(InputError, match=r"got 120 degC, expected 0 to 100 degC"):
        choice.at(393.15)


def test_one_temperature_without_stiffness_is_enough(tmp_path):
    (tmp_path / "mine.csv").write_text(
        f"# bench\n{HEAD.replace(',', ';')}\n20;1;749;1.5\n20;100;756;1.7"
    )
    choice = read_file("mine.csv", tmp_path, name="ours", gas_fraction="0.1 %")
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
        read_file("mine.csv", tmp_path).at(293.15)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (f"{HEAD}\n20, 1, 749, 1.5\n20, 100, 748, 1.7\n", "increase with pressure"),
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
    message = problem_file(tmp_path, text if text.strip() else "\n")
    assert told in message
    assert "mine.csv" in message


def test_the_file_of_the_documentation_is_a_fluid(tmp_path):
    page = (Path(__file__).parents[2] / "docs" / "theory" / "fluids.md").read_text()
    text = page.split("## Fluids from a file")[1].split("```\n")[2]
    (tmp_path / "my_fluid.csv").write_text(text)
    fluid = read_file("my_fluid.csv", tmp_path).at(293.15)
    assert float(fluid.sound_speed(500e5)) == pytest.approx(1555.0, rel=1e-2)  # on the isentrope


def test_paths_follow_the_rules_of_other_files(tmp_path):
    (tmp_path / "large.csv").write_bytes(b"#" * 5_000_001)
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00")
    for name, words in (
        ("nothing.csv", "does not exist"),
        (".", "a folder"),
        ("large.csv", "at most 5 MB"),
        ("binary.csv", "not text"),
    ):
        with pytest.raises(ValidationError, match=words):
            read_file(name, tmp_path)
    with pytest.raises(ValidationError, match="the file has them"):
        read_file("fluid_dodecane.csv", viscosity="1 mPa*s")


def test_celsius_and_kelvin_are_one_temperature(tmp_path):
    (tmp_path / "mine.csv").write_text(
        f"{HEAD}\n{ROWS}".replace("degC", "K").replace("20,", "293.15,")
    )
    assert read_property_table(tmp_path / "mine.csv").temperature == pytest.approx([293.15])
