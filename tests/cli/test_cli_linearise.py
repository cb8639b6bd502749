"""klack linearise through main(argv).

Truth: R and L of a coil by hand, that all files hold the same matrices, and the words that are
promised for what cannot be.
"""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
from quoted_output import compare
from scipy.io import loadmat

from klack.analyses.linearisation.analysis import LINEARISATION
from klack.analyses.linearisation.loops import plain_name
from klack.case.any_case import read_case_tree
from klack.cli.main import main
from klack.simulation.network_run import simulate_network

HOW_TO = Path(__file__).parents[2] / "docs" / "how-to"
MAGNET = (HOW_TO / "held_open.yaml").read_text(encoding="utf-8")
RELIEF = (HOW_TO / "relief_on_pipe.yaml").read_text(encoding="utf-8")
SWEEP = ("--sweep", "network.components.damper.diameter", "0.2 mm", "0.3 mm", "3")


@pytest.fixture(autouse=True)
def _case():
    Path("valve.yaml").write_text(MAGNET)
    Path("relief.yaml").write_text(RELIEF)


def linearise(*words: str) -> int:
    return main(["linearise", *words])


@pytest.mark.slow
def test_all_files_hold_the_same_model(capsys):
    words = ("--current", "1 A", "--from", "coil.voltage", "--to", "coil.current")
    assert linearise("valve.yaml", *words, "--json", "n.json", "--no-report", "--out", "out") == 0

    assert "Stable: every small disturbance decays" in capsys.readouterr().out
    stored = LINEARISATION.load(Path("out"))
    packed, mat = np.load("out/linear-model.npz"), loadmat("out/linear-model.mat")["klack"]
    numbers = json.loads(Path("n.json").read_text())
    for name in "ABCD":
        expected = getattr(stored, name)
        assert np.array_equal(packed[name], expected)
        assert np.array_equal(mat[name][0, 0], expected)
        assert np.array_equal(np.array(numbers[name]), expected)
        rows = list(csv.reader(Path(f"out/{name}.csv").open()))[1:]
        assert np.array_equal(np.array([row[1:] for row in rows], dtype=float), expected)
    assert [str(x[0]) for x in mat["states"][0, 0].ravel()] == [
        x["name"] for x in numbers["states"]
    ]
    assert numbers["stable"] is True
    low = next(iter(csv.DictReader(Path("out/frequency-response.csv").open())))
    size = float(low["coil.current over coil.voltage magnitude [A/V]"])
    assert size == pytest.approx(0.5, rel=0.02)  # 1/R at a low frequency


@pytest.mark.slow
def test_a_relief_valve_on_a_pipe_is_told_unstable_and_where_it_becomes_so(capsys):
    words = ("--band", "2 kHz", "--loop", "edge.mass_flow", "--no-report", "--out", "out")
    assert linearise("relief.yaml", *words, *SWEEP) == 0

    assert "Unstable: a small disturbance oscillates at 533.3 Hz" in capsys.readouterr().out
    rows = list(csv.DictReader(Path("out/stability.csv").open()))
    assert [row["unstable eigenvalues"] != "0" for row in rows] == [False, True, True]
    assert {"loop-edge-mass-flow.svg", "stability-over-damper-diameter.svg"} <= {
        path.name for path in Path("out").iterdir()
    }
    stored = LINEARISATION.load(Path("out"))
    assert stored.loops[0].gain_margin < 1.0
    assert stored.shares.sum(axis=1) == pytest.approx(np.ones(len(stored.eigenvalues)))


VOICE = """
klack: 1
title: A needle on a spring whose force a PID controls
network:
  components:
    needle: {type: rigid-mass, mass: 3 g, points: [tip]}
    spring: {type: spring, stiffness: 10 N/mm, preload: -3 N, damping: 2 N*s/m}
    voice:
      type: controlled-force
      sample_time: 20 us
      sensors: {lift: {channel: needle.tip displacement, unit: um, delay: 30 us}}
      controller:
        {kind: pid, sensor: lift, setpoint: 300.01, gain: GAIN, integral_time: 5 ms,
         derivative_time: 1 ms, derivative_filter: 0.1 ms, lower: -20, upper: 20}
  connections: [[needle.tip, spring.end, voice.end]]
run: {duration: 12 ms, variants: [dry]}
"""


def test_the_gain_margin_of_a_pid_is_where_runs_in_time_begin_to_swing():
    Path("voice.yaml").write_text(VOICE.replace("GAIN", "0.002"))
    assert linearise("voice.yaml", "--loop", "voice", "--no-report", "--quiet", "--out", "out") == 0
    margin = LINEARISATION.load(Path("out")).loops[0].gain_margin

    growth = []
    for share in (0.97, 1.03):
        Path("other.yaml").write_text(VOICE.replace("GAIN", repr(0.002 * margin * share)))
        network = read_case_tree(Path("other.yaml")).case().network.network()
        result = simulate_network(network.rows(), duration=12e-3, record=5e-6)
        lift = result.channels["needle.tip displacement"].values
        parts = np.array_split(lift, 6)
        growth.append(np.ptp(parts[5]) / np.ptp(parts[3]))

    assert growth[0] < 0.7
    assert growth[1] > 1.2


@pytest.mark.slow
def test_a_switching_controller_has_no_margins(capsys):
    Path("switched.yaml").write_text((HOW_TO / "controlled_valve.yaml").read_text(encoding="utf-8"))

    assert linearise("switched.yaml", "--loop", "driver") == 2

    assert "a switch has no linear law" in capsys.readouterr().err


@pytest.mark.slow
def test_every_channel_of_a_gas_network_is_an_output_of_its_own():
    path = HOW_TO / "pneumatic_valve.yaml"
    assert linearise(str(path), "--no-report", "--quiet", "--out", "out") == 0

    model = LINEARISATION.load(Path("out"))
    network = read_case_tree(path).case().network.network()
    recorded = simulate_network(network.rows(), duration=1e-6).channels
    # no small signals
    apart = ("driver state", "peak force", "film force", "repaid impulse", "passed mass")
    wanted = {plain_name(name) for name in recorded if not name.endswith(apart)}
    assert wanted <= {plain_name(signal.name) for signal in model.outputs}
    states = [signal.name for signal in model.states]
    assert len(set(states)) == len(states)
    assert {"inlet.mass", "working.mass", "working.internal energy"} <= set(states)


@pytest.mark.slow
def test_a_boost_driver_is_told_to_be_no_part_of_the_model(capsys):
    path = HOW_TO / "boost_driver.yaml"
    assert linearise(str(path), "--no-report", "--quiet", "--out", "out") == 0

    said = " ".join(capsys.readouterr().err.split())
    assert "the driver 'driver' switches repeatedly" in said
    assert "the capacitor, diodes and switches of the driver 'driver' are not part" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        *(
            pytest.param(words, said, marks=pytest.mark.slow)  # once it is linearised
            for words, said in (
                (("--from", "coil.volt", "--to", "needle.velocity"), "did you mean 'coil.voltage'"),
                (("--from", "coil.voltage"), "--to: got nothing beside --from"),
                (("--loop", "coil.force"), "coil.armature.force"),
            )
        ),
        (("--band", "0 Hz"), "--band: got 0 Hz"),
        (("--frequencies", "1 kHz", "1 Hz"), "--frequencies: got from 1 kHz to 1 Hz"),
        (("--current", "1"), "unit"),
        (("--lift", "1 mm"), "between the stops"),
        (("--lift", "-1 mm"), "between the stops"),
        (("--current", "-1 A"), "expected 0 A or more"),
        (("--variant", "moist"), "moist"),
        (("--sweep", "lift", "0 um", "10 um", "1"), "2 or more"),
        (("--sweep", "lift", "-10 um", "0 um", "1"), "2 or more"),
    ],
)
def test_what_cannot_be_is_one_message(words, said, capsys):
    assert linearise("valve.yaml", *words) == 2

    assert said in capsys.readouterr().err


def test_the_report_has_the_answer_and_the_tables():
    assert linearise("relief.yaml", "--band", "2 kHz", "--out", "out", "--quiet") == 0

    page = Path("out/report.html").read_text()
    assert "Unstable: a small disturbance oscillates" in page
    assert "participation" in page.lower()


@pytest.mark.slow
def test_the_page_quotes_what_is_printed(capsys):
    page = (HOW_TO / "linearise.md").read_text(encoding="utf-8")
    quoted = re.findall(r"```\n((?:frequency|value|Unstable|loop).*?)```", page, re.DOTALL)
    assert len(quoted) == 4

    words = ("--band", "3 kHz", "--no-report", "--loop", "edge.mass_flow")
    diameters = ("network.components.damper.diameter", "0.15 mm", "0.35 mm", "9")
    assert linearise("relief.yaml", *words, "--sweep", *diameters) == 0
    printed = capsys.readouterr().out
    for text in quoted:
        compare(text, printed, "linearise.md")
