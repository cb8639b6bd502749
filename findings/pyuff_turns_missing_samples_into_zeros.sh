#!/usr/bin/env bash
# pyuff 2.5.8: write_sets turns samples that are nan into zeros, in the caller's data as well.
#
# Guess: nan is written as nan, or refused.
# Reality, 2026-11-29: nan becomes 0.0 and inf 1.8e308, in the file and in the dictionary that was given.
# No warning.
# Why it matters here: where a laser loses its target the samples of the lift are nan; as zeros they are
# a needle that jumps onto its seat and back.  klack's page on measurement files says what to do.
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
    data=np.array([80.0, np.nan, 79.0, 78.0]), x=np.arange(4) * 1e-6,
)
lift["orddenom_spec_data_type"] = 0
pyuff.UFF("lift.uff").write_sets([lift])
read = pyuff.UFF("lift.uff").read_sets(0)["data"]
print("read", read, "given afterwards", lift["data"])
assert read.tolist() == lift["data"].tolist() == [80.0, 0.0, 79.0, 78.0], (read, lift["data"])
PYTHON
echo "as found: a lost sample is a lift of zero"
