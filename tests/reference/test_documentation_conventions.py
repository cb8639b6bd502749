"""The page of signs and definitions says what the code does.

Truth: closed results of the simplest cases, each with the sign or reference that the page states.
"""

import re
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest

from klack.acoustics.signal_statistics import peak_level, sound_exposure_level
from klack.acoustics.spectrum import (
    density_level,
    energy_spectral_density,
    impulse_level,
    impulse_spectrum,
)
from klack.acoustics.third_octave import band_energies
from klack.case.any_case import read_valve_case
from klack.contact.laws import LinearLaw
from klack.contact.restitution import measure_impact
from klack.signals import TimeSeries
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.impact import simulate_impact
from klack.simulation.system import ContactPair, ReducedSystem

DOCS = Path(__file__).parents[2] / "docs"
MASS, STIFFNESS, SPEED, GAP = 2e-3, 1e9, 0.4, 1e-6  # [kg], [N/m], [m/s], [m]


def test_the_needle_comes_down_is_pushed_up_and_rebounds():
    seat = ContactPair(
        body_a="needle",
        port_a="contact",
        body_b="seat",
        port_b="contact",
        law=LinearLaw(STIFFNESS),
        gap=GAP,
    )
    bodies = (rigid_mass_body("needle", MASS), fixed_body("seat"))
    history = simulate_impact(
        ReducedSystem(bodies=bodies, contacts=(seat,)), speed=SPEED, step=2e-9, duration=15e-6
    )
    measures = measure_impact(history)

    assert history.velocity_a[0] == pytest.approx(-SPEED)
    assert history.velocity_a[-1] == pytest.approx(SPEED, rel=1e-9)  # no loss
    assert history.force.min() >= 0.0
    assert history.gap[0] > 0.0 > history.gap.min()
    assert measures.restitution == pytest.approx(1.0, abs=1e-9)
    # the sum of the means is the change of momentum
    assert history.force.sum() * history.step == pytest.approx(2 * MASS * SPEED, rel=1e-9)
    assert measures.impulse == pytest.approx(2 * MASS * SPEED, rel=1e-4)
    assert measures.contact_time == pytest.approx(pi * sqrt(MASS / STIFFNESS), rel=1e-5)
    assert measures.restitution == pytest.approx(measures.impulse / (MASS * SPEED) - 1, abs=1e-4)


def test_zero_decibels_are_where_the_page_says():
    step, width = 1e-7, 10e-6
    time = (np.arange(2000) + 0.5) * step
    shape = np.where((time > width) & (time < 2 * width), np.sin(pi * (time - width) / width), 0.0)
    pulse = TimeSeries(step=step, values=1e-6 * shape / (shape.sum() * step), unit="N")  # 1 uN s
    spectrum = impulse_spectrum(pulse, resolution=100.0)
    density = energy_spectral_density(spectrum)
    low = spectrum.frequency < 1000.0  # flat there to (f T)^2 = 1e-4

    assert np.allclose(impulse_level(spectrum)[low], 0.0, atol=0.01)
    assert np.allclose(density_level(density)[low], 10 * np.log10(2.0), atol=0.01)
    whole = np.sum(pulse.values**2) * step
    bands = band_energies(density, low=20.0, high=4e5)
    assert bands.energy.sum() < whole
    assert np.trapezoid(np.real(density.values), density.frequency) == pytest.approx(
        whole, rel=1e-3
    )
    level = bands.level_re(1e-12)  # (1 uN)^2 s
    assert np.allclose(level, 10 * np.log10(bands.energy / 1e-12))

    second = TimeSeries(step=1e-4, values=np.full(10_000, 20e-6), unit="Pa")
    assert peak_level(second) == pytest.approx(0.0, abs=1e-9)
    assert sound_exposure_level(second) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
def test_a_positive_force_opens_and_the_spring_closes():
    from klack.analyses.stroke.run import run_stroke

    page = (DOCS / "reference" / "valve-case.md").read_text(encoding="utf-8")
    example = re.search(r"```yaml\n(.*?)```", page, re.DOTALL)
    assert example is not None
    study = run_stroke(read_valve_case(example[1], Path("example.yaml")))
    lift = study.variants["dry"].channel(study.channels.lift)

    # 30 N along +z against 12 N of preload and 0.8 N of rate: up to the stop at 80 um, then back
    assert lift.values.max() == pytest.approx(80e-6, rel=0.05)
    assert abs(lift.values[-1]) < 2e-6
    assert lift.values.min() > -2e-6
