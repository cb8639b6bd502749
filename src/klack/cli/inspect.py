"""``klack inspect``: what is in a file of another program."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from klack.cli.tables import print_table

__all__ = ["inspect"]


def inspect(
    file: Annotated[Path, Parameter(name="FILE", help="Mesh, matrix or FMU of another program.")],
    /,
    *,
    unit: Annotated[
        str | None,
        Parameter(name="--unit", help='Unit of the coordinates, "mm", if the file names none.'),
    ] = None,
    matrix: Annotated[
        str | None, Parameter(name="--matrix", help="Name of a matrix in a file of several.")
    ] = None,
) -> int:
    """Show solids, surfaces and sets of a mesh, rows of a matrix, inputs and outputs of an FMU."""
    from klack.units import LENGTH, parse_quantity
    from klack.workflow.inspection import inspect_file

    length = None if unit is None else parse_quantity(f"1 {unit}", LENGTH, "--unit")
    rows = inspect_file(file, length, matrix)
    print_table(file.name, ("what", "name", "content"), rows, left=3)
    return 0
