"""Growth with degrees of freedom: what each stage of the solid valve costs on four meshes."""

from dataclasses import dataclass
from time import process_time

from machine import peak_gigabytes
from number import Number, Size, exponent
from solid_valve import solid_valve
from threadpoolctl import threadpool_limits

from klack.assembling.bodies import assemble_body, build_bodies
from klack.assembling.candidates import Candidates
from klack.assembling.ladder import closing_force, impact_energy, static_ladder
from klack.assembling.modes import mode_pool
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.selection import ByCount
from klack.case.schema import Case
from klack.machine.progress import silent
from klack.transient.full_order import simulate_full_order

__all__ = ["numbers"]

# scale of the elements, layers, scale of the elements at the contact
_MESHES: dict[Size, tuple[tuple[float, int, float], ...]] = {
    "smallest": ((3.0, 6, 4.0), (2.0, 8, 4.0)),
    "quick": ((3.0, 6, 4.0), (2.0, 9, 3.0), (2.0, 9, 1.5), (1.5, 11, 1.0)),
    "full": ((2.0, 6, 1.0), (1.2, 12, 1.0), (1.0, 18, 1.0), (0.55, 28, 1.0)),
}
_GOAL_DOFS, _GOAL = 133_000, 3.0  # [s] of assembly
_MODES = 20
_STEPS = 50


@dataclass(frozen=True, kw_only=True)
class _Costs:
    """Processor seconds of both bodies, and gigabytes."""

    dofs: int
    stages: dict[str, float]
    memory: float


def numbers(size: Size) -> list[Number]:
    """Processor time of every stage on one thread, its exponent, and the peak memory.

    Each mesh holds both bodies.  Modes are 20 of each body; the step of the full order is the mean
    of 50.
    """
    # the limit also holds the products of numpy and scipy to one thread
    with threadpool_limits(limits=1):
        _measure(_valve(4.0, 6, 8.0))  # compiled and loaded before the clock starts
        measured = [_measure(_valve(*mesh)) for mesh in _MESHES[size]]
    dofs = [float(costs.dofs) for costs in measured]
    found = []
    for stage in measured[0].stages:
        times = [costs.stages[stage] for costs in measured]
        found += [
            Number(
                name=f"{stage}, mesh {k + 1} of {len(measured)} ({dof:.0f} dof)",
                value=seconds,
                unit="s",
                series=stage,
                at=dof,
            )
            for k, (dof, seconds) in enumerate(zip(dofs, times, strict=True))
        ]
        slope = exponent(dofs, times)
        found.append(
            Number(name=f"{stage}, exponent over degrees of freedom", value=slope, unit="-")
        )
        if stage == "assembly":
            scaled = times[-1] * _GOAL_DOFS / dofs[-1]
            name = f"assembly at {_GOAL_DOFS} degrees of freedom, scaled from the largest mesh"
            found.append(Number(name=name, value=scaled, unit="s", goal=_GOAL))
    found += [
        Number(
            name=f"peak memory up to mesh {k + 1} of {len(measured)}",
            value=costs.memory,
            unit="GB",
            series="peak memory",
            at=costs.dofs,
        )
        for k, costs in enumerate(measured)
    ]
    return found


def _valve(scale: float, layers: int, contact: float) -> Case:
    return solid_valve(scale, layers, contact=contact)


def _measure(case: Case) -> _Costs:
    """Costs of one mesh; the stages follow one another as in a run of the case."""
    clock = _Clock()
    pair = build_bodies(case, silent)
    clock.stop("meshes and assembly")
    bodies = (pair.upper, pair.lower)
    for body in bodies:
        assemble_body(case, body.name, body.mesh)
    clock.stop("assembly")
    factors = [Flexibility(body, threads=1) for body in bodies]
    clock.stop("factorisation")
    static, _ = static_ladder(
        Candidates(pair, *factors),
        energy=impact_energy(case, pair),
        closing=closing_force(case),
        reach=case.contact.reach,
        progress=silent,
    )
    clock.stop("static contact")
    for body, factor in zip(bodies, factors, strict=True):
        mode_pool(ByCount(_MODES), body, factor)
    clock.stop("modes")
    for factor in factors:
        factor.close()
    step = case.run.full_step
    run = simulate_full_order(
        *bodies, static.space, speed=case.motion.speed, duration=_STEPS * step, step=step, threads=1
    )
    # one thread: wall-clock of the loop is its processor time but for what others take away
    share = run.statistics.loop_time / (run.statistics.set_up_time + run.statistics.loop_time)
    spent = clock.stop("full order, 50 steps with its factors")
    clock.stages["full order, one step"] = spent * share / run.statistics.steps
    return _Costs(
        dofs=sum(body.dof_count for body in bodies), stages=clock.stages, memory=peak_gigabytes()
    )


class _Clock:
    """Processor seconds of the stages of one mesh."""

    def __init__(self) -> None:
        self.stages: dict[str, float] = {}
        self._begin = process_time()

    def stop(self, stage: str) -> float:
        """End a stage; the next one begins."""
        now = process_time()
        self.stages[stage], self._begin = now - self._begin, now
        return self.stages[stage]
