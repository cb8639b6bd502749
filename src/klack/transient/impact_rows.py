"""Rows of a record about an impact, in memory of fixed size: the compiled part.

Forces are summed over intervals, so that their sum stays the impulse; where there is no more room,
two intervals become one.  States of films and bodies are samples; where there is no more room,
every second one stays.  All of it lies in arrays that a run keeps, puts back and stores with its
other state.
"""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Cube, Matrix, Vector
from klack.compiling.jit import inner, njit

__all__ = [
    "FILM_ROWS",
    "LOAD_ROWS",
    "MODE_ROWS",
    "MOST",
    "MOST_MOTIONS",
    "NUMBER",
    "PHASE",
    "PRESSED",
    "RESTING",
    "STOP",
    "ImpactRows",
    "follow",
]


RESTING, APART, SQUEEZED, PRESSED = 0, 1, 2, 3
"""What a stop is doing: carries since long, nothing, its film is felt, an impact is recorded."""

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
        """Return room for stops that carry, and have carried for long."""
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
    """Take in steps ``first`` and later; the step before which a recorded impact is over, or -1.

    Then the caller takes its rows, sets the phase, and continues with that step.

    Parameters
    ----------
    rows : ImpactRows
    c, first : int
        Stop; step to begin with.
    t, h : float [s]
        Start of step 0, and length of the steps.
    force : array, shape (n, S) [N]
        Mean force of each sector in each step.
    levers : array, shape (n, 3) [N m], [N m^2], [N m]
        Force times radius, its square, and height.
    film : array, shape (n,) [N]
        Axial force of the film; empty without.
    lands : array, shape (n, 6)
        Its lift and tilts at both ends of each step.
    felt : float [N]
        Force from which on a film is felt.
    places : array, shape (n, M)
        Modal coordinates at the ends of the steps.
    pause : float [s]
        Contacts closer together are one impact.
    rest : float [s]
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
    """Remember where the bodies are: the moment before a touch."""
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
    """Add a step to the sums of its interval; before it one without force where time has passed."""
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
    """Make room for one more step: in the present interval, a new one, or by joining them all."""
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
    """Add a sample of the film."""
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
    """Forget samples of the film that are too old."""
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
    """Add a moment of the bodies."""
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
