"""Derivatives of objectives and bounds in the unit cube."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.sensitivities.parameters import SlopeSpace, slope_space
from klack.analyses.sensitivities.slopes import SlopeRunner, has_slope
from klack.analyses.study.goals import Goals
from klack.analyses.study.measures import ChosenMeasure
from klack.analyses.study.points import Space
from klack.analyses.study.strokes import AskedPoints
from klack.case.study_source import StudySource
from klack.case.valve import ValveCase
from klack.errors import InputError, KlackError
from klack.input.problem import one_of
from klack.machine.progress import Progress
from klack.studies.designs import Listed
from klack.studies.polish import NoValue

__all__ = ["Gradients", "require_gradients"]

_AHEAD = 1e-6
"""Step in the cube for differences of values."""


def require_gradients(source: StudySource, asked: AskedPoints, space: Space) -> SlopeSpace | None:
    """Space of the derivatives of a polish, if one is asked for.

    InputError where a measure or a parameter has no derivative.
    """
    if not source.study.search.polish:
        return None

    def refused(got: str, hint: str = "leave 'polish' out.") -> InputError:
        return InputError(
            source.where(("search", "polish")),
            got=got,
            expected="objectives and bounds on times of the stroke and on its impacts, and "
            "parameters that are numbers of the network",
            hint=f"{hint} 'refinements' need no derivatives.",
        )

    if not isinstance(asked.case, ValveCase):
        raise refused("an impact of two bodies, without derivatives")
    if asked.case.motion != "axial":
        raise refused("a motion in three dimensions, without derivatives")
    wanted = {*source.study.objectives, *source.study.constraints}
    without = [x.name for x in asked.chosen if x.name in wanted and not has_slope(x)]
    if without:
        raise refused(f"{one_of(without)}, without derivatives")
    if source.study.robust is not None:
        raise refused("a robust search: statistics of manufactured valves have no derivatives here")
    listed = [item.name for item in space.varied if isinstance(item.spread, Listed)]
    if listed:
        raise refused(f"{one_of(listed)}, a list of values")
    try:
        return slope_space(asked.case, source, [item.name for item in space.varied])
    except InputError as error:
        raise refused(f"{error.where.removeprefix('--parameter ')}, {error.got}") from None


@dataclass(frozen=True, slots=True, eq=False)
class Gradients:
    """Derivatives at points of a search.

    ``chosen`` are the measures of the objectives and bounds, ``notes`` tell why a derivative could
    not be computed.
    """

    runner: SlopeRunner
    slopes: SlopeSpace
    space: Space
    goals: Goals
    chosen: tuple[ChosenMeasure, ...]
    notes: list[str]

    @classmethod
    def of(
        cls,
        asked: AskedPoints,
        slopes: SlopeSpace,
        space: Space,
        goals: Goals,
        progress: Progress,
    ) -> "Gradients":
        """Bodies and laws are built here."""
        wanted = {name for name, _ in goals.sides}
        variant = asked.case.one_variant(asked.variant)
        return cls(
            runner=SlopeRunner(asked.case, asked.tree, slopes, variant, progress, None),
            slopes=slopes,
            space=space,
            goals=goals,
            chosen=tuple(item for item in asked.chosen if item.name in wanted),
            notes=[],
        )

    def at(self, point: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Derivatives of objectives and bounds, each of shape (..., parameters).

        NoValue where the stroke, or a derivative, cannot be computed.
        """
        try:
            runner = self.runner.about(self.slopes.at(self.space.at(point)))
            runs = runner.tangents()
            slopes = runner.slopes(runs, self.chosen)
            found = {item.name: row for item, (_, row) in zip(self.chosen, slopes, strict=True)}
        except KlackError as error:
            self.notes.append(f"The polish by derivatives ended early: {error}")
            raise NoValue from None
        missing = [name for name, row in found.items() if None in row]
        if missing:
            self.notes.append(
                f"The polish by derivatives ended where {one_of(missing)} has none: an impact "
                "appears or disappears there."
            )
            raise NoValue
        per_share = self._values_per_share(point)
        rows = {name: np.array(row, dtype=float) * per_share for name, row in found.items()}
        pairs = zip(self.goals.signs, self.goals.objectives, strict=True)
        objectives = np.array([sign * rows[name] for sign, name in pairs])
        bounds = [
            (1.0 if b.is_most else -1.0) * rows[b.measure] / (abs(b.value) or 1.0)
            for b in self.goals.bounds
        ]
        return objectives, np.reshape(bounds, (len(bounds), per_share.size))

    def _values_per_share(self, point: NDArray[np.float64]) -> NDArray[np.float64]:
        """Derivatives of values [SI] with shares of the cube."""
        found = []
        for item, share in zip(self.space.varied, point, strict=True):
            low, high = max(float(share) - _AHEAD, 0.0), min(float(share) + _AHEAD, 1.0)
            ends = [float(item.spread.at(place)) for place in (low, high)]
            found.append((ends[1] - ends[0]) / (high - low))
        return np.array(found)
