"""What a page shows: bodies as triangles, where they touch, and how they move."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from klack.mesh.skin import Skin

__all__ = ["BodyView", "ContactView", "Curve", "MotionView", "View"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class ContactView:
    """Two surfaces that meet.

    Parameters
    ----------
    name : str
        Of the stop; ``"contact"`` for that of an impact.
    upper, lower : str
        Surfaces, written ``needle.tip``.
    ring : array, shape (n, 3) [m]
        Points of first touch in their order round their centre; one for a point, none where flat
        faces touch all at once.
    closed : bool
        The points are a ring; others are drawn one by one.
    gap : float [m]
        Between both as shown; nan where it is not known.
    """

    name: str
    upper: str
    lower: str
    ring: Floats
    closed: bool
    gap: float


@dataclass(frozen=True, kw_only=True, eq=False)
class MotionView:
    """Shapes of a body and what they do over time.

    Parameters
    ----------
    shapes : int16 array, shape (m, n, dimension)
        Of full range each: mode shapes of the nodes of the surface, rigid ones first, then the
        static rests.
    scale : array, shape (m,)
        Displacement of each shape at 32767, per unit of its amplitude.
    frequency : array, shape (m,) [Hz]
        0 for a rigid motion; nan for a static rest.
    amplitude : array, shape (frames, m)
        Over ``time`` of the page; empty where no impact was computed with these shapes.
    stress : array, shape (n,) [Pa]
        Von Mises at the highest force; empty where it is not known.
    node : int array, shape (n,)
        Nodes of the mesh, rising.
    """

    shapes: NDArray[np.int16]
    scale: Floats
    frequency: Floats
    amplitude: NDArray[np.floating]
    stress: NDArray[np.floating]
    node: NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyView:
    """A body.

    Parameters
    ----------
    name, about : str
        ``about`` in words: where it comes from, its mesh.
    skin : Skin
    held : bool array, shape (v,)
        Vertices of the skin that are held.
    section : array, shape (s, 2, 3) [m]
        Sides of elements in the plane y = 0.
    finest : float [m]
        Shortest side of an element.
    travel : array, shape (frames,) [m]
        Displacement along z of the body as a whole over ``time`` of the page; empty without.
    motion : MotionView or None
    """

    name: str
    about: str
    skin: Skin
    held: NDArray[np.bool_]
    section: Floats
    finest: float
    travel: Floats = field(default_factory=lambda: np.empty(0))
    motion: MotionView | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """A curve with its axes.

    Parameters
    ----------
    name, x_unit, y_unit : str
    x, y : array, shape (n,)
    body : str
        Whose modes its peaks are; empty for a history.
    """

    name: str
    x: Floats
    y: Floats
    x_unit: str
    y_unit: str
    body: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """A page.

    Parameters
    ----------
    name, title, source, description : str
        ``name`` is a short one, for a file; ``source`` says which case, mesh or result this is.
    version : str
        Of klack.
    bodies : tuple of BodyView
    contacts : tuple of ContactView
    time : array, shape (frames,) [s]
        Instants of the motion; empty without one.
    transfer, histories : tuple of Curve
    schematic : str
        SVG of the network; empty without one.
    notes : tuple of str
        What is not shown, and why.
    """

    name: str
    title: str
    source: str
    description: str
    version: str
    bodies: tuple[BodyView, ...]
    contacts: tuple[ContactView, ...] = ()
    time: Floats = field(default_factory=lambda: np.empty(0))
    transfer: tuple[Curve, ...] = ()
    histories: tuple[Curve, ...] = ()
    schematic: str = ""
    notes: tuple[str, ...] = ()
