"""Checks of the strokes of klack shots: what they need, and what contradicts them."""

from klack.case.valve_sections import ValveSections
from klack.errors import refuse
from klack.input.problem import CaseProblem

__all__ = ["check_shots_of_valve"]


def check_shots_of_valve(case: ValveSections) -> None:
    """Raise :class:`CaseProblem` for shots that this valve cannot have."""
    shots = case.shots
    if shots is None:
        return
    given, other = "eccentricity", "tilt"
    if shots.eccentricity is None:
        given, other = other, given
    placed = case.placement is not None
    refuse(
        (
            case.motion == "axial",
            CaseProblem(
                ("shots",),
                got="shots of a needle that moves along its axis",
                expected="motion: three-dimensional, and a guide: along the axis all strokes are "
                "alike",
                hint="add 'motion: three-dimensional' and 'guide', or remove this section.",
                on_key=True,
            ),
        ),
        (
            case.guide is None,
            CaseProblem(
                ("shots",),
                got="shots without a guide",
                expected="a section 'guide', whose clearance bounds the position of the needle",
                hint="add 'guide: {surface: ..., heights: [..., ...], clearance: ...}'.",
                on_key=True,
            ),
        ),
        (
            (shots.eccentricity is None) != (shots.tilt is None),
            CaseProblem(
                ("shots", given),
                got=f"{given} without {other}, and a guide",
                expected="both of them, or none: the guide then limits the placement",
                hint=f"add '{other}' (0 is possible), or remove '{given}'.",
                on_key=True,
            ),
        ),
        (
            placed and not shots.carry,
            CaseProblem(
                ("placement",),
                got="a placement beside shots, each of which has one of its own",
                expected="one of them",
                hint="remove 'placement': shots draw it from shots.seed. With shots.carry: true "
                "the first stroke starts from it.",
                on_key=True,
            ),
        ),
        (
            placed and shots.draws_position,
            CaseProblem(
                ("shots", "eccentricity"),
                got="a drawn position beside a placement",
                expected="one of them: the first stroke starts from it",
                hint="remove 'placement', or shots.eccentricity and shots.tilt.",
                on_key=True,
            ),
        ),
    )
