"""``klack inspect``: what is in a file of another program."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from klack.cli.tables import print_table
from klack.errors import InputError

__all__ = ["inspect"]


def inspect(
    file: Annotated[Path, Parameter(name="FILE", help="Mesh of another program.")],
    /,
    *,
    unit: Annotated[
        str | None,
        Parameter(name="--unit", help='Unit of the coordinates, "mm", if the file names none.'),
    ] = None,
) -> int:
    """Show nodes, elements, solids, surfaces, sets and materials of a mesh file."""
    from klack.mesh.mesh_file import MESH_FORMATS
    from klack.units import LENGTH, parse_quantity
    from klack.workflow.inspection import inspect_mesh, is_mesh

    if not is_mesh(file):
        raise InputError(
            str(file),
            got=f"a file that ends in '{file.suffix}'",
            expected=f"one of: {', '.join(MESH_FORMATS)}",
            hint="klack inspect reads finished meshes.",
        )
    length = None if unit is None else parse_quantity(f"1 {unit}", LENGTH, "--unit")
    rows = inspect_mesh(file, length)
    print_table(file.name, ("what", "name", "content"), rows, left=3)
    return 0
