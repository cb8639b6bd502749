"""Measures of many strokes: start and whole of each, and its first impact on a stop."""

from collections.abc import Mapping

from klack.analyses.measures import Measure, described_in
from klack.analyses.stroke_shots.highest import HighestRebound

__all__ = [
    "AT_TOUCH",
    "COMPARED",
    "FIRST_TOUCH_MEASURES",
    "HIGHEST_MEASURES",
    "RESULTS",
    "STARTED",
    "STROKE_MEASURES",
    "Row",
]

Row = Mapping[str, float]
"""Numbers of one stroke by the name of their column."""

_THEORY = "theory/stroke-in-three-dimensions"

STARTED: tuple[Measure[Row], ...] = described_in(
    _THEORY,
    Measure(
        key="eccentricity",
        symbol="e_0",
        unit="m",
        definition="Distance of the axis of the needle from that of the valve at the height of the "
        "seat, at the start.",
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
        definition="Coulomb's coefficient in the guide.",
        form="fixed",
        digits=3,
    ),
    Measure(
        key="contact_friction",
        name="friction between the faces",
        symbol="mu_c",
        definition="Coulomb's coefficient between the faces of all stops, where it is drawn.",
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
        "stroke, else in the longest; none where it is not touched.",
        digits=5,
    ),
    Measure(
        key="closing_time",
        symbol="t_c",
        unit="s",
        definition="From time zero to the first touch of the seat after the largest lift of that "
        "stroke; none where the needle stays closed or the run ends before.",
        digits=5,
    ),
    Measure(
        key="impact_loss",
        name="lost in impacts",
        symbol="W",
        unit="J",
        definition="Kinetic energy of the centre of mass that all impacts take: into rotation, "
        "lateral motion and vibration.",
    ),
    Measure(
        key="guide_loss",
        name="lost in the guide",
        symbol="W_g",
        unit="J",
        definition="Energy that friction in the guide takes in the whole stroke.",
    ),
    Measure(
        key="faces_loss",
        name="lost between the faces",
        symbol="W_f",
        unit="J",
        definition="Energy that friction between the faces of all stops takes in the whole stroke; "
        "missing without friction there.",
    ),
    Measure(
        key="injected_energy",
        name="structure-borne energy",
        symbol="W_in",
        unit="J",
        definition="Work of the stops on the modes of the held bodies, along the axis.",
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
"""Of the whole of a stroke, with a distribution of their own."""

STROKE_MEASURES: tuple[Measure[Row], ...] = described_in(
    _THEORY,
    *STARTED,
    *RESULTS,
    Measure(key="impacts", symbol="n", definition="Impacts on all stops.", kind="whole"),
    Measure(
        key="energy_residual",
        symbol="r_E",
        definition="Residual of the energy balance over the throughput: round-off in a correct "
        "run.",
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
        definition="Distance of the axis of the needle from that of the valve at the height of the "
        "stop, at first touch.",
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
        definition="Direction in which the upper end is tilted then, from x to y.",
        digits=3,
    ),
)
"""Position of the needle when it touches a stop."""

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
        definition="Farthest turn of the centre of mass from the stop after the impact and before "
        "another stop is touched, from its place at first touch; 0 where it comes to rest, missing "
        "where the stroke ends before a turn.",
    ),
    Measure(
        key="energy_loss",
        symbol="W_1",
        unit="J",
        definition="Kinetic energy of the centre of mass that the impact takes.",
    ),
)
"""Of the first impact on a stop, with a distribution of their own."""

FIRST_TOUCH_MEASURES: tuple[Measure[Row], ...] = described_in(
    _THEORY,
    *AT_TOUCH,
    *COMPARED,
    Measure(
        key="impacts",
        name="impacts on the stop",
        symbol="n",
        definition="Impacts on this stop in the whole stroke, the first one among them.",
        kind="whole",
    ),
)
"""All columns of the first impact on a stop."""

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
        definition="Its place among the strokes in the order of that eccentricity; 1 is the most "
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
"""Of the stroke with the highest rebound from a stop."""
