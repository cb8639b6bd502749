"""Study files as text."""

import json
import re
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from math import isfinite
from pathlib import Path
from typing import Any, Literal, get_args, get_origin

from pydantic.fields import FieldInfo

from klack import __version__
from klack.analyses.magnet.case import MagnetCase
from klack.analyses.study.goals import goals_of
from klack.analyses.study.kinds import kind_of, measure_names
from klack.analyses.study.run import asked_points
from klack.app.answers import Checked, FormField, MeasureOffer, StudyChoice, StudyOffer, typed
from klack.app.explorer import has_sliders, sliders_of
from klack.case.any_case import CaseTree, tree_of
from klack.case.bodies import WrittenCase
from klack.case.key_path import kind_at, node_at, written_at
from klack.case.reader import parse, validated
from klack.case.rewriting import with_values
from klack.case.study import CaseStudy, StudyFile
from klack.case.study_source import StudySource, study_of
from klack.errors import InputError, KlackError
from klack.input.problem import CaseProblem, Key, key_text
from klack.input.section import Section

__all__ = [
    "checked_text",
    "choices_of",
    "differing_inputs",
    "exchanged_text",
    "form_of",
    "is_read_text",
    "leaves",
    "limits_of",
    "scalar_of",
    "shown",
    "study_offer",
    "study_problem",
    "study_text",
]


_FIRST = {
    "stroke": ("opening_time", "closing_time"),
    "impact": ("peak_force", "contact_time", "restitution"),
}
_NEXT = (".peak_force", "noise.sound_exposure_level_weighted", ".approach_speed")
"""Ends of the names of measures that follow."""
_OF_THE_SOLVER = (
    "degrees_of_freedom",
    "steps",
    "fine_steps",
    "coarse_steps",
    "step",
    "wall_time",
    "setup_time",
    "real_time_factor",
)
"""Numbers of a run, not of the valve."""
_PLAIN = re.compile(r"[A-Za-z0-9_.+-]+(?: [A-Za-z0-9_.+*/^%()°-]+)*")
_TYPED = re.compile(r"\d[\d.]*(?:e-?\d+)?(?: ?%| [A-Za-z][A-Za-z0-9*/^]*)|[A-Za-z][A-Za-z0-9_-]*")
"""A quantity or a word that YAML takes for the text that it is."""
_TAKEN = ("true", "false", "null", "yes", "no", "on", "off", "nan", "inf")
_WORDS = {"minimise", "maximise"}
_DESIGNS = {
    "sobol": "even coverage; preferably a power of two",
    "latin-hypercube": "each parameter evenly",
    "saltelli": "which parameter causes the scatter: points times (2 + number of parameters)",
    "morris": "which parameters matter at all: points times (1 + number of parameters)",
}


def is_study(data: Any) -> bool:
    """Whether plain data are a study, not a case."""
    return "study" in data and not {"bodies", "network"} & set(data)


def study_source(text: str, path: Path) -> tuple[StudyFile, StudySource, CaseTree]:
    """Study of a text, and the text as a form changes it."""
    data, lines = parse(text, path)
    file = validated(StudyFile, text, path, data, lines)
    source = StudySource(study=file.study, path=path, lines=lines, text=text)
    return file, source, CaseTree(path=path, text=text, data=data, lines=lines)


_NO_INPUT = ("title", "description", "study", "calibration")
_LONGEST_INPUT = 60  # characters


def differing_inputs(first: str, second: str) -> tuple[tuple[str, str, str], ...]:
    """Keys that two cases have written otherwise, with both texts."""
    try:
        one, other = (parse(text, Path("case.yaml"))[0] for text in (first, second))
    except KlackError:  # of a result that holds another text
        return ()
    return tuple(_differing(one, other))


def _differing(one: Any, other: Any, above: Key = ()) -> Iterator[tuple[str, str, str]]:
    if isinstance(one, dict) and isinstance(other, dict):
        for key in dict.fromkeys((*one, *other)):
            if above or key not in _NO_INPUT:
                yield from _differing(one.get(key), other.get(key), (*above, key))
    elif one != other:
        yield ".".join(map(str, above)), _in_short(one), _in_short(other)


def _in_short(value: Any) -> str:
    if value is None:
        return "–"
    text = value if isinstance(value, str) else json.dumps(value, default=str, ensure_ascii=False)
    return text if len(text) <= _LONGEST_INPUT else "other entries"


def study_words(study: CaseStudy) -> str:
    """A study in short."""
    varied = [item for item in study.parameters.values() if item.fixed is None]
    parts = [_counted(len(varied), "parameter"), _counted(len(study.measures), "measure")]
    if study.objectives:
        parts.append(_counted(len(study.objectives), "objective"))
    return f"Study of {', '.join(parts)}; {study.design.kind}"


def _counted(count: int, word: str) -> str:
    return f"{count} {word}{'s' * (count != 1)}"


def study_problem(text: str, path: str, case_text: str, case_path: str) -> Checked:
    """What every command would say of a study of a case before its first run.

    An empty ``text`` means the section ``study`` of the case itself.
    """
    try:
        tree = tree_of(case_text, Path(case_path))
        case = tree.any_case()
        source = study_source(text, Path(path))[1] if text else study_of(case, tree)
        points, _ = asked_points(case, tree, source)
        if source.study.objectives:
            names = (*source.study.measures, *source.study.objectives, *source.study.constraints)
            chosen = kind_of(case).measures(case, names)
            by_name = {item.name: item.measure for item in chosen}
            goals_of(source, by_name, dict.fromkeys(by_name, 1.0))
    except KlackError as error:
        return Checked(error=str(error))
    return Checked(
        title=f"{_counted(len(points.values), 'point')}, {points.design}, of {case.name}",
        kind="study",
        has_study=True,
        has_objectives=bool(source.study.objectives),
    )


def study_offer(text: str, path: str) -> StudyOffer:
    """Parameters and measures for a study of a case."""
    tree = tree_of(text, Path(path))
    case = tree.any_case()
    kind = "stroke" if "network" in tree.data else "impact"
    known = measure_names(case)
    names = [name for name in known if name not in _OF_THE_SOLVER and _can(case, name)]
    names.sort(key=lambda name: _rank(name, _FIRST[kind]))
    chosen = kind_of(case).measures(case, names)
    return StudyOffer(
        title=case.title or case.name,
        kind=kind,
        parameters=tuple(item for item in sliders_of(case, tree) if item.written != "not given"),
        measures=tuple(
            MeasureOffer(
                name=item.name,
                unit=item.measure.unit if item.measure.unit not in ("1", "-") else "",
                definition=typed(item.measure.definition),
                is_first=item.name in _FIRST[kind],
            )
            for item in chosen
        ),
        designs=_DESIGNS,
    )


def _rank(name: str, first: tuple[str, ...]) -> int:
    """Rank of a measure; equal ones keep their order."""
    if name in first:
        return 0
    return next((k for k, end in enumerate(_NEXT, 1) if name.endswith(end)), len(_NEXT) + 1)


def _can(case: Any, name: str) -> bool:
    try:
        kind_of(case).measures(case, (name,))
    except InputError:
        return False
    return True


def study_text(choice: StudyChoice, case_text: str, case_path: str) -> str:
    """Commented text of a new study, checked with its case."""
    tree = tree_of(case_text, Path(case_path))
    case = tree.any_case()
    today = {item.key: item for item in sliders_of(case, tree)}
    if not choice.ranges:
        raise _refused("parameters", "none", "one or more", "tick what varies.")
    if not choice.measures and not choice.objectives:
        raise _refused("measures", "none", "one or more", "tick what is computed.")
    for way in choice.objectives.values():
        if way not in _WORDS:
            raise _refused("objectives", way[:40], "minimise or maximise", "choose one of them.")
    name = Path(case_path).name
    made = datetime.now(UTC).date().isoformat()
    lines = [
        f"# Study of {_comment(name)}, made by klack app (klack {__version__}) on {made}.",
        "#   klack study CASE --study THIS_FILE       computes the points of the design",
        "#   klack optimise CASE --study THIS_FILE    searches the ranges for the best points",
        "klack: 1",
        f"case: {_as_yaml(name)}  # klack app runs it with this case",
        "study:",
        "  # keys of the case and their ranges; a tolerance is {normal: {mean: 12 N, sd: 0.3 N}}",
        "  parameters:",
    ]
    linked: list[str] = []
    for key, (low, high) in choice.ranges.items():
        known = today.get(key)
        if known is None:
            raise _refused(key[:80], "a key without a number in the case", "one of the list", "")
        name = known.label.replace(" ", "_") if known.also else key
        lines.append(
            f"    {_as_yaml(name)}: {{from: {_as_yaml(low)}, to: {_as_yaml(high)}}}"
            f"  # today {known.text(known.start)}"
        )
        if known.also:
            linked += [f"    {'.'.join(map(str, place))}: {name}" for place in known.places]
    if linked:
        lines += ["  linked:  # keys that always have the same value", *linked]
    measures = dict.fromkeys((*choice.measures, *choice.objectives))
    of = {item.name: item.measure for item in kind_of(case).measures(case, measures)}
    lines.append("  measures:")
    lines += [f"    - {_as_yaml(name)}  # {_comment(of[name].definition)}" for name in measures]
    if choice.objectives:
        lines.append("  objectives:  # of klack optimise, and of the front that klack app shows")
        lines += [f"    {_as_yaml(name)}: {way}" for name, way in choice.objectives.items()]
    if choice.design not in _DESIGNS:
        raise _refused("design", choice.design[:40], ", ".join(_DESIGNS), "choose one of them.")
    lines.append(f"  # {_DESIGNS[choice.design]}")
    lines.append(f"  design: {{kind: {choice.design}, points: {choice.points}}}")
    if choice.objectives:
        lines.append("  # how long klack optimise searches: points = population * generations")
        lines.append("  search: {population: 20, generations: 10, refinements: 100}")
    text = "\n".join(lines) + "\n"
    path = str(Path(case_path).with_name("study.yaml"))
    found = study_problem(text, path, case_text, case_path)
    if found.error:
        raise KlackError(found.error)
    return text


def _as_yaml(text: str) -> str:
    """YAML of a text: plain if that is the same, else in quotes."""
    plain = text.strip()
    if _PLAIN.fullmatch(plain) and not _is_number_like_word(plain):
        return plain
    return json.dumps(plain, ensure_ascii=False)


def _is_number_like_word(text: str) -> bool:
    """Whether YAML takes a word for neither text nor a finite number."""
    if text.lower().lstrip("+-.") in _TAKEN:
        return True
    try:
        return not isfinite(float(text))
    except ValueError:
        return text.startswith(("-", "+", ".", "%", "?"))


def _comment(text: str) -> str:
    line = " ".join(text.split())
    return "".join(sign for sign in line if sign.isprintable())[:160]


def _refused(where: str, got: str, expected: str, hint: str) -> InputError:
    return InputError(where, got=got, expected=expected, hint=hint or "reload the page.")


_SIGNS = (("gt", ">"), ("ge", "≥"), ("lt", "<"), ("le", "≤"))
_MOST = 400
_LONGEST_NUMBER = 40  # characters


def checked_text(text: str, path: str, has_form: bool = True) -> Checked:
    """Check a case like every command, and make its form if asked for."""
    try:
        tree = tree_of(text, Path(path))
        if is_study(tree.data):
            return _checked_study(text, path)
        if "magnet" in tree.data:
            return _checked_magnet(tree, has_form)
        case = tree.any_case()
    except KlackError as error:
        line, column = _place(error, path)
        return Checked(error=str(error), line=line, column=column)
    return Checked(
        doubts=tuple(_doubts(case, text, path)),
        has_study=case.study is not None,
        has_objectives=case.study is not None and bool(case.study.objectives),
        title=case.title or case.name,
        kind="stroke" if "network" in tree.data else "impact",
        fields=tuple(form_of(case, tree)) if has_form else (),
        has_sliders=has_sliders(case),
    )


def _doubts(case: WrittenCase, text: str, path: str) -> Iterator[tuple[int, str]]:
    """Notes with the lines, from 1, of the keys that they begin with; 0 for one of another file."""
    lines = {key_text(key): line for key, line in parse(text, Path(path))[1].keys.items()}
    for words in case.input_notes:
        yield lines.get(words.partition(": ")[0], 0), words


def _magnet_of(tree: CaseTree) -> MagnetCase:
    return validated(MagnetCase, tree.text, tree.path, tree.data, tree.lines)


def _checked_magnet(tree: CaseTree, has_form: bool) -> Checked:
    case = _magnet_of(tree)
    fields = tuple(form_of(case, tree)) if has_form else ()
    doubts = tuple(_doubts(case, tree.text, str(tree.path)))
    return Checked(title=case.title or case.name, kind="magnet", fields=fields, doubts=doubts)


def _place(error: KlackError, path: str) -> tuple[int, int]:
    """Line and column that an error names in the text, from 1; 0 without one."""
    if not isinstance(error, InputError):
        return 0, 0
    line = re.match(re.escape(path) + r":(\d+)(?!\d)", error.where)
    column = re.match(r"text that is not YAML at column (\d+)", error.got)
    return int(line[1]) if line else 0, int(column[1]) if line and column else 0


def _checked_study(text: str, path: str) -> Checked:
    """Check a study by itself; its case would take too long."""
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

    InputError if the file cannot have the value there.
    """
    data, lines = parse(text, Path(path))  # without the files that it includes
    _require_component(data, place)
    tree = CaseTree(path=Path(path), text=text, data=data, lines=lines)
    return with_values(tree, {place: scalar_of(written, is_text=_takes_text(tree, place))})


def _require_component(data: Any, place: Key) -> None:
    """Refuse a value of a component that is not there: it was removed, or has another name."""
    if place[:2] == ("network", "components") and place[2:]:
        components = written_at(data, place[:2])
        known = components if isinstance(components, Mapping) else {}
        if place[2] not in known:
            where = ".".join(map(str, place))
            raise InputError(
                where,
                got=f"no component '{place[2]}' in the text",
                expected=f"one of: {', '.join(known)}",
                hint="add the component again, or write the value for another one.",
            )


def is_read_text(text: str, path: str) -> bool:
    """Whether a text is YAML that has keys."""
    try:
        parse(text, Path(path))
    except KlackError:
        return False
    return True


def form_of(case: Section, tree: CaseTree) -> Iterator[FormField]:
    """Fields in the file, then further single values for its sections."""
    written = dict(leaves(tree.data))
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
            written="" if place not in written else shown(written[place]),
            kind="" if kind is None else kind.name,
            example="" if kind is None else kind.example,
            limits=limits_of(info),
            choices=choices_of(info),
            description="" if info is None else (info.description or ""),
            default="" if place in written or info is None else shown(node),
        )


def leaves(data: Any, above: Key = ()) -> Iterator[tuple[Key, Any]]:
    """Single values of the file, without coordinates of profiles."""
    if "edges" in above or "start" in above[-2:]:
        return
    if isinstance(data, dict):
        for key, value in data.items():
            yield from leaves(value, (*above, key))
    elif isinstance(data, list):
        for i, value in enumerate(data):
            yield from leaves(value, (*above, i))
    elif above != ("klack",):
        yield above, data


def _further(case: Section, data: Any, above: Key = ()) -> Iterator[Key]:
    """Further keys for one quantity, word or number."""
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


def limits_of(info: FieldInfo | None) -> str:
    """Bounds of a field in signs."""
    found = [] if info is None else info.metadata
    words = [
        f"{sign} {getattr(item, name):g}"
        for item in found
        for name, sign in _SIGNS
        if isinstance(getattr(item, name, None), int | float)
    ]
    return ", ".join(words)


def choices_of(info: FieldInfo | None) -> tuple[str, ...]:
    """Words that a field allows; empty for any."""
    annotation = None if info is None else info.annotation
    options = [annotation, *get_args(annotation)]
    words = [
        str(word)
        for option in options
        if get_origin(option) is Literal
        for word in get_args(option)
    ]
    return tuple(words)


def shown(value: Any) -> str:
    """A value as a box shows it."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return str(value)


def _section_of(tree: CaseTree) -> Section:
    if is_study(tree.data):
        return study_source(tree.text, tree.path)[0]
    if "magnet" in tree.data:
        return _magnet_of(tree)
    return tree.any_case()


def _takes_text(tree: CaseTree, place: Key) -> bool:
    """Whether a key takes any text: a title of digits is no number."""
    try:
        case = _section_of(tree)
        _, info = node_at(case, place)
    except (KlackError, CaseProblem):  # of a text that is not valid the kinds are not known
        return False
    return info is not None and info.annotation in (str, str | None)


def scalar_of(text: str, *, is_text: bool = False) -> str:
    """YAML of typed text: plain where that means the same, else in quotes."""
    plain = text.strip()
    if is_text:
        return json.dumps(plain, ensure_ascii=False)
    if plain[:1] in ("[", "{") and _is_in_brackets(plain):
        return plain
    if _TYPED.fullmatch(plain) and plain.lower() not in _TAKEN[2:]:
        return plain
    try:
        float(plain if len(plain) <= _LONGEST_NUMBER else "text")
    except ValueError:
        return json.dumps(plain, ensure_ascii=False)
    return plain


def _is_in_brackets(text: str) -> bool:
    """Whether a text is a list or a section in YAML, on one line."""
    try:
        return isinstance(parse(f"value: {text}", Path("value"))[0]["value"], list | dict)
    except KlackError:
        return False
