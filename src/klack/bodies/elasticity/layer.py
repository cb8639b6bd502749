r"""Thin layers between two solids of a body: gaskets, O-rings, adhesives.

The displacement jumps by :math:`w = u_1 - u_2` between the faces of a pair, and the layer answers
with a traction in proportion, along the normal n and across it:

.. math:: t = -\left[ k_n\, n n^T + k_t\, (1 - n n^T) \right] w, \qquad
    K_L = \int N^T \left[ \ldots \right] N \, dA

with stiffness per area (of a thin layer: modulus over thickness). Both, and the loss factor, may
depend on frequency. One stiffness, at one stated frequency, goes into the matrices of the body.
Of a mode with the shares :math:`s_n, s_t` of strain energy in the layer, at its own frequency f,

.. math:: \eta = \eta_L(f)\,(s_n + s_t), \qquad
    \frac{\Delta f}{f} = \tfrac12 \left[ \left(\frac{k_n(f)}{k_n} - 1\right) s_n
    + \left(\frac{k_t(f)}{k_t} - 1\right) s_t \right]

to first order: the loss is used, the shift is reported (Johnson & Kienholz 1982).

Limits: the layer has no mass and no waves of its own, and bulges nowhere: a thick soft pad is a
solid. It pulls as it pushes.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from klack.arrays import Flags, Floats, Ints
from klack.bodies.elasticity.loads import face_points, over_faces
from klack.errors import InputError
from klack.mesh.mesh import FacePair, Mesh

__all__ = ["Layer", "LayerStiffness", "layer_damping", "layer_stiffness", "with_layers"]


_SOFTEST, _STIFFEST = 1e-10, 1e6  # diagonal of K: of a layer over that of the solids beside it


@dataclass(frozen=True, kw_only=True, eq=False)
class Layer:
    """Properties of a layer at some frequencies, the same beyond the first and the last.

    Parameters
    ----------
    name
        Of the pair of faces.
    table (k, 4) [Hz, N/m^3, N/m^3, -]
        Rising frequencies; stiffness per area along and across the normal; loss factor. Stiffness
        is interpolated as a power of the frequency, the loss factor over its logarithm.
    frequency [Hz]
        At which the stiffness is taken.
    """

    name: str
    table: Floats
    frequency: float

    def at(self, frequency: Floats | float) -> tuple[Floats, Floats, Floats]:
        """Stiffness along and across the normal [N/m^3], and loss factor [-]."""
        f, normal, across, loss = self.table.T
        if len(f) == 1:
            found = [np.full(np.shape(frequency), x[0]) for x in (normal, across, loss)]
            return found[0], found[1], found[2]
        at = np.log(np.maximum(frequency, f[0]))
        of = np.log(f)
        return (
            np.exp(np.interp(at, of, np.log(normal))),
            np.exp(np.interp(at, of, np.log(across))),
            np.interp(at, of, loss),
        )

    def covers(self, frequency: Floats) -> Flags:
        """Whether the table has these frequencies; a single row has all."""
        f = self.table[:, 0]
        return (len(f) == 1) | ((frequency >= f[0]) & (frequency <= f[-1]))


@dataclass(frozen=True, kw_only=True, eq=False)
class LayerStiffness:
    """A layer between the faces of one pair.

    Parameters
    ----------
    area [m^2]
        Full circle.
    normal, across (n_dof, n_dof) [N/m]
        At the frequency of the layer.
    """

    layer: Layer
    solids: tuple[str, str]
    area: float
    normal: csr_array
    across: csr_array

    @cached_property
    def matrix(self) -> csr_array:
        """Stiffness of the layer, shape (n_dof, n_dof) [N/m]."""
        return csr_array(self.normal + self.across)

    def shares(self, omega: Floats, shapes: Floats) -> tuple[Floats, Floats]:
        """Shares of strain energy along and across the normal of modes of unit mass.

        Zero without frequency. ``shapes`` (n_dof, m).
        """
        squares = np.where(omega > 0.0, omega, np.inf) ** 2
        rows = np.flatnonzero(np.diff(self.matrix.indptr))  # few of a large body
        u = shapes[rows]
        found = [
            np.einsum("im,im->m", u, K[rows][:, rows] @ u) / squares
            for K in (self.normal, self.across)
        ]
        return found[0], found[1]

    def loss(self, omega: Floats, shapes: Floats) -> Floats:
        """Loss factor that each mode has by this layer, shape (m,)."""
        return self.layer.at(omega / (2.0 * np.pi))[2] * sum(self.shares(omega, shapes))

    def shift(self, omega: Floats, shapes: Floats) -> Floats:
        """Relative shift of each frequency by the stiffness at that frequency, shape (m,)."""
        own, taken = self.layer.at(omega / (2.0 * np.pi)), self.layer.at(self.layer.frequency)
        shares = self.shares(omega, shapes)
        moved = [(own[i] / taken[i] - 1.0) * share for i, share in enumerate(shares)]
        return 0.5 * (moved[0] + moved[1])


def layer_stiffness(
    body: str, mesh: Mesh, layer: Layer, K: csr_array, order: int | None = None
) -> LayerStiffness:
    """Stiffness of a layer on the pair of its name.

    Rejects a layer so stiff or so soft beside the solids that nothing of the numbers would be left.

    Parameters
    ----------
    mesh
        Parted there (:func:`klack.mesh.parting.parted`).
    K (n_dof, n_dof) [N/m]
        Of the solids.
    order
        Fourier order of a body of revolution; None: displacements as of the mesh.
    """
    pair = mesh.pairs[layer.name]
    per_node = mesh.dimension if order is None else 3
    k_n, k_t, _ = layer.at(layer.frequency)
    normal, across = (
        over_faces(
            [
                (nodes, along, float(k) * size)
                for nodes, along, size in _jumps(mesh, pair, order, at)
            ],
            mesh.node_count,
            per_node,
        )
        for k, at in ((k_n, slice(0, 1)), (k_t, slice(1, None)))
    )
    result = LayerStiffness(
        layer=layer,
        solids=pair.solids,
        area=float(sum(face_points(mesh, block)[2].sum() for block in pair.first)),
        normal=normal,
        across=across,
    )
    for way, matrix in (("normal", normal), ("tangential", across)):
        own = matrix.diagonal()
        beside = float((own / np.where(own > 0.0, K.diagonal(), 1.0)).max())
        if _SOFTEST <= beside <= _STIFFEST:
            continue
        soft = beside < 1.0
        raise InputError(
            f"bodies.{body}.layers.{layer.name}",
            got=f"a {way} stiffness {1 / beside if soft else beside:.2g} times as "
            f"{'soft' if soft else 'stiff'} as the adjacent row of elements",
            expected=f"at most {1 / _SOFTEST if soft else _STIFFEST:g} times",
            hint="check its unit; parts that are not held together are separate bodies."
            if soft
            else "check its unit; without the layer the parts are glued.",
        )
    return result


def with_layers(K: csr_array, layers: tuple[LayerStiffness, ...]) -> csr_array:
    """Stiffness of solids and layers [N/m]; that of the solids itself without layers."""
    if not layers:
        return K
    K = csr_array(sum((each.matrix for each in layers), K))
    K.sum_duplicates()
    K.indices, K.indptr = K.indices.astype(np.int32), K.indptr.astype(np.int32)
    return K


def layer_damping(layers: tuple[LayerStiffness, ...], omega: Floats, shapes: Floats) -> Floats:
    """Damping ratio that modes have by all layers, shape (m,); zero without any."""
    ratio = np.zeros(np.shape(omega))
    for each in layers:
        ratio += 0.5 * each.loss(omega, shapes)
    return ratio


def _jumps(
    mesh: Mesh, pair: FacePair, order: int | None, which: slice
) -> Iterator[tuple[Ints, Floats, Floats]]:
    """Nodes of both sides, what of their displacements jumps in some directions, and weights.

    Directions: the normal, then those across it.
    """
    circle = 0.5 if order else 1.0
    for one, other in zip(pair.first, pair.second, strict=True):
        N, _, size, normal = face_points(mesh, one)
        both = np.hstack([N, -N])
        nodes = np.hstack([one.connectivity, other.connectivity])
        for direction in _directions(normal, order)[which]:
            along = np.einsum("qi,fqa->fqia", both, direction).reshape(*size.shape, -1)
            yield nodes, along, circle * size


def _directions(normal: Floats, order: int | None) -> list[Floats]:
    """Unit vectors (faces, q, per_node), on the degrees of freedom of a node."""
    if normal.shape[-1] == 3:
        flattest = np.eye(3)[np.abs(normal).argmin(axis=-1)]
        first = np.cross(normal, flattest)
        first /= np.linalg.norm(first, axis=-1, keepdims=True)
        return [normal, first, np.cross(normal, first)]
    in_section = [normal, np.stack([-normal[..., 1], normal[..., 0]], axis=-1)]
    if order is None:
        return in_section
    # U = a + b, V = b - a
    around = np.broadcast_to([-1.0, 1.0, 0.0], (*normal.shape[:-1], 3))
    return [*(d[..., [0, 0, 1]] for d in in_section), around]
