"""A solenoid known by a table of its linkage (and force) over current and gap."""

from collections.abc import Mapping
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from klack.errors import InputError
from klack.input.problem import CaseProblem
from klack.magnetics.driver import driver_of
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.flux_step import flux_rows
from klack.magnetics.winding import REFERENCE_TEMPERATURE, warm_resistance
from klack.network.component import Component
from klack.network.port import COIL, ELEMENT, Port
from klack.network.rows import LimitRow, Rows
from klack.units import Current, Flux, Force, Length, Resistance, Temperature

__all__ = ["ForceMapSolenoid"]

_BEYOND = 0.02  # of the largest current: a driver that limits it there overshoots a little


class ForceMapSolenoid(Component):
    r"""Coil and armature as a map :math:`\psi(i, x)` from finite elements or a bench.

    .. math:: u = R\,i + \dot\psi, \qquad i = \frac{\partial W}{\partial\psi}, \qquad
              F = -\frac{\partial W}{\partial x}

    with one stored energy :math:`W(\psi, x)` built from the table, so that a stroke neither makes
    nor loses energy; see :class:`~klack.magnetics.flux_map.FluxMap`.  A force table is compared
    with that, and a disagreement above 5 % of its peak is warned of.

    The table must hold every gap that the stops allow, and every current: beyond the last current
    the linkage continues linearly, with a warning.

    Limits: static map, so no eddy currents and no hysteresis; use
    :class:`~klack.magnetics.solenoid.Solenoid` where the first 100 us matter.
    """

    type: ClassVar[str] = "force-map-solenoid"
    ports: ClassVar[Mapping[str, Port]] = {
        "armature": ELEMENT,
        "base": Port("mechanical", ELEMENT.role, optional=True),
        "terminals": COIL,
    }

    resistance: Resistance = Field(gt=0, description="Of coil and harness, at 20 degC.")
    winding_temperature: Temperature = Field(
        default=REFERENCE_TEMPERATURE, gt=0, description="Of the copper."
    )
    gap: Length = Field(description="Gap at the start, as in the table.")
    closes: Literal["upward", "downward"] = Field(
        default="upward", description="Armature motion that closes the gap; upward opens a valve."
    )
    current: tuple[Current, ...] = Field(min_length=2, description="Currents, increasing from 0.")
    gaps: tuple[Length, ...] = Field(min_length=3, description="Gaps of the table, increasing.")
    linkage: tuple[tuple[Flux, ...], ...] = Field(
        description="Flux linkage of the coil: one row per current, one value per gap."
    )
    force: tuple[tuple[Force, ...], ...] | None = Field(
        default=None, description="Force, negative where it closes the gap; compared only."
    )
    start_current: Current = Field(
        default=0.0, ge=0, description="Steady current before the start: holding."
    )

    @model_validator(mode="after")
    def _usable(self) -> Self:
        for name in ("linkage", "force"):
            table = getattr(self, name)
            widths = {len(row) for row in table} if table is not None else {len(self.gaps)}
            if widths != {len(self.gaps)} or (table and len(table) != len(self.current)):
                raise CaseProblem(
                    (name,),
                    got=f"{len(table)} rows of {sorted(widths)} values",
                    expected=f"a {name} for each of {len(self.current)} currents (rows) and "
                    f"{len(self.gaps)} gaps",
                    hint="write one row per current, with one value per gap.",
                )
        try:
            FluxMap.of(current=self.current, gap=self.gaps, linkage=self.linkage, force=self.force)
        except InputError as error:
            raise CaseProblem(
                ("linkage",), got=error.got, expected=error.expected, hint=error.hint
            ) from None
        return self

    def flux_map(self) -> FluxMap:
        """Return the energy surface."""
        return FluxMap.of(current=self.current, gap=self.gaps, linkage=self.linkage, force=None)

    def add_rows(self, rows: Rows) -> None:
        """Add the coil with its driver."""
        flux_rows(
            rows,
            self.flux_map(),
            resistance=warm_resistance(self.resistance, self.winding_temperature),
            driver=driver_of(rows, "terminals"),
            gap=self.gap,
            closing=self.closes == "upward",
            armature=rows.port("armature"),
            base=rows.port("base"),
            current=self.start_current,
        )
        most = max(self.current)
        rows.limits.append(
            LimitRow(
                component=rows.component,
                quantity="current",
                unit="A",
                valid=(-most, most),
                slack=_BEYOND * most,
                law=f"the map of '{rows.component}'",
                effect=lambda value: "The linkage continues linearly there, without saturation.",
                advice="add currents to the table, or limit the current by the driver.",
                channel=f"{rows.component} current",
            )
        )
