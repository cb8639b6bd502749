"""SciPy with PARDISO, and CalculiX, beside klack: factor and 50 modes of a housing, on one mesh.

The housing of the demo valve, and one with ribs, held where their cases say.  SciPy iterates with
ARPACK in shift and invert on a factor of ``pypardiso``, on the matrices of klack; CalculiX reads
the mesh and assembles as well, with its own solver (``ccx`` of Debian: SPOOLES).  It integrates the
mass of quadratic tetrahedra with four points, so that high modes of coarse meshes differ.
Processor times, one thread each.
"""

import resource
import shutil
import tempfile
from pathlib import Path
from time import process_time

import numpy as np
from number import Number, Size
from numpy.typing import NDArray
from ribbed_housing import ribbed_housing
from scipy.sparse.linalg import LinearOperator, eigsh
from solid_valve import solid_valve
from threadpoolctl import threadpool_limits

from klack.assembling.bodies import build_bodies
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.statics import Flexibility
from klack.case.schema import Case
from klack.machine.progress import silent
from klack.materials.material import Material
from klack.verification.exchange import calculix_frequencies

__all__ = ["numbers"]

_MODES = 50
_HOURS = 2.0  # until CalculiX is stopped

Found = tuple[float, NDArray[np.float64]]


def numbers(size: Size) -> list[Number]:
    """Ratios of processor times over meshes, with the deviation of the frequencies."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        cases = [solid_valve(3.0, 6), solid_valve(1.0, 18)]  # housing of the demo valve
        cases += [ribbed_housing(folder, *mesh) for mesh in ((4.0, 0.04), (0.66, 0.04))]
        count = {"smallest": 1, "quick": 2, "full": 4}[size]
        return [
            number
            for case in cases[:count]
            for number in _measure(case, folder / str(cases.index(case)))
        ]


def _measure(case: Case, folder: Path) -> list[Number]:
    body = build_bodies(case, silent).lower
    (material,) = case.materials_of(body.name, body.mesh.solids).values()
    with threadpool_limits(limits=1):
        own, frequency = _by_klack(body)
        others = {"SciPy with pypardiso": _by_arpack(body)}
        if shutil.which("ccx") is not None:
            others["CalculiX"] = _by_calculix(body, material, folder)
    what = f"factor and {_MODES} modes, {body.dof_count} dof"
    found = [Number(name=f"klack: {what}", value=own, unit="s")]
    for program, (spent, theirs) in others.items():
        found.append(
            Number(
                name=f"{program} over klack: {what}",
                value=spent / own,
                unit="-",
                accuracy=float(np.abs(theirs / frequency - 1.0).max()),
                accuracy_of="frequencies apart",
                series=f"{program} over klack",
                at=body.dof_count,
            )
        )
    return found


def _by_klack(body: ElasticBody) -> Found:
    begin = process_time()
    with Flexibility(body, threads=1) as flexibility:
        modes = eigenmodes(body, count=_MODES, flexibility=flexibility)
    return process_time() - begin, modes.frequency


def _by_arpack(body: ElasticBody) -> Found:
    from pypardiso import PyPardisoSolver

    K, M = (A[body.free][:, body.free].tocsr() for A in (body.K, body.M))
    begin = process_time()
    solver = PyPardisoSolver()
    solver.factorize(K)
    inverse = LinearOperator(K.shape, matvec=lambda b: solver.solve(K, b), dtype=float)
    squares = eigsh(K, k=_MODES, M=M, sigma=0.0, OPinv=inverse, tol=1e-10)[0]
    spent = process_time() - begin
    solver.free_memory(everything=True)
    return spent, np.sqrt(np.sort(squares)) / (2.0 * np.pi)


def _by_calculix(body: ElasticBody, material: Material, folder: Path) -> Found:
    held = np.setdiff1d(np.arange(len(body.mesh.points)), body.free // 3)
    before = _of_children()
    found = calculix_frequencies(
        body.mesh, material, _MODES, folder, held=held, seconds=3600.0 * _HOURS
    )
    return _of_children() - before, found


def _of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
