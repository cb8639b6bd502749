"""Output of ``--json`` of each command: one type for the code, the schema and the docs.

Every analysis has a type of its own (:attr:`Analysis.json`); those of the other commands stand
here.  Functions that make the JSON are annotated with these types, so that the type checker
compares their keys; the schema that ``klack schema --kind result`` prints and the page of the
reference are generated from them.  Numbers are SI, the unit in the key; what does not exist (nan,
infinite) is null.  The number behind the slash of ``schema`` goes up when a key goes or changes its
meaning.
"""

from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter
from typing_extensions import TypedDict

from klack.analyses.catalogue import analyses
from klack.analyses.json_parts import Real
from klack.analyses.measures import described

__all__ = [
    "AboutJson",
    "CacheJson",
    "ComponentsJson",
    "ExportJson",
    "InspectionJson",
    "ReportJson",
    "ShowJson",
    "VerificationJson",
    "WarmJson",
    "measures_catalogue",
    "result_schema",
]


class CheckJson(TypedDict):
    """One verification check."""

    group: str
    name: str
    expected: Real
    computed: Real
    deviation: Real
    deviation_unit: str
    tolerance: float
    headroom: Real
    wide: bool
    passed: bool
    source: str
    reason: str


class VerificationJson(TypedDict):
    """``klack verify``."""

    schema: Literal["klack-verify/1"]
    about: Annotated[dict[str, str], Field(description="Versions and machine.")]
    checks: list[CheckJson]


class AboutJson(TypedDict):
    """``klack about``."""

    schema: Literal["klack-about/1"]
    about: Annotated[dict[str, str], Field(description="By name; for people.")]


class CacheJson(TypedDict):
    """``klack cache``."""

    schema: Literal["klack-cache/1"]
    folder: Annotated[str | None, Field(description="Null where the cache is off.")]
    count: int
    size_B: int
    limit_B: int


class WarmedJson(TypedDict):
    """One group of compiled functions."""

    compiled: Annotated[int, Field(description="Functions; 0 if all were there.")]
    compile_time_s: float


class WarmJson(TypedDict):
    """``klack warm``."""

    schema: Literal["klack-warm/1"]
    folder: str
    count: int
    size_B: int
    groups: dict[str, WarmedJson]


class InspectedRowJson(TypedDict):
    """One row of the table."""

    what: str
    name: str
    content: str


class InspectionJson(TypedDict):
    """``klack inspect``."""

    schema: Literal["klack-inspect/1"]
    file: str
    parts: Annotated[
        dict[str, list[InspectedRowJson]],
        Field(
            description="By the name of the file, or of each body of a case; also 'case: "
            "parameters', 'case: values of expressions', 'case: components', 'case: connections'."
        ),
    ]


class ShownNodeJson(TypedDict):
    """One connection of a network."""

    domain: str
    ports: Annotated[list[str], Field(description="As component.port.")]
    fixed: Annotated[str | None, Field(description="ground or ambient, if it is that.")]


class ShowJson(TypedDict):
    """``klack show``."""

    schema: Literal["klack-show/1"]
    case: str
    file: str
    bodies: Annotated[
        dict[str, list[str]], Field(description="Named surfaces of each body that is drawn.")
    ]
    components: Annotated[
        dict[str, str], Field(description="Type by name; none without a network.")
    ]
    nodes: list[ShownNodeJson]


class ComponentPortJson(TypedDict):
    """Port of a component type."""

    domain: str
    optional: bool


class ComponentKeyJson(TypedDict):
    """Key of a component type."""

    unit: Annotated[str, Field(description="SI; empty for words and whole numbers.")]
    required: bool
    meaning: str


class ComponentTypeJson(TypedDict):
    """A component type."""

    summary: str
    ports: Annotated[
        dict[str, ComponentPortJson],
        Field(description="Empty for a body, whose ports are its points."),
    ]
    keys: dict[str, ComponentKeyJson]
    equation: Annotated[str, Field(description="LaTeX; empty if there is none.")]
    source: Annotated[str, Field(description="Empty for a definition.")]


class ComponentsJson(TypedDict):
    """``klack show --components``."""

    schema: Literal["klack-show-components/1"]
    types: Annotated[dict[str, ComponentTypeJson], Field(description="By type.")]


class ReportJson(TypedDict):
    """``klack report``."""

    schema: Literal["klack-report/1"]
    case: str
    result: Annotated[str, Field(description="Folder of the result.")]
    folder: Annotated[str, Field(description="Where the report is.")]
    files: list[str]


class ExportJson(TypedDict):
    """``klack export``."""

    schema: Literal["klack-export/1"]
    case: str
    to: Annotated[str, Field(description="Format.")]
    folder: Annotated[str, Field(description="Where the files are.")]
    files: Annotated[list[str], Field(description="Names of the files and folders written.")]


_OTHERS = (
    InspectionJson,
    ShowJson,
    ComponentsJson,
    ReportJson,
    ExportJson,
    VerificationJson,
    CacheJson,
    WarmJson,
    AboutJson,
)


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
    kinds = (*(analysis.json for analysis in analyses()), *_OTHERS)
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
