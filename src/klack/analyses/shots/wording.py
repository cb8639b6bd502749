"""Words for reports of many shots and of many strokes."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from klack.analyses.shots.record import FIRST_IMPACT, ShotsStudy
from klack.report.page import Section, Table
from klack.report.wording import count, quantity, signed_share

if TYPE_CHECKING:
    from klack.analyses.stroke_shots.record import StrokeShotsStudy

__all__ = [
    "degrees",
    "drawn_section",
    "largest_size",
    "length_unit",
    "plain",
    "shot_name",
    "shots_answer",
]

_SMALL = 1e-4
"""Lengths up to this are shown in micrometres [m]."""


def shots_answer(study: ShotsStudy) -> str:
    """Whether the rule holds, and the spread of the shots."""
    shots = study.shots
    spread = [
        f"{measure.name} {measure.printed(float(np.nanmin(values)))} to "
        f"{measure.printed(float(np.nanmax(values)))}"
        for measure in FIRST_IMPACT
        if measure.key in ("restitution", "peak_force", "contact_time")
        and np.isfinite(values := getattr(shots, measure.key)).any()
    ]
    best, rule = study.highest, study.rule
    verdict = f"{'right' if rule.holds else 'wrong'} for this valve, judged by 1 % of restitution"
    return (
        f"Of {shots.count} shots, {shot_name(best)} rebounds highest, "
        f"{quantity(float(shots.rebound_height[best]), 'm', 3)} with a restitution of "
        f"{float(shots.restitution[best]):.4f}; the centred impact has "
        f"{quantity(float(study.centric.rebound_height[0]), 'm', 3)} and "
        f"{float(study.centric.restitution[0]):.4f}. Taking the highest rebound of {shots.count} "
        f"for the centred one is {verdict}: the restitution is wrong by "
        f"{signed_share(rule.relative_restitution_bias)}, the rebound height by "
        f"{signed_share(rule.relative_rebound_height_bias, 1)}. The shots spread over: "
        f"{', '.join(spread)}. Eccentricities reach "
        f"{quantity(largest_size(shots.eccentricity), 'm', 3)}, tilts "
        f"{np.degrees(largest_size(shots.tilt)):.3g}°."
    )


def shot_name(index: int) -> str:
    """Name of a shot; counted from 0, as in the result."""
    return f"shot {index}"


def largest_size(values: ArrayLike) -> float:
    """Largest magnitude of what is a number; 0 without any."""
    found = np.abs(np.asarray(values, dtype=float))
    return float(np.max(found, initial=0.0, where=np.isfinite(found)))


def length_unit(values: ArrayLike) -> tuple[str, float]:
    """Unit in which lengths [m] are easy to read, and the factor to it.

    >>> length_unit([2e-5]), length_unit([4.6e-3])
    (('µm', 1000000.0), ('mm', 1000.0))
    """
    return ("µm", 1e6) if largest_size(values) <= _SMALL else ("mm", 1e3)


def plain(value: float, decimals: int) -> str:
    """Number with fixed decimals; a dash without one."""
    if not np.isfinite(value):
        return "–"
    return f"{value:.{decimals}f}".replace("-", "\N{MINUS SIGN}")


def degrees(angle: float) -> str:
    """Whole degrees, 0 to 359, of an angle [rad]; a dash without one."""
    return f"{round(np.degrees(angle)) % 360}" if np.isfinite(angle) else "–"


def drawn_section(
    study: "ShotsStudy | StrokeShotsStudy",
    facts: Iterable[tuple[str, str]],
    runs: str,
    spent: float,
) -> Section:
    """What varies from run to run, and the facts that all of them share.

    ``runs`` is what they are called, ``"shots"``; ``spent`` [s] the wall time of the runs alone.
    """
    processes = f"{study.workers} process{'es' if study.workers != 1 else ''}"
    shared = [
        ("seed", str(study.seed)),
        *facts,
        (f"computing time of the {runs}", f"{quantity(spent, 's', 3)} on {processes}"),
    ]
    if study.resumed:
        shared.append(("resumed from an interrupted run", f"{count(study.resumed)} {runs}"))
    return Section(
        title="Distributions",
        tables=(
            Table(columns=("what varies", "drawn from"), rows=tuple(study.distributions.items())),
            Table(columns=(f"shared by all {runs}", ""), rows=tuple(shared)),
        ),
    )
