"""A whole stroke: nanoseconds per step, wall time of 10 ms, step sizes, CVODE beside it.

``uv run --group dev python benchmarks/stroke.py`` prints all tables; ``--json FILE`` also writes
``{name: {value, unit, goal}}``; ``--only speed``, ``steps``, ``cvode`` or ``books`` takes one part.

The valve (:mod:`klack.verification.network`) has 20 + 40 + 20 modes, two end stops, each a
contact before a compliance, with films when wet, solenoid with two poles, iron, leakage and one
eddy term under peak and hold, ball seat, two chambers, a line with frequency-dependent friction.
The model beside CVODE is :mod:`small_valve`.

Times are the best of several runs, in one process, after compilation.
"""

import argparse
import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
from number import Number, Size
from small_valve import Motion, by_cvode, by_klack, network
from threadpoolctl import threadpool_limits

from klack.magnetics.voltage_step import VoltageStep
from klack.network.network import Network
from klack.simulation.network_result import ImpactEvent, NetworkResult
from klack.simulation.network_run import simulate_network
from klack.verification.network import peak_and_hold, whole_valve

__all__ = ["books_rows", "cvode_rows", "main", "numbers", "speed_rows", "step_rows"]

STEP, COARSE, RECORD = 20e-9, 64, 1.28e-6
STROKE = 10e-3
STEPS = (80e-9, 40e-9, 20e-9, 10e-9, 5e-9)
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)


def numbers(size: Size) -> list[Number]:
    """Speed and energy of the valve; in full also its step sizes, and CVODE beside a small one."""
    if size == "smallest":
        valve = valves()["dry"]
        return [_row("dry: fine step", ns_per_step(valve, coarse=1, steps=500, repeats=1), "ns")]
    books = books_rows()
    found = _with_accuracy(speed_rows(8 if size == "quick" else 25), books) + books
    if size == "full":
        found += step_rows() + cvode_rows()
    return [replace(number, name=f"stroke, {number.name}") for number in found]


def _with_accuracy(speeds: list[Number], books: list[Number]) -> list[Number]:
    """Times, each with the energy residual of its valve."""
    worst = {
        name: max(b.value for b in books if b.name.startswith(name)) for name in ("dry", "wet")
    }
    return [
        replace(number, accuracy=worst[number.name[:3]], accuracy_of="energy residual")
        if number.unit in ("ns", "s")
        else number
        for number in speeds
    ]


def _row(
    name: str, value: float, unit: str, goal: float | None = None, *, at_least: bool = False
) -> Number:
    return Number(name=name, value=float(value), unit=unit, goal=goal, at_least=at_least)


def valves(*, damping: float = 0.01, end: float = 2.5e-3) -> dict[str, Network]:
    """The valve wet and dry."""
    wet = whole_valve(damping=damping, driver=peak_and_hold(end=end))
    return {"dry": wet.dry(), "wet": wet}


def stroke(
    valve: Network, duration: float, *, step: float = STEP, coarse: int = 1, record: float = RECORD
) -> NetworkResult:
    """Run from rest."""
    return simulate_network(
        valve.rows(), duration=duration, step=step, coarse=coarse, record=record
    )


def ns_per_step(valve: Network, *, coarse: int, steps: int = 20_000, repeats: int = 25) -> float:
    """Best time of the loop per step, from the start: open, fly, hit the stop, bounce.

    The clock runs in the loop alone, records included; many short runs find an undisturbed moment.
    """
    rows = valve.rows()
    best = np.inf
    for _ in range(repeats):
        result = simulate_network(
            rows, duration=steps * STEP, step=STEP, coarse=coarse, record=RECORD
        )
        best = min(best, result.wall_time / (result.fine_steps + result.coarse_steps))
    return best * 1e9


def closed_ns_per_step(*, wet: bool, steps: int = 20_000, repeats: int) -> float:
    """The same of a needle pressed onto its seat: all contacts closed, nothing moves."""
    valve = whole_valve(driver=VoltageStep(voltage=12.0, start=1.0))
    return ns_per_step(valve if wet else valve.dry(), coarse=1, steps=steps, repeats=repeats)


def speed_rows(repeats: int = 25) -> list[Number]:
    """Speed of fine steps, and of a stroke of 10 ms."""
    rows = []
    goals = {"dry": 75.0, "wet": 140.0}
    for name, valve in valves().items():
        moving = ns_per_step(valve, coarse=1, repeats=repeats)
        closed = closed_ns_per_step(wet=name == "wet", repeats=repeats)
        rows.append(_row(f"{name}: fine step", moving, "ns", goals[name]))
        rows.append(_row(f"{name}: fine step, closed at rest", closed, "ns"))
    for name, valve in valves().items():
        runs = [stroke(valve, STROKE, coarse=COARSE) for _ in range(7)]
        best = min(runs, key=lambda result: result.wall_time)
        goal = 0.1 if name == "wet" else None
        rows.append(_row(f"{name}: 10 ms, open and close", best.wall_time, "s", goal))
        rows.append(_row(f"{name}: real-time factor", best.wall_time / STROKE, "-"))
        rows.append(_row(f"{name}: fine steps", best.fine_steps, "-"))
        rows.append(_row(f"{name}: macro steps", best.coarse_steps, "-"))
        rows.append(_row(f"{name}: impacts", len(best.events), "-"))
        alone = min(stroke(valve, STROKE, coarse=1).wall_time for _ in range(3))
        rows.append(_row(f"{name}: 10 ms in fine steps only", alone, "s"))
    return rows


def books_rows() -> list[Number]:
    """Energy residual of undamped valves that open and close, over the throughput."""
    rows = []
    for name, valve in valves(damping=0.0, end=1e-3).items():
        for coarse in (1, COARSE):
            result = stroke(valve, 3e-3, coarse=coarse)
            label = f"{name}: energy residual, 3 ms, coarse {coarse}"
            rows.append(_row(label, result.books.relative_residual, "-", 1e-9))
    return rows


def first_impacts(events: tuple[ImpactEvent, ...]) -> dict[str, ImpactEvent]:
    """First impact on each stop after the needle has opened."""
    found: dict[str, ImpactEvent] = {}
    for event in events:
        found.setdefault(event.stop, event)
    return found


def step_rows() -> list[Number]:
    """First impacts over step sizes against 5 ns; fine steps only, and with coarse ones at 20 ns.

    The driver ends 0.35 ms after the first touch, before bounces have become chaotic.
    """
    rows, table = [], []
    # 160 ns in common, so that all records end together
    settings = [(step, 1) for step in STEPS] + [(STEP, COARSE)]
    for name, valve in valves(end=0.45e-3).items():
        runs = [
            first_impacts(stroke(valve, 1.6e-3, step=step, coarse=coarse, record=1.28e-6).events)
            for step, coarse in settings
        ]
        exact = runs[len(STEPS) - 1]
        for (step, coarse), run in zip(settings, runs, strict=True):
            for stop in ("opening", "seat"):
                a, b = exact[stop], run[stop]
                peak = b.peak_force / a.peak_force - 1.0
                late = b.time - a.time
                table.append(
                    f"{name:<5}{stop:<9}{step * 1e9:5.0f} ns{'  coarse' if coarse > 1 else '':<8}"
                    f"{b.peak_force:10.3f} N {100 * peak:+9.4f} %"
                    f"{b.time * 1e6:12.3f} us {late * 1e6:+8.3f} us"
                    f"{b.approach_speed:9.5f} m/s"
                )
                if step == STEP:
                    kind = ", coarse" if coarse > 1 else ""
                    where = f"{name}: {stop}, 20 ns{kind} against 5 ns"
                    rows.append(_row(f"{where}, peak", 100 * abs(peak), "%", 0.1))
                    rows.append(_row(f"{where}, time", 1e6 * abs(late), "us", 0.05))
    print("\n".join(table))
    return rows


def cvode_rows() -> list[Number]:
    """Time of klack and of CVODE at equal error of the state, on one small valve."""
    import sksundae.cvode  # noqa: F401  (loaded before the limit, which reaches what is loaded)

    # small matrices gain nothing from several threads
    with threadpool_limits(limits=1):
        return _cvode_rows()


def _cvode_rows() -> list[Number]:
    rows = []
    for name, modes in product(("dry", "wet"), (5, 20, 80)):
        exact, ours, theirs = _both(wet=name == "wet", modes=modes)
        for step, run in zip(STEPS, ours[:-1], strict=True):
            print(_motion_line(f"{name} {modes} klack {step * 1e9:3.0f} ns", run, exact))
        print(_motion_line(f"{name} {modes} klack macro", ours[-1], exact))
        for rtol, run in zip(TOLERANCES, theirs, strict=True):
            print(_motion_line(f"{name} {modes} CVODE {rtol:.0e}", run, exact))
        for what, run, goal in (
            ("fine steps", ours[STEPS.index(STEP)], None),
            ("macro steps", ours[-1], {5: 80.0, 20: 300.0, 80: 1000.0}[modes]),
        ):
            error = run.distance(exact)["state"]
            enough = [peer for peer in theirs if peer.distance(exact)["state"] <= error]
            peer = min(enough or theirs[-1:], key=lambda run: run.seconds)
            label = f"{name}, {modes} modes, {what}"
            ratio = peer.seconds / run.seconds
            rows += [
                _row(f"{label}: state against CVODE 1e-11", error, "-"),
                _row(f"{label}: time of CVODE at that error or better", peer.seconds, "s"),
                _row(f"{label}: time of klack", run.seconds, "s"),
                _row(f"{label}: time ratio CVODE / klack", ratio, "-", goal, at_least=True),
            ]
    return rows


def _both(*, wet: bool, modes: int) -> tuple[Motion, list[Motion], list[Motion]]:
    """CVODE at 1e-11; klack over fine steps, then with macro steps; CVODE over tolerances."""
    rows = network(wet=wet, modes=modes)

    def ours(step: float, coarse: int) -> Motion:
        return by_klack(rows, step=step, coarse=coarse)[0]

    def theirs(rtol: float) -> Motion:
        return by_cvode(wet=wet, rtol=rtol, modes=modes)

    return (
        theirs(1e-11),
        [_best(partial(ours, *way)) for way in [*((step, 1) for step in STEPS), (STEP, COARSE)]],
        [_best(partial(theirs, rtol)) for rtol in TOLERANCES],
    )


def _best(run: Callable[[], Motion], repeats: int = 5) -> Motion:
    return min((run() for _ in range(repeats)), key=lambda motion: motion.seconds)


def _motion_line(label: str, run: Motion, exact: Motion) -> str:
    away = run.distance(exact)
    words = "  ".join(f"{key} {value:.1e}" for key, value in away.items())
    return f"{label:<20}{run.steps:>7} steps {1e3 * run.seconds:9.3f} ms   {words}"


PARTS = {"speed": speed_rows, "books": books_rows, "steps": step_rows, "cvode": cvode_rows}


def main() -> None:
    """Measure, print, write the JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=tuple(PARTS), help="one part alone")
    parser.add_argument("--json", type=Path, help="write {name: {value, unit, goal}}")
    args = parser.parse_args()
    result = []
    for name, part in PARTS.items():
        if args.only in (None, name):
            print(f"\n{name}")
            rows = part()
            result += rows
            print("\n".join(row.line() for row in rows))
    if args.json is not None:
        entries = {row.name: row.entry() for row in result}
        args.json.write_text(json.dumps(entries, indent=1) + "\n")


if __name__ == "__main__":
    main()
