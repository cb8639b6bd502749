"""Section ``thermal``: what a stroke warms, and what follows temperatures."""

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field, Strict, StringConstraints

from klack.input.section import Name, Section, Text
from klack.units import Expansion, Length, Ratio, Temperature, TemperatureRise, Time

__all__ = ["CaseThermal", "Growth", "GrowthLength", "HeatedMagnet", "SentHeat"]

_REFERENCE = 293.15

_WORD = r"[A-Za-z_][A-Za-z0-9_-]*"
CoilName = Annotated[str, Strict(), StringConstraints(pattern=rf"^{_WORD}(\.{_WORD})?$")]
"""Component of a coil, and its circuit where several."""


class SentHeat(Section):
    """A loss of the stroke that warms a node."""

    loss: Text = Field(
        examples=["coil ohmic"],
        description="A component, for all its losses, or one of them with its name in the "
        "energy balance: coil ohmic, coil eddy, seat contact, feed flow.",
    )
    node: Name = Field(description="Thermal node: a heat-capacity.")
    share: Ratio = Field(default=1.0, gt=0, le=1, description="Of that loss.")


class HeatedMagnet(Section):
    """Permanent magnets whose remanence follows a temperature."""

    node: Name = Field(description="Thermal node.")
    coefficient: Expansion = Field(
        description="Relative change of the remanence; NdFeB -0.0012 1/K, ferrite -0.002 1/K."
    )
    reference: Temperature = Field(
        default=_REFERENCE,
        gt=0,
        description="Temperature at which the remanence of the case holds.",
    )


class GrowthLength(Section):
    """One length of a chain that closes in a gap."""

    node: Name = Field(description="Thermal node that gives its temperature.")
    length: Length = Field(
        description="Length of the part; above 0 if the gap widens when the part grows, below 0 "
        "if it "
        "narrows."
    )
    expansion: Expansion = Field(
        examples=["11.5e-6 1/K"], description="Linear thermal expansion of its material."
    )


class Growth(Section):
    r"""A gap that changes with the temperatures, ``g = g_0 + sum(l alpha (T - T_ref))``.

    A preload changes by the stiffness of its spring: ``F = F_0 - k sum(...)``, with the chain of
    the length in which the spring is held.
    """

    of: tuple[Text, ...] = Field(
        examples=[["stop.gap", "coil.gap"]],
        min_length=1,
        description="Keys that change, as component.key: lengths, or the preload of a spring.",
    )
    lengths: tuple[GrowthLength, ...] = Field(min_length=1, description="The chain.")
    reference: Temperature = Field(
        default=_REFERENCE, gt=0, description="Temperature at which the numbers of the case hold."
    )

    def change(self, temperature: Mapping[str, float]) -> float:
        """Change of the gap [m] at node temperatures [K]."""
        return sum(
            item.length * item.expansion * (temperature[item.node] - self.reference)
            for item in self.lengths
        )


class CaseThermal(Section):
    """Input of klack heat: where the losses go, and what follows the temperatures."""

    period: Time = Field(
        examples=["100 ms"],
        gt=0,
        description="Time from one stroke to the next; run.duration or more.",
    )
    heat: tuple[SentHeat, ...] = Field(
        default=(), description="Losses of the stroke, and the nodes that they warm."
    )
    windings: Mapping[CoilName, Name] = Field(
        default_factory=dict,
        description="coil: node of its copper, in place of its winding_temperature; magnet.circuit "
        "for a further circuit of a magnetic-network.",
    )
    fluid: Name | None = Field(
        default=None, description="Node of the fluid; default: the ambient temperature."
    )
    magnets: Mapping[Name, HeatedMagnet] = Field(
        default_factory=dict, description="coil: temperature of its permanent magnets."
    )
    growth: Mapping[Name, Growth] = Field(
        default_factory=dict, description="name: a gap that changes with temperatures."
    )
    duration: Time | None = Field(
        default=None, gt=0, description="Duration of the warm-up; default: to the steady state."
    )
    tolerance: TemperatureRise = Field(
        default=0.1,
        ge=1e-6,
        le=100,
        description="Error of a step, and distance to the steady state.",
    )
    spacing: TemperatureRise = Field(
        default=5.0,
        ge=1e-5,
        le=500,
        description="Largest temperature change before a stroke is computed again.",
    )
