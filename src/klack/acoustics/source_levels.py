r"""Levels of a source at its mounts: exposures of a click, lines and bands of a drive, EN 15657.

The energy spectral density of one click with the spectrum :math:`\hat x` is
:math:`2 |\hat x|^2`; its integral over a one-third octave is an *exposure*, divided by no
duration.  A drive of :math:`r` clicks per second has lines at the multiples of :math:`r`, of rms
:math:`\sqrt 2\, r\, |\hat x(k r)|`; its mean square in a band is :math:`r` times the exposure, for
clicks at random times and as the mean over narrow lines.

References differ: EN 15657 and klack use 1 nm/s and 1 uN, ISO 9611 uses 50 nm/s, 34 dB apart.
"""

from dataclasses import dataclass

import numpy as np

from klack.acoustics.coupling import Missing, Placement, couple
from klack.acoustics.interface import Complexes, InterfacePoint, SourceAtMounts
from klack.acoustics.plate import Plate
from klack.acoustics.receivers.plates import InfinitePlate
from klack.acoustics.third_octave import ThirdOctaves, band_energies
from klack.arrays import Floats, Matrix, Vector
from klack.errors import refuse_if, require_positive
from klack.materials.material import Material
from klack.signals.sampled import Spectrum

__all__ = [
    "CONCRETE_PLATE",
    "FORCE_REFERENCE",
    "STEEL_PLATE",
    "VELOCITY_REFERENCE",
    "SingleEquivalents",
    "drive_lines",
    "exposure",
    "single_equivalents",
]

VELOCITY_REFERENCE = 1e-9
"""[m/s], of EN 15657."""
FORCE_REFERENCE = 1e-6
"""[N]."""

_CONCRETE = Material(name="concrete", young=30e9, poisson=0.2, density=2300.0)
_STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7800.0)
CONCRETE_PLATE = Plate(thickness=0.1, area=10.0, material=_CONCRETE)
"""Reception plate of low mobility."""
STEEL_PLATE = Plate(thickness=0.3e-3, area=1.0, material=_STEEL)
"""Reception plate of high mobility."""


def exposure(
    frequency: Vector,
    spectrum: Complexes | Floats,
    *,
    low: float | None = None,
    high: float | None = None,
) -> ThirdOctaves:
    """One-third octaves of one click, ``2 |x|^2`` integrated [unit^2 s].

    Parameters
    ----------
    frequency (k,) [Hz]
        Rising; bands outside are left out, not extrapolated.
    spectrum (k,) [unit/Hz]
    low, high [Hz]
        Further limits of the bands.
    """
    limits = (
        max(frequency[0], low or 0.0, 1e-3),
        min(frequency[-1], np.inf if high is None else high),
    )
    density = Spectrum(frequency=frequency, values=2.0 * np.abs(spectrum) ** 2, unit="unit^2 s/Hz")
    return band_energies(density, low=float(limits[0]), high=float(limits[1]))


def drive_lines(frequency: Vector, spectrum: Complexes, rate: float) -> tuple[Vector, Floats]:
    """Lines of a drive within the known frequencies [Hz] and their rms [unit], shapes (m,).

    Parameters
    ----------
    frequency (k,) [Hz]
    spectrum (k,) [unit/Hz]
        Of one click; linear between its frequencies.
    rate [Hz]
        Clicks per second.
    """
    require_positive("drive_lines: rate", rate, "Hz")
    first, last = np.ceil(frequency[0] / rate - 1e-9), np.floor(frequency[-1] / rate + 1e-9)
    lines = rate * np.arange(max(first, 1.0), last + 1.0)
    return lines, np.sqrt(2.0) * rate * np.abs(np.interp(lines, frequency, spectrum))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SingleEquivalents:
    r"""Single numbers of a source as two reception plates give them (EN 15657:2018).

    .. math:: |F_{b,eq}|^2 = \frac{2 W_{low}}{\mathrm{Re}\,Y_{low}}, \qquad
              |v_{f,eq}|^2 = \frac{2 W_{high} |Y_{high}|^2}{\mathrm{Re}\,Y_{high}}, \qquad
              |Y_{S,eq}| = \frac{|v_{f,eq}|}{|F_{b,eq}|}

    Parameters
    ----------
    frequency (k,) [Hz]
    force, velocity (k,) [N/Hz], [m/s/Hz]
        Amplitudes; of a click their spectra.
    """

    frequency: Vector
    force: Vector
    velocity: Vector

    @property
    def mobility(self) -> Vector:
        """``|Y_S,eq|`` [m/(N s)], shape (k,)."""
        return self.velocity / self.force

    def levels(self, rate: float) -> dict[str, tuple[ThirdOctaves, Vector]]:
        """Levels of a drive in one-third octaves [dB], by what they are of.

        ``blocked force`` re 1 uN, ``free velocity`` re 1 nm/s, and ``installed power`` re 1 pW on
        the concrete plate of the standard with a mobility of 5e-6 m/(N s).

        Parameters
        ----------
        rate [Hz]
            Clicks per second.
        """
        require_positive("levels: rate", rate, "Hz")
        force = exposure(self.frequency, self.force)
        velocity = exposure(self.frequency, self.velocity)
        in_force = force.level_re(FORCE_REFERENCE**2 / rate)
        return {
            "blocked force": (force, in_force),
            "free velocity": (velocity, velocity.level_re(VELOCITY_REFERENCE**2 / rate)),
            "installed power": (force, in_force + 10.0 * np.log10(_NORMAL_MOBILITY)),
        }


_NORMAL_MOBILITY = 5e-6  # [m/(N s)]; 1 uN^2 m/(N s) is 1 pW


def single_equivalents(
    source: SourceAtMounts,
    *,
    axes: Matrix | None = None,
    radius: float = 0.0,
    low: Plate = CONCRETE_PLATE,
    high: Plate = STEEL_PLATE,
) -> SingleEquivalents:
    """Couple the source to two infinite plates and take their powers.

    Parameters
    ----------
    source
        Its mounts stand where the drawing has them, in one plane.
    axes (3, 3)
        Rows are x, y, z of the drawing in the frame of the plate, z along its normal; the same
        without.
    radius [m]
        Of the feet.  Plates are stiff in their plane, so they block what moves there; with
        point contacts (0) rotations about x and y are free.
    low, high
        Plates of low and of high mobility.
    """
    turned = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    places = {point.name: point.position @ turned for point in source.points}
    height = np.array([place[2] for place in places.values()])
    refuse_if(
        float(np.ptp(height)) > 1e-3,
        "single_equivalents",
        got=f"mounts {np.ptp(height) * 1e3:.3g} mm apart along the normal of the plate",
        expected="mounts in one plane",
        hint="give axes: x, y, z of the drawing in the frame of the plate.",
    )
    points = tuple(InterfacePoint(name=name, position=place) for name, place in places.items())
    lacking: dict[str, Missing] = {
        str(freedom): "free" if freedom.is_rotation and radius == 0.0 else "blocked"
        for freedom in source.freedoms
    }
    powers = []
    for plate in (low, high):
        joined = couple(
            source,
            InfinitePlate(plate=plate, points=points, radius=radius, ideal=True),
            placements={name: Placement(axes=turned) for name in places},
            missing=lacking,
        )
        powers.append(np.maximum(joined.power.sum(axis=1), 0.0))
    return SingleEquivalents(
        frequency=source.frequency,
        force=np.sqrt(2.0 * powers[0] / low.mobility),
        velocity=np.sqrt(2.0 * powers[1] * high.mobility),
    )
