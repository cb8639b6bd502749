"""Truth: conservation. A run in pieces, with its state handed on, has the impacts of the whole run.

And what does not fit into the record of fine steps costs no impact.
"""

from collections.abc import Sequence
from time import sleep

import energy_ledger
import numpy as np
import pytest

from klack.mechanics.end_stop import EndStop
from klack.mechanics.force import ForceOverTime
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.network import Network
from klack.network.rows import Rows
from klack.simulation import network_recorder, network_run
from klack.simulation.network_result import ImpactEvent, NetworkResult
from klack.simulation.network_run import simulate_network
from klack.verification.network import peak_and_hold, whole_valve

PERIOD, CYCLES = 1.5e-3, 4
RECORD = 6.4e-6  # whole macro steps of both valves


def switched_valve() -> Rows:
    """3 g between two stops 40 um apart, opened and closed again and again; it bounces."""
    time, force = [0.0], [0.0]
    for cycle in range(CYCLES):
        begin = cycle * PERIOD + 50e-6
        time += [begin, begin + 1e-6, begin + 0.6e-3, begin + 0.601e-3]
        force += [0.0, 30.0, 30.0, 0.0]
    law = {"kind": "linear", "stiffness": 1e8}
    parts = {
        "needle": RigidMass(mass=3e-3, points=("tip",)),
        "seat": EndStop(gap=0.0, law=law, restitution=0.6),
        "stop": EndStop(gap=40e-6, law=law, restitution=0.6),
        "spring": Spring(stiffness=1e4, preload=12.0),
        "magnet": ForceOverTime(time=tuple(time), force=tuple(force)),
    }
    joints = [
        ["needle.tip", "seat.upper", "stop.lower", "spring.end", "magnet.end"],
        ["seat.lower", "ground"],
        ["stop.upper", "ground"],
    ]
    return Network(parts, joints).rows()


def flexible_valve() -> Rows:
    """A wet valve with films on both stops and elastic bodies that part and touch again."""
    return whole_valve(modes=(4, 6, 4), damping=0.0, driver=peak_and_hold(end=0.6e-3)).rows()


VALVES = {"rigid": (switched_valve, 50e-9, CYCLES * PERIOD), "wet": (flexible_valve, 20e-9, 1.4e-3)}


def in_pieces(rows: Rows, cuts: Sequence[int], step: float) -> list[NetworkResult]:
    state, pieces = None, []
    for records in np.diff([0, *cuts]):
        piece = simulate_network(
            rows, duration=float(records) * RECORD, step=step, record=RECORD, state=state
        )
        state = piece.state
        pieces.append(piece)
    return pieces


def told(pieces: Sequence[NetworkResult]) -> dict[tuple[str, float], ImpactEvent]:
    """The last word on every impact."""
    return {(event.stop, event.time): event for piece in pieces for event in piece.events}


@pytest.mark.parametrize("kind", list(VALVES))
def test_a_run_in_pieces_has_the_impacts_of_the_whole(kind):
    build, step, duration = VALVES[kind]
    rows = build()
    whole = simulate_network(rows, duration=duration, step=step, record=RECORD)
    records = len(whole.time) - 1
    hits = [round(event.peak_time / RECORD) for event in whole.events]
    # somewhere, and in the middle of three contacts
    cuts = sorted({*(records * k // 7 for k in range(1, 8)), *hits[2:5]})
    # a piece in which the needle hardly moves turns little energy over
    with energy_ledger.allowed("simulate_network", 1e-6):
        pieces = in_pieces(rows, cuts, step)

    found = sorted(told(pieces).values(), key=lambda event: event.time)
    assert len(whole.events) >= 5
    assert repr(found) == repr(list(whole.events))  # the same bits; nan is not equal to itself
    assert any(piece.events and np.isnan(piece.events[-1].separation_time) for piece in pieces)
    # an impact is reported again only where more is known of it
    assert sum(len(piece.events) for piece in pieces) <= len(whole.events) + 2 * len(cuts)


def test_impacts_do_not_depend_on_chunks_and_room(monkeypatch: pytest.MonkeyPatch):
    rows = switched_valve()
    usual = simulate_network(rows, duration=3e-3, step=50e-9, record=RECORD)
    assert all(record.complete for record in usual.interfaces.values())
    monkeypatch.setattr(network_recorder, "_MOST_FINE", 300)
    monkeypatch.setattr(network_run, "_CHUNK", 7_777)
    narrow = simulate_network(rows, duration=3e-3, step=50e-9, record=RECORD)

    assert repr(narrow.events) == repr(usual.events)
    for stop, record in narrow.interfaces.items():
        whole = usual.interfaces[stop]
        assert not record.complete
        assert np.array_equal(record.contact_force, whole.contact_force[:300])
        # these would be missing
        assert sum(e.time > record.time[-1] for e in usual.events if e.stop == stop) >= 3
    for name, channel in usual.channels.items():
        assert np.array_equal(narrow.channels[name].values, channel.values), name


def test_impacts_do_not_depend_on_the_spacing_of_records():
    """Bounces of 20 us are no single impact because the channels are 80 us apart."""
    rows = switched_valve()
    close, wide = (
        simulate_network(rows, duration=3.2e-3, step=50e-9, record=record)
        for record in (0.8e-6, 80e-6)
    )

    assert repr(wide.events) == repr(close.events)
    for name, channel in wide.channels.items():
        values = close.channels[name].values
        expected = values[::100]
        if name.endswith("peak force"):
            expected = values[1:].reshape(-1, 100).max(axis=1)
        elif name.endswith("force"):
            expected = values[1:].reshape(-1, 100).mean(axis=1)
        scale = np.abs(expected).max()
        assert np.allclose(channel.values[-len(expected) :], expected, atol=1e-12 * scale), name


def test_memory_of_the_records_is_asked_for_before_the_run(monkeypatch: pytest.MonkeyPatch):
    from klack import memory
    from klack.errors import InputError

    small = memory.AvailableMemory(size=100e6, bound="as in this test")
    monkeypatch.setattr(memory, "available_memory", lambda: small)
    with pytest.raises(
        InputError, match=r"record: got \d+ records of \d+ channels that takes about 8.4 GB"
    ):
        simulate_network(switched_valve(), duration=60.0, step=50e-9, record=0.8e-6)


@pytest.mark.slow
def test_compiling_is_no_part_of_the_wall_time(monkeypatch):
    """Truth: the first call of the loop, which compiles, advances nothing and is not timed."""
    calls, kernel = [], network_run.run_network

    def slow_at_first(macros, *rest):
        calls.append(macros)
        if len(calls) == 1:
            sleep(0.5)
        return kernel(macros, *rest)

    monkeypatch.setattr(network_run, "run_network", slow_at_first)
    result = simulate_network(switched_valve(), duration=2e-5, step=50e-9, record=RECORD)
    assert calls[0] == 0
    assert sum(calls) > 0
    assert result.wall_time < 0.5
