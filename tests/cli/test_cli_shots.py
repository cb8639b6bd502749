"""klack shots through main(argv), on the case of the how-to page.

Truth: the exit codes and files that it promises, and the sentence printed on that page.
"""

import contextlib
import io
import json
import re
from pathlib import Path

import pytest

import klack.analyses.shots.run as workflow
from klack.analyses.shots.one_shot import SHOT_LOG
from klack.cli.main import main

pytestmark = pytest.mark.slow

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
CASE = HOW_TO / "guided_needle.yaml"
PAGE = (HOW_TO / "shots.md").read_text(encoding="utf-8")
SHOT = {
    "restitution",
    "rebound_height_m",
    "peak_force_N",
    "contact_time_s",
    "impulse_Ns",
    "eccentricity_m",
    "tilt_rad",
    "force_N",
    "friction",
    "waviness_m",
    "impacts",
    "energy_residual",
}


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> tuple[Path, str, dict]:
    """Folder, text and numbers of the command of the page."""
    folder = tmp_path_factory.mktemp("shots")
    command = re.search(r"^klack shots \S+(.*)$", PAGE, re.MULTILINE)
    assert command is not None
    words = [str(CASE), *command[1].split(), "--workers", "1", "--threads", "1", "--no-report"]
    numbers = folder / "numbers.json"
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        code = main(["shots", *words, "--out", str(folder / "out"), "--json", str(numbers)])
    assert code == 0
    return folder, out.getvalue(), json.loads(numbers.read_text())


def test_numbers_have_the_promised_keys(run):
    _, _, numbers = run

    assert (numbers["case"], numbers["seed"]) == ("guided_needle", 1)
    assert len(numbers["shots"]) == 6
    for shot in (numbers["centric"], *numbers["shots"]):
        assert set(shot) >= SHOT
        assert shot["impacts"] == 2
    heights = [shot["rebound_height_m"] for shot in numbers["shots"]]
    assert heights[numbers["highest"]] == max(heights)
    assert set(numbers["rule"]) >= {"restitution_bias", "rebound_height_bias"}


def test_the_terminal_shows_distributions_and_the_answer(run):
    folder, text, numbers = run

    for words in ("rebound height", "standard deviation", "6 shots, seed 1"):
        assert words in text
    assert numbers["rule"]["sentence"] in text
    assert (folder / "out" / "result.zarr").is_dir()
    assert not (folder / "out" / SHOT_LOG.file).exists()


def test_the_page_of_the_how_to_prints_what_comes_out(run):
    """Words alike, and the numbers too: but for the last digit with another mesher."""
    _, _, numbers = run
    first = re.search(r"(?:^> .*\n)+", PAGE, re.MULTILINE)
    quoted = " ".join(line.removeprefix("> ") for line in first[0].splitlines())
    pattern = r"[+-]?\d+\.\d+|\d+"
    found, written = numbers["rule"]["sentence"], quoted

    assert re.sub(pattern, "#", written) == re.sub(pattern, "#", found)
    for one, other in zip(re.findall(pattern, written), re.findall(pattern, found), strict=True):
        assert float(one) == pytest.approx(float(other), rel=0.01, abs=0.1)
    # the excerpt is that of the file
    blocks = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    assert len(blocks) == 1
    case = CASE.read_text(encoding="utf-8").splitlines()
    assert all(line in case for line in blocks[0].splitlines())


def test_the_python_of_the_page_runs(run, monkeypatch, capsys):
    folder, _, numbers = run
    code = re.search(r"```python\n(.*?)```", PAGE, re.DOTALL)
    (Path("klack-results")).mkdir()
    (Path("klack-results") / "guided_needle").symlink_to(folder / "out")
    exec(compile(code[1], "shots.md", "exec"), {})

    best, holds = capsys.readouterr().out.split()
    assert float(best) == max(shot["restitution"] for shot in numbers["shots"])
    assert holds == str(numbers["rule"]["holds"])


def test_ctrl_c_keeps_the_finished_shots(monkeypatch, capsys):
    def stop(*args, folder, **kwargs):
        folder.mkdir(parents=True)
        (folder / SHOT_LOG.file).write_text("header\none\ntwo\n")
        raise KeyboardInterrupt

    monkeypatch.setattr(workflow, "run_shots", stop)

    assert main(["shots", str(CASE), "-q"]) == 130
    error = capsys.readouterr().err
    assert f"2 finished shots are kept in klack-results/guided_needle/{SHOT_LOG.file}" in error


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["demo-valve"], "shots: got no section 'shots'"),
        (["demo-stroke"], "impact"),
        ([str(CASE), "--shots", "0"], "--shots"),
        ([str(CASE), "--seed", "-1"], "--seed"),
        ([str(CASE), "--workers", "0"], "--workers"),
        ([str(CASE), "--json", "nowhere/x.json"], "--json"),
        (["nothing.yaml"], "nothing.yaml"),
    ],
)
def test_mistakes_are_refused_before_the_long_work(words, part, capsys):
    assert main(["shots", *words]) == 2

    error = capsys.readouterr().err
    assert part in error
    assert "Try:" in error
    assert not list(Path().iterdir())
