"""Sections of a part of a network that cases include, and of the include itself."""

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, WithJsonSchema

from klack.case.parameters import PARAMETERS, Written
from klack.input.section import Count, Name, PlainName, Section, Text

__all__ = ["INCLUDE", "PARTS", "CaseHead", "CaseInclude", "PartFile"]

INCLUDE = "Parts of the network from files of their own."
PARTS = (
    "Texts of the included files, where a result or another stored case holds them; they replace "
    "the files."
)
"""Descriptions of keys that stand in two sections."""

_Values = Annotated[
    Any,
    WithJsonSchema(
        {
            "type": ["string", "number", "array"],
            "examples": ["80 um", ["80 um", "82 um"]],
        }
    ),
]
_Plain = Annotated[Any, WithJsonSchema({"type": "object"})]


class CaseInclude(Section):
    """A part of a network from a file of its own."""

    file: Text = Field(
        min_length=1,
        description="Of the part, in the folder of the file that includes it or below.",
    )
    name: Name = Field(
        alias="as", description="Its components are called after it: injector_needle."
    )
    count: Count | None = Field(
        default=None, le=1000, description="Several of them: injector1, injector2, ..."
    )
    arguments: Mapping[PlainName, _Values] = Field(
        default_factory=dict,
        alias="with",
        description="Parameters of the part: a value or an expression of the parameters of this "
        "file and of 'number', which counts the copies from 1; or a list with a value per copy.",
    )


class CaseHead(Section):
    """Sections of a case that are read before all others."""

    parameters: Mapping[PlainName, Written] = Field(default_factory=dict, description=PARAMETERS)
    include: tuple[CaseInclude, ...] = Field(default=(), description=INCLUDE)
    parts: Mapping[Text, Text] = Field(default_factory=dict, description=PARTS)


class PartFile(Section):
    """A part of a network in a file of its own."""

    klack: Literal[1] = Field(description="Format version of the file: 1.")
    part: Text = Field(min_length=1, description="What it is; one line.")
    description: Text = Field(default="", description="Its limits, and the source of its numbers.")
    parameters: Mapping[PlainName, Written | None] = Field(
        default_factory=dict,
        description="name: default; none (nothing after the colon): to be given by 'with'.",
    )
    ports: Mapping[Name, Text] = Field(
        default_factory=dict,
        description="Names by which others connect it: component.port of this part.",
    )
    include: tuple[CaseInclude, ...] = Field(default=(), description="Parts inside this one.")
    materials: Mapping[Name, _Plain] = Field(default_factory=dict, description="As in a case.")
    bodies: Mapping[Name, _Plain] = Field(default_factory=dict, description="As in a case.")
    stops: Mapping[Name, _Plain] = Field(default_factory=dict, description="As in a case.")
    components: Mapping[Name, _Plain] = Field(
        default_factory=dict, description="name: {type: ..., and the keys of that type}."
    )
    connections: tuple[tuple[Text, ...], ...] = Field(
        default=(), description="Between ports of this part; ground and ambient are allowed."
    )
