"""Strokes of one valve at many points: per hour, on threads, beside single ones.

``uv run --group dev python benchmarks/many_strokes.py`` prints the table; ``--points N`` takes more
of them.

- *alone*: ``klack.run_stroke`` of the changed case in a loop; bodies come from a warm cache.
- *together*: ``klack.run_many`` of the same points, and that its numbers are the same bits.
- *split*: where the time of one stroke goes, on one thread.
- *network*: the valve of ``benchmarks/stroke.py``, wet, 5 ms, a network without a case: rows,
  layout, start and loop of each point, on the same threads.

Rounds of one, two threads and alone follow each other; the best of several counts.
"""

import argparse
import os
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any
from unittest.mock import patch

import numpy as np
from number import Number, Size
from stroke import COARSE, RECORD, STEP, valves

import klack
from klack.analyses.study.computing import on_threads
from klack.simulation.network_run import simulate_network

__all__ = ["main", "numbers"]

CASE = "demo-stroke"
SMALL = Path(__file__).parents[1] / "docs" / "how-to" / "small_valve.yaml"
PRELOAD = "network.components.spring.preload"
MEASURES = (
    "opening_time",
    "closing_time",
    "opening.1.peak_force",
    "opening.1.restitution",
    "energy_residual",
)
DURATION = 5e-3
PARTS = {
    "bodies, made once, their share": "klack.analyses.study.strokes.build_valve",
    "case and network": "klack.analyses.study.strokes._valve_at",
    "rows": "klack.network.network.Network.rows",
    "layout": "klack.simulation.network_run.compile_network",
    "static start": "klack.simulation.network_run.begin_at_rest",
    "time loop": "klack.simulation.network_run.run_network",
    "impact finder": "klack.simulation.impact_events.ImpactFinder.feed",
    "times of the lift": "klack.analyses.stroke.run.all_lift_times",
    "measures": "klack.analyses.study.measures.ChosenMeasure.value",
}
"""Parts of a stroke, and the functions that take their time."""


def numbers(size: Size) -> list[Number]:
    """Strokes per hour, alone and together, and the split of one."""
    with tempfile.TemporaryDirectory() as folder:
        os.environ["KLACK_CACHE"] = folder
        if size == "smallest":
            found = case_rows(klack.load_case(SMALL), 2, 1)
        else:
            count, rounds = (10, 2) if size == "quick" else (40, 3)
            found = case_rows(klack.load_case(CASE), count, rounds) + network_rows(count, rounds)
    return [replace(number, name=f"many strokes, {number.name}") for number in found]


def case_rows(case: klack.CaseOnHand, count: int, rounds: int) -> list[Number]:
    """Alone and together: strokes per hour and the split of one."""
    written = [f"{x} N" for x in np.linspace(11.0, 13.0, count)]
    cores = (1, 2)
    tables: dict[int, klack.PointTable] = {}
    seconds = {name: np.inf for name in ("alone", *cores)}
    some = max(2, count // 4)  # of those alone, which take longer

    def together(threads: int, preloads: list[str]) -> klack.PointTable:
        return klack.run_many(case, {PRELOAD: preloads}, MEASURES, variant="wet", threads=threads)

    together(1, written[:1])  # compile, build
    _alone(case, written[0])
    for _ in range(rounds):
        for threads in cores:
            begin = perf_counter()
            tables[threads] = together(threads, written)
            seconds[threads] = min(seconds[threads], (perf_counter() - begin) / count)
        begin = perf_counter()
        alone = [_alone(case, value) for value in written[:some]]
        seconds["alone"] = min(seconds["alone"], (perf_counter() - begin) / some)
    values = [np.column_stack([c.values for c in tables[n].measures]) for n in cores]
    off = max(
        float(np.sum(values[0] != values[1])), float(np.sum(np.array(alone) != values[0][:some]))
    )
    residual = float(np.abs(tables[1]["energy_residual"]).max())
    rows = [
        Number(
            name=f"{case.name}: strokes per hour, {what}",
            value=3600.0 / seconds[key],
            unit="1/h",
            accuracy=residual,
            accuracy_of="energy residual",
        )
        for key, what in (("alone", "run_stroke in a loop"), (1, "1 thread"), (2, "2 threads"))
    ]
    rows.append(Number(name=f"{case.name}: numbers that differ", value=off, unit="-", goal=0.0))
    with split(PARTS) as spent:
        begin = perf_counter()
        together(1, written)
        whole = perf_counter() - begin
    return rows + [
        Number(name=f"{case.name}: {part} of a stroke", value=1e3 * time / count, unit="ms")
        for part, time in [*spent.items(), ("all", whole)]
    ]


def _alone(case: klack.CaseOnHand, preload: str) -> list[float]:
    found = klack.run_stroke(case.with_value(PRELOAD, preload), ["wet"]).measures
    return [
        float(found["wet, opening 1" if "." in name else "wet"][name.rpartition(".")[2]])
        for name in MEASURES
    ]


def network_rows(count: int, rounds: int) -> list[Number]:
    """A valve without a case: simulate_network at each point, on one thread and on two."""
    valve = valves()["wet"]
    spring: Any = valve.components["spring"]
    points = [spring.model_copy(update={"preload": x}) for x in np.linspace(11.0, 13.0, count)]

    def compute(part: Any, check: Callable[[], None]) -> float:
        rows = valve.with_components({"spring": part}).rows()
        run = simulate_network(rows, duration=DURATION, step=STEP, coarse=COARSE, record=RECORD)
        return run.books.relative_residual

    found: list[Number] = []
    residuals: dict[int, float] = {}
    compute(points[0], lambda: None)
    seconds = {1: np.inf, 2: np.inf}
    for _ in range(rounds):
        for threads in seconds:
            begin = perf_counter()
            on_threads(
                range(count),
                lambda i, check: compute(points[i], check),
                threads,
                residuals.__setitem__,
                lambda: None,
            )
            seconds[threads] = min(seconds[threads], (perf_counter() - begin) / count)
    for threads, time in seconds.items():
        found.append(
            Number(
                name=f"network: strokes per hour, {threads} thread{'s' * (threads > 1)}",
                value=3600.0 / time,
                unit="1/h",
                accuracy=max(map(abs, residuals.values())),
                accuracy_of="energy residual",
            )
        )
    return found


@contextmanager
def split(parts: dict[str, str]) -> Iterator[Counter[str]]:
    """Time that each part takes meanwhile [s]."""
    spent: Counter[str] = Counter()
    patches = []
    for name, place in parts.items():
        module, _, function = place.rpartition(".")
        owner = _found(module)
        patches.append(patch.object(owner, function, _timed(name, getattr(owner, function), spent)))
    for item in patches:
        item.start()
    try:
        yield spent
    finally:
        for item in patches:
            item.stop()


def _found(place: str) -> Any:
    from importlib import import_module

    try:
        return import_module(place)
    except ModuleNotFoundError:
        module, _, name = place.rpartition(".")
        return getattr(import_module(module), name)


def _timed(name: str, function: Callable[..., Any], spent: Counter[str]) -> Callable[..., Any]:
    def call(*given: Any, **named: Any) -> Any:
        begin = perf_counter()
        try:
            return function(*given, **named)
        finally:
            spent[name] += perf_counter() - begin  # type: ignore[assignment]

    return call


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, default=40)
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.environ["KLACK_CACHE"] = folder
        rows = case_rows(klack.load_case(CASE), args.points, args.rounds)
        rows += network_rows(args.points, args.rounds)
    print("\n".join(row.line() for row in rows))


if __name__ == "__main__":
    main()
