"""Schematics: rules that hold for every picture, on cases and on random networks.

Truth: the network itself (its components, ports and connections), geometry, and letters as wide as
the font that matplotlib brings has them.
"""

from pathlib import Path
from xml.etree import ElementTree

import pytest
from rigid_valve import TEXT
from schematic_rules import FLUID, Actuator, broken_rules, random_network

from klack.case.any_case import load_any_case, read_valve_case
from klack.case.reader import shipped_cases
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_source import PressureSource
from klack.mechanics.end_stop import EndStop
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.component import Component
from klack.network.network import Network
from klack.schematic.picture import Schematic, schematic_of, schematic_svg, with_legend
from klack.schematic.shapes import text_width
from klack.schematic.values import value_lines

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
FILES = [
    path
    for path in (*shipped_cases().values(), *sorted(HOW_TO.glob("*.yaml")))
    if "\nnetwork:" in path.read_text(encoding="utf-8")
]


def drawn(network: Network) -> Schematic:
    return with_legend(schematic_of(network), network, "A title")


@pytest.mark.slow
@pytest.mark.parametrize("path", FILES, ids=[f"{p.parent.name}/{p.stem}" for p in FILES])
def test_no_case_of_the_project_breaks_a_rule(path):
    network = load_any_case(path).network.network()

    assert not broken_rules(drawn(network), network)


def test_cases_were_found():
    assert len(FILES) >= 8


@pytest.mark.slow
def test_no_random_network_breaks_a_rule():
    for seed in range(12):
        network = random_network(seed)

        assert not broken_rules(drawn(network), network), seed


SMALL = {
    "a mass alone": ({"mass": RigidMass(mass=1.0)}, []),
    "a hole to nowhere": (
        {"hole": Orifice(diameter=1e-3)},
        [["hole.a", "ambient"], ["hole.b", "ambient"]],
    ),
    "no body": (
        {
            "supply": PressureSource(pressure=5e5),
            "hole": Orifice(diameter=1e-3),
            "volume": Chamber(volume=1e-7),
            "outlet": Orifice(diameter=1e-3),
        },
        [
            ["supply.fluid", "hole.a"],
            ["hole.b", "volume.fluid", "outlet.a"],
            ["outlet.b", "ambient"],
        ],
    ),
}


@pytest.mark.parametrize("name", SMALL)
def test_the_smallest_networks_break_no_rule(name):
    network = Network(*SMALL[name], fluid=FLUID)

    assert not broken_rules(drawn(network), network)


@pytest.mark.slow
def test_none_of_two_hundred_random_networks_breaks_a_rule():
    sizes = []
    for seed in range(200):
        network = random_network(seed)
        sizes.append(len(network.components))

        assert not broken_rules(drawn(network), network), seed
    assert max(sizes) >= 55
    assert sum(size > 30 for size in sizes) > 50


def test_the_same_network_gives_the_same_picture():
    assert schematic_svg(random_network(9), "x") == schematic_svg(random_network(9), "x")


def test_letters_are_no_wider_than_assumed():
    from matplotlib import get_data_path
    from matplotlib.ft2font import FT2Font

    words = ("needle.armature_top", "WWW mmm", "p(0) 6.013 bar", "400 mm³", "50 µm", "0.6 Ω", "1°")
    for name, bold in (("DejaVuSans.ttf", False), ("DejaVuSans-Bold.ttf", True)):
        font = FT2Font(str(Path(get_data_path()) / "fonts" / "ttf" / name))
        font.set_size(100.0, 72)
        for word in words:
            font.set_text(word)
            width = font.get_width_height()[0] / 64.0

            assert width <= text_width(word, 100.0, bold=bold), word
            assert width >= 0.7 * text_width(word, 100.0, bold=bold), word


# --------------------------------------------------------------------------- what is written


def labels_of(network: Network) -> list[str]:
    return [label.text for label in schematic_of(network).labels]


def injector(**more: Component) -> Network:
    """Source, hole, chamber; a needle between two stops under a spring."""
    parts: dict[str, Component] = {
        "supply": PressureSource(pressure=800e5),
        "hole": Orifice(diameter=0.15e-3, count=6),
        "sac": Chamber(volume=0.3e-9),
        "needle": RigidMass(mass=4e-3, points=("tip", "top"), speed=0.2),
        "spring": Spring(stiffness=3e4, preload=30.0),
        "seat": EndStop(gap=0.0, law={"kind": "linear", "stiffness": 1e8}),
    }
    links = [
        ["supply.fluid", "hole.a"],
        ["hole.b", "sac.fluid"],
        ["needle.top", "spring.end"],
        ["needle.tip", "seat.upper"],
        ["seat.lower", "ground"],
    ]
    return Network({**parts, **more}, links, fluid=FLUID)


def test_values_have_the_units_of_the_trade():
    said = labels_of(injector())

    for line in (
        "p(0) 800 bar",
        "diameter 150 µm",
        "count 6",
        "volume 0.3 mm³",
        "p(0) is computed",
        "mass 4 g",
        "v(0) 200 mm/s",
        "stiffness 30 N/mm",
        "F(0) 30 N",
        "gap(0) 0 mm",
        "law linear, 1e8 N/m",
        "base (open: ground)",
    ):
        assert said.count(line) == 1, line


def test_a_course_over_time_begins_at_zero():
    table = {"time": (-1e-3, 1e-3), "pressure": (1e5, 3e5)}
    step = {"to": 8e5, "at": 2e-3}

    assert value_lines(PressureSource(table=table)) == ("p(0) 2 bar", "p(t) 1 bar to 3 bar")
    assert value_lines(PressureSource(pressure=5e5, step=step)) == (
        "p(0) 5 bar",
        "step to 8 bar at 2 ms",
    )


def test_a_type_without_a_symbol_is_a_dashed_box_with_its_word():
    found = schematic_of(
        Network(
            {"needle": RigidMass(mass=1.0), "jack": Actuator(relief=3e6)},
            [["jack.upper", "ambient"], ["jack.lower", "ambient"], ["jack.rod", "needle.body"]],
            fluid=FLUID,
        )
    )

    (symbol,) = [s for s in found.symbols if s.component == "jack"]
    assert [stroke.ink for stroke in symbol.strokes] == ["unknown"]
    texts = {label.text for label in found.labels}
    assert {"own: tests:Actuator", "relief 30 bar", "upper", "rod"} <= texts
    assert "pilot (open: surroundings)" in texts


def test_the_legend_explains_what_occurs():
    plain = {label.text for label in drawn(injector()).labels}
    strange = {label.text for label in drawn(random_network(9)).labels}

    assert {"fluid: n-heptane, 20 °C", "motion and force", "ground"} <= plain
    assert not {"voltage and current", "type without a symbol"} & plain
    assert {"voltage and current", "surroundings: 1.0132 bar", "type without a symbol"} <= strange


def test_bodies_stand_as_their_stops_say():
    parts = {
        "housing": RigidMass(mass=1.0),
        "needle": RigidMass(mass=1.0, points=("tip", "land")),
        "pole": RigidMass(mass=1.0),
        "seat": EndStop(gap=0.0, law={"kind": "linear", "stiffness": 1e8}),
        "opening": EndStop(gap=1e-4, law={"kind": "linear", "stiffness": 1e8}),
    }
    links = [
        ["needle.tip", "seat.upper"],
        ["housing.body", "seat.lower"],
        ["pole.body", "opening.upper"],
        ["needle.land", "opening.lower"],
    ]

    found = schematic_of(Network(parts, links))

    heights = {symbol.component: symbol.box.y for symbol in found.symbols}
    assert heights["pole"] < heights["needle"] < heights["housing"]
    points = {label.text: label.y for label in found.labels}
    assert points["land"] < points["tip"]


# --------------------------------------------------------------------------- the file


def test_names_are_text_and_nothing_else():
    evil = '<script>alert("1")</script>&amp;'
    parts = {evil: RigidMass(mass=1.0), "s": Spring(stiffness=1.0, preload=0.0)}
    picture = schematic_svg(Network(parts, [[f"{evil}.body", "s.end"]]), "\x00]]> <b>" + evil)

    root = ElementTree.fromstring(picture)
    assert "<script" not in picture
    assert not [item for item in root.iter() if item.tag.endswith("script")]
    assert any((item.text or "").startswith("<script>") for item in root.iter())
    named = [item.get("data-name") for item in root.iter() if item.get("data-name")]
    assert sorted(named) == sorted([evil, "s"])


def test_the_picture_has_every_connection_and_every_component():
    network = read_valve_case(TEXT, Path("case.yaml")).network.network()

    root = ElementTree.fromstring(schematic_svg(network))

    groups = [item for item in root.iter() if item.get("class") == "node"]
    said = {item[0].text for item in groups}
    assert said == {str(node) for node in network.nodes if not node.word}
    named = [item.get("data-name") for item in root.iter() if item.get("data-name")]
    assert sorted(named) == sorted(network.components)
