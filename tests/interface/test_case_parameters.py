"""Parameters and expressions in cases; truth: the same case with plain values."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import klack
from klack.analyses.analysis import StoredAnalysis
from klack.analyses.catalogue import analyses
from klack.analyses.record import CaseRecord, case_fields, run_fields
from klack.analyses.sensitivities.record import SensitivityRecord
from klack.analyses.study.asked_points import groups_of
from klack.analyses.study.strokes import STROKES
from klack.case import read_case
from klack.case.any_case import read_valve_case, tree_of
from klack.case.key_path import quantity_at, split_path
from klack.case.measurement import CaseCalibration
from klack.case.points import points_of
from klack.case.rewriting import rewritten, written_quantity
from klack.cli.main import main
from klack.errors import InputError
from klack.input.problem import CaseProblem
from klack.machine.progress import silent
from klack.machine.stages import StageClock
from klack.simulation.network_run import simulate_network

SMALL = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"
TEXT = SMALL.read_text(encoding="utf-8")
IMPACT = Path(__file__).parents[1] / "data" / "case" / "drawn.yaml"


def with_parameters(parameters: str, *pairs: str) -> str:
    text = TEXT.replace("network:", f"parameters: {{{parameters}}}\nnetwork:", 1)
    for old, new in zip(pairs[::2], pairs[1::2], strict=True):
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return text


PARAMETRIC = with_parameters(
    "k: 10 N/mm, x0: 1.2 mm, lift: 100 um, holes: 4, r: 1.5 mm, t0: 10 us",
    "preload: 12 N",
    'preload: "= k * x0"',
    "stiffness: 10 N/mm",
    "stiffness: = k",
    "gap: 100 um",
    "gap: = lift",
    "count: 4",
    "count: = holes",
    "inner_radius: 1.5 mm",
    "inner_radius: = r",
    "outer_radius: 2 mm",
    "outer_radius: = r + 0.5 mm",
    "time: [10 us, 11 us, 1000 us, 1001 us]",
    "time: [= t0, = t0 + 1 us, = 100 * t0, = 100 * t0 + 1 us]",
    "restitution: 0.5}",
    "restitution: = 2 / holes}",
)
SPARE = with_parameters(
    'k: 10 N/mm, x0: 1.2 mm, twice: "= 2 * x0", spare: 3 mm, other: "= 2 * spare"',
    "preload: 12 N",
    'preload: "= k * twice / 2"',
)


@pytest.mark.slow
def test_a_case_with_parameters_is_that_with_numbers_to_the_bit():
    plain = read_valve_case(TEXT, SMALL)
    case = read_valve_case(PARAMETRIC, SMALL)

    assert case.network.components == plain.network.components
    assert str(case.parameters["lift"]) == "100 um"
    runs = [
        simulate_network(item.network.network().rows(), duration=1e-3, record=1e-5)
        for item in (plain, case)
    ]
    for name, series in runs[0].channels.items():
        assert np.array_equal(series.values, runs[1].channels[name].values), name


@pytest.mark.parametrize(
    ("key", "text", "value"),
    [
        ("face", "{type: pressure-face, direction: closing, area: = pi/4 * d^2}", 2.5e-5 * math.pi),
        ("face", "{type: pressure-face, direction: closing, area: = 78 mm^2 + 0}", 7.8e-5),
    ],
)
def test_an_expression_is_computed(key, text, value):
    case = read_valve_case(
        with_parameters(
            "d: 10 mm", "{type: pressure-face, direction: closing, outer_diameter: 10 mm}", text
        ),
        SMALL,
    )

    assert case.network.components[key].area == pytest.approx(value, rel=1e-14, abs=0.0)


def area(text: str, parameters: str = "d: 10 mm, p: 5 bar, n: 4, f: 50 Hz") -> str:
    return with_parameters(parameters, "preload: 12 N", f'preload: "{text}"')


MISTAKES = {
    "another dimension": (area("= d"), "'= d', which is 0.01, a length [m]", "a force [N]"),
    "sum of two kinds": (area("= d + p"), "'d' is a length [m] and 'p' is a pressure", "one kind"),
    "unknown name": (area("= p * dd^2"), "unknown name 'dd'", "names among: d, p, n, f"),
    "syntax": (area("= p * (d"), "a '(' without its ')' at character 5", "arithmetic"),
    "no unit": (area("= 12 * n"), "48 without unit, from '= 12 * n'", "a force"),
    "empty": (area("="), "no expression", "arithmetic"),
    "zero division": (area("= 12 N / (n - 4)"), "divides by zero (n = 4, SI units)", "finite"),
    "range of the kind": (area("= 1e20 N"), "", "of a magnitude between"),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_names_file_key_expression_and_what_was_expected(name):
    text, got, expected = MISTAKES[name]
    with pytest.raises(InputError) as caught:
        read_valve_case(text, SMALL)

    line = text[: text.index("preload:")].count("\n") + 1
    assert caught.value.where == f"{SMALL}:{line}: network.components.spring.preload"
    assert got in caught.value.got
    assert expected in caught.value.expected


def test_a_value_out_of_the_bounds_of_its_key_tells_its_expression():
    text = with_parameters("k: 10 N/mm", "stiffness: 10 N/mm", "stiffness: = -k")
    with pytest.raises(InputError, match="a value above 0") as caught:
        read_valve_case(text, SMALL)

    assert "'= -k', which is -10000, a stiffness [N/m]" in caught.value.got


@pytest.mark.parametrize(
    ("parameters", "got"),
    [
        ("a: = b, b: = a", "expressions that form a loop"),
        ("a: 2 * a", "expressions that form a loop: a needs a"),
        ("pi: 3", "'pi', which is a function or pi"),
        ("min: 3 mm", "'min', which is a function or pi"),
        ("a-b: 3 mm", ""),
        ("µ: 3 mm", ""),
        ("1: 3 mm", ""),
        ("a: ", "nothing"),
        ("a: [1 mm]", "['1 mm']"),
        ("a: true", "'True'"),
        ("a: 1 mm + 1 N", "'1 N' is a force"),
        ("a: 3 foo", "unknown unit 'foo'"),
        ("a: 1 / 0", "divides by zero"),
        ("a: .nan", ""),
        ("a: .inf", ""),
        ("a: 1e300", ""),
    ],
)
def test_a_wrong_parameter_is_one_error_at_its_line(parameters, got):
    with pytest.raises(InputError) as caught:
        read_valve_case(with_parameters(parameters), SMALL)

    assert got in caught.value.got
    assert caught.value.where.startswith(f"{SMALL}:4: parameters")


def test_a_name_with_a_hyphen_would_be_a_difference():
    with pytest.raises(InputError) as caught:
        read_valve_case(with_parameters("a-b: 3 mm"), SMALL)

    assert caught.value.expected == "a name of letters, digits and _, not starting with a digit"


def test_a_chain_of_parameters_is_computed_in_any_order():
    text = with_parameters("c: 2 * b, b: a + 1 N, a: 5 N", "preload: 12 N", "preload: = c")

    assert read_valve_case(text, SMALL).network.components["spring"].preload == 12.0


def test_angles_frequencies_and_rates_are_told_apart():
    parameters = "f: 50 Hz, w: 2 * pi * f, alpha: pi / 4, T: 293.15 K"
    case = read_valve_case(with_parameters(parameters), SMALL)
    kinds = {name: item.kind.name for name, item in case.parameters.items()}

    assert kinds["f"] == "a frequency"
    assert kinds["w"] == "a rate"
    assert kinds["T"] == "a temperature"
    assert case.parameters["alpha"].dimension.fits("rad")
    assert case.parameters["alpha"].dimension.fits("-")


def test_titles_are_words_and_an_expression_in_a_list_of_words_is_refused():
    title = "title: A small valve of rigid parts"
    case = read_valve_case(TEXT.replace(title, 'title: "= A small valve"', 1), SMALL)
    assert case.title.startswith("=")
    with pytest.raises(InputError, match="variants"):
        read_valve_case(TEXT.replace("variants: [dry, wet]", 'variants: ["= 2 * 3 mm"]'), SMALL)


def test_an_impact_case_has_parameters_as_well():
    text = IMPACT.read_text(encoding="utf-8")
    plain = read_case(text, IMPACT)
    line = next(line for line in text.splitlines() if "speed:" in line)
    value = line.split("speed:")[1].split(",")[0].split("}")[0].split("#")[0].strip()
    head, rest = text.replace(f"speed: {value}", "speed: = 2 * v", 1).split("\n", 1)
    case = read_case(f"{head}\nparameters: {{v: {plain.motion.speed / 2!r} m/s}}\n{rest}", IMPACT)

    assert case.motion.speed == plain.motion.speed
    assert case.behind(("parameters", "v")) == (("motion", "speed"),)


def test_a_parameter_is_varied_like_a_key_and_written_alone():
    tree = tree_of(PARAMETRIC, SMALL)
    place = quantity_at(tree.case(), split_path("parameters.lift"))

    assert tree.case({place.key: place.written(9e-5)}).network.components["opening"].gap == 9e-5
    text = rewritten(tree, {place.key: written_quantity(tree, place, 9.5e-5)})
    assert text == PARAMETRIC.replace("lift: 100 um", "lift: 95 um")


def test_a_parameter_that_is_an_expression_is_replaced_by_a_quantity():
    tree = tree_of(with_parameters("a: 2 * 3 N, b: a", "preload: 12 N", "preload: = b"), SMALL)
    for name in ("a", "b"):
        place = quantity_at(tree.case(), ("parameters", name))
        assert place.value == 6.0
        new = rewritten(tree, {place.key: written_quantity(tree, place, 7.5)})
        assert read_valve_case(new, SMALL).network.components["spring"].preload == 7.5


@pytest.mark.parametrize("value", ["90 bar", "90", "= lift", "-90 um + "])
def test_another_kind_of_value_for_a_parameter_is_refused(value):
    place = quantity_at(tree_of(PARAMETRIC, SMALL).case(), ("parameters", "lift"))

    with pytest.raises(InputError):
        place.parse(value)


def test_a_parameter_without_use_is_refused_where_it_is_varied():
    tree = tree_of(with_parameters("a: 2 mm"), SMALL)

    with pytest.raises(CaseProblem, match="on which no value of the case depends"):
        quantity_at(tree.case(), ("parameters", "a"))


def test_keys_behind_a_parameter_follow_through_others():
    case = tree_of(
        with_parameters("a: 3 N, b: 2 * a, c: 1 mm", "preload: 12 N", "preload: = b + 6 N"), SMALL
    ).case()

    spring = ("network", "components", "spring", "preload")
    assert case.behind(("parameters", "a")) == case.behind(("parameters", "b")) == (spring,)
    assert case.behind(("parameters", "c")) == ()
    assert case.behind(spring) == (spring,)


CALIBRATION = """
calibration:
  parameters: {{k: {{key: {key}, lower: {lower}, upper: {upper}}}}}
"""


def test_calibration_takes_a_parameter_of_the_network_alone():
    text = PARAMETRIC + CALIBRATION.format(key="parameters.k", lower="8 N/mm", upper="12 N/mm")
    assert isinstance(read_valve_case(text, SMALL).calibration, CaseCalibration)

    run = PARAMETRIC.replace("duration: 2 ms", "duration: = 200 * t0")
    text = run + CALIBRATION.format(key="parameters.t0", lower="8 us", upper="12 us")
    with pytest.raises(InputError, match=r"calibration\.parameters\.k\.key: got 'parameters\.t0'"):
        read_valve_case(text, SMALL)


def test_points_of_a_parameter_are_the_strokes_of_cases_written_out(tmp_path):
    path = tmp_path / "small.yaml"
    path.write_text(PARAMETRIC.replace("duration: 2 ms", "duration: 0.4 ms"), encoding="utf-8")
    case = klack.load_case(path)
    measures = ["opening.peak_force"]
    lifts = ["90 um", "100 um", "110 um"]
    table = klack.run_many(case, {"parameters.lift": lifts}, measures)
    plain = tmp_path / "plain.yaml"
    plain.write_text(TEXT.replace("duration: 2 ms", "duration: 0.4 ms"), encoding="utf-8")
    key = "network.components.opening.gap"
    other = klack.run_many(plain, {key: lifts}, measures)

    assert np.array_equal(table[measures[0]], other[measures[0]])
    assert len(set(table[measures[0]].tolist())) == 3


def test_a_large_case_with_many_expressions_is_read(tmp_path):
    springs = [f"    s{i}: {{type: spring, stiffness: 1 N/mm, preload: 1 N}}" for i in range(100)]
    masses = [f"    m{i}: {{type: rigid-mass, mass: 3 g, points: [a]}}" for i in range(100)]
    nodes = [f"    - [m{i}.a, s{i}.end]" for i in range(100)]
    head = "klack: 1\ntitle: many\n"
    tail = "run: {duration: 1 ms, lift: m0.a}\n"
    body = ["network:", "  components:", *springs, *masses, "  connections:", *nodes, ""]
    names = "parameters:\n  k0: 1 N/mm\n" + "".join(
        f"  k{i}: k{i - 1} * 1.0 + 0 N/m\n" for i in range(1, 50)
    )
    text = head + names + "\n".join(body) + tail
    for i in range(50):
        text = text.replace("preload: 1 N}", f"preload: = k{i} * 1 mm}}", 1)

    parts = read_valve_case(text, tmp_path / "b.yaml").network.components
    assert [parts[f"s{i}"].preload for i in range(100)] == [1.0] * 100


def test_bounds_of_studies_and_calibrations_can_be_expressions():
    text = PARAMETRIC + CALIBRATION.format(key="parameters.k", lower="= 0.8 * k", upper="= 12 N/mm")
    text += """
study:
  parameters:
    parameters.lift: {from: = lift - 10 um, to: = 1.1 * lift}
  measures: [opening_time]
"""
    case = read_valve_case(text, SMALL)

    item = case.calibration.parameters["k"]
    assert (item.lower, item.upper) == ("8000.0 N/m", "12000.0 N/m")
    (spread,) = case.study.parameters.values()
    assert float(spread.lowest.split()[0]) == pytest.approx(9e-5, rel=1e-14)


STROKE = IMPACT.with_name("stroke.yaml")


@pytest.mark.parametrize(
    ("old", "new", "builds"),
    [
        ("size: 1 mm", "size: = x", True),
        ("young: 210 GPa", "young: = 210 GPa * x / 1 mm", True),
        ("preload: ", "preload: = x * 1 N/mm + 0 * ", False),
    ],
)
def test_a_study_builds_bodies_again_where_they_follow_from_a_parameter(old, new, builds):
    text = STROKE.read_text(encoding="utf-8")
    assert old in text
    text = text.replace("materials:", "parameters: {x: 1 mm}\nmaterials:", 1).replace(old, new, 1)
    case, tree = read_valve_case(text, STROKE), tree_of(text, STROKE)
    points = points_of(case, tree, {"parameters.x": ["1 mm", "2 mm", "2 mm"]})
    groups = groups_of(SimpleNamespace(points=points, case=case, kind=STROKES), range(3))

    assert [group.places for group in groups] == ([(0,), (1, 2)] if builds else [(0, 1, 2)])


def test_parameters_without_effect_are_named():
    told = read_valve_case(SPARE, SMALL).input_notes

    assert [note.partition(":")[0] for note in told] == ["parameters.spare", "parameters.other"]
    assert read_valve_case(PARAMETRIC, SMALL).input_notes == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    "command",
    [
        ("stroke",),
        ("stroke", "--steady"),
        ("linearise",),
        ("advise", "--no-confirm"),
        ("export", "--to", "netcdf"),
    ],
)
def test_every_command_names_parameters_without_effect(command, tmp_path, capsys):
    case = tmp_path / "case.yaml"
    case.write_text(SPARE, encoding="utf-8")
    report = () if command[0] == "export" else ("--no-report",)
    own = () if command[0] == "advise" else (*report, "--out", str(tmp_path / "out"))

    assert main([command[0], str(case), *command[1:], *own]) == 0

    told = "".join(capsys.readouterr())
    assert told.count("Note: parameters.spare: nothing in this case depends on it.") == 1
    assert told.count("Note: parameters.other:") == 1


def test_every_record_of_a_case_takes_its_notes():
    case = read_valve_case(SPARE, SMALL)
    kinds = [item.form.kind for item in analyses() if isinstance(item, StoredAnalysis)]
    of_cases = [kind for kind in (*kinds, SensitivityRecord) if issubclass(kind, CaseRecord)]

    made = CaseRecord(
        **case_fields(case), **run_fields(0.0, StageClock(silent)), warnings=("other",)
    )

    assert made.warnings == ("other", *case.input_notes)
    assert len(of_cases) > 10
    assert all(kind.__post_init__ is CaseRecord.__post_init__ for kind in of_cases)
