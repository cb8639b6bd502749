"""What a valve balances within itself: momentum of a needle that bounces against a spring.

Truth: over one period the spring gives back the impulse of one blow, so nothing is left at low
frequencies; during a blow of 40 us it hardly counts, so all is left at high ones.
"""

import numpy as np
import pytest

from klack.acoustics.force_bands import force_bands
from klack.analyses.noise.body import net_share, share_at
from klack.signals import TimeSeries

STEP, PERIOD, BLOW, BOUNCES = 1e-7, 1e-3, 40e-6, 20
PEAK = 300.0
IMPULSE = 2.0 / np.pi * PEAK * BLOW


@pytest.fixture(scope="module")
def forces() -> tuple[TimeSeries, TimeSeries]:
    """Contact force, and with the spring that makes the needle come back: of twenty bounces."""
    t = (np.arange(round(BOUNCES * PERIOD / STEP)) + 0.5) * STEP
    phase = np.mod(t, PERIOD) - 0.5 * PERIOD
    blow = np.where((phase > 0.0) & (phase < BLOW), PEAK * np.sin(np.pi * phase / BLOW), 0.0)
    spring = IMPULSE / PERIOD
    contact = TimeSeries(step=STEP, values=np.pad(blow, 1), unit="N")
    net = TimeSeries(step=STEP, values=np.pad(blow - spring, 1), unit="N")
    return contact, net


def test_the_spring_balances_what_is_slower_than_a_flight(forces):
    contact, net = forces
    bands = force_bands(contact)

    share = net_share(net, [bands])

    assert abs(net.values.sum()) * STEP < 1e-5 * BOUNCES * IMPULSE
    # below the lines of the train, at 1 kHz and above, nothing is left of the pulse of 20 ms
    assert share[bands.middle < 130.0].max() < 2e-3
    lines = (bands.energy > 0.04 * bands.energy.max()) & (bands.middle > 100.0)
    assert lines.sum() > 10
    assert bands.middle[lines].min() > 0.95 / PERIOD
    np.testing.assert_allclose(share[lines], 1.0, rtol=1e-3)


def test_without_other_forces_all_is_left(forces):
    contact, _ = forces
    bands = force_bands(contact)

    np.testing.assert_array_equal(net_share(None, [bands]), 1.0)
    # a needle that only falls: mass times acceleration is the contact force; the zeros at both
    # ends move the frequencies a little between the lines of the train
    np.testing.assert_allclose(net_share(contact, [bands]), 1.0, rtol=1e-3)
    # two stops with the same blows at other times: energies add
    np.testing.assert_allclose(net_share(contact, [bands, bands]), 0.5, rtol=1e-3)


def test_the_share_between_the_bands(forces):
    contact, net = forces
    bands = force_bands(contact)
    share = net_share(net, [bands])

    np.testing.assert_allclose(share_at(bands.middle, bands, share), share, rtol=1e-12)
    inside = share_at(np.sqrt(bands.middle[1:] * bands.middle[:-1]), bands, share)
    np.testing.assert_allclose(inside, np.sqrt(share[1:] * share[:-1]), rtol=1e-9)
