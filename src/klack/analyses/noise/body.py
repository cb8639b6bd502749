r"""What the forces of the stops do to one held body: energy, mobility, hold, radiation.

Springs, magnets and fluid push the needle from the same housing that the needle hits.  As long as
nothing but the needle moves, the resultant of all forces on the housing is minus the mass times
acceleration of the needle,

.. math:: \sum F_\text{contact} + \sum F_\text{other} = - m\, \ddot x .

At high frequencies the contact forces are all of it.  Below about one over the time of flight they
are balanced by the others almost completely: a needle that is pressed on its seat by a spring makes
no noise.  The share of the energy that is left per band,

.. math:: s_b = \min\left(1, \frac{\int_b |m \ddot x|^2}{\sum_s \int_b |F_s|^2}\right),

is taken on all ways from the force to the ear, where nothing says on which surfaces the others act.
With ``noise.mounts`` all forces act at their places, with their signs, and no share is needed.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.boundary.over_frequency import SurfaceRadiation
from klack.acoustics.force_bands import force_bands
from klack.acoustics.force_response import modal_response, port_forces
from klack.acoustics.injected import injected_density, injected_energy
from klack.acoustics.interface import (
    Complexes,
    Freedom,
    InterfacePoint,
    Receiver,
    ReceiverResponse,
)
from klack.acoustics.mobility import transfer_mobility
from klack.acoustics.mount import Mount, mounted
from klack.acoustics.plate import Air, Plate
from klack.acoustics.radiation import Efficiency, power_transfer
from klack.acoustics.surface_bands import Pushed, surface_spectra
from klack.acoustics.third_octave import ThirdOctaves
from klack.analyses.noise.machine import Machine
from klack.analyses.noise.record import BodyNoise, Surface
from klack.bodies.reduction.structure import Structure
from klack.signals.sampled import TimeSeries

__all__ = [
    "ASSUMED_DAMPING",
    "Elements",
    "Surroundings",
    "Transfers",
    "body_noise",
    "net_share",
    "port_transfers",
    "share_at",
]


Floats = NDArray[np.float64]

_SMALLEST = 1e-30


def net_share(net: TimeSeries | None, bands: Sequence[ThirdOctaves]) -> Floats:
    """Unbalanced share (b,) of the energy of all stops per band.

    Parameters
    ----------
    net [N]
        Mass times acceleration of the needle, means over intervals; None for all of it.
    bands
        Of each stop; those above a tenth of the sampling rate of ``net`` count in full.
    """
    total = np.sum([octaves.energy for octaves in bands], axis=0)
    share = np.ones(total.size)
    if net is None:
        return share
    left = force_bands(_at_rest_outside(net))
    known = min(left.energy.size, total.size)
    share[:known] = left.energy[:known] / np.maximum(total[:known], 1e-300)
    return np.clip(share, _SMALLEST, 1.0)


def share_at(frequency: Floats, bands: ThirdOctaves, share: Floats) -> Floats:
    """Share at frequencies [Hz], linear in logarithms between bands."""
    level = np.interp(np.log(frequency), np.log(bands.middle), np.log(share))
    return np.asarray(np.exp(level))


def _at_rest_outside(net: TimeSeries) -> TimeSeries:
    """With a zero on both sides: no push outside of the record."""
    return TimeSeries(
        step=net.step,
        values=np.pad(net.values, 1),
        unit=net.unit,
        start=net.start - net.step,
        name=net.name,
    )


Elements = tuple[Mapping[str, SurfaceRadiation], str]
"""Radiation of each body by boundary elements, or why there is none."""

ASSUMED_DAMPING = 0.005
"""Damping ratio of radiating modes where the case gives none."""
_LOWEST, _HIGHEST = 20.0, 400e3  # [Hz] of mobilities
_AUDIBLE = 24e3  # [Hz]
_LINES, _ROUND_A_PEAK = 1200, 40
_MOST_TRANSFERS = 32
_LONGEST = 4_000_000  # values of a spectrum that resolves every resonance


@dataclass(frozen=True, kw_only=True)
class Surroundings:
    """What is below a held body, and the air.

    ``period`` [s] is from click to click, ``share`` (b,) [-] that of :func:`net_share`, 1 where all
    forces act at their places; bodies in ``elements`` radiate by those.
    """

    mount: Mount | None
    plate: Plate | None
    air: Air
    efficiency: Literal["piston", "unity"]
    period: float
    share: Floats
    octaves: ThirdOctaves
    elements: Mapping[str, SurfaceRadiation] = field(default_factory=dict)

    def radiation_of(self, structure: Structure) -> Efficiency:
        """By boundary elements where there are any."""
        return self.elements.get(structure.name, self.efficiency)


def body_noise(
    structure: Structure,
    stop_forces: Mapping[str, TimeSeries],
    around: Surroundings,
    acting: Mapping[str, TimeSeries] | None = None,
    *,
    others: Sequence[Pushed] = (),
    alone: bool = True,
) -> BodyNoise | None:
    """Vibration and radiation of one body, if a stop pushes it.

    It is rigidly held, as the forces [N] of the stops were computed.  Its surface moves under those
    ``acting`` at its ports, and under ``others`` on the same mount; without them under those of the
    stops.  What mount and plate take counts only where it stands ``alone`` on them, or for all.
    """
    forces = port_forces(structure, stop_forces)
    if not forces:
        return None
    moved = modal_response(structure, forces)
    sounding = damped(structure)
    bands = np.column_stack([around.octaves.low, around.octaves.high])
    frequency = frequency_lines(structure, None, _LOWEST, _HIGHEST)
    spectra = surface_spectra(
        sounding,
        acting or forces,
        bands,
        mount=around.mount,
        plate=around.plate,
        others=[item for item in others if item[1]],
    )
    plain = spectra if alone else replace(spectra, plate=None)
    estimate = plain.radiated(efficiency=around.radiation_of(structure), air=around.air)
    equivalent = plain.radiated(efficiency="unity", air=around.air)
    velocity = spectra.face_velocity(period=around.period)
    area = list(structure.group_area) + [np.nan] * (len(estimate.names) - len(structure.group_area))
    ports = tuple(forces)
    stops = dict(zip(structure.port_names, structure.port_stops, strict=True))
    return BodyNoise(
        name=structure.name,
        mass=structure.mass,
        highest_frequency=structure.highest_frequency,
        modes=structure.omega.size,
        ports=ports,
        stops=tuple(stops[port] for port in ports),
        injected=np.array([moved.injected[structure.port_index(port)] for port in ports]),
        vibration_energy=moved.vibration_energy,
        vibration_spectral=_by_mobility(structure, forces),
        dissipated=float(moved.dissipated.sum()),
        ringing=float(moved.ringing.sum()),
        static_energy=moved.injected_energy - moved.vibration_energy,
        residual=moved.residual,
        assumed=sounding is not structure,
        frequency=frequency,
        mobility=np.array(
            [[transfer_mobility(sounding, a, b, frequency) for b in ports] for a in ports]
        ),
        blocked=moved.blocked_force,
        blocked_bands=force_bands(moved.blocked_force),
        groups=estimate.names,
        area=np.array(area),
        radiated=estimate.energy * around.share,
        upper_bound=equivalent.energy * around.share,
        support_energy=float(spectra.support_energy() @ around.share) if alone else 0.0,
        surface=Surface(
            points=structure.points,
            faces=structure.faces,
            face_group=structure.face_group,
            velocity=(velocity * np.sqrt(around.share)[:, None]).astype(np.float32),
        ),
    )


class _Remembered:
    """A receiver that answers the same ``s`` again at once."""

    def __init__(self, receiver: Receiver) -> None:
        self.points, self.freedoms = receiver.points, receiver.freedoms
        self.ears = receiver.ears
        self._receiver, self._last = receiver, None

    points: tuple[InterfacePoint, ...]
    freedoms: tuple[Freedom, ...]
    ears: tuple[str, ...]
    _last: tuple[Complexes, ReceiverResponse] | None

    def at(self, s: Complexes) -> ReceiverResponse:
        """As the receiver does."""
        last = self._last  # threads of a study share it
        if last is None or not np.array_equal(last[0], s):
            last = s, self._receiver.at(s)
            self._last = last
        return last[1]


class Transfers:
    """Radiated power per force of ports, and the machine, kept for runs of the same bodies."""

    def __init__(self) -> None:
        self._machine: tuple[tuple[object, ...], Machine] | None = None
        self._found: dict[tuple[object, ...], tuple[Floats, Floats]] = {}
        self._elements: dict[tuple[object, ...], Elements] = {}

    def machine(self, described: tuple[object, ...], make: Callable[[], Machine]) -> Machine:
        """The machine of a case, made and answered once while what describes it stays."""
        kept = self._machine  # threads of a study share it
        if kept is None or kept[0] != described:
            made = make()
            kept = described, replace(made, receiver=_Remembered(made.receiver))
            self._machine = kept
        return kept[1]

    def elements(
        self, structures: tuple[Structure, ...], sound_speed: float, compute: Callable[[], Elements]
    ) -> Elements:
        """Boundary elements of bodies in air, computed once."""
        key = (*structures, sound_speed)
        if key not in self._elements:
            if len(self._elements) >= _MOST_TRANSFERS:
                self._elements.clear()
            self._elements[key] = compute()
        return self._elements[key]

    def of(self, structure: Structure, port: str, around: Surroundings) -> tuple[Floats, Floats]:
        """Audible frequencies [Hz] and radiated power [W/N^2] of a port."""
        radiation = around.radiation_of(structure)
        key = (structure, port, around.mount, around.plate, around.air, radiation)
        found = self._found.get(key)
        if found is None:
            sounding = damped(structure)
            frequency = frequency_lines(sounding, around.mount, 15.0, _AUDIBLE)
            transfer = power_transfer(
                sounding,
                frequency,
                port,
                mount=around.mount,
                plate=around.plate,
                efficiency=radiation,
                air=around.air,
            )
            found = frequency, transfer.total
            if len(self._found) >= _MOST_TRANSFERS:  # of other mounts
                self._found.clear()
            self._found[key] = found
        return found


def port_transfers(
    structure: Structure,
    forces: Mapping[str, TimeSeries],
    around: Surroundings,
    transfers: Transfers,
) -> list[tuple[TimeSeries, Floats, Floats]]:
    """Force [N], audible frequencies [Hz] and radiated power [W/N^2] of every pushed port."""
    found = []
    for port, force in forces.items():
        frequency, transfer = transfers.of(structure, port, around)
        left = share_at(frequency, around.octaves, around.share)
        found.append((force, frequency, transfer * left))
    return found


def damped(structure: Structure) -> Structure:
    """Give undamped modes, which would ring and radiate without end, the assumed damping.

    Layers alone leave all modes undamped that do not strain them: what they lose is added.
    """
    has_own = structure.has_own_damping & (structure.damping > 0.0)
    if np.all(has_own):
        return structure
    damping = structure.damping + np.where(has_own, 0.0, ASSUMED_DAMPING)
    return replace(structure, damping=damping, has_own_damping=True)


def frequency_lines(structure: Structure, mount: Mount | None, low: float, high: float) -> Floats:
    """Rising frequencies [Hz] that resolve every resonance, also on the mount."""
    kinds = [damped(structure)]
    if mount is not None:
        kinds.append(mounted(kinds[0], mount))
    lines = [np.geomspace(low, high, _LINES)]
    # denser towards each peak: half widths by the tangent of even angles
    offsets = np.tan(np.linspace(-1.55, 1.55, _ROUND_A_PEAK))
    for kind in kinds:
        for omega, damping in zip(kind.omega, kind.damping, strict=True):
            f = omega / (2.0 * np.pi)
            if f < 1.2 * high:
                lines.append(f * (1.0 + np.append(damping, 1e-4) * offsets[:, None]).ravel())
    whole = np.unique(np.concatenate(lines))
    return np.asarray(whole[(whole >= low) & (whole <= high)])


def _by_mobility(structure: Structure, forces: Mapping[str, TimeSeries]) -> float:
    """Vibration energy by ``int 2 Re(Y) |F|^2 df`` [J]; nan if the lines are too narrow."""
    width = structure.damping * structure.omega / (2.0 * np.pi)
    step = next(iter(forces.values())).step
    if not np.all(width > 0.0) or 3.0 / (width.min() * step) > _LONGEST:
        return float("nan")
    return injected_energy(injected_density(structure, forces))
