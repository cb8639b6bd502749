#!/usr/bin/env bash
# SciPy 1.17.1: mmread takes 1.5D+03 of a Matrix Market file for 1.5.
#
# Guess: 1500, as Fortran means it, or an error at the D.
# Reality, 2026-11-29: the number ends before the D, and the rest of the line is passed over without a word.
# scipy.io.hb_read raises an error for such numbers.
# Why it matters here: solvers written in Fortran print double precision with D, and a stiffness that
# loses its powers of ten still is a symmetric matrix.  klack reads these numbers itself.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check scipy==1.17.1 numpy==2.4.6
"$place/env/bin/python" - <<'PYTHON'
from io import StringIO

import scipy
from scipy.io import mmread

HEAD = "%%MatrixMarket matrix coordinate real symmetric\n2 2 3\n"
found = {
    letter: mmread(
        StringIO(HEAD + "".join(f"{place} 1.5{letter}+03\n" for place in ("1 1", "2 1", "2 2")))
    ).toarray()
    for letter in "ED"
}
print("scipy", scipy.__version__, {letter: A.tolist() for letter, A in found.items()})
assert (found["E"] == 1500.0).all() and (found["D"] == 1.5).all(), found
PYTHON
echo "as found: a thousand times too small"
