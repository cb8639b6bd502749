"""Truth: peaks of first impacts in steps eight times as short (convergence), half a sine (exact).

What the steps miss of a peak is estimated by ``klack.simulation.impact_doubts``; it is held against
the same stroke in much shorter steps.
"""

import warnings
from dataclasses import replace

import numpy as np
import pytest

from klack.errors import AccuracyWarning
from klack.mechanics.end_stop import EndStop
from klack.mechanics.rigid_mass import RigidMass
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import FilmRow, Rows
from klack.simulation.impact_doubts import impact_doubts, missing_peak
from klack.simulation.network_result import InterfaceRecord, NetworkResult
from klack.simulation.network_run import simulate_network

STEEP = FilmRow(cubic=2e-15, linear=0.0, cut_off=1e-6, suction=1e9)
"""Hardest at touch: a needle of 2 g at 2 m/s crosses it without losing much of its speed."""
THICK = FilmRow(cubic=2.9e-14, linear=0.0, cut_off=2e-6, suction=1e9)
"""Takes nine tenths of the momentum before the touch: hardest while the needle still flies."""


def rows(restitution: float | None = None, film: FilmRow | None = None) -> Rows:
    """A needle of 2 g flies at 2 m/s onto a stop of 200 N/um."""
    parts: dict[str, Component] = {
        "needle": RigidMass(mass=2e-3, points=("tip",), speed=-2.0),
        "seat": EndStop(
            gap=40e-6, law={"kind": "linear", "stiffness": 2e8}, restitution=restitution
        ),
    }
    found = Network(parts, [["needle.tip", "seat.upper"], ["seat.lower", "ground"]]).rows()
    if film is None:
        return found
    return replace(found, interfaces=[replace(found.interfaces[0], film=film)])


def impact(of: Rows, step: float | None = None) -> tuple[NetworkResult, list[str]]:
    """One stroke and its doubts."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", AccuracyWarning)
        result = simulate_network(of, duration=60e-6, step=step, start="free")
    return result, [str(item.message) for item in said]


@pytest.mark.parametrize("restitution", [0.05, 0.2, 0.5, 1.0])
def test_default_steps_resolve_a_stop_of_any_restitution(restitution):
    result, doubts = impact(rows(restitution))
    finer, _ = impact(rows(restitution), 2.5e-9)

    assert not doubts
    first, truth = result.events[0], finer.events[0]
    assert first.time == pytest.approx(truth.time, abs=5e-8)
    assert first.peak_force == pytest.approx(truth.peak_force, rel=3e-4)


@pytest.mark.parametrize(
    ("restitution", "film", "step"),
    [
        (0.05, None, 100e-9),
        (None, None, 200e-9),
        (None, THICK, 200e-9),
        (None, STEEP, 20e-9),
        (None, STEEP, 100e-9),
    ],
    ids=["low restitution", "elastic", "thick film", "film at touch", "film at touch, coarse"],
)
def test_a_peak_that_the_steps_miss_is_told_with_its_size(restitution, film, step):
    result, doubts = impact(rows(restitution, film), step)
    finer, _ = impact(rows(restitution, film), step / 20.0)

    missing = finer.events[0].peak_force / result.events[0].peak_force - 1.0
    first = result.events[0]
    share, _, _ = missing_peak(result.interfaces["seat"], first.peak_time, first.restitution)
    assert missing > 6e-4
    assert len(doubts) == 1
    assert "first impact on 'seat'" in doubts[0]
    assert "run.step: " in doubts[0]
    assert share == pytest.approx(missing, rel=0.25, abs=1e-4)


def test_the_step_that_a_doubt_advises_ends_it():
    _, doubts = impact(rows(0.05), 100e-9)
    words = doubts[0].split("run.step: ")[1].split()

    assert words[1].rstrip(";") == "ns"
    _, again = impact(rows(0.05), float(words[0]) * 1e-9)
    assert not again


@pytest.mark.parametrize("step", [500e-9, 1e-6, 2e-6, 5e-6])
@pytest.mark.parametrize("restitution", [0.02, 0.5, 1.0])
def test_steps_that_resolve_no_peak_promise_no_better_value(restitution, step):
    """The peak is off by 2 % and more, or the contact has fewer than eight steps."""
    result, doubts = impact(rows(restitution), step)
    truth, _ = impact(rows(restitution), 2.5e-9)

    missing = truth.events[0].peak_force / result.events[0].peak_force - 1.0
    told = [text for text in doubts if "first impact on 'seat'" in text]
    assert len(told) == 1
    assert "run.step: " in told[0]
    if "count with about" in told[0]:
        assert missing < 0.03
    else:
        assert "or more" in told[0] or "not resolved" in told[0]


@pytest.mark.parametrize("place", [0.0, 0.2, 0.5], ids=lambda share: f"{share} of a step")
def test_half_a_sine_misses_what_its_means_miss(place):
    """Thirty steps of half a sine: 1 less the largest mean, to a twentieth of it."""
    h = np.pi / 30.0
    edges = h * (np.arange(31) + place)
    means = (np.cos(edges[:-1]) - np.cos(edges[1:])) / h
    record = InterfaceRecord(
        time=edges[:-1],
        step=np.full(30, h),
        contact_force=means,
        film_force=np.zeros(30),
        gap=-np.sin(edges[1:]),
        complete=True,
    )
    k = int(np.argmax(means))

    share, at_touch, length = missing_peak(record, edges[k] + 0.5 * h)

    assert not at_touch
    assert length == h
    assert share == pytest.approx(1.0 / means[k] - 1.0, rel=0.05)


def test_impacts_without_a_record_are_not_doubted():
    result, _ = impact(rows(0.05), 100e-9)
    none = np.zeros(0)
    empty = InterfaceRecord(
        time=none, step=none, contact_force=none, film_force=none, gap=none, complete=False
    )

    assert list(impact_doubts(result.events, {"seat": empty}, 100e-9)) == []
