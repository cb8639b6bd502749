"""Searches asked and told; the truth is pymoo run alone, and optima known in closed form."""

import subprocess
import sys
import warnings

import numpy as np
import pytest

from klack.errors import InputError, MissingExtraError
from klack.studies.fronts import find_front
from klack.studies.search import Search, SearchSettings


def zdt1(x):
    """Zitzler, Deb and Thiele (2000): the front is f2 = 1 - sqrt(f1) at g = 1."""
    g = 1.0 + 9.0 * x[:, 1:].mean(axis=1)
    return np.column_stack((x[:, 0], g * (1.0 - np.sqrt(x[:, 0] / g))))


def bnh(u):
    """Binh and Korn (1997) with its two constraints, in the unit square."""
    x, y = 5.0 * u[:, 0], 3.0 * u[:, 1]
    goals = np.column_stack((4 * x**2 + 4 * y**2, (x - 5) ** 2 + (y - 5) ** 2))
    limits = np.column_stack(((x - 5) ** 2 + y**2 - 25, 7.7 - (x - 8) ** 2 - (y + 3) ** 2))
    return goals, limits


def dtlz2(x, count):
    """Deb, Thiele, Laumanns and Zitzler (2005): the front is the unit sphere."""
    goals = np.repeat(1.0 + ((x[:, count - 1 :] - 0.5) ** 2).sum(axis=1)[:, None], count, axis=1)
    angle = 0.5 * np.pi * x[:, : count - 1]
    for i in range(count):
        goals[:, i] *= np.cos(angle[:, : count - 1 - i]).prod(axis=1)
        goals[:, i] *= np.sin(angle[:, count - 1 - i]) if i else 1.0
    return goals


def sphere(x):
    return ((x - 0.3) ** 2).sum(axis=1)[:, None]


def rosenbrock(x):
    z = 4.0 * x - 2.0
    return (100.0 * (z[:, 1:] - z[:, :-1] ** 2) ** 2 + (1.0 - z[:, :-1]) ** 2).sum(axis=1)[:, None]


def run(settings, values, start=()):
    """All points, objectives and constraints of a search."""
    search = Search(settings, start)
    log = []
    for points in search:
        found = values(points)
        goals, limits = found if isinstance(found, tuple) else (found, np.zeros((len(points), 1)))
        search.tell(goals, limits)
        log.append((points, goals, limits))
    return tuple(np.concatenate(part) for part in zip(*log, strict=True))


def alone(settings, values, constraints, algorithm):
    """All points of pymoo run by itself."""
    from pymoo.core.problem import Problem
    from pymoo.optimize import minimize

    seen = []

    class Alone(Problem):
        def __init__(self):
            high = np.nextafter(1.0, 0.0)
            super().__init__(settings.parameters, settings.objectives, constraints, xl=0.0, xu=high)

        def _evaluate(self, x, out, *_, **__):
            found = values(x)
            out["F"], out["G"] = found if constraints else (found, None)
            seen.append(x)

    with warnings.catch_warnings():
        minimize(Alone(), algorithm, ("n_gen", settings.generations), seed=settings.seed)
    return np.concatenate(seen)


def nsga2(population):
    from pymoo.algorithms.moo.nsga2 import NSGA2

    return NSGA2(pop_size=population)


def nsga3(population):
    from pymoo.algorithms.moo.nsga3 import NSGA3
    from pymoo.util.ref_dirs import get_reference_directions

    return NSGA3(get_reference_directions("das-dennis", 4, n_partitions=5), pop_size=population)


def evolution(population):
    from pymoo.algorithms.soo.nonconvex.de import DE

    return DE(pop_size=population, variant="DE/best/1/bin", F=0.5, CR=0.9)


@pytest.mark.parametrize(
    ("parameters", "objectives", "values", "constraints", "algorithm"),
    [(8, 2, zdt1, 0, nsga2), (2, 2, bnh, 2, nsga2), (4, 1, rosenbrock, 0, evolution)],
)
def test_points_are_those_of_pymoo_run_alone(
    parameters, objectives, values, constraints, algorithm
):
    settings = SearchSettings(parameters, objectives, population=40, generations=30, seed=5)
    points, *_ = run(settings, values)
    assert np.array_equal(points, alone(settings, values, constraints, algorithm(40)))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parameters", "values", "reference", "generations"),
    [(10, zdt1, [1.1, 1.1], 150), (2, bnh, [140.0, 50.0], 60)],
)
def test_fronts_have_the_hypervolume_of_pymoo_run_alone(parameters, values, reference, generations):
    from pymoo.indicators.hv import HV

    settings = SearchSettings(parameters, 2, population=60, generations=generations, seed=2)
    start = np.full((1, parameters), 0.5)
    volumes = []
    expected = alone(settings, values, 2 if values is bnh else 0, nsga2(60))
    for points in (run(settings, values, start)[0], expected):
        found = values(points)
        goals, limits = found if isinstance(found, tuple) else (found, None)
        volumes.append(HV(ref_point=reference)(goals[find_front(goals, limits).points]))
    assert volumes[0] == pytest.approx(volumes[1], rel=0.01)
    if values is zdt1:  # closed form: area of the box less that below the front
        assert volumes[0] == pytest.approx(1.1**2 - 1.0 / 3.0, rel=0.01)


@pytest.mark.slow
def test_four_objectives_have_the_hypervolume_of_pymoo_run_alone():
    from pymoo.indicators.hv import HV

    settings = SearchSettings(7, 4, population=56, generations=60, seed=1)
    _, goals, _ = run(settings, lambda x: dtlz2(x, 4))
    expected = dtlz2(alone(settings, lambda x: dtlz2(x, 4), 0, nsga3(56)), 4)
    volumes = [
        HV(ref_point=[1.2] * 4)(f[-112:][find_front(f[-112:]).points]) for f in (goals, expected)
    ]
    assert volumes[0] == pytest.approx(volumes[1], rel=0.01)
    front = goals[find_front(goals).points]
    assert np.median(np.linalg.norm(front, axis=1)) == pytest.approx(1.0, abs=0.02)  # the sphere
    assert np.all(front.max(axis=0) > 0.9)  # all four ends of it


@pytest.mark.slow
def test_sizes_of_four_objectives_do_not_matter():
    settings = SearchSettings(7, 4, population=56, generations=40, seed=1)
    sizes = np.array([2.0**-40, 1.0, 2.0**30, 2.0**-20])  # powers of two: no rounding
    points, *_ = run(settings, lambda x: dtlz2(x, 4))
    scaled, *_ = run(settings, lambda x: dtlz2(x, 4) * sizes)
    assert np.array_equal(points, scaled)


@pytest.mark.parametrize("objectives", [1, 2, 3, 4])
@pytest.mark.parametrize("huge", [1e200, np.finfo(float).max])
def test_huge_objectives_of_a_part_do_not_stop_a_search(objectives, huge):
    def values(x):
        goals = dtlz2(x, 4)[:, :objectives]
        goals[x[:, 1] < 0.3] = huge
        return goals

    settings = SearchSettings(6, objectives, population=40, generations=20, seed=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        points, *_ = run(settings, values)
    assert np.mean(points[-40:, 1] < 0.3) < 0.2


def test_one_objective_finds_its_optimum():
    points, goals, _ = run(SearchSettings(8, 1, population=40, generations=80), sphere)
    assert goals.min() < 1e-10
    assert points[np.argmin(goals)] == pytest.approx(0.3, abs=1e-5)
    _, goals, _ = run(SearchSettings(2, 1, population=30, generations=60), rosenbrock)
    assert goals.min() < 1e-8


def failing(values, part):
    """Nothing is found in this part of the box, and the best points lie at its edge."""

    def partly(points):
        goals = values(points)
        goals[points[:, 0] < part] = np.nan
        return goals

    return partly


@pytest.mark.parametrize(
    ("objectives", "values"),
    [(1, sphere), (2, zdt1), (3, lambda x: dtlz2(x, 3)), (4, lambda x: dtlz2(x, 4))],
)
@pytest.mark.parametrize("part", [1 / 3, 0.98, 2.0])
def test_failed_points_end_in_no_crash_and_the_same_points_again(objectives, values, part):
    settings = SearchSettings(6, objectives, population=35, generations=15, seed=7)
    points, goals, _ = run(settings, failing(values, part))
    again, *_ = run(settings, failing(values, part))
    assert np.array_equal(points, again)
    assert len(points) == 35 * 15
    if part < 0.5:  # the search leaves the failed third
        failed = np.isnan(goals[:, 0])
        assert failed[:35].sum() >= 5
        assert failed[-70:].mean() < 0.5 * failed[:35].mean() or objectives == 1
        assert find_front(goals).feasible


@pytest.mark.parametrize("objectives", [1, 2, 4])
def test_equal_violations_are_drawn_from_the_seed(objectives):
    def values(x):
        return dtlz2(x, 4)[:, :objectives], np.where(x[:, :1] < 0.99, 1.0, 0.0)

    settings = SearchSettings(5, objectives, population=30, generations=8, seed=4)
    assert np.array_equal(run(settings, values)[0], run(settings, values)[0])


@pytest.mark.parametrize("worst", [1.0, 1e300])
def test_a_failed_point_is_worse_than_any_violation(worst):
    def values(x):
        goals, limits = x[:, :1].copy(), np.full((len(x), 2), worst)
        goals[x[:, 0] > 0.5] = np.nan
        return goals, limits

    points, *_ = run(SearchSettings(2, 1, population=30, generations=10), values)
    assert np.mean(points[-30:, 0] > 0.5) < 0.25
    points, *_ = run(
        SearchSettings(2, 2, population=30, generations=10),
        lambda x: (np.repeat(values(x)[0], 2, axis=1), values(x)[1]),
    )
    assert np.mean(points[-30:, 0] > 0.5) < 0.25


def test_the_optimum_beside_a_failed_third_is_found():
    def beside(x):
        return failing(lambda u: ((u - 0.3) ** 2).sum(axis=1)[:, None], 1 / 3)(x)

    _, goals, _ = run(SearchSettings(6, 1, population=40, generations=60), beside)
    assert np.nanmin(goals) == pytest.approx((1 / 3 - 0.3) ** 2, abs=1e-4)


@pytest.mark.parametrize("objectives", [1, 2, 4])
def test_a_search_told_stored_values_asks_for_the_same_points(objectives):
    def values(x):
        return sphere(x) if objectives == 1 else dtlz2(x, objectives)

    settings = SearchSettings(5, objectives, population=24, generations=12, seed=11)
    whole, goals, _ = run(settings, values)
    store = {point.tobytes(): goal for point, goal in zip(whole, goals, strict=True)}
    resumed, other = Search(settings), Search(SearchSettings(9, objectives, population=30))
    np.random.seed(1)  # noqa: NPY002  the global generator is of no influence
    for points in resumed:
        if resumed.told >= 7:  # another search in between is of no influence either
            other.tell(values(other.ask()))
        resumed.tell([store[point.tobytes()] for point in points])
    assert resumed.told == 12
    shorter, *_ = run(SearchSettings(5, objectives, population=24, generations=5, seed=11), values)
    assert np.array_equal(shorter, whole[: 5 * 24])
    different, *_ = run(
        SearchSettings(5, objectives, population=24, generations=2, seed=12), values
    )
    assert not np.any(np.isin(different, whole))


def test_the_design_of_today_is_in_the_first_batch():
    start = [[0.2, 0.9], [1.0, 0.0]]
    first = Search(SearchSettings(2, 2, population=10), start).ask()
    assert first[:2].tolist() == [[0.2, 0.9], [np.nextafter(1.0, 0.0), 0.0]]
    assert np.array_equal(first[2:], Search(SearchSettings(2, 2, population=10)).ask()[2:])


def test_a_search_spreads_from_the_only_design_that_works():
    today = np.full(6, 0.7)

    def values(points):
        goals = zdt1(points)
        goals[np.abs(points - today).max(axis=1) > 0.03] = np.nan  # 5e-8 of the box
        return goals

    settings = SearchSettings(6, 2, population=30, generations=20, seed=3)
    _, goals, _ = run(settings, values, [today])
    works = np.isfinite(goals[:, 0])
    assert works[:30].tolist() == [True] + [False] * 29
    assert works[-30:].sum() >= 5


@pytest.mark.parametrize("objectives", [1, 2, 4])
def test_points_keep_off_the_faces(objectives):
    settings = SearchSettings(3, objectives, population=30, generations=10, edge=0.01)
    points, *_ = run(settings, lambda x: x[:, [0, 1, 2, 0]][:, :objectives])
    assert 0.01 <= points.min() < 0.011
    assert points.max() <= 0.99
    plain = SearchSettings(3, objectives, population=30, generations=10)
    points, *_ = run(plain, lambda x: -x[:, [0, 1, 2, 0]][:, :objectives])
    assert 0.999 < points.max() < 1.0


def test_a_search_without_anything_to_find_ends():
    points, *_ = run(SearchSettings(1, 2, population=8, generations=20), lambda x: np.ones((8, 2)))
    assert len(points) == 160
    points, *_ = run(SearchSettings(3, 4, population=20, generations=9), lambda x: np.ones((20, 4)))
    assert len(points) == 180


def test_warnings_stay_on():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        run(SearchSettings(6, 4, population=20, generations=3), lambda x: dtlz2(x, 4))
        warnings.warn("still heard", stacklevel=1)
    assert [str(w.message) for w in caught if w.category is UserWarning] == ["still heard"]


def test_pymoo_is_imported_by_the_first_search_only():
    code = "import sys, klack.studies.search; print('pymoo' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert said.stdout.strip() == "False"


def test_without_pymoo_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymoo.config", None)
    with pytest.raises(MissingExtraError, match="--extra optimise"):
        Search(SearchSettings(2, 2))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"objectives": 5}, "objectives: got 5, expected a whole number from 1 to 4"),
        ({"objectives": 0}, "1 to 4"),
        ({"parameters": 0}, "parameters"),
        ({"population": 7}, "population: got 7, expected a whole number from 8"),
        ({"objectives": 4, "population": 19}, "from 20"),
        ({"population": 20.5}, "whole number"),
        ({"generations": 0}, "generations"),
        ({"seed": -1}, "seed"),
    ],
)
def test_settings_out_of_range_are_named(change, words):
    with pytest.raises(InputError, match=words):
        SearchSettings(**({"parameters": 3, "objectives": 2} | change))
