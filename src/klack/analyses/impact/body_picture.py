r"""Both bodies of an impact as a picture that moves: surfaces and mode shapes.

.. math:: u(t) = \Phi q(t) + F(t) \left( K^+ p - \Phi_e \Omega_e^{-2} \Phi_e^T p \right)

on the surface only, with one pressure pattern ``p``, that of the highest force: near it this is the
displacement of :mod:`klack.analyses.impact.recovered_motion`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from klack.analyses.impact.record import BodyPicture, LevelResult
from klack.analyses.impact.recovered_motion import recovered_bodies
from klack.analyses.impact.section import section_picture
from klack.assembling.modes import kept_modes
from klack.assembling.problem import ContactProblem
from klack.assembling.reduced_pair import ReducedPair, impact_system
from klack.assembling.touch_ring import TouchingSide, touch_ring
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.stress import StressField, von_mises
from klack.case.schema import Case
from klack.errors import InputError
from klack.mesh.mesh import Mesh
from klack.mesh.quality import edge_lengths
from klack.mesh.skin import skin_of_mesh
from klack.simulation.impact import simulate

__all__ = ["body_pictures", "section_lines", "with_peak_stress"]

Floats = NDArray[np.float64]

_FRAMES = 121
_WORK = 3e8  # steps of a mode in all frames, 2 s: each takes a run of its own
_FULL = 32767


def body_pictures(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    pair: ReducedPair,
    ran: LevelResult | None,
) -> tuple[BodyPicture, BodyPicture]:
    """Pictures of the upper and of the lower body.

    Motion and stress are those of the reduced level ``ran``; ``pair`` is as the case asks.
    """
    bodies = (problem.pair.upper, problem.pair.lower)
    faces = (problem.pair.upper_surface.name, problem.pair.lower_surface.name)
    upper, lower = (_still(body, face) for body, face in zip(bodies, faces, strict=True))
    plain = (upper, replace(lower, touch=_touch(problem)))
    reduced = (pair.upper, pair.lower)
    parts = recovered_bodies(problem, pools, pair)
    if ran is None or any(
        part.shapes.shape[1] != model.mode_count for part, model in zip(parts, reduced, strict=True)
    ):
        kept = kept_modes(problem, pools, pair.ports)
        return tuple(  # type: ignore[return-value]
            _with_shapes(picture, body, kept[body.name].shapes, kept[body.name].frequency)
            for picture, body in zip(plain, bodies, strict=True)
        )
    instants, forces, coordinates = _frames(problem.case, pair, ran)
    loads = pair.static.load_patterns(min(pair.pattern_force, pair.static.max_force))
    highest = int(np.argmax(forces))
    pictures = []
    for k, (picture, body, part, model) in enumerate(
        zip(plain, bodies, parts, reduced, strict=True)
    ):
        frequency = np.where(
            np.arange(model.mode_count) < model.rigid_count, 0.0, model.frequencies
        )
        if model.attachment_count:
            frequency[-model.attachment_count :] = np.nan
        shapes, amplitude = part.shapes, coordinates[k]
        rest = part.rest(loads[k])
        if rest is not None:
            shapes = np.column_stack([shapes, rest])
            frequency = np.append(frequency, np.nan)
            amplitude = np.column_stack([amplitude, forces])
        moving = replace(
            _with_shapes(picture, body, shapes, frequency),
            instants=instants,
            amplitude=amplitude.astype(np.float32),
        )
        pictures.append(with_peak_stress(moving, problem.case, body, shapes @ amplitude[highest]))
    return pictures[0], pictures[1]


def with_peak_stress(
    picture: BodyPicture, case: Case, body: ElasticBody, displacement: Floats
) -> BodyPicture:
    """Picture with the stress of a displacement [m]; unchanged for a body of matrices."""
    if case.bodies[body.name].material is None:
        return picture
    field = StressField(body.mesh, case.materials_of(body.name, body.mesh.solids))
    worst = np.zeros(body.mesh.node_count)
    np.maximum.at(worst, field.nodes, von_mises(field(displacement)))
    return replace(picture, stress=worst[picture.node].astype(np.float32))


def section_lines(mesh: Mesh, name: str) -> Floats:
    """Sides of elements in the plane y = 0, shape (s, 2, 3) [m]."""
    sides = [np.empty((0, 2, 3))]
    for sign in (1.0, -1.0):
        turned = (
            mesh if mesh.dimension == 2 else replace(mesh, points=mesh.points * [sign, sign, 1])
        )
        try:
            cut = section_picture(turned, np.zeros(mesh.dof_count), 0.0, name)
        except InputError:
            continue
        r, z = cut.points[cut.edges].transpose(2, 0, 1)
        sides.append(np.stack([sign * r, 0.0 * r, z], axis=2))
    return np.concatenate(sides)


def _touch(problem: ContactProblem) -> Floats:
    case, pair = problem.case, problem.pair
    return touch_ring(
        TouchingSide(case.moving_body, pair.upper.mesh, pair.upper_surface.name),
        TouchingSide(case.stop_body, pair.lower.mesh, pair.lower_surface.name),
    )[0]


def _still(body: ElasticBody, face: str) -> BodyPicture:
    """Body at rest; what belongs to several surfaces belongs to ``face`` first."""
    surfaces = {
        name: body.mesh.surfaces[name] for name in dict.fromkeys((face, *body.mesh.surfaces))
    }
    skin = skin_of_mesh(replace(body.mesh, surfaces=surfaces))
    held: NDArray[np.bool_] = np.ones(body.dof_count, dtype=bool)
    held[body.free] = False
    node = np.unique(skin.node)
    return BodyPicture(
        body=body.name,
        skin=skin,
        held=np.asarray(held.reshape(-1, body.dimension).all(axis=1))[skin.node],
        section=section_lines(body.mesh, body.name),
        finest=float(edge_lengths(body.mesh).min()),
        node=node,
        shapes=np.zeros((0, len(node), body.dimension), dtype=np.int16),
        scale=np.empty(0),
        frequency=np.empty(0),
    )


def _with_shapes(
    picture: BodyPicture, body: ElasticBody, shapes: Floats, frequency: Floats
) -> BodyPicture:
    at_nodes = shapes.reshape(-1, body.dimension, shapes.shape[1])[picture.node]
    fields = np.moveaxis(at_nodes, 2, 0)  # (m, n, dimension)
    scale = np.abs(fields).max(axis=(1, 2), initial=0.0)
    safe = np.where(scale > 0.0, scale, 1.0)
    packed = np.round(fields / safe[:, None, None] * _FULL).astype(np.int16)
    return replace(picture, shapes=packed, scale=scale, frequency=np.asarray(frequency, float))


def _frames(
    case: Case, pair: ReducedPair, ran: LevelResult
) -> tuple[Floats, Floats, Sequence[Floats]]:
    """Instants, contact force, and modal coordinates (frames, m) of both bodies."""
    step = case.run.reduced_step
    last = max(1, round(case.run.duration / step))
    most = int(_WORK / (0.5 * last * (pair.upper.mode_count + pair.lower.mode_count)))
    count = min(max(min(_FRAMES, most), 2), last + 1)
    steps = np.unique(np.round(np.linspace(0, last, count)).astype(int))
    # the instant of the highest force is one of them
    peak = int(np.argmax(ran.history.force))
    steps = np.union1d(steps, [min(max(round((peak + 1) * ran.history.step / step), 1), last)])
    system = impact_system(case, pair.upper, pair.lower, pair.law)
    force = np.zeros(len(steps))
    coordinates = [np.zeros((len(steps), body.mode_count)) for body in (pair.upper, pair.lower)]
    for k, number in enumerate(steps):
        if number == 0:
            continue
        record = simulate(
            system,
            velocities={pair.upper.name: -case.motion.speed},
            step=step,
            duration=float(number) * step,
        )
        force[k] = record.force[-1, 0]
        for own, values in zip(coordinates, record.final_position, strict=True):
            own[k] = values
    return steps * step, force, coordinates
