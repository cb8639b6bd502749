"""Errors of the mesh generator in terms of the case: the key, and a size that works."""

from collections.abc import Callable
from dataclasses import replace

from klack.errors import InputError
from klack.mesh.mesh import Mesh
from klack.mesh.quality import PoorElementError
from klack.mesh.sizing import MeshSizing
from klack.units import format_si

__all__ = ["coarsest_sound", "meshed_for_case"]

_FINER = (0.7, 0.5, 0.35, 0.25, 0.12, 0.06)
"""Shares of a size that are tried when it gives poor elements."""
_MOST_TRIED = 50_000
"""Elements after which no finer size is tried."""


def coarsest_sound(sizing: MeshSizing, mesher: Callable[[MeshSizing], Mesh]) -> Mesh:
    """Mesh of a sizing, or with a finer size where its elements are poor: a mesh to look at.

    Raises
    ------
    PoorElementError
        If no size does.
    """
    for share in (1.0, *_FINER):
        try:
            return mesher(replace(sizing, size=share * sizing.size))
        except PoorElementError as error:
            if share == _FINER[-1] or error.elements > _MOST_TRIED:
                raise
    raise AssertionError  # the last share returns or raises


def meshed_for_case(
    body: str,
    sizing: MeshSizing,
    mesher: Callable[[MeshSizing], Mesh],
    at_size: Callable[[float], MeshSizing] | None = None,
) -> Mesh:
    """Mesh a body of a case; an error names the key of the case.

    Parameters
    ----------
    body : str
    sizing : MeshSizing
    mesher : callable
        Makes the mesh of a sizing.
    at_size : callable, optional
        All that the case would ask for with another general size [m], its refinements where the
        bodies would be found to touch then; without, only that size changes.

    Raises
    ------
    InputError
        For poor elements with a finer size that was tried and does, if one does.
    """
    key = f"bodies.{body}.mesh"
    try:
        return mesher(sizing)
    except PoorElementError as error:
        raise InputError(
            f"{key}.size: {error.where}",
            got=f"{format_si(sizing.size, 'm')}, which gives {error.got}",
            expected=error.expected,
            hint=_finer(key, sizing, mesher, at_size, error),
        ) from error
    except InputError as error:
        setting = error.where.rsplit(": ", 1)[-1]
        if setting not in ("size", "contact.size") and not setting.startswith("surfaces."):
            raise
        hint = error.hint.replace(f"'mesh: {setting}'", f"{key}.{setting}")
        raise InputError(
            f"{key}.{setting}", got=error.got, expected=error.expected, hint=hint
        ) from error


def _finer(
    key: str,
    sizing: MeshSizing,
    mesher: Callable[[MeshSizing], Mesh],
    at_size: Callable[[float], MeshSizing] | None,
    error: PoorElementError,
) -> str:
    elements = error.elements
    for share in _FINER:
        if elements > _MOST_TRIED:
            break
        size = float(f"{share * sizing.size:.2g}")
        try:
            mesher(replace(sizing, size=size) if at_size is None else at_size(size))
        except PoorElementError as still:
            elements = still.elements
            continue
        except InputError:
            break
        return f"{key}.size: {format_si(size, 'm')} (tried, it does)."
    return (
        f"a {key}.size below the radius of the smallest round face, or a {key}.grading below "
        f"{sizing.grading:g}."
    )
