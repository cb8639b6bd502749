"""Record of each impact while bodies move point by point: forces round the ring, film, motion.

The rows lie in :class:`klack.transient.impact_rows.ImpactRows`; here impacts that are over are
taken out of them.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.arrays import Vector
from klack.hydraulics.tilted_film import SectorFilm
from klack.simulation.spatial_impact import FilmLand, FilmMoments, ModalMoments, SpatialImpact
from klack.transient.impact_rows import (
    APART,
    FILM_ROWS,
    LOAD_ROWS,
    MODE_ROWS,
    MOST,
    MOST_MOTIONS,
    NUMBER,
    PHASE,
    PRESSED,
    RESTING,
    STOP,
    ImpactRows,
    follow,
)
from klack.transient.interface_arrays import Films, Record
from klack.transient.interface_model import InterfaceModel
from klack.transient.ring_sectors import SECTORS, sector_shares
from klack.transient.tilting_film import TiltingFilm

__all__ = ["ImpactRecorder", "film_lands"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Stop:
    """What stays the same of one stop."""

    name: str
    points: slice
    shares: csr_array  # (S, n) axial force of a sector per force of a point
    levers: Vector  # (n, 3) axial force times radius, its square, and height per force of a point
    film: int  # its place among the films, -1 without
    land: FilmLand | None
    felt: float
    pause: float
    rest: float


class ImpactRecorder:
    """Records impacts on all stops of one run.

    Parameters
    ----------
    model : InterfaceModel
    stops : sequence of str
        Of ``model.contacts``.
    films : sequence of (str, FilmLand or None)
        Stop and land of each film, in the order of the record of steps.
    shape_marks : array, shape (M,)
        By which the shapes of the modes are known again.
    felt, pause, rest : array, shape (stops,) [N], [s], [s]
        Force from which on a film is felt; contacts that are closer together are one impact; a
        contact that lasts so long ends the impact.
    """

    def __init__(
        self,
        model: InterfaceModel,
        stops: Sequence[str],
        films: Sequence[tuple[str, FilmLand | None]],
        shape_marks: Vector,
        felt: Vector,
        pause: Vector,
        rest: Vector,
    ) -> None:
        self.model, self._marks = model, shape_marks
        names = [name for name, _ in films]
        self._stops = []
        for c, name in enumerate(stops):
            _, first, last = model.contacts[c]
            at = slice(first, last)
            axial = np.abs(model.axial[at])
            radius = np.linalg.norm(model.points[at, :2], axis=1)
            film = names.index(name) if name in names else -1
            self._stops.append(
                _Stop(
                    name=name,
                    points=at,
                    shares=csr_array(sector_shares(model.points[at], model.area[at]) * axial),
                    levers=axial[:, None]
                    * np.column_stack([radius, radius**2, model.points[at, 2]]),
                    film=film,
                    land=films[film][1] if film >= 0 else None,
                    felt=float(felt[c]),
                    pause=float(pause[c]),
                    rest=float(rest[c]),
                )
            )
        self.rows = ImpactRows.empty(len(stops), SECTORS, model.mode_count, len(films))
        self._over: list[tuple[float, SpatialImpact]] = []

    def changing(self) -> dict[str, NDArray[np.generic]]:
        """All arrays that a step changes and the next one begins with."""
        return {f"impact_{name}": array for name, array in self.rows._asdict().items()}

    def resume(self) -> None:
        """Begin the record of a continued run: with the impacts that are not over."""
        words = self.rows.words
        going = words[:, PHASE] == PRESSED
        words[going, NUMBER] = np.argsort(np.argsort(words[going, NUMBER])) + 1
        self.rows.total[0] = np.count_nonzero(going)

    def tell(self, t: float, h: float, record: Record, before: Vector) -> None:
        """Take in the steps of a record that begins at ``t`` [s]; ``before``: modes at its start.

        What was recorded of later moments is forgotten, since they are computed again.
        """
        while self._over and self._over[-1][0] > t + h * (len(record.force) - 0.5):
            self._over.pop()
        for c in range(len(self._stops)):
            self._tell(c, t, h, record, before)

    def _tell(self, c: int, t: float, h: float, record: Record, before: Vector) -> None:
        stop, rows, steps = self._stops[c], self.rows, len(record.force)
        words = rows.words[c]
        force, levers = np.zeros((steps, SECTORS)), np.zeros((steps, 3))
        if len(record.points):
            points = record.points[:, stop.points].astype(float)
            if np.any(points):
                force, levers = (
                    np.ascontiguousarray((stop.shares @ points.T).T),
                    points @ stop.levers,
                )
        film, lands = np.zeros(0), np.zeros((steps, 6))
        if stop.land is not None:
            film = np.ascontiguousarray(record.film[:, stop.film])
            lands = np.ascontiguousarray(record.lands[:, stop.film])
        if words[PHASE] not in (PRESSED, RESTING):
            self._stand(c, t, before)
        first = 0
        while True:
            first = follow(
                *(rows, c, first, t, h, force, levers, film, lands, stop.felt),
                *(record.places, stop.pause, stop.rest),
            )
            if first < 0:
                return
            self._take(c, t + first * h)
            if words[PHASE] == PRESSED:
                words[PHASE] = APART
                self._stand(c, t + first * h, record.places[first - 1] if first else before)

    def _stand(self, c: int, time: float, place: Vector) -> None:
        rows = self.rows
        rows.moments[c, 0], rows.places[c, 0], rows.words[c, MODE_ROWS] = time, place, 1

    def _take(self, c: int, time: float) -> None:
        if self.rows.words[c, NUMBER] <= MOST:
            self._over.append((time, self._impact(c)))

    def impacts(self, end: float) -> tuple[SpatialImpact, ...]:
        """All impacts up to a moment [s], in order of first touch; also those that are not over."""
        found = [impact for time, impact in self._over if time <= end * (1.0 + 1e-12)]
        words = self.rows.words
        for c in np.flatnonzero((words[:, PHASE] == PRESSED) & (words[:, NUMBER] <= MOST)):
            found.append(self._impact(int(c)))
        return tuple(sorted(found, key=lambda impact: impact.number))

    def _impact(self, c: int) -> SpatialImpact:
        stop, rows = self._stops[c], self.rows
        words, edges = rows.words[c], rows.edges[c]
        count = int(
            np.searchsorted(edges[: words[LOAD_ROWS] + 1], rows.times[c, STOP] * (1 - 1e-12))
        )
        count = min(max(count, 1), int(words[LOAD_ROWS]))
        edges = edges[: count + 1].copy()
        _, first, second, height = rows.sums[c] / rows.sums[c, 0]
        film, modes = None, None
        if stop.land is not None:
            samples = rows.film[c, : words[FILM_ROWS]].copy()
            film = FilmMoments(
                land=stop.land,
                time=samples[:, 0],
                step=samples[:, 1],
                film_force=samples[:, 2],
                before=samples[:, 3:6],
                after=samples[:, 6:],
            )
        if words[NUMBER] <= MOST_MOTIONS:
            owner = self.model.owner
            modes = ModalMoments(
                bodies=self.model.bodies,
                counts=tuple(
                    int(np.count_nonzero(owner == k)) for k in range(len(self.model.bodies))
                ),
                time=rows.moments[c, : words[MODE_ROWS]].copy(),
                coordinates=rows.places[c, : words[MODE_ROWS]].copy(),
                shape_marks=self._marks,
            )
        return SpatialImpact(
            number=int(words[NUMBER]),
            stop=stop.name,
            edges=edges,
            sector_force=rows.load[c, :count] / np.diff(edges)[:, None],
            radius=float(first),
            spread=float(np.sqrt(max(second - first**2, 0.0))),
            height=float(height),
            film=film,
            modes=modes,
        )


def film_lands(
    films: Films | None, squeezed: Sequence[TiltingFilm]
) -> list[tuple[str, FilmLand | None]]:
    """Stop and land of each film; None for a film that no tilt changes."""
    if films is None:
        return []
    return [(film.stop, _land(films, k, film.land)) for k, film in enumerate(squeezed)]


def _land(films: Films, k: int, land: SectorFilm | None) -> FilmLand | None:
    if land is None:
        return None
    return FilmLand(
        inner_radius=land.inner_radius,
        outer_radius=land.outer_radius,
        sectors=land.sectors,
        circles=land.circles,
        viscosity=float(films.viscosity[k]),
        tension=float(films.tension[k]),
        lowest=float(films.lowest[k]),
        slope=float(films.axial[k]),
        shear=float(films.shear[k]),
    )
