r"""Where a source meets a receiver: freedoms at points, and what either side is there.

Time as :math:`e^{s t}` with :math:`s = \alpha + i\omega`; on the real axis of frequency
:math:`\alpha = 0`.  A mobility is a velocity per force.  A point has up to six freedoms, and the
blocks of a matrix have different units:

============================  =============  =============
                              per force      per moment
============================  =============  =============
velocity                      m/(N s)        1/(N s)
velocity of rotation          1/(N s)        1/(N m s)
============================  =============  =============

So no norm, condition or singular value means anything before the moments are scaled by a length.
Spectra are those of one click, in unit s = unit/Hz, unless a function says otherwise.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from klack.arrays import Complexes, Matrix, Vector
from klack.errors import refuse_if

__all__ = [
    "DIRECTIONS",
    "Complexes",
    "Freedom",
    "InterfacePoint",
    "Receiver",
    "ReceiverResponse",
    "SourceAtMounts",
    "freedoms_of",
    "laplace",
]

Complexes = Complexes
"""Complex numbers."""

DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
"""Names of the directions 1 to 6: along the axes of a point, and about them."""


@dataclass(frozen=True, slots=True)
class Freedom:
    """A motion of a point and the force (moment) that does work on it.

    Parameters
    ----------
    point
        Name of an :class:`InterfacePoint`.
    direction
        1, 2, 3: along x, y, z of the point's own axes; 4, 5, 6: about them; negative: against.
    """

    point: str
    direction: int

    def __post_init__(self) -> None:
        refuse_if(
            not 1 <= abs(self.direction) <= 6,
            f"freedom of '{self.point}'",
            got=f"direction {self.direction}",
            expected="1 to 6 for x, y, z, rx, ry, rz, with a minus where it is reversed",
            hint="a scalar (direction 0) can be a pressure at an ear, but not a degree of "
            "freedom of a mount.",
        )

    @property
    def index(self) -> int:
        """Place in the six freedoms of a point, from 0."""
        return abs(self.direction) - 1

    @property
    def sign(self) -> float:
        """-1 where the direction is reversed, else 1."""
        return -1.0 if self.direction < 0 else 1.0

    @property
    def is_rotation(self) -> bool:
        """True of a rotation and its moment."""
        return abs(self.direction) > 3

    def __str__(self) -> str:
        """``flange.z``, ``flange.-z``, ``flange.rx``."""
        return f"{self.point}.{'-' if self.direction < 0 else ''}{DIRECTIONS[self.index]}"


def freedoms_of(point: str, names: Iterable[str] = DIRECTIONS) -> tuple[Freedom, ...]:
    """Freedoms of a point by their names: ``x``, ``-z``, ``rx``; all six without.

    >>> [str(freedom) for freedom in freedoms_of("clip", ("x", "-z"))]
    ['clip.x', 'clip.-z']
    """
    known = {name: place + 1 for place, name in enumerate(DIRECTIONS)}
    known |= {f"-{name}": -place for name, place in known.items()}
    chosen = tuple(names)
    for name in chosen:
        refuse_if(
            name not in known,
            f"freedoms of '{point}'",
            got=f"'{name}'",
            expected=f"some of {', '.join(DIRECTIONS)}, with a minus where reversed",
            hint="rx, ry, rz are rotations about the axes of the point.",
        )
    return tuple(Freedom(point, known[name]) for name in chosen)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InterfacePoint:
    """A mounting point with its own axes; its moments are about its position.

    Parameters
    ----------
    name
    position (3,) [m]
        In the frame of the drawing (source) or of the measurement (receiver).
    axes (3, 3)
        Rows are the unit vectors x, y, z of the point in that frame; right-handed.
    """

    name: str
    position: Vector = field(default_factory=lambda: np.zeros(3))
    axes: Matrix = field(default_factory=lambda: np.eye(3))

    def __post_init__(self) -> None:
        axes = np.asarray(self.axes, dtype=float)
        square = axes.shape == (3, 3) and bool(np.abs(axes @ axes.T - np.eye(3)).max() < 1e-6)
        refuse_if(
            not square or np.linalg.det(axes) < 0.0,
            f"axes of '{self.name}'",
            got="left-handed axes" if square else "no three unit vectors at right angles",
            expected="x, y and z = x cross y, each of length 1",
            hint="give only x and y: z follows from them.",
        )


def laplace(frequency: Vector, shift: float = 0.0) -> Complexes:
    r"""Points :math:`s = \alpha + 2\pi i f` [1/s], shape (k,), on or beside the axis of frequency.

    Parameters
    ----------
    frequency (k,) [Hz]
    shift [1/s]
        :math:`\alpha`.
    """
    return shift + 2j * np.pi * np.asarray(frequency, dtype=float)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SourceAtMounts:
    r"""A vibrating body as a source at its mounts, independent of what carries it.

    With the internal forces :math:`f` and the mobilities of the free body

    .. math:: v_f = Y_{if} f, \qquad Y_S F_{bl} = v_f

    (Moorhouse, Elliott & Evans 2009): the velocity of the free mounts, and the force on mounts
    that are held.

    Parameters
    ----------
    frequency (k,) [Hz]
        Rising, above 0 where ``shift`` is 0.
    points
        Mounting points, in the frame of the drawing.
    freedoms : tuple of Freedom, n of them
    free_velocity (k, n) [m/s/Hz, 1/Hz for rotations]
    blocked_force (k, n) [N/Hz, N m/Hz for moments]
        Force of the source on what holds it.
    mobility (k, n, n)
        Symmetric; units see above.
    shift [1/s]
        All values stand at ``s = shift + 2 pi i frequency`` (see :func:`laplace`).
    """

    frequency: Vector
    points: tuple[InterfacePoint, ...]
    freedoms: tuple[Freedom, ...]
    free_velocity: Complexes
    blocked_force: Complexes
    mobility: Complexes
    shift: float = 0.0

    def __post_init__(self) -> None:
        k, n = np.size(self.frequency), len(self.freedoms)
        shapes = self.free_velocity.shape, self.blocked_force.shape, self.mobility.shape
        refuse_if(
            shapes != ((k, n), (k, n), (k, n, n)),
            "SourceAtMounts",
            got=f"arrays of the shapes {shapes}",
            expected=f"{(k, n)}, {(k, n)}, {(k, n, n)} for {k} frequencies and {n} freedoms",
            hint="the first axis is that of frequency.",
        )

    @property
    def s(self) -> Complexes:
        """Where the values stand [1/s], shape (k,)."""
        return laplace(self.frequency, self.shift)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReceiverResponse:
    """A receiver at given points ``s``.

    Parameters
    ----------
    mobility (k, n, n)
        At the freedoms of the receiver.
    transfers (k, ears, n) [Pa/N, Pa/(N m) for moments]
        Sound pressure at each ear per force on each freedom.
    """

    mobility: Complexes
    transfers: Complexes


class Receiver(Protocol):
    """What carries the source: a model, or measured responses."""

    @property
    def points(self) -> tuple[InterfacePoint, ...]:
        """Points in the receiver's own frame."""

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Freedoms of the columns and rows, n of them."""

    @property
    def ears(self) -> tuple[str, ...]:
        """Names of the places where the sound pressure is known; may be none."""

    def at(self, s: Complexes) -> ReceiverResponse:
        """Return mobility and transfers at ``s`` (k,) [1/s].

        Where only measured values exist, it rejects frequencies beyond them and an ``s`` that has
        a real part.
        """
