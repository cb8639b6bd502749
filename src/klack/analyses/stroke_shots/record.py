"""Record of ``klack shots`` of a whole valve: many strokes, and the centred one.

The numbers are plain columns, one row per stroke, so that a stored study can be reported again
without the solver.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import NDArray

from klack.analyses.record import CaseRecord

__all__ = ["StopColumns", "StrokeColumns", "StrokeShotsStudy", "VariantShots"]

Column = NDArray[np.float64]


def _not_kept() -> Column:
    return np.zeros(0)


@dataclass(frozen=True, kw_only=True, eq=False)
class StrokeColumns:
    """Strokes in rows: start and results; what a stroke does not reach is nan.

    Every field is an array of shape (n,).

    Parameters
    ----------
    eccentricity, direction : array [m], [rad]
        Distance of the axis of the needle from that of the valve at the height of the seat, at the
        start, and where to (from x towards y).
    tilt, tilt_direction : array [rad]
        Angle between the axes, and direction in which the upper end is tilted.
    friction : array [-]
        Coulomb's coefficient in the guide.
    contact_friction : array [-]
        The same between the faces of all stops, where it is drawn.
    opening_time, closing_time : array [s]
    impacts : array [-]
        On all stops.
    impact_loss : array [J]
        Kinetic energy of the centre of mass that all impacts take.
    guide_loss : array [J]
        Energy that friction in the guide takes.
    faces_loss : array [J]
        Energy that friction between the faces of all stops takes; nan where they have none.
    injected_energy : array [J]
        Work of the stops on the modes of the held bodies.
    radiated_energy : array [J]
        Sound of their surfaces; nan for a case without a section ``noise``.
    energy_residual : array [-]
        Of the energy balance, over the throughput.
    """

    eccentricity: Column
    direction: Column
    tilt: Column
    tilt_direction: Column
    friction: Column
    contact_friction: Column = field(default_factory=_not_kept)
    opening_time: Column
    closing_time: Column
    impacts: Column
    impact_loss: Column
    guide_loss: Column
    faces_loss: Column = field(default_factory=_not_kept)
    injected_energy: Column
    radiated_energy: Column
    energy_residual: Column

    def __post_init__(self) -> None:
        """Fill in what the first results of many strokes do not have: faces without friction."""
        for name in ("contact_friction", "faces_loss"):
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.full(self.count, np.nan))

    @property
    def count(self) -> int:
        """Number of strokes."""
        return len(self.impacts)

    def row(self, index: int) -> dict[str, float]:
        """Return all numbers of one stroke by the name of their column."""
        return {item.name: float(getattr(self, item.name)[index]) for item in fields(self)}


@dataclass(frozen=True, kw_only=True, eq=False)
class StopColumns:
    """First impact of each stroke on one stop, in rows; nan for a stroke without one.

    Every field is an array of shape (n,).

    Parameters
    ----------
    eccentricity, direction : array [m], [rad]
        Of the axis of the needle at the height of this stop, at first touch.
    tilt, tilt_direction : array [rad]
        At first touch.
    approach_speed : array [m/s]
    peak_force, contact_time, impulse, restitution : array [N], [s], [N s], [-]
    rebound_height : array [m]
        Farthest turn of the centre of mass from this stop after it, from its place at first touch.
    energy_loss : array [J]
    impacts : array [-]
        On this stop, in the whole stroke.
    """

    eccentricity: Column
    direction: Column
    tilt: Column
    tilt_direction: Column
    approach_speed: Column
    peak_force: Column
    contact_time: Column
    impulse: Column
    restitution: Column
    rebound_height: Column
    energy_loss: Column
    impacts: Column

    def row(self, index: int) -> dict[str, float]:
        """Return all numbers of one stroke by the name of their column."""
        return {item.name: float(getattr(self, item.name)[index]) for item in fields(self)}


@dataclass(frozen=True, kw_only=True, eq=False)
class VariantShots:
    """All strokes of one variant.

    Parameters
    ----------
    name, label : str
        ``"wet"`` or ``"dry"``; what a legend says.
    strokes : StrokeColumns
    stops : mapping of str to StopColumns
        By end stop, the seat first.
    centric : StrokeColumns
        One row: started centred and upright, without Coulomb friction in the guide.
    centric_stops : mapping of str to StopColumns
        One row each.
    time : array, shape (k,) [s]
    lift : float32 array, shape (n, k) [m]
        Displacement of the point of the lift; nan after the end of a stroke that failed.
    centric_lift : float32 array, shape (k,) [m]
    failures : mapping of str to str
        By the number of the stroke, why it ended early; its row holds what was known by then.
    """

    name: str
    label: str
    strokes: StrokeColumns
    stops: Mapping[str, StopColumns]
    centric: StrokeColumns
    centric_stops: Mapping[str, StopColumns]
    time: Column
    lift: NDArray[np.float32]
    centric_lift: NDArray[np.float32]
    failures: Mapping[str, str]


@dataclass(frozen=True, kw_only=True, eq=False)
class StrokeShotsStudy(CaseRecord):
    """Many strokes of one valve in some variants, with the same draws.

    Parameters
    ----------
    seed, workers : int
    carry : bool
        Whether every stroke starts from where the one before has left the needle.
    resumed : int
        Strokes that an earlier, interrupted run had finished.
    stroke_time : float [s]
        Wall time of the strokes alone.
    duration : float [s]
        Of each stroke.
    needle, seat, opening_stop : str
        Components; empty where the valve has no such stop.
    guide : str
        In words.
    distributions : mapping of str to str
        In words.
    largest_eccentricity : mapping of str to float [m]
        At the height of each stop: what the guide allows to the axis of a rigid needle.
    mass : float [kg]
        Of the needle.
    points : mapping of str to int
        Contact points of each stop.
    variants : mapping of str to VariantShots
    schematic : str
        Picture of the network (SVG); empty in older results.
    """

    seed: int
    workers: int
    carry: bool
    resumed: int
    stroke_time: float
    duration: float
    needle: str
    seat: str
    opening_stop: str
    guide: str
    distributions: Mapping[str, str]
    largest_eccentricity: Mapping[str, float]
    mass: float
    points: Mapping[str, int]
    variants: Mapping[str, VariantShots]
    schematic: str = ""

    @property
    def count(self) -> int:
        """Number of strokes of each variant."""
        return next(iter(self.variants.values())).strokes.count
