#!/usr/bin/env bash
# meshio 5.3.5: quadrilaterals of a solid's skin become CAX4P in an Abaqus deck, axisymmetric
# elements with pore pressure, and hexahedra become C3D8RH.
#
# Guess: a quadrilateral of a three-dimensional mesh is written as S4 or as a plain surface element.
# Reality, 2026-11-28: TYPE=CAX4P beside TYPE=C3D8RH, without a warning; Abaqus takes no
# axisymmetric elements in a model of three dimensions.
# Why it matters here: a mesh of hexahedra with its marked faces is converted that way for klack,
# which refuses CAX4P as no element of a body, and says where it comes from.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check meshio==5.3.5 numpy==2.2.6
cd "$place"
"$place/env/bin/python" - <<'PYTHON'
from pathlib import Path

import meshio
import numpy as np

points = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], float)
cells = [("hexahedron", [list(range(8))]), ("quad", [[0, 1, 2, 3]])]
meshio.write("cube.inp", meshio.Mesh(points, cells))
types = [line.split("TYPE=")[1] for line in Path("cube.inp").read_text().splitlines() if "TYPE=" in line]
print("meshio", meshio.__version__, types)
assert types == ["C3D8RH", "CAX4P"], types
PYTHON
echo "as found: the quadrilateral of the skin is CAX4P"
