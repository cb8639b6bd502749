"""The answer of an impact in one paragraph."""

from math import hypot, isfinite

from klack.analyses.contact_doubts import contact_doubt, elastic_above
from klack.analyses.impact.measures import DEVIATION_MEASURES
from klack.analyses.impact.record import ImpactStudy, LevelResult
from klack.contact.restitution import Deviation, ImpactMeasures
from klack.report.wording import count, quantity, share, signed, signed_share

__all__ = [
    "ESTIMATE_COLUMNS",
    "FAIR",
    "GOOD",
    "answer",
    "estimate_rows",
    "estimate_sentence",
    "leaves_axis",
    "verdict",
    "which_contact",
    "worst_error",
]


_SAME_SPEED = 5e-4
"""Change of the approach speed that three digits do not show."""


def answer(study: ImpactStudy) -> str:
    """Course of the impact, with the deviation of the reduced level."""
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
            "impulse and restitution are incomplete. "
        )
    else:
        text += (
            f"with a peak force of {quantity(numbers.peak_force, 'N', 3)}"
            f"{which_contact(numbers, numbers.strongest)}, stays in contact for "
            f"{quantity(numbers.contact_time, 's', 3)}{which_contact(numbers, 1)} and rebounds "
            f"with {share(numbers.restitution, 2)} of its speed at first touch"
        )
        if isfinite(numbers.vibration_share):
            text += f"; {share(numbers.vibration_share)} of the impact energy remains as vibration"
        text += f". {_across(reference)}"
    text += _behind(reference)
    text += f"These numbers come from the {_called(study.reference)} run"
    if study.reference == "full":
        text += ", which follows every degree of freedom and every contact point"
    elif study.reference == "interface":
        text += ", which represents the bodies by modes and has a point-resolved contact"
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


def _behind(level: LevelResult) -> str:
    """What the body behind the struck one takes; empty for two bodies."""
    contact = level.backing
    if contact is None:
        return ""
    text = (
        f"Below, {contact.surfaces} carries {quantity(contact.least_force, 'N', 3)} to "
        f"{quantity(contact.peak_force, 'N', 3)}"
    )
    if contact.open_time > 0.0:
        return (
            f"{text}: it lifts off {quantity(contact.lift_off, 's', 3)} after the start of the "
            f"run, is open for {quantity(contact.open_time, 's', 3)} in all, up to "
            f"{quantity(contact.largest_gap, 'm', 3)}. "
        )
    return f"{text} and stays closed. "


def _across(level: LevelResult) -> str:
    """Motion across the axis after the impact; empty for a straight one."""
    motion = level.oblique
    if motion is None:
        return ""
    sideways = "leaves"
    if isfinite(motion.tangential_restitution):
        sideways = f"keeps {share(motion.tangential_restitution, 1)} of its sideways speed, leaves"
    return (
        f"It {sideways} with a spin of {hypot(*motion.spin_after):.4g} rad/s, and the impulse "
        f"across the axis is {motion.impulse_ratio:.4f} of the impulse along it. "
    )


def leaves_axis(study: ImpactStudy) -> bool:
    """Whether axisymmetric bodies met off-axis, at points on rings."""
    level = study.levels.get("interface")
    in_plane = all(body.model == "axisymmetric" for body in study.bodies)
    if level is None or level.pressure is None or not in_plane:
        return False
    return bool(level.pressure.points.shape[1] == 3)


def which_contact(numbers: ImpactMeasures, number: int) -> str:
    """Contact of a number, in brackets; empty for a single one."""
    if numbers.sub_contacts < 2:
        return ""
    return f" (contact {number} of {numbers.sub_contacts} in quick succession)"


def _started(study: ImpactStudy, numbers: ImpactMeasures) -> str:
    if abs(numbers.approach_speed / study.speed - 1.0) < _SAME_SPEED:
        return ""
    return f", {study.speed:.3g} m/s at the start"


def verdict(result: LevelResult, deviation: Deviation) -> str:
    """Deviation of one level, in one sentence."""
    return (
        f"The {_called(result.level)} model ({count(result.degrees_of_freedom)} degrees of "
        f"freedom, computed in {quantity(result.wall_time, 's', 2)}) deviates from them by "
        f"{signed_share(deviation.peak_force)} in peak force, "
        f"{signed_share(deviation.contact_time)} in contact time and "
        f"{signed(deviation.restitution, 4)} in restitution; its force over time by "
        f"{share(deviation.history_l2, 2)} (root mean square)."
    )


def _estimated(estimate: Deviation) -> str:
    return (
        f"Estimated error of this level: {signed_share(estimate.peak_force)} in peak force, "
        f"{signed_share(estimate.contact_time)} in contact time and "
        f"{signed(estimate.restitution, 4)} in restitution."
    )


def _called(level: str) -> str:
    return {"full": "full-order", "interface": "interface-level"}.get(level, level)


_SHOWN = DEVIATION_MEASURES[:5]
ESTIMATE_COLUMNS = ("", *(measure.name for measure in _SHOWN))

GOOD, FAIR = 0.01, 0.05
"""Largest errors up to which a level counts as good, and as fair."""


def estimate_rows(study: ImpactStudy) -> tuple[tuple[str, ...], ...]:
    """A row per level: error and margin, and true deviation from the full order."""
    rows = []
    for name, estimate in study.estimates.items():
        cells = _numbers(estimate)
        if within := study.estimate_margins.get(name):
            margins = (text.removeprefix("+") for text in _numbers(within))
            cells = [f"{cell} ± {margin}" for cell, margin in zip(cells, margins, strict=True)]
        true = _true(study, name)
        if true is not None:
            pairs = zip(cells, _numbers(true), strict=True)
            cells = [f"{cell}\ntrue: {other}" for cell, other in pairs]
        label = study.levels[name].label if name in study.levels else name
        rows.append((label, *cells))
    return tuple(rows)


def estimate_sentence(study: ImpactStudy) -> str:
    """Whether the reduced level can be used here; empty without an estimate."""
    if not study.estimates:
        return ""
    steps = ""
    if "full" in study.estimates:
        steps = f"The steps of the full order shift it by {_off(study.estimates['full'])}."
    reduced = [name for name in study.estimates if name != "full"]
    if not reduced:
        return f"{steps} This follows from the {study.estimate_basis}."
    name = "reduced" if "reduced" in reduced else reduced[0]
    estimate, true = study.estimates[name], _true(study, name)
    text = (
        f"Compared with one run of the {study.estimate_basis}, at the same condition, the "
        f"'{name}' level deviates by {_off(estimate)}: {_verdict(study, name)}."
    )
    if true is not None:
        text += f" Compared with the full order, which was run too, it deviates by {_off(true)}."
    return f"{text} {steps}".rstrip()


def _true(study: ImpactStudy, name: str) -> Deviation | None:
    return study.deviations.get(name) if study.reference == "full" else None


def _numbers(deviation: Deviation) -> list[str]:
    return [measure.on_page(deviation) for measure in _SHOWN]


def _off(deviation: Deviation) -> str:
    peak, time, impulse, restitution, _ = _numbers(deviation)
    return (
        f"{peak} in peak force, {time} in contact time, {impulse} in impulse and {restitution} in "
        "restitution"
    )


def worst_error(study: ImpactStudy, level: str) -> float:
    """Largest error in peak force, contact time, impulse and restitution, at worst [-]."""
    known = (study.estimates[level], study.estimate_margins.get(level))
    parts = [
        [abs(getattr(one, key)) for one in known if one is not None]
        for key in ("peak_force", "contact_time", "impulse", "restitution")
    ]
    return max(sum(size for size in sizes if isfinite(size)) for sizes in parts)


def _verdict(study: ImpactStudy, level: str) -> str:
    if doubts := study.contact.doubts:
        return (
            "both share the same contact, which cannot be relied on, because "
            f"{' and '.join(doubts)}"
        )
    worst = worst_error(study, level)
    if worst <= GOOD:
        return "good enough to rely on"
    if worst <= FAIR:
        return "good enough for comparisons, not for the last per cent"
    return "too large an error; use the interface level for this condition"
