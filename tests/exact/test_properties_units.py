"""Truth: definitions. What is written with a unit is read as the same value, over all sizes."""

from math import exp, log

import numpy as np
import pytest
from draws import each
from hypothesis import assume, given
from hypothesis import strategies as st
from property_profiles import examples

from klack import units
from klack.errors import InputError
from klack.units import format_si, parse_quantity

KINDS = list(units.KINDS)


def sizes(kind: units.Kind) -> st.SearchStrategy[float]:
    """Values that a case may hold, every decade alike, of both signs."""
    low, high = log(kind.smallest), log(kind.largest)
    inside = st.floats(low + 1e-9, high - 1e-9)  # a unit and its digits round at the ends
    return st.builds(lambda sign, power: sign * exp(power), st.sampled_from([1.0, -1.0]), inside)


QUANTITIES = st.sampled_from(KINDS).flatmap(lambda kind: st.tuples(sizes(kind), st.just(kind)))


@examples(100)
@given(QUANTITIES)
def test_plain_numbers_are_read_as_written(quantity):
    value, kind = quantity
    text = repr(value) if kind.bare else f"{value!r} {kind.unit}"
    assert parse_quantity(text, kind) == pytest.approx(value, rel=1e-14)


@pytest.mark.slow
@examples(100)
@given(QUANTITIES, st.integers(2, 9))
def test_what_people_read_can_be_read_back(quantity, digits):
    """Half a unit of the last digit, whatever the prefix, for every kind that klack knows."""
    value, kind = quantity
    assume(2.0 * kind.smallest < abs(value) < 0.5 * kind.largest)  # rounding leads out of it
    text = format_si(value, kind.unit, digits)
    assert parse_quantity(text, kind) == pytest.approx(value, rel=0.501 * 10.0 ** (1 - digits))


@examples(60)
@given(
    sizes(units.LENGTH),
    st.sampled_from([("m", 1.0), ("mm", 1e-3), ("um", 1e-6), ("inch", 0.0254)]),
)
def test_a_length_is_the_same_in_every_unit(value, unit):
    name, metres = unit
    read = parse_quantity(f"{value / metres!r} {name}", units.LENGTH)
    assert read == pytest.approx(value, rel=1e-14)


@examples(60)
@given(st.data(), st.sampled_from(["uHz", "nHz", "urad", "mrad"]))
def test_a_prefix_is_a_power_of_ten_in_tables_of_units_as_well(data, unit):
    kind = units.FREQUENCY if unit.endswith("Hz") else units.ANGLE
    factor = {"u": 1e-6, "n": 1e-9, "m": 1e-3}[unit[0]]
    value = data.draw(sizes(kind)) / factor
    assert parse_quantity(f"{value!r} {unit}", kind) == pytest.approx(value * factor, rel=1e-14)


@each("kind", KINDS)
def test_beyond_the_sizes_that_there_are_it_is_asked(kind):
    for value in (0.5 * kind.smallest, -0.5 * kind.smallest, 2.0 * kind.largest):
        with pytest.raises(InputError, match="of a size between"):
            parse_quantity(repr(value) if kind.bare else f"{value!r} {kind.unit}", kind)


@examples(60)
@given(st.floats(allow_nan=False), st.sampled_from(KINDS), st.integers(1, 17))
def test_any_number_can_be_written_for_people(value, kind, digits):
    text = format_si(value, kind.unit, digits)
    assert len(text) < 40
    if value == 0.0 or 2.0 * kind.smallest < abs(value) < 0.5 * kind.largest:
        read = parse_quantity(text, kind)
        assert read == pytest.approx(value, rel=0.501 * 10.0 ** (1 - min(digits, 14)))


@pytest.mark.slow
@examples(60)
@given(st.text(max_size=12), st.sampled_from(KINDS))
def test_any_text_is_a_finite_number_or_an_input_error(text, kind):
    try:
        value = parse_quantity(text, kind)
    except InputError:
        return
    assert np.isfinite(value)
