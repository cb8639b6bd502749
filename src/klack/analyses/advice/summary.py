"""An advice in words and numbers: rows of the table, lines below it, plain JSON."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from typing_extensions import TypedDict

from klack.analyses.advice.advice import Advice, Counsel
from klack.analyses.advice.ladder import REACH, Measure, score
from klack.analyses.advice.settings import SettingValue
from klack.analyses.json_parts import Real
from klack.input.problem import Key
from klack.terminal.tables import TextTable
from klack.units import format_si

__all__ = [
    "ADVICE_COLUMNS",
    "AdviceJson",
    "AdvisedCase",
    "advice_lines",
    "advice_rows",
    "advice_to_json",
    "advice_told",
]

ADVICE_COLUMNS = (
    "setting",
    "in the case",
    "advised",
    "order",
    "expected error now",
    "with the advice",
    "from runs",
)


class AdvisedSettingJson(TypedDict):
    """One setting with its measured convergence."""

    name: str
    kind: str
    values: Annotated[dict[str, dict[str, Real]], Field(description="By key: now, advised.")]
    order: float
    order_measured: bool
    factors_run: list[float]
    factor: float
    reached: bool
    error: dict[str, dict[str, Real]]
    runs: str


class FixedErrorJson(TypedDict):
    """An error that no setting changes."""

    name: str
    error: dict[str, Real]


class AdviceJson(TypedDict):
    """``klack advise``: errors relative, or in dB where the name says so."""

    schema: Literal["klack-advise/1"]
    case: str
    level: str
    judged_up_to_Hz: Real
    target: dict[str, float]
    meets_target: dict[Literal["now", "advised"], bool | None]
    meshes_given: list[str]
    settings: list[AdvisedSettingJson]
    fixed: list[FixedErrorJson]
    expected_error: dict[Literal["now", "advised"], dict[str, Real]]
    run_again: dict[Literal["now", "advised"], dict[str, Real]] | None
    degrees_of_freedom: dict[Literal["now", "advised"], int] | None
    changes: Annotated[dict[str, str], Field(description="By key: what the advice writes.")]
    notes: list[str]
    runs: int
    wall_time_s: float


@dataclass(frozen=True, kw_only=True, eq=False)
class AdvisedCase:
    """An advice for a case file, and what it writes there.

    Parameters
    ----------
    advice : Advice
    changes : mapping of key to str
    yaml : str
        Sections of the case with the advice in them; empty if nothing changes.
    written : Path or None
        Where the whole case with the advice stands.
    """

    advice: Advice
    changes: Mapping[Key, str]
    yaml: str
    written: Path | None


def advice_told(advised: AdvisedCase) -> Iterator[TextTable | str]:
    """What a terminal shows: the settings, the verdict, and what to write into the case."""
    advice = advised.advice
    title = f"{advice.title}: advice for the {advice.level} level"
    yield TextTable(title=title, columns=ADVICE_COLUMNS, rows=advice_rows(advice))
    yield from advice_lines(advice)
    if advised.yaml:
        yield "\nIn place of the same keys of the case:\n"
        yield advised.yaml
    if advised.written is not None:
        yield f"The case with the advice: {advised.written}"


def advice_rows(advice: Advice) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`ADVICE_COLUMNS`: settings, what no setting changes, sums, target, check."""
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
    """Values of a setting, one of those that are alike in name, now and then."""
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
    """Worst of the judged relative errors, and the levels."""
    pairs = [(e, m) for e, m in zip(errors, measures, strict=True) if np.isfinite(m.limit)]
    parts = [_number(100.0 * max(e for e, m in pairs if not m.decibel), "%")]
    parts += [_number(e, "dB") for e, m in pairs if m.decibel]
    return ", ".join(parts)


def _number(value: float, unit: str) -> str:
    return f"< 0.01 {unit}" if value < 0.01 else f"{value:.2g} {unit}"


def advice_lines(advice: Advice) -> tuple[str, ...]:
    """Sentences below the table: verdict, band, cost, what is missing."""
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
    what = "" if whole else "Modes and step alone can be advised here. "
    return f"{what}But for the error of {meshes}: {_lowered(_verdict_of_sums(advice))}"


def _lowered(text: str) -> str:
    return text[0].lower() + text[1:]


def _verdict_of_sums(advice: Advice) -> str:
    if advice.is_good:
        text = "The case meets the target as it is"
        return f"{text}; the advice makes it cheaper." if advice.changes else f"{text}: keep it."
    if advice.meets:
        return "The case is expected to miss the target, and the advised one to meet it."
    return (
        "By the sum of expected errors the target is not reached: the advice goes as far as runs "
        "can be extrapolated and larger models be afforded."
        + _narrower(advice)
        + (" Run again, the advised case is within it." if _within(advice) else "")
    )


def _narrower(advice: Advice) -> str:
    """A way out where third octaves miss the target that force and time meet."""
    relative = [(e, m) for e, m in zip(advice.then, advice.measures, strict=True) if not m.decibel]
    met = score(np.array([e for e, _ in relative]), [m for _, m in relative]) <= 1.0
    if not (met and advice.band_from_case):
        return ""
    return (
        " Peak force, contact time and history are within it, third octaves are not. Try: "
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
                f"Note: '{name}' scatters by more than its share of the target: refining it "
                "changes no less than it did before, so nothing finer is advised."
            )
        elif not item.reached:
            lines.append(
                f"Note: '{name}' does not reach its share of the target within {REACH:g} times "
                "finer than the finest run. Try: apply the advice and ask again."
            )
        elif item.measured.ladder.scattered and item.measured.setting.group == "mesh":
            lines.append(
                f"Note: refining '{name}' changes no less than it did before: what is left there "
                "is the scatter of meshes."
            )
    for fixed in advice.fixed:
        limits = np.array([measure.limit for measure in advice.measures])
        if np.max(fixed.errors / limits) > 0.5:
            lines.append(
                f"Note: '{fixed.name}' takes more than half of the target, and no setting changes "
                f"it. Try: {fixed.remedy}."
            )
    return lines


def advice_to_json(advised: AdvisedCase) -> AdviceJson:
    """Plain numbers: errors relative (-) or in dB, settings in SI."""
    advice = advised.advice
    names = [_json_name(measure) for measure in advice.measures]

    def errors(found: NDArray[np.float64]) -> dict[str, float | None]:
        return {name: float(value) for name, value in zip(names, found, strict=True)}

    return {
        "schema": "klack-advise/1",
        "case": advice.case,
        "level": advice.level,
        "judged_up_to_Hz": advice.up_to if np.isfinite(advice.up_to) else None,
        "target": {
            name: measure.limit
            for name, measure in zip(names, advice.measures, strict=True)
            if np.isfinite(measure.limit)
        },
        "meets_target": {"now": advice.is_good, "advised": advice.meets},
        "meshes_given": list(advice.unmeshed),
        "settings": [_setting_json(item, errors) for item in advice.counsels],
        "fixed": [{"name": item.name, "error": errors(item.errors)} for item in advice.fixed],
        "expected_error": {"now": errors(advice.now), "advised": errors(advice.then)},
        "run_again": None
        if advice.checked is None
        else {"now": errors(advice.checked[0]), "advised": errors(advice.checked[1])},
        "degrees_of_freedom": None
        if advice.dofs is None
        else {"now": advice.dofs[0], "advised": advice.dofs[1]},
        "changes": {".".join(map(str, key)): text for key, text in advised.changes.items()},
        "notes": list(advice.notes),
        "runs": advice.runs,
        "wall_time_s": advice.wall_time,
    }


def _json_name(measure: Measure) -> str:
    return measure.name.replace(" ", "_") + ("_dB" if measure.decibel else "")


def _setting_json(item: Counsel, errors: Any) -> AdvisedSettingJson:
    ladder, setting = item.measured.ladder, item.measured.setting
    return {
        "name": setting.name,
        "kind": setting.group,
        "values": {
            ".".join(map(str, value.key)): {"now": value.value, "advised": item.values[value.key]}
            for value in setting.values
        },
        "order": ladder.order,
        "order_measured": bool(np.isfinite(ladder.raw_order) and not ladder.scattered),
        "factors_run": list(ladder.factors),
        "factor": item.factor,
        "reached": item.reached,
        "error": {"now": errors(item.now), "advised": errors(item.then)},
        "runs": item.measured.runs,
    }
