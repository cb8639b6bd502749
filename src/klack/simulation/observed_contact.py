r"""A contact whose gap is read beside its ports, to show what that costs in energy.

The force enters each body by the load vector ``b`` of its port, but the gap is that of one node
(``c``), as in state-space models with one node as output.  The work on the body, ``F d(b^T u)``,
and that from the spring, ``F d(c^T u)``, then differ by

.. math:: \Delta E = \sum_\text{bodies} \int F \, \mathrm d(b^T u - c^T u),

which the impact gains or loses from nowhere.  The integration adds nothing: modes are propagated
exactly, the force is the discrete gradient of :func:`klack.simulation.contact_step.solve_step`, so
that with ``c = b`` the energy is kept to round-off.  Bodies are taken without damping, springs and
constant forces.
"""

from dataclasses import dataclass

import numpy as np

from klack.arrays import Floats
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.contact.laws import LinearLaw
from klack.errors import refuse_if, require_positive
from klack.simulation.contact_step import solve_step
from klack.simulation.propagator import modal_propagator

__all__ = ["ObservedImpact", "observed_impact"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ObservedImpact:
    """An impact whose gap may be read elsewhere than at the loads.

    Parameters
    ----------
    step [s]
    force (n,) [N]
        Mean over each step.
    restitution [-]
        Of the centre of mass of the upper body, at the end of the run.
    energy [-]
        Of bodies and contact at the end, over that at the start: 1 for ``c = b``.
    """

    step: float
    force: Floats
    restitution: float
    energy: float

    @property
    def peak_force(self) -> float:
        """Largest force of any step [N]."""
        return float(self.force.max(initial=0.0))


def observed_impact(
    upper: ReducedBody,
    lower: ReducedBody,
    *,
    outputs: tuple[Floats, Floats],
    stiffness: float,
    speed: float,
    duration: float,
    step: float,
) -> ObservedImpact:
    """Impact of two reduced bodies, at their first ports, on a linear spring.

    Parameters
    ----------
    outputs (m,) [1/sqrt(kg)]
        Modal amplitudes of the displacement along z that the gap is made of, of the upper and of
        the lower body; those of the ports for a reciprocal contact.
    stiffness [N/m]
    speed [m/s]
        Of the upper body in -z, at first touch.
    duration, step [s]

    Raises
    ------
    InputError
        Where a force on the bodies would close the gap that it should open.
    """
    require_positive("observed_impact: speed", speed, "m/s")
    require_positive("observed_impact: step", step, "s")
    omega = np.concatenate([upper.omega, lower.omega])
    load = np.concatenate([upper.port_shapes[:, 0], -lower.port_shapes[:, 0]])
    read = np.concatenate([outputs[0], -outputs[1]])
    modes = modal_propagator(omega, np.zeros(omega.size), step)
    opened = float(read @ (modes.B1 * load))  # by a unit force during a step
    refuse_if(
        not opened > 0.0,
        "contact with a node as output",
        got=f"a gap that closes by {-opened:.3g} m when 1 N pushes the bodies apart for a step",
        expected="a node that moves with the load",
        hint="use a node on the contact surface.",
    )
    q, v = np.zeros(omega.size), np.zeros(omega.size)
    v[: upper.rigid_count] = -speed * upper.rigid_axial
    before = 0.5 * float(v @ v)
    law = LinearLaw(stiffness).flat()
    depth, force = 0.0, np.zeros(max(1, int(np.ceil(duration / step))))
    for i in range(force.size):
        free = modes.A11 * q + modes.A12 * v
        v = modes.A21 * q + modes.A22 * v
        deep = -float(read @ free)
        F = solve_step(law.kind, law.parameters, 0, 0.0, opened, depth, deep, 0.0, 0)[0]
        q, v = free + modes.B1 * (load * F), v + modes.B2 * (load * F)
        depth, force[i] = deep - opened * F, F
    after = 0.5 * float(v @ v + np.sum((omega * q) ** 2))
    after += 0.5 * stiffness * max(depth, 0.0) ** 2
    return ObservedImpact(
        step=step,
        force=force,
        restitution=float(force.sum() * step / upper.mass / speed) - 1.0,
        energy=after / before,
    )
