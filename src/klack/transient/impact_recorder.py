"""Record of each impact while bodies move point by point: forces round the ring, film, motion.

The compiled part writes rows (:class:`ImpactRows`) into memory of fixed size, which a run keeps,
puts back and stores with its other state.  Forces are summed over intervals, so that their sum
stays the impulse; where there is no more room, two intervals become one.  States of films and
bodies are samples; where there is no more room, every second one stays.  Impacts that are over are
taken out of the rows.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_diag, csr_array

from klack.arrays import Cube, Matrix, Vector
from klack.hydraulics.tilted_film import SectorFilm
from klack.machine.compiling.jit import inner, njit, of_one_kind
from klack.simulation.network_arrays import Recording, Scratch
from klack.simulation.network_compile import CompiledNetwork
from klack.simulation.spatial_impact import FilmLand, FilmMoments, ModalMoments, SpatialImpact
from klack.transient.interface_arrays import Films, Record
from klack.transient.interface_model import InterfaceModel
from klack.transient.ring_arcs import ArcWatch
from klack.transient.spatial_kernel import StopRows, StopState, tell_stops
from klack.transient.tilting_films import TiltingFilm

__all__ = [
    "FILM_ROWS",
    "LOAD_ROWS",
    "MODE_ROWS",
    "NUMBER",
    "PHASE",
    "PRESSED",
    "RESTING",
    "ImpactRecorder",
    "ImpactRows",
    "StopRecord",
    "film_lands",
    "follow",
    "sector_shares",
]


SECTORS = 36
_SAME_ANGLE = 1e-6  # [rad]


def sector_shares(points: Vector, area: Vector, sectors: int = SECTORS) -> csr_array:
    """Share of each sector in the force of each contact point, shape (S, n); columns sum to 1.

    Between two columns of the mesh (points at one angle) the circumference is divided in the ratio
    of their areas, so that a uniform pressure is a uniform line load, also where points at corners
    and in the middle of sides alternate.

    Parameters
    ----------
    points (n, 3) [m]
        About the axis x = y = 0.
    area (n,) [m^2]
    sectors
        Of equal angles, the first one from +x.
    """
    turn = 2.0 * np.pi
    angle = np.arctan2(points[:, 1], points[:, 0]) % turn
    order = np.argsort(angle, kind="stable")
    new = np.diff(angle[order], prepend=-np.inf) > _SAME_ANGLE
    column = np.empty(len(angle), dtype=np.int64)
    column[order] = np.cumsum(new) - 1
    at = angle[order][new]
    if len(at) > 1 and at[0] + turn - at[-1] <= _SAME_ANGLE:  # round-off about +x
        column[column == len(at) - 1] = 0
        at = at[:-1]
    weight = np.bincount(column, weights=area, minlength=len(at))
    gap = np.diff(at, append=at[0] + turn)
    after = np.roll(weight, -1)
    end = at + gap * weight / (weight + after)
    begin = np.roll(end, 1)
    begin[0] -= turn
    share = np.zeros((sectors, len(at)))
    edges = turn / sectors * np.arange(sectors + 1)
    for shift in (-turn, 0.0, turn):
        low = np.maximum(begin + shift, edges[:-1, None])
        high = np.minimum(end + shift, edges[1:, None])
        share += np.maximum(high - low, 0.0)
    share /= share.sum(axis=0)
    return csr_array(share[:, column])


RESTING, APART, SQUEEZED, PRESSED = 0, 1, 2, 3
"""Phase of a stop: carries for long, nothing, its film is felt, an impact is recorded."""

PHASE, NUMBER = 0, 1
LOAD_ROWS, LOAD_STRIDE, LOAD_FILL = 2, 3, 4
FILM_ROWS, FILM_STRIDE, FILM_SKIP = 5, 6, 7
MODE_ROWS, MODE_STRIDE, MODE_SKIP = 8, 9, 10
_WORDS = 11
BEGIN, STOP, FELT = 0, 1, 2  # of the contact that is closed, of the last one, of the film [s]
_TIMES = 3

MOST, MOST_MOTIONS = 32, 8
"""Impacts of a run that are recorded, and those with the motion of the bodies."""
_LOADS, _FILMS, _MOMENTS = 400, 400, 200
_SUMS = 4  # of the force over time, and of it times radius, its square, and height
_FILM = 9  # start, length, force, lift and tilts at the start and at the end
_SAME = 1e-3  # of a step


class ImpactRows(NamedTuple):
    """One entry for each stop, changed in place."""

    words: NDArray[np.int64]  # (c, 11) see the names above
    times: Matrix  # (c, 3) [s]
    sums: Matrix  # (c, 4) [N s], [N s m], [N s m^2], [N s m]
    edges: Matrix  # (c, n + 1) [s]
    load: Cube  # (c, n, S) [N s]
    film: Cube  # (c, n, 9)
    moments: Matrix  # (c, n) [s]
    places: Cube  # (c, n, M)
    total: NDArray[np.int64]  # (1,) impacts of the run so far

    @classmethod
    def empty(cls, stops: int, sectors: int, modes: int, films: int) -> Self:
        """Room for stops that have carried for long."""
        times = np.full((stops, _TIMES), -np.inf)
        return cls(
            np.zeros((stops, _WORDS), dtype=np.int64),
            times,
            np.zeros((stops, _SUMS)),
            np.zeros((stops, _LOADS + 1)),
            np.zeros((stops, _LOADS, sectors)),
            np.zeros((stops, _FILMS if films else 0, _FILM)),
            np.zeros((stops, _MOMENTS)),
            np.zeros((stops, _MOMENTS, modes)),
            np.zeros(1, dtype=np.int64),
        )


@njit
def follow(
    rows: ImpactRows,
    c: int,
    first: int,
    t: float,
    h: float,
    force: Matrix,
    levers: Matrix,
    film: Vector,
    lands: Matrix,
    felt: float,
    places: Matrix,
    pause: float,
    rest: float,
) -> int:
    """Take in steps from ``first`` on; the step before which a recorded impact is over, or -1.

    Then the caller takes its rows, sets the phase, and continues with that step.

    Parameters
    ----------
    c
        Stop.
    t, h [s]
        Start of step 0, and length of the steps.
    force (n, S) [N]
        Mean force of each sector in each step.
    levers (n, 3) [N m], [N m^2], [N m]
        Force times radius, its square, and height.
    film (n,) [N]
        Axial force of the film; empty without.
    lands (n, 6)
        Its lift and tilts at both ends of each step.
    felt [N]
        Force from which on a film is felt.
    places (n, M)
        Modal coordinates at the ends of the steps.
    pause [s]
        Contacts closer together are one impact.
    rest [s]
        An impact whose contact lasts this long is over.
    """
    words, times = rows.words[c], rows.times[c]
    for i in range(first, places.shape[0]):
        start, end, total = t + i * h, t + (i + 1) * h, 0.0
        for s in range(force.shape[1]):
            total += force[i, s]
        closed = total > 0.0
        if words[PHASE] == RESTING:
            if closed:
                times[STOP] = end
            elif end - times[STOP] >= pause:
                words[PHASE] = APART
        elif words[PHASE] == PRESSED and start - times[STOP] >= pause:
            return i
        if words[PHASE] == APART or words[PHASE] == SQUEEZED:
            _await(rows, c, start, end, closed, film.size > 0 and abs(film[i]) > felt, pause)
        if words[PHASE] == SQUEEZED or words[PHASE] == PRESSED:
            if film.size > 0:
                _add_film(rows, c, start, h, film[i], lands[i], pause)
        if words[PHASE] == PRESSED:
            if closed:
                if start - times[STOP] > _SAME * h:
                    times[BEGIN] = start
                times[STOP] = end
            _add_load(rows, c, start, end, h, force[i], levers[i], total)
            _add_place(rows, c, end, places[i])
            if closed and end - times[BEGIN] >= rest:
                words[PHASE] = RESTING
                return i + 1
        elif words[PHASE] != RESTING:
            _await_place(rows, c, end, places[i])
    return -1


@inner
def _await(
    rows: ImpactRows, c: int, start: float, end: float, closed: bool, felt: bool, pause: float
) -> None:
    """Before an impact: a film may be felt, or the stop be touched."""
    words, times = rows.words[c], rows.times[c]
    if closed:
        if words[PHASE] == APART:
            words[FILM_ROWS], words[FILM_STRIDE], words[FILM_SKIP] = 0, 1, 0
        else:
            _forget_films(rows, c, start - pause)
        words[PHASE] = PRESSED
        rows.total[0] += 1
        words[NUMBER] = rows.total[0]
        words[LOAD_ROWS], words[LOAD_STRIDE], words[LOAD_FILL] = 0, 1, 0
        words[MODE_STRIDE], words[MODE_SKIP] = 1, 0
        times[BEGIN], times[STOP] = start, start
        rows.edges[c, 0] = start
        for k in range(rows.sums.shape[1]):
            rows.sums[c, k] = 0.0
    elif felt:
        if words[PHASE] == APART:
            words[FILM_ROWS], words[FILM_STRIDE], words[FILM_SKIP] = 0, 1, 0
        words[PHASE] = SQUEEZED
        times[FELT] = end
    elif words[PHASE] == SQUEEZED and end - times[FELT] >= pause:
        words[PHASE] = APART


@inner
def _await_place(rows: ImpactRows, c: int, time: float, place: Vector) -> None:
    rows.words[c, MODE_ROWS] = 1
    rows.moments[c, 0] = time
    for k in range(len(place)):
        rows.places[c, 0, k] = place[k]


@inner
def _add_load(
    rows: ImpactRows,
    c: int,
    start: float,
    end: float,
    h: float,
    force: Vector,
    levers: Vector,
    total: float,
) -> None:
    """Add a step to the sums of its interval, after one without force where time has passed."""
    words, edges, load = rows.words[c], rows.edges[c], rows.load[c]
    if words[NUMBER] > MOST:
        return
    filled = words[LOAD_ROWS]
    if start - edges[filled] > _SAME * h:
        _next_load(rows, c)
        edges[words[LOAD_ROWS]] = start
    _next_load(rows, c)
    at = words[LOAD_ROWS] - 1
    edges[at + 1] = end
    for s in range(load.shape[1]):
        load[at, s] += force[s] * h
    rows.sums[c, 0] += total * h
    for k in range(3):
        rows.sums[c, k + 1] += levers[k] * h


@inner
def _next_load(rows: ImpactRows, c: int) -> None:
    """Make room for one more step: in the present interval, a new one, or by joining all."""
    words, edges, load = rows.words[c], rows.edges[c], rows.load[c]
    if words[LOAD_ROWS] > 0 and words[LOAD_FILL] < words[LOAD_STRIDE]:
        words[LOAD_FILL] += 1
        return
    if words[LOAD_ROWS] == load.shape[0]:
        half = load.shape[0] // 2
        for k in range(half):
            for s in range(load.shape[1]):
                load[k, s] = load[2 * k, s] + load[2 * k + 1, s]
            edges[k + 1] = edges[2 * k + 2]
        words[LOAD_ROWS] = half
        words[LOAD_STRIDE] *= 2
    for s in range(load.shape[1]):
        load[words[LOAD_ROWS], s] = 0.0
    words[LOAD_ROWS] += 1
    words[LOAD_FILL] = 1


@inner
def _add_film(
    rows: ImpactRows, c: int, start: float, h: float, force: float, land: Vector, pause: float
) -> None:
    words, film = rows.words[c], rows.film[c]
    if words[PHASE] == PRESSED and words[NUMBER] > MOST:
        return
    if words[FILM_SKIP] > 0:
        words[FILM_SKIP] -= 1
        return
    if words[FILM_ROWS] == film.shape[0]:
        if words[PHASE] == SQUEEZED:
            _forget_films(rows, c, start - pause)
        if words[FILM_ROWS] > film.shape[0] // 2:
            words[FILM_ROWS] = _every_second(film, words[FILM_ROWS])
            words[FILM_STRIDE] *= 2
    row = film[words[FILM_ROWS]]
    row[0], row[1], row[2] = start, h, force
    for k in range(6):
        row[k + 3] = land[k]
    words[FILM_ROWS] += 1
    words[FILM_SKIP] = words[FILM_STRIDE] - 1


@inner
def _forget_films(rows: ImpactRows, c: int, before: float) -> None:
    words, film = rows.words[c], rows.film[c]
    old = 0
    while old < words[FILM_ROWS] and film[old, 0] < before:
        old += 1
    for k in range(old, words[FILM_ROWS]):
        for j in range(film.shape[1]):
            film[k - old, j] = film[k, j]
    words[FILM_ROWS] -= old


@inner
def _add_place(rows: ImpactRows, c: int, time: float, place: Vector) -> None:
    words, moments, places = rows.words[c], rows.moments[c], rows.places[c]
    if words[NUMBER] > MOST_MOTIONS:
        return
    if words[MODE_SKIP] > 0:
        words[MODE_SKIP] -= 1
        return
    if words[MODE_ROWS] == places.shape[0]:
        for k in range(0, words[MODE_ROWS], 2):
            moments[k // 2] = moments[k]
        words[MODE_ROWS] = _every_second(places, words[MODE_ROWS])
        words[MODE_STRIDE] *= 2
    moments[words[MODE_ROWS]] = time
    for k in range(len(place)):
        places[words[MODE_ROWS], k] = place[k]
    words[MODE_ROWS] += 1
    words[MODE_SKIP] = words[MODE_STRIDE] - 1


@inner
def _every_second(rows: Matrix, count: int) -> int:
    for k in range(0, count, 2):
        for j in range(rows.shape[1]):
            rows[k // 2, j] = rows[k, j]
    return (count + 1) // 2


class Watched(NamedTuple):
    """What stays the same of all stops; shares of sectors lie point after point."""

    span: NDArray[np.int64]  # (c, 2) first point, and the one behind the last
    start: NDArray[np.int64]  # (n + 1,) in ``sector`` and ``share``
    sector: NDArray[np.int64]
    share: Vector  # axial force of a sector per force of a point
    levers: Matrix  # (n, 3) axial force times radius, its square, and height per force of a point
    film: NDArray[np.int64]  # (c,) place among the films, -1 without one that tilts
    felt: Vector  # (c,) [N]
    pause: Vector  # (c,) [s]
    rest: Vector  # (c,) [s]


@njit
def follow_stops(
    rows: ImpactRows,
    stops: Watched,
    c: int,
    first: int,
    times: tuple[float, float],
    record: Record,
    before: Vector,
) -> tuple[int, int]:
    """Take in the steps of all stops from step ``first`` of stop ``c`` on.

    Returns the stop and the step before which a recorded impact is over, as :func:`follow`; the
    stop is -1 when all is done.

    Parameters
    ----------
    times [s]
        Start of step 0, and length of the steps.
    before (M,)
        Modes there.
    """
    t, h = times
    steps, sectors = len(record.force), rows.load.shape[2]
    force, levers = np.zeros((steps, sectors)), np.zeros((steps, 3))
    film, lands = np.zeros(0), np.zeros((steps, 6))
    for stop in range(c, len(stops.film)):
        if stop > c:
            first = 0
        if first == 0 and rows.words[stop, PHASE] != PRESSED and rows.words[stop, PHASE] != RESTING:
            _await_place(rows, stop, t, before)
        force[:] = 0.0
        levers[:] = 0.0
        for i in range(len(record.points)):
            for k in range(stops.span[stop, 0], stops.span[stop, 1]):
                load = float(record.points[i, k])
                if load != 0.0:
                    for s in range(stops.start[k], stops.start[k + 1]):
                        force[i, stops.sector[s]] += stops.share[s] * load
                    for d in range(3):
                        levers[i, d] += stops.levers[k, d] * load
        place = stops.film[stop]
        if place >= 0:
            film = record.film[:, place].copy()
            lands[:] = record.lands[:, place]
        else:
            film = film[:0]
        first = follow(
            rows,
            stop,
            first,
            t,
            h,
            force,
            levers,
            film,
            lands,
            stops.felt[stop],
            record.places,
            stops.pause[stop],
            stops.rest[stop],
        )
        if first >= 0:
            return stop, first
    return -1, 0


class ImpactRecorder:
    """Records impacts on all stops of one run.

    Parameters
    ----------
    stops
        Of ``model.contacts``.
    films
        Stop and land of each film, in the order of the record of steps.
    shape_marks (M,)
        Identify the shapes of the modes.
    felt, pause, rest (stops,) [N], [s], [s]
        As of :func:`follow`.
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
        named, own = dict(films), [name for name, _ in films]
        self._lands = [(name, named.get(name)) for name in stops]
        axial, points = np.abs(model.axial), model.points
        spans = [contact[1:] for contact in model.contacts]
        shares = block_diag(
            [sector_shares(points[a:b], model.area[a:b]) * axial[a:b] for a, b in spans]
        ).tocsc()
        radius = np.linalg.norm(points[:, :2], axis=1)
        self._watched = Watched(
            span=np.array(spans, dtype=np.int64),
            start=shares.indptr.astype(np.int64),
            sector=shares.indices.astype(np.int64) % SECTORS,
            share=shares.data,
            levers=axial[:, None] * np.column_stack([radius, radius**2, points[:, -1]]),
            film=np.array([own.index(n) if land is not None else -1 for n, land in self._lands]),
            felt=np.array(felt),
            pause=np.array(pause),
            rest=np.array(rest),
        )
        self._follow = of_one_kind(follow_stops)
        self.rows = ImpactRows.empty(len(stops), SECTORS, model.mode_count, len(films))
        self._over: list[tuple[float, SpatialImpact]] = []

    def changing(self) -> dict[str, NDArray[np.generic]]:
        """All arrays that a step changes and the next one starts from."""
        return {f"impact_{name}": array for name, array in self.rows._asdict().items()}

    def resume(self) -> None:
        """Begin the record of a continued run with the unfinished impacts."""
        words = self.rows.words
        going = words[:, PHASE] == PRESSED
        words[going, NUMBER] = np.argsort(np.argsort(words[going, NUMBER])) + 1
        self.rows.total[0] = np.count_nonzero(going)

    def tell(self, t: float, h: float, record: Record, before: Vector) -> None:
        """Take in the steps of a record from ``t`` [s] on; ``before``: modes at its start.

        Later moments are forgotten, since they are computed again.
        """
        while self._over and self._over[-1][0] > t + h * (len(record.force) - 0.5):
            self._over.pop()
        rows, c, first = self.rows, 0, 0
        while True:
            c, first = self._follow(rows, self._watched, c, first, (t, h), record, before)
            if c < 0:
                return
            self._take(c, t + first * h)
            if rows.words[c, PHASE] == PRESSED:
                rows.words[c, PHASE] = APART
                place = record.places[first - 1] if first else before
                rows.moments[c, 0], rows.places[c, 0] = t + first * h, place
                rows.words[c, MODE_ROWS] = 1

    def _take(self, c: int, time: float) -> None:
        if self.rows.words[c, NUMBER] <= MOST:
            self._over.append((time, self._impact(c)))

    def impacts(self, end: float) -> tuple[SpatialImpact, ...]:
        """All impacts up to a moment [s], finished or not, in order of first touch."""
        found = [impact for time, impact in self._over if time <= end * (1.0 + 1e-12)]
        words = self.rows.words
        for c in np.flatnonzero((words[:, PHASE] == PRESSED) & (words[:, NUMBER] <= MOST)):
            found.append(self._impact(int(c)))
        return tuple(sorted(found, key=lambda impact: impact.number))

    def _impact(self, c: int) -> SpatialImpact:
        rows, (name, land) = self.rows, self._lands[c]
        words, edges = rows.words[c], rows.edges[c]
        count = int(
            np.searchsorted(edges[: words[LOAD_ROWS] + 1], rows.times[c, STOP] * (1 - 1e-12))
        )
        count = min(max(count, 1), int(words[LOAD_ROWS]))
        edges = edges[: count + 1].copy()
        _, first, second, height = rows.sums[c] / rows.sums[c, 0]
        film, modes = None, None
        if land is not None:
            samples = rows.film[c, : words[FILM_ROWS]].copy()
            film = FilmMoments(
                land=land,
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
            stop=name,
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


class StopRecord:
    """Record of each stop over a macro step.

    Parameters
    ----------
    ports (M, ports)
        Shapes of the ports of the bodies.
    rows
        Interface of the network at each of ``model.contacts``.
    films
        Place among the recorded films of an interface that has one.
    step [s]
        Fine step.

    Attributes
    ----------
    side (contacts,)
        1 where the force on the needle is upwards, -1 where it is downwards, or elsewhere.
    closed (contacts,)
        Fine step since which a stop is closed; nan while open.
    force (contacts,) [N]
        Axial force of the last step.
    """

    def __init__(
        self,
        network: CompiledNetwork,
        model: InterfaceModel,
        ports: Matrix,
        rows: Sequence[int],
        films: Mapping[int, int],
        arcs: ArcWatch | None,
        step: float,
    ) -> None:
        self._network, self._arcs, self._step = network, arcs, step
        self.closed, self.force = np.full(len(rows), np.nan), np.zeros(len(rows))
        self._last, self._tell = self.force.copy(), of_one_kind(tell_stops)
        self._out: StopState | None = None
        axial = [model.axial[first:last] for _, first, last in model.contacts]
        self.side = np.array([np.sign(np.sum(part)) for part in axial])
        faces = network.interfaces
        self._rows = StopRows(
            row=np.array(rows, dtype=np.int64),
            span=np.array([contact[1:] for contact in model.contacts], dtype=np.int64),
            film=np.array([films.get(row, -1) for row in rows], dtype=np.int64),
            side=self.side,
            slope=np.array([np.mean(np.abs(part)) for part in axial]),
            felt=faces.film_felt[rows],
            upper=faces.upper[rows].astype(np.int64),
            lower=faces.lower[rows].astype(np.int64),
            traces=model.traces,
            ports=ports,
        )

    def begin(self, recording: Recording, scratch: Scratch) -> None:
        """Write into these records from now on."""
        gap0, gap = self._network.interfaces.gap0, self._network.interface_state.gap
        self._out = StopState(
            *(gap0, gap, scratch.sums, scratch.peaks, recording.fine, recording.filled),
            *(self.closed, self.force, self._last),
        )

    def tell(
        self,
        record: Record,
        t: float,
        h: float,
        ends: tuple[Vector, Vector, Vector],
        *,
        points: bool,
    ) -> None:
        """Take in the steps of a record from ``t`` on, of length ``h`` [s].

        ``ends``: modes, forces and gaps of the points at its end; ``points``: whether points were
        looked at.
        """
        elements = self._network.elements
        first = int(elements.port0[elements.rows]) + self._network.branches.rows
        self._tell(self._rows, self._out, record, first, (t, h, self._step), *ends, points)
        if self._arcs is not None:
            for c, (begin, end) in enumerate(self._rows.span):
                self._arcs.see(c, float(self._last[c]), ends[1][begin:end])
