"""What a refined run would need: degrees of freedom, memory, time, by powers of the size.

Rough, and meant to be: they decide whether a finer mesh is tried, and what a user may expect.
"""

from klack.memory import available_memory

__all__ = ["added", "fits", "larger", "memory_of", "time_of"]

_SHARE = 0.5  # of the free memory

# factor and exponent of peak memory [bytes] of two bodies with n degrees of freedom in all, and the
# exponent of the time: nested dissection fills n log n in the plane, n^(4/3) in space; measured
# 3 GB for 87 000 in space and 0.5 GB for 85 000 in the plane
_MEMORY = {2: (6.0e3, 1.0), 3: (780.0, 4.0 / 3.0)}
_TIME = {2: 1.2, 3: 1.5}


def larger(dofs: int, factor: float, dimension: int) -> int:
    """Most degrees of freedom that refining one region by a factor below 1 can make."""
    return round(dofs * factor**-dimension)


def added(present: int, run: tuple[float, int], factor: float, dimension: int) -> float:
    r"""Degrees of freedom that one region adds at a factor, from one run with that region changed.

    A region of fixed extent holds :math:`b f^{-d}` of them: :math:`b` from the run.

    Parameters
    ----------
    present : int
        Of the case.
    run : pair of float and int
        Factor of the run, and its degrees of freedom.
    factor : float
    dimension : int

    Examples
    --------
    Half the size once made 1000 into 8000; two thirds of it make 3375:

    >>> round(1000 + added(1000, (0.5, 8000), 2 / 3, 3))
    3375
    """
    known, dofs = run
    share = (dofs - present) / (known**-dimension - 1.0)
    return max(share, 0.0) * (factor**-dimension - 1.0)


def memory_of(dofs: int, dimension: int) -> float:
    """Peak memory [bytes]."""
    factor, exponent = _MEMORY[dimension]
    return float(factor * dofs**exponent)


def time_of(dofs: int, dimension: int) -> float:
    """Time in a unit of its own: for ratios."""
    return float(dofs ** _TIME[dimension])


def fits(dofs: int, dimension: int) -> bool:
    """Whether a run of this size is expected to use no more than half of the free memory.

    Free is what is left to this process, inside a container or a batch job too.
    """
    return memory_of(dofs, dimension) <= _SHARE * available_memory().size
