"""Energy balance of a run: stores at a moment, supplies and losses between two."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from klack.simulation.delay_line import LINE_LOSSES, line_store
from klack.simulation.interface_step import interface_store
from klack.simulation.network_arrays import (
    EXCESS,
    LAST,
    PORTS,
    SEEN,
    STORE,
    SUPPLY,
    WITHIN,
    WORK,
    Y0,
)
from klack.simulation.network_compile import CompiledNetwork, body_energy, modal_state
from klack.simulation.network_gas import dissolution_energy
from klack.simulation.network_result import BODY_STORE, EnergyBooks
from klack.simulation.wave_rows import wave_store

__all__ = ["WITHIN_STEPS", "balance_since", "energy_stores", "reset_accounts"]

WITHIN_STEPS = "forces that change within steps"
"""Supply [J]: work beyond that of the mean over a macro step, of either sign."""


def reset_accounts(network: CompiledNetwork) -> None:
    """Begin a new energy balance: no supplies and losses, works that elements have still to see."""
    for account in network.accounts:
        account[:] = 0.0
    network.bodies.at[WORK : WORK + PORTS] = _unseen_work(network)
    network.bodies.at[WITHIN] = 0.0
    if network.moving is not None:
        network.moving.forget_losses()


def _unseen_work(network: CompiledNetwork) -> NDArray[np.float64]:
    """Work [J] of the last forces, port by port, that elements and fluid see in the next step.

    They are behind the bodies by what the guess of the last step missed.  Times the differences
    of the forces this cancels or is repaid; at the ends of a run the whole force counts, and of a
    preloaded needle that is far more than what moves it.  The same holds for contacts and films.
    With it, at the first port that is free, what bodies got beyond their due and the next steps
    take back.
    """
    at, rows, state = network.bodies.at, network.interfaces, network.interface_state
    force, end, seen = (at[row : row + PORTS] for row in (LAST, Y0, SEEN))
    unseen = np.asarray(force * (end - seen), dtype=float)
    ground = len(network.ports)
    for c in range(rows.interfaces):
        if state.far[c] != 0.0:  # its force is among those of elements
            continue
        upper, lower = rows.upper[c], rows.lower[c]
        behind = rows.gap0[c] + end[upper] - end[lower] - state.gap[c]
        unseen[upper if upper < ground else lower] += state.force[c] * behind
    sliders, slid = network.sliders, network.slider_state
    for s in range(sliders.sliders):
        upper, lower = sliders.upper[s], sliders.lower[s]
        behind = end[upper] - end[lower] - slid.seen[s]
        unseen[upper if upper < ground else lower] += slid.force[s] * behind
    free = [row.course is None for row in network.rows.bodies for _ in row.ports]
    if any(free):
        unseen[free.index(True)] += at[EXCESS]
    return unseen


def energy_stores(network: CompiledNetwork) -> dict[str, float]:
    """Energy [J] that each part holds now, by name.

    Bodies are counted without the work that elements have still to see.
    """
    rows, nodes, state = network.rows, network.nodes, network.node_state
    interfaces, touching = network.interfaces, network.interface_state
    stores = {}
    unseen, place = _unseen_work(network), 0
    for b, row in enumerate(rows.bodies):
        if row.course is not None:  # what its motion needs is a supply
            place += len(row.ports)
            continue
        kinetic, strain = body_energy(row.body, *modal_state(network, b))
        ahead = float(unseen[place : place + len(row.ports)].sum())
        place += len(row.ports)
        stores[f"{row.component} {BODY_STORE}"] = kinetic + strain - ahead
    for i, kind in enumerate(network.account_kind):
        if kind == STORE:
            stores[network.account_names[i]] = float(network.accounts.rows[i])
    for c, contact in enumerate(rows.interfaces):
        stores[f"{contact.component} contact"] = float(
            interface_store(
                int(interfaces.kind[c]),
                interfaces.law,
                int(interfaces.law0[c]),
                float(interfaces.series[c]),
                float(touching.gap[c]),
                float(touching.e[c]),
            )
        )
    if network.moving is not None:
        stores |= network.moving.stores()
    for i in range(nodes.volumes):
        excess = state.p[i] - nodes.ambient
        name = rows.nodes[network.node_order[i]].component
        energy = float(state.mass[i] * state.g[i] - excess * state.held[i])
        stores[f"{name} compression"] = energy - dissolution_energy(nodes, state, i)
    for k, line in enumerate(rows.lines):
        name = f"{line.component} waves"
        held = float(line_store(network.lines, network.line_state, k))
        stores[name] = stores.get(name, 0.0) + held
    for k, wave in enumerate(rows.waves):
        stores[f"{wave.component} waves"] = float(wave_store(network.waves, rows.waves, k)[0])
    return stores


def balance_since(network: CompiledNetwork, before: Mapping[str, float]) -> EnergyBooks:
    """Energy balance since the moment of ``before``; modal damping is what a body misses."""
    rows, nodes, accounts = network.rows, network.nodes, network.accounts
    after = energy_stores(network)
    supplies: dict[str, float] = {}
    losses: dict[str, float] = {}
    for i, kind in enumerate(network.account_kind):
        if kind != STORE:
            owner = supplies if kind == SUPPLY else losses
            owner[network.account_names[i]] = float(accounts.rows[i])
    for i, energy in enumerate(accounts.supply):
        name = rows.nodes[network.node_order[nodes.volumes + i]].component
        supplies[f"{name} pressure"] = supplies.get(f"{name} pressure", 0.0) + float(energy)
    for i in range(nodes.volumes):
        name = rows.nodes[network.node_order[i]].component
        losses[f"{name} implicit step"] = float(accounts.implicit[i])
    for i, energy in enumerate(accounts.gas):
        name = rows.nodes[network.node_order[i]].component
        supplies[f"{name} gas release"] = float(energy)
    for c, contact in enumerate(rows.interfaces):
        losses[f"{contact.component} contact"] = float(accounts.contact[c])
        losses[f"{contact.component} film"] = float(accounts.film[c])
    for s, slider in enumerate(rows.sliders):
        losses[f"{slider.component} loss"] = float(accounts.friction[s])
    for k, line in enumerate(rows.lines):
        for j, what in enumerate(LINE_LOSSES):
            name = f"{line.component} {what}"
            losses[name] = losses.get(name, 0.0) + float(accounts.lines[k, j])
    for k, wave in enumerate(rows.waves):
        for j, what in enumerate(wave.losses):
            losses[f"{wave.component} {what}"] = float(accounts.waves[k, j])
    supplies[WITHIN_STEPS] = float(network.bodies.at[WITHIN])
    if network.moving is not None:
        return EnergyBooks(
            supplies=supplies | network.moving.supplies(),
            losses=losses | network.moving.losses(),
            stores_before=dict(before),
            stores_after=after,
        )
    works = network.bodies.at[WORK : WORK + PORTS] - _unseen_work(network)
    place = 0
    for row in rows.bodies:
        work = float(works[place : place + len(row.ports)].sum())
        place += len(row.ports)
        if row.course is not None:
            supplies[f"{row.component} motion"] = -work
        if np.any(row.body.damping > 0.0):
            name = f"{row.component} {BODY_STORE}"
            losses[f"{row.component} damping"] = work - (after[name] - before[name])
    return EnergyBooks(
        supplies=supplies, losses=losses, stores_before=dict(before), stores_after=after
    )
