"""Measures of one shot: what was drawn, and what came out."""

from collections.abc import Mapping

from klack.analyses.measures import Measure, described_in

__all__ = ["DRAWN", "FIRST_IMPACT", "ROCKING", "SHOT_MEASURES", "Shot"]

Shot = Mapping[str, float]
"""Numbers of one shot by the name of their column; see :class:`ShotColumns`."""

_THEORY = "theory/interface"

DRAWN: tuple[Measure[Shot], ...] = described_in(
    _THEORY,
    Measure(
        key="eccentricity",
        symbol="e_0",
        unit="m",
        definition="Distance of the axis of the moving body from that of the seat at the height of"
        " first touch, at the start of the drop.",
    ),
    Measure(
        key="direction",
        symbol="phi_e",
        unit="rad",
        definition="To which side the axis is off, counted from x to y.",
    ),
    Measure(
        key="tilt",
        symbol="theta",
        unit="rad",
        definition="Angle between both axes at the start of the drop.",
    ),
    Measure(
        key="tilt_direction",
        symbol="phi_t",
        unit="rad",
        definition="Where the upper end leans to, counted from x to y.",
    ),
    Measure(
        key="force",
        name="closing force",
        symbol="F_0",
        unit="N",
        definition="Force that closes the valve at first touch.",
    ),
    Measure(
        key="friction",
        name="friction in the guide",
        symbol="mu",
        definition="Coulomb's coefficient in the guide.",
        form="fixed",
    ),
    Measure(
        key="waviness",
        name="out-of-roundness, rms",
        symbol="w",
        unit="m",
        definition="Root mean square deviation of the ring from a circle.",
    ),
)
"""What differs from shot to shot."""

FIRST_IMPACT: tuple[Measure[Shot], ...] = described_in(
    _THEORY,
    Measure(
        key="restitution",
        symbol="e",
        definition="Velocity of the centre of mass along the axis after the first impact over that"
        " before it.",
        form="fixed",
        note="It is a result, never an input. A closing force goes on working while the "
        "bodies touch: a strong one lifts the restitution of an eccentric impact, even "
        "above one.",
    ),
    Measure(
        key="rebound_height",
        symbol="h",
        unit="m",
        definition="Highest position of the centre of mass between the first impact and the "
        "second, above that at first touch.",
    ),
    Measure(
        key="peak_force",
        symbol="F_max",
        unit="N",
        definition="Largest contact force of any time step of the first impact.",
    ),
    Measure(
        key="contact_time",
        symbol="t_c",
        unit="s",
        definition="From first touch to the end of the first uninterrupted contact.",
    ),
    Measure(
        key="impulse",
        symbol="J",
        unit="N s",
        definition="Integral of the contact force over the first impact, with all its contacts.",
    ),
)
"""What is measured of the first impact; the first two tell how high it comes back."""

ROCKING = Measure[Shot](
    key="rocking",
    name="motion across the axis after it",
    symbol="E_r/E_0",
    definition="Kinetic energy of rotation and sideways motion right after the first impact, "
    "over the energy of approach.",
    form="share",
    digits=2,
    note="What an eccentric or tilted impact takes from the rebound.",
)

SHOT_MEASURES: tuple[Measure[Shot], ...] = described_in(
    _THEORY,
    *DRAWN,
    Measure(
        key="approach_speed",
        symbol="v_0",
        unit="m/s",
        definition="Speed of the centre of mass along the axis before the first impact.",
    ),
    *FIRST_IMPACT,
    Measure(
        key="sub_contacts",
        symbol="n_c",
        definition="Contacts of which the first impact consists.",
        kind="whole",
    ),
    ROCKING,
    Measure(
        key="second_impact",
        symbol="t_2",
        unit="s",
        definition="Time from the first touch to that of the second impact.",
    ),
    Measure(key="impacts", symbol="n", definition="Impacts until the shot ended.", kind="whole"),
    Measure(
        key="energy_residual",
        symbol="r_E",
        definition="Energy from nowhere over the initial energy, of the whole shot: round-off in a"
        " sound run.",
        form="power",
    ),
)
"""All columns of a shot, in their order."""
