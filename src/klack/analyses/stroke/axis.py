"""Axis of a needle in three dimensions."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from ruamel.yaml import YAML

from klack.analyses.stroke.record import StrokeStudy, StrokeVariant
from klack.case.guide import ValveGuide
from klack.report.chart import AxisSpec, Chart, Colour, Curve, Mark, Panel
from klack.report.looks import look_of, thinned
from klack.units import format_si

__all__ = [
    "AxisPlace",
    "acts_across",
    "axis_over_time_chart",
    "axis_path_chart",
    "axis_place",
    "guide_of",
    "moves_in_space",
]


_LEAST_PLACE, _LEAST_TILT = 1e-5, 1e-6  # [um], [mrad]; less is round-off, and shown as 0


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisPlace:
    """Position [m] of the axis at the height of the seat, and its slope [rad], upwards."""

    x: float
    y: float
    tilt_x: float
    tilt_y: float

    @property
    def position(self) -> str:
        """Both coordinates in micrometres."""
        return _both(1e6 * self.x, 1e6 * self.y, _LEAST_PLACE)

    @property
    def tilt(self) -> str:
        """Both slopes in millirad."""
        return _both(1e3 * self.tilt_x, 1e3 * self.tilt_y, _LEAST_TILT)


def _both(first: float, second: float, least: float) -> str:
    shown = (0.0 if abs(value) < least else value for value in (first, second))
    return ", ".join(f"{value:.3g}" for value in shown)


def moves_in_space(study: StrokeStudy, variant: StrokeVariant) -> bool:
    """Whether a variant was computed in three dimensions."""
    return variant.channel(f"{study.needle} x") is not None


def axis_place(study: StrokeStudy, variant: StrokeVariant, time: float) -> AxisPlace | None:
    """Axis at a moment, between records; None for a motion along the axis."""
    found = []
    for what in ("x", "y", "tilt x", "tilt y"):
        channel = variant.channel(f"{study.needle} {what}")
        if channel is None:
            return None
        found.append(float(np.interp(time, variant.result.time, channel.values)))
    return AxisPlace(x=found[0], y=found[1], tilt_x=found[2], tilt_y=found[3])


def acts_across(variant: StrokeVariant) -> tuple[str, ...]:
    """Magnets and seats that act across the axis."""
    end = " side force x"
    return tuple(name.removesuffix(end) for name in variant.result.channels if name.endswith(end))


def guide_of(study: StrokeStudy) -> ValveGuide | None:
    """Section ``guide`` of the case."""
    given = YAML(typ="safe").load(study.case_text).get("guide")
    return None if given is None else ValveGuide.model_validate(given)


Floats = NDArray[np.float64]

_ROUND = 181  # points of a circle
_WIDE = 2.6  # width of a panel over its height, which makes circles round
_HIGH = 1.39  # of a panel
_MOST = 3000  # points of a path
_MARKED = 12  # impacts
_ROOM = 1.15


def axis_path_chart(study: StrokeStudy) -> Chart | None:
    """The axis from above, at the lowest and the highest height of the guide.

    None for a motion along the axis, and without a guide.
    """
    variant = study.reference
    guide = guide_of(study) if moves_in_space(study, variant) else None
    if guide is None:
        return None
    last = len(guide.heights)
    clearance = 1e6 * guide.clearance
    angle = np.linspace(0.0, 2.0 * np.pi, _ROUND)
    panels = []
    paths = [_path(variant, number) for number in (last, 1)]
    reach = _ROOM * max(clearance, *(float(np.abs(path).max()) for path in paths))
    for number, path in zip((last, 1), paths, strict=True):
        every = max(1, len(path) // _MOST)
        label = number == last
        curves = [
            Curve(
                x=clearance * np.cos(angle),
                y=clearance * np.sin(angle),
                label="clearance of the guide",
                style="dashed",
                colour="grey",
                listed=label,
            ),
            Curve(
                x=path[::every, 0],
                y=path[::every, 1],
                label="path of the axis",
                colour="sky",
                width=1.2,
                listed=label,
            ),
            _dot(path[:1], "start", "black", (), label=label, width=3.5),
        ]
        for k, stop in enumerate(dict.fromkeys(e.stop for e in variant.result.events[:_MARKED])):
            events = [event for event in variant.result.events[:_MARKED] if event.stop == stop]
            at = _at(variant, path, [event.time for event in events])
            names = tuple(f"{stop} at {format_si(event.time, 's', 4)}" for event in events)
            colour: Colour = ("red", "blue")[k % 2]
            curves.append(_dot(at, f"touch of '{stop}'", colour, names, label=label))
        height = format_si(guide.heights[number - 1], "m", 3)
        panels.append(
            Panel(
                y=AxisSpec(label=f"y at {height}", unit="µm", range=(-reach, reach)),
                curves=tuple(curves),
                share=_HIGH,
            )
        )
    wide = _WIDE * reach
    return Chart(
        name="axis-path",
        title="Path of the needle axis, from above",
        x=AxisSpec(label="x", unit="µm", range=(-wide, wide)),
        panels=tuple(panels),
        note=(
            "Axis of the undeformed needle at the highest and the lowest height of its guide. "
            "Outside the circle the bore presses on the shaft, or the shaft is bent. Dots: "
            f"position of the axis at the first {_MARKED} impacts."
        ),
    )


def axis_over_time_chart(study: StrokeStudy) -> Chart | None:
    """Position at the seat, tilt, and guide forces, in three dimensions."""
    variant = study.reference
    if not moves_in_space(study, variant):
        return None
    needle, time = study.needle, 1e3 * variant.result.time
    touches = tuple(Mark(value=1e3 * event.time) for event in variant.result.events[:_MARKED])
    panels = [
        _panel(
            variant, [(f"{needle} {a}", a) for a in "xy"], "axis at seat", "µm", 1e6, touches, 1e-3
        ),
        _panel(
            variant, [(f"{needle} tilt {a}", a) for a in "xy"], "tilt", "mrad", 1e3, touches, 1e-4
        ),
    ]
    guide = guide_of(study)
    if guide is not None:
        forces = [
            (f"guide {k + 1} force", f"guide at {format_si(z, 'm', 3)}")
            for k, z in enumerate(guide.heights)
        ]
        panels.append(_panel(variant, forces, "guide force", "N", 1.0, touches, 1e-3, first=2))
    across = acts_across(variant)
    sides = [(f"{name} side force {a}", f"{name} {a}") for name in across for a in "xy"]
    if sides:
        panels.append(_panel(variant, sides, "side force", "N", 1.0, touches, 1e-6))
    return Chart(
        name="axis-time",
        title="Needle off-axis",
        x=AxisSpec(label="time", unit="ms", range=(float(time[0]), float(time[-1]))),
        panels=tuple(panels),
        note=(
            "Position of the axis at the height of the seat, slope of the axis, forces of the "
            "guide, and of magnet and seat across the axis if the case has them, at the ends of "
            "the records. Thin upright lines: impacts. After the first few impacts the path "
            "depends on the smallest detail: a different step, or one micrometre at the start, "
            "gives a different path of the same kind."
        ),
    )


def _path(variant: StrokeVariant, number: int) -> Floats:
    """Position (n, 2) [um] of the axis at a guide height."""
    found = [variant.channel(f"guide {number} {a}") for a in "xy"]
    return 1e6 * np.column_stack([channel.values for channel in found if channel is not None])


def _at(variant: StrokeVariant, path: Floats, times: list[float]) -> Floats:
    time = variant.result.time
    return np.column_stack([np.interp(times, time, path[:, i]) for i in range(2)])


def _dot(
    at: Floats,
    name: str,
    colour: Colour,
    names: tuple[str, ...],
    *,
    label: bool,
    width: float = 2.0,
) -> Curve:
    return Curve(
        x=at[:, 0],
        y=at[:, 1],
        label=name,
        colour=colour,
        drawn="points",
        width=width,
        listed=label,
        names=names,
    )


def _panel(
    variant: StrokeVariant,
    names: list[tuple[str, str]],
    label: str,
    unit: str,
    factor: float,
    marks: tuple[Mark, ...],
    least: float,
    first: int = 0,
) -> Panel:
    """Curves over time; the axis spans at least ``least``."""
    curves = []
    for k, (channel, word) in enumerate(names):
        data = variant.channel(channel)
        if data is not None:
            x, y = thinned(1e3 * variant.result.time, factor * data.values)
            curves.append(look_of(first + k).curve(x, y, word))
    most = max((float(np.max(np.abs(curve.y), initial=0.0)) for curve in curves), default=0.0)
    span = (-least, least) if most < least else None
    return Panel(
        y=AxisSpec(label=label, unit=unit, range=span),
        curves=tuple(curves),
        marks=marks,
        share=0.6,
    )
