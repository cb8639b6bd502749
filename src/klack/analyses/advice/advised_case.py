"""Advice for a case of either kind, also as YAML."""

from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any, cast

from ruamel.yaml import YAML

from klack.analyses.advice.advice import Advice
from klack.analyses.advice.impact import AdviceLevel, advise_impact
from klack.analyses.advice.stroke import advise_stroke
from klack.case.any_case import CaseTree, read_any_case
from klack.case.key_path import written_at
from klack.case.rewriting import merged, moved_files, plain_data, with_values
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.errors import InputError, refuse_if
from klack.input.problem import Key
from klack.machine.progress import Progress, silent
from klack.units import FREQUENCY, LENGTH, TIME, format_si, parse_quantity

__all__ = ["advice_yaml", "advise_case", "advised_text", "changed_values"]


def advise_case(
    case: Case | ValveCase,
    *,
    error: float = 0.01,
    level_error: float = 1.0,
    up_to: float | None = None,
    level: str | None = None,
    confirm: bool = True,
    progress: Progress = silent,
    threads: int | None = None,
) -> Advice:
    """Advise an impact of two bodies, or the stroke of a whole valve.

    Parameters are those of :func:`klack.analyses.advice.impact.advise_impact`; a stroke has neither
    band nor levels.
    """
    if isinstance(case, Case):
        advice = advise_impact(
            case,
            error=error,
            level_error=level_error,
            up_to=up_to,
            level=cast(AdviceLevel | None, level),
            confirm=confirm,
            progress=progress,
            threads=threads,
        )
    else:
        _refuse_options(("--up-to", up_to and format_si(up_to, "Hz", 3)), ("--level", level))
        advice = advise_stroke(
            case, error=error, confirm=confirm, progress=progress, threads=threads
        )
    return replace(advice, notes=(*advice.notes, *case.input_notes))


def _refuse_options(*given: tuple[str, object]) -> None:
    for option, value in given:
        refuse_if(
            value is not None,
            option,
            got=f"{value} for the case of a whole valve",
            expected="no such option: a stroke is judged by its first impacts",
            hint="use it for a case of two bodies, e.g. klack advise demo-valve-axisymmetric.",
        )


_WIDTH = 96
_KINDS = (LENGTH, TIME, FREQUENCY)


def changed_values(tree: CaseTree, advice: Advice) -> dict[Key, str]:
    """What the advice writes at each key, in the unit that stands there now."""
    units = {item.key: item.unit for c in advice.counsels for item in c.measured.setting.values}
    return {
        key: _written(written_at(tree.data, key), value, units[key])
        for key, value in advice.changes.items()
    }


def _written(now: object, value: float, unit: str) -> str:
    if not unit:
        return f"{value:g}"
    if isinstance(now, str):
        rest = now.strip().lstrip("+-0123456789.eE").strip()
        if rest:
            kind = next(kind for kind in _KINDS if kind.unit == unit)
            return f"{value / parse_quantity(f'1 {rest}', kind):.6g} {rest}"
    return format_si(value, unit, 3)


def advice_yaml(tree: CaseTree, advice: Advice) -> str:
    """Sections to merge into the case: whole meshes and modes, single other keys.

    Empty if nothing changes.
    """
    safe = YAML(typ="safe")
    data: Any = {}
    for key, text in changed_values(tree, advice).items():
        whole = key[:3] if key[0] == "bodies" and key[2] == "mesh" else None
        if whole and written_at(data, whole) is None:
            data = merged(data, whole, plain_data(written_at(tree.data, whole)))
        data = merged(data, key, safe.load(text))
    if not data:
        return ""
    out = YAML()
    out.width = _WIDTH
    out.default_flow_style = None  # innermost mappings in one line
    stream = StringIO()
    out.dump(data, stream)
    return stream.getvalue()


def advised_text(tree: CaseTree, advice: Advice, path: Path, version: str) -> str:
    """Text of the case with the advice, for a file at ``path``; comments and order stay.

    InputError if the new text is no case, or a value cannot be exchanged alone.
    """
    values = changed_values(tree, advice)
    header = (
        f"Advised by klack {version} (klack advise), from {tree.path.name}; "
        f"{len(values)} values were changed."
    )
    moved = moved_files(tree, path.absolute().parent)
    text = with_values(tree, {**moved, **values}, header)
    try:
        read_any_case(text, path, tree.components.values())
    except InputError as error:
        raise InputError(
            f"--write {path}",
            got=f"no case with the advice in it ({error.where}: {error.got})",
            expected=error.expected,
            hint=error.hint,
        ) from None
    return text
