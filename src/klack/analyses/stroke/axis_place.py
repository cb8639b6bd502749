"""Where the axis of a needle is that moves in three dimensions: at the start, and at each touch."""

from dataclasses import dataclass

import numpy as np
from ruamel.yaml import YAML

from klack.analyses.stroke.record import StrokeStudy, StrokeVariant
from klack.case.guide import CaseGuide
from klack.case.motion_of_valve import ValveGuide

__all__ = ["AxisPlace", "axis_place", "guide_of", "moves_in_space"]


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
        return f"{1e6 * self.x:.3g}, {1e6 * self.y:.3g}"

    @property
    def tilt(self) -> str:
        """Both slopes in millirad."""
        return f"{1e3 * self.tilt_x:.3g}, {1e3 * self.tilt_y:.3g}"


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


def guide_of(study: StrokeStudy) -> CaseGuide | None:
    """Section ``guide`` of the case, which was checked when it was run; None without."""
    given = YAML(typ="safe").load(study.case_text).get("guide")
    return None if given is None else ValveGuide.model_validate(given)
