r"""From a state space A, B, C, D to modes at ports.

The transfer function of a mechanical body at its ports is

.. math:: D + \frac{G_r}{s^2} + \sum_i \frac{G_i}{s^2 + 2\zeta_i\omega_i s + \omega_i^2},
          \qquad G_i = \varphi_i \varphi_i^T .

Its rigid part is a *defective* double pole, which an eigenvalue solver splits into a pair at the
square root of round-off. The null spaces of ``A`` and ``A^2`` are therefore found by two singular
value decompositions and split off first. Every other pole pair :math:`\lambda, \bar\lambda` (or
real pair) with the residue :math:`r` has :math:`G = (\lambda-\bar\lambda)\,r`. A body that creates
no energy has real, symmetric :math:`G \ge 0`; the port shape is its factor. With one port, a
mismatch of force and displacement shows only in a negative residue or a wrong mass.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from klack.arrays import Complexes, Flags, Floats
from klack.bodies.reduction.given_modes import (
    RIGID_FREQUENCY,
    TOLERANCE,
    ModesAtPorts,
    body_of_modes,
    shapes_of_gram,
)
from klack.bodies.reduction.reduced_body import ReducedBody, StateSpace
from klack.errors import InputError, refuse_if
from klack.input.unit_systems import UnitSystem

__all__ = ["body_of_state_space", "modes_of_state_space", "state_space_in_si"]


_NULL = 1e-10  # singular values below this share of the largest are zero
_NOISE = 1e-5  # of the largest G: smaller ones are not judged
_SAME = 1e-7  # poles closer than this share of their size belong together
_STABLE = 1e-6  # growth per radian that counts as round-off
_ROUND_OFF = 1e-11  # of the fastest pole


@dataclass(frozen=True, kw_only=True, eq=False)
class _Poles:
    """Poles with their residues at the ports, shape (n, n_ports, n_ports)."""

    poles: Complexes
    residues: Complexes


def state_space_in_si(model: StateSpace, units: UnitSystem) -> StateSpace:
    """Convert forces, displacements and time of a model to N, m and s."""
    return StateSpace(
        A=model.A / units.time,
        B=model.B / (units.time * units.force),
        C=model.C * units.length,
        feedthrough=model.feedthrough * (units.length / units.force),
        input_names=model.input_names,
        output_names=model.output_names,
    )


def body_of_state_space(
    name: str, model: StateSpace, *, where: str, mass: float | None = None
) -> ReducedBody:
    """Convert a state space whose inputs and outputs are the ports, in SI and in pairs.

    Rejects a model that is unstable, not reciprocal, not passive, or whose damping couples modes;
    the error names mode and ports.

    Parameters
    ----------
    model
        Forces [N] in, displacements [m] out, ``input_names`` being those of the ports.
    mass [kg]
        As of :func:`klack.bodies.reduction.given_modes.body_of_modes`.
    """
    return body_of_modes(name, where, modes_of_state_space(model, where=where), mass=mass)


def modes_of_state_space(model: StateSpace, *, where: str) -> ModesAtPorts:
    """Modes and rigid motion at the ports; see :func:`body_of_state_space`."""
    ports = model.input_names
    A, B, C = _balanced(model)
    rigid, rest = _split_rigid(where, A, B, C)
    found = _poles(*rest)
    _check_stable(where, found.poles)
    slow = np.abs(found.poles) < 2.0 * np.pi * RIGID_FREQUENCY
    rigid = rigid + np.real(np.einsum("i,iab->ab", found.poles[slow], found.residues[slow]))
    pairs = _oscillating(found, ~slow) + _overdamped(where, found, ~slow)
    largest = max([float(np.max(np.abs(G))) for _, _, G, _ in pairs], default=0.0)
    omega, damping, shapes = [], [], [np.zeros((0, len(ports)))]
    for number, (w, z, G, count) in enumerate(sorted(pairs, key=lambda pair: pair[0]), 1):
        _check_gram(f"{where}: mode {number} ({w / (2e3 * np.pi):.6g} kHz)", ports, G, largest)
        omega += [w] * count
        damping += [z] * count
        shapes.append(shapes_of_gram(np.real(G), count))
    return ModesAtPorts(
        port_names=ports,
        omega=np.array(omega),
        damping=np.array(damping),
        shapes=np.vstack(shapes),
        rigid_gram=rigid,
        residual=model.feedthrough,
        coordinates=len(model.A),
    )


def _balanced(model: StateSpace) -> tuple[Floats, Floats, Floats]:
    """Scale the states: positions and velocities of one size."""
    A, scale = scipy.linalg.matrix_balance(model.A, permute=False, separate=True)
    size = np.asarray(scale[0], dtype=np.float64)
    return np.asarray(A, dtype=np.float64), model.B / size[:, None], model.C * size


# --------------------------------------------------------------------------- rigid motion


def _split_rigid(
    where: str, A: Floats, B: Floats, C: Floats
) -> tuple[Floats, tuple[Floats, Floats, Floats]]:
    """Rigid part ``C A B`` on the null space of ``A^2``, and the model without it."""
    V0, chains = _generalised_null_space(A)
    W0, _ = _generalised_null_space(A.T)
    zero = np.zeros((len(C), B.shape[1]))
    if V0.shape[1] == 0:
        return zero, (A, B, C)
    refuse_if(
        V0.shape[1] != 2 * chains or W0.shape[1] != V0.shape[1],
        f"{where}: poles at zero",
        got=f"{V0.shape[1]} of them in {chains} chains",
        expected="two for each rigid motion: its displacement and its velocity",
        hint="a body is free or supported; drag on the rigid motion is not part of it, and "
        "integrated outputs are not possible.",
    )
    inner = W0.T @ V0
    into, out = np.linalg.solve(inner, W0.T @ B), C @ V0
    turn = np.linalg.solve(inner, W0.T @ A @ V0)
    jump, rigid = out @ into, out @ turn @ into
    # a displacement does not jump when a force sets in; a velocity does
    speed = float(np.linalg.norm(turn, 2))
    _not_displacement_if(
        np.max(np.abs(jump)) * speed > TOLERANCE * max(np.max(np.abs(rigid)), 1e-300),
        f"{where}: rigid motion",
    )
    V1, W1 = scipy.linalg.null_space(W0.T), scipy.linalg.null_space(V0.T)
    middle = W1.T @ V1
    rest = (
        np.linalg.solve(middle, W1.T @ A @ V1).astype(np.float64),
        np.linalg.solve(middle, W1.T @ B).astype(np.float64),
        C @ V1,
    )
    return np.asarray(rigid, dtype=np.float64), rest


def _generalised_null_space(A: Floats) -> tuple[Floats, int]:
    """Orthonormal basis of the null space of all powers of ``A``, and the dimension of its first.

    In an orthonormal basis that begins with the null space, the null space of the remaining block
    belongs to the next power; ``A^2`` itself would square the round-off.
    """
    size = float(np.linalg.norm(A, 2))
    basis, found, first = np.eye(len(A)), 0, 0
    block = A
    while len(block):
        _, values, vectors = np.linalg.svd(block)
        null = int(np.sum(values <= _NULL * size))
        if null == 0:
            break
        first = first or null
        turned = np.vstack([vectors[len(vectors) - null :], vectors[: len(vectors) - null]]).T
        basis[:, found:] = basis[:, found:] @ turned
        found += null
        block = (basis.T @ A @ basis)[found:, found:]
    return basis[:, :found], first


# --------------------------------------------------------------------------- elastic modes


def _poles(A: Floats, B: Floats, C: Floats) -> _Poles:
    if not len(A):
        empty = np.zeros((0, len(C), B.shape[1]), dtype=complex)
        return _Poles(poles=np.zeros(0, dtype=complex), residues=empty)
    poles, vectors = np.linalg.eig(A)
    into = np.linalg.solve(vectors, B.astype(complex))
    residues = np.einsum("ai,ib->iab", C @ vectors, into)
    return _Poles(poles=poles.astype(complex), residues=residues)


def _check_stable(where: str, poles: Complexes) -> None:
    if not poles.size:
        return
    size = np.abs(poles)
    slow = size < 2.0 * np.pi * RIGID_FREQUENCY
    growth = poles.real - _STABLE * size - _ROUND_OFF * size.max()
    growth[slow] = -1.0
    worst = int(np.argmax(growth))
    refuse_if(
        growth[worst] > 0,
        f"{where}: stability",
        got=f"a pole that grows by {poles[worst].real:.4g} 1/s at "
        f"{abs(poles[worst].imag) / (2e3 * np.pi):.6g} kHz",
        expected="poles that decay or persist",
        hint="the model is unstable and would create energy; reduce the body again.",
    )


_Pair = tuple[float, float, Complexes, int]
"""omega, damping, G, number of modes."""


def _oscillating(found: _Poles, wanted: Flags) -> list[_Pair]:
    """Pairs of complex poles; coinciding ones (bending in two planes) stay together."""
    upper = np.flatnonzero(wanted & (found.poles.imag > 0))
    upper = upper[np.argsort(np.abs(found.poles[upper]))]
    groups: list[list[int]] = []
    for i in upper:
        pole = found.poles[i]
        if groups and abs(pole - found.poles[groups[-1][-1]]) <= _SAME * abs(pole):
            groups[-1].append(int(i))
        else:
            groups.append([int(i)])
    pairs = []
    for group in groups:
        poles = found.poles[group]
        G = np.einsum("i,iab->ab", 2j * poles.imag, found.residues[group])
        omega = float(np.mean(np.abs(poles)))
        damping = max(0.0, float(-np.mean(poles.real)) / omega)
        pairs.append((omega, damping, G, len(group)))
    return pairs


def _overdamped(where: str, found: _Poles, wanted: Flags) -> list[_Pair]:
    """Pairs of real poles with opposite residues, those visible at a port."""
    real = np.flatnonzero(wanted & (found.poles.imag == 0))
    sizes = np.array([float(np.max(np.abs(r))) for r in found.residues]) * np.abs(found.poles)
    floor = _NOISE * _NOISE * float(sizes.max(initial=0.0))
    left = [int(i) for i in real[np.argsort(-found.poles[real].real)] if sizes[i] > floor]
    pairs = []
    while left:
        i = left.pop(0)
        r = found.residues[i]
        apart = [float(np.max(np.abs(r + found.residues[j]))) for j in left]
        k = int(np.argmin(apart)) if apart else -1
        if k < 0 or apart[k] > TOLERANCE * float(np.max(np.abs(r))):
            raise InputError(
                f"{where}: real pole at {found.poles[i].real:.6g} 1/s",
                got="no second real pole with the opposite residue",
                expected="overdamped modes have a pair of real poles",
                hint="filters, actuators and drag on the rigid motion are not part of a body.",
            )
        j = left.pop(k)
        slow, fast = float(found.poles[i].real), float(found.poles[j].real)
        omega = float(np.sqrt(slow * fast))
        pairs.append((omega, -(slow + fast) / (2.0 * omega), (slow - fast) * r, 1))
    return pairs


def _check_gram(where: str, ports: Sequence[str], G: Complexes, largest: float) -> None:
    """Reject a ``G`` that is not real, symmetric and positive, as far as it matters."""
    own = float(np.max(np.abs(G)))
    limit = TOLERANCE * own + _NOISE * largest
    turned = float(np.max(np.abs(G.imag)))
    if turned > limit:
        _not_displacement_if(turned > 0.5 * own, where)
        raise InputError(
            where,
            got=f"a complex shape ({100 * turned / own:.2g} % out of phase)",
            expected="real modes: damping that does not couple them",
            hint="reduce with modal or Rayleigh damping, or give force and displacement "
            "at one point.",
        )
    own_share = np.diag(G.real)
    _makes_energy_if(
        own_share.min() < -limit, where, ports[int(np.argmin(own_share))], float(own_share.min())
    )
    apart = np.abs(G.real - G.real.T)
    if np.max(apart) > limit:
        i, j = (int(k) for k in np.unravel_index(int(np.argmax(apart)), apart.shape))
        raise InputError(
            where,
            got=f"{G[i, j].real:.6g} 1/kg from '{ports[j]}' to '{ports[i]}', "
            f"{G[j, i].real:.6g} 1/kg back ({100 * apart[i, j] / own:.2g} % apart)",
            expected="the same in both directions (reciprocity): otherwise a contact creates or "
            "removes energy",
            hint="weight the displacement of a port like its force; the displacement of a single "
            "node is not that of a loaded area.",
        )
    values, vectors = np.linalg.eigh(0.5 * (G.real + G.real.T))
    _makes_energy_if(
        values[0] < -limit, where, ports[int(np.argmax(np.abs(vectors[:, 0])))], float(values[0])
    )


def _makes_energy_if(wrong: object, where: str, port: str, share: float) -> None:
    refuse_if(
        wrong,
        where,
        got=f"a share of {share:.6g} 1/kg at port '{port}'",
        expected="shares of 0 or more (passivity): force and displacement have the same direction",
        hint="check the signs of input and output, and that the output is a displacement, not "
        "an acceleration.",
    )


def _not_displacement_if(wrong: object, where: str) -> None:
    refuse_if(
        wrong,
        where,
        got="an output that follows the force like a velocity",
        expected="displacements",
        hint="choose the displacement output of the port, not its velocity.",
    )
