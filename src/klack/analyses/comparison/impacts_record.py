"""What ``klack compare`` leaves behind of an impact and measured pulses, side by side."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.record import CaseRecord
from klack.measurement.pulse import Pulse

__all__ = ["ComparedPulse", "MeasuredImpactStudy"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedPulse:
    """One measured pulse, and the computed one at its time and height.

    Parameters
    ----------
    name : str
        Of the recording.
    channel : str
        Read from it, with its unit.
    measured, computed : Pulse
        In the unit of the output, each on its own clock.
    factor : float [-]
        Measured over computed.
    fitted : bool
        Whether the factor is fitted; otherwise it is 1.
    shift : float [s]
        Computed time minus measured time.
    rms : float [-]
        Of the difference, over the measured plateau.
    absolute : bool
        False if the recording cannot be in the unit of the output: it names none, or a scale that
        klack does not know.
    """

    name: str
    channel: str
    measured: Pulse
    computed: Pulse
    factor: float
    fitted: bool
    shift: float
    rms: float
    absolute: bool = True

    @property
    def length_difference(self) -> float:
        """Computed length over the measured one, minus 1 [-]."""
        return self.computed.length / self.measured.length - 1.0


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredImpactStudy(CaseRecord):
    """An impact beside measured pulses of one and the same channel.

    Parameters
    ----------
    level : str
        Of the impact.
    output, label, unit : str
        Name of the channel, what it is, and its unit.
    speed : float [m/s]
        That was computed.
    pulses : tuple of ComparedPulse
        One for each recording.
    time : array, shape (n,) [s]
        From half of the plateau in the front of the computed pulse.
    measured : float32 array, shape (recordings, n)
        Over the factor of each, so that all belong to the computed speed, upwards.
    middle, low, high : array, shape (n,)
        Median, 5 % and 95 % of the recordings.
    computed : array, shape (n,)
    notes : tuple of str
    """

    level: str
    output: str
    label: str
    unit: str
    speed: float
    pulses: tuple[ComparedPulse, ...]
    time: Floats
    measured: NDArray[np.float32]
    middle: Floats
    low: Floats
    high: Floats
    computed: Floats
    notes: tuple[str, ...]
