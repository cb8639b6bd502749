"""Derivatives of strokes with every number of a case, against differences of strokes.

``uv run --group dev python benchmarks/derivatives.py CASE...`` goes over all numbers of the
network of each case (of all shipped ones by default).  It compares what every channel does up to
the first touch, at fixed steps, with strokes that have the number changed by 1e-2, 1e-3 and 1e-5,
and lists what deviates, and what has no derivative, with the reason.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.analyses.sensitivities.parameters import VariedKey, slope_space
from klack.analyses.sensitivities.slopes import SlopeRunner
from klack.case.any_case import CaseTree, read_case_tree
from klack.case.key_path import quantity_at
from klack.case.reader import find_case, shipped_cases
from klack.case.valve import ValveCase
from klack.errors import KlackError
from klack.input.problem import CaseProblem, Key
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.simulation.tangent_run import DIRECTIONS, TangentRun, run_tangents

__all__ = ["Compared", "compared", "main"]

HOW_TO = Path(__file__).parents[1] / "docs" / "how-to"

_CHANGES = (1e-3, 1e-5, 1e-2)
"""Of a number; the best one counts.  Small ones show the saw-tooth of a controller that switches
at the ends of steps, large ones the bend of a law."""
_NOISE = 1e-12  # of the largest value of a unit: how well differences of two runs are known
_LEAST = {"m": 1e-5, "m/s": 1e-2, "N": 1.0, "Pa": 1e5, "m^2": 1e-7}
"""Of channels that are all zero, their size, by the unit."""
_SHARE = 1e-6  # of the largest value: what a number changed by its whole size has to change
_AT_START = ("m", "m/s")  # what else is recorded first is of the moment, no mean
_MOVED = 1e-13  # [s] for a number changed by its whole size: where steps stretch towards a touch
_HOLDS = 1e-2  # deviation that is listed


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """A number of a case, and how well its derivatives agree with differences.

    Parameters
    ----------
    key : str
    refused : str
        Why it has no derivative; empty if it has.
    deviation : float
        Root mean square over time, over that of the change; of the channel that deviates most.
    channel : str
    time : float [s]
        At which it deviates most,
    by_tangents, by_runs : float
        and its change there, for the number changed by its whole size.
    """

    key: str
    refused: str = ""
    deviation: float = 0.0
    channel: str = ""
    time: float = 0.0
    by_tangents: float = 0.0
    by_runs: float = 0.0


def compared(
    path: str | Path,
    *,
    duration: float = 1e-3,
    only: str = "",
    variant: str | None = None,
    enough: float = 0.0,
) -> Iterator[Compared]:
    """Compare all numbers of the network of a case, or those with ``only`` in their path.

    A number whose channels all deviate by less than ``enough`` is not changed any further.
    """
    tree = read_case_tree(find_case(str(path)), [])
    case = tree.any_case()
    if not isinstance(case, ValveCase):
        return
    kept = []
    for key in _numbers(case):
        if only not in key:
            continue
        try:
            slope_space(case, None, [key])
            kept.append(key)
        except KlackError as error:
            yield Compared(key=key, refused=_reason(error))
    for first in range(0, len(kept), DIRECTIONS):
        keys = kept[first : first + DIRECTIONS]
        yield from _together(case, tree, keys, duration, variant, enough)


def _together(
    case: ValveCase,
    tree: CaseTree,
    keys: Sequence[str],
    duration: float,
    variant: str | None,
    enough: float,
) -> Iterator[Compared]:
    """Numbers that one run carries; each alone where one of them is refused."""
    name = case.one_variant(variant)
    run = case.run
    given = {
        "duration": min(run.duration, duration),
        "accuracy": run.accuracy,
        "step": run.step,
        "coarse": run.coarse,
        "record": run.record,
    }
    try:
        space = slope_space(case, None, keys)
        runner = SlopeRunner(case, tree, space, name, lambda *_: None, None)
        directions = [runner._direction(item) for item in space.varied]
        found = run_tangents(runner.rows({}), directions, **given)
        for k, item in enumerate(space.varied):
            ends: list[list[NetworkResult]] = []
            for share in _CHANGES:
                changes = ({item.name: way * share * item.size} for way in (1.0, -1.0))
                ends.append([simulate_network(runner.rows(one), **given) for one in changes])
                worst = _worst(found, k, item, ends)
                if worst.deviation < enough:
                    break
            yield worst
    except KlackError as error:
        if len(keys) == 1:
            yield Compared(key=keys[0], refused=_reason(error))
            return
        for key in keys:
            yield from _together(case, tree, [key], duration, variant, enough)


def _worst(
    run: TangentRun, k: int, item: VariedKey, ends: Sequence[Sequence[NetworkResult]]
) -> Compared:
    """The channel that deviates most, before the steps begin to stretch."""
    (rates, late), base = run.rates(k), run.moved(k, 0.0)
    count = min(len(end.time) for pair in ends for end in pair)
    touch = run.touches[0].time if run.touches else np.inf
    moves = np.abs(late[:: run.looks][:count]) * item.size > _MOVED
    fixed = np.flatnonzero(~moves & (base.time[:count] < touch))
    fixed = fixed[fixed == np.arange(fixed.size)]
    largest = _largest(base)
    found = [Compared(key=item.name)]
    for name, channel in rates.channels.items():
        at = fixed if channel.unit in _AT_START else fixed[1:]
        # what is repaid to macro steps is round-off of their forces
        if name not in ends[0][0].channels or not at.size or name.endswith("repaid impulse"):
            continue
        size = max(largest[channel.unit], _LEAST.get(channel.unit, 0.0), 1e-30)
        pairs = zip(_CHANGES, ends, strict=False)
        of_shares = [
            _deviation(
                (channel.values * item.size)[at],
                (plus.channels[name].values - minus.channels[name].values)[at] / (2.0 * share),
                max(_SHARE, _NOISE / share / _HOLDS) * size,
            )
            for share, (plus, minus) in pairs
        ]
        deviation, j, by_tangents, by_runs = min(of_shares)
        time = float(base.time[at[j]])
        found.append(
            Compared(
                key=item.name,
                deviation=deviation,
                channel=name,
                time=time,
                by_tangents=by_tangents,
                by_runs=by_runs,
            )
        )
    return max(found, key=lambda one: one.deviation)


def _deviation(
    by_tangents: NDArray[np.float64], by_runs: NDArray[np.float64], least: float
) -> tuple[float, int, float, float]:
    """Relative deviation over all times, and where it is largest."""
    missed = by_runs - by_tangents
    j = int(np.argmax(np.abs(missed)))
    scale = max(_rms(by_runs), _rms(by_tangents), least)
    return _rms(missed) / scale, j, float(by_tangents[j]), float(by_runs[j])


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _largest(result: NetworkResult) -> dict[str, float]:
    found: dict[str, float] = {}
    for channel in result.channels.values():
        found[channel.unit] = max(
            found.get(channel.unit, 0.0), float(np.max(np.abs(channel.values)))
        )
    return found


def _numbers(case: ValveCase) -> Iterator[str]:
    """Paths of all numbers of the network and of all parameters, but for those of zero."""
    for place in _places(case, ("network",)), _places(case, ("parameters",)):
        for key in place:
            try:
                value = quantity_at(case, key).value
            except CaseProblem:
                continue
            if value != 0.0 and np.isfinite(value):
                yield ".".join(map(str, key))


def _places(case: ValveCase, key: Key) -> Iterator[Key]:
    """Places of everything below a key that has nothing below."""
    from klack.case.key_path import _below, node_at

    _, below = _below(node_at(case, key)[0])
    for part in below:
        yield from _places(case, (*key, part))
    if not below:
        yield key


def _reason(error: KlackError) -> str:
    return str(error).splitlines()[0]


def main() -> None:
    """Compare and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*")
    parser.add_argument("--duration", type=float, default=1e-3, help="[s]")
    parser.add_argument("--only", default="", help="part of the path of a key")
    parser.add_argument("--all", action="store_true", help="list what agrees as well")
    asked = parser.parse_args()
    for path in asked.cases or [*shipped_cases(), *sorted(map(str, HOW_TO.glob("*.yaml")))]:
        try:
            found = list(compared(path, duration=asked.duration, only=asked.only))
        except KlackError as error:
            print(f"{path}: {_reason(error)}", flush=True)
            continue
        agreed = [item for item in found if not item.refused and item.deviation <= _HOLDS]
        worst = max((item.deviation for item in agreed), default=0.0)
        print(f"{path}: {len(agreed)} of {len(found)} numbers agree, to {worst:.1e}", flush=True)
        for item in found:
            if item.refused:
                print(f"  {item.key}: {item.refused}", flush=True)
            elif asked.all or item.deviation > _HOLDS:
                print(
                    f"  {item.key}: {item.deviation:.1e}, {item.channel} at {item.time:.6g} s: "
                    f"{item.by_tangents:.4g} by tangents, {item.by_runs:.4g} by runs",
                    flush=True,
                )


if __name__ == "__main__":
    main()
