"""Measures whose derivatives are asked for."""

from collections.abc import Sequence

from klack.case.study_source import StudySource

__all__ = ["asked_measures"]


def asked_measures(source: StudySource | None, names: Sequence[str] = ()) -> tuple[str, ...]:
    """Names that are given; without any, measures and constraints of the study, if there is one."""
    if names or source is None:
        return tuple(names)
    return tuple(dict.fromkeys((*source.study.measures, *source.study.constraints)))
