"""Tests of commands: each in an empty folder; what it writes with --json fits the schema."""

from pathlib import Path

import pytest
from json_schema_check import every_result_is_documented  # noqa: F401


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Run each test in an empty folder, so that nothing is left in the project."""
    monkeypatch.chdir(tmp_path)
