"""``klack inspect``: what is in the files of other programs, before anything runs."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.terminal.options import Components, imported
from klack.terminal.tables import TextTable
from klack.terminal.wanted import SHOWN, Shown

if TYPE_CHECKING:
    from klack.analyses.inspection import Row
    from klack.analyses.json_results import InspectionJson

__all__ = ["inspect"]

_COLUMNS = ("what", "name", "content")


def inspect(
    file: Annotated[
        Path,
        Parameter(
            name="FILE",
            help="STEP, mesh, matrix or FMU of another program; or a case: its parameters, parts "
            "and bodies.",
        ),
    ],
    /,
    *,
    unit: Annotated[
        str | None,
        Parameter(name="--unit", help='Unit of the coordinates, "mm", if the file names none.'),
    ] = None,
    matrix: Annotated[
        str | None,
        Parameter(name="--matrix", help="Name of one matrix in a file of several. [default: all]"),
    ] = None,
    component: Components = None,
    wanted: Shown = SHOWN,
) -> int:
    """Show surfaces and sets of CAD or a mesh, rows of a matrix, inputs and outputs of an FMU.

    Of a case: its parameters and expressions in SI, the components of included parts, and the
    bodies that come from other programs, checked as a run checks them.
    """
    from klack.analyses.inspection import inspect_case, inspect_file
    from klack.case.reader import find_case, shipped_cases
    from klack.errors import InputError
    from klack.mesh.files.catalogue import STEP_ENDINGS
    from klack.units import LENGTH, parse_quantity

    is_case = file.suffix.lower() in (".yaml", ".yml") or (file / "case.yaml").is_file()
    if is_case or (not file.exists() and str(file) in shipped_cases()):
        from klack.case.any_case import load_any_case

        parts = inspect_case(load_any_case(find_case(file), imported(component)))
        _show(str(file), parts, wanted)
        return 0
    length = None if unit is None else parse_quantity(f"1 {unit}", LENGTH, "--unit")
    if unit is not None and file.is_file() and file.suffix.lower() in STEP_ENDINGS:
        raise InputError(
            "--unit",
            got=f"'{unit}' for a STEP file, which has its own unit",
            expected="no --unit",
            hint="leave it out; klack shows sizes in mm.",
        )
    _show(str(file), [(file.name, inspect_file(file, length, matrix))], wanted)
    return 0


def _show(file: str, parts: "Iterable[tuple[str, tuple[Row, ...]]]", wanted: Shown) -> None:
    """Print each part as soon as it is known, and write all of them as JSON."""
    found: InspectionJson = {"schema": "klack-inspect/1", "file": file, "parts": {}}
    for name, rows in parts:
        wanted.show([TextTable(title=name, columns=_COLUMNS, rows=rows, left=3)])
        found["parts"][name] = [
            {"what": what, "name": of, "content": content} for what, of, content in rows
        ]
    wanted.write(lambda: found)
