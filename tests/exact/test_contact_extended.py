"""Compliance of more points than were solved for; truth = all of them solved for at once."""

import numpy as np
import pytest

from klack.contact.statics import contact_compliance, extended_compliance, static_contact
from klack.elasticity.statics import Flexibility
from klack.verification.indentation import half_spaces, parabola


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
