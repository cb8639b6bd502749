"""klack shots of whole strokes through main(argv).

Truth: the exit codes and files that it promises, and the sentences of its own numbers.
"""

import contextlib
import io
import json

import pytest
from shots_valve import valve_text

import klack.analyses.stroke_shots.run as workflow
from klack.analyses.stroke_shots.one_stroke import STROKE_LOG
from klack.api import load_result
from klack.cli.main import main


@pytest.mark.slow
def test_strokes_from_case_to_report(tmp_path):
    case, folder, numbers = tmp_path / "valve.yaml", tmp_path / "out", tmp_path / "numbers.json"
    case.write_text(valve_text("shots: {count: 2, seed: 3}"))
    words = [str(case), "--workers", "1", "--out", str(folder), "--json", str(numbers)]
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        assert main(["shots", *words]) == 0
    text, found = out.getvalue(), json.loads(numbers.read_text())

    assert "2 strokes dry, independent, seed 3" in text
    assert found["schema"] == "klack-stroke-shots/1"
    assert (found["seed"], found["carry"], len(found["variants"]["dry"]["strokes"])) == (
        3,
        False,
        2,
    )
    told = " ".join(text.split())
    assert found["answers"]
    assert all(" ".join(answer.split()) in told for answer in found["answers"])
    assert (folder / "report.html").is_file()
    assert (folder / "report.pdf").is_file()
    assert not (folder / STROKE_LOG.file).exists()
    result = load_result(folder)
    assert result.record.count == 2
    assert "dry stroke 1 seat" in {name for name, *_ in result.analysis.measured(result.record)}


def test_ctrl_c_keeps_the_finished_strokes(tmp_path, monkeypatch, capsys):
    (tmp_path / "valve.yaml").write_text(valve_text())

    def stop(*args, folder, **kwargs):
        folder.mkdir(parents=True)
        (folder / STROKE_LOG.file).write_text("header\none\ntwo\n")
        raise KeyboardInterrupt

    monkeypatch.setattr(workflow, "run_stroke_shots", stop)

    assert main(["shots", "valve.yaml", "-q"]) == 130
    error = capsys.readouterr().err
    assert f"2 finished strokes are kept in klack-results/valve/{STROKE_LOG.file}" in error
