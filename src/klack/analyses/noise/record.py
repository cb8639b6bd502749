"""Record of a noise study."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.impulsive import Prominence
from klack.acoustics.interface import InterfacePoint, SourceAtMounts, freedoms_of
from klack.acoustics.loudness import Loudness
from klack.acoustics.signal_statistics import SoundStatistics
from klack.acoustics.third_octave import ThirdOctaves
from klack.analyses.record import Record
from klack.signals.sampled import TimeSeries

__all__ = [
    "BodyNoise",
    "ClickSound",
    "EarSound",
    "InMachine",
    "InSituFreedom",
    "InterfaceFreedom",
    "MountFreedom",
    "MountSource",
    "NoiseDesign",
    "NoiseSettings",
    "NoiseStudy",
    "PathSound",
    "StopForce",
    "Surface",
    "SurfaceSound",
    "VirtualTestResult",
]

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class StopForce:
    """Force of one stop over time and frequency.

    Parameters
    ----------
    stop
        Component; ``"contact"`` for an impact.
    peak_force [N]
        Largest mean over a step.
    impulse [N s]
        Of the whole record, with forces at rest.
    force [N]
        Means over steps, positive when it presses.
    first [N]
        The strongest impact alone.
    frequency, level (k,) [Hz], [dB re 1 uN s]
        Magnitude of the Fourier integral of the strongest impact.
    bands
        Of the whole record, 20 Hz to 200 kHz [N^2 s].
    """

    stop: str
    impacts: int
    peak_force: float
    impulse: float
    force: TimeSeries
    first: TimeSeries
    frequency: Floats
    level: Floats
    bands: ThirdOctaves


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """Faces of a body in the air and how fast they move in each band.

    Parameters
    ----------
    points (n, dimension) [m]
        (r, z) or (x, y, z).
    faces (f, 2) or (f, 3 or 4)
    face_group (f,)
    velocity (b, f) [m/s]
        Normal velocity, rms over one period of the drive pattern.
    """

    points: Floats
    faces: NDArray[np.int64]
    face_group: NDArray[np.int64]
    velocity: NDArray[np.float32]


@dataclass(frozen=True, kw_only=True, eq=False)
class BodyNoise:
    """A held body as the forces move it.

    ``p`` ports that are hit, ``b`` bands, ``g`` groups of the surface (the last one may be the
    plate), ``k`` frequencies.

    Parameters
    ----------
    mass [kg]
    highest_frequency [Hz]
        Highest kept mode.
    injected (p,) [J]
        ``int F v dt``: structure-borne energy through each port.
    vibration_energy [J]
        Lost in the modes, or still ringing at the end: by the motion over time.
    vibration_spectral [J]
        The same by ``int 2 Re(Y) |F|^2 df``; nan for a body without damping.
    dissipated, ringing [J]
        Parts of the vibration energy.
    static_energy [J]
        Stored statically at the end, less at the start: the rest of what was injected.
    residual [-]
        Of the balance of energy, over the energy turned over.
    assumed
        Whether the damping for radiation is assumed.
    frequency (k,) [Hz]
    mobility (p, p, k) [m/s/N]
        Drive-point on the diagonal, transfer beside it.
    blocked [N]
        Force on the rigid support.
    blocked_bands [N^2 s]
    area (g,) [m^2]
        Nan for the plate.
    radiated (g, b) [J]
        Estimated sound energy, on the mount and with the plate of the case.
    upper_bound (h, b) [J]
        Equivalent radiated energy ``rho c int v_n^2 dA dt`` of named surfaces and plate: radiation
        efficiency 1. Its name is that of former versions: it is no bound.
    support_energy [J]
        Through the held surfaces into mount and plate; nan in results of former versions.
    """

    name: str
    mass: float
    highest_frequency: float
    modes: int
    ports: tuple[str, ...]
    stops: tuple[str, ...]
    injected: Floats
    vibration_energy: float
    vibration_spectral: float
    dissipated: float
    ringing: float
    static_energy: float
    residual: float
    assumed: bool
    frequency: Floats
    mobility: NDArray[np.complex128]
    blocked: TimeSeries
    blocked_bands: ThirdOctaves
    groups: tuple[str, ...]
    area: Floats
    radiated: Floats
    upper_bound: Floats
    surface: Surface
    support_energy: float = float("nan")


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceSound:
    """Sound of one click by the valve's own surface, in the far field at the distance of the case.

    Parameters
    ----------
    angle (a,) [rad]
        From +z.
    middle (n,) [Hz]
    exposure (n, a) [Pa^2 s]
        By third octave.
    axis, side [Pa]
        Over time, at 0 and 90 degrees, without the travel time.
    """

    angle: Floats
    middle: Floats
    exposure: Floats
    axis: TimeSeries
    side: TimeSeries


@dataclass(frozen=True, kw_only=True, eq=False)
class ClickSound:
    """Estimated sound of one stroke.

    Parameters
    ----------
    pressure [Pa]
        Of one click, as ``statistics`` and ``loudness``; free field, at
        :attr:`NoiseSettings.distance`.
    bands [Pa^2 s]
        Sound exposures of one click.
    pattern
        Of the drive pattern, over whole periods.
    prominence
        Of the drive pattern; None in results of former versions.
    """

    pressure: TimeSeries
    statistics: SoundStatistics
    bands: ThirdOctaves
    pattern: SoundStatistics
    loudness: Loudness
    prominence: Prominence | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class MountFreedom:
    """One freedom of a mount; exposures of one click.

    Parameters
    ----------
    name
        ``flange.z``.
    position (3,) [m]
        Of its mount.
    free_velocity, blocked_force (k,) [m/s/Hz], [N/Hz]
        Of rotations 1/Hz, N m/Hz.
    velocity_bands, force_bands [(m/s)^2 s], [N^2 s]
    """

    name: str
    position: Floats
    free_velocity: NDArray[np.complex128]
    blocked_force: NDArray[np.complex128]
    velocity_bands: ThirdOctaves
    force_bands: ThirdOctaves


@dataclass(frozen=True, kw_only=True, eq=False)
class MountSource:
    """The valve as a source at its mounts; ``n`` freedoms, ``k`` frequencies.

    Parameters
    ----------
    frequency (k,) [Hz]
    mobility (k, n, n) [m/(N s), 1/(N s), 1/(N m s)]
    mass [kg]
        Of the held bodies.
    balance [-]
        Largest value of the sum of all forces on held bodies and of m a of what moves, less what
        enters, over the largest force; nan where it is not known.
    repaid, entering [-], [N]
        Largest force that took back energy of macro steps, over the largest force; and largest
        change of what enters by columns of fluid, mouths and from outside.
    equivalent_force, equivalent_velocity [N^2 s], [(m/s)^2 s]
        Single numbers of EN 15657 to 20 kHz, z along the normal of its plates; nan where the mounts
        are not in one plane across the axis.
    """

    frequency: Floats
    freedoms: tuple[MountFreedom, ...]
    mobility: NDArray[np.complex128]
    mass: float
    balance: float
    repaid: float = 0.0
    entering: float = 0.0
    equivalent_force: float = float("nan")
    equivalent_velocity: float = float("nan")

    def along(self, read: Callable[[MountFreedom], ThirdOctaves]) -> float:
        """Sum over all directions, without rotations, and bands."""
        own = [item for item in self.freedoms if item.name.split(".")[1] in ("x", "y", "z")]
        return float(sum(read(item).energy.sum() for item in own))

    def source(self) -> SourceAtMounts:
        """As what couples with a receiver."""
        places = {item.name.split(".")[0]: item.position for item in self.freedoms}
        return SourceAtMounts(
            frequency=self.frequency,
            points=tuple(InterfacePoint(name=n, position=x) for n, x in places.items()),
            freedoms=tuple(
                freedom
                for item in self.freedoms
                for freedom in freedoms_of(item.name.split(".")[0], [item.name.split(".")[1]])
            ),
            free_velocity=np.stack([item.free_velocity for item in self.freedoms], axis=1),
            blocked_force=np.stack([item.blocked_force for item in self.freedoms], axis=1),
            mobility=self.mobility,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class InterfaceFreedom:
    """One freedom between valve and machine; exposures of one click.

    Parameters
    ----------
    name
        ``flange.z``.
    force (k,) [N/Hz]
        On the machine; of rotations N m/Hz.
    force_bands, blocked_bands [N^2 s]
        Of that, and of the blocked force on the same lines.
    energy, energy_bands [J]
        Into the machine; below 0 where the freedom gives energy back.
    """

    name: str
    force: NDArray[np.complex128]
    force_bands: ThirdOctaves
    blocked_bands: ThirdOctaves
    energy: float
    energy_bands: ThirdOctaves


@dataclass(frozen=True, kw_only=True, eq=False)
class PathSound:
    """Contribution of one degree of freedom to an ear.

    Parameters
    ----------
    bands [Pa^2 s]
        By itself.
    exposure_A [Pa^2 s]
        By itself, A-weighted.
    share [-]
        Its part of the A-weighted exposure of all, with phase; all parts make 1.
    """

    name: str
    bands: ThirdOctaves
    exposure_A: float
    share: float


@dataclass(frozen=True, kw_only=True, eq=False)
class EarSound:
    """Sound of one click at one ear, by its spectrum.

    Parameters
    ----------
    bands [Pa^2 s]
    exposure_A [Pa^2 s]
    sound
        Over time; None where the responses do not hold the ringing.
    """

    name: str
    bands: ThirdOctaves
    exposure_A: float
    paths: tuple[PathSound, ...]
    sound: ClickSound | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class InSituFreedom:
    """Exposure of the blocked force of one freedom [N^2 s]: found, and that of the source."""

    name: str
    found: ThirdOctaves
    exact: ThirdOctaves


@dataclass(frozen=True, kw_only=True, eq=False)
class VirtualTestResult:
    """Blocked forces as a bench would find them in the machine, without noise.

    Parameters
    ----------
    freedoms
        In which the machine moves.
    deviation [-]
        Largest over the lines, moments scaled.
    condition
        Largest over the lines.
    """

    indicators: tuple[str, ...]
    freedoms: tuple[InSituFreedom, ...]
    deviation: float
    condition: float


@dataclass(frozen=True, kw_only=True, eq=False)
class InMachine:
    """The valve in the machine of its case; ``k`` frequencies.

    Parameters
    ----------
    receiver, elements
        In words; without elements joined rigidly.
    frequency (k,) [Hz]
    element_loss [J]
        Lost in the elements.
    balance [-]
        Largest sum of all powers over the largest of them.
    motion [-]
        Highest velocity of the mounts along z over that of the needle at its fastest impact.
    """

    receiver: str
    elements: str
    frequency: Floats
    freedoms: tuple[InterfaceFreedom, ...]
    element_loss: float
    balance: float
    motion: float
    ears: tuple[EarSound, ...]
    notes: tuple[str, ...]
    in_situ: VirtualTestResult | None = None

    @property
    def energy(self) -> float:
        """Into the machine through all freedoms [J]."""
        return sum(item.energy for item in self.freedoms)


@dataclass(frozen=True, kw_only=True)
class NoiseSettings:
    """Section ``noise`` of a case, in SI.

    Parameters
    ----------
    mount, plate
        In words; empty without.
    radiation
        ``"piston"``, ``"unity"`` or ``"elements"``.
    outside
        Closed surface of boundary elements, in words; empty without.
    distance [m]
    air_density [kg/m^3]
    sound_speed [m/s]
    rate [Hz]
        Strokes per second of the drive pattern.
    duration [s]
        Of the drive pattern.
    given
        Whether the case has such a section.
    background [dB re 20 uPa]
        A-weighted level of steady noise besides, which clicks stand out from.
    machine
        In words, with the elements between; empty without.
    ear
        Whose sound is that of the design; empty where it is an estimate at the distance.
    """

    mount: str
    plate: str
    radiation: str
    distance: float
    air_density: float
    sound_speed: float
    rate: float
    duration: float
    given: bool
    background: float | None = None
    outside: str = ""
    machine: str = ""
    ear: str = ""


@dataclass(frozen=True, kw_only=True, eq=False)
class NoiseDesign:
    """One design: a stroke or an impact from force to ear.

    Parameters
    ----------
    name
        Short and unique.
    label, detail
        For a legend; what was run.
    kind
        ``"impact"`` or ``"stroke"``.
    run
        Name of the variant or level.
    valid_from, valid_up_to [Hz]
        One over the record, 0 if every force ends as it began; lowest of the bodies' highest kept
        modes, nan without any.
    net_share (b,) [-]
        Of the energy of the contact forces, what the others do not balance. See
        :mod:`klack.analyses.noise.body`; without mounts a factor of radiated energy, surface
        velocity and sound.
    bodies
        Elastic held ones; without any there is no sound.
    at_mounts
        If mounts are described.
    machine
        If a receiver is described; with ears ``sound`` is that of the first one.
    own_sound
        Of bodies of revolution by boundary elements.
    """

    name: str
    label: str
    detail: str
    kind: str
    case: str
    case_text: str
    run: str
    valid_from: float
    valid_up_to: float
    stops: tuple[StopForce, ...]
    net_share: Floats
    bodies: tuple[BodyNoise, ...]
    sound: ClickSound | None
    settings: NoiseSettings
    notes: tuple[str, ...] = ()
    own_components: Mapping[str, str] = field(default_factory=dict)
    at_mounts: MountSource | None = None
    machine: InMachine | None = None
    own_sound: SurfaceSound | None = None

    @property
    def band_middle(self) -> Floats:
        """Middle frequencies of all bands [Hz]."""
        return self.stops[0].bands.middle

    @property
    def band_energy(self) -> Floats:
        """Energy of all stop forces per band [N^2 s]."""
        return np.asarray(np.sum([stop.bands.energy for stop in self.stops], axis=0))

    @property
    def unbalanced_energy(self) -> Floats:
        """Energy of the forces per band that is not balanced within the valve [N^2 s]."""
        return np.asarray(self.band_energy * self.net_share)

    @property
    def balanced_below(self) -> float:
        """Frequency [Hz] below which half or more of the forces is balanced; or 0."""
        balanced = np.flatnonzero(self.net_share < 0.5)
        return float(self.stops[0].bands.high[balanced[-1]]) if balanced.size else 0.0

    @property
    def support_energy(self) -> float:
        """Energy through the held surfaces into mounts and plates [J]; nan without bodies.

        In a machine that into it and its elements.

        It does not stand in :attr:`injected_energy`, whose bodies are held rigidly: on a mount a
        body moves as a whole and takes up more.  The radiated energy comes from both.
        """
        if self.machine is not None:
            return self.machine.energy + self.machine.element_loss
        return self._over_bodies(lambda body: body.support_energy)

    @property
    def injected_energy(self) -> float:
        """Structure-borne energy [J] through all ports; nan without bodies."""
        return self._over_bodies(lambda body: body.injected.sum())

    @property
    def radiated_energy(self) -> float:
        """Estimated sound energy [J]; nan without bodies."""
        return float(self.radiated_bands.sum())

    @property
    def radiated_bands(self) -> Floats:
        """Estimated sound energy per band [J]; nan without bodies."""
        if not self.bodies:
            return np.full(self.band_middle.size, np.nan)
        return np.asarray(np.sum([body.radiated.sum(axis=0) for body in self.bodies], axis=0))

    @property
    def equivalent_energy(self) -> float:
        """Equivalent radiated energy, radiation efficiency 1 [J]; nan without bodies."""
        return self._over_bodies(lambda body: body.upper_bound.sum())

    def _over_bodies(self, energy: Callable[[BodyNoise], float]) -> float:
        return float(sum(map(energy, self.bodies))) if self.bodies else float("nan")


@dataclass(frozen=True, kw_only=True, eq=False)
class NoiseStudy(Record):
    """One design, or several; ``wall_time`` is that of the noise chain, without the runs before."""

    designs: tuple[NoiseDesign, ...]

    @property
    def reference(self) -> NoiseDesign:
        """First design, with which others are compared."""
        return self.designs[0]

    @property
    def case(self) -> str:
        """Names of all cases."""
        return " and ".join(dict.fromkeys(design.case for design in self.designs))

    @property
    def case_text(self) -> str:
        """Text of all cases, each once."""
        return "\n\n".join(dict.fromkeys(item.case_text.rstrip() + "\n" for item in self.designs))

    @property
    def own_components(self) -> Mapping[str, str]:
        """Components of all designs that are not klack's."""
        return {
            name: digest for item in self.designs for name, digest in item.own_components.items()
        }
