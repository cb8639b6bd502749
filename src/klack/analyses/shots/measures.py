"""Measures of one shot: drawn quantities and results."""

from collections.abc import Mapping

from klack.analyses.measures import Measure

__all__ = ["DRAWN", "FIRST_IMPACT", "ROCKING", "SHOT_MEASURES", "Shot"]

Shot = Mapping[str, float]
"""Numbers of one shot by the name of their column; see :class:`ShotColumns`."""

_THEORY = "theory/interface"

DRAWN: tuple[Measure[Shot], ...] = (
    Measure(
        key="eccentricity",
        name="eccentricity",
        symbol="e_0",
        unit="m",
        definition="Distance of the axis of the moving body from that of the seat at the height of"
        " first touch, at the start of the drop.",
        source=_THEORY,
        read=lambda shot: shot["eccentricity"],
    ),
    Measure(
        key="direction",
        name="direction",
        symbol="phi_e",
        unit="rad",
        definition="Direction of the eccentricity, from x to y.",
        source=_THEORY,
        read=lambda shot: shot["direction"],
    ),
    Measure(
        key="tilt",
        name="tilt",
        symbol="theta",
        unit="rad",
        definition="Angle between both axes at the start of the drop.",
        source=_THEORY,
        read=lambda shot: shot["tilt"],
    ),
    Measure(
        key="tilt_direction",
        name="tilt direction",
        symbol="phi_t",
        unit="rad",
        definition="Direction in which the upper end is tilted, from x to y.",
        source=_THEORY,
        read=lambda shot: shot["tilt_direction"],
    ),
    Measure(
        key="force",
        name="closing force",
        symbol="F_0",
        unit="N",
        definition="Force that closes the valve at first touch.",
        source=_THEORY,
        read=lambda shot: shot["force"],
    ),
    Measure(
        key="friction",
        name="friction in the guide",
        symbol="mu",
        unit="1",
        definition="Coulomb's coefficient in the guide.",
        source=_THEORY,
        read=lambda shot: shot["friction"],
        form="fixed",
    ),
    Measure(
        key="waviness",
        name="out-of-roundness, rms",
        symbol="w",
        unit="m",
        definition="Root mean square deviation of the ring from a circle.",
        source=_THEORY,
        read=lambda shot: shot["waviness"],
    ),
)
"""What differs from shot to shot."""

FIRST_IMPACT: tuple[Measure[Shot], ...] = (
    Measure(
        key="restitution",
        name="restitution",
        symbol="e",
        unit="1",
        definition="Velocity of the centre of mass along the axis after the first impact over that"
        " before it.",
        source=_THEORY,
        read=lambda shot: shot["restitution"],
        form="fixed",
        note="It is a result, never an input. A closing force also works during "
        "the contact: a strong one raises the restitution of an eccentric impact, even "
        "above one.",
    ),
    Measure(
        key="rebound_height",
        name="rebound height",
        symbol="h",
        unit="m",
        definition="Highest position of the centre of mass between the first impact and the "
        "second, above that at first touch.",
        source=_THEORY,
        read=lambda shot: shot["rebound_height"],
    ),
    Measure(
        key="peak_force",
        name="peak force",
        symbol="F_max",
        unit="N",
        definition="Largest contact force of any time step of the first impact.",
        source=_THEORY,
        read=lambda shot: shot["peak_force"],
    ),
    Measure(
        key="contact_time",
        name="contact time",
        symbol="t_c",
        unit="s",
        definition="From first touch to the end of the first uninterrupted contact.",
        source=_THEORY,
        read=lambda shot: shot["contact_time"],
    ),
    Measure(
        key="impulse",
        name="impulse",
        symbol="J",
        unit="N s",
        definition="Integral of the contact force over the first impact, with all its contacts.",
        source=_THEORY,
        read=lambda shot: shot["impulse"],
    ),
)
"""What is measured of the first impact; the first two tell how high it comes back."""

ROCKING = Measure[Shot](
    key="rocking",
    name="lateral motion after it",
    symbol="E_r/E_0",
    unit="1",
    definition="Kinetic energy of rotation and lateral motion right after the first impact, "
    "over the energy of approach.",
    source=_THEORY,
    read=lambda shot: shot["rocking"],
    form="share",
    digits=2,
    note="The loss of rebound by an eccentric or tilted impact.",
)

SHOT_MEASURES: tuple[Measure[Shot], ...] = (
    *DRAWN,
    Measure(
        key="approach_speed",
        name="approach speed",
        symbol="v_0",
        unit="m/s",
        definition="Speed of the centre of mass along the axis before the first impact.",
        source=_THEORY,
        read=lambda shot: shot["approach_speed"],
    ),
    *FIRST_IMPACT,
    Measure(
        key="sub_contacts",
        name="sub contacts",
        symbol="n_c",
        unit="1",
        definition="Contacts of which the first impact consists.",
        source=_THEORY,
        read=lambda shot: shot["sub_contacts"],
        kind="whole",
        form="count",
    ),
    ROCKING,
    Measure(
        key="second_impact",
        name="second impact",
        symbol="t_2",
        unit="s",
        definition="Time from the first touch to that of the second impact.",
        source=_THEORY,
        read=lambda shot: shot["second_impact"],
    ),
    Measure(
        key="impacts",
        name="impacts",
        symbol="n",
        unit="1",
        definition="Impacts until the shot ended.",
        source=_THEORY,
        read=lambda shot: shot["impacts"],
        kind="whole",
        form="count",
    ),
    Measure(
        key="energy_residual",
        name="energy residual",
        symbol="r_E",
        unit="1",
        definition="Residual of the energy balance over the initial energy, of the whole shot: "
        "round-off in a correct run.",
        source=_THEORY,
        read=lambda shot: shot["energy_residual"],
        form="power",
    ),
)
"""All columns of a shot, in their order."""
