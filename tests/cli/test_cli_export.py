"""klack export through main(argv); truth: the run of the same case, and what the messages promise.

Readers that klack has no part in open what it wrote.
"""

from pathlib import Path

import numpy as np
import pytest
import scipy.io

from klack.analyses.impact.analysis import IMPACT
from klack.analyses.impact.run import run_impact
from klack.case import find_case, read_case
from klack.cli.main import main

VALVE = find_case("demo-valve-axisymmetric")
SEAT_INSERT = Path(__file__).parents[2] / "docs" / "how-to" / "seat_insert.yaml"


@pytest.fixture(scope="module")
def study():
    return run_impact(read_case(VALVE.read_text(), VALVE), levels=("reduced",), certify=False)


@pytest.fixture(scope="module")
def stored(study, tmp_path_factory):
    folder = tmp_path_factory.mktemp("result")
    IMPACT.save(study, folder)
    return folder


def exported(tmp_path: Path, *arguments: str, source: object = VALVE) -> set[str]:
    out = tmp_path / "out"
    assert main(["export", str(source), "--out", str(out), "-q", *arguments]) == 0
    return {path.name for path in out.iterdir()}


@pytest.mark.slow
def test_models_for_matlab_hold_every_body_and_the_pair(tmp_path, study):
    made = exported(tmp_path, "--to", "mat")

    bodies = [body.name for body in study.bodies]
    assert {f"{name}.mat" for name in (*bodies, "demo_valve_axisymmetric_pair")} <= made
    held = scipy.io.loadmat(tmp_path / "out" / f"{bodies[0]}.mat", simplify_cells=True)["klack"]
    elastic = held["frequencies_Hz"][1:]  # the needle is free: one rigid mode
    np.testing.assert_allclose(elastic, study.bodies[0].frequencies, rtol=1e-12)


def test_one_body_alone(tmp_path, study):
    name = study.bodies[0].name

    made = exported(tmp_path, "--to", "modelica", "--body", name)

    assert made == {f"{name}.mo"}


def test_a_body_that_is_not_there_is_refused_and_nothing_written(tmp_path, capsys):
    out = tmp_path / "x"
    arguments = ["export", str(VALVE), "--to", "csv", "--body", "nedle", "--out", str(out)]

    assert main([*arguments, "-q"]) == 2

    assert "nedle" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.slow
def test_an_fmu_of_the_pair_hits_as_hard_as_klack_says(tmp_path, study):
    fmpy = pytest.importorskip("fmpy")

    made = exported(tmp_path, "--to", "fmu", "--part", "pair")

    assert made == {"demo_valve_axisymmetric_pair.fmu"}
    history = study.levels["reduced"].history
    run = fmpy.simulate_fmu(
        str(tmp_path / "out" / "demo_valve_axisymmetric_pair.fmu"),
        fmi_type="CoSimulation",
        stop_time=len(history.force) * history.step,
        output_interval=1e-6,
        output=["peak_contact_force"],
    )
    peak = study.levels["reduced"].measures.peak_force
    assert np.max(run["peak_contact_force"]) == pytest.approx(peak, rel=1e-9)  # the same steps


@pytest.mark.parametrize(
    ("target", "ending"), [("netcdf", ".nc"), ("mdf", ".mf4"), ("mat", ".mat"), ("csv", ".csv")]
)
def test_a_stored_result_is_written_for_others(tmp_path, stored, target, ending):
    made = exported(tmp_path, "--to", target, source=stored)

    assert any(name.endswith(ending) for name in made)


def test_the_force_of_a_result_is_in_netcdf_to_the_last_bit(tmp_path, stored, study):
    netcdf = pytest.importorskip("netCDF4")

    (name,) = exported(tmp_path, "--to", "netcdf", source=stored)

    with netcdf.Dataset(tmp_path / "out" / name) as data:
        found = [v for v in _variables(data) if v.name.endswith("contact_force")]
        assert found[0].units == "N"
        np.testing.assert_array_equal(found[0][:], study.levels["reduced"].history.force)


def _variables(group):
    yield from group.variables.values()
    for child in group.groups.values():
        yield from _variables(child)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--to", "mat", "--fmi", "3"], "--fmi"),
        (["--to", "fmu", "--frames", "10"], "--frames"),
        (["--to", "netcdf", "--part", "body"], "--part"),
        (["--to", "fmu", "--platform", "mars"], "mars"),
        (["--to", "abaqus"], "abaqus"),
    ],
)
def test_what_makes_no_sense_is_refused_at_once(tmp_path, capsys, arguments, words):
    assert main(["export", str(VALVE), *arguments, "--out", str(tmp_path / "x"), "-q"]) == 2

    told = capsys.readouterr().err
    assert words in told
    assert told.count("klack export:") == 1  # named once
    assert "klack export --to" not in told
    assert "klack export --part" not in told
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize("part", ["body", "pair"])
def test_a_valve_of_rigid_bodies_is_refused_and_told_why(tmp_path, capsys, part):
    valve = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"
    words = ["--to", "fmu", "--part", part, "--out", str(tmp_path / "x"), "-q"]
    assert main(["export", str(valve), *words]) == 2
    told = capsys.readouterr().err
    assert "network.components: got rigid bodies only, expected" in told


def test_the_flexible_body_of_a_valve_with_rigid_ones_is_exported_alone(tmp_path, capsys):
    """The refusal of the whole valve says how; an elastic housing, needle and armature rigid."""
    words = ["export", "free-travel", "--to", "csv", "-q", "--out", str(tmp_path / "x")]
    assert main(words) == 2
    told = capsys.readouterr().err
    assert "network.components.needle: got a rigid-mass at an end stop" in told
    assert "--part body" in told

    assert main([*words, "--part", "body"]) == 0
    assert {path.name.split("_")[0] for path in (tmp_path / "x").iterdir()} == {"housing"}


@pytest.mark.slow
def test_a_stop_on_the_ground_is_refused_and_told_why(tmp_path, capsys):
    text = find_case("demo-stroke").read_text(encoding="utf-8")
    for old, new in (
        ("  opening: {between: [pole.stop, needle.land], speed: 1.5 m/s, force: 60 N}\n", ""),
        (
            "gap: 100 um  # the lift, as drawn\n      law: {kind: consistent}",
            "gap: 100 um\n      law: {kind: linear, stiffness: 1e8 N/m}",
        ),
        ("[pole.stop, opening.upper]", "[ground, opening.upper]"),
    ):
        assert old in text
        text = text.replace(old, new)
    case = tmp_path / "case.yaml"
    case.write_text(text, encoding="utf-8")
    assert main(["export", str(case), "--to", "csv", "--out", str(tmp_path / "x"), "-q"]) == 2
    assert "network.components.opening: got an end stop on the ground" in capsys.readouterr().err


def test_models_do_not_come_from_a_result(stored, capsys):
    assert main(["export", str(stored), "--to", "fmu"]) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"klack export: {stored}: got a stored result with --to fmu")
    assert "case" in told


@pytest.mark.slow
def test_the_pair_of_a_valve_says_what_it_leaves_out(tmp_path, capsys):
    words = ["demo-stroke", "--to", "csv", "--part"]
    assert main(["export", *words, "pair", "--out", str(tmp_path / "pair")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert main(["export", *words, "body", "--out", str(tmp_path / "body")]) == 0
    other = capsys.readouterr().out

    left_out = (
        said.split("Not in the models, to be added by you: ")[1].split(" Written")[0].split(", ")
    )
    assert {"spring", "guide", "coil", "driver", "feed", "sac", "nozzle"} <= set(left_out)
    assert not {"needle", "housing", "pole", "seat", "opening"} & set(left_out)
    assert "to be added by you" not in other


@pytest.mark.slow
def test_a_force_on_a_moving_body_without_an_input_is_named(tmp_path, capsys):
    """The sleeve clamps an insert: the pair has inputs of the needle only."""
    case = tmp_path / "case.yaml"
    text = SEAT_INSERT.read_text(encoding="utf-8")
    for old, new in (
        ("    - [housing.ledge, foot.lower]\n", "    - [housing.ledge, foot.lower, stop.upper]\n"),
        ("    - [ground, stop.upper]\n", ""),
        (", restitution: 0.2}", "}"),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    case.write_text(text, encoding="utf-8")

    words = ["export", str(case), "--to", "csv", "--part", "pair", "--out", str(tmp_path / "x")]
    assert main(words) == 0

    told = capsys.readouterr().err
    assert "no input for 'insert', on which 'sleeve' acts" in told
    assert told.count("no input") == 1
