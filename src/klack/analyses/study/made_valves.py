"""Valves made after a design, about whose values theirs scatter."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.study.asked_points import PointRow
from klack.analyses.study.goals import Side
from klack.analyses.study.points import Parameter, Space, Values, written
from klack.analyses.study.record import StudyColumn
from klack.case.any_case import AnyCase
from klack.case.key_path import quantity_at, split_path
from klack.case.points import PointValue
from klack.case.study import StudyRobust
from klack.case.study_source import StudySource
from klack.errors import InputError, refuse_if
from klack.input.problem import CaseProblem, nearest, one_of
from klack.studies.designs import Listed, Normal, sobol_sequence
from klack.studies.samples import RobustValue
from klack.units import Kind, format_si, parse_quantity

__all__ = ["Compute", "MadeValves", "made_space", "made_valves_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Scattered:
    """A value that scatters, of a parameter of the study or another key.

    ``deviation`` [SI] is the standard deviation of made valves; ``today`` [SI] is None for a word
    without a value in the case.
    """

    name: str
    kind: Kind
    deviation: float
    today: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scatter:
    """What scatters from valve to valve, the same for every design.

    ``cube`` (valves, values) has shares of probability.
    """

    space: Space
    values: tuple[_Scattered, ...]
    cube: NDArray[np.float64]

    def made(self, design: Values) -> list[dict[str, PointValue]]:
        """Texts for each valve made after a design."""
        own = {item.name: design[item.name] for item in self.space.parameters}
        return [self._valve(own, shares) for shares in self.cube]

    def _valve(self, design: Values, shares: NDArray[np.float64]) -> dict[str, PointValue]:
        shifted = {
            item.name: Normal(
                float(design.get(item.name, item.today)),  # type: ignore[arg-type]
                item.deviation,
            ).at(float(share))
            for item, share in zip(self.values, shares, strict=True)
        }
        inside = {name: shifted.get(name, value) for name, value in design.items()}
        others = {
            item.name: written(shifted[item.name], item.kind)
            for item in self.values
            if item.name not in design
        }
        return {**self.space.written(self.space.completed(inside)), **others}


def scatter_of(case: AnyCase, source: StudySource, space: Space) -> Scatter | None:
    """Scatter of made valves, if the study has one.

    InputError for a key that follows from parameters, and a deviation of another unit or not above
    zero.
    """
    given = source.study.robust
    if given is None:
        return None
    values = _scattered(case, source, space, given)
    return Scatter(
        space=space,
        values=values,
        cube=sobol_sequence(given.valves, len(values), given.seed),
    )


def made_space(case: AnyCase, source: StudySource, space: Space) -> Space:
    """Parameters of valves made after the case as it is: what scatters, about its value there.

    Keys that follow from what scatters follow here too; all others keep their value.  InputError
    without a scatter, and for a word that has no value in the case.
    """
    given = source.study.robust
    if given is None:
        raise InputError(
            source.where(()),
            got="no scatter of manufactured valves",
            expected="robust: {scatter: {network.components.spring.preload: 0.3 N}}",
            hint="give the standard deviations of quantities that scatter from valve to valve.",
        )
    values = _scattered(case, source, space, given)
    names = {item.name for item in values}
    linked = []
    for item in space.linked:
        if names & set(item.words.values()):
            linked.append(item)
            names.add(item.name)
    known = space.known()
    needed = {name for item in linked for name in item.words.values()} - names
    own = {item.name for item in values if item.today is not None}
    for name in (*needed, *(item.name for item in values)):
        refuse_if(
            name not in known and name not in own,
            source.where(("robust", "scatter")),
            got=f"'{name}', a word whose value in the case is not known",
            expected="words that directly determine a key of the case",
            hint=f"give the scatter of the keys that depend on '{name}', or link one: a.key: "
            f"{name}.",
        )
    return Space(
        parameters=tuple(
            Parameter(
                name=item.name,
                kind=item.kind,
                spread=Normal(_today(item, known), item.deviation),
                today=_today(item, known),
            )
            for item in values
        ),
        linked=tuple(linked),
        constants={name: float(known[name]) for name in needed},
    )


def _today(item: _Scattered, known: Values) -> float:
    return float(known[item.name]) if item.today is None else item.today


def _scattered(
    case: AnyCase, source: StudySource, space: Space, given: StudyRobust
) -> tuple[_Scattered, ...]:
    parameters = {item.name: item for item in space.parameters}
    linked = {item.name for item in space.linked}
    return tuple(
        _one(case, source, parameters, linked, name, deviation)
        for name, deviation in given.scatter.items()
    )


def _one(
    case: AnyCase,
    source: StudySource,
    parameters: Mapping[str, Parameter],
    linked: set[str],
    name: str,
    given: object,
) -> _Scattered:
    at = ("robust", "scatter", name)
    refuse_if(
        name in linked,
        source.where(at, on_key=True),
        got="a key that depends on parameters",
        expected="a parameter, or an independent key",
        hint="give the scatter of these parameters.",
    )
    own = parameters.get(name)
    if own is not None:
        listed = isinstance(own.spread, Listed) and not own.is_fixed
        if own.kind is None or listed:
            raise InputError(
                source.where(at, on_key=True),
                got="a list of values" if listed else "words",
                expected="a parameter with a range, or a key with a quantity",
                hint="a choice from a list does not scatter; leave it out.",
            )
        kind, today = own.kind, None if own.today is None else float(own.today)
    elif "." not in name:
        raise InputError(
            source.where(at, on_key=True),
            got=f"'{name}'",
            expected=f"the path of a key, or a parameter: {one_of(parameters)}",
            hint=nearest(name, list(parameters), "write the path of the key."),
        )
    else:
        try:
            quantity = quantity_at(case, split_path(name))
        except CaseProblem as problem:
            raise source.refuse(at, problem) from None
        kind, today = quantity.kind, quantity.value
    deviation = source.read(at, lambda: parse_quantity(given, kind))
    refuse_if(
        deviation <= 0.0,
        source.where(at),
        got=format_si(deviation, kind.unit),
        expected="more than 0",
        hint="leave out quantities that do not scatter.",
    )
    return _Scattered(name=name, kind=kind, deviation=deviation, today=today)


Written = Mapping[str, PointValue]
Compute = Callable[[Sequence[Written], Sequence[str]], list[PointRow]]
"""Rows of points, with the measures of these names."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MadeValves:
    """Valves made after every design, and what stands for their measures.

    ``today`` are valves made after the case as it is; empty where words of the study have no value
    there.
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
            text = (
                f"{failures.total()} of {len(valves)} manufactured valves have no measures: "
                f"{reason}"
            )
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
        """Columns of the sides, beside designs as drawn."""
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
    """Made valves of a study, unless it compares designs as drawn."""
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
