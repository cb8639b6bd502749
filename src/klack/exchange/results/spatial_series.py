r"""One impact of a stroke in three dimensions as a film for ParaView.

Displacements follow from the recorded modal coordinates, :math:`u = \Phi q`, stresses from them.
Both are those of the kept modes, without the local indentation under the contact points, which the
residual compliance carries.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from klack.analyses.stroke.film_frames import recorded_impacts
from klack.analyses.stroke.record import StrokeStudy, StrokeVariant
from klack.arrays import Floats
from klack.assembling.modes import shape_marks
from klack.assembling.spatial import modes_in_network
from klack.assembling.valve import build_valve_bodies, valve_parts
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.stress import StressField, von_mises
from klack.case.valve import ValveCase
from klack.errors import InputError, refuse_if
from klack.exchange.results.table import file_stems
from klack.exchange.results.vtk_series import stress_grid
from klack.exchange.results.vtu import SeriesFile, VtuGrid, grid_piece, write_grid, write_pvd
from klack.files.whole import whole_files
from klack.machine.progress import Progress, silent
from klack.simulation.spatial_impact import ModalMoments, SpatialImpact

__all__ = ["valve_shapes", "write_spatial_series"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyShapes:
    """Body and shapes of its coordinates.

    Parameters
    ----------
    shapes (n_dof, m) [1/sqrt(kg)]
        Rigid ones first.
    omega (m,) [rad/s]
    above [m]
        By stop of this body: how far the upper body is above its drawing at displacements 0 of the
        network, the lower one as drawn.
    is_upper
        By stop.
    """

    body: ElasticBody
    shapes: Floats
    omega: Floats
    above: Mapping[str, float]
    is_upper: Mapping[str, bool]


def valve_shapes(
    case: ValveCase, progress: Progress = silent, *, threads: int | None = None
) -> dict[str, BodyShapes]:
    """Mesh the bodies of a valve, and compute the modes of its network, as cached by a run."""
    with threadpool_limits(limits=threads or 1, user_api="blas"):
        parts = valve_parts(case, build_valve_bodies(case, progress), progress, threads or 1)
        for flexibility in parts.flexibilities.values():
            flexibility.close()
    found = {}
    for name, body in parts.bodies.items():
        kept = modes_in_network(case, name, parts.pools, parts.ports)
        rigid = body.rigid_modes
        touching = [
            c for c in parts.contacts.values() if name in (c.pair.upper.name, c.pair.lower.name)
        ]
        found[name] = BodyShapes(
            body=body,
            shapes=np.hstack([rigid, kept.shapes]),
            omega=np.append(np.zeros(rigid.shape[1]), kept.omega),
            above={
                c.name: c.pair.shift + float(getattr(case.network.components[c.name], "gap", 0.0))
                for c in touching
            },
            is_upper={c.name: c.pair.upper.name == name for c in touching},
        )
    return found


_LINE = 3  # VTK_LINE


def write_ring(
    path: Path,
    radius: float,
    height: float,
    fields: Mapping[str, Floats],
    time: float,
) -> None:
    """Write lines round the axis z, one per value in each field.

    Parameters
    ----------
    radius, height [m]
    fields (S,)
        Of the sectors, the first from +x; single precision.
    time [s]
    """
    count = len(next(iter(fields.values())))
    angle = 2.0 * np.pi / count * np.arange(count)
    points = np.column_stack(
        [radius * np.cos(angle), radius * np.sin(angle), np.full(count, height)]
    )
    ends = np.column_stack([np.arange(count), (np.arange(count) + 1) % count])
    types = np.full(count, _LINE, dtype="u1")
    single = {name: values.astype("f4") for name, values in fields.items()}
    write_grid(path, grid_piece(points, ends.ravel(), np.full(count, 2), types, single), {}, time)


_SAME = 1e-6  # of the largest mark of a body: its shapes are those of the result


@dataclass(frozen=True, slots=True, eq=False)
class _Part:
    """One body of the film: its grid and fields."""

    name: str
    stem: str
    shapes: BodyShapes
    coordinates: Floats
    stress: StressField | None
    grid: VtuGrid

    def fields(self, moment: int) -> dict[str, Floats]:
        q, rigid = self.coordinates[moment], self.shapes.omega == 0.0
        bent = self.shapes.shapes[:, ~rigid] @ q[~rigid]
        moved = self.shapes.shapes[:, rigid] @ q[rigid] + bent
        if self.stress is None:
            return {"displacement": moved, "deformation": bent}
        tensor, nodes = self.stress(bent), self.stress.nodes
        return {
            "displacement": moved.reshape(-1, 3)[nodes],
            "deformation": bent.reshape(-1, 3)[nodes],
            "stress": tensor,
            "von_mises": von_mises(tensor),
        }


def write_spatial_series(
    study: StrokeStudy,
    case: ValveCase,
    folder: Path,
    *,
    impact: int,
    variant: str | None = None,
    frames: int = 50,
    progress: Progress = silent,
    threads: int | None = None,
) -> Path:
    """Write ``<case>_<variant>_impact_<n>.pvd`` with a grid per body and instant, and the ring.

    Fields in single precision: ``displacement`` [m] from the drawing, ``deformation`` [m] without
    the rigid motion, ``stress`` [Pa] (xx, yy, zz, xy, yz, xz) and ``von_mises`` [Pa]; of the ring
    ``line_load`` [N/m] and ``sector_force`` [N]. The needle is where it is drawn, the other body
    where it meets it. Rejects half sections, impacts without recorded motion, and bodies other
    than those of the result.

    Parameters
    ----------
    case
        Of the study.
    folder
        Files of the same names are replaced when everything is complete.
    impact
        Of the variant, from 1, as in the report.
    variant
        Default: the first.
    frames
        At most, evenly among the recorded instants; two at least.
    """
    refuse_if(
        frames < 2,
        "--frames",
        got=f"{frames}",
        expected="at least 2",
        hint="50 give a smooth animation.",
    )
    _require_solids(case)
    run = _run(study, variant)
    record, modes = _recorded(run, impact)
    shapes = valve_shapes(case, progress, threads=threads)
    names = _pair(record.stop, modes, shapes)
    parts = _parts(case, modes, shapes, names, record.stop)
    count = len(modes.time)
    chosen = np.unique(np.round(np.linspace(0, count - 1, min(frames, count))).astype(int))
    stem = f"{file_stems([case.name])[0]}_{run.name}_impact_{impact}"
    needle = shapes[names[0]]  # heights are those of the lower body, which stands lower then
    height = record.height - (needle.above[record.stop] if needle.is_upper[record.stop] else 0.0)
    files: list[SeriesFile] = []
    with whole_files(folder) as stage:
        grids = stage / stem
        grids.mkdir()
        for number, moment in enumerate(chosen):
            time = float(modes.time[moment])
            for k, part in enumerate(parts):
                name = f"{part.stem}_{number:04d}.vtu"
                part.grid.write(grids / name, part.fields(int(moment)), time)
                files.append(SeriesFile(time=time, part=k, name=part.name, file=f"{stem}/{name}"))
            name = f"contact_ring_{number:04d}.vtu"
            write_ring(grids / name, record.radius, height, _loads(record, time), time)
            at = len(parts)
            files.append(SeriesFile(time=time, part=at, name="ring", file=f"{stem}/{name}"))
            progress("grids", (number + 1) / len(chosen))
        write_pvd(stage / f"{stem}.pvd", files)
    return folder / f"{stem}.pvd"


def _require_solids(case: ValveCase) -> None:
    for name, body in case.bodies.items():
        refuse_if(
            body.geometry.dimension == 2,
            f"{case.path or 'case'}: bodies.{name}",
            got="a half section, whose motion in Fourier orders has no grid",
            expected="bodies of three dimensions",
            hint="the report has the line load of the impact; for grids use 'model: swept' "
            "with 'layers: 18' for all bodies.",
        )


def _run(study: StrokeStudy, variant: str | None) -> StrokeVariant:
    name = next(iter(study.variants)) if variant is None else variant
    refuse_if(
        name not in study.variants,
        "--variant",
        got=f"'{name}'",
        expected=f"one of: {', '.join(study.variants)}",
        hint="the variants of this result.",
    )
    return study.variants[name]


def _recorded(run: StrokeVariant, impact: int) -> tuple[SpatialImpact, ModalMoments]:
    """Record of an impact with the motion of bodies."""
    known = {
        number: (record, record.modes)
        for number, _, record in recorded_impacts(run)
        if record.modes is not None
    }
    found = known.get(impact)
    if found is None or found[1] is None:
        old = run.result.spatial_impacts is None
        raise InputError(
            "--impact",
            got=f"impact {impact} of '{run.name}', whose motion was not recorded",
            expected=f"one of: {', '.join(map(str, known))}" if known else "a recorded impact",
            hint="run the stroke again with this version of klack."
            if old
            else "only the first 8 impacts of a stroke in three dimensions are recorded.",
        )
    return found[0], found[1]


def _pair(stop: str, modes: ModalMoments, shapes: Mapping[str, BodyShapes]) -> tuple[str, str]:
    """Needle and the body that it meets."""
    others = [
        name
        for name, body in shapes.items()
        if stop in body.is_upper and name != modes.bodies[0] and name in modes.bodies
    ]
    needle = modes.bodies[0]
    _other_bodies_if(
        len(others) != 1 or needle not in shapes or stop not in shapes[needle].is_upper,
        f"no stop '{stop}' of two of the bodies {', '.join(modes.bodies)}",
    )
    return needle, others[0]


def _parts(
    case: ValveCase,
    modes: ModalMoments,
    shapes: Mapping[str, BodyShapes],
    names: tuple[str, str],
    stop: str,
) -> list[_Part]:
    starts = dict(zip(modes.bodies, np.cumsum([0, *modes.counts]), strict=False))
    stems = file_stems(list(names))
    parts = []
    for name, stem in zip(names, stems, strict=True):
        found, q = shapes[name], modes.of(name)
        first = int(starts[name])
        marks = modes.shape_marks[first : first + q.shape[1]]
        _require_same(name, found, q, marks)
        mesh = found.body.mesh
        if name != names[0]:  # the needle stays as it is drawn
            side = 1.0 if found.is_upper[stop] else -1.0
            mesh = mesh.moved(np.array([0.0, 0.0, side * found.above[stop]]))
        parts.append(_Part(name, stem, found, q, *stress_grid(case, name, mesh)))
    return parts


def _require_same(name: str, found: BodyShapes, q: Floats, marks: Floats) -> None:
    """Reject other shapes: mesh, sign or pairing of modes may differ."""
    here = shape_marks(found.shapes)
    _other_bodies_if(
        found.shapes.shape[1] != q.shape[1],
        f"{found.shapes.shape[1]} modes of '{name}', and {q.shape[1]} in the result",
    )
    _other_bodies_if(
        len(marks) != len(here) or np.any(np.abs(here - marks) > _SAME * np.abs(here).max()),
        f"modes of '{name}' whose shapes differ from the result",
    )


def _other_bodies_if(wrong: object, got: str) -> None:
    refuse_if(
        wrong,
        "bodies of the case in the result",
        got=got,
        expected="the bodies that the stroke was computed with",
        hint="run the stroke again on this machine, with this version of klack.",
    )


def _loads(record: SpatialImpact, time: float) -> dict[str, Floats]:
    """Loads of the sectors in the interval that ends at or after a moment; else 0."""
    at = int(np.searchsorted(record.edges, time * (1.0 - 1e-12))) - 1
    if 0 <= at < len(record.sector_force):
        return {"line_load": record.line_load[at], "sector_force": record.sector_force[at]}
    nothing = np.zeros(record.sector_force.shape[1])
    return {"line_load": nothing, "sector_force": nothing}
