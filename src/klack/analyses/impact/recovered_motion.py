r"""Motion of all nodes, recovered from an impact of two reduced bodies.

.. math:: u = \Phi q + F \left( K^+ p(F) - \Phi_e \Omega_e^{-2} \Phi_e^T p_0 \right)

with the contact force ``F``, the pressure pattern ``p(F)`` of the static contact at that force and
the pattern ``p_0`` of the reduced model: the modes carry the waves, the static solution the
contact (mode acceleration; Craig & Kurdila 2006, ch. 17).  The velocity is that of the modes alone.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.assembling.modes import damping_of, mode_pools, selection_of
from klack.assembling.problem import ContactProblem
from klack.assembling.reduced_pair import ReducedPair, first_stiffness, impact_system, own_pair
from klack.assembling.yielding import tell_elastic
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.ports import Port
from klack.bodies.reduction.reduce import reduce_body
from klack.machine.progress import Progress
from klack.simulation.impact import simulate
from klack.transient.result import MotionOfBody

__all__ = ["Recovered", "recovered_bodies", "recovered_motion"]

_LEAST = 1e-3
"""Smallest share of the largest static force with a pattern of its own."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Recovered:
    """From modal coordinates and contact force to the displacement of all nodes.

    ``missing`` [m/N] is what the modes already hold of the static deflection, with a minus; None
    where attachment modes or nothing at all stand for the rest.
    """

    name: str
    shapes: NDArray[np.float64]
    flexibility: Flexibility
    missing: NDArray[np.float64] | None

    def rest(self, load: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Static displacement (n_dof,) that the modes lack [m/N]."""
        if self.missing is None:
            return None
        return np.asarray(self.flexibility.deflections(load[:, None])[:, 0] + self.missing)

    def motion(
        self,
        q: NDArray[np.float64],
        v: NDArray[np.float64],
        force: float,
        load: NDArray[np.float64],
    ) -> MotionOfBody:
        """Fields (n_dof,) under a contact force [N] with its pattern."""
        u = self.shapes @ q
        rest = self.rest(load) if force > 0.0 else None
        if rest is not None:
            u = u + force * rest
        return MotionOfBody(name=self.name, displacement=u, velocity=self.shapes @ v)


def _recovered(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    elastic: ElasticBody,
    flexibility: Flexibility,
    port: Port,
    sign: float,
) -> Recovered:
    case = problem.case
    body = reduce_body(
        elastic,
        [port],
        modes=selection_of(case.reduction.choice(elastic.name)),
        correction=case.reduction.correction,
        damping=damping_of(case.bodies[elastic.name].damping),
        modes_pool=pools[elastic.name],
        flexibility=flexibility,
        shifts=case.reduction.shifts_of(elastic.name, case.reduction.correction),
        recovery_nodes=np.arange(elastic.mesh.node_count),
    )
    shapes = np.zeros((elastic.dof_count, 0)) if body.recovery is None else body.recovery.shapes
    missing = None
    if body.correction == "consistent":
        own = slice(body.rigid_count, None)
        missing = -sign * shapes[:, own] @ (body.port_shapes[own, 0] / body.omega[own] ** 2)
    return Recovered(name=elastic.name, shapes=shapes, flexibility=flexibility, missing=missing)


def recovered_bodies(
    problem: ContactProblem, pools: Mapping[str, Modes], pair: ReducedPair
) -> tuple[Recovered, Recovered]:
    """Recovery for both bodies, the upper one first."""
    upper, lower = problem.pair.upper, problem.pair.lower
    # the force pushes the upper body up and the lower one down
    return (
        _recovered(problem, pools, upper, problem.flexibility_upper, pair.ports[0], 1.0),
        _recovered(problem, pools, lower, problem.flexibility_lower, pair.ports[1], -1.0),
    )


def recovered_motion(
    problem: ContactProblem, instants: Sequence[int], progress: Progress
) -> Iterator[tuple[float, tuple[MotionOfBody, ...]]]:
    """Motion of the reduced level of a case at instants.

    Yields the time [s] and the motion of the upper and the lower body.

    Parameters
    ----------
    instants
        In steps of ``run.reduced_step``, rising; factorisations of the problem must stay until the
        last.
    """
    case = problem.case
    tell_elastic(case, "the recovered motion is that of")
    pools = mode_pools(problem, at_least=1, progress=progress)
    progress("reduced", 0.0)
    pair = own_pair(problem, pools, stiffness=first_stiffness(problem))
    parts = recovered_bodies(problem, pools, pair)
    system = impact_system(case, pair.upper, pair.lower, pair.law)
    thrown = np.zeros(pair.upper.mode_count)
    thrown[: pair.upper.rigid_count] = -case.motion.speed * pair.upper.rigid_axial
    still = np.zeros(pair.lower.mode_count)
    q: tuple[NDArray[np.float64], ...] = (0.0 * thrown, still)
    v: tuple[NDArray[np.float64], ...] = (thrown, still)
    step, force = case.run.reduced_step, 0.0
    # every instant from a run of its own: a run takes milliseconds, a record of modes memory
    for k, steps in enumerate(instants):
        if steps > 0:
            record = simulate(
                system,
                velocities={pair.upper.name: -case.motion.speed},
                step=step,
                duration=steps * step,
            )
            q, v, force = record.final_position, record.final_velocity, float(record.force[-1, 0])
        highest = pair.static.max_force
        loads = pair.static.load_patterns(float(np.clip(force, _LEAST * highest, highest)))
        yield (
            steps * step,
            tuple(
                part.motion(own_q, own_v, force, load)
                for part, own_q, own_v, load in zip(parts, q, v, loads, strict=True)
            ),
        )
        progress("reduced", (k + 1) / len(instants))
