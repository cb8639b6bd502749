"""A stored impact beside that of another program: the numbers of both, and how far apart."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any, Literal, cast

from typing_extensions import TypedDict

from klack.acoustics.comparison import compare_histories
from klack.analyses.impact.measures import DEVIATION_MEASURES, LEVEL_MEASURES
from klack.analyses.impact.record import ImpactStudy, LevelResult
from klack.analyses.impact.summary import DeviationJson
from klack.analyses.json_parts import Real
from klack.analyses.measures import (
    Column,
    Measure,
    cells,
    heads,
    json_of,
    with_measures,
)
from klack.contact.history import EnergyLedger, ImpactHistory
from klack.contact.restitution import Deviation, ImpactMeasures, measure_impact
from klack.errors import InputError
from klack.terminal.tables import TextTable

__all__ = [
    "COMPARISON_COLUMNS",
    "PROGRAM_MEASURES",
    "CalculixJson",
    "Comparison",
    "OtherRun",
    "compare_with",
    "comparison_rows",
    "comparison_to_json",
    "comparison_told",
    "level_of",
    "with_other",
]


@dataclass(frozen=True, kw_only=True, eq=False)
class OtherRun:
    """One impact that another program computed.

    Parameters
    ----------
    program : str
        Its name, as a table says it.
    history : ImpactHistory
    energy_swing : float or None [-]
        Largest distance of the total energy from that at the start, over that at the start.
    steps : int
    iterations : int or None
        Of all steps together.
    wall_time : float or None [s]
    """

    program: str
    history: ImpactHistory
    energy_swing: float | None
    steps: int
    iterations: int | None = None
    wall_time: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """A level of klack beside another program.

    Parameters
    ----------
    case, title : str
    level : LevelResult
    other : OtherRun
    measures : ImpactMeasures
        Of the other program.
    deviation : Deviation
        Of klack from the other program.
    """

    case: str
    title: str
    level: LevelResult
    other: OtherRun
    measures: ImpactMeasures
    deviation: Deviation

    @property
    def runs(self) -> tuple[LevelResult, LevelResult]:
        """The other program, as if it were a level of klack, and klack."""
        other, history = self.other, self.other.history
        guest = LevelResult(
            level=other.program.lower(),
            label=other.program,
            history=history,
            measures=self.measures,
            degrees_of_freedom=self.level.degrees_of_freedom,
            steps=other.steps,
            step=history.step,
            wall_time=float("nan") if other.wall_time is None else other.wall_time,
            setup_time=0.0,
            energies=history.ledger.parts(),
            energy_residual=history.ledger.residual,
        )
        label = f"klack, {self.level.level}"
        return guest, replace(self.level, label=label, wall_time=self.wall_time)

    @property
    def wall_time(self) -> float:
        """Set-up and time integration of klack [s]."""
        return self.level.setup_time + self.level.wall_time

    @property
    def wall_time_ratio(self) -> float | None:
        """Wall-clock time of the other program over that of klack [-]."""
        other = self.other.wall_time
        return None if other is None or self.wall_time == 0.0 else other / self.wall_time


_OF_LEVELS = {measure.key: measure for measure in LEVEL_MEASURES}
PROGRAM_MEASURES: tuple[Measure[LevelResult], ...] = (
    replace(_OF_LEVELS["peak_force"], column=Column("N", 1.0, ".3f")),
    *(_OF_LEVELS[key] for key in ("contact_time", "impulse", "restitution")),
    Measure(
        key="energy_balance",
        symbol="r_E",
        definition="Energy gained (negative: lost) by the numerics of a run without damping, over "
        "the energy turned over; friction of the faces is no loss of the numerics.",
        source="theory/calculix",
        read=lambda run: energy_balance(run.history.ledger),
        form="power",
        column=Column("", 1.0, "+.1e"),
        absent="",
    ),
    replace(_OF_LEVELS["steps"], column=Column("", 1.0, "d")),
    _OF_LEVELS["step"],
    replace(_OF_LEVELS["wall_time"], absent=""),
)
"""Of an impact as one program computed it; the wall time of klack has its set-up in it."""

COMPARISON_COLUMNS = ("", *heads(PROGRAM_MEASURES))


@with_measures(PROGRAM_MEASURES)
class ProgramJson(TypedDict):
    """Impact as one program computed it."""


class OtherProgramJson(ProgramJson):
    """Impact as the other program computed it."""

    iterations: int | None
    energy_swing: Real


class CalculixJson(TypedDict):
    """``klack compare --calculix``."""

    schema: Literal["klack-compare-calculix/1"]
    case: str
    level: str
    program: str
    klack: ProgramJson
    other: OtherProgramJson
    deviation: DeviationJson
    wall_time_ratio: Real


def level_of(study: ImpactStudy, name: str) -> LevelResult:
    """Level of a study by name.

    Raises
    ------
    InputError
        If the study does not hold it.
    """
    if name not in study.levels:
        raise InputError(
            f"result of case '{study.case}'",
            got=f"no level '{name}'{study.why_missing(name)}",
            expected=f"one of: {', '.join(study.levels)}",
            hint=f"run `klack impact {study.case} --level {name}`, or choose with --level.",
        )
    return study.levels[name]


def compare_with(study: ImpactStudy, level: str, other: OtherRun) -> Comparison:
    """Lay one level of a study over the impact of another program, which is the reference.

    Raises
    ------
    InputError
        If the study has no such level, or the other run no contact.
    """
    chosen = level_of(study, level)
    return Comparison(
        case=study.case,
        title=study.title,
        level=chosen,
        other=other,
        measures=measure_impact(other.history),
        deviation=compare_histories(other.history, chosen.history),
    )


def with_other(study: ImpactStudy, comparison: Comparison) -> ImpactStudy:
    """Study that holds the compared level and the other program as one more level, for charts."""
    guest, _ = comparison.runs
    return replace(
        study,
        levels={guest.level: guest, comparison.level.level: comparison.level},
        reference=guest.level,
        deviations={comparison.level.level: comparison.deviation},
    )


def comparison_rows(comparison: Comparison) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`COMPARISON_COLUMNS`: the other program, klack, the deviation."""
    deviation, ratio = comparison.deviation, comparison.wall_time_ratio
    return (
        *((run.label, *cells(PROGRAM_MEASURES, run)) for run in comparison.runs),
        (
            "klack from it",
            f"{100 * deviation.peak_force:+.2f} %",
            f"{100 * deviation.contact_time:+.2f} %",
            f"{100 * deviation.impulse:+.3f} %",
            f"{deviation.restitution:+.4f}" if isfinite(deviation.restitution) else "–",
            "",
            "",
            "" if ratio is None else f"1/{ratio:.3g}",
        ),
    )


def comparison_told(comparison: Comparison) -> Iterator[TextTable | str]:
    """What a terminal shows: both programs, and how far their histories are apart."""
    yield TextTable(
        title=comparison.title, columns=COMPARISON_COLUMNS, rows=comparison_rows(comparison)
    )
    d = comparison.deviation
    yield (
        f"Force history: {100 * d.history_l2:.2f} % rms of the peak; third octaves within "
        f"{d.third_octave_max_dB:.2g} dB up to {d.third_octave_up_to_Hz / 1e3:.4g} kHz."
    )
    swing, friction = comparison.other.energy_swing, _rubbed(comparison.level.history.ledger)
    if swing is None:
        return
    if friction:
        yield (
            f"Energy that {comparison.other.program} lost, to friction and its numerics: "
            f"{100 * swing:.2f} % of that at the start; friction took {100 * friction:.2f} % in "
            "klack."
        )
    else:
        yield (
            f"Energy of {comparison.other.program} within {swing:.1e} of that at the start at all "
            "times."
        )


def energy_balance(ledger: EnergyLedger) -> float | None:
    """Energy gained (negative: lost) by the numerics of a run without damping [-].

    What the bodies, springs and contacts hold at the end, less what they had and what outside
    forces gave, over the energy turned over; None where a run has no energies.  What friction took
    is not counted.
    """
    if not ledger.bodies:
        return None
    return ledger.residual - _lost(ledger) + _rubbed(ledger)


def _lost(ledger: EnergyLedger) -> float:
    turned_over = max(ledger.initial, abs(ledger.work))
    return ledger.lost / turned_over if turned_over else 0.0


def _rubbed(ledger: EnergyLedger) -> float:
    turned_over = max(ledger.initial, abs(ledger.work))
    return ledger.friction / turned_over if turned_over else 0.0


def comparison_to_json(comparison: Comparison) -> CalculixJson:
    """Plain numbers in SI, the unit in the key; what is not known is None."""
    other = comparison.other
    theirs, ours = comparison.runs
    found: Any = {
        "schema": "klack-compare-calculix/1",
        "case": comparison.case,
        "level": comparison.level.level,
        "program": other.program,
        "klack": json_of(PROGRAM_MEASURES, ours),
        "other": {
            **json_of(PROGRAM_MEASURES, theirs),
            "iterations": other.iterations,
            "energy_swing": other.energy_swing,
        },
        "deviation": json_of(DEVIATION_MEASURES, comparison.deviation),
        "wall_time_ratio": comparison.wall_time_ratio,
    }
    return cast(CalculixJson, found)
