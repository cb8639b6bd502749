"""A valve in its machine: interface forces, energy by freedom, paths to the ears, sound."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from klack.acoustics.coupled_signal import CoupledSignal, measured_signal, model_signal
from klack.acoustics.coupling import Coupled, Junction, joined, power_balance
from klack.acoustics.in_situ import virtual_test
from klack.acoustics.interface import SourceAtMounts
from klack.acoustics.signal_statistics import weighting
from klack.acoustics.sound import audio_band
from klack.acoustics.source_levels import exposure
from klack.acoustics.third_octave import ThirdOctaves, band_energies
from klack.analyses.noise.machine import Machine, machine_of
from klack.analyses.noise.mount_source import lowest_band, source_of
from klack.analyses.noise.record import (
    EarSound,
    InMachine,
    InSituFreedom,
    InterfaceFreedom,
    PathSound,
    VirtualTestResult,
)
from klack.analyses.noise.source import NoiseSource
from klack.arrays import Vector
from klack.errors import InputError
from klack.signals.sampled import Spectrum, TimeSeries
from klack.units import format_si

__all__ = ["Installed", "in_machine", "installed"]

_HIGHEST = 20e3  # [Hz]
_RATE = 48e3  # [Hz] of sound
_LEAD = 5e-3  # [s] of silence before the record
_APART, _MOST = 10.0, 16000  # [Hz] between lines at first, and lines
_SETTLED = 0.01  # change of the energy when every second line is left out
_RUNG = 1e-4  # share of the energy in the last tenth of a model's record
_LONGEST = 0.8  # [s]
_CUT = (
    f"The sound at the ears ends {_LONGEST:g} s after it begins, while forces act or the machine "
    "rings: peak, loudness and files refer to this part, exposures to the whole sound."
)
_FELT = 0.01  # velocity of the mounts over that of the needle
_ROUND_OFF = 1e-9  # of what swings to and fro
_LEFT_OUT = 0.01  # share of the blocked force outside of the measured band

SourceAt = Callable[[Vector, float], SourceAtMounts]


@dataclass(frozen=True, kw_only=True, eq=False)
class Installed:
    """A source on its machine: ``at`` frequencies and a shift, and the record [s] of its forces.

    ``moves``: they are those of a run on this machine.
    """

    at: SourceAt
    machine: Machine
    span: float
    top: float
    moves: bool = False

    def signal(self) -> tuple[CoupledSignal | None, str]:
        """Signals up to 20 kHz, beginning 5 ms before the forces, or why there are none."""
        if self.machine.causal:
            return self._of_models(), ""
        try:
            return self._on_lines(), ""
        except InputError as error:
            return None, " ".join(str(error).split())

    def pressures(self) -> tuple[tuple[TimeSeries, ...], str]:
        """Sound pressure of one click at each ear [Pa], or why there is none."""
        found, why = self.signal()
        return (() if found is None else ear_pressures(found)), why

    def _heard(self, frequency: Vector, shift: float) -> SourceAtMounts:
        """The source in the band of hearing, delayed by the lead."""
        source = self.at(frequency, shift)
        factor = (audio_band(frequency) * np.exp(-source.s * _LEAD))[:, None]
        return replace(
            source,
            free_velocity=source.free_velocity * factor,
            blocked_force=source.blocked_force * factor,
        )

    def _of_models(self) -> CoupledSignal:
        duration = 2.0 * (self.span + _LEAD) + 0.1
        while True:
            duration = min(duration, _LONGEST)
            found = model_signal(
                self._heard, self.machine.coupled, step=1.0 / _RATE, duration=duration
            )
            energy = np.sum(found.velocity**2, axis=1)
            tail = float(energy[-energy.size // 10 :].sum())
            whole = self.span + _LEAD <= duration and tail <= _RUNG * float(energy.sum())
            if whole or duration >= _LONGEST:
                is_told = whole or not found.ears
                return found if is_told else replace(found, notes=(*found.notes, _CUT))
            duration *= 2.0

    def _on_lines(self) -> CoupledSignal:
        """On lines that divide the rate of the sound; of models finer until all has rung."""
        if self.machine.known is not None:
            frequency = even_lines(self.machine.known, 0.98 * 0.5 * _RATE)
            return measured_signal(self._heard, self.machine.coupled, frequency, step=1.0 / _RATE)
        apart = 1.0 / max(4.0 * (self.span + _LEAD), 0.1)
        while True:
            frequency = even_lines((0.0, np.inf, apart), 0.98 * 0.5 * _RATE, 8 * _MOST)
            try:
                return measured_signal(
                    self._heard, self.machine.coupled, frequency, step=1.0 / _RATE
                )
            except InputError:
                apart /= 2.0
                if apart < 0.25 / _LONGEST:
                    raise


def even_lines(known: tuple[float, float, float], top: float, most: int = _MOST) -> Vector:
    """Lines [Hz] at even distances within a range, at multiples that divide the rate of sound."""
    low, high, apart = known
    apart = _RATE / np.ceil(_RATE / max(apart, (min(high, top) - low) / most) - 1e-6)
    first = max(int(np.ceil(low / apart - 1e-6)), 1)
    last = int(np.floor(min(high, top) / apart + 1e-6))
    return np.clip(apart * np.arange(first, last + 1), low, high)


def ear_pressures(signal: CoupledSignal) -> tuple[TimeSeries, ...]:
    """Sound pressures at the ears, in the time of the forces [Pa]."""
    return tuple(replace(signal.ear(name), start=signal.start - _LEAD) for name in signal.ears)


def installed(
    source: NoiseSource,
    kept: Callable[[tuple[object, ...], Callable[[], Machine]], Machine] = (lambda _, make: make()),
) -> Installed | None:
    """The source of a run on the machine of its case, if there is one; ``kept`` may keep that."""
    if source.held is None or source.noise.receiver is None:
        return None
    at = source_of(source.structures, source.held)
    held = source.held
    points = at(np.array([100.0, 200.0]), 0.0).points
    return Installed(
        at=at,
        machine=kept(
            (source.noise, source.materials, [(p.name, *p.position.tolist()) for p in points]),
            lambda: machine_of(source.noise, source.materials, points),
        ),
        span=held.step * next(iter(held.forces.values())).shape[0],
        top=min(_HIGHEST, 0.1 / held.step),
        moves=source.run.endswith("mounted"),
    )


def in_machine(
    found: Installed, speed: float, *, in_situ: bool = False
) -> tuple[InMachine, tuple[TimeSeries, ...]]:
    """Record of the coupled valve, and its sound at each ear [Pa].

    Parameters
    ----------
    speed [m/s]
        Of the needle at its fastest impact.
    in_situ
        Add a virtual test.
    """
    machine = found.machine
    source, joint, coupled = _coupled(found)
    f, low = source.frequency, lowest_band(float(source.frequency[0]))
    lost, rest = power_balance(joint, coupled)
    kept = [source.freedoms.index(freedom) for freedom in coupled.freedoms]
    density = coupled.energy_density()
    signal, why = found.signal()
    moved = _motion(coupled, signal) / speed if speed > 0.0 else float("nan")
    notes = [*coupled.notes, *machine.notes, *_outside(found, f)]
    if why:
        notes.append(f"No signal over time at the machine: {why}")
    notes += signal.notes if signal is not None else ()
    if found.moves:
        notes.append(
            f"The valve itself moves in its run, with up to {100 * moved:.2g} % of the speed of "
            "its needle: its forces are valid only on this machine."
        )
    elif moved > _FELT:
        notes.append(
            f"On this machine the valve itself moves with up to {100 * moved:.2g} % of the speed "
            "of its needle: the impact force, computed for the rigidly held valve, is wrong by "
            "about as much."
            + " The variant dry-mounted of the stroke includes this motion."
            * machine.causal
        )
    record = InMachine(
        receiver=machine.words[0],
        elements=machine.words[1],
        frequency=f,
        freedoms=tuple(
            InterfaceFreedom(
                name=str(freedom),
                force=coupled.force[:, i].copy(),
                force_bands=exposure(f, coupled.force[:, i], low=low),
                blocked_bands=exposure(f, source.blocked_force[:, kept[i]], low=low),
                energy=_energy(coupled, i),
                energy_bands=_bands(f, density[:, i], low),
            )
            for i, freedom in enumerate(coupled.freedoms)
        ),
        element_loss=float(np.trapezoid(4.0 * lost, f)),
        balance=float(rest.max()),
        motion=moved,
        ears=tuple(_ear(coupled, e, low) for e in range(len(coupled.ears))),
        notes=tuple(dict.fromkeys(notes)),
        in_situ=_in_situ(source, joint) if in_situ else None,
    )
    return record, () if signal is None else ear_pressures(signal)


def _coupled(found: Installed) -> tuple[SourceAtMounts, Junction, Coupled]:
    """On lines fine enough for its resonances, where it is a model."""
    known = found.machine.known
    apart = _APART if known is None else known[2]
    while True:
        low, high = (0.0, np.inf) if known is None else known[:2]
        if known is not None and not low < found.top:
            raise InputError(
                f"noise.receiver: {found.machine.words[0]}",
                got=f"responses from {format_si(low, 'Hz')} upwards",
                expected=f"responses below {format_si(found.top, 'Hz')}",
                hint="measure the machine in the band of the click.",
            )
        source = found.at(even_lines((low, high, apart), found.top), 0.0)
        joint = found.machine.junction(source)
        coupled = joined(joint, source, found.machine.receiver.ears)
        energy, f = coupled.energy_density().sum(axis=1), source.frequency
        whole, half = np.trapezoid(energy, f), np.trapezoid(energy[::2], f[::2])
        fine = abs(whole - half) <= _SETTLED * abs(whole)
        if fine or known is not None or 2 * f.size > _MOST:
            return source, joint, coupled
        apart /= 2.0


def _energy(coupled: Coupled, i: int) -> float:
    """Into a freedom [J]; none where it is round-off of what swings to and fro."""
    f, density = coupled.frequency, coupled.energy_density()[:, i]
    size = 2.0 * np.abs(coupled.force[:, i] * coupled.velocity[:, i])
    found = float(np.trapezoid(density, f))
    return found if abs(found) > _ROUND_OFF * np.trapezoid(size, f) else 0.0


def _bands(f: Vector, density: Vector, low: float) -> ThirdOctaves:
    spectrum = Spectrum(frequency=f, values=density, unit="J/Hz")
    return band_energies(spectrum, low=max(float(f[0]), low), high=float(f[-1]))


def _ear(coupled: Coupled, e: int, low: float) -> EarSound:
    """Exposures at one ear, of the sum and of each path."""
    f, parts = coupled.frequency, coupled.contributions[:, e]
    whole = coupled.pressure[:, e]
    a = weighting(f, "A")
    heard = 2.0 * np.abs(a * whole) ** 2
    total = float(np.trapezoid(heard, f))
    paths = []
    for i, freedom in enumerate(coupled.freedoms):
        alone = float(np.trapezoid(2.0 * np.abs(a * parts[:, i]) ** 2, f))
        with_all = np.abs(a) ** 2 * 2.0 * np.real(np.conj(whole) * parts[:, i])
        paths.append(
            PathSound(
                name=str(freedom),
                bands=exposure(f, parts[:, i], low=low),
                exposure_A=alone,
                share=float(np.trapezoid(with_all, f)) / total if total > 0.0 else 0.0,
            )
        )
    return EarSound(
        name=coupled.ears[e],
        bands=exposure(f, whole, low=low),
        exposure_A=total,
        paths=tuple(paths),
    )


def _motion(coupled: Coupled, signal: CoupledSignal | None) -> float:
    """Highest velocity of the mounts along z [m/s]; a bound where it is not known over time."""
    along = [i for i, freedom in enumerate(coupled.freedoms) if freedom.index == 2]
    if not along:
        return 0.0
    if signal is not None:
        return float(np.abs(signal.source_velocity[:, along]).max())
    size = np.abs(coupled.source_velocity[:, along])
    return float(2.0 * np.trapezoid(size, coupled.frequency, axis=0).max())


def _outside(found: Installed, f: Vector) -> tuple[str, ...]:
    """What of the force lies outside of the measured band."""
    if found.machine.known is None:
        return ()
    lines = even_lines((0.0, np.inf, _APART), found.top)
    force = found.at(lines, 0.0).blocked_force
    density = np.abs(force) ** 2
    whole = np.trapezoid(density, lines, axis=0)
    outside = np.trapezoid(density * ((lines < f[0]) | (lines > f[-1]))[:, None], lines, axis=0)
    share = float(np.max(outside / np.maximum(whole, 1e-300), initial=0.0))
    if share <= _LEFT_OUT:
        return ()
    return (
        f"The machine was measured from {format_si(float(f[0]), 'Hz')} to "
        f"{format_si(float(f[-1]), 'Hz')}: {100 * share:.2g} % of the exposure of the blocked "
        f"force up to {format_si(found.top, 'Hz')} lies outside and is left out of forces, "
        "energies and sound.",
    )


def _in_situ(source: SourceAtMounts, joint: Junction) -> VirtualTestResult:
    places = {point.name: point.position for point in source.points}
    extra = [str(place) for place in joint.places if place.point not in places]
    test = virtual_test(joint, length=_length(source), indicators=extra or None)
    f = source.frequency
    low = lowest_band(float(f[0]))
    return VirtualTestResult(
        indicators=tuple(map(str, test.indicators)),
        freedoms=tuple(
            InSituFreedom(
                name=str(freedom),
                found=exposure(f, test.blocked_force[:, i], low=low),
                exact=exposure(f, test.exact[:, i], low=low),
            )
            for i, freedom in enumerate(test.freedoms)
        ),
        deviation=float(test.deviation.max()),
        condition=float(test.condition.max()),
    )


def _length(source: SourceAtMounts) -> float:
    """By which moments are scaled [m]: distance of the mounts, or by mobilities of one mount."""
    places = np.array([point.position for point in source.points])
    span = float(np.linalg.norm(np.ptp(places, axis=0)))
    if span > 0.0:
        return span
    own = np.abs(np.einsum("kii->ki", source.mobility)).mean(axis=0)
    turned = np.array([freedom.is_rotation for freedom in source.freedoms])
    if not turned.any() or turned.all():
        return 1.0
    return float(np.sqrt(own[~turned].mean() / own[turned].mean()))
