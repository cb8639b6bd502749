#!/usr/bin/env bash
# Universal files, data set 58: abscissae of uneven data have six digits, also beside ordinates in
# double precision (E13.5 beside E20.12); pyuff 2.5.8 as a writer that keeps to the format.
#
# Guess: a set in double precision holds both columns in double precision.
# Reality, 2026-11-29: times of 100.000000 to 100.000006 s are four times 100.000 s in the file.
# Why it matters here: a recorder that keeps only what changes stores uneven times, often since its
# start.  A touch is sought to 0.05 us: after 50 ms the steps of the format are longer.  klack refuses
# times that do not rise.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check pyuff==2.5.8 numpy==2.2.6
cd "$place"
"$place/env/bin/python" -W ignore - <<'PYTHON'
import numpy as np
import pyuff

lift = pyuff.prepare_58(
    func_type=1, rsp_node=1, rsp_dir=1, ref_node=1, ref_dir=1, ord_data_type=4, id1="lift", binary=0,
    data=np.arange(4.0) + 1e-9, x=100.0 + np.array([0.0, 1e-6, 5e-6, 6e-6]), abscissa_spacing=0,
)
lift["orddenom_spec_data_type"] = 0
pyuff.UFF("lift.uff").write_sets([lift])
read = pyuff.UFF("lift.uff").read_sets(0)
print("times", read["x"], "lift - 0, 1, 2, 3:", read["data"] - np.arange(4.0))
assert (read["x"] == 100.0).all() and np.allclose(read["data"] - np.arange(4.0), 1e-9, rtol=1e-2)
PYTHON
echo "as found: four equal times, and eleven digits of the lift"
