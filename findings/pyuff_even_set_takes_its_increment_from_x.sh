#!/usr/bin/env bash
# pyuff 2.5.8: a data set 58 with even abscissa gets its increment from the first two x, whatever
# it is given, and one that prepare_58 makes with its defaults is refused by write_sets.
#
# Guess: abscissa_min and abscissa_inc say what is written, or x that is not even is refused.
# Reality, 2026-11-28: minimum 5 us and increment 2 us given beside x = 0, 1, 2, 3 us are written as
# 0 and 1 us; x = 0, 1, 5, 6 us marked as even becomes 0, 1, 2, 3 us.  No warning.  And write_sets
# asks for 'orddenom_spec_data_type', which prepare_58 leaves out.
# Why it matters here: whoever exports a recording with pauses that way gives klack a lift whose
# later touches come too early; the file itself holds no sign of it.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check pyuff==2.5.8 numpy==2.2.6
cd "$place"
"$place/env/bin/python" -W ignore - <<'PYTHON'
import numpy as np
import pyuff


def made(x, **more):
    return pyuff.prepare_58(
        func_type=1, rsp_node=1, rsp_dir=1, ref_node=1, ref_dir=1, data=np.arange(4.0), x=x,
        id1="lift", binary=0, ord_data_type=4, **more,
    )


def written(data):
    data["orddenom_spec_data_type"] = 0
    pyuff.UFF("lift.uff").write_sets([data], "overwrite")
    return pyuff.UFF("lift.uff").read_sets(0)["x"]


even, paused = np.array([0.0, 1e-6, 2e-6, 3e-6]), np.array([0.0, 1e-6, 5e-6, 6e-6])
try:
    pyuff.UFF("lift.uff").write_sets([made(even)], "overwrite")
except Exception as error:
    refused = str(error)
given = written(made(even, abscissa_spacing=1, abscissa_min=5e-6, abscissa_inc=2e-6))
marked = written(made(paused, abscissa_spacing=1))
uneven = written(made(paused, abscissa_spacing=0))
print(f"with defaults: {refused}\n5 us + 2 us k: {given}\nmarked as even: {marked}\nnot: {uneven}")
assert "orddenom_spec_data_type" in refused, "it changed"
assert np.allclose(given, even) and np.allclose(marked, even) and np.allclose(uneven, paused)
PYTHON
echo "as found: the increment is that of the first two x"
