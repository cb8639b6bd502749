r"""Linear systems with delays: frequency response, eigenvalues, participation.

.. math:: \dot x = A x + B u + B_w w, \quad y = C x + D u + D_w w, \quad
          z = C_z x + D_z u + D_{zw} w, \quad w_i(t) = z_i(t - T_i)

The frequency response takes :math:`e^{-sT}` as it is.  Without delays the eigenvalues are those of
:math:`A`; with delays they are the roots of

.. math:: \det\begin{pmatrix} s - A & -B_w \\ -e^{-sT} C_z & 1 - e^{-sT} D_{zw}\end{pmatrix} = 0,

infinitely many.  A rational model (each delay cut into equal pieces, each Padé's fraction of degree
4 over 5, whose magnitude is nowhere above one) gives starting values up to a frequency for Newton's
method on the determinant itself.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, factorial

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.arrays import Matrix, Vector
from klack.errors import InputError

__all__ = ["LinearSystem", "Mode", "Signal", "modes", "rational", "transfer"]

Complex = NDArray[np.complex128]

ORDER = 5
"""States of each piece of a delay."""

PIECE = 3.0
"""[rad] Phase of a piece at the end of the band: its error is 1.3e-4 there."""

MOST_STATES = 1500
"""Of a rational model."""

_NEWTON = 40
_CONVERGED = 1e-11  # last Newton step over the root
_SAME = 1e-7  # two roots over their distance from zero
_REAL = 1e-10  # imaginary part over the distance from zero: round-off of equal real roots
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True, slots=True)
class Signal:
    """State, input or output."""

    owner: str
    quantity: str
    unit: str

    @property
    def name(self) -> str:
        """Under which a user asks for it."""
        return f"{self.owner}.{self.quantity}"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearSystem:
    """A linear system with delays.

    Parameters
    ----------
    A, B, C, D
        From states and inputs to rates and outputs.
    Bw, Dw
        From waves that arrive.
    Cz, Dz, Dzw
        To waves that leave, from states, inputs and arriving waves.
    delays [s]
    waves
        Component of each delay.
    """

    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    Bw: Matrix
    Dw: Matrix
    Cz: Matrix
    Dz: Matrix
    Dzw: Matrix
    delays: Vector
    waves: tuple[str, ...]
    states: tuple[Signal, ...]
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mode:
    """One eigenvalue, or one of a conjugate pair.

    Parameters
    ----------
    root [1/s]
        Imaginary part zero or above.
    uncertainty [1/s]
        Possible shift by round-off.
    participation
        By component, the largest first; they add up to one.
    """

    root: complex
    uncertainty: float
    participation: dict[str, float]

    @property
    def frequency(self) -> float:
        """Of the oscillation [Hz]; 0 without one."""
        return self.root.imag / (2.0 * np.pi)

    @property
    def damping(self) -> float:
        """Damping ratio [-]; below zero where it grows."""
        return -self.root.real / abs(self.root) if self.root else 0.0

    @property
    def verdict(self) -> int:
        """1 if it grows, -1 if it decays, 0 if neither can be told."""
        if abs(self.root.real) <= self.uncertainty:
            return 0
        return 1 if self.root.real > 0.0 else -1


def transfer(system: LinearSystem, frequency: Vector) -> Iterator[Complex]:
    """Frequency response of all outputs to all inputs at each frequency [Hz], delays exact."""
    factors = _balance(system.A)
    for f in frequency:
        yield _response(system, 2j * np.pi * float(f), factors)


def _balance(A: Matrix) -> Vector:
    """Factors that bring rows and columns with all kinds of units to one size."""
    factors = np.ones(len(A))
    size = np.abs(A - np.diag(np.diag(A)))
    for _ in range(20):
        scaled = size * factors[None, :] / factors[:, None]
        row, column = scaled.sum(axis=1), scaled.sum(axis=0)
        known = (row > 0.0) & (column > 0.0)
        if not np.any(known):
            break
        factors[known] *= 2.0 ** np.round(0.5 * np.log2(row[known] / column[known]))
    return factors


def _response(system: LinearSystem, s: complex, factors: Vector) -> Complex:
    n, u = len(system.A), system.B.shape[1]
    late = np.exp(-s * system.delays)
    left = _bordered(system, s, late, factors)
    right = np.vstack([system.B / factors[:, None], late[:, None] * system.Dz])
    found = np.linalg.solve(left, right.astype(complex)) if len(left) else np.zeros((0, u))
    return np.asarray(
        system.C @ (factors[:, None] * found[:n]) + system.Dw @ found[n:] + system.D,
        dtype=complex,
    )


def _bordered(system: LinearSystem, s: complex, late: Complex, factors: Vector) -> Complex:
    """Matrix of the characteristic equation; states divided by ``factors``."""
    n, d = len(system.A), len(system.delays)
    found = np.zeros((n + d, n + d), dtype=complex)
    found[:n, :n] = s * np.eye(n) - system.A * factors[None, :] / factors[:, None]
    found[:n, n:] = -system.Bw / factors[:, None]
    found[n:, :n] = -late[:, None] * system.Cz * factors[None, :]
    found[n:, n:] = np.eye(d) - late[:, None] * system.Dzw
    return found


# --------------------------------------------------------------------------- rational models


def _late(delay: float, pieces: int) -> tuple[Matrix, Vector, Vector]:
    tau, n = delay / pieces, ORDER
    m = n - 1
    # e^-x = N(x)/P(x), x = s tau; no feedthrough, so that no reflection closes an algebraic loop
    below = [
        factorial(m + n - k) * factorial(n) / (factorial(k) * factorial(n - k))
        for k in range(n + 1)
    ]
    above = [
        (-1.0) ** k * factorial(m + n - k) * factorial(m) / (factorial(k) * factorial(m - k))
        for k in range(n)
    ]
    A1 = np.diag(np.ones(n - 1), 1)
    A1[-1] = -np.array(below[:n]) / below[n]
    A1, B1 = A1 / tau, np.append(np.zeros(n - 1), 1.0 / tau)
    C1 = np.array(above) / below[n]
    A, B = np.zeros((n * pieces, n * pieces)), np.zeros(n * pieces)
    B[:n] = B1
    for k in range(pieces):
        here = slice(n * k, n * (k + 1))
        A[here, here] = A1
        if k:
            A[here, n * (k - 1) : n * k] = np.outer(B1, C1)
    C = np.zeros(n * pieces)
    C[-n:] = C1
    return A, B, C


def pieces_of(delay: float, band: float) -> int:
    """Pieces of a delay [s] for a model up to ``band`` [Hz]."""
    return max(1, ceil(2.0 * np.pi * band * delay / PIECE))


def rational(system: LinearSystem, band: float) -> LinearSystem:
    """Model without delays, good up to ``band`` [Hz].

    Raises
    ------
    InputError
        For more than :data:`MOST_STATES` states.
    """
    if not len(system.delays):
        return system
    pieces = [pieces_of(float(T), band) for T in system.delays]
    more = ORDER * sum(pieces)
    n, d, u = len(system.A), len(system.delays), system.B.shape[1]
    if n + more > MOST_STATES:
        room = (
            max(MOST_STATES - n, 1) * PIECE / (2.0 * np.pi * ORDER * float(np.sum(system.delays)))
        )
        raise InputError(
            "--band",
            got=f"{band:.4g} Hz, for which the lines need {more} states",
            expected=f"at most about {room:.3g} Hz with these lines",
            hint="give a lower --band; the frequency response takes delays exactly at any "
            "frequency.",
        )
    Ad, Bd = np.zeros((more, more)), np.zeros((more, d))
    Cd = np.zeros((d, more))
    names, begin = [], 0
    for i, (T, count) in enumerate(zip(system.delays, pieces, strict=True)):
        here = slice(begin, begin + ORDER * count)
        begin = here.stop
        Ad[here, here], Bd[here, i], Cd[i, here] = _late(float(T), count)
        names += [
            Signal(system.waves[i], f"wave {i + 1} state {k + 1}", "Pa")
            for k in range(ORDER * count)
        ]
    # w = Cd xd, xd' = Ad xd + Bd z, z = Cz x + Dz u + Dzw w
    return LinearSystem(
        A=np.block([[system.A, system.Bw @ Cd], [Bd @ system.Cz, Ad + Bd @ system.Dzw @ Cd]]),
        B=np.vstack([system.B, Bd @ system.Dz]),
        C=np.hstack([system.C, system.Dw @ Cd]),
        D=system.D,
        Bw=np.zeros((n + more, 0)),
        Dw=np.zeros((len(system.C), 0)),
        Cz=np.zeros((0, n + more)),
        Dz=np.zeros((0, u)),
        Dzw=np.zeros((0, 0)),
        delays=np.zeros(0),
        waves=(),
        states=(*system.states, *names),
        inputs=system.inputs,
        outputs=system.outputs,
    )


# --------------------------------------------------------------------------- eigenvalues


def modes(system: LinearSystem, band: float) -> tuple[list[Mode], int]:
    """Eigenvalues, growing ones first, then by frequency; and how many were not confirmed.

    Without delays all of them; with delays the roots up to ``band`` [Hz] and those that grow
    faster, and how many eigenvalues of the rational model led to no root.
    """
    if not len(system.A) and not len(system.delays):
        return [], 0
    model = rational(system, band)
    factors = _balance(model.A)
    scaled = model.A * factors[None, :] / factors[:, None]
    roots, left, right = scipy.linalg.eig(scaled, left=True, right=True)  # type: ignore[misc]
    size = float(np.linalg.norm(scaled, 2)) if len(scaled) else 0.0
    found: list[Mode] = []
    lost = 0
    own = _balance(system.A)
    for i in np.argsort(np.abs(roots)):
        root = complex(roots[i])
        beyond = len(system.delays) > 0 and abs(root) > 2.0 * np.pi * band * 1.05
        if root.imag < -_REAL * abs(root) or (beyond and root.real <= 0.0):
            continue
        exact = _newton(system, root, own)
        if exact is not None:
            root, product, unsure = exact
        elif len(system.delays):
            lost += abs(root.imag) <= 2.0 * np.pi * band * 0.95
            continue
        else:  # a double root
            product = np.conj(left[:, i]) * right[:, i]
            overlap = abs(np.sum(product))
            spread = float(np.linalg.norm(left[:, i]) * np.linalg.norm(right[:, i]))
            unsure = 20.0 * _EPS * size * spread / max(overlap, _EPS * spread)
        if len(system.delays):
            if abs(root) > 2.0 * np.pi * band and root.real <= 0.0:
                continue
            if any(abs(root - other.root) <= _SAME * abs(root) for other in found):
                continue
        if abs(root) <= 3.0 * unsure:
            unsure = max(unsure, abs(root))
        if abs(root.imag) <= max(_REAL * abs(root), unsure):
            root = complex(root.real, 0.0)  # one of several equal real roots
        found.append(Mode(root=root, uncertainty=unsure, participation=_shares(system, product)))
    found.sort(key=lambda mode: (-mode.verdict if mode.verdict > 0 else 0, abs(mode.root)))
    return found, lost


def _newton(
    system: LinearSystem, start: complex, factors: Vector
) -> tuple[complex, Complex, float] | None:
    """Root of the characteristic equation near ``start``, products of its vectors, uncertainty.

    The last is by how much the root changes with some units in the last place of every number.
    """
    s, n = start, len(system.A)
    late = np.exp(-s * system.delays)
    matrix = _bordered(system, s, late, factors)
    scale = np.maximum(np.max(np.abs(matrix), axis=1), 1e-300)
    near = 0.3 if len(system.delays) else 1e-3
    for _ in range(_NEWTON):
        matrix, slope = _with_slope(system, s, factors)
        try:
            trace = np.trace(np.linalg.solve(matrix / scale[:, None], slope / scale[:, None]))
        except np.linalg.LinAlgError:
            break  # on the root
        if trace == 0.0 or not np.isfinite(trace):
            return None
        step = 1.0 / trace  # Newton's step of the determinant
        s -= step
        if abs(s - start) > near * abs(start):
            return None
        if abs(step) <= _CONVERGED * abs(s):
            break
    else:
        return None
    matrix, slope = _with_slope(system, s, factors)
    U, _, Vh = np.linalg.svd(matrix / scale[:, None])
    left, right = U[:, -1].conj() / scale, Vh[-1].conj()
    along = left @ slope @ right
    known = np.abs(left) @ np.abs(matrix) @ np.abs(right)
    unsure = 20.0 * _EPS * float(known / max(abs(along), 1e-300))
    share = left[:n] * right[:n]
    waves = left[n:] * right[n:] * system.delays  # as the characteristic matrix changes with s
    return complex(s.real, abs(s.imag)), np.concatenate([share, waves]), unsure


def _with_slope(system: LinearSystem, s: complex, factors: Vector) -> tuple[Complex, Complex]:
    n, late = len(system.A), np.exp(-s * system.delays)
    matrix = _bordered(system, s, late, factors)
    slope = np.zeros_like(matrix)
    slope[:n, :n] = np.eye(n)
    slope[n:, :n] = (system.delays * late)[:, None] * system.Cz * factors[None, :]
    slope[n:, n:] = (system.delays * late)[:, None] * system.Dzw
    return matrix, slope


def _shares(system: LinearSystem, product: Complex) -> dict[str, float]:
    found: dict[str, float] = {}
    size = np.abs(product)
    owners = [*(signal.owner for signal in system.states), *system.waves]
    for owner, part in zip(owners, size[: len(owners)], strict=True):
        found[owner] = found.get(owner, 0.0) + float(part)
    total = sum(found.values()) or 1.0
    pairs = sorted(found.items(), key=lambda item: -item[1])
    return {name: part / total for name, part in pairs}
