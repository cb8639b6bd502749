"""The case with its calibrated values, ready to run from the folder of the result."""

from pathlib import Path

from klack.analyses.calibration.record import CalibrationStudy
from klack.case.case_tree import CaseTree
from klack.case.free_parameters import free_parameters
from klack.case.rewriting import moved_files, rewritten, written_quantity
from klack.case.valve_reader import read_valve_case
from klack.units import format_si

__all__ = ["CALIBRATED_NAME", "calibrated_text"]

CALIBRATED_NAME = "case_calibrated.yaml"


def calibrated_text(tree: CaseTree, study: CalibrationStudy, folder: Path) -> str:
    """Text of the case with the values found, for a file in ``folder``.

    Comments and order are those of the author; files are named from the new place.

    Raises
    ------
    InputError
        If the new text is no case, or a value cannot be exchanged alone.
    """
    found = {item.name: item for item in study.parameters}
    values = moved_files(tree, folder)
    lines = [
        f"Calibrated by klack {study.version}, {study.created[:10]}, to "
        f"{len(study.strokes)} strokes of {study.source}.",
        f"Made from {tree.path.name}; only these values were changed:",
    ]
    for parameter in free_parameters(tree.case()):
        item = found[parameter.name]
        for place in parameter.places:
            values[place.key] = written_quantity(tree, place, item.value)
        error = format_si(item.standard_error, item.unit, 2)
        lines.append(
            f"  {item.name} = {format_si(item.value, item.unit, 5)}, standard error {error} "
            f"({', '.join(item.keys)})"
        )
    text = rewritten(tree, values, "\n".join(lines))
    read_valve_case(text, folder / CALIBRATED_NAME, tree.components.values())
    return text
