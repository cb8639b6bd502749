r"""Impacts one after another on the same faces, until they do not yield any more.

Every impact starts like the first; the law remembers how far the faces were pressed.  For a rigid
body of energy E the limit is the force :math:`P_\infty` whose elastic opening gives back all of it,
:math:`W_e(P_\infty) = E` (shakedown), and what is missing falls geometrically.
"""

import warnings
from collections.abc import Callable, Sequence

import numpy as np

from klack.analyses.impact.record import RunningIn
from klack.assembling.reduced_pair import ReducedPair, simulate_bodies
from klack.case.schema import Case
from klack.contact.restitution import measure_impact
from klack.contact.yielding_law import YieldingLaw
from klack.errors import AccuracyWarning, InputError
from klack.plasticity.loops import YieldingLoops
from klack.units import format_si

__all__ = ["running_in", "running_in_columns", "running_in_rows"]

_RUN_IN = 1e-4
"""Share of the energy [-] that a run-in contact may still lose in yield."""

_MOST = 1000


def running_in(case: Case, pair: ReducedPair, loops: YieldingLoops) -> RunningIn | None:
    """Impacts on the same faces, as many as the case asks for; None where it asks for one.

    Parameters
    ----------
    case : Case
        ``run.impacts``, and with ``run.run_in`` as many more as it takes.
    pair : ReducedPair
        With a law of faces that yield.
    loops : YieldingLoops
        Behind that law.

    Warns
    -----
    AccuracyWarning
        Where the faces are pressed further than the loops go.
    """
    law = pair.law
    asked = case.run.impacts
    if not isinstance(law, YieldingLaw) or (asked == 1 and not case.run.run_in):
        return None
    rows: list[tuple[float, ...]] = []
    settled = False
    while len(rows) < (_MOST if case.run.run_in else asked):
        try:
            history = simulate_bodies(case, pair.upper, pair.lower, law)
        except InputError:
            if not rows or not loops.limit:
                raise
            warnings.warn(
                f"running in ends after {len(rows)} impacts: the next one presses harder than "
                f"{format_si(float(loops.force[-1]), 'N', 4)}, where the static loops end. "
                f"{loops.limit}",
                AccuracyWarning,
                stacklevel=2,
            )
            break
        measures, before = measure_impact(history), law.loss_after(law.reached)
        law = law.after(history.pressed)
        lost = law.loss_after(law.reached) - before
        force = float(np.interp(law.reached, law.largest, law.closing))
        width = 2.0 * float(np.interp(force, loops.force, loops.half_width))
        rows.append(
            (
                measures.peak_force,
                measures.contact_time,
                measures.restitution,
                lost,
                law.set_after(law.reached),
                width,
            )
        )
        settled = lost < _RUN_IN * history.ledger.initial
        if measures.cut_off or (settled and len(rows) >= asked):
            break
    columns = np.array(rows).T
    worn_by = float(np.interp(law.reached, law.largest, law.closing))
    order = np.argsort(loops.radius)
    gap = loops.plastic_gap_after(worn_by)[order]
    return RunningIn(
        asked=asked,
        peak_force=columns[0],
        contact_time=columns[1],
        restitution=columns[2],
        lost=columns[3],
        set=columns[4],
        land=columns[5],
        run_in=settled,
        radius=loops.radius[order],
        opening=gap - gap.min(),
        worn_by=worn_by,
    )


def running_in_columns(found: RunningIn) -> tuple[str, ...]:
    """Heads of the impacts side by side: the first, the last asked for, the last of all."""
    return ("", *(_name(found, i) for i in _shown(found)))


def running_in_rows(
    found: RunningIn, told: Callable[[float, str, int], str]
) -> tuple[tuple[str, ...], ...]:
    """Their numbers, one quantity each row; ``told`` writes a value, its unit and its digits."""
    shown = _shown(found)

    def row(title: str, values: np.ndarray, unit: str, digits: int) -> tuple[str, ...]:
        return (title, *(told(float(values[i]), unit, digits) for i in shown))

    return (
        row("peak force", found.peak_force, "N", 5),
        row("contact time", found.contact_time, "s", 4),
        ("restitution", *(f"{found.restitution[i]:.4f}" for i in shown)),
        row("lost in yield", found.lost, "J", 3),
        row("set after it", found.set, "m", 3),
        row("width of the land", found.land, "m", 3),
    )


def _shown(found: RunningIn) -> Sequence[int]:
    last = len(found.peak_force) - 1
    return sorted({0, min(found.asked - 1, last), last})


def _name(found: RunningIn, place: int) -> str:
    name = f"impact {place + 1}"
    is_last = place == len(found.peak_force) - 1
    return f"{name}, run in" if is_last and found.run_in else name
