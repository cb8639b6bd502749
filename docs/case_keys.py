"""Write the pages of all keys, docs/reference/*-keys.md, from the schema.

Run it in the folder of the project: ``python docs/case_keys.py``.  The schema is that of
``klack schema``; nothing on these pages is written by hand.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import degrees
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from klack.analyses.magnet.case import MagnetCase
from klack.case.reader import schema_of
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.units import KINDS, Kind, format_si

__all__ = ["PAGES", "anchor", "page"]

FOLDER = Path(__file__).parent / "reference"
Node = Mapping[str, Any]
_LIMITS = {
    "gt": "above",
    "exclusiveMinimum": "above",
    "ge": "at least",
    "minimum": "at least",
    "lt": "below",
    "exclusiveMaximum": "below",
    "le": "at most",
    "maximum": "at most",
}

PAGES = {
    "case-keys": (
        "Keys of an impact case",
        "Every key that `klack impact`, `klack shots`, `klack reduce` and `klack noise` read in a "
        "case of two bodies. What they mean together, with examples: "
        "[case files](case.md). The same for editors: `klack schema`.",
        Case,
    ),
    "valve-keys": (
        "Keys of a valve case",
        "Every key of the case of a whole valve, with all components of its network "
        "(`klack stroke`, `klack calibrate`, `klack noise`). What they mean together, with "
        "examples: [cases of a whole valve](valve-case.md). The same for editors: "
        "`klack schema --kind stroke`.",
        ValveCase,
    ),
    "magnet-keys": (
        "Keys of the case of a magnet",
        "Every key that `klack magnet` reads. With examples: "
        "[bring a magnet map](../how-to/bring-a-magnet-map.md#from-a-drawing). The same for "
        "editors: `klack schema --kind magnet`.",
        MagnetCase,
    ),
}
_NOTES = """\
- **Type.** A quantity is a text with its unit, such as `80 um`; any unit of the same kind will do.
  The unit in brackets is the one that klack computes in. `name` is a word that you choose, `NAME`
  in a path stands for it. `list` and `N` likewise for the entries of a list, counted from 0.
- **Default.** *required*: the key must be there; *none*: it may be left out, and what follows then
  is in the description.
- **Limits** are those of the key alone. Checks that concern several keys, and those of components,
  answer with a message that says what came, what was expected and what to try.
"""


@dataclass(kw_only=True)
class _Section:
    """One mapping of keys, and all places where a case may have it."""

    node: Node
    heads: list[str] = field(default_factory=list)


def page(title: str, about: str, schema: Node) -> str:
    """Markdown page of all keys of a schema."""
    found: dict[str, _Section] = {}
    _collect("", "", schema, schema, found)
    text = [f"# {title}", "<!-- written by docs/case_keys.py -->", about, _NOTES.rstrip()]
    text += [_section(section, schema, found) for section in found.values()]
    return "\n\n".join(text) + "\n"


def _collect(path: str, of: str, node: Node, schema: Node, found: dict[str, _Section]) -> None:
    """Find all mappings, each once, in the order of the file."""
    section = found.setdefault(_identity(node), _Section(node=node))
    kind = _word(node)
    head = f"`{path}`" if path else "Top level"
    head += f" of `{of}`" if of else ""
    head = f"{head}: `{kind}`" if kind else head
    taken = {other.heads[0] for other in found.values() if other.heads}
    if head in taken and not section.heads:  # another form of the same mapping
        head += f" with `{next(iter(node.get('required', node['properties'])))}`"
    section.heads.append(head)
    if len(section.heads) > 1:
        return
    for key, value in node["properties"].items():
        for inner, mapping in _mappings(f"{path}.{key}".lstrip("."), value, schema):
            # the parts of a component are told apart by its type
            _collect(inner, kind or of, mapping, schema, found)


def _identity(node: Node) -> str:
    return f"{node.get('title')} {sorted(node['properties'])}"


def _word(node: Node) -> str:
    """Type of a component, kind of a law or shape of a film: a key with one possible word."""
    words = (value.get("const") for value in node["properties"].values())
    return next((word for word in words if isinstance(word, str)), "")


def _mappings(path: str, node: Node, schema: Node) -> Iterator[tuple[str, Node]]:
    """Mappings with keys of their own inside the value of a key."""
    node = _resolved(node, schema)
    if "properties" in node:
        yield path, node
    for choice in _choices(node):
        yield from _mappings(path, choice, schema)
    for other in _named(node):
        yield from _mappings(f"{path}.NAME", other, schema)
    entries = [*node.get("prefixItems", ())]
    if isinstance(node.get("items"), Mapping):
        entries.append(node["items"])
    for entry in entries:
        yield from _mappings(f"{path}.N", entry, schema)


def _named(node: Node) -> list[Node]:
    """Values of a mapping whose keys are names."""
    others = [*node.get("patternProperties", {}).values(), node.get("additionalProperties")]
    return [other for other in others if isinstance(other, Mapping)]


def _resolved(node: Node, schema: Node) -> Node:
    """Follow a reference; words beside it win."""
    while "$ref" in node:
        rest = {key: value for key, value in node.items() if key != "$ref"}
        node = {**schema["$defs"][node["$ref"].removeprefix("#/$defs/")], **rest}
    return node


def _choices(node: Node) -> list[Node]:
    return [*node.get("anyOf", ()), *node.get("oneOf", ())]


def _section(section: _Section, schema: Node, found: Mapping[str, _Section]) -> str:
    node = section.node
    also = ", ".join(section.heads[1:])
    rows = ["| key | type | default | limits | description |", "|---|---|---|---|---|"]
    required = next((one["required"] for one in (node, *_choices(node)) if "required" in one), ())
    rows += [_row(key, node, key in required, schema, found) for key in node["properties"]]
    lines = [f"## {section.heads[0]}", _words(node.get("description", ""))]
    lines += [f"The same keys: {also}." if also else "", "\n".join(rows)]
    return "\n\n".join(line for line in lines if line)


def _row(key: str, of: Node, required: bool, schema: Node, found: Mapping[str, _Section]) -> str:
    node = of["properties"][key]
    described = node.get("description") or _resolved(node, schema).get("description", "")
    default = "*required*" if required else _default(node.get("default"), _kind(node, schema))
    kind = _type(node, schema, found)
    cells = (f"`{key}`", kind, default, _limits(key, node, of, schema), _words(described))
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _words(text: str) -> str:
    """First paragraph of a description as Markdown; equations and their story are in the API."""
    first = " ".join(text.split("\n\n")[0].split()).replace("``", "`")
    if first.endswith(":"):
        first = first[:-1] + "."
    first = re.sub(r":math:`([^`]*)`", r"$\1$", first)
    return re.sub(r":(?:class|mod|func|meth|attr):`~?(?:[\w.]*\.)?([\w]+)`", r"`\1`", first)


def _kind(node: Node, schema: Node) -> Kind | None:
    """Kind of quantity that a value is, as its schema says."""
    node = _resolved(node, schema)
    for kind in KINDS:
        if kind.name == node.get("$comment"):
            return kind
    found = [_kind(choice, schema) for choice in _choices(node)]
    if isinstance(node.get("items"), Mapping):
        found.append(_kind(node["items"], schema))
    found += [_kind(entry, schema) for entry in node.get("prefixItems", ())]
    return next((kind for kind in found if kind is not None), None)


def _type(node: Node, schema: Node, found: Mapping[str, _Section]) -> str:
    node = _resolved(node, schema)
    if "const" in node:
        return f"`{str(node['const']).lower() if node['const'] is True else node['const']}`"
    if "enum" in node:
        return "one of " + ", ".join(f"`{value}`" for value in node["enum"])
    if "properties" in node:
        head = found[_identity(node)].heads[0]
        bare = "text or " if isinstance(node.get("type"), list) else ""
        return f"{bare}[{_word(node) or 'mapping'}](#{anchor(head)})"
    choices = [choice for choice in _choices(node) if choice.get("type") != "null"]
    if choices:
        return " or ".join(dict.fromkeys(_type(choice, schema, found) for choice in choices))
    if named := _named(node):
        names = node.get("propertyNames", {}).get("enum", ("NAME",))
        each = ", ".join(f"`{name}:`" for name in names)
        return f"{each} {_type(named[0], schema, found)}"
    if node.get("type") == "array":
        if "prefixItems" in node:
            kinds = [_type(entry, schema, found) for entry in node["prefixItems"]]
            if len(set(kinds)) == 1:
                return f"list of {len(kinds)}: {kinds[0]}"
            return "list of " + ", ".join(kinds)
        return f"list of {_type(node.get('items', {}), schema, found)}"
    kind = _kind(node, schema)
    if kind is not None:
        return f"{_plain(kind)}, as `{_example(node, kind)}`"
    if isinstance(node.get("type"), list) or node.get("type") == "string":
        return _text(node)
    return {"number": "number", "integer": "whole number", "boolean": "`true` or `false`"}.get(
        str(node.get("type")), "any"
    )


def _example(node: Node, kind: Kind) -> str:
    return str(next(iter(node.get("examples", ())), kind.example))


def anchor(head: str) -> str:
    """Name that readers of Markdown give to a heading."""
    return re.sub(r"[^\w\- ]", "", head.lower()).strip().replace(" ", "-")


def _plain(kind: Kind) -> str:
    name = re.sub(r"^an? ", "", kind.name)
    return f"{name} [{kind.unit}]" if kind.unit != "-" else name


def _text(node: Node) -> str:
    if "pattern" in node:
        return "name" if node["pattern"].startswith("^[A-Za-z_]") else "`body.surface`"
    examples = [str(example) for example in node.get("examples", ())]
    return f"text, as `{examples[0]}`" if examples else "text"


def _default(value: Any, kind: Kind | None) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, int | float):
        if kind is not None and kind.unit == "rad" and value:
            return f"{degrees(value):g} deg"
        if kind is not None and kind.unit == "K":
            return f"{value - 273.15:g} degC"
        return format_si(value, kind.unit) if kind is not None and value else f"{value:g}"
    if isinstance(value, Mapping):
        given = {k: v for k, v in value.items() if v not in (None, {}, [])}
        return "as its keys say" if given else "empty"
    if isinstance(value, list | tuple):
        return ", ".join(f"`{entry}`" for entry in value) or "empty"
    return f"`{value}`" if value != "" else "empty"


def _limits(key: str, node: Node, of: Node, schema: Node) -> str:
    """Limits of a number in its unit, and of the length of a list."""
    node, kind = _resolved(node, schema), _kind(node, schema)
    nodes = [node, *(_resolved(choice, schema) for choice in _choices(node))]
    found = [
        f"{word} {_default(one[name], kind)}"
        for one in nodes
        for name, word in _LIMITS.items()
        if name in one
    ]
    # a quantity is a text, of which the schema cannot say how large; its class can
    for limit in _field_metadata(of, key):
        name = type(limit).__name__.lower()
        if name in _LIMITS:
            found.append(f"{_LIMITS[name]} {_default(getattr(limit, name), kind)}")
    if node.get("minItems", 0) > 0 and "prefixItems" not in node:
        found.append(f"{node['minItems']} or more")
    return ", ".join(dict.fromkeys(found))


def _field_metadata(of: Node, key: str) -> Sequence[Any]:
    """What pydantic knows of a field besides its type."""
    for one in _classes():
        names = {info.alias or name: name for name, info in one.model_fields.items()}
        if one.__name__ == of.get("title") and names.keys() == of["properties"].keys() - {"type"}:
            return one.model_fields[names[key]].metadata if key in names else ()
    return ()


def _classes() -> Iterator[type[BaseModel]]:
    """Every section of a case."""
    waiting: list[type[BaseModel]] = [BaseModel]
    while waiting:
        for one in waiting.pop().__subclasses__():
            waiting.append(one)
            if one.__module__.startswith("klack."):
                yield one


def main() -> None:
    """Write both pages."""
    for name, (title, about, kind) in PAGES.items():
        (FOLDER / f"{name}.md").write_text(page(title, about, schema_of(kind)), encoding="utf-8")


if __name__ == "__main__":
    main()
