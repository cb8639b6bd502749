"""What comes back from other programs is listed; truth: the page of all checks.

``klack verify`` computes them, and CI compares that page with its run.
"""

import re
from pathlib import Path

REFERENCE = Path(__file__).parents[2] / "docs" / "reference"


def test_the_page_lists_every_check():
    pages = (REFERENCE / f"{name}.md" for name in ("conformance", "exchange"))
    every, listed = (page.read_text(encoding="utf-8") for page in pages)
    (section,) = re.findall(r"^## exchange$.*?(?=^## |\Z)", every, re.M | re.S)
    names = [line.split(" | ")[0] for line in section.splitlines() if line.startswith("| ")][1:]

    assert len(names) > 30
    assert not [name for name in names if f"{name} |" not in listed]
