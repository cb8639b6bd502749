"""Energy, momentum and reciprocity of what sounds.

Energy, momentum and reciprocity of a vibrating structure, over time and over frequency.

What a valve balances within itself: momentum of a needle that bounces against a spring.

Truth: over one period the spring gives back the impulse of one blow, so nothing is left at low
frequencies; during a blow of 40 us it hardly counts, so all is left at high ones.
"""

from dataclasses import replace

import numpy as np
import pytest

from klack.acoustics.force_bands import force_bands
from klack.acoustics.force_response import modal_response, port_forces
from klack.acoustics.harmonic import harmonic_response
from klack.acoustics.injected import injected_density, injected_energy
from klack.acoustics.mobility import transfer_mobility
from klack.acoustics.mount import Mount, mounted
from klack.acoustics.plate import Plate
from klack.acoustics.radiation import power_transfer
from klack.acoustics.spectrum import force_spectrum
from klack.acoustics.surface_bands import face_band_velocity, radiated_bands, surface_spectra
from klack.acoustics.third_octave import band_edges, band_numbers
from klack.analyses.noise.body import net_share, share_at
from klack.bodies.reduction.structure import Structure
from klack.signals.sampled import TimeSeries
from klack.verification.lattice import STEEL
from klack.verification.one_dimension import half_sines
from klack.verification.vibration import rod_structure

PLATE = Plate(thickness=1.5e-3, area=0.5, material=STEEL)
MOUNT = Mount(stiffness=5e5, loss_factor=0.1)


@pytest.fixture(scope="module")
def damped() -> Structure:
    return rod_structure(damping=0.01)


def noise(count: int, seed: int, step: float = 50e-9) -> TimeSeries:
    values = np.random.default_rng(seed).normal(20.0, 30.0, count)
    return TimeSeries(step=step, values=values, unit="N", start=0.5 * step)


def test_injected_energy_is_in_the_modes_or_lost(damped: Structure) -> None:
    """Work, energy and loss are summed apart; any forces at two ports, any damping."""
    ratios = np.linspace(0.0, 1.4, len(damped.omega))
    forces = {"tip": noise(4000, 1), "skin": noise(4000, 2)}

    for structure in (damped, replace(damped, damping=ratios), mounted(damped, MOUNT)):
        run = modal_response(structure, forces)
        change = run.modal_energy.sum() - run.energy_before
        assert np.abs(run.injected).max() > 1e-6
        assert run.injected_energy == pytest.approx(change + run.dissipated.sum(), rel=1e-9)
        assert abs(run.residual) < 1e-9
        assert np.all(run.dissipated >= 0.0)
        assert run.stored[-1] == pytest.approx(run.modal_energy.sum(), rel=1e-12)


def test_injected_energy_over_time_and_over_frequency(damped: Structure) -> None:
    """Int F v dt = int 2 Re(Y) |F|^2 df, also for forces that begin or stay above zero."""
    pulse = half_sines(step=20e-9, count=10_000, times=(2e-5, 1.1e-4), length=1e-5)
    held = replace_values(pulse, 40.0 + pulse.values)
    stays = replace_values(pulse, pulse.values + 25.0 * (pulse.time > 5e-5))
    for forces in ({"tip": pulse}, {"tip": held}, {"tip": stays, "skin": pulse}):
        run = modal_response(damped, forces)

        energy = injected_energy(injected_density(damped, forces))

        # the trapezoidal rule over resonances three of its steps wide: 2 exp(-6 pi)
        assert energy == pytest.approx(run.vibration_energy, rel=1e-7)


def test_density_of_the_injected_energy_is_the_mobility_times_the_force(damped: Structure) -> None:
    pulse = half_sines(step=20e-9, count=10_000, times=(2e-5,), length=1e-5)
    density = injected_density(damped, {"tip": pulse}, resolution=500.0)
    below = (density.frequency > 0.0) & (density.frequency < 2e6)
    f = density.frequency[below]

    real = transfer_mobility(damped, "tip", "tip", f).real
    force = np.fft.rfft(pulse.values, 2 * (density.frequency.size - 1))[below] * pulse.step
    force = force * np.sinc(f * pulse.step)  # of a force that is constant over each interval

    expected = 2 * real * np.abs(force) ** 2
    assert density.values[below] == pytest.approx(expected, rel=1e-8, abs=1e-12 * expected.max())


@pytest.mark.parametrize("mount", [None, MOUNT])
@pytest.mark.parametrize("plate", [None, PLATE])
def test_reciprocity_and_passivity(
    damped: Structure, mount: Mount | None, plate: Plate | None
) -> None:
    f = np.geomspace(1.0, 5e6, 300)

    there = transfer_mobility(damped, "skin", "tip", f, mount=mount, plate=plate)
    back = transfer_mobility(damped, "tip", "skin", f, mount=mount, plate=plate)

    assert there == pytest.approx(back, rel=1e-10)
    for port in damped.port_names:
        drive = transfer_mobility(damped, port, port, f, mount=mount, plate=plate)
        assert np.all(drive.real >= -1e-12 * np.abs(drive))


def test_all_impulse_reaches_the_hold(damped: Structure) -> None:
    """Blocked force and contact force have the same integral once all is at rest."""
    pulse = half_sines(step=50e-9, count=80_000, times=(2e-5, 3e-5), length=2e-5)

    run = modal_response(damped, {"tip": pulse})

    assert run.vibration_energy > 0.0
    assert run.ringing.sum() < 1e-8 * run.vibration_energy
    assert run.blocked_force.values.sum() == pytest.approx(pulse.values.sum(), rel=1e-5)


def test_blocked_force_over_time_and_over_frequency(damped: Structure) -> None:
    pulse = half_sines(step=20e-9, count=200_000, times=(2e-5,), length=1e-5)
    reaction = modal_response(damped, {"tip": pulse}).blocked_force

    n = len(reaction.values)
    f = np.fft.rfftfreq(n, pulse.step)[1:800]
    force = np.fft.rfft(pulse.values)[1:800]

    expected = harmonic_response(damped, f, "tip").support_force * force
    # what still rings at the end of 4 ms: 1e-5 of the velocity
    error = np.abs(np.fft.rfft(reaction.values)[1:800] - expected)
    assert error.max() < 3e-5 * np.abs(expected).max()


def test_static_force_on_the_hold(damped: Structure) -> None:
    for port in damped.port_names:
        share = harmonic_response(damped, np.array([0.0, 10.0]), port).support_force
        assert share == pytest.approx([1.0, 1.0], rel=1e-6)


@pytest.mark.parametrize(
    ("mount", "plate"), [(None, None), (MOUNT, None), (None, PLATE), (MOUNT, PLATE)]
)
def test_energy_of_the_force_is_lost_in_the_modes_or_below(
    damped: Structure, mount: Mount | None, plate: Plate | None
) -> None:
    """Int 2 Re(Y) |F|^2 df = losses of the modes + what flows into mount and plate."""
    pulse = half_sines(step=20e-9, count=30_000, times=(2e-5, 2e-4), length=1e-5)
    bands = np.column_stack(band_edges(band_numbers(900.0, 224e3)))
    spectra = surface_spectra(damped, {"tip": pulse}, bands, mount=mount, plate=plate)
    count, at = len(damped.omega), damped.port_index("tip")

    below = spectra.support_energy()

    given = lost = 0.0
    for part in spectra.parts:
        f, weights = part.frequency, part.weights.sum(axis=0)
        force = part.fields[:, count + at] / (2j * np.pi * f)
        drive = transfer_mobility(damped, "tip", "tip", f, mount=mount, plate=plate)
        given += weights @ (2.0 * drive.real * np.abs(force) ** 2)
        rates = 2.0 * damped.damping * damped.omega
        lost += weights @ (2.0 * np.abs(part.fields[:, :count]) ** 2 @ rates)
    assert below.shape == (len(bands),)
    assert np.all(below >= 0.0)
    assert (below.sum() > 0.1 * given) == (mount is not None or plate is not None)
    assert lost + below.sum() == pytest.approx(given, rel=1e-9)


def test_bands_add_up_to_the_whole(damped: Structure) -> None:
    """Energies of third octaves against one wide band, and against the power transfer."""
    pulse = half_sines(step=20e-9, count=30_000, times=(2e-5, 2e-4), length=1e-5)
    bands = np.column_stack(band_edges(band_numbers(900.0, 224e3)))
    whole = np.array([[bands[0, 0], bands[-1, 1]]])
    options = {"mount": MOUNT, "plate": PLATE}

    parts = radiated_bands(damped, {"tip": pulse}, bands, **options)
    once = radiated_bands(damped, {"tip": pulse}, whole, **options)
    spectrum = force_spectrum(pulse, high=whole[0, 1], resolution=25.0)
    inside = spectrum.frequency >= whole[0, 0]
    power = power_transfer(damped, spectrum.frequency[inside], "tip", **options)
    fine = np.trapezoid(power.values * 2 * np.abs(spectrum.values[inside]) ** 2, dx=25.0)

    assert parts.names == once.names == power.names
    # partial steps at the edges of the bands
    assert parts.energy.sum(axis=1) == pytest.approx(once.energy[:, 0], rel=2e-3)
    assert once.energy[:, 0] == pytest.approx(fine, rel=2e-3)
    velocity = face_band_velocity(damped, {"tip": pulse}, bands, **options)
    velocity_once = face_band_velocity(damped, {"tip": pulse}, whole, **options)
    total = np.sum(velocity**2, axis=0)
    moving = total > 1e-6 * total.max()  # the side of a rod without Poisson's ratio stands still
    assert total[moving] == pytest.approx(velocity_once[0][moving] ** 2, rel=2e-3)


def test_rms_of_a_face_over_time_and_over_bands(damped: Structure) -> None:
    pulse = half_sines(step=20e-9, count=200_000, times=(2e-5,), length=1e-5)
    alone = replace(damped, face_residual=np.zeros_like(damped.face_residual))
    run = modal_response(damped, {"tip": pulse}, sample=40e-9)
    edges = np.geomspace(1e2, 2e6, 25)

    bands = face_band_velocity(
        alone, {"tip": pulse}, np.column_stack([edges[:-1], edges[1:]]), period=0.1
    )

    face = int(np.argmin(damped.axial_normals))
    squares = np.sum((run.modal_velocity @ damped.face_shapes[face]) ** 2) * 40e-9
    assert np.sum(bands[:, face] ** 2) == pytest.approx(squares / 0.1, rel=1e-4)


def test_forces_of_stops_push_the_ports_with_their_signs(damped: Structure) -> None:
    pulse = half_sines(step=20e-9, count=1000, times=(2e-6,), length=1e-5)

    forces = port_forces(damped, {"seat": pulse, "opening": pulse})

    assert list(forces) == ["tip"]
    np.testing.assert_array_equal(forces["tip"].values, -pulse.values)


def replace_values(series: TimeSeries, values: np.ndarray) -> TimeSeries:
    return TimeSeries(step=series.step, values=values, unit="N", start=series.start)


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
