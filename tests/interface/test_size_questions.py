"""Bodies of an unusual size are asked about, once; truth: sizes drawn here, and the words.

A needle valve is 0.1 mm to 1 m long; a STEP file in the wrong unit is a thousand times off.
"""

from pathlib import Path

import pytest

from klack.assembling.given_shapes import require_given_shapes, require_usual_sizes
from klack.case.reader import read_case
from klack.cli.main import main
from klack.errors import AccuracyWarning, InputError

RODS = (Path(__file__).parents[1] / "data" / "tiny_rods.yaml").read_text(encoding="utf-8")
MODEL = "      model: axisymmetric\n"


def rods(unit: str = "mm", extent: str = ""):
    """Rods of 20 and 40 units; ``extent`` confirms the size of the long one."""
    head, tail = RODS.replace("unit: mm", f"unit: {unit}").split("\n  long:\n")
    if extent:
        tail = tail.replace(MODEL, f"{MODEL}      extent: {extent}\n", 1)
    return read_case(f"{head}\n  long:\n{tail}", Path("rods.yaml"))


def no_mesh(name: str):
    raise AssertionError(f"nothing may be read for '{name}'")


@pytest.mark.parametrize("unit", ["mm", "cm"])
def test_usual_sizes_pass(unit):
    require_given_shapes(rods(unit), no_mesh)


@pytest.mark.parametrize(("unit", "size"), [("m", "40 m"), ("um", "40 um")])
def test_a_drawing_in_the_wrong_unit_is_asked_about(unit, size):
    with pytest.raises(InputError) as caught:
        require_given_shapes(rods(unit), no_mesh)

    text = str(caught.value)
    assert "rods.yaml:22: bodies.long.geometry" in text
    assert f"a body 'long' of {size}" in text
    assert f"geometry: {{extent: {size}}}" in caught.value.hint


@pytest.mark.parametrize("unit", ["m", "um"])
def test_what_the_question_proposes_is_taken(unit):
    require_given_shapes(rods(unit, f"40 {unit}"), no_mesh)


def test_a_case_that_is_unusual_as_a_whole_is_noted():
    text = RODS.replace("unit: mm", "unit: m").replace("klack: 1", "klack: 1\nunusual: true")
    with pytest.warns(AccuracyWarning, match="bodies.long: 40 m is an unusual size"):
        require_given_shapes(read_case(text, Path("rods.yaml")), no_mesh)


def test_a_confirmation_of_another_size_is_refused():
    with pytest.raises(InputError, match=r"geometry.extent: got an extent of 40 mm, expected 40 m"):
        require_given_shapes(rods("m", "40 mm"), no_mesh)


@pytest.mark.parametrize(
    ("short", "long", "asked"),
    [(5e-3, 0.4, None), (5e-3, 0.6, "short"), (3e-3, 0.9, "short"), (0.9, 3e-3, "long")],
)
def test_sizes_that_differ_a_hundredfold(short, long, asked):
    sizes = {"short": short, "long": long}
    if asked is None:
        require_usual_sizes(rods(), sizes)
        return
    with pytest.raises(InputError, match=f"a body '{asked}' of .* bodies of similar size"):
        require_usual_sizes(rods(), sizes)


def test_both_have_to_be_confirmed_where_they_differ():
    sizes = {"short": 0.3e-3, "long": 40e-3}
    with pytest.raises(InputError, match="a body 'short'"):
        require_usual_sizes(rods(extent="40 mm"), sizes)


@pytest.mark.slow
def test_a_step_file_in_metres(tmp_path):
    """A part drawn as 20 mm, whose file counts them as metres; and its names come along."""
    from netgen.occ import Box, Pnt

    for name, low, high in (("up", 0, 20_000), ("down", -20_000, 0)):
        Box(Pnt(-5000, -5000, low), Pnt(5000, 5000, high)).WriteStep(str(tmp_path / f"{name}.step"))
    text = RODS.split("bodies:\n")[0] + "bodies:\n"
    for name in ("up", "down"):
        text += (
            f"  {name}:\n    geometry: {{step: {{file: {name}.step}}}}\n"
            "    material: steel\n    mesh: {size: 1 mm}\n"
        )
    text += "contact: {between: [up.face5, down.face6], gap: 0 um}\n"
    text += "motion: {speed: 1 m/s}\nrun: {levels: [reduced], duration: 20 us}\n"
    case = read_case(text, tmp_path / "boxes.yaml")
    with pytest.raises(InputError, match=r"a body 'up' of 20 m"):
        require_given_shapes(case, no_mesh)


def test_a_command_asks_before_it_meshes(tmp_path, capsys):
    (tmp_path / "rods.yaml").write_text(RODS.replace("unit: mm", "unit: m"), encoding="utf-8")
    words = ["impact", str(tmp_path / "rods.yaml"), "--no-report", "--out", str(tmp_path / "out")]

    assert main(words) == 2
    assert "is the unit of its shape right?" in capsys.readouterr().err
