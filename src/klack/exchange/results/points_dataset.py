"""Points of a study as named arrays over the points."""

import numpy as np

from klack.analyses.study.record import StudyColumn, StudyRecord
from klack.exchange.results.naming import identifiers
from klack.exchange.results.variables import Variable

__all__ = ["points_variables"]

_SAID = {"failure": "why there are no measures", "doubts": "what speaks against the numbers"}


def points_variables(study: StudyRecord) -> tuple[dict[str, Variable], dict[str, Variable]]:
    """Variables and coordinates of all points, in the order of the design.

    Parameters and measures are of shape (points,) over ``point``, by their names with underscores
    for what Python does not take; ``failure`` says why a point has no measures, ``doubts`` what
    speaks against its numbers.

    Parameters
    ----------
    study : StudyRecord
    """
    names = identifiers([item.name for item in study.columns], ("point", *_SAID))
    variables = {
        name: Variable(
            ("point",),
            (np.array([item.words[int(i)] for i in item.values]) if item.words else item.values),
            _about(item),
        )
        for name, item in zip(names, study.columns, strict=True)
    }
    for (name, long_name), texts in zip(_SAID.items(), (study.failures, study.notes), strict=True):
        variables[name] = Variable(("point",), np.array(texts, dtype=str), {"long_name": long_name})
    number = np.arange(study.count)
    return variables, {"point": Variable(("point",), number, {"long_name": "number of the point"})}


def _about(item: StudyColumn) -> dict[str, str]:
    comment = {"comment": item.spread} if item.spread else {}
    return {"units": item.unit or "1", "long_name": item.name, **comment}
