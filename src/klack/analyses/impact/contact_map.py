r"""Contact points laid out in a plane, so that their forces can be drawn as a picture.

A ring is unrolled: angle round its axis, and distance across it along the surface.  A spot is seen
along the axis of motion.  An axisymmetric contact keeps its distance across alone.  Points and
forces tell which of them a contact is.

Nothing is interpolated: every point of the picture belongs to the nearest contact point, and a
contact point spreads its force evenly over its cell.  With :math:`w_k` the share of cell *k* that a
column of the width :math:`\Delta x` holds, the force per length of that column is

.. math:: q(x, t) = \frac{1}{\Delta x} \sum_k w_k(x) \, \lambda_k(t),

and the integral of *q* is the sum of the point forces exactly.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.analyses.impact.record import PressureRecord

__all__ = [
    "Cells",
    "ContactMap",
    "averaged",
    "cell_edges",
    "closed",
    "contact_map",
    "line_load_weights",
    "map_cells",
]

Floats = NDArray[np.float64]

_RING = 0.25
"""Spread of the force over the mean radius below which a contact is a ring."""
_WIDEST_GAP = 180.0
_EARLY = 0.1
"""Share of the peak force until which the contact is still the first touch."""
_FAR = 2.0
"""Reach of a cell, in distances to the nearest other point."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContactMap:
    """Places of the contact points in the plane of the picture.

    Parameters
    ----------
    shape
        Of axisymmetric bodies ``meridian`` (a ring) or ``disc`` (around the axis).
    along (nc,)
        Ring: angle from +x towards +y, 0 to 360 [deg]; spot: x [m]; else 0.
    across (nc,) [m]
        Ring: distance along the surface, outwards, from where the bodies touch first.  Spot: y.
        Disc: distance from the axis.  A spot is counted from the centre of its force.
    radius [m]
        Mean radius; nan without a ring.
    """

    shape: Literal["ring", "spot", "meridian", "disc"]
    along: Floats
    across: Floats
    radius: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Cells:
    """The picture, cut into rectangles that each belong to one contact point.

    Parameters
    ----------
    along (nx + 1,), across (ny + 1,)
        Edges of the rectangles, in the units of the map.
    owner (ny, nx)
        Contact point of each rectangle; -1 beyond the surface.
    closed
        The last column borders on the first one.
    """

    along: Floats
    across: Floats
    owner: NDArray[np.int64]
    closed: bool


def contact_map(record: PressureRecord) -> ContactMap:
    """Lay out the contact points of a record with some force."""
    weight = np.asarray(record.point_force, dtype=float).sum(axis=0)
    axes = [np.zeros(1)]
    if record.points.shape[1] == 3:
        axes = [np.zeros(2), np.average(record.points[:, :2], axis=0, weights=record.area)]
    spread, mean, axis = min(
        (_about_axis(record, weight, axis) for axis in axes), key=lambda found: found[0]
    )
    is_ring = spread < _RING * mean
    if record.points.shape[1] == 2:
        if not is_ring:
            return _map("disc", np.zeros(len(weight)), record.points[:, 0], np.nan)
        across = _across(record, record.points[:, 0], weight)
        return _map("meridian", np.zeros(len(weight)), across, mean)
    x, y = (record.points[:, :2] - axis).T
    angle = np.degrees(np.arctan2(y, x)) % 360.0
    if is_ring and _widest_gap(angle) < _WIDEST_GAP:
        return _map("ring", angle, _across(record, np.hypot(x, y), weight), mean)
    centre = np.average(record.points[:, :2], axis=0, weights=weight)
    x, y = (record.points[:, :2] - centre).T
    return _map("spot", x, y, np.nan)


def _map(
    shape: Literal["ring", "spot", "meridian", "disc"],
    along: Floats,
    across: Floats,
    radius: float,
) -> ContactMap:
    return ContactMap(shape=shape, along=along, across=across, radius=radius)


def _about_axis(
    record: PressureRecord, weight: Floats, axis: Floats
) -> tuple[float, float, Floats]:
    """Spread of the force in the meridian plane [m], mean radius [m], and axis."""
    radius = np.linalg.norm(record.points[:, :-1] - axis, axis=1)
    place = np.column_stack([radius, record.points[:, -1]])
    mean = np.average(place, axis=0, weights=weight)
    square = np.average(np.sum((place - mean) ** 2, axis=1), weights=weight)
    return float(np.sqrt(square)), float(mean[0]), axis


def _widest_gap(angle: Floats) -> float:
    turned = np.sort(angle)
    return float(np.diff(turned, append=turned[0] + 360.0).max())


def _across(record: PressureRecord, radius: Floats, weight: Floats) -> Floats:
    """Distance along the meridian, outwards, from the first touch."""
    place = np.column_stack([radius, record.points[:, -1]])
    apart = place - np.average(place, axis=0, weights=weight)
    # the longer axis of the cloud of candidates is the tangent of the meridian
    tangent = np.linalg.eigh((apart * record.area[:, None]).T @ apart)[1][:, -1]
    distance = apart @ tangent * (1.0 if tangent[0] >= 0 else -1.0)
    total = record.point_force.sum(axis=1)
    until = 1 + int(np.argmax(total >= _EARLY * total.max()))
    early = np.asarray(record.point_force[:until], dtype=float).sum(axis=0)
    return distance - np.average(distance, weights=early)


# --------------------------------------------------------------------------- cells


def map_cells(
    found: ContactMap,
    along: tuple[float, float],
    across: tuple[float, float],
    shape: tuple[int, int],
) -> Cells:
    """Cut a window of a ring or a spot, in units of the map, into (nx, ny) rectangles."""
    x = np.linspace(*along, shape[0] + 1)
    y = np.linspace(*across, shape[1] + 1)
    points = np.column_stack([found.along, found.across])
    scale = 1.0
    if found.shape == "ring":
        scale = np.radians(found.radius)  # [m/deg]
        points = np.concatenate([points + np.array([turn, 0.0]) for turn in (-360.0, 0.0, 360.0)])
    tree = scipy.spatial.cKDTree(points * [scale, 1.0])
    centres = np.meshgrid(0.5 * scale * (x[1:] + x[:-1]), 0.5 * (y[1:] + y[:-1]))
    distance, owner = tree.query(np.stack(centres, axis=-1))
    if found.shape == "spot":
        apart, _ = tree.query(tree.data, k=2)
        nearest = np.asarray(apart)[:, 1]
        owner = np.where(distance <= _FAR * nearest[owner], owner, len(points))
    else:  # the candidates of a ring end at two circles
        low, high = found.across.min(), found.across.max()
        beyond = (centres[1] < low) | (centres[1] > high)
        owner = np.where(beyond, len(points), owner)
    count = len(found.along)
    owner = np.where(owner == len(points), -1, owner % count).astype(np.int64)
    return Cells(along=x, across=y, owner=owner, closed=found.shape == "ring")


def cell_edges(found: ContactMap) -> tuple[NDArray[np.int64], Floats]:
    """Points of an axisymmetric contact from inside to outside, and the edges of their cells [m].

    Edges lie in the middle between neighbours, and at the first and the last point.
    """
    order = np.argsort(found.across)
    places = found.across[order]
    middles = 0.5 * (places[1:] + places[:-1])
    return order, np.concatenate([places[:1], middles, places[-1:]])


def line_load_weights(found: ContactMap, cells: Cells) -> Floats:
    """Force per length of the columns of the picture per point force, shape (nc, nx) [1/m].

    A contact point without a rectangle of its own is left to the column that it lies in.
    """
    count, columns = len(found.along), len(cells.along) - 1
    owned, column = cells.owner >= 0, np.broadcast_to(np.arange(columns), cells.owner.shape)
    place = cells.owner[owned] * columns + column[owned]
    share = np.bincount(place, minlength=count * columns).reshape(count, columns).astype(float)
    bare = np.flatnonzero(share.sum(axis=1) == 0)
    alone = np.searchsorted(cells.along, found.along[bare], side="right") - 1
    share[bare, np.clip(alone, 0, columns - 1)] = 1.0
    width = (cells.along[1] - cells.along[0]) * (
        np.radians(found.radius) if found.shape == "ring" else 1.0
    )
    return np.asarray(share / share.sum(axis=1, keepdims=True) / width)


def averaged(values: Floats, cells: Cells) -> Floats:
    """Moving mean (ny, nx) over two cells either way: one quadratic element.

    What lies beyond the surface has no share.
    """
    inside = (cells.owner >= 0).astype(float)
    size = tuple(2 * width for width in _cell_size(cells))
    border: list[Literal["constant", "wrap"]] = ["constant", "wrap" if cells.closed else "constant"]
    mean, weight = (
        scipy.ndimage.uniform_filter(v, size, mode=border) for v in (values * inside, inside)
    )
    return np.divide(mean, weight, out=np.zeros_like(mean), where=weight > 0)


def closed(carries: NDArray[np.bool_], cells: Cells) -> NDArray[np.bool_]:
    """Loaded cells (ny, nx), with holes and notches of single cells filled."""
    rows, columns = (2 * (width // 2) + 3 for width in _cell_size(cells))  # a little more than one
    # beyond the ends of a ring is its other end, beyond all others nothing
    wide = np.pad(carries, [(rows, rows), (0, 0)])
    wide = np.pad(wide, [(0, 0), (columns, columns)], mode="wrap" if cells.closed else "constant")
    filled = scipy.ndimage.minimum_filter(
        scipy.ndimage.maximum_filter(wide, (rows, columns)), (rows, columns)
    )
    return np.asarray(filled[rows:-rows, columns:-columns] & (cells.owner >= 0))


def _cell_size(cells: Cells) -> tuple[int, int]:
    rows, columns = np.nonzero(cells.owner >= 0)
    owner = cells.owner[rows, columns]
    return _usual_run(owner, columns), _usual_run(owner, rows)


def _usual_run(owner: NDArray[np.int64], line: NDArray[np.int64]) -> int:
    number = np.bincount(owner * (int(line.max(initial=0)) + 1) + line)
    return max(round(float(np.median(number[number > 0]))), 1)
