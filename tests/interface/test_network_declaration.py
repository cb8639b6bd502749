"""The section ``network`` of a case: components, variants, protocols.

The section ``network`` of a case file, and the catalogue behind it.

A network asks no more of its fluid and of its contact laws than its protocols say.

Truth: the same valve with the fluid and the laws themselves, bit by bit.

Variants of a network: without fluid, lumped, and with parts added.

Truth: a step function in plain Python does what the compiled one does; its errors come out.
"""

import re
import subprocess
import sys
from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, ClassVar

import numpy as np
import pytest
from draws import each
from pydantic import ValidationError
from ruamel.yaml import YAML

import klack
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.errors import ConvergenceError, InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_choice import FluidChoice
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.input.problem import CaseProblem
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.force import ConstantForce
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.catalogue import (
    COMPONENTS,
    component_class,
    component_classes,
    component_word,
    import_component,
    type_words,
)
from klack.network.component import Component
from klack.network.declaration import NetworkSection, read_component
from klack.network.network import Network
from klack.network.port import ELEMENT, Port
from klack.network.protocols import InterfaceLaw, LawNumbers, NetworkFluid
from klack.network.rows import GROUND, Book, Rows
from klack.network.step_function import python_step
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.verification.network import whole_valve

SECTION: dict[str, Any] = {
    "ambient": {"pressure": "1 bar", "temperature": "40 degC"},
    "fluid": "n-heptane",
    "components": {
        "needle": {"type": "rigid-mass", "mass": "3 g"},
        "spring": {"type": "spring", "stiffness": "5 N/mm", "preload": "20 N"},
        "seat": {
            "type": "end-stop",
            "gap": "0 um",
            "law": {"kind": "linear", "stiffness": "1 GN/m"},
        },
        "sac": {"type": "chamber", "volume": "2 mm^3", "pressure": "5 bar"},
        "face": {"type": "pressure-face", "direction": "opening", "area": "1 mm^2"},
    },
    "connections": [
        ["needle.body", "spring.end", "seat.upper", "face.body"],
        ["seat.lower", "ground"],
        ["sac.fluid", "face.fluid"],
    ],
}
IN_A_FILE = {"path": Path("case.yaml")}


def read(change: Callable[[dict[str, Any]], object] = lambda section: None) -> NetworkSection:
    section = deepcopy(SECTION)
    change(section)
    return NetworkSection.model_validate(section, context=IN_A_FILE)


def first_detail(change: Callable[[dict[str, Any]], object]) -> tuple[tuple[Any, ...], str]:
    """Key path and text of the first complaint, as the reader of case files sees them."""
    with pytest.raises(ValidationError) as caught:
        read(change)
    detail = caught.value.errors()[0]
    own = detail.get("ctx", {}).get("error")
    key = own.key if isinstance(own, CaseProblem) else ()
    return (*detail["loc"], *key), str(own or detail["msg"])


def test_a_section_becomes_a_network_in_si():
    network = read().network()

    assert network.ambient.pressure == 1e5
    assert network.ambient.temperature == pytest.approx(313.15)
    assert network.fluid.name == "n-heptane"
    assert network.fluid.temperature == pytest.approx(313.15)
    rows = network.rows()
    assert rows.elements[0].parameters == pytest.approx([5e3, 20.0, 0.0])
    assert next(node for node in rows.nodes.values() if node.volume).volume == pytest.approx(2e-9)


def test_a_dry_valve_needs_no_fluid():
    def dry(section: dict[str, Any]) -> None:
        del section["fluid"], section["components"]["sac"], section["components"]["face"]
        section["connections"] = [
            ["needle.body", "spring.end", "seat.upper"],
            ["seat.lower", "ground"],
        ]

    assert read(dry).network().fluid is None


COMPLAINTS = {
    "bare number": (
        lambda s: s["components"]["spring"].update(stiffness=5.0),
        ("components", "spring", "stiffness"),
        "5.0 without unit",
    ),
    "out of range": (
        lambda s: s["components"]["spring"].update(stiffness="-5 N/mm"),
        ("components", "spring", "stiffness"),
        "greater than 0",
    ),
    "unknown key": (
        lambda s: s["components"]["spring"].update(stifness="5 N/mm"),
        ("components", "spring", "stifness"),
        "did you mean 'stiffness'",
    ),
    "missing key": (
        lambda s: s["components"]["spring"].pop("preload"),
        ("components", "spring"),
        "no key 'preload'",
    ),
    "unknown type": (
        lambda s: s["components"]["spring"].update(type="sprng"),
        ("components", "spring", "type"),
        "did you mean 'spring'",
    ),
    "no type": (
        lambda s: s["components"]["spring"].pop("type"),
        ("components", "spring"),
        "without the key 'type'",
    ),
    "no mapping": (
        lambda s: s["components"].update(spring="strong"),
        ("components", "spring"),
        "got 'strong'",
    ),
    "class that was not let in": (
        lambda s: s["components"]["spring"].update(type="pathlib:Path"),
        ("components", "spring", "type"),
        "a class that is not part of klack",
    ),
    "unknown fluid": (
        lambda s: s.update(fluid="n-heptan"),
        ("fluid", "name"),
        "did you mean 'n-heptane'",
    ),
    "wrong connection": (
        lambda s: s["connections"].append(["spring.base", "needle.bdy"]),
        ("connections", 3, 1),
        "did you mean 'needle.body'",
    ),
    "no fluid": (lambda s: s.pop("fluid"), (), "no fluid, but the hydraulic component 'sac'"),
}


@pytest.mark.parametrize("name", COMPLAINTS)
def test_a_complaint_names_its_key(name):
    change, key, text = COMPLAINTS[name]

    found, message = first_detail(change)

    assert found == key
    assert text in message


def test_a_component_of_ones_own_is_named_by_its_module(tmp_path, monkeypatch):
    source = (
        "from typing import ClassVar\n"
        "from pydantic import Field\n"
        "from klack.network.component import Component\n"
        "from klack.units import Length\n"
        "class Part(Component):\n"
        "    type: ClassVar[str] = 'part'\n"
        "    size: Length = Field(gt=0, description='Size.')\n"
        "    def add_rows(self, rows): ...\n"
    )
    (tmp_path / "my_parts.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)

    kind = import_component("my_parts:Part")
    own = {component_word(kind): kind}

    part = read_component(
        {"type": "my_parts:Part", "size": "2 mm"}, {**IN_A_FILE, "components": own}
    )

    assert part.size == 2e-3
    sys.modules.pop("my_parts")


def test_components_made_in_python_pass_through():
    spring = Spring(stiffness=5e3, preload=20.0)

    assert read_component(spring) is spring


@each("word", type_words())
def test_every_registered_type_is_documented(word):
    found = component_class(word)

    assert found.type == word
    assert "_" not in word
    assert found.__doc__
    for name, field in found.model_fields.items():
        assert field.description, f"{word}.{name}"


def test_every_word_stands_for_one_class():
    words, paths = zip(*COMPONENTS, strict=True)

    assert sorted(set(words)) == sorted(words)
    assert sorted(set(paths)) == sorted(paths)


def test_every_component_of_the_domains_is_registered():
    registered = {path for _, path in COMPONENTS}
    existing = set()
    for domain in ("mechanics", "hydraulics", "hydraulics.gas", "magnetics", "thermal"):
        folder = Path(klack.__file__).parent.joinpath(*domain.split("."))
        for info in iter_modules([str(folder)]):
            module = import_module(f"klack.{domain}.{info.name}")
            existing |= {
                f"{found.__module__}.{found.__name__}"
                for found in vars(module).values()
                if isinstance(found, type)
                and issubclass(found, Component)
                and found.__module__ == module.__name__
                and "type" in vars(found)
            }

    assert existing == registered


@pytest.mark.slow
def test_nothing_is_imported_before_it_is_asked_for():
    program = (
        "import sys, klack.network.declaration\n"
        "assert not any(n.startswith(('klack.mechanics.', 'klack.hydraulics.', 'klack.magnetics.'))"
        " for n in sys.modules)"
    )
    subprocess.run([sys.executable, "-c", program], check=True)


def test_the_json_schema_describes_every_type():
    schema = NetworkSection.model_json_schema()
    (named,) = schema["properties"]["components"]["patternProperties"].values()
    choices = named["oneOf"]

    def resolved(choice: dict[str, Any]) -> dict[str, Any]:
        reference = choice.get("$ref", "")
        return schema["$defs"][reference.rsplit("/", 1)[-1]] if reference else choice

    words = [resolved(choice)["properties"]["type"]["const"] for choice in choices]
    assert words == [found.type for found in component_classes()]
    spring = next(resolved(c) for c, word in zip(choices, words, strict=True) if word == "spring")
    assert spring["required"] == ["type", "stiffness", "preload"]
    assert spring["properties"]["stiffness"]["examples"] == ["5 N/mm"]


def test_an_unknown_type_lists_what_there_is():
    with pytest.raises(InputError, match="one of: rigid-mass, flexible-body, spring"):
        component_class("valve")


def test_the_network_of_the_theory_page_can_be_computed():
    page = Path(klack.__file__).parents[2] / "docs" / "theory" / "network.md"
    (text,) = re.findall(r"```yaml\n(.*?)```", page.read_text(), re.DOTALL)
    section = YAML(typ="safe").load(text)["network"]

    rows = NetworkSection.model_validate(section, context=IN_A_FILE).network().rows()

    assert len(rows.bodies) == len(rows.interfaces) == len(rows.walls) == len(rows.branches) == 1


class Only:
    """Shows what a protocol names, and hides the rest."""

    def __init__(self, held, protocol):
        self._held = held
        self._names = {name for name in vars(protocol) if not name.startswith("_")}

    def __getattr__(self, name):
        if name.startswith("_") or name not in self._names:
            raise AttributeError(name)
        return getattr(self._held, name)


class OnlyLaw(Only):
    def flat(self):
        return Only(self._held.flat(), LawNumbers)


def run(rows):
    return simulate_network(rows, duration=20e-6, record=1.28e-6)


@pytest.fixture(scope="module")
def valve():
    return whole_valve(modes=(2, 2, 2))


@pytest.fixture(scope="module")
def expected(valve):
    return run(valve.rows())


def assert_same(result, expected):
    assert result.channels.keys() == expected.channels.keys()
    for name, channel in expected.channels.items():
        assert result.channels[name].values.tobytes() == channel.values.tobytes(), name


def test_a_fluid_needs_no_more_than_the_protocol(valve, expected):
    fluid = Only(valve.fluid, NetworkFluid)
    network = type(valve)(valve.components, valve.connections, valve.ambient, fluid)

    assert_same(run(network.rows()), expected)


def test_a_contact_law_needs_no_more_than_the_protocol(valve, expected):
    rows = valve.rows()
    rows.interfaces = [replace(row, law=OnlyLaw(row.law, InterfaceLaw)) for row in rows.interfaces]

    assert_same(run(rows), expected)


FILM = {"shape": "disc", "radius": 2e-3, "roughness": 0.2e-6}


def body(name: str, rigid: int, ports: tuple[str, ...]) -> ReducedBody:
    """Two modes, the first one rigid for a free body."""
    shapes = np.arange(1.0, 1.0 + 2 * len(ports)).reshape(2, -1)
    shapes[:rigid] = 1.0 / np.sqrt(3e-3)
    return ReducedBody(
        name=name,
        mass=3e-3,
        omega=np.array([0.0 if rigid else 1e5, 2e5]),
        damping=np.full(2, 1e-3),
        port_names=ports,
        port_shapes=shapes,
        observer_names=(),
        observer_shapes=np.zeros((2, 0)),
        static_compliance=np.eye(len(ports)) * 1e-9,
        rigid_count=rigid,
        rigid_axial=np.full(rigid, np.sqrt(3e-3)),
        dof_count=99,
    )


def valve_variants(film: dict | None = None) -> Network:
    """Flexible needle and housing, two stops, a spring, a face in a chamber with a drain."""
    stop = {"law": {"kind": "linear", "stiffness": 2e9}, "film": film}
    parts = {
        "needle": FlexibleBody.of(body("needle", 1, ("tip", "top", "rim")), ("top", "tip")),
        "housing": FlexibleBody.of(body("housing", 0, ("seat", "stop"))),
        "spring": Spring(stiffness=5e3, preload=20.0),
        "seat": EndStop(gap=0.0, **stop),
        "opening": EndStop(gap=80e-6, series_compliance=1e-9, **stop),
        "sac": Chamber(volume=1e-9),
        "face": PressureFace(direction="opening", area=1e-6),
        "drain": Orifice(diameter=0.2e-3),
    }
    connections = [
        ["needle.tip", "seat.upper", "face.body"],
        ["needle.top", "opening.lower", "spring.end"],
        ["housing.seat", "seat.lower"],
        ["housing.stop", "opening.upper"],
        ["sac.fluid", "face.fluid", "drain.a"],
        ["drain.b", "ambient"],
    ]
    return Network(parts, connections, fluid=FluidChoice(name="n-heptane").at(293.15))


def test_the_whole_valve_becomes_rows():
    rows = valve_variants().rows()

    assert [row.component for row in rows.bodies] == ["needle", "housing"]
    assert [row.component for row in rows.interfaces] == ["seat", "opening"]
    assert len(rows.walls) == len(rows.branches) == 1
    assert len(rows.nodes) == 2  # sac and ambient
    needle = rows.bodies[0]
    assert needle.body.port_names == ("top", "tip")
    assert rows.interfaces[0].upper == needle.ports[1] == rows.walls[0].port
    assert rows.interfaces[1].lower == needle.ports[0]


def test_ports_of_a_flexible_body_keep_their_shapes():
    full = body("needle", 1, ("tip", "top", "rim"))

    chosen = FlexibleBody.of(full, ("rim", "tip")).reduced

    assert chosen.port_shapes == pytest.approx(full.port_shapes[:, [2, 0]])
    assert chosen.static_compliance == pytest.approx(full.static_compliance[np.ix_([2, 0], [2, 0])])


def test_dry_leaves_mechanics_alone():
    wet = valve_variants(FILM)

    dry = wet.dry()

    assert set(dry.components) == {"needle", "housing", "spring", "seat", "opening"}
    assert dry.fluid is None
    rows = dry.rows()
    assert rows.nodes == {}
    assert rows.walls == rows.branches == []
    assert all(row.film is None for row in rows.interfaces)
    assert all(row.film is not None for row in wet.rows().interfaces)
    assert [row.law for row in rows.interfaces] == [row.law for row in wet.dry().rows().interfaces]


def test_lumped_makes_one_mass_and_two_springs():
    rows = valve_variants(FILM).lumped(1e9, 0.3).rows()

    assert len(rows.bodies) == 1
    assert rows.bodies[0].body.mass == 3e-3
    assert rows.bodies[0].body.mode_count == 1
    seat, opening = rows.interfaces
    assert seat.lower == opening.upper == GROUND
    assert seat.law.flat().parameters[0] == opening.law.flat().parameters[0] == 1e9
    assert seat.law.flat().dissipation > 0.0
    assert opening.series_compliance == 0.0
    assert opening.film is not None
    assert len(rows.walls) == 1


def test_dry_and_lumped_commute():
    first, second = valve_variants(FILM).dry().lumped(1e9), valve_variants(FILM).lumped(1e9).dry()

    assert set(first.components) == set(second.components)
    assert first.connections == second.connections
    assert first.fluid is None
    assert second.fluid is None


def test_a_film_keeps_the_fluid_of_a_lumped_valve_without_chambers():
    wet = valve_variants(FILM)
    kept = {key: wet.components[key] for key in ("needle", "housing", "spring", "opening")}
    small = Network(kept, [wet.connections[1], wet.connections[3]], fluid=wet.fluid)

    assert small.lumped(1e9).rows().interfaces[0].film is not None


def test_a_flexible_needle_starts_with_its_speed_also_when_lumped():
    needle = FlexibleBody.of(body("needle", 1, ("tip",)), speed=-0.4)
    stop = EndStop(gap=0.0, law={"kind": "linear", "stiffness": 1e9})
    network = Network(
        {"needle": needle, "stop": stop}, [["needle.tip", "stop.upper"], ["stop.lower", "ground"]]
    )

    assert network.rows().bodies[0].speed == -0.4
    assert network.lumped(1e9).rows().bodies[0].speed == -0.4


def test_parts_can_be_added_where_others_are():
    network = valve_variants().with_components(
        {"magnet": ConstantForce(force=40.0)}, [["needle.top", "magnet.end"]]
    )

    rows = network.rows()

    assert len(network.connections) == 6
    magnet = next(row for row in rows.elements if row.component == "magnet")
    assert magnet.ports == (rows.bodies[0].ports[0],)


def test_parts_can_be_replaced():
    network = valve_variants().with_components({"spring": Spring(stiffness=1e4, preload=5.0)})

    assert network.rows().elements[0].parameters[0] == 1e4


def test_a_flexible_body_without_modes_says_where_they_come_from():
    with pytest.raises(InputError, match=r"FlexibleBody\.of"):
        Network({"needle": FlexibleBody(body="needle", points=("tip",))}, []).rows()


def test_a_flexible_body_names_the_ports_it_has():
    with pytest.raises(InputError, match=r"no port .tipp.[^\n]*\n.*did you mean .tip."):
        FlexibleBody.of(body("needle", 1, ("tip", "top")), ("tipp",))


def test_a_held_body_cannot_start_with_a_speed():
    with pytest.raises(InputError, match="which is supported"):
        FlexibleBody.of(body("housing", 0, ("seat",)), speed=0.1)


def test_lumped_keeps_points_apart_in_the_results():
    assert valve_variants().lumped(1e9).components["needle"] == RigidMass(
        mass=3e-3, points=("top", "tip")
    )


STIFFNESS, PRELOAD = 1e4, 12.0


def plain_spring(par, state, inp, out):
    """Do what ``klack.mechanics.spring`` does."""
    start, end = inp[2], inp[3]
    force = par[1] + 0.5 * par[0] * (start + end)
    out[0] = -force
    out[1] = end * (par[1] + 0.5 * par[0] * end)


class FailureOfTheUser(Exception):
    pass


def broken_spring(par, state, inp, out):
    if inp[0] > 5e-6:
        raise FailureOfTheUser("no spring any more")
    plain_spring(par, state, inp, out)


def tired_spring(par, state, inp, out):
    plain_spring(par, state, inp, out)
    return 7 if inp[0] > 5e-6 else 0


class PlainSpring(Component):
    """The return spring in plain Python."""

    type: ClassVar[str] = "plain-spring"
    ports: ClassVar[Mapping[str, Port]] = {"end": ELEMENT}
    step: ClassVar = staticmethod(plain_spring)

    def add_rows(self, rows: Rows) -> None:
        rows.element(
            python_step(type(self).step, parameters=2, states=0, inputs=4, outputs=2),
            ports=(rows.port("end"),),
            parameters=(STIFFNESS, PRELOAD),
            books=(Book("energy", "store"),),
            failures={7: "its wire is tired"},
        )


class BrokenSpring(PlainSpring):
    step: ClassVar = staticmethod(broken_spring)


class TiredSpring(PlainSpring):
    step: ClassVar = staticmethod(tired_spring)


def run_step(spring: Component, duration: float) -> NetworkResult:
    valve = whole_valve(modes=(4, 6, 4)).dry().with_components({"spring": spring})
    return simulate_network(
        valve.rows(), duration=duration, step=20e-9, coarse=16, record=1.28e-6, start="free"
    )


def test_plain_python_does_what_the_compiled_spring_does():
    duration = 0.2e-3  # past the first impact on the stop
    compiled = run_step(Spring(stiffness=STIFFNESS, preload=PRELOAD), duration)
    plain = run_step(PlainSpring(), duration)

    assert plain.events[-1].stop == "opening"
    for label, channel in plain.channels.items():
        expected = compiled.channels[label].values
        # the same operations, in another order: round-off, and what an impact makes of it
        scale = np.abs(expected).max()
        assert np.allclose(channel.values, expected, rtol=0.0, atol=1e-8 * scale), label
    assert plain.books.relative_residual < 1e-9


def test_an_exception_of_the_user_comes_out_as_it_is():
    with pytest.raises(FailureOfTheUser, match="no spring any more"):
        run_step(BrokenSpring(), 20e-6)


def test_a_status_of_the_user_comes_out_in_his_words():
    with pytest.raises(ConvergenceError, match="its wire is tired") as caught:
        run_step(TiredSpring(), 20e-6)

    assert "spring" in str(caught.value)
    assert "5." in str(caught.value)  # us
