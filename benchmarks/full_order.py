"""Seconds per full-order impact, beside its error: ``python benchmarks/full_order.py``.

A needle D4 x 30 mm with a spherical tip falls on a seat cone at 0.5 m/s; the solid is swept from
the meridian mesh of the axisymmetric run that it is compared with.  ``--size``, ``--bulk`` and
``--layers`` set the mesh (0.025 mm, 1 mm and 16: 75 000 degrees of freedom).
"""

import argparse
import os
import resource
import time

import numpy as np
from machine import peak_gigabytes
from number import Number, Size
from solid_valve import solid_valve

from klack.analyses.impact.run import run_impact
from klack.case import load_case, shipped_cases
from klack.transient.full_order import simulate_full_order
from klack.transient.result import FullOrderResult
from klack.verification.transient import needle_over_seat

__all__ = ["main", "numbers"]


def numbers(size: Size) -> list[Number]:
    """Time and memory of the full order of the demo valve; in full: 258 000 unknowns, 1000 steps.

    The time counts from its factorisation on; meshes and static contact come before it.
    """
    steps = {"smallest": 20, "quick": 200, "full": 1000}[size]
    if size == "smallest":
        case = load_case(shipped_cases()["demo-valve-axisymmetric"])
    else:
        case = solid_valve(2.0, 9) if size == "quick" else solid_valve(0.45, 40)
    run = case.run.model_copy(update={"duration": steps * case.run.full_step})
    study = run_impact(case.model_copy(update={"run": run}), levels=("full",))
    full = study.levels["full"]
    ledger = full.history.ledger
    lost = ledger.contact_dissipation / ledger.initial
    goals = (600.0, 8.0) if size == "full" else (None, None)
    name = f"full order, {full.degrees_of_freedom} degrees of freedom, {full.steps} steps"
    return [
        Number(
            name=f"{name}: time",
            value=full.setup_time + full.wall_time,
            unit="s",
            goal=goals[0],
            accuracy=lost,
            accuracy_of="energy lost",
        ),
        Number(name=f"{name}: time per step", value=1e3 * full.wall_time / full.steps, unit="ms"),
        Number(name=f"{name}: peak memory", value=peak_gigabytes(), unit="GB", goal=goals[1]),
    ]


def impact(layers: int, options: argparse.Namespace, **solver: object) -> FullOrderResult:
    """One impact of 30 us with steps of 50 ns."""
    a, b, space = needle_over_seat(size=options.size, bulk=options.bulk, layers=layers)
    begin = time.process_time()
    result = simulate_full_order(a, b, space, speed=0.5, duration=50e-9 * options.steps, **solver)
    spent = time.process_time() - begin
    statistics, force = result.statistics, result.history.force
    print(
        f"{statistics.degrees_of_freedom:7d} unknowns, {statistics.contact_points} points "
        f"({statistics.watched:.0f} watched), {statistics.factor_entries / 1e6:.1f}M in factors, "
        f"set-up {statistics.set_up_time:.1f} s, {statistics.steps} steps "
        f"{statistics.loop_time:.1f} s, processor {spent:.1f} s | "
        f"peak {force.max():.3f} N, contact {np.count_nonzero(force > 0) * 0.05:.2f} us, "
        f"e {result.history.velocity_a[-1] / 0.5:.5f}, loss {result.energy_loss:.1e}, "
        f"ledger {result.history.ledger.residual:.0e}",
        flush=True,
    )
    return result


def main() -> None:
    """Axisymmetric, then the solid in several ways."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=float, default=25e-6, help="element size at the ring [m]")
    parser.add_argument("--bulk", type=float, default=1e-3, help="element size far away [m]")
    parser.add_argument("--layers", type=int, default=16)
    parser.add_argument("--steps", type=int, default=600)
    options = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    plane = impact(0, options)
    solid = impact(options.layers, options, threads=1)
    for solver in ({"threads": 2}, {"threads": 2, "precision": "single"}, {"scheme": "massless"}):
        print(solver)
        other = impact(options.layers, options, **solver)
        change = np.abs(other.history.force - solid.history.force).max()
        print(f"    largest change of the force {change / solid.history.force.max():.1e} of peak")
    error = solid.history.force.max() / plane.history.force.max() - 1.0
    print(f"solid against axisymmetric: peak force {error:+.2%}")
    print(f"peak memory {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6:.2f} GB")


if __name__ == "__main__":
    main()
