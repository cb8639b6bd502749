"""A stored impact beside that of another program."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import isfinite

from klack.acoustics.comparison import compare_histories
from klack.analyses.analysis import Analysis
from klack.analyses.impact.analysis import DEVIATION
from klack.analyses.impact.measures import LEVEL_MEASURES
from klack.analyses.impact.record import ImpactStudy, LevelResult
from klack.analyses.json_parts import (
    JsonForm,
    Key,
    Real,
    inherited,
    measured_keys,
    schema_key,
)
from klack.analyses.measures import Column, Measure, cells, heads
from klack.contact.history import EnergyLedger, ImpactHistory
from klack.contact.restitution import Deviation, ImpactMeasures, measure_impact
from klack.errors import InputError, refuse_if
from klack.terminal.tables import TextTable

__all__ = [
    "CALCULIX",
    "COMPARISON_COLUMNS",
    "PROGRAM_MEASURES",
    "Comparison",
    "OtherRun",
    "compare_with",
    "comparison_rows",
    "level_of",
    "with_other",
]


@dataclass(frozen=True, kw_only=True, eq=False)
class OtherRun:
    """One impact that another program computed.

    ``energy_swing`` [-] is the largest change of the total energy since the start, relative;
    ``iterations`` those of all steps.
    """

    program: str
    history: ImpactHistory
    energy_swing: float | None
    steps: int
    iterations: int | None = None
    wall_time: float | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Comparison:
    """A level of klack beside another program; ``measures`` are those of the other one.

    ``deviation`` is that of klack from the other program.
    """

    case: str
    title: str
    level: LevelResult
    other: OtherRun
    measures: ImpactMeasures
    deviation: Deviation

    @property
    def runs(self) -> tuple[LevelResult, LevelResult]:
        """The other program as if it were a level, and klack."""
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
        """Wall time of the other program over that of klack [-]."""
        other = self.other.wall_time
        return None if other is None or self.wall_time == 0.0 else other / self.wall_time


_OF_LEVELS = {measure.key: measure for measure in LEVEL_MEASURES}
PROGRAM_MEASURES: tuple[Measure[LevelResult], ...] = (
    replace(_OF_LEVELS["peak_force"], column=Column("N", 1.0, ".3f")),
    *(_OF_LEVELS[key] for key in ("contact_time", "impulse", "restitution")),
    Measure(
        key="energy_balance",
        symbol="r_E",
        definition="Energy gained (negative: lost) by the numerics of a run without damping, "
        "over the energy throughput; friction of the faces is not a numerical loss.",
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
"""Of an impact by one program; the wall time of klack includes its set-up."""

COMPARISON_COLUMNS = ("", *heads(PROGRAM_MEASURES))


_PROGRAM = JsonForm(
    "ProgramJson", "Impact as one program computed it.", *measured_keys(PROGRAM_MEASURES)
)
_OTHER = JsonForm(
    "OtherProgramJson",
    "Impact as the other program computed it.",
    *inherited(_PROGRAM, lambda comparison: comparison.runs[0]),
    Key("iterations", int | None, of="other.iterations"),
    Key("energy_swing", Real, of="other.energy_swing"),
)
_COMPARISON = JsonForm(
    "CalculixJson",
    "``klack compare --calculix``.",
    schema_key("klack-compare-calculix/1"),
    Key("case", str),
    Key("level", str, of="level.level"),
    Key("program", str, of="other.program"),
    Key("klack", _PROGRAM, of=lambda comparison: comparison.runs[1]),
    Key("other", _OTHER, of=lambda comparison: comparison),
    Key("deviation", DEVIATION),
    Key("wall_time_ratio", Real),
)


def level_of(study: ImpactStudy, name: str) -> LevelResult:
    """Level of a study of two bodies by name; InputError if it is missing."""
    refuse_if(
        study.is_row,
        f"result of case '{study.case}'",
        got="an impact of three bodies in a row",
        expected="an impact of two bodies, for which sensors and a CalculiX deck exist",
        hint="compare a stroke of the three bodies with its measurement.",
    )
    if name not in study.levels:
        raise InputError(
            f"result of case '{study.case}'",
            got=f"no level '{name}'{study.why_missing(name)}",
            expected=f"one of: {', '.join(study.levels)}",
            hint=f"run `klack impact {study.case} --level {name}`, or choose with --level.",
        )
    return study.levels[name]


def compare_with(study: ImpactStudy, level: str, other: OtherRun) -> Comparison:
    """Compare one level of a study with the impact of another program, which is the reference.

    InputError if the other run has no contact.
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
    """Study with the compared level and the other program as one more level."""
    guest, _ = comparison.runs
    return replace(
        study,
        levels={guest.level: guest, comparison.level.level: comparison.level},
        reference=guest.level,
        deviations={comparison.level.level: comparison.deviation},
    )


def comparison_rows(comparison: Comparison) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`COMPARISON_COLUMNS`: other program, klack, deviation."""
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


def _told(comparison: Comparison) -> Iterator[TextTable | str]:
    yield TextTable(
        title=comparison.title, columns=COMPARISON_COLUMNS, rows=comparison_rows(comparison)
    )
    d = comparison.deviation
    yield (
        f"Force history: {100 * d.history_l2:.2f} % rms of the peak; third octaves within "
        f"{d.third_octave_max_dB:.2g} dB up to {d.third_octave_up_to_Hz / 1e3:.4g} kHz."
    )
    swing, ledger = comparison.other.energy_swing, comparison.level.history.ledger
    friction = _over_all(ledger, ledger.friction)
    if swing is None:
        return
    if friction:
        yield (
            f"Energy that {comparison.other.program} lost to friction and its numerics: "
            f"{100 * swing:.2f} % of the energy at the start; friction dissipated "
            f"{100 * friction:.2f} % in klack."
        )
    else:
        yield (
            f"Energy of {comparison.other.program} within {swing:.1e} of its initial value at "
            "all times."
        )


def energy_balance(ledger: EnergyLedger) -> float | None:
    """Energy gained (negative: lost) by the numerics of a run without damping [-].

    What the bodies, springs and contacts hold at the end, less what they had and what outside
    forces gave, over the energy turned over; None where a run has no energies.  What friction took
    is not counted.
    """
    if not ledger.bodies:
        return None
    return ledger.residual - _over_all(ledger, ledger.lost) + _over_all(ledger, ledger.friction)


def _over_all(ledger: EnergyLedger, energy: float) -> float:
    """Energy over the energy turned over [-]."""
    turned_over = max(ledger.initial, abs(ledger.work))
    return energy / turned_over if turned_over else 0.0


CALCULIX = Analysis(
    json=_COMPARISON.type,
    to_json=_COMPARISON.json,
    told=_told,
    measures={"impact by a program": PROGRAM_MEASURES},
)
