r"""Radiated power of the fields of held bodies over frequency.

Impedances of radiation have no resonances, so a few frequencies tell all: six to an octave from
:math:`ka` = 0.1 to the top. Between them, with :math:`d_i = \sqrt{R_{ii}}`,

.. math:: R_{ij}(f) = d_i(f)\, d_j(f)\; C_{ij}(f),

the scales :math:`d` follow their power law (linear in logarithms) and the correlations :math:`C`
are linear in the logarithm of frequency: a sum of matrices without negative eigenvalues has none.
Below them a source is a monopole of its volume flow :math:`V`, known in closed form, and a rest
that falls with :math:`f^4`,

.. math:: R(k) = \frac{k^2}{4\pi} V V^T + \Big(\frac{k}{k_0}\Big)^4
          \Big(R(k_0) - \frac{k_0^2}{4\pi} V V^T\Big),

and from twice the top on waves are plane. The top is 20 kHz, or where the largest element is a
sixth of the wavelength. Matrices are per :math:`\rho c`; each group of the
surface has its own, for the power that leaves through it, and their sum is the whole.

The far pressure of a body of revolution, :math:`p = \rho c\, D\, e^{-ikr}/r`, is kept at even polar
angles. Between two solutions :math:`D` is linear in frequency, once the delay that all fields
share has been taken off it; below the lowest one its monopole is known, and the rest falls with
:math:`f^2`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import pi

import numpy as np

from klack.acoustics.boundary.outline import Outline, not_closed, revolved_outline
from klack.acoustics.boundary.revolved import Meridian
from klack.acoustics.boundary.solid_outline import solid_outline
from klack.acoustics.boundary.solution import BoundaryMesh, Radiation, radiation
from klack.arrays import Complexes, Cube, Flags, Floats, Matrix, Vector
from klack.bodies.reduction.structure import Structure
from klack.errors import ConvergenceError
from klack.machine.cache.entry import Entry
from klack.machine.cache.remember import remembered
from klack.machine.cache.result_cache import ResultCache

__all__ = ["ANGLES", "TOP", "SurfaceRadiation", "surface_radiation"]


TOP = 20e3
"""Highest frequency [Hz] that is solved for, if the elements hold that far."""

_LOWEST = 10.0  # [Hz]
_PER_OCTAVE = 6
_SMALL = 0.1  # ka below which the monopole and its rest are all
_PER_WAVE = 6.0
ANGLES = np.linspace(0.0, pi, 37)
"""Polar angles [rad] of the far pressure, from the upper end of the axis."""

_NOTHING = 1e-24  # of plane waves: motions that do not radiate
_NEGATIVE = 1e-4  # of the largest eigenvalue: the loudest motion would be off by 0.0004 dB


@dataclass(frozen=True, kw_only=True, eq=False)
class SurfaceRadiation:
    """Radiated power of the fields of one structure, as part of a closed surface.

    Parameters
    ----------
    names
        Groups of this structure, and the rest of the surface, which it takes along.
    frequency (n,) [Hz]
    scale (n, b)
        Square root of the power of each field, per density and speed of sound.
    correlation (n, g, b, b) [-]
    holds_up_to [Hz]
        Where the largest element is a sixth of the wavelength.
    residual [-]
        Largest pressure left inside, of the largest on the surface.
    covered [-]
        Share of the area that closes openings.
    elements
        Of the whole surface.
    far (n - 1, angles, b) [m]
        Far pressure per field and density and speed of sound, at :data:`ANGLES`, times r; of
        solids there is none.
    """

    names: tuple[str, ...]
    frequency: Vector
    scale: Matrix
    correlation: Floats
    holds_up_to: float
    residual: float
    covered: float
    elements: int
    far: Complexes

    def far_pressure(self, frequency: Vector, fields: Complexes) -> Complexes:
        """Far pressure (k, angles) per density and speed of sound, times r, ``exp(-ikr)`` left out.

        Parameters
        ----------
        frequency (k,) [Hz]
        fields (k, b)
        """
        at = self.frequency[:-1]
        found = np.zeros((len(frequency), self.far.shape[1]), dtype=complex)
        node = np.clip(np.searchsorted(at, frequency) - 1, 0, len(at) - 2)
        for n in np.unique(node):
            own = np.flatnonzero(node == n)
            w = np.clip((frequency[own] - at[n]) / (at[n + 1] - at[n]), 0.0, 1.0)[:, None]
            one, other = self.far[n], self.far[n + 1]
            turn = np.angle(np.einsum("ab,ab->a", one.conj(), other))
            y = fields[own]
            later = np.exp(-1j * turn) * (y @ other.T)
            found[own] = ((1.0 - w) * (y @ one.T) + w * later) * np.exp(1j * w * turn)
        return found

    def energy(self, frequency: Vector, fields: Complexes, weights: Matrix) -> Matrix:
        r""":math:`\int 2 y^H R_g\, y\, \mathrm df` (g, n) per density and speed of sound.

        Parameters
        ----------
        frequency (k,) [Hz]
        fields (k, b)
        weights (n, k) [Hz]
        """
        scaled = fields * self._scale_at(frequency)
        found = np.zeros((len(self.names), len(weights)))
        for node, hat in self._hats(frequency):
            for n, weight in enumerate(weights):
                within = np.flatnonzero(weight * hat)
                if within.size:
                    y, w = scaled[within], (weight * hat)[within, None]
                    products = 2.0 * ((y.real * w).T @ y.real + (y.imag * w).T @ y.imag)
                    found[:, n] += np.einsum("gij,ij->g", self.correlation[node], products)
        return found

    def power(self, frequency: Vector, fields: Complexes) -> Matrix:
        """The same at each frequency, of mean squares (g, k): :math:`y^H R_g y`."""
        scaled = fields * self._scale_at(frequency)
        found = np.zeros((len(self.names), len(frequency)))
        for node, hat in self._hats(frequency):
            within = np.flatnonzero(hat)
            y = scaled[within]
            for g, c in enumerate(self.correlation[node]):
                own = sum(np.einsum("kb,kb->k", part @ c, part) for part in (y.real, y.imag))
                found[g, within] += hat[within] * own
        return found

    def _scale_at(self, frequency: Vector) -> Matrix:
        at, logs = np.log(self.frequency), np.log(self.scale)
        x = np.log(frequency)
        return np.exp(np.column_stack([np.interp(x, at, column) for column in logs.T]))

    def _hats(self, frequency: Vector) -> list[tuple[int, Vector]]:
        """Nodes that count, and their weights over frequency."""
        at, x = np.log(self.frequency), np.log(frequency)
        unit = np.eye(len(at))
        hats = [np.interp(x, at, row) for row in unit]
        return [(n, hat) for n, hat in enumerate(hats) if np.any(hat)]


def surface_radiation(
    structures: Sequence[Structure], sound_speed: float, cache: ResultCache | None = None
) -> tuple[SurfaceRadiation, ...]:
    """Radiation of the fields of each structure, from the outside of all of them together.

    Parameters
    ----------
    sound_speed [m/s]
    """
    dimensions = {own.dimension for own in structures}
    if len(dimensions) > 1:
        raise not_closed("bodies of revolution together with solids")
    if dimensions == {3}:
        outline = solid_outline(structures)
    else:
        outline = revolved_outline(structures, sound_speed / TOP / _PER_WAVE)
    holds_up_to = sound_speed / (_PER_WAVE * outline.largest)
    found = []
    solved = remembered(
        cache,
        "surface radiation, far pressure",
        (outline.mesh, outline.motions, outline.group, sound_speed, min(TOP, holds_up_to)),
        lambda: _solved(outline, sound_speed, min(TOP, holds_up_to)),
        pack=lambda arrays: Entry(arrays=arrays),
        unpack=lambda entry: dict(entry.arrays),
    )
    for s, own in enumerate(structures):
        mine = [outline.name_of[f"{own.name}.{name}"] for name in own.group_names]
        found.append(
            SurfaceRadiation(
                names=(*own.group_names, outline.groups[-1]),
                frequency=solved["frequency"],
                scale=solved[f"scale {s}"],
                correlation=_kept(solved[f"correlation {s}"], mine),
                holds_up_to=holds_up_to,
                residual=float(solved["residual"][0]),
                covered=outline.covered,
                elements=len(outline.group),
                far=solved[f"far {s}"],
            )
        )
    return tuple(found)


def _kept(correlation: Floats, mine: Sequence[int]) -> Floats:
    """Own groups, and the sum of all others."""
    others = np.setdiff1d(np.arange(correlation.shape[1]), mine)
    rest = correlation[:, others].sum(axis=1, keepdims=True)
    return np.concatenate([correlation[:, list(mine)], rest], axis=1)


def _solved(outline: Outline, sound_speed: float, top: float) -> dict[str, Floats]:
    """Frequencies, and scales and correlations of each structure."""
    mesh = outline.mesh
    radius = float(np.sqrt(mesh.areas.sum() / (4.0 * pi)))
    first = min(max(_LOWEST, _SMALL * sound_speed / (2.0 * pi * radius)), top / 2.0)
    upper = np.geomspace(first, top, 1 + round(_PER_OCTAVE * float(np.log2(top / first))))
    lower = np.geomspace(_LOWEST, first, 1 + round(_PER_OCTAVE * float(np.log2(first / _LOWEST))))
    velocity = np.hstack(outline.motions)
    size = np.sqrt(mesh.weights @ velocity**2)  # fields have units of their own
    size[size == 0.0] = 1.0
    velocity = velocity / size
    widths = np.cumsum([0, *(motion.shape[1] for motion in outline.motions)])
    columns = [slice(a, b) for a, b in pairwise(widths.tolist())]
    groups = [outline.group == g for g in range(len(outline.groups))]
    at: list[list[Cube]] = [[] for _ in columns]
    away: list[Complexes] = []
    residuals = []
    for f in upper:
        found = radiation(mesh, 2.0 * pi * float(f) / sound_speed, velocity)
        residuals.append(found.residual)
        away.append(_far(found))
        for own, kept in zip(columns, at, strict=True):
            p, v = found.pressure[:, own], velocity[:, own]
            kept.append(_by_group(p.real, v, mesh.weights, groups))
    arrays = {"residual": np.array([max(residuals)])}
    for s, (own, kept) in enumerate(zip(columns, at, strict=True)):
        v = velocity[:, own]
        below = _below(kept[0], v, mesh.weights, groups, lower[:-1], float(first), sound_speed)
        plane = _by_group(v, v, mesh.weights, groups)
        matrices = np.array([*below, *map(_without_negative, kept), plane])
        power = np.maximum(np.einsum("ngii->ni", matrices), 0.0)
        scale = np.sqrt(np.maximum(power, _NOTHING))
        arrays[f"scale {s}"] = scale * size[own]
        low = _far_below(away[0][:, own], v, mesh, lower[:-1], float(first), sound_speed)
        arrays[f"far {s}"] = np.array([*low, *(one[:, own] for one in away)]) * size[own]
        arrays[f"correlation {s}"] = matrices / (scale[:, None, :, None] * scale[:, None, None, :])
    arrays["frequency"] = np.concatenate([lower[:-1], upper, [2.0 * top]])
    return arrays


def _far(found: Radiation) -> Complexes:
    """Far pressure (angles, b) of all motions; without angles of a solid."""
    if not isinstance(found.mesh, Meridian):
        return np.zeros((0, found.velocity.shape[1]), dtype=complex)
    by_pressure, by_velocity = found.mesh.far_field(found.wave_number, ANGLES)
    return np.asarray(by_pressure @ found.pressure + by_velocity @ found.velocity)


def _far_below(
    first: Complexes,
    v: Matrix,
    mesh: BoundaryMesh,
    frequency: Vector,
    lowest: float,
    sound_speed: float,
) -> list[Complexes]:
    """Far pressure below the lowest frequency that is solved for, about the middle of the mesh."""
    middle = float(mesh.areas @ mesh.centres[:, -1] / mesh.areas.sum())
    delay = 2j * pi / sound_speed * middle * np.cos(ANGLES)[: len(first), None]
    monopole = 0.5j / sound_speed * (mesh.weights @ v)  # per frequency
    rest = first * np.exp(-lowest * delay) - lowest * monopole
    return [(f * monopole + (f / lowest) ** 2 * rest) * np.exp(f * delay) for f in frequency]


def _by_group(p: Matrix, v: Matrix, weights: Vector, groups: Sequence[Flags]) -> Cube:
    r"""Symmetric part of :math:`\int_g p_i v_j\, \mathrm dS` (g, b, b)."""
    found = np.array([p[own].T @ (weights[own, None] * v[own]) for own in groups])
    return np.asarray((found + found.transpose(0, 2, 1)) / 2.0)


def _below(
    first: Cube,
    v: Matrix,
    weights: Vector,
    groups: Sequence[Flags],
    frequency: Vector,
    lowest: float,
    sound_speed: float,
) -> list[Cube]:
    """Groups' matrices below the lowest frequency that is solved for."""
    flow = weights @ v
    parts = np.array([np.outer(flow, weights[own] @ v[own]) for own in groups])
    monopole = (parts + parts.transpose(0, 2, 1)) / (8.0 * pi)
    wave_number = 2.0 * pi / sound_speed
    rest = _without_negative(first - (wave_number * lowest) ** 2 * monopole, check=False)
    return [(wave_number * f) ** 2 * monopole + (f / lowest) ** 4 * rest for f in frequency]


def _without_negative(groups: Cube, *, check: bool = True) -> Cube:
    """Matrices of groups (g, b, b) whose sum has no negative eigenvalue."""
    whole = groups.sum(axis=0)
    values, vectors = np.linalg.eigh(whole)
    if check and values[0] < -_NEGATIVE * max(float(values[-1]), 0.0):
        raise ConvergenceError(
            f"boundary elements: a motion of the body takes {-values[0] / values[-1]:.1e} of the "
            f"largest power from the air instead of radiating it (allowed: {_NEGATIVE:g}).\n"
            "Try: smaller elements, or radiation: piston."
        )
    kept = vectors[:, values > 0.0]
    onto = kept @ kept.T
    return np.asarray(onto @ groups @ onto)
