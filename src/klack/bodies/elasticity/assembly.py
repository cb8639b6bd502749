r"""Stiffness and mass matrices of linear elasticity.

.. math::

    K_{ij} = \int B_i^T D B_j \, dV, \qquad M_{ij} = \int \varrho N_i N_j \, dV \; 1

Bodies of revolution (points with two columns) have u_r, u_z and the hoop strain u_r / r, and are
integrated over the full circle; Fourier orders: :mod:`klack.bodies.elasticity.fourier_body`.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.bodies.elasticity.kernels import add_elements, block_pattern, diagonal_blocks, node_graph
from klack.bodies.elasticity.quadrature import Purpose, quadrature
from klack.bodies.elasticity.shape_functions import shape_functions
from klack.errors import InputError, refuse_if
from klack.machine.memory import require_memory
from klack.materials.material import Material
from klack.mesh.mesh import ElementBlock, Mesh

__all__ = ["SMALLEST_JACOBIAN_RATIO", "assemble", "assemble_order"]

_ENTRY = 12.0  # bytes: value and column
_NO_ORDER = -1

SMALLEST_JACOBIAN_RATIO = 1e-3
"""Least accepted smallest-to-largest Jacobian within one element [-]."""


def assemble(mesh: Mesh, materials: Mapping[str, Material]) -> tuple[csr_array, csr_array]:
    """Stiffness and mass matrix of all degrees of freedom.

    Rejects a solid without material and an element that is inverted or too distorted.

    Returns
    -------
    K (n_dof, n_dof) [N/m]
        Full symmetric storage, 32-bit indices, sorted.
    M (n_dof, n_dof) [kg]
        Consistent; no coupling between directions, so ``M[::d, ::d]`` is the scalar matrix.
    """
    d = mesh.dimension
    K, start, neighbours, m_values = _integrated(mesh, materials, d, _NO_ORDER)
    M = csr_array(diagonal_blocks(start, neighbours, m_values, d), shape=K.shape)
    return _canonical(K), _canonical(M)


def assemble_order(
    mesh: Mesh, materials: Mapping[str, Material], order: int
) -> tuple[csr_array, csr_array]:
    """Stiffness [N/m] and mass [kg] of a body of revolution in one Fourier order around its axis.

    Three amplitudes a, b, w per node, see :mod:`klack.bodies.elasticity.fourier_body`; the mass
    does not couple them, and is for a and b twice that of w.

    Parameters
    ----------
    mesh
        Of dimension 2.
    order
        0 or more; 0 has the axisymmetric motion and the torsion.
    """
    K, start, neighbours, m_values = _integrated(mesh, materials, 3, order)
    M = csr_array(diagonal_blocks(start, neighbours, m_values, 3), shape=K.shape)
    twice = np.tile([2.0, 2.0, 1.0], mesh.node_count)
    M.data *= np.repeat(twice, np.diff(M.indptr))
    return _canonical(K), _canonical(M)


def _integrated(
    mesh: Mesh, materials: Mapping[str, Material], per_node: int, order: int
) -> tuple[csr_array, NDArray[np.int64], NDArray[np.int32], NDArray[np.float64]]:
    """K, the graph of the nodes, and the scalar mass matrix on it."""
    points = np.ascontiguousarray(mesh.points, dtype=np.float64)
    _check_input(mesh, materials)
    start, neighbours = _graph(mesh, per_node)
    k_values = np.zeros(len(neighbours) * per_node**2)
    m_values = np.zeros(len(neighbours))
    for block in mesh.blocks:
        material = materials[block.solid]
        jacobians = add_elements(
            points,
            np.ascontiguousarray(block.connectivity, dtype=np.int32),
            _tables(block.family, "stiffness"),
            _tables(block.family, "mass"),
            material.lame_lambda,
            material.shear_modulus,
            material.density,
            order,
            start,
            neighbours,
            k_values,
            m_values,
        )
        _check_jacobians(mesh, block, jacobians)
    indices, row_start = block_pattern(start, neighbours, per_node)
    size = mesh.node_count * per_node
    K = csr_array((k_values, indices, row_start), shape=(size, size))
    return K, start, neighbours, m_values


def _canonical(matrix: csr_array) -> csr_array:
    matrix.has_sorted_indices = True
    matrix.has_canonical_format = True
    return matrix


def _tables(
    family: str, purpose: Purpose
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    xi, w = quadrature(family, purpose)
    N, dN = shape_functions(family, xi)
    return np.ascontiguousarray(N), np.ascontiguousarray(dN), w


def _graph(mesh: Mesh, per_node: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    elements = np.concatenate([b.connectivity.ravel() for b in mesh.blocks]).astype(np.int32)
    sizes = [np.full(len(b.connectivity), b.connectivity.shape[1]) for b in mesh.blocks]
    offsets = np.concatenate([[0], np.cumsum(np.concatenate(sizes))]).astype(np.int64)
    start, neighbours = node_graph(elements, offsets, mesh.node_count)
    size = mesh.node_count * per_node
    refuse_if(
        len(neighbours) * per_node**2 > np.iinfo(np.int32).max,
        "assemble: mesh",
        got=f"{size} degrees of freedom",
        expected="fewer than 2^31 matrix entries",
        hint="use a coarser mesh away from the contact.",
    )
    entries = len(neighbours)
    require_memory(
        "assemble: mesh",
        entries * (per_node**2 * _ENTRY + per_node * _ENTRY + 8.0),
        what=f"stiffness and mass of {size} degrees of freedom",
        hint="larger elements away from the contact.",
    )
    return start, neighbours


def _check_input(mesh: Mesh, materials: Mapping[str, Material]) -> None:
    missing = [solid for solid in mesh.solids if solid not in materials]
    if missing:
        raise InputError(
            "assemble: materials",
            got=f"no material for solid '{missing[0]}'",
            expected=f"one for each of: {', '.join(mesh.solids)}",
            hint="name the material of every solid of the mesh.",
        )
    for block in mesh.blocks:
        if block.topology.dimension != mesh.dimension:
            raise InputError(
                f"assemble: block of solid '{block.solid}'",
                got=f"{block.family} elements on points with {mesh.dimension} columns",
                expected=f"elements of dimension {mesh.dimension}",
                hint="a solid needs tet, hex or wedge; an axisymmetric body tri or quad.",
            )
    if mesh.dimension == 2:
        _check_radius(mesh)


def _check_radius(mesh: Mesh) -> None:
    size = np.ptp(mesh.points, axis=0).max()
    lowest = int(np.argmin(mesh.points[:, 0]))
    if mesh.points[lowest, 0] < -1e-9 * size:
        r, z = 1e3 * mesh.points[lowest]
        raise InputError(
            f"assemble: axisymmetric mesh, node {lowest}",
            got=f"radius {r:.6g} mm at z = {z:.6g} mm",
            expected="radii of zero or more (axis at r = 0)",
            hint="mesh only half of the meridian section.",
        )


def _check_jacobians(mesh: Mesh, block: ElementBlock, jacobians: NDArray[np.float64]) -> None:
    low, high = jacobians.T
    scale = np.maximum(np.abs(low), np.abs(high))
    ratio = low / np.where(scale > 0, scale, 1.0)
    bad = np.flatnonzero(~(ratio > SMALLEST_JACOBIAN_RATIO))
    if not bad.size:
        return
    worst = int(bad[np.argmin(ratio[bad])])
    centre = 1e3 * mesh.points[block.connectivity[worst]].mean(axis=0)
    where = ", ".join(f"{c:.4f}" for c in centre)
    reversed_order = bool(high[worst] < 0)
    raise InputError(
        f"assemble: solid '{block.solid}', {block.family} element {worst}",
        got=f"a Jacobian of {ratio[worst]:.3g} of its largest magnitude at ({where}) mm; "
        f"{bad.size} of {len(low)} elements are like this",
        expected=f"a ratio above {SMALLEST_JACOBIAN_RATIO:g}",
        hint=(
            "the node order of the element is wrong; reorient the elements."
            if reversed_order
            else "move its mid-edge nodes towards the straight edge, or refine the mesh there."
        ),
    )
