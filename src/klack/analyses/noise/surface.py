"""Surfaces of the bodies in the air, coloured by how fast they move in one band.

A body of revolution is shown as its half section: the lines are the radiating surfaces.  A
solid is shown in parallel projection, seen from the front and above; faces that look away are left
out.  One row per design, all colours to one scale.
"""

from collections.abc import Sequence
from math import ceil, floor
from typing import Any

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from numpy.typing import NDArray

from klack.acoustics.radiation import PLATE
from klack.acoustics.third_octave import ThirdOctaves, nominal_label
from klack.analyses.noise.record import BodyNoise, NoiseDesign, NoiseStudy, Surface
from klack.report.page import Picture
from klack.report.printed import STYLE, plain, svg
from klack.report.wording import listed

__all__ = ["shown_bands", "surface_figure"]

Floats = NDArray[np.float64]

_REFERENCE = 1e-6  # [m/s]
_RANGE = 50.0  # [dB] of the colours at most
_MAP = "viridis"
_HEARING = 20e3  # [Hz]
_TURN, _LIFT = np.radians(35.0), np.radians(25.0)  # of the view, about z and above the ground
_VECTOR_FACES = 3000
_MOST = 4  # pictures side by side


def shown_bands(study: NoiseStudy) -> tuple[int, ...]:
    """Bands of the strongest radiation: audible ones, and all."""
    designs = [design for design in study.designs if design.bodies]
    if not designs:
        return ()
    energy = np.zeros(designs[0].band_middle.size)
    for body in designs[0].bodies:
        own = [i for i, name in enumerate(body.groups) if name != PLATE]
        energy += body.radiated[own].sum(axis=0)
    audible = np.where(designs[0].band_middle <= _HEARING, energy, 0.0)
    return tuple(dict.fromkeys((int(np.argmax(audible)), int(np.argmax(energy)))))


def surface_figure(study: NoiseStudy) -> Picture | None:
    """Draw all bodies of every design in the loudest bands."""
    designs = [design for design in study.designs if design.bodies]
    if not designs:
        return None
    bands = shown_bands(study)
    shown = [(design, band) for design in designs for band in bands]
    octaves = designs[0].stops[0].bands
    scale = _scale(designs, bands)
    columns = min(len(shown), _MOST)
    rows = ceil(len(shown) / columns)
    with rc_context(STYLE | {"axes.grid": False}):
        shape = min(_width_over_height(body.surface) for d in designs for body in d.bodies)
        tall = float(np.clip(6.0 / columns / max(shape, 0.2), 1.8, 4.2))
        # room for the titles of pictures without axes
        layout = ConstrainedLayoutEngine(h_pad=0.1)
        figure = Figure(figsize=(6.7, tall * rows + 0.9), layout=layout)
        grid = figure.subplots(rows, columns, squeeze=False)
        for axes in grid.ravel()[len(shown) :]:
            axes.set_axis_off()
        for (design, band), axes in zip(shown, grid.ravel(), strict=False):
            whose = f"{design.name}\n" if len(study.designs) > 1 else ""
            _draw(axes, design.bodies, band, scale)
            axes.set_title(plain(f"{whose}{nominal_label(int(octaves.number[band]))}"))
        _bar(figure, grid, scale)
        return Picture(svg(figure), _note(designs, octaves, bands))


def _level(velocity: NDArray[np.float32]) -> Floats:
    return np.asarray(20.0 * np.log10(np.maximum(velocity.astype(float), 1e-30) / _REFERENCE))


def _scale(designs: list[NoiseDesign], bands: tuple[int, ...]) -> Normalize:
    values = np.concatenate(
        [_level(body.surface.velocity[list(bands)]).ravel() for d in designs for body in d.bodies]
    )
    top = 5.0 * ceil(float(values.max()) / 5.0)
    low = max(5.0 * floor(float(values.min()) / 5.0), top - _RANGE)
    return Normalize(min(low, top - 5.0), top)


# --------------------------------------------------------------------------- drawing


def _draw(axes: Any, bodies: Sequence[BodyNoise], band: int, scale: Normalize) -> None:
    axes.set_aspect("equal")
    solid = [body for body in bodies if body.surface.points.shape[1] == 3]
    flat = [body for body in bodies if body.surface.points.shape[1] == 2]
    if solid:
        _draw_solids(axes, solid, band, scale)
    else:
        _draw_sections(axes, flat, band, scale)


def _draw_sections(axes: Any, bodies: Sequence[BodyNoise], band: int, scale: Normalize) -> None:
    lines = np.concatenate([1e3 * b.surface.points[b.surface.faces] for b in bodies])
    level = np.concatenate([_level(body.surface.velocity[band]) for body in bodies])
    both = np.concatenate([lines, lines * np.array([-1.0, 1.0])])
    collection = LineCollection(list(both), linewidths=3.5, capstyle="round", cmap=_MAP, norm=scale)
    collection.set_array(np.concatenate([level, level]))
    axes.add_collection(collection)
    axes.axvline(0.0, color="#22262b", linewidth=0.5, dashes=(8, 2, 2, 2))
    size = float(np.abs(both).max(axis=(0, 1))[0])
    low, high = float(both[..., 1].min()), float(both[..., 1].max())
    margin = 0.08 * max(size, high - low)
    axes.set_xlim(-size - margin, size + margin)
    axes.set_ylim(low - margin, high + margin)
    axes.set_xlabel("distance from the axis [mm]")
    axes.set_ylabel("height [mm]")


def _draw_solids(axes: Any, bodies: Sequence[BodyNoise], band: int, scale: Normalize) -> None:
    right, up, towards = _best_view(bodies, band)
    flat, depth, level, facing = [], [], [], []
    for body in bodies:
        corners = 1e3 * body.surface.points[body.surface.faces]
        turned = _normals(corners) @ towards
        seen = turned > 0.0
        kept = corners[seen]
        if kept.shape[1] == 3:
            kept = np.concatenate([kept, kept[:, 2:]], axis=1)
        flat.append(np.stack([kept @ right, kept @ up], axis=-1))
        depth.append((kept @ towards).mean(axis=1))
        level.append(_level(body.surface.velocity[band])[seen])
        facing.append(turned[seen])
    order = np.argsort(np.concatenate(depth))
    shapes = np.concatenate(flat)[order]
    colours = colormaps[_MAP](scale(np.concatenate(level)[order]))
    colours[:, :3] *= 0.72 + 0.28 * np.concatenate(facing)[order, None]
    axes.add_collection(
        PolyCollection(
            list(shapes),
            facecolors=colours,
            edgecolors=colours,
            linewidths=0.2,
            rasterized=len(order) > _VECTOR_FACES,
        )
    )
    low, high = shapes.min(axis=(0, 1)), shapes.max(axis=(0, 1))
    margin = 0.05 * float((high - low).max())
    axes.set_xlim(low[0] - margin, high[0] + margin)
    axes.set_ylim(low[1] - margin, high[1] + margin)
    axes.set_axis_off()


def _normals(corners: Floats) -> Floats:
    """Outward normals (f, 3); a quadrangle that repeats a corner is a triangle."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.asarray(normals / np.maximum(size, 1e-300))


def _best_view(bodies: Sequence[BodyNoise], band: int) -> tuple[Floats, Floats, Floats]:
    """From above or below, whichever shows more motion."""
    views = [_axes_of_view(lift) for lift in (_LIFT, -_LIFT)]
    seen = np.zeros(2)
    for body in bodies:
        corners = body.surface.points[body.surface.faces]
        normals = _normals(corners)
        size = np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        moved = size * body.surface.velocity[band].astype(float) ** 2
        seen += [float(moved @ np.maximum(normals @ view[2], 0.0)) for view in views]
    return views[int(np.argmax(seen))]


def _axes_of_view(lift: float) -> tuple[Floats, Floats, Floats]:
    """Right, up, and towards the eye, in coordinates of the body."""
    towards = np.array([np.cos(lift) * np.sin(_TURN), -np.cos(lift) * np.cos(_TURN), np.sin(lift)])
    right = np.array([np.cos(_TURN), np.sin(_TURN), 0.0])
    return right, np.cross(towards, right), towards


def _width_over_height(surface: Surface) -> float:
    if surface.points.shape[1] == 2:
        used = surface.points[np.unique(surface.faces)]
        width, height = 2.0 * float(used[:, 0].max()), float(np.ptp(used[:, 1]))
    else:
        right, up, _ = _axes_of_view(_LIFT)
        width, height = (float(np.ptp(surface.points @ axis)) for axis in (right, up))
    return float(np.clip(width / max(height, 1e-9), 0.5, 3.0))


def _bar(figure: Figure, grid: Any, scale: Normalize) -> None:
    bar = figure.colorbar(
        ScalarMappable(norm=scale, cmap=_MAP),
        ax=list(grid.ravel()),
        location="bottom",
        shrink=0.6,
        aspect=40,
    )
    bar.set_label("normal velocity [dB re 1 µm/s]")


def _note(designs: list[NoiseDesign], octaves: ThirdOctaves, bands: tuple[int, ...]) -> str:
    names = listed([nominal_label(int(octaves.number[band])) for band in bands])
    which = (
        "the band in which the bodies radiate most"
        if len(bands) == 1
        else "the audible band in which the bodies radiate most, and the one of all bands"
    )
    solid = any(body.surface.points.shape[1] == 3 for design in designs for body in design.bodies)
    seen = (
        "Solids are shown from above or below, whichever shows more of the motion."
        if solid
        else "Half sections, mirrored; the lines are the radiating surfaces."
    )
    return (
        f"Normal velocity of the surfaces in the third octaves {names}: {which}, of the first "
        f"design. Root mean square over one period of the drive pattern. {seen}"
    )
