"""Many runs in rows: a column for each of their measures."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import field, fields, make_dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from klack.analyses.measures import Measure
from klack.units import format_si

__all__ = ["Columns", "told_value", "with_columns"]

Column = NDArray[np.float64]
Kind = TypeVar("Kind", bound="type[Columns]")


class Columns:
    """Runs in rows, a column for each measure; what a run does not reach is nan."""

    filled: ClassVar[float]

    if TYPE_CHECKING:

        def __init__(self, **columns: Column) -> None: ...

        def __getattr__(self, key: str) -> Column: ...

    def __post_init__(self) -> None:
        """Fill in columns that earlier versions have not stored."""
        for name in self.keys():
            if not len(getattr(self, name)):
                object.__setattr__(self, name, np.full(self.count, self.filled))

    @classmethod
    def of(cls, rows: Sequence[Mapping[str, float]]) -> Self:
        """Columns of the numbers of each run."""
        return cls(**{name: np.array([row[name] for row in rows]) for name in cls.keys()})

    @classmethod
    def keys(cls) -> tuple[str, ...]:
        """Names of the columns, in their order."""
        return tuple(item.name for item in fields(cast(Any, cls)))

    @property
    def count(self) -> int:
        """Number of runs."""
        return len(getattr(self, self.keys()[0]))

    def row(self, index: int) -> dict[str, float]:
        """Numbers of one run by column."""
        return {name: float(getattr(self, name)[index]) for name in self.keys()}


def with_columns(
    measures: Iterable[Measure[Any]],
    later: Collection[str] = (),
    filled: float = float("nan"),
) -> Callable[[Kind], Kind]:
    """Give a class a column (runs,) for each measure, in its unit and in stored order.

    Columns ``later`` are missing in earlier versions; ``filled`` stands there instead.
    """
    members = [
        (item.key, Column, field(default_factory=lambda: np.zeros(0)))
        if item.key in later
        else (item.key, Column, field())
        for item in measures
    ]

    def extended(kind: Kind) -> Kind:
        found: Any = make_dataclass(
            kind.__name__, members, bases=(kind,), frozen=True, kw_only=True, eq=False
        )
        found.__module__, found.__doc__, found.filled = kind.__module__, kind.__doc__, filled
        return cast(Kind, found)

    return extended


def told_value(value: float, unit: str, digits: int = 4) -> str:
    """Value for a terminal; a dash without one."""
    if not np.isfinite(value):
        return "–"
    if unit == "kg":
        value, unit = 1e3 * value, "g"
    return format_si(value, unit, digits) if unit != "1" else f"{value:.4f}"
