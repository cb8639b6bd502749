"""Numbers that a valve has not are doubted, those that cannot be refused; truth: what is written.

The other half of it: no case that klack ships, shows or tests is doubted.
"""

from pathlib import Path

import pytest
from doubts import doubts

from klack.assembling.bodies import wanted_sizes
from klack.assembling.given_shapes import require_given_shapes, tell_effort
from klack.case import read_case, shipped_cases
from klack.case.any_case import read_any_case
from klack.cli.main import main
from klack.errors import InputError

ROOT = Path(__file__).parents[2]
RODS = (ROOT / "tests" / "data" / "tiny_rods.yaml").read_text(encoding="utf-8")
VALVE = (ROOT / "docs" / "how-to" / "small_valve.yaml").read_text(encoding="utf-8")


def rods(old: str = "", new: str = ""):
    assert old in RODS
    return read_case(RODS.replace(old, new), Path("rods.yaml"))


class Said(list):
    """Progress that keeps the lines shown at once."""

    def __call__(self, stage: str, fraction: float) -> None:
        pass

    def remark(self, line: str) -> None:
        self.append(line)


def no_mesh(name: str):
    raise AssertionError(f"nothing may be read for '{name}'")


@pytest.mark.parametrize("command", ["impact", "reduce", "inspect", "advise", "noise", "export"])
def test_every_command_refuses_a_speed_that_cannot_be(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "fast.yaml").write_text(RODS.replace("speed: 1 m/s", "speed: 300 m/s"))

    assert main([command, "fast.yaml", *(["--to", "calculix"] if command == "export" else [])]) == 2

    said = capsys.readouterr().err
    assert "fast.yaml:39: motion.speed: got 300 m/s, expected 100 m/s or less" in said
    assert "with 'unusual: true' at the top of the case it is computed nevertheless" in said
    assert list(tmp_path.iterdir()) == [tmp_path / "fast.yaml"]


@pytest.mark.parametrize(
    ("speed", "doubted"),
    [("1 mm/s", True), ("20 mm/s", False), ("14.4 m/s", False), ("40 m/s", True)],
)
def test_unusual_speeds_are_noted(speed, doubted):
    notes = rods("speed: 1 m/s", f"speed: {speed}").input_notes

    assert len(notes) == doubted
    assert not doubted or f"motion.speed: {speed} is unusual (usual: 2 mm/s to 20 m/s" in notes[0]


def test_a_confirmed_case_is_noted():
    text = RODS.replace("klack: 1\n", "klack: 1\nunusual: true\n")
    case = read_case(text.replace("speed: 1 m/s", "speed: 300 m/s"), Path("rods.yaml"))
    assert "300 m/s is unusual" in case.input_notes[0]


@pytest.mark.parametrize(
    ("mass", "words"), [("20 kg", "20 kg is unusual"), ("3 t", "expected 1000 kg or less")]
)
def test_masses_of_rigid_parts(mass, words):
    text = VALVE.replace("mass: 3 g", f"mass: {mass}")
    assert text != VALVE
    try:
        said = read_any_case(text, Path("valve.yaml")).input_notes[0]
    except InputError as error:
        said = str(error)
    assert words in said
    assert "network.components.needle.mass" in said


def test_sizes_and_masses_are_told_before_the_mesh():
    """Rods of 20 and 40 cm with a radius of 2 cm; the short one, of steel, weighs 1.97 kg."""
    said = Said()
    with doubts() as told:
        require_given_shapes(rods("unit: mm", "unit: cm"), no_mesh, said)

    assert [f"note: {text}" for text in told] == said
    assert "bodies.long: 400 mm is an unusual size (longest side; needles and" in said[0]
    assert "bodies.short: a mass of 1.973 kg is unusual (usual: 0.01 g to 500 g" in said[1]


@pytest.mark.parametrize(("size", "told"), [("0.2 mm", False), ("5 um", True)])
def test_a_large_mesh_is_told_before_it_is_made(size, told):
    case, said = rods("mesh: {size: 1 mm}", f"mesh: {{size: {size}}}"), Said()
    shapes = require_given_shapes(case, no_mesh)
    with doubts() as texts:
        tell_effort(case, shapes, wanted_sizes(case.bodies, {"short": (), "long": ()}), said)

    assert len(said) == len(texts) == told
    if told:
        assert (
            "bodies.long.mesh: elements of 5 um to 5 um make a mesh of about 4e+07 nodes" in said[0]
        )
        assert "h on two cores and at least" in said[0]


def test_no_case_of_klack_is_doubted():
    """Cases that are read as they are; the inputs of parts and studies are none."""
    files = [*shipped_cases().values(), *(ROOT / "docs").rglob("*.yaml")]
    files += (ROOT / "tests" / "data").rglob("*.yaml")
    read = 0
    for file in files:
        text = file.read_text(encoding="utf-8")
        if "\ntitle:" in text and "\nrun:" in text:
            assert read_any_case(text, file).doubts == (), file
            read += 1
    assert read > 30
