"""Output channels of an impact: sensors on the bodies."""

from collections.abc import Mapping
from typing import Literal, Self

from pydantic import Field, field_validator, model_validator

from klack.bodies.gauges.gauge import GaugeKind
from klack.input.problem import refuse_key_if
from klack.input.section import Count, Name, Number, Section
from klack.signals.low_pass import LowPass
from klack.units import Frequency, Length

__all__ = ["CaseLowPass", "CaseOutput", "check_outputs"]

_AXES = {2: ("r", "z"), 3: ("x", "y", "z")}

Direction = Literal["x", "y", "z", "r", "around"]


class CaseLowPass(Section):
    """Low pass of a sensor and its amplifier."""

    cut_off: Frequency = Field(gt=0, description="Frequency at which 3 dB are lost.")
    order: Count = Field(default=2, le=8, description="Its poles.")
    kind: Literal["bessel", "butterworth"] = Field(
        default="bessel",
        description="bessel preserves the shape of pulses, butterworth their level.",
    )

    @property
    def filter(self) -> LowPass:
        """The low pass itself."""
        return LowPass(cut_off=self.cut_off, order=self.order, kind=self.kind)


class CaseOutput(Section):
    """A sensor at a point of a body, or along a short line on it."""

    name: Name = Field(description="Name of the channel in all results.")
    body: Name = Field(description="Body that carries the sensor.")
    kind: GaugeKind = Field(
        description="displacement, velocity, strain or stress; tension is positive."
    )
    at: tuple[Length, ...] = Field(
        min_length=2,
        max_length=3,
        description="Place in the drawing of the body: [r, z] axisymmetric, [x, y, z] solid.",
    )
    direction: Direction | tuple[Number, ...] = Field(
        default="z",
        description="Direction of the reading: x, y, z, r, or three numbers; around: around the "
        "axis of an axisymmetric body.",
    )
    length: Length = Field(
        default=0.0,
        ge=0,
        description="Gauge length along the direction, over which the mean is read; default: at "
        "the point.",
    )
    low_pass: CaseLowPass | None = Field(
        default=None, description="Low pass of sensor and amplifier; default: unlimited."
    )

    @field_validator("direction", mode="after")
    @classmethod
    def _points_somewhere(cls, value: str | tuple[float, ...]) -> str | tuple[float, ...]:
        refuse_key_if(
            not isinstance(value, str) and (len(value) not in (2, 3) or not any(value)),
            (),
            got=f"{list(value)}",
            expected="a name, or a vector of two numbers [r, z] or three [x, y, z], not zero",
            hint="direction: z is along the axis.",
        )
        return value

    @model_validator(mode="after")
    def _has_kind(self) -> Self:
        refuse_key_if(
            self.direction == "around" and self.kind in ("displacement", "velocity"),
            ("direction",),
            got=f"'around' for a {self.kind}",
            expected="r or z: a body of revolution does not move around its axis",
            hint="strain and stress have that direction.",
        )
        return self

    def vector(self, dimension: int) -> tuple[float, ...] | None:
        """Direction in mesh columns; None around the axis."""
        if self.direction == "around":
            return None
        if isinstance(self.direction, str):
            return tuple(float(axis == self.direction) for axis in _AXES[dimension])
        return self.direction


def check_outputs(
    outputs: tuple[CaseOutput, ...], dimensions: Mapping[str, int], other: str
) -> None:
    """Reject an output that the bodies of the case cannot have (:class:`CaseProblem`).

    Parameters
    ----------
    dimensions
        Of each body: 2 for axisymmetric ones, 3 for solids.
    other
        Section whose forces a gauge does not see, or empty.
    """
    names: set[str] = set()
    for i, output in enumerate(outputs):
        refuse_key_if(
            output.name in names,
            ("outputs", i, "name"),
            got=f"'{output.name}' twice",
            expected="a different name for each output",
            hint="use names of channels in the results.",
        )
        names.add(output.name)
        dimension = dimensions[output.body]
        axes = _AXES[dimension]
        known = (*axes, "around") if dimension == 2 else axes
        fits = (
            output.direction in known
            if isinstance(output.direction, str)
            else len(output.direction) == dimension
        )
        refuse_key_if(
            other,
            ("outputs",),
            got=f"outputs together with '{other}'",
            expected="meshed bodies on which only the contact acts",
            hint=f"remove outputs, or '{other}'.",
            on_key=True,
        )
        refuse_key_if(
            len(output.at) != dimension,
            ("outputs", i, "at"),
            got=f"{len(output.at)} coordinates",
            expected=f"[{', '.join(axes)}] of '{output.body}'",
            hint="give coordinates as in the drawing.",
        )
        refuse_key_if(
            not fits,
            ("outputs", i, "direction"),
            got=f"{output.direction}",
            expected=f"one of: {', '.join(known)}, or {dimension} numbers",
            hint=f"'{output.body}' has the coordinates {', '.join(axes)}.",
        )
