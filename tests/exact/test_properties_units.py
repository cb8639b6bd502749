"""Truth: definitions. What is written with a unit is read as the same value, over 30 decades."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from property_profiles import examples

from klack import units
from klack.errors import InputError
from klack.units import format_si, parse_quantity

KINDS = [units.LENGTH, units.TIME, units.FORCE, units.STIFFNESS, units.PRESSURE]
VALUES = st.builds(
    lambda sign, power: sign * float(np.exp(power * np.log(10.0))),
    st.sampled_from([1.0, -1.0]),
    st.floats(-15.0, 15.0),
)


@examples(100)
@given(VALUES, st.sampled_from(KINDS))
def test_plain_numbers_are_read_as_written(value, kind):
    text = f"{value!r} {kind.unit}"
    assert parse_quantity(text, kind) == pytest.approx(value, rel=1e-14)


@examples(100)
@given(VALUES, st.sampled_from(KINDS), st.integers(2, 9))
def test_what_people_read_can_be_read_back(value, kind, digits):
    """Half a unit of the last digit, whatever the prefix (a frequency is read from mHz on)."""
    text = format_si(value, kind.unit, digits)
    assert parse_quantity(text, kind) == pytest.approx(value, rel=0.501 * 10.0 ** (1 - digits))


@examples(60)
@given(VALUES, st.sampled_from([("m", 1.0), ("mm", 1e-3), ("um", 1e-6), ("inch", 0.0254)]))
def test_a_length_is_the_same_in_every_unit(value, unit):
    name, metres = unit
    read = parse_quantity(f"{value / metres!r} {name}", units.LENGTH)
    assert read == pytest.approx(value, rel=1e-14)


@examples(60)
@given(st.text(max_size=12), st.sampled_from(KINDS))
def test_any_text_is_a_finite_number_or_an_input_error(text, kind):
    try:
        value = parse_quantity(text, kind)
    except InputError:
        return
    assert np.isfinite(value)
