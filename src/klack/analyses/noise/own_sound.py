r"""Sound of a valve's own surface around it, by boundary elements: with phase, over angle and time.

All bodies add with their phases,

.. math:: \hat p(f, \theta) = \frac{\rho c}{r} \sum_s D_s(f, \theta)\, y_s(f),

with the velocity spectra :math:`y_s` of the fields of each body under all forces.  It is the far
field, in the free, without the travel time, up to where the elements hold; on one mount all bodies
move alike, and its motion counts once.
"""

import warnings
from collections.abc import Mapping

import numpy as np
import scipy

from klack.acoustics.boundary.over_frequency import ANGLES
from klack.acoustics.interface import Complexes
from klack.acoustics.sound import audio_band
from klack.acoustics.spectrum import change_spectrum
from klack.acoustics.surface_bands import pushed_fields
from klack.analyses.noise.body import Surroundings, damped
from klack.analyses.noise.record import SurfaceSound
from klack.analyses.noise.source import NoiseSource
from klack.arrays import Vector
from klack.errors import AccuracyWarning
from klack.signals.sampled import TimeSeries
from klack.units import format_si

__all__ = ["own_sound"]

_RATE = 48e3  # [Hz] of sound
_HEARING = 20e3  # [Hz]
_EDGE = 1.01 * 10**0.05  # over the middle of a band, with a margin
_LEAD, _RINGS = 5e-3, 0.03  # [s] before the forces and after them
_MOST = 40000  # lines; a record is at most half of the period that they make
_RUNG = 1e-4  # share of the energy that is cut off


def own_sound(
    source: NoiseSource,
    acting: Mapping[str, Mapping[str, TimeSeries]],
    around: Surroundings,
    distance: float,
) -> SurfaceSound | None:
    """Of one click, where boundary elements know the far pressure of all bodies.

    Parameters
    ----------
    acting [N]
        By body and port.
    distance [m]
    """
    used = [own for own in source.structures if own.name in around.elements]
    forces = [force for own in used for force in acting[own.name].values()]
    if not forces or not all(around.elements[own.name].far.shape[1] for own in used):
        return None
    begin = min(force.start - 0.5 * force.step for force in forces) - _LEAD
    span = max(force.values.size * force.step for force in forces)
    length = span + _LEAD + _RINGS
    if length * _RATE > _MOST:
        _warn(
            f"is left out: its forces last {format_si(span, 's', 3)}, more than "
            f"{format_si(_MOST / _RATE - _LEAD - _RINGS, 's', 2)}. Try: a shorter run.duration"
        )
        return None
    count = min(int(np.ceil(2.0 * length * _RATE)), _MOST)
    f = np.linspace(0.0, 0.5 * _RATE, count + 1)

    def spectrum_of(force: TimeSeries) -> tuple[Vector, Complexes]:
        changes = change_spectrum(force, high=float(f[-1]), count=f.size, origin=begin)
        return f[1:], np.asarray(changes[1:] / (2j * np.pi * f[1:]))

    together = source.held is not None
    pressure = np.zeros((count, ANGLES.size), dtype=complex)
    for k, own in enumerate(used):
        others = [(damped(x), acting[x.name]) for x in used if x is not own and acting[x.name]]
        if not acting[own.name] and not (together and others):
            continue
        pushed = damped(own), acting[own.name]
        fields, _ = pushed_fields(
            pushed, others if together else (), spectrum_of, around.mount, around.plate
        )
        if together and k:
            fields[:, -1] = 0.0
        pressure += around.elements[own.name].far_pressure(f[1:], fields)
    share = np.interp(f[1:], around.octaves.middle, np.sqrt(around.share))
    pressure *= around.air.impedance / distance * share[:, None]
    top = min(_HEARING, *(around.elements[own.name].holds_up_to for own in used))
    heard = around.octaves.high <= _EDGE * top
    if not np.any(heard):
        return None
    pressure[f[1:] > _EDGE * top] = 0.0
    low, high = around.octaves.low[heard, None], around.octaves.high[heard, None]
    df = float(f[1])
    inside = np.minimum(f[1:] + df / 2, high) - np.maximum(f[1:] - df / 2, low)
    limited = np.vstack(
        [np.zeros(2), pressure[:, [0, ANGLES.size // 2]] * audio_band(f[1:])[:, None]]
    )
    values = scipy.fft.irfft(limited, 2 * count, axis=0) * _RATE
    most = 3 * count // 2  # of the period: at its end is what sharp ends of the band ring before
    energy = np.cumsum(np.sum(values[:most] ** 2, axis=1))
    kept = max(int(length * _RATE), int(np.searchsorted(energy, (1.0 - _RUNG) * energy[-1])))
    if kept > 0.9 * most:
        _warn(
            f"rings for longer than {format_si(most / _RATE, 's', 2)}: its end is added to "
            "its beginning. Try: the damping of the mounted valve"
        )
    axis, side = (
        TimeSeries(step=1.0 / _RATE, start=begin, values=column[:kept].copy(), unit="Pa", name=name)
        for column, name in zip(values.T, ("on the axis", "beside"), strict=True)
    )
    return SurfaceSound(
        angle=ANGLES,
        middle=around.octaves.middle[heard],
        exposure=np.maximum(inside, 0.0) @ (2.0 * np.abs(pressure) ** 2),
        axis=axis,
        side=side,
    )


def _warn(what: str) -> None:
    warnings.warn(
        f"The sound of the valve's own surface over angle and time {what}.",
        AccuracyWarning,
        stacklevel=3,
    )
