"""Kept modes of each body as settings."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from math import ceil
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.comparison import compare_histories, impact_third_octaves
from klack.acoustics.third_octave import ThirdOctaves, band_edges
from klack.analyses.advice.ladder import Ladder, Measure
from klack.analyses.advice.settings import Setting, SettingValue
from klack.analyses.impact.interface_level import build_interface, simulate_case
from klack.assembling.modes import mode_pools
from klack.assembling.problem import ContactProblem
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.reduction.ports import Port
from klack.case.bodies import ModeChoice
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.contact.history import ImpactHistory
from klack.errors import InputError
from klack.machine.progress import Progress
from klack.units import format_si

__all__ = [
    "HISTORY",
    "counted",
    "expected_count",
    "explicit_modes",
    "highest_band",
    "history_ladder",
    "impact_errors",
    "impact_measures",
    "interface_history",
    "judged_up_to",
    "mode_ladder",
    "mode_setting",
    "modes_in_band",
    "richer_pools",
]


HISTORY = 2
"""Place of the force history, on which orders are measured."""

_RANGE = 40.0  # [dB] below the highest band


def impact_measures(error: float, level: float) -> tuple[Measure, ...]:
    """Measures of one impact, with accepted errors.

    ``error`` [-] holds for peak force, contact time and force history (rms, over the peak force),
    ``level`` [dB] for every third octave of the target band.
    """
    return (
        Measure(name="peak force", limit=error),
        Measure(name="contact time", limit=error),
        Measure(name="force history", limit=error),
        Measure(name="third octaves", limit=level, decibel=True),
        Measure(name="impulse"),
        Measure(name="restitution"),
    )


def highest_band(history: ImpactHistory) -> float:
    """Middle frequency [Hz] of the highest third octave within 40 dB of the strongest."""
    bands = impact_third_octaves(history)
    return float(bands.middle[_judged(bands)][-1])


def judged_up_to(history: ImpactHistory, up_to: float) -> float:
    """Middle frequency [Hz] of the highest band that is judged in a target band.

    InputError for a target band below the first third octave of the force.
    """
    bands = impact_third_octaves(history)
    judged = bands.middle[_judged(bands) & (bands.low < up_to)]
    if not judged.size:
        raise InputError(
            "--up-to",
            got=format_si(up_to, "Hz"),
            expected=f"{format_si(float(bands.low[0]), 'Hz', 2)} or more",
            hint="give the highest frequency that matters, e.g. 20 kHz.",
        )
    return float(judged[-1])


def _judged(bands: ThirdOctaves) -> NDArray[np.bool_]:
    return np.asarray(bands.level >= bands.level.max() - _RANGE)


def impact_errors(
    reference: ImpactHistory, candidate: ImpactHistory, up_to: float
) -> NDArray[np.float64]:
    """Absolute deviations in the order of :func:`impact_measures`, shape (6,).

    Third octaves are compared that begin below ``up_to`` [Hz], as far as those of the reference
    lie within 40 dB of its strongest.
    """
    whole = compare_histories(reference, candidate)
    high = 0.1 / max(reference.step, candidate.step)
    bands = [impact_third_octaves(item, high=high) for item in (reference, candidate)]
    chosen = _judged(bands[0]) & (bands[0].low < up_to)
    difference = np.abs(bands[1].level - bands[0].level)[chosen]
    found: Sequence[float] = (
        whole.peak_force,
        whole.contact_time,
        whole.history_l2,
        float(difference.max(initial=0.0)),
        whole.impulse,
        whole.restitution,
    )
    return np.abs(np.nan_to_num(np.array(found)))


AnyCase = TypeVar("AnyCase", Case, ValveCase)

_ORDER = 2.0
_MEASURED = (4.0, 2.0, 1.0, 0.5)
_FEWEST = 2


def explicit_modes(case: AnyCase) -> AnyCase:
    """Case with the choice of modes written out for every body."""
    choices = {name: case.reduction.choice(name) for name in case.bodies}
    return _with_choices(case, choices)


def _with_choices(case: AnyCase, choices: Mapping[str, ModeChoice]) -> AnyCase:
    modes = {**case.reduction.modes, **choices}
    reduction = case.reduction.model_copy(update={"modes": modes})
    return case.model_copy(update={"reduction": reduction})


def counted(choice: ModeChoice, pool: Modes) -> int:
    """Elastic modes that a choice keeps of a pool."""
    if choice.frequency is not None:
        return int(np.sum(pool.omega <= 2.0 * np.pi * choice.frequency))
    return min(choice.count or choice.participation or 1, len(pool.omega))


def expected_count(choice: ModeChoice, pool: Modes) -> int:
    """Modes kept of a larger pool, with evenly spaced frequencies above."""
    asked = choice.count or choice.participation
    if asked is not None:
        return asked
    share = (choice.frequency or 0.0) / float(pool.frequency[-1])
    return ceil(share * len(pool.omega)) if share > 1.0 else counted(choice, pool)


def _choice(choice: ModeChoice, count: int) -> ModeChoice:
    if choice.participation is not None:
        return ModeChoice(participation=count, pool=max(choice.pool or count, count))
    return ModeChoice(count=count)


def richer_pools(
    problem: ContactProblem, counts: Mapping[str, int], progress: Progress
) -> Mapping[str, Modes]:
    """Modes of each body, as many as are counted."""
    choices = {
        name: _choice(problem.case.reduction.choice(name), count) for name, count in counts.items()
    }
    richer = replace(problem, case=_with_choices(problem.case, choices))
    return mode_pools(richer, at_least=1, progress=progress)


def interface_history(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    ports: tuple[Port, Port],
    counts: Mapping[str, int],
    *,
    step: float,
) -> ImpactHistory:
    """Impact at the interface level with so many modes of each body, if the pool has them."""
    choices = {
        name: _choice(problem.case.reduction.choice(name), min(count, len(pools[name].omega)))
        for name, count in counts.items()
    }
    case = _with_choices(problem.case, choices)
    model = build_interface(replace(problem, case=case), pools, ports=ports)
    return simulate_case(case, model, step=step).history


def mode_setting(
    body: str, choice: ModeChoice, count: int, frequencies: NDArray[np.float64]
) -> Setting:
    """Modes of a body as the case chooses ``count`` of them.

    ``frequencies`` (k,) [Hz] of all known elastic modes ascend.
    """
    key = ("reduction", "modes", body)
    kind = "participation" if choice.participation is not None else "count"
    value = SettingValue(key=(*key, kind), value=float(count), kind="count", least=1.0)
    if choice.frequency is not None:
        value = SettingValue(
            key=(*key, "frequency"),
            value=choice.frequency,
            unit="Hz",
            kind="frequency",
            table=tuple(frequencies.tolist()),
        )
    return Setting(name=f"modes of {body}", group="modes", values=(value,))


def mode_ladder(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    ports: tuple[Port, Port],
    counts: Mapping[str, int],
    body: str,
    *,
    reference: ImpactHistory,
    step: float,
    up_to: float,
) -> Ladder | None:
    """A quarter, half, all and twice the modes of one body, the other bodies with twice theirs.

    At the interface level, where leaving out modes is the only change: their compliance goes to the
    contact points.  None where the pool holds no more modes.  ``counts`` are kept, ``pools`` twice
    as many; ``reference`` has twice the modes of every body.
    """
    most = {name: 2 * count for name, count in counts.items()}
    if len(pools[body].omega) < most[body]:
        return None
    factors = [f for f in _MEASURED if f <= 1.0 or counts[body] >= _FEWEST * f]
    runs = [
        interface_history(problem, pools, ports, {**most, body: round(counts[body] / f)}, step=step)
        for f in factors[:-1]
    ]
    return history_ladder(factors, [*runs, reference], up_to, _ORDER)


def history_ladder(
    factors: list[float], runs: list[ImpactHistory], up_to: float, order: float
) -> Ladder:
    """Histories compared with the finest, and neighbours with each other."""
    return Ladder(
        factors=tuple(factors),
        differences=np.array([impact_errors(runs[-1], run, up_to) for run in runs[:-1]]),
        steps=np.array(
            [impact_errors(finer, run, up_to)[HISTORY] for run, finer in pairwise(runs)]
        ),
        assumed_order=order,
    )


def modes_in_band(pool: Modes, up_to: float) -> int:
    """Modes of a pool below the upper edge of the highest band that begins below ``up_to``."""
    number = np.floor(10.0 * np.log10(up_to / 1000.0) + 0.5).astype(np.int64)
    edge = float(band_edges(np.array([number]))[1][0])
    return int(np.sum(pool.omega <= 2.0 * np.pi * edge))
