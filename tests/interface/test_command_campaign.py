"""Whole commands on cases changed at random: an answer or one clear error, never a silent fault.

Longer: ``KLACK_LONG=100``, another ``KLACK_SEED=2``.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1] / "data"))
from command_campaign import faults

LONGER = int(os.environ.get("KLACK_LONG", "1"))
SEED = os.environ.get("KLACK_SEED", "1")
CAMPAIGN = Path(__file__).parents[1] / "data" / "command_campaign.py"


@pytest.mark.slow
def test_commands_answer_or_say_why_not(tmp_path: Path):
    words = [sys.executable, str(CAMPAIGN), str(tmp_path / "campaign"), str(6 * LONGER), SEED]
    found = json.loads(subprocess.run(words, capture_output=True, text=True, check=True).stdout)
    assert found.pop("wrong") == []
    assert sum(counts.get("answer", 0) for counts in found.values()) > 0


@pytest.mark.parametrize(
    ("code", "said", "made", "fault"),
    [
        (None, "", "{}", "hang"),
        (70, "klack: internal error", None, "exit code 70"),
        (-11, "", None, "exit code -11"),
        (0, "peak force nan N", "{}", "no number in the words"),
        (0, "", '{"peak": {"force": Infinity}}', "no number in ['.peak.force']"),
        (0, "x.py:3: RuntimeWarning: overflow", "{}", "warning of Python"),
        (0, "", '{"energy_residual": 1e-3}', "residual without a word: ['.energy_residual']"),
        (0, "", None, "no JSON"),
    ],
)
def test_faults_are_seen(code: int | None, said: str, made: str | None, fault: str, tmp_path: Path):
    path = tmp_path / "made.json"
    if made is not None:
        path.write_text(made)
    assert fault in faults(code, said, path)


def test_words_that_only_look_like_no_number_pass(tmp_path: Path):
    (tmp_path / "made.json").write_text('{"energy_residual": 1e-14}')
    assert faults(0, "nanometre, infinite", tmp_path / "made.json") == []
    assert faults(2, "got nan", tmp_path / "none.json") == []
