"""Parameters for derivatives: of a study, or keys of the case."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import sqrt

from klack.analyses.sensitivities.record import SlopeParameter
from klack.analyses.study.points import Linked, Space, Values, space_of, unit_of, written
from klack.analyses.study.strokes import STROKES
from klack.case.any_case import AnyCase
from klack.case.key_path import quantity_at, split_path
from klack.case.points import PointValue
from klack.case.study_source import StudySource
from klack.case.valve import ValveCase
from klack.errors import InputError, refuse_if
from klack.input.problem import CaseProblem, Key, nearest, one_of
from klack.studies.designs import Normal, Range, Spread
from klack.units import RATIO, Kind

__all__ = ["SlopeSpace", "VariedKey", "asked_measures", "slope_space"]


def asked_measures(source: StudySource | None, names: Sequence[str] = ()) -> tuple[str, ...]:
    """Given names, else measures and constraints of the study."""
    if names or source is None:
        return tuple(names)
    return tuple(dict.fromkeys((*source.study.measures, *source.study.constraints)))


_WHERE = "--parameter"
_EXPECTED = (
    "a number of bodies, motion or contact, not zero",
    "a number of the network around the bodies",
)
"""Of an impact, and of a whole valve."""


@dataclass(frozen=True, slots=True, kw_only=True)
class VariedKey:
    """A parameter, its value [SI], and the size [SI] by which its changes are small or large.

    The size is that of the value; of its range where that is zero.
    """

    name: str
    kind: Kind
    value: float
    size: float

    @property
    def unit(self) -> str:
        """SI unit; ``"1"`` for a pure number."""
        return unit_of(self.kind)


@dataclass(frozen=True, slots=True, kw_only=True)
class SlopeSpace:
    """Parameters with what follows from them, about one point.

    Parameters
    ----------
    others [SI]
        Parameters of the study that stay.
    kinds
        Of all changed keys.
    space
        Of the study.
    skipped
        Parameters without a derivative here.
    """

    varied: tuple[VariedKey, ...]
    others: Mapping[str, float | str]
    kinds: Mapping[str, Kind | None]
    space: Space
    skipped: tuple[str, ...] = ()

    @property
    def described(self) -> tuple[SlopeParameter, ...]:
        """Parameters as a record lists them."""
        return tuple(
            SlopeParameter(name=item.name, unit=item.unit, value=item.value) for item in self.varied
        )

    def together(self, share: float) -> dict[str, float]:
        """Shifts [SI] of all parameters by a share of their sizes, with + and - in turn.

        So the effects of two like parameters do not only add up.
        """
        return {item.name: share * (-1.0) ** k * item.size for k, item in enumerate(self.varied)}

    def change_together(
        self, share: float, slopes: Sequence[float | None]
    ) -> tuple[float | None, float]:
        """Change of a measure under :meth:`together` by its slopes, None where one is missing.

        And the scale: root of the sum of the squares of the parts.
        """
        shifts = self.together(share).values()
        parts = [x * slope for x, slope in zip(shifts, slopes, strict=True) if slope is not None]
        predicted = sum(parts) if len(parts) == len(slopes) else None
        return predicted, sqrt(sum(part * part for part in parts))

    def at(self, values: Values) -> "SlopeSpace":
        """The same about other values [SI] of the parameters."""
        return replace(
            self,
            varied=tuple(replace(item, value=float(values[item.name])) for item in self.varied),
            others={name: values[name] for name in self.others},
        )

    def written(self, shifts: Mapping[str, float]) -> dict[str, PointValue]:
        """What the case has where parameters are shifted by so much [SI], by the path of the key.

        Parameters without a shift stay.
        """
        values = dict(self.others)
        values |= {item.name: item.value + shifts.get(item.name, 0.0) for item in self.varied}
        values = dict(self.space.completed(values))
        return {name: written(values[name], kind) for name, kind in self.kinds.items()}


def slope_space(case: AnyCase, source: StudySource | None, names: Sequence[str] = ()) -> SlopeSpace:
    """Find the parameters in the case.

    ``names`` are keys, or parameters of ``source``; by default all its numbers that vary.
    InputError also for a key that is no number with a unit, one that the run itself follows from,
    and of a valve one that bodies or contact laws follow from.
    """
    space = space_of(case, source) if source is not None else Space(parameters=(), linked=())
    found: dict[str, VariedKey] = {}
    known = space.known()
    others: dict[str, float | str] = {}
    for item in space.parameters:
        middle = item.spread.at(0.5)
        others[item.name] = value = middle if item.is_fixed else known.get(item.name, middle)
        if item.kind is not None and not isinstance(value, str) and not item.is_fixed:
            size = abs(value) or _width(item.spread)
            found[item.name] = VariedKey(name=item.name, kind=item.kind, value=value, size=size)
    chosen = list(dict.fromkeys(names)) or [
        name for name, item in found.items() if _reason(case, item, space.linked) is None
    ]
    refuse_if(
        not chosen,
        _WHERE,
        got="no numerical parameter of the network",
        expected="keys of the case with a number and unit",
        hint="--parameter network.components.spring.preload, or a section 'study'.",
    )
    varied = tuple(found.get(name) or _key(case, name, list(found)) for name in chosen)
    for key in varied:
        if (reason := _reason(case, key, space.linked)) is not None:
            raise InputError(
                f"{_WHERE} {key.name}",
                got=reason[0],
                expected=_EXPECTED[isinstance(case, ValveCase)],
                hint=reason[1],
            )
    kinds: dict[str, Kind | None] = {p.name: p.kind for p in space.parameters if p.is_key}
    kinds |= {key.name: key.kind for key in varied if "." in key.name}
    kinds |= {item.name: item.kind for item in space.linked}
    skipped = () if names else tuple(p.name for p in space.parameters if p.name not in chosen)
    return SlopeSpace(
        varied=varied,
        others=others,
        kinds=kinds,
        space=space,
        skipped=tuple(name for name in skipped if not _is_fixed(space, name)),
    )


def _width(spread: Spread) -> float:
    if isinstance(spread, Range):
        return spread.high - spread.low
    return spread.deviation if isinstance(spread, Normal) else 0.0


def _key(case: AnyCase, name: str, known: Sequence[str]) -> VariedKey:
    if "." not in name and known:
        raise InputError(
            _WHERE,
            got=f"'{name}'",
            expected=f"a parameter of the study, {one_of(known)}, or the path of a key",
            hint=nearest(name, known, "write the path from the top level of the case."),
        )
    try:
        found = quantity_at(case, split_path(name))
    except CaseProblem as problem:
        raise InputError(
            _WHERE, got=problem.got, expected=problem.expected, hint=problem.hint
        ) from None
    size = abs(found.value)
    return VariedKey(name=name, kind=found.kind or RATIO, value=found.value, size=size)


def _is_fixed(space: Space, name: str) -> bool:
    return any(item.name == name and item.is_fixed for item in space.parameters)


def _reason(case: AnyCase, item: VariedKey, linked: Sequence[Linked]) -> tuple[str, str] | None:
    if item.size == 0.0:
        return "a value of zero", "give a range in a study to define the size of a small change."
    follow = [other.name for other in linked if item.name in other.words.values()]
    for name in (item.name, *follow):
        place = split_path(name)
        if len(place) == 1:
            continue
        for key in case.behind(place):
            reason = _reason_at(case, key)
            if reason is not None:
                return reason
    return None


def _reason_at(case: AnyCase, place: Key) -> tuple[str, str] | None:
    if place[0] == "run":
        return "a setting of the run", "klack advise shows what its steps change."
    if not isinstance(case, ValveCase):
        return None
    if place[0] != "network" or STROKES.makes_bodies(case, place):
        return (
            "a key on which meshes, modes, contact laws or the noise depend",
            "klack study with a few values of it computes the valve at each of them.",
        )
    return None
