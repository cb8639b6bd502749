"""Where each stroke starts: drawn in the guide, centred, or where the one before has ended."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.shots.draw import drawn_face_friction, drawn_friction, drawn_position
from klack.assembling.spatial import placement_of, seat_height
from klack.assembling.valve import Valve
from klack.case.shots import StrokeShots
from klack.case.valve import ValveCase
from klack.errors import InputError, refuse_if
from klack.mesh.rigid import rigid_placement

__all__ = ["CENTRED", "Starts", "StrokeStart", "shots_of_valve"]

Vector = NDArray[np.float64]

CENTRED = -1
"""Number of the stroke that starts centred and upright."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StrokeStart:
    """Start of one stroke.

    Parameters
    ----------
    index : int
    aside : array, shape (2,) [m]
        Position of the axis of the needle at the height of its seat.
    lean : array, shape (2,) [rad]
        Slope of that axis over the height: towards x and y.
    placement : array, shape (6,) [m], [rad]
        The same as a translation of the centre of mass and a rotation vector; with a turn about
        the axis, which guides with friction leave behind.
    friction : float [-]
        Coulomb's coefficient in the guide.
    contact_friction : float [-]
        That between the faces of all stops; nan: each has that of the case.
    """

    index: int
    aside: Vector
    lean: Vector
    placement: Vector
    friction: float
    contact_friction: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Starts:
    """Draws the starts of the strokes of a case.

    Parameters
    ----------
    case : ValveCase
        With a section ``shots`` and a guide.
    seed : int
    height : float [m]
        Of the seat in the drawing of the needle.
    centre : array, shape (3,) [m]
        Centre of mass of the needle there.
    """

    case: ValveCase
    seed: int
    height: float
    centre: Vector

    @classmethod
    def of(cls, valve: Valve, needle: str, seed: int) -> "Starts":
        """Starts of a valve whose needle is this body."""
        return cls(
            case=valve.case,
            seed=seed,
            height=seat_height(valve.contacts, needle),
            centre=valve.bodies[needle].centre_in_space,
        )

    def drawn(self, index: int) -> StrokeStart:
        """Start of an independent stroke, or of the first one of a row.

        It depends on the seed and on its number alone.

        Raises
        ------
        InputError
            When the guide leaves no room for the stated eccentricity and tilt.
        """
        if self.case.placement is not None:
            position = placement_of(self.case, self.height)
        else:
            shots = shots_of_valve(self.case)
            position = drawn_position(self.case, shots, self.seed, index, self.height)
        return self._at(index, *position, self.friction(index))

    def centred(self) -> StrokeStart:
        """Centred and upright, without Coulomb friction in the guide, which it does not touch."""
        return self._at(CENTRED, np.zeros(2), np.zeros(2), 0.0)

    def contact_friction(self, index: int) -> float:
        """Coefficient of friction between the faces, the mean one in the centred stroke."""
        shots = shots_of_valve(self.case)
        if index == CENTRED and shots.contact_friction is not None:
            return shots.contact_friction.mean
        return drawn_face_friction(shots, self.seed, max(index, 0))

    def after(self, index: int, end: Vector) -> StrokeStart:
        """Start of a stroke where the one before has left the needle across its axis.

        Parameters
        ----------
        index : int
        end : array, shape (6,) [m], [rad]
            Translation of the centre of mass and rotation vector at the end of the one before.
        """
        lean = np.array([end[4], -end[3]])
        aside = end[:2] + (self.height - self.centre[2]) * lean
        return self._at(index, aside, lean, self.friction(index), float(end[5]))

    def friction(self, index: int) -> float:
        """Coefficient of friction in the guide of a stroke."""
        return drawn_friction(self.case, shots_of_valve(self.case), self.seed, index)

    def _at(
        self, index: int, aside: Vector, lean: Vector, friction: float, turn: float = 0.0
    ) -> StrokeStart:
        about = np.array([0.0, 0.0, self.height])
        placement = rigid_placement(aside, lean, about, self.centre)
        placement[5] = turn
        return StrokeStart(
            index=index,
            aside=aside,
            lean=lean,
            placement=placement,
            friction=friction,
            contact_friction=self.contact_friction(index),
        )


def shots_of_valve(case: ValveCase) -> StrokeShots:
    """Section ``shots`` of the case of a valve.

    Raises
    ------
    InputError
        For a motion along the axis, in which all strokes are alike, and without a section.
    """
    where = str(case.path or "case")
    refuse_if(
        case.motion == "axial",
        f"{where}: motion",
        got="'axial' in klack shots",
        expected="motion: three-dimensional, or the case of an impact: along the axis all "
        "strokes are alike",
        hint="set 'motion: three-dimensional', add 'guide' and 'shots: {count: 50}'.",
    )
    if case.shots is None:
        raise InputError(
            f"{where}: shots",
            got="no section 'shots'",
            expected="how many strokes, and what varies from stroke to stroke",
            hint="add 'shots: {count: 50}' and a 'guide', and remove 'placement'.",
        )
    return case.shots
