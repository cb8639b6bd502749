"""Linear equations of what flows between volumes."""

from typing import Any

from klack.compiling.jit import inner

__all__ = ["solve_mass_balance"]


@inner(error_model="numpy", _nrt=False, forceinline=True)
def solve_mass_balance(A: Any, own: Any, r: Any, n: int) -> None:
    """Gauss without pivoting and without subtracting, ``A`` row by row and its column sums ``own``.

    What leaves a volume fills another: beside the diagonal ``A`` is below zero, and its column sums
    are what a pressure changes in all volumes together, above zero.  Pivots follow from these sums
    (Grassmann, Taksar & Heyman 1985), the diagonal is not looked at.  So a wide channel between two
    almost empty volumes, whose storage is less than the round-off of its flow, is solved as well.
    """
    for k in range(n):
        pivot = own[k]
        for i in range(k + 1, n):
            pivot -= A[i * n + k]
        A[k * n + k] = pivot
        inverse = 1.0 / pivot
        share = own[k] * inverse
        for j in range(k + 1, n):
            own[j] -= A[k * n + j] * share
        for i in range(k + 1, n):
            if A[i * n + k] != 0.0:
                c = A[i * n + k] * inverse
                for j in range(k + 1, n):
                    A[i * n + j] -= c * A[k * n + j]
                r[i] -= c * r[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            r[k] -= A[k * n + j] * r[j]
        r[k] /= A[k * n + k]
