r"""Pressure on a closed surface that moves, and around it.

The pressure of the air outside, :math:`e^{i\omega t}`, obeys

.. math:: c(x)\, p(x) = \int_S p\, \frac{\partial G}{\partial n'} - G\, q \;\mathrm dS', \qquad
          G = \frac{e^{-ikR}}{4\pi R}, \quad q = -i\omega\rho\, v_n,

with the normal into the air and :math:`c` = 1/2 on the (smooth) surface, 1 outside and 0 inside.
On the surface alone it has no unique solution at the resonances of the inside; rows for points
*inside* join it, in the sense of least squares (Schenck 1968, CHIEF). All motions are right-hand
sides of one factorisation. Pressures here are per :math:`\rho c`, so they are velocities [m/s].
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy

from klack.arrays import Complexes, Floats, Matrix, Vector
from klack.errors import ConvergenceError

__all__ = ["LARGEST_RESIDUAL", "BoundaryMesh", "Radiation", "radiation"]

Motions = Floats | Complexes

LARGEST_RESIDUAL = 0.02
"""Of the largest pressure: what may be left in the inside, where silence is the solution."""

_INTERIOR = 16


class BoundaryMesh(Protocol):
    """Closed surface in elements with one value each."""

    @property
    def centres(self) -> Matrix:
        """Where the equation holds (n, d) [m]."""

    @property
    def areas(self) -> Vector:
        """[m^2], shape (n,)."""

    @property
    def weights(self) -> Vector:
        """Integral of the square of a unit motion over each element [m^2], shape (n,)."""

    def kernels(self, points: Matrix, wave_number: float) -> tuple[Complexes, Complexes]:
        """G and H (k, n) of all elements at points (k, d)."""

    def inside(self, count: int, draw: int) -> Matrix:
        """Points (count, d) in the inside."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Radiation:
    """Sound of motions of a closed surface at one frequency.

    Parameters
    ----------
    wave_number [1/m]
    velocity (n, b) [m/s]
        Normal, into the air.
    pressure (n, b) [m/s]
        Over density and speed of sound.
    residual [-]
        Pressure that is left at points inside (rms), of the largest one on the surface.
    """

    mesh: BoundaryMesh
    wave_number: float
    velocity: Motions
    pressure: Complexes
    residual: float

    @property
    def matrix(self) -> Matrix:
        r""":math:`\mathrm{Re}\int p_i^* v_j\,\mathrm dS` [m^2 (m/s)^2], symmetric, shape (b, b)."""
        found = np.real(self.pressure.conj().T @ (self.mesh.weights[:, None] * self.velocity))
        return np.asarray((found + found.T) / 2.0)

    @property
    def efficiency(self) -> Vector:
        """Radiated power over that of plane waves [-], shape (b,)."""
        plane = self.mesh.weights @ np.abs(self.velocity) ** 2
        return np.asarray(np.diag(self.matrix) / np.where(plane > 0.0, plane, np.inf))

    def added_mass(self, motion: Vector) -> Vector:
        """Of air that a motion (n,) carries along [m^3]: mass over density, shape (b,)."""
        force = (self.mesh.weights * motion) @ self.pressure
        return np.asarray(force.imag / self.wave_number)

    def pressure_at(self, points: Matrix) -> Complexes:
        """Pressure over density and speed of sound (k, b) [m/s] at points outside."""
        G, H = self.mesh.kernels(points, self.wave_number)
        return np.asarray(H @ self.pressure + 1j * self.wave_number * (G @ self.velocity))


def radiation(mesh: BoundaryMesh, wave_number: float, velocity: Motions) -> Radiation:
    """Solve for the pressure of all motions; ConvergenceError where the inside is not silent.

    Points inside come from one draw, the judgement from another that the solution does not know;
    where that fails, they change places.

    Parameters
    ----------
    wave_number [1/m]
    velocity (n, b) [m/s]
        Normal, into the air.
    """
    v = velocity
    G, H = mesh.kernels(mesh.centres, wave_number)
    on_surface = _rows(G, 0.5 * np.eye(len(v)) - H, wave_number, v)
    draws = []
    for draw in (1, 2):
        G, H = mesh.kernels(mesh.inside(_INTERIOR, draw), wave_number)
        draws.append(_rows(G, -H, wave_number, v))
    for silent, judge in (draws, draws[::-1]):
        left, right = (np.concatenate(both) for both in zip(on_surface, silent, strict=True))
        p = _least_squares(left, right)
        rest = np.sqrt((np.abs(judge[0] @ p - judge[1]) ** 2).mean(axis=0))
        residual = float((rest / np.maximum(np.abs(p).max(axis=0), 1e-300)).max(initial=0.0))
        if residual <= LARGEST_RESIDUAL:
            return Radiation(
                mesh=mesh, wave_number=wave_number, velocity=v, pressure=p, residual=residual
            )
    raise ConvergenceError(
        f"boundary elements at {wave_number:.4g} per metre: {100 * residual:.3g} % of the "
        "largest pressure remains inside the body, where it must vanish (allowed: "
        f"{100 * LARGEST_RESIDUAL:g} %).\n"
        "Try: smaller elements, six or more to a wavelength and two or more across the thinnest "
        "part."
    )


def _rows(G: Complexes, left: Complexes, k: float, v: Motions) -> tuple[Complexes, Complexes]:
    return left, 1j * k * (G @ v)


def _least_squares(left: Complexes, right: Complexes) -> Complexes:
    """By the normal equations: interior rows keep them far from singular."""
    adjoint = left.conj().T
    factor = scipy.linalg.cho_factor(adjoint @ left, check_finite=False)
    return np.asarray(scipy.linalg.cho_solve(factor, adjoint @ right, check_finite=False))
