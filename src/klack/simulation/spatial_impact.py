"""What is recorded of one impact of bodies that meet point by point."""

from dataclasses import dataclass

import numpy as np

from klack.arrays import Floats

__all__ = ["FilmLand", "FilmMoments", "ModalMoments", "SpatialImpact"]


_RING = 0.25  # spread of the force over its mean radius, below which it lies on a ring


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmLand:
    """Numbers that the pressure of a film follows from, beside its lift and tilts.

    Parameters
    ----------
    inner_radius, outer_radius : float [m]
        Of the land, unrolled where it is a cone.
    sectors, circles : int
        As of :func:`klack.hydraulics.tilted_film.sector_film`.
    viscosity : float [Pa s]
    tension : float [Pa]
        Largest mean tension of a sector.
    lowest : float [m]
        Height that roughness leaves.
    slope : float [-]
        Axial force per force along the lift.
    shear : float [N s]
        Force over closing speed, times the height, of the flow along a cone: no pressure.
    """

    inner_radius: float
    outer_radius: float
    sectors: int
    circles: int
    viscosity: float
    tension: float
    lowest: float
    slope: float
    shear: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FilmMoments:
    """A film in single time steps about an impact.

    Parameters
    ----------
    land : FilmLand
    time, step : array, shape (k,) [s]
        Start and length of the step.
    film_force : array, shape (k,) [N]
        Mean axial force over the step.
    before, after : array, shape (k, 3) [m], [-]
        Lift and both tilts of the land at the start and at the end of the step.
    """

    land: FilmLand
    time: Floats
    step: Floats
    film_force: Floats
    before: Floats
    after: Floats


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModalMoments:
    """Modal coordinates of all bodies at moments of an impact.

    Parameters
    ----------
    bodies : tuple of str
        The needle first.
    counts : tuple of int
        Coordinates of each body, rigid ones first.
    time : array, shape (k,) [s]
        The first one is before the first touch.
    coordinates : array, shape (k, M) [m sqrt(kg)]
        Body by body.
    shape_marks : array, shape (M,) [1/sqrt(kg)]
        By which the shapes of the modes are known again; empty for bodies without meshes.
    """

    bodies: tuple[str, ...]
    counts: tuple[int, ...]
    time: Floats
    coordinates: Floats
    shape_marks: Floats

    def of(self, body: str) -> Floats:
        """Coordinates of one body, shape (k, m)."""
        at = self.bodies.index(body)
        first = sum(self.counts[:at])
        return self.coordinates[:, first : first + self.counts[at]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SpatialImpact:
    r"""Contact forces round the ring of one impact, and what else was recorded of it.

    A contact point gives its force to the sectors that its share of the circumference lies in, so
    that the sum over the sectors is the contact force, and with the intervals its impulse.

    Parameters
    ----------
    number : int
        Of the impacts of the run that were recorded, from 1, in order of their first touch.
    stop : str
        Component.
    edges : array, shape (n + 1,) [s]
        Ends of the intervals, from the first touch.
    sector_force : array, shape (n, S) [N]
        Mean axial force of each sector over each interval.  Sector ``k`` lies between the angles
        ``2 pi k / S`` and ``2 pi (k + 1) / S``, from +x towards +y.
    radius : float [m]
        Mean distance of the force from the axis of the stop.
    spread : float [m]
        Standard deviation of that distance.
    height : float [m]
        Mean height of the force, in the drawing of the lower body of the stop.
    film : FilmMoments or None
        Of a stop without a film, or whose film no tilt changes.
    modes : ModalMoments or None
        Of the first impacts of a run.
    """

    number: int
    stop: str
    edges: Floats
    sector_force: Floats
    radius: float
    spread: float
    height: float
    film: FilmMoments | None = None
    modes: ModalMoments | None = None

    @property
    def begin(self) -> float:
        """First touch [s]."""
        return float(self.edges[0])

    @property
    def durations(self) -> Floats:
        """Lengths of the intervals, shape (n,) [s]."""
        return np.diff(self.edges)

    @property
    def impulse(self) -> float:
        """Of the contact force [N s]."""
        return float(self.durations @ self.sector_force.sum(axis=1))

    @property
    def line_load(self) -> Floats:
        """Force per length of the ring through the contact points, shape (n, S) [N/m]."""
        sectors = self.sector_force.shape[1]
        return self.sector_force * (sectors / (2.0 * np.pi * self.radius))

    @property
    def is_ring(self) -> bool:
        """Whether the force lies on a ring, and not on a disc or a spot aside."""
        return self.spread < _RING * self.radius
