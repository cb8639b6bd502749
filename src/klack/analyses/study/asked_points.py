"""Points of a case, and the calculation at each of them."""

import warnings
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import nan
from typing import Any, Generic, NamedTuple

from typing_extensions import TypeVar

from klack.analyses.study.measures import ChosenMeasure
from klack.case.any_case import CaseTree
from klack.case.bodies import CaseFile
from klack.case.points import PointKey, Points, PointValue
from klack.case.study import CaseStudy
from klack.errors import AccuracyWarning, KlackError, refuse_if
from klack.input.problem import Key
from klack.machine.progress import Progress
from klack.signals.sampled import TimeSeries

__all__ = [
    "UNCHECKED",
    "AskedPoints",
    "PointGroup",
    "PointKind",
    "PointRow",
    "PointSteps",
    "Taken",
    "doubts_in",
    "groups_of",
    "others_in",
]


class PointSteps(NamedTuple):
    """What a check of the time steps of a stroke has found.

    ``change`` [-] is the largest one of impacts that the measures depend on with all steps twice as
    long, over what the accuracy promises; inf where one has no counterpart, nan without a check.
    """

    halvings: int = 0
    change: float = nan

    def with_other(self, other: "PointSteps") -> "PointSteps":
        """Of two runs of one point, for different measures."""
        return PointSteps(max(self.halvings, other.halvings), max(self.change, other.change))


UNCHECKED = PointSteps()


@dataclass(frozen=True, slots=True)
class PointRow:
    """What one point leaves behind.

    Parameters
    ----------
    failure
        Why there are no values.
    notes, others
        Doubts about the numbers, and other warnings.
    by_chance
        Whether another try may succeed: the memory was full, or a component of the user's own has
        failed.
    model
        Level, modes and meshes of an impact.
    steps
        Of a stroke.
    """

    values: tuple[float | None, ...]
    failure: str = ""
    notes: tuple[str, ...] = ()
    others: tuple[warnings.WarningMessage, ...] = ()
    by_chance: bool = False
    model: str = ""
    steps: PointSteps | None = None

    @property
    def numbers(self) -> tuple[float, ...]:
        """Values with nan where there is none."""
        return tuple(float("nan") if value is None else value for value in self.values)


def doubts_in(caught: Iterable[warnings.WarningMessage]) -> tuple[str, ...]:
    """Warnings that are doubts about numbers, as text."""
    return tuple(str(item.message) for item in caught if issubclass(item.category, AccuracyWarning))


def others_in(
    caught: Iterable[warnings.WarningMessage],
) -> tuple[warnings.WarningMessage, ...]:
    """Other warnings, to be shown as usual."""
    return tuple(item for item in caught if not issubclass(item.category, AccuracyWarning))


CaseT = TypeVar("CaseT", bound=CaseFile, default=Any)
Built = TypeVar("Built", default=Any)

Taken = Callable[[], Sequence[warnings.WarningMessage]]
"""Warnings of the calling thread since it called last."""


class PointKind(ABC, Generic[CaseT, Built]):
    """What a study computes at its points: strokes of a valve, impacts and shots of two bodies.

    Each point is computed by the functions of a single run.  Those with the same bodies share what
    is built for them.
    """

    builds: int
    """Groups of points whose bodies are kept."""
    same: tuple[Key, str, str]
    """Section of the case that is the same for all points, its content, and the alternative."""

    @abstractmethod
    def asked_variant(self, study: CaseStudy) -> str | None:
        """What the study says of the variant.

        An error names a key of the study that this kind of case does not have.
        """

    @abstractmethod
    def variant(self, case: CaseT, name: str | None, chosen: Sequence[ChosenMeasure]) -> str:
        """Check that a case can run a variant, or level, for some measures; its own by default.

        Returns what is computed at the points: with equal values of its keys a point is the same if
        this is.
        """

    @abstractmethod
    def measures(self, case: CaseT, names: Iterable[str]) -> tuple[ChosenMeasure, ...]:
        """Measures by name, each once; an error proposes the nearest."""

    def require_keys(self, keys: Iterable[PointKey]) -> None:
        """Refuse points that change what is the same for all."""
        section, what, hint = self.same
        for key in keys:
            refuse_if(
                key.place[: len(section)] == section,
                f"points: {key.name}",
                got=f"a {what} as a part of a point",
                expected=f"a single {what} for all points",
                hint=hint,
            )

    @abstractmethod
    def makes_bodies(self, case: CaseT, place: Key) -> bool:
        """Whether what is built may follow from this key."""

    def holds_interpreter(self, asked: "AskedPoints[CaseT]") -> bool:
        """Whether threads hardly speed these points up."""
        return True

    @abstractmethod
    def build(
        self,
        asked: "AskedPoints[CaseT]",
        group: "PointGroup",
        tree: CaseTree,
        case: CaseT,
        progress: Progress,
    ) -> Built:
        """Bodies, modes and laws of a group.

        ``tree`` has the values of the group; ``case`` is that of the first point.
        """

    def close(self, built: Built) -> None:
        """Free what was built, if a kind has to."""

    def crew(
        self,
        asked: "AskedPoints[CaseT]",
        built: Built,
        places: Sequence[int],
        threads: int | None,
    ) -> int:
        """Threads for these points: one, where they hold the interpreter.

        InputError if so many points at a time do not fit into the memory.
        """
        return 1

    @abstractmethod
    def row(
        self,
        asked: "AskedPoints[CaseT]",
        built: Built,
        place: int,
        check: Callable[[], None],
        taken: Taken,
    ) -> PointRow:
        """Compute one point, in whichever thread.

        Parameters
        ----------
        check
            Called now and then; raises :class:`~klack.analyses.study.computing.Stopped` to give up.
        taken
            See :func:`klack.machine.stages.warnings_of_threads`.
        """

    @abstractmethod
    def pressure(self, asked: "AskedPoints[CaseT]", built: Built, place: int) -> TimeSeries | None:
        """Sound of a click of one point, if there is one."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AskedPoints(Generic[CaseT]):
    """Points of a case, and what is computed at every one of them.

    ``variant`` may be a level, ``"shots"``, or both; ``checks`` if time steps of strokes are
    checked, unless the case says.
    """

    kind: PointKind[CaseT, Any] = field(compare=False)
    case: CaseT
    tree: CaseTree
    points: Points
    chosen: tuple[ChosenMeasure, ...]
    variant: str
    checks: bool = True

    def failed(self, error: BaseException) -> PointRow:
        """Row of a point without measures."""
        known = isinstance(error, KlackError)
        text = str(error) if known else f"{type(error).__name__}: {error}"
        return PointRow((None,) * len(self.chosen), text, by_chance=not known)


@dataclass(frozen=True, slots=True, kw_only=True)
class PointGroup:
    """Points with the same bodies and contact laws.

    ``made`` is what they exchange that bodies and laws follow from.
    """

    made: Mapping[Key, PointValue]
    places: tuple[int, ...]


def groups_of(asked: AskedPoints, places: Iterable[int]) -> tuple[PointGroup, ...]:
    """Points with the same bodies, in order of their first ones."""
    found: dict[tuple[tuple[Key, PointValue], ...], list[int]] = {}
    for i in places:
        changes = asked.points.changes(i).items()
        made = tuple(item for item in changes if _makes_bodies(asked, item[0]))
        found.setdefault(made, []).append(i)
    return tuple(PointGroup(made=dict(made), places=tuple(at)) for made, at in found.items())


def _makes_bodies(asked: AskedPoints, place: Key) -> bool:
    """Whether bodies may follow from a key, or from a parameter behind it."""
    return any(asked.kind.makes_bodies(asked.case, key) for key in asked.case.behind(place))
