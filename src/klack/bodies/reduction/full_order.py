r"""Transfer functions of the full body, without a factorisation at every frequency.

Wanted is ``G(w) = b^T [(1 + i eta) K - w^2 M]^{-1} b`` at hundreds of frequencies; a factorisation
for each takes a second or more in 3-D. Instead the body is projected onto the block Krylov space

.. math:: \{K^{+} b,\; K^{+} M K^{+} b,\; (K^{+} M)^2 K^{+} b, \ldots\}

which takes *one* factorisation, that of the statics, and one back-substitution per vector (Lanczos
1950; Grimme 1997 as moment matching). Its Ritz vectors are the combinations of modes that the
ports can excite: a few dozen replace hundreds of eigenmodes. Rigid modes are added exactly; known
eigenmodes may come first.

The error is bounded. Orthogonalisation gives the recurrence ``K^+ M Q = Q T + W [0 ... beta]``
with one next block ``W``; with it the residual ``r = b - [(1 + i eta) K - w^2 M] Q y`` is known at
*every* frequency,

.. math:: K^{+} r = Q \left[ \beta_0 - (1 + i\eta) y + \omega^2 T y \right]
                    + \omega^2 W \beta \, y_{last} .

By reciprocity the error of ``G`` is quadratic in the residual, and since
``|w_i^2 / (w_i^2 (1 + i eta) - w^2)| <= 1 / eta`` for every mode,

.. math:: |\Delta G| = |r^T [(1 + i \eta) K - \omega^2 M]^{-1} r| \le r^H K^{+} r \,/\, \eta .

The basis grows until this bound is below ``tolerance |G|`` at every frequency. (Between two ports
the bound is the geometric mean of theirs.) Independently, ``checks`` frequencies can be solved
directly, as ``klack verify`` does.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array

from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.factorization import Backend
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.dynamic_stiffness import solve_symmetric
from klack.bodies.reduction.ports import Port
from klack.bodies.reduction.receptance import Receptance, frequency_axis, modal_sum
from klack.errors import ConvergenceError, require_positive
from klack.machine.cache.entry import Entry
from klack.machine.memory import require_memory

__all__ = [
    "direct_receptance",
    "entry_of_receptance",
    "full_order_receptance",
    "receptance_of_entry",
]


_DEPENDENT = 1e-10  # share of its M-norm below which what is new in a vector is round-off
_PARALLEL = 1e-12  # least eigenvalue of the Gram matrix of unit vectors
_BLOCKS_BETWEEN_TESTS = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class FullOrderReceptance:
    """Receptance of the full body and the evidence for it.

    Parameters
    ----------
    basis_size
        Rigid modes included.
    error_bound (n, n_ports) [-]
        Of the drive-point receptances, relative; the error is mostly far smaller.
    checked_frequencies (k,) [Hz]
        Where the undamped full system was solved directly.
    checked_deviations (k,) [-]
        Largest relative deviation of the undamped receptance there.
    """

    receptance: Receptance
    basis_size: int
    error_bound: NDArray[np.float64]
    checked_frequencies: NDArray[np.float64]
    checked_deviations: NDArray[np.float64]

    @property
    def note(self) -> str:
        """Sentence for the caption of a figure."""
        text = (
            f"{self.receptance.label}: Krylov basis of {self.basis_size} vectors, relative error "
            f"at most {self.error_bound.max():.1g} at each of "
            f"{len(self.receptance.frequencies)} frequencies"
        )
        if not len(self.checked_frequencies):
            return text
        return (
            f"{text}; deviation from direct solutions at {len(self.checked_frequencies)} of them "
            f"{self.checked_deviations.max():.1g}"
        )


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
    checks: int = 0,
    backend: Backend = "auto",
    threads: int | None = None,
) -> FullOrderReceptance:
    """Displacement per force between all ports of the full body.

    Raises :class:`~klack.errors.ConvergenceError` if ``max_vectors`` do not reach the tolerance.

    Parameters
    ----------
    frequencies (n,) [Hz]
        Ascending, above zero.
    loss_factor [-]
        ``eta`` of ``(1 + i eta) K``, above zero.
    flexibility
        Of this body; saves the factorisation.
    modes
        Known elastic eigenmodes, put in first.
    tolerance [-]
        Largest accepted error bound at any frequency.
    checks
        Number of direct solutions, in the upper half of the axis.
    """
    frequencies = frequency_axis("full_order_receptance: frequencies", frequencies)
    require_positive("full_order_receptance: loss_factor", loss_factor, "-")
    require_positive("full_order_receptance: tolerance", tolerance, "-")
    flexibility = flexibility or Flexibility(body, backend=backend, threads=threads)
    patterns = np.column_stack([port.pattern for port in ports])
    space = _KrylovSpace(body, patterns, flexibility, modes)
    bound = _grow_until(space, 2.0 * np.pi * frequencies, loss_factor, tolerance, max_vectors)
    checked = _check_places(frequencies, checks)
    return FullOrderReceptance(
        receptance=Receptance(
            label=f"full order, {body.dof_count} degrees of freedom",
            port_names=tuple(port.name for port in ports),
            frequencies=frequencies,
            values=space.receptance(2.0 * np.pi * frequencies, loss_factor),
        ),
        basis_size=space.size + body.rigid_modes.shape[1],
        error_bound=bound,
        checked_frequencies=checked,
        checked_deviations=_deviations(body, ports, checked, space),
    )


def _grow_until(
    space: "_KrylovSpace",
    omega: NDArray[np.float64],
    eta: float,
    tolerance: float,
    max_vectors: int,
) -> NDArray[np.float64]:
    """Enlarge the basis; returns the relative error bound, shape (n, p)."""
    while True:
        space.grow(_BLOCKS_BETWEEN_TESTS)
        size = np.abs(np.einsum("wpp->wp", space.receptance(omega, eta)))
        bound = space.residual_energy(omega, eta) / (eta * size)
        if bound.max() <= tolerance or space.exhausted:
            return bound
        if space.size >= max_vectors:
            raise ConvergenceError(
                f"full_order_receptance of body '{space.body.name}': the error may still be "
                f"{bound.max():.2g} with {space.size} vectors, above the tolerance {tolerance:g}.\n"
                f"Try: a lower top frequency than {omega[-1] / (2 * np.pi):.4g} Hz (in a case: "
                "run.transfer.to); in Python also a larger max_vectors."
            )


def direct_receptance(
    body: ElasticBody,
    ports: Sequence[Port],
    frequencies: ArrayLike,
) -> Receptance:
    """Undamped receptance by one factorisation of ``K - w^2 M`` for each frequency.

    The slow truth behind :func:`full_order_receptance`; undefined at an eigenfrequency.
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
    """M-orthonormal basis ``Q`` of fields that the ports excite, and the projected body."""

    def __init__(
        self,
        body: ElasticBody,
        patterns: NDArray[np.float64],
        flexibility: Flexibility,
        modes: Modes | None,
    ) -> None:
        self.body, self.patterns, self.flexibility = body, patterns, flexibility
        self.size = 0
        self._store = np.empty((body.dof_count, 64), order="F")
        self.stiffness = np.empty((0, 0))  # Q^T K Q
        self.recurrence = np.empty((0, 0))  # T
        if modes is not None:
            self._append(modes.shapes)
            self.recurrence = np.diag(1.0 / modes.omega**2)
        inside, self.pending, self.link = self._split(flexibility.solve(patterns))
        self.static = np.vstack([inside, self.link])  # K^+ b in coordinates of (Q, W)

    @property
    def basis(self) -> NDArray[np.float64]:
        return self._store[:, : self.size]

    @property
    def exhausted(self) -> bool:
        """True when the ports excite no further direction."""
        return not self.pending.shape[1]

    def grow(self, blocks: int) -> None:
        for _ in range(blocks):
            if self.exhausted:
                return
            block, before = self.pending, self.size
            self._append(block)
            inside, self.pending, self.link = self._split(
                self.flexibility.solve(self.body.M @ block)
            )
            square = np.zeros((self.size, self.size))
            square[:before, :before] = self.recurrence
            square[:, before:] = inside
            square[before:, :before] = inside[:before].T  # T is symmetric
            self.recurrence = square

    def _append(self, vectors: NDArray[np.float64]) -> None:
        """Take M-orthonormal vectors into the basis; border the projected stiffness."""
        image = self.body.K @ vectors
        side = self.basis.T @ image
        corner = vectors.T @ image
        self.stiffness = np.block([[self.stiffness, side], [side.T, (corner + corner.T) / 2]])
        size = self.size + vectors.shape[1]
        if size > self._store.shape[1]:
            require_memory(
                f"full_order_receptance of body '{self.body.name}'",
                16.0 * self.body.dof_count * size,
                what=f"a Krylov basis of {2 * size} vectors",
                hint="a lower top frequency, or larger elements.",
            )
            larger = np.empty((self.body.dof_count, 2 * size), order="F")
            larger[:, : self.size] = self.basis
            self._store = larger
        self._store[:, self.size : size] = vectors
        self.size = size

    def _split(
        self, vectors: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Write vectors as ``Q inside + W link``, W M-orthonormal and orthogonal to Q."""
        M, rigid = self.body.M, self.body.rigid_modes
        inside = np.zeros((self.size, vectors.shape[1]))
        link = np.eye(vectors.shape[1])
        scale = _norms(M, vectors)
        for _ in range(2):  # the second time for what scaling has blown up
            vectors = vectors - rigid @ (rigid.T @ (M @ vectors))
            part = self.basis.T @ (M @ vectors)
            vectors = vectors - self.basis @ part
            inside += part @ link
            norms = _norms(M, vectors)
            kept = norms > _DEPENDENT * scale
            vectors = vectors[:, kept] / norms[kept]
            values, turn = scipy.linalg.eigh(vectors.T @ (M @ vectors))
            values, turn = values[values > _PARALLEL], turn[:, values > _PARALLEL]
            vectors = vectors @ (turn / np.sqrt(values))
            link = (np.sqrt(values)[:, None] * turn.T * norms[kept]) @ link[kept]
            scale = np.ones(len(values))
        return inside, vectors, link

    def receptance(self, omega: NDArray[np.float64], eta: float) -> NDArray[np.complex128]:
        """Projected receptance, shape (n, p, p)."""
        squares, turn = scipy.linalg.eigh(self.stiffness)
        elastic = turn.T @ (self.basis.T @ self.patterns)
        rigid = self.body.rigid_modes.T @ self.patterns
        shapes = np.vstack([rigid, elastic])
        squares = np.concatenate([np.zeros(len(rigid)), squares])
        return modal_sum(shapes, squares * (1 + 1j * eta) - omega[:, None] ** 2)

    def residual_energy(self, omega: NDArray[np.float64], eta: float) -> NDArray[np.float64]:
        """Energy norm squared ``r^H K^+ r`` of the residuals, (n, p) [m/N]."""
        squares, turn = scipy.linalg.eigh(self.stiffness)
        w2 = omega[:, None, None] ** 2
        loads = turn.T @ (self.basis.T @ self.patterns)
        y = np.matmul(turn, loads / (squares[:, None] * (1 + 1j * eta) - w2))
        static = np.zeros((self.size, loads.shape[1]))
        static[: len(self.static)] = self.static
        inside = static - (1 + 1j * eta) * y + w2 * np.matmul(self.recurrence, y)
        outside = w2 * np.matmul(self.link, y[:, self.size - self.link.shape[1] :])
        image = self.body.K @ self.pending
        side, corner = self.basis.T @ image, self.pending.T @ image
        both = np.concatenate([inside, outside], axis=1)
        K = np.block([[self.stiffness, side], [side.T, corner]])
        return np.abs(np.einsum("wip,wip->wp", both.conj(), np.matmul(K, both)))


def _norms(M: csr_array, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.sqrt(np.einsum("ij,ij->j", vectors, M @ vectors))


def _check_places(frequencies: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Frequencies in the upper half of the axis, where errors are largest, and the last."""
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


def entry_of_receptance(full: FullOrderReceptance) -> Entry:
    """Numbers and names of a receptance."""
    receptance = full.receptance
    names = {
        "label": receptance.label,
        "ports": list(receptance.port_names),
        "basis size": full.basis_size,
    }
    return Entry(
        arrays={
            "frequencies": np.asarray(receptance.frequencies),
            "values": np.ascontiguousarray(receptance.values),
            "error bound": full.error_bound,
            "checked frequencies": full.checked_frequencies,
            "checked deviations": full.checked_deviations,
        },
        text=json.dumps(names),
    )


def receptance_of_entry(entry: Entry) -> FullOrderReceptance:
    """Inverse of :func:`entry_of_receptance`."""
    names, arrays = json.loads(entry.text), entry.arrays
    return FullOrderReceptance(
        receptance=Receptance(
            label=names["label"],
            port_names=tuple(names["ports"]),
            frequencies=arrays["frequencies"],
            values=arrays["values"],
        ),
        basis_size=names["basis size"],
        error_bound=arrays["error bound"],
        checked_frequencies=arrays["checked frequencies"],
        checked_deviations=arrays["checked deviations"],
    )
