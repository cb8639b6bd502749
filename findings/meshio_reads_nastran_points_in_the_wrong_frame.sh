#!/usr/bin/env bash
# meshio 5.3.5: points of a Nastran deck in a local coordinate system are read as global ones.
#
# Guess: GRID with CP = 7 is turned by CORD2R 7, or refused.
# Reality, 2026-11-29: the third field is passed over without a word.  A point at 1 along the first axis
# of a frame whose first axis is y comes as (1, 0, 0) instead of (0, 1, 0).
# Why it matters here: parts of a valve are often drawn in frames of their own; a needle lies beside its
# seat, and a volume has no sign of it.  klack reads such decks itself, with all frames.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check meshio==5.3.5 numpy==2.2.6
cd "$place"
cat > tetrahedron.bdf <<'BDF'
BEGIN BULK
CORD2R  7               0.      0.      0.      0.      0.      1.
        0.      1.      0.
GRID    1       7       1.      0.      0.
GRID    2               0.      0.      0.
GRID    3               1.      0.      0.
GRID    4               0.      0.      1.
CTETRA  1       1       2       3       1       4
ENDDATA
BDF
"$place/env/bin/python" - <<'PYTHON'
import meshio

mesh = meshio.read("tetrahedron.bdf")
print("meshio", meshio.__version__, "node 1 at", mesh.points[0])
assert mesh.points[0].tolist() == [1.0, 0.0, 0.0], mesh.points
PYTHON
echo "as found: the local point is taken for a global one"
