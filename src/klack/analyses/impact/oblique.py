"""Impacts of a body that starts sideways or with a spin: its motion afterwards, and doubts."""

import warnings
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from klack.analyses.impact.record import LevelResult, ObliqueMotion
from klack.assembling.problem import ContactProblem
from klack.contact.statics import ring_radius
from klack.errors import AccuracyWarning
from klack.units import format_si

__all__ = ["oblique_doubts", "with_oblique"]


def with_oblique(
    problem: ContactProblem, level: LevelResult, after: NDArray[np.float64]
) -> LevelResult:
    """The level with the rigid motion of a body that starts across the axis, and its energy apart.

    Parameters
    ----------
    after (6,) [m/s], [rad/s]
        Motion after the impact.
    """
    motion, history, body = problem.case.motion, level.history, problem.pair.upper
    if motion.is_straight:
        return level
    before, spin = motion.across, after[3:]
    oblique = ObliqueMotion(
        velocity_before=before[:3] - [0.0, 0.0, motion.speed],
        velocity_after=after[:3],
        spin_before=before[3:],
        spin_after=spin,
        mass=history.mass_a,
        mass_ratio=history.mass_a / history.mass_b,
        impulse=level.measures.impulse,
    )
    rigid = 0.5 * float(body.mass * after[:2] @ after[:2] + spin @ body.inertia @ spin)
    own = f"{body.name} vibration"
    energies = {}
    for name, energy in level.energies.items():
        if name == own:
            energies[f"{body.name} sideways and spin"] = rigid
        energies[name] = energy - rigid * (name == own)
    # how a free lower body turns is not known apart from its vibration
    left = sum(energy for name, energy in energies.items() if name.endswith(" vibration"))
    share = left / (0.5 * body.mass * level.measures.approach_speed**2)
    measures = replace(
        level.measures, vibration_share=share if np.isinf(history.mass_b) else float("nan")
    )
    return replace(level, oblique=oblique, energies=energies, measures=measures)


_LARGEST_TURN = np.radians(5.0)
_TILTED, _OTHER_RESTITUTION = 0.02, 0.01  # of the impulse ratio, of the restitution
_SMOOTH = 0.01  # impulse ratio below which that of friction is none
_CARRIED = 0.02  # share of the moment of friction that contact points take with them
_NO_FRICTION = (
    "the faces have no friction: motion.sideways_speed and motion.spin have no effect on a face "
    "perpendicular to the axis, and act only through the slope of other faces. Try: "
    "contact.friction."
)


def oblique_doubts(problem: ContactProblem, level: LevelResult) -> Iterator[str]:
    """Doubts about a body that moves across the axis while it touches."""
    motion, measures = level.oblique, level.measures
    if motion is None or measures.cut_off:
        return
    if problem.case.contact.faces.is_none:
        warnings.warn(_NO_FRICTION, AccuracyWarning, stacklevel=2)
    time = measures.total_contact_time
    spin = 0.5 * (motion.spin_before + motion.spin_after)
    yield from _slide_doubts(problem, level, motion)
    angle = float(np.linalg.norm(spin)) * time
    if angle > _LARGEST_TURN:
        yield (
            f"the body turns by {np.degrees(angle):.2g} degrees during contact, and only small "
            f"rotations are accurate, up to {np.degrees(_LARGEST_TURN):.0f} degrees. Try: less "
            "motion.spin."
        )
    carried = 0.5 * float(np.hypot(*spin[:2])) * time / max(motion.impulse_ratio, 1e-12)
    if level.level == "full" and motion.impulse_ratio > 0.0 and carried > _CARRIED:
        yield (
            "contact points of the full order rotate with the body, which reduces its spin by "
            f"about {100 * carried:.1f} %. Try: level interface, whose contact stays below the "
            "centre."
        )


def _slide_doubts(
    problem: ContactProblem, level: LevelResult, motion: ObliqueMotion
) -> Iterator[str]:
    """Doubts about a body whose contact slides over a lower face, with the normals kept.

    A body that moves by *s* past a lower face of radius R takes the normals of the lower points
    with it, to the wrong side: the force is tilted wrongly by s/(2 R) on the mean.
    """
    measures, static = level.measures, problem.static
    lost = motion.velocity_after[:2] - motion.velocity_before[:2]
    slid = motion.velocity_before[:2] + 0.5 * (1.0 + motion.mass_ratio) * lost
    speed = float(np.hypot(*slid))
    way, force = speed * measures.total_contact_time, min(measures.peak_force, static.max_force)
    space, pattern = static.space, static.pattern_at(force)
    if space.dimension == 2 or ring_radius(space, pattern) is not None:
        width = static.half_width_at(force)
        if way > width:
            yield (
                f"the body moves {format_si(way, 'm', 3)} sideways during contact, more than the "
                f"half width of its contact ring, {format_si(width, 'm', 3)}, while the faces "
                "keep their normals of first touch. Try: less motion.sideways_speed."
            )
        return
    if speed == 0.0:
        return
    moved = np.zeros(space.G_a.shape[1])
    moved[0::3], moved[1::3] = slid / speed
    place = space.points[:, :2] @ slid / speed
    curvature = abs(float(np.polyfit(place, space.G_a @ moved, 1, w=np.sqrt(pattern))[0]))
    tilt = 0.5 * way * curvature
    other = 2.0 * tilt * speed / measures.approach_speed
    if tilt > _TILTED * max(motion.impulse_ratio, _SMOOTH) or other > _OTHER_RESTITUTION:
        yield (
            f"the body moves {format_si(way, 'm', 3)} sideways over a curved lower face during "
            "contact, while the faces keep their normals of first touch: the impulse across the "
            f"axis is wrong by about {tilt:.2g} of the impulse along it, the restitution by "
            f"{other:.2g}. Try: less motion.sideways_speed, or a flat lower face."
        )
