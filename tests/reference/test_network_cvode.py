"""Truth: integrators of others.

Truth: CVODE of SUNDIALS, an integrator by others, on equations written without klack.

Reference solution: tolerance 1e-11, events located; it differs from that at 1e-10 by 1e-7.

Truth: an implicit Runge-Kutta solver of order 5 (scipy, Radau IIA) on the same equations.
"""

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from klack.network.rows import FilmRow
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.verification.interface_motion import film_by_ode, interface_motion
from klack.verification.one_dimension import steel_rod

pytestmark = pytest.mark.slow


BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
STEPS = np.array([80e-9, 40e-9, 20e-9, 10e-9, 5e-9])


@pytest.fixture(scope="module")
def model() -> Iterator[ModuleType]:
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        yield import_module("small_valve")


@pytest.fixture(scope="module", params=[False, True], ids=["dry", "wet"])
def compared(request, model):
    """CVODE's motion, and klack's over step sizes."""
    wet = request.param
    rows = model.network(wet=wet)
    reference = model.by_cvode(wet=wet, rtol=1e-11)
    return wet, reference, [model.by_klack(rows, step=float(step))[0] for step in STEPS]


def test_reference_does_not_depend_on_its_tolerance(model):
    loose, tight = (model.by_cvode(wet=True, rtol=rtol) for rtol in (1e-10, 1e-11))

    # a root is located to about 1e-13 s: 1e-7 of the state after two impacts
    assert max(loose.distance(tight).values()) < 2e-6


def test_state_and_peaks_agree_to_1e_4(compared):
    wet, reference, runs = compared
    at_10_ns = runs[3].distance(reference)

    assert at_10_ns.pop("state") < (1e-4 if wet else 2e-6)
    assert max(at_10_ns.values()) < (2e-5 if wet else 1e-6), at_10_ns


def test_first_touch_is_found_within_its_step(compared):
    _, reference, runs = compared

    for step, run in zip(STEPS, runs, strict=True):
        late = reference.touched - run.touched  # an impact begins with the step that finds it
        assert np.all(late > -0.05 * step)
        assert np.all(late < 1.05 * step)


def test_order_of_convergence(compared):
    wet, reference, runs = compared
    errors = [run.distance(reference)["state"] for run in runs]

    order = np.polyfit(np.log(STEPS), np.log(errors), 1)[0]
    if wet:  # implicit Euler in the chamber, and the jump of a film's force at first touch: order 1
        assert 0.9 < order < 1.6
    else:
        assert order == pytest.approx(2.0, abs=0.05)
        assert errors[-1] < 1e-6


def test_coarse_steps_in_flight_change_little(model, compared):
    wet, reference, runs = compared
    coarse, _ = model.by_klack(model.network(wet=wet), step=20e-9, coarse=16)

    away = coarse.distance(reference)
    assert coarse.steps < 0.8 * runs[2].steps
    # magnet and pressure in steps of 320 ns before the impact
    assert away["state"] < 1e-3
    assert away["seat peak"] < 5e-5
    assert away["stop peak"] < 5e-5


FILM = FilmRow(cubic=5e-17, linear=0.0, cut_off=1e-8, suction=1e9)
SHEARED = FilmRow(cubic=5e-17, linear=2e-11, cut_off=1e-8, suction=1e9)


@pytest.mark.parametrize("film", [FILM, SHEARED], ids=["squeeze", "squeeze and shear"])
def test_mass_on_a_film_before_a_spring(film):
    """3 g, 0.4 m/s, 1e9 N/m: the film alone stops the needle 0.1 um before the wall."""
    needle, wall = rigid_mass_body("needle", 3e-3, port="bottom"), fixed_body("wall", port="top")
    given = {"series": 1e-9, "gap": 4e-6, "speed": 0.4}
    peak, state = film_by_ode(needle, wall, film, **given, duration=30e-6, relative=1e-10)

    m = interface_motion(needle, wall, None, film=film, **given, step=20e-9, steps=1500)

    assert m.peak_force == pytest.approx(peak, rel=5e-5)  # mean of a step at the peak
    assert m.upper_speed == pytest.approx(state[1] / np.sqrt(3e-3), rel=5e-4)
    assert 0.05e-6 < m.law_gap.min() < 0.2e-6


def test_two_rods_kept_apart_by_a_film_converge_with_order_two():
    a, b = steel_rod("a", 0.04, 20), steel_rod("b", 0.08, 40)
    given = {"series": 1e-9, "gap": 5e-6, "speed": 0.5}
    _, exact = film_by_ode(a, b, FILM, **given, duration=60e-6, relative=1e-9)
    weight = np.concatenate([a.omega, b.omega, np.ones(a.omega.size + b.omega.size)])

    steps = np.array([375, 750, 1500, 3000])
    errors = []
    for n in steps:
        m = interface_motion(a, b, None, film=FILM, **given, step=60e-6 / n, steps=int(n))
        errors.append(np.linalg.norm(weight * (m.state - exact)) / np.linalg.norm(weight * exact))

    order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert order == pytest.approx(2.0, abs=0.08)
    assert errors[-1] < 1e-5
