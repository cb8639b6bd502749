"""A solenoid known by a table of its linkage (and force) over current and gap."""

from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from klack.input.problem import CaseProblem, problem_at, refuse_key_if
from klack.magnetics.driver import driver_of
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.flux_step import flux_rows
from klack.magnetics.insulation import InsulationClass
from klack.magnetics.map_choice import MapFile
from klack.magnetics.map_file import MapTable
from klack.magnetics.winding import REFERENCE_TEMPERATURE, WindingTemperature, warm_resistance
from klack.network.component import Component
from klack.network.port import COIL, ELEMENT, Port
from klack.network.rows import LimitRow, Rows
from klack.units import Current, Flux, Force, Length, Resistance

__all__ = ["ForceMapSolenoid"]

_TABLE = ("current", "gaps", "linkage", "force")
_BEYOND = 0.02  # of the largest current: a driver that limits it there overshoots a little


class ForceMapSolenoid(Component):
    r"""Coil and armature as a map :math:`\psi(i, x)` from finite elements or a bench.

    .. math:: u = R\,i + \dot\psi, \qquad i = \frac{\partial W}{\partial\psi}, \qquad
              F = -\frac{\partial W}{\partial x}

    with one stored energy :math:`W(\psi, x)` built from the table, so that a stroke neither makes
    nor loses energy; see :class:`~klack.magnetics.flux_map.FluxMap`.  A force table is compared
    with it, and a deviation above 5 % of its peak is warned of.

    The table, in the case or in a file of a finite-element program
    (:class:`~klack.magnetics.map_choice.MapFile`), must hold every gap that the stops allow, and
    every current: beyond the last one the linkage continues linearly, with a warning.

    Limits: static map, so no eddy currents and no hysteresis; use
    :class:`~klack.magnetics.solenoid.Solenoid` where the first 100 us matter.
    """

    type: ClassVar[str] = "force-map-solenoid"
    ports: ClassVar = {
        "armature": ELEMENT,
        "base": Port("mechanical", ELEMENT.role, optional=True),
        "terminals": COIL,
    }

    resistance: Resistance = Field(gt=0, description="Of coil and harness, at 20 degC.")
    winding_temperature: WindingTemperature = Field(
        default=REFERENCE_TEMPERATURE, description="Of the copper, -200 to 1085 degC."
    )
    insulation_class: InsulationClass = None
    gap: Length = Field(description="Gap at the start, as in the table.")
    closes: Literal["upward", "downward"] = Field(
        default="upward", description="Armature motion that closes the gap; upward opens a valve."
    )
    map: MapFile | None = Field(
        default=None,
        description="Map from a file of FEMM, JMAG, Ansys Maxwell or another program; otherwise "
        "give current, gaps and linkage.",
    )
    current: tuple[Current, ...] | None = Field(
        default=None, min_length=2, description="Currents, increasing from 0."
    )
    gaps: tuple[Length, ...] | None = Field(
        default=None, min_length=3, description="Gaps of the table, increasing."
    )
    linkage: tuple[tuple[Flux, ...], ...] | None = Field(
        default=None,
        description="Flux linkage of the coil: one row per current, one value per gap.",
    )
    force: tuple[tuple[Force, ...], ...] | None = Field(
        default=None, description="Force, negative where it closes the gap; only compared."
    )
    start_current: Current = Field(
        default=0.0, ge=0, description="Steady (holding) current before the start."
    )

    @model_validator(mode="after")
    def _usable(self) -> Self:
        if self.map is not None:
            self._refuse_with(_TABLE, "map", "the file has it")
        else:
            self._whole_table()
        table = self.table()
        with problem_at(*(("linkage",) if self.map is None else ("map", "file"))):
            FluxMap.of(
                current=table.current, gap=table.gap, linkage=table.linkage, force=table.force
            )
        return self

    def _whole_table(self) -> None:
        for name in _TABLE[:3]:
            refuse_key_if(
                getattr(self, name) is None,
                (),
                got=f"neither '{name}' nor 'map'",
                expected="a map from a file, or current, gaps and linkage",
                hint=f"add {name}, or map: {{file: map.csv}}.",
            )
        count, width = len(self.current or ()), len(self.gaps or ())
        for name in _TABLE[2:]:
            table = getattr(self, name)
            widths = {len(row) for row in table} if table is not None else {width}
            if widths != {width} or (table and len(table) != count):
                raise CaseProblem(
                    (name,),
                    got=f"{len(table)} rows of {sorted(widths)} values",
                    expected=f"a {name} for each of {count} currents (rows) and {width} gaps",
                    hint="write one row per current, with one value per gap.",
                )

    def table(self) -> MapTable:
        """Table of the case or of the file."""
        if self.map is not None:
            return self.map.table()
        return MapTable(
            current=np.array(self.current),
            gap=np.array(self.gaps),
            linkage=np.array(self.linkage),
            force=None if self.force is None else np.array(self.force),
        )

    def flux_map(self) -> FluxMap:
        """Return the energy surface."""
        return self._map_of(self.table())

    def _map_of(self, table: MapTable) -> FluxMap:
        return FluxMap.of(current=table.current, gap=table.gap, linkage=table.linkage, force=None)

    def add_rows(self, rows: Rows) -> None:
        """Add the coil with its driver."""
        table = self.table()
        flux_rows(
            rows,
            self._map_of(table),
            resistance=warm_resistance(self.resistance, self.winding_temperature),
            driver=driver_of(rows, "terminals"),
            gap=self.gap,
            closing=self.closes == "upward",
            armature=rows.port("armature"),
            base=rows.port("base"),
            current=self.start_current,
        )
        most = float(table.current[-1])
        rows.limits.append(
            LimitRow(
                component=rows.component,
                quantity="current",
                unit="A",
                valid=(-most, most),
                slack=_BEYOND * most,
                law=f"the map of '{rows.component}'",
                effect=lambda value: "The linkage continues linearly there, without saturation.",
                advice="add currents to the table, or limit the current in the driver.",
                channel=f"{rows.component} current",
            )
        )
