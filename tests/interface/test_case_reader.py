"""Case files: truth = the numbers written in the file, and the line where a mistake was put."""

import re
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from klack.case import Case, CaseProblem, find_case, load_case, read_case, shipped_cases
from klack.case.any_case import load_any_case, read_any_case
from klack.errors import InputError

DRAWN = Path(__file__).parents[1] / "data" / "case" / "drawn.yaml"
TEXT = DRAWN.read_text(encoding="utf-8")


def changed(old: str, new: str) -> str:
    assert TEXT.count(old) >= 1, f"the case has no {old!r}"
    return TEXT.replace(old, new, 1)


def complaint(text: str) -> InputError:
    with pytest.raises(InputError) as caught:
        read_case(text, Path("valve.yaml"))
    return caught.value


def test_values_arrive_in_si():
    case = load_case(DRAWN)

    assert case.path == DRAWN
    assert case.folder == DRAWN.parent
    assert case.name == "drawn"
    assert case.source == TEXT
    assert case.dimension == 3
    needle, housing = case.moving_body, case.stop_body
    assert (needle.mesh.size, needle.mesh.surfaces["tip"]) == (1.2e-3, 1e-4)
    assert (needle.mesh.contact.size, needle.mesh.contact.extent) == (2.5e-5, 1.2e-4)
    assert needle.geometry.layers == 18
    assert needle.fixed is None
    assert housing.fixed[0].sectors.count == 3
    assert housing.fixed[0].sectors.width == pytest.approx(0.6981317007977318, rel=1e-15)
    assert str(case.contact.moving) == "needle.tip"
    assert (case.contact.gap, case.contact.reach) == (0.0, None)
    assert (case.motion.speed, case.motion.spring.stiffness) == (0.5, 5000.0)
    assert case.reduction.choice("needle").count == 20
    assert case.reduction.choice("housing").pool == 100
    assert (case.run.duration, case.run.reduced_step, case.run.full_step) == (4e-5, 2e-8, 5e-8)
    assert (case.run.transfer.lowest, case.run.transfer.highest) == (1e3, 5e5)
    assert case.lumped.stiffness == 1e9  # '1e9' is a number in YAML 1.2


def test_outline_becomes_the_meridian_in_metres():
    profile = load_case(DRAWN).moving_body.geometry.profile

    stem = profile.profiles()["stem"]

    assert profile.surfaces == ("tip", "shaft", "top")
    # cylinder of radius 1.2 mm from z = 2.4 to 20 mm, below it a spherical cap of height 0.4 mm
    cylinder = 1.2**2 * 17.6
    cap = 0.4 * (3 * 1.2**2 + 0.4**2) / 6
    assert stem.volume == pytest.approx(3.141592653589793e-9 * (cylinder + cap), rel=1e-12)


def test_materials_go_to_the_solids():
    case = load_case(DRAWN)

    steel = case.materials_of("housing", ["seat"])["seat"]

    assert (steel.young, steel.poisson, steel.density) == (210e9, 0.3, 7850.0)
    with pytest.raises(InputError, match="no material for the solid 'seta'"):
        case.materials_of("housing", ["seta"])


# what the text is changed to, the line and key that the error must name, words it must contain
MISTAKES = {
    "wrong kind of unit": (
        ("size: 1.2 mm", "size: 1.2 bar"),
        "valve.yaml:23: bodies.needle.mesh.size",
        ["'1.2 bar' (a pressure)", "a length"],
    ),
    "no unit": (("0.5 m/s", "0.5"), "valve.yaml:44: motion.speed", ["without unit", '"0.5 m/s"']),
    "negative size": (("size: 1.2 mm", "size: -1 mm"), "mesh.size", ["'-1 mm'", "above 0"]),
    "decimal comma": (("1.2 mm", "1,2 mm"), "valve.yaml:23", ["decimal point"]),
    "unknown key": (
        ("density:", "densty:"),
        "valve.yaml:6: materials.steel.densty",
        ["unknown key", "did you mean 'density'"],
    ),
    "missing key": (("speed: 0.5 m/s, ", ""), "valve.yaml:44: motion", ["no key 'speed'"]),
    "missing section": (("motion: {", "motion_: {"), "valve.yaml:44: motion_", ["'motion'"]),
    "nothing where a section belongs": (
        ("mesh: {size: 1 mm}", "mesh:"),
        "bodies.housing.mesh",
        ["got nothing", "write its value, or remove 'mesh'"],
    ),
    "value where a section belongs": (
        ("mesh: {size: 1 mm}", "mesh: 1 mm"),
        "valve.yaml:39: bodies.housing.mesh",
        ["'1 mm'", "a mapping with the keys: size"],
    ),
    "unknown body": (
        ("needle.tip", "nedle.tip"),
        "valve.yaml:42: contact.between[0]",
        ["'nedle'", "did you mean 'needle'"],
    ),
    "unknown face": (
        ("needle.tip", "needle.tipp"),
        "valve.yaml:42: contact.between[0]",
        ["'tipp'", "tip, shaft, top", "did you mean 'tip'"],
    ),
    "no face": (("needle.tip", "needle"), "contact.between[0]", ["needle.tip"]),
    "one face": (("[needle.tip, housing.seat]", "[needle.tip]"), "contact.between", ["one more"]),
    "faces of one body": (
        ("housing.seat]", "needle.shaft]"),
        "contact.between",
        ["two surfaces of one body", "housing"],
    ),
    "zero modes": (
        ("count: 20", "count: 0"),
        "valve.yaml:45: reduction.modes.needle.count",
        ["0 modes", "1 or more"],
    ),
    "half a mode": (("count: 20", "count: 2.5"), "modes.needle.count", ["2.5", "whole number"]),
    "modes twice": (
        ("{count: 20}", "{count: 20, frequency: 9 kHz}"),
        "modes.needle",
        ["count and frequency together"],
    ),
    "modes of nobody": (("{needle: {c", "{needel: {c"), "modes.needel", ["'needle'"]),
    "small pool": (("pool: 100", "pool: 5"), "modes.housing.pool", ["8 or more"]),
    "penetrating gap": (
        ("gap: 0", "gap: -2 um"),
        "valve.yaml:43: contact.gap",
        ["-2 um", "already penetrate", "0 or more"],
    ),
    "unknown material": (
        ("material: steel", "material: stel"),
        "valve.yaml:22: bodies.needle.material",
        ["'stel'", "did you mean 'steel'"],
    ),
    "material of no part": (("{seat: steel}", "{set: steel}"), "material.set", ["'seat'"]),
    "material written out": (
        ("material: steel", "material: {young: 5}"),
        "material.young",
        ["'materials'"],
    ),
    "impossible Poisson": (("poisson: 0.3", "poisson: 0.5"), "steel.poisson", ["below 0.5"]),
    "held needle": (
        ("[needle.tip, housing.seat]", "[housing.seat, needle.tip]"),
        "valve.yaml:40: bodies.housing.fixed",
        ["the moving body", "swap"],
    ),
    "mixed dimensions": (
        (
            "model: swept\n      layers: 18\n    material: steel",
            "model: axisymmetric\n    material: steel",
        ),
        "needle.geometry.model",
        ["both axisymmetric or both three-dimensional"],
    ),
    "layers of no sweep": (
        ("model: swept", "model: solid"),
        "geometry.layers",
        ["only a swept body"],
    ),
    "swept without layers": (("      layers: 18\n", ""), "needle.geometry", ["layers"]),
    "unknown model": (("swept", "sweept"), "geometry.model", ["did you mean 'swept'"]),
    "two shapes": (
        ("geometry:\n      profile:", f"geometry:\n      step: {{file: {DRAWN}}}\n      profile:"),
        "needle.geometry",
        ["profile and step together"],
    ),
    "missing STEP file": (
        ("geometry:\n      profile:", "geometry:\n      step: {file: no.step}\n      profile:"),
        "valve.yaml:10: bodies.needle.geometry.step.file",
        ["'no.step'", "does not exist"],
    ),
    "sectors beyond the circle": (("count: 3,", "count: 10,"), "sectors.width", ["360 deg"]),
    "unknown support": (("surface: rim", "surface: rm"), "fixed[0].surface", ["'rim'"]),
    "arc without centre": ((", centre: [0, 4]", ""), "edges[0]", ["without a centre"]),
    "arc off its circle": (
        ("[1.2, 2.4]", "[1.2, 2.9]"),
        "valve.yaml:14: bodies.needle.geometry.profile.parts.stem",
        ["edge 1 'tip'", "same distance"],
    ),
    "open outline": (
        ("              - {close: true, name: axis}\n", ""),
        "parts.stem",
        ["(0, 20) mm", "(0, 2) mm"],
    ),
    "closed too early": (
        ("- {line: [1.2, 20], name: shaft}", "- {close: true}"),
        "edges[1].close",
        ["last edge only"],
    ),
    "edge of two kinds": (
        ("{line: [1.2, 20]", "{line: [1.2, 20], close: true"),
        "edges[1]",
        ["line and close together"],
    ),
    "point of three": (("[1.2, 20]", "[1.2, 20, 0]"), "edges[1].line", ["at most 2"]),
    "point with a word": (("[1.2, 20]", "[1.2, x]"), "edges[1].line[1]", ["'x'", "a number"]),
    "unknown level": (
        ("run: {", "run: {levels: [reduced, ful], "),
        "valve.yaml:46: run.levels[1]",
        ["'ful'", "did you mean 'full'"],
    ),
    "seconds for microseconds": (("40 us", "40 s"), "run.duration", ["2e+09 steps"]),
    "swapped frequencies": (("from: 1 kHz", "from: 1 MHz"), "run.transfer.to", ["1 MHz"]),
    "law twice": (
        ("gap: 0", "local_law: {kind: linear, stiffness: 1e9 N/m}"),
        "contact.local_law.kind",
        ["correction: attachment"],
    ),
    "law without number": (("gap: 0", "local_law: {kind: linear}"), "local_law", ["stiffness"]),
    "unknown law": (("gap: 0", "local_law: {kind: liner}"), "local_law.kind", ["'linear'"]),
    "law as a word": (("gap: 0", "local_law: linear"), "local_law", ["a mapping"]),
    "later version": (("klack: 1", "klack: 2"), "valve.yaml:1: klack", ["version 2"]),
    "duplicate key": (
        ("title:", "title: one\ntitle:"),
        "valve.yaml:3: title",
        ["for the second time", "once"],
    ),
    "duplicate key in a section": (
        ("  gap: 0", "  gap: 0\n  gap: 1 um"),
        "valve.yaml:44: gap",
        ["'gap' for the second time"],
    ),
    "misplaced key": (("motion: {", "gap: 1 um\nmotion: {"), "gap", ["it belongs in contact.gap"]),
    "name instead of a mapping": (
        ("fixed: [{surface: rim, sectors: {count: 3, width: 40 deg}}]", "fixed: [rim]"),
        "fixed[0]",
        ["write {surface: rim}"],
    ),
    "typographic minus": (("start: [0, 2]", "start: [0, \N{MINUS SIGN}2]"), "start[1]", ["as '-'"]),
    "section of a valve": (("motion: {", "netwrk: {}\nmotion: {"), "netwrk", ["'network'"]),
    "model of another program": (
        ("model: swept", "model: 3d"),
        "geometry.model",
        ["write solid or swept"],
    ),
    "coordinates with a unit": (
        ("start: [0, ", "start: [0 mm, "),
        "start[0]",
        ["got '0 mm'", "write only the number"],
    ),
    "deeper line": (("  gap: 0", "     gap: 0"), "valve.yaml", ["same indentation"]),
    "no blank behind a colon": (("  gap: 0", "  gap:0"), "valve.yaml", ["a line without 'key: v"]),
    "open quote": (
        ("title: ", "title: '"),
        "valve.yaml:2",
        ["a quotation mark that is not closed"],
    ),
    "comma in a number": (
        ("poisson: 0.3", "poisson: 0,3"),
        "materials",
        ["a decimal point"],
    ),
    "word as a count": (("count: 20", "count: twenty"), "count", ["write digits"]),
    "hole": (("motion: {", "motion: "), "valve.yaml:44", ["not YAML"]),
    "tabulator": (("title:", "\ttitle:"), "valve.yaml:2", ["indent with spaces, not tabs"]),
    "colon in a title": (("Two turned", "Two: turned"), "valve.yaml:2", ["not YAML", "quotes"]),
    "unknown alias": (("steel:", "steel: *x"), "valve.yaml:6", ["not YAML", "write the value"]),
    "no colon": (("klack: 1", "klack 1"), "valve.yaml:1", ["without 'key: value'", "a colon"]),
    "no blank behind the colon": (
        ("mesh: {size: 1 mm}", "mesh: {size:1 mm}"),
        "bodies.housing.mesh",
        ["put a space after the colon: size: 1 mm"],
    ),
    "no colon in a section": (
        ("mesh: {size: 1 mm}", "mesh:\n      size 1 mm"),
        "bodies.housing.mesh",
        ["write 'size: 1 mm', with a colon"],
    ),
    "round brackets": (("mesh: {size: 1 mm}", "mesh: (size: 1 mm)"), "valve.yaml:39", ["round"]),
    "bracket too many": (("{size: 1 mm}", "{size: 1 mm}}"), "valve.yaml:", ["a surplus bracket"]),
    "no blank behind a dash": (
        ("- {line: [1.2, 20], name: shaft}", "-{line: [1.2, 20], name: shaft}"),
        "valve.yaml:17",
        ["a dash without a space"],
    ),
    "no dash": (
        ("- {line: [1.2, 20], name: shaft}", "{line: [1.2, 20], name: shaft}"),
        "valve.yaml:17",
        ["without its dash"],
    ),
    "comma behind": (("{size: 1 mm}", "{size: 1 mm},"), "valve.yaml:", ["a comma after"]),
    "a list of keys": (
        ("mesh: {size: 1 mm}", "mesh:\n      - size: 1 mm"),
        "bodies.housing.mesh",
        ["got a list", "remove the dashes"],
    ),
    "python object": (("title: ", "title: !!python/name:os.system "), "title", ["python"]),
    "date": (("title: Two turned bodies", "title: 2026-01-01"), "title", ["date", "quotes"]),
    "number as key": (("materials:", "5: x\nmaterials:"), "valve.yaml:5", ["the key 5"]),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistake_is_named_with_line_and_key(name):
    (old, new), where, words = MISTAKES[name]

    error = complaint(changed(old, new))

    text = str(error)
    assert where in text
    for word in words:
        assert word in text
    assert "\nTry: " in text
    assert "pydantic" not in text
    assert len(text.splitlines()) <= 3


def test_the_first_of_two_equal_keys_is_named_by_its_line():
    """Not the line where their section begins."""
    text = changed("contact:\n", "contact:\n  angles: 48\n  gap: 0 um\n")
    line = text[: text.index("  gap: 0 um")].count("\n") + 1

    assert f"first in line {line})" in str(complaint(text))


def test_long_lists_lose_their_middle_and_no_half_words():
    names = [f"component-{i}" for i in range(200)]
    error = InputError("case", got="x", expected=", ".join(names), hint="a" * 5000)

    kept = error.expected.replace(" ... ", " ").split(", ")
    assert set(kept[:20] + kept[-5:]) <= set(names)
    assert len(error.expected) < 1220
    assert len(error.hint) < 1220


def test_further_mistakes_are_counted_and_have_places():
    text = changed("0.5 m/s", "0.5").replace("1.2 mm", "1.2 bar").replace("210 GPa", "210")

    assert "materials.steel.young" in str(complaint(text))
    last = str(complaint(text)).splitlines()[-1]
    lines = [text[: text.index(word)].count("\n") + 1 for word in ("1.2 bar", "speed: 0.5")]
    found = [int(line) for line in re.findall(r":(\d+): ", last)]
    assert last.startswith("(2 more problems: valve.yaml:")
    assert found == lines


@pytest.mark.parametrize(("count", "end"), [(1, "every key."), (2, ".coil.poles[1])")])
def test_a_section_that_fails_for_what_is_in_it_is_no_problem_of_its_own(count: int, end: str):
    """A list of poles without their edge fields is not too short as well."""
    text = find_case("free-travel").read_text(encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_any_case(text.replace(", fringing: plane", "", count), Path("valve.yaml"))

    assert ".coil.poles[0]: got no key 'fringing'" in str(caught.value)
    assert str(caught.value).endswith(end)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "empty file"),
        ("hello", "single value"),
        ("- a\n", "a list"),
        ("a,b\n1,2\n", "single value"),
        ("*HEADING\nmesh\n*NODE\n1, 2., 3.\n", "not YAML"),
        ("a: 1\n---\nb: 2\n", "not YAML"),
        ("a: {b: [\n", "brackets that are not closed"),
        ("a: \x00", "not YAML"),
        ("[" * 500, "nested"),
        ("a: &a [*a]\n", "plain tree"),
        ("a: &a {<<: *a}\n", "plain tree"),
        ("a: &a {b: {<<: [*a]}}\n", "plain tree"),
        ("a: " + "[" * 5000, "more than 40 levels"),
        ("{a: " * 5000, "more than 40 levels"),
        ("a: 0x" + "f" * 50_000, ":1: got a number of 50002 characters"),
        ("a: 0b" + "1" * 50_000, ":1: got a number of 50002 characters"),
        ("b: 1\na: [1, " + "9" * 50_000 + "]", ":2: got a number of 50000 characters"),
        ("a: 1\n" + "#" * 1_000_000, "a larger file"),
    ],
)
def test_what_is_no_case_is_refused(text, word):
    assert word in str(complaint(text))


def test_aliases_may_not_explode():
    # ten times ten times ... = 1e9 values behind 400 characters
    lines = ["a: &a [x, x, x, x, x, x, x, x, x, x]"]
    for before, name in zip("abcdefgh", "bcdefghi", strict=True):
        lines.append(f"{name}: &{name} [{', '.join([f'*{before}'] * 10)}]")

    assert "more than 200000 values" in str(complaint("\n".join(lines)))


def test_aliases_and_anchors_are_fine():
    text = changed("mesh: {size: 1.2 mm", "mesh: {size: &s 1.2 mm").replace(
        "mesh: {size: 1 mm}", "mesh: {size: *s}"
    )

    assert read_case(text, DRAWN).stop_body.mesh.size == 1.2e-3


def test_missing_file_folder_binary_and_giant_are_refused(tmp_path):
    binary, giant = tmp_path / "a.step", tmp_path / "b.yaml"
    binary.write_bytes(b"klack: 1\n\xff\xfe")
    giant.write_bytes(b"#" * 1_000_001)

    for path, words in [
        (tmp_path / "none.yaml", "neither a file"),
        (tmp_path, "a folder"),
        (binary, "not UTF-8"),
        (giant, "1 MB"),
    ]:
        with pytest.raises(InputError, match=words) as caught:
            load_case(path)
        assert str(path) in str(caught.value)


def test_files_are_found_beside_the_case(tmp_path):
    (tmp_path / "needle.step").write_text("ISO-10303-21;")
    start = TEXT.index("      profile:")
    end = TEXT.index("      model: swept")
    text = TEXT[:start] + "      step: {file: needle.step}\n" + TEXT[end:]
    text = text.replace("      model: swept\n      layers: 18\n", "", 1)
    (tmp_path / "case.yaml").write_text(text)

    case = load_case(tmp_path / "case.yaml")

    assert case.moving_body.geometry.step.file == (tmp_path / "needle.step").resolve()
    assert case.moving_body.geometry.dimension == 3
    assert case.name == tmp_path.name  # of the folder, as the file is just called case.yaml


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(data=st.data())
def test_any_damage_gives_a_case_or_one_clear_error(data):
    # robustness: nothing but InputError may come out, whatever happens to the file
    at = data.draw(st.integers(0, len(TEXT)))
    cut = data.draw(st.integers(0, 30))
    put = data.draw(st.text(alphabet="{}[]:,-#&*!|>'\"%@ \n\t0a.~", max_size=6))
    text = TEXT[:at] + put + TEXT[at + cut :]

    outcome: Case | InputError
    try:
        outcome = read_case(text, DRAWN)
    except InputError as error:
        outcome = error

    if isinstance(outcome, InputError):
        assert "drawn.yaml" in outcome.where
        assert outcome.got
        assert outcome.expected
        assert outcome.hint


def test_python_gets_the_same_checks():
    # the classes of a case are usable without a file; pydantic then wraps our error
    raw = load_case(DRAWN).model_dump(by_alias=True, exclude_none=True)
    for body in raw["bodies"].values():
        body["geometry"]["profile"]["unit"] = "mm"
    raw["motion"]["speed"] = "5 mm"

    with pytest.raises(ValidationError, match="expected a speed"):
        Case.model_validate(raw)


def test_levels_are_checked():
    case = load_case(DRAWN)

    assert case.require_levels(["full", "reduced", "full"]) == ("reduced", "full")
    with pytest.raises(InputError, match="did you mean 'lumped'"):
        case.require_levels(["lmped"])
    bare = read_case(changed("lumped: {stiffness: 1e9 N/m}", ""), DRAWN)
    with pytest.raises(InputError, match="no section 'lumped'"):
        bare.require_levels(["lumped"])


@pytest.mark.slow
def test_shipped_cases_can_all_be_read():
    cases = shipped_cases()

    assert "demo-valve" in cases
    for name, path in cases.items():
        case = load_any_case(path)
        assert case.name == name
        assert case.title
        assert find_case(name) == path


def test_case_is_found_by_path_folder_and_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "valve").mkdir()
    (tmp_path / "valve" / "case.yaml").write_text(TEXT)

    assert find_case("valve") == Path("valve/case.yaml")
    assert find_case(tmp_path / "valve" / "case.yaml").is_file()
    with pytest.raises(InputError, match="did you mean 'demo-valve'"):
        find_case("demo-valv")


def test_problem_writes_its_key_like_people_do():
    problem = CaseProblem(("edges", 2, "arc"), got="a", expected="b", hint="c")

    assert problem.where == "edges[2].arc"


def test_the_unit_that_is_proposed_fits_the_key():
    """A supply has no 210 GPa: example of the field, its default, or a value that it mentions."""
    how_to = Path(__file__).parents[2] / "docs" / "how-to"
    valve = (how_to / "small_valve.yaml").read_text(encoding="utf-8")
    for old, new, proposed in (
        ("{temperature: 20 degC}", "{pressure: 1}", "101.3 kPa"),
        ("volume: 200 mm^3", "volume: 200 mm^3, pressure: 5", "5 bar"),
        ("fluid: n-heptane", "fluid: {name: x, bulk_modulus: 1e9}", "1.5 GPa"),
        ("stiffness: 1e9 N/m", "stiffness: 1e9", "1e9 N/m"),
        ("roughness: 0.3 um", "cut_off: 0.3", "0.3 um"),
    ):
        assert old in valve
        with pytest.raises(InputError) as caught:
            read_any_case(valve.replace(old, new, 1), Path("valve.yaml"))
        assert f'"{proposed}"' in caught.value.hint


@pytest.mark.parametrize("point", ["[1.2, 1e308]", "[1.2, 1e14]", "[1e-300, 2.4]"])
def test_points_of_an_outline_have_a_sensible_size(point):
    text = str(complaint(changed("[1.2, 2.4]", point)))

    assert "edges[0].arc" in text
    assert any(words in text for words in ("below 1e15", "1e-12 to 1e+06 m"))
