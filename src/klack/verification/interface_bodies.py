"""Interface-level models whose motion is known: rigid bodies, rods, a sphere on a beam.

A model is nothing but arrays, so simple bodies are written down by hand; others are reduced from
finite elements here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, pi

import numpy as np
from numpy.typing import NDArray

from klack.elasticity import eigen
from klack.elasticity.body import ElasticBody
from klack.elasticity.statics import Flexibility
from klack.simulation.propagator import modal_propagator
from klack.transient.guide import Guide
from klack.transient.interface_arrays import (
    Modes,
    Outside,
    Record,
    State,
)
from klack.transient.interface_kernel import march
from klack.transient.interface_model import (
    InterfaceBody,
    InterfaceContact,
    InterfaceModel,
    StaticChecks,
    interface_model,
)
from klack.transient.interface_run import contact_points

__all__ = [
    "advance",
    "free_rod",
    "lateral_guide",
    "modal_model",
    "momenta",
    "reduce_bodies",
    "rigid_body",
    "rod_between_stops",
]

Array = NDArray[np.float64]

_YOUNG, _DENSITY = 210e9, 7850.0
_ROD_LENGTH, _ROD_AREA = 30e-3, pi * 2e-3**2


def modal_model(
    *,
    masses: Sequence[float],
    omega: Array,
    traces: Array,
    compliance: Array,
    gap: Array,
    rigid: Array | None = None,
    owner: NDArray[np.int64] | None = None,
    axial: Array | None = None,
    contacts: tuple[tuple[str, int, int], ...] | None = None,
    points: Array | None = None,
    damping: Array | None = None,
) -> InterfaceModel:
    """Model from its arrays; coordinate 0 is the flight of the moving body along z.

    Parameters
    ----------
    masses : sequence of float [kg]
        Moving body first, ``inf`` for a supported one.
    omega : array, shape (M,) [rad/s]
    traces : array, shape (nc, M) [1/sqrt(kg)]
    compliance : array, shape (nc, nc) [m/N]
    gap : array, shape (nc,) [m]
    rigid : array, shape (6, M), optional [1/sqrt(kg)]
    owner : int array, shape (M,), optional
        Without it all coordinates belong to the moving body.
    axial, contacts, points : optional
        Without them: one contact below the moving body, on its axis.
    damping : array, shape (M,), optional [-]
    """
    nc, modes = traces.shape
    if rigid is None:
        rigid = np.zeros((6, modes))
        rigid[2, 0] = masses[0] ** -0.5
    drift = np.zeros((len(masses), modes))
    drift[0] = rigid[2]
    return InterfaceModel(
        bodies=("moving", "other")[: len(masses)],
        masses=tuple(masses),
        omega=np.asarray(omega, dtype=float),
        damping=np.zeros(modes) if damping is None else damping,
        owner=np.zeros(modes, dtype=np.int64) if owner is None else owner,
        traces=np.ascontiguousarray(traces, dtype=float),
        compliance=np.ascontiguousarray(compliance, dtype=float),
        gap=np.asarray(gap, dtype=float),
        axial=np.ones(nc) if axial is None else axial,
        area=np.ones(nc),
        points=np.zeros((nc, 3)) if points is None else points,
        contacts=contacts or (("contact", 0, nc),),
        rim=np.zeros(nc, dtype=bool),
        beyond=np.full(nc, inf),
        rigid=rigid,
        drift=drift,
        centre=np.zeros(3),
        longest_period=0.0,
        checks=StaticChecks(lowest_pivot=1.0, reciprocity=0.0, static_limit=0.0, modal_share=0.0),
    )


def rigid_body(
    *, mass: float, inertia: Sequence[float], points: Array, stiffness: float, gap: float = 0.0
) -> InterfaceModel:
    """Rigid body above a floor with one spring under each contact point.

    Parameters
    ----------
    mass : float [kg]
    inertia : three floats [kg m^2]
        About x, y, z through the centre of mass.
    points : array, shape (nc, 3) [m]
        From the centre of mass.
    stiffness, gap : float [N/m], [m]
    """
    J = np.asarray(inertia, dtype=float)
    points = np.asarray(points, dtype=float)
    traces = np.zeros((len(points), 6))
    traces[:, 2] = mass**-0.5
    # u_z = theta_x y - theta_y x
    traces[:, 3], traces[:, 4] = points[:, 1] / np.sqrt(J[0]), -points[:, 0] / np.sqrt(J[1])
    return modal_model(
        masses=(mass, inf),
        omega=np.zeros(6),
        traces=traces,
        compliance=np.eye(len(points)) / stiffness,
        gap=np.full(len(points), gap),
        rigid=np.diag(np.concatenate([np.full(3, mass**-0.5), J**-0.5])),
        points=points,
    )


def free_rod(modes: int, *, stiffness: float, gap: float = 0.0) -> InterfaceModel:
    """Steel rod D4 x L30 mm with exact modes over a rigid wall with a linear contact spring."""
    both = rod_between_stops(modes, stiffness=stiffness, gaps=(gap, 1.0))
    return modal_model(
        masses=both.masses,
        omega=both.omega,
        traces=both.traces[:1],
        compliance=both.compliance[:1, :1],
        gap=both.gap[:1],
    )


def rod_between_stops(modes: int, *, stiffness: float, gaps: tuple[float, float]) -> InterfaceModel:
    r"""Steel rod D4 x L30 mm with exact modes between a lower and an upper wall.

    .. math:: \omega_n = n \pi c / L, \qquad \varphi_n = \sqrt{2/m} \cos(n \pi x / L)

    and the static flexibility with inertia relief L/(3EA) at one end, -L/(6EA) across.

    Parameters
    ----------
    modes : int
        Elastic ones.
    stiffness : float [N/m]
        Of the contact spring at either end.
    gaps : pair of float [m]
        Below and above.
    """
    mass = _DENSITY * _ROD_AREA * _ROD_LENGTH
    n = np.arange(1, modes + 1)
    omega = np.concatenate([[0.0], n * pi / _ROD_LENGTH * np.sqrt(_YOUNG / _DENSITY)])
    ends = np.ones((2, modes + 1))
    ends[1, 1:] = (-1.0) ** n
    # moving up opens the gap below and closes the one above
    traces = ends * np.sqrt(np.where(omega > 0, 2.0, 1.0) / mass) * np.array([[1.0], [-1.0]])
    soft = _ROD_LENGTH / (_YOUNG * _ROD_AREA)
    whole = soft * np.array([[1 / 3, 1 / 6], [1 / 6, 1 / 3]]) + np.eye(2) / stiffness
    kept = traces[:, 1:] / omega[1:]
    return modal_model(
        masses=(mass, inf),
        omega=omega,
        traces=traces,
        compliance=whole - kept @ kept.T,
        gap=np.array(gaps),
        axial=np.array([1.0, -1.0]),
        contacts=(("seat", 0, 1), ("stop", 1, 2)),
    )


def lateral_guide(
    model: InterfaceModel,
    *,
    clearance: float,
    stiffness: float,
    heights: Sequence[float] = (0.0,),
    offset: Sequence[tuple[float, float]] = ((0.0, 0.0),),
    friction: float = 0.0,
    viscous: float = 0.0,
    radius: float = 0.0,
) -> Guide:
    """Guide of a :func:`rigid_body` at some heights above its centre of mass.

    Parameters
    ----------
    model : InterfaceModel
    clearance, stiffness : float [m], [N/m]
    heights, offset : sequence of float, of (x, y) [m]
    friction, viscous : float [-], [N s/m]
        At each height.
    radius : float [m]
        Of the shaft, which friction turns.
    """
    translation, rotation = model.rigid[:3], model.rigid[3:]
    count = len(heights)
    traces = np.zeros((count, 2, model.mode_count))
    for k, height in enumerate(heights):
        traces[k, 0] = translation[0] + rotation[1] * height
        traces[k, 1] = translation[1] - rotation[0] * height
    return Guide(
        heights=np.array(heights),
        clearance=np.full(count, clearance),
        offset=np.array(offset, dtype=float),
        traces=traces,
        slide=np.repeat(translation[2:3], count, axis=0),
        turn=np.repeat(rotation[None], count, axis=0),
        radius=np.full(count, radius),
        compliance=np.repeat(np.eye(2)[None] / stiffness, count, axis=0),
        friction=np.full(count, friction),
        viscous=np.full(count, viscous),
    )


def reduce_bodies(
    bodies: Sequence[ElasticBody], contacts: Sequence[InterfaceContact], counts: Sequence[int]
) -> tuple[InterfaceModel, tuple[InterfaceBody, ...]]:
    """Undamped model of finite-element bodies with some of their lowest modes, or none."""
    items = []
    for body, count in zip(bodies, counts, strict=True):
        flexibility = Flexibility(body)
        modes = eigen.Modes(np.zeros(0), np.zeros((body.dof_count, 0)))
        if count:
            modes = eigen.eigenmodes(body, count=count, flexibility=flexibility)
        items.append(
            InterfaceBody(
                body=body, flexibility=flexibility, modes=modes, damping=np.zeros(len(modes.omega))
            )
        )
    return interface_model(items, contacts), tuple(items)


def momenta(items: Sequence[InterfaceBody], v: Array) -> tuple[Array, Array]:
    """Momentum and its moment about the origin, of all bodies."""
    linear, angular, start = np.zeros(3), np.zeros(3), 0
    for item in items:
        shapes = np.hstack([item.body.rigid_modes, item.modes.shapes])
        end = start + shapes.shape[1]
        nodal = (item.body.M @ (shapes @ v[start:end])).reshape(-1, 3)
        linear += nodal.sum(axis=0)
        angular += np.cross(item.body.mesh.points, nodal).sum(axis=0)
        start = end
    return linear, angular


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModalState:
    """Where a model is: coordinates, velocities and point forces."""

    q: Array
    v: Array
    force: Array


def advance(model: InterfaceModel, q: Array, v: Array, *, step: float, steps: int) -> ModalState:
    """Take ``steps`` steps of the compiled loop from an open contact, without outside forces."""
    n, M = model.count, model.mode_count
    P = modal_propagator(model.omega, model.damping, step)
    push = np.ascontiguousarray(model.rigid[2])
    none = np.zeros((0, M))
    yields, rough = model.limit is not None, model.layer is not None
    state = State.still(M, n, 0, model.ways, yields=yields, rough=rough)
    state.q[:], state.v[:] = q, v
    march(
        steps,
        0,
        Modes(P.A11, P.A12, P.A21, P.A22, P.B1, P.B2, none, push, model.drift, step),
        Outside(0.0, 0.0),
        contact_points(model, P.B1, step),
        None,
        None,
        state,
        Record.empty(steps, len(model.bodies), n, model.ways, keep_points=False),
    )
    return ModalState(q=state.q, v=state.v, force=state.lam)
