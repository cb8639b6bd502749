"""From the film of an end stop to its land in three dimensions."""

from math import sin

import numpy as np

from klack.contact.mortar import ContactSpace
from klack.contact.rings import RingSpace
from klack.hydraulics.film import ConeFilm, DiscFilm, FilmShape, RingFilm
from klack.hydraulics.tilted_film import SectorFilm, sector_film
from klack.transient.tilting_film import TiltingFilm

__all__ = ["tilting_film"]

_WIDE = 0.1  # width over mean radius, above which heights differ across the land
_TOUCHING = 0.05  # share of the reach: points that touch first


def tilting_film(
    stop: str, film: FilmShape, space: ContactSpace | RingSpace, reach: float
) -> TiltingFilm:
    """Land of a film, and the lift and tilts of it in the gaps of contact points.

    A conical land is unrolled: a flat ring of its mean radius and its width, whose height is normal
    to the cone.

    Parameters
    ----------
    stop : str
    film : FilmShape
    space : ContactSpace or RingSpace
        Contact points of the stop, centred, all round.
    reach : float [m]
        Their largest gap in touch.
    """
    slope, land, cubic = 1.0, None, 1.0
    if isinstance(film, RingFilm):
        land = _ring(film.inner_radius, film.outer_radius, film.sectors)
        cubic = film.coefficients()[0]
    elif isinstance(film, DiscFilm):
        land = sector_film(0.0, film.radius, sectors=film.sectors, circles=2)
        cubic = film.coefficients()[0]
    elif isinstance(film, ConeFilm):
        half = 0.5 * min(film.width, 1.9 * film.mean_radius)
        inner, outer = film.mean_radius - half, film.mean_radius + half
        land, slope = _ring(inner, outer, film.sectors), sin(film.half_angle)
        flat = RingFilm(shape="ring", inner_radius=inner, outer_radius=outer)
        cubic = flat.coefficients()[0]
    lift = space.gap / np.maximum(space.axial * np.sign(np.sum(space.axial)), 1e-6)
    near = lift <= lift.min() + _TOUCHING * reach
    weight = np.where(near, space.area, 0.0)
    shapes = np.column_stack([np.ones(len(space.gap)), space.points[:, :2]])
    fit = np.linalg.solve((shapes.T * weight) @ shapes, shapes.T * weight)
    touching = space.gap - lift.min() * np.abs(space.axial)
    return TiltingFilm(stop=stop, land=land, cubic=cubic, slope=slope, fit=fit, base=fit @ touching)


def _ring(inner: float, outer: float, sectors: int) -> SectorFilm:
    wide = outer - inner > _WIDE * 0.5 * (inner + outer)
    return sector_film(inner, outer, sectors=sectors, circles=2 if wide else 1)
