"""What an advice says where a run of the same case warns."""

import pytest

from klack.analyses.advice.regions import coarse_contact_notes
from klack.contact.statics import COARSE


@pytest.mark.parametrize(("ratio", "count"), [(0.8, 0), (COARSE, 0), (2.1, 1)])
def test_a_coarse_contact_is_named_where_a_run_warns_of_it(ratio, count):
    notes = coarse_contact_notes(ratio)

    assert len(notes) == count
    assert all("2.1 half widths long, and a run warns above 1.5" in note for note in notes)
