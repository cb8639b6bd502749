"""An advice in words and numbers."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from klack.analyses.advice.advice import Advice, Counsel, Fixed
from klack.analyses.advice.ladder import REACH, Measure, score
from klack.analyses.advice.settings import SettingValue
from klack.analyses.analysis import Analysis
from klack.analyses.json_parts import JsonForm, Key, Real, schema_key
from klack.input.problem import Key as CaseKey
from klack.terminal.tables import TextTable
from klack.units import format_si

__all__ = ["ADVICE", "AdvisedCase"]

_COLUMNS = (
    "setting",
    "in the case",
    "advised",
    "order",
    "expected error now",
    "with the advice",
    "from runs",
)


@dataclass(frozen=True, kw_only=True, eq=False)
class AdvisedCase:
    """Advice for a case file, with the sections ``yaml`` of :func:`advice_yaml`.

    ``written`` is the file of the whole case with the advice.
    """

    advice: Advice
    changes: Mapping[CaseKey, str]
    yaml: str
    written: Path | None


def _told(advised: AdvisedCase) -> Iterator[TextTable | str]:
    advice = advised.advice
    title = f"{advice.title}: advice for the {advice.level} level"
    yield TextTable(title=title, columns=_COLUMNS, rows=_rows(advice))
    yield from _lines(advice)
    if advised.yaml:
        yield "\nReplace these keys of the case:\n"
        yield advised.yaml
    if advised.written is not None:
        yield f"The case with the advice: {advised.written}"


def _rows(advice: Advice) -> tuple[tuple[str, ...], ...]:
    measures = advice.measures
    rows = [_row(item, measures) for item in advice.counsels]
    for fixed in advice.fixed:
        error = _errors(fixed.errors, measures)
        rows.append((fixed.name, "-", "-", "-", error, error, "reduced and interface"))
    now, then = _errors(advice.now, measures), _errors(advice.then, measures)
    rows.append((_sum(advice), "", "", "", now, then, ""))
    limits = np.array([measure.limit for measure in measures])
    rows.append(("target", "", "", "", *[_errors(limits, measures)] * 2, ""))
    if advice.checked is not None:
        checked = [_errors(item, measures) for item in advice.checked]
        rows.append(("run again", "", "", "", *checked, "against the finest run"))
    return tuple(rows)


def _sum(advice: Advice) -> str:
    return f"sum, without the mesh of {', '.join(advice.unmeshed)}" if advice.unmeshed else "sum"


def _row(item: Counsel, measures: Sequence[Measure]) -> tuple[str, ...]:
    setting, values = item.measured.setting, item.values
    advised = "as it is"
    if item.changes:
        advised = ", ".join(_value(value, values[value.key]) for value in _different(item))
    return (
        setting.name,
        ", ".join(_value(value, value.value) for value in _different(item)),
        advised,
        _order(item),
        _errors(item.now, measures),
        _errors(item.then, measures),
        item.measured.runs,
    )


def _different(item: Counsel) -> list[SettingValue]:
    found = {(v.key[-1], v.value, item.values[v.key]): v for v in item.measured.setting.values}
    return list(found.values())


def _value(value: SettingValue, number: float) -> str:
    name = str(value.key[-1])
    if name in ("grading", "participation"):
        return f"{name} {number:g}"
    return format_si(number, value.unit, 3) if value.unit else f"{number:g}"


def _order(item: Counsel) -> str:
    ladder = item.measured.ladder
    if np.isnan(ladder.raw_order):
        return f"{ladder.order:g} assumed"
    return "none seen" if ladder.scattered else f"{ladder.raw_order:.1f}"


def _errors(errors: NDArray[np.float64], measures: Sequence[Measure]) -> str:
    pairs = [(e, m) for e, m in zip(errors, measures, strict=True) if np.isfinite(m.limit)]
    parts = [_number(100.0 * max(e for e, m in pairs if not m.decibel), "%")]
    parts += [_number(e, "dB") for e, m in pairs if m.decibel]
    return ", ".join(parts)


def _number(value: float, unit: str) -> str:
    return f"< 0.01 {unit}" if value < 0.01 else f"{value:.2g} {unit}"


def _lines(advice: Advice) -> tuple[str, ...]:
    return tuple(
        line
        for line in (
            _verdict(advice),
            _band(advice),
            _cost(advice),
            f"Check: {advice.check_words}." if advice.check_words else "",
            *_reaches(advice),
            *(f"Note: {note}" for note in advice.notes),
        )
        if line
    )


def _verdict(advice: Advice) -> str:
    if not advice.unmeshed:
        return _verdict_of_sums(advice)
    meshes = "a mesh that was given" if len(advice.unmeshed) == 1 else "meshes that were given"
    whole = any(item.measured.setting.group == "mesh" for item in advice.counsels)
    what = "" if whole else "Only modes and step can be advised here. "
    return f"{what}Apart from the error of {meshes}: {_lowered(_verdict_of_sums(advice))}"


def _lowered(text: str) -> str:
    return text[0].lower() + text[1:]


def _verdict_of_sums(advice: Advice) -> str:
    if advice.is_good:
        text = "The case meets the target unchanged"
        return f"{text}; the advice reduces its cost." if advice.changes else f"{text}: keep it."
    if advice.meets:
        return "The case is expected to miss the target, and the advised one to meet it."
    return (
        "The sum of the expected errors exceeds the target: the advice is limited by "
        "extrapolation and by the size of the models."
        + _narrower(advice)
        + (" When run again, the advised case meets the target." if _within(advice) else "")
    )


def _narrower(advice: Advice) -> str:
    """A way out where third octaves miss the target that force and time meet."""
    relative = [(e, m) for e, m in zip(advice.then, advice.measures, strict=True) if not m.decibel]
    met = score(np.array([e for e, _ in relative]), [m for _, m in relative]) <= 1.0
    if not (met and advice.band_from_case):
        return ""
    return (
        " Peak force, contact time and history meet the target, third octaves do not. Try: "
        "--up-to with the highest frequency that matters, or a larger --bands."
    )


def _within(advice: Advice) -> bool:
    return advice.checked is not None and score(advice.checked[1], advice.measures) <= 1.0


def _band(advice: Advice) -> str:
    if not np.isfinite(advice.up_to):
        return ""
    why = "the highest within 40 dB of the strongest" if advice.band_from_case else "as asked"
    return (
        f"Third octaves are judged up to {format_si(advice.up_to, 'Hz', 3)} ({why}); errors in % "
        "are the worst of peak force, contact time and force history (rms, of the peak)."
    )


def _cost(advice: Advice) -> str:
    if advice.dofs is None:
        return ""
    (before, after), (now, then) = advice.dofs, advice.times
    return (
        f"Cost: {before} degrees of freedom and {format_si(now, 's', 2)} to reduced bodies now, "
        f"{after} and about {format_si(then, 's', 2)} with the advice. "
        f"Measured with {advice.runs} runs in {format_si(advice.wall_time, 's', 2)}."
    )


def _reaches(advice: Advice) -> list[str]:
    lines = []
    for item in advice.counsels:
        name = item.measured.setting.name
        if item.extrapolated > 1.001:
            lines.append(
                f"Note: '{name}' is advised {item.extrapolated:.2g} times beyond what was run."
            )
        if not item.reached and item.measured.ladder.scattered:
            lines.append(
                f"Note: '{name}' scatters by more than its share of the target: refinement does "
                "not reduce the changes, so nothing finer is advised."
            )
        elif not item.reached:
            lines.append(
                f"Note: '{name}' does not reach its share of the target within {REACH:g} times "
                "the resolution of the finest run. Try: apply the advice, then run klack advise "
                "again."
            )
        elif item.measured.ladder.scattered and item.measured.setting.group == "mesh":
            lines.append(
                f"Note: refining '{name}' changes the results as much as before: the remaining "
                "error is the scatter between meshes."
            )
    for fixed in advice.fixed:
        limits = np.array([measure.limit for measure in advice.measures])
        if np.max(fixed.errors / limits) > 0.5:
            lines.append(
                f"Note: '{fixed.name}' uses more than half of the target, and no setting reduces "
                f"it. Try: {fixed.remedy}."
            )
    return lines


_Named = Callable[[NDArray[np.float64]], dict[str, float]]


class _Advised(NamedTuple):
    item: Counsel | Fixed
    errors: _Named


def _errors_of(advised: AdvisedCase) -> _Named:
    names = _names(advised)
    return lambda found: dict(zip(names, found, strict=True))


def _names(advised: AdvisedCase) -> list[str]:
    return [
        item.name.replace(" ", "_") + ("_dB" if item.decibel else "")
        for item in advised.advice.measures
    ]


def _both(now: Any, then: Any) -> dict[str, Any]:
    return {"now": now, "advised": then}


def _targets(advised: AdvisedCase) -> dict[str, float]:
    limits = zip(_names(advised), (item.limit for item in advised.advice.measures), strict=True)
    return {name: limit for name, limit in limits if np.isfinite(limit)}


def _run_again(advised: AdvisedCase) -> dict[str, Any] | None:
    checked = advised.advice.checked
    return None if checked is None else _both(*map(_errors_of(advised), checked))


def _is_measured(of: Any) -> bool:
    ladder = of.item.measured.ladder
    return bool(np.isfinite(ladder.raw_order) and not ladder.scattered)


_Errors = dict[Literal["now", "advised"], dict[str, Real]]
_SETTING = JsonForm(
    "AdvisedSettingJson",
    "One setting with its measured convergence.",
    Key("name", str, of="item.measured.setting.name"),
    Key("kind", str, of="item.measured.setting.group"),
    Key(
        "values",
        dict[str, dict[str, Real]],
        "By key: now, advised.",
        lambda of: {
            ".".join(map(str, value.key)): _both(value.value, of.item.values[value.key])
            for value in of.item.measured.setting.values
        },
    ),
    Key("order", float, of="item.measured.ladder.order"),
    Key("order_measured", bool, of=_is_measured),
    Key("factors_run", list[float], of="item.measured.ladder.factors"),
    Key("factor", float, of="item.factor"),
    Key("reached", bool, of="item.reached"),
    Key(
        "error",
        dict[str, dict[str, Real]],
        of=lambda of: _both(of.errors(of.item.now), of.errors(of.item.then)),
    ),
    Key("runs", str, of="item.measured.runs"),
)
_FIXED = JsonForm(
    "FixedErrorJson",
    "An error that no setting can reduce.",
    Key("name", str, of="item.name"),
    Key("error", dict[str, Real], of=lambda of: of.errors(of.item.errors)),
)
_ADVICE = JsonForm(
    "AdviceJson",
    "``klack advise``: errors are relative, or in dB where the name says so.",
    schema_key("klack-advise/1"),
    Key("case", str, of="advice.case"),
    Key("level", str, of="advice.level"),
    Key("judged_up_to_Hz", Real, of="advice.up_to"),
    Key("target", dict[str, float], of=_targets),
    Key(
        "meets_target",
        dict[Literal["now", "advised"], bool | None],
        of=lambda advised: _both(advised.advice.is_good, advised.advice.meets),
    ),
    Key("meshes_given", list[str], of="advice.unmeshed"),
    Key(
        "settings",
        [_SETTING],
        of=lambda advised: [_Advised(x, _errors_of(advised)) for x in advised.advice.counsels],
    ),
    Key(
        "fixed",
        [_FIXED],
        of=lambda advised: [_Advised(x, _errors_of(advised)) for x in advised.advice.fixed],
    ),
    Key(
        "expected_error",
        _Errors,
        of=lambda of: _both(*map(_errors_of(of), (of.advice.now, of.advice.then))),
    ),
    Key("run_again", _Errors | None, of=_run_again),
    Key(
        "degrees_of_freedom",
        dict[Literal["now", "advised"], int] | None,
        of=lambda advised: advised.advice.dofs and _both(*advised.advice.dofs),
    ),
    Key(
        "changes",
        dict[str, str],
        "Values written by the advice, by key.",
        lambda advised: {".".join(map(str, key)): x for key, x in advised.changes.items()},
    ),
    Key("notes", list[str], of="advice.notes"),
    Key("runs", int, of="advice.runs"),
    Key("wall_time_s", float, of="advice.wall_time"),
)
ADVICE = Analysis(json=_ADVICE.type, to_json=_ADVICE.json, told=_told)
