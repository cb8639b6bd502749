"""Files, charts and report of a linearisation."""

from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.analyses.linearisation.analysis import (
    EIGENVALUE_HEADS,
    LOOP_HEADS,
    SWEEP_HEADS,
    eigenvalue_rows,
    loop_rows,
    stability_text,
    sweep_rows,
)
from klack.analyses.linearisation.record import LinearModel, LoopMargins, Response, StabilitySweep
from klack.analyses.page import page_of, write_table
from klack.analyses.study.wording import shown_unit
from klack.report.chart import AxisSpec, Chart, Curve, Mark, Panel
from klack.report.page import Content, Section, Table
from klack.report.wording import file_word, printed_unit, quantity

__all__ = ["linear_charts", "linear_model_content", "write_files"]


def write_files(record: LinearModel, folder: Path) -> tuple[str, ...]:
    """Write all files; return their names."""
    content = _content(record)
    np.savez_compressed(folder / "linear-model.npz", **content)
    cells = {
        key: np.array(value, dtype=object) if key in _WORDS else value
        for key, value in content.items()
    }
    scipy.io.savemat(
        folder / "linear-model.mat",
        {"klack": cells},
        long_field_names=True,
        oned_as="column",
        do_compression=True,
    )
    names = ["linear-model.npz", "linear-model.mat"]
    states, inputs, outputs = (
        [x.name for x in signals] for signals in (record.states, record.inputs, record.outputs)
    )
    for key, matrix, down, across in (
        ("A", record.A, states, states),
        ("B", record.B, states, inputs),
        ("C", record.C, outputs, states),
        ("D", record.D, outputs, inputs),
    ):
        names.append(f"{key}.csv")
        rows = ([name, *map(repr, row)] for name, row in zip(down, matrix.tolist(), strict=True))
        write_table(folder / names[-1], (("", *across), *rows))
    names.append("eigenvalues.csv")
    write_table(
        folder / names[-1],
        (
            [
                "verdict", "real [1/s]", "imaginary [1/s]", "uncertainty [1/s]", "frequency [Hz]",
                "damping ratio", "time constant [s]", *record.owners,
            ],
            *(
                [
                    mode.verdict,
                    *map(
                        repr,
                        (mode.real, mode.imaginary, mode.uncertainty, mode.frequency,
                         mode.damping, mode.time_constant),
                    ),
                    *map(repr, record.shares[k].tolist()),
                ]
                for k, mode in enumerate(record.eigenvalues)
            ),
        ),
    )  # fmt: skip
    if record.responses or record.loops:
        names.append("frequency-response.csv")
        _write_responses(record, folder / names[-1])
    for swept in record.sweeps:
        names.append("stability.csv")
        columns = (swept.values, swept.unstable, swept.growth, swept.frequency, swept.damping)
        write_table(
            folder / names[-1],
            (
                [
                    f"{swept.name} [{swept.unit}]", "unstable eigenvalues", "growth [1/s]",
                    "frequency [Hz]", "damping ratio", "failure",
                ],
                *(
                    [*(repr(c[i].item()) for c in columns), " ".join(swept.failures[i].split())]
                    for i in range(len(swept.values))
                ),
            ),
        )  # fmt: skip
    return tuple(names)


_WORDS = ("states", "state_units", "inputs", "input_units", "outputs", "output_units")


def _content(record: LinearModel) -> dict[str, Any]:
    signals = {"state": record.states, "input": record.inputs, "output": record.outputs}
    return {
        "A": record.A,
        "B": record.B,
        "C": record.C,
        "D": record.D,
        "E": np.eye(len(record.states)),
        "eigenvalues": np.array([complex(x.real, x.imaginary) for x in record.eigenvalues]),
        "delays": record.delays,
        "band": np.array(record.band),
        **{f"{kind}s": np.array([x.name for x in found]) for kind, found in signals.items()},
        **{f"{kind}_units": np.array([x.unit for x in found]) for kind, found in signals.items()},
    }


def _write_responses(record: LinearModel, file: Path) -> None:
    columns: list[tuple[str, Any]] = []
    axis = (record.responses or record.loops)[0].frequency
    curves: list[tuple[str, str, Response | LoopMargins]] = [
        *((f"{x.target.name} over {x.source.name}", x.unit, x) for x in record.responses),
        *((f"open loop at {x.name}", "1", x) for x in record.loops),
    ]
    for name, unit, curve in curves:
        values = curve.real + 1j * curve.imaginary
        columns.append((f"{name} magnitude [{unit}]", np.abs(values)))
        columns.append((f"{name} phase [degrees]", np.degrees(np.unwrap(np.angle(values)))))
    rows = ([repr(float(f)), *(repr(float(c[k])) for _, c in columns)] for k, f in enumerate(axis))
    write_table(file, (["frequency [Hz]", *(name for name, _ in columns)], *rows))


Vector = NDArray[np.float64]


def linear_charts(record: LinearModel) -> tuple[Chart, ...]:
    """Charts of responses, loops and eigenvalues."""
    return (
        *(_response_chart(x) for x in record.responses if not _is_silent(x)),
        *(_loop_chart(x) for x in record.loops),
        *(_sweep_chart(x) for x in record.sweeps),
        *_eigenvalue_charts(record),
    )


def _axis(frequency: Vector) -> AxisSpec:
    return AxisSpec(
        label="frequency",
        unit="Hz",
        log=True,
        range=(float(frequency[0]), float(frequency[-1])),
    )


def _phase(values: NDArray[np.complex128]) -> Vector:
    """Phase [degrees] without jumps, starting within 180."""
    turned = np.degrees(np.unwrap(np.angle(values)))
    return np.asarray(turned - 360.0 * np.round(turned[0] / 360.0))


def _is_silent(response: Response) -> bool:
    """Whether the output does not move at any frequency."""
    return not (np.any(response.real) or np.any(response.imaginary))


def _response_chart(response: Response) -> Chart:
    values = response.real + 1j * response.imaginary
    size = np.abs(values)
    size = np.where(size > 0.0, size, np.nan)
    name = f"{response.target.name} over {response.source.name}"
    return Chart(
        name=file_word(f"response {name}"),
        title=f"Response of {response.target.name} to {response.source.name}",
        x=_axis(response.frequency),
        panels=(
            Panel(
                y=AxisSpec(label="magnitude", unit=response.unit, log=True),
                curves=(Curve(x=response.frequency, y=size, label="magnitude", colour="blue"),),
                share=1.3,
            ),
            Panel(
                y=AxisSpec(label="phase", unit="degrees"),
                curves=(
                    Curve(
                        x=response.frequency,
                        y=_phase(values),
                        label="phase",
                        colour="orange",
                        style="dashed",
                    ),
                ),
            ),
        ),
        note="Response to small motions about the operating point; delays of lines are exact.",
    )


def _loop_chart(loop: LoopMargins) -> Chart:
    values = loop.real + 1j * loop.imaginary
    size = np.where(np.abs(values) > 0.0, np.abs(values), np.nan)
    gain_marks = [Mark(value=1.0, axis="y")]
    phase_marks = [Mark(value=-180.0, axis="y")]
    if np.isfinite(loop.gain_frequency):
        gain_marks.append(Mark(value=loop.gain_frequency, label=f"gain {loop.gain_margin:.3g}"))
    if np.isfinite(loop.phase_frequency):
        phase_marks.append(
            Mark(value=loop.phase_frequency, label=f"phase {loop.phase_margin:.3g}°")
        )
    return Chart(
        name=file_word(f"loop {loop.name}"),
        title=f"Open loop at {loop.name}",
        x=_axis(loop.frequency),
        panels=(
            Panel(
                y=AxisSpec(label="magnitude", log=True),
                curves=(Curve(x=loop.frequency, y=size, label="magnitude", colour="blue"),),
                marks=tuple(gain_marks),
                share=1.3,
            ),
            Panel(
                y=AxisSpec(label="phase", unit="degrees"),
                curves=(
                    Curve(
                        x=loop.frequency,
                        y=_phase(values),
                        label="phase",
                        colour="orange",
                        style="dashed",
                    ),
                ),
                marks=tuple(phase_marks),
            ),
        ),
        note="The loop closes with -1: at its limit of stability the magnitude is one at -180 "
        "degrees.",
    )


def _sweep_chart(swept: StabilitySweep) -> Chart:
    if swept.unit in ("1", "-"):
        spec, factor = AxisSpec(label=swept.short), 1.0
    else:
        unit, factor = printed_unit(swept.values, swept.unit)
        spec = AxisSpec(label=swept.short, unit=unit)
    x = factor * swept.values
    return Chart(
        name=file_word(f"stability over {swept.short}"),
        title=f"Slowest decaying oscillation over {swept.short}",
        x=spec,
        panels=(
            Panel(
                y=AxisSpec(label="damping ratio", unit="%"),
                curves=(
                    Curve(x=x, y=100.0 * swept.damping, colour="blue"),
                    Curve(x=x, y=100.0 * swept.damping, colour="blue", drawn="points", width=3.0),
                ),
                marks=(Mark(value=0.0, axis="y"),),
                share=1.3,
            ),
            Panel(
                y=AxisSpec(label="frequency", unit="Hz"),
                curves=(Curve(x=x, y=swept.frequency, colour="orange", drawn="points", width=3.0),),
            ),
        ),
        note="Below zero the valve oscillates. Every dot is computed separately.",
    )


def _eigenvalue_charts(record: LinearModel) -> tuple[Chart, ...]:
    """Damping ratio over frequency of all that oscillates."""
    tones = [mode for mode in record.eigenvalues if mode.imaginary > 0.0]
    if not tones:
        return ()
    frequency = np.array([mode.frequency for mode in tones])
    damping = np.array([100.0 * mode.damping for mode in tones])
    low, high = float(np.min(frequency)), float(np.max(frequency))
    names = tuple(", ".join(record.parts(record.eigenvalues.index(mode))) for mode in tones)
    stands = damping >= 0.0
    curves = []
    for chosen, label, colour in ((stands, "decays", "blue"), (~stands, "grows", "red")):
        if np.any(chosen):
            curves.append(
                Curve(
                    x=frequency[chosen],
                    y=damping[chosen],
                    label=label,
                    colour=colour,  # type: ignore[arg-type]
                    drawn="points",
                    width=4.0,
                    names=tuple(n for n, c in zip(names, chosen, strict=True) if c),
                )
            )
    return (
        Chart(
            name="eigenvalues",
            title="Damping ratio over frequency of every oscillation",
            x=AxisSpec(label="frequency", unit="Hz", log=True, range=(0.5 * low, 2.0 * high)),
            panels=(
                Panel(
                    y=AxisSpec(label="damping ratio", unit="%"),
                    curves=tuple(curves),
                    marks=(Mark(value=0.0, axis="y"),),
                    share=1.3,
                ),
            ),
            note="Below zero an oscillation grows.",
        ),
    )


_LISTED = 100


def linear_model_content(record: LinearModel) -> Content:
    """Texts, tables and curves."""
    return page_of(
        record,
        "Linear model",
        subtitle=(f"variant {record.variant}",),
        answer=stability_text(record),
        numbers=Table(columns=EIGENVALUE_HEADS, rows=tuple(eigenvalue_rows(record, 12))),
        sections=(
            Section(
                title="Frequency response, loops and eigenvalues",
                paragraphs=tuple(
                    f"{x.target.name} does not respond to {x.source.name} at this operating point: "
                    "its magnitude is zero at all frequencies."
                    for x in record.responses
                    if _is_silent(x)
                ),
                charts=linear_charts(record),
            ),
            Section(title="Stability margins", tables=_margins(record)),
            Section(
                title="Stability over a quantity",
                tables=tuple(
                    Table(columns=(x.short, *SWEEP_HEADS[1:]), rows=tuple(sweep_rows(x)))
                    for x in record.sweeps
                ),
            ),
            Section(title="Operating point", tables=(_point(record),)),
            Section(
                title="Eigenvalues",
                tables=(
                    Table(
                        columns=EIGENVALUE_HEADS,
                        rows=tuple(eigenvalue_rows(record, _LISTED)),
                    ),
                ),
            ),
            Section(title="States, inputs and outputs", tables=_signals(record)),
        ),
        definitions=(
            (
                "damping ratio",
                "Share of critical damping; below zero the oscillation grows.",
            ),
            ("time constant", "Time to 1/e, or to e where it grows."),
            (
                "components",
                "Participation factors: the share of each component in the eigenvalue, products "
                "of its left and right eigenvector.",
            ),
            (
                "margins",
                "Margins of the loop to the limit of stability: a factor, a phase lag, and the "
                "distance from -1.",
            ),
        ),
        limits=(
            (
                "small motions",
                "Linear: contacts stay closed or open, nothing switches, and amplitudes are small.",
            ),
            ("friction", "Dry friction is left out; parts that it holds at rest are more stable."),
            (
                "lines",
                "Eigenvalues and matrices of valves with lines hold up to the band; the frequency "
                "response takes their delays exactly.",
            ),
        ),
    )


def _point(record: LinearModel) -> Table:
    rows = []
    for x in record.point:
        unit, factor = shown_unit(x.unit)
        rows.append((x.component, x.quantity, quantity(factor * x.value, unit)))
    return Table(columns=("component", "quantity", "value"), rows=tuple(rows))


def _margins(record: LinearModel) -> tuple[Table, ...]:
    if not record.loops:
        return ()
    return (Table(columns=LOOP_HEADS, rows=tuple(loop_rows(record))),)


def _signals(record: LinearModel) -> tuple[Table, ...]:
    return tuple(
        Table(
            columns=(kind, "unit"), rows=tuple((x.name, x.unit or "1") for x in signals[:_LISTED])
        )
        for kind, signals in (
            ("state", record.states),
            ("input", record.inputs),
            ("output", record.outputs),
        )
        if signals
    )
