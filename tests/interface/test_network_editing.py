"""Changes of a network in the text of its case.

Truth: the text itself.  Lines that a change does not concern keep every byte, the change that takes
one back gives the former text, and a changed text is a case, or has one error with its place.
"""

import random
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from klack.app.network_view import added_component, catalogue, edited, network_view
from klack.app.texts import exchanged_text
from klack.case.any_case import tree_of
from klack.case.network_editing import (
    connected,
    disconnected,
    with_component,
    with_component_renamed,
    without_component,
    without_key,
)
from klack.case.reader import parse, shipped_cases
from klack.errors import InputError

PATH = Path("case.yaml")
TEXT = """\
klack: 1  # a comment of the head
title: A needle on its stop
network:
  components:
    # the moving part
    needle: {type: rigid-mass, mass: 10 g, points: [tip]}  # weighed
    spring:
      type: spring
      stiffness: 20 N/mm  # of the drawing
      preload: 60 N
    # held open
    stop: {type: end-stop, gap: 1 mm, law: {kind: linear, stiffness: 1e8 N/m}}

  connections:
    # mechanics
    - [needle.tip, spring.end,
       stop.lower]  # on two lines
    - [stop.upper, ground]
run: {duration: 1 ms, lift: needle.tip}  # the end
"""
GIVEN = {"stiffness": "5 N/mm", "preload": "12 N"}
NETWORKS = {
    path.stem if path.stem != "case" else path.parent.name: path
    for path in (
        *(shipped_cases()[name] for name in ("free-travel", "stairs", "warm-valve")),
        *sorted(Path("docs/how-to").glob("*.yaml")),
        *sorted(Path("tests/data/valves").glob("*.yaml")),
    )
    if "\nnetwork:" in path.read_text("utf-8")
}


def tried(act: Callable[[], Any]) -> Any:
    """What an act gives, or its error."""
    try:
        return act()
    except InputError as error:
        return error


def replaced(old: str, new: str) -> str:
    assert TEXT.count(old) == 1
    return TEXT.replace(old, new)


def test_a_component_is_added_behind_the_last_one_with_its_comment():
    text = with_component(TEXT, PATH, "lid", {"type": "gravity", "angle": "0 deg"})

    assert text == replaced(
        "stiffness: 1e8 N/m}}\n",
        "stiffness: 1e8 N/m}}\n    lid: {type: gravity, angle: 0 deg}\n",
    )
    assert without_component(text, PATH, "lid") == TEXT


def test_a_long_component_stands_on_several_lines():
    entries = {"type": "spring"} | {f"key_{number}": "12345678 N/mm" for number in range(6)}
    text = with_component(TEXT, PATH, "lid", entries)

    lines = ["    lid:", "      type: spring"]
    lines += [f"      key_{number}: 12345678 N/mm" for number in range(6)]
    assert "\n".join(lines) + "\n\n  connections:" in text
    assert without_component(text, PATH, "lid") == TEXT


def test_a_component_leaves_its_connections_and_those_of_one_port_go():
    text = without_component(TEXT, PATH, "stop")

    changed = replaced(
        "    stop: {type: end-stop, gap: 1 mm, law: {kind: linear, stiffness: 1e8 N/m}}\n", ""
    )
    changed = changed.replace("spring.end,\n       stop.lower]", "spring.end]")
    assert text == changed.replace("    - [stop.upper, ground]\n", "")


def test_ports_are_connected_in_the_connection_that_is_there():
    both = replaced("       stop.lower]", "       stop.lower, spring.base]")
    merged = replaced("    - [stop.upper, ground]\n", "").replace(
        "stop.lower]", "stop.lower, stop.upper, ground]"
    )

    assert connected(TEXT, PATH, "needle.tip", "spring.base") == both
    assert connected(TEXT, PATH, "spring.base", "stop.lower") == both
    assert disconnected(both, PATH, "spring.base") == TEXT
    assert connected(TEXT, PATH, "needle.tip", "stop.upper") == merged
    assert connected(TEXT, PATH, "needle.tip", "stop.lower") == TEXT


def test_ports_that_are_in_none_get_a_connection_of_their_own():
    text = connected(TEXT, PATH, "spring.base", "ground")

    assert text == replaced(
        "[stop.upper, ground]\n", "[stop.upper, ground]\n    - [spring.base, ground]\n"
    )
    assert disconnected(text, PATH, "spring.base") == TEXT


def test_the_last_connection_leaves_an_empty_list():
    text = disconnected(disconnected(TEXT, PATH, "stop.upper"), PATH, "spring.end")
    text = disconnected(text, PATH, "needle.tip")

    assert parse(text, PATH)[0]["network"]["connections"] == []
    again = connected(text, PATH, "needle.tip", "spring.end")
    assert parse(again, PATH)[0]["network"]["connections"] == [["needle.tip", "spring.end"]]


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_ports_on_lines_of_their_own_keep_their_comments(newline):
    text = (
        "network:\n  components:\n    a: {type: gravity}\n  connections:\n"
        "  - - a.x  # one\n    - b.x\n  -\n    # odd\n    - c.x  # two\n    - d.x\n    - e.x\n"
    ).replace("\n", newline)

    for port in ("a.x", "e.x"):
        joined = connected(text, PATH, port, "f.x")
        assert disconnected(joined, PATH, "f.x") == text
        assert len(joined.splitlines()) == len(text.splitlines()) + 1
    less = text.replace(f"    - d.x{newline}", "")
    assert disconnected(text, PATH, "d.x") == less
    assert f"  - - b.x{newline}    - g.x" in disconnected(
        connected(text, PATH, "b.x", "g.x"), PATH, "a.x"
    )


def test_a_name_changes_where_the_case_has_it():
    text = with_component_renamed(TEXT, PATH, "needle", "plunger")

    assert text == TEXT.replace("needle:", "plunger:").replace("needle.tip", "plunger.tip")
    assert with_component_renamed(text, PATH, "plunger", "needle") == TEXT


@pytest.mark.parametrize(
    ("path", "names"),
    [
        (shipped_cases()["warm-valve"], ("coil", "copper", "fluid", "stop")),
        (shipped_cases()["demo-mounted"], ("spring", "guide")),
        (Path("docs/how-to/seat_insert.yaml"), ("seat",)),
    ],
)
def test_a_name_changes_in_heat_noise_and_run_and_it_stays_a_case(path, names):
    """Truth: the reader of cases, which names a component that is not there."""
    for name in names:
        text = with_component_renamed(path.read_text("utf-8"), path, name, "other")
        assert "other" in tree_of(text, path).any_case().network.components


def test_a_name_changes_in_the_channels_of_sensors_and_not_where_another_thing_has_it():
    """Truth: the text; reactions of ``fluid`` are of all pressures, and bodies keep their names."""
    more = (
        "noise: {reactions: {fluid: needle.rim, needle: needle.rim}, passages: {fluid: {}}}\n"
        "bodies: {needle: {}}\n"
    )
    text = TEXT.replace(
        "    # held open\n",
        "    fluid: {type: pid, sensors: {a: {channel: needle.tip speed}, b: {channel: fluid}}}\n",
    )
    renamed = with_component_renamed(text + more, PATH, "needle", "plunger")
    both = with_component_renamed(renamed, PATH, "fluid", "oil")

    assert "channel: plunger.tip speed" in renamed
    assert "{fluid: needle.rim, plunger: needle.rim}" in renamed
    assert "bodies: {needle: {}}" in renamed
    assert "    oil: {type: pid" in both
    assert "b: {channel: oil}" in both
    assert "reactions: {fluid: needle.rim, plunger: needle.rim}, passages: {oil: {}}" in both


@pytest.mark.parametrize("name", ["stop", "ground", "1a", "a b", "", "a.b"])
def test_a_name_that_cannot_be_is_refused(name):
    with pytest.raises(InputError, match="a new name"):
        with_component_renamed(TEXT, PATH, "needle", name)


def test_a_key_is_left_out():
    assert without_key(TEXT, PATH, "spring", "stiffness") == replaced(
        "      stiffness: 20 N/mm  # of the drawing\n", ""
    )
    assert without_key(TEXT, PATH, "needle", "mass") == replaced("mass: 10 g, ", "")
    with pytest.raises(InputError, match="a key of this component"):
        without_key(TEXT, PATH, "needle", "type")


@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize(
    "text",
    [
        TEXT,
        TEXT.rstrip("\n"),
        "network: {components: {a: {type: gravity}, b: {type: lever}}, connections: [[a.x, b.x]]}",
        "network:\n  components: {a: {type: gravity}, b: {type: gravity}}\n  connections:\n"
        "  - - a.x\n    - b.x  # second\n",
    ],
)
def test_each_layout_takes_a_component_and_its_connection_and_gives_them_back(text, newline):
    text = text.replace("\n", newline)
    first = parse(text, PATH)[0]["network"]["connections"][0][0]
    more = with_component(text, PATH, "new", {"type": "gravity"})
    joined = connected(more, PATH, "new.x", "new.y")

    assert disconnected(joined, PATH, "new.x") == more
    assert without_component(joined, PATH, "new") == text
    assert without_component(more, PATH, "new") == text
    assert parse(connected(more, PATH, first, "new.x"), PATH)[0]["network"]["connections"][0][
        -1
    ] == ("new.x")
    assert newline == "\n" or "\n" not in joined.replace("\r\n", "")


def test_anchors_are_not_changed_in_two_places():
    text = TEXT.replace("[needle.tip, spring.end,", "&both [needle.tip, spring.end,")
    text = text.replace("run:", "copy: *both\nrun:")

    with pytest.raises(InputError, match="a layout"):
        connected(text, PATH, "needle.tip", "spring.base")


# ----------------------------------------------------------------------- all networks of klack


@pytest.mark.slow
@pytest.mark.parametrize("name", NETWORKS)
def test_shipped_networks_take_random_changes_and_give_each_back(name):
    """Truth: the change that takes one back; a case that is drawn whenever it can be read."""
    rng, path = random.Random(name), str(NETWORKS[name])
    text = before = NETWORKS[name].read_text("utf-8")
    for _ in range(2):
        view = network_view(text, path)
        assert view is not None
        own = [part for part in view.parts if not part.is_included]
        ports = [f"{part.name}.{port.name}" for part in own for port in part.ports]
        part, port = rng.choice(own), rng.choice(ports)
        spring = with_component(text, PATH, "q9", {"type": "spring", "stiffness": "5 N/mm"})
        joined = connected(spring, PATH, "q9.end", port)
        assert disconnected(joined, PATH, "q9.end") == spring
        assert without_component(joined, PATH, "q9") == text
        other = with_component_renamed(text, PATH, part.name, "q9")
        assert with_component_renamed(other, PATH, "q9", part.name) == text
        change, *words = rng.choice(
            [
                ("connect", port, rng.choice([*ports, "ground"])),
                ("disconnect", port),
                ("remove", part.name),
            ]
        )
        found = tried(partial(edited, text, path, change, *words))
        if isinstance(found, InputError):
            assert "layout" not in found.got
        else:
            text = found
        drawn = network_view(text, path)
        assert drawn is not None
        assert drawn.svg
        read = tried(tree_of(text, Path(path)).any_case)
        assert not isinstance(read, InputError) or (read.where and read.got and read.expected)
    kept = set(before.splitlines()) & set(text.splitlines())
    assert len(kept) > 0.5 * len(set(before.splitlines()))


# ----------------------------------------------------------------------- what the page shows


def test_an_open_port_is_drawn_while_the_case_is_not_complete():
    """Truth: the checker's own words, and the picture of what is there so far."""
    text = added_component(TEXT, "case.yaml", "new", "spring", GIVEN)
    view = network_view(text, "case.yaml")

    assert view is not None
    assert 'data-port="new.end"' in view.svg
    assert "(to be connected)" in view.svg
    with pytest.raises(InputError, match=r"the port new\.end in no connection"):
        tree_of(text, PATH).any_case()


def test_a_component_that_the_reader_refuses_is_not_added():
    with pytest.raises(InputError, match=r"new\.stiffness: got '5 kg'") as found:
        added_component(TEXT, "case.yaml", "new", "spring", GIVEN | {"stiffness": "5 kg"})
    assert found.value.expected.startswith("a stiffness")
    with pytest.raises(InputError, match="exactly one of diameter, area"):
        added_component(TEXT, "case.yaml", "new", "orifice", {})


@pytest.mark.parametrize(
    "typed", ["{a: 1", "0x1F", "2026-11-30", "a: b", "[1, 2", "5 N # x", "null"]
)
def test_what_is_typed_for_a_new_component_is_one_value(typed):
    """Truth: the reader of components, which gets what was typed as a text."""
    with pytest.raises(InputError, match=r"new\.stiffness: got ") as found:
        added_component(TEXT, "case.yaml", "new", "spring", GIVEN | {"stiffness": typed})
    assert typed in found.value.got


def test_a_connection_of_two_domains_is_refused_in_the_words_of_the_reader():
    text = added_component(TEXT, "case.yaml", "hole", "orifice", {"diameter": "1 mm"})

    with pytest.raises(InputError, match="ports of one domain"):
        edited(text, "case.yaml", "connect", "hole.a", "needle.tip")


def test_keys_of_a_component_are_those_of_its_class_as_the_text_has_them():
    view = network_view(TEXT, "case.yaml")
    assert view is not None
    fields = {item.key.removeprefix("network.components."): item for item in view.parts[2].fields}

    assert fields["stop.gap"].written == "1 mm"
    assert fields["stop.law.stiffness"].written == "1e8 N/m"
    assert fields["stop.film"].written == ""
    assert fields["stop.film"].example.startswith("{")
    whole = exchanged_text(TEXT, "case.yaml", fields["stop.film"].place, "{shape: ring}")
    assert parse(whole, PATH)[0]["network"]["components"]["stop"]["film"] == {"shape": "ring"}


def test_each_type_of_the_catalogue_is_added_with_its_examples_or_says_what_it_needs():
    """Truth: the reader of components; the examples of required keys alone are enough, or not."""
    entries, reads = catalogue(), set()
    for entry in entries:
        given = {str(item.place[-1]): item.example for item in entry.fields}
        required = {key: given[key] for key in entry.required}
        found = tried(partial(added_component, TEXT, "case.yaml", "new", entry.word, required))
        if isinstance(found, InputError):
            assert found.where.startswith("new")
            assert found.expected
        else:
            reads.add(entry.word)
    assert {entry.group for entry in entries} == {
        "mechanics",
        "hydraulics",
        "gas",
        "magnetics",
        "thermal",
    }
    assert {"spring", "rigid-mass", "chamber", "relief-valve", "solenoid"} & reads >= {
        "spring",
        "rigid-mass",
        "chamber",
    }


def test_a_form_value_of_a_case_with_parts_leaves_them_in_their_files():
    path = NETWORKS["four_injectors"]
    text, place = path.read_text("utf-8"), ("network", "components", "supply", "diameter")

    assert exchanged_text(text, str(path), place, "0.9 mm") == text.replace(
        "diameter: 0.8 mm", "diameter: 0.9 mm"
    )
