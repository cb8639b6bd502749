"""Both bodies of an impact in space, cut open by a quarter: what is held and where they touch.

In parallel projection, as meshed and placed at the start.  The cut goes through the axis of the
contact: the middle of the ring of first touch, or of a contact face that touches all at once.
"""

from dataclasses import dataclass
from math import floor, isfinite, log10
from typing import Any

import numpy as np
import scipy
from matplotlib import rc_context
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from numpy.typing import NDArray
from scipy.sparse import coo_array

from klack.analyses.impact.record import BodyPicture, ImpactStudy
from klack.assembling.touch_ring import goes_round
from klack.mesh.skin import Skin
from klack.report.depth_image import Camera, Quarter, Seen, Window, outlines, seen_of
from klack.report.page import Picture
from klack.report.printed import STYLE, plain, svg

__all__ = ["solid_figure"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_CAMERA = Camera(np.radians(-58.0), np.radians(24.0))
_CUT = np.array([[1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_TINTS = ("#8fb0d0", "#d8c096")
_CUT_TINTS = ("#dfe8f2", "#f5eddb")
_TOUCH = "#c8321f"
_RING = "#b0007a"
_HELD = "#2e6b3a"
_INK = "#22262b"
_DASHES = (0, (3.0, 1.5))
_TOUCHING = "contact faces"
_LONGEST = 32
"""Characters of a name; of both names for a legend in one row."""
_WIDTH = 720
_BELOW = 0.1
"""Room below the bodies, of their height, for the scale and the axes."""
_TALLEST = 1.5
_LAMP = np.array([-0.45, 0.65, -0.61])
"""Direction of the light: right, up, away from the viewer."""
_STEEPEST = 0.05
"""Share of a normal towards the viewer below which a surface is seen from its edge."""
_LEVELS = 40
"""Shades of a colour; fewer shades, smaller pictures."""
_STRIPES = 14
"""Pixels between stripes of a held surface."""


def solid_figure(study: ImpactStudy) -> Picture:
    """Draw ``study.pictures``: the whole, and the contact enlarged."""
    pictures = study.pictures
    touching = _contact_triangles(study)
    touch = pictures[1].touch
    corner = touch.mean(axis=0) if len(touch) else _middle(pictures[1].skin, touching[1])
    quarter = Quarter(corner, _CUT)
    scene = [_painted(*item) for item in zip(pictures, touching, strict=True)]
    whole = _window_round(np.concatenate([picture.skin.points for picture in pictures]))
    near = _window_at(corner, _reach(study, touching), whole)
    with rc_context(STYLE | {"axes.grid": False, "hatch.color": _HELD}):
        tall = 3.25 * whole.rows / whole.columns
        figure = Figure(figsize=(6.7, tall + 0.85), layout="constrained")
        for axes, window, title in zip(
            figure.subplots(1, 2), (whole, near), ("cut open", "contact"), strict=True
        ):
            _draw(axes, scene, window, quarter)
            _draw_touch(axes, touch, window)
            _draw_scale(axes, window)
            axes.set_title(title)
        _draw_axes(figure.axes[0], whole)
        _draw_frame(figure.axes[0], near, whole)
        _legend(figure, study, any(own.any() for own in touching))
        return Picture(svg(figure), _note(study, touching))


# --------------------------------------------------------------------------- what is drawn


@dataclass(frozen=True, slots=True, eq=False)
class _Painted:
    """A body; ``part`` numbers the smooth surface of each triangle."""

    skin: Skin
    part: Ints
    touching: NDArray[np.bool_]
    held: NDArray[np.bool_]


def _painted(picture: BodyPicture, touching: NDArray[np.bool_]) -> _Painted:
    skin = picture.skin
    triangles = skin.triangles
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]]])
    joined = coo_array(
        (np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(skin.points),) * 2
    )
    part = scipy.sparse.csgraph.connected_components(joined, directed=False)[1][
        triangles[:, 0]
    ].astype(np.int64)
    held = np.asarray(picture.held[triangles].all(axis=1))
    return _Painted(skin, 4 * part + 2 * touching + held, touching, held)


def _contact_triangles(study: ImpactStudy) -> list[NDArray[np.bool_]]:
    found = []
    moving, _, stop = study.contact.surfaces.partition(" on ")
    for picture, side in zip(study.pictures, (moving, stop), strict=True):
        skin = picture.skin
        name = side.removeprefix(f"{picture.body}.")
        place = skin.faces.index(name) if name in skin.faces else -2
        found.append(skin.face[skin.triangles[:, 0]] == place)
    return found


def _middle(skin: Skin, touching: NDArray[np.bool_]) -> Floats:
    triangles = skin.triangles[touching] if touching.any() else skin.triangles
    corners = skin.points[triangles]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    return np.asarray(area @ corners.mean(axis=1) / area.sum())


def _reach(study: ImpactStudy, touching: list[NDArray[np.bool_]]) -> float:
    touch, half_width = study.pictures[1].touch, study.contact.half_width
    if goes_round(touch):
        return 2.2 * float(_radii(touch).max())
    skins = [picture.skin for picture in study.pictures]
    spans = [
        float(np.ptp(skin.points[skin.triangles[own]].reshape(-1, 3), axis=0).max())
        for skin, own in zip(skins, touching, strict=True)
        if own.any()
    ]
    most = 0.7 * min(spans or [float(np.ptp(skin.points, axis=0).max()) for skin in skins])
    if len(touch) and isfinite(half_width) and half_width > 0:
        return min(max(6.0 * half_width, 2.2 * float(_radii(touch).max())), most)
    return most


def _radii(touch: Floats) -> Floats:
    return np.asarray(np.linalg.norm(touch - touch.mean(axis=0), axis=1))


# --------------------------------------------------------------------------- windows


def _window_round(points: Floats) -> Window:
    own = points @ _CAMERA.axes[:2].T
    low, high = own.min(axis=0), own.max(axis=0)
    low[1] -= _BELOW * (high[1] - low[1])
    width, height = 1.1 * (high - low)
    shape = float(np.clip(height / width, 0.7, _TALLEST))
    width = max(width, height / shape)
    columns, rows = _WIDTH, round(_WIDTH * shape)
    pixel = width / columns
    left, bottom = 0.5 * (low + high) - 0.5 * pixel * np.array([columns, rows])
    return Window(float(left), float(bottom), float(pixel), columns, rows)


def _window_at(corner: Floats, reach: float, whole: Window) -> Window:
    pixel = min(2.0 * reach / whole.columns, whole.pixel)
    middle = corner @ _CAMERA.axes[:2].T
    left, bottom = middle - 0.5 * pixel * np.array([whole.columns, whole.rows])
    return Window(float(left), float(bottom), pixel, whole.columns, whole.rows)


# --------------------------------------------------------------------------- drawing


def _draw(axes: Any, scene: list[_Painted], window: Window, quarter: Quarter) -> None:
    seen = seen_of(
        [(one.skin.points, one.skin.triangles) for one in scene], _CAMERA, window, quarter
    )
    axes.imshow(
        _coloured(scene, seen, window),
        origin="lower",
        extent=(0, window.columns, 0, window.rows),
        interpolation="none",
    )
    for one in scene:
        lines = list(_flat(_trace(one, quarter), window))
        axes.add_collection(LineCollection(lines, colors=_TOUCH, linewidths=1.8, capstyle="round"))
    axes.set_xlim(0, window.columns)
    axes.set_ylim(0, window.rows)
    axes.set_xticks([])
    axes.set_yticks([])
    for side in axes.spines.values():
        side.set(color="#c8cdd3", linewidth=0.6)


def _coloured(scene: list[_Painted], seen: Seen, window: Window) -> NDArray[np.uint8]:
    shape = seen.body.shape
    image = np.ones((*shape, 3))
    surface = np.where(seen.body < 0, -1, 0)
    slope = np.zeros(shape)
    rows, columns = np.indices(shape)
    stripe = np.asarray((rows + columns) % _STRIPES < 0.4 * _STRIPES)
    for place, one in enumerate(scene):
        tint = place % len(_TINTS)
        cut = (seen.body == place) & (seen.triangle < 0)
        image[cut] = _rgb(_CUT_TINTS[tint])
        surface[cut] = 4 * (place + 1) + seen.cut[cut]
        at = np.nonzero((seen.body == place) & (seen.triangle >= 0))
        triangle = seen.triangle[at]
        light, lean = _light(one.skin)
        colour = np.tile(_rgb(_TINTS[tint]), (len(triangle), 1))
        colour[one.touching[triangle]] = _rgb(_TOUCH)
        colour[one.held[triangle] & stripe[at]] = _rgb(_HELD)
        image[at] = colour * light[triangle][:, None]
        surface[at] = 4 * (len(scene) + 1) + len(scene) * one.part[triangle] + place
        slope[at] = lean[triangle]
    lines = outlines(surface, seen.depth / window.pixel, slope)
    image[lines] = _rgb(_INK)
    return np.round(image * 255).astype(np.uint8)


def _light(skin: Skin) -> tuple[Floats, Floats]:
    """Brightness by the mean normal, and depth per pixel, of each triangle."""
    normal = skin.normals[skin.triangles].sum(axis=1) @ _CAMERA.axes.T
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    bright = np.clip(normal @ (_LAMP / np.linalg.norm(_LAMP)), 0.0, 1.0)
    light = np.round((0.5 + 0.5 * bright) * _LEVELS) / _LEVELS
    toward = np.clip(-normal[:, 2], 0.0, 1.0)
    return light, np.sqrt(1.0 - toward**2) / np.maximum(toward, _STEEPEST)


def _rgb(colour: str) -> Floats:
    return np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0


def _trace(one: _Painted, quarter: Quarter) -> Floats:
    """Contact face on the two cut faces, (s, 2, 3) [m]."""
    corners = one.skin.points[one.skin.triangles[one.touching]]
    found = [np.empty((0, 2, 3))]
    for normal, other in (quarter.normals, quarter.normals[::-1]):
        height = (corners - quarter.corner) @ normal
        above = height > 0
        crossing = above.any(axis=1) & ~above.all(axis=1)
        for triangle, h in zip(corners[crossing], height[crossing], strict=True):
            ends = [
                triangle[i] + h[i] / (h[i] - h[j]) * (triangle[j] - triangle[i])
                for i, j in ((0, 1), (1, 2), (2, 0))
                if (h[i] > 0) != (h[j] > 0)
            ]
            middle = 0.5 * (ends[0] + ends[1])
            if (middle - quarter.corner) @ other > 0:
                found.append(np.array([ends]))
    return np.concatenate(found)


def _flat(points: Floats, window: Window) -> Floats:
    flat = points @ _CAMERA.axes[:2].T
    return np.asarray((flat - [window.left, window.bottom]) / window.pixel)


def _draw_touch(axes: Any, touch: Floats, window: Window) -> None:
    if not len(touch):
        return
    around = touch - touch.mean(axis=0)
    ordered = touch[np.argsort(np.arctan2(around[:, 1], around[:, 0]))]
    u, v = _flat(np.concatenate([ordered, ordered[:1]]), window).T
    axes.plot(u, v, **_touch_look(touch))


def _touch_look(touch: Floats) -> dict[str, Any]:
    if goes_round(touch):
        return {"color": _RING, "linewidth": 0.9, "linestyle": _DASHES}
    return {"color": _RING, "linestyle": "", "marker": "o", "markersize": 1.8}


def _draw_scale(axes: Any, window: Window) -> None:
    length = _round_length(0.3 * window.pixel * window.columns)
    end, height = 0.95 * window.columns, 0.04 * window.rows
    start = end - length / window.pixel
    axes.plot([start, end], [height] * 2, color=_INK, linewidth=2.0, solid_capstyle="butt")
    words = f"{1e3 * length:g} mm" if length >= 1e-4 else f"{1e6 * length:g} µm"
    axes.text(0.5 * (start + end), height + 0.015 * window.rows, words, ha="center")


def _round_length(most: float) -> float:
    power = 10.0 ** floor(log10(most))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most * (1 + 1e-12))


def _draw_axes(axes: Any, window: Window) -> None:
    foot = np.array([0.07, 0.045 * window.columns / window.rows]) * [window.columns, window.rows]
    size = 0.085 * window.columns
    for name, own in zip("xyz", _CAMERA.axes[:2].T, strict=True):
        axes.annotate(
            "",
            xy=tuple(foot + size * own),
            xytext=tuple(foot),
            arrowprops={"arrowstyle": "-|>", "color": _INK, "linewidth": 0.8, "shrinkA": 0},
        )
        axes.text(*(foot + 1.3 * size * own), name, ha="center", va="center")


def _draw_frame(axes: Any, near: Window, whole: Window) -> None:
    corner = np.array([near.left - whole.left, near.bottom - whole.bottom]) / whole.pixel
    size = near.pixel / whole.pixel * np.array([near.columns, near.rows])
    axes.add_patch(Rectangle(tuple(corner), *size, fill=False, edgecolor=_INK, linewidth=0.8))


def _legend(figure: Any, study: ImpactStudy, touching: bool) -> None:
    names = [_shortened(picture.body) for picture in study.pictures]
    handles: list[Any] = [
        Patch(facecolor=tint, edgecolor=_INK, linewidth=0.5, label=plain(name))
        for tint, name in zip(_TINTS, names, strict=True)
    ]
    if touching:
        handles.append(Patch(facecolor=_TOUCH, edgecolor=_INK, linewidth=0.5, label=_TOUCHING))
    touch = study.pictures[1].touch
    if len(touch):
        handles.append(Line2D([], [], label="first touch", **_touch_look(touch)))
    held = [tint for tint, one in zip(_TINTS, study.pictures, strict=True) if one.held.any()]
    if held:
        striped = Patch(facecolor=held[0], edgecolor=_HELD, hatch="////", label="held")
        striped.set_linewidth(0.5)
        handles.append(striped)
    columns = 5 if sum(map(len, names)) <= _LONGEST else 3
    figure.legend(handles=handles, loc="outside lower center", ncols=columns)


def _shortened(name: str) -> str:
    line = " ".join(name.split())
    return line if len(line) <= _LONGEST else f"{line[: _LONGEST - 1]}…"


def _note(study: ImpactStudy, touching: list[NDArray[np.bool_]]) -> str:
    note = (
        "The surfaces of the meshes at the start, with a quarter cut away; cut faces are pale. "
        "Right: the framed part. Parallel projection: the scale bars apply perpendicular to the "
        "line of sight."
    )
    touch = study.pictures[1].touch
    if len(touch):
        what = "ring" if goes_round(touch) else "points"
        note += f" The {what} of first touch of the centred bodies is visible through them."
    if any(picture.held.any() for picture in study.pictures):
        note += " Surfaces held in all directions are striped."
    for picture, own in zip(study.pictures, touching, strict=True):
        if not own.any():
            note += f" The contact face of the {picture.body} is not known and not coloured."
    return note
