"""Parts that the JSON of several commands has; numbers are SI, the unit in the key."""

from typing import Annotated

from pydantic import Field
from typing_extensions import TypedDict

__all__ = ["ContactJson", "OwnComponents", "Real", "RejectedJson", "Version"]

Real = float | None
"""A number, or null where there is none (nan, infinite)."""
OwnComponents = Annotated[
    dict[str, str], Field(description="First digits of the SHA-256 of their code, by name.")
]
Version = Annotated[str, Field(description="Version.")]


class ContactJson(TypedDict):
    """Mesh of a contact at the force of the impact; null without a mesh."""

    surfaces: Annotated[str, Field(description="Empty for a stop without surfaces.")]
    half_width_m: Real
    size_over_half_width: Annotated[Real, Field(description="Good up to 1, doubtful above 1.5.")]
    points_across: Annotated[int | None, Field(description="Too few below 5.")]
    doubts: Annotated[
        list[str],
        Field(description="Reasons why no error of impacts there can be estimated; empty if none."),
    ]
    needed_yield_Pa: Annotated[
        Real, Field(description="Yield stress from which on both bodies stay elastic, about.")
    ]


class RejectedJson(TypedDict):
    """A recording that was left out."""

    name: str
    reason: str
