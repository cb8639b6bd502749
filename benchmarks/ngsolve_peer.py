"""NGSolve beside klack: assembly of K and M and the lowest modes, on one mesh.

Both get the ten-node tetrahedra of the housing of the demo valve with straight edges, so that both
have the same space of functions; their frequencies then agree to the tolerance of the iteration.
NGSolve numbers hierarchical functions and gets its own sparse Cholesky factorisation; for the modes
the faster of its own LOBPCG with the exact inverse, and ARPACK of scipy on its factor.  (Its own
shift-and-invert Arnoldi iteration wants complex spaces.)  One thread each.
"""

from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from io import StringIO
from time import process_time
from typing import Any

import numpy as np
from number import Number, Size
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, eigsh
from solid_valve import solid_valve
from threadpoolctl import threadpool_limits

from klack.assembling.bodies import build_bodies
from klack.bodies.elasticity.assembly import assemble
from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.factorization import factorize
from klack.bodies.elasticity.statics import Flexibility
from klack.machine.progress import silent
from klack.materials.material import Material
from klack.mesh.mesh import ElementBlock, Mesh

__all__ = ["numbers", "straightened"]

_STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
_HELD = "bottom"  # surface of the housing
_ENOUGH = 1e-6  # of a frequency: both are then exact beside the error of the mesh
_ROUNDS = 5  # of four iterations each


@dataclass(frozen=True, kw_only=True)
class _Modal:
    """Processor seconds of one program, and its frequencies [Hz]."""

    assembly: float
    factorisation: float
    modes: float
    frequency: NDArray[np.float64]


def numbers(size: Size) -> list[Number]:
    """Processor times of both, their ratios, and how far their frequencies are apart."""
    scale, layers = {"smallest": (3.0, 6), "quick": (2.0, 9), "full": (1.0, 18)}[size]
    count = {"smallest": 5, "quick": 20, "full": 40}[size]
    mesh = straightened(build_bodies(solid_valve(scale, layers), silent).lower.mesh)
    with threadpool_limits(limits=1):
        klack = _by_klack(mesh, count)
        iterated = _by_arpack(mesh, count)
        other = _by_ngsolve(mesh, count, klack.frequency)
    apart = float(np.abs(other.frequency / klack.frequency - 1.0).max())
    arpack_apart = float(np.abs(iterated[1] / klack.frequency - 1.0).max())
    found = [
        Number(name=f"{program}: {stage}, {mesh.dof_count} dof", value=value, unit="s")
        for program, run in (("klack", klack), ("NGSolve", other))
        for stage, value in (
            ("assembly of K and M", run.assembly),
            ("factorisation", run.factorisation),
            (f"{count} modes", run.modes),
        )
    ]
    ratios = {
        "assembly": other.assembly / klack.assembly,
        f"factorisation and {count} modes": (other.factorisation + other.modes)
        / (klack.factorisation + klack.modes),
    }
    found += [
        Number(
            name=f"NGSolve over klack: {name}",
            value=ratio,
            unit="-",
            accuracy=apart,
            accuracy_of="frequencies apart",
            series="ratio",
        )
        for name, ratio in ratios.items()
    ]
    found.append(
        Number(
            name=f"ARPACK of scipy on klack's factor over klack: {count} modes",
            value=iterated[0] / klack.modes,
            unit="-",
            accuracy=arpack_apart,
            accuracy_of="frequencies apart",
            series="ratio",
        )
    )
    return found


def straightened(mesh: Mesh) -> Mesh:
    """The same ten-node tetrahedra with every middle node half way between its corners."""
    points = mesh.points.copy()
    for block in mesh.blocks:
        corners = block.topology.corners
        for k, (a, b) in enumerate(block.topology.edges):
            ends = points[block.connectivity[:, a]] + points[block.connectivity[:, b]]
            points[block.connectivity[:, corners + k]] = 0.5 * ends
    return replace(mesh, points=points)


def _by_klack(mesh: Mesh, count: int) -> _Modal:
    materials = dict.fromkeys(mesh.solids, _STEEL)
    assemble(_first_elements(mesh), materials)  # compiled before the clock starts
    begin = process_time()
    assemble(mesh, materials)
    assembled = process_time() - begin
    body = _body(mesh)
    begin = process_time()
    with Flexibility(body, threads=1) as flexibility:
        factorised = process_time() - begin
        begin = process_time()
        modes = eigenmodes(body, count=count, flexibility=flexibility)
        iterated = process_time() - begin
    return _Modal(
        assembly=assembled, factorisation=factorised, modes=iterated, frequency=modes.frequency
    )


def _body(mesh: Mesh) -> ElasticBody:
    held = np.unique(_held_faces(mesh))
    return elastic_body("housing", mesh, dict.fromkeys(mesh.solids, _STEEL), fixed_nodes=held)


def _held_faces(mesh: Mesh) -> NDArray[np.int64]:
    return np.concatenate([block.connectivity for block in mesh.surface(_HELD).blocks])


def _first_elements(mesh: Mesh) -> Mesh:
    """A mesh of the first element alone."""
    block = mesh.blocks[0]
    nodes = block.connectivity[0]
    connectivity = np.arange(len(nodes))[None]
    element = ElementBlock(block.family, connectivity, block.solid)
    return Mesh(points=mesh.points[nodes], blocks=(element,))


def _by_arpack(mesh: Mesh, count: int) -> tuple[float, NDArray[np.float64]]:
    """Processor seconds and frequencies of the shift-and-invert iteration of scipy."""
    body = _body(mesh)
    K, M = (A[body.free][:, body.free] for A in (body.K, body.M))
    with factorize(K, threads=1) as factor:
        inverse = LinearOperator(K.shape, matvec=factor.solve, dtype=float)
        begin = process_time()
        squares = eigsh(K, k=count, M=M, sigma=0.0, OPinv=inverse, tol=1e-10)[0]
        spent = process_time() - begin
    return spent, np.sqrt(np.sort(squares)) / (2.0 * np.pi)


def _by_ngsolve(mesh: Mesh, count: int, exact: NDArray[np.float64]) -> _Modal:
    """NGSolve by the faster of two iterations."""
    import ngsolve as ng

    ng.SetNumThreads(1)
    space = ng.VectorH1(ng.Mesh(_netgen_mesh(mesh)), order=2, dirichlet="held")
    u, v = space.TnT()
    strain = ng.Sym(ng.Grad(u))
    stress = 2.0 * _STEEL.shear_modulus * strain
    stress += _STEEL.lame_lambda * ng.Trace(strain) * ng.Id(3)
    elastic = ng.InnerProduct(stress, ng.Sym(ng.Grad(v))).Compile()
    inertia = (_STEEL.density * ng.InnerProduct(u, v)).Compile()
    best = np.inf
    for _ in range(2):
        begin = process_time()
        K = ng.BilinearForm(elastic * ng.dx, symmetric=True).Assemble()
        M = ng.BilinearForm(inertia * ng.dx, symmetric=True).Assemble()
        best = min(best, process_time() - begin)
    K.mat.SetInverseType("sparsecholesky")
    begin = process_time()
    inverse = K.mat.Inverse(space.FreeDofs())
    factorised = process_time() - begin
    own = _by_lobpcg(K.mat, M.mat, inverse, count, exact)
    free = np.flatnonzero(np.array(space.FreeDofs()))
    arpack = _by_arpack_on(K.mat, M.mat, inverse, free, count)
    if arpack[0] > own[0] and np.abs(own[1] / exact - 1.0).max() <= _ENOUGH:
        arpack = own
    return _Modal(assembly=best, factorisation=factorised, modes=arpack[0], frequency=arpack[1])


def _by_lobpcg(
    K: Any, M: Any, inverse: Any, count: int, exact: NDArray[np.float64]
) -> tuple[float, NDArray[np.float64]]:
    """NGSolve's own iteration, with the exact inverse, until the frequencies are right."""
    from ngsolve.eigenvalues import LOBPCG

    vectors, spent = None, 0.0
    frequency = np.zeros(count)
    for _ in range(_ROUNDS):
        begin = process_time()
        with redirect_stdout(StringIO()):
            squares, vectors = LOBPCG(
                K, M, inverse, num=count + count // 2, maxit=4, initial=vectors, printrates=False
            )
        spent += process_time() - begin
        frequency = np.sqrt(np.sort(np.asarray(squares))[:count]) / (2.0 * np.pi)
        if np.abs(frequency / exact - 1.0).max() <= _ENOUGH:
            break
    return spent, frequency


def _by_arpack_on(
    K: Any, M: Any, inverse: Any, free: NDArray[np.int64], count: int
) -> tuple[float, NDArray[np.float64]]:
    """ARPACK of scipy on the matrices and the factor of NGSolve."""
    right, solution = K.CreateColVector(), K.CreateColVector()
    right[:] = 0.0

    def solve(b: NDArray[np.float64]) -> NDArray[np.float64]:
        right.FV().NumPy()[free] = b
        solution.data = inverse * right
        return solution.FV().NumPy()[free]

    matrices = []
    for matrix in (K, M):
        values, columns, start = matrix.CSR()
        whole = csr_array(
            (np.asarray(values), np.asarray(columns), np.asarray(start)),
            shape=(matrix.height, matrix.width),
        )
        matrices.append(whole[free][:, free])
    operator = LinearOperator(matrices[0].shape, matvec=solve, dtype=float)
    begin = process_time()
    squares = eigsh(matrices[0], k=count, M=matrices[1], sigma=0.0, OPinv=operator, tol=1e-10)[0]
    spent = process_time() - begin
    return spent, np.sqrt(np.sort(squares)) / (2.0 * np.pi)


def _netgen_mesh(mesh: Mesh) -> object:
    """Corners and faces of the tetrahedra as Netgen holds them; the held faces are named."""
    import netgen.meshing as nm

    target = nm.Mesh(dim=3)
    corners = np.unique(np.concatenate([b.connectivity[:, :4].ravel() for b in mesh.blocks]))
    number = {int(node): target.Add(nm.MeshPoint(nm.Pnt(*mesh.points[node]))) for node in corners}
    target.Add(nm.FaceDescriptor(surfnr=1, domin=1, domout=0, bc=1))
    target.SetBCName(0, "held")
    target.SetMaterial(1, "steel")
    for face in _held_faces(mesh)[:, :3]:
        target.Add(nm.Element2D(1, [number[int(n)] for n in face]))
    for block in mesh.blocks:
        for element in block.connectivity[:, :4]:
            target.Add(nm.Element3D(1, [number[int(n)] for n in element]))
    target.Update()
    return target
