"""A measured file that cannot be read ends a command with one message and exit code 2."""

import sys
from pathlib import Path

import pytest

from klack.cli.main import main

CASE = Path(__file__).parents[2] / "cases/measured/case.yaml"
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
    code = main(["calibrate", str(CASE), "--measurement", str(path), "--out", str(tmp_path / "o")])
    message = capsys.readouterr().err
    assert code == 2
    assert all(words in message for words in said), message
    assert "Traceback" not in message


def test_a_missing_reader_says_how_to_install_it(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "nptdms", None)
    path = tmp_path / "bench.tdms"
    path.write_bytes(b"TDSm")
    code = main(["calibrate", str(CASE), "--measurement", str(path), "--out", str(tmp_path / "o")])
    message = capsys.readouterr().err
    assert code != 0
    assert "pip install 'klack[measurement]'" in message
    assert "Traceback" not in message
