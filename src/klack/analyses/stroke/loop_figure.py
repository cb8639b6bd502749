"""Loops of the iron in a stroke: flux over current of every coil with hysteresis."""

from klack.analyses.stroke.record import StrokeStudy
from klack.report.chart import AxisSpec, Chart, Curve, Mark, Panel
from klack.report.looks import look_of

__all__ = ["loop_chart"]

_MOST = 2000  # points of a curve
_SHARE = 0.8


def loop_chart(study: StrokeStudy) -> Chart | None:
    """Flux over current of the reference; None without hysteresis."""
    variant = study.reference
    losses, channels = variant.result.books.losses, variant.result.channels
    coils = [name.removesuffix(" hysteresis") for name in losses if name.endswith(" hysteresis")]
    curves: list[Curve] = []
    for coil in coils:
        current, flux = channels.get(f"{coil} current"), channels.get(f"{coil} flux")
        if current is None or flux is None:
            continue
        every = max(1, len(flux.values) // _MOST)
        x, y = current.values[::every], 1e6 * flux.values[::every]
        curves.append(look_of(len(curves)).curve(x, y, coil))
        curves.append(
            Curve(
                x=x[:1],
                y=y[:1],
                label=f"start of {coil}",
                drawn="points",
                width=3.5,
                colour="black",
            )
        )
    if not curves:
        return None
    heat = "; ".join(
        f"{coil}: {1e3 * losses[f'{coil} hysteresis']:.3g} mJ lost in hysteresis" for coil in coils
    )
    zero = (Mark(value=0.0, axis="y"), Mark(value=0.0))
    return Chart(
        name="loops",
        title=f"Flux over current: {variant.label}",
        x=AxisSpec(label="current", unit="A"),
        panels=(
            Panel(
                y=AxisSpec(label="flux", unit="µWb"), curves=tuple(curves), marks=zero, share=_SHARE
            ),
        ),
        note=f"Reference variant '{variant.name}'; {heat}. The flux is that of the working gap, so "
        "the loop also holds eddy currents and the motion of the armature.",
    )
