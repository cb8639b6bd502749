"""JSON schema of a case: truth = the classes themselves, and a case that is known to be good."""

import json
import re
from pathlib import Path
from typing import Any

from draws import each
from ruamel.yaml import YAML

from klack.case import read_case
from klack.case.reader import schema_of
from klack.case.schema import Case

ROOT = Path(__file__).parents[2]
DRAWN = ROOT / "tests" / "data" / "case" / "drawn.yaml"
SCHEMA = schema_of(Case)


def resolve(node: dict[str, Any]) -> dict[str, Any]:
    while "$ref" in node:
        node = SCHEMA["$defs"][node["$ref"].removeprefix("#/$defs/")]
    return node


def fits(value: Any, node: dict[str, Any]) -> bool:
    """Check the part of JSON schema that schema_of uses."""
    node = resolve(node)
    for word in ("anyOf", "oneOf"):
        if word in node:
            return any(fits(value, choice) for choice in node[word])
    if "const" in node and value != node["const"]:
        return False
    if "enum" in node and value not in node["enum"]:
        return False
    kinds = {"object": dict, "array": list, "string": str, "number": (int, float), "integer": int}
    kinds |= {"boolean": bool, "null": type(None)}
    types = node.get("type", list(kinds))
    if not isinstance(
        value, tuple(kinds[t] for t in ([types] if isinstance(types, str) else types))
    ):
        return False
    if isinstance(value, dict):
        known = node.get("properties", {})
        if any(key not in value for key in node.get("required", [])):
            return False
        other = node.get("additionalProperties", True)
        return all(
            fits(v, known[k])
            if k in known
            else other is not False and (other is True or fits(v, other))
            for k, v in value.items()
        )
    if isinstance(value, list):
        first = node.get("prefixItems", [])
        rest = node.get("items", {})
        return all(fits(v, first[i] if i < len(first) else rest) for i, v in enumerate(value))
    return True


def test_schema_accepts_a_good_case_and_refuses_bad_ones():
    good = YAML(typ="safe").load(DRAWN.read_text(encoding="utf-8"))

    assert fits(good, SCHEMA)
    assert not fits(good | {"klack": 2}, SCHEMA)
    assert not fits(good | {"motoin": {}}, SCHEMA)
    assert not fits({k: v for k, v in good.items() if k != "run"}, SCHEMA)
    assert not fits(good | {"run": good["run"] | {"levels": ["ful"]}}, SCHEMA)


def test_example_of_the_reference_page_is_a_case():
    page = (ROOT / "docs" / "reference" / "case.md").read_text(encoding="utf-8")
    example = re.search(r"```yaml\n(.*?)```", page, re.DOTALL)

    case = read_case(example[1], Path("example.yaml"))

    assert case.dimension == 2
    assert case.stop_body.geometry.profile.surfaces == ("bottom", "rim", "seat", "bore")


def test_schema_is_plain_json_and_closed():
    json.dumps(SCHEMA, allow_nan=False)

    assert SCHEMA["$schema"].startswith("https://json-schema.org/")
    sections = [SCHEMA, *SCHEMA["$defs"].values()]
    assert len(sections) > 20
    for section in sections:
        assert section["additionalProperties"] is False


KEYS = sorted(
    (name, key)
    for name, section in {"Case": SCHEMA, **SCHEMA["$defs"]}.items()
    for key in section["properties"]
)


@each(("section", "key"), KEYS)
def test_each_key_is_described(section, key):
    node = (SCHEMA if section == "Case" else SCHEMA["$defs"][section])["properties"][key]
    pages = ROOT / "docs" / "reference"
    page = "".join((pages / f"{name}.md").read_text("utf-8") for name in ("case", "case-noise"))
    # the study is that of a valve, as the page says
    page += (pages / "valve-case.md").read_text(encoding="utf-8").partition("## `study`")[2]

    assert node.get("description") or resolve(node).get("description")
    assert f"`{key}`" in page
