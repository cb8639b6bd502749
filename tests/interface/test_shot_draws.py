"""What shots draw; truth = the stated distributions, and a shaft that stays inside its guide."""

from math import hypot, pi
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from klack.analyses.shots.draw import centric_draw, draw_shot, extreme_placements, polar
from klack.case import load_case
from klack.case.distribution import Distribution
from klack.case.schema import Case
from klack.case.shots import Shots, Waviness
from klack.errors import InputError
from klack.mesh.rigid import Pose, rigid_placement

GUIDED = load_case(Path(__file__).parents[2] / "docs" / "how-to" / "guided_needle.yaml")
TOUCH = -0.42e-3
# Kolmogorov-Smirnov: a true distribution fails once in a thousand seeds
SURE = 1e-3


def changed(case: Case = GUIDED, *, guide: bool = True, **shots) -> Case:
    update = {"shots": Shots(**shots)} | ({} if guide else {"guide": None})
    return case.model_copy(update=update)


def draws(case: Case, count: int = 400, seed: int = 1):
    return [draw_shot(case, seed, index, TOUCH) for index in range(count)]


def lengths(vectors) -> tuple[np.ndarray, np.ndarray]:
    return tuple(np.array([polar(vector) for vector in vectors]).T)


def uniform(values: np.ndarray, low: float, high: float) -> bool:
    return stats.kstest(values, stats.uniform(low, high - low).cdf).pvalue > SURE


def test_a_shot_depends_on_seed_and_index_only():
    one, again, other = (draw_shot(GUIDED, seed, 7, TOUCH) for seed in (1, 1, 2))

    assert np.array_equal(one.aside, again.aside)
    assert np.array_equal(one.waves, again.waves)
    assert (one.force, one.friction) == (again.force, again.friction)
    assert not np.array_equal(one.aside, other.aside)
    assert one.force != other.force
    assert draw_shot(GUIDED, 1, 8, TOUCH).force != one.force


def test_one_distribution_leaves_the_other_draws_alone():
    wide = changed(force=Distribution("uniform", 0.0, 100.0))

    for index in range(5):
        one, other = (draw_shot(case, 1, index, TOUCH) for case in (GUIDED, wide))
        assert np.array_equal(one.aside, other.aside)
        assert np.array_equal(one.lean, other.lean)


def test_the_guide_holds_the_axis_at_both_heights():
    """Uniform over a disc: the square of the radius is uniform, and so is the angle."""
    guide = GUIDED.guide
    ends = np.array(
        [[d.aside + d.lean * (z - TOUCH) for z in guide.heights] for d in draws(GUIDED)]
    )
    for k in range(2):
        radius, angle = lengths(ends[:, k])
        assert radius.max() <= guide.clearance * (1 + 1e-12)
        assert uniform((radius / guide.clearance) ** 2, 0.0, 1.0)
        assert uniform(angle, -pi, pi)
    assert abs(np.corrcoef(ends[:, 0, 0], ends[:, 1, 0])[0, 1]) < 0.2


def test_stated_eccentricity_and_tilt():
    case = changed(
        guide=False,
        eccentricity=Distribution("rayleigh", 1e-6),
        tilt=Distribution("normal", 1e-3, 1e-4),
        force=Distribution("normal", 10.0, 0.5),
    )
    shots = draws(case)
    radius, angle = lengths([d.aside for d in shots])
    tilt, lean = lengths([d.lean for d in shots])

    assert stats.kstest(radius, stats.rayleigh(scale=1e-6).cdf).pvalue > SURE
    assert stats.kstest(tilt, stats.norm(1e-3, 1e-4).cdf).pvalue > SURE
    assert stats.kstest([d.force for d in shots], stats.norm(10.0, 0.5).cdf).pvalue > SURE
    assert uniform(angle, -pi, pi)
    assert uniform(lean, -pi, pi)
    assert all(d.friction == 0.0 for d in shots)


def test_stated_placements_stay_inside_the_guide():
    case = changed(
        eccentricity=Distribution("uniform", 0.0, 20e-6),
        tilt=Distribution("uniform", 0.0, 3e-3),
    )
    for d in draws(case, 50):
        ends = [d.aside + d.lean * (z - TOUCH) for z in case.guide.heights]
        assert max(hypot(*end) for end in ends) <= case.guide.clearance


def test_a_guide_without_room_is_told():
    case = changed(eccentricity=Distribution("fixed", 0.0), tilt=Distribution("fixed", 0.01))
    with pytest.raises(InputError, match="left the guide"):
        draw_shot(case, 1, 0, TOUCH)


def test_an_out_of_round_ring_has_the_drawn_root_mean_square_and_harmonics():
    waviness = Waviness(rms=Distribution("uniform", 1e-7, 2e-7), harmonics=(3, 5))
    angle = 2 * pi * np.arange(64) / 64
    powers = []
    for d in draws(changed(waviness=waviness), 200):
        ring = d.radial_deviation(angle)
        spectrum = np.abs(np.fft.rfft(ring)) ** 2
        assert 1e-7 <= d.waviness <= 2e-7
        assert np.sqrt(np.mean(ring**2)) == pytest.approx(d.waviness, rel=1e-12)
        assert np.delete(spectrum, [3, 4, 5]).max() < 1e-20 * spectrum.max()
        powers.append(spectrum[3:6] / spectrum.sum())
    # evenly on average: 1/3 each, with a standard deviation of 0.25 in each shot
    assert np.mean(powers, axis=0) == pytest.approx(1 / 3, abs=0.07)


def test_the_centred_shot_has_nothing_but_the_mean_force():
    d = centric_draw(changed(force=Distribution("uniform", 8.0, 14.0)))

    assert d.force == 11.0
    assert (d.friction, d.waviness) == (0.0, 0.0)
    assert not np.any(d.aside)
    assert not np.any(d.lean)
    assert np.all(d.radial_deviation(np.linspace(0, 6, 5)) == 0.0)


@pytest.mark.parametrize(
    ("distribution", "truth"),
    [
        (Distribution("rayleigh", 2.0), stats.rayleigh(scale=2.0)),
        (Distribution("normal", 1.0, 2.0), stats.truncnorm(-0.5, np.inf, loc=1.0, scale=2.0)),
        (Distribution("uniform", 1.0, 2.0), stats.uniform(1.0, 1.0)),
        (Distribution("fixed", 1.5), stats.uniform(1.5, 1e-300)),
    ],
)
def test_means_are_those_of_the_distributions(distribution, truth):
    assert distribution.mean == pytest.approx(truth.mean(), rel=1e-12)


def test_no_draw_lies_beyond_the_extremes():
    farthest = max(hypot(*aside) for aside, _ in extreme_placements(GUIDED, TOUCH))
    steepest = max(hypot(*lean) for _, lean in extreme_placements(GUIDED, TOUCH))

    for d in draws(GUIDED, 200):
        assert hypot(*d.aside) <= farthest
        assert hypot(*d.lean) <= steepest


def test_a_placement_puts_the_axis_where_it_was_drawn():
    """Points of the axis, carried along with the centre of mass, lie on the drawn line."""
    about, centre = np.array([0.0, 0.0, TOUCH]), np.array([1e-4, 0.0, 5e-3])
    d = draw_shot(GUIDED, 1, 3, TOUCH)
    placement = rigid_placement(d.aside, d.lean, about, centre)
    pose = Pose(rotation=placement[3:], about=centre, shift=placement[:3])

    for z in (TOUCH, 3e-3, 7e-3):
        at = pose.of(np.array([0.0, 0.0, z]))
        # angles of a milliradian: the cosine is 1 to 1e-6
        assert at[:2] == pytest.approx(d.aside + d.lean * (z - TOUCH), rel=1e-5, abs=1e-12)
