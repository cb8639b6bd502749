"""Output of ``--json`` of each command: one type for the code, the schema and the docs.

Every analysis has a type of its own (:attr:`Analysis.json`); those of the other commands stand
here.  The JSON, the schema that ``klack schema --kind result`` prints and the page of the reference
are generated from them.  Numbers are SI, the unit in the key; what does not exist (nan,
infinite) is null.  The number behind the slash of ``schema`` goes up when a key goes or changes its
meaning.
"""

from operator import itemgetter
from types import SimpleNamespace
from typing import Any

from pydantic import TypeAdapter

from klack.analyses.catalogue import analyses
from klack.analyses.json_parts import JsonForm, Key, Real, by_name, schema_key
from klack.analyses.measures import described

__all__ = ["command_json", "measures_catalogue", "result_schema"]


_CHECK = JsonForm(
    "CheckJson",
    "One verification check.",
    Key("group", str),
    Key("name", str),
    Key("expected", Real),
    Key("computed", Real),
    Key("deviation", Real),
    Key("deviation_unit", str),
    Key("tolerance", float),
    Key("headroom", Real),
    Key("wide", bool, of="is_wide"),
    Key("passed", bool),
    Key("source", str),
    Key("reason", str),
)
_WARMED = JsonForm(
    "WarmedJson",
    "One group of compiled functions.",
    Key("compiled", int, "Compiled functions; 0 if all were there already.", "functions"),
    Key("compile_time_s", float, of="seconds"),
)
_ROW = JsonForm(
    "InspectedRowJson",
    "One row of the table.",
    *(Key(name, str, of=itemgetter(i)) for i, name in enumerate(("what", "name", "content"))),
)
_NODE = JsonForm(
    "ShownNodeJson",
    "One connection of a network.",
    Key("domain", str),
    Key("ports", list[str], "As component.port.", lambda node: list(map(str, node.joints))),
    Key(
        "fixed",
        str | None,
        "ground or ambient, if connected to one of them.",
        lambda node: node.word or None,
    ),
)
_PORT = JsonForm(
    "ComponentPortJson", "Port of a component type.", Key("domain", str), Key("optional", bool)
)
_KEY = JsonForm(
    "ComponentKeyJson",
    "Key of a component type.",
    Key("unit", str, "SI; empty for words and whole numbers."),
    Key("required", bool),
    Key("meaning", str),
)
_TYPE = JsonForm(
    "ComponentTypeJson",
    "A component type.",
    Key("summary", str),
    Key("ports", {str: _PORT}, "Empty for a body, whose ports are its points."),
    Key("keys", {str: _KEY}),
    Key("equation", str, "LaTeX; empty if there is none."),
    Key("source", str, "Empty for a definition."),
)
_COMMANDS = {
    "inspect": JsonForm(
        "InspectionJson",
        "``klack inspect``.",
        schema_key("klack-inspect/1"),
        Key("file", str),
        Key(
            "parts",
            {str: [_ROW]},
            "By the name of the file, or of each body of a case; also 'case: "
            "parameters', 'case: values of expressions', 'case: components', 'case: connections'.",
        ),
    ),
    "show": JsonForm(
        "ShowJson",
        "``klack show``.",
        schema_key("klack-show/1"),
        Key("case", str),
        Key("file", str),
        Key("bodies", dict[str, list[str]], "Named surfaces of each body that is drawn."),
        Key("components", dict[str, str], "Type by name; none without a network."),
        Key("nodes", [_NODE]),
    ),
    "show-components": JsonForm(
        "ComponentsJson",
        "``klack show --components``.",
        schema_key("klack-show-components/1"),
        Key("types", {str: _TYPE}, "By type.", by_name("types", "word")),
    ),
    "report": JsonForm(
        "ReportJson",
        "``klack report``.",
        schema_key("klack-report/1"),
        Key("case", str),
        Key("result", str, "Folder of the result."),
        Key("folder", str, "Where the report is."),
        Key("files", list[str]),
    ),
    "export": JsonForm(
        "ExportJson",
        "``klack export``.",
        schema_key("klack-export/1"),
        Key("case", str),
        Key("to", str, "Format."),
        Key("folder", str, "Where the files are."),
        Key("files", list[str], "Names of the files and folders written."),
    ),
    "verify": JsonForm(
        "VerificationJson",
        "``klack verify``.",
        schema_key("klack-verify/1"),
        Key("about", dict[str, str], "Versions and machine."),
        Key("checks", [_CHECK]),
    ),
    "cache": JsonForm(
        "CacheJson",
        "``klack cache``.",
        schema_key("klack-cache/1"),
        Key("folder", str | None, "Null if the cache is off."),
        Key("count", int),
        Key("size_B", int),
        Key("limit_B", int),
    ),
    "warm": JsonForm(
        "WarmJson",
        "``klack warm``.",
        schema_key("klack-warm/1"),
        Key("folder", str),
        Key("count", int),
        Key("size_B", int),
        Key("groups", {str: _WARMED}, of=by_name("groups")),
    ),
    "about": JsonForm(
        "AboutJson",
        "``klack about``.",
        schema_key("klack-about/1"),
        Key("about", dict[str, str], "By name; for people."),
    ),
}


def command_json(command: str, **values: Any) -> dict[str, Any]:
    """JSON of a command that is no analysis."""
    return _COMMANDS[command].json(SimpleNamespace(**values))


def measures_catalogue() -> dict[str, Any]:
    """Key, name, symbol, unit, definition and source of every measure, versioned."""
    catalogue: dict[str, Any] = {"schema": "klack-measures/1"}
    for analysis in analyses():
        catalogue |= {of: described(measures) for of, measures in analysis.measures.items()}
    return catalogue


def result_schema() -> dict[str, Any]:
    """JSON schema (draft 2020-12) of what every command writes with ``--json``.

    The key ``schema`` of a result tells which of the choices it is; ``x-measures`` is the catalogue
    of measures.
    """
    kinds = (
        *(analysis.json for analysis in analyses()),
        *(form.type for form in _COMMANDS.values()),
    )
    references, definitions = TypeAdapter.json_schemas(
        [(kind.__name__, "serialization", TypeAdapter(kind)) for kind in kinds]
    )
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Results of klack",
        "oneOf": [references[kind.__name__, "serialization"] for kind in kinds],
        "$defs": definitions["$defs"],
        "x-measures": measures_catalogue(),
    }
