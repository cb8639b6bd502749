"""Solenoid maps: exact for a linear coil, consistent everywhere, honest about a wrong force."""

import numpy as np
import pytest

from klack.errors import AccuracyWarning, InputError
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.voltage_step import VoltageStep
from klack.verification.drivers import run_coil

CURRENT = np.linspace(0.0, 10.0, 21)
GAP = np.linspace(20e-6, 120e-6, 21)


def inductance(x):
    return 1e-8 / (x + 50e-6)  # [H], 60 turns on some mm^2


def linear_map():
    return FluxMap.of(
        current=CURRENT, gap=GAP, linkage=CURRENT[:, None] * inductance(GAP), force=None
    )


def saturating_map():
    linkage = np.tanh(CURRENT[:, None] * inductance(GAP) / 8e-4) * 8e-4 + 1e-5 * CURRENT[:, None]
    return FluxMap.of(current=CURRENT, gap=GAP, linkage=linkage, force=None)


@pytest.mark.parametrize(("current", "gap"), [(3.3, 33e-6), (9.9, 101e-6)])
def test_linear_coil(current, gap):
    made = linear_map()
    psi = current * inductance(gap)

    # splines over 21 gaps: 4th order, 5 um against a scale of 70 um
    assert made.current_at(psi, gap) == pytest.approx(current, rel=1e-5)
    assert made.energy_at(psi, gap) == pytest.approx(0.5 * psi * current, rel=1e-5)
    force = -0.5 * current**2 * 1e-8 / (gap + 50e-6) ** 2
    assert made.force_at(psi, gap) == pytest.approx(force, rel=1e-3)


@pytest.mark.parametrize("linkage", [1e-5, 3e-4, 8.1e-4, 1.4e-3])
@pytest.mark.parametrize("gap", [10e-6, 20e-6, 47e-6, 140e-6])
def test_current_and_force_are_slopes_of_one_energy(linkage, gap):
    made = saturating_map()
    d, e = 1e-5 * linkage, 1e-9

    current = (made.energy_at(linkage + d, gap) - made.energy_at(linkage - d, gap)) / (2 * d)
    force = -(made.energy_at(linkage, gap + e) - made.energy_at(linkage, gap - e)) / (2 * e)

    assert made.current_at(linkage, gap) == pytest.approx(current, rel=1e-6)
    assert made.force_at(linkage, gap) == pytest.approx(force, rel=1e-4, abs=1e-6)


def test_map_is_even_in_force_and_odd_in_current():
    made = saturating_map()

    assert made.current_at(-3e-4, 5e-5) == -made.current_at(3e-4, 5e-5)
    assert made.force_at(-3e-4, 5e-5) == made.force_at(3e-4, 5e-5)


@pytest.mark.parametrize(("k", "u", "j", "v"), [(0, 0.3, 0, 0.7), (57, 0.5, 13, 0.25)])
def test_flat_table_is_the_surface(k, u, j, v):
    made = saturating_map()
    table = made.table()
    m, n, step = int(table[0]), int(table[1]), table[2]
    gaps = table[3 : 3 + n]
    cells = table[3 + n :].reshape(m - 1, n - 1, 4, 4)

    energy = u ** np.arange(4) @ cells[k, j] @ v ** np.arange(4)

    psi, gap = (k + u) * step, gaps[j] + v * (gaps[j + 1] - gaps[j])
    assert energy == pytest.approx(made.energy_at(psi, gap), rel=1e-12)


def test_contradicting_force_is_reported_and_not_used():
    linkage = CURRENT[:, None] * inductance(GAP)
    force = 0.5 * np.array([[-(i**2) * 1e-8 / (x + 50e-6) ** 2 for x in GAP] for i in CURRENT])

    with pytest.warns(AccuracyWarning, match="only one of them can conserve energy"):
        made = FluxMap.of(current=CURRENT, gap=GAP, linkage=linkage, force=1.3 * force)

    assert made.force_at(10 * inductance(60e-6), 60e-6) == pytest.approx(
        -0.5 * 100 * 1e-8 / (110e-6) ** 2, rel=1e-3
    )


def test_agreeing_force_is_accepted(recwarn):
    linkage = CURRENT[:, None] * inductance(GAP)
    force = 0.5 * np.array([[-(i**2) * 1e-8 / (x + 50e-6) ** 2 for x in GAP] for i in CURRENT])

    FluxMap.of(current=CURRENT, gap=GAP, linkage=linkage, force=force)

    assert not [w for w in recwarn if issubclass(w.category, AccuracyWarning)]


@pytest.mark.parametrize(
    ("current", "linkage", "words"),
    [
        ([0.0, 1.0], np.ones((2, 2)), "a linkage for each"),
        ([0.0, 1.0], np.ones((2, 21)), "not increasing"),
        ([1.0, 0.5], np.ones((2, 21)), "not increasing"),
    ],
    ids=["shape", "remanence", "falling"],
)
def test_bad_tables(current, linkage, words):
    with pytest.raises(InputError, match=words):
        FluxMap.of(current=current, gap=GAP, linkage=linkage, force=None)


def small_coil(scale, soft, current):
    """Linkage of a coil that saturates sooner the smaller ``soft`` is."""
    gap = np.linspace(10e-6, 30e-6, 4)
    i = np.array(current)[:, None]
    linkage = scale * (np.tanh(i / (soft * (gap + 20e-6) / 20e-6)) + 0.02 * i)
    return FluxMap.of(current=current, gap=gap, linkage=linkage, force=None)


def test_current_rises_everywhere_on_a_map_that_saturates_within_its_first_row():
    """Energy like psi^4 within one cell: the plain cubic through it would bend downwards."""
    made = small_coil(0.14, 0.1, [0.0, 0.9, 3.2])

    for gap in np.linspace(made.gap[0], made.gap[-1], 7):
        current = [made.current_at(psi, gap) for psi in np.geomspace(1e-9, 0.15, 200)]
        assert np.all(np.diff(current) > 0.0)


def test_a_table_that_jumps_between_two_gaps_is_refused():
    """Splines over such gaps swing, and somewhere the current falls with rising linkage."""
    current, gap = [1.0, 2.0, 3.0], [1e-5, 2e-5, 3e-5, 4e-5, 5e-5]
    rise = np.array([[1.0, 1.0, 1.0, 1.0, 1.0], [5e-3, 5e-3, 1.0, 5e-3, 5e-3], [1.0] * 5])

    with pytest.raises(InputError, match="so abruptly between the gaps 10 um and 20 um"):
        FluxMap.of(current=current, gap=gap, linkage=1e-3 * np.cumsum(rise, axis=0), force=None)


@pytest.mark.parametrize("volts", [5.0, 45.0])
def test_a_coil_far_beyond_its_map_takes_its_ohmic_current(volts):
    """Fifty times the current of the map: the iteration ends at the last digits of the linkage."""
    made = small_coil(5e-7, 1.0, np.linspace(0.0, 1.0, 5))
    lift = np.linspace(0.0, -1e-6, 101)
    run = run_coil(
        made,
        VoltageStep(voltage=volts).program(),
        resistance=1.0,
        gap=30e-6,
        step=1e-6,
        lift=lift,
    )

    assert run.current[-1] == pytest.approx(volts, rel=1e-3)  # the moving armature induces a little
    assert run.residual < 1e-14


def test_a_coil_without_slope_at_rest_starts():
    """Its first row rose like psi^3, without slope at zero, and no flux was found."""
    run = run_coil(
        small_coil(0.14, 0.1, [0.0, 0.9, 3.2]),
        VoltageStep(voltage=13.0).program(),
        resistance=1.0,
        gap=30e-6,
        step=0.3e-6,
        lift=np.zeros(101),
    )

    # almost all of the voltage becomes flux
    assert run.flux[-1] == pytest.approx(13.0 * 30e-6, rel=1e-3)
    assert run.residual < 1e-14
