"""Truth: a step function in plain Python does what the compiled one does; its errors come out."""

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
import pytest

from klack.errors import ConvergenceError
from klack.mechanics.spring import Spring
from klack.network.component import Component
from klack.network.port import ELEMENT, Port
from klack.network.rows import Book, Rows
from klack.network.step_function import python_step
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.verification.network import whole_valve

STIFFNESS, PRELOAD = 1e4, 12.0


def plain_spring(par, state, inp, out):
    """Do what ``klack.mechanics.spring`` does."""
    start, end = inp[2], inp[3]
    force = par[1] + 0.5 * par[0] * (start + end)
    out[0] = -force
    out[1] = end * (par[1] + 0.5 * par[0] * end)


class FailureOfTheUser(Exception):
    pass


def broken_spring(par, state, inp, out):
    if inp[0] > 5e-6:
        raise FailureOfTheUser("no spring any more")
    plain_spring(par, state, inp, out)


def tired_spring(par, state, inp, out):
    plain_spring(par, state, inp, out)
    return 7 if inp[0] > 5e-6 else 0


class PlainSpring(Component):
    """The return spring in plain Python."""

    type: ClassVar[str] = "plain-spring"
    ports: ClassVar[Mapping[str, Port]] = {"end": ELEMENT}
    step: ClassVar = staticmethod(plain_spring)

    def add_rows(self, rows: Rows) -> None:
        rows.element(
            python_step(type(self).step, parameters=2, states=0, inputs=4, outputs=2),
            ports=(rows.port("end"),),
            parameters=(STIFFNESS, PRELOAD),
            books=(Book("energy", "store"),),
            failures={7: "its wire is tired"},
        )


class BrokenSpring(PlainSpring):
    step: ClassVar = staticmethod(broken_spring)


class TiredSpring(PlainSpring):
    step: ClassVar = staticmethod(tired_spring)


def run(spring: Component, duration: float) -> NetworkResult:
    valve = whole_valve(modes=(4, 6, 4)).dry().with_components({"spring": spring})
    return simulate_network(
        valve.rows(), duration=duration, step=20e-9, coarse=16, record=1.28e-6, start="free"
    )


def test_plain_python_does_what_the_compiled_spring_does():
    duration = 0.2e-3  # past the first impact on the stop
    compiled = run(Spring(stiffness=STIFFNESS, preload=PRELOAD), duration)
    plain = run(PlainSpring(), duration)

    assert plain.events[-1].stop == "opening"
    for label, channel in plain.channels.items():
        expected = compiled.channels[label].values
        # the same operations, in another order: round-off, and what an impact makes of it
        scale = np.abs(expected).max()
        assert np.allclose(channel.values, expected, rtol=0.0, atol=1e-8 * scale), label
    assert plain.books.relative_residual < 1e-9


def test_an_exception_of_the_user_comes_out_as_it_is():
    with pytest.raises(FailureOfTheUser, match="no spring any more"):
        run(BrokenSpring(), 20e-6)


def test_a_status_of_the_user_comes_out_in_his_words():
    with pytest.raises(ConvergenceError, match="its wire is tired") as caught:
        run(TiredSpring(), 20e-6)

    assert "spring" in str(caught.value)
    assert "5." in str(caught.value)  # us
