"""The case file of a point of a study, ready to run."""

import json
from pathlib import Path

from klack.analyses.study.record import StudyColumn, StudyRecord
from klack.case.case_tree import tree_of
from klack.case.inserting import with_values
from klack.case.key_path import split_path
from klack.case.valve_reader import read_any_case
from klack.errors import InputError

__all__ = ["case_of_point"]


def case_of_point(record: StudyRecord, point: int | None, folder: Path) -> tuple[str, str]:
    """Name and text of the case of a point, with all digits; comments stay.

    Parameters
    ----------
    record : StudyRecord
    point : int or None
        The recommended one of an optimisation by default.
    folder : Path
        Where it will lie; files that the case names are looked for there.

    Raises
    ------
    InputError
        For a point that the study does not have, and where the text is no case there.
    """
    if point is None and record.optimum is not None:
        point = record.optimum.best
    if point is None or not 0 <= point < record.count:
        raise InputError(
            "--point",
            got="no point" if point is None else str(point),
            expected=f"0 to {record.count - 1}",
            hint="the report of the study numbers its points.",
        )
    name = f"{record.case}_point_{point}.yaml"
    tree = tree_of(record.case_text, folder / name)
    values = {
        split_path(item.name): json.dumps(_written(item, point))
        for item in (*record.parameters, *record.linked)
        if "." in item.name
    }
    made = f"Point {point} of a study by klack {record.version}, {record.created[:10]}: "
    text = with_values(tree, values, f"{made}{record.design}.\nMade from {record.case}.")
    if not record.own_components:
        read_any_case(text, folder / name)
    return name, text


def _written(item: StudyColumn, point: int) -> str | float:
    value = float(item.values[point])
    if item.words:
        return item.words[int(value)]
    if item.unit == "1":
        return int(value) if item.is_whole else value
    return f"{value!r} {item.unit}"
