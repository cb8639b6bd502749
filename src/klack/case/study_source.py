"""Study of a case, in it or in a file of its own, with lines."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from klack.case.any_case import AnyCase, CaseTree
from klack.case.reader import Lines, parse, text_of, validated
from klack.case.study import CaseStudy, StudyFile
from klack.errors import InputError, refuse_if
from klack.input.problem import CaseProblem, Key, key_text

__all__ = ["StudySource", "study_if_any", "study_of"]


_MOST_VALVES = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudySource:
    """A study and where it is written.

    Parameters
    ----------
    text
        Of its own file, else empty.
    """

    study: CaseStudy
    path: Path
    lines: Lines
    text: str = ""

    def where(self, key: Key, *, on_key: bool = False) -> str:
        """File, line and key below ``study``."""
        whole = ("study", *key)
        return f"{self.path}:{self.lines.find(whole, on_key=on_key)}: {key_text(whole)}"

    def made(self, valves: int) -> "StudySource":
        """Same study of 1 to 1e6 valves made after the case."""
        refuse_if(
            isinstance(valves, bool) or not 1 <= valves <= _MOST_VALVES,
            "--made",
            got=f"{valves} valves",
            expected=f"1 to {_MOST_VALVES}",
            hint="with 1024 valves a probability of 1 % is known to about half its value.",
        )
        design = self.study.design.model_copy(
            update={"kind": "made", "points": valves, "file": None}
        )
        return replace(self, study=self.study.model_copy(update={"design": design}))

    def refuse(self, key: Key, error: InputError) -> InputError:
        """Error at its place in the study."""
        inner = error.key if isinstance(error, CaseProblem) else ()
        where = self.where((*key, *inner))
        return InputError(where, got=error.got, expected=error.expected, hint=error.hint)

    def read(self, key: Key, parse: Callable[[], float]) -> float:
        """Value of a text; its error names the place."""
        try:
            return parse()
        except InputError as error:
            raise self.refuse(key, error) from None


def study_of(case: AnyCase, tree: CaseTree, file: Path | None = None) -> StudySource:
    """Study in a file, or in the section ``study`` of the case."""
    if file is not None:
        text = text_of(file)
        data, lines = parse(text, file)
        return StudySource(
            study=validated(StudyFile, text, file, data, lines).study,
            path=file,
            lines=lines,
            text="" if file == tree.path else text,
        )
    if case.study is None:
        raise InputError(
            f"{tree.path}: study",
            got="no section 'study'",
            expected="parameters with their ranges, and measures",
            hint="add the section, or give a file with it: --study FILE.",
        )
    return StudySource(study=case.study, path=tree.path, lines=tree.lines)


def study_if_any(case: AnyCase, tree: CaseTree, file: Path | None = None) -> StudySource | None:
    """:func:`study_of`, or None."""
    return study_of(case, tree, file) if file is not None or case.study is not None else None
