"""What all commands promise: help, JSON, stops, one clear error.

The help of every command shows an example; truth: the parser, and the cases that exist.

Every command knows --json; truth: the schema that klack schema --kind result prints.

A stop is a stop wherever it comes; truth = the exit codes that shells know.

Commands that know a motion along the axis only; truth: one clear error, and nothing built.

A measured file that cannot be read ends a command with one message and exit code 2.

The commands on bodies of other programs, and the guide: truth = what they promise.
"""

import ctypes
import json
import shlex
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from json_schema_check import require_documented
from pages import ROOT, blocks, printed

import klack.cli.main
from klack.case import find_case, load_case
from klack.cli.commands import COMMANDS, parser
from klack.cli.main import main


@pytest.mark.parametrize(
    ("command", "example"), COMMANDS.items(), ids=[command.__name__ for command in COMMANDS]
)
def test_the_example_can_be_typed(command, example, capsys):
    name = command.__name__
    assert main([name, "--help"]) == 0
    assert " ".join(capsys.readouterr().out.split("Example:")[-1].split("╭")[0].split()) == example

    first, *words = shlex.split(example)
    found, bound, _ = parser.parse_args(words, print_error=False, exit_on_error=False)

    assert (first, words[0]) == ("klack", name)
    assert found is command
    if "case" in bound.arguments:
        case = bound.arguments["case"]  # shipped, or of the documentation
        assert find_case(ROOT / case if len(case.parts) > 1 else case).is_file()


DATA = Path(__file__).parents[1] / "data"
RODS = DATA / "tiny_rods.yaml"
VALVE = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"


def said(capsys: pytest.CaptureFixture[str], *words: object) -> dict:
    """JSON of a command on the terminal: nothing else may stand there."""
    assert main([*map(str, words), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    require_documented(found)
    return found


def test_every_command_takes_it(capsys):
    for command in COMMANDS:
        if command.__name__ in ("app", "completion"):  # a server until Ctrl-C; a script
            continue
        capsys.readouterr()
        assert main([command.__name__, "--help"]) == 0
        assert "--json" in capsys.readouterr().out, command


def test_an_impact_its_report_its_export_and_its_files(tmp_path, capsys):
    out = tmp_path / "out"
    impact = said(capsys, "impact", RODS, "--no-report", "--no-certify", "--out", out)
    report = said(capsys, "report", out)
    export = said(capsys, "export", out, "--to", "csv", "--out", tmp_path / "csv")
    parts = said(capsys, "inspect", RODS)

    assert impact["schema"] == "klack-impact/1"
    assert impact["levels"]["reduced"]["peak_force_N"] > 0.0
    assert all((out / name).is_file() for name in report["files"])
    assert sorted(path.name for path in (tmp_path / "csv").iterdir()) == export["files"]
    assert set(parts["parts"]) == {"short", "long", "case: impact"}


def test_a_stroke_and_a_reduction(tmp_path, capsys):
    words = ("--no-report", "--variant", "dry", "--duration", "0.1 ms", "--out", tmp_path)
    stroke = said(capsys, "stroke", VALVE, *words)
    reduction = said(capsys, "reduce", RODS, "--out", tmp_path)

    assert stroke["schema"] == "klack-stroke/1"
    assert reduction["bodies"]["short"]["rigid_modes"] == 1


@pytest.mark.parametrize("kind", ["stroke", "stroke-steady", "shots", "stroke-shots", "noise"])
def test_who_reads_a_result_by_program_sees_its_doubts(kind, capsys):
    assert main(["schema", "--kind", "result"]) == 0
    (whole,) = (
        part["properties"]
        for part in json.loads(capsys.readouterr().out)["$defs"].values()
        if part["properties"].get("schema", {}).get("const") == f"klack-{kind}/1"
    )
    assert whole["warnings"]["items"] == {"type": "string"}


@pytest.mark.slow
def test_the_cache_and_a_verification(capsys):
    assert said(capsys, "cache")["schema"] == "klack-cache/1"
    assert all(
        check["passed"] for check in said(capsys, "verify", "--group", "mechanics")["checks"]
    )


def test_the_schema_is_printed(capsys):
    assert main(["schema", "--kind", "result"]) == 0
    schema = json.loads(capsys.readouterr().out)

    kinds = {
        definition["properties"]["schema"]["const"]
        for definition in schema["$defs"].values()
        if "schema" in definition["properties"]
    }
    commands = {kind.removeprefix("klack-").split("-")[0].split("/")[0] for kind in kinds}
    assert len(kinds) == len(schema["oneOf"])
    # demo writes what impact writes, optimise what study writes; app and completion write none
    own = {command.__name__ for command in COMMANDS} - {
        "demo",
        "optimise",
        "schema",
        "app",
        "completion",
    }
    assert commands == own


@pytest.mark.parametrize("change", ["missing", "unknown", "type"])
def test_the_check_sees_what_differs(change, capsys):
    found = said(capsys, "cache")
    if change == "missing":
        del found["count"]
    else:
        found["count" if change == "type" else "kount"] = "many"
    with pytest.raises(AssertionError):
        require_documented(found)


def _stopped_in_a_callback(number: int) -> None:
    """As a signal comes while LLVM calls back: ctypes lets no exception through."""
    callback = ctypes.CFUNCTYPE(None)(lambda: signal.raise_signal(number))
    callback()


@pytest.fixture
def heard() -> Iterator[None]:
    """Ctrl-C is heard also where the tests were started in the background, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("heard")
@pytest.mark.parametrize(
    ("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)], ids=("Ctrl-C", "SIGTERM")
)
@pytest.mark.parametrize("goes_on", [True, False], ids=("goes on", "fails"))
def test_a_stop_that_a_library_drops_is_a_stop(number, code, goes_on, monkeypatch, capfd):
    def run(arguments: list[str], name: str) -> int:
        _stopped_in_a_callback(number)
        if not goes_on:
            raise RuntimeError("no compiled object yet")
        for _ in range(1000):
            time.sleep(0.01)
        return 0

    monkeypatch.setattr(klack.cli.main, "_run", run)
    handlers = [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]

    assert klack.cli.main.main(["stroke"]) == code
    assert capfd.readouterr().err == "klack stroke: stopped; no partial files are left.\n"
    assert handlers == [signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM)]


def test_an_error_without_a_stop_stays_an_internal_error(monkeypatch, capfd):
    def run(arguments: list[str], name: str) -> int:
        raise RuntimeError("no compiled object yet")

    monkeypatch.setattr(klack.cli.main, "_run", run)

    assert klack.cli.main.main(["stroke"]) == 70
    assert "please report" in capfd.readouterr().err


CASE = Path(__file__).parents[2] / "docs" / "how-to" / "stroke_off_axis.yaml"
STROKES = Path(__file__).parents[2] / "cases" / "measured" / "strokes_synthetic.csv"
FITTED = (
    "calibration: {parameters: {preload: {key: network.components.spring.preload, "
    "lower: 8 N, upper: 16 N}}}\n"
)
POLISHED = (
    "study:\n  parameters: {network.components.spring.preload: {from: 8 N, to: 16 N}}\n"
    "  measures: [opening_time]\n  objectives: {opening_time: minimise}\n"
    "  search: {polish: 4}\n"
)


@pytest.mark.parametrize(
    ("command", "added"),
    [
        (["advise"], ""),
        (["sensitivities", "--parameter", "network.components.spring.preload"], ""),
        (["calibrate", "--measurement", str(STROKES)], FITTED),
        (["optimise"], POLISHED),
        *((["export", "--to", to], "") for to in ("fmu", "mat", "csv", "modelica")),
    ],
)
def test_what_knows_the_axis_only_says_so(command, added, tmp_path, capsys):
    case = tmp_path / "valve.yaml"
    case.write_text(CASE.read_text(encoding="utf-8") + added, encoding="utf-8")

    code = main([command[0], str(case), *command[1:], "--quiet"])

    told = capsys.readouterr().err
    assert code == 2
    assert "three-dimensional" in told or "three dimensions" in told
    assert "Try:" in told
    assert sorted(path.name for path in tmp_path.iterdir()) == ["valve.yaml"]


def test_an_impact_to_show_is_one_of_a_result(tmp_path, capsys):
    code = main(["export", str(CASE), "--to", "vtk", "--impact", "1", "--quiet"])

    assert code == 2
    assert "the folder of a stored stroke in three dimensions" in capsys.readouterr().err
    assert main(["export", str(CASE), "--to", "csv", "--impact", "1", "--quiet"]) == 2
    assert "--impact" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


CASE_FILES = Path(__file__).parents[2] / "cases/measured/case.yaml"
HEADER = "time [s];Needle_Lift [um];I_Coil [A];P_Inlet [bar]\n"  # as the case names them
ROWS = "0;1;2;5\n1e-5;1;2;5\n2e-5;1;2;5\n"

FAULTS = {
    "a word": (HEADER + ROWS + "3e-5;open;2;5\n", ["bench.csv:5, column 2: got 'open'", "Try: "]),
    "no lift": (
        HEADER.replace("Needle_Lift", "lift") + ROWS,
        ["measurement.channels.lift: got no channel 'Needle_Lift', expected one of: lift, I_Coil"],
    ),
    "no unit": (HEADER.replace(" [um]", "") + ROWS, ["'Needle_Lift' (lift): got no unit"]),
    "no time": ("Needle_Lift [um]\n1\n2\n3\n", ["got no time", "time_step: 10 us"]),
    "a workbook": ("PK\x03\x04", ["a zip archive or an Excel workbook", "export it as CSV"]),
}


@pytest.mark.parametrize(("text", "said"), FAULTS.values(), ids=FAULTS)
def test_unreadable_measurements(tmp_path, capsys, text, said):
    path = tmp_path / "bench.csv"
    path.write_text(text)
    code = main(
        ["calibrate", str(CASE_FILES), "--measurement", str(path), "--out", str(tmp_path / "o")]
    )
    message = capsys.readouterr().err
    assert code == 2
    assert all(words in message for words in said), message
    assert "Traceback" not in message


def test_a_missing_reader_says_how_to_install_it(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "nptdms", None)
    path = tmp_path / "bench.tdms"
    path.write_bytes(b"TDSm")
    code = main(
        ["calibrate", str(CASE_FILES), "--measurement", str(path), "--out", str(tmp_path / "o")]
    )
    message = capsys.readouterr().err
    assert code != 0
    assert "pip install 'FILE.whl[measurement]'" in message
    assert "Traceback" not in message


PAGE = (Path(__file__).parents[2] / "docs/how-to/bring-a-reduced-model.md").read_text()
CASE_COMMANDS = Path(__file__).parents[2] / "cases/from-other-tools/case.yaml"


@pytest.mark.slow
def test_impact_and_reduce_of_the_shipped_case(capsys):
    assert main(["impact", "from-other-tools", "--json", "numbers.json", "--quiet"]) == 0
    numbers = json.loads(Path("numbers.json").read_text())["levels"]
    assert numbers["reduced"]["restitution"] == pytest.approx(0.5, abs=0.005)
    folder = Path("klack-results/from-other-tools")
    assert {"result.zarr", "report.html", "report.pdf"} <= {p.name for p in folder.iterdir()}
    page = (folder / "report.html").read_text()
    assert "state space in needle.csv" in page
    assert "modal data in seat.uff" in page
    assert main(["reduce", "from-other-tools", "--json", "bodies.json"]) == 0
    assert "98.5" in capsys.readouterr().out
    bodies = json.loads(Path("bodies.json").read_text())["bodies"]
    assert bodies["needle"]["mass_kg"] == pytest.approx(3.9458e-3, rel=1e-4)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (["impact", "from-other-tools", "--level", "full"], "levels among: lumped, reduced"),
        (["shots", "from-other-tools"], "shots"),
        (["export", "from-other-tools", "--to", "calculix"], "meshed surfaces"),
    ],
)
def test_what_needs_a_mesh_ends_with_a_message(capsys, command, words):
    assert main(command) == 2
    error = capsys.readouterr().err
    assert "Traceback" not in error
    assert words in error


@pytest.mark.slow
def test_noise_knows_the_force_alone(capsys):
    assert main(["noise", "from-other-tools"]) == 0
    assert "only the spectra of the force are known" in capsys.readouterr().out


def test_example_of_the_guide_prints_what_it_says():
    assert printed(blocks(PAGE, "python")[0], "guide") == blocks(PAGE, "text")[0]


def test_case_of_the_guide_can_be_read(tmp_path):
    text = blocks(PAGE, "yaml")[0]
    for name in ("needle.mat", "seat.uff"):
        (tmp_path / name).write_text("")
    (tmp_path / "case.yaml").write_text(
        f"klack: 1\ntitle: guide\n{text}motion: {{speed: 1 m/s}}\nlumped: {{stiffness: 1e9 N/m}}\n"
    )
    case = load_case(tmp_path / "case.yaml")
    assert case.bodies["seat"].reduced.ports["face"].input == "11 12 13 z"
