#!/usr/bin/env bash
# netgen 6.2.2608: its "Gmsh2 Format" mirrors every tetrahedron, and states version 2.000000.
#
# Guess: version 2.2, as Gmsh writes it, and elements of positive volume by the manual of Gmsh.
# Reality, 2026-11-29: all tetrahedra of a box of 1 x 2 x 3 are left-handed; their volumes add up to -6.
# The names of the solid and of its faces are not in the file, either.
# Why it matters here: K of such elements has the wrong sign, and a program that tests for inverted
# elements refuses the mesh as damaged.  klack turns them, if all are mirrored, and says so.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check netgen-mesher==6.2.2608 numpy==2.2.6
cd "$place"
"$place/env/bin/python" - <<'PYTHON'
from pathlib import Path

import numpy as np
from netgen.occ import Box, OCCGeometry, Pnt

box = Box(Pnt(0, 0, 0), Pnt(1, 2, 3))
box.mat("steel")
OCCGeometry(box).GenerateMesh(maxh=1.0).Export("box.msh", "Gmsh2 Format")
text = Path("box.msh").read_text()
nodes, elements = (
    [line.split() for line in text.split(name)[1].split("$End")[0].splitlines()[2:]]
    for name in ("$Nodes", "$Elements")
)
points = np.array([row[1:] for row in nodes], float)
corners = np.array([row[-4:] for row in elements if row[1] == "4"], int) - 1
a, b, c, d = np.moveaxis(points[corners], 1, 0)
volumes = ((np.cross(b - a, c - a) * (d - a)).sum(axis=1)) / 6.0
print(text.split()[1], len(volumes), "tetrahedra, volume", volumes.sum(), "steel" in text)
assert text.split()[1] == "2.000000" and (volumes < 0).all() and "steel" not in text
assert abs(volumes.sum() + 6.0) < 1e-5, volumes.sum()
PYTHON
echo "as found: every tetrahedron is mirrored"
