"""A linearisation for scripts and terminals."""

from collections.abc import Iterator
from math import isfinite, isnan
from typing import Annotated, Any, Literal

from pydantic import Field
from typing_extensions import TypedDict

from klack.analyses.json_parts import OwnComponents, Real, Version
from klack.analyses.linearisation.record import (
    Eigenvalue,
    LinearModel,
    LoopMargins,
    SignalName,
    StabilitySweep,
)
from klack.analyses.study.wording import number_text
from klack.terminal.tables import TextTable
from klack.units import format_si

__all__ = [
    "LinearModelJson",
    "eigenvalue_rows",
    "linear_model_to_json",
    "linear_model_told",
    "loop_rows",
    "stability_text",
    "sweep_rows",
]

_TOLD = 24
"""Eigenvalues on a terminal."""
_PARTS = 3

EIGENVALUE_HEADS = ("", "frequency", "damping ratio", "time constant", "components")
LOOP_HEADS = ("loop opened at", "gain margin", "at", "phase margin", "at", "distance from -1", "at")


SWEEP_HEADS = ("value", "", "frequency", "damping ratio")


class SignalJson(TypedDict):
    """A state, input or output."""

    name: str
    unit: Annotated[str, Field(description="SI.")]


class EigenvalueJson(TypedDict):
    """One eigenvalue, or one of a conjugate pair."""

    real_1_s: float
    imaginary_1_s: float
    uncertainty_1_s: Annotated[float, Field(description="By which round-off may move it.")]
    frequency_Hz: Real
    damping_ratio: Real
    time_constant_s: Annotated[Real, Field(description="Null where it neither decays nor grows.")]
    verdict: Literal["decays", "grows", "neutral"]
    participation: Annotated[dict[str, float], Field(description="By component, from 1 % on.")]


class ResponseJson(TypedDict):
    """Frequency response of one output to one input."""

    source: str
    target: str
    unit: str
    frequency_Hz: list[float]
    real: list[float]
    imaginary: list[float]


class LoopJson(TypedDict):
    """Margins of an opened loop; null where there is no crossing."""

    opened_at: str
    gain_margin: Annotated[Real, Field(description="Factor on the loop, the nearest to one.")]
    gain_margin_frequency_Hz: Real
    phase_margin_deg: Real
    phase_margin_frequency_Hz: Real
    distance: Annotated[float, Field(description="Least distance of the open loop from -1.")]
    distance_frequency_Hz: float


class SweepJson(TypedDict):
    """The oscillation that decays the slowest along a sweep; null where there is none."""

    name: str
    unit: Annotated[str, Field(description="SI; 1 for a pure number.")]
    values: list[float]
    growth_1_s: list[Real]
    frequency_Hz: list[Real]
    damping_ratio: list[Real]
    unstable: Annotated[
        list[int], Field(description="Eigenvalues that grow; -1 where there is no point.")
    ]
    failures: Annotated[list[str], Field(description="Why there is no point; else empty.")]


class LinearModelJson(TypedDict):
    """``klack linearise``."""

    schema: Literal["klack-linearise/1"]
    case: str
    klack: Version
    own_components: OwnComponents
    variant: str
    current_A: Annotated[dict[str, float], Field(description="By coil.")]
    operating_point: Annotated[
        dict[str, Real], Field(description="By component, quantity and unit [SI].")
    ]
    stable: Annotated[
        bool | None, Field(description="Null where something neither decays nor grows.")
    ]
    band_Hz: Annotated[float, Field(description="Of matrices and eigenvalues with lines.")]
    delays_s: list[float]
    states: list[SignalJson]
    inputs: list[SignalJson]
    outputs: list[SignalJson]
    A: list[list[float]]
    B: list[list[float]]
    C: list[list[float]]
    D: list[list[float]]
    eigenvalues: list[EigenvalueJson]
    unconfirmed: Annotated[int, Field(description="Of the matrices, without a root with delays.")]
    responses: list[ResponseJson]
    loops: list[LoopJson]
    sweeps: list[SweepJson]
    cpu_time_s: Real
    wall_time_s: Real
    warnings: list[str]


def linear_model_to_json(record: LinearModel) -> dict[str, Any]:
    """Plain numbers in SI."""
    return {
        "schema": "klack-linearise/1",
        "case": record.case,
        "klack": record.version,
        "own_components": dict(record.own_components),
        "variant": record.variant,
        "current_A": dict(record.drive),
        "operating_point": {
            f"{x.component} {x.quantity} [{x.unit}]": _real(x.value) for x in record.point
        },
        "stable": None if record.neutral and not record.growing else not record.growing,
        "band_Hz": record.band,
        "delays_s": record.delays.tolist(),
        "states": _signals(record.states),
        "inputs": _signals(record.inputs),
        "outputs": _signals(record.outputs),
        "A": record.A.tolist(),
        "B": record.B.tolist(),
        "C": record.C.tolist(),
        "D": record.D.tolist(),
        "eigenvalues": [_eigenvalue(record, k, x) for k, x in enumerate(record.eigenvalues)],
        "unconfirmed": record.unconfirmed,
        "responses": [
            {
                "source": x.source.name,
                "target": x.target.name,
                "unit": x.unit,
                "frequency_Hz": x.frequency.tolist(),
                "real": x.real.tolist(),
                "imaginary": x.imaginary.tolist(),
            }
            for x in record.responses
        ],
        "loops": [_loop(x) for x in record.loops],
        "sweeps": [
            {
                "name": x.name,
                "unit": x.unit,
                "values": x.values.tolist(),
                "growth_1_s": [_real(v) for v in x.growth],
                "frequency_Hz": [_real(v) for v in x.frequency],
                "damping_ratio": [_real(v) for v in x.damping],
                "unstable": x.unstable.tolist(),
                "failures": list(x.failures),
            }
            for x in record.sweeps
        ],
        "cpu_time_s": record.cpu_time,
        "wall_time_s": record.wall_time,
        "warnings": list(record.warnings),
    }


def _real(value: float) -> float | None:
    return float(value) if isfinite(value) else None


def _signals(signals: tuple[SignalName, ...]) -> list[dict[str, str]]:
    return [{"name": x.name, "unit": x.unit} for x in signals]


def _eigenvalue(record: LinearModel, k: int, mode: Eigenvalue) -> dict[str, Any]:
    return {
        "real_1_s": mode.real,
        "imaginary_1_s": mode.imaginary,
        "uncertainty_1_s": mode.uncertainty,
        "frequency_Hz": _real(mode.frequency),
        "damping_ratio": _real(mode.damping),
        "time_constant_s": _real(mode.time_constant),
        "verdict": mode.verdict,
        "participation": record.parts(k),
    }


def _loop(loop: LoopMargins) -> dict[str, Any]:
    return {
        "opened_at": loop.name,
        "gain_margin": _real(loop.gain_margin),
        "gain_margin_frequency_Hz": _real(loop.gain_frequency),
        "phase_margin_deg": _real(loop.phase_margin),
        "phase_margin_frequency_Hz": _real(loop.phase_frequency),
        "distance": loop.distance,
        "distance_frequency_Hz": loop.distance_frequency,
    }


def stability_text(record: LinearModel) -> str:
    """In plain words whether the point is stable."""
    up_to = f" up to {format_si(record.band, 'Hz', 3)}" if record.has_lines else ""
    if record.growing:
        worst = max(record.growing, key=lambda mode: mode.real)
        k = record.eigenvalues.index(worst)
        names = " and ".join(f"'{name}'" for name in list(record.parts(k))[:2])
        way = (
            f"oscillates at {format_si(worst.frequency, 'Hz', 4)} and grows"
            if worst.imaginary > 0.0
            else "moves away without oscillating and grows"
        )
        return (
            f"Unstable: a small disturbance {way} by a factor of e in "
            f"{format_si(worst.time_constant, 's', 3)}, in {names}."
        )
    slow = [mode for mode in record.eigenvalues if mode.verdict == "decays"]
    least = min(slow, key=lambda mode: mode.time_constant * -1.0, default=None)
    told = f"Stable{up_to}: every small disturbance decays"
    if record.neutral:
        told = (
            f"Neither stable nor unstable{up_to}: {len(record.neutral)} motions neither decay "
            "nor grow (a free body, enclosed fluid, or one without losses); all others decay"
        )
    if least is None:
        return f"{told}."
    return f"{told}, the slowest to 1/e in {format_si(least.time_constant, 's', 3)}."


def eigenvalue_rows(record: LinearModel, most: int) -> list[tuple[str, ...]]:
    """Verdict, frequency, damping ratio, time constant and components."""
    rows: list[tuple[str, ...]] = []
    for k in _shown(record, most):
        mode = record.eigenvalues[k]
        parts = ", ".join(
            f"{name} {100.0 * share:.0f} %"
            for name, share in list(record.parts(k).items())[:_PARTS]
        )
        oscillates = mode.imaginary > 0.0
        rows.append(
            (
                mode.verdict,
                format_si(mode.frequency, "Hz", 5) if oscillates else "–",
                f"{mode.damping:.4g}" if oscillates else "–",
                format_si(mode.time_constant, "s", 4) if isfinite(mode.time_constant) else "–",
                parts,
            )
        )
    return rows


def _shown(record: LinearModel, most: int) -> list[int]:
    """Eigenvalues worth a row: those of the memory of friction in lines come last."""
    of_lines = {
        name.name.rpartition(".")[0] for name in record.states if "friction term" in name.name
    }

    def is_memory(k: int) -> bool:
        parts = record.parts(k)
        first = next(iter(parts), "")
        return record.eigenvalues[k].imaginary == 0.0 and first in of_lines

    order = sorted(range(len(record.eigenvalues)), key=is_memory)
    return order[:most]


def loop_rows(record: LinearModel) -> list[tuple[str, ...]]:
    """Margins of every loop."""

    def at(value: float) -> str:
        return "–" if isnan(value) else format_si(value, "Hz", 4)

    return [
        (
            loop.name,
            "–" if isnan(loop.gain_margin) else f"{loop.gain_margin:.4g}",
            at(loop.gain_frequency),
            "–" if isnan(loop.phase_margin) else f"{loop.phase_margin:.3g}°",
            at(loop.phase_frequency),
            f"{loop.distance:.4g}",
            at(loop.distance_frequency),
        )
        for loop in record.loops
    ]


def sweep_rows(swept: StabilitySweep) -> list[tuple[str, ...]]:
    """Verdict and least damped oscillation at every value."""
    rows: list[tuple[str, ...]] = []
    for i, value in enumerate(swept.values):
        word = "not found" if swept.failures[i] else "unstable" if swept.unstable[i] else "stable"
        known = isfinite(swept.frequency[i])
        rows.append(
            (
                number_text(float(value), swept.unit, 4),
                word,
                format_si(float(swept.frequency[i]), "Hz", 4) if known else "–",
                f"{swept.damping[i]:.4g}" if known else "–",
            )
        )
    return rows


def linear_model_told(record: LinearModel) -> Iterator[TextTable | str]:
    """What a terminal shows: the verdict, the point, the eigenvalues, margins."""
    drive = ", ".join(f"{name} at {format_si(i, 'A')}" for name, i in record.drive.items())
    yield TextTable(
        title=f"Operating point, {record.variant}: {drive or 'no coil'}",
        columns=("component", "quantity", "value"),
        rows=[(x.component, x.quantity, number_text(x.value, x.unit, 6)) for x in record.point],
        left=2,
    )
    count = len(record.eigenvalues)
    about = f", up to {format_si(record.band, 'Hz', 3)}" if record.has_lines else ""
    yield TextTable(
        title=f"Eigenvalues{about}",
        columns=EIGENVALUE_HEADS,
        rows=[(*row[:1], *row[1:]) for row in eigenvalue_rows(record, _TOLD)],
        left=1,
    )
    if count > _TOLD:
        yield f"{_TOLD} of {count} eigenvalues; all of them are in the CSV file."
    if record.loops:
        yield TextTable(title="Stability margins", columns=LOOP_HEADS, rows=loop_rows(record))
    for swept in record.sweeps:
        yield TextTable(
            title=f"Oscillation that decays the slowest, over {swept.short}",
            columns=SWEEP_HEADS,
            rows=sweep_rows(swept),
            left=2,
        )
    yield stability_text(record)
    yield (
        f"{len(record.states)} states, {len(record.inputs)} inputs, {len(record.outputs)} outputs "
        f"in {format_si(record.cpu_time, 's', 3)} of processor time."
    )
