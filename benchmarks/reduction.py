"""Reduction of the solid valve: meshes, matrices, factors, static contact, modes, local law."""

from time import perf_counter

import numpy as np
from machine import peak_gigabytes
from number import Number, Size
from solid_valve import solid_valve

from klack.assembling.modes import mode_pools
from klack.assembling.problem import build_problem
from klack.assembling.reduced_pair import first_stiffness, own_pair
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.case import load_case, shipped_cases
from klack.machine.progress import silent

__all__ = ["largest_residual", "numbers"]

_MODES = 50


def numbers(size: Size) -> list[Number]:
    """Time and memory from the case to two reduced bodies of 50 modes each and their law."""
    if size == "smallest":
        case = load_case(shipped_cases()["demo-valve-axisymmetric"])
    else:
        case = solid_valve(2.0, 9) if size == "quick" else solid_valve(0.55, 28)
    begin = perf_counter()
    problem = build_problem(case, silent)
    pools = mode_pools(problem, at_least=_MODES, progress=silent)
    own_pair(problem, pools, stiffness=first_stiffness(problem))
    seconds = perf_counter() - begin
    peak = peak_gigabytes()
    bodies = (problem.pair.upper, problem.pair.lower)
    residual = max(largest_residual(body, pools[body.name]) for body in bodies)
    problem.close()
    goals = (60.0, 3.0) if size == "full" else (None, None)
    dofs = sum(body.dof_count for body in bodies)
    name = f"reduction of {dofs} degrees of freedom"
    return [
        Number(
            name=f"{name}: time",
            value=seconds,
            unit="s",
            goal=goals[0],
            accuracy=residual,
            accuracy_of="of modes, K x - omega^2 M x over K x",
        ),
        Number(name=f"{name}: peak memory", value=peak, unit="GB", goal=goals[1]),
    ]


def largest_residual(body: ElasticBody, modes: Modes) -> float:
    """Largest residual of the eigenproblem on the free degrees of freedom, relative to K x."""
    shapes = modes.shapes
    elastic = (body.K @ shapes)[body.free]
    inertia = (body.M @ shapes)[body.free] * modes.omega**2
    norms = np.linalg.norm(elastic - inertia, axis=0) / np.linalg.norm(elastic, axis=0)
    return float(norms.max())
