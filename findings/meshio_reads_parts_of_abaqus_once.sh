#!/usr/bin/env bash
# meshio 5.3.5: of an Abaqus assembly with two instances of a part one is read, without its surface.
#
# Guess: two balls, the second moved by 5, each with its set and its surface; or an error.
# Reality, 2026-11-29: one element at the place of the part; the shift and *SURFACE are passed over
# without a word.
# Why it matters here: Abaqus/CAE writes every model as parts and instances, and contact faces as
# *SURFACE.  klack reads both itself.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check meshio==5.3.5 numpy==2.2.6
cd "$place"
cat > balls.inp <<'INP'
*PART, NAME=BALL
*NODE
1, 0., 0., 0.
2, 1., 0., 0.
3, 0., 1., 0.
4, 0., 0., 1.
*ELEMENT, TYPE=C3D4, ELSET=STEEL
1, 1, 2, 3, 4
*SURFACE, NAME=FLAT, TYPE=ELEMENT
STEEL, S1
*END PART
*ASSEMBLY, NAME=BOTH
*INSTANCE, NAME=LEFT, PART=BALL
*END INSTANCE
*INSTANCE, NAME=RIGHT, PART=BALL
5., 0., 0.
*END INSTANCE
*END ASSEMBLY
INP
"$place/env/bin/python" - <<'PYTHON'
import meshio

mesh = meshio.read("balls.inp")
names = [*mesh.cell_sets, *mesh.point_sets]
print("meshio", meshio.__version__, mesh.cells, names, "largest x", mesh.points[:, 0].max())
assert len(mesh.cells_dict["tetra"]) == 1 and mesh.points[:, 0].max() == 1.0, mesh
assert names == ["STEEL"], names
PYTHON
echo "as found: one ball of two, and no surface"
