"""The case file of a point of a study, ready to run."""

import json
from pathlib import Path

from klack.analyses.study.record import StudyColumn, StudyRecord
from klack.case.any_case import read_any_case, tree_of
from klack.case.key_path import split_path
from klack.case.rewriting import with_values
from klack.errors import InputError

__all__ = ["case_of_point", "written_of_point"]


def case_of_point(
    record: StudyRecord, point: int | None, folder: Path, study: str = "a study"
) -> tuple[str, str]:
    """Name and text of the case of a point, with all digits; comments stay.

    ``point`` is by default the recommended one; files are looked for in ``folder``, where the case
    will lie; ``study`` is named in its first comment.
    """
    if point is None and record.optimum is not None:
        point = record.optimum.best
    if point is None or not 0 <= point < record.count:
        raise InputError(
            "--point",
            got="no point" if point is None else str(point),
            expected=f"0 to {record.count - 1}",
            hint="the report of the study lists the numbers of the points.",
        )
    name = f"{record.case}_point_{point}.yaml"
    tree = tree_of(record.case_text, folder / name)
    values = {
        split_path(name): json.dumps(value)
        for name, value in written_of_point(record, point).items()
    }
    made = f"Point {point} of {study} by klack {record.version}, {record.created[:10]}: "
    text = with_values(tree, values, f"{made}{record.design}.\nMade from {record.case}.")
    if not record.own_components:
        read_any_case(text, folder / name)
    return name, text


def written_of_point(record: StudyRecord, point: int) -> dict[str, str | float]:
    """Texts of the case at a point, by key."""
    columns = (*record.parameters, *record.linked)
    return {item.name: _written(item, point) for item in columns if "." in item.name}


def _written(item: StudyColumn, point: int) -> str | float:
    value = float(item.values[point])
    if item.words:
        return item.words[int(value)]
    if item.unit == "1":
        return int(value) if item.is_whole else value
    return f"{value!r} {item.unit}"
