#!/usr/bin/env bash
# ngsolve 6.2.2608: inverse="sparsecholesky" solves indefinite systems without a word.
#
# Guess: a Cholesky factorisation fails at a negative pivot, as LAPACK's and PARDISO's for type 2 do.
# Reality, 2026-11-29: eigenvalues -3.4, 2.0 and 2.4 make no difference; the solution solves the system.
# It is a factorisation L D L^T, and nothing tells the sign of D.
# Why it matters here: a stiffness with a negative eigenvalue is a fault of the model (a buckled state, a
# wrong sign in a given matrix), and a failed Cholesky is the usual test for it.  klack tests by itself.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check ngsolve==6.2.2608 numpy==2.2.6
"$place/env/bin/python" - <<'PYTHON'
import ngsolve
import numpy as np

A = np.array([[2.0, 1.0, 0.0], [1.0, -3.0, 1.0], [0.0, 1.0, 2.0]])
b = np.array([1.0, 2.0, 3.0])
rows, columns = np.nonzero(A)
matrix = ngsolve.la.SparseMatrixd.CreateFromCOO(
    rows.astype(np.int32), columns.astype(np.int32), A[rows, columns], 3, 3
)
right, x = matrix.CreateColVector(), matrix.CreateColVector()
right.FV().NumPy()[:] = b
x.data = matrix.Inverse(inverse="sparsecholesky") * right
residual = np.abs(A @ x.FV().NumPy() - b).max()
print("eigenvalues", np.linalg.eigvalsh(A).round(2), "residual", residual)
try:
    np.linalg.cholesky(A)
except np.linalg.LinAlgError as error:
    print("LAPACK:", error)
else:
    raise AssertionError("LAPACK took it")
assert residual < 1e-12, residual
PYTHON
echo "as found: no sign of the negative eigenvalue"
