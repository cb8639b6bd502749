"""Pages on what is off-axis; truth: what their examples print."""

import pytest
from pages import HOW_TO, blocks, printed


@pytest.mark.parametrize(
    "name",
    ["off-axis-magnet-and-seat", pytest.param("off-axis-impact", marks=pytest.mark.slow)],
)
def test_the_example_prints_what_the_page_shows(name):
    text = (HOW_TO / f"{name}.md").read_text(encoding="utf-8")
    (code,), (shown,) = blocks(text, "python"), blocks(text, "text")

    assert printed(code, name) == shown
