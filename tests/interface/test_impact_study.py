"""Studies of impacts: points, shared bodies, notes, what is kept, and what is refused.

Truth: single impacts of the changed cases, bit for bit, as ``klack impact`` computes them.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import klack
from klack.analyses.noise.measures import DESIGN_MEASURES
from klack.analyses.sensitivities.analysis import SENSITIVITIES
from klack.analyses.sensitivities.record import (
    ImpactSlope,
    MeasureSlopes,
    SensitivityRecord,
    SlopeParameter,
)
from klack.analyses.study import impacts
from klack.analyses.study.asked_points import groups_of
from klack.analyses.study.evaluation import asked_of
from klack.case.study_source import study_of
from klack.cli.main import main
from klack.errors import InputError

HEAD = "klack: 1\nstudy:\n"
SPEED, FORCE, DAMPING = "motion.speed", "motion.force", "bodies.ball.damping.modal"
YOUNG, SIZE = "materials.steel.young", "mesh.contact.size"
STUDY = f"""
  parameters:
    {SPEED}: {{from: 0.3 m/s, to: 0.6 m/s}}
    {FORCE}: {{from: 0 N, to: 1 N}}
    {DAMPING}: {{from: 0.005, to: 0.02}}
  measures: [peak_force, contact_time, restitution, impulse, sub_contacts]
  design: {{points: 2}}
"""
RUBBING = """
    contact.friction: {from: 0, to: 0.3}
    contact.static_friction: {from: 0.3, to: 0.4}
    contact.stribeck_speed: {from: 0.01 m/s, to: 0.1 m/s}
  measures"""
CASE = """klack: 1
title: Ball on a short rod
materials:
  steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}
bodies:
  ball:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          ball:
            start: [0, 0]
            edges:
              - {arc: [2, 2], centre: [0, 2], name: tip}
              - {arc: [0, 4], centre: [0, 2], name: top}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 0.8 mm, contact: {size: 0.02 mm, extent: 0.2 mm}}
    damping: {modal: 0.01}
  rod:
    geometry:
      model: axisymmetric
      profile:
        unit: mm
        parts:
          rod:
            start: [0, -6]
            edges:
              - {line: [4, -6], name: foot}
              - {line: [4, 0], name: side}
              - {line: [0, 0], name: end}
              - {close: true, name: axis}
    material: steel
    mesh: {size: 1.5 mm, contact: {size: 0.02 mm, extent: 0.2 mm}}
    fixed: [{surface: foot}]
contact: {between: [ball.tip, rod.end], gap: 0 um}
motion: {speed: 0.5 m/s}
reduction: {modes: {ball: {count: 10}, rod: {count: 20}}}
run: {levels: [reduced], duration: 40 us, reduced_step: 20 ns, full_step: 0.1 us}
lumped: {stiffness: 1e8 N/m}
noise: {drive: {frequency: 10 Hz}}
"""


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    file = tmp_path_factory.mktemp("ball") / "ball.yaml"
    file.write_text(CASE)
    return klack.load_case(file)


def write(folder: Path, text: str, name: str = "study.yaml") -> Path:
    file = folder / name
    file.write_text(HEAD + text)
    return file


def columns(record, kind="measures"):
    return {item.name: item.values for item in getattr(record, kind)}


def changed(case, record, i):
    """Case of a point, by hand."""
    for item in (*record.parameters, *record.linked):
        value = float(item.values[i])
        case = case.with_value(item.name, value if item.unit == "1" else f"{value!r} {item.unit}")
    return case


@pytest.mark.slow
def test_every_point_is_the_impact_of_the_changed_case(ball, tmp_path):
    record = klack.run_study(ball, write(tmp_path, STUDY)).record
    assert (record.count, record.variant, record.threads) == (2, "reduced", 1)
    assert not record.failed.any()
    for i in (0, 1):
        found = klack.run_impact(changed(ball, record, i), ["reduced"])
        for name, values in columns(record).items():
            assert float(found.measures["reduced"][name]) == values[i], name
    today = klack.run_impact(ball, ["reduced"]).measures["reduced"]
    assert record.measures[0].today == float(today["peak_force"])
    assert "reduced, 10 + 20 modes, consistent law" in record.model
    assert "ball" in record.model


@pytest.mark.parametrize(
    ("key", "value", "level"),
    [
        ("lumped.stiffness", "{values: [2e8 N/m, 3e8 N/m]}", "lumped"),
        *(
            pytest.param(*point, marks=pytest.mark.slow)
            for point in (
                ("contact.gap", "{values: [1 um, 2 um]}", "reduced"),
                ("bodies.rod.mesh.contact.size", "{values: [0.025 mm, 0.03 mm]}", "reduced"),
                (YOUNG, "{values: [190 GPa, 200 GPa]}", "interface"),
                ("reduction.modes.ball.count", "{values: [8, 9]}", "reduced"),
                ("contact.friction", "{values: [0, 0.2]}", "reduced"),
                ("contact.friction", "{values: [0.2, 0]}", "interface"),
                ("run.reduced_step", "{values: [10 ns, 15 ns]}", "reduced-none"),
                (SPEED, "{values: [0.4 m/s, 0.5 m/s]}", "full"),
            )
        ),
    ],
)
def test_any_key_and_any_level(ball, tmp_path, key, value, level):
    """Of the second point, which finds the bodies of the first one if these are its own, too."""
    text = f"""
  parameters: {{{key}: {value}}}
  measures: [peak_force, restitution]
  design: {{kind: grid}}
  level: {level}
"""
    record = klack.run_study(ball, write(tmp_path, text)).record
    (item,) = record.parameters
    if item.is_whole:
        case = ball.with_value(key, int(item.values[1]))
    else:
        case = changed(ball, record, 1)
    found = klack.run_impact(case, [level]).measures[level]
    for name, values in columns(record).items():
        assert float(found[name]) == values[1]


@pytest.mark.slow
def test_many_points_of_your_own_program(ball):
    speeds = ["0.4 m/s", "0.5 m/s"]
    table = klack.run_many(ball, {SPEED: speeds}, ["peak_force", "restitution"], level="reduced")
    assert table.variant == "reduced"
    for i, speed in enumerate(speeds):
        single = klack.run_impact(ball.with_value(SPEED, speed), ["reduced"]).measures["reduced"]
        assert table["peak_force"][i] == float(single["peak_force"])
        assert table["restitution"][i] == float(single["restitution"])


@pytest.mark.slow
def test_points_of_the_same_bodies_build_them_once(ball, tmp_path, monkeypatch):
    """Speed, forces, damping and friction leave meshes and modes; a modulus does not."""
    built = []
    real = impacts.impact_bodies

    def counted(*given, **named):
        built.append(1)
        return real(*given, **named)

    monkeypatch.setattr(impacts, "impact_bodies", counted)
    for key, value in (("friction", 0.1), ("static_friction", 0.3), ("stribeck_speed", "0.1 m/s")):
        ball = ball.with_value(f"contact.{key}", value)
    klack.run_study(ball, write(tmp_path, STUDY.replace("\n  measures", RUBBING)))
    assert len(built) == 1
    text = STUDY.replace("measures", f"  {YOUNG}: {{values: [200 GPa, 210 GPa]}}\n  measures")
    file = write(tmp_path, text.replace("points: 2", "kind: grid, levels: 2"))
    source = study_of(ball.checked, ball.tree, file)
    points = [{SPEED: f"{v} m/s", YOUNG: f"{e} GPa"} for e in (200, 210) for v in (0.3, 0.4, 0.5)]
    asked = asked_of(ball.checked, ball.tree, source, points, ["peak_force"])
    assert [group.places for group in groups_of(asked, range(6))] == [(0, 1, 2), (3, 4, 5)]


@pytest.mark.slow
def test_doubts_of_an_impact_are_notes_of_its_point(ball, tmp_path):
    """A run that ends in contact, and a mesh that is too coarse."""
    text = """
  parameters: {run.duration: {values: [2 us, 40 us]}}
  measures: [peak_force, highest_force, restitution]
  design: {kind: grid}
"""
    record = klack.run_study(ball, write(tmp_path, text)).record
    assert np.isnan(columns(record)["peak_force"]).tolist() == [True, False]
    assert np.isfinite(columns(record)["highest_force"]).all()
    assert "the run ends before separation" in record.notes[0]
    assert any("1 of 2 points" in note for note in record.warnings)
    text = f"""
  parameters: {{bodies.ball.{SIZE}: {{values: [0.1 mm, 0.02 mm]}}}}
  linked: {{bodies.rod.{SIZE}: ball_mesh_contact_size}}
  measures: [peak_force]
  design: {{kind: grid}}
"""
    record = klack.run_study(ball, write(tmp_path, text)).record
    single = klack.run_impact(changed(ball, record, 0), ["reduced"]).record
    own = [note for note in single.warnings if "only for comparison" not in note]
    assert own
    assert set(own) <= set(record.notes[0].splitlines())
    assert "at 1 point" in record.model


@pytest.mark.slow
def test_a_level_that_is_not_the_answer_says_so_at_its_point(tmp_path):
    """A stiff spring in place of the consistent law: the interface level answers."""
    file = tmp_path / "stiff.yaml"
    law = "gap: 0 um, local_law: {kind: linear, stiffness: 1e10 N/m}}"
    text = CASE.replace("gap: 0 um}", law)
    file.write_text(text.replace("reduction: {", "reduction: {correction: attachment, "))
    text = """
  parameters: {contact.local_law.stiffness: {values: [1e9 N/m, 1e10 N/m]}}
  measures: [peak_force]
  design: {kind: grid}
"""
    record = klack.run_study(file, write(tmp_path, text)).record
    single = klack.run_impact(file, ["reduced"]).record
    assert single.reference == "interface"
    assert single.levels["reduced"].measures.peak_force == columns(record)["peak_force"][1]
    assert set(single.warnings) <= set(record.notes[1].splitlines())
    assert "Try: level: interface in the study" in record.notes[1]


@pytest.mark.slow
def test_a_point_that_fails_is_a_row(ball, tmp_path):
    text = """
  parameters: {contact.gap: {values: [1 um, 100 um]}}
  measures: [peak_force]
  design: {kind: grid}
"""
    record = klack.run_study(ball, write(tmp_path, text)).record
    assert record.failed.tolist() == [False, True]
    assert "first touch at" in record.failures[1]


@pytest.mark.slow
def test_noise_is_that_of_the_impact_of_the_changed_case(ball, tmp_path):
    text = """
  parameters: {motion.speed: {values: [0.4 m/s, 0.5 m/s]}}
  measures: [peak_force, noise.sound_exposure_level_weighted, noise.radiated_energy]
  design: {kind: grid}
"""
    record = klack.run_study(ball, write(tmp_path, text)).record
    impact = klack.run_impact(changed(ball, record, 0), ["reduced"])
    design = klack.noise_of(impact).record.designs[0]
    found = {f"noise.{item.key}": item.read(design) for item in DESIGN_MEASURES}
    for name in list(columns(record))[1:]:
        assert columns(record)[name][0] == found[name]
        assert np.isfinite(columns(record)[name]).all()


@pytest.mark.slow
def test_it_resumes_and_more_points_use_what_is_there(ball, tmp_path):
    out = tmp_path / "out"
    first = klack.run_study(ball, write(tmp_path, STUDY), folder=out).record
    again = klack.run_study(ball, write(tmp_path, STUDY), folder=out).record
    assert (first.computed, again.computed, again.kept) == (3, 0, 3)
    assert again.model == first.model
    more = write(tmp_path, STUDY.replace("points: 2", "points: 4"))
    second = klack.run_study(ball, more, folder=out).record
    assert second.computed == 2
    np.testing.assert_array_equal(columns(second)["peak_force"][:2], columns(first)["peak_force"])
    lumped = klack.run_study(ball, write(tmp_path, STUDY + "  level: lumped\n"), folder=out).record
    assert (lumped.computed, lumped.variant) == (3, "lumped")


@pytest.mark.slow
def test_processes_give_the_same_bits(ball, tmp_path):
    file = write(tmp_path, STUDY)
    here = klack.run_study(ball, file).record
    there = klack.run_study(ball, file, workers=2).record
    assert there.workers == "processes"
    for name, values in columns(here).items():
        np.testing.assert_array_equal(columns(there)[name], values)
    assert there.notes == here.notes
    assert there.model == here.model


OPTIMUM = """
  parameters:
    motion.speed: {from: 0.3 m/s, to: 0.6 m/s}
  measures: [impulse]
  objectives: {peak_force: minimise}
  constraints: {impulse: {least: today}}
  search: {population: 20, generations: 2, refinements: 4}
"""


@pytest.mark.slow
def test_optimum_keeps_its_bound_and_exports_its_case(ball, tmp_path):
    """Truth: force and impulse rise with the speed, so that the bound of today holds the speed."""
    out = tmp_path / "out"
    file = write(tmp_path, OPTIMUM)
    command = ["optimise", str(ball.tree.path), "--study", str(file), "--no-report"]
    assert main([*command, "--threads", "1", "--out", str(out)]) == 0
    record = klack.load_result(out).record
    best = record.optimum.best
    assert 0.5 <= columns(record, "parameters")[SPEED][best] < 0.52
    made = tmp_path / "made"
    assert main(["export", str(out), "--to", "case", "--point", str(best), "--out", str(made)]) == 0
    (file,) = made.glob("*.yaml")
    found = klack.run_impact(file, ["reduced"]).measures["reduced"]
    assert float(found["peak_force"]) == columns(record)["peak_force"][best]


@pytest.mark.slow
def test_impacts_made_after_the_case_are_counted(ball, tmp_path):
    """Truth: the peak force rises with the speed, so that half of them are above that of today."""
    text = """
  parameters: {motion.speed: {from: 0.3 m/s, to: 0.6 m/s}}
  measures: [peak_force]
  constraints: {peak_force: {most: today}}
  robust: {scatter: {motion.speed: 0.02 m/s}}
"""
    record = klack.run_study(ball, write(tmp_path, text), made=4).record
    speed, force = columns(record, "parameters")[SPEED], columns(record)["peak_force"]
    assert record.missed[0].missed == 2
    assert (np.argsort(speed) == np.argsort(force)).all()


WRONG = [
    (SPEED, "network.components.spring.preload", "there is no 'network'"),
    (SPEED, "motion.sped", "did you mean 'speed'?"),
    ("peak_force,", "opening_time,", "peak_force"),
    ("peak_force,", "seat.peak_force,", "write peak_force."),
    ("peak_force,", "noise.loudnes,", "noise.loud"),
    ("peak_force,", "wall_time,", "one of"),
    ("points: 2}", "points: 2}\n  variant: dry", "only strokes have variants"),
    ("points: 2}", "points: 2}\n  level: reducd", "reduced"),
    (
        f"{SPEED}: {{from: 0.3 m/s, to: 0.6 m/s}}",
        "run.levels.0: {values: [full]}",
        "a single level",
    ),
]


@pytest.mark.parametrize(("old", "new", "words"), WRONG)
def test_what_cannot_be_is_one_error(ball, tmp_path, capsys, old, new, words):
    assert old in STUDY
    file = write(tmp_path, STUDY.replace(old, new, 1))
    out = tmp_path / "out"
    assert main(["study", str(ball.tree.path), "--study", str(file), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert "Traceback" not in said


def test_a_level_of_a_valve_is_refused(tmp_path):
    small = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"
    text = """
  parameters: {lift: {from: 90 um, to: 110 um}}
  linked: {network.components.opening.gap: lift}
  measures: [opening_time]
  level: reduced
"""
    with pytest.raises(InputError, match="only impacts have levels"):
        klack.run_study(small, write(tmp_path, text))


def test_the_section_of_the_case_serves_as_well(ball, tmp_path):
    case = tmp_path / "case.yaml"
    case.write_text(CASE + "study:" + STUDY.replace("points: 2", "kind: grid, levels: 1"))
    assert klack.run_study(case).record.count == 1


class TestDerivatives:
    """By differences; truth: dimensional analysis of elastic bodies, and impacts on both sides."""

    @pytest.mark.slow
    def test_stiffer_bodies_hit_as_dimensions_say(self, ball):
        """F / (E L^2) and t c / L depend on v / c alone, c^2 = E / rho, without forces."""
        record = klack.sensitivities(
            ball, parameters=[SPEED, YOUNG], measures=["peak_force", "contact_time", "impulse"]
        )
        force, time, push = (
            [record.elasticity(name, key) for key in (SPEED, YOUNG)]
            for name in ("peak_force", "contact_time", "impulse")
        )
        assert force[0] == pytest.approx(1.2, abs=0.1)  # 6/5 of Hertz, without waves in the rod
        assert force[1] == pytest.approx(1.0 - 0.5 * force[0], abs=2e-3)
        # 1 % are 70 ns, of which a step of 20 ns leaves some per cent open
        assert time[1] == pytest.approx(-0.5 - 0.5 * time[0], abs=0.02)
        assert push[1] == pytest.approx(0.5 - 0.5 * push[0], abs=2e-3)
        assert record.by_differences
        assert record.variant == "reduced"
        assert all(item.deviation < 0.01 for item in record.measures)

    def test_comes_back_from_disk_and_has_a_report(self, tmp_path):
        """Truth: the record; the order of elasticities, -2 and +0.5 of the peak."""
        peak = MeasureSlopes(
            name="peak_force",
            title="peak force",
            unit="N",
            value=100.0,
            slopes=(50.0, -2e9, None),
            predicted=1.5,
            secant=None,
            scale=2.0,
            resolution=0.0,
        )
        record = SensitivityRecord(
            title="a ball",
            description="",
            version="0",
            versions={},
            created="2026-01-31T12:00:00+00:00",
            wall_time=1.0,
            stage_times={},
            case="ball",
            case_text="klack: 1",
            variant="dry",
            parameters=(
                SlopeParameter(name=SPEED, unit="m/s", value=1.0),
                SlopeParameter(name="contact.gap", unit="m", value=1e-7),
                SlopeParameter(name=YOUNG, unit="Pa", value=2e11),
            ),
            measures=(peak, replace(peak, name="time", value=None, slopes=(None, None, None))),
            impacts=(
                ImpactSlope(
                    stop="seat",
                    number=1,
                    time=1e-3,
                    growth=2e-4,
                    deviation=None,
                    is_doubtful=False,
                ),
            ),
            share=0.0,
            runs_time=1.0,
            run_time=0.0,
            warnings=("a doubt",),
        )
        found = klack.load_result(SENSITIVITIES.save(record, tmp_path))

        assert vars(found.record) == vars(record)
        page = found.analysis.content(found.record)
        assert [row[0] for row in page.numbers.rows] == ["peak_force", "time"]
        assert page.numbers.rows[0][2:] == ("contact.gap", "\N{MINUS SIGN}2.0000")
        assert page.numbers.rows[1][1:] == ("no value", "–", "–")
        (bars,) = page.sections[0].charts
        assert bars.rows == ("contact.gap", SPEED)
        assert [part.values for part in bars.parts] == [(0.0, 0.5), (2.0, 0.0)]
        assert "not checked" in page.answer
        assert page.warnings == ("a doubt",)

    @pytest.mark.slow
    def test_value_is_that_of_the_impact(self, ball):
        record = klack.sensitivities(ball, parameters=[SPEED], check=False)
        single = klack.run_impact(ball, ["reduced"]).measures["reduced"]
        assert [item.name for item in record.measures] == [
            "peak_force",
            "contact_time",
            "impulse",
            "restitution",
        ]
        for item in record.measures:
            assert item.value == float(single[item.name])
            assert item.predicted is not None
            assert item.secant is None

    @pytest.mark.slow
    def test_jumps_are_told(self, ball):
        """The number of contacts does not change smoothly, and here not at all."""
        record = klack.sensitivities(ball, parameters=[SPEED], measures=["sub_contacts"])
        assert record.measures[0].slopes == (0.0,)

    @pytest.mark.slow
    def test_command(self, ball, tmp_path, capsys):
        """Truth of the stored result: its JSON is that of the command."""
        file, out = tmp_path / "ball.yaml", tmp_path / "out"
        file.write_text(CASE)
        numbers = tmp_path / "numbers.json"
        command = ["sensitivities", str(file), "--parameter", SPEED, "--json", str(numbers)]
        command += ["--out", str(out)]
        assert main(command) == 0
        assert "by differences of impacts" in " ".join(capsys.readouterr().out.split())
        told = json.loads(numbers.read_text())
        assert told["method"] == "differences"
        assert sorted(path.name for path in out.iterdir()) == [
            "report.html",
            "report.pdf",
            "result.zarr",
        ]
        assert klack.load_result(out).json == told
        for more, words in (
            (["--variant", "dry"], "only strokes have variants"),
            (["--parameter", "contact.gap"], "a value of zero"),
            (["--measure", "seat.peak_force"], "write peak_force"),
            (["--level", "reduce"], "reduced"),
        ):
            assert main([*command, *more, "-q"]) == 2
            assert words in capsys.readouterr().err
