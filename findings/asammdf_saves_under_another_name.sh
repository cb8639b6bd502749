#!/usr/bin/env bash
# asammdf 8.8.28: save("stroke.part") writes stroke.mf4, whatever stands there with overwrite=True.
#
# Guess: a file is written under the name that was given.
# Reality, 2026-11-29: the suffix is replaced; stroke.part does not exist, and a former stroke.mf4 is gone.
# The new name is returned, without a warning.
# Why it matters here: a result is written beside its place and renamed when it is whole; that way the
# former one would be replaced first.  klack gives the passing file the suffix .mf4.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check asammdf==8.8.28 numpy==2.2.6
cd "$place"
"$place/env/bin/python" - <<'PYTHON'
from pathlib import Path

import numpy as np
from asammdf import MDF, Signal


def save(name, lift):
    file = MDF(version="4.10")
    file.append([Signal(np.array(lift), np.arange(2) * 1e-6, unit="um", name="lift")])
    return file.save(name, overwrite=True)


save("stroke.mf4", [1.0, 2.0])
given = save("stroke.part", [3.0, 4.0])
there, lift = sorted(path.name for path in Path().glob("stroke*")), MDF("stroke.mf4").get("lift")
print("returned", given, "there", there, "lift", lift.samples)
assert there == ["stroke.mf4"] and lift.samples.tolist() == [3.0, 4.0], (there, lift)
PYTHON
echo "as found: the suffix is replaced, and so is the other file"
