"""The keys of a case as fields of a form, made from its schema: kind, unit, limits, description."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from klack.app.answers import Checked, FormField
from klack.app.study_texts import is_study, study_source, study_words
from klack.case.any_case import CaseTree, tree_of
from klack.case.key_path import kind_at, node_at
from klack.case.rewriting import with_values
from klack.errors import KlackError
from klack.input.problem import CaseProblem, Key
from klack.input.section import Section

__all__ = ["checked_text", "exchanged_text", "form_of"]

_SIGNS = (("gt", ">"), ("ge", "≥"), ("lt", "<"), ("le", "≤"))
_MOST = 400
_LONGEST_NUMBER = 40  # characters


def checked_text(text: str, path: str, *, has_form: bool = True) -> Checked:
    """Check the text of a case as every command does, and make its form where it is asked for."""
    try:
        tree = tree_of(text, Path(path))
        if is_study(tree.data):
            return _checked_study(text, path)
        case = tree.any_case()
    except KlackError as error:
        return Checked(error=str(error))
    return Checked(
        has_study=case.study is not None,
        has_objectives=case.study is not None and bool(case.study.objectives),
        title=case.title or case.name,
        kind="stroke" if "network" in tree.data else "impact",
        fields=tuple(form_of(case, tree)) if has_form else (),
    )


def _checked_study(text: str, path: str) -> Checked:
    """Check the text of a study by itself; with its case that is more than a form can wait for."""
    file, _, tree = study_source(text, Path(path))
    return Checked(
        title=study_words(file.study),
        kind="study",
        fields=tuple(form_of(file, tree)),
        has_study=True,
        has_objectives=bool(file.study.objectives),
        case=file.case or "",
    )


def exchanged_text(text: str, path: str, place: Key, written: str) -> str:
    """Text with another value at a key; everything else stays as its author wrote it.

    Raises
    ------
    InputError
        If the file cannot have the value there.
    """
    tree = tree_of(text, Path(path))
    return with_values(tree, {place: _scalar(written, is_text=_takes_text(tree, place))})


def form_of(case: Section, tree: CaseTree) -> Iterator[FormField]:
    """Fields of what the file has, then single values that it could have in the same sections."""
    written = dict(_leaves(tree.data))
    count = 0
    for place in (*written, *_further(case, tree.data)):
        try:
            node, info = node_at(case, place)
        except CaseProblem:
            continue
        count += 1
        if count > _MOST:
            return
        kind = kind_at(node, info)
        start = 1 if place[0] == "study" and len(place) > 2 else 0
        yield FormField(
            key=".".join(map(str, place)),
            place=place,
            section=str(place[start]) if len(place) > 1 else "case",
            label=" ".join(map(str, place[start + 1 :] or place[-1:])).replace("_", " "),
            written="" if place not in written else _shown(written[place]),
            kind="" if kind is None else kind.name,
            example="" if kind is None else kind.example,
            limits=_limits(info),
            choices=_choices(info),
            description="" if info is None else (info.description or ""),
            default="" if place in written or info is None else _shown(node),
        )


def _leaves(data: Any, above: Key = ()) -> Iterator[tuple[Key, Any]]:
    """Single values of the file; coordinates of profiles stay in the YAML."""
    if "edges" in above or "start" in above[-2:]:
        return
    if isinstance(data, dict):
        for key, value in data.items():
            yield from _leaves(value, (*above, key))
    elif isinstance(data, list):
        for i, value in enumerate(data):
            yield from _leaves(value, (*above, i))
    elif above != ("klack",):
        yield above, data


def _further(case: Section, data: Any, above: Key = ()) -> Iterator[Key]:
    """Keys with one quantity, one word or one number that the sections of the file could have."""
    if isinstance(data, Mapping):
        try:
            node = node_at(case, above)[0] if above else case
        except CaseProblem:
            return
        if isinstance(node, Section):
            for name, info in type(node).model_fields.items():
                key = info.alias or name
                value = getattr(node, name)
                simple = isinstance(value, float | int | str)
                if key not in data and (simple or (value is None and _is_quantity(value, info))):
                    yield (*above, key)
        for key, value in data.items():
            yield from _further(case, value, (*above, key))


def _is_quantity(value: Any, info: FieldInfo) -> bool:
    return kind_at(value, info) is not None


def _limits(info: FieldInfo | None) -> str:
    found = [] if info is None else info.metadata
    words = [
        f"{sign} {getattr(item, name):g}"
        for item in found
        for name, sign in _SIGNS
        if isinstance(getattr(item, name, None), int | float)
    ]
    return ", ".join(words)


def _choices(info: FieldInfo | None) -> tuple[str, ...]:
    annotation = None if info is None else info.annotation
    options = [annotation, *get_args(annotation)]
    words = [
        str(word)
        for option in options
        if get_origin(option) is Literal
        for word in get_args(option)
    ]
    return tuple(words)


def _shown(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value)


def _takes_text(tree: CaseTree, place: Key) -> bool:
    """Whether a key takes any text: a title of digits is no number."""
    try:
        case = study_source(tree.text, tree.path)[0] if is_study(tree.data) else tree.any_case()
        _, info = node_at(case, place)
    except (KlackError, CaseProblem):  # of a text that is not valid the kinds are not known
        return False
    return info is not None and info.annotation in (str, str | None)


def _scalar(text: str, *, is_text: bool) -> str:
    """YAML of what was typed: a number and true or false stay what they are where they may."""
    import json

    plain = text.strip()
    if is_text:
        return json.dumps(plain, ensure_ascii=False)
    try:
        float(plain if len(plain) <= _LONGEST_NUMBER else "text")
    except ValueError:
        return plain if plain in ("true", "false") else json.dumps(plain, ensure_ascii=False)
    return plain
