"""A linearisation in words and numbers, and on disk.

``result.zarr/study/A`` is the matrix of the states.
"""

from collections.abc import Iterator, Mapping
from math import isfinite, isnan
from typing import Literal, NamedTuple

from klack.analyses.analysis import StoredAnalysis
from klack.analyses.json_parts import CASE, OWN_COMPONENTS, JsonForm, Key, Real, schema_key
from klack.analyses.linearisation.record import Eigenvalue, LinearModel, StabilitySweep
from klack.analyses.store import RecordFormat
from klack.analyses.study.wording import number_text
from klack.terminal.tables import TextTable
from klack.units import format_si

__all__ = ["LINEARISATION", "eigenvalue_rows", "loop_rows", "stability_text", "sweep_rows"]


_TOLD = 24
_PARTS = 3

EIGENVALUE_HEADS = ("", "frequency", "damping ratio", "time constant", "components")
LOOP_HEADS = ("loop opened at", "gain margin", "at", "phase margin", "at", "distance from -1", "at")


SWEEP_HEADS = ("value", "", "frequency", "damping ratio")


_SIGNAL = JsonForm(
    "SignalJson", "A state, input or output.", Key("name", str), Key("unit", str, "SI.")
)
_EIGENVALUE = JsonForm(
    "EigenvalueJson",
    "One eigenvalue, or one of a conjugate pair.",
    Key("real_1_s", float, of="mode.real"),
    Key("imaginary_1_s", float, of="mode.imaginary"),
    Key("uncertainty_1_s", float, "Possible shift by round-off.", "mode.uncertainty"),
    Key("frequency_Hz", Real, of="mode.frequency"),
    Key("damping_ratio", Real, of="mode.damping"),
    Key("time_constant_s", Real, "Null where it neither decays nor grows.", "mode.time_constant"),
    Key("verdict", Literal["decays", "grows", "neutral"], of="mode.verdict"),
    Key("participation", dict[str, float], "By component, 1 % and above.", "parts"),
)
_RESPONSE = JsonForm(
    "ResponseJson",
    "Frequency response of one output to one input.",
    Key("source", str, of="source.name"),
    Key("target", str, of="target.name"),
    Key("unit", str),
    Key("frequency_Hz", list[float], of="frequency"),
    Key("real", list[float]),
    Key("imaginary", list[float]),
)
_LOOP = JsonForm(
    "LoopJson",
    "Margins of an opened loop; null where there is no crossing.",
    Key("opened_at", str, of="name"),
    Key("gain_margin", Real, "Factor on the loop, the nearest to one."),
    Key("gain_margin_frequency_Hz", Real, of="gain_frequency"),
    Key("phase_margin_deg", Real, of="phase_margin"),
    Key("phase_margin_frequency_Hz", Real, of="phase_frequency"),
    Key("distance", float, "Smallest distance of the open loop from -1."),
    Key("distance_frequency_Hz", float, of="distance_frequency"),
)
_SWEEP = JsonForm(
    "SweepJson",
    "The slowest decaying oscillation along a sweep; null where there is none.",
    Key("name", str),
    Key("unit", str, "SI; 1 for a pure number."),
    Key("values", list[float]),
    Key("growth_1_s", list[Real], of="growth"),
    Key("frequency_Hz", list[Real], of="frequency"),
    Key("damping_ratio", list[Real], of="damping"),
    Key("unstable", list[int], "Number of growing eigenvalues; -1 where there is no point."),
    Key("failures", list[str], "Reason why there is no point; otherwise empty."),
)


class _Shared(NamedTuple):
    mode: Eigenvalue
    parts: Mapping[str, float]


LINEAR_MODEL = JsonForm(
    "LinearModelJson",
    "``klack linearise``.",
    schema_key("klack-linearise/1"),
    *CASE,
    OWN_COMPONENTS,
    Key("variant", str),
    Key("current_A", dict[str, float], "By coil.", "drive"),
    Key(
        "operating_point",
        dict[str, Real],
        "By component, quantity and unit [SI].",
        lambda record: {f"{x.component} {x.quantity} [{x.unit}]": x.value for x in record.point},
    ),
    Key(
        "stable",
        bool | None,
        "Null where something neither decays nor grows.",
        lambda record: None if record.neutral and not record.growing else not record.growing,
    ),
    Key("band_Hz", float, "Of matrices and eigenvalues with lines.", "band"),
    Key("delays_s", list[float], of="delays"),
    Key("states", [_SIGNAL]),
    Key("inputs", [_SIGNAL]),
    Key("outputs", [_SIGNAL]),
    *(Key(name, list[list[float]]) for name in "ABCD"),
    Key(
        "eigenvalues",
        [_EIGENVALUE],
        of=lambda record: [
            _Shared(mode, record.parts(k)) for k, mode in enumerate(record.eigenvalues)
        ],
    ),
    Key(
        "unconfirmed",
        int,
        "Eigenvalues of the matrices without a root of the equation with delays.",
    ),
    Key("responses", [_RESPONSE]),
    Key("loops", [_LOOP]),
    Key("sweeps", [_SWEEP]),
    Key("cpu_time_s", Real, of="cpu_time"),
    Key("wall_time_s", Real, of="wall_time"),
    Key("warnings", list[str]),
)


def stability_text(record: LinearModel) -> str:
    """Whether the point is stable, in words."""
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
    """Eigenvalues for rows: those of the memory of friction in lines come last."""
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
    """The verdict, the point, the eigenvalues, margins."""
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
            title=f"Slowest decaying oscillation over {swept.short}",
            columns=SWEEP_HEADS,
            rows=sweep_rows(swept),
            left=2,
        )
    yield stability_text(record)
    yield (
        f"{len(record.states)} states, {len(record.inputs)} inputs, {len(record.outputs)} outputs "
        f"in {format_si(record.cpu_time, 's', 3)} of processor time."
    )


LINEARISATION = StoredAnalysis(
    form=RecordFormat(
        name="klack linear model",
        version=1,
        kind=LinearModel,
        command="klack linearise CASE",
        units={"delays": "s", "frequency": "Hz"},
        tables=("eigenvalues", "point", "states", "inputs", "outputs"),
    ),
    page="linearisation.content:linear_model_content",
    json=LINEAR_MODEL.type,
    to_json=LINEAR_MODEL.json,
    told=linear_model_told,
)
