"""Gaps for which a magnet is described."""

from dataclasses import dataclass
from math import inf

from klack.magnetics.circuit import MagneticCircuit
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.reluctance import GapReluctance

__all__ = ["GapRange"]

_COMPRESSION = 0.05  # of the first and the last cell of a map, or of a table of reluctances
_MAP_END = 0.5  # of these cells: beyond it a straight continuation is no magnet any more


@dataclass(frozen=True, slots=True, kw_only=True)
class GapRange:
    """Working gaps [m] of a magnet.

    Parameters
    ----------
    valid
        Where its law holds; stops must keep the armature inside.
    slack
        By which a contact may exceed that before it is warned of.
    usable
        Beyond it a run stops.
    """

    valid: tuple[float, float]
    slack: float
    usable: tuple[float, float]

    @classmethod
    def of(cls, plant: MagneticCircuit | FluxMap) -> "GapRange":
        """Range of the tables of a circuit or of a map; without end if nothing has a table."""
        if isinstance(plant, FluxMap):
            tables = [plant.gap]
        else:
            laws = [branch.law for branch in plant.branches]
            tables = [law.points for law in laws if isinstance(law, GapReluctance)]
        low = max((float(x[0]) for x in tables), default=-inf)
        high = min((float(x[-1]) for x in tables), default=inf)
        first = min((float(x[1] - x[0]) for x in tables), default=0.0)
        last = min((float(x[-1] - x[-2]) for x in tables), default=0.0)
        return cls(
            valid=(low, high),
            slack=_COMPRESSION * min(first, last),
            usable=(low - _MAP_END * first, high + _MAP_END * last),
        )
