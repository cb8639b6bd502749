"""Study files as text: checked with their case, and made from choices on a page."""

import json
import re
from datetime import UTC, datetime
from math import isfinite
from pathlib import Path
from typing import Any

from klack import __version__
from klack.analyses.study.goals import goals_of
from klack.analyses.study.kinds import kind_of, measure_names
from klack.analyses.study.run import asked_points
from klack.app.answers import Checked, MeasureOffer, StudyChoice, StudyOffer, typed
from klack.app.sliders import sliders_of
from klack.case.any_case import CaseTree, tree_of
from klack.case.reader import parse, validated
from klack.case.study import CaseStudy, StudyFile
from klack.case.study_source import StudySource, study_of
from klack.errors import InputError, KlackError
from klack.units import format_si

__all__ = ["is_study", "study_offer", "study_problem", "study_source", "study_text", "study_words"]

_FIRST = {
    "stroke": ("opening_time", "closing_time"),
    "impact": ("peak_force", "contact_time", "restitution"),
}
"""Measures that are ticked at first, where the case has them."""
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
"""Numbers of a run that say nothing about the valve."""
_PLAIN = re.compile(r"[A-Za-z0-9_.+-]+(?: [A-Za-z0-9_.+*/^%()°-]+)*")
_TAKEN = ("true", "false", "null", "yes", "no", "on", "off", "nan", "inf")
_WORDS = {"minimise", "maximise"}
_DESIGNS = {
    "sobol": "an even cover; better a power of two",
    "latin-hypercube": "each parameter evenly",
    "saltelli": "which parameter causes the scatter: points times (2 + number of parameters)",
    "morris": "which parameters matter at all: points times (1 + number of parameters)",
}


def is_study(data: Any) -> bool:
    """Whether the plain data of a file are a study, and no case."""
    return "study" in data and not {"bodies", "network"} & set(data)


def study_source(text: str, path: Path) -> tuple[StudyFile, StudySource, CaseTree]:
    """Study of a text, and the text as a form changes it.

    Raises
    ------
    InputError
        With file, line and key.
    """
    data, lines = parse(text, path)
    file = validated(StudyFile, text, path, data, lines)
    source = StudySource(study=file.study, path=path, lines=lines, text=text)
    return file, source, CaseTree(path=path, text=text, data=data, lines=lines)


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
    """What can vary in a case, and what can be computed.

    Raises
    ------
    InputError
        For a case that is not valid.
    """
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
    """Place of a measure in the list; those of one rank stay as the reference has them."""
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
    """Commented text of a new study, checked with its case.

    Raises
    ------
    InputError
        For a choice that is no study of this case.
    """
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
        f"case: {_scalar(name)}  # klack app runs it with this case",
        "study:",
        "  # keys of the case and their ranges; a tolerance is {normal: {mean: 12 N, sd: 0.3 N}}",
        "  parameters:",
    ]
    for key, (low, high) in choice.ranges.items():
        known = today.get(key)
        if known is None:
            raise _refused(key[:80], "a key that the case has no number at", "one of the list", "")
        word = format_si(known.start, known.unit)
        lines.append(
            f"    {_scalar(key)}: {{from: {_scalar(low)}, to: {_scalar(high)}}}  # today {word}"
        )
    measures = dict.fromkeys((*choice.measures, *choice.objectives))
    of = {item.name: item.measure for item in kind_of(case).measures(case, measures)}
    lines.append("  measures:")
    lines += [f"    - {_scalar(name)}  # {_comment(of[name].definition)}" for name in measures]
    if choice.objectives:
        lines.append("  objectives:  # of klack optimise, and of the front that klack app shows")
        lines += [f"    {_scalar(name)}: {way}" for name, way in choice.objectives.items()]
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


def _scalar(text: str) -> str:
    """Text as YAML has it: plain where that is the same text, else in quotes."""
    plain = text.strip()
    if _PLAIN.fullmatch(plain) and not _is_number_like_word(plain):
        return plain
    return json.dumps(plain, ensure_ascii=False)


def _is_number_like_word(text: str) -> bool:
    """Words that YAML takes for something else than text or a finite number."""
    if text.lower().lstrip("+-.") in _TAKEN:
        return True
    try:
        return not isfinite(float(text))
    except ValueError:
        return text.startswith(("-", "+", ".", "%", "?"))


def _comment(text: str) -> str:
    """Text as a comment has it: one line of printable characters."""
    line = " ".join(text.split())
    return "".join(sign for sign in line if sign.isprintable())[:160]


def _refused(where: str, got: str, expected: str, hint: str) -> InputError:
    return InputError(where, got=got, expected=expected, hint=hint or "reload the page.")
