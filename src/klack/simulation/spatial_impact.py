"""What is recorded of one impact of bodies that meet point by point."""

from dataclasses import dataclass, field

import numpy as np
import scipy

from klack.arrays import Floats, Vector

__all__ = ["FilmLand", "FilmMoments", "ModalMoments", "SpatialImpact", "SpatialPath"]


_RING = 0.25  # spread of the force over its mean radius, below which it lies on a ring


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmLand:
    """Numbers that, beside lift and tilts, determine the pressure of a film.

    Parameters
    ----------
    inner_radius, outer_radius [m]
        Of the land, unrolled where it is a cone.
    sectors, circles
        As of :func:`klack.hydraulics.tilted_film.sector_film`.
    viscosity [Pa s]
    tension [Pa]
        Largest mean tension of a sector.
    lowest [m]
        Height that roughness leaves.
    slope [-]
        Axial force per force along the lift.
    shear [N s]
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
    time, step (k,) [s]
        Start and length of the step.
    film_force (k,) [N]
        Mean axial force over the step.
    before, after (k, 3) [m], [-]
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
    bodies
        The needle first.
    counts
        Coordinates of each body, rigid ones first.
    time (k,) [s]
        The first one is before the first touch.
    coordinates (k, M) [m sqrt(kg)]
        Body by body.
    shape_marks (M,) [1/sqrt(kg)]
        Identify the shapes of the modes; empty for bodies without meshes.
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
    """Contact forces round the ring of one impact, and what else was recorded of it.

    The sum over the sectors is the contact force: a contact point gives its force to the sectors
    that its share of the circumference lies in.

    Parameters
    ----------
    number
        From 1, in order of first touch.
    edges (n + 1,) [s]
        Ends of the intervals, from the first touch.
    sector_force (n, S) [N]
        Mean axial force of each sector over each interval.  Sector ``k`` lies between the angles
        ``2 pi k / S`` and ``2 pi (k + 1) / S``, from +x towards +y.
    radius [m]
        Mean distance of the force from the axis of the stop.
    spread [m]
        Standard deviation of that distance.
    height [m]
        Mean height of the force, in the drawing of the lower body of the stop.
    film
        None for a stop without a film, or whose film no tilt changes.
    modes
        Only of the first impacts of a run.
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
        """Whether the force lies on a ring, not on a disc or an eccentric spot."""
        return self.spread < _RING * self.radius


@dataclass(eq=False)
class SpatialPath:
    """Rigid motion of the needle and forces across its axis, filled while it moves."""

    _rows: list[tuple[float, Vector, Vector, Vector, Vector]] = field(default_factory=list)

    def clear(self) -> None:
        """Forget everything."""
        self._rows.clear()

    def add(
        self, time: float, place: Vector, speed: Vector, guide: Vector, side: Vector | None = None
    ) -> None:
        """Add a moment and forget later ones, which are computed again.

        ``side`` are forces and moments of magnets and seats across the axis, shape (n, 4).
        """
        while self._rows and self._rows[-1][0] >= time:
            self._rows.pop()
        across = np.zeros((0, 4)) if side is None else side
        self._rows.append((time, place, speed, np.linalg.norm(guide, axis=1), across))

    @property
    def begun(self) -> bool:
        """Whether it has a moment."""
        return bool(self._rows)

    def position_at(self, time: Vector) -> Vector:
        """Position between the moments, shape (len(time), 6): cubic, with the velocities."""
        if len(self._rows) < 2:
            return np.repeat(self.position, len(time), axis=0)
        return np.asarray(
            scipy.interpolate.CubicHermiteSpline(self.time, self.position, self.velocity)(time)
        )

    @property
    def time(self) -> Vector:
        """Moments, shape (n,) [s]."""
        return np.array([row[0] for row in self._rows])

    @property
    def position(self) -> Vector:
        """Translation of the centre of mass and rotation vector, shape (n, 6) [m], [rad]."""
        return np.array([row[1] for row in self._rows]).reshape(-1, 6)

    @property
    def velocity(self) -> Vector:
        """Rates of both, shape (n, 6) [m/s], [rad/s]."""
        return np.array([row[2] for row in self._rows]).reshape(-1, 6)

    @property
    def guide_force(self) -> Vector:
        """Side force at each height of the guide, shape (n, k) [N]."""
        return np.array([row[3] for row in self._rows])

    @property
    def side_force(self) -> Vector:
        """Forces [N] and moments [N m] about the centre of mass, shape (n, k, 4)."""
        return np.array([row[4] for row in self._rows])
