"""How much shots depend on their time step: against runs in steps twice as long.

The error of the peak force is of second order in the step, at worst of first order: the difference
of the two runs is three times the error of the shorter steps, or as large as it.  It is no bound:
an error that depends on where a step happens to lie may differ less.  The centred shot and the
first one are compared, and at last the one that chatters most, in their first impact; later
bounces magnify any difference.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import inf, isnan, nan

import numpy as np
from numpy.typing import NDArray

from klack.analyses.shots.draw import ShotDraw
from klack.analyses.shots.one_shot import ShotOutcome, ShotSetup, run_shot
from klack.analyses.stroke.step_check import SHARE
from klack.analyses.workers import Failure, answer, unwrapped
from klack.machine.progress import Progress
from klack.units import format_si

__all__ = ["CheckedStep", "in_checked_steps", "step_doubt"]

PROMISED = {"peak_force": 1e-3, "contact_time": 5e-3, "restitution": 5e-3}
"""Errors of a first impact: relative ones, and of the restitution itself."""

_MOST_HALVINGS = 4


@dataclass(frozen=True, kw_only=True, eq=False)
class CheckedStep:
    """Setup in steps that are short enough, and the compared shots in them.

    ``change`` is the largest one over what is promised; inf where shots in longer steps fail.
    """

    setup: ShotSetup
    outcomes: tuple[ShotOutcome, ...]
    halvings: int = 0
    change: float = nan
    doubt: str = ""


def in_checked_steps(
    setup: ShotSetup, draws: Sequence[ShotDraw], progress: Progress
) -> CheckedStep:
    """Halve the step until shots on new faces do not depend on it.

    Where only contact times and restitutions do, it is halved as long as their changes fall: those
    of an impact that chatters need not converge.
    """
    progress("check step", 0.0)
    longer: Sequence[ShotOutcome | Failure] = [
        answer(partial(run_shot, replace(setup, step=2.0 * setup.step), draw)) for draw in draws
    ]
    halvings, before = 0, inf
    while True:
        run = tuple(
            unwrapped(_name(draw), answer(partial(run_shot, setup, draw))) for draw in draws
        )
        changes = [_changes(*pair) for pair in zip(run, longer, strict=True)]
        largest = max(map(_largest, changes))
        peak = max(abs(change["peak_force"]) for change in changes) / PROMISED["peak_force"]
        is_enough = largest <= SHARE or (halvings and peak <= SHARE and largest >= before)
        if is_enough or halvings == _MOST_HALVINGS:
            return CheckedStep(
                setup=setup,
                outcomes=run,
                halvings=halvings,
                change=largest,
                doubt=_doubt(setup.step, draws, changes),
            )
        setup, longer, before = replace(setup, step=0.5 * setup.step), run, largest
        halvings += 1


def step_doubt(
    setup: ShotSetup, draw: ShotDraw, run: ShotOutcome, worn: NDArray[np.float64] | None
) -> str:
    """Doubt about one shot that was computed, on faces with this set; empty without."""
    longer = answer(partial(run_shot, replace(setup, step=2.0 * setup.step), draw, worn))
    return _doubt(setup.step, [draw], [_changes(run, longer)])


def _name(draw: ShotDraw) -> str:
    return "the centred shot" if draw.index < 0 else f"shot {draw.index}"


def _changes(run: ShotOutcome, longer: ShotOutcome | Failure) -> dict[str, float]:
    """Changes in longer steps, inf without a pair."""
    if isinstance(longer, Failure):
        return dict.fromkeys(PROMISED, inf)
    found = {}
    for key in PROMISED:
        one, two = run.numbers[key], longer.numbers[key]
        change = two - one if key == "restitution" else two / one - 1.0
        found[key] = 0.0 if isnan(one) and isnan(two) else inf if isnan(change) else change
    return found


def _largest(changes: Mapping[str, float]) -> float:
    """Over what is promised."""
    return max(abs(change) / PROMISED[key] for key, change in changes.items())


def _words(changes: Mapping[str, float]) -> str:
    if inf in changes.values():
        return "cannot be compared"
    peak, time, restitution = changes.values()
    return (
        f"changes by {100.0 * peak:+.3g} % of its peak force, {100.0 * time:+.3g} % of its "
        f"contact time and {restitution:+.2g} in restitution"
    )


def _doubt(step: float, draws: Sequence[ShotDraw], changes: Sequence[Mapping[str, float]]) -> str:
    doubts = [
        f"{_name(draw)} {_words(change)}"
        for draw, change in zip(draws, changes, strict=True)
        if _largest(change) > SHARE
    ]
    if not doubts:
        return ""
    peak, time, restitution = (SHARE * promise for promise in PROMISED.values())
    return (
        f"with a time step of {format_si(2.0 * step, 's')} instead of {format_si(step, 's')} "
        f"{'; '.join(doubts)}. A step is short enough if these changes are below "
        f"{100.0 * peak:g} %, {100.0 * time:g} % and {restitution:g}. Try: a shorter shots.step."
    )
