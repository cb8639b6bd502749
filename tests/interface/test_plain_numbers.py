"""Numbers of a text: all of them, or none where anything else stands among them."""

import pytest

from klack.input.plain_numbers import plain_numbers


@pytest.mark.parametrize("text", [b"1 2,3", b"1.5D+03", b"2x", b"1 two", b"1e", b"0x10", b"1-3"])
def test_anything_else_is_no_list_of_numbers(text: bytes) -> None:
    """What other readers take for 1.5, 2 and 0."""
    assert plain_numbers(text) is None


@pytest.mark.parametrize("text", [b"", b" \n\t "])
@pytest.mark.parametrize("kind", [int, float])
def test_nothing_is_no_number(text: bytes, kind: type) -> None:
    found = plain_numbers(text, kind)
    assert found is not None
    assert found.shape == (0,)
    assert found.dtype == kind


def test_whole_numbers_stay_exact() -> None:
    found = plain_numbers(b"9007199254740993\n-7", int)
    assert found is not None
    assert found.tolist() == [9007199254740993, -7]
