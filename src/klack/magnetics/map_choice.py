"""A map from files, as a case describes it: columns, units, signs."""

from dataclasses import replace
from pathlib import Path
from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from klack.errors import InputError, refuse_if
from klack.input.problem import CaseProblem, refuse_key_if
from klack.input.section import Count, InputPath, Number, Section, Text
from klack.magnetics.map_file import MapTable, read_map, read_matrix
from klack.units import Length, format_si

__all__ = ["MapFile"]

_NOTHING = 1e-6  # of the largest linkage: that without current may be round-off of the field


class MapColumns(Section):
    """Columns whose names do not tell what they hold: a name of the head, or a number from 1."""

    current: Count | Text | None = Field(default=None, description="Column of the current.")
    gap: Count | Text | None = Field(
        default=None, description="Of the gap, or of a position with closed_at."
    )
    linkage: Count | Text | None = Field(default=None, description="Of the flux linkage.")
    force: Count | Text | None = Field(default=None, description="Of the force.")


class MapUnits(Section):
    """Units of the columns, in place of those of the head."""

    current: Text | None = Field(default=None, description="Unit of the current: A.")
    gap: Text | None = Field(default=None, description="Of the gap: mm.")
    linkage: Text | None = Field(default=None, description="Of the flux linkage: mWb.")
    force: Text | None = Field(default=None, description="Of the force: N.")


class MapFile(Section):
    """Table of linkage and force from a file; see :mod:`klack.magnetics.map_file`."""

    file: InputPath = Field(
        description="CSV or text, relative to the case: one row per point, or a column per gap "
        "or current with its value in the header; with layout: matrix, the linkage."
    )
    layout: Literal["rows", "matrix"] = Field(
        default="rows",
        description="matrix: gaps down the first column, currents across the first row.",
    )
    force_file: InputPath | None = Field(
        default=None, description="Matrix of the force, with layout: matrix."
    )
    columns: MapColumns = Field(
        default=MapColumns(), description="Columns that the header does not identify."
    )
    units: MapUnits = Field(default=MapUnits(), description="Units that the header does not state.")
    linkage_factor: Number = Field(
        default=1.0,
        description="Factor on the linkage: 2 for half a model, the number of turns for a flux "
        "per turn, -1 for a coil of opposite sense.",
    )
    force_factor: Number = Field(
        default=1.0, gt=0, description="Factor on the force: 2 for half a model."
    )
    force_closing: Literal["negative", "positive"] = Field(
        default="negative", description="Sign that a force closing the gap has in the file."
    )
    closed_at: Length | None = Field(
        default=None,
        description="Position at zero gap, if the column of the gap is a position that grows "
        "while the gap closes: gap = closed_at - position.",
    )

    @model_validator(mode="after")
    def _readable(self) -> Self:
        refuse_key_if(
            self.linkage_factor == 0.0,
            ("linkage_factor",),
            got="0",
            expected="a factor other than 0",
            hint="leave the factor out for a whole model.",
        )
        refuse_key_if(
            self.force_file is not None and self.layout != "matrix",
            ("force_file",),
            got="a file of the force with layout: rows",
            expected="layout: matrix",
            hint="with layout: rows the force is a column of 'file'.",
        )
        try:
            self.table()
        except InputError as error:
            raise CaseProblem(
                ("file",),
                got=f"{error.where}: {error.got}",
                expected=error.expected,
                hint=error.hint,
            ) from None
        return self

    def table(self) -> MapTable:
        """Map in the signs of klack: linkage with the current, force with the gap.

        Raises
        ------
        InputError
            If a file cannot be read, or its numbers are not those of a coil that pulls.
        """
        found = self._read()
        gap, linkage, force = found.gap, self.linkage_factor * found.linkage, found.force
        if self.closed_at is not None:
            gap, linkage = (self.closed_at - gap)[::-1], linkage[:, ::-1]
            force = None if force is None else force[:, ::-1]
        if force is not None:
            sign = -1.0 if self.force_closing == "positive" else 1.0
            force = sign * self.force_factor * force
        linkage = np.where(np.abs(linkage) <= _NOTHING * np.max(np.abs(linkage)), 0.0, linkage)
        made = replace(found, gap=gap, linkage=linkage, force=force)
        _require_coil(f"force map '{self.file.name}'", made)
        return made

    def _read(self) -> MapTable:
        units = self.units.model_dump(exclude_none=True)
        if self.layout == "rows":
            columns = self.columns.model_dump(exclude_none=True)
            return read_map(self.file, columns=columns, units=units)
        current, gap, linkage = read_matrix(self.file, "linkage", units)
        force = None
        if self.force_file is not None:
            i, x, force = read_matrix(self.force_file, "force", units)
            refuse_if(
                not (_same(i, current) and _same(x, gap)),
                f"force map '{self.force_file.name}'",
                got=f"{i.size} currents and {x.size} gaps",
                expected=f"the {current.size} currents and {gap.size} gaps of "
                f"'{Path(self.file).name}'",
                hint="export both over the same points.",
            )
        return MapTable(current=current, gap=gap, linkage=linkage, force=force)


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    return a.shape == b.shape and bool(np.allclose(a, b, rtol=1e-6, atol=1e-9 * np.max(np.abs(b))))


def _require_coil(where: str, table: MapTable) -> None:
    """Reject what no coil does, naming the point."""
    i, x, psi = table.current, table.gap, table.linkage
    refuse_if(
        i.size < 2 or x.size < 3,
        where,
        got=f"{i.size} currents and {x.size} gaps",
        expected="at least 2 currents and 3 gaps",
        hint="compute more points; ten of each are usual.",
    )
    refuse_if(
        i[0] < 0.0,
        where,
        got=f"a current of {format_si(i[0], 'A')}",
        expected="currents from 0",
        hint="leave out the rows with negative currents: linkage and force follow by symmetry.",
    )
    if i[0] == 0.0 and np.any(psi[0] != 0.0):
        j = int(np.argmax(np.abs(psi[0])))
        raise InputError(
            where,
            got=f"a linkage of {format_si(psi[0, j], 'Wb')} without current, at a gap of "
            f"{format_si(x[j], 'm')}",
            expected="none",
            hint="a map holds neither magnets nor remanence: describe them with a solenoid.",
        )
    rise = np.diff(psi, axis=0, prepend=0.0 if i[0] > 0.0 else np.nan)
    if np.any(rise <= 0.0):
        k, j = np.argwhere(rise <= 0.0)[0]
        turned = bool(np.all(psi[-1] < 0.0))
        raise InputError(
            where,
            got=f"a linkage of {format_si(psi[k, j], 'Wb')} at {format_si(i[k], 'A')} and a gap of "
            f"{format_si(x[j], 'm')}"
            + (
                f", after {format_si(psi[k - 1, j], 'Wb')} at {format_si(i[k - 1], 'A')}"
                if k > 0
                else ""
            ),
            expected="a linkage that increases with the current",
            hint="write linkage_factor: -1, because the coil has the opposite sense."
            if turned
            else "correct that point.",
        )
    refuse_if(
        np.all(np.diff(psi[-1]) > 0.0),
        where,
        got=f"a linkage that rises from {format_si(psi[-1, 0], 'Wb')} to "
        f"{format_si(psi[-1, -1], 'Wb')} as the gap opens from {format_si(x[0], 'm')} to "
        f"{format_si(x[-1], 'm')}",
        expected="a linkage that falls: iron is attracted",
        hint="if the column is a position that grows while the gap closes, give closed_at.",
    )
