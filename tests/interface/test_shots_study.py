"""Shots as points of a study: numbers, shared bodies, unfinished shots, and what is refused.

Truth: ``klack shots`` of the changed cases, bit for bit; NumPy for statistics.
"""

from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import yaml
from energy_ledger import allowed

import klack
from klack.analyses.shots.analysis import SHOTS
from klack.analyses.shots.model import build_shots
from klack.analyses.shots.one_shot import shot_log
from klack.analyses.shots.record import RESULTS, ShotColumns
from klack.analyses.shots.run import DroppedShots, drop_shots, run_shots
from klack.analyses.study import impacts
from klack.analyses.study.asked_points import groups_of
from klack.analyses.study.evaluation import asked_of
from klack.analyses.study.measures import SHOT_NAMES, shot_measure, shot_notes
from klack.case.study_source import study_of
from klack.cli.main import main
from klack.machine.progress import silent

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
NEEDLE = (HOW_TO / "guided_needle.yaml").read_text().replace("  count: 6\n", "  count: 2\n")
CLEARANCE, SPEED, YOUNG = "guide.clearance", "motion.speed", "materials.steel.young"
MEASURES = (
    *("shots.restitution.mean", "shots.restitution.sd", "shots.restitution.standard_error"),
    *("shots.rebound_height.lowest", "shots.peak_force.median", "shots.contact_time.q75"),
    *("shots.impulse.q95", "shots.rocking.highest", "shots.centric.restitution"),
    *("shots.rule.relative_restitution_bias", "shots.rule.rebound_height_bias", "shots.rule.rank"),
)
STUDY = f"""
  parameters:
    {CLEARANCE}: {{values: [2 um, 3 um]}}
  measures: [shots.restitution.mean, shots.centric.peak_force]
  design: {{kind: grid}}
"""


@pytest.fixture(autouse=True)
def in_steps_twice_as_long():
    """The check of a step compares with 100 ns, in which the bore gives off 0.4 % of the energy."""
    with allowed("simulate_interface", 1e-2):
        yield


@pytest.fixture(scope="module")
def needle(tmp_path_factory):
    file = tmp_path_factory.mktemp("needle") / "needle.yaml"
    file.write_text(NEEDLE)
    return klack.load_case(file)


def write(folder: Path, text: str, name: str = "study.yaml") -> Path:
    file = folder / name
    file.write_text("klack: 1\nstudy:\n" + text)
    return file


def columns(record):
    return {item.name: item.values for item in record.measures}


def by_hand(study, name: str) -> float:
    """Number of a measure from the record of ``klack shots``."""
    _, of, key = name.split(".")
    if of == "centric":
        return float(getattr(study.centric, key)[0])
    if of == "rule":
        return float(getattr(study.rule, key))
    values = getattr(study.shots, of)
    known = {
        "mean": np.mean,
        "sd": np.std,
        "standard_error": lambda x: np.std(x, ddof=1) / np.sqrt(len(x)),
        "lowest": np.min,
        "q75": lambda x: np.quantile(x, 0.75),
        "q95": lambda x: np.quantile(x, 0.95),
        "median": np.median,
        "highest": np.max,
    }
    return float(known[key](values))


def changed(case, values):
    for key, value in values.items():
        case = case.with_value(key, value)
    return case.checked


@pytest.mark.slow
def test_every_point_has_the_bits_of_klack_shots(needle, tmp_path):
    """Two designs of the same bodies; the second one finds them used."""
    rows = [
        {CLEARANCE: "2 um", SPEED: "0.25 m/s", "shots.seed": 1, "shots.force.uniform.1": "1 N"},
        {CLEARANCE: "3.5 um", SPEED: "0.3 m/s", "shots.seed": 7, "shots.force.uniform.1": "1.5 N"},
    ]
    table = "\n".join(",".join(map(str, row.values())) for row in rows)
    (tmp_path / "points.csv").write_text(f"{','.join(rows[0])}\n{table}\n")
    keys = "\n".join(f"    {key}: {{values: [{rows[0][key]}, {rows[1][key]}]}}" for key in rows[0])
    text = f"""
  parameters:
{keys}
  measures: [{", ".join(MEASURES)}]
  design: {{kind: file, file: points.csv}}
"""
    record = klack.run_study(needle, write(tmp_path, text)).record
    assert not record.failed.any()
    assert record.variant == "shots"
    for i, row in enumerate(rows):
        single = run_shots(changed(needle, row), workers=1)
        for name, values in columns(record).items():
            assert values[i] == by_hand(single, name), name
        moments = SHOTS.to_json(single)["distribution"]["restitution"]
        assert moments["standard_error"] == columns(record)["shots.restitution.standard_error"][i]
    assert record.model.startswith("shots at the interface level, 6 + 6 modes; needle ")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "values"),
    [
        ("shots.count", "[3, 4]"),
        ("shots.impacts", "[2, 3]"),
        ("shots.duration", "[0.9 ms, 1 ms]"),
        ("shots.step", "[45 ns, 50 ns]"),
        ("shots.friction", "[0, 0.3]"),
        ("shots.contact_friction", "[0, 0.2]"),
        ("contact.friction", "[0, 0.2]"),
        ("shots.waviness.harmonics.1", "[8, 12]"),
        ("guide.friction", "[0, 0.2]"),
        ("guide.viscous", "[0 N s/m, 0.02 N s/m]"),
        ("guide.heights.1", "[6 mm, 7 mm]"),
        ("motion.force", "[0.5 N, 2 N]"),
        ("bodies.needle.damping.modal", "[0.005, 0.02]"),
        ("reduction.modes.needle.count", "[5, 6]"),
        ("contact.gap", "[1 um, 2 um]"),
        (YOUNG, "[190 GPa, 210 GPa]"),
    ],
)
def test_any_key(needle, tmp_path, key, values):
    text = f"""
  parameters: {{{key}: {{values: {values}}}}}
  measures: [{", ".join(MEASURES)}]
  design: {{kind: grid}}
"""
    given = yaml.safe_load(values)
    case = needle.with_value(key, given[0])
    record = klack.run_study(case, write(tmp_path, text)).record
    for i, value in enumerate(given):
        single = run_shots(changed(case, {key: value}), workers=1)
        for name, found in columns(record).items():
            assert found[i] == by_hand(single, name), (name, value)


@pytest.mark.slow
def test_designs_of_the_same_bodies_build_them_once(needle, tmp_path, monkeypatch):
    """Clearance, speed, force and draws leave meshes and modes; a modulus does not."""
    built = []
    real = impacts.shot_bodies

    def counted(*given, **named):
        built.append(1)
        return real(*given, **named)

    monkeypatch.setattr(impacts, "shot_bodies", counted)
    klack.run_study(needle, write(tmp_path, STUDY))
    assert len(built) == 1
    source = study_of(needle.checked, needle.tree, tmp_path / "study.yaml")
    points = [
        {CLEARANCE: f"{c} um", SPEED: "0.2 m/s", YOUNG: f"{e} GPa"}
        for e in (200, 210)
        for c in (2, 3)
    ]
    asked = asked_of(needle.checked, needle.tree, source, points, ["shots.restitution.mean"])
    assert [group.places for group in groups_of(asked, range(4))] == [(0, 1), (2, 3)]


@pytest.mark.slow
def test_impact_and_shots_of_the_same_points(needle, tmp_path):
    text = (
        STUDY.replace("[shots", "[peak_force, noise.radiated_energy, shots")
        + "  level: interface\n"
    )
    text = text.replace("3 um", "2.5 um")
    out = tmp_path / "out"
    record = klack.run_study(needle, write(tmp_path, text), folder=out).record
    assert record.variant == "interface + shots"
    case = needle.with_value(CLEARANCE, "2.5 um")  # the second point, with bodies of the first
    impact = klack.run_impact(case, ["interface"])
    assert columns(record)["peak_force"][1] == float(impact.measures["interface"]["peak_force"])
    single = run_shots(case.checked, workers=1)
    for name in ("shots.restitution.mean", "shots.centric.peak_force"):
        assert columns(record)[name][1] == by_hand(single, name)
    assert record.model.count("needle ") == 1
    assert "; shots at the interface level, 6 + 6 modes; " in record.model
    assert klack.run_study(needle, tmp_path / "study.yaml", folder=out).record.computed == 0
    alone = write(tmp_path, STUDY, "alone.yaml")
    assert klack.run_study(needle, alone, folder=out).record.computed == 3  # of another kind


# --------------------------------------------------------------------------- unfinished shots


def dropped(**given) -> DroppedShots:
    """Three shots and a centred one with these numbers, zeros elsewhere."""

    def made(own) -> ShotColumns:
        count = len(next(iter(own.values())))
        return ShotColumns(
            **{
                item.name: np.array(own.get(item.name, [0.0] * count))
                for item in fields(ShotColumns)
            }
        )

    found = DroppedShots(checked=None, draws=(), outcomes=(), alone=None)
    centric = {key: [values[0]] for key, values in given.items()}
    vars(found).update(shots=made(given), centric=made(centric))
    return found


def value(name: str, found: DroppedShots) -> float | None:
    class Run:
        shots = found

    return shot_measure(name).value(Run)


def test_statistics_are_of_all_shots_or_of_none():
    """A shot without a rebound is one of the highest: a mean of the others would be too low."""
    found = dropped(restitution=[0.9, 0.8, 0.7], rebound_height=[2e-5, np.nan, 1e-5])
    assert value("shots.restitution.mean", found) == pytest.approx(0.8)
    assert value("shots.restitution.sd", found) == pytest.approx(np.sqrt(0.02 / 3))
    assert value("shots.restitution.standard_error", found) == pytest.approx(0.1 / np.sqrt(3))
    for statistic in ("mean", "sd", "standard_error", "lowest", "q05", "median", "highest"):
        assert np.isnan(value(f"shots.rebound_height.{statistic}", found))
    assert value("shots.rule.rank", found) is None
    assert value("shots.centric.rebound_height", found) == 2e-5
    names = ["shots.rebound_height.mean", "shots.restitution.mean", "shots.centric.restitution"]
    (note,) = shot_notes(names, found)
    assert note.startswith("1 of 3 shots ended before their rebound height was known")
    assert shot_notes(names[1:], found) == ()
    assert shot_notes(["shots.rule.rank"], found) == (note,)


def test_quantiles_of_few_shots_are_doubted():
    found = dropped(restitution=[0.9, 0.8, 0.7])
    (note,) = shot_notes(["shots.restitution.q05", "shots.restitution.median"], found)
    assert note.startswith("3 shots are too few for their 5 % quantile, which needs 20.")
    many = dropped(restitution=np.linspace(0.7, 0.9, 20).tolist())
    assert shot_notes(["shots.restitution.q05"], many) == ()
    assert np.isnan(value("shots.restitution.standard_error", dropped(restitution=[0.9])))


def test_the_rule_is_that_of_klack_shots():
    found = dropped(restitution=[0.8, 0.82, 0.7], rebound_height=[2e-5, 2.2e-5, 1e-5])
    assert value("shots.rule.relative_restitution_bias", found) == pytest.approx(0.025)
    assert value("shots.rule.rebound_height_bias", found) == pytest.approx(2e-6)
    assert value("shots.rule.rank", found) == 2


@pytest.mark.slow
def test_a_point_of_unfinished_shots_says_so(needle, tmp_path):
    text = """
  parameters: {shots.duration: {values: [0.1 ms]}}
  measures: [shots.rebound_height.mean, shots.peak_force.mean, shots.centric.rebound_height]
  design: {kind: grid}
"""
    text = text.replace("[0.1 ms]", "[0.1 ms, 1 ms]")
    record = klack.run_study(needle, write(tmp_path, text)).record
    height, force, centred = columns(record).values()
    assert np.isnan([height[0], centred[0]]).all()
    assert np.isfinite([force[0], height[1], centred[1]]).all()
    assert "2 of 2 shots ended before their rebound height was known" in record.notes[0]
    assert "The centred shot ended before its rebound height was known" in record.notes[0]
    assert not record.notes[1]


@pytest.mark.slow
def test_a_point_whose_shots_fail_is_a_row(needle, tmp_path):
    case = needle.with_value("contact.reach", "3 um")
    text = """
  parameters: {contact.reach: {values: [0.02 um, 3 um]}}
  measures: [shots.peak_force.mean]
  design: {kind: grid}
"""
    record = klack.run_study(case, write(tmp_path, text)).record
    assert record.failed.tolist() == [True, False]
    assert "Try: enlarge the reach" in record.failures[0]


# --------------------------------------------------------------------------- what is refused

VARIED = f"{CLEARANCE}: {{values: [2 um, 3 um]}}"
WRONG = [
    ("study", "restitution.mean", "restitution.maen", "did you mean 'shots.restitution.mean'?"),
    ("study", "restitution.mean", "restitution", "write shots.restitution.mean"),
    ("study", "restitution.mean", "eccentricity.mean", "a statistic of: mean, sd"),
    (
        "study",
        "centric.peak_force",
        "centred.peak_force",
        "did you mean 'shots.centric.peak_force'?",
    ),
    ("study", "shots.centric.peak_force", "centric.peak_force", "write peak_force"),
    ("study", VARIED, "shots.seed: {from: 1, to: 3}", "{values:"),
    (
        "optimise",
        f"{CLEARANCE}: {{values: [2 um, 3 um]}}",
        "shots.seed: {values: [1, 2]}",
        "most favourable draw",
    ),
    (
        "optimise",
        f"{CLEARANCE}: {{values: [2 um, 3 um]}}",
        "shots.count: {values: [4, 9]}",
        "most favourable draw",
    ),
]


@pytest.mark.parametrize(("command", "old", "new", "words"), WRONG)
def test_what_cannot_be_is_one_error(needle, tmp_path, capsys, command, old, new, words):
    assert old in STUDY
    text = STUDY.replace(old, new, 1)
    if command == "optimise":
        text += "  objectives: {shots.restitution.mean: minimise}\n"
    file = write(tmp_path, text)
    out = tmp_path / "out"
    assert main([command, str(needle.tree.path), "--study", str(file), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert words in said
    assert str(file) in said
    assert "Traceback" not in said
    assert not out.exists()


@pytest.mark.parametrize(
    ("case", "key", "words"),
    [
        ("small_valve.yaml", "lift", "shots are drops of two bodies"),
        ("no_shots.yaml", "motion.speed", "add 'shots: {count: 50}' to the case"),
    ],
)
def test_cases_without_shots_are_refused(tmp_path, capsys, case, key, words):
    (tmp_path / "no_shots.yaml").write_text(NEEDLE[: NEEDLE.index("shots:")])
    path = HOW_TO / case if (HOW_TO / case).exists() else tmp_path / case
    spread = "{from: 90 um, to: 110 um}" if key == "lift" else "{from: 0.2 m/s, to: 0.3 m/s}"
    text = f"""
  parameters: {{{key}: {spread}}}
  {"linked: {network.components.opening.gap: lift}" if key == "lift" else ""}
  measures: [shots.restitution.mean]
"""
    file = write(tmp_path, text)
    assert main(["study", str(path), "--study", str(file), "--out", str(tmp_path / "out")]) == 2
    assert words in capsys.readouterr().err


def test_names_are_those_of_the_catalogue():
    for name in SHOT_NAMES:
        item = shot_measure(name)
        assert (item.name, item.of) == (name, "shots")
        assert item.measure.definition
    assert len(set(SHOT_NAMES)) == len(SHOT_NAMES)
    assert {item.key for item in RESULTS} >= {"restitution", "rebound_height", "rocking", "impacts"}


# --------------------------------------------------------------------------- end to end


@pytest.mark.slow
def test_processes_resume_report_and_export(needle, tmp_path, capsys):
    """The same rows on two processes, from the log, in JSON and as CSV."""
    command = ["study", str(needle.tree.path), "--study", str(write(tmp_path, STUDY)), "--quiet"]
    logs = []
    for words in (["--workers", "2"], ["--threads", "1"]):
        out = tmp_path / words[0].strip("-")
        assert main([*command, *words, "--out", str(out), "--json", str(out) + ".json"]) == 0
        (log,) = out.glob("points-*.jsonl")
        logs.append(sorted(log.read_text().splitlines()))
    assert logs[0] == logs[1]
    assert "shots restitution mean" in (out / "report.html").read_text()
    kept = log.read_text().splitlines(keepends=True)
    log.write_text("".join(kept[:-1]) + kept[-1][:30])  # as a killed run leaves it
    assert main([*command, "--threads", "1", "--out", str(out), "--no-report"]) == 0
    assert sorted(log.read_text().splitlines()) == logs[0]
    assert klack.load_result(out).record.computed == 1
    capsys.readouterr()
    assert main(["export", str(out), "--to", "csv", "--out", str(tmp_path / "csv")]) == 0
    (table,) = (tmp_path / "csv").glob("*.csv")
    assert "shots.restitution.mean" in table.read_text().splitlines()[0]


@pytest.mark.slow
def test_valves_made_after_the_case_scatter_by_their_clearance_alone(needle, tmp_path):
    """Truth: the same draws, scaled by the clearance, rock the more the farther off-axis they are.

    With draws of their own the few shots of each valve would come in any order.
    """
    text = """
  parameters: {guide.clearance: {from: 1 um, to: 4 um}, shots.duration: 0.1 ms}
  measures: [shots.rocking.mean]
  constraints: {shots.rocking.mean: {most: 0.5}}
  robust: {scatter: {guide.clearance: 0.05 um}}
"""
    record = klack.run_study(needle, write(tmp_path, text), made=4).record
    (clearance,) = (item.values for item in record.parameters if item.name == CLEARANCE)
    assert len(set(clearance)) == 4
    rocking = columns(record)["shots.rocking.mean"]
    assert (np.argsort(clearance) == np.argsort(rocking)).all()
    assert record.missed[0].points == 4


@pytest.mark.slow
def test_a_search_finds_the_smallest_clearance_and_exports_it(needle, tmp_path, capsys):
    """Truth: on the same draws a needle rocks the less the smaller its clearance."""
    text = """
  parameters: {guide.clearance: {from: 2 um, to: 3 um}, shots.duration: 0.1 ms}
  measures: [shots.restitution.mean]
  objectives: {shots.rocking.mean: minimise}
  search: {population: 20, generations: 1, refinements: 0}
"""
    out, file = tmp_path / "out", write(tmp_path, text)
    command = ["optimise", str(needle.tree.path), "--study", str(file), "--no-report"]
    assert main([*command, "--threads", "1", "--out", str(out)]) == 0
    assert "to which the best point is adapted" in " ".join(capsys.readouterr().out.split())
    record = klack.load_result(out).record
    best = record.optimum.best
    clearance = next(item.values for item in record.parameters if item.name == CLEARANCE)
    assert best == np.argmin(clearance)
    made = tmp_path / "made"
    assert main(["export", str(out), "--to", "case", "--point", str(best), "--out", str(made)]) == 0
    (file,) = made.glob("*.yaml")
    case = klack.load_case(file).checked
    model = build_shots(case, silent, threads=1)
    found = drop_shots(case, model, 2, 1, 1, shot_log(None, ""), silent)
    for name, values in columns(record).items():
        assert values[best] == by_hand(found, name)
