"""An impact study in words and numbers, and on disk.

``result.zarr/study/levels/full/history/force`` is the force of the full-order run in newtons.
"""

from collections.abc import Iterator
from math import isfinite
from typing import NamedTuple, Self

import numpy as np

from klack.analyses.analysis import Measured, StoredAnalysis
from klack.analyses.contact_doubts import CONTACT, contact_doubt, elastic_above
from klack.analyses.impact.measures import (
    BACKING_MEASURES,
    CONTACT_TIME,
    DEVIATION_MEASURES,
    LEVEL_MEASURES,
    OBLIQUE_MEASURES,
    PEAK_FORCE,
    measures_of,
)
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.json_parts import JsonForm, Key, Real, measured_keys, schema_key
from klack.analyses.measures import text_table
from klack.analyses.store import RecordFormat
from klack.bodies.gauges.gauge import GaugeRecord
from klack.bodies.reduction.structure import STRUCTURE_UNITS
from klack.terminal.tables import TextTable
from klack.units import format_si

__all__ = [
    "DEVIATION",
    "GAUGE_COLUMNS",
    "IMPACT",
    "answer_line",
    "answer_so_far",
    "compliance_line",
    "estimate_lines",
    "gauge_rows",
    "gauge_text",
    "no_estimate",
    "study_told",
]


DEVIATION = JsonForm(
    "DeviationJson", "Deviation of one result from another.", *measured_keys(DEVIATION_MEASURES)
)


class _Ends(NamedTuple):
    record: GaugeRecord
    lowest: float
    lowest_at: float
    highest: float
    highest_at: float

    @classmethod
    def of(cls, record: GaugeRecord) -> Self:
        values, time = record.values, record.time
        places = (int(np.argmin(values)), int(np.argmax(values)))
        return cls(record, *(float(of[k]) for k in places for of in (values, time)))


_OUTPUT = JsonForm(
    "OutputJson",
    "Signal of one sensor during the impact.",
    Key("kind", str, "displacement, velocity, strain or stress.", "record.kind"),
    Key("unit", str, "Unit of the two values; 1 for a strain.", "record.unit"),
    Key("lowest", Real),
    Key("lowest_at_s", Real, of="lowest_at"),
    Key("highest", Real),
    Key("highest_at_s", Real, of="highest_at"),
)
_OBLIQUE = JsonForm(
    "ObliqueJson",
    "Motion across the axis after the impact.",
    *measured_keys(OBLIQUE_MEASURES),
)
_BACKING = JsonForm(
    "BackingJson",
    "Contact of the struck body with the body behind it.",
    *measured_keys(BACKING_MEASURES),
)
_LEVEL = JsonForm(
    "LevelJson",
    "Impact at one level.",
    *measured_keys(LEVEL_MEASURES),
    Key(
        "oblique",
        (_OBLIQUE, None),
        "Null for a body that starts along the axis.",
        lambda level: None if level.oblique is None else level,
    ),
    Key(
        "backing",
        (_BACKING, None),
        "Null for two bodies.",
        lambda level: None if level.backing is None else level,
    ),
    Key("doubts", list[str], "Reasons why the level may be wrong."),
    Key(
        "outputs",
        {str: _OUTPUT},
        "By the name of the channel.",
        lambda level: {record.name: _Ends.of(record) for record in level.gauges},
    ),
)
_RUNNING_IN = JsonForm(
    "RunningInJson",
    "Impacts one after another on the same faces, a number each.",
    Key("level", str),
    Key("asked", int),
    Key("run_in", bool, "Whether the last impact no longer yields."),
    Key("peak_force_N", list[Real], of="peak_force"),
    Key("contact_time_s", list[Real], of="contact_time"),
    Key("restitution", list[Real]),
    Key("lost_J", list[Real], "In yield.", "lost"),
    Key("set_m", list[Real], "Lowering of the first touch after it.", "set"),
    Key("land_m", list[Real], "Width of the strip in contact so far; level reduced.", "land"),
)
_STUCK = JsonForm(
    "ContactComplianceJson",
    "Approach d and tangential displacement s of the bodies for small changes of the forces along "
    "and across the normal while all points stick: d = normal P + coupling T, "
    "s = coupling P + tangential T.",
    Key("normal_m_per_N", Real, of="normal"),
    Key(
        "tangential_m_per_N",
        Real,
        "Null in the circumferential direction of half sections.",
        "tangential",
    ),
    Key("coupling_m_per_N", Real, "The same.", "coupling"),
    Key("force_N", Real, "Axial force of the static state.", "force"),
)
_FIT = JsonForm(
    "PressFitJson",
    "Two parts of a body pressed on each other, before the impact.",
    Key("body", str),
    Key("joint", str),
    Key("inner", str),
    Key("outer", str),
    Key("interference_m", Real, "On the diameter.", "interference"),
    Key("friction", Real),
    Key("pressure_Pa", Real, "Mean over the joint.", "pressure"),
    Key("least_pressure_Pa", Real, "Below zero: the joint opens.", "least_pressure"),
    Key("largest_pressure_Pa", Real, "Away from sharp corners.", "largest_pressure"),
    Key(
        "stress_Pa",
        dict[str, float],
        "Largest equivalent stress of each part, like the pressure.",
        "stress",
    ),
    Key("yield_Pa", dict[str, float], "Of parts whose material yields.", "yield_stress"),
    Key("axial_force_N", Real, "That friction holds.", "axial_force"),
    Key("torque_Nm", Real, "That friction holds.", "torque"),
    Key(
        "stiffening",
        Real,
        "Largest relative shift of a frequency by the stress, left out of the impact.",
    ),
)
_BOLTS = JsonForm(
    "BoltsJson",
    "Two parts of a body pressed together by bolts; numbers of all bolts together.",
    Key("body", str),
    Key("joint", str),
    Key("lower", str),
    Key("upper", str),
    Key("ends", list[str], "Edges or faces that the bolts press."),
    Key("count", int, "Of bolts."),
    Key("area_m2", Real, "Of the joint.", "area"),
    Key("preload_N", Real, of="preload"),
    Key("bolt_stress_Pa", Real, "Under the preload.", "bolt_stress"),
    Key("bolt_yield_Pa", (Real, None), "Null where it is not given.", "bolt_yield"),
    Key("pressure_Pa", Real, "Mean over the joint.", "pressure"),
    Key("least_pressure_Pa", Real, "Zero where the joint is open.", "least_pressure"),
    Key("largest_pressure_Pa", Real, "Away from sharp corners.", "largest_pressure"),
    Key("open_share", Real, "Of the joint, under the preload."),
    Key("stress_Pa", dict[str, float], "Largest equivalent stress of each part.", "stress"),
    Key("yield_Pa", dict[str, float], "Of parts whose material yields.", "yield_stress"),
    Key("bolt_stiffness_N_per_m", Real, of="bolt_stiffness"),
    Key("part_stiffness_N_per_m", Real, "Of the clamped parts.", "part_stiffness"),
    Key("load_factor", Real, "Share of a force between the ends that the bolts carry."),
    Key("lifting_force_N", Real, "Between the ends.", "lifting_force"),
    Key("carried_N", (Real, None), "Twice the largest contact force.", "carried"),
    Key("opens", bool, "The impact may open the joint: carried_N is above the preload."),
)
_LAYER = JsonForm(
    "LayerJson",
    "A layer between two parts of a body, and its share in the modes.",
    Key("body", str),
    Key("layer", str, of="name"),
    Key("first", str),
    Key("second", str),
    Key("area_m2", Real, of="area"),
    Key("normal_N_per_m", Real, "Of the whole area.", "normal"),
    Key("tangential_N_per_m", Real, "Of the whole area.", "tangential"),
    Key("stiffness_at_Hz", Real, "Null: of no frequency.", "taken"),
    Key("frequency_Hz", list[Real], "Of the elastic modes.", "frequency"),
    Key("energy_share", list[Real], "Share of their strain energy in the layer.", "share"),
    Key("loss_factor", list[Real], "By the layer.", "loss"),
    Key(
        "shift",
        list[Real],
        "Relative shift of each frequency by the stiffness there, left out of the impact.",
    ),
)
STUDY = JsonForm(
    "ImpactJson",
    "``klack impact`` and ``klack demo``.",
    schema_key("klack-impact/1"),
    Key("case", str),
    Key("complete", bool, "False: a level failed.", lambda study: not study.failures),
    Key("failures", dict[str, str], "Why a level has no numbers, by its name."),
    Key("answer", str, "Name of the best level.", "reference"),
    Key("levels", {str: _LEVEL}, "By the name of the level."),
    Key(
        "deviation",
        (DEVIATION, None),
        "Deviation of the level reduced from the reference.",
        lambda study: study.deviations.get("reduced"),
    ),
    Key("deviations", {str: DEVIATION}, "Deviation of every level that is not the reference."),
    Key(
        "estimated_error",
        {str: (DEVIATION, None)},
        "Estimated error of every reduced level, and of the steps of the full order, from a run "
        "at the interface level.",
        lambda study: {
            name: item if study.estimates_settled else None
            for name, item in study.estimates.items()
        },
    ),
    Key(
        "estimate_margin",
        {str: DEVIATION},
        "Uncertainty of each; without sign.",
        "estimate_margins",
    ),
    Key("contact", CONTACT, "All levels but lumped share it."),
    Key(
        "contact_compliance",
        (_STUCK, None),
        "For half sections and faces with friction.",
        lambda study: study.contact.stuck,
    ),
    Key("running_in", (_RUNNING_IN, None), "Null for one impact, or elastic faces."),
    Key("fits", [_FIT], "Press fits of all bodies."),
    Key("bolts", [_BOLTS], "Bolted joints of all bodies."),
    Key("layers", [_LAYER], "Gaskets, O-rings and adhesives of all bodies."),
    Key("warnings", list[str]),
)


def study_told(study: ImpactStudy) -> Iterator[TextTable | str]:
    """Levels side by side, the answer, the error of the others."""
    yield text_table(study.title, "level", LEVEL_MEASURES, study.levels.items())
    oblique = [item for item in study.levels.items() if item[1].oblique is not None]
    if oblique:
        yield text_table("Across the axis", "level", OBLIQUE_MEASURES, oblique)
    row = [item for item in study.levels.items() if item[1].backing is not None]
    for name, level in row:
        assert level.backing is not None
        title = f"Behind: {level.backing.surfaces}"
        yield text_table(title, "level", BACKING_MEASURES, [(name, level)])
    yield answer_line(study)
    if doubt := contact_doubt(study.contact):
        yield doubt
    if line := elastic_above(study.contact):
        yield line
    yield from estimate_lines(study)
    if line := compliance_line(study):
        yield line
    if rows := gauge_rows(study):
        yield TextTable(title="Outputs", columns=GAUGE_COLUMNS, rows=rows, left=3)
    if found := study.running_in:
        yield TextTable(
            title="Running in",
            columns=found.heads,
            rows=found.rows(format_si),
        )
    for fit in study.fits:
        heads = ("press fit", f"{fit.body}.{fit.joint}")
        yield TextTable(title="Press fit", columns=heads, rows=fit.rows())
    for bolted in study.bolts:
        heads = ("bolts", f"{bolted.body}.{bolted.joint}")
        yield TextTable(title="Bolts", columns=heads, rows=bolted.rows())
    for each in study.layers:
        heads = ("layer", f"{each.body}.{each.name}")
        yield TextTable(title="Layer", columns=heads, rows=each.rows())


def compliance_line(study: ImpactStudy) -> str:
    """Compliance of a contact that sticks along and across its normal; empty if unknown."""
    stuck = study.contact.stuck
    rubs = any(level.energies.get("friction") for level in study.ordered)
    if stuck is None or not rubs or not isfinite(stuck.tangential):
        return ""
    return (
        f"Compliance of the contact at {format_si(stuck.force, 'N', 3)} while it sticks: along the "
        f"normal {stuck.normal:.4g} m/N, across it {stuck.tangential:.4g} m/N "
        f"({stuck.tangential / stuck.normal:.3f} of it), coupling {stuck.coupling:.3g} m/N "
        f"({stuck.coupling / stuck.normal:+.3f})."
    )


GAUGE_COLUMNS = ("output", "what", "level", "lowest", "at", "highest", "at")
"""Heads of :func:`gauge_rows`."""


def gauge_rows(study: ImpactStudy) -> tuple[tuple[str, ...], ...]:
    """Extremes of every output at every level."""
    return tuple(
        (
            record.name,
            record.label,
            level.level,
            gauge_text(record, ends.lowest),
            format_si(ends.lowest_at, "s"),
            gauge_text(record, ends.highest),
            format_si(ends.highest_at, "s"),
        )
        for level in study.ordered
        for record in level.gauges
        for ends in (_Ends.of(record),)
    )


def gauge_text(record: GaugeRecord, value: float) -> str:
    """Value of an output with its unit; a strain in um/m."""
    if record.kind == "strain":
        return f"{1e6 * value:.4g} um/m"
    return format_si(value, record.unit)


def study_measured(study: ImpactStudy) -> Iterator[Measured]:
    """Every level with its measures."""
    for name, level in study.levels.items():
        yield name, level, measures_of(level)


def answer_line(study: ImpactStudy) -> str:
    """Level and numbers of the answer."""
    level = study.levels[study.reference]
    m = level.measures
    begin = f"Answer (level '{study.reference}'): "
    touch = f"{m.approach_speed:.4g} m/s at first touch"
    if m.cut_off:
        return (
            f"{begin}{touch}; the run ends in contact, at {m.peak_force:.2f} N so far: no peak "
            "force, no contact time, no restitution."
        )
    contacts = f", {m.sub_contacts} contacts" if m.sub_contacts > 1 else ""
    return (
        f"{begin}peak force {PEAK_FORCE.told(level)}, contact time {CONTACT_TIME.told(level)}"
        f"{contacts}; {touch}, "
        f"{100 * m.restitution:.2f} % of it after the impact."
    )


def answer_so_far(study: ImpactStudy) -> tuple[str, ...]:
    """Lines on a study that is not complete yet."""
    line = answer_line(study).replace("Answer", "Answer so far", 1)
    doubts = (*study.levels[study.reference].doubts, contact_doubt(study.contact))
    return (line, *filter(None, doubts), *estimate_lines(study))


def no_estimate(study: ImpactStudy) -> str:
    """Why a requested estimate of the error is missing; else empty."""
    if study.estimate_doubt:
        return f"No error estimate: {study.estimate_doubt}"
    if study.estimates and not study.estimates_settled:
        advice = "" if "full" in study.levels else " Compare with --level full."
        return (
            "No error estimate: the interface level itself has not converged (its force history "
            f"changes by {100 * study.estimate_spread:.0f} % with half the modes in longer "
            f"steps), as for flat faces that meet all at once.{advice}"
        )
    return ""


def estimate_lines(study: ImpactStudy) -> tuple[str, ...]:
    """Error of every reduced level and of the steps of the full order."""
    if reason := no_estimate(study):
        return (reason,)
    return tuple(_estimate_line(study, name) for name in study.estimates)


def _estimate_line(study: ImpactStudy, name: str) -> str:
    item, within = study.estimates[name], study.estimate_margins.get(name)
    peak, time, impulse, restitution = (
        (getattr(item, key), None if within is None else getattr(within, key))
        for key in ("peak_force", "contact_time", "impulse", "restitution")
    )
    return (
        f"Estimated error of {'the steps of ' * (name == 'full')}'{name}': peak force "
        f"{_percent(*peak)}, contact time {_percent(*time)}, impulse {_percent(*impulse)}, "
        f"restitution {_signed(*restitution, 4)} (against the {study.estimate_basis})."
    )


def _percent(value: float, within: float | None) -> str:
    """Two significant digits, but nothing below 0.01 %."""
    size = abs(100.0 * value)
    digits = 2 if size < 1.0 else 1 if size < 10.0 else 0
    text = _signed(100.0 * value, None if within is None else 100.0 * within, digits)
    return text if text == "unknown" else f"{text} %"


def _signed(value: float, within: float | None, digits: int) -> str:
    if not abs(value) < float("inf"):
        return "unknown"
    text = f"{value:+.{digits}f}"
    return text if within is None or within != within else f"{text} ± {within:.{digits}f}"


_UNITS = {
    **STRUCTURE_UNITS,
    "time": "s",
    "force": "N",
    "peak_force": "N",
    "external_force": "N",
    "gap": "m",
    "approach": "m",
    "indentation": "m",
    "area": "m^2",
    "velocity_a": "m/s",
    "velocity_b": "m/s",
    "displacement_a": "m",
    "displacement_b": "m",
    "frequency": "Hz",
    "frequencies": "Hz",
    "energy": "J",
    "modal": "J",
    "points": "m",
    "point_force": "N",
    "normals": "1",
    "section": "m",
    "angle": "rad",
    "instants": "s",
    "stress": "Pa",
    "velocity_before": "m/s",
    "velocity_after": "m/s",
    "spin_before": "rad/s",
    "spin_after": "rad/s",
    "touch": "m",
    "displacement": "m",
    "magnitude": "m",
    "share": "1",
    "exact": "SI",
}


IMPACT = StoredAnalysis(
    form=RecordFormat(
        name="klack impact study",
        version=1,
        kind=ImpactStudy,
        command="klack impact",
        units=_UNITS,
    ),
    page="impact.content:report_content",
    json=STUDY.type,
    to_json=STUDY.json,
    told=study_told,
    measures={
        "impact level": LEVEL_MEASURES,
        "oblique impact level": OBLIQUE_MEASURES,
        "impact level of three bodies": BACKING_MEASURES,
        "difference of two levels": DEVIATION_MEASURES,
    },
    measured=study_measured,
)
