"""Way of a needle in space over a run."""

from dataclasses import dataclass, field

import numpy as np
import scipy

from klack.arrays import Vector

__all__ = ["SpatialPath"]


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
        """Add a moment; what was later is forgotten, since it has been computed again.

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
