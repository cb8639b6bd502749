"""Evolutionary search with one to four objectives, in batches."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.errors import MissingExtraError
from klack.studies.batches import Batches, PointValues, highest, require_count

__all__ = ["Search", "SearchSettings", "require_pymoo"]

_WORST_VIOLATION = 1e200
"""Largest violation of a point that did not fail."""

_LARGEST = 1e100
"""Largest objectives: their differences and squares stay finite."""


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """What a search looks for and how long.

    Parameters
    ----------
    objectives
        1 to 4.
    population
        Points per generation, which is one batch: 8 to 10 000, from 20 with 4 objectives.
    edge
        Distance of points from the faces of the cube, 0 to below 0.5; above zero for distributions
        without ends.
    """

    parameters: int
    objectives: int
    population: int = 100
    generations: int = 100
    seed: int = 0
    edge: float = 0.0

    def __post_init__(self) -> None:
        require_count("search: parameters", self.parameters, 1, 1000)
        require_count("search: objectives", self.objectives, 1, 4)
        least = 20 if self.objectives == 4 else 8
        require_count("search: population", self.population, least, 10_000)
        require_count("search: generations", self.generations, 1, 10**9)
        require_count("search: seed", self.seed, 0, 2**63 - 1)

    @property
    def algorithm(self) -> str:
        """``"DE"`` for one objective, ``"NSGA-II"`` for two or three, ``"NSGA-III"`` for four."""
        return {1: "DE", 4: "NSGA-III"}.get(self.objectives, "NSGA-II")


class Search(Batches):
    """Evolutionary search, asked and told; one batch is one generation.

    One objective: differential evolution DE/best/1/bin with ``F = 0.5`` and ``CR = 0.9``.  Two and
    three: NSGA-II, by rank of domination and distance on the front.  Four: NSGA-III, by directions
    evenly spread over the front.  Constraints by Deb's rule: feasible before infeasible, then the
    smaller sum of violations.  A failed point is worse than every one that did not fail.

    With more generations the first ones stay the same, so a longer search continues a shorter one.
    The points of the front are those of all batches (:func:`klack.studies.fronts.find_front`), not
    those of the last population.

    Parameters
    ----------
    start (points, parameters)
        Points that enter the first batch, before drawn ones: the design of today.  Those nearer to
        a face than ``edge`` are moved.

    Notes
    -----
    Storn and Price (1997), J. Global Optim. 11, 341-359; Deb, Pratap, Agarwal and Meyarivan
    (2002), IEEE Trans. Evol. Comput. 6, 182-197; Deb and Jain (2014), IEEE Trans. Evol. Comput. 18,
    577-601.  All as in pymoo: Blank and Deb (2020), IEEE Access 8, 89497-89509.
    """

    def __init__(self, settings: SearchSettings, start: ArrayLike = ()) -> None:
        super().__init__(settings.objectives)
        self.settings = settings
        first = np.reshape(np.asarray(start, dtype=float), (-1, settings.parameters))
        self._start = np.clip(first, settings.edge, highest(settings.edge))
        self._scale: NDArray[np.float64] | None = None
        self._population: Any = None
        with _own_warnings():
            self._algorithm = _algorithm(settings)

    def _next_points(self) -> NDArray[np.float64] | None:
        if self.told == self.settings.generations:
            return None
        with _own_warnings():
            population = self._algorithm.ask()
        if population is None or not len(population):
            return None  # every child would repeat a known point
        points = np.array(population.get("X"), dtype=float)
        if self.told == 0:
            points[: len(self._start)] = self._start
            population.set("X", points)
        self._population = population
        return points

    def _take(self, points: NDArray[np.float64], values: PointValues) -> None:
        violation = np.minimum(values.violation, _WORST_VIOLATION)
        violation[values.failed] = 2.0 * _WORST_VIOLATION
        objectives = np.where(values.failed[:, None], 0.0, values.objectives)
        with np.errstate(over="ignore"):
            sized = np.clip(objectives / self._scales(values), -_LARGEST, _LARGEST)
        self._population.set("F", sized, "G", violation[:, None])
        with _own_warnings():
            self._algorithm.tell(infills=self._population)

    def _scales(self, values: PointValues) -> NDArray[np.float64]:
        """Divisors of objectives: NSGA-III has absolute limits for sizes around one."""
        if self.settings.algorithm != "NSGA-III":
            return np.ones(self.settings.objectives)
        if self._scale is None:
            known = values.objectives[~values.failed]
            if not len(known):
                return np.ones(self.settings.objectives)
            self._scale = _spread(known)
        return self._scale


def _spread(objectives: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of quartiles, or range, or size of each column; never zero."""
    near = np.clip(objectives, -_LARGEST, _LARGEST)
    low, high = np.quantile(near, (0.25, 0.75), axis=0)
    spread = high - low
    for wider in (np.ptp(near, axis=0), np.abs(near).max(axis=0)):
        spread = np.where(spread > 0.0, spread, wider)
    return np.where(spread > 0.0, spread, 1.0)


@contextmanager
def _own_warnings() -> Iterator[None]:
    """Keep warning filters, which pymoo's NSGA-III switches off for good."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def require_pymoo() -> None:
    """Refuse a search without pymoo before any computation."""
    try:
        import pymoo.config  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("pymoo", "A search for optima", "optimise") from error


def _algorithm(settings: SearchSettings) -> Any:
    """Fresh algorithm of pymoo."""
    require_pymoo()
    from pymoo.algorithms.moo.nsga2 import NSGA2
    from pymoo.algorithms.soo.nonconvex.de import DE
    from pymoo.config import Config
    from pymoo.core.problem import Problem
    from pymoo.core.termination import NoTermination

    Config.warnings["not_compiled"] = False  # would be printed among results
    problem = Problem(
        n_var=settings.parameters,
        n_obj=settings.objectives,
        n_ieq_constr=1,  # the sum of violations
        xl=settings.edge,
        xu=highest(settings.edge),
    )
    made: Any
    if settings.algorithm == "DE":
        made = DE(pop_size=settings.population, variant="DE/best/1/bin", F=0.5, CR=0.9, output=None)
    elif settings.algorithm == "NSGA-II":
        made = NSGA2(pop_size=settings.population, output=None)
    else:
        made = _nsga3(settings)
    made.setup(problem, termination=NoTermination(), seed=int(settings.seed))
    return made


def _nsga3(settings: SearchSettings) -> Any:
    """NSGA-III with as many even directions as the population can follow."""
    from pymoo.algorithms.moo.nsga3 import NSGA3
    from pymoo.operators.selection.tournament import TournamentSelection
    from pymoo.util.ref_dirs import get_reference_directions

    last = settings.objectives - 1
    parts = 1
    while comb(parts + 1 + last, last) <= settings.population:
        parts += 1
    directions = get_reference_directions("das-dennis", settings.objectives, n_partitions=parts)
    return NSGA3(
        directions,
        pop_size=settings.population,
        selection=TournamentSelection(func_comp=_less_violated),
        output=None,
    )


def _less_violated(
    pop: Any, P: NDArray[np.intp], random_state: np.random.Generator, **_: Any
) -> NDArray[np.intp]:
    """Winner of each pair: the less violated one, else one by chance.

    That of pymoo draws from a generator without a seed where both are equally violated.
    """
    violation = pop.get("CV")[:, 0]
    first, second = P[:, 0], P[:, 1]
    chosen = np.where(random_state.random(len(P)) < 0.5, first, second)
    chosen = np.where(violation[first] < violation[second], first, chosen)
    chosen = np.where(violation[second] < violation[first], second, chosen)
    return chosen[:, None]
