"""Errors of the mesh generator in terms of the case: the key, and a size that works."""

from collections.abc import Callable
from dataclasses import replace

from klack.errors import InputError
from klack.mesh.mesh import Mesh
from klack.mesh.quality import PoorElementError
from klack.mesh.sizing import MeshSizing
from klack.units import format_si

__all__ = ["meshed_for_case"]

_FINER = (0.7, 0.5, 0.35, 0.25, 0.12, 0.06)
"""Shares of a size that are tried when it gives poor elements."""
_MOST_TRIED = 50_000
"""Elements after which no finer size is tried."""


def meshed_for_case(body: str, sizing: MeshSizing, mesher: Callable[[MeshSizing], Mesh]) -> Mesh:
    """Mesh a body of a case; an error names the key of the case.

    Parameters
    ----------
    body : str
    sizing : MeshSizing
    mesher : callable
        Makes the mesh of a sizing.

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
            hint=_finer(key, sizing, mesher, error),
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
    key: str, sizing: MeshSizing, mesher: Callable[[MeshSizing], Mesh], error: PoorElementError
) -> str:
    elements = error.elements
    for share in _FINER:
        if elements > _MOST_TRIED:
            break
        size = float(f"{share * sizing.size:.2g}")
        try:
            mesher(replace(sizing, size=size))
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
