"""Rigid motions of the nodes of a body, and the forces they cause in given matrices."""

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import csr_array

from klack.errors import InputError
from klack.mesh.mesh import Mesh

__all__ = [
    "at_distant_nodes",
    "held_best",
    "held_dofs",
    "motions_left_free",
    "on_axis",
    "orthonormal_in_mass",
    "require_rigid_motions",
    "rigid_motions",
    "without_rigid_strain",
]

_AXIS = 1e-9
_SUPPORT = 1e-4

_LARGEST_FORCE = 1e-5
_MOST_TIED = 0.5
_NAMED = 4
_QUIET = 0.05  # [Hz] rigid frequency that needs no cure


def held_dofs(mesh: Mesh, nodes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Degrees of freedom of held nodes; r on the axis is always held."""
    d = mesh.dimension
    held = (d * nodes[:, None] + np.arange(d)).ravel()
    if d == 2:
        held = np.union1d(held, 2 * on_axis(mesh))
    return held


def on_axis(mesh: Mesh) -> NDArray[np.int64]:
    """Nodes of a body of revolution that lie on its axis."""
    return np.flatnonzero(np.abs(mesh.points[:, 0]) <= _AXIS * np.ptp(mesh.points))


def orthonormal_in_mass(R: NDArray[np.float64], M: csr_array) -> NDArray[np.float64]:
    """Combine the columns so that R^T M R = 1."""
    for _ in range(2):  # the second pass removes the round-off of the first
        L = np.linalg.cholesky(R.T @ (M @ R))
        R = np.linalg.solve(L, R.T).T.astype(np.float64)
    return np.ascontiguousarray(R)


def held_best(R: NDArray[np.float64], candidates: NDArray[np.int64]) -> NDArray[np.int64]:
    """The candidates, one per motion, that hold the rigid motions best."""
    _, _, order = scipy.linalg.qr(R[candidates].T, mode="economic", pivoting=True)
    return np.asarray(candidates[order[: R.shape[1]]])


def motions_left_free(held: NDArray[np.float64]) -> int:
    """Rigid motions left free by a support, from their values at its nodes."""
    sizes = np.linalg.svd(held, compute_uv=False)
    return held.shape[1] - int(np.sum(sizes > _SUPPORT * sizes[0]))


def rigid_motions(mesh: Mesh, about: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """Translations, and rotations that move the farthest node by 1, shape (n_dof, 6 | 1).

    Parameters
    ----------
    about (dimension,) [m]
        Default: the middle of the nodes.
    """
    x = mesh.points - (mesh.points.mean(axis=0) if about is None else about)
    if mesh.dimension == 2:
        motion = np.zeros((len(x), 2, 1))
        motion[:, 1, 0] = 1.0
        return motion.reshape(-1, 1)
    motion = np.zeros((len(x), 3, 6))
    motion[:, :, :3] = np.eye(3)
    for k in range(3):
        motion[:, :, 3 + k] = np.cross(np.eye(3)[k], x)
    motion[:, :, 3:] /= np.linalg.norm(x, axis=1).max()
    return motion.reshape(-1, 6)


def require_rigid_motions(
    where: str,
    K: csr_array,
    mesh: Mesh,
    absent: NDArray[np.int64],
    numbers: NDArray[np.int64],
) -> float:
    """Check that rigid motions cause no forces; returns the largest relative one.

    In row i the sum of ``K_ij R_j`` is compared with the sum of the magnitudes. Rows of nodes that
    share an element with one missing in the files cannot cancel and are left out; without
    elements, at most half of the rows may be tied to missing ones. The error says whether the
    order of the rows, the coordinates or a support within K is to blame.
    """
    R = rigid_motions(mesh)
    size = abs(K) @ np.abs(R)
    force = np.abs(K @ R) / np.maximum(size, np.finfo(float).tiny)
    looked_at = np.ones(len(R), dtype=bool)
    looked_at[absent] = False
    absent = absent[R[absent].any(axis=1)]  # r on the axis of a body of revolution moves nothing
    if len(absent):
        if mesh.blocks:
            looked_at[_tied(mesh, absent)] = False
        else:
            tied = np.any(force > _LARGEST_FORCE, axis=1)
            if np.mean(tied[looked_at]) <= _MOST_TIED:
                looked_at &= ~tied
    if not np.any(looked_at):
        return 0.0
    wrong = (force > _LARGEST_FORCE) & looked_at[:, None]
    if not np.any(wrong):
        return float(force[looked_at].max())
    raise _fault(where, wrong, force, looked_at, mesh, numbers)


def _tied(mesh: Mesh, absent: NDArray[np.int64]) -> NDArray[np.int64]:
    """Degrees of freedom of nodes that share an element with an absent one."""
    d = mesh.dimension
    missing = np.zeros(mesh.node_count, dtype=bool)
    missing[absent // d] = True
    near = np.zeros(mesh.node_count, dtype=bool)
    for block in mesh.blocks:
        near[block.connectivity[missing[block.connectivity].any(axis=1)]] = True
    return (d * np.flatnonzero(near)[:, None] + np.arange(d)).ravel()


def _fault(
    where: str,
    wrong: NDArray[np.bool_],
    force: NDArray[np.float64],
    looked_at: NDArray[np.bool_],
    mesh: Mesh,
    numbers: NDArray[np.int64],
) -> InputError:
    d = mesh.dimension
    shifts = wrong[:, : 1 if d == 2 else 3].any(axis=1)
    share = float(np.count_nonzero(shifts)) / np.count_nonzero(looked_at)
    largest = float(force[looked_at].max())
    rows = np.flatnonzero(wrong.any(axis=1))
    named = ", ".join(str(n) for n in numbers[np.unique(rows // d)[:_NAMED]])
    if np.any(shifts) and share < _MOST_TIED:
        got = f"forces under a rigid shift at {len(np.unique(rows // d))} nodes ({named}, ...)"
        hint = (
            "the stiffness matrix includes springs or supports there: remove "
            "them, or let the program leave out constrained rows."
        )
    elif np.any(shifts):
        got = "forces under a rigid shift at most nodes"
        hint = (
            "the order of the rows is not x, y, z node by node: give 'dofs'; or "
            "the matrix is not a stiffness."
        )
    else:
        got = "forces under a rigid rotation, but none under a shift"
        hint = (
            "the coordinates are not those of the matrices: a different mesh or order "
            "of nodes (give 'dofs'), or nodes with rotated coordinate systems."
        )
    return InputError(
        where,
        got=f"{got}, up to {largest:.2g} of the forces that should cancel",
        expected=f"K R = 0 for every rigid motion R (up to {_LARGEST_FORCE:g})",
        hint=hint,
    )


def without_rigid_strain(K: csr_array, M: csr_array, mesh: Mesh) -> csr_array:
    """Remove the rounding of its file from the stiffness of a free body, so that K R = 0.

    Numbers of 7 to 10 digits leave forces :math:`E = K R`, small against K, that give rigid
    motions a frequency. Those of shifts are taken out of the diagonal blocks. For what is left,
    with a support :math:`G` of three nodes, :math:`G^T R = 1`,

    .. math:: K' = K - E G^T - G E^T + G (R^T E) G^T

    is symmetric, has :math:`K' R = 0`, and adds nine dense rows at most.  A matrix of full
    precision is returned as it is.
    """
    R = rigid_motions(mesh)
    E = K @ R
    squares = np.abs(np.linalg.eigvalsh(np.linalg.solve(R.T @ (M @ R), R.T @ E)))
    if np.sqrt(squares.max()) < 2 * np.pi * _QUIET:
        return K
    K = _without_shifts(K, mesh.dimension)
    E = K @ R
    places = _support(mesh)
    G = np.linalg.pinv(R[places]).T
    row = np.repeat(np.arange(len(R)), len(places))
    part = csr_array(((E @ G.T).ravel(), (row, np.tile(places, len(R)))), shape=K.shape)
    pairs = (np.repeat(places, len(places)), np.tile(places, len(places)))
    corner = csr_array(((G @ (R.T @ E) @ G.T).ravel(), pairs), shape=K.shape)
    clean = csr_array(K - part - part.T.tocsr() + corner)
    return csr_array((clean + clean.T.tocsr()) * 0.5)


def _without_shifts(K: csr_array, d: int) -> csr_array:
    """Change the diagonal blocks so that a rigid shift causes almost no force."""
    n = K.shape[0] // d
    blocks = np.empty((n, d, d))
    for way in range(d):
        along = np.zeros(d * n)
        along[way::d] = 1.0
        blocks[:, :, way] = (K @ along).reshape(n, d)
    if d == 2:  # a shift along r is no rigid motion
        blocks[:, 0] = blocks[:, :, 0] = 0.0
    blocks = (blocks + blocks.transpose(0, 2, 1)) / 2
    at = d * np.arange(n)[:, None, None] + np.zeros((d, d), dtype=np.int64)
    row = (at + np.arange(d)[:, None]).ravel()
    column = (at + np.arange(d)).ravel()
    return csr_array(K - csr_array((blocks.ravel(), (row, column)), shape=K.shape))


def _support(mesh: Mesh) -> NDArray[np.int64]:
    """All directions of three distant nodes (z of one node of a body of revolution)."""
    x = mesh.points
    if mesh.dimension == 2:
        return np.array([2 * int(np.argmin(x[:, 1])) + 1])
    return at_distant_nodes(x, x.mean(axis=0))


def at_distant_nodes(x: NDArray[np.float64], centre: NDArray[np.float64]) -> NDArray[np.int64]:
    """All directions of three nodes far from a centre, and not on one line."""
    first = int(np.argmax(np.linalg.norm(x - centre, axis=1)))
    second = int(np.argmax(np.linalg.norm(x - x[first], axis=1)))
    along = (x[second] - x[first]) / np.linalg.norm(x[second] - x[first])
    third = int(np.argmax(np.linalg.norm(np.cross(x - x[first], along), axis=1)))
    return (3 * np.array([first, second, third])[:, None] + np.arange(3)).ravel()
