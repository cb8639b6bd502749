"""Gauges of a case on the meshes of its bodies."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from klack.bodies.gauges.gauge import Gauge
from klack.bodies.gauges.rows import AROUND, Line, displacement_row, strain_row, stress_row
from klack.case.outputs import CaseOutput
from klack.case.schema import Case
from klack.mesh.mesh import Mesh
from klack.mesh.rigid import Pose, rotation_matrix

__all__ = ["place_gauges", "placed_point"]

Floats = NDArray[np.float64]


def place_gauges(case: Case, bodies: Mapping[str, tuple[Mesh, Pose | None]]) -> tuple[Gauge, ...]:
    """Place the outputs of a case on its bodies.

    Parameters
    ----------
    bodies
        Mesh in its place, and how it came there from its drawing, or None.
    """
    gauges = []
    for output in case.outputs:
        mesh, pose = bodies[output.body]
        line = _line(case, output, mesh, pose)
        if output.kind == "strain":
            row = strain_row(mesh, line)
        elif output.kind == "stress":
            row = stress_row(mesh, line, case.materials_of(output.body, mesh.solids))
        else:
            row = displacement_row(mesh, line)
        gauges.append(
            Gauge(
                name=output.name,
                body=output.body,
                kind=output.kind,
                row=row,
                place=_words(output),
                low_pass=None if output.low_pass is None else output.low_pass.filter,
            )
        )
    return tuple(gauges)


def _line(case: Case, output: CaseOutput, mesh: Mesh, pose: Pose | None) -> Line:
    at, vector = np.array(output.at), output.vector(mesh.dimension)
    direction: Floats | str = AROUND
    if vector is not None:
        direction = np.array(vector) / np.linalg.norm(vector)
    at = placed_point(at, pose)
    if pose is not None and mesh.dimension == 3:
        direction = rotation_matrix(pose.rotation) @ np.asarray(direction)
    return Line(
        at=at,
        direction=direction,
        length=output.length,
        where=f"{case.path or 'case'}: outputs.{output.name}",
        pose=pose,
    )


def placed_point(at: Floats, pose: Pose | None) -> Floats:
    """Place of a point of the drawing, shape (2,) or (3,) [m]."""
    if pose is None:
        return at
    return at + pose.shift[2] * np.array([0.0, 1.0]) if len(at) == 2 else pose.of(at)


def _words(output: CaseOutput) -> str:
    """As ``along z over 3 mm at (10, -1260) mm``."""
    along = "around" if output.direction == AROUND else f"along {_direction(output)}"
    over = f" over {1e3 * output.length:.6g} mm" if output.length else ""
    return f"{along}{over} at ({', '.join(f'{1e3 * x:.6g}' for x in output.at)}) mm"


def _direction(output: CaseOutput) -> str:
    if isinstance(output.direction, str):
        return output.direction
    return "(" + ", ".join(f"{x:g}" for x in output.direction) + ")"
