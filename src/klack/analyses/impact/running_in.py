r"""Impacts one after another on the same faces, until they do not yield any more.

Every impact starts like the first; the law remembers how far the faces were pressed, or every
contact point its set.  For a rigid body of energy E the limit is the force :math:`P_\infty` whose
elastic opening gives back all of it, :math:`W_e(P_\infty) = E` (shakedown), and what is missing
falls geometrically.
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.analyses.impact.interface_level import simulate_case
from klack.analyses.impact.record import RunningIn
from klack.assembling.reduced_pair import ReducedPair, simulate_bodies
from klack.case.any_case import CaseTree
from klack.case.case_text import parse
from klack.case.key_path import written_at
from klack.case.reader import read_case
from klack.case.rewriting import moved_files, with_values
from klack.case.schema import Case
from klack.contact.history import ImpactHistory
from klack.contact.plasticity.loops import YieldingLoops
from klack.contact.restitution import measure_impact
from klack.contact.yielding_law import YieldingLaw
from klack.errors import AccuracyWarning, InputError
from klack.input.problem import Key
from klack.transient.interface_arrays import Guide
from klack.transient.interface_model import InterfaceModel
from klack.units import format_si

__all__ = [
    "WORN",
    "asks_for_more",
    "points_running_in",
    "running_in",
    "worn_text",
]


_RUN_IN = 1e-4
"""Share of the energy [-] that a run-in contact may still lose."""

_MOST = 1000


def running_in(case: Case, pair: ReducedPair, loops: YieldingLoops) -> RunningIn | None:
    """Impacts on the same faces, as many as the case asks for; None where it asks for one.

    ``loops`` are behind the law of faces that yield of ``pair``; a warning tells where the faces
    are pressed further than they go.
    """
    law = pair.law
    if not isinstance(law, YieldingLaw) or not asks_for_more(case):
        return None

    def hit(count: int) -> _Impact | None:
        nonlocal law
        assert isinstance(law, YieldingLaw)
        try:
            history = simulate_bodies(case, pair.upper, pair.lower, law)
        except InputError:
            if not count or not loops.limit:
                raise
            warnings.warn(
                f"running in ends after {count} impacts: the next one presses harder than "
                f"{format_si(float(loops.force[-1]), 'N', 4)}, where the static loops end. "
                f"{loops.limit}",
                AccuracyWarning,
                stacklevel=2,
            )
            return None
        before = law.loss_after(law.reached)
        law = law.after(history.pressed)
        force = float(np.interp(law.reached, law.largest, law.closing))
        return _Impact(
            history=history,
            lost=law.loss_after(law.reached) - before,
            set=law.set_after(law.reached),
            land=2.0 * float(np.interp(force, loops.force, loops.half_width)),
        )

    columns, settled = _repeated(case, hit)
    worn_by = float(np.interp(law.reached, law.largest, law.closing))
    order = np.argsort(loops.radius)
    gap = loops.plastic_gap_after(worn_by)[order]
    return RunningIn(
        asked=case.run.impacts,
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


def points_running_in(case: Case, model: InterfaceModel, guide: Guide | None) -> RunningIn | None:
    """Impacts at the interface level on the same faces; None where the case asks for one.

    Every point keeps its own set, wherever the body lands; the model has a pressure limit.
    """
    if model.limit is None or not asks_for_more(case):
        return None
    facing = model.axial > 1e-6
    made = np.min(model.gap[facing] / model.axial[facing])
    worn = np.zeros(model.count)

    def hit(_: int) -> _Impact:
        nonlocal worn
        result = simulate_case(case, model, guide, worn=worn)
        worn = result.worn
        touch = np.min((model.gap + worn)[facing] / model.axial[facing])
        return _Impact(
            history=result.history,
            lost=result.energy.plastic,
            set=float(touch - made),
            land=float("nan"),
        )

    columns, settled = _repeated(case, hit)
    return RunningIn(
        asked=case.run.impacts,
        peak_force=columns[0],
        contact_time=columns[1],
        restitution=columns[2],
        lost=columns[3],
        set=columns[4],
        land=columns[5],
        run_in=settled,
        radius=np.empty(0),
        opening=np.empty(0),
        worn_by=float("nan"),
        level="interface",
    )


def asks_for_more(case: Case) -> bool:
    """Whether the case asks for more than one impact on the same faces."""
    return case.run.impacts > 1 or case.run.run_in


@dataclass(frozen=True, kw_only=True, eq=False)
class _Impact:
    history: ImpactHistory
    lost: float
    set: float
    land: float


def _repeated(case: Case, hit: Callable[[int], _Impact | None]) -> tuple[NDArray[np.float64], bool]:
    """Impacts as often as the case asks for: numbers in columns, and whether they are run in.

    ``hit`` is given how many there were, and returns None where they end.
    """
    rows: list[tuple[float, ...]] = []
    settled = False
    while len(rows) < (_MOST if case.run.run_in else case.run.impacts):
        found = hit(len(rows))
        if found is None:
            break
        measures = measure_impact(found.history)
        rows.append(
            (
                measures.peak_force,
                measures.contact_time,
                measures.restitution,
                found.lost,
                found.set,
                found.land,
            )
        )
        settled = found.lost < _RUN_IN * found.history.ledger.initial
        if measures.cut_off or (settled and len(rows) >= case.run.impacts):
            break
    return np.array(rows).T, settled


WORN = "worn.yaml"
"""File beside the result."""


def worn_text(text: str, source: Path, found: RunningIn, folder: Path, version: str) -> str:
    """Text of the case with ``contact.worn``, for a file in ``folder``; comments and order stay.

    ``text``, from ``source``, is that of the case whose impacts have worn the faces.  InputError
    where its layout does not allow it.
    """
    data, lines = parse(text, source)
    tree = CaseTree(path=source, text=text, data=data, lines=lines)
    radius = ", ".join(f"{1e6 * r:.4f} um" for r in found.radius)
    opening = ", ".join(f"{1e9 * w:.4f} nm" for w in found.opening)
    values: dict[Key, str] = {
        ("contact", "worn"): f"{{force: {found.worn_by:.5g} N, "
        f"radius: [{radius}], opening: [{opening}]}}",
    }
    for key, once in ((("run", "impacts"), "1"), (("run", "run_in"), "false")):
        if written_at(data, key) is not None:
            values[key] = once
    state = "run in" if found.run_in else "not yet run in"
    header = (
        f"klack {version}, klack impact: faces of {source.name} after {len(found.peak_force)} "
        f"impacts, {state}.\nTheir set at the {len(found.radius)} contact points of that mesh "
        f"is in contact.worn; they are elastic up to {found.worn_by:.4g} N."
    )
    read_case(with_values(tree, values, header), source)
    return with_values(tree, {**moved_files(tree, folder), **values}, header)
