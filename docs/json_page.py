"""Write docs/reference/json.md, what ``--json`` writes, from the schema of results.

Run it in the folder of the project: ``python docs/json_page.py``.  The schema is that of
``klack schema --kind result``.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from klack.analyses.json_results import result_schema

__all__ = ["page"]

Node = Mapping[str, Any]

_HEAD = """\
# JSON of every command

<!-- written by docs/json_page.py -->

Every command has `--json FILE`: plain numbers in SI, with the unit in the key (`peak_force_N`); a
value that does not exist (nan, infinite) is `null`. `--json -` writes to the terminal and sends the
tables to the error output, so that `klack impact CASE --json - | jq .levels.reduced` works.

The key `schema` names command and version: `klack-impact/1`. The version increases when a key is
removed or changes its meaning. New keys may be added without a new version: readers should ignore
unknown keys. The JSON schema (draft 2020-12), for checking files or generating readers:

```
klack schema --kind result --json klack-results.schema.json
```

Keys in *italics* may be missing."""


def page() -> str:
    """Markdown of the whole page."""
    schema = result_schema()
    definitions: Node = schema["$defs"]
    tops = [reference["$ref"].rsplit("/", 1)[1] for reference in schema["oneOf"]]
    inner = [name for name in definitions if name not in tops]
    parts = [_HEAD]
    for name in tops:
        kind = definitions[name]["properties"]["schema"]["const"]
        parts.append(_section(kind, definitions[name], definitions))
    parts.append("## Parts\n\nMappings that several results, or several keys of one, hold.")
    parts += [_section(_plain(name), definitions[name], definitions, "###") for name in inner]
    return "\n\n".join(parts) + "\n"


def _section(title: str, node: Node, definitions: Node, level: str = "##") -> str:
    rows = ["| key | type | content |", "|---|---|---|"]
    for key, value in node["properties"].items():
        name = f"`{key}`" if key in node.get("required", ()) else f"*`{key}`*"
        rows.append(f"| {name} | {_type(value)} | {value.get('description', '')} |")
    words = node.get("description", "").replace("``", "`")
    return f"{level} {title}\n\n{words}\n\n" + "\n".join(rows)


def _type(node: Node) -> str:
    if "$ref" in node:
        name = _plain(node["$ref"].rsplit("/", 1)[1])
        return f"[{name}](#{name})"
    if "anyOf" in node:
        return " or ".join(_type(choice) for choice in node["anyOf"])
    if "const" in node or "enum" in node:
        return ", ".join(f"`{word}`" for word in node.get("enum", [node.get("const")]))
    if node.get("type") == "array":
        return f"list of {_type(node['items'])}"
    if node.get("type") == "object":
        values = node.get("additionalProperties")
        return f"name: {_type(values)}" if isinstance(values, Mapping) else "mapping"
    words = {"integer": "whole number", "string": "text", "boolean": "`true` or `false`"}
    kind = str(node.get("type", "any"))
    return f"`{kind}`" if kind == "null" else words.get(kind, kind)


def _plain(name: str) -> str:
    """``ReducedBodyJson`` is called reducedbody."""
    return name.removesuffix("Json").lower()


def main() -> None:
    """Write the page."""
    path = Path(__file__).parent / "reference" / "json.md"
    path.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
