"""Faces that earlier impacts have worn."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from klack.contact.mortar import ContactSpace

__all__ = ["WornFaces", "opened_by"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WornFaces:
    """Set of both faces along the meridian.

    Parameters
    ----------
    radius (n,) [m]
        From the axis of motion, increasing.
    opening (n,) [m]
        Gap that has stayed between both faces, along their normal; linear between the radii,
        constant outside.
    """

    radius: NDArray[np.float64]
    opening: NDArray[np.float64]


def opened_by(space: "ContactSpace", worn: WornFaces | None) -> "ContactSpace":
    """Contact points of worn faces, which touch first where those as made (``space``) did."""
    if worn is None:
        return space
    radius = np.linalg.norm(space.points[:, :-1], axis=1)
    start = min(space.clearance, space.touch)
    opened = replace(
        space,
        gap=space.gap + np.interp(radius, worn.radius, worn.opening),
        beyond=space.beyond + float(worn.opening.min()),
    )
    opened = opened.shifted(start - opened.touch)
    # a worn land closes at once: its weighted gaps touch with the faces themselves
    return replace(opened, clearance=start)
