r"""Transfer functions of the full body, without a factorisation at every frequency.

Wanted is ``G(w) = b^T [(1 + i eta) K - w^2 M]^{-1} b`` at hundreds of frequencies.  One direct
solution each would take one factorisation each (a second or more in 3-D).  Instead the body is
projected onto the block Krylov space

.. math:: \{K^{+} b,\; K^{+} M K^{+} b,\; (K^{+} M)^2 K^{+} b, \ldots\}

which takes *one* factorisation, that of the statics, and one back-substitution per vector (Lanczos
1950; Grimme 1997 as moment matching).  Its Ritz vectors are exactly those combinations of modes
that the ports can excite, so a few dozen replace hundreds of eigenmodes.  Rigid modes are added
exactly; known eigenmodes may be put in first.

How far it is the full order is not assumed but measured.  For this space the residual
``r = b - [(1 + i eta) K - w^2 M] u`` keeps one fixed direction per port,
``r(w) = r_b c(w)`` with ``r_b = P b - M Q Q^T b``, so its size is known at *every* frequency at the
price of one more back-substitution.  The basis grows until

.. math:: \sqrt{r^H K^{+} r \,/\, b^T K^{+} b} \le \mathrm{tolerance}

(energy norm; relative to the load).  By reciprocity the error of ``G`` is quadratic in it,
``r^T [..]^{-1} r``: a residual of 1e-3 leaves about 1e-6 of the static compliance.  Independent of
all that, ``checks`` frequencies are solved directly and the deviation is reported.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eigh

from klack.elasticity.body import ElasticBody
from klack.elasticity.eigen import Modes
from klack.elasticity.factorization import Backend
from klack.elasticity.statics import Flexibility
from klack.errors import ConvergenceError, require_nonnegative, require_positive
from klack.reduction.dynamic_stiffness import solve_symmetric
from klack.reduction.ports import Port
from klack.reduction.receptance import Receptance, frequency_axis, modal_sum

__all__ = ["FullOrderReceptance", "direct_receptance", "full_order_receptance"]

_DEPENDENT = 1e-10  # relative M-norm below which a new direction is round-off
_BLOCKS_BETWEEN_TESTS = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class FullOrderReceptance:
    """Receptance of the full body and the evidence for it.

    Parameters
    ----------
    receptance : Receptance
    basis_size : int
        Number of basis vectors, rigid modes included.
    residual : array, shape (n,) [-]
        Energy norm of the residual over that of the load, the largest of all ports.
    checked_frequencies : array, shape (k,) [Hz]
        Where the undamped full system was solved directly.
    checked_deviations : array, shape (k,) [-]
        Largest relative deviation of the (undamped) receptance there.
    """

    receptance: Receptance
    basis_size: int
    residual: NDArray[np.float64]
    checked_frequencies: NDArray[np.float64]
    checked_deviations: NDArray[np.float64]


def full_order_receptance(
    body: ElasticBody,
    ports: Sequence[Port],
    frequencies: ArrayLike,
    *,
    loss_factor: float,
    flexibility: Flexibility | None = None,
    modes: Modes | None = None,
    tolerance: float = 1e-3,
    max_vectors: int = 600,
    checks: int = 1,
    backend: Backend = "auto",
    threads: int | None = None,
) -> FullOrderReceptance:
    """Displacement per force between all ports of the full body.

    Parameters
    ----------
    body : ElasticBody
    ports : sequence of Port
    frequencies : array, shape (n,) [Hz]
        Ascending, above zero.
    loss_factor : float [-]
        Structural damping ``eta`` of ``(1 + i eta) K``.
    flexibility : Flexibility, optional
        Of the same body; saves the factorisation.
    modes : Modes, optional
        Elastic eigenmodes computed before; the basis starts with them.
    tolerance : float [-]
        Largest accepted residual (energy norm, relative) at any frequency.
    max_vectors : int
        Give up above this basis size.
    checks : int
        Number of direct solutions, spread over the upper half of the axis.
    backend, threads
        Of the sparse direct solver.

    Raises
    ------
    ConvergenceError
        If ``max_vectors`` do not reach the tolerance.
    """
    frequencies = frequency_axis("full_order_receptance: frequencies", frequencies)
    require_nonnegative("full_order_receptance: loss_factor", loss_factor, "-")
    require_positive("full_order_receptance: tolerance", tolerance, "-")
    flexibility = flexibility or Flexibility(body, backend=backend, threads=threads)
    space = _KrylovSpace(body, np.column_stack([port.pattern for port in ports]), flexibility)
    if modes is not None:
        space.append(modes.shapes)
    omega = 2.0 * np.pi * frequencies
    while True:
        space.grow(_BLOCKS_BETWEEN_TESTS)
        residual = space.residual(omega, loss_factor)
        if residual.max() <= tolerance or space.exhausted:
            break
        if space.size >= max_vectors:
            raise ConvergenceError(
                f"full_order_receptance of body '{body.name}': the residual is still "
                f"{residual.max():.2g} with {space.size} vectors, above the tolerance "
                f"{tolerance:g}.\nTry: a lower top frequency than {frequencies[-1]:.4g} Hz, or a "
                "larger max_vectors."
            )
    checked = _check_places(frequencies, checks)
    return FullOrderReceptance(
        receptance=Receptance(
            label=f"full order, {body.dof_count} degrees of freedom",
            port_names=tuple(port.name for port in ports),
            frequencies=frequencies,
            values=space.receptance(omega, loss_factor),
        ),
        basis_size=space.size + body.rigid_modes.shape[1],
        residual=residual,
        checked_frequencies=checked,
        checked_deviations=_deviations(body, ports, checked, space),
    )


def direct_receptance(
    body: ElasticBody,
    ports: Sequence[Port],
    frequencies: ArrayLike,
) -> Receptance:
    """Undamped receptance by one factorisation of ``K - w^2 M`` for each frequency.

    The slow truth behind :func:`full_order_receptance`; parameters as there.
    """
    frequencies = frequency_axis("direct_receptance: frequencies", frequencies)
    B = np.column_stack([port.pattern for port in ports])[body.free]
    K = body.K[body.free][:, body.free]
    M = body.M[body.free][:, body.free]
    values = np.empty((len(frequencies), B.shape[1], B.shape[1]), dtype=complex)
    for i, frequency in enumerate(frequencies):
        shifted = K - (2.0 * np.pi * frequency) ** 2 * M
        values[i] = B.T @ solve_symmetric(shifted, B)
    return Receptance(
        label="full order, direct solutions",
        port_names=tuple(port.name for port in ports),
        frequencies=frequencies,
        values=values,
    )


class _KrylovSpace:
    """M-orthonormal basis of elastic fields that the ports excite, and the projected body."""

    def __init__(
        self, body: ElasticBody, patterns: NDArray[np.float64], flexibility: Flexibility
    ) -> None:
        self.body, self.patterns, self.flexibility = body, patterns, flexibility
        self.basis = np.empty((body.dof_count, 0), order="F")
        self.stiffness = np.empty((0, 0))  # Q^T K Q
        self.candidate = flexibility.solve(patterns)
        self.static = patterns.T @ self.candidate
        rigid = body.rigid_modes
        self.elastic_load = patterns - body.M @ (rigid @ (rigid.T @ patterns))  # P b
        self.exhausted = False

    @property
    def size(self) -> int:
        return self.basis.shape[1]

    def append(self, vectors: NDArray[np.float64]) -> None:
        """Take M-orthonormal vectors into the basis and border the projected stiffness."""
        image = self.body.K @ vectors
        side = self.basis.T @ image
        corner = vectors.T @ image
        self.stiffness = np.block([[self.stiffness, side], [side.T, (corner + corner.T) / 2]])
        self.basis = np.hstack([self.basis, vectors])

    def grow(self, blocks: int) -> None:
        """Add some Krylov blocks of one vector per port."""
        for _ in range(blocks):
            block = self._orthonormal(self.candidate)
            if not block.shape[1]:
                self.exhausted = True
                return
            self.append(block)
            self.candidate = self.flexibility.solve(self.body.M @ block)

    def _orthonormal(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        M = self.body.M
        vectors = vectors / np.sqrt(np.einsum("ij,ij->j", vectors, M @ vectors))
        for _ in range(2):
            for basis in (self.body.rigid_modes, self.basis):
                vectors = vectors - basis @ (basis.T @ (M @ vectors))
        values, turn = eigh(vectors.T @ (M @ vectors))
        independent = values > _DEPENDENT**2
        vectors = vectors @ (turn[:, independent] / np.sqrt(values[independent]))
        for basis in (self.body.rigid_modes, self.basis):  # small vectors were blown up
            vectors = vectors - basis @ (basis.T @ (M @ vectors))
        return vectors

    def receptance(self, omega: NDArray[np.float64], eta: float) -> NDArray[np.complex128]:
        """Projected receptance, shape (n, p, p)."""
        squares, turn = eigh(self.stiffness)
        elastic = turn.T @ (self.basis.T @ self.patterns)
        rigid = self.body.rigid_modes.T @ self.patterns
        shapes = np.vstack([rigid, elastic])
        squares = np.concatenate([np.zeros(len(rigid)), squares])
        return modal_sum(shapes, squares * (1 + 1j * eta) - omega[:, None] ** 2)

    def residual(self, omega: NDArray[np.float64], eta: float) -> NDArray[np.float64]:
        """Relative residual at each frequency, energy norm, shape (n,)."""
        amplitudes = self.basis.T @ self.patterns
        direction = self.elastic_load - self.body.M @ (self.basis @ amplitudes)  # r_b
        probe = self.flexibility.solve(direction)
        size = direction.T @ probe  # r_b^T K^+ r_b
        squares, turn = eigh(self.stiffness)
        loads = turn.T @ amplitudes
        denominator = squares * (1 + 1j * eta) - omega[:, None] ** 2
        stiff = (probe.T @ (self.body.K @ self.basis)) @ turn
        heavy = (probe.T @ (self.body.M @ self.basis)) @ turn
        # probe^T r = size @ c, hence c(w)
        total = np.broadcast_to(probe.T @ self.elastic_load, (len(omega), *size.shape))
        inner = (1 + 1j * eta) * stiff - omega[:, None, None] ** 2 * heavy
        projected = total - np.einsum("wpm,wm,mq->wpq", inner, 1 / denominator, loads)
        coefficients = np.linalg.lstsq(size, np.swapaxes(projected, 0, 1).reshape(len(size), -1))[0]
        coefficients = np.swapaxes(coefficients.reshape(len(size), len(omega), -1), 0, 1)
        squared = np.einsum("wpq,pr,wrq->wq", coefficients.conj(), size, coefficients).real
        return np.sqrt(np.max(np.abs(squared) / np.diag(self.static), axis=1))


def _check_places(frequencies: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Frequencies in the upper half of the axis, where errors are largest; the last included."""
    places = np.linspace(len(frequencies) - 1, (len(frequencies) - 1) / 2, max(count, 0))
    return np.sort(frequencies[np.unique(np.round(places).astype(int))])


def _deviations(
    body: ElasticBody,
    ports: Sequence[Port],
    frequencies: NDArray[np.float64],
    space: _KrylovSpace,
) -> NDArray[np.float64]:
    if not len(frequencies):
        return np.empty(0)
    truth = direct_receptance(body, ports, frequencies).values
    difference = space.receptance(2.0 * np.pi * frequencies, 0.0) - truth
    scale = np.abs(truth).max(axis=(1, 2))
    return np.abs(difference).max(axis=(1, 2)) / scale
