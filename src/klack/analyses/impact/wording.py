"""The answer of an impact in one paragraph."""

from klack.analyses.contact_doubts import contact_doubt, elastic_above
from klack.analyses.impact.record import ImpactStudy, LevelResult
from klack.contact.restitution import Deviation, ImpactMeasures
from klack.report.wording import count, quantity, share, signed, signed_share

__all__ = ["answer", "leaves_axis", "verdict", "which_contact"]

_SAME_SPEED = 5e-4
"""Relative change of the approach speed that three digits do not show."""


def answer(study: ImpactStudy) -> str:
    """Course of the impact as text, with the deviation of the reduced level from the reference."""
    needle, partner = study.bodies[0], study.bodies[1]
    reference = study.levels[study.reference]
    numbers = reference.measures
    text = (
        f"The {needle.name} ({quantity(1e3 * needle.mass, 'g', 3)}, "
        f"{numbers.approach_speed:.3g} m/s at first touch{_started(study, numbers)}) hits the "
        f"{partner.name} "
    )
    if numbers.cut_off:
        text += (
            "and is still in contact when the record ends, "
            f"{quantity(numbers.contact_time, 's', 3)} after first touch: the force has reached "
            f"{quantity(numbers.peak_force, 'N', 3)} by then, and peak force, contact time, "
            "impulse and restitution are cut off. "
        )
    else:
        text += (
            f"with a peak force of {quantity(numbers.peak_force, 'N', 3)}"
            f"{which_contact(numbers, numbers.strongest)}, stays in contact for "
            f"{quantity(numbers.contact_time, 's', 3)}{which_contact(numbers, 1)} and rebounds "
            f"with {share(numbers.restitution, 2)} of its speed at first touch; "
            f"{share(numbers.vibration_share)} of the impact energy remains as vibration. "
        )
    text += f"These numbers come from the {_called(study.reference)} run"
    if study.reference == "full":
        text += ", which follows every degree of freedom and every contact point"
    elif study.reference == "interface":
        text += ", which has the bodies as modes and a point-resolved contact"
    text += "."
    if doubt := contact_doubt(study.contact):
        text += f" {doubt}"
    if line := elastic_above(study.contact):
        text += f" {line}"
    if "reduced" in study.deviations:
        text += f" {verdict(study.levels['reduced'], study.deviations['reduced'])}"
    elif study.reference == "reduced" and "reduced" in study.estimates and study.estimates_settled:
        text += f" {_estimated(study.estimates['reduced'])}"
    return text


def leaves_axis(study: ImpactStudy) -> bool:
    """Whether axisymmetric bodies of this study met off their axis, at points on rings."""
    level = study.levels.get("interface")
    in_plane = all(body.model == "axisymmetric" for body in study.bodies)
    if level is None or level.pressure is None or not in_plane:
        return False
    return bool(level.pressure.points.shape[1] == 3)


def which_contact(numbers: ImpactMeasures, number: int) -> str:
    """Which contact of several in one impact a number belongs to, in brackets; empty for one."""
    if numbers.sub_contacts < 2:
        return ""
    return f" (contact {number} of {numbers.sub_contacts} in quick succession)"


def _started(study: ImpactStudy, numbers: ImpactMeasures) -> str:
    """Speed at the start, where forces have changed it before touch."""
    if abs(numbers.approach_speed / study.speed - 1.0) < _SAME_SPEED:
        return ""
    return f", {study.speed:.3g} m/s at the start"


def verdict(result: LevelResult, deviation: Deviation) -> str:
    """Deviation of one level from the reference, in one sentence."""
    return (
        f"The {_called(result.level)} model ({count(result.degrees_of_freedom)} degrees of "
        f"freedom, computed in {quantity(result.wall_time, 's', 2)}) deviates from them by "
        f"{signed_share(deviation.peak_force)} in peak force, "
        f"{signed_share(deviation.contact_time)} in contact time and "
        f"{signed(deviation.restitution, 4)} in restitution; its force over time by "
        f"{share(deviation.history_l2, 2)} (root mean square)."
    )


def _estimated(estimate: Deviation) -> str:
    """Errors that one run of the interface level gives the reduced level."""
    return (
        f"Estimated error of this level: {signed_share(estimate.peak_force)} in peak force, "
        f"{signed_share(estimate.contact_time)} in contact time and "
        f"{signed(estimate.restitution, 4)} in restitution."
    )


def _called(level: str) -> str:
    return {"full": "full-order", "interface": "interface-level"}.get(level, level)
