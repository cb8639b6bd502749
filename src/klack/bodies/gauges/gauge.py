"""A gauge on a body, and its record over time."""

from dataclasses import dataclass
from math import inf
from typing import Literal

import numpy as np

from klack.arrays import Floats
from klack.signals.low_pass import LowPass

__all__ = ["GAUGE_UNITS", "Gauge", "GaugeKind", "GaugeRecord"]


GaugeKind = Literal["displacement", "velocity", "strain", "stress"]

GAUGE_UNITS: dict[GaugeKind, str] = {
    "displacement": "m",
    "velocity": "m/s",
    "strain": "1",
    "stress": "Pa",
}
"""Unit of what each kind reads."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gauge:
    """What is read on one body: ``row . u`` of its nodal displacements, or ``row . u'``.

    Parameters
    ----------
    row (n_dof,)
        Of a velocity the row of the displacement.
    place
        In words, for example ``"along z over 3 mm at (10, -1260) mm"``.
    """

    name: str
    body: str
    kind: GaugeKind
    row: Floats
    place: str
    low_pass: LowPass | None = None

    def record(self, start: float, step: float, values: Floats) -> "GaugeRecord":
        """Record of this gauge from its exact values."""
        return GaugeRecord(
            name=self.name,
            body=self.body,
            kind=self.kind,
            place=self.place,
            start=start,
            step=step,
            exact=values,
            low_pass=self.low_pass,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GaugeRecord:
    """What one gauge reads during an impact, at uniform instants.

    Parameters
    ----------
    start, step [s]
        The clock is that of the contact force.
    exact (n,)
        Before the low pass, in :attr:`unit`; tension and motion along the direction are positive.
    kept_up_to [Hz]
        Highest mode that it sees; infinite where every degree of freedom moves.
    upper_share [-]
        What the modes above 0.7 of that add, over its highest value.
    """

    name: str
    body: str
    kind: GaugeKind
    place: str
    start: float
    step: float
    exact: Floats
    low_pass: LowPass | None = None
    kept_up_to: float = inf
    upper_share: float = 0.0

    @property
    def unit(self) -> str:
        """Unit of the values; 1 for a strain."""
        return GAUGE_UNITS[self.kind]

    @property
    def time(self) -> Floats:
        """Instants, shape (n,) [s]."""
        return np.asarray(self.start + self.step * np.arange(len(self.exact)))

    @property
    def values(self) -> Floats:
        """What the sensor shows behind its low pass, shape (n,)."""
        return self.exact if self.low_pass is None else self.low_pass(self.exact, self.step)

    @property
    def label(self) -> str:
        """Kind, place and low pass in words."""
        behind = "" if self.low_pass is None else f", {self.low_pass.words}"
        return f"{self.kind} of {self.body} {self.place}{behind}"
