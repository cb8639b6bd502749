"""Charts of a linearisation: frequency responses, loops, eigenvalues."""

import re

import numpy as np
from numpy.typing import NDArray

from klack.analyses.linearisation.record import LinearModel, LoopMargins, Response, StabilitySweep
from klack.report.chart import AxisSpec, Chart, Curve, Mark, Panel
from klack.report.wording import printed_unit

__all__ = ["linear_charts"]

Vector = NDArray[np.float64]


def linear_charts(record: LinearModel) -> tuple[Chart, ...]:
    """A chart for each response and loop, and one of the eigenvalues."""
    return (
        *(_response_chart(x) for x in record.responses),
        *(_loop_chart(x) for x in record.loops),
        *(_sweep_chart(x) for x in record.sweeps),
        *_eigenvalue_charts(record),
    )


def _word(text: str) -> str:
    return re.sub(r"[^A-Za-z0-9]+", "-", text).strip("-").lower()


def _axis(frequency: Vector) -> AxisSpec:
    return AxisSpec(
        label="frequency",
        unit="Hz",
        log=True,
        range=(float(frequency[0]), float(frequency[-1])),
    )


def _phase(values: NDArray[np.complex128]) -> Vector:
    """Phase [degrees] without jumps, the first one within half a turn of zero."""
    turned = np.degrees(np.unwrap(np.angle(values)))
    return np.asarray(turned - 360.0 * np.round(turned[0] / 360.0))


def _response_chart(response: Response) -> Chart:
    values = response.real + 1j * response.imaginary
    size = np.abs(values)
    size = np.where(size > 0.0, size, np.nan)
    name = f"{response.target.name} over {response.source.name}"
    return Chart(
        name=_word(f"response {name}"),
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
        note="Of small motions about the operating point; delays of lines are exact.",
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
        name=_word(f"loop {loop.name}"),
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
        name=_word(f"stability over {swept.short}"),
        title=f"Oscillation that decays the slowest, over {swept.short}",
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
        note="Below zero the valve oscillates. Every dot is a point of its own.",
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
