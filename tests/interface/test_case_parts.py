"""Included parts of networks; truth: the same network written out by hand."""

import json
import os
import random
import shutil
from pathlib import Path

import numpy as np
import pytest
from mutated_cases import NASTY, leaves, mutated
from mutated_cases import changed as changed_value
from ruamel.yaml import YAML

import klack
from klack.analyses.stroke.run import run_stroke
from klack.case.any_case import load_valve_case, read_case_tree, read_valve_case, tree_of
from klack.case.key_path import quantity_at
from klack.case.parts import with_parts
from klack.case.reader import expanded
from klack.case.rewriting import moved_files, rewritten
from klack.errors import InputError
from klack.input.problem import CaseProblem

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
FOUR = HOW_TO / "four_injectors.yaml"
PART = (HOW_TO / "parts" / "injector.yaml").read_text(encoding="utf-8")

INJECTOR = """
    injector{i}_needle: {{type: rigid-mass, mass: 3 g, points: [tip, top]}}
    injector{i}_seat:
      {{type: end-stop, gap: 0 um, law: {{kind: linear, stiffness: 1e9 N/m}}, restitution: 0.5}}
    injector{i}_opening:
      {{type: end-stop, gap: 80 um, law: {{kind: linear, stiffness: 1e9 N/m}}, restitution: 0.5}}
    injector{i}_spring: {{type: spring, stiffness: 10 N/mm, preload: 20 N}}
    injector{i}_magnet:
      type: force-over-time
      time: [{t0} us, {t1} us, {t2} us, {t3} us]
      force: [0 N, 60 N, 60 N, 0 N]
    injector{i}_bore: {{type: orifice, diameter: 1 mm}}
    injector{i}_chamber: {{type: chamber, volume: 50 mm^3}}
    injector{i}_face: {{type: pressure-face, direction: closing, area: 1.13097335529233 mm^2}}
    injector{i}_nozzle: {{type: seat, shape: cone, diameter: 1.2 mm, half_angle: 45 deg}}
"""
NODES = """
    - [injector{i}_needle.tip, injector{i}_seat.upper, injector{i}_nozzle.needle]
    - [injector{i}_seat.lower, ground]
    - [injector{i}_opening.upper, ground]
    - [injector{i}_needle.top, injector{i}_opening.lower, injector{i}_spring.end,
       injector{i}_magnet.end, injector{i}_face.body]
    - [injector{i}_bore.b, injector{i}_chamber.fluid, injector{i}_face.fluid, injector{i}_nozzle.a]
    - [injector{i}_nozzle.b, ambient]
"""


def by_hand() -> str:
    parts = "".join(
        INJECTOR.format(
            i=i + 1, t0=10 + 200 * i, t1=20 + 200 * i, t2=500 + 200 * i, t3=510 + 200 * i
        ).lstrip("\n")
        for i in range(4)
    )
    nodes = "".join(NODES.format(i=i + 1).lstrip("\n") for i in range(4))
    inlets = ", ".join(f"injector{i + 1}_bore.a" for i in range(4))
    return f"""klack: 1
title: Four injectors on one rail
network:
  fluid: n-heptane
  components:
    pump: {{type: pressure-source, pressure: 50 bar}}
    supply: {{type: orifice, diameter: 0.8 mm}}
    rail: {{type: chamber, volume: 2 cm^3, pressure: 50 bar}}
{parts}  connections:
    - [pump.fluid, supply.a]
    - [supply.b, rail.fluid, {inlets}]
{nodes}run: {{duration: 2 ms, lift: injector1_needle.tip}}
"""


def test_four_included_injectors_are_the_network_written_out():
    case = load_valve_case(FOUR)
    plain = read_valve_case(by_hand(), FOUR)

    assert list(case.network.components) == list(plain.network.components)
    assert case.network.connections == plain.network.connections
    assert case.network.components == plain.network.components


@pytest.mark.slow
def test_and_their_strokes_are_the_same_to_the_bit():
    runs = [
        run_stroke(item, variants=("wet",)).variants["wet"].result
        for item in (load_valve_case(FOUR), read_valve_case(by_hand(), FOUR))
    ]

    assert len(runs[0].events) == len(runs[1].events) > 20
    for one, other in zip(runs[0].events, runs[1].events, strict=True):
        assert (one.stop, one.time, one.peak_force) == (other.stop, other.time, other.peak_force)


# ------------------------------------------------------------------ a small pair of files

MAIN = """klack: 1
title: Masses on springs
parameters: {k: 10 N/mm}
include:
  - {file: mass.yaml, as: left, with: {k: k, m: 3 g}}
network:
  components:
    wall: {type: spring, stiffness: 1 N/mm, preload: 0 N}
  connections:
    - [left.tip, wall.end]
run: {duration: 1 ms, lift: left_body.a}
"""
MASS = """klack: 1
part: A mass on a spring
parameters:
  k:
  m: 1 g
ports: {tip: body.a}
components:
  body: {type: rigid-mass, mass: = m, points: [a]}
  spring: {type: spring, stiffness: = k, preload: = 2 mm * k}
connections:
  - [body.a, spring.end]
"""


def written(folder: Path, main: str = MAIN, **parts: str) -> Path:
    for name, text in {"mass": MASS, **parts}.items():
        (folder / f"{name}.yaml").write_text(text, encoding="utf-8")
    path = folder / "case.yaml"
    path.write_text(main, encoding="utf-8")
    return path


def changed(text: str, *pairs: str) -> str:
    for old, new in zip(pairs[::2], pairs[1::2], strict=True):
        assert text.count(old) >= 1, old
        text = text.replace(old, new, 1)
    return text


def test_a_port_joins_the_node_behind_it(tmp_path):
    case = load_valve_case(written(tmp_path))

    assert case.network.connections == (("left_body.a", "left_spring.end", "wall.end"),)
    assert case.network.components["left_spring"].preload == 20.0
    assert case.network.components["left_body"].mass == 3e-3


def test_components_of_a_part_can_be_named_as_well(tmp_path):
    main = changed(MAIN, "[left.tip, wall.end]", "[left_body.a, left_spring.end, wall.end]")
    part = changed(MASS, "connections:\n  - [body.a, spring.end]\n", "")

    case = load_valve_case(written(tmp_path, main, mass=part))
    assert case.network.connections == (("left_body.a", "left_spring.end", "wall.end"),)


def test_a_list_gives_each_copy_its_value_and_number_counts_them(tmp_path):
    main = changed(
        MAIN,
        "as: left, with: {k: k, m: 3 g}",
        "as: m, count: 3, with: {k: k * number, m: [1 g, 2 g, 3 g]}",
        "[left.tip, wall.end]",
        "[m1.tip, wall.end]",
        "left_body",
        "m1_body",
    )
    components = load_valve_case(written(tmp_path, main)).network.components

    assert [components[f"m{i}_body"].mass for i in (1, 2, 3)] == [1e-3, 2e-3, 3e-3]
    assert [components[f"m{i}_spring"].stiffness for i in (1, 2, 3)] == [1e4, 2e4, 3e4]


PAIR = """klack: 1
part: Two masses
parameters: {stiff: 5 N/mm}
ports: {out: second.tip, mid: link.a}
include:
  - {file: mass.yaml, as: first, with: {k: stiff}}
  - {file: mass.yaml, as: second, with: {k: 2 * stiff, m: 2 g}}
components:
  link: {type: rigid-mass, mass: 1 g, points: [a]}
  bolt: {type: spring, stiffness: = stiff, preload: 1 N}
  bind: {type: spring, stiffness: = stiff, preload: 1 N}
connections:
  - [link.a, bolt.end]
  - [first.tip, bind.end]
"""


def test_parts_inside_parts_have_their_own_names_and_values(tmp_path):
    main = changed(
        MAIN, "file: mass.yaml, as: left, with: {k: k, m: 3 g}", "file: pair.yaml, as: p",
        "left.tip", "p.out", "left_body", "p_first_body", "parameters: {k: 10 N/mm}\n", "",
    )  # fmt: skip
    case = load_valve_case(written(tmp_path, main, pair=PAIR))

    assert case.network.components["p_second_spring"].stiffness == 1e4
    assert case.network.components["p_first_spring"].stiffness == 5e3
    assert set(case.network.connections) == {
        ("p_second_body.a", "p_second_spring.end", "wall.end"),
        ("p_link.a", "p_bolt.end"),
        ("p_first_body.a", "p_first_spring.end", "p_bind.end"),
    }


def test_a_part_in_a_folder_below_names_its_neighbours(tmp_path):
    (tmp_path / "parts").mkdir()
    main = changed(MAIN, "mass.yaml", "parts/pair.yaml", "with: {k: k, m: 3 g}", "with: {stiff: k}")
    path = written(tmp_path, changed(main, "left.tip", "left.out", "left_body", "left_first_body"))
    for name, text in (("mass", MASS), ("pair", PAIR)):
        (tmp_path / "parts" / f"{name}.yaml").write_text(text, encoding="utf-8")

    case = load_valve_case(path)
    assert list(case.parts) == ["parts/pair.yaml", "parts/mass.yaml"]
    assert case.network.components["left_second_spring"].stiffness == 2e4


MISTAKES = {
    "no file": (changed(MAIN, "mass.yaml", "none.yaml"), MASS, "'none.yaml': a file that does not"),
    "out of the folder": (changed(MAIN, "mass.yaml", "../mass.yaml"), MASS, "'../mass.yaml'"),
    "out and in again": (changed(MAIN, "mass.yaml", "a/../../x.yaml"), MASS, "x.yaml"),
    "absolute": (changed(MAIN, "mass.yaml", "/etc/passwd"), MASS, "'/etc/passwd'"),
    "home": (changed(MAIN, "mass.yaml", "~/mass.yaml"), MASS, "'~/mass.yaml'"),
    "null": (changed(MAIN, "mass.yaml", '"a\\x01.yaml"'), MASS, "that does not exist"),
    "folder": (changed(MAIN, "mass.yaml", "."), MASS, "'.'"),
    "unknown argument": (
        changed(MAIN, "m: 3 g", "mas: 3 g"),
        MASS,
        "'mas', which is not a parameter",
    ),
    "argument of another kind": (changed(MAIN, "m: 3 g", "m: 3 mm"), MASS, "'3 mm' for 'm'"),
    "argument missing": (changed(MAIN, "k: k, ", ""), MASS, "no 'k', a parameter of"),
    "argument unknown name": (changed(MAIN, "k: k,", "k: kk,"), MASS, "unknown name 'kk'"),
    "outer parameter inside": (MAIN, changed(MASS, "= m,", "= M,"), "unknown name 'M'"),
    "no such port": (changed(MAIN, "left.tip", "left.top"), MASS, "has no port 'top'"),
    "port of no component": (MAIN, changed(MASS, "tip: body.a", "tip: bodi.a"), "'bodi'"),
    "connection outside": (MAIN, changed(MASS, "spring.end]", "wall.end]"), "'wall'"),
    "joined twice": (
        changed(MAIN, "- [left.tip, wall.end]", "- [left.tip, wall.end]\n    - [left.tip, ground]"),
        MASS,
        "left_body.a",
    ),
    "name twice": (
        changed(MAIN, "    wall:", "    left_body: {type: gravity}\n    wall:"),
        MASS,
        "'left_body' for the second time",
    ),
    "copy is a component": (
        changed(MAIN, "    wall:", "    left: {type: gravity}\n    wall:"),
        MASS,
        "'left' for the second time",
    ),
    "copy twice": (
        changed(MAIN, "network:", "  - {file: mass.yaml, as: left, with: {k: k}}\nnetwork:"),
        MASS,
        "'left' for the second time",
    ),
    "list without count": (changed(MAIN, "m: 3 g", "m: [3 g]"), MASS, "a list of 1"),
    "too many": (changed(MAIN, "as: left", "as: left, count: 1001"), MASS, "1001"),
    "includes itself": (
        MAIN,
        MASS + "include: [{file: mass.yaml, as: x}]\n",
        "mass.yaml includes mass.yaml",
    ),
    "a case is no part": (MAIN, by_hand(), "the unknown key 'title'"),
    "a part with a fluid": (MAIN, MASS + "fluid: water\n", "the unknown key 'fluid'"),
    "not YAML": (MAIN, "[", "text that is not YAML"),
    "empty part": (MAIN, "", "an empty file"),
    "component of the wrong form": (
        MAIN,
        changed(MASS, "{type: rigid-mass, mass: = m, points: [a]}", "3"),
        "'3'",
    ),
    "value of a component": (MAIN, changed(MASS, "mass: = m", "mass: = k"), "a mass [kg]"),
    "key of a component": (MAIN, changed(MASS, "mass: = m", "mas: = m"), "'mas'"),
    "include is a word": (changed(MAIN, "  - {file: mass.yaml, as: left, with: {k: k, m: 3 g}}",
                          "  mass.yaml"), MASS, "mass.yaml"),
    "no name": (changed(MAIN, "as: left, ", ""), MASS, "no key 'as'"),
    "name with a point": (changed(MAIN, "as: left", "as: le.ft"), MASS, "'le.ft'"),
}  # fmt: skip


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_one_error_that_names_the_file(name, tmp_path):
    main, part, said = MISTAKES[name]
    path = written(tmp_path, main, mass=part)

    with pytest.raises(InputError) as caught:
        load_valve_case(path)
    text = str(caught.value)
    assert said in text, text
    assert caught.value.where.startswith(str(tmp_path))


def test_an_error_inside_a_part_names_its_file_line_and_copy(tmp_path):
    path = written(tmp_path, mass=changed(MASS, "mass: = m", "mass: = 2 * k"))

    with pytest.raises(InputError) as caught:
        load_valve_case(path)
    assert caught.value.where == f"{tmp_path}/mass.yaml:8: components.body.mass (of 'left')"
    assert "'= 2 * k', which is 20000, a stiffness [N/m]" in caught.value.got


def test_a_chain_of_parts_ends_at_eight_levels(tmp_path):
    link = "klack: 1\npart: link\ninclude: [{{file: {}.yaml, as: x}}]\n"
    chain = {f"n{i}": link.format(f"n{i + 1}") for i in range(9)} | {"n9": "klack: 1\npart: e\n"}
    path = written(tmp_path, changed(MAIN, "mass.yaml", "n0.yaml"), **chain)

    with pytest.raises(InputError, match="8 levels"):
        load_valve_case(path)


def test_parts_that_grow_without_bound_are_refused(tmp_path):
    link = "klack: 1\npart: link\ninclude: [{{file: {}.yaml, as: x, count: 1000}}]\n"
    chain = {f"n{i}": link.format(f"n{i + 1}") for i in range(4)} | {"n4": "klack: 1\npart: e\n"}
    path = written(tmp_path, changed(MAIN, "mass.yaml", "n0.yaml", "with: {k: k, m: 3 g}",
                   "with: {}"), **chain)  # fmt: skip

    with pytest.raises(InputError, match="more than 1000 parts"):
        load_valve_case(path)


@pytest.mark.skipif(not hasattr(os, "symlink"), reason="no links")
def test_a_link_out_of_the_folder_is_refused(tmp_path):
    outside = tmp_path / "outside.yaml"
    outside.write_text(MASS, encoding="utf-8")
    (tmp_path / "in").mkdir()
    path = written(tmp_path / "in")
    (tmp_path / "in" / "mass.yaml").unlink()
    (tmp_path / "in" / "mass.yaml").symlink_to(outside)

    with pytest.raises(InputError, match="a link that leaves the folder"):
        load_valve_case(path)


# ------------------------------------------------------------------ what a result keeps


def test_a_stored_case_needs_no_file_and_does_not_change_with_it(tmp_path):
    path = written(tmp_path)
    case = load_valve_case(path)
    (tmp_path / "mass.yaml").write_text(changed(MASS, "m: 1 g", "m: 9 g"), encoding="utf-8")

    stored = read_valve_case(case.source, tmp_path / "elsewhere" / "case.yaml")
    assert stored.network.components == case.network.components
    assert stored.source == case.source
    assert stored.parts == {"mass.yaml": MASS}
    assert case.source.startswith(MAIN)
    assert load_valve_case(path).source != case.source


@pytest.mark.parametrize(
    "part",
    [
        MASS,
        MASS.rstrip("\n"),
        MASS + "\n\n",
        "# é µ 💧 'quotes' \"double\" \\n : - {\n" + MASS,
        MASS.replace("\n", "\r\n"),
        MASS + "#\ttab\n",
        "   # blank in front\n" + MASS,
        MASS + "# blank behind   \n",
        MASS.replace("part: A mass on a spring", "part: 'a: b #c'"),
    ],
    ids=["plain", "no end", "more ends", "signs", "crlf", "tab", "in front", "behind", "quotes"],
)
def test_the_text_of_a_part_is_kept_to_the_letter(part, tmp_path):
    path = written(tmp_path)
    (tmp_path / "mass.yaml").write_bytes(part.encode())
    case = load_valve_case(path)

    assert case.parts == {"mass.yaml": part}
    assert read_valve_case(case.source, path).parts == case.parts
    text = with_parts(case.source, path, {"mass.yaml": MASS})
    assert read_valve_case(text, path).parts == {"mass.yaml": MASS}


@pytest.mark.parametrize("end", ["", "\n# { a comment }\n"])
def test_a_case_in_braces_keeps_its_parts(end, tmp_path):
    path = written(tmp_path, json.dumps(YAML(typ="safe").load(MAIN)) + end)
    case = load_valve_case(path)

    assert case.network == load_valve_case(written(tmp_path)).network
    assert read_valve_case(case.source, path).parts == {"mass.yaml": MASS}
    assert case.source.endswith(end)


@pytest.mark.parametrize("end", ["...\n", "---\nb: 3\n"])
def test_a_case_that_ends_before_its_file_cannot_keep_its_parts(end, tmp_path):
    with pytest.raises(InputError):
        load_valve_case(written(tmp_path, MAIN + end))


SEEDS = range(2)


def outcome(path: Path) -> None:
    """Read; only our own error may come out, with a place."""
    said: InputError | None = None
    try:
        load_valve_case(path)
    except InputError as error:
        said = error
    if said is not None:
        assert all((said.where, said.got, said.expected, said.hint))
        assert str(path.parent) in said.where, str(said)
        assert len(str(said)) < 3000, str(said)


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_damaged_files_are_a_case_or_one_clear_error(seed, tmp_path):
    draw = random.Random(seed)
    for _ in range(60):
        files = {"main": MAIN, "mass": MASS}
        name = draw.choice(list(files))
        damaged = {name: mutated(files[name].encode(), draw)}
        for each, text in files.items():
            target = tmp_path / ("case.yaml" if each == "main" else f"{each}.yaml")
            target.write_bytes(damaged.get(each, text.encode()))
        outcome(tmp_path / "case.yaml")


VALUES = [*NASTY, "= 2", "= k", "'= 1 mm'", "'='", "'= ' ", "= (", "= 1/0", "left.tip", "'*'"]


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_nasty_values_in_case_and_part_are_a_case_or_one_clear_error(seed, tmp_path):
    draw = random.Random(seed)
    trees = {"main": YAML(typ="safe").load(MAIN), "mass": YAML(typ="safe").load(MASS)}
    for _ in range(60):
        name = draw.choice(list(trees))
        place = draw.choice(list(leaves(trees[name])))
        texts = {"main": MAIN, "mass": MASS} | {
            name: changed_value(trees[name], place, draw.choice(VALUES))
        }
        outcome(written(tmp_path, texts["main"], mass=texts["mass"]))


def test_texts_of_parts_without_an_include_are_refused(tmp_path):
    include = "include:\n  - {file: mass.yaml, as: left, with: {k: k, m: 3 g}}\n"
    path = written(tmp_path, changed(MAIN, include, "", "left.tip, ", "") + "parts: {a: b}\n")

    with pytest.raises(InputError, match="texts of parts that are not included"):
        load_valve_case(path)


def test_an_argument_is_varied_and_a_key_of_a_part_is_not(tmp_path):
    tree = read_case_tree(written(tmp_path))
    case = tree.case()
    place = quantity_at(case, ("include", 0, "with", "m"))

    assert place.value == 3e-3
    assert tree.case({place.key: "4 g"}).network.components["left_body"].mass == 4e-3
    assert case.behind(place.key) == (("network", "components", "left_body", "mass"),)
    assert rewritten(tree, {place.key: "4 g"}).startswith(changed(MAIN, "m: 3 g", "m: 4 g"))
    with pytest.raises(CaseProblem, match="is in the part 'left'"):
        quantity_at(case, ("network", "components", "left_body", "mass"))


def test_the_python_door_changes_an_argument(tmp_path):
    case = klack.load_case(written(tmp_path))
    other = case.with_value("include.0.with.m", "5 g").with_value("parameters.k", "1 N/mm")

    assert other.value("network.components.left_body.mass") == 5e-3
    assert other.value("network.components.left_spring.stiffness") == 1e3


@pytest.mark.slow
def test_points_of_an_argument_are_those_of_cases_with_it(tmp_path):
    path = shutil.copytree(HOW_TO / "parts", tmp_path / "parts").parent / "four.yaml"
    text = FOUR.read_text(encoding="utf-8").replace("duration: 2 ms", "duration: 0.3 ms")
    path.write_text(text, encoding="utf-8")
    measure = "injector1_opening.peak_force"
    table = klack.run_many(path, {"parameters.lift": ["70 um", "80 um"]}, [measure])
    path.write_text(text.replace("lift: 80 um", "lift: 70 um"), encoding="utf-8")
    assert table[measure][0] == klack.run_many(path, [{}], [measure])[measure][0]
    assert np.all(np.isfinite(table[measure]))


def test_files_of_parts_are_named_from_a_new_folder(tmp_path):
    part = changed(MASS, "  spring: {", "  extra: {type: fmu, file: model.fmu}\n  spring: {")
    tree = read_case_tree(written(tmp_path, mass=part))
    moved = moved_files(tree, tmp_path / "new")

    assert list(moved) == [("parts", "mass.yaml")]
    new = tree_of(rewritten(tree, moved), tmp_path / "new" / "case.yaml")
    assert new.data["parts"]["mass.yaml"] == changed(part, "model.fmu", '"../model.fmu"')


def test_bodies_materials_and_stops_of_a_part_have_names_of_their_own(tmp_path):
    stroke = Path(__file__).parents[1] / "data" / "case" / "stroke.yaml"
    data = YAML(typ="safe").load(stroke)
    main = {name: data[name] for name in ("klack", "title", "run", "reduction", "lumped")
            if name in data}  # fmt: skip
    network = data["network"]
    part = {name: data[name] for name in ("klack", "materials", "bodies", "stops")}
    part |= {"part": "all", "components": network["components"]}
    part |= {"connections": network["connections"]}
    main["network"] = {k: v for k, v in network.items() if k not in ("components", "connections")}
    main["network"] |= {"connections": [], "components": {}}
    main["include"] = [{"file": "valve.yaml", "as": "v"}]
    main["run"].pop("lift", None)
    main.pop("reduction", None)
    for name, content in (("valve.yaml", part), ("case.yaml", main)):
        with (tmp_path / name).open("w", encoding="utf-8") as file:
            YAML().dump(content, file)

    case = load_valve_case(tmp_path / "case.yaml")
    plain = load_valve_case(stroke)
    assert list(case.bodies) == [f"v_{name}" for name in plain.bodies]
    assert {f"v_{plain.bodies[k].material}" for k in plain.bodies} == {
        body.material for body in case.bodies.values()
    }
    assert str(case.stops["v_seat"].upper) == "v_needle.tip"
    assert case.network.components["v_needle"].body == "v_needle"


def test_files_of_a_part_are_named_from_its_own_folder(tmp_path):
    (tmp_path / "parts").mkdir()
    part = changed(MASS, "  spring: {", "  extra: {type: fmu, file: a/model.fmu}\n  spring: {")
    (tmp_path / "parts" / "mass.yaml").write_text(part, encoding="utf-8")
    tree = read_case_tree(written(tmp_path, changed(MAIN, "mass.yaml", "parts/mass.yaml")))

    found = expanded(tree.data, tree.lines, tree.path)
    assert found.data["network"]["components"]["left_extra"]["file"] == "parts/a/model.fmu"


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [("m: 3 g", "m: 3 mm", "include[0].with.m"), ("k: k, ", "", "include[0].with")],
)
def test_a_wrong_or_missing_argument_is_an_error_of_the_include(old, new, key, tmp_path):
    path = written(tmp_path, changed(MAIN, old, new))

    with pytest.raises(InputError) as caught:
        load_valve_case(path)
    assert caught.value.where == f"{path}:5: {key}"
