"""A network asks no more of its fluid and of its contact laws than its protocols say.

Truth: the same valve with the fluid and the laws themselves, bit by bit.
"""

from dataclasses import replace

import pytest

from klack.network.protocols import InterfaceLaw, LawNumbers, NetworkFluid
from klack.simulation.network_run import simulate_network
from klack.verification.network import whole_valve


class Only:
    """Shows what a protocol names, and hides the rest."""

    def __init__(self, held, protocol):
        self._held = held
        self._names = {name for name in vars(protocol) if not name.startswith("_")}

    def __getattr__(self, name):
        if name.startswith("_") or name not in self._names:
            raise AttributeError(name)
        return getattr(self._held, name)


class OnlyLaw(Only):
    def flat(self):
        return Only(self._held.flat(), LawNumbers)


def run(rows):
    return simulate_network(rows, duration=20e-6, record=1.28e-6)


@pytest.fixture(scope="module")
def valve():
    return whole_valve(modes=(2, 2, 2))


@pytest.fixture(scope="module")
def expected(valve):
    return run(valve.rows())


def assert_same(result, expected):
    assert result.channels.keys() == expected.channels.keys()
    for name, channel in expected.channels.items():
        assert result.channels[name].values.tobytes() == channel.values.tobytes(), name


def test_a_fluid_needs_no_more_than_the_protocol(valve, expected):
    fluid = Only(valve.fluid, NetworkFluid)
    network = type(valve)(valve.components, valve.connections, valve.ambient, fluid)

    assert_same(run(network.rows()), expected)


def test_a_contact_law_needs_no_more_than_the_protocol(valve, expected):
    rows = valve.rows()
    rows.interfaces = [replace(row, law=OnlyLaw(row.law, InterfaceLaw)) for row in rows.interfaces]

    assert_same(run(rows), expected)
