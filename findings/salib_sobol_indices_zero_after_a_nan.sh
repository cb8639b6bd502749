#!/usr/bin/env bash
# SALib 1.6.0: one output that is not a number makes all Sobol indices and their intervals zero.
#
# Guess: the indices are nan too, as those of SALib 1.5.2 are, or an error names the output.
# Reality, 2026-11-29: S1 and S1_conf are 0.0 for every parameter, without a warning.  ST is zero, too.
# Why it matters here: a study of strokes loses points (a run that stops, a measure that does not
# exist there), and a designer would read that no parameter matters.  klack discards the base rows
# of such points and says how many; with too few rows left the indices are blank, and it says why.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check SALib==1.6.0 numpy==2.4.6 scipy==1.17.1
cd "$place"
"$place/env/bin/python" -W error::RuntimeWarning - <<'PYTHON'
from importlib.metadata import version

import numpy as np
from SALib.analyze import sobol as analyze
from SALib.sample import sobol as sample

problem = {"num_vars": 3, "names": ["a", "b", "c"], "bounds": [[-np.pi, np.pi]] * 3}
x = sample.sample(problem, 1024, calc_second_order=False, seed=1)
y = np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
whole = analyze.analyze(problem, y, calc_second_order=False, seed=1)
y[5] = np.nan
lost = analyze.analyze(problem, y, calc_second_order=False, seed=1)
print("SALib", version("SALib"))
print("5120 outputs     S1", whole["S1"].round(3), "ST", whole["ST"].round(3))
print("one is nan       S1", lost["S1"], "ST", lost["ST"], "S1_conf", lost["S1_conf"])
assert np.allclose(whole["S1"], [0.314, 0.442, 0.0], atol=0.01), whole["S1"]  # Ishigami, exact
assert (lost["S1"] == 0.0).all() and (lost["S1_conf"] == 0.0).all(), lost
PYTHON
echo "as found: zero for every parameter"
