"""An impact as a film for ParaView: displacement, velocity and stress of both bodies.

At the full level node by node; at the reduced level
:mod:`klack.analyses.impact.recovered_motion` recovers the fields from the modes.
"""

from collections.abc import Sequence
from math import ceil
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from klack.analyses.impact.full_level import simulate_in_full
from klack.analyses.impact.recovered_motion import recovered_motion
from klack.assembling.modes import is_damped, kept_modes, mode_pools
from klack.assembling.problem import ContactProblem, build_problem
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.stress import StressField, von_mises
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.errors import refuse_if
from klack.exchange.results.table import file_stems
from klack.exchange.results.vtu import SeriesFile, VtuGrid, write_pvd
from klack.files.whole import whole_files
from klack.machine.progress import Progress, silent
from klack.mesh.mesh import Mesh
from klack.transient.result import MotionOfBody, Snapshots

__all__ = ["write_impact_series"]


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
    [m/s], ``stress`` [Pa] (xx, yy, zz, xy, yz, xz) and ``von_mises`` [Pa], except of given
    matrices. Axisymmetric bodies are in the half plane y = 0.

    Parameters
    ----------
    folder
        Files of the same names are replaced when everything is complete.
    frames
        Evenly over ``run.duration``, at most one per step; two at least.
    """
    refuse_if(
        frames < 2,
        "write_impact_series: frames",
        got=f"{frames}",
        expected="at least 2",
        hint="50 give a smooth animation.",
    )
    case.require_levels([level])
    case.require_on_axis("a series of fields")
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
            instants = _instants(case.run.duration, case.run.reduced_step, frames)
            for time, motion in recovered_motion(problem, instants, progress):
                film.add(time, motion)
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
        drawn = [stress_grid(case, body.name, body.mesh) for body in bodies]
        self.stress, self.grids = zip(*drawn, strict=True)

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


def stress_grid(
    case: Case | ValveCase, name: str, mesh: Mesh
) -> tuple[StressField | None, VtuGrid]:
    """Stress of a body of known material, and the grid of its fields."""
    known = case.bodies[name].material is not None
    field = StressField(mesh, case.materials_of(name, mesh.solids)) if known else None
    return field, VtuGrid(mesh if field is None else field.mesh)


def _fields(stress: StressField | None, body: MotionOfBody) -> dict[str, NDArray[np.float64]]:
    """Nodal fields of the grid."""
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
    case = problem.case
    kept = {}
    if any(is_damped(case, body.name) for body in (problem.pair.upper, problem.pair.lower)):
        kept = kept_modes(problem, mode_pools(problem, at_least=1, progress=progress))
    problem.close()
    steps = _instants(case.run.duration, case.run.full_step, frames)
    simulate_in_full(
        problem,
        kept=kept,
        progress=progress,
        threads=threads,
        snapshots=Snapshots(steps=steps, receive=film.add),
    )


def _instants(duration: float, step: float, frames: int) -> tuple[int, ...]:
    """Steps of frames, as even as possible."""
    last = ceil(duration / step * (1.0 - 1e-9))
    return tuple(dict.fromkeys(round(k * last / (frames - 1)) for k in range(frames)))
