"""A body whose motion is given: a lift curve."""

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar, Literal, Self

import numpy as np
import scipy
from numpy.typing import NDArray
from pydantic import Field, model_validator

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.errors import InputError
from klack.input.problem import CaseProblem, refuse_key_if
from klack.input.section import InputPath, Name, Text
from klack.network.component import Component
from klack.network.port import MOTION, Port
from klack.network.rows import MotionCourse, Rows
from klack.units import LENGTH, TIME, Length, Time, parse_quantity

__all__ = ["PrescribedMotion"]

_STIFF = 1e12  # [rad/s] a static force of 1 kN would move it by 1e-21 m
_LARGEST = 10_000_000  # bytes of a table


class PrescribedMotion(Component):
    """Body that follows a lift curve exactly, whatever pushes it.

    .. math:: y(t) = c(t) - c(0)

    through the points of a table or of a file, by monotone cubics that do not overshoot (Fritsch
    and Carlson, SIAM J. Numer. Anal. 17 (1980) 238) or by straight lines; constant before the first
    and after the last point.  Drives seats, faces and films with a lift that is measured or of
    another program.

    The force that the motion needs is recorded as ``<component> drive force``, positive along +z;
    its work is the supply ``<component> motion``, negative while the body is pushed along.
    Displacements are exact at the end of every step, with a constant speed in between.

    Limits: no mass, so the force is that of its surroundings alone; an end stop or friction may
    join it to a body that can move, not to the ground.  The check of strokes before a run does not
    know its travel.
    """

    type: ClassVar[str] = "prescribed-motion"

    time: tuple[Time, ...] = Field(default=(), description="Points in time, increasing.")
    displacement: tuple[Length, ...] = Field(
        default=(), description="Displacement along +z (opening) at each of them."
    )
    file: InputPath | None = Field(
        default=None,
        description="Instead of time and displacement: CSV file with these as its first two "
        "columns; lines without numbers are skipped.",
    )
    time_unit: Text | None = Field(default=None, description="Unit of the first column: ms.")
    displacement_unit: Text | None = Field(default=None, description="Of the second: um.")
    between: Literal["smooth", "straight"] = Field(
        default="smooth", description="Curve between two points."
    )
    points: tuple[Name, ...] = Field(
        default=("body",), min_length=1, description="Names of its ports."
    )

    @model_validator(mode="after")
    def _one_curve(self) -> Self:
        given = (self.file, self.time_unit, self.displacement_unit)
        some, whole = any(x is not None for x in given), all(x is not None for x in given)
        refuse_key_if(
            bool(self.time or self.displacement) == some or (some and not whole),
            ("time",),
            got="a table and a file" if some and self.time else "an incomplete curve",
            expected="'time' and 'displacement', or 'file' with the units of its columns",
            hint="file: lift.csv, time_unit: ms, displacement_unit: um.",
        )
        refuse_key_if(
            len(set(self.points)) < len(self.points),
            ("points",),
            got=", ".join(self.points),
            expected="every name once",
            hint="one point can have any number of springs, faces and seats.",
        )
        self.course()
        return self

    def port_kinds(self) -> Mapping[str, Port]:
        """One port for each point."""
        return dict.fromkeys(self.points, MOTION)

    def course(self) -> MotionCourse:
        """Curve from its displacement at time zero on."""
        key = "time" if self.file is None else "file"
        if self.file is None:
            time, place = np.array(self.time), np.array(self.displacement)
        else:
            time, place = self._columns(self.file)
        refuse_key_if(
            len(time) != len(place) or len(time) < 2 or not np.all(np.diff(time) > 0.0),
            (key,),
            got=f"{len(place)} displacements at {len(time)} times"
            + (", not rising" if len(time) == len(place) > 1 else ""),
            expected="one displacement for each time, at least two, with increasing times",
            hint="sort the points; write a jump as a short ramp, e.g. of 1 us.",
        )
        if self.between == "smooth" and len(time) > 2:
            after = before = np.asarray(
                scipy.interpolate.PchipInterpolator(time, place).derivative()(time)
            )
        else:
            slope = np.diff(place) / np.diff(time)
            after, before = np.append(slope, 0.0), np.insert(slope, 0, 0.0)
        course = MotionCourse(time, place, after, before)
        return MotionCourse(time, place - _at_zero(course), after, before)

    def add_rows(self, rows: Rows) -> None:
        """Add a body that forces do not move."""
        count = len(self.points)
        body = ReducedBody(
            name=rows.component,
            mass=1.0,
            omega=np.full(1, _STIFF),
            damping=np.zeros(1),
            port_names=self.points,
            port_shapes=np.ones((1, count)),
            observer_names=(),
            observer_shapes=np.zeros((1, 0)),
            static_compliance=np.zeros((count, count)),
            rigid_count=0,
            rigid_axial=np.zeros(0),
            dof_count=1,
            correction="none",
        )
        rows.body(body, self.points, course=self.course())

    def _columns(self, path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        size = path.stat().st_size
        refuse_key_if(
            size > _LARGEST,
            ("file",),
            got=f"{size / 1e6:.0f} MB",
            expected=f"at most {_LARGEST / 1e6:.0f} MB",
            hint="keep two columns, and fewer points.",
        )
        found = []
        for number, line in enumerate(path.read_text("utf-8", errors="replace").splitlines(), 1):
            cells = line.replace(";", ",").replace("\t", ",").split(",")
            try:
                found.append((float(cells[0]), float(cells[1])))
            except (ValueError, IndexError):
                if found and line.strip():
                    raise CaseProblem(
                        ("file",),
                        got=f"'{line[:60]}' in line {number}",
                        expected="two numbers, time and displacement",
                        hint="separate columns with a comma, semicolon or tab, and use a decimal "
                        "point.",
                    ) from None
        table = np.array(found).reshape(-1, 2)
        refuse_key_if(
            not np.all(np.isfinite(table)),
            ("file",),
            got="a value that is not finite",
            expected="finite numbers",
            hint="remove such lines.",
        )
        sizes = []
        for key, unit, kind in (
            ("time_unit", self.time_unit, TIME),
            ("displacement_unit", self.displacement_unit, LENGTH),
        ):
            try:
                sizes.append(parse_quantity(f"1 {unit}", kind, key))
            except InputError as error:
                raise CaseProblem(
                    (key,), got=error.got, expected=error.expected, hint=error.hint
                ) from error
        return table[:, 0] * sizes[0], table[:, 1] * sizes[1]


def _at_zero(course: MotionCourse) -> float:
    time, place = course.time, course.displacement
    k = int(np.searchsorted(time, 0.0, side="right"))
    if k == 0 or k == len(time):
        return float(place[min(k, len(time) - 1)])
    h = float(time[k] - time[k - 1])
    s = float(-time[k - 1]) / h
    rise = float(place[k] - place[k - 1])
    a, b = h * float(course.slope_after[k - 1]), h * float(course.slope_before[k])
    return float(place[k - 1]) + s * (a + s * (3.0 * rise - 2.0 * a - b + s * (a + b - 2.0 * rise)))
