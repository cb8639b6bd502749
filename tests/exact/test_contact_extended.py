"""More contact points than were prepared; truth = all of them prepared at once."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.full_level import run_full
from klack.assembling.modes import kept_modes, mode_pools
from klack.assembling.problem import build_problem
from klack.case import load_case
from klack.contact.history import ImpactHistory
from klack.contact.mortar import ContactSpace
from klack.contact.statics import (
    ReachError,
    contact_compliance,
    extended_compliance,
    static_contact,
)
from klack.elasticity.statics import Flexibility
from klack.progress import silent
from klack.verification.contact import half_spaces, parabola

BALL = Path(__file__).parents[1] / "data" / "small_ball.yaml"


def test_new_points_join_the_known_ones():
    problem = half_spaces(parabola(10e-3, 0.2e-3), contact=0.1e-3, cells=(8, 8), reach=2e-6)
    keep = problem.space.gap < np.median(problem.space.gap)
    keep[3] = False  # and one in the middle, so that the order of the points matters
    fewer = problem.space.restricted(keep)

    with Flexibility(problem.body_a) as a, Flexibility(problem.body_b) as b:
        whole = contact_compliance(problem.space, a, b)
        known = static_contact(fewer, contact_compliance(fewer, a, b), 1e-3)
        extended = extended_compliance(problem.space, known, a, b)

    assert 0 < known.space.count < problem.space.count - 1
    # round-off of the triangular solves
    assert extended == pytest.approx(whole, rel=1e-10, abs=1e-12 * np.abs(whole).max())


@pytest.mark.slow
def test_the_full_order_goes_on_to_as_many_points_as_it_reaches():
    """As the interface level does: the static contact bounds one quasi-static impact only."""
    problem = build_problem(load_case(BALL), silent)
    pools = mode_pools(problem, at_least=1, progress=silent)
    kept = kept_modes(problem, pools)
    problem.close()
    near = problem.space.gap < np.sort(problem.space.gap)[3]
    narrow = replace(problem.space.restricted(near), reach=problem.space.reach / 3.0)

    def run(space: ContactSpace, **contact: float) -> ImpactHistory:
        changed = problem.case.contact.model_copy(update=contact)
        asked = problem.case.model_copy(update={"contact": changed})
        given = replace(problem, space=space, case=asked)
        return run_full(given, pools, kept=kept, progress=silent, threads=1)[0].history

    expected = run(problem.space).force

    # the clock starts at the same placement; round-off of factors in single precision, 250 steps
    assert run(narrow).force == pytest.approx(expected, rel=1e-6, abs=3e-6 * expected.max())
    with pytest.raises(ReachError, match="at the edge of the candidate area, at"):
        run(narrow, reach=1e-6)
