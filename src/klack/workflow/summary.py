"""The few numbers of a study that a script or a terminal wants."""

from klack.contact.restitution import Deviation
from klack.workflow.json_results import DeviationJson, ImpactJson, LevelJson
from klack.workflow.study import ImpactStudy, LevelResult

__all__ = ["SUMMARY_COLUMNS", "estimate_lines", "study_to_json", "summary_rows"]

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
        ``case``; ``levels``: per level the numbers of the impact; ``deviation``: of ``reduced``
        against the reference, None when there is nothing to compare; ``deviations``: of every level
        that is not the reference; ``estimated_error``: of every reduced level, by an
        interface-level run, None where that is no reference.  Numbers that do not exist (nan) are
        None.
    """
    deviations = {name: _deviation(item) for name, item in study.deviations.items()}
    return {
        "schema": "klack-impact/1",
        "case": study.case,
        "levels": {name: _level(result) for name, result in study.levels.items()},
        "deviation": deviations.get("reduced"),
        "deviations": deviations,
        "estimated_error": {
            name: _deviation(item) if study.estimates_settled else None
            for name, item in study.estimates.items()
        },
    }


def estimate_lines(study: ImpactStudy) -> tuple[str, ...]:
    """Say how good every reduced level is, one line each."""
    if study.estimates and not study.estimates_settled:
        return (
            "No estimate of the error: the interface level itself has not settled (its force "
            f"history changes by {100 * study.estimate_spread:.0f} % when the modes are doubled), "
            "as when flat faces meet all at once. Compare with --level full.",
        )
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
            f"{result.measures.peak_force:.2f}",
            f"{1e6 * result.measures.contact_time:.3f}",
            f"{1e3 * result.measures.impulse:.4f}",
            f"{result.measures.restitution:.4f}",
            f"{result.energy_residual:.1e}",
            f"{result.degrees_of_freedom}",
            f"{result.wall_time:.3g}",
        )
        for name, result in study.levels.items()
    )


def _level(result: LevelResult) -> LevelJson:
    measures = result.measures
    return {
        "peak_force_N": _number(measures.peak_force),
        "contact_time_s": _number(measures.contact_time),
        "impulse_Ns": _number(measures.impulse),
        "restitution": _number(measures.restitution),
        "sub_contacts": int(measures.sub_contacts),
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
