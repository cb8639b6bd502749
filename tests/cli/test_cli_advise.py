"""``klack advise``: what it writes loads and runs, and what it refuses (interface)."""

import json
from pathlib import Path

import pytest
from energy_ledger import allowed
from ruamel.yaml import YAML

from klack.case import load_case, read_case
from klack.case.any_case import read_case_tree
from klack.case.rewriting import with_values
from klack.cli.main import main
from klack.errors import InputError

CASE = """\
# a small sphere on a small block: the comment stays
klack: 1
title: Sphere on a block
materials:
  steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}
bodies:
  sphere:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          sphere:
            start: [0, 0]
            edges:
              - {arc: [1, 1], centre: [0, 1], name: tip}
              - {arc: [0, 2], centre: [0, 1], name: top}
              - {close: true, name: axis}
    material: steel
    mesh:
      size: 0.5 mm  # far away
      contact: {size: 30 um, extent: 0.15 mm}
  block:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          block:
            start: [0, -3]
            edges:
              - {line: [3, -3], name: foot}
              - {line: [3, 0], name: side}
              - {line: [0, 0], name: face}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 1 mm, contact: {size: 30 um, extent: 0.15 mm}}
    fixed: [{surface: foot}]
contact: {between: [sphere.tip, block.face], gap: 0 um, reach: 20 um}
motion: {speed: 0.5 m/s}
reduction:
  modes:
    sphere: {count: 2}  # the block has the default
run: {levels: [reduced], duration: 20 us, reduced_step: 50 ns}
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "sphere.yaml"
    path.write_text(CASE)
    return path


def _merged(data, other):
    if not isinstance(other, dict):
        return other
    return {**data, **{key: _merged(data.get(key, {}), value) for key, value in other.items()}}


@pytest.mark.slow
def test_advice_can_be_pasted_and_written(path, tmp_path, capsys):
    """The lines to paste, laid over the case, are the case that is written; both load."""
    new, numbers = tmp_path / "finer.yaml", tmp_path / "advice.json"

    target = ["--error", "0.5 %", "--bands", "0.5 dB", "--up-to", "300 kHz"]
    written = ["--write", str(new), "--json", str(numbers)]
    code = main(["advise", str(path), *target, *written, "--no-confirm"])

    out = capsys.readouterr().out
    assert code == 0
    told = json.loads(numbers.read_text())
    assert told["target"] == {
        "peak_force": 0.005,
        "contact_time": 0.005,
        "force_history": 0.005,
        "third_octaves_dB": 0.5,
    }
    assert {item["kind"] for item in told["settings"]} == {"mesh", "modes", "step"}
    assert [item["name"] for item in told["fixed"]] == ["one pressure pattern"]
    assert told["run_again"] is None
    for item in told["settings"]:
        assert item["error"]["advised"]["force_history"] >= 0
        assert item["name"].split(",")[0] in out.replace("\n", " ")

    advised = load_case(new)
    text = new.read_text()
    for comment in ("# a small sphere", "# far away", "# the block has the default"):
        assert comment in text
    contact = told["changes"]["bodies.sphere.mesh.contact.size"]
    assert contact.endswith("um")  # in the unit that stood there
    assert advised.bodies["sphere"].mesh.contact.size < 30e-6

    pasted = out.split("Replace these keys of the case:\n")[1].split("The case with")[0]
    safe = YAML(typ="safe")
    merged = _merged(safe.load(CASE), safe.load(pasted))
    stream = tmp_path / "pasted.yaml"
    with stream.open("w") as file:
        YAML().dump(merged, file)
    laid_over = read_case(stream.read_text(), stream)
    assert laid_over.bodies == advised.bodies
    assert laid_over.reduction == advised.reduction
    assert laid_over.run == advised.run


@pytest.mark.slow
def test_the_interface_level_is_advised_and_run_again(path, tmp_path):
    """Convergence: the advised case is nearer to the finest run than the case as it is."""
    numbers = tmp_path / "advice.json"

    with allowed("simulate_interface", 1e-3):  # a coarse contact, owing 1.2e-4 at the end
        code = main(
            ["advise", str(path), "--level", "interface", "--json", str(numbers), "--quiet"]
        )

    assert code == 0
    told = json.loads(numbers.read_text())
    assert (told["level"], told["fixed"]) == ("interface", [])
    again = told["run_again"]
    assert again["advised"]["force_history"] < again["now"]["force_history"]


def test_values_are_added_where_none_stand(path):
    """Exact: only the values asked for change, wherever the mapping ends."""
    text = with_values(
        read_case_tree(path),
        {
            ("bodies", "sphere", "mesh", "grading"): "0.2",
            ("bodies", "block", "mesh", "grading"): "0.15",
            ("bodies", "block", "mesh", "size"): "0.4 mm",
            ("reduction", "modes", "block", "count"): "12",
            ("run", "interface_step"): "25 ns",
        },
        "Advised.",
    )

    assert text.startswith("# Advised.\n# a small sphere")
    case = read_case(text, path)
    assert case.bodies["sphere"].mesh.grading == 0.2
    assert (case.bodies["block"].mesh.grading, case.bodies["block"].mesh.size) == (0.15, 4e-4)
    assert case.reduction.choice("block").count == 12
    assert case.reduction.choice("sphere").count == 2
    assert case.run.interface_step == 25e-9
    assert "# the block has the default" in text


def test_a_whole_section_is_added(path):
    path.write_text(
        CASE.replace(
            "reduction:\n  modes:\n    sphere: {count: 2}  # the block has the default\n", ""
        )
    )
    text = with_values(
        read_case_tree(path),
        {
            ("reduction", "modes", "block", "count"): "12",
            ("reduction", "modes", "sphere", "count"): "3",
        },
    )

    case = read_case(text, path)
    assert (case.reduction.choice("block").count, case.reduction.choice("sphere").count) == (12, 3)


def test_anchors_are_refused(path):
    shared = CASE.replace("contact: {size: 30 um", "contact: &near {size: 30 um", 1).replace(
        "contact: {size: 30 um, extent: 0.15 mm}}", "contact: *near}"
    )
    path.write_text(shared)
    tree = read_case_tree(path)

    with pytest.raises(InputError, match="anchors"):
        with_values(tree, {("bodies", "sphere", "mesh", "contact", "size"): "20 um"})


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--error", "1"], ("--error", "'1'", "20 %", "1 %")),
        (["--error", "0 %"], ("--error", "above 0")),
        (["--error", "1 mm"], ("--error", "1 mm")),
        (["--bands", "loud"], ("--bands", "'loud'", "1 dB")),
        (["--bands", "0 dB"], ("--bands", "above 0")),
        (["--up-to", "40"], ("--up-to", "Hz")),
        (["--level", "full"], ("--level", "'full'", "reduced or interface")),
        (["--write", "sphere.yaml"], ("--write", "exists", "never changed")),
        (["--write", "nowhere/new.yaml"], ("--write", "folder")),
        (["--threads", "0"], ("--threads",)),
    ],
)
def test_what_is_refused(path, tmp_path, capsys, options, words):
    code = main(["advise", path.name, *options])

    said = capsys.readouterr().err
    assert code == 2
    assert said.startswith("klack advise:")
    assert all(word in said for word in words), said
    assert path.read_text() == CASE
    assert [item.name for item in tmp_path.iterdir()] == ["sphere.yaml"]


def test_reduced_models_are_told_what_to_do_instead(capsys):
    assert main(["advise", "from-other-tools"]) == 2
    said = capsys.readouterr().err
    assert "without surfaces" in said
    assert "half of run.reduced_step" in said


def test_a_valve_has_no_band(capsys):
    assert main(["advise", "demo-stroke", "--up-to", "20 kHz"]) == 2
    assert "first impacts" in capsys.readouterr().err


@pytest.mark.slow
def test_a_short_run_is_refused(path, capsys):
    path.write_text(CASE.replace("duration: 20 us", "duration: 3 us"))
    assert main(["advise", str(path)]) == 2
    assert "do not separate" in capsys.readouterr().err
