"""Measures of a level, and of the difference of two."""

from collections.abc import Callable
from math import isfinite
from operator import attrgetter

from klack.analyses.impact.record import LevelResult
from klack.analyses.measures import Column, Measure, described_in
from klack.contact.restitution import Deviation
from klack.report.wording import count, quantity

__all__ = [
    "BACKING_MEASURES",
    "CONTACT_TIME",
    "DEVIATION_MEASURES",
    "LEVEL_MEASURES",
    "OBLIQUE_MEASURES",
    "PEAK_FORCE",
    "RESTITUTION",
    "measures_of",
]

_THEORY = "theory/impact"


def _whole(level: LevelResult) -> bool:
    return not level.measures.cut_off


def _cut(level: LevelResult) -> str:
    return " (cut off)" if level.measures.cut_off else ""


def _contact(level: LevelResult, number: int) -> str:
    several = level.measures.sub_contacts
    return f" (contact {number} of {several})" if several > 1 else ""


def _oblique(read: Callable[..., float]) -> Callable[[LevelResult], float | None]:
    """Read the motion after the impact; None for a straight or cut-off one."""

    def found(level: LevelResult) -> float | None:
        motion = level.oblique
        return None if motion is None or level.measures.cut_off else read(motion)

    return found


PEAK_FORCE = Measure[LevelResult](
    key="peak_force",
    symbol="F_max",
    unit="N",
    definition="Largest contact force of any time step of the first impact.",
    page=True,
    read=lambda level: level.measures.peak_force,
    column=Column("N", 1.0, ".2f"),
    given=_whole,
    remark=lambda level: _contact(level, level.measures.strongest) + _cut(level),
    deviation="relative",
)
CONTACT_TIME = Measure[LevelResult](
    key="contact_time",
    symbol="t_c",
    unit="s",
    definition="From first touch to the end of the first uninterrupted contact.",
    note="Both instants are located inside the time steps.",
    page=True,
    read=lambda level: level.measures.contact_time,
    column=Column("us", 1e6, ".3f"),
    given=_whole,
    remark=lambda level: _contact(level, 1) + _cut(level),
    deviation="relative",
)
RESTITUTION = Measure[LevelResult](
    key="restitution",
    symbol="e",
    definition="Velocity of the centre of mass after the impact over its velocity before "
    "(relative velocity of both centres where both are free; of three bodies in a row, of the "
    "upper one).",
    note="It results from the vibration left in the bodies; it is never an input, and does not "
    "refer to a point on the surface.",
    page=True,
    read=lambda level: level.measures.restitution,
    form="fixed",
    column=Column("", 1.0, ".4f"),
    deviation="difference",
)

OBLIQUE_MEASURES: tuple[Measure[LevelResult], ...] = described_in(
    "theory/friction",
    Measure(
        key="tangential_restitution",
        symbol="e_t",
        definition="Sideways velocity of the centre of mass after the impact over its velocity "
        "before, along the sideways direction (relative velocity of both centres where both are "
        "free).",
        page=True,
        read=_oblique(lambda motion: motion.tangential_restitution),
        form="fixed",
        column=Column("", 1.0, ".4f"),
    ),
    Measure(
        key="impulse_ratio",
        symbol="J_t/J",
        definition="Impulse on the moving body across the axis over the impulse along it; the "
        "coefficient of friction where flat faces slip all the time.",
        page=True,
        read=_oblique(lambda motion: motion.impulse_ratio),
        form="fixed",
        column=Column("", 1.0, ".5f"),
    ),
    *(
        Measure(
            key=f"velocity_{axis}_after",
            symbol=f"v_{axis}",
            unit="m/s",
            definition=f"Velocity of the centre of mass of the moving body along {axis} after the "
            "impact.",
            page=True,
            read=_oblique(lambda motion, i=i: float(motion.velocity_after[i])),
            column=Column("m/s", 1.0, ".5g", f"v_{axis}"),
        )
        for i, axis in enumerate("xy")
    ),
    *(
        Measure(
            key=f"spin_{axis}_after",
            symbol=f"w_{axis}",
            unit="rad/s",
            definition=f"Angular velocity of the moving body about {axis} after the impact.",
            page=True,
            read=_oblique(lambda motion, i=i: float(motion.spin_after[i])),
            column=Column("rad/s", 1.0, ".5g", f"w_{axis}"),
        )
        for i, axis in enumerate("xyz")
    ),
)
"""Of levels that move a body sideways; no others have a value."""


def _backing(read: Callable[..., float]) -> Callable[[LevelResult], float | None]:
    """Read the contact with the third body; None for two bodies and for what does not happen."""

    def found(level: LevelResult) -> float | None:
        value = float("nan") if level.backing is None else read(level.backing)
        return value if isfinite(value) else None

    return found


BACKING_MEASURES: tuple[Measure[LevelResult], ...] = described_in(
    _THEORY,
    Measure(
        key="backing_peak_force",
        symbol="F_2",
        unit="N",
        definition="Largest force between the struck body and the body behind it in the whole "
        "run, including the preload.",
        page=True,
        read=_backing(lambda contact: contact.peak_force),
        column=Column("N", 1.0, ".2f", "peak"),
    ),
    Measure(
        key="backing_least_force",
        symbol="F_2min",
        unit="N",
        definition="Smallest force there after first contact; 0 if the struck body lifts.",
        page=True,
        read=_backing(lambda contact: contact.least_force),
        column=Column("N", 1.0, ".2f", "least"),
    ),
    Measure(
        key="lift_off",
        symbol="t_off",
        unit="s",
        definition="Time from the start of the run at which the struck body first leaves the "
        "body behind it.",
        page=True,
        read=_backing(lambda contact: contact.lift_off),
        column=Column("us", 1e6, ".3f", "lifts at"),
    ),
    Measure(
        key="open_time",
        symbol="t_open",
        unit="s",
        definition="Total time that the two are apart after their first contact.",
        page=True,
        read=_backing(lambda contact: contact.open_time),
        column=Column("us", 1e6, ".3f", "open"),
    ),
    Measure(
        key="largest_gap",
        symbol="g_2",
        unit="m",
        definition="Largest gap between the two after their first contact.",
        page=True,
        read=_backing(lambda contact: contact.largest_gap),
        column=Column("um", 1e6, ".4f", "gap"),
    ),
)
"""Of three bodies in a row; no others have a value."""

LEVEL_MEASURES: tuple[Measure[LevelResult], ...] = described_in(
    _THEORY,
    PEAK_FORCE,
    CONTACT_TIME,
    Measure(
        key="impulse",
        symbol="J",
        unit="N s",
        definition="Integral of the contact force over the impact, including all contacts that "
        "follow each other closely.",
        page=True,
        read=lambda level: level.measures.impulse,
        column=Column("mN s", 1e3, ".4f"),
        given=_whole,
        remark=_cut,
        deviation="relative",
    ),
    RESTITUTION,
    Measure(
        key="approach_speed",
        title="speed at first touch",
        symbol="v_0",
        unit="m/s",
        definition="Relative speed of the centres of mass at first touch.",
        page=True,
        read=lambda level: level.measures.approach_speed,
    ),
    Measure(
        key="rebound_speed",
        symbol="v_1",
        unit="m/s",
        definition="Relative speed of the centres of mass after the last contact of the impact.",
        page=True,
        read=lambda level: level.measures.rebound_speed,
    ),
    Measure(
        key="vibration_share",
        title="vibration left behind",
        symbol="E_v/E_0",
        definition="Share of the energy of approach that remains as vibration.",
        page=True,
        read=lambda level: level.measures.vibration_share,
        form="share",
        digits=1,
    ),
    Measure(
        key="sub_contacts",
        title="contacts in the impact",
        symbol="n_c",
        definition="Number of contacts during the impact.",
        page=True,
        read=lambda level: level.measures.sub_contacts,
        kind="whole",
    ),
    Measure(
        key="strongest_contact",
        symbol="k",
        definition="Number of the contact with the peak force, counted from 1.",
        read=lambda level: level.measures.strongest,
        kind="whole",
    ),
    Measure(
        key="total_contact_time",
        symbol="t_tot",
        unit="s",
        definition="From first touch to the end of the last contact of the impact.",
        read=lambda level: level.measures.total_contact_time,
        given=_whole,
    ),
    Measure(
        key="peak_time",
        symbol="t_max",
        unit="s",
        definition="Time of the peak force, counted from first touch.",
        read=lambda level: level.measures.peak_time,
        given=_whole,
    ),
    Measure(
        key="first_touch",
        symbol="t_0",
        unit="s",
        definition="Time of first touch from the start of the run.",
        read=lambda level: level.measures.first_touch,
    ),
    Measure(
        key="dissipated_share",
        symbol="E_d/E_0",
        definition="Losses in the contact and by damping over the energy of approach.",
        read=lambda level: level.measures.dissipated_share,
        form="share",
        digits=1,
    ),
    Measure(
        key="cut_off",
        definition="Whether the run ends while the bodies are in contact.",
        read=lambda level: level.measures.cut_off,
        kind="truth",
    ),
    Measure(
        key="highest_force",
        symbol="F",
        unit="N",
        definition="Highest force so far, also of a run that ends in contact.",
        read=lambda level: level.measures.peak_force,
    ),
    Measure(
        key="energy_residual",
        symbol="r_E",
        definition="Energies at the end and losses, minus the energies at the start and the work "
        "done, over the initial energy: round-off in a correct run.",
        note="The time scheme of the full order loses a little energy by itself; this is counted "
        "as contact dissipation.",
        page=True,
        form="power",
        column=Column("", 1.0, ".1e"),
    ),
    Measure(
        key="degrees_of_freedom",
        symbol="n",
        definition="Degrees of freedom of the time integration: free displacements of the full "
        "order; modes and rigid motions of the reduced and interface levels.",
        page=True,
        kind="whole",
        column=Column("", 1.0, "d"),
    ),
    Measure(key="steps", symbol="n_t", definition="Time steps of the run.", kind="whole"),
    Measure(
        key="step",
        title="time step",
        remark=lambda level: f"\n{count(level.steps)} steps",
        symbol="dt",
        unit="s",
        definition="Length of a time step.",
        page=True,
        digits=3,
    ),
    Measure(
        key="wall_time",
        title="computing time",
        unit="s",
        definition="Wall time of the time integration.",
        page=True,
        digits=3,
        column=Column("s", 1.0, ".3g"),
    ),
    Measure(
        key="setup_time",
        title="preparation",
        unit="s",
        definition="Wall time of all preparations of the level.",
        page=True,
        read=lambda level: level.setup_time if level.setup_time else None,
        digits=3,
    ),
)
"""In the order of JSON and of exported files."""


def measures_of(*levels: LevelResult) -> tuple[Measure[LevelResult], ...]:
    """Measures that any of these levels has."""
    oblique = any(level.oblique is not None for level in levels)
    backing = any(level.backing is not None for level in levels)
    return (
        *LEVEL_MEASURES,
        *(OBLIQUE_MEASURES if oblique else ()),
        *(BACKING_MEASURES if backing else ()),
    )


def _of_level(measure: Measure[LevelResult]) -> Measure[Deviation]:
    relative = measure.deviation == "relative"
    return Measure(
        key=measure.key,
        name=measure.name,
        symbol=measure.symbol,
        unit="1",
        definition="Relative: 0.01 is 1 %." if relative else "Difference.",
        source=measure.source,
        read=attrgetter(measure.key),
        form="signed share" if relative else "signed",
        digits=2 if relative else 4,
    )


DEVIATION_MEASURES: tuple[Measure[Deviation], ...] = described_in(
    _THEORY,
    *(_of_level(measure) for measure in LEVEL_MEASURES if measure.deviation),
    Measure(
        key="history_l2",
        page=True,
        name="force over time",
        title="force over time, deviation",
        definition="Root mean square difference from the reference during the contact, first touch "
        "aligned, over the peak force of the reference.",
        form="share",
        digits=2,
    ),
    Measure(
        key="third_octave_max",
        page=True,
        name="third-octave levels",
        title="third-octave levels, deviation",
        unit="dB",
        definition="Largest level difference over all bands within 40 dB of the highest one.",
        source="theory/spectra",
        read=lambda deviation: deviation.third_octave_max_dB,
        form="fixed",
        digits=2,
        remark=lambda deviation: (
            f"\nup to {quantity(deviation.third_octave_up_to_Hz, 'Hz', 3)}"
            if isfinite(deviation.third_octave_max_dB)
            else ""
        ),
    ),
    Measure(
        key="third_octave_up_to",
        name="third-octave levels, up to",
        unit="Hz",
        definition="Highest band compared.",
        source="theory/spectra",
        read=lambda deviation: deviation.third_octave_up_to_Hz,
        digits=3,
    ),
)
"""Deviation of one level from another."""
