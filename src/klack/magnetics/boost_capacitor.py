"""A boost capacitor that several drivers draw from and recharge."""

from typing import ClassVar

from pydantic import Field

from klack.magnetics.output_stage import Capacitor
from klack.magnetics.shared_capacitors import shared_capacitors
from klack.network.component import Component
from klack.network.port import FEEDS
from klack.network.rows import Rows
from klack.units import Capacitance, Current, Power, Ratio, Voltage

__all__ = ["BoostCapacitor"]


class BoostCapacitor(Component):
    r"""Boost capacitor of a control unit, with the converter that recharges it.

    .. math:: C\,\dot U = -\sum_k d_k\,i_k + i_r

    Each boost-driver whose port ``supply`` is joined to its ``outlet`` draws the current of its
    coil, :math:`d_k = 1`, or returns it, :math:`d_k = -1`, by its state.  The converter works all
    the time up to ``voltage``, at constant power with a largest current.  The magnets of these
    drivers are solved together; what the converter draws from the battery is counted here.

    Limits: those of :mod:`klack.magnetics.output_stage`; at most 8 coils in all.
    Source: charge balance of a capacitor; converter as in boost-driver.
    """

    type: ClassVar[str] = "boost-capacitor"
    ports: ClassVar = {"outlet": FEEDS}

    capacitance: Capacitance = Field(gt=0, description="Of the capacitor.")
    voltage: Voltage = Field(gt=0, description="Voltage to which the converter recharges it.")
    start_voltage: Voltage | None = Field(
        default=None, ge=0, description="At the start; default: voltage."
    )
    recharge_power: Power = Field(ge=0, description="Power into the capacitor; 0: no recharge.")
    recharge_current: Current | None = Field(
        default=None, gt=0, description="Largest current into the capacitor; default no limit."
    )
    efficiency: Ratio = Field(default=1.0, gt=0, le=1, description="Of the converter.")

    def capacitor(self) -> Capacitor:
        """Capacitor for the compiled step."""
        return Capacitor(
            capacitance=self.capacitance,
            start=self.voltage if self.start_voltage is None else self.start_voltage,
            nominal=self.voltage,
            power=self.recharge_power,
            current=self.recharge_current or 0.0,
            efficiency=self.efficiency,
        )

    def add_rows(self, rows: Rows) -> None:
        """Name the capacitor; its row is that of the coils at it."""
        there = shared_capacitors(rows)
        there.capacitors[rows.port("outlet")] = (rows.component, self.capacitor())
