"""The numbers that klack promises, measured: ``uv run python benchmarks/run.py --json FILE``.

``--quick`` leaves out what takes more than some minutes: the full order with 250 000 degrees of
freedom, the reduction of 150 000, and the three-dimensional demo valve in its variants.
"""

import argparse
import json
import resource
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from kernel import error_at_20_ns, kernel_ns_per_step

from klack.case import load_case, shipped_cases
from klack.case.schema import Case
from klack.contact.restitution import Deviation
from klack.workflow.impact import run_impact
from klack.workflow.study import ImpactStudy

LEVELS = ("reduced-none", "reduced-attachment", "reduced-participation", "reduced", "full")


@dataclass(frozen=True)
class Row:
    """One measured number."""

    name: str
    value: float
    unit: str
    goal: float | None = None

    def entry(self) -> dict[str, float | str | None]:
        """As the JSON holds it."""
        return {"value": self.value, "unit": self.unit, "goal": self.goal}


def kernel_rows() -> list[Row]:
    """Speed and accuracy of the reduced time integration."""
    errors = error_at_20_ns()
    return [
        Row("kernel_ns_per_step", kernel_ns_per_step(), "ns", 50.0),
        Row("kernel_ns_per_step_in_contact", kernel_ns_per_step(closed=True), "ns"),
        Row("kernel_error_at_20_ns", abs(errors["peak force"]), "of the peak force", 1e-3),
        Row("kernel_energy_residual", abs(errors["energy residual"]), "-", 1e-9),
    ]


def deviation_rows(name: str, deviation: Deviation, *, history_goal: float | None) -> list[Row]:
    """Reduced against full order; goals only where they are promised."""
    promised = history_goal is not None
    goals = (0.005, 0.01, 0.005, 0.002, history_goal, 1.0)
    fields = ("peak_force", "contact_time", "impulse", "restitution", "history_l2")
    units = ("-", "-", "-", "absolute", "of the peak force", "dB")
    return [
        Row(
            f"{name}_{field}",
            abs(float(getattr(deviation, field))),
            unit,
            goal if promised else None,
        )
        for field, unit, goal in zip((*fields, "third_octave_max_dB"), units, goals, strict=True)
    ]


def case_rows(name: str, *, history_goal: float) -> tuple[list[Row], ImpactStudy]:
    """One shipped case at all levels."""
    case = load_case(shipped_cases()[name])
    study = run_impact(case, levels=LEVELS, progress=_say)
    key = name.replace("-", "_")
    rows = [
        Row(f"{key}_energy_residual", abs(study.levels["reduced"].energy_residual), "-", 1e-9),
        Row(f"{key}_full_energy_loss", _loss(study), "-", 1e-3),
    ]
    for level, deviation in study.deviations.items():
        goal = history_goal if level == "reduced" else None
        rows += deviation_rows(f"{key}_{level.replace('-', '_')}", deviation, history_goal=goal)
    return rows, study


def _loss(study: ImpactStudy) -> float:
    ledger = study.levels["full"].history.ledger
    return ledger.contact_dissipation / ledger.initial


def whole_rim(case: Case) -> Case:
    """The same case with every support closed round the circumference."""
    bodies = {}
    for name, body in case.bodies.items():
        fixed = body.fixed and tuple(s.model_copy(update={"sectors": None}) for s in body.fixed)
        bodies[name] = body.model_copy(update={"fixed": fixed})
    return case.model_copy(update={"bodies": bodies})


def axisymmetric_twin(case: Case) -> Case:
    """The same meridian meshes as axisymmetric bodies."""
    bodies = {}
    for name, body in case.bodies.items():
        geometry = body.geometry.model_copy(update={"model": "axisymmetric", "layers": None})
        bodies[name] = body.model_copy(update={"geometry": geometry})
    return case.model_copy(update={"bodies": bodies})


def solid_against_axisymmetric() -> list[Row]:
    """Full order of one valve, three-dimensional and axisymmetric, held all round."""
    from klack.acoustics.comparison import compare_histories

    solid = whole_rim(load_case(shipped_cases()["demo-valve"]))
    twin = axisymmetric_twin(solid)
    runs = [run_impact(case, levels=("full",), progress=_say) for case in (twin, solid)]
    deviation = compare_histories(*(run.levels["full"].history for run in runs))
    goals = {"peak_force": 0.005, "contact_time": 0.01, "restitution": 0.003, "history_l2": None}
    return [
        Row(f"solid_against_axisymmetric_{field}", abs(getattr(deviation, field)), "-", goal)
        for field, goal in goals.items()
    ]


def finer(case: Case, scale: float, layers: int) -> Case:
    """The same case with smaller elements everywhere but at the contact."""
    bodies = {}
    for name, body in case.bodies.items():
        mesh = body.mesh and body.mesh.model_copy(update={"size": body.mesh.size * scale})
        geometry = body.geometry.model_copy(update={"layers": layers})
        bodies[name] = body.model_copy(update={"mesh": mesh, "geometry": geometry})
    return case.model_copy(update={"bodies": bodies})


def reduction_rows() -> list[Row]:
    """Reduction of 150 000 degrees of freedom to 50 modes each, with the local law."""
    from klack.workflow.levels import first_stiffness, mode_pools, own_pair
    from klack.workflow.problem import build_problem

    case = finer(load_case(shipped_cases()["demo-valve"]), 0.55, 28)
    begin = perf_counter()
    problem = build_problem(case, _say)
    pools = mode_pools(problem, at_least=50, progress=_say)
    own_pair(problem, pools, stiffness=first_stiffness(problem))
    seconds = perf_counter() - begin
    problem.close()
    dofs = problem.pair.upper.dof_count + problem.pair.lower.dof_count
    return [
        Row("reduction_degrees_of_freedom", dofs, "-"),
        Row("reduction_seconds", seconds, "s", 60.0),
        Row("reduction_peak_memory", _peak_memory(), "GB", 3.0),
    ]


def large_full_order_rows() -> list[Row]:
    """Full order with 250 000 degrees of freedom and 1000 steps."""
    case = finer(load_case(shipped_cases()["demo-valve"]), 0.45, 40)
    run = case.run.model_copy(update={"duration": 1000 * case.run.full_step})
    study = run_impact(case.model_copy(update={"run": run}), levels=("full",), progress=_say)
    full = study.levels["full"]
    return [
        Row("large_full_order_degrees_of_freedom", full.degrees_of_freedom, "-"),
        Row("large_full_order_steps", full.steps, "-"),
        Row("large_full_order_seconds", full.setup_time + full.wall_time, "s", 600.0),
        Row("large_full_order_peak_memory", _peak_memory(), "GB", 8.0),
    ]


def _peak_memory() -> float:
    """Largest resident size of this process so far [GB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9


def _say(stage: str, fraction: float) -> None:
    print(f"\r  {stage:<24}{100 * fraction:4.0f} %", end="", file=sys.stderr, flush=True)


def quick() -> list[Row]:
    """Everything within some minutes."""
    rows = kernel_rows()
    rows += case_rows("demo-valve-axisymmetric", history_goal=0.015)[0]
    rows += case_rows("sphere-on-rod", history_goal=0.015)[0]
    return rows


# What needs its own process, since the peak memory of a process never falls again.
SLOW: dict[str, Callable[[], list[Row]]] = {
    "reduction": reduction_rows,
    "demo-valve": lambda: case_rows("demo-valve", history_goal=0.01)[0],
    "solid-against-axisymmetric": solid_against_axisymmetric,
    "large-full-order": large_full_order_rows,
}


def main() -> None:
    """Measure, print a table, write the JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="leave out the long ones")
    parser.add_argument("--only", choices=("quick", *SLOW), help="one part alone")
    parser.add_argument("--json", type=Path, help="write {name: {value, unit, goal}}")
    args = parser.parse_args()
    if args.only is not None and args.only != "quick":
        rows = SLOW[args.only]()
    else:
        rows = quick()
        if not args.quick and args.only is None:
            rows += [row for name in SLOW for row in _in_own_process(name)]
    print("", file=sys.stderr)
    for row in rows:
        goal = "" if row.goal is None else f"goal {row.goal:g}"
        verdict = "" if row.goal is None else ("ok" if row.value <= row.goal else "MISSED")
        print(f"{row.name:<62}{row.value:>12.4g} {row.unit:<20}{goal:<14}{verdict}")
    if args.json is not None:
        args.json.write_text(json.dumps({row.name: row.entry() for row in rows}, indent=1) + "\n")


def _in_own_process(name: str) -> list[Row]:
    import subprocess
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "rows.json"
        command = [sys.executable, __file__, "--only", name, "--json", str(target)]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return [Row(key, **entry) for key, entry in json.loads(target.read_text()).items()]


if __name__ == "__main__":
    main()
