r"""Memory of a factorisation before it is made.

MKL counts the entries of the factor in its analysis. For SuperLU and NGSolve the growth of nested
dissection is taken (George 1973: :math:`n \log n` entries in the plane, Lipton, Rose & Tarjan
1979: :math:`n^{4/3}` in space) with a factor measured on bodies of valves: bulky ones in space,
since slim ones fill less.
"""

from math import log2

from klack.errors import InputError
from klack.machine.memory import available_memory, fits, in_words, require_memory

__all__ = ["FactorMemoryError", "fill_memory", "out_of_memory", "require_factor_memory"]

# Entries per row of the matrix that tell space from plane: 10-node tetrahedra have 80, 6-node
# triangles 23.
_SPATIAL = 40.0
_PLANE = {"superlu": 130.0, "ngsolve": 100.0}  # bytes
_SPACE = {"superlu": 600.0, "ngsolve": 500.0}


class FactorMemoryError(InputError):
    """A factor that does not fit into memory."""


def fill_memory(backend: str, size: int, nonzeros: int) -> float:
    """Estimated memory of a factorisation [byte], from the matrix alone."""
    row = nonzeros / size
    if row > _SPATIAL:
        return _SPACE[backend] * size ** (4.0 / 3.0)
    return _PLANE[backend] * size * log2(max(size, 2))


def require_factor_memory(
    backend: str,
    size: int,
    nonzeros: int,
    needed: float,
    *,
    beside: str = "",
    precision: str = "double",
) -> None:
    """Reject a factorisation that does not fit.

    The error names the element size that would fit: memory grows with h^-4 in space and with h^-2
    in the plane.

    Parameters
    ----------
    size, nonzeros
        Rows and entries of the matrix.
    needed [byte]
    beside
        What of it is not for the factor.
    """
    if fits(needed):  # the words take longer than a small factorisation
        return
    what, hint = _words(backend, size, nonzeros, needed)
    if precision == "single":
        what += ", in single precision"
    if beside:
        what += f" and with {beside},"
    try:
        require_memory("factorisation", needed, what=what, hint=hint)
    except InputError as error:
        raise FactorMemoryError(
            error.where, got=error.got, expected=error.expected, hint=error.hint
        ) from None


def out_of_memory(backend: str, size: int, nonzeros: int, needed: float) -> FactorMemoryError:
    """Error of a factorisation that ran out of memory."""
    what, hint = _words(backend, size, nonzeros, needed)
    there = available_memory()
    return FactorMemoryError(
        "factorisation",
        got=f"{what} needing about {in_words(needed)} of memory, which is not available",
        expected=f"what fits into {in_words(there.size)} ({there.bound})",
        hint=hint,
    )


def _words(backend: str, size: int, nonzeros: int, needed: float) -> tuple[str, str]:
    """Text on what is too large, with remedies."""
    spatial = nonzeros / size > _SPATIAL
    there = max(available_memory().size, 1e6)
    coarser = max((needed / there) ** (0.25 if spatial else 0.5), 1.0)
    ways = [f"elements {1.05 * coarser:.2g} times as large away from the contact"]
    if spatial:
        ways.append("an axisymmetric model, which needs a hundredth")
    if backend == "superlu":
        ways.append("MKL (pip install pypardiso), which needs less")
    ways.append(f"a machine with {in_words(1.3 * needed)} free")
    return f"a matrix of {size} degrees of freedom ({backend})", f"{'; or '.join(ways)}."
