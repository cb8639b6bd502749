"""CalculiX beside the full order: ``python benchmarks/calculix.py --folder FOLDER``.

Runs ccx on the deck of a case for every step and penalty asked for, the full order of klack on the
same mesh for every step, and prints both convergences, the energy balances, and the times.  Runs of
ccx that are finished in the folder are read instead.  Processor times (one thread each) are what to
compare on a shared machine.  As a part of ``run.py`` there is one run of each, with the energy kept
equally well by both.
"""

import argparse
import json
import resource
import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter, process_time

from number import Number, Size
from solid_valve import coarse_witness

from klack.acoustics.comparison import compare_histories
from klack.analyses.comparison.calculix import energy_balance
from klack.assembling.problem import ContactProblem, build_problem
from klack.case import find_case, load_case
from klack.case.schema import Case
from klack.contact.history import ImpactHistory
from klack.contact.restitution import measure_impact
from klack.exchange.calculix_case import calculix_impact, calculix_settings
from klack.exchange.calculix_deck import CalculixImpact, write_deck
from klack.exchange.calculix_result import other_run, read_calculix
from klack.exchange.calculix_run import run_calculix
from klack.transient.full_order import simulate_full_order

_PENALTY = 1e18  # [N/m^3]
_STEPS: dict[Size, tuple[float, float]] = {  # of CalculiX and of klack [s]
    "smallest": (400e-9, 100e-9),
    "quick": (200e-9, 50e-9),
    "full": (100e-9, 25e-9),
}


def numbers(size: Size) -> list[Number]:
    """Processor times of both on the witness, and their ratio; nothing without ``ccx``."""
    if shutil.which("ccx") is None:
        return []
    theirs, ours = _STEPS[size]
    case = load_case(find_case("witness")) if size == "full" else coarse_witness()
    used = process_time()
    problem = build_problem(case, lambda stage, fraction: None, threads=1)
    problem.close()
    used = process_time() - used
    own = run_klack(case, problem, ours)
    impact = calculix_impact(case, lambda stage, fraction: None)
    with tempfile.TemporaryDirectory() as folder:
        other = run_witness(case, impact, own.history, Path(folder), theirs, _PENALTY)
    apart = compare_histories(own.history, other.history).history_l2
    dofs = len(problem.pair.upper.free) + len(problem.pair.lower.free)
    label = f"witness of {dofs} dof"
    found = [
        Number(
            name=f"{label}: {row.program} at {row.step_ns:g} ns, processor time",
            value=row.processor_s,
            unit="s",
            accuracy=row.energy_swing,
            accuracy_of="energy at any time",
        )
        for row in (other, own)
    ]
    return [
        *found,
        Number(
            name=f"{label}: matrices and static contact of klack, processor time",
            value=used,
            unit="s",
        ),
        Number(
            name="CalculiX over klack: impact of the witness",
            value=other.processor_s / own.processor_s,
            unit="-",
            goal=20.0 if size == "full" else None,
            at_least=True,
            accuracy=apart,
            accuracy_of="force histories apart",
            series="ratio",
        ),
        Number(
            name="CalculiX over klack: with matrices and static contact",
            value=other.processor_s / (own.processor_s + used),
            unit="-",
            series="ratio",
        ),
    ]


@dataclass(frozen=True)
class Row:
    """One run of either program."""

    program: str
    step_ns: float
    penalty_MPa_per_mm: float | None
    history: ImpactHistory
    energy_balance: float
    energy_swing: float
    iterations: int
    wall_s: float
    processor_s: float

    def entry(self, reference: ImpactHistory) -> dict[str, float | int | str | None]:
        """As table and JSON hold it, with the deviation from a reference run."""
        measures, off = measure_impact(self.history), compare_histories(reference, self.history)
        out = {key: value for key, value in asdict(self).items() if key != "history"}
        return out | {
            "peak_force_N": measures.peak_force,
            "contact_time_us": 1e6 * measures.contact_time,
            "restitution": measures.restitution,
            "peak_off": off.peak_force,
            "contact_time_off": off.contact_time,
            "restitution_off": off.restitution,
            "history_l2": off.history_l2,
        }


def run_witness(
    case: Case,
    impact: CalculixImpact,
    reference: ImpactHistory,
    folder: Path,
    step: float,
    penalty: float,
) -> Row:
    """One run of ccx, or what an earlier one left."""
    name = f"{case.name}-{step * 1e9:g}ns-{penalty * 1e-9:.0e}"
    data, times = folder / f"{name}.dat", folder / f"{name}.times"
    if not times.exists():
        settings = calculix_settings(case, impact, step=step, penalty=penalty)
        write_deck(impact, settings, folder / f"{name}.inp")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        run = run_calculix(folder / f"{name}.inp", duration=settings.duration, progress=_say(name))
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        times.write_text(json.dumps([run.wall_time, used]))
    wall, used = json.loads(times.read_text())
    other = other_run(read_calculix(data), reference)
    return Row(
        "CalculiX",
        1e9 * step,
        1e-9 * penalty,
        other.history,
        energy_balance(other.history.ledger) or 0.0,
        other.energy_swing or 0.0,
        other.iterations or 0,
        wall,
        used,
    )


def run_klack(case: Case, problem: ContactProblem, step: float) -> Row:
    """One run of the full order on one thread, set-up included."""
    wall, used = perf_counter(), process_time()
    result = simulate_full_order(
        problem.pair.upper,
        problem.pair.lower,
        problem.space,
        speed=case.motion.speed,
        duration=case.run.duration,
        step=step,
        axial_force=-case.motion.closing_force,
        threads=1,
    )
    wall, used = perf_counter() - wall, process_time() - used
    energy = result.energy
    balance = energy.total - energy.total[0] - energy.work
    return Row(
        "klack",
        1e9 * step,
        None,
        result.history,
        float(balance[-1] / energy.total[0]),
        float(abs(balance).max() / energy.total[0]),
        result.statistics.steps,
        wall,
        used,
    )


def _say(name: str) -> Callable[[float], None]:
    return lambda done: print(f"\r  {name} {100 * done:4.0f} %", end="", file=sys.stderr)


def print_rows(title: str, rows: list[Row], reference: ImpactHistory) -> None:
    """One line per run; deviations from the reference."""
    print(f"\n{title}")
    print(
        f"{'step':>7}{'MPa/mm':>9}{'peak N':>9}{'us':>8}{'e':>8}{'balance':>10}{'swing':>9}"
        f"{'L2':>8}{'peak':>8}{'time':>8}{'its':>6}{'wall s':>8}{'proc s':>8}"
    )
    for row in rows:
        e = row.entry(reference)
        penalty = "" if row.penalty_MPa_per_mm is None else f"{row.penalty_MPa_per_mm:.0e}"
        print(
            f"{row.step_ns:>7g}{penalty:>9}{e['peak_force_N']:>9.3f}{e['contact_time_us']:>8.3f}"
            f"{e['restitution']:>8.4f}{row.energy_balance:>10.1e}{row.energy_swing:>9.1e}"
            f"{e['history_l2']:>8.2%}{e['peak_off']:>8.2%}{e['contact_time_off']:>8.2%}"
            f"{row.iterations:>6}{row.wall_s:>8.1f}{row.processor_s:>8.1f}"
        )


def main() -> None:
    """Convergence of both, and the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--case", default="witness", help="case file or shipped case")
    parser.add_argument("--steps", default="200,100,50", help="of CalculiX [ns]")
    parser.add_argument("--penalties", default="1e8,1e9,1e10", help="of CalculiX [MPa/mm]")
    parser.add_argument("--klack-steps", default="100,50,25,12.5", help="of the full order [ns]")
    parser.add_argument("--folder", type=Path, required=True, help="for decks and results")
    parser.add_argument("--json", type=Path, help="write all rows")
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    case = load_case(find_case(args.case))
    used = process_time()
    problem = build_problem(case, lambda stage, fraction: None, threads=1)
    problem.close()
    used = process_time() - used
    dofs = len(problem.pair.upper.free) + len(problem.pair.lower.free)
    print(f"{case.name}: {dofs} degrees of freedom, {problem.space.count} contact points")
    print(f"meshes, matrices and static contact of klack: {used:.1f} s of processor time")
    own = [run_klack(case, problem, 1e-9 * float(t)) for t in args.klack_steps.split(",")]
    impact = calculix_impact(case, lambda stage, fraction: None)
    rows = [
        run_witness(
            case, impact, own[-1].history, args.folder, 1e-9 * float(step), 1e9 * float(penalty)
        )
        for penalty in args.penalties.split(",")
        for step in args.steps.split(",")
    ]
    print("", file=sys.stderr)
    finest = rows[-1].history
    print_rows("CalculiX; deviations from its last row", rows, finest)
    print_rows("klack; deviations from the last row of CalculiX", own, finest)
    if args.json is not None:
        entries = [row.entry(finest) for row in (*rows, *own)]
        args.json.write_text(json.dumps(entries, indent=1) + "\n")


if __name__ == "__main__":
    main()
