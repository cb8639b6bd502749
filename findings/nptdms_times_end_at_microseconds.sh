#!/usr/bin/env bash
# npTDMS 1.13.0 cuts start times of waveforms to whole microseconds, when it writes and when it reads.
#
# Guess: TDMS keeps times in units of 2^-64 s, so a start time of 300 ns after a second survives.
# Reality, 2026-11-28: a numpy.datetime64 of nanoseconds is written as its microsecond; a file that
# holds 300 ns is read as 0 unless TdmsFile.read is asked for raw_timestamps=True.  No warning.
# Why it matters here: the start times of two channels give the time base that both share.  A needle
# that touches at 0.5 m/s moves 0.5 um in a microsecond, and klack compares touches to 0.05 us.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check nptdms==1.13.0 numpy==2.2.6
"$place/env/bin/python" - <<'PYTHON'
import io

import numpy as np
from nptdms import ChannelObject, TdmsFile, TdmsWriter
from nptdms.timestamp import TdmsTimestamp


def start(stored, **how):
    """The start time that comes back of one that is stored."""
    file = io.BytesIO()
    times = {"wf_start_time": stored, "wf_increment": 1e-6}
    with TdmsWriter(file) as writer:
        writer.write_segment([ChannelObject("group", "lift", np.arange(3.0), properties=times)])
    file.seek(0)
    found = TdmsFile.read(file, **how)["group"]["lift"].properties["wf_start_time"]
    return found.as_datetime64("ns") if how else np.datetime64(found, "ns")


second = np.datetime64("2024-01-02T00:26:40", "ns")
written = start(second + np.timedelta64(300, "ns"), raw_timestamps=True) - second
exact = TdmsTimestamp(3_787_000_000, int(300.5e-9 * 2**64))
read, raw = start(exact) - second, start(exact, raw_timestamps=True) - second
print(f"written as datetime64 of 300 ns: {written}; read of 300 ns: {read}; raw: {raw}")
assert (written, read, raw) == tuple(np.timedelta64(k, "ns") for k in (0, 0, 300)), "it changed"
PYTHON
echo "as found: 300 ns are lost in both ways, and kept by raw time stamps alone"
