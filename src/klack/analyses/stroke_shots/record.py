"""Record of ``klack shots`` of a whole valve."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.measures import Measure, described_in
from klack.analyses.record import CaseRecord
from klack.analyses.run_columns import Columns, with_columns

__all__ = [
    "AT_TOUCH",
    "COMPARED",
    "FIRST_TOUCH_MEASURES",
    "HIGHEST_MEASURES",
    "RESULTS",
    "STARTED",
    "STROKE_MEASURES",
    "HighestRebound",
    "Row",
    "StopColumns",
    "StrokeColumns",
    "StrokeShotsStudy",
    "VariantShots",
    "highest_rebound",
]


Column = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class HighestRebound:
    """Highest rebound from one stop, against the most centred stroke and the centred one.

    Parameters
    ----------
    rebound_height, eccentricity [m]
        The eccentricity is that at first touch.
    place
        In the order of that eccentricity; 1 is the most centred.
    most_centred
        Its number.
    most_centred_height, most_centred_eccentricity [m]
    centred_height [m]
        Of the stroke that starts centred.
    relative_height_bias [-]
        Highest rebound over that, minus 1.
    restitution_bias [-]
        Restitution minus that of the stroke that starts centred.
    """

    stroke: int
    rebound_height: float
    eccentricity: float
    place: int
    count: int
    most_centred: int
    most_centred_height: float
    most_centred_eccentricity: float
    centred_height: float
    relative_height_bias: float
    restitution_bias: float

    @property
    def is_most_centred(self) -> bool:
        """Whether the highest rebound is that of the most centred stroke."""
        return self.stroke == self.most_centred


Row = Mapping[str, float]
"""Numbers of one stroke by the name of their column."""

_THEORY = "theory/stroke-in-three-dimensions"

STARTED: tuple[Measure[Row], ...] = described_in(
    _THEORY,
    Measure(
        key="eccentricity",
        symbol="e_0",
        unit="m",
        definition="Distance between the axes of needle and valve at the height of the seat, at "
        "the start.",
    ),
    Measure(
        key="direction",
        symbol="phi_e",
        unit="rad",
        definition="Direction of the eccentricity, from x to y.",
    ),
    Measure(
        key="tilt", symbol="theta", unit="rad", definition="Angle between both axes at the start."
    ),
    Measure(
        key="tilt_direction",
        symbol="phi_t",
        unit="rad",
        definition="Direction in which the upper end is tilted, from x to y.",
    ),
    Measure(
        key="friction",
        name="friction in the guide",
        symbol="mu",
        definition="Coefficient of Coulomb friction in the guide.",
        form="fixed",
        digits=3,
    ),
    Measure(
        key="contact_friction",
        name="friction between the faces",
        symbol="mu_c",
        definition="Coefficient of Coulomb friction between the faces of all stops, where it is "
        "drawn.",
        form="fixed",
        digits=3,
    ),
)
"""What differs from stroke to stroke."""

RESULTS: tuple[Measure[Row], ...] = described_in(
    _THEORY,
    Measure(
        key="opening_time",
        symbol="t_o",
        unit="s",
        definition="From time zero to the first touch of the opening stop in the first whole "
        "stroke, otherwise in the longest; none if it is not touched.",
        digits=5,
    ),
    Measure(
        key="closing_time",
        symbol="t_c",
        unit="s",
        definition="From time zero to the first touch of the seat after the largest lift of "
        "that stroke; none if the needle stays closed or the run ends earlier.",
        digits=5,
    ),
    Measure(
        key="impact_loss",
        name="lost in impacts",
        symbol="W",
        unit="J",
        definition="Kinetic energy of the centre of mass lost in all impacts to rotation, "
        "lateral motion and vibration.",
    ),
    Measure(
        key="guide_loss",
        name="lost in the guide",
        symbol="W_g",
        unit="J",
        definition="Energy dissipated by friction in the guide in the whole stroke.",
    ),
    Measure(
        key="faces_loss",
        name="lost between the faces",
        symbol="W_f",
        unit="J",
        definition="Energy dissipated by friction between the faces of all stops in the whole "
        "stroke; missing without friction there.",
    ),
    Measure(
        key="injected_energy",
        name="structure-borne energy",
        symbol="W_in",
        unit="J",
        definition="Work of the stops on the modes of the held bodies, along the axis; negative "
        "if a pressed face is released, which returns its elastic energy, and no impact follows.",
    ),
    Measure(
        key="delivered_mass",
        symbol="m",
        unit="kg",
        definition="Mass that leaves the valve in one stroke through all restrictions that lead to "
        "the surroundings or to a given pressure; missing without one, as in a dry stroke.",
    ),
    Measure(
        key="radiated_energy",
        name="sound energy radiated (estimate)",
        symbol="W_rad",
        unit="J",
        definition="Sound energy that the surfaces radiate during one stroke; missing in a case "
        "without a section noise.",
    ),
)
"""Of a whole stroke, with a distribution."""

STROKE_MEASURES: tuple[Measure[Row], ...] = described_in(
    _THEORY,
    *STARTED,
    *RESULTS,
    Measure(key="impacts", symbol="n", definition="Impacts on all stops.", kind="whole"),
    Measure(
        key="energy_residual",
        symbol="r_E",
        definition="Residual of the energy balance over the throughput (or what bodies and stores "
        "hold): round-off in a correct run.",
        form="power",
    ),
)
"""All columns of a stroke."""

AT_TOUCH: tuple[Measure[Row], ...] = described_in(
    _THEORY,
    Measure(
        key="eccentricity",
        name="eccentricity at touch",
        symbol="e_1",
        unit="m",
        definition="Distance between the axes of needle and valve at the height of the stop, at "
        "first touch.",
        digits=3,
    ),
    Measure(
        key="direction",
        name="direction at touch",
        symbol="phi_1",
        unit="rad",
        definition="Direction of that eccentricity, from x to y.",
        digits=3,
    ),
    Measure(
        key="tilt",
        name="tilt at touch",
        symbol="theta_1",
        unit="rad",
        definition="Angle between both axes at first touch.",
        digits=3,
    ),
    Measure(
        key="tilt_direction",
        name="direction of tilt at touch",
        symbol="phi_t1",
        unit="rad",
        definition="Direction in which the upper end is tilted at that time, from x to y.",
        digits=3,
    ),
)

COMPARED: tuple[Measure[Row], ...] = described_in(
    _THEORY,
    Measure(
        key="approach_speed",
        symbol="v_0",
        unit="m/s",
        definition="Speed of the centre of mass along the axis before the impact.",
    ),
    Measure(
        key="peak_force",
        symbol="F_max",
        unit="N",
        definition="Largest contact force along the axis.",
    ),
    Measure(
        key="contact_time",
        symbol="t_c",
        unit="s",
        definition="Time closed, all contacts of the impact together.",
    ),
    Measure(
        key="impulse",
        symbol="J",
        unit="N s",
        definition="Integral of the contact force along the axis.",
    ),
    Measure(
        key="restitution",
        symbol="e",
        definition="Opening speed over approach speed of the centre of mass; 0 where it comes to "
        "rest.",
        form="fixed",
    ),
    Measure(
        key="rebound_height",
        symbol="h",
        unit="m",
        definition="Largest distance of the centre of mass from its position at first touch, "
        "after the impact and before another stop is touched; 0 if it comes to rest, missing if "
        "the stroke ends before it turns back.",
    ),
    Measure(
        key="energy_loss",
        symbol="W_1",
        unit="J",
        definition="Kinetic energy of the centre of mass lost in the impact.",
    ),
)
"""Of the first impact on a stop, with a distribution."""

FIRST_TOUCH_MEASURES: tuple[Measure[Row], ...] = described_in(
    _THEORY,
    *AT_TOUCH,
    *COMPARED,
    Measure(
        key="impacts",
        name="impacts on the stop",
        symbol="n",
        definition="Impacts on this stop in the whole stroke, including the first.",
        kind="whole",
    ),
)

HIGHEST_MEASURES: tuple[Measure[HighestRebound], ...] = described_in(
    _THEORY,
    Measure(
        key="stroke",
        symbol="k_h",
        definition="Number of the stroke with the highest rebound, from 0.",
        kind="whole",
    ),
    Measure(
        key="rebound_height",
        symbol="h_h",
        unit="m",
        definition="Its rebound height.",
    ),
    Measure(
        key="eccentricity",
        symbol="e_h",
        unit="m",
        definition="Its eccentricity at first touch of the stop.",
    ),
    Measure(
        key="place",
        symbol="n_h",
        definition="Its rank among the strokes in the order of that eccentricity; 1 is the most "
        "centred one.",
        kind="whole",
    ),
    Measure(
        key="most_centred",
        symbol="k_c",
        definition="Number of the most centred stroke at first touch.",
        kind="whole",
    ),
    Measure(
        key="relative_height_bias",
        symbol="h_h/h_0 - 1",
        definition="Highest rebound over that of the stroke that starts centred, minus 1.",
        form="signed share",
    ),
    Measure(
        key="restitution_bias",
        symbol="e_h - e_0",
        definition="Restitution of the stroke with the highest rebound minus that of the stroke "
        "that starts centred.",
        form="signed",
    ),
)


_STORED = (*STARTED, *RESULTS[:2], *STROKE_MEASURES[-2:-1], *RESULTS[2:], *STROKE_MEASURES[-1:])


@with_columns(_STORED, later=("contact_friction", "delivered_mass", "faces_loss"))
class StrokeColumns(Columns):
    """Strokes in rows: start and results; early versions lack some columns."""


@with_columns(FIRST_TOUCH_MEASURES)
class StopColumns(Columns):
    """First impact of each stroke on one stop, in rows."""


@dataclass(frozen=True, kw_only=True, eq=False)
class VariantShots:
    """All strokes of one variant.

    Parameters
    ----------
    name, label
        ``"wet"`` or ``"dry"``; for a legend.
    stops
        By end stop, the seat first.
    centric, centric_stops
        One row: started centred and upright, without Coulomb friction in the guide.
    time (k,) [s]
    lift (n, k), centric_lift (k,) [m]
        Nan after the end of a stroke that failed.
    failures
        Why a stroke ended early, by number; its row holds what was known.
    """

    name: str
    label: str
    strokes: StrokeColumns
    stops: Mapping[str, StopColumns]
    centric: StrokeColumns
    centric_stops: Mapping[str, StopColumns]
    time: Column
    lift: NDArray[np.float32]
    centric_lift: NDArray[np.float32]
    failures: Mapping[str, str]


@dataclass(frozen=True, kw_only=True, eq=False)
class StrokeShotsStudy(CaseRecord):
    """Many strokes of one valve in some variants, with the same draws.

    Parameters
    ----------
    carry
        Whether strokes start where the one before ended.
    resumed
        Strokes of an interrupted run.
    stroke_time [s]
        Wall time of all.
    duration [s]
        Of each stroke.
    needle, seat, opening_stop
        Components, or empty.
    guide, distributions
        In words.
    largest_eccentricity [m]
        By stop: what the guide allows to a rigid needle.
    schematic
        Picture of the network (SVG); empty in older results.
    """

    seed: int
    workers: int
    carry: bool
    resumed: int
    stroke_time: float
    duration: float
    needle: str
    seat: str
    opening_stop: str
    guide: str
    distributions: Mapping[str, str]
    largest_eccentricity: Mapping[str, float]
    mass: float
    points: Mapping[str, int]
    variants: Mapping[str, VariantShots]
    schematic: str = ""

    @property
    def count(self) -> int:
        """Number of strokes of each variant."""
        return next(iter(self.variants.values())).strokes.count


def highest_rebound(shots: VariantShots, stop: str) -> HighestRebound | None:
    """Highest rebound of all strokes of a variant."""
    columns, alone = shots.stops[stop], shots.centric_stops[stop]
    height, off = columns.rebound_height, columns.eccentricity
    known = np.flatnonzero(np.isfinite(height) & np.isfinite(off))
    if not known.size or not np.any(height[known] > 0.0):
        return None
    best = int(known[np.argmax(height[known])])
    centred = int(known[np.argmin(off[known])])
    middle = float(alone.rebound_height[0])
    return HighestRebound(
        stroke=best,
        rebound_height=float(height[best]),
        eccentricity=float(off[best]),
        place=1 + int(np.sum(off[known] < off[best])),
        count=int(known.size),
        most_centred=centred,
        most_centred_height=float(height[centred]),
        most_centred_eccentricity=float(off[centred]),
        centred_height=middle,
        relative_height_bias=float(height[best]) / middle - 1.0 if middle > 0.0 else float("nan"),
        restitution_bias=float(columns.restitution[best] - alone.restitution[0]),
    )
