"""Run drawn networks of valves: how many run, and how well their energy balances.

The programs that draw them are ``random_supplies.py`` and ``random_lines.py``.  A run that stops
must say why: one of klack's own errors counts as told, anything else as failed.
"""

import argparse
import sys
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

from klack.case.any_case import read_valve_case
from klack.errors import KlackError
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network

__all__ = ["run", "run_draws"]


def run(text: str) -> NetworkResult:
    """Run one draw."""
    case = read_valve_case(text, Path("draw.yaml"))
    return simulate_network(
        case.network.network().rows(),
        duration=case.run.duration,
        step=case.run.step,
        record=case.run.record,
    )


def run_draws(draw: Callable[[int], str], *, about: str | None, count: int) -> int:
    """Run draws, and print what failed and the largest residual; options are of the command line.

    Parameters
    ----------
    draw : callable
        Text of the case of a draw, by its number.
    about : str
        What the program does.
    count : int
        Of draws, if the command line does not say.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--count", type=int, default=count)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int)
    chosen = parser.parse_args()
    warnings.simplefilter("ignore")
    seeds = range(chosen.seed, chosen.seed + chosen.count)
    if chosen.only is not None:
        sys.stdout.write(draw(chosen.only) + "\n")
        seeds = range(chosen.only, chosen.only + 1)
    worst, least, told, failed = 0.0, 0.0, 0, 0
    for seed in seeds:
        try:
            result = run(draw(seed))
        except KlackError as error:
            told += 1
            sys.stdout.write(f"{seed}: {' '.join(str(error).split())[:300]}\n")
        except Exception:
            failed += 1
            sys.stdout.write(f"{seed}: {traceback.format_exc()}\n")
        else:
            residual, loss = result.books.relative_residual, result.books.least_loss
            worst = max(worst, residual)
            least = min(least, loss / (result.books.scale or 1.0))
            if not (residual <= 1e-9 and loss >= -1e-9 * result.books.scale):
                sys.stdout.write(f"{seed}: energy residual {residual:.2e}, loss {loss:.2e} J\n")
    drawn = len(seeds)
    sys.stdout.write(
        f"{drawn - told - failed} of {drawn} ran, {told} stopped with an error, {failed} failed; "
        f"largest energy residual {worst:.2e}, least loss {least:.2e}\n"
    )
    return int(failed > 0)
