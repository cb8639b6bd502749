"""Sources of a page: a case, a mesh or CAD file, or a result."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from klack.analyses.catalogue import load_result
from klack.analyses.ending import is_result
from klack.case.any_case import load_any_case
from klack.case.valve import ValveCase
from klack.errors import InputError, refuse_if
from klack.machine.progress import Progress, silent
from klack.mesh.files.catalogue import MESH_FORMATS, STEP_ENDINGS
from klack.network.component import Component

if TYPE_CHECKING:
    from klack.mesh.mesh import Mesh
    from klack.viewer.view import View

__all__ = ["named_case", "view_of_source"]


_SIDES_ACROSS = 25  # elements over the longest side of a STEP file, for its picture only


def view_of_source(
    source: Path,
    components: Iterable[type[Component]] = (),
    *,
    unit_length: float | None = None,
    progress: Progress = silent,
) -> "View":
    """What a page of this source shows; InputError if it is none, or has nothing to draw.

    ``source`` is a case file or shipped case, mesh or STEP file, or folder of a result;
    ``unit_length`` [m] that of a mesh file without it.
    """
    from klack.analyses.inspection import inspect_file
    from klack.viewer.drawn import view_of_case, view_of_mesh, view_of_result

    ending = source.suffix.lower()
    if source.is_file() and ending in STEP_ENDINGS:
        return _step_view(source)
    if source.is_file() and ending in MESH_FORMATS:
        from klack.mesh.files.mesh_file import read_mesh_file

        model = read_mesh_file(source, unit_length, solids_only=True)
        return view_of_mesh(model.mesh, source.name, inspect_file(source, unit_length))
    refuse_if(
        unit_length is not None,
        "--unit",
        got=f"a unit for {source}",
        expected="--unit with a mesh file only",
        hint="leave it out: cases, results and STEP files have their units.",
    )
    if is_result(source):
        return view_of_result(load_result(source), source, tuple(components), progress)
    return view_of_case(load_any_case(source, components), progress)


def named_case(source: Path, components: Iterable[type[Component]] = ()) -> ValveCase | None:
    """The case of a whole valve, if that is what the source names."""
    if is_result(source) or source.suffix.lower() in (*STEP_ENDINGS, *MESH_FORMATS):
        return None
    case = load_any_case(source, components)
    return case if isinstance(case, ValveCase) else None


def _step_view(source: Path) -> "View":
    """A turned part as its half section, in a tenth of the time; others as solids."""
    from klack.analyses.inspection import inspect_file
    from klack.mesh.step_content import step_content
    from klack.mesh.step_profile import NotTurnedError, profiles_of_step
    from klack.viewer.drawn import view_of_mesh

    content, rows = step_content(source), inspect_file(source)
    longest = max(max(b - a for a, b in zip(s.low, s.high, strict=True)) for s in content.solids)
    note = "Meshed coarsely, only for this picture."
    try:
        profiles = profiles_of_step(source)
    except (NotTurnedError, InputError):  # or an outline that crosses itself, by a flaw of the file
        return view_of_mesh(_solid_mesh(source, longest), source.name, rows, note)
    from klack.mesh.meridian import mesh_meridian
    from klack.mesh.sizing import MeshSizing

    mesh = mesh_meridian(profiles, MeshSizing(size=longest / _SIDES_ACROSS))
    return view_of_mesh(mesh, source.name, rows, f"A turned part, from its half section. {note}")


def _solid_mesh(source: Path, longest: float) -> "Mesh":
    from klack.mesh.quality import PoorElementError
    from klack.mesh.sizing import MeshSizing
    from klack.mesh.solid import mesh_step

    try:
        return mesh_step(source, MeshSizing(size=longest / _SIDES_ACROSS))
    except PoorElementError as error:
        raise InputError(
            str(source),
            got=f"a shape whose coarse mesh has inverted elements ({error.got})",
            expected="a shape that elements of 1/25 of its length can represent",
            hint="write a case with element sizes for it, and show the case.",
        ) from error
