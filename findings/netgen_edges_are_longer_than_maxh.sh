#!/usr/bin/env bash
# netgen 6.2.2608: maxh is not the largest edge of a mesh.
#
# Guess: no edge is longer than maxh, or longer by some percent.
# Reality, 2026-11-29: on a ball of radius 5 with maxh=1 edges of the surface reach 1.5 and edges inside 2.8;
# the mean on the surface is 1.0.
# Why it matters here: the number of elements across a contact radius decides the error of the contact
# force.  klack counts elements across the contact on the mesh as made, and says when they are few.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check netgen-mesher==6.2.2608 numpy==2.2.6
"$place/env/bin/python" - <<'PYTHON'
from itertools import combinations

import numpy as np
from netgen.occ import OCCGeometry, Pnt, Sphere

mesh = OCCGeometry(Sphere(Pnt(0, 0, 0), 5.0)).GenerateMesh(maxh=1.0)
points = np.asarray(mesh.Coordinates())


def edges(elements, corners):
    nodes = elements.NumPy()["nodes"][:, :corners] - 1
    pairs = [points[nodes[:, a]] - points[nodes[:, b]] for a, b in combinations(range(corners), 2)]
    return np.linalg.norm(np.concatenate(pairs), axis=1)


inside, surface = edges(mesh.Elements3D(), 4), edges(mesh.Elements2D(), 3)
print(f"surface: mean {surface.mean():.2f}, largest {surface.max():.2f}; all: {inside.max():.2f}")
assert 0.9 < surface.mean() < 1.1 and surface.max() > 1.3 and inside.max() > 2.0
PYTHON
echo "as found: maxh is about the mean edge of the surface"
