"""The section ``network`` of a case file, and the catalogue behind it."""

import re
import subprocess
import sys
from collections.abc import Callable
from copy import deepcopy
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any

import pytest
from draws import each
from pydantic import ValidationError
from ruamel.yaml import YAML

import klack
from klack.errors import InputError
from klack.input.problem import CaseProblem
from klack.mechanics.spring import Spring
from klack.network.catalogue import COMPONENTS, component_class, component_classes, type_words
from klack.network.component import Component
from klack.network.declaration import NetworkSection, read_component
from klack.network.own_component import component_word, import_component

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
    for domain in ("mechanics", "hydraulics", "pneumatics", "magnetics", "thermal"):
        folder = Path(klack.__file__).parent / domain
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
