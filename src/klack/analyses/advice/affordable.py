"""Advice whose meshes a machine can hold, for a looser target if need be.

Degrees of freedom, memory and time of a refined run are rough estimates, by powers of the size.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from klack.analyses.advice.advice import Counsel, Fixed, Measured, settle
from klack.analyses.advice.ladder import Measure
from klack.input.problem import Key
from klack.machine.memory import available_memory

__all__ = ["added", "affordable", "fits", "larger", "memory_of", "time_of"]


_SHARE = 0.5  # of the free memory

# factor and exponent of peak memory [bytes] of two bodies with n degrees of freedom in all, and the
# exponent of the time: nested dissection fills n log n in the plane, n^(4/3) in space; measured
# 3 GB for 87 000 in space and 0.5 GB for 85 000 in the plane
_MEMORY = {2: (6.0e3, 1.0), 3: (780.0, 4.0 / 3.0)}
_TIME = {2: 1.2, 3: 1.5}


def larger(dofs: int, factor: float, dimension: int) -> int:
    """Most degrees of freedom from refining one region by a factor below 1."""
    return round(dofs * factor**-dimension)


def added(present: int, run: tuple[float, int], factor: float, dimension: int) -> float:
    """Degrees of freedom that one region adds at a factor, from one run with that region changed.

    A region of fixed extent holds :math:`b f^{-d}` of them: :math:`b` from the run.

    Parameters
    ----------
    present
        Of the case.
    run
        Its factor and degrees of freedom.

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
    """Time in its own unit, for ratios."""
    return float(dofs ** _TIME[dimension])


def fits(dofs: int, dimension: int) -> bool:
    """Whether a run of this size needs at most half of the free memory."""
    return memory_of(dofs, dimension) <= _SHARE * available_memory().size


_LOOSER = (1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0)
_MOST_GROWTH = 20.0  # of the degrees of freedom


def affordable(
    measured: Sequence[Measured],
    fixed: Sequence[Fixed],
    measures: Sequence[Measure],
    *,
    size_with: Callable[[Mapping[Key, float]], int],
    present: int,
    dimension: int,
) -> tuple[tuple[Counsel, ...], int, str]:
    """Settle a target, or the tightest multiple of it whose meshes are affordable.

    Affordable is what :func:`fits`, with no more than twenty times the degrees of freedom of the
    case (``present``).  For a multiple no setting becomes coarser than the case.

    Returns
    -------
    counsels : tuple of Counsel
    dofs : int
    note : str
        Empty where the target itself was affordable.
    """
    needed = 0
    for looser in _LOOSER:
        limits = [replace(measure, limit=looser * measure.limit) for measure in measures]
        counsels = settle(measured if looser == 1.0 else _no_coarser(measured), fixed, limits)
        dofs = size_with({key: v for item in counsels for key, v in item.changes.items()})
        needed = needed or dofs
        if fits(dofs, dimension) and dofs <= _MOST_GROWTH * present:
            break
    if looser == 1.0:
        return counsels, dofs, ""
    return (
        counsels,
        dofs,
        f"The meshes for this target would have about {needed:.2g} degrees of freedom and need "
        f"{memory_of(needed, dimension) / 1e9:.2g} GB: too many for the free memory, or more "
        f"than {_MOST_GROWTH:g} times as many as in the case. The advice is for {looser:g} times "
        "the target. Try: axisymmetric half sections where the supports allow them, or apply "
        "the advice and run it again.",
    )


def _no_coarser(measured: Sequence[Measured]) -> list[Measured]:
    return [replace(item, at_least=min(item.at_least, 1.0)) for item in measured]
