"""Designs by what the valves made after them do."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from klack.analyses.study.goals import Side
from klack.analyses.study.point_row import PointRow
from klack.analyses.study.points import Space, Values
from klack.analyses.study.record import StudyColumn
from klack.analyses.study.scatter import Scatter, made_space, scatter_of
from klack.case.any_case import AnyCase
from klack.case.points import PointValue
from klack.case.study_source import StudySource
from klack.errors import InputError
from klack.studies.robust import RobustValue

__all__ = ["Compute", "MadeValves", "made_valves_of"]

Written = Mapping[str, PointValue]
Compute = Callable[[Sequence[Written], Sequence[str]], list[PointRow]]
"""Rows of points, with the measures of these names."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MadeValves:
    """Valves made after every design, and what stands for their measures.

    Parameters
    ----------
    scatter : Scatter
    value : RobustValue
    today : tuple of mapping
        Valves made after the case as it is; empty where words of the study have no value there.
    """

    scatter: Scatter
    value: RobustValue
    today: tuple[Written, ...]

    def name(self, side: Side) -> str:
        """``closing_time (mean + 2 sd)``."""
        measure, high = side
        return f"{measure} ({self.value.words(high=high)})"

    def rows(
        self, designs: Sequence[Values], sides: Sequence[Side], compute: Compute
    ) -> list[PointRow]:
        """Value of each side for every design, from its valves."""
        return self._rows([self.scatter.made(design) for design in designs], sides, compute)

    def row_of_today(self, sides: Sequence[Side], compute: Compute) -> PointRow:
        """The same for the case as it is."""
        return self._rows([self.today], sides, compute)[0]

    def _rows(
        self,
        made: Sequence[Sequence[Written]],
        sides: Sequence[Side],
        compute: Compute,
    ) -> list[PointRow]:
        names = list(dict.fromkeys(measure for measure, _ in sides))
        rows = iter(compute([valve for valves in made for valve in valves], names))
        return [self._row([next(rows) for _ in valves], names, sides) for valves in made]

    def _row(
        self, valves: Sequence[PointRow], names: Sequence[str], sides: Sequence[Side]
    ) -> PointRow:
        if not valves:
            return PointRow((None,) * len(sides))
        table = np.array([row.numbers for row in valves], dtype=float)
        values = (self.value.of(table[:, names.index(m)], high=high) for m, high in sides)
        failures = Counter(row.failure.partition("\n")[0] for row in valves if row.failure)
        notes = {f"Made valves: {note}": None for row in valves for note in row.notes}
        if failures:
            reason = failures.most_common(1)[0][0]
            text = f"{failures.total()} of {len(valves)} made valves have no measures: {reason}"
            notes[text] = None
        return PointRow(
            tuple(value if np.isfinite(value) else None for value in values), notes=tuple(notes)
        )

    def columns(
        self,
        measures: Sequence[StudyColumn],
        sides: Sequence[Side],
        rows: Sequence[PointRow],
        today: PointRow,
    ) -> tuple[StudyColumn, ...]:
        """Columns of the sides, beside those of the designs as drawn."""
        own = {item.name: item for item in measures}
        return tuple(
            StudyColumn(
                name=self.name(side),
                title=f"{own[side[0]].title} ({self.value.words(high=side[1])})",
                unit=own[side[0]].unit,
                spread="",
                today=today.numbers[k],
                values=np.array([row.numbers[k] for row in rows], dtype=float),
            )
            for k, side in enumerate(sides)
        )


def made_valves_of(case: AnyCase, source: StudySource, space: Space) -> MadeValves | None:
    """Made valves of a study; None for one that compares designs as drawn.

    Raises
    ------
    InputError
        With file, line and key.
    """
    given, scatter = source.study.robust, scatter_of(case, source, space)
    if given is None or scatter is None:
        return None
    value = RobustValue.parse(given.value, source.where(("robust", "value")))
    return MadeValves(scatter=scatter, value=value, today=_of_today(case, source, space, scatter))


def _of_today(
    case: AnyCase, source: StudySource, space: Space, scatter: Scatter
) -> tuple[Written, ...]:
    try:
        own = made_space(case, source, space)
    except InputError:
        return ()
    return tuple(own.written(own.at(share)) for share in scatter.cube)
