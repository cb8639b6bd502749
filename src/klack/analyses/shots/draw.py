r"""Random draws of the quantities that vary between drops of one valve.

Each shot has its own stream of numbers, seeded by (seed, index): its draw depends neither on how
many shots there are nor on who computes them.  Every quantity takes the same members of that
stream, so a change of one distribution leaves the draws of all others as they were.

With a guide and no stated distribution, the axis of the moving body passes through one point of the
clearance disc at the lowest guiding height, and one at the highest, each uniform over its disc:

.. math:: x(z) = p_1 + (p_2 - p_1)\frac{z - z_1}{z_2 - z_1}, \qquad |p_1|, |p_2| \le c .

Its eccentricity is ``|x|`` at the height of first touch, its tilt the slope of x.
"""

from dataclasses import dataclass
from math import atan2, cos, hypot, pi, sin

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.assembling.placement import axis_through, in_disc
from klack.case.any_case import AnyCase
from klack.case.distribution import Distribution
from klack.case.schema import Case
from klack.case.shots import Shots, StrokeShots
from klack.errors import InputError, require_positive
from klack.machine.cores import available_cores

__all__ = [
    "ShotDraw",
    "centric_draw",
    "closing_force",
    "draw_shot",
    "drawn_face_friction",
    "drawn_friction",
    "drawn_position",
    "extreme_placements",
    "face_friction",
    "polar",
    "runs_asked",
    "shots_of",
]

_ATTEMPTS = 1000
_HIGHEST_HARMONIC = 40
# Members of the stream of a shot.
_PLACE, _TILT = slice(0, 2), slice(2, 4)
_FORCE, _FRICTION, _WAVINESS, _HARMONICS = 4, 5, 6, 7
_FACES = _HARMONICS + 2 * _HIGHEST_HARMONIC
_NUMBERS = _FACES + 1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ShotDraw:
    """One draw.

    Parameters
    ----------
    index
        From 0; -1 for the centred one.
    aside (2,) [m]
        Axis of the moving body at the height of first touch.
    lean (2,) [rad]
        Slope of that axis, towards x and y.
    force [N]
        Closing force at first touch.
    friction [-]
        Coefficient of Coulomb friction in the guide.
    contact_friction [-]
        That between the faces, while they slip.
    waviness [m]
        Root mean square.
    waves (h, 2) [m]
        Cosine and sine of each harmonic of the ring.
    harmonics (h,)
    """

    index: int
    aside: NDArray[np.float64]
    lean: NDArray[np.float64]
    force: float
    friction: float
    contact_friction: float
    waviness: float
    waves: NDArray[np.float64]
    harmonics: NDArray[np.int64]

    def radial_deviation(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Outward deviation of the ring [m] at angles round the axis [rad]."""
        phase = self.harmonics[:, None] * np.asarray(angle)[None, :]
        return np.asarray(self.waves[:, 0] @ np.cos(phase) + self.waves[:, 1] @ np.sin(phase))


def closing_force(case: Case) -> Distribution:
    """Distribution of the closing force at first touch."""
    stated = case.shots.force if case.shots is not None else None
    return stated if stated is not None else Distribution("fixed", case.motion.closing_force)


def face_friction(case: Case) -> Distribution:
    """Distribution of the kinetic friction coefficient of the faces."""
    stated = case.shots.contact_friction if case.shots is not None else None
    return stated if stated is not None else Distribution("fixed", case.contact.friction)


def draw_shot(case: Case, seed: int, index: int, height: float) -> ShotDraw:
    """Draw shot ``index`` of a case.

    ``height`` [m] is z of first touch in the drawing of the moving body.  InputError when the guide
    leaves no room for the stated eccentricity and tilt.
    """
    shots = shots_of(case)
    stream = _stream(seed, index, 0)
    aside, lean = drawn_position(case, shots, seed, index, height)
    force = closing_force(case).quantile(stream[_FORCE])
    waviness, low, high = 0.0, 2, 1
    if shots.waviness is not None:
        waviness = shots.waviness.rms.quantile(stream[_WAVINESS])
        low, high = shots.waviness.harmonics
    harmonics = np.arange(low, high + 1)
    first = _HARMONICS + 2 * (harmonics - 1)
    waves = scipy.special.ndtri(np.stack([stream[first], stream[first + 1]], axis=1))
    scale = float(np.sqrt(np.sum(waves**2) / 2.0))  # root mean square round the ring
    return ShotDraw(
        index=index,
        aside=aside,
        lean=lean,
        force=force,
        friction=drawn_friction(case, shots, seed, index),
        contact_friction=face_friction(case).quantile(stream[_FACES]),
        waviness=waviness,
        waves=waves * (waviness / scale) if scale > 0.0 else waves,
        harmonics=harmonics,
    )


def centric_draw(case: Case) -> ShotDraw:
    """Shot that all others scatter around: centred, upright, round, with the mean force.

    It has no Coulomb friction in the guide, which a centred body does not touch; viscous drag there
    is no scatter and stays.  Faces slip on each other in a centred impact, too, with the mean
    coefficient.
    """
    return ShotDraw(
        index=-1,
        aside=np.zeros(2),
        lean=np.zeros(2),
        force=closing_force(case).mean,
        friction=0.0,
        contact_friction=face_friction(case).mean,
        waviness=0.0,
        waves=np.zeros((0, 2)),
        harmonics=np.zeros(0, dtype=np.int64),
    )


def extreme_placements(
    case: Case, height: float, directions: int = 8
) -> tuple[tuple[NDArray[np.float64], NDArray[np.float64]], ...]:
    """Farthest placements (aside, lean) that shots can draw, in some directions each.

    Where a distribution has no end, one draw in ten thousand lies beyond.
    """
    shots = shots_of(case)
    extremes = []
    for angle in 2.0 * pi * np.arange(directions) / directions:
        towards = np.array([cos(angle), sin(angle)])
        for sign in (1.0, -1.0):
            if shots.eccentricity is None and shots.tilt is None and case.guide is not None:
                c = case.guide.clearance
                extremes.append(axis_through(case.guide, height, c * towards, sign * c * towards))
                continue
            aside = _largest(shots.eccentricity) * towards
            extremes.append((aside, sign * _largest(shots.tilt) * towards))
    return tuple(extremes)


def runs_asked(
    stated: Shots | StrokeShots, count: int | None, seed: int | None, workers: int | None, runs: str
) -> tuple[int, int, int]:
    """Count, seed and processes: as asked for, else as stated."""
    wanted = stated.count if count is None else count
    require_positive("shots: count", wanted, runs)
    own = stated.seed if seed is None else seed
    return wanted, own, available_cores() if workers is None else workers


def shots_of(case: Case) -> Shots:
    """Section ``shots`` of a case; :class:`InputError` without one."""
    if case.shots is None:
        raise InputError(
            f"{case.path or 'case'}: shots",
            got="no section 'shots'",
            expected="the quantities that vary from shot to shot",
            hint="add 'shots: {count: 50}' and a 'guide', or 'eccentricity' and 'tilt'.",
        )
    return case.shots


def _stream(seed: int, index: int, attempt: int) -> NDArray[np.float64]:
    """Numbers between 0 and 1 for one attempt to draw a shot."""
    return np.random.default_rng([seed, index, attempt]).random(_NUMBERS)


def drawn_friction(case: AnyCase, shots: Shots | StrokeShots, seed: int, index: int) -> float:
    """Coulomb's coefficient in the guide of one shot."""
    if shots.friction is not None:
        return shots.friction.quantile(_stream(seed, index, 0)[_FRICTION])
    return case.guide.friction if case.guide is not None else 0.0


def drawn_face_friction(shots: StrokeShots, seed: int, index: int) -> float:
    """Coulomb's coefficient of all faces; nan where it is not drawn."""
    drawn = shots.contact_friction
    return float("nan") if drawn is None else drawn.quantile(_stream(seed, index, 0)[_FACES])


def drawn_position(
    case: AnyCase, shots: Shots | StrokeShots, seed: int, index: int, height: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Position of the axis of one shot at a height, and its slope, as :func:`draw_shot`."""
    for attempt in range(_ATTEMPTS):
        stream = _stream(seed, index, attempt)
        if shots.eccentricity is None and shots.tilt is None:
            if case.guide is None:
                return np.zeros(2), np.zeros(2)
            c = case.guide.clearance
            low, high = in_disc(stream[_PLACE], c), in_disc(stream[_TILT], c)
            return axis_through(case.guide, height, low, high)
        aside = _vector(shots.eccentricity, stream[_PLACE])
        lean = _vector(shots.tilt, stream[_TILT])
        if _has_room(case, height, aside, lean):
            return aside, lean
    raise InputError(
        f"{case.path or 'case'}: shots",
        got=f"eccentricity and tilt that left the guide in {_ATTEMPTS} draws",
        expected="placements within the radial clearance at all guiding heights",
        hint="make them smaller, or leave both out: then the guide limits the placement.",
    )


def _vector(size: Distribution | None, shares: NDArray[np.float64]) -> NDArray[np.float64]:
    if size is None:
        return np.zeros(2)
    angle = 2.0 * pi * shares[1]
    return size.quantile(float(shares[0])) * np.array([cos(angle), sin(angle)])


def _has_room(
    case: AnyCase, height: float, aside: NDArray[np.float64], lean: NDArray[np.float64]
) -> bool:
    if case.guide is None:
        return True
    at = [aside + lean * (z - height) for z in case.guide.heights]
    return max(hypot(*x) for x in at) <= case.guide.clearance


def _largest(size: Distribution | None) -> float:
    return 0.0 if size is None else size.quantile(1.0 - 1e-4)


def polar(vector: NDArray[np.float64]) -> tuple[float, float]:
    """Length and direction [rad], from x towards y, of a plane vector."""
    return hypot(*vector), atan2(vector[1], vector[0])
