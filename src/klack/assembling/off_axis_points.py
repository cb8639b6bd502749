"""Contact points of faces that meet off their axis."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from klack.assembling.bodies import BodyPair
from klack.contact.gap_update import PlacedGaps, RigidGaps
from klack.contact.mortar import ContactSpace, contact_space
from klack.contact.ring_gaps import RingGaps

__all__ = ["off_axis_rings", "off_axis_space", "touch_height"]

Vector = NDArray[np.float64]

# An eccentric contact carries on a part of the ring only, and yields more.
_SOFTER = 1.6
_WIDER = 4.0
_FIRST = 0.02  # share of the reach: points with so small a gap touch first


def touch_height(space: ContactSpace) -> float:
    """Height z [m] at which the centred bodies touch first."""
    facing = space.axial > 1e-6
    lift = space.gap[facing] / space.axial[facing]
    first = lift <= lift.min() + _FIRST * space.reach
    return float(np.mean(space.points[facing][first, -1]))


def off_axis_space(
    pair: BodyPair,
    space: ContactSpace,
    farthest: Sequence[Vector],
    off_axis: float,
    *,
    centre: Vector,
    upper_moves: bool = True,
) -> ContactSpace:
    """Contact points that close in a centred impact or in one from the farthest placements.

    Parameters
    ----------
    pair : BodyPair
        In first touch.
    space : ContactSpace
        Points of the centred contact.
    farthest : sequence of array, shape (6,) [m], [rad]
        Rigid placements of the moving body: translation of ``centre`` and rotation vector.
    off_axis : float [m]
        Largest distance from the axis among them.
    centre : array, shape (3,) [m]
        Centre of mass of the moving body.
    upper_moves : bool
        Whether that is the upper one.
    """
    reach = space.reach
    surfaces = (pair.upper.mesh, pair.upper_surface, pair.lower.mesh, pair.lower_surface)
    wide = contact_space(
        *surfaces, reach=_WIDER * reach + off_axis, slave=space.slave, form=pair.form
    )
    rigid = RigidGaps.of(wide, *surfaces, centre=centre, form=pair.form)
    gaps = PlacedGaps((rigid,), (upper_moves,))
    keep = wide.gap <= wide.gap.min() + _SOFTER * reach
    for placement in farthest:
        keep |= _gaps_in_touch(gaps, wide.axial, placement, upper_moves) <= _SOFTER * reach
    return _with_neighbours(wide, keep)


def off_axis_rings(
    pair: BodyPair,
    space: ContactSpace,
    farthest: Sequence[Vector],
    off_axis: float,
    *,
    angle: Vector,
    centre: Vector,
    upper_moves: bool = True,
) -> ContactSpace:
    """Hats of a half section whose rings close in a centred impact or in one from afar.

    Whole rings: a needle may come from any side.

    Parameters
    ----------
    pair : BodyPair
        Of bodies of revolution, in first touch.
    angle : array, shape (n,) [rad]
        Of the points of every ring.
    space, farthest, off_axis, centre, upper_moves
        As of :func:`off_axis_space`.
    """
    reach = space.reach
    surfaces = (pair.upper.mesh, pair.upper_surface, pair.lower.mesh, pair.lower_surface)
    wide = contact_space(
        *surfaces, reach=_WIDER * reach + off_axis, slave=space.slave, form=pair.form
    )
    rings = RingGaps.of(wide, *surfaces, angle=angle, centre=centre, form=pair.form)
    gaps, axial = PlacedGaps((rings,), (upper_moves,)), np.repeat(wide.axial, len(angle))
    keep = wide.gap <= wide.gap.min() + _SOFTER * reach
    for placement in farthest:
        near = _gaps_in_touch(gaps, axial, placement, upper_moves) <= _SOFTER * reach
        keep |= np.any(near.reshape(wide.count, -1), axis=1)
    return _with_neighbours(wide, keep)


def _with_neighbours(wide: ContactSpace, keep: NDArray[np.bool_]) -> ContactSpace:
    """These hats and one row more: on coarse elements a contact is hardly wider than a point."""
    G = abs(wide.G_a if wide.slave == "a" else wide.G_b)
    return wide.restricted(G @ (G.T @ keep.astype(float)) > 0)


def _gaps_in_touch(
    gaps: Callable[[Vector], Vector], axial: Vector, placement: Vector, upper_moves: bool
) -> Vector:
    """Gaps [m] after the moving body has been moved along z to its first touch."""
    facing = axial > 1e-6
    side = 1.0 if upper_moves else -1.0
    for _ in range(3):  # points slide along the other surface
        gap = gaps(placement)
        lift = float(np.min(gap[facing] / axial[facing]))
        placement = placement - side * np.array([0.0, 0.0, lift, 0.0, 0.0, 0.0])
    return np.asarray(gap - lift * axial)
