"""Cases of a whole valve: truth = the numbers written in the file, and where a mistake was put."""

import json
import re
from pathlib import Path

import pytest

from klack.case import read_case
from klack.case.any_case import load_any_case, load_valve_case, read_valve_case
from klack.case.bodies import CaseBody
from klack.case.reader import schema_of
from klack.case.valve import ValveCase
from klack.case.valve_roles import find_roles
from klack.case.valve_sections import BodyPort, CaseStop, StrokeRun, ValveBody
from klack.errors import InputError
from klack.input.section import Section
from klack.network.catalogue import component_classes

FILE = Path(__file__).parents[1] / "data" / "case" / "stroke.yaml"
IMPACT = FILE.with_name("drawn.yaml")
TEXT = FILE.read_text(encoding="utf-8")


def changed(*pairs: str) -> str:
    text = TEXT
    for old, new in zip(pairs[::2], pairs[1::2], strict=True):
        assert text.count(old) >= 1, f"the case has no {old!r}"
        text = text.replace(old, new, 1)
    return text


def test_values_arrive_in_si():
    case = load_valve_case(FILE)

    assert case.name == "stroke"
    assert list(case.bodies) == ["needle", "housing", "pole"]
    assert case.bodies["needle"].damping.modal == 0.002
    assert (str(case.stops["seat"].upper), str(case.stops["seat"].lower)) == (
        "needle.tip",
        "housing.seat",
    )
    assert (case.stops["opening"].speed, case.stops["opening"].force) == (1.2, 40.0)
    assert case.network.components["opening"].gap == 1e-4
    assert case.network.ambient.temperature == 293.15
    assert (case.run.duration, case.run.fine_step, case.run.coarse) == (1e-3, 2e-8, None)
    assert case.run.variants == ("dry", "dry-lumped")


def test_needle_seat_and_opening_stop_are_found():
    roles = find_roles(load_valve_case(FILE))

    assert (roles.needle, roles.point) == ("needle", "tip")
    assert (roles.seat, roles.opening_stop) == ("seat", "opening")


def test_the_lift_can_be_measured_elsewhere():
    text = changed("duration: 1 ms", "duration: 1 ms, lift: needle.top")

    assert find_roles(read_valve_case(text, FILE)).point == "top"


def test_a_valve_without_elastic_bodies_is_a_case_too():
    text = """
klack: 1
title: Rigid
network:
  components:
    needle: {type: rigid-mass, mass: 3 g, points: [bottom, top]}
    seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e9 N/m}}
    spring: {type: spring, stiffness: 10 N/mm, preload: 12 N}
  connections:
    - [needle.bottom, seat.upper]
    - [seat.lower, ground]
    - [needle.top, spring.end]
run: {duration: 1 ms}
"""
    roles = find_roles(read_valve_case(text, Path("rigid.yaml")))

    assert (roles.needle, roles.point, roles.opening_stop) == ("needle", "bottom", "")


MISTAKES = {
    "stop of unknown body": (
        changed("between: [needle.tip,", "between: [nedle.tip,"),
        "stops.seat.between[0]",
        "did you mean 'needle'?",
    ),
    "stop of unknown surface": (
        changed("between: [needle.tip,", "between: [needle.tipp,"),
        "stops.seat.between[0]",
        "did you mean 'tip'?",
    ),
    "stop without end stop": (
        changed("  seat: {between", "  seet: {between"),
        "stops.seet",
        "did you mean 'seat'?",
    ),
    "stop upside down": (
        changed("[needle.tip, housing.seat]", "[housing.seat, needle.tip]"),
        "stops.seat.between",
        "the upper surface must come first",
    ),
    "one surface for two stops": (
        changed("between: [pole.stop, needle.land]", "between: [pole.stop, needle.tip]"),
        "stops.seat.between[0]",
        "split the edge",
    ),
    "stop within a body": (
        changed("[needle.tip, housing.seat]", "[needle.tip, needle.shaft]"),
        "stops.seat.between",
        "a separate body",
    ),
    "friction of a law that is given": (
        changed(
            "speed: 1.2 m/s, force: 20 N}",
            "speed: 1.2 m/s, force: 20 N, friction: 0.1}",
            "seat: {type: end-stop, gap: 0 um, law: {kind: consistent}}",
            "seat: {type: end-stop, gap: 0 um, law: {kind: linear, stiffness: 1e9 N/m}}",
        ),
        "stops.seat.friction",
        "the only law with friction",
    ),
    "friction beside a restitution": (
        changed(
            "speed: 1.2 m/s, force: 20 N}",
            "speed: 1.2 m/s, force: 20 N, friction: 0.1}",
            "seat: {type: end-stop, gap: 0 um, law: {kind: consistent}}",
            "seat: {type: end-stop, gap: 0 um, law: {kind: consistent}, restitution: 0.9}",
        ),
        "network.components.seat.restitution",
        "one of them",
    ),
    "friction beyond any pair of faces": (
        changed("force: 20 N}", "force: 20 N, friction: 3}"),
        "stops.seat.friction",
        "2",
    ),
    "consistent law without surfaces": (
        changed("  seat: {between: [needle.tip, housing.seat], speed: 1.2 m/s, force: 20 N}\n", ""),
        "network.components.seat.law",
        "stops: {seat: {between: ...}}",
    ),
    "unknown point": (
        changed("points: [seat]", "points: [saet]"),
        "network.connections[1][0]",
        "did you mean 'housing.saet'?",
    ),
    "point that the body lacks": (
        changed("points: [stop, pole_face]", "points: [stop, pole_fase]"),
        "network.components.pole.points[1]",
        "did you mean 'pole_face'?",
    ),
    "body that the network lacks": (
        changed("body: pole,", "body: poule,"),
        "network.components.pole.body",
        "did you mean 'pole'?",
    ),
    "attachment modes with a consistent law": (
        changed("reduction:\n", "reduction:\n  correction: attachment\n"),
        "reduction.correction",
        "linear law",
    ),
    "shifts of attachment modes with a consistent law": (
        changed("reduction:\n", "reduction:\n  shifts: {needle: [-20 kHz]}\n"),
        "reduction.shifts",
        "correction: attachment",
    ),
    "shifts of an unknown body": (
        changed("reduction:\n", "reduction:\n  shifts: {neddle: [-20 kHz]}\n"),
        "reduction.shifts.neddle",
        "did you mean 'needle'?",
    ),
    "lumped without stiffness": (
        changed("lumped: {stiffness: 1e9 N/m, restitution: 0.5}", ""),
        "run.variants",
        "add 'lumped",
    ),
    "lift of nothing": (
        changed("duration: 1 ms", "duration: 1 ms, lift: needle.tipp"),
        "run.lift",
        "did you mean 'needle.tip'?",
    ),
    "record longer than the run": (
        changed("duration: 1 ms", "duration: 1 ms, record: 1 ms"),
        "run.record",
        "10 to",
    ),
    "number without unit in a component": (
        changed("stiffness: 10 N/mm", "stiffness: 10"),
        "network.components.spring.stiffness",
        "add a unit",
    ),
    "unknown component": (
        changed("type: spring", "type: sprng"),
        "network.components.spring.type",
        "did you mean 'spring'?",
    ),
    "unknown shape of a film": (
        changed("gap: 0 um,", "gap: 0 um, film: {shape: spherical, radius: 1 mm},"),
        "network.components.seat.film.shape",
        "did you mean 'sphere'?",
    ),
    "film without a shape": (
        changed("gap: 0 um,", "gap: 0 um, film: {radius: 1 mm},"),
        "network.components.seat.film",
        "a mapping with the key 'shape'",
    ),
    "port on a surface that is not drawn": (
        changed(
            "    material: ferritic\n", "    material: ferritic\n    ports: {a: {surface: b}}\n"
        ),
        "bodies.needle.ports.a.surface",
        "one of: tip, neck",
    ),
}


@pytest.mark.parametrize(("text", "key", "words"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_is_named_with_its_key(text: str, key: str, words: str):
    with pytest.raises(InputError) as caught:
        read_valve_case(text, Path("valve.yaml"))

    assert caught.value.where.endswith(f": {key}")
    assert caught.value.where.startswith("valve.yaml:")
    assert words in str(caught.value)


def test_two_needles_need_a_word():
    text = changed(
        "    seat: {type: end-stop",
        "    other: {type: rigid-mass, mass: 1 g}\n    seat: {type: end-stop",
    )

    with pytest.raises(InputError, match="2 bodies that can move"):
        read_valve_case(text, Path("valve.yaml"))


def test_each_kind_of_case_says_what_the_other_is_for():
    with pytest.raises(InputError, match="run it with klack stroke") as caught:
        read_case(TEXT, Path("valve.yaml"))
    assert f":{TEXT[: TEXT.index('network:')].count(chr(10)) + 1}: network" in caught.value.where
    with pytest.raises(InputError, match="run it with klack impact"):
        read_valve_case(IMPACT.read_text(encoding="utf-8"), Path("impact.yaml"))


def test_either_kind_is_told_by_its_sections():
    assert isinstance(load_any_case(FILE), ValveCase)
    assert load_any_case(IMPACT).contact.gap == 0.0


def test_schema_is_plain_json_and_holds_the_components():
    schema = schema_of(ValveCase)

    assert '"flexible-body"' in json.dumps(schema, allow_nan=False)
    assert set(schema["required"]) == {"klack", "title", "network", "run"}


def test_variants_are_checked():
    case = load_valve_case(FILE)

    assert case.require_variants(("dry-lumped", "wet", "wet")) == ("wet", "dry-lumped")
    with pytest.raises(InputError, match="did you mean 'dry'"):
        case.require_variants(("dyr",))


PAGE = (FILE.parents[3] / "docs" / "reference" / "valve-case.md").read_text(encoding="utf-8")


def test_example_of_the_reference_page_is_a_case():
    example = re.search(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    assert example is not None

    roles = find_roles(read_valve_case(example[1], Path("example.yaml")))

    assert (roles.seat, roles.opening_stop) == ("seat", "stop")


@pytest.mark.parametrize("section", [ValveCase, ValveBody, BodyPort, CaseStop, StrokeRun])
def test_reference_page_has_every_key(section: type[Section]):
    for key in section.model_fields:
        assert f"`{key}`" in PAGE or key in CaseBody.model_fields or f"`{key}:" in PAGE, key


def test_reference_page_has_every_component_with_its_ports():
    for found in component_classes():
        row = next(line for line in PAGE.splitlines() if f"`{found.type}`" in line and "|" in line)
        for port in found.ports:
            assert port in row


@pytest.mark.parametrize(
    ("film", "key"),
    [
        ("roughness: 0.3 um", "network.ambient.pressure"),
        ("pressure: 2 Pa", "network.components.opening.film.pressure"),
        ("cavitation_pressure: 3 Pa", "network.components.opening.film.cavitation_pressure"),
    ],
)
def test_surroundings_that_boil_are_named_by_the_key_that_is_given(film, key):
    text = (Path(__file__).parents[2] / "docs/how-to/small_valve.yaml").read_text(encoding="utf-8")
    text = text.replace("temperature: 20 degC", "temperature: 20 degC, pressure: 1 Pa")
    case = read_valve_case(text.replace("roughness: 0.3 um", film), Path("valve.yaml"))

    with pytest.raises(InputError) as caught:
        case.network.network().rows()
    assert caught.value.where == key


SMALL = Path(__file__).parents[2] / "docs" / "how-to" / "two_coils.yaml"
_STOP = "law: {kind: linear, stiffness: 1e9 N/m}, restitution: 0.5}\n    spring"


@pytest.mark.parametrize(
    ("old", "new", "where", "words"),
    [
        (
            "resistance: 0.8 ohm",
            "resistance: 0.8 ohm, winding_temperature: -235 degC",
            "network.components.magnet.winding_temperature",
            "-235 degC",
        ),
        (
            "resistance: 9 ohm",
            "resistance: 9 ohm, winding_temperature: 1100 degC",
            "network.components.magnet.circuits.holding.winding_temperature",
            "1100 degC",
        ),
        *(
            (
                _STOP,
                _STOP.replace("linear, stiffness: 1e9 N/m", f"table, {table}"),
                "network.components.stop.law.indentation",
                words,
            )
            for table, words in (
                ("indentation: [2 um, 1 um], force: [1 N, 2 N]", "to (1e-06 m, 2 N)"),
                ("indentation: [1 um, 2 um], force: [1 N]", "2 indentations and 1 forces"),
                ("indentation: [0 um], force: [0 N]", "from (0 m, 0 N) to (0 m, 0 N)"),
            )
        ),
    ],
)
def test_what_no_winding_or_law_can_be_is_refused_at_its_key(old, new, where, words):
    """Copper melts at 1084.62 degC (ITS-90); at -235 degC its coefficient leaves no resistance."""
    text = SMALL.read_text(encoding="utf-8")
    if old == "resistance: 0.8 ohm":
        new = new.replace(", ", "\n      ")
    assert text.count(old) == 1
    with pytest.raises(InputError) as error:
        read_valve_case(text.replace(old, new), SMALL)
    assert where in str(error.value)
    assert words in str(error.value)
