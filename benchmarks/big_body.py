"""Bodies of up to a million degrees of freedom: a housing with ribs, from STEP to modes and law."""

import tempfile
from pathlib import Path
from time import perf_counter, process_time

from machine import peak_gigabytes
from number import Number, Size
from reduction import largest_residual
from ribbed_housing import ribbed_housing

from klack.assembling.modes import mode_pools
from klack.assembling.problem import build_problem
from klack.assembling.reduced_pair import first_stiffness, own_pair

__all__ = ["numbers"]

_MODES = 50
# elements of the housing and of the contact [mm], ascending: the peak is that of the process
_SIZES: dict[Size, tuple[tuple[float, float], ...]] = {
    "smallest": ((4.0, 0.15),),
    "quick": ((1.5, 0.08),),
    "full": ((0.75, 0.04), (0.4, 0.04), (0.27, 0.04)),
}
_GOAL_DOFS, _GOAL_SECONDS, _GOAL_GIGABYTES = 1_000_000, 600.0, 18.0


def numbers(size: Size) -> list[Number]:
    """Time and memory of every stage on all cores, and the memory plan on the terminal."""
    return [number for mesh in _SIZES[size] for number in _measure(*mesh)]


def _measure(size: float, contact: float) -> list[Number]:
    with tempfile.TemporaryDirectory() as folder:
        case = ribbed_housing(Path(folder), size, contact)
        clock = _Clock()
        problem = build_problem(case, clock)
        pools = mode_pools(problem, at_least=_MODES, progress=clock)
        clock("law", 0.0)
        own_pair(problem, pools, stiffness=first_stiffness(problem))
        clock("", 0.0)
    bodies = (problem.pair.upper, problem.pair.lower)
    dofs = sum(body.dof_count for body in bodies)
    residual = max(largest_residual(body, pools[body.name]) for body in bodies)
    problem.close()
    large = dofs >= _GOAL_DOFS
    name = f"housing with ribs, {dofs} degrees of freedom"
    wall, busy = (sum(times) for times in zip(*clock.stages.values(), strict=True))
    found = [
        Number(
            name=f"{name}: time",
            value=wall,
            unit="s",
            goal=_GOAL_SECONDS if large else None,
            accuracy=residual,
            accuracy_of="of modes, K x - omega^2 M x over K x",
            series="time of a big body",
            at=dofs,
        ),
        Number(name=f"{name}: processor time", value=busy, unit="s"),
        Number(
            name=f"{name}: peak memory",
            value=peak_gigabytes(),
            unit="GB",
            goal=_GOAL_GIGABYTES if large else None,
            series="peak memory of a big body",
            at=dofs,
        ),
    ]
    return found + [
        Number(name=f"{name}: {stage}, processor time", value=times[1], unit="s")
        for stage, times in clock.stages.items()
    ]


class _Clock:
    """Reporter that measures stages, and prints the memory plan."""

    def __init__(self) -> None:
        self.stages: dict[str, tuple[float, float]] = {}
        self._stage, self._since = "", (perf_counter(), process_time())

    def __call__(self, stage: str, fraction: float) -> None:
        if stage == self._stage:
            return
        now, since = (perf_counter(), process_time()), self._since
        if self._stage:
            before = self.stages.get(self._stage, (0.0, 0.0))
            wall, busy = (b + n - s for b, n, s in zip(before, now, since, strict=True))
            self.stages[self._stage] = (wall, busy)
        self._stage, self._since = stage, now

    def remark(self, line: str) -> None:
        """Print a line of the memory plan."""
        print(line, flush=True)
