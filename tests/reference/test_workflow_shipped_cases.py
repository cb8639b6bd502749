"""Every shipped case runs, and one of its numbers is right.

Truth: exact wave theory (two rods), Zener (sphere on rod), and the full order for the reduced
level of the valve, with the tolerances that the project promises.
"""

from math import pi, sqrt

import numpy as np
import pytest
from energy_ledger import allowed

import klack
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.run import run_impact
from klack.analyses.shots.run import run_shots
from klack.case import load_case, read_case, shipped_cases
from klack.case.schema import Case
from klack.contact.laws import LinearLaw
from klack.measurement.pulse import measure_pulse
from klack.simulation.bodies import rod_body
from klack.simulation.impact import simulate_impact
from klack.simulation.system import ContactPair, ReducedSystem

pytestmark = pytest.mark.slow


def shipped(name: str) -> Case:
    return load_case(shipped_cases()[name])


def study_of(name: str, *levels: str, certify: bool = False) -> ImpactStudy:
    case = shipped(name)
    # transfer functions have tests of their own
    run = case.run.model_copy(update={"transfer": None})
    return run_impact(case.model_copy(update={"run": run}), levels=levels, certify=certify)


def test_all_shipped_cases_are_tested():
    assert set(shipped_cases()) == {
        "demo-shots",
        "demo-stroke",  # in test_workflow_stroke.py
        "demo-valve",
        "demo-valve-axisymmetric",
        "from-other-tools",
        "measured",  # in test_measured_strokes.py
        "needle-from-inp",
        "quieter",
        "sphere-on-rod",
        "stairs",  # in test_workflow_stairs.py
        "struck-bar",
        "two-rods",
        "warm-valve",  # in test_how_to_heat.py
        "witness",  # in test_calculix_impact.py
    }


def test_the_struck_bar_carries_the_wave_of_one_dimension():
    """Truth: St Venant, strain v / (2 c) for 2 L / c, later by the distance over c."""
    (gauge,) = study_of("struck-bar", "full").levels["full"].gauges
    c, length, speed = sqrt(204.6e9 / 7800.0), 0.2, 14.4
    pulse = measure_pulse(gauge.time, gauge.values, "struck-bar")

    assert pulse.plateau == pytest.approx(speed / (2 * c), rel=5e-3)  # ripple of lateral inertia
    # the dome makes the pulse 2.8 % longer, the low pass late by its delay and half of the front
    assert pulse.length == pytest.approx(2 * length / c, rel=0.035)
    assert pulse.front == pytest.approx(1.26 / c, rel=0.05)


def test_axisymmetric_valve_reduced_against_full():
    study = study_of("demo-valve-axisymmetric", "reduced", "full")
    deviation = study.deviations["reduced"]
    assert abs(deviation.peak_force) < 0.005
    assert abs(deviation.contact_time) < 0.01
    assert abs(deviation.impulse) < 0.005
    assert abs(deviation.restitution) < 0.002
    assert deviation.history_l2 < 0.015
    assert deviation.third_octave_max_dB < 1.0
    assert deviation.third_octave_up_to_Hz > 50e3
    assert abs(study.levels["reduced"].energy_residual) < 1e-9
    assert study.levels["full"].history.ledger.contact_dissipation < 1e-3 * (
        study.levels["full"].history.ledger.initial
    )


def test_valve_pressed_shut_reduced_against_full():
    """A closing force goes on working during the approach: the ladder must reach that far."""
    case = shipped("demo-valve-axisymmetric")
    run = case.run.model_copy(update={"transfer": None, "duration": 75e-6})
    motion = case.motion.model_copy(update={"force": 150.0})
    case = case.model_copy(update={"run": run, "motion": motion})
    study = run_impact(case, levels=("reduced", "full"), certify=False)
    deviation = study.deviations["reduced"]
    assert study.levels["full"].measures.peak_force > 2 * 150.0
    assert study.contact.force[-1] > study.levels["full"].measures.peak_force
    assert abs(deviation.peak_force) < 0.005
    assert abs(deviation.contact_time) < 0.01


def test_levels_are_named_by_what_they_are_and_the_best_is_the_reference():
    study = study_of("demo-valve-axisymmetric", "lumped", "reduced-attachment", "reduced")
    assert study.reference == "reduced"
    assert set(study.deviations) == {"lumped", "reduced-attachment"}
    labels = {name: level.label for name, level in study.levels.items()}
    assert labels["reduced"] == "reduced, 20 + 40 modes, consistent law"
    assert labels["reduced-attachment"] == "reduced, 20 + 40 modes, attachment modes, 1000 N/um"


@pytest.mark.slow
def test_two_rods_follow_wave_theory():
    """St Venant: plateau rho c A v / 2 until 2 L / c of the short rod; restitution 0.5."""
    study = study_of("two-rods", "reduced", "full")
    c, area = sqrt(210e9 / 7850), pi * 0.002**2
    plateau, duration = 7850 * c * area * 1.0 / 2, 2 * 0.040 / c
    for level in ("reduced", "full"):
        result = study.levels[level]
        time = result.history.time - result.measures.first_touch
        middle = (time > 0.25 * duration) & (time < 0.75 * duration)
        # the modes end at some hundred kHz and leave ripples; their mean is the plateau
        assert np.mean(result.history.force[middle]) == pytest.approx(plateau, rel=0.01)
        assert result.measures.impulse == pytest.approx(plateau * duration, rel=0.005)
        assert result.measures.restitution == pytest.approx(0.5, abs=0.005)


def test_reduced_models_of_other_programs_follow_wave_theory_and_the_exact_rods():
    """St Venant as above; the files hold the exact rods, the universal file in five decimals."""
    result = study_of("from-other-tools", "reduced").levels["reduced"]
    steel = {"young": 210e9, "density": 7850.0, "area": pi * 0.002**2}
    needle = rod_body("needle", length=0.040, elastic_modes=40, **steel)
    seat = rod_body("seat", length=0.080, elastic_modes=80, **steel)
    plateau, duration = 7850 * sqrt(210e9 / 7850) * steel["area"] / 2, 0.080 / sqrt(210e9 / 7850)
    assert result.measures.impulse == pytest.approx(plateau * duration, rel=0.005)
    assert result.measures.restitution == pytest.approx(0.5, abs=0.005)
    contact = ContactPair(
        body_a="needle",
        port_a="bottom",
        body_b="seat",
        port_b="top",
        law=LinearLaw(1e10),
        gap=0.0,
        series_compliance=float(needle.residual_compliance[0, 0]),
    )
    system = ReducedSystem(bodies=(needle, seat), contacts=(contact,))
    own = simulate_impact(system, speed=1.0, duration=40e-6, step=10e-9)
    difference = np.abs(result.history.force - own.force).max()
    assert difference < 1e-4 * own.force.max()  # five decimals, 100 periods of the highest mode


@pytest.mark.slow
def test_sphere_on_rod_is_near_zener():
    """Zener's curve for a thin rod: the 8 mm rod under a 4 mm sphere is not quite thin."""
    study = study_of("sphere-on-rod", "reduced", "full")
    mass, speed = 7850 * 4 / 3 * pi * 0.002**3, 0.5
    hertz = 4 / 3 * (210e9 / (2 * (1 - 0.3**2))) * sqrt(0.002)
    scale = (mass**2 / (hertz**2 * speed)) ** 0.2
    impedance = 7850 * sqrt(210e9 / 7850) * pi * 0.004**2
    expected = zener_restitution(mass / (impedance * scale))
    for level in ("reduced", "full"):
        assert study.levels[level].measures.restitution == pytest.approx(expected, abs=0.02)
    deviation = study.deviations["reduced"]
    assert abs(deviation.peak_force) < 0.005
    assert abs(deviation.contact_time) < 0.01
    assert abs(deviation.restitution) < 0.002
    assert deviation.history_l2 < 0.015


def zener_restitution(inelasticity: float) -> float:
    """Restitution from s'' + (1 + lambda d/dtau) s^1.5 = 0, s(0) = 0, s'(0) = 1 (Zener 1941)."""
    s, rate, step = 0.0, 1.0, 1e-4
    while True:
        force = max(s, 0.0) ** 1.5
        slope = 1.5 * sqrt(max(s, 0.0)) * rate
        acceleration = -(force + inelasticity * slope)
        # the sphere itself is slowed by the force alone; s is the indentation
        s, rate = s + step * rate + step**2 / 2 * acceleration, rate + step * acceleration
        if s < 0:
            break
    return -rate


@pytest.mark.slow
def test_needle_of_another_program_runs():
    """Momentum: J = m (v_before + v_after), and the mass is that of the drawing."""
    study = study_of("needle-from-inp", "reduced")
    result, needle = study.levels["reduced"], study.bodies[0]
    # half ball and shank to z = 22, disc on top: 2/3 pi r^3 + pi r^2 20 + pi 4^2 2 mm3
    volume = (2 / 3 * pi * 8 + pi * 4 * 20 + pi * 16 * 2) * 1e-9
    assert needle.mass == pytest.approx(7850 * volume, rel=1e-3)
    rebound = result.measures.restitution * study.speed
    assert result.measures.impulse == pytest.approx(needle.mass * (study.speed + rebound), rel=1e-3)
    assert 0.5 < result.measures.restitution < 1.0


@pytest.mark.slow
def test_solid_demo_valve_reduced():
    """The demo: enough degrees of freedom, an energy ledger that closes, a plausible rebound."""
    study = study_of("demo-valve", "reduced", certify=True)
    result = study.levels["reduced"]
    assert sum(body.dofs for body in study.bodies) >= 60_000
    assert abs(result.energy_residual) < 1e-9
    # full order on the same meshes, 87132 degrees of freedom: 120.82 N, 39.28 us (benchmarks)
    assert result.measures.peak_force == pytest.approx(120.82, rel=0.005)
    assert result.measures.contact_time == pytest.approx(39.28e-6, rel=0.01)
    assert result.measures.sub_contacts == 1
    assert study.contact.size_ratio < 1.2
    assert 0.8 < result.measures.restitution < 1.0


@pytest.mark.slow
def test_shots_of_the_guided_valve():
    """On a coarse mesh.  Truth: momentum, and a throw against the spring that closes."""
    path = shipped_cases()["demo-shots"]
    text = path.read_text(encoding="utf-8")
    for fine, coarse in (
        ("{size: 0.02 mm, extent: 0.08 mm}", "{size: 0.05 mm, extent: 0.05 mm}"),
        ("layers: 18", "layers: 12"),
        ("size: 2 mm", "size: 4 mm"),
        ("grading: 0.4", "grading: 0.9"),
    ):
        assert fine in text
        text = text.replace(fine, coarse)
    with allowed("simulate_interface", 1e-3):  # coarse elements at the contact: asserted below
        study = run_shots(read_case(text, path), count=3, workers=1)

    centric, shots = study.centric.row(0), study.shots
    back = centric["restitution"] * centric["approach_speed"]
    impulse = study.mass * (back + centric["approach_speed"]) + 6.0 * centric["contact_time"]
    assert centric["impulse"] == pytest.approx(impulse, rel=2e-3)
    # m v^2 / 2 = 6 N h + 10 N/mm h^2 / 2, while the body still rings
    top = (sqrt(36.0 + 1e4 * study.mass * back**2) - 6.0) / 1e4
    assert centric["rebound_height"] == pytest.approx(top, rel=0.01)
    assert np.all(shots.impacts == 4)
    assert np.all(shots.restitution > 0.8)
    assert np.all(np.abs(shots.energy_residual) < 1e-3)
    assert np.all(shots.rocking > centric["rocking"])
    assert set(study.pressures) == {"centric", "highest", "lowest"}


def test_quieter_starts_from_the_demo_stroke():
    """Truth: the same valve; a current that is followed instead of peak and hold."""
    names = ["opening_time", "closing_time", "noise.sound_exposure_level_weighted"]
    here, there = (
        [item.values[0] for item in klack.run_many(name, [{}], names, variant="wet").measures]
        for name in ("quieter", "demo-stroke")
    )
    assert abs(here[0] - there[0]) < 1e-6
    assert abs(here[1] - there[1]) < 1e-6
    assert abs(here[2] - there[2]) < 0.1
