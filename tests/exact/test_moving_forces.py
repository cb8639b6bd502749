"""Forces with derivatives at fixed times, and the noise that follows from them.

Truth: a pulse whose derivative is known; a valve whose work, or whose drive, is all that changes.
"""

from pathlib import Path

import numpy as np
import pytest

import klack
from klack.analyses.sensitivities.parameters import slope_space
from klack.analyses.sensitivities.slopes import SlopeRunner, moved_forces, transported
from klack.case.reader import find_case
from klack.case.study_source import study_of
from klack.machine.progress import silent

SMALL = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"
MASS = "network.components.needle.mass"
DELAY = """klack: 1
study:
  parameters:
    delay: {from: 5 us, to: 15 us}
    edge: {fixed: 1 us}
    pulse: {fixed: 990 us}
  linked:
    network.components.magnet.time.0: delay
    network.components.magnet.time.1: delay + edge
    network.components.magnet.time.2: delay + pulse
    network.components.magnet.time.3: delay + pulse + edge
  measures: [noise.force_level]
"""


def rates_of_a_pulse(count):
    """Error of the derivative with p of ``exp(-(t - p)^2 (1 + p)^2)``, of intervals that move."""
    edges = np.linspace(-6.0, 6.0, count + 1)
    step = edges[1] - edges[0]
    moving = 0.7 * np.sin(edges)  # speeds of the ends of the intervals

    def impulse(t):
        from scipy.special import erf

        return 0.5 * np.sqrt(np.pi) * erf(t)

    # at p = 0 the impulse up to t is I(t (1 + p) - p (1 + p)) / (1 + p)
    mean = np.diff(impulse(edges)) / step
    up_to = np.exp(-(edges**2)) * (edges - 1.0) - impulse(edges)
    moved = np.diff(up_to + np.exp(-(edges**2)) * moving) / step
    return np.abs(moved + transported(mean, moving, step) - np.diff(up_to) / step).max()


def test_what_moving_intervals_record_is_known_at_fixed_times():
    """Truth: the derivative of a pulse that moves and shrinks; second order in the intervals."""
    coarse, fine = rates_of_a_pulse(300), rates_of_a_pulse(600)
    assert fine < 1e-3
    assert coarse / fine == pytest.approx(4.0, rel=0.05)


def test_what_leaves_one_interval_enters_the_next():
    """Truth: conservation of the impulse."""
    rng = np.random.default_rng(1)
    values, late = rng.normal(size=50), rng.normal(size=51)
    late[[0, -1]] = 0.0
    assert transported(values, late, 0.1).sum() == pytest.approx(0.0, abs=1e-12)


def forces(study, parameters, variant, duration):
    """Forces of the small valve with derivatives, the parameter, and the first touch."""
    case = klack.load_case(SMALL).with_value("run.duration", duration)
    case = case.with_value("run.coarse", 1)  # macro steps blur when a drive switches
    source = study_of(case.checked, case.tree, study) if study else None
    space = slope_space(case.checked, source, parameters)
    runner = SlopeRunner(case.checked, case.tree, space, variant, silent, None)
    (run,) = runner.tangents()
    found = moved_forces(klack.run_stroke(case, variants=[variant]).record, case.checked, run, 0)
    return found, space.varied[0].value, run.touches[0]


@pytest.mark.slow  # the loop with derivatives compiles for a minute
class TestSmallValve:
    def test_a_heavier_needle_pushes_longer_with_the_same_force(self):
        """Truth: with the work given, the integral of F^2 of an impact grows with sqrt(M)."""
        found, mass, _ = forces(None, [MASS], "dry", "0.4 ms")  # some bounces on the opening stop
        stop = next(stop for stop in found.source.stops if stop.name == "opening")
        half = stop.force.values.size // 2
        force, rate = stop.force.values[:half], found.stops["opening"][:half]
        energy, change = (force**2).sum(), 2.0 * (force * rate).sum()
        assert mass * change / energy == pytest.approx(0.5, abs=2e-3)
        assert mass * rate.sum() / force.sum() == pytest.approx(0.5, abs=2e-3)

    def test_a_later_drive_moves_the_force_in_time(self, tmp_path):
        """Truth: a valve at rest answers later; its force has the derivative ``-dF/dt``.

        Times of the drive are known to a quarter of a step of its edge, as those of the touch are.
        """
        study = tmp_path / "delay.yaml"
        study.write_text(DELAY)
        found, _, touch = forces(study, [], "dry", "0.4 ms")
        stop = next(stop for stop in found.source.stops if stop.name == "opening")
        force, rate = stop.force.values, found.stops["opening"]
        later = float(touch.slopes[0])
        assert later == pytest.approx(1.0, abs=0.01)
        assert rate.sum() == pytest.approx(0.0, abs=1e-3 * np.abs(rate).sum())
        assert (rate * stop.force.time).sum() == pytest.approx(later * force.sum(), rel=1e-4)
        assert (force * rate).sum() == pytest.approx(0.0, abs=1e-4 * np.abs(force * rate).sum())


@pytest.mark.slow
def test_forces_on_held_bodies_follow_the_momentum(tmp_path):
    """Truth: at mounts the derivative of the sum of all forces is that of -m a of the needle."""
    text = find_case("demo-stroke").read_text(encoding="utf-8")
    keys = (
        "noise:\n  mounts: {flange: {surface: [housing.rim, pole.rim]}}\n"
        "  reactions: {spring: pole.top, guide: housing.inside}\n  #"
    )
    path = tmp_path / "case.yaml"
    path.write_text(text.replace("noise:  #", keys).replace("duration: 5 ms", "duration: 0.4 ms"))
    case, key = klack.load_case(path), "network.components.spring.preload"
    space = slope_space(case.checked, None, [key])
    (run,) = SlopeRunner(case.checked, case.tree, space, "dry", silent, None).tangents()
    study = klack.run_stroke(case, variants=["dry"]).record
    found = moved_forces(study, case.checked, run, 0)
    held, now = found.source.held, found.held(1e-3)
    assert held is not None
    assert now is not None
    assert found.net is not None
    change = sum((now.forces[name] - held.forces[name]).sum(axis=1) / 1e-3 for name in held.forces)
    kept = int(0.8 * change.size)
    net = found.net[:kept]
    assert np.abs(net).max() > 1.0  # [N/N]: impacts move in time
    # the force that takes back energy of macro steps is in the momentum alone
    assert np.abs(change[:kept] + net).max() < 1e-4 * np.abs(net).max()


@pytest.mark.slow
class TestNoise:
    def test_a_later_drive_is_as_loud(self, tmp_path):
        study = tmp_path / "delay.yaml"
        study.write_text(DELAY)
        record = klack.sensitivities(SMALL, study, variant="dry", check=False)
        (level,) = record.measures
        assert level.unit == "dB"
        assert abs(1e-5 * level.slopes[0]) < 0.01  # 10 us
        assert record.elasticity("noise.force_level", "delay") is None

    def test_noise_of_one_impact_is_predicted(self):
        """Truth: a straight line through 17 strokes whose preload changes by up to 3 %.

        Their energies scatter by 0.03 %, as times are found on steps: 1.2 % of the slope.  Farther
        away the peak is of another swing.
        """
        case = klack.load_case("demo-stroke").with_value("run.duration", "0.35 ms")
        preload, change = "network.components.spring.preload", np.linspace(-0.4, 0.4, 17)  # N
        measures = [
            "noise.sound_exposure_level",
            "noise.peak_level",
            "noise.injected_energy",
            "noise.radiated_energy",
            "noise.support_energy",
        ]
        record = klack.sensitivities(
            case, parameters=[preload], measures=measures, variant="wet", check=False
        )
        table = klack.run_many(
            case, {preload: [f"{12.0 + n} N" for n in change]}, measures, variant="wet"
        )
        for item in record.measures:
            slope = np.polynomial.Polynomial.fit(change, table[item.name], 1).deriv()(0.0)
            assert item.slopes[0] == pytest.approx(slope, rel=0.04), item.name
