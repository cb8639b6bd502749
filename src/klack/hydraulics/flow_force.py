"""Flow forces on a needle, in addition to the pressure on its faces.

A jet carries momentum away, which lowers the pressure near the edge and draws the needle shut,
whichever way the fluid runs (Lee & Blackburn 1952).  A column of fluid along the needle that is
accelerated pushes back with ``rho L dQ/dt``.
"""

from math import cos

from pydantic import Field

from klack.input.section import Section
from klack.units import Angle, Length, Ratio

__all__ = ["FlowForce"]


class FlowForce(Section):
    r"""Steady and transient flow force of a seat.

    .. math:: F = -\frac{C_v \cos\theta}{C_q A}\,\frac{\dot m^2}{\varrho} - L \frac{d\dot m}{dt}

    along +z on the needle and, opposite, on the body.  The first term is ``rho Q v cos(theta)``
    with the jet's speed ``v = C_v sqrt(2 dp/rho)`` and equals ``2 C_q C_v A dp cos(theta)`` where
    the flow is turbulent; it always closes.  Not to be added where the pressure on the land is that
    of a flow computation.
    """

    velocity_coefficient: Ratio = Field(
        default=0.98, ge=0, le=1, description="Speed of the jet over the speed without loss."
    )
    jet_angle: Angle | None = Field(
        default=None,
        ge=0,
        description="Between jet and axis; the seat's own surface by default.",
    )
    damping_length: Length = Field(
        default=0.0,
        description="Fluid column accelerated by a change of flow; positive when flow from a to "
        "b runs along +z past the needle.",
    )

    def momentum(self, angle: float) -> float:
        """``C_v cos(theta)`` [-]; ``angle`` [rad] is that of the seat's surface."""
        theta = angle if self.jet_angle is None else self.jet_angle
        return self.velocity_coefficient * cos(theta)
