"""The two bodies cut open: meshes on the left, displacement on the right, the contact enlarged.

The colour is the total displacement, with that of the needle as a rigid body, several micrometres;
across the contact only its normal part is continuous, since the surfaces slide.  The magnified
*shape* leaves the rigid closing motion out: magnified with it, the bodies would run through each
other.  Next to the contact strains are so large that magnified elements turn inside out; they are
left out.  The enlarged contact is drawn at true scale, where the surfaces do touch.
"""

from dataclasses import replace
from math import floor, isfinite, log10
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from klack.analyses.impact.record import ImpactStudy, SectionPicture
from klack.report.page import Picture
from klack.report.printed import STYLE, plain, svg
from klack.report.wording import quantity

__all__ = ["section_figure"]

Floats = NDArray[np.float64]

_TINTS = ("#d9e4ef", "#eee6d8", "#e2eddd", "#efe0e8")
_INK = "#22262b"
_VECTOR_LINES = 4000
_MAP = "viridis"
_SHOWN = 0.03
"""Largest magnified displacement over the size of the picture."""
_CRUSHED = 0.2
"""Smallest share of its area of a magnified triangle that is drawn."""


def section_figure(study: ImpactStudy) -> Picture:
    """Draw ``study.sections`` in one picture with equal scales."""
    pictures = study.sections
    low, high = _bounds(pictures)
    width, height = high[0], high[1] - low[1]
    elastic = max(float(np.abs(_elastic(picture)).max()) for picture in pictures)
    factor = _round_down(_SHOWN * max(width, height) / elastic) if elastic > 0 else 1.0
    top = 1e6 * max(float(picture.magnitude.max()) for picture in pictures)
    spot = _contact_spot(pictures, study.contact.half_width)
    with rc_context(STYLE | {"axes.grid": False}):
        tall = float(np.clip(2.75 * height / (2 * width), 2.6, 6.4))
        figure = Figure(figsize=(6.7, tall + 0.9), layout="constrained")
        whole, zoom = figure.subplots(1, 2, width_ratios=(1.0, 1.05))
        for i, picture in enumerate(pictures):
            tint = _TINTS[i % len(_TINTS)]
            _draw_mesh(whole, picture, tint)
            colours = _draw_field(whole, picture, factor * _elastic(picture), top)
        margin = 0.04 * max(width, height)
        _frame(whole, (-width - margin, width + margin), (low[1] - margin, high[1] + margin))
        whole.axvline(0, color=_INK, linewidth=0.5, dashes=(8, 2, 2, 2))
        whole.set_title(f"mesh  |  shape magnified {factor:g}×")
        _draw_zoom(zoom, pictures, spot, _reach(study, max(width, height)), top)
        bar = figure.colorbar(colours, ax=[whole, zoom], location="bottom", shrink=0.6, aspect=40)
        bar.set_label("magnitude of the displacement [µm]")
        return Picture(svg(figure), _note(study, factor))


def _note(study: ImpactStudy, factor: float) -> str:
    time = quantity(study.sections[0].time, "s", 3)
    note = (
        f"Section through the axis {time} after the start of the computation. Left: the meshes, "
        "mirrored; right of the axis: the same section, coloured by the magnitude of the total "
        f"displacement since the start, its shape magnified {factor:g} times."
    )
    closing = [p for p in study.sections if p.closing]
    for picture in closing:
        note += (
            f" The rigid motion of the {picture.body} ({quantity(picture.closing, 'm', 3)} along "
            "the axis) is left out of the shape, but not of the colour, which is why a gap "
            "opens."
        )
    if factor > 1:
        note += " Elements at the contact that magnification would turn inside out are left out."
    return note + " Far right: the contact zone at true scale, with the elements of both bodies."


def _elastic(picture: SectionPicture) -> Floats:
    """Displacement (n, 2) [m] without the rigid closing motion."""
    return picture.displacement - np.array([0.0, picture.closing])


def _bounds(pictures: tuple[SectionPicture, ...]) -> tuple[Floats, Floats]:
    points = np.concatenate([picture.points for picture in pictures])
    return points.min(axis=0), points.max(axis=0)


def _round_down(value: float) -> float:
    """Largest of 1, 2, 5 times a power of ten below ``value``, at least 1."""
    if not isfinite(value) or value <= 1:
        return 1.0
    power = 10.0 ** floor(log10(value))
    return next(step * power for step in (5.0, 2.0, 1.0) if step * power <= value * (1 + 1e-12))


# --------------------------------------------------------------------------- drawing


def _frame(axes: Any, x: tuple[float, float], y: tuple[float, float]) -> None:
    axes.set_aspect("equal")
    axes.set_xlim(1e3 * x[0], 1e3 * x[1])
    axes.set_ylim(1e3 * y[0], 1e3 * y[1])
    axes.set_xlabel("distance from the axis [mm]")
    axes.set_ylabel("height [mm]")


def _draw_mesh(axes: Any, picture: SectionPicture, tint: str) -> None:
    points = 1e3 * picture.points * np.array([-1.0, 1.0])
    axes.add_collection(
        PolyCollection(
            points[picture.triangles], facecolors=tint, edgecolors="none", rasterized=True
        )
    )
    _draw_lines(axes, points[picture.edges], 0.2)
    _draw_lines(axes, points[_rim(picture)], 0.7)


def _draw_field(axes: Any, picture: SectionPicture, shift: Floats, top: float) -> Any:
    points = 1e3 * (picture.points + shift)
    whole = _areas(points, picture.triangles) > _CRUSHED * 1e6 * _areas(
        picture.points, picture.triangles
    )
    colours = axes.tripcolor(
        points[:, 0],
        points[:, 1],
        picture.triangles[whole],
        1e6 * picture.magnitude,
        shading="gouraud",
        cmap=_MAP,
        vmin=0.0,
        vmax=top,
        rasterized=True,
    )
    rim = _rim(picture)
    kept = np.isin(rim, picture.triangles[whole]).all(axis=1)
    _draw_lines(axes, points[rim[kept]], 0.7)
    return colours


def _areas(points: Floats, triangles: NDArray[np.int64]) -> Floats:
    a, b, c = (points[triangles[:, i]] for i in range(3))
    return 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def _draw_lines(axes: Any, segments: Floats, width: float) -> None:
    axes.add_collection(
        LineCollection(
            list(segments),
            colors=_INK,
            linewidths=width,
            capstyle="round",
            rasterized=len(segments) > _VECTOR_LINES,
        )
    )


def _draw_zoom(
    axes: Any, pictures: tuple[SectionPicture, ...], spot: Floats, reach: float, top: float
) -> None:
    for picture in pictures:
        near = _near(picture, spot, 1.6 * reach)
        _draw_field(axes, near, near.displacement, top)
        points = 1e3 * (near.points + near.displacement)
        inside = np.all(np.abs(points[near.edges] - 1e3 * spot) < 1.6e3 * reach, axis=(1, 2))
        _draw_lines(axes, points[near.edges[inside]], 0.35)
        _name(axes, near, spot, reach)
    left = max(spot[0] - reach, -0.1 * reach)
    _frame(axes, (left, left + 2 * reach), (spot[1] - reach, spot[1] + reach))
    axes.set_title("contact zone, true scale")


def _near(picture: SectionPicture, spot: Floats, reach: float) -> SectionPicture:
    corners = picture.points[picture.triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    seen = np.all((low < spot + reach) & (high > spot - reach), axis=1)
    return replace(picture, triangles=picture.triangles[seen])


def _name(axes: Any, picture: SectionPicture, spot: Floats, reach: float) -> None:
    centres = picture.points[picture.triangles].mean(axis=1)
    window = np.array([max(spot[0] - reach, 0.0), spot[1] - reach])
    middle = window + reach
    inside = np.all((centres > window) & (centres < window + 2 * reach), axis=1)
    if not inside.any():
        return
    place = np.array([middle[0], centres[inside, 1].mean()])
    place[1] = spot[1] + np.sign(place[1] - spot[1]) * 0.86 * reach
    axes.text(
        *(1e3 * place),
        plain(picture.body),
        ha="center",
        va="center",
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5},
    )


# --------------------------------------------------------------------------- where the contact is


def _rim(picture: SectionPicture) -> NDArray[np.int64]:
    """Sides (s, 2) of triangles without a neighbour, except on the axis."""
    triangles = picture.triangles
    sides = np.sort(
        np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    )
    unique, number = np.unique(sides, axis=0, return_counts=True)
    rim = unique[number == 1]
    on_axis = picture.points[rim, 0] < 1e-6 * picture.points[:, 0].max()
    return rim[~on_axis.all(axis=1)]


def _contact_spot(pictures: tuple[SectionPicture, ...], half_width: float) -> Floats:
    """Closest place (r, z) [m] of the deformed bodies."""
    first = pictures[0]
    if len(pictures) < 2:
        low, high = _bounds(pictures)
        return np.array([0.5 * high[0], 0.5 * (low[1] + high[1])])
    second = pictures[1]
    nodes = np.unique(_rim(first))
    points = (first.points + first.displacement)[nodes]
    ends = (second.points + second.displacement)[_rim(second)]
    distance = _distance_to_segments(points, ends[:, 0], ends[:, 1])
    closest = points[np.argmin(distance)]
    scale = half_width if half_width > 0 and isfinite(half_width) else 0.0
    same = (distance < distance.min() + 0.02 * scale) & (
        np.linalg.norm(points - closest, axis=1) <= 4 * scale
    )
    return np.asarray(points[same].mean(axis=0) if same.any() else closest)


def _distance_to_segments(points: Floats, start: Floats, end: Floats) -> Floats:
    along = end - start
    square = np.maximum(np.einsum("sk,sk->s", along, along), 1e-300)
    nearest = np.full(len(points), np.inf)
    for i, point in enumerate(points):
        t = np.clip(np.einsum("sk,sk->s", point - start, along) / square, 0.0, 1.0)
        nearest[i] = np.sqrt(((start + t[:, None] * along - point) ** 2).sum(axis=1).min())
    return nearest


def _reach(study: ImpactStudy, size: float) -> float:
    half_width = study.contact.half_width
    usable = half_width > 0 and isfinite(half_width)
    return min(6 * half_width, 0.2 * size) if usable else 0.05 * size
