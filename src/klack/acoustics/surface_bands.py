r"""Motion of a surface and its sound, band by band, under the forces of all ports.

With the velocity spectra :math:`y_i(f)` of the surface fields under all forces, one matrix per
band,

.. math:: C_{ij} = \int_{band} 2\,\mathrm{Re}(y_i\, y_j^*)\,\mathrm df:

gives the squared normal velocity of a face over time, :math:`\phi^T C \phi`, and the energy
:math:`\rho c\, \mathrm{tr}(G C)` that a group with the Gram matrix ``G`` radiates at efficiency 1.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from klack.acoustics.boundary.over_frequency import SurfaceRadiation
from klack.acoustics.force_response import aligned_forces
from klack.acoustics.harmonic import SUPPORT, harmonic_response
from klack.acoustics.mount import Mount, support_mobility
from klack.acoustics.plate import Air, Plate
from klack.acoustics.radiation import PLATE, Efficiency, surface_efficiency
from klack.acoustics.spectrum import force_spectrum
from klack.arrays import Complexes, Floats, Vector
from klack.bodies.reduction.structure import Structure
from klack.errors import refuse_if, require_positive
from klack.signals.sampled import TimeSeries

__all__ = [
    "Pushed",
    "RadiatedBands",
    "SurfaceSpectra",
    "face_band_velocity",
    "pushed_fields",
    "radiated_bands",
    "surface_spectra",
]


Pushed = tuple[Structure, Mapping[str, TimeSeries]]
"""A body and the forces at its ports."""

_DECADE = 12.6  # eleven third octaves
_LEAST, _MOST = 8.0, 400.0  # frequencies in the lowest band of a decade
_DECAY = 2.0  # inverse half widths zeta f of ringing after the record: all but exp(-4 pi)


@dataclass(frozen=True, kw_only=True, eq=False)
class RadiatedBands:
    """Energy radiated by a transient.

    Parameters
    ----------
    names
        Groups of the surface, then ``"plate"`` if there is one.
    bands (n, 2) [Hz]
    energy (g, n) [J]
    """

    names: tuple[str, ...]
    bands: Floats
    energy: Floats

    @property
    def total(self) -> Floats:
        """Of all groups together [J], shape (n,)."""
        return np.asarray(self.energy.sum(axis=0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Decade:
    """Bands: frequency (k,), fields (k, b), force (k,), weights (n, k) [Hz]."""

    frequency: Floats
    fields: Complexes
    support_force: Complexes
    weights: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceSpectra:
    """Velocity spectra of a surface in bands, computed once.

    Parameters
    ----------
    bands (n, 2) [Hz]
    """

    structure: Structure
    mount: Mount | None
    plate: Plate | None
    bands: Floats
    parts: tuple[_Decade, ...]

    def face_velocity(self, *, period: float = 1.0) -> Floats:
        """Normal velocity of faces in bands, as :func:`face_band_velocity`."""
        require_positive("face velocity: period", period, "s")
        own = self.structure
        shapes = np.hstack([own.face_shapes, own.face_residual, own.axial_normals[:, None]])
        shapes = shapes.astype(np.float64)
        rows = [
            np.einsum("fb,fb->f", shapes @ _products(part.fields, weights), shapes)
            for part in self.parts
            for weights in part.weights
        ]
        return np.sqrt(np.maximum(rows, 0.0) / period)

    def radiated(
        self, *, efficiency: Efficiency = "piston", air: Air | None = None
    ) -> RadiatedBands:
        """Energy radiated in every band; see :func:`radiated_bands`."""
        own, air = self.structure, air or Air()
        names = efficiency.names if isinstance(efficiency, SurfaceRadiation) else own.group_names
        parts = [air.impedance * self._by_group(part, efficiency, air) for part in self.parts]
        energy = np.hstack([np.empty((len(names), 0)), *parts])
        if self.plate is not None:
            flowing = [self._by_plate(self.plate, part, air) for part in self.parts]
            names, energy = (*names, PLATE), np.vstack([energy, np.concatenate(flowing)])
        return RadiatedBands(names=names, bands=self.bands, energy=energy)

    def _by_group(self, part: _Decade, efficiency: Efficiency, air: Air) -> Floats:
        """Of each group in each band (g, n) [J], per density and speed of sound."""
        if isinstance(efficiency, SurfaceRadiation):
            return efficiency.energy(part.frequency, part.fields, part.weights)
        sigma = surface_efficiency(self.structure, part.frequency, efficiency, air)
        columns = [
            np.einsum("gij,ij->g", self.structure.group_gram, _products(part.fields, weights))
            for weights in part.weights * sigma
        ]
        return np.asarray(np.array(columns).T)

    @staticmethod
    def _by_plate(plate: Plate, part: _Decade, air: Air) -> Floats:
        """In each band (n,) [J]."""
        bending = plate.mobility * 2.0 * np.abs(part.support_force) ** 2
        share = plate.radiated_share(part.frequency, air)
        return np.asarray([float(weights @ (bending * share)) for weights in part.weights])

    def support_energy(self) -> Floats:
        r"""Energy through the held surfaces into mount and plate, in every band [J].

        .. math:: \int_{band} 2\,\mathrm{Re}(Y_s)\,|\hat F_s|^2\,\mathrm df

        with mobility :math:`Y_s` of the support; zero for a rigid hold.
        """
        return np.array(
            [
                float(weights @ flowing)
                for part in self.parts
                for flowing in [
                    2.0
                    * support_mobility(part.frequency, self.mount, self.plate).real
                    * np.abs(part.support_force) ** 2
                ]
                for weights in part.weights
            ]
        )


def surface_spectra(
    structure: Structure,
    forces: Mapping[str, TimeSeries],
    bands: Floats,
    *,
    mount: Mount | None = None,
    plate: Plate | None = None,
    others: Sequence[Pushed] = (),
) -> SurfaceSpectra:
    """Velocity spectra of the surface under all forces.

    Parameters
    ----------
    forces [N]
        By port, along +z, means over intervals; held at both ends.
    bands (n, 2) [Hz]
        Edges, ascending.
    mount, plate
        Below the held surfaces.
    others
        Bodies on the same mount, which push it by their blocked forces; their mass is part of it.
    """
    aligned_forces(structure, forces)
    edges = _edges(bands, forces)
    parts = tuple(_decades((structure, forces), others, edges, mount, plate))
    return SurfaceSpectra(structure=structure, mount=mount, plate=plate, bands=edges, parts=parts)


def face_band_velocity(
    structure: Structure,
    forces: Mapping[str, TimeSeries],
    bands: Floats,
    *,
    mount: Mount | None = None,
    plate: Plate | None = None,
    period: float = 1.0,
) -> Floats:
    """Normal velocity of faces in bands (n, f) [m/s]: rms over a period with one such transient.

    Parameters as of :func:`surface_spectra`; ``period`` [s] is from click to click.
    """
    spectra = surface_spectra(structure, forces, bands, mount=mount, plate=plate)
    return spectra.face_velocity(period=period)


def radiated_bands(
    structure: Structure,
    forces: Mapping[str, TimeSeries],
    bands: Floats,
    *,
    mount: Mount | None = None,
    plate: Plate | None = None,
    efficiency: Efficiency = "piston",
    air: Air | None = None,
) -> RadiatedBands:
    """Energy that each group of the surface, and the plate, radiate in every band.

    As of :func:`klack.acoustics.radiation.power_transfer`, but forces of several ports add with
    their phases. Parameters as of :func:`surface_spectra`.
    """
    spectra = surface_spectra(structure, forces, bands, mount=mount, plate=plate)
    return spectra.radiated(efficiency=efficiency, air=air)


def _decades(
    pushed: Pushed,
    others: Sequence[Pushed],
    edges: Floats,
    mount: Mount | None,
    plate: Plate | None,
) -> Iterator[_Decade]:
    """Spectra by decade: low bands need fine frequencies."""
    first = 0
    while first < len(edges):
        within = edges[first:, 1] <= max(_DECADE * edges[first, 0], edges[first, 1]) * 1.0001
        last = first + (len(edges) - first if within.all() else int(np.argmin(within)))
        yield _decade(pushed, others, edges[first:last], mount, plate)
        first = last


def _decade(
    pushed: Pushed,
    others: Sequence[Pushed],
    edges: Floats,
    mount: Mount | None,
    plate: Plate | None,
) -> _Decade:
    structure, forces = pushed
    length = max(force.values.size * force.step for force in forces.values())
    spacing = _spacing(structure, edges, mount, length)
    frequency, df = np.zeros(0), 0.0

    def spectrum_of(force: TimeSeries) -> tuple[Vector, Complexes]:
        nonlocal frequency, df
        spectrum = force_spectrum(force, high=float(edges[-1, 1]), resolution=spacing)
        df = spectrum.resolution
        first = max(int(edges[0, 0] / df), 1)  # not 0 Hz, where a force that stays has no spectrum
        frequency = spectrum.frequency[first:]
        return frequency, np.asarray(spectrum.values[first:], dtype=complex)

    fields, support = pushed_fields(pushed, others, spectrum_of, mount, plate)
    low = np.maximum(frequency - df / 2, edges[:, :1])
    high = np.minimum(frequency + df / 2, edges[:, 1:])
    return _Decade(
        frequency=frequency,
        fields=fields,
        support_force=support,
        weights=np.maximum(high - low, 0.0),
    )


def pushed_fields(
    pushed: Pushed,
    others: Sequence[Pushed],
    spectrum_of: Callable[[TimeSeries], tuple[Vector, Complexes]],
    mount: Mount | None,
    plate: Plate | None,
) -> tuple[Complexes, Complexes]:
    """Spectra of the fields (k, b) of a structure and of the force on its support (k,).

    Parameters
    ----------
    others
        Bodies on the same mount, which push it by their blocked forces.
    spectrum_of
        Frequencies above 0 and Fourier integral of a force, the same for all.
    """
    structure, forces = pushed
    fields: Complexes | float = 0.0
    support: Complexes | float = 0.0
    carried: Complexes | float = 0.0
    for port, force in forces.items():
        frequency, own = spectrum_of(force)
        answer = harmonic_response(structure, frequency, port, mount=mount, plate=plate)
        fields = fields + answer.fields * own[:, None]
        support = support + answer.support_force * own
    for other, its_forces in others:
        for port, force in its_forces.items():
            frequency, own = spectrum_of(force)
            carried = carried + harmonic_response(other, frequency, port).support_force * own
    if others:
        answer = harmonic_response(structure, frequency, SUPPORT, mount=mount, plate=plate)
        fields = fields + answer.fields * np.asarray(carried)[:, None]
        support = support + answer.support_force * carried
    return np.asarray(fields), np.asarray(support)


def _spacing(structure: Structure, edges: Floats, mount: Mount | None, length: float) -> float:
    """Distance of frequencies [Hz] that resolves bands, record and resonances."""
    width = float(edges[0, 1] - edges[0, 0])
    f = structure.omega / (2.0 * np.pi)
    near = (f > 0.5 * edges[0, 0]) & (f < 2.0 * edges[-1, 1])
    half_width = float(np.min((structure.damping * f)[near], initial=np.inf))
    if mount is not None:
        half_width = min(half_width, 0.25 * mount.loss_factor * float(edges[0, 0]))
    wanted = 1.0 / (length + _DECAY / half_width) if half_width > 0.0 else 0.0
    return min(width / _LEAST, max(width / _MOST, wanted))


def _products(fields: Complexes, weights: Floats) -> Floats:
    """Weighted integral of ``2 Re(y y^*)``, shape (b, b)."""
    within = np.flatnonzero(weights)
    if not within.size:
        return np.zeros((fields.shape[1], fields.shape[1]))
    band = slice(int(within[0]), int(within[-1]) + 1)  # few of the lines of a decade
    parts = (fields[band].real, fields[band].imag)
    return np.asarray(2.0 * sum((y * weights[band, None]).T @ y for y in parts))


def _edges(bands: Floats, forces: Mapping[str, TimeSeries]) -> Floats:
    edges = np.atleast_2d(np.asarray(bands, dtype=float))
    highest = 0.5 / next(iter(forces.values())).step
    shaped = edges.ndim == 2 and edges.shape[1] == 2
    refuse_if(
        not shaped or not np.all((edges[:, 0] > 0.0) & (edges[:, 0] < edges[:, 1])),
        "bands",
        got=f"an array of shape {edges.shape}",
        expected="a lower and a higher edge above 0 Hz for each band",
        hint="numpy.column_stack(band_edges(band_numbers(17.0, 224e3))) gives third octaves.",
    )
    refuse_if(
        edges[-1, 1] > highest or np.any(np.diff(edges[:, 0]) <= 0.0),
        "bands",
        got=f"edges up to {edges.max():g} Hz",
        expected=f"ascending bands up to {highest:g} Hz, half the sampling rate",
        hint="take fewer bands, or a force with a shorter step.",
    )
    return edges
