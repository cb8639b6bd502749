"""The stop on the other side of the moving body's travel."""

from pydantic import Field

from klack.case.bodies import BodySurface, SurfaceName
from klack.contact.friction import MOST_FRICTION, Friction
from klack.input.section import Section
from klack.units import Length, Ratio

__all__ = ["CaseOpposite"]


class CaseOpposite(Section):
    """Third body above, which the moving body may hit after a rebound.

    Only the interface level knows it, in ``klack impact`` and ``klack shots``.
    """

    between: tuple[BodySurface, BodySurface] = Field(
        description="Surface of the upper stop, then the opposing surface of the moving body."
    )
    gap: Length = Field(
        gt=0, description="Travel of the moving body upwards, from its start to the upper stop."
    )
    reach: Length | None = Field(
        default=None, gt=0, description="Largest gap of points that may come into contact."
    )
    friction: Ratio | None = Field(
        default=None,
        ge=0,
        le=MOST_FRICTION,
        description="Coulomb's coefficient between the faces here; default as at the contact.",
    )

    def faces(self, contact: Friction) -> Friction:
        """Friction between the faces, where the contact below has the one given."""
        return contact if self.friction is None else Friction.coulomb(self.friction)

    @property
    def stop(self) -> SurfaceName:
        """Surface of the upper stop."""
        return self.between[0]

    @property
    def moving(self) -> SurfaceName:
        """Surface of the moving body."""
        return self.between[1]
