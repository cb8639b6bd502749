"""A needle that drops on its seat and bounces in exact parabolas."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["BouncingDrop"]


@dataclass(frozen=True, slots=True, kw_only=True)
class BouncingDrop:
    """Closed form: rest, free fall, contacts of a given time, parabolas, rest.

    During a contact the lift is the cubic that joins both speeds below the level 0, so that
    approach and rebound speed are exact at first touch and release.

    Parameters
    ----------
    speed : float [m/s]
        At first touch.
    acceleration : float [m/s^2]
    restitution : tuple of float
        Per impact; the needle rests after the flight that follows the last.
    contact : float [s]
    before, after : float [s]
        Rest at the top, and on the seat.
    """

    speed: float
    acceleration: float
    restitution: tuple[float, ...]
    contact: float = 0.0
    before: float = 200e-6
    after: float = 300e-6

    @property
    def height(self) -> float:
        """From which it drops [m]."""
        return self.speed**2 / (2.0 * self.acceleration)

    @property
    def speeds(self) -> tuple[float, ...]:
        """Approach speed of each impact, and of the touch after which it rests [m/s]."""
        return tuple((self.speed * np.cumprod([1.0, *self.restitution])).tolist())

    @property
    def touches(self) -> tuple[float, ...]:
        """First touch of each impact, and of the last landing [s]."""
        times = [self.before + self.speed / self.acceleration]
        for w in self.speeds[1:]:
            times.append(times[-1] + self.contact + 2.0 * w / self.acceleration)
        return tuple(times)

    @property
    def duration(self) -> float:
        """Of the whole record [s]."""
        return self.touches[-1] + self.after

    def lift(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Height of the needle above its seat [m]."""
        a, v = self.acceleration, self.speeds
        fall = np.clip(time - self.before, 0.0, v[0] / a)
        x = np.where(time < self.touches[0], self.height - 0.5 * a * fall**2, 0.0)
        for k, touch in enumerate(self.touches[:-1]):
            release = touch + self.contact
            if self.contact > 0.0:
                u = np.clip((time - touch) / self.contact, 0.0, 1.0)
                dip = -self.contact * u * (1.0 - u) * (v[k] * (1.0 - u) + v[k + 1] * u)
                x = np.where((time >= touch) & (time < release), dip, x)
            s = time - release
            flies = (s >= 0.0) & (s < 2.0 * v[k + 1] / a)
            x = np.where(flies, v[k + 1] * s - 0.5 * a * s**2, x)
        return np.asarray(x)
