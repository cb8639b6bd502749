r"""Elastic bodies whose stiffness and mass another program has assembled, checked before use.

A wrong file is hard to see in an impact, so the matrices must first pass what every elastic body
obeys:

- diagonals are positive, M is positive definite, and K has no negative eigenvalue;
- a rigid motion causes no force, :math:`K R = 0`, in every row that is not tied to a held node;
- there are no more motions without strain than the rigid ones;
- the mass is the same in all directions, and its centre lies among the nodes;
- density, stiffness and wave speed are those of some engineering material.  A uniform strain
  :math:`u = x\, e_x` stores the energy :math:`u^T K u / 2 = V (\lambda + 2 \mu) / 2`, so the body
  itself tells its modulus, and :math:`c^2 = u^T K u / m` its wave speed, whatever its volume.

A wrong unit of the coordinates leaves K R = 0 true (a rotation stays one when all lengths grow);
density and wave speed show it.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.sparse import csr_array, dia_array

from klack.bodies.elasticity.body import ElasticBody, require_support
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.plausible_material import (
    MaterialEstimate,
    estimate_material,
    require_plausible_material,
)
from klack.bodies.elasticity.rigid_motions import (
    held_dofs,
    require_rigid_motions,
    rigid_motions,
    without_rigid_strain,
)
from klack.bodies.elasticity.statics import Flexibility
from klack.errors import InputError, refuse_if
from klack.input.unit_systems import UnitSystem
from klack.mesh.mesh import Mesh
from klack.units import format_si

__all__ = ["MatrixReport", "check_matrices", "checked_body"]


_DENSE = 400


def require_positive_mass(where: str, M: csr_array, free: NDArray[np.int64]) -> None:
    """Check that the mass matrix is positive definite, by its smallest eigenvalue (Lanczos).

    Scaled to a unit diagonal, a consistent mass matrix has eigenvalues of the order of 0.1.
    """
    A = M[free][:, free]
    scale = dia_array((1.0 / np.sqrt(A.diagonal())[None], [0]), shape=A.shape)
    scaled = (scale @ A @ scale).tocsr()
    if len(free) <= _DENSE:
        smallest = float(scipy.linalg.eigvalsh(scaled.toarray(), subset_by_index=[0, 0])[0])
    else:
        start = np.random.default_rng(5).standard_normal(len(free))
        values = scipy.sparse.linalg.eigsh(
            scaled, k=1, which="SA", tol=1e-2, v0=start, return_eigenvectors=False
        )
        smallest = float(values[0])
    refuse_if(
        not smallest > 0,
        where,
        got=f"a mass matrix with a negative eigenvalue ({smallest:.2g} of its diagonal)",
        expected="a positive definite mass matrix",
        hint="the entry is K, or only the off-diagonal part of M; use a consistent mass matrix.",
    )


def first_frequency(where: str, body: ElasticBody) -> float:
    """Lowest elastic eigenfrequency [Hz], and the check that nothing else is below it.

    With K R = 0, and with as many degrees of freedom held as there are rigid motions, K has a
    Cholesky factor exactly if it has no negative eigenvalue and no motions without strain but the
    rigid ones.
    """
    try:
        with Flexibility(body) as flexibility:
            modes = eigenmodes(body, count=1, flexibility=flexibility)
    except InputError as error:
        raise InputError(
            where,
            got=f"{body.rigid_modes.shape[1]} rigid motions free, and {error.got}",
            expected="a stiffness with strain in every other motion, with all eigenvalues above 0",
            hint="the body is in several pieces or has a mechanism (glue its solids before the "
            "matrices are written), or the matrix has stress stiffening, or K and M are exchanged.",
        ) from error
    return float(modes.frequency[0])


_SAME_MASS = 1e-4


@dataclass(frozen=True, kw_only=True)
class MatrixReport:
    """Properties found of K and M.

    Parameters
    ----------
    rows
        What, and its value in words.
    mass [kg]
        Without the degrees of freedom that are missing in the files.
    centre_of_mass [m]
    strain [-]
        Largest force of a rigid motion, relative to the forces that cancel in it.
    rigid
        Number of motions without strain.
    held
        Number of degrees of freedom at zero.
    """

    rows: tuple[tuple[str, str], ...]
    mass: float
    centre_of_mass: tuple[float, ...]
    material: MaterialEstimate
    strain: float
    first_frequency: float
    rigid: int
    held: int


def check_matrices(
    where: str,
    K: csr_array,
    M: csr_array,
    mesh: Mesh,
    *,
    fixed: NDArray[np.int64],
    absent: NDArray[np.int64] | None = None,
    numbers: NDArray[np.int64] | None = None,
    units: UnitSystem | None = None,
) -> MatrixReport:
    """Check K and M of all degrees of freedom against the nodes they belong to.

    Parameters
    ----------
    mesh
        Elements and faces may be missing.
    fixed
        Degrees of freedom at zero, absent ones included.
    absent
        Those without rows in the files.
    numbers
        Of each node in its program, for messages.
    units
        Of the files; with it, a message names the system that would fit.
    """
    absent = np.empty(0, dtype=np.int64) if absent is None else absent
    numbers = np.arange(1, mesh.node_count + 1) if numbers is None else numbers
    free = np.setdiff1d(np.arange(mesh.dof_count), fixed)
    name = _Namer(numbers, mesh.dimension)
    _require_positive_diagonals(where, K, M, free, name)
    R = rigid_motions(mesh)
    mass, centre = _require_one_mass(where, M, mesh, absent[R[absent].any(axis=1)])
    material = estimate_material(K, mesh, mass)
    require_plausible_material(where, material, units)
    strain = require_rigid_motions(where, K, mesh, absent, numbers)
    require_positive_mass(where, M, free)
    is_free = not np.any(R[fixed])
    rigid = R.shape[1] if is_free else 0
    if rigid:
        K = without_rigid_strain(K, M, mesh)
    body = ElasticBody(name="given", mesh=mesh, K=K, M=M, fixed=np.sort(fixed))
    frequency = first_frequency(where, body)
    rows = (
        ("degrees of freedom", f"{mesh.dof_count}, {len(fixed)} of them held"),
        ("left out in the files", f"{len(absent)} degrees of freedom, taken as held"),
        ("mass", f"{1e3 * mass:.6g} g" + (" without held nodes" if len(absent) else "")),
        ("centre of mass", ", ".join(f"{round(1e3 * x, 9) + 0.0:.6g}" for x in centre) + " mm"),
        ("density", material.density_in_words),
        ("modulus lambda + 2 mu", material.modulus_in_words),
        ("wave speed", f"{material.wave_speed:.4g} m/s"),
        ("rigid motions", f"{rigid}; {strain:.1g} of their forces do not cancel"),
        ("definiteness", "mass positive, stiffness positive except for rigid motions"),
        ("first eigenfrequency", format_si(frequency, "Hz", 6)),
    )
    return MatrixReport(
        rows=tuple(row for row in rows if len(absent) or not row[0].startswith("left out")),
        mass=mass,
        centre_of_mass=tuple(float(x) for x in centre),
        material=material,
        strain=strain,
        first_frequency=frequency,
        rigid=rigid,
        held=len(fixed),
    )


def checked_body(
    name: str,
    mesh: Mesh,
    K: csr_array,
    M: csr_array,
    *,
    fixed_nodes: Iterable[int] = (),
    absent: NDArray[np.int64] | None = None,
    where: str | None = None,
    numbers: NDArray[np.int64] | None = None,
    units: UnitSystem | None = None,
) -> tuple[ElasticBody, MatrixReport]:
    """Make a body from given matrices, with a report on them; parameters as :func:`check_matrices`.

    Parameters
    ----------
    mesh
        With or without elements.
    fixed_nodes
        Held in all directions; degrees of freedom in ``absent`` are held as well.
    """
    where = f"body '{name}': matrices" if where is None else where
    fixed = held_dofs(mesh, np.unique(np.fromiter(fixed_nodes, dtype=np.int64)))
    if absent is not None:
        fixed = np.union1d(fixed, absent)
    _require_sizes(where, K, M, mesh)
    held = rigid_motions(mesh)[fixed]
    if np.any(held):
        require_support(
            name,
            held,
            "supports",
            "held degrees of freedom",
            "are not on one line; constraints of the program that wrote the matrices apply here "
            "too.",
        )
    report = check_matrices(
        where, K, M, mesh, fixed=fixed, absent=absent, numbers=numbers, units=units
    )
    if report.rigid:
        K = without_rigid_strain(K, M, mesh)
    return ElasticBody(name=name, mesh=mesh, K=K, M=M, fixed=fixed), report


class _Namer:
    def __init__(self, numbers: NDArray[np.int64], dimension: int) -> None:
        self._numbers, self._letters = numbers, "rz" if dimension == 2 else "xyz"

    def __call__(self, dof: int) -> str:
        node, way = divmod(int(dof), len(self._letters))
        return f"node {self._numbers[node]}, direction {self._letters[way]}"


def _require_sizes(where: str, K: csr_array, M: csr_array, mesh: Mesh) -> None:
    n = mesh.dof_count
    refuse_if(
        K.shape != (n, n) or M.shape != (n, n),
        where,
        got=f"K of shape {K.shape} and M of shape {M.shape}",
        expected=f"({n}, {n}) for {mesh.node_count} nodes",
        hint="the mesh must be that of the model that wrote the matrices.",
    )


def _require_positive_diagonals(
    where: str, K: csr_array, M: csr_array, free: NDArray[np.int64], name: _Namer
) -> None:
    for letter, A, hint in (
        ("K", K, "the node belongs to no element, or the mesh is a different one."),
        (
            "M",
            M,
            "use a consistent mass matrix; every node needs mass, and a density must be given.",
        ),
    ):
        diagonal = A.diagonal()[free]
        wrong = np.flatnonzero(~(diagonal > 0))
        if len(wrong):
            raise InputError(
                where,
                got=f"{letter} = {diagonal[wrong[0]]:.4g} on the diagonal at "
                f"{name(free[wrong[0]])} and {len(wrong)} places in all",
                expected="values above 0",
                hint=hint,
            )


def _require_one_mass(
    where: str, M: csr_array, mesh: Mesh, absent: NDArray[np.int64]
) -> tuple[float, NDArray[np.float64]]:
    """Mass [kg], the same in every direction, and its centre [m] among the nodes."""
    d, x = mesh.dimension, mesh.points
    along = [np.zeros(mesh.dof_count) for _ in range(d)]
    for way in range(d):
        along[way][way::d] = 1.0
    ways = range(d) if d == 3 else (1,)  # r is no direction of a rigid motion
    moved = {way: M @ along[way] for way in ways}
    mass = {way: float(along[way] @ moved[way]) for way in ways}
    mean = float(np.mean(list(mass.values())))
    unlike = max(mass.values()) - min(mass.values())
    crossed = max(
        (abs(float(along[a] @ moved[b])) for a in ways for b in ways if a != b), default=0.0
    )
    refuse_if(
        not max(unlike, crossed) <= _SAME_MASS * mean and not len(absent),
        where,
        got=f"masses of {', '.join(f'{m:.6g}' for m in mass.values())} kg along x, y, z and "
        f"{crossed:.3g} kg of coupling",
        expected="the same mass in all directions, and no coupling",
        hint="the order of the rows differs (give 'dofs'), or nodes have "
        "rotated coordinate systems.",
    )
    nodal = np.mean([moved[way][way::d] for way in ways], axis=0)
    centre = np.asarray(nodal @ x / nodal.sum())
    low, high = x.min(axis=0), x.max(axis=0)
    slack = 1e-6 * (high - low)
    refuse_if(
        np.any(centre < low - slack) or np.any(centre > high + slack),
        where,
        got=f"a centre of mass at ({', '.join(f'{1e3 * c:.4g}' for c in centre)}) mm",
        expected="a point within the bounding box of the nodes",
        hint="the mass matrix has negative parts, or belongs to different nodes.",
    )
    if d == 2:
        centre[0] = 0.0
    return mean, centre
