r"""Pressure in the sectors of a squeeze film, from its recorded lift and tilts.

A step from the lift and tilts :math:`u_0` to :math:`u_1` has the heights

.. math:: h = \max(g + r\,(t_x \cos\theta + t_y \sin\theta), 0) + h_r

at its ends, of which :func:`klack.hydraulics.tilted_film.solved_film` has the mean forces of the
sectors over the step.  Divided by the area of a sector they are its mean pressure above ambient.
With the drag along a cone,

.. math:: f_s = c_s \frac{\ln(h_0 / h_1)}{h_0 - h_1} \frac{h_0 - h_1}{\Delta t}, \qquad
    F = s \Bigl(\sum_k F_k + f_s\Bigr),

the forces of all sectors are the recorded axial force, to the tolerance with which it was found.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Floats
from klack.hydraulics.tilted_film import (
    SectorFilm,
    mean_mobility,
    sector_film,
    solved_film,
)
from klack.simulation.spatial_impact import FilmLand, FilmMoments

__all__ = ["SectorPressure", "sector_pressure"]


_HELD = 1e-6  # of the tension: a sector that is no closer to it does not cavitate


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SectorPressure:
    """Pressure of a film at some of its recorded moments.

    Parameters
    ----------
    time (k,) [s]
        Middle of each step.
    angles (S,) [rad]
        Middles of the sectors, from +x towards +y.
    pressure (k, S) [Pa]
        Mean over each sector, above ambient.
    cavitates (k, S)
        Where the tension is the largest that the film bears.
    height (k, S) [m]
        Mean height of the film in each sector at the end of the step.
    axial_force (k,) [N]
        Of all sectors and the drag along a cone; comparable with the recorded one.
    """

    time: Floats
    angles: Floats
    pressure: Floats
    cavitates: NDArray[np.bool_]
    height: Floats
    axial_force: Floats


def sector_pressure(film: FilmMoments, at: NDArray[np.int64] | None = None) -> SectorPressure:
    """Compute the pressure of a film in its sectors at some moments, all by default."""
    land = film.land
    cut = sector_film(
        land.inner_radius, land.outer_radius, sectors=land.sectors, circles=land.circles
    )
    spread, at = cut.rows(), np.arange(len(film.time)) if at is None else np.asarray(at)
    area = float(np.sum(cut.area))
    pressure = np.zeros((len(at), land.sectors))
    height, axial = np.zeros_like(pressure), np.zeros(len(at))
    for row, k in enumerate(at):
        open0, open1 = (
            (spread @ ends[k]).reshape(land.sectors, -1) for ends in (film.before, film.after)
        )
        force = np.zeros((land.sectors, land.circles))
        if max(np.max(open0), np.max(open1)) > 0.0:  # where faces are closed no film acts
            force = _forces(cut, land, open0, open1, float(film.step[k]))
        pressure[row] = force.sum(axis=1) / area
        height[row] = (np.maximum(open1, 0.0) + land.lowest).mean(axis=1)
        drag = _drag(land, float(film.before[k, 0]), float(film.after[k, 0]), float(film.step[k]))
        axial[row] = land.slope * (float(force.sum()) + drag)
    return SectorPressure(
        time=film.time[at] + 0.5 * film.step[at],
        angles=cut.angles,
        pressure=pressure,
        cavitates=pressure <= -land.tension * (1.0 - _HELD),
        height=height,
        axial_force=axial,
    )


def _forces(cut: SectorFilm, land: FilmLand, open0: Floats, open1: Floats, step: float) -> Floats:
    """Forces on the circles of the sectors; heights are cut off as in the run."""
    a, b = (np.maximum(gap @ cut.between.T, 0.0) + land.lowest for gap in (open0, open1))
    mobility = mean_mobility(a, b, land.viscosity)
    closing = (np.maximum(open0, 0.0) - np.maximum(open1, 0.0)) / step
    edges = np.zeros(cut.load.shape), np.zeros(land.circles)
    return solved_film(cut, mobility, closing, 0.0 * mobility, edges, land.tension, 0.0)[0]


def _drag(land: FilmLand, lift0: float, lift1: float, step: float) -> float:
    a, b = max(lift0, 0.0) + land.lowest, max(lift1, 0.0) + land.lowest
    mean = np.log(a / b) / (a - b) if abs(a - b) > 1e-6 * a else 2.0 / (a + b)
    return float(land.shear * mean * (a - b) / step)
