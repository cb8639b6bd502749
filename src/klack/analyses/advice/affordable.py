"""Advice whose meshes a machine can hold, for a looser target if need be."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from klack.analyses.advice.advice import Counsel, Fixed, Measured, settle
from klack.analyses.advice.cost import fits, memory_of
from klack.analyses.advice.ladder import Measure
from klack.input.problem import Key

__all__ = ["affordable"]

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

    Affordable is what needs no more than half of the free memory, and no more than twenty times
    the degrees of freedom of the case.  For a multiple no setting becomes coarser than the case.

    Parameters
    ----------
    measured, fixed, measures
        As for :func:`klack.analyses.advice.advice.settle`.
    size_with : callable
        Degrees of freedom of all bodies with these values.
    present : int
        Those of the case.
    dimension : int

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
        f"{memory_of(needed, dimension) / 1e9:.2g} GB: too many for the free memory, or more than "
        f"{_MOST_GROWTH:g} times those of the case. The advice is for {looser:g} times the target. "
        "Try: axisymmetric half sections where the supports allow them, or apply the advice "
        "and run it again.",
    )


def _no_coarser(measured: Sequence[Measured]) -> list[Measured]:
    return [replace(item, at_least=min(item.at_least, 1.0)) for item in measured]
