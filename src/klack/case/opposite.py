"""The stop on the other side of the moving body's travel."""

from pydantic import Field

from klack.case.bodies import BodySurface, SurfaceName
from klack.input.section import Section
from klack.units import Length

__all__ = ["CaseOpposite"]


class CaseOpposite(Section):
    """A third body above, which the moving body may hit on its way back.

    Only the interface level knows it, in ``klack impact`` and ``klack shots``.
    """

    between: tuple[BodySurface, BodySurface] = Field(
        description="Surface of the stop above, then surface of the moving body that meets it."
    )
    gap: Length = Field(
        gt=0, description="Way of the moving body upwards, from its start to the stop above."
    )
    reach: Length | None = Field(
        default=None, gt=0, description="Largest gap of points that may come into contact."
    )

    @property
    def stop(self) -> SurfaceName:
        """Surface of the stop above."""
        return self.between[0]

    @property
    def moving(self) -> SurfaceName:
        """Surface of the moving body."""
        return self.between[1]
