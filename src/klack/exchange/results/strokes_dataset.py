"""Many strokes of one variant as named arrays over the strokes and over time."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from klack.analyses.measures import Measure
from klack.analyses.stroke_shots.record import FIRST_TOUCH_MEASURES, STROKE_MEASURES, VariantShots
from klack.exchange.results.variables import Variable, about_measure

__all__ = ["strokes_variables"]


def strokes_variables(shots: VariantShots) -> tuple[dict[str, Variable], dict[str, Variable]]:
    """Variables and coordinates of all strokes of a variant and of the centred one.

    Numbers of a stroke are of shape (n + 1,) over ``stroke``, those of the first impact on a stop
    behind its name, ``seat_peak_force``; the lift is of shape (n + 1, k) over ``stroke`` and
    ``time``.  Strokes are counted from 0; the last row, stroke -1, is the centred one.
    """
    variables = {
        measure.key: _column(measure, shots.strokes, shots.centric) for measure in STROKE_MEASURES
    }
    for stop, columns in shots.stops.items():
        variables |= {
            f"{stop}_{measure.key}": _column(measure, columns, shots.centric_stops[stop])
            for measure in FIRST_TOUCH_MEASURES
        }
    variables["lift"] = Variable(
        ("stroke", "time"),
        np.vstack([shots.lift, shots.centric_lift]),
        {"units": "m", "long_name": "displacement of the point of the lift"},
    )
    coordinates = {
        "stroke": Variable(
            ("stroke",),
            np.append(np.arange(shots.strokes.count), -1),
            {"long_name": "number of the stroke; -1 is the one that starts centred"},
        ),
        "time": Variable(("time",), shots.time, {"units": "s", "long_name": "time"}),
    }
    return variables, coordinates


def _column(measure: Measure[Mapping[str, float]], every: Any, alone: Any) -> Variable:
    values = np.append(getattr(every, measure.key), getattr(alone, measure.key))
    return Variable(("stroke",), values, about_measure(measure))
