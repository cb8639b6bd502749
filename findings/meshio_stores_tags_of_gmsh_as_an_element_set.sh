#!/usr/bin/env bash
# meshio 5.3.5: a Gmsh 4.1 mesh that becomes an Abaqus deck gets an element set of signed tags.
#
# Guess: the sets of the deck are the physical groups, and list numbers of its elements.
# Reality, 2026-11-29: a set gmsh:bounding_entities is added.  It holds the tags of the surfaces that
# bound a volume, with their signs, shifted like element numbers: -3 and 9 in a deck of two elements.
# Why it matters here: klack refused such decks for a number that no element has, or would have
# named elements of a solid by a tag.  It now leaves the set out, and says so.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check meshio==5.3.5 numpy==2.2.6
cd "$place"
cat > tetrahedron.msh <<'MSH'
$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
2
2 1 "seat"
3 2 "steel"
$EndPhysicalNames
$Entities
0 0 2 1
5 0 0 0 1 1 0 1 1 0
7 0 0 0 1 0 1 0 0
1 0 0 0 1 1 1 1 2 2 -5 7
$EndEntities
$Nodes
1 4 1 4
3 1 0 4
1
2
3
4
0 0 0
1 0 0
0 1 0
0 0 1
$EndNodes
$Elements
2 2 1 2
2 5 2 1
1 1 3 2
3 1 4 1
2 1 2 3 4
$EndElements
MSH
"$place/env/bin/python" - <<'PYTHON'
from pathlib import Path

import meshio

meshio.read("tetrahedron.msh").write("tetrahedron.inp")
sets = Path("tetrahedron.inp").read_text().split("*ELSET, ELSET=")[1:]
print("meshio", meshio.__version__, [text.split() for text in sets])
assert sets[-1].replace(",", " ").split() == ["gmsh:bounding_entities", "-3", "9"], sets
PYTHON
echo "as found: tags -5 and 7 stand as elements -3 and 9"
