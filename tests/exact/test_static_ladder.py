"""The static contact reaches as far as an impact can press it, on any mesh."""

from math import sqrt
from pathlib import Path

import pytest

from klack.assembling.ladder import effective_mass
from klack.assembling.problem import build_problem
from klack.case.reader import load_case
from klack.contact.statics import ReachError

pytestmark = pytest.mark.slow

RADIUS, YOUNG, POISSON = 20e-3, 210e9, 0.3
CROWN = Path(__file__).parents[1] / "data" / "case" / "crown.yaml"


def _problem(speed, reach=None):
    case = load_case(CROWN)
    given = {
        "motion": case.motion.model_copy(update={"speed": speed}),
        "contact": case.contact.model_copy(update={"reach": reach}),
    }
    case = case.model_copy(update=given)
    return build_problem(case, lambda *_: None)


def _hertz(energy):
    """Force [N] at which a sphere on a flat stores an energy: E = 2/5 P d, P = k d^(3/2)."""
    k = 4.0 / 3.0 * YOUNG / (2.0 * (1.0 - POISSON**2)) * sqrt(RADIUS)
    return k**0.4 * (2.5 * energy) ** 0.6


@pytest.mark.parametrize("speed", [0.05, 0.25, 1.0])
def test_reach_is_found_on_faces_as_wide_as_the_contact(speed):
    """Reference: Hertz (Johnson 1985, 4.2); 15 % for faces as wide as the contact, and the bulk.

    The first guess of the force is up to nine times too high here: its load covers the whole face.
    """
    problem = _problem(speed)

    static = problem.static
    energy = 0.5 * effective_mass(problem.pair) * speed**2
    assert static.max_force == pytest.approx(1.15 * _hertz(energy), rel=0.15)


def test_given_reach_is_judged_by_the_force_that_is_needed():
    """Reference: the reach found for the case does (1 %: where a ladder ends); a tenth does not."""
    found = _problem(0.25).static

    again = _problem(0.25, found.space.reach).static
    assert again.max_force == pytest.approx(found.max_force, rel=0.01)
    with pytest.raises(ReachError, match="edge of the candidate points"):
        _problem(0.25, 0.1 * found.space.reach)
