"""The few numbers of a study that a script or a terminal wants."""

from math import isfinite

from klack.contact.restitution import Deviation, ImpactMeasures
from klack.workflow.json_results import ContactJson, DeviationJson, ImpactJson, LevelJson
from klack.workflow.stroke_study import StopSummary
from klack.workflow.study import ContactSummary, ImpactStudy, LevelResult

__all__ = [
    "SUMMARY_COLUMNS",
    "answer_line",
    "contact_doubt",
    "contact_to_json",
    "estimate_lines",
    "no_estimate",
    "restitution_text",
    "study_to_json",
    "summary_rows",
]

SUMMARY_COLUMNS = (
    "level",
    "peak force [N]",
    "contact time [us]",
    "impulse [mN s]",
    "restitution",
    "energy residual",
    "degrees of freedom",
    "wall time [s]",
)


def study_to_json(study: ImpactStudy) -> ImpactJson:
    """Plain numbers in SI, the unit in the key.

    Returns
    -------
    dict
        ``case``; ``complete`` and ``failures``: why levels have no numbers; ``answer``: the level
        whose numbers to take; ``levels``: per level the numbers of the impact, with ``doubts`` that
        make it no reference; ``deviation``: of ``reduced`` against the reference, None when there
        is nothing to compare; ``deviations``: of every level that is not the reference;
        ``estimated_error``: of every reduced level, by an interface-level run, None where that is
        no reference; ``contact``: its mesh, with ``doubts`` that concern all levels; ``warnings``.
        Numbers that do not exist (nan) are None, and so are peak force, contact time and impulse of
        a run that ends in contact (``cut_off``): ``highest_force_N`` is what it had reached.
    """
    deviations = {name: _deviation(item) for name, item in study.deviations.items()}
    return {
        "schema": "klack-impact/1",
        "case": study.case,
        "complete": not study.failures,
        "failures": dict(study.failures),
        "answer": study.reference,
        "levels": {name: _level(result) for name, result in study.levels.items()},
        "deviation": deviations.get("reduced"),
        "deviations": deviations,
        "estimated_error": {
            name: _deviation(item) if study.estimates_settled else None
            for name, item in study.estimates.items()
        },
        "contact": contact_to_json(study.contact),
        "warnings": list(study.warnings),
    }


def contact_to_json(contact: ContactSummary | StopSummary) -> ContactJson:
    """How a contact is meshed, and what makes its numbers doubtful."""
    return {
        "surfaces": contact.surfaces,
        "half_width_m": _number(contact.half_width),
        "size_over_half_width": _number(contact.size_ratio),
        "points_across": contact.points_across or None,
        "doubts": list(contact.doubts),
    }


def contact_doubt(contact: ContactSummary | StopSummary) -> str:
    """Say in one sentence why the numbers of a contact are doubtful; empty if they are not."""
    doubts = " and ".join(contact.doubts)
    return f"The contact {contact.surfaces} cannot be relied on: {doubts}." if doubts else ""


def answer_line(study: ImpactStudy) -> str:
    """Say in one line which level is the answer, and what it says."""
    m = study.levels[study.reference].measures
    begin = f"Answer (level '{study.reference}'): "
    touch = f"{m.approach_speed:.4g} m/s at first touch"
    if m.cut_off:
        return (
            f"{begin}{touch}; the run is cut off in contact, at {m.peak_force:.2f} N so far: "
            "no peak force, no contact time, no restitution."
        )
    contacts = f", {m.sub_contacts} contacts" if m.sub_contacts > 1 else ""
    peak, time = _peak(m, m.peak_force, " N"), _first(m, 1e6 * m.contact_time, " us")
    return (
        f"{begin}peak force {peak}, contact time {time}{contacts}; {touch}, "
        f"{100 * m.restitution:.2f} % of it after the impact."
    )


def no_estimate(study: ImpactStudy) -> str:
    """Why the error of reduced levels was not estimated; empty where it was, or not asked for."""
    if study.estimate_doubt:
        return f"No estimate of the error: {study.estimate_doubt}"
    if study.estimates and not study.estimates_settled:
        return (
            "No estimate of the error: the interface level itself has not settled (its force "
            f"history changes by {100 * study.estimate_spread:.0f} % when the modes are doubled), "
            "as when flat faces meet all at once. Compare with --level full."
        )
    return ""


def estimate_lines(study: ImpactStudy) -> tuple[str, ...]:
    """Say how good every reduced level is, one line each."""
    if reason := no_estimate(study):
        return (reason,)
    return tuple(
        f"Estimated error of '{name}': peak force {_percent(item.peak_force)}, contact time "
        f"{_percent(item.contact_time)}, impulse {_percent(item.impulse)}, restitution "
        f"{_signed(item.restitution, 4)} (against the {study.estimate_basis})."
        for name, item in study.estimates.items()
    )


def _percent(value: float) -> str:
    """Two significant digits, but nothing below a hundredth of a per cent."""
    if not abs(value) < float("inf"):
        return "unknown"
    size = abs(100.0 * value)
    digits = 2 if size < 1.0 else 1 if size < 10.0 else 0
    return _signed(100.0 * value, digits) + " %"


def _signed(value: float, digits: int) -> str:
    return f"{value:+.{digits}f}" if abs(value) < float("inf") else "unknown"


def summary_rows(study: ImpactStudy) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`SUMMARY_COLUMNS`, one per level, as text."""
    return tuple(
        (
            name,
            _peak(result.measures, result.measures.peak_force),
            _first(result.measures, 1e6 * result.measures.contact_time),
            f"{1e3 * result.measures.impulse:.4f}{_cut(result.measures)}",
            restitution_text(result.measures),
            f"{result.energy_residual:.1e}",
            f"{result.degrees_of_freedom}",
            f"{result.wall_time:.3g}",
        )
        for name, result in study.levels.items()
    )


def restitution_text(measures: ImpactMeasures) -> str:
    """Restitution; a dash where the bodies have not parted."""
    return f"{measures.restitution:.4f}" if isfinite(measures.restitution) else "–"


def _peak(measures: ImpactMeasures, value: float, unit: str = "") -> str:
    """Peak force, and in which contact of several it is."""
    which = f" (contact {measures.strongest} of {measures.sub_contacts})"
    return f"{value:.2f}{unit}{which if measures.sub_contacts > 1 else ''}{_cut(measures)}"


def _first(measures: ImpactMeasures, value: float, unit: str = "") -> str:
    """Contact time, which is that of the first contact of several."""
    which = f" (contact 1 of {measures.sub_contacts})" if measures.sub_contacts > 1 else ""
    return f"{value:.3f}{unit}{which}{_cut(measures)}"


def _cut(measures: ImpactMeasures) -> str:
    return " (cut off)" if measures.cut_off else ""


def _level(result: LevelResult) -> LevelJson:
    measures = result.measures
    whole = not measures.cut_off
    return {
        "peak_force_N": _number(measures.peak_force) if whole else None,
        "contact_time_s": _number(measures.contact_time) if whole else None,
        "impulse_Ns": _number(measures.impulse) if whole else None,
        "restitution": _number(measures.restitution),
        "approach_speed_m_s": _number(measures.approach_speed),
        "rebound_speed_m_s": _number(measures.rebound_speed),
        "sub_contacts": int(measures.sub_contacts),
        "strongest_contact": int(measures.strongest),
        "total_contact_time_s": _number(measures.total_contact_time) if whole else None,
        "cut_off": measures.cut_off,
        "highest_force_N": _number(measures.peak_force),
        "doubts": list(result.doubts),
        "energy_residual": _number(result.energy_residual),
        "degrees_of_freedom": int(result.degrees_of_freedom),
        "steps": int(result.steps),
        "wall_time_s": _number(result.wall_time),
    }


def _deviation(deviation: Deviation) -> DeviationJson:
    return {
        "peak_force": _number(deviation.peak_force),
        "contact_time": _number(deviation.contact_time),
        "impulse": _number(deviation.impulse),
        "restitution": _number(deviation.restitution),
        "history_l2": _number(deviation.history_l2),
        "third_octave_max_dB": _number(deviation.third_octave_max_dB),
        "third_octave_up_to_Hz": _number(deviation.third_octave_up_to_Hz),
    }


def _number(value: float) -> float | None:
    """JSON knows no nan and no infinity."""
    return float(value) if abs(value) < float("inf") else None
