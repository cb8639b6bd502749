"""What a contact says of its yield; truth: yield stresses of steels, 0.2 to 2.4 GPa."""

from types import SimpleNamespace

import pytest

from klack.analyses.contact_doubts import elastic_above


@pytest.mark.parametrize(
    ("needed", "words"),
    [
        (0.4e9, "stay elastic from a yield stress of about 400 MPa on"),
        (5.5e9, "would yield: elastic ones need a yield stress of 5.5 GPa, and hardened steel has"),
        (float("nan"), ""),
    ],
)
def test_a_yield_stress_that_no_steel_has_is_no_comfort(needed, words):
    contact = SimpleNamespace(surfaces="needle.tip on housing.seat", needed_yield=needed)

    said = elastic_above(contact)  # type: ignore[arg-type]

    assert words in said
    assert ("Try: 'yield'" in said) == (needed > 2.5e9)
