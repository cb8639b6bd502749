"""A stored impact beside that of another program: the numbers of both, and how far apart."""

from dataclasses import dataclass, replace
from math import isfinite

from klack.acoustics.comparison import compare_histories
from klack.analyses.impact.record import ImpactStudy, LevelResult
from klack.analyses.json_results import CalculixJson, ProgramJson
from klack.analyses.measures import number_or_none
from klack.contact.history import EnergyLedger, ImpactHistory
from klack.contact.restitution import Deviation, ImpactMeasures, measure_impact
from klack.errors import InputError

__all__ = [
    "COMPARISON_COLUMNS",
    "Comparison",
    "OtherRun",
    "compare_with",
    "comparison_rows",
    "comparison_to_json",
    "level_of",
    "with_other",
]

COMPARISON_COLUMNS = (
    "",
    "peak force [N]",
    "contact time [us]",
    "impulse [mN s]",
    "restitution",
    "energy balance",
    "steps",
    "wall time [s]",
)


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
    case : str
    level : LevelResult
    other : OtherRun
    measures : ImpactMeasures
        Of the other program.
    deviation : Deviation
        Of klack from the other program.
    """

    case: str
    level: LevelResult
    other: OtherRun
    measures: ImpactMeasures
    deviation: Deviation

    @property
    def wall_time(self) -> float:
        """Set-up and time integration of klack [s]."""
        return self.level.setup_time + self.level.wall_time

    @property
    def wall_time_ratio(self) -> float | None:
        """Wall-clock time of the other program over that of klack [-]."""
        other = self.other.wall_time
        return None if other is None or self.wall_time == 0.0 else other / self.wall_time


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
        level=chosen,
        other=other,
        measures=measure_impact(other.history),
        deviation=compare_histories(other.history, chosen.history),
    )


def with_other(study: ImpactStudy, comparison: Comparison) -> ImpactStudy:
    """Study that holds the compared level and the other program as one more level, for charts."""
    other, history = comparison.other, comparison.other.history
    guest = LevelResult(
        level=other.program.lower(),
        label=other.program,
        history=history,
        measures=comparison.measures,
        degrees_of_freedom=comparison.level.degrees_of_freedom,
        steps=other.steps,
        step=history.step,
        wall_time=other.wall_time or 0.0,
        setup_time=0.0,
        energies=history.ledger.parts(),
        energy_residual=history.ledger.residual,
    )
    return replace(
        study,
        levels={guest.level: guest, comparison.level.level: comparison.level},
        reference=guest.level,
        deviations={comparison.level.level: comparison.deviation},
    )


def comparison_rows(comparison: Comparison) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`COMPARISON_COLUMNS`: the other program, klack, the deviation."""
    level, other, deviation = comparison.level, comparison.other, comparison.deviation
    ratio = comparison.wall_time_ratio
    return (
        _row(
            other.program,
            comparison.measures,
            other.history.ledger,
            other.steps,
            other.wall_time,
        ),
        _row(
            f"klack, {level.level}",
            level.measures,
            level.history.ledger,
            level.steps,
            comparison.wall_time,
        ),
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


def _row(
    name: str,
    measures: ImpactMeasures,
    ledger: EnergyLedger,
    steps: int,
    wall_time: float | None,
) -> tuple[str, ...]:
    balance = energy_balance(ledger)
    return (
        name,
        f"{measures.peak_force:.3f}",
        f"{1e6 * measures.contact_time:.3f}",
        f"{1e3 * measures.impulse:.4f}",
        f"{measures.restitution:.4f}" if isfinite(measures.restitution) else "–",
        "" if balance is None else f"{balance:+.1e}",
        f"{steps}",
        "" if wall_time is None else f"{wall_time:.3g}",
    )


def energy_balance(ledger: EnergyLedger) -> float | None:
    """Energy gained (negative: lost) by the numerics of a run without damping [-].

    What the bodies, springs and contacts hold at the end, less what they had and what outside
    forces gave, over the energy turned over; None where a run has no energies.
    """
    if not ledger.bodies:
        return None
    return ledger.residual - _lost(ledger)


def _lost(ledger: EnergyLedger) -> float:
    turned_over = max(ledger.initial, abs(ledger.work))
    return (ledger.contact_dissipation + ledger.damping) / turned_over if turned_over else 0.0


def comparison_to_json(comparison: Comparison) -> CalculixJson:
    """Plain numbers in SI, the unit in the key; what is not known is None."""
    level, other = comparison.level, comparison.other
    d = comparison.deviation
    return {
        "schema": "klack-compare-calculix/1",
        "case": comparison.case,
        "level": level.level,
        "program": other.program,
        "klack": _numbers(level.measures, level.history, level.steps, comparison.wall_time),
        "other": {
            **_numbers(comparison.measures, other.history, other.steps, other.wall_time),
            "iterations": other.iterations,
            "energy_swing": other.energy_swing,
        },
        "deviation": {
            "peak_force": number_or_none(d.peak_force),
            "contact_time": number_or_none(d.contact_time),
            "impulse": number_or_none(d.impulse),
            "restitution": number_or_none(d.restitution),
            "history_l2": number_or_none(d.history_l2),
            "third_octave_max_dB": number_or_none(d.third_octave_max_dB),
            "third_octave_up_to_Hz": number_or_none(d.third_octave_up_to_Hz),
        },
        "wall_time_ratio": comparison.wall_time_ratio,
    }


def _numbers(
    measures: ImpactMeasures, history: ImpactHistory, steps: int, wall_time: float | None
) -> ProgramJson:
    return {
        "peak_force_N": number_or_none(measures.peak_force),
        "contact_time_s": number_or_none(measures.contact_time),
        "impulse_Ns": number_or_none(measures.impulse),
        "restitution": number_or_none(measures.restitution),
        "energy_balance": energy_balance(history.ledger),
        "steps": steps,
        "step_s": history.step,
        "wall_time_s": wall_time,
    }
