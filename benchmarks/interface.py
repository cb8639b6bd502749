"""The interface level against the full order: ``python benchmarks/interface.py``.

The solid demo valve, centred, 1 um off axis, leaning by 0.05 degrees, and both.  Full order and
interface level share the meshes of each placement.  The last columns take one interface model, that
of the centred meshes, with the exact gaps of the placement: what ``klack shots`` does.
"""

import argparse
import os
from math import radians
from time import perf_counter

import numpy as np

from klack.acoustics.comparison import compare_histories
from klack.analyses.impact.full_level import run_full
from klack.analyses.impact.interface_level import (
    build_interface,
    exact_gaps,
    simulate_case,
)
from klack.assembling.modes import kept_modes, mode_pools
from klack.assembling.problem import build_problem
from klack.case import load_case, shipped_cases
from klack.case.guide import Placement
from klack.case.schema import Case
from klack.contact.gap_update import PlacedGaps
from klack.contact.history import ImpactHistory
from klack.machine.progress import silent
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_run import simulate_interface

_PLACEMENTS = {
    "centred": Placement(),
    "1 um off axis": Placement(eccentricity=1e-6),
    "leaning 0.05 deg": Placement(tilt=radians(0.05)),
    "both": Placement(eccentricity=1e-6, tilt=radians(0.05)),
}
_SPARE_REACH = 12e-6  # of the model that serves all placements [m]


def placed(placement: Placement) -> Case:
    """Return the solid demo valve with this placement."""
    case = load_case(shipped_cases()["demo-valve"])
    motion = case.motion.model_copy(update={"placement": placement})
    return case.model_copy(update={"motion": motion})


def line(name: str, reference: ImpactHistory, history: ImpactHistory, seconds: float) -> None:
    """Print the deviation of one run."""
    d = compare_histories(reference, history)
    print(
        f"    {name:34s} peak {d.peak_force:+.3%}, contact time {d.contact_time:+.3%}, "
        f"impulse {d.impulse:+.4%}, restitution {d.restitution:+.5f}, history {d.history_l2:.3%} "
        f"| {seconds:.2f} s",
        flush=True,
    )


def shared_model() -> tuple[InterfaceModel, PlacedGaps, float]:
    """Model of the centred meshes, its gaps at any placement, and the height of first touch."""
    case = placed(Placement())
    contact = case.contact.model_copy(update={"reach": _SPARE_REACH})
    case = case.model_copy(update={"contact": contact})
    problem = build_problem(case, silent)
    pools = mode_pools(problem, at_least=1, progress=silent)
    model, gaps = build_interface(problem, pools), exact_gaps(problem)
    touch = float(problem.space.points[np.argmin(problem.space.gap), 2])
    problem.close()
    return model, gaps, touch


def main() -> None:
    """Every placement, by three ways."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, default=2)
    options = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    shared, gaps, touch = shared_model()
    for name, placement in _PLACEMENTS.items():
        case = placed(placement)
        problem = build_problem(case, silent)
        pools = mode_pools(problem, at_least=1, progress=silent)
        begin = perf_counter()
        model = build_interface(problem, pools)
        built = perf_counter() - begin
        kept = kept_modes(problem, pools)
        full, result = run_full(problem, pools, kept=kept, progress=silent, threads=options.threads)
        print(
            f"{name}: full order {full.measures.peak_force:.2f} N, "
            f"{1e6 * full.measures.contact_time:.2f} us, restitution "
            f"{full.measures.restitution:.4f}, loss {result.energy_loss:.1e} | "
            f"{full.wall_time:.1f} s"
        )
        simulate_case(case, model)
        run = simulate_case(case, model)
        words = f"interface, {model.count} points"
        line(words, full.history, run.history, run.wall_time)
        print(
            f"        built in {built:.2f} s, {run.rounds_per_step:.2f} active sets per step, "
            f"energy residual {run.energy.residual:.0e}"
        )
        arm = float(shared.centre[2]) - touch
        shift = placement.eccentricity + np.sin(placement.tilt) * arm
        offset = np.array([shift, 0.0, 0.0, 0.0, placement.tilt, 0.0])
        run = simulate_interface(
            shared,
            speed=case.motion.speed,
            duration=case.run.duration,
            offset=offset,
            height=0.0,
            gaps=gaps,
        )
        line("centred model, exact gaps", full.history, run.history, run.wall_time)
        problem.close()


if __name__ == "__main__":
    main()
