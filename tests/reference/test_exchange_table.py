"""What comes back from other programs; truth: what left, and what CalculiX and CVODE compute."""

from pathlib import Path

import pytest

from klack.verification import run_checks

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "exchange.md"


@pytest.mark.slow
def test_all_comes_back_and_the_page_lists_it():
    checks = run_checks(["exchange"])
    listed = PAGE.read_text(encoding="utf-8")

    assert len(checks) > 30
    assert not [check for check in checks if not check.passed]
    assert not [check.name for check in checks if f"| {check.name} |" not in listed]
