r"""Time signals of a source on a receiver.

**Models** are evaluated beside the axis of frequency, :math:`s = \alpha + i\omega` with
:math:`\alpha T = 13.8` in a record of the length :math:`T` (numerical Laplace inversion).  What
has not decayed at the end then comes back at the beginning weaker by :math:`e^{-13.8}`, where a
plain Fourier transform folds it in whole; the first half of the record is kept.  All laws must
hold at ``s``: modal damping does, a constant loss factor does not.

**Measured** responses exist on the axis alone, at lines ``df`` apart, and a record of ``1/df``
must hold all of the ringing.  So the energy before time zero and at the end of the record is
judged, and the time signal refused where it is too much.  Nothing is extrapolated: the ends of the
measured band are faded by half a cosine over one third octave.  A band that begins above 0 rings
before its cause, about three periods of its lowest frequency; these belong to the signal.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from klack.acoustics.coupling import Coupled
from klack.acoustics.interface import Complexes, SourceAtMounts
from klack.arrays import Matrix, Vector
from klack.errors import InputError, refuse_if, require_positive
from klack.signals.sampled import TimeSeries

__all__ = ["CoupledSignal", "measured_signal", "model_signal"]

_DECAYS = 13.8  # alpha T: what is left at the end is 1e-6 of what it was
_RINGING = 1e-4  # share of the energy in the last tenth before what precedes time zero
_BEFORE = 1e-3  # share of the energy before time zero
_THIRD = 2.0 ** (1.0 / 3.0)
_PERIODS = 3.0  # of the lowest frequency, in which a band that begins there rings before its cause

SourceAt = Callable[[Vector, float], SourceAtMounts]
"""Source at frequencies (k,) [Hz] and a shift [1/s]."""
Coupling = Callable[[SourceAtMounts], Coupled]
"""What joins a source to its receiver."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CoupledSignal:
    """Signals over time.

    Parameters
    ----------
    step [s]
    start [s]
        Time of the first value; the source's spectra count from 0.
    force, velocity (t, n) [N], [m/s]
        On the receiver and of it, by freedom.
    source_velocity (t, n) [m/s]
        On the source's side.
    pressure (t, ears) [Pa]
    notes
        What was done to the ends of a measured band.
    """

    step: float
    start: float = 0.0
    ears: tuple[str, ...]
    force: Matrix
    velocity: Matrix
    source_velocity: Matrix
    pressure: Matrix
    notes: tuple[str, ...] = ()

    def ear(self, name: str) -> TimeSeries:
        """Sound pressure at one ear [Pa]."""
        refuse_if(
            name not in self.ears,
            "ear",
            got=f"'{name}'",
            expected=f"one of: {', '.join(self.ears) or '(none)'}",
            hint="ears are pressures per force in the receiver's responses.",
        )
        values = self.pressure[:, self.ears.index(name)]
        return TimeSeries(step=self.step, start=self.start, values=values, unit="Pa", name=name)


def model_signal(
    source: SourceAt, coupling: Coupling, *, step: float, duration: float
) -> CoupledSignal:
    """Signals of a source and a receiver that both are models.

    Parameters
    ----------
    source
        Its spectra must have died out at ``1 / (2 step)``.
    step, duration [s]
    """
    require_positive("model_signal: step", step, "s")
    require_positive("model_signal: duration", duration, "s")
    kept = max(round(duration / step), 2)
    count = scipy.fft.next_fast_len(2 * kept, real=True)
    shift = _DECAYS / (count * step)
    joined = coupling(source(scipy.fft.rfftfreq(count, step), shift))
    growth = np.exp(shift * step * np.arange(kept))[:, None]

    def over_time(spectra: Complexes) -> Matrix:
        values = scipy.fft.irfft(spectra, count, axis=0, overwrite_x=False)[:kept]
        return np.asarray(values * growth / step)

    return CoupledSignal(
        step=step,
        ears=joined.ears,
        force=over_time(joined.force),
        velocity=over_time(joined.velocity),
        source_velocity=over_time(joined.source_velocity),
        pressure=over_time(joined.pressure),
    )


def measured_signal(
    source: SourceAt, coupling: Coupling, frequency: Vector, *, step: float
) -> CoupledSignal:
    """Signals at a receiver that is known at lines of frequency alone.

    Parameters
    ----------
    frequency (k,) [Hz]
        Measured lines: multiples of one distance.
    step [s]
        Rounded so that a whole number of steps makes the record.

    Raises
    ------
    InputError
        Where the lines are uneven, or the record they make does not hold the ringing.
    """
    require_positive("measured_signal: step", step, "s")
    apart = float(np.median(np.diff(frequency)))
    place = frequency / apart
    even = float(np.abs(place - np.round(place)).max())
    refuse_if(
        even > 1e-3 or not np.all(np.diff(np.round(place)) == 1.0),
        "time signal",
        got=f"frequency lines that are not multiples of {apart:.4g} Hz",
        expected="evenly spaced lines at multiples of the spacing",
        hint="use the spectra, or export the responses on an even grid from 0 Hz.",
    )
    joined = coupling(source(frequency, 0.0))
    count = round(1.0 / (apart * step))
    step = 1.0 / (apart * count)  # a whole number of steps to the record
    first, last = round(float(place[0])), round(float(place[-1]))
    fade, notes = _fade(frequency, whole=first <= 1)
    refuse_if(
        count < 2 * last,
        "time signal: step",
        got=f"{step:.3g} s",
        expected=f"at most {0.5 / frequency[-1]:.3g} s for a band up to {frequency[-1]:.4g} Hz",
        hint="take a smaller step.",
    )

    def over_time(spectra: Complexes) -> Matrix:
        full = np.zeros((count // 2 + 1, spectra.shape[1]), dtype=complex)
        full[first : last + 1] = spectra * fade[:, None]
        return np.asarray(scipy.fft.irfft(full, count, axis=0) * (apart * count))

    before = count // 20  # of the record is what precedes time zero
    early = 0 if first <= 1 else min(round(_PERIODS / (frequency[0] * step)), before // 2)
    velocity, pressure = over_time(joined.velocity), over_time(joined.pressure)
    for name, values in (("velocity", velocity), ("pressure", pressure)):
        _judge(name, values, count - before, count - early, apart)

    def kept(values: Matrix) -> Matrix:
        return np.roll(values, early, axis=0)[: count - before]

    return CoupledSignal(
        step=step,
        start=-early * step,
        ears=joined.ears,
        force=kept(over_time(joined.force)),
        velocity=kept(velocity),
        source_velocity=kept(over_time(joined.source_velocity)),
        pressure=kept(pressure),
        notes=notes,
    )


def _fade(frequency: Vector, *, whole: bool) -> tuple[Vector, tuple[str, ...]]:
    """Half cosines over the last third octave, and over the first where the band begins above 0."""
    top, bottom = frequency[-1], frequency[0]
    falling = np.clip((frequency - top / _THIRD) / (top - top / _THIRD), 0.0, 1.0)
    fade = 0.5 * (1.0 + np.cos(np.pi * falling))
    notes = [f"Faded out from {top / _THIRD:.5g} to {top:.5g} Hz, where the responses end."]
    if not whole:
        rising = np.clip((frequency - bottom) / (bottom * _THIRD - bottom), 0.0, 1.0)
        fade *= 0.5 * (1.0 - np.cos(np.pi * rising))
        notes.append(
            f"Nothing below {bottom:.4g} Hz, where the responses begin; faded in to "
            f"{bottom * _THIRD:.4g} Hz."
        )
    return fade, tuple(notes)


def _judge(name: str, values: Matrix, last: int, cause: int, apart: float) -> None:
    """Refuse a record that ends before its ringing, or rings before its cause."""
    energy = np.sum(values**2, axis=1)
    whole = float(energy.sum())
    if whole == 0.0:
        return
    late = float(energy[last - values.shape[0] // 10 : last].sum()) / whole
    early = float(energy[last:cause].sum()) / whole
    if late < _RINGING and early < _BEFORE:
        return
    raise InputError(
        f"time signal of the {name}",
        got=f"{100 * late:.2g} % of the energy in the last tenth of {1.0 / apart:.3g} s and "
        f"{100 * early:.2g} % before its cause",
        expected=f"less than {100 * _RINGING:g} % and {100 * _BEFORE:g} %: ringing decays within "
        "the record, and none precedes its cause",
        hint="measure lines closer together (or with the damping of the mounted machine), or use "
        "the spectra, which remain valid.",
    )
