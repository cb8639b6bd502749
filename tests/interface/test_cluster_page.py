"""The page about clusters: its trial runs as a script, its recipes are Python."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to" / "cluster.md").read_text(encoding="utf-8")
TRIAL, *RECIPES = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)


@pytest.mark.slow
def test_the_trial_prints_what_the_page_shows(tmp_path: Path):
    """In a script of its own: its processes read it again."""
    pytest.importorskip("distributed")
    script = tmp_path / "trial.py"
    script.write_text(
        TRIAL.replace('"small-study"', repr(str(tmp_path / "out"))).replace(
            "threads_per_worker=1", 'threads_per_worker=1, dashboard_address=":0"'
        )
    )
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=ROOT,
        env=os.environ,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    (quoted,) = re.findall(r"```\n(128 points.*?)```", PAGE, re.DOTALL)
    assert done.stdout == quoted, done.stderr
    assert len(list((tmp_path / "out").glob("points-*.jsonl"))) == 1


def test_the_recipes_hand_a_client_to_a_study():
    assert len(RECIPES) == 2
    for recipe in RECIPES:
        compile(recipe, "cluster.md", "exec")
        assert re.search(r"klack\.run_study\(.*folder=.*dask=client\)", recipe)
