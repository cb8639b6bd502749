"""Contact laws of an end stop as a case file writes them."""

from math import log, sqrt
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from klack.contact.laws import HertzLaw, LinearLaw, TableLaw
from klack.input.problem import problem_at
from klack.input.section import Section
from klack.units import Force, Length, Modulus, Stiffness

__all__ = [
    "AsperityStopLaw",
    "ConsistentStopLaw",
    "HertzStopLaw",
    "LinearStopLaw",
    "StopLaw",
    "TableStopLaw",
]

_LARGEST_FORCE = 1e5  # [N] of an asperity law; straight on from there
_POINTS_PER_HEIGHT = 40  # force within 2e-4 of the exponential, at its start


class ConsistentStopLaw(Section):
    """Law from the static contact of both bodies, less what their modes carry; filled in later."""

    kind: Literal["consistent"] = Field(description="Which law: consistent.")


class LinearStopLaw(Section):
    """Constant stiffness, ``F = k d``."""

    kind: Literal["linear"] = Field(description="Which law: linear.")
    stiffness: Stiffness = Field(
        examples=["1e9 N/m"], gt=0, description="Stiffness k of only the contact zone."
    )

    def contact_law(self) -> LinearLaw:
        """Return the law."""
        return LinearLaw(self.stiffness)


class HertzStopLaw(Section):
    """Smooth curved faces, ``F = 4/3 E* sqrt(R) d^(3/2)`` (Hertz 1882)."""

    kind: Literal["hertz"] = Field(description="Which law: hertz.")
    radius: Length = Field(gt=0, description="Effective radius R: 1/R = 1/R1 + 1/R2.")
    modulus: Modulus = Field(
        gt=0, description="E*: 1/E* = (1 - nu1^2)/E1 + (1 - nu2^2)/E2; 115 GPa for steel on steel."
    )

    def contact_law(self) -> HertzLaw:
        """Return the law."""
        return HertzLaw(4.0 / 3.0 * self.modulus * sqrt(self.radius))


class TableStopLaw(Section):
    """Monotone curve through measured or computed points, from the origin."""

    kind: Literal["table"] = Field(description="Which law: table.")
    indentation: tuple[Length, ...] = Field(
        min_length=1, description="Indentations from first touch, increasing."
    )
    force: tuple[Force, ...] = Field(min_length=1, description="One force per indentation.")

    @model_validator(mode="after")
    def _is_a_law(self) -> Self:
        with problem_at("indentation"):
            self.contact_law()
        return self

    def contact_law(self) -> TableLaw:
        """Return the law."""
        return TableLaw(self.indentation, self.force)


class AsperityStopLaw(Section):
    r"""Rough flat faces whose summits touch one after the other.

    .. math:: F = F_0 \bigl(e^{d/s} - 1\bigr)

    An exponential height distribution of summits makes load and real area of contact grow alike
    (Greenwood and Williamson 1966); ``- 1`` lets it start at zero.  In series with the bulk.
    """

    kind: Literal["asperity"] = Field(description="Which law: asperity.")
    force: Force = Field(gt=0, description="F0.")
    height: Length = Field(gt=0, description="Height s over which the force grows by a factor e.")

    def contact_law(self) -> TableLaw:
        """Table within 2e-4 up to 100 kN and straight beyond."""
        most = max(log(1.0 + _LARGEST_FORCE / self.force), 1.0)
        x = np.linspace(0.0, most, int(_POINTS_PER_HEIGHT * most) + 2)
        return TableLaw(self.height * x, self.force * np.expm1(x))


StopLaw = Annotated[
    ConsistentStopLaw | LinearStopLaw | HertzStopLaw | TableStopLaw | AsperityStopLaw,
    Field(discriminator="kind"),
]
