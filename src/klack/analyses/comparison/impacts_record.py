"""Record of ``klack compare`` for an impact and measured pulses."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.measures import Column, Measure, described_in
from klack.analyses.record import CaseRecord
from klack.measurement.pulse import Pulse

__all__ = ["PULSE_MEASURES", "ComparedPulse", "MeasuredImpactStudy"]


Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class ComparedPulse:
    """One measured pulse, and the computed one at its time and height.

    Parameters
    ----------
    name, channel
        Of the recording; the channel with its unit.
    measured, computed
        In the unit of the output, each on its own clock.
    factor [-]
        Measured over computed; 1 unless ``fitted``.
    shift [s]
        Computed time minus measured time.
    rms [-]
        Of the difference, over the measured plateau.
    absolute
        False if the recording names no unit of the output, or a scale that klack does not know.
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
    """An impact beside measured pulses of one channel.

    Parameters
    ----------
    output, label, unit
        Name of the channel, what it is, and its unit.
    speed [m/s]
        That was computed.
    time (n,) [s]
        From half of the plateau in the front of the computed pulse.
    measured (recordings, n)
        Over their factors: at the computed speed, upwards.
    middle, low, high (n,)
        Median, 5 % and 95 % of the recordings.
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


_US = ("us", 1e6, ".2f")


def _pair(key: str, definition: str) -> tuple[Measure[ComparedPulse], ...]:
    words = key.replace("_", " ")
    return (
        Measure(
            key=f"measured_{key}",
            unit="s",
            definition=f"{definition} For the measured pulse.",
            read=lambda pulse: getattr(pulse.measured, key),
            column=Column(*_US, f"{words}, measured"),
            page=True,
        ),
        Measure(
            key=f"computed_{key}",
            unit="s",
            definition=f"{definition} For the computed pulse.",
            read=lambda pulse: getattr(pulse.computed, key),
            column=Column(*_US, "computed"),
            page=True,
        ),
    )


PULSE_MEASURES: tuple[Measure[ComparedPulse], ...] = described_in(
    "reference/measured",
    Measure(
        key="factor",
        definition="Measured over computed: the single factor that is fitted, unless the speed "
        "is known.",
        column=Column("", 1.0, ".4f"),
        page=True,
    ),
    Measure(
        key="shift",
        unit="s",
        definition="Fitted time shift, computed minus measured pulse.",
    ),
    Measure(
        key="measured_plateau",
        unit="1",
        definition="Mean over the middle half of the measured pulse, in SI.",
        read=lambda pulse: pulse.measured.plateau,
    ),
    Measure(
        key="rms",
        definition="Root mean square of the difference over the measured plateau, from 20 % of "
        "the length before the front to 20 % after the end.",
        form="share",
        digits=2,
        column=Column("%", 100.0, ".2f", "rms"),
        page=True,
    ),
    *_pair("length", "Between the crossings of half the plateau."),
    Measure(
        key="length_difference",
        definition="Computed length over the measured one, minus 1.",
        form="signed share",
        digits=2,
        column=Column("%", 100.0, "+.2f", "length, difference"),
        page=True,
    ),
    *_pair("rise", "From 10 to 90 % of the plateau."),
    *_pair("fall", "From 90 to 10 % of the plateau."),
    Measure(
        key="measured_peak",
        definition="Highest value of the measured pulse over its plateau.",
        read=lambda pulse: pulse.measured.peak,
        column=Column("", 1.0, ".3f", "peak / plateau, measured"),
    ),
    Measure(
        key="computed_peak",
        definition="Highest value of the computed pulse over its plateau.",
        read=lambda pulse: pulse.computed.peak,
        column=Column("", 1.0, ".3f", "computed"),
    ),
    Measure(
        key="measured_ripple",
        definition="Standard deviation of the measured plateau over its mean.",
        read=lambda pulse: pulse.measured.ripple,
        form="share",
    ),
    Measure(
        key="computed_ripple",
        definition="Standard deviation of the computed plateau over its mean.",
        read=lambda pulse: pulse.computed.ripple,
        form="share",
    ),
    *_pair("ripple_period", "From the first to the second crest after the front."),
)
"""Of one recording; catalogue of its page."""
