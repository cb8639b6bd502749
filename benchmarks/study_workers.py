"""Points of a study on threads, processes and a cluster of dask: per hour, and what each costs.

``uv run --group dev python benchmarks/study_workers.py`` prints the table.

- *noise*: ``demo-stroke``, wet, levels of a click, new spring preloads: one and two threads, one
  and two processes, two workers of dask.
- *strokes*: the same without noise.
- *geometries*: a needle of another length at each point (mesh, static laws, modes, a wet stroke),
  one and two processes.
- *impacts*: ``demo-valve-axisymmetric`` with another length of the needle: mesh, static law, modes,
  reduced impact, in one process.
- *dask*: what a point costs beside its computation, with a valve that takes milliseconds, on one
  worker; each point as a task of its own, and as klack joins them.

Workers have started and have the case; rounds of all of them follow each other, the best of several
counts.  Rows of all are compared: none may differ in a bit.  On a busy machine the scaling says
little; the share of the time that two processes compute, of the time that they could, does not
depend on what else runs, nor do processor times: twice that share is the scaling of an idle one.
"""

import argparse
import os
import tempfile
import warnings
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from itertools import count as counter
from pathlib import Path
from time import perf_counter, process_time
from typing import Any
from unittest.mock import patch

from number import Number, Size

import klack
from klack.analyses.study import where as where_module
from klack.analyses.study.asked_points import PointRow
from klack.analyses.study.computing import PointWorkers
from klack.analyses.study.dask_workers import DaskWorkers, _TaskSize
from klack.analyses.study.kinds import ask
from klack.analyses.study.where import Where
from klack.case.valve import ValveCase
from klack.machine.progress import silent

__all__ = ["main", "numbers"]

SMALL = Path(__file__).parents[1] / "docs" / "how-to" / "small_valve.yaml"
PRELOAD = "network.components.spring.preload"
LENGTHS = tuple(f"bodies.needle.geometry.profile.parts.needle.edges.{i}.line.1" for i in (1, 2))
CLICK = ("opening_time", "noise.sound_exposure_level_weighted")
STROKE = ("opening_time", "closing_time", "opening.1.peak_force")

Point = Mapping[str, str | float]


def numbers(size: Size) -> list[Number]:
    """Points per hour of each kind of workers."""
    if size == "smallest":
        return small_rows(4)
    points, rounds = (8, 2) if size == "quick" else (24, 5)
    return [*small_rows(400), *rows(points, rounds)]


def rows(points: int, rounds: int) -> list[Number]:
    """Noise, strokes and geometries of demo-stroke."""
    case = klack.load_case("demo-stroke")
    fresh = counter()

    def preloads(count: int) -> list[Point]:
        return [{PRELOAD: f"{11 + 0.01 * next(fresh)} N"} for _ in range(count)]

    def lengths(count: int) -> list[Point]:
        return [
            dict.fromkeys(LENGTHS, 20.0 + 1e-3 * k) for k in (next(fresh) for _ in range(count))
        ]

    found = []
    with open_workers(case, ["1 thread", "2 threads", "1 process", "2 processes", "dask"]) as crews:
        for name, measures, make, share, only in (
            ("noise", CLICK, preloads, 1, tuple(crews)),
            ("strokes", STROKE, preloads, 2, tuple(crews)),
            ("geometries", STROKE, lengths, 1, ("1 thread", "1 process", "2 processes")),
        ):
            used = {key: crews[key] for key in only}
            best, busy, spent = race(
                case, used, measures, make, points * share, rounds, name != "geometries"
            )
            found.append(
                Number(name=f"{name}: processor time of a point", value=1e3 * spent, unit="ms")
            )
            found += [
                Number(name=f"{name} per hour, {key}", value=3600.0 / best[key], unit="1/h")
                for key in used
            ]
            found.append(
                Number(
                    name=f"{name}: 2 processes against 1",
                    value=best["1 process"] / best["2 processes"],
                    unit="-",
                    goal=1.8 if name == "noise" else None,
                    at_least=True,
                )
            )
            found.append(
                Number(
                    name=f"{name}: share of the time that 2 processes compute", value=busy, unit="-"
                )
            )
    found = [
        replace(item, goal=4000.0, at_least=True)
        if item.name == "geometries per hour, 2 processes"
        else item
        for item in found
    ]
    return [*found, impact_row(points)]


def race(
    case: klack.CaseOnHand,
    crews: Mapping[str, PointWorkers],
    measures: Sequence[str],
    make: Callable[[int], list[Point]],
    points: int,
    rounds: int,
    same: bool,
) -> tuple[dict[str, float], float, float]:
    """Seconds for a point, of each crew; all get the same points where ``same`` is true.

    Also the share of the time that two processes compute, and the processor time of a point.
    """
    for crew in crews.values():
        compute(case, crew, measures, make(2 * max(crew.count, 1)))  # start, read, compile
    best: dict[str, float] = defaultdict(lambda: float("inf"))
    busy, processor = 0.0, float("inf")
    for _ in range(rounds):
        shared = make(points)
        answers = []
        for name, crew in crews.items():
            with seconds_of_workers() as spent:
                begin, used = perf_counter(), process_time()
                answers.append(compute(case, crew, measures, shared if same else make(points)))
                whole, used = perf_counter() - begin, process_time() - used
            best[name] = min(best[name], whole / points)
            if name == "2 processes":
                busy = max(busy, sum(spent) / (2.0 * whole))
            if name == "1 thread":
                processor = min(processor, used / points)
        assert not same or all(answer == answers[0] for answer in answers), "bits differ"
    return best, busy, processor


@contextmanager
def seconds_of_workers() -> Iterator[list[float]]:
    """Seconds that processes take for each answer meanwhile."""
    spent: list[float] = []
    keep = where_module._keep

    def noted(asked: Any, item: Any, found: Any, tally: Any) -> None:
        spent.append(found.seconds)
        keep(asked, item, found, tally)

    with patch.object(where_module, "_keep", noted):
        yield spent


def compute(
    case: klack.CaseOnHand, crew: PointWorkers, measures: Sequence[str], points: Sequence[Point]
) -> list[tuple[float | None, ...]]:
    """Values of the points, all of which can be computed."""
    asked = ask(checked(case), case.tree, points, measures, "wet")
    found: dict[int, PointRow] = {}
    crew.compute(asked, range(len(points)), found.__setitem__, silent)
    assert not any(row.failure for row in found.values()), found
    return [found[i].values for i in range(len(points))]


def small_rows(points: int) -> list[Number]:
    """What dask costs beside the computation of a point, on one worker."""
    case = klack.load_case(SMALL)
    found = []
    with open_workers(case, ["dask of one"]) as crews:
        crew = crews["dask of one"]
        assert isinstance(crew, DaskWorkers)
        written = [{PRELOAD: f"{11 + 1e-3 * k} N"} for k in range(points)]
        compute(case, crew, ("opening_time",), written[:4])
        for what, most in (("one by one", 1), ("joined", _TaskSize._most)):
            best = float("inf")
            for _ in range(3):
                spent: list[float] = []
                learn = _TaskSize.learn

                def noted(self: Any, answer: Any, spent: Any = spent, learn: Any = learn) -> None:
                    spent.append(answer.seconds)
                    learn(self, answer)

                with (
                    patch.object(_TaskSize, "learn", noted),
                    patch.object(_TaskSize, "_most", most),
                ):
                    crew._size = _TaskSize()
                    begin = perf_counter()
                    compute(case, crew, ("opening_time",), written)
                    whole = perf_counter() - begin
                best = min(best, (whole - sum(spent)) / points)
            found.append(
                Number(
                    name=f"dask: beside a point, {what}",
                    value=1e3 * best,
                    unit="ms",
                    goal=2.0,
                )
            )
        found.append(
            Number(
                name="dask: a point of the small valve", value=1e3 * sum(spent) / points, unit="ms"
            )
        )
    return found


def impact_row(count: int) -> Number:
    """Mesh, static law, modes and reduced impact of new geometries, one after another."""
    case = klack.load_case("demo-valve-axisymmetric")
    best = float("inf")
    for k in range(count):
        changed = case
        for i in (4, 5):
            key = f"bodies.needle.geometry.profile.parts.needle.edges.{i}.line.1"
            changed = changed.with_value(key, 19.4 + 1e-3 * (k + 1))
        begin = process_time()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            klack.run_impact(changed, ["reduced"], certify=False)
        best = min(best, process_time() - begin)
    return Number(
        name="impacts of new geometries: processor time of a point", value=1e3 * best, unit="ms"
    )


def checked(case: klack.CaseOnHand) -> ValveCase:
    """Case of a whole valve."""
    assert isinstance(case.checked, ValveCase)
    return case.checked


@contextmanager
def open_workers(case: klack.CaseOnHand, kinds: Sequence[str]) -> Iterator[dict[str, PointWorkers]]:
    """Workers by their names."""
    from distributed import LocalCluster

    places = {
        "1 thread": Where(threads=1),
        "2 threads": Where(threads=2),
        "1 process": Where(workers=1),
        "2 processes": Where(workers=2),
    }
    with ExitStack() as stack:
        found = {}
        for kind in kinds:
            where = places.get(kind)
            if where is None:
                cluster = LocalCluster(
                    n_workers=1 if kind.endswith("one") else 2,
                    threads_per_worker=1,
                    dashboard_address=None,
                )
                where = Where(dask=stack.enter_context(cluster).scheduler_address)
            found[kind] = stack.enter_context(where.open(checked(case), case.tree))
        yield found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=24)
    parser.add_argument("--rounds", type=int, default=5)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["KLACK_CACHE"] = folder
        found = [*small_rows(400), *rows(args.points, args.rounds)]
    print("\n".join(row.line() for row in found))


if __name__ == "__main__":
    main()
