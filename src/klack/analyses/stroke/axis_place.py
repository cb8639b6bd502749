"""Where the axis of a needle is that moves in three dimensions: at the start, and at each touch."""

from dataclasses import dataclass

import numpy as np
from ruamel.yaml import YAML

from klack.analyses.stroke.record import StrokeStudy, StrokeVariant
from klack.case.guide import ValveGuide

__all__ = ["AxisPlace", "acts_across", "axis_place", "guide_of", "moves_in_space"]

_LEAST_PLACE, _LEAST_TILT = 1e-5, 1e-6  # [um], [mrad]; less is round-off, and shown as 0


@dataclass(frozen=True, slots=True, kw_only=True)
class AxisPlace:
    """Position of the axis at the height of the seat, and its slope.

    Parameters
    ----------
    x, y : float [m]
    tilt_x, tilt_y : float [rad]
        Of the axis along x and along y, upwards.
    """

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
    """Place of the axis at a moment, between records; None for a motion along the axis."""
    found = []
    for what in ("x", "y", "tilt x", "tilt y"):
        channel = variant.channel(f"{study.needle} {what}")
        if channel is None:
            return None
        found.append(float(np.interp(time, variant.result.time, channel.values)))
    return AxisPlace(x=found[0], y=found[1], tilt_x=found[2], tilt_y=found[3])


def acts_across(variant: StrokeVariant) -> tuple[str, ...]:
    """Magnets and seats that act across the axis in a variant."""
    end = " side force x"
    return tuple(name.removesuffix(end) for name in variant.result.channels if name.endswith(end))


def guide_of(study: StrokeStudy) -> ValveGuide | None:
    """Section ``guide`` of the case, which was checked when it was run; None without."""
    given = YAML(typ="safe").load(study.case_text).get("guide")
    return None if given is None else ValveGuide.model_validate(given)
