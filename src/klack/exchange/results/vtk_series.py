r"""An impact as a film for ParaView: displacement, velocity and stress of both bodies over time.

At the full level the fields are those of the run, node by node.  At the reduced level they are
recovered from the modes,

.. math:: u = \Phi q + F \left( K^+ p(F) - \Phi_e \Omega_e^{-2} \Phi_e^T p_0 \right)

with the contact force ``F``, the pressure pattern ``p(F)`` of the static contact at that force and
the pattern ``p_0`` of the reduced model: the modes carry the waves, the static solution the
contact (mode acceleration; Craig & Kurdila 2006, ch. 17).  The velocity is that of the modes alone.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from klack.case.schema import Case
from klack.elasticity.body import ElasticBody
from klack.elasticity.eigen import Modes
from klack.elasticity.statics import Flexibility
from klack.elasticity.stress import StressField, von_mises
from klack.errors import InputError
from klack.exchange.results.naming import file_stems
from klack.exchange.results.vtu import SeriesFile, VtuGrid, write_pvd
from klack.exchange.results.whole_file import whole_files
from klack.reduction.ports import Port
from klack.reduction.reduce import reduce_body
from klack.simulation.impact import simulate
from klack.transient.full_order import simulate_full_order
from klack.transient.result import MotionOfBody, Snapshots
from klack.workflow.levels import (
    damping_of,
    first_stiffness,
    impact_system,
    mode_pools,
    own_pair,
    selection_of,
)
from klack.workflow.problem import ContactProblem, build_problem
from klack.workflow.progress import Progress, silent

__all__ = ["write_impact_series"]

_LEAST = 1e-3
"""Smallest share of the largest static force whose pressure pattern is asked for."""

_Frame = tuple[float, tuple[MotionOfBody, ...]]


def write_impact_series(
    case: Case,
    folder: Path,
    *,
    level: Literal["full", "reduced"],
    frames: int = 50,
    progress: Progress = silent,
    threads: int | None = None,
) -> Path:
    """Compute one impact and write ``<case>_<level>.pvd`` with one grid per body and instant.

    Fields in single precision: ``displacement`` [m] from the start of the motion, ``velocity``
    [m/s], ``stress`` [Pa] (xx, yy, zz, xy, yz, xz) and ``von_mises`` [Pa]; a body that came as
    matrices has no stress.  Axisymmetric bodies are drawn in the half plane y = 0.

    Parameters
    ----------
    case : Case
    folder : Path
        What stands there under the same names is replaced when everything is complete.
    level : "full" or "reduced"
    frames : int
        Instants, evenly spaced over ``run.duration``; fewer if the run has fewer steps.
    progress : callable
    threads : int, optional

    Returns
    -------
    Path
        Of the ``.pvd``.

    Raises
    ------
    InputError
        For a case that this level cannot compute, fewer than two frames, or a place that cannot be
        written to.
    """
    if frames < 2:
        raise InputError(
            "write_impact_series: frames",
            got=f"{frames}",
            expected="at least 2",
            hint="50 make a smooth film.",
        )
    case.require_levels([level])
    problem = build_problem(case, progress, threads=threads)
    bodies = (problem.pair.upper, problem.pair.lower)
    stems = file_stems([body.name for body in bodies])
    name = f"{file_stems([case.name])[0]}_{level}"
    with whole_files(folder) as stage:
        grids = stage / name
        grids.mkdir()
        film = _Film(case, bodies, stems, grids)
        if level == "full":
            _run_full(problem, film, frames, progress, threads)
        else:
            for frame in _reduced_frames(problem, frames, progress):
                film.add(*frame)
            problem.close()
        write_pvd(stage / f"{name}.pvd", film.files)
    return folder / f"{name}.pvd"


class _Film:
    """Writes frame after frame."""

    def __init__(
        self, case: Case, bodies: Sequence[ElasticBody], stems: Sequence[str], folder: Path
    ) -> None:
        self.folder, self.stems = folder, stems
        self.files: list[SeriesFile] = []
        self.stress: list[StressField | None] = []
        self.grids: list[VtuGrid] = []
        for body in bodies:
            known = case.bodies[body.name].material is not None
            materials = case.materials_of(body.name, body.mesh.solids) if known else {}
            field = StressField(body.mesh, materials) if known else None
            self.stress.append(field)
            self.grids.append(VtuGrid(body.mesh if field is None else field.mesh))

    def add(self, time: float, motion: Sequence[MotionOfBody]) -> None:
        """Write all bodies at one instant."""
        number = len(self.files) // len(self.grids)
        parts = zip(self.stems, self.grids, self.stress, motion, strict=True)
        for part, (stem, grid, stress, body) in enumerate(parts):
            name = f"{stem}_{number:04d}.vtu"
            grid.write(self.folder / name, _fields(stress, body), time)
            self.files.append(
                SeriesFile(time=time, part=part, name=body.name, file=f"{self.folder.name}/{name}")
            )


def _fields(stress: StressField | None, body: MotionOfBody) -> dict[str, NDArray[np.float64]]:
    """Nodal fields at the points of the grid."""
    if stress is None:
        return {"displacement": body.displacement, "velocity": body.velocity}
    d = stress.mesh.dimension
    tensor = stress(body.displacement)
    return {
        "displacement": body.displacement.reshape(-1, d)[stress.nodes],
        "velocity": body.velocity.reshape(-1, d)[stress.nodes],
        "stress": tensor,
        "von_mises": von_mises(tensor),
    }


# --------------------------------------------------------------------------- full level


def _run_full(
    problem: ContactProblem, film: _Film, frames: int, progress: Progress, threads: int | None
) -> None:
    case, pair = problem.case, problem.pair
    problem.close()
    closing = case.motion.force + (case.motion.spring.preload if case.motion.spring else 0.0)
    progress("full order", 0.0)
    simulate_full_order(
        pair.upper,
        pair.lower,
        problem.space,
        speed=case.motion.speed,
        duration=case.run.duration,
        step=case.run.full_step,
        axial_force=-closing,
        threads=threads or 2,
        progress=lambda fraction: progress("full order", fraction),
        snapshots=Snapshots(
            steps=_instants(case.run.duration, case.run.full_step, frames), receive=film.add
        ),
    )


def _instants(duration: float, step: float, frames: int) -> tuple[int, ...]:
    """Steps at which the frames are, as even as whole steps allow."""
    last = ceil(duration / step * (1.0 - 1e-9))
    return tuple(dict.fromkeys(round(k * last / (frames - 1)) for k in range(frames)))


# --------------------------------------------------------------------------- reduced level


@dataclass(frozen=True, kw_only=True, eq=False)
class _Recovered:
    """From modal coordinates and contact force to the displacement of all nodes.

    ``missing`` [m/N] is what the modes already hold of the static deflection, with a minus; None
    where attachment modes or nothing at all stand for the rest.
    """

    name: str
    shapes: NDArray[np.float64]
    flexibility: Flexibility
    missing: NDArray[np.float64] | None

    def motion(
        self,
        q: NDArray[np.float64],
        v: NDArray[np.float64],
        force: float,
        load: NDArray[np.float64],
    ) -> MotionOfBody:
        """Fields under a contact force [N] with its load pattern, shape (n_dof,)."""
        u = self.shapes @ q
        if self.missing is not None and force > 0.0:
            u = u + force * (self.flexibility.solve(load[:, None])[:, 0] + self.missing)
        return MotionOfBody(name=self.name, displacement=u, velocity=self.shapes @ v)


def _recovered(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    elastic: ElasticBody,
    flexibility: Flexibility,
    port: Port,
    sign: float,
) -> _Recovered:
    case = problem.case
    body = reduce_body(
        elastic,
        [port],
        modes=selection_of(case.reduction.choice(elastic.name)),
        correction=case.reduction.correction,
        damping=damping_of(case.bodies[elastic.name].damping),
        modes_pool=pools[elastic.name],
        flexibility=flexibility,
        recovery_nodes=np.arange(elastic.mesh.node_count),
    )
    shapes = np.zeros((elastic.dof_count, 0)) if body.recovery is None else body.recovery.shapes
    missing = None
    if body.correction == "consistent":
        own = slice(body.rigid_count, None)
        missing = -sign * shapes[:, own] @ (body.port_shapes[own, 0] / body.omega[own] ** 2)
    return _Recovered(name=elastic.name, shapes=shapes, flexibility=flexibility, missing=missing)


def _reduced_frames(problem: ContactProblem, frames: int, progress: Progress) -> Iterator[_Frame]:
    """Every instant from a run of its own: a run takes milliseconds, a record of modes memory."""
    case, both = problem.case, problem.pair
    pools = mode_pools(problem, at_least=1, progress=progress)
    progress("reduced", 0.0)
    pair = own_pair(problem, pools, stiffness=first_stiffness(problem))
    # the force pushes the upper body up and the lower one down
    parts = (
        _recovered(problem, pools, both.upper, problem.flexibility_upper, pair.ports[0], 1.0),
        _recovered(problem, pools, both.lower, problem.flexibility_lower, pair.ports[1], -1.0),
    )
    system = impact_system(case, pair.upper, pair.lower, pair.law)
    thrown = np.zeros(pair.upper.mode_count)
    thrown[: pair.upper.rigid_count] = -case.motion.speed * pair.upper.rigid_axial
    still = np.zeros(pair.lower.mode_count)
    q: tuple[NDArray[np.float64], ...] = (0.0 * thrown, still)
    v: tuple[NDArray[np.float64], ...] = (thrown, still)
    step = case.run.reduced_step
    instants = _instants(case.run.duration, step, frames)
    force = 0.0
    for k, steps in enumerate(instants):
        if steps > 0:
            record = simulate(
                system,
                velocities={pair.upper.name: -case.motion.speed},
                step=step,
                duration=steps * step,
            )
            q, v, force = record.final_position, record.final_velocity, float(record.force[-1, 0])
        loads = problem.static.load_patterns(
            float(np.clip(force, _LEAST * problem.static.max_force, problem.static.max_force))
        )
        yield (
            steps * step,
            tuple(
                part.motion(own_q, own_v, force, load)
                for part, own_q, own_v, load in zip(parts, q, v, loads, strict=True)
            ),
        )
        progress("reduced", (k + 1) / len(instants))
