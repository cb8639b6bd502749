"""klack stroke through main(argv), on the case of the how-to page.

Truth: work and energy for the speed of the first impact, the numbers printed on that page, and one
run of 2 ms against two of 1 ms.
"""

import json
import re
from math import pi, sqrt
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from klack.analyses.stroke.analysis import STROKE
from klack.cli.main import main
from klack.contact.laws import gonthier_coefficient

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
CASE = HOW_TO / "small_valve.yaml"
# 35 N of the magnet, less 12 N of the spring and its 10 N/mm, over 100 um, on 3 g
SPEED = sqrt(2.0 * (23.0 * 1e-4 - 0.5 * 1e4 * 1e-4**2) / 3e-3)
EVENT = {
    "stop",
    "time_s",
    "approach_speed_m_s",
    "peak_force_N",
    "contact_time_s",
    "impulse_Ns",
    "restitution",
}
STUDY = {"events", "opening_time_s", "closing_time_s", "energy_residual", "steps", "wall_time_s"}


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Path:
    """Folder with the result and the numbers of the whole case."""
    folder = tmp_path_factory.mktemp("stroke")
    numbers = folder / "numbers.json"
    words = ["--out", str(folder / "out"), "--json", str(numbers), "--no-report", "-q"]
    assert main(["stroke", str(CASE), *words]) == 0
    return folder


@pytest.fixture(scope="module")
def numbers(run: Path) -> dict:
    return json.loads((run / "numbers.json").read_text())


def test_numbers_have_the_promised_keys(numbers):
    assert set(numbers) >= STUDY
    assert list(numbers["variants"]) == ["wet", "dry"]
    for variant in numbers["variants"].values():
        assert set(variant) >= STUDY
        assert len(variant["events"]) > 5
        assert all(set(event) >= EVENT for event in variant["events"])
    reference = numbers["variants"]["wet"]
    assert all(numbers[key] == reference[key] for key in STUDY)


def test_the_first_impact_has_the_speed_that_work_gives(numbers):
    event = numbers["variants"]["dry"]["events"][0]

    assert event["stop"] == "opening"
    # read at the last step before touch, up to 20 ns early at 7500 m/s^2
    assert event["approach_speed_m_s"] == pytest.approx(SPEED, abs=1.5e-4)
    assert numbers["variants"]["dry"]["opening_time_s"] == event["time_s"]
    # momentum: what comes back is the restitution
    back = event["approach_speed_m_s"] * (1.0 + event["restitution"])
    pushed = 23.0 * event["contact_time_s"]  # by magnet and spring meanwhile
    assert event["impulse_Ns"] == pytest.approx(3e-3 * back + pushed, rel=2e-3)


def test_the_books_close(numbers):
    for variant in numbers["variants"].values():
        assert variant["energy_throughput_J"] > 3e-3
        assert variant["energy_residual"] < 1e-9


def test_fluid_slows_the_needle(numbers):
    wet, dry = (numbers["variants"][name] for name in ("wet", "dry"))

    assert wet["events"][0]["approach_speed_m_s"] < 0.9 * dry["events"][0]["approach_speed_m_s"]
    assert wet["opening_time_s"] > dry["opening_time_s"]


def test_the_page_of_the_how_to_prints_the_right_number():
    text = (HOW_TO / "stroke.md").read_text(encoding="utf-8")
    written = re.findall(r"([\d.]+) m/s", text)

    assert written == ["1.2247", "1.2248"]
    assert float(written[0]) == pytest.approx(SPEED, abs=5e-5)
    # the excerpt is that of the file
    case = CASE.read_text(encoding="utf-8")
    blocks = re.findall(r"```yaml\n(.*?)```", text, re.DOTALL)
    assert len(blocks) == 2
    for line in "".join(blocks).splitlines():
        assert line.strip() in ("...", "") or line in case


def test_the_page_of_the_how_to_shows_the_times_of_the_json(numbers):
    text = (HOW_TO / "stroke.md").read_text(encoding="utf-8")
    wet = numbers["variants"]["wet"]
    shown = json.loads("{" + re.findall(r"```json\n(.*?)```", text, re.DOTALL)[0] + "}")

    for key in ("starts", "lift_between_stops", "bodies"):
        assert shown[key] == wet[key]
    assert (shown["lift_m"], shown["opening_time_s"]) == pytest.approx(
        (wet["lift_m"], wet["opening_time_s"]), rel=5e-3
    )
    for way in ("opening", "closing"):
        row = re.search(rf"needle +{way} +100 +([\d. ]+) +\w+\n", text)[1].split()
        keys = ("at_10_percent_s", "at_50_percent_s", "at_90_percent_s", "touch_s")
        assert wet[way]["stop"] == shown[way]["stop"]
        for key, value in zip(keys, row, strict=True):
            assert float(value) == pytest.approx(1e3 * wet[way][key], abs=2e-4)
            assert shown[way][key] == pytest.approx(wet[way][key], rel=1e-2)


def test_what_does_not_exist_is_null(capsys):
    # the needle is still on its way
    words = ["--duration", "100 us", "--variant", "dry", "--json", "-", "--no-report"]
    assert main(["stroke", str(CASE), *words]) == 0

    out, err = capsys.readouterr()
    found = json.loads(out)
    assert (found["opening_time_s"], found["closing_time_s"], found["events"]) == (None, None, [])
    assert list(found["variants"]) == ["dry"]
    assert "no impacts" in err
    assert found["closing"]["touch_s"] is None
    assert "not reached" in err
    assert "klack-results/small_valve: result.zarr\n" in err


def test_the_terminal_shows_variants_and_impacts(capsys):
    assert main(["stroke", str(CASE), "--duration=1.3 ms", "--no-report", "--out", "x"]) == 0

    out = capsys.readouterr().out
    for words in ("opens [ms]", "real-time factor", "peak force [N]", "dry, rigid bodies"):
        assert words in out
    assert "1.2248 " in out  # as on the page
    assert "at 1.01 bar, rigid bodies" in out  # absolute, as in the case
    assert out.index("wet:") < out.index("dry:")


def test_two_runs_are_one(run):
    """The state is complete: the second half goes on to the same bits."""
    half = ["stroke", str(CASE), "--duration", "1 ms", "--variant=dry", "--no-report", "-q"]
    assert main([*half, "--out", "first"]) == 0
    assert main([*half, "--out", "second", "--continue", "first"]) == 0

    whole = STROKE.load(run / "out").variants["dry"].result
    parts = [STROKE.load(Path(name)).variants["dry"].result for name in ("first", "second")]
    assert len(parts[0].events) > 3 < len(parts[1].events)
    # the impact in which the first half ends is told again, whole
    found = {(e.stop, e.time): e for part in parts for e in part.events}
    last = sorted(found.values(), key=lambda event: event.time)
    assert repr(last) == repr(list(whole.events))
    lift = "needle.tip displacement"
    left = len(whole.time) - len(parts[0].time)  # both halves are whole records
    assert left > 500
    np.testing.assert_array_equal(
        whole.channels[lift].values[-left:], parts[1].channels[lift].values[1 : left + 1]
    )


@pytest.mark.slow
def test_the_report_of_a_stroke_is_written_again(run, capsys):
    copytree(run / "out", "r")

    assert main(["report", "r"]) == 0

    assert sorted(path.name for path in Path("r").iterdir()) == [
        "report.html",
        "report.pdf",
        "result.zarr",
    ]
    assert "Report in r: report.html, report.pdf" in capsys.readouterr().out
    page = Path("r/report.html").read_text(encoding="utf-8")
    assert "A small valve of rigid parts" in page
    assert "<h2>Schematic</h2>" in page
    assert Path("r/report.pdf").read_bytes().startswith(b"%PDF")


BAD = {
    "duration without unit": (["--duration", "5"], ["--duration", "a unit"]),
    "negative duration": (["--duration=-1 ms"], ["--duration", "above 0 s"]),
    "endless": (["--duration", "1 min"], ["--duration", "2000000 records"]),
    "step too long": (["--step", "1 ms"], ["--step", "10 to 20000000000 steps"]),
    "unknown variant": (["--variant", "wett"], ["'wett'", "did you mean 'wet'"]),
    "lumped without stiffness": (["--variant", "dry,dry-lumped"], ["lumped: {stiffness: 1e9 N/m}"]),
    "nothing to go on from": (["--continue", "none"], ["none", "result.zarr"]),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_options_give_one_message_and_exit_2(name, capsys, tmp_path):
    options, words = BAD[name]

    code = main(["stroke", str(CASE), *options])

    out, err = capsys.readouterr()
    assert (code, out) == (2, "")
    assert err.startswith("klack stroke: ")
    assert "\nTry: " in err
    assert "Traceback" not in err
    for word in words:
        assert word in err
    assert list(tmp_path.iterdir()) == []


def test_a_run_goes_on_only_with_its_own_step_and_variants(run, capsys, tmp_path):
    go_on = ["stroke", str(CASE), "--continue", str(run / "out")]
    copytree(run / "out", tmp_path / "r")

    assert main([*go_on, "--step", "50 ns"]) == 2
    assert "expected 20 ns" in capsys.readouterr().err
    text = CASE.read_text(encoding="utf-8") + "lumped: {stiffness: 1e9 N/m}\n"
    Path("small_valve.yaml").write_text(text, encoding="utf-8")
    assert main(["stroke", "small_valve.yaml", "--continue", "r", "--variant=dry-lumped"]) == 2
    assert "'dry-lumped', which is not in the result to continue from" in capsys.readouterr().err


def test_an_impact_case_is_no_stroke(capsys):
    assert main(["stroke", str(Path(__file__).parents[1] / "data" / "case" / "drawn.yaml")]) == 2

    assert "run it with klack impact" in capsys.readouterr().err


def test_schema_of_a_stroke_names_the_components(capsys):
    assert main(["schema", "--kind", "stroke"]) == 0

    printed = capsys.readouterr().out
    assert {"network", "run", "stops"} <= set(json.loads(printed)["properties"])
    for word in ("rigid-mass", "end-stop", "solenoid", "orifice"):
        assert f'"{word}"' in printed


def least_force_on_the_seat() -> float:
    """DOP853 of the needle on F = k d (1 + chi d') when 5 N of 12 N are taken off at once."""
    mass, stiffness, load, pull = 3e-3, 1e9, 12.0, 5.0
    depth = load / stiffness
    chi = gonthier_coefficient(0.5) / sqrt(stiffness * depth**2 / mass)

    def force(state):
        return stiffness * state[0] * (1.0 + chi * state[1])

    def rate(time, state):
        return [state[1], (load - pull - force(state)) / mass]

    period = 2.0 * pi * sqrt(mass / stiffness)
    swing = solve_ivp(
        rate,
        (0.0, 3 * period),
        [depth, 0.0],
        "DOP853",
        rtol=1e-9,
        atol=1e-18,
        max_step=period / 500,
    )
    return float(np.min(force(swing.y)))


@pytest.mark.slow
@pytest.mark.parametrize("quiet", [False, True])
def test_a_valve_that_does_not_open_says_so(tmp_path, capsys, recwarn, quiet):
    """5 N of the magnet against 12 N of the spring: 7 N are missing."""
    text = CASE.read_text()
    assert "35 N, 35 N" in text
    (tmp_path / "case.yaml").write_text(text.replace("35 N, 35 N", "5 N, 5 N"))

    words = ["--variant", "dry", "--out", str(tmp_path / "out")]
    assert main(["stroke", str(tmp_path / "case.yaml"), *words, *(["-q"] if quiet else [])]) == 0

    shown = capsys.readouterr()
    told = shown.err if quiet else shown.out
    assert "Note: 'dry': the needle never left its seat. It was pressed on 'seat' with 12 N" in told
    missing = re.search(r"and ([\d.]+) N were still missing", told)
    assert missing is not None
    # the magnet pulls at once, and the needle swings on its seat
    # a mean over 1.28 us of a force that swings in 11 us
    assert float(missing[1]) == pytest.approx(least_force_on_the_seat(), rel=0.02)
    assert "preload" in told
    assert (tmp_path / "out" / "report.html").is_file()
    if quiet:
        assert shown.out == ""
    assert [str(w.message) for w in recwarn if w.category is UserWarning] == []


def test_a_valve_that_opens_has_no_such_note(run):
    assert not any("never left" in note for note in STROKE.load(run / "out").warnings)


@pytest.mark.parametrize(("record", "told"), [("640 ns", True), ("10 us", False), (None, False)])
def test_records_that_are_further_apart_than_asked_are_told(record, told):
    text = CASE.read_text("utf-8")
    duration = "{duration: 200 us" + (f", record: {record}" if record else "")
    text = re.sub(r"\{duration: [^,}]*", duration, text, count=1)
    Path("valve.yaml").write_text(text, "utf-8")

    assert main(["stroke", "valve.yaml", "--variant", "dry", "--no-report", "--out", "out"]) == 0
    study = STROKE.load(Path("out"))
    time = study.variants["dry"].result.time
    note = f"records are {1e6 * (time[1] - time[0]):.3g} us apart instead of run.record: {record}"
    assert any(note in warning for warning in study.warnings) == told


@pytest.mark.slow
def test_steps_are_checked_unless_they_are_to_stay(tmp_path, capsys):
    out = tmp_path / "out"
    words = ["--variant", "dry", "--step", "1.6 us", "--duration", "300 us", "--out", str(out)]

    assert main(["stroke", str(CASE), *words, "--no-check-steps", "--no-report"]) == 0
    told = capsys.readouterr()
    assert "of 1.6 us" in told.out
    assert "steps are doubled" not in told.out
    assert main(["stroke", str(CASE), *words]) == 0

    text = capsys.readouterr().out
    assert "25 ns; halved because impacts depended on them: 6 times" in text
    assert "dry: change when all time steps are doubled" in text
    assert re.search(r"opening 1 +[+-]0\.\d{4} +[+-]0\.\d{4} ", text)
    assert "impact 1 on 'opening' changes by " in " ".join(text.split())
    assert "change of peak force" in (out / "report.html").read_text()
