#!/usr/bin/env bash
# pyuff 2.5.8: a binary data set 58 that is written with mode "overwrite" leaves a file of 7 bytes.
#
# Guess: "overwrite" starts a new file and writes the whole set, as it does for text.
# Reality, 2026-11-29: the file is opened anew for the samples and once more for the end mark; "    -1" is
# all that stays.  No error, no warning.  The default mode "add" to a new file writes the whole set.
# Why it matters here: 58b is the compact form of long recordings; the loss is seen when they are read,
# perhaps after the test bench is gone.  klack refuses such a file as one without data sets.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check pyuff==2.5.8 numpy==2.2.6
cd "$place"
"$place/env/bin/python" -W ignore - <<'PYTHON'
from pathlib import Path

import numpy as np
import pyuff

sizes = {}
for binary in (0, 1):
    for mode in ("add", "overwrite"):
        lift = pyuff.prepare_58(
            func_type=1, rsp_node=1, rsp_dir=1, ref_node=1, ref_dir=1, ord_data_type=4, id1="lift",
            binary=binary, data=np.arange(1000.0), x=np.arange(1000) * 1e-6,
        )
        lift["orddenom_spec_data_type"] = 0
        path = Path(f"{mode}{binary}.uff")
        pyuff.UFF(str(path)).write_sets([lift], mode)
        sizes["binary" if binary else "text", mode] = path.stat().st_size
print(sizes)
assert sizes.pop(("binary", "overwrite")) == 7 and min(sizes.values()) > 8000, sizes
PYTHON
echo "as found: 7 bytes"
