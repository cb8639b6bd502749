"""Squeeze films between faces that tilt: from their lands to arrays of the compiled step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import pi

import numpy as np

from klack.arrays import Floats
from klack.hydraulics.tilted_film import SectorFilm
from klack.network.rows import FilmRow
from klack.transient.interface_arrays import Films, Guide
from klack.transient.interface_model import InterfaceModel

__all__ = ["BearingFilm", "TiltingFilm", "film_arrays"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TiltingFilm:
    """Land of a film at the contact points of an end stop.

    Parameters
    ----------
    stop : str
        Name of the contact in the model.
    land : SectorFilm or None
        None for a film that no tilt changes: a sphere.
    cubic : float [m^4]
        Force of the land over viscosity and closing speed, times the height cubed.
    slope : float [-]
        Sine of the angle between the axis and the land: 1 for a flat one.
    fit : array, shape (3, n)
        Lift [-] and tilts [1/m] that fit gaps of the contact points best.
    base : array, shape (3,)
        The same of the gaps of the centred faces in touch.
    """

    stop: str
    land: SectorFilm | None
    cubic: float
    slope: float
    fit: Floats
    base: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class BearingFilm:
    """Film at each height of a guide, a short bearing.

    Parameters
    ----------
    length : float [m]
        Along the axis.
    cut_off : float [m]
        Height that the roughness leaves.
    """

    length: float
    cut_off: float

    def arrays(self, guide: Guide, viscosity: float) -> tuple[Floats, Floats]:
        """``mu L^3 R / c^2`` [N s] and clearance with the cut-off [m] at each height."""
        room = guide.clearance + self.cut_off
        return viscosity * self.length**3 * guide.radius / room**2, room


def film_arrays(
    model: InterfaceModel,
    films: Sequence[TiltingFilm],
    rows: Mapping[str, FilmRow],
    series: Mapping[str, float],
    bearing: Floats,
    room: Floats,
) -> Films:
    """Arrays of films for the compiled step, at the gaps of the model.

    Parameters
    ----------
    model : InterfaceModel
    films : sequence of TiltingFilm
    rows : mapping of str to FilmRow
        Of each of their stops, between parallel faces along the axis.
    series : mapping of str to float [m/N]
        Compliance along the axis of the bulk of the bodies at these stops.
    bearing, room : array, shape (g,) [N s], [m]
        Of the films at the heights of the guide; empty without.
    """
    at = {name: slice(first, last) for name, first, last in model.contacts}
    here = [(film, rows[film.stop]) for film in films]
    lands = [_laid_out(film.land) for film in films]
    starts = np.cumsum([0, *(len(land) for land in lands)])[:-1]
    slope = np.array([film.slope for film in films])
    M, n = model.mode_count, model.count

    def each(values: list[Floats], *shape: int) -> Floats:
        return np.array(values) if values else np.zeros((0, *shape))

    return Films(
        rows=each([film.fit @ model.traces[at[film.stop]] for film in films], 3, M),
        offset=each([film.fit @ model.gap[at[film.stop]] - film.base for film in films], 3),
        lowest=slope * [row.cut_off for _, row in here],
        reach=np.array([1e-3 if f.land is None else f.land.outer_radius for f in films]),
        viscosity=np.array([row.cubic * film.slope / film.cubic for film, row in here]),
        tension=np.array([row.suction / (film.slope * _area(film)) for film, row in here]),
        shear=np.array([row.linear for _, row in here]) / slope,
        axial=slope,
        arms=each([_arms(model, film) for film in films], n, 3),
        span=np.array([(at[f.stop].start, at[f.stop].stop) for f in films], int).reshape(-1, 2),
        compliance=each([_bulk(model, film, series[film.stop]) for film in films], 3, 3),
        bearing=bearing,
        room=room,
        sizes=np.array([_sizes(film.land) for film in films], dtype=np.int64).reshape(-1, 5),
        start=np.array(starts, dtype=np.int64),
        land=np.concatenate([np.zeros(0), *lands]),
    )


def _arms(model: InterfaceModel, film: TiltingFilm) -> Floats:
    """Lift and tilts at the contact points of the stop of a film, zero at others, shape (n, 3)."""
    arms = np.zeros((model.count, 3))
    for name, first, last in model.contacts:
        if name == film.stop:
            arms[first:last, 0], arms[first:last, 1:] = 1.0, model.points[first:last, :2]
    return arms


def _bulk(model: InterfaceModel, film: TiltingFilm, series: float) -> Floats:
    """Compliance of the bulk for a force and moments, as of an elastic bed under the touching ring.

    Along the axis it is ``series``; a bed of the same stiffness under a ring of radius r has the
    tilting compliance 2/r^2 times as large.
    """
    points = slice(*next(c[1:] for c in model.contacts if c[0] == film.stop))
    radius = np.linalg.norm(model.points[points, :2], axis=1)
    weight = film.fit[0]
    square = float(weight @ radius**2 / np.sum(weight))
    return film.slope**2 * series * np.diag([1.0, 2.0 / square, 2.0 / square])


def _area(film: TiltingFilm) -> float:
    """Of the land [m^2]; 1 without one."""
    if film.land is None:
        return 1.0
    return pi * (film.land.outer_radius**2 - film.land.inner_radius**2)


def _sizes(land: SectorFilm | None) -> list[int]:
    if land is None:
        return [0, 0, 0, 0, 0]
    points, functions = land.load.shape
    return [land.sectors, land.circles, points, functions, land.shared]


def _laid_out(land: SectorFilm | None) -> Floats:
    if land is None:
        return np.zeros(0)
    parts = (land.rows(), land.between, land.along, land.around, land.load, land.area)
    return np.concatenate([part.ravel() for part in parts])
