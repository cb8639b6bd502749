"""Runs of a needle in three dimensions that fail late. Truth: the same run up to the failure."""

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import pytest
from spatial_needle import ABOVE, BELOW, Needle, move, ring

from klack.network.component import Component
from klack.network.port import ELEMENT, Port
from klack.network.rows import Book, Rows
from klack.network.step_function import python_step
from klack.simulation.network_result import IncompleteRunError

pytestmark = pytest.mark.slow

NEEDLE = Needle(seat=ring(8, 0.6e-3, BELOW), stop=ring(8, 2e-3, ABOVE)).with_modes()


class Tired(Component):
    """Closes with 12 N, opens with 45 N from 2 us on, and fails at a moment."""

    type: ClassVar[str] = "tired"
    ports: ClassVar[Mapping[str, Port]] = {"end": ELEMENT}
    at: float = 1.0

    def add_rows(self, rows: Rows) -> None:
        def step(par: Any, state: Any, inp: Any, out: Any) -> int:
            out[0] = 45.0 if inp[0] > 2e-6 else -12.0
            out[1] = out[0] * (inp[3] - inp[2])
            return 7 if inp[0] + inp[1] > self.at else 0

        rows.element(
            python_step(step, parameters=1, states=0, inputs=4, outputs=2),
            ports=(rows.port("end"),),
            parameters=(0.0,),
            books=(Book("work", "supply"),),
            failures={7: "its wire is tired"},
        )


@pytest.mark.parametrize("at", [60e-6, 98e-6])  # in flight, and on the stop
def test_a_run_that_fails_keeps_its_record(at):
    placed = np.array([1e-7, -5e-8, 0.0, 0.0, 0.0, 0.0])
    guide = NEEDLE.guide(friction=0.1, clearance=0.2e-6)

    def run(at, duration):
        valve = NEEDLE.valve(placement=placed, guide=guide)
        return move(NEEDLE.rows({"land": Tired(at=at)}), valve, duration)

    whole = run(1.0, 150e-6)
    with pytest.raises(IncompleteRunError, match="its wire is tired") as caught:
        run(at, 150e-6)

    part = caught.value.result
    assert at - 3e-6 < part.time[-1] <= at
    for name, channel in part.channels.items():
        expected = whole.channels[name].values[: len(part.time)]
        # guide forces are told between other moments at the end
        np.testing.assert_allclose(channel.values[:-1], expected[:-1], rtol=1e-9, atol=1e-12)
    carried = part.state["moving.forces"] > 0.0
    assert carried.any() == (at > 90e-6)
