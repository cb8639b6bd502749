r"""Phases of a step for gas that leaves and enters the liquid of chambers with time constants.

The share of free gas by :mod:`klack.hydraulics.gas_release` is found with the pressures of a step.
Then the flows ``q`` of a step ``H`` carry it:

.. math:: \Bigl(m_i + H \sum_j q_{ji}\Bigr) y_i^* - H \sum_j q_{ji}\,y_j^* = m_i\,y_i

mixes what flows in, with the share of the chamber that it leaves (implicit upwind): shares stay
between those of all chambers, and no gas is made or lost.  A given pressure gives fluid at
equilibrium.  The next step begins with these shares.
"""

from math import expm1
from typing import Any

from klack.errors import InputError
from klack.hydraulics.fluid_store import fluid_store_step
from klack.hydraulics.fluid_table import fluid_at
from klack.hydraulics.gas_release import (
    free_gas,
    mixture_at,
    mixture_pressure,
    settled_share,
    share_moved,
)
from klack.hydraulics.mass_balance import clear_links, solve_mass_balance
from klack.network.rows import Rows
from klack.simulation.network_arrays import Nodes, NodeState
from klack.simulation.phase import compiled

__all__ = [
    "begin_gas",
    "dissolution_energy",
    "end_energy",
    "end_gas",
    "look_up_mixture",
    "pressure_of_mixture",
    "require_chambers",
    "settle_gas",
]


def require_chambers(rows: Rows) -> None:
    """Reject parts that hold fluid without a share of free gas."""
    wrong = [row.component for row in rows.lines] + [row.component for row in rows.waves]
    wrong += [row.component for row in rows.branches if row.step is fluid_store_step]
    if wrong:
        raise InputError(
            f"{wrong[0]}: fluid with release_time and absorption_time",
            got="a part whose fluid has all of its gas free",
            expected="only chambers, openings, pumps and prescribed pressures",
            hint="leave both times out, or replace the part with a chamber and an inertance.",
        )


def settle_gas(nodes: Nodes, state: NodeState) -> None:
    """Start all chambers with the share of equilibrium."""
    for i in range(nodes.volumes * nodes.slow_gas):
        state.free[i], _ = settled_share(nodes.gas, state.p[i])
        state.dissolved[i] = state.mass[i] * (1.0 - state.free[i])


def dissolution_energy(nodes: Nodes, state: NodeState, i: int) -> float:
    """Energy ``D G(p)`` [J] by which a chamber holds less than with all gas free."""
    if not nodes.slow_gas:
        return 0.0
    return float(state.dissolved[i] * free_gas(nodes.gas, state.p[i])[2])


@compiled(_nrt=False, error_model="numpy")
def begin_gas(fluid: Any, H: float) -> None:
    """Shares of the way to equilibrium that release and absorption cover in a step."""
    law, trial = fluid.nodes.gas, fluid.trial
    trial.freed[0] = -expm1(-H / law[5])
    trial.taken[0] = -expm1(-H / law[6])


@compiled(_nrt=False, error_model="numpy")
def look_up_mixture(fluid: Any) -> None:
    """Density, its slope and the energy of flows of every node at the present pressures."""
    nodes, state, trial, hint = fluid.nodes, fluid.state, fluid.trial, fluid.state.hint
    for i in range(nodes.volumes):
        theta = trial.theta[i]
        rho, trial.slope[i], g, hint[i] = mixture_at(
            nodes.fluid,
            nodes.gas,
            trial.end[i],
            state.free[i],
            trial.freed[0],
            trial.taken[0],
            hint[i],
        )
        trial.rho_end[i], trial.g_end[i] = rho, g
        before = state.mass[i] / state.held[i]
        trial.rho[i] = before + theta * (rho - before)
        trial.g[i] = state.g[i] + theta * (g - state.g[i])
    for i in range(nodes.volumes, nodes.nodes):
        if trial.p[i] != trial.known[i]:
            rho, _, g, hint[i] = mixture_at(
                nodes.fluid, nodes.gas, trial.p[i], 1.0, 1.0, 1.0, hint[i]
            )
            trial.rho[i], trial.g[i] = rho, g
            trial.g_end[i] = g
            trial.known[i] = trial.p[i]


@compiled(_nrt=False, error_model="numpy")
def pressure_of_mixture(fluid: Any, i: int, rho: float) -> float:
    """Pressure at the end of the step for this density of a chamber."""
    nodes, state, trial = fluid.nodes, fluid.state, fluid.trial
    p, state.hint[i] = mixture_pressure(
        nodes.fluid,
        nodes.gas,
        rho,
        state.free[i],
        trial.freed[0],
        trial.taken[0],
        state.hint[i],
    )
    return p


@compiled(_nrt=False, error_model="numpy")
def end_energy(fluid: Any) -> None:
    """Energy of flows at the pressures after the last Newton step."""
    nodes, state, trial = fluid.nodes, fluid.state, fluid.trial
    for i in range(nodes.volumes):
        _, _, g, state.hint[i] = fluid_at(nodes.fluid, trial.end[i], state.hint[i])
        trial.g_end[i] = g
        trial.g[i] = state.g[i] + trial.theta[i] * (g - state.g[i])


@compiled(_nrt=False, error_model="numpy")
def end_gas(fluid: Any, H: float, accounts: Any) -> None:
    """Accept the shares of all chambers, with their energy, and mix what flows in."""
    nodes, state, trial = fluid.nodes, fluid.state, fluid.trial
    law = nodes.gas
    for i in range(nodes.volumes):
        share, _ = share_moved(law, trial.end[i], state.free[i], trial.freed[0], trial.taken[0])
        before, dissolved = state.dissolved[i], (state.mass[i] + trial.inflow[i]) * (1.0 - share)
        _, _, G_before = free_gas(law, state.p[i])
        _, _, G = free_gas(law, trial.end[i])
        given = -(G_before + trial.theta[i] * (G - G_before)) * (dissolved - before)
        accounts.gas[i] += given
        accounts.implicit[i] += dissolved * G - before * G_before + given
        state.dissolved[i] = dissolved
        trial.share[i] = share
    _mix(fluid, H)
    for i in range(nodes.volumes):
        state.free[i] = trial.share[i]


@compiled(_nrt=False, error_model="numpy")
def _mix(fluid: Any, H: float) -> None:
    nodes, state, trial, branches = fluid.nodes, fluid.state, fluid.trial, fluid.branches
    n, into, own, y = nodes.volumes, trial.into, trial.own, trial.share
    for i in range(n):
        own[i] = state.mass[i]
        y[i] *= state.mass[i]
    clear_links(nodes, into)
    for k in range(branches.rows):
        source, sink, mass = branches.a[k], branches.b[k], H * fluid.flows.mdot[k]
        place = nodes.place[2 * k + 1]
        if mass < 0.0:
            source, sink, mass = sink, source, -mass
            place = nodes.place[2 * k]
        if source == sink:
            continue
        if sink < n:
            own[sink] += mass
            if source < n:
                into[place] += mass
            else:
                share, _ = settled_share(nodes.gas, trial.p[source])
                y[sink] += mass * share
        if source < n and sink < n:
            own[source] -= mass
    solve_mass_balance(nodes, into, own, y)
