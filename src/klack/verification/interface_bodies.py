"""Interface-level models whose motion is known: rigid bodies, rods, points, a sphere on a beam."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import asin, inf, pi, sqrt
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from klack.bodies.elasticity import eigen
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.statics import Flexibility
from klack.contact.asperity_layer import AsperityLayer
from klack.contact.face_friction import FaceFriction
from klack.contact.friction import Friction
from klack.contact.mortar import ContactSpace
from klack.contact.restitution import measure_impact
from klack.simulation.propagator import modal_propagator
from klack.transient.interface_arrays import Guide, Modes, Outside, Record, State
from klack.transient.interface_kernel import march
from klack.transient.interface_model import (
    InterfaceBody,
    InterfaceContact,
    InterfaceModel,
    StaticChecks,
    interface_model,
)
from klack.transient.interface_run import contact_points, simulate_interface
from klack.verification.check import Check, check

__all__ = [
    "LAYER",
    "BeamImpact",
    "MassOnLayer",
    "PointImpact",
    "PointRebound",
    "Touch",
    "advance",
    "free_rod",
    "lateral_guide",
    "modal_model",
    "momenta",
    "reduce_bodies",
    "rigid_body",
    "rod_between_stops",
    "rough_checks",
    "rough_rod",
    "rubbing_faces",
    "seat_restitution",
    "sphere_on_beam",
    "time_above",
]


_YOUNG, _POISSON, _DENSITY = 210e9, 0.3, 7850.0
_ROD_LENGTH, _ROD_AREA = 30e-3, pi * 2e-3**2


def modal_model(
    *,
    masses: Sequence[float],
    omega: np.ndarray,
    traces: np.ndarray,
    compliance: np.ndarray,
    gap: np.ndarray,
    rigid: np.ndarray | None = None,
    **more: Any,
) -> InterfaceModel:
    """Model from its arrays; coordinate 0 is the flight of the moving body along z.

    Parameters
    ----------
    masses [kg]
        Moving body first, ``inf`` for a supported one.
    omega (M,) [rad/s]
    traces (nc, M) [1/sqrt(kg)]
    compliance (nc, nc) [m/N]
    gap (nc,) [m]
    rigid (6, M) [1/sqrt(kg)]
    more
        Other fields. By default all coordinates belong to the moving body and are undamped, and
        one contact on 1 m^2 for each point lies below it, on its axis.
    """
    nc, modes = traces.shape
    if rigid is None:
        rigid = np.zeros((6, modes))
        rigid[2, 0] = masses[0] ** -0.5
    drift = np.zeros((len(masses), modes))
    drift[0] = rigid[2]
    plain: dict[str, Any] = {
        "damping": np.zeros(modes),
        "owner": np.zeros(modes, dtype=np.int64),
        "axial": np.ones(nc),
        "area": np.ones(nc),
        "points": np.zeros((nc, 3)),
        "contacts": (("contact", 0, nc),),
    }
    return InterfaceModel(
        bodies=("moving", "other")[: len(masses)],
        masses=tuple(masses),
        omega=np.asarray(omega, dtype=float),
        traces=np.ascontiguousarray(traces, dtype=float),
        compliance=np.ascontiguousarray(compliance, dtype=float),
        gap=np.asarray(gap, dtype=float),
        rim=np.zeros(nc, dtype=bool),
        beyond=np.full(nc, inf),
        rigid=rigid,
        drift=drift,
        centre=np.zeros(3),
        longest_period=0.0,
        checks=StaticChecks(lowest_pivot=1.0, reciprocity=0.0, static_limit=0.0, modal_share=0.0),
        **(plain | more),
    )


def rigid_body(
    *,
    mass: float,
    inertia: Sequence[float],
    points: np.ndarray,
    stiffness: float,
    gap: float = 0.0,
    **more: Any,
) -> InterfaceModel:
    """Rigid body above a floor with one spring under each contact point.

    Parameters
    ----------
    mass [kg]
    inertia [kg m^2]
        About x, y, z.
    points (nc, 3) [m]
        From the centre of mass.
    stiffness, gap [N/m], [m]
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
        **more,
    )


def free_rod(modes: int, *, stiffness: float, gap: float = 0.0) -> InterfaceModel:
    """Steel rod D4 x L30 mm with exact modes over a rigid wall with a linear spring."""
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

    and the static flexibility with inertia relief L/(3EA) at one end, -L/(6EA) across. Contact
    springs of ``stiffness`` [N/m] at ``gaps`` [m] below and above.
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
    clearance, stiffness [m], [N/m]
    heights, offset [m]
        Offset (x, y) at each height.
    friction, viscous [-], [N s/m]
    radius [m]
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
    """Undamped model of finite-element bodies with some of their lowest modes."""
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


def momenta(items: Sequence[InterfaceBody], v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
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
    """Coordinates, velocities and point forces."""

    q: np.ndarray
    v: np.ndarray
    force: np.ndarray


def advance(
    model: InterfaceModel, q: np.ndarray, v: np.ndarray, *, step: float, steps: int
) -> ModalState:
    """Steps of the compiled loop from an open contact, without outside forces."""
    n, M = model.count, model.mode_count
    P = modal_propagator(model.omega, model.damping, step)
    yields, rough = model.limit is not None, model.layer is not None
    state = State.still(M, n, 0, model.ways, yields=yields, rough=rough)
    state.q[:], state.v[:] = q, v
    march(
        steps,
        0,
        Modes(
            P.A11,
            P.A12,
            P.A21,
            P.A22,
            P.B1,
            P.B2,
            np.zeros((0, M)),
            np.ascontiguousarray(model.rigid[2]),
            model.drift,
            step,
        ),
        Outside(0.0, 0.0),
        contact_points(model, P.B1, step),
        None,
        None,
        state,
        Record.empty(steps, len(model.bodies), n, model.ways, keep_points=False),
    )
    return ModalState(q=state.q, v=state.v, force=state.lam)


_LARGEST_DEPTH = 80e-6  # [m]


@dataclass(frozen=True, slots=True, kw_only=True)
class Touch:
    """One sub-impact: first touch and separation [s], impulse [N s]."""

    start: float
    end: float
    impulse: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BeamImpact:
    r"""Sphere that falls on a simply supported beam and meets it several times.

    Euler-Bernoulli beam with modes

    .. math:: \omega_n = \left(\frac{n \pi}{L}\right)^2 \sqrt{\frac{E I}{\rho A}}, \qquad
        \varphi_n(L/2) = \sqrt{2 / m_b} \, \sin(n \pi / 2), \quad n \text{ odd},

    rigid sphere, Hertz contact in pieces: parallel springs (contact points) with gaps :math:`a_i`
    and stiffnesses :math:`k_i` that meet :math:`K \delta^{3/2}` at :math:`\delta = a_i`. The other
    solution is an explicit Runge-Kutta method of order 8.

    Parameters
    ----------
    mass [kg]
        Of the sphere.
    omega, shapes (m,) [rad/s], [1/sqrt(kg)]
        Of the beam, at the middle.
    gaps, stiffness (n,) [m], [N/m]
    hertz [N/m^1.5]
        K.
    """

    mass: float
    omega: np.ndarray
    shapes: np.ndarray
    gaps: np.ndarray
    stiffness: np.ndarray
    hertz: float

    def model(self) -> InterfaceModel:
        """Model of the interface level."""
        row = np.concatenate([[self.mass**-0.5], -self.shapes])
        return modal_model(
            masses=(self.mass, inf),
            omega=np.concatenate([[0.0], self.omega]),
            traces=np.repeat(row[None], len(self.gaps), axis=0),
            compliance=np.diag(1.0 / self.stiffness),
            gap=self.gaps,
            owner=np.minimum(np.arange(len(row)), 1),
        )

    def force(self, depth: np.ndarray) -> np.ndarray:
        """Contact force [N] at depths [m] below first touch."""
        return np.maximum(depth[..., None] - self.gaps, 0.0) @ self.stiffness

    def touches(
        self, *, speed: float, duration: float, smooth: bool = False, samples: int = 100_001
    ) -> tuple[Touch, ...]:
        """Sub-impacts by the Runge-Kutta method DOP853 with tight tolerances.

        Parameters
        ----------
        speed, duration [m/s], [s]
        smooth
            Take Hertz' law itself.
        samples
            Instants of the force.
        """
        m = len(self.omega)

        def law(y: np.ndarray) -> np.ndarray:
            depth = self.shapes @ y[1 : 1 + m] - y[0]
            return self.hertz * np.maximum(depth, 0.0) ** 1.5 if smooth else self.force(depth)

        def rate(_: float, y: np.ndarray) -> np.ndarray:
            P = law(y)
            return np.concatenate(
                [y[1 + m :], [P / self.mass], -(self.omega**2) * y[1 : 1 + m] - self.shapes * P]
            )

        start = np.zeros(2 * m + 2)
        start[1 + m] = -speed
        t = np.linspace(0.0, duration, samples)
        solution = solve_ivp(
            rate,
            (0.0, duration),
            start,
            method="DOP853",
            t_eval=t,
            rtol=1e-9,
            atol=1e-13,
            max_step=5e-6,
        )
        return _touches(t, law(solution.y))


def _touches(t: np.ndarray, force: np.ndarray) -> tuple[Touch, ...]:
    on = np.concatenate([[False], force > 0.0, [False]])
    first, last = np.flatnonzero(on[1:] & ~on[:-1]), np.flatnonzero(~on[1:] & on[:-1])
    return tuple(
        Touch(
            start=float(t[a]),
            end=float(t[b - 1]),
            impulse=float(np.trapezoid(force[a:b], t[a:b])),
        )
        for a, b in zip(first, last, strict=True)
    )


def sphere_on_beam(*, modes: int = 20, springs: int = 30) -> BeamImpact:
    """Sphere R70 mm above the middle of a beam of 60 x 27.8 x 780 mm, both of steel.

    Sub-impacts were measured on it (Adv. Mech. Eng. 2016, 8(9), 10.1177/1687814016668089).

    Parameters
    ----------
    modes
        Symmetric ones.
    springs
        Pieces of Hertz' law, up to a depth of 80 um.
    """
    radius, length, width, height = 70e-3, 780e-3, 60e-3, 27.8e-3
    beam_mass = _DENSITY * length * width * height
    n = 2 * np.arange(modes) + 1
    K = 4.0 / 3.0 * 0.5 * _YOUNG / (1.0 - _POISSON**2) * sqrt(radius)
    depth = _LARGEST_DEPTH * (np.arange(springs + 1) / springs) ** 2
    return BeamImpact(
        mass=_DENSITY * 4.0 / 3.0 * pi * radius**3,
        omega=np.asarray((n * pi / length) ** 2 * sqrt(_YOUNG * height**2 / 12.0 / _DENSITY)),
        shapes=np.sqrt(2.0 / beam_mass) * np.sin(n * pi / 2.0),
        gaps=depth[:-1],
        stiffness=np.diff(np.diff(K * depth**1.5) / np.diff(depth), prepend=0.0),
        hertz=K,
    )


LAYER = AsperityLayer.of_summits(rms=0.2e-6, radius=50e-6, density=0.05, modulus=115e9)
"""Steel on steel, ground."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MassOnLayer:
    r"""A rigid mass on one point with a layer of asperities, in closed form.

    The pressure is straight between points of the curve, so the mass moves on arcs of oscillators:
    from the pressure :math:`p_j` with the slope :math:`s_j` and the speed :math:`v_j` on

    .. math:: R_j = \sqrt{p_j^2 + s_j \tfrac{m}{A} v_j^2}, \qquad
        t = \sqrt{\frac{m}{A s_j}} \left(\arcsin\frac{p}{R_j} - \arcsin\frac{p_j}{R_j}\right) .

    Parameters
    ----------
    mass [kg]
    area [m^2]
    stiffness [N/m]
        In series with the layer.
    """

    layer: AsperityLayer = LAYER
    mass: float = 3e-3
    area: float = 4e-6
    stiffness: float = 1e15

    @property
    def model(self) -> InterfaceModel:
        """Model of the interface level."""
        return rigid_body(
            mass=self.mass,
            inertia=(1.0, 1.0, 1.0),
            points=np.zeros((1, 3)),
            stiffness=self.stiffness,
            area=np.array([self.area]),
            layer=self.layer,
        )

    def peak(self, speed: float) -> float:
        """Highest force [N] on rigid bodies."""
        return self.area * self._arcs(speed)[1]

    def time_above(self, force: float, speed: float) -> float:
        """Time [s] for which rigid bodies exceed a force."""
        return 2.0 * self._arcs(speed, force / self.area)[0]

    def _arcs(self, speed: float, above: float = 0.0) -> tuple[float, float]:
        """Time [s] from a pressure to the highest one [Pa]."""
        curve, per_area = self.layer, self.mass / self.area
        slope = np.diff(curve.pressure) / np.diff(curve.closure)
        energy = curve.state(curve.closure)[2]
        time = 0.0
        for j in range(len(slope)):
            squared = speed**2 - 2.0 * energy[j] / per_area
            radius = sqrt(curve.pressure[j] ** 2 + slope[j] * per_area * squared)
            last = j + 1 == len(slope) or radius <= curve.pressure[j + 1]
            begin = max(float(curve.pressure[j]), above)
            end = radius if last else float(curve.pressure[j + 1])
            if end > begin:
                arc = asin(min(end / radius, 1.0)) - asin(begin / radius)
                time += sqrt(per_area / slope[j]) * arc
            if last:
                return time, radius
        raise AssertionError


def time_above(force: float, history: np.ndarray, step: float) -> float:
    """Time [s] above a force, straight between the middles of steps."""
    is_above = np.flatnonzero(history > force)
    first, last = is_above[0], is_above[-1]
    before = (history[first] - force) / (history[first] - history[first - 1])
    after = (history[last] - force) / (history[last] - history[last + 1])
    return float(step * (last - first + before + after))


def rough_rod(modes: int = 10) -> InterfaceModel:
    """Steel rod D4 x L30 mm with a rough end, over a rigid wall with a spring of 1e9 N/m."""
    return replace(free_rod(modes, stiffness=1e9, gap=0.1e-6), area=np.array([1e-6]), layer=LAYER)


def rough_checks() -> list[Check]:
    """Contact points with a layer of asperities."""
    return [*_mass_on_layer(), *_rod()]


def _mass_on_layer() -> list[Check]:
    mass, speed, step = MassOnLayer(), 0.05, 10e-9
    peak = mass.peak(speed)
    run = simulate_interface(mass.model, speed=speed, duration=30e-6, step=step)
    force = run.history.force
    source = "arcs of oscillators on the pieces of the curve of Greenwood and Williamson"
    return [
        check(
            "rigid mass on a layer of asperities: peak force [N]",
            expected=peak,
            computed=float(force.max()),
            tolerance=1e-5,
            source=source,
        ),
        check(
            "rigid mass on a layer of asperities: time above half of the peak [s]",
            expected=mass.time_above(0.5 * peak, speed),
            computed=time_above(0.5 * peak, force, step),
            tolerance=5e-6,
            source=source,
        ),
        check(
            "rigid mass on a layer of asperities: restitution [-]",
            expected=1.0,
            computed=float(run.motion.velocity[-1, 2]) / speed,
            tolerance=1e-13,
            source="an elastic layer gives all energy back",
        ),
    ]


def _rod() -> list[Check]:
    model, speed = rough_rod(), 0.5
    q, v = np.zeros((2, model.mode_count))
    v[0] = -speed * sqrt(model.mass)

    def end(steps: int) -> np.ndarray:
        return advance(model, q, v, step=20e-6 / steps, steps=steps).v

    exact = end(64_000)
    errors = [float(np.linalg.norm(end(n) - exact)) for n in (1000, 2000, 4000)]
    cut = simulate_interface(model, speed=speed, duration=5e-6, step=40e-9)
    return [
        check(
            "rough rod with 10 modes through an impact: order of convergence of the step [-]",
            expected=2.0,
            computed=float(np.log2(errors[0] / errors[2]) / 2.0),
            tolerance=5e-2,
            source="forces of both ends weighed by energy, exact modes",
        ),
        check(
            "rough rod, run ended while it is pressed: energy residual [-]",
            expected=0.0,
            computed=cut.energy.residual,
            tolerance=1e-13,
            source="the work of each step is the change of the energy of bodies and layer",
        ),
    ]


@dataclass(frozen=True, slots=True, kw_only=True)
class PointRebound:
    """Tangential and normal velocity of the point after an impact [m/s], loss [J]."""

    tangential: float
    normal: float
    lost: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PointImpact:
    """Planar rigid body that hits with one point.

    Parameters
    ----------
    along, coupling, normal [1/kg]
        Inverse mass: tangential, tangential per normal force, normal.
    friction [-]
    tangential, approach [m/s]
        Of the point before, along the face and into it.
    spring, stiffer [N/m], [-]
        Normal, and the tangential one over it.
    """

    along: float
    coupling: float
    normal: float
    friction: float
    tangential: float
    approach: float = 1.0
    spring: float = 1.0
    stiffer: float = 0.8235294

    def hit(self, time: float, *, steps: int = 400) -> PointRebound:
        """Impact of about ``time`` [s]."""
        root = np.asarray(
            np.linalg.cholesky([[self.normal, self.coupling], [self.coupling, self.along]]),
            dtype=float,
        )  # normal motion is the first coordinate
        rigid = np.zeros((6, 2))
        rigid[2], rigid[0] = root
        model = modal_model(
            masses=(1.0 / self.normal, inf),
            omega=np.zeros(2),
            traces=root[:1],
            compliance=np.diag([1.0, 1.0 / self.stiffer]) / self.spring,
            gap=np.zeros(1),
            rigid=rigid,
            tangents=root[1:],
            axial_across=np.zeros(1),
            friction=(Friction.coulomb(self.friction),),
        )
        run = simulate_interface(
            model,
            speed=self.approach,
            duration=1.02 * time,
            step=time / steps,
            velocity=np.array([self.tangential, 0.0, 0.0, 0.0, 0.0, 0.0]),
        )
        after = run.motion.velocity[-1]
        return PointRebound(
            tangential=float(after[0]), normal=float(after[2]), lost=run.energy.friction
        )


def seat_restitution(
    half_angle: float, friction: float, stiffer: float, coupling: float = 0.0, steps: int = 800
) -> float:
    """Restitution of a rigid needle on a frictional cone, compliant at the ring alone.

    Parameters
    ----------
    half_angle [rad]
    stiffer
        Stiffness along the cone over that along its normal.
    coupling
        Displacement of the needle out of the cone under a normal force, over that along the normal.
    """
    s, c = np.sin(half_angle), np.cos(half_angle)
    model = modal_model(
        masses=(1.0, inf),
        omega=np.zeros(1),
        traces=np.array([[s]]),
        compliance=np.array([[1.0, -coupling], [-coupling, 1.0 / stiffer]]),
        gap=np.zeros(1),
        tangents=np.array([[c]]),
        axial_across=np.array([c]),
        friction=(Friction.coulomb(friction),),
    )
    time = np.pi / s
    run = simulate_interface(model, speed=1.0, duration=1.2 * time, step=time / steps)
    return measure_impact(run.history).restitution


def rubbing_faces(
    upper: ElasticBody,
    lower: ElasticBody,
    space: ContactSpace,
    faces: tuple[str, str],
    friction: float,
) -> InterfaceContact:
    """Contact of two meshed bodies with tangential directions."""
    meshes = (upper.mesh, upper.mesh.surface(faces[0]), lower.mesh, lower.mesh.surface(faces[1]))
    return InterfaceContact(
        name="face",
        upper=upper.name,
        lower=lower.name,
        space=space,
        faces=FaceFriction.on(Friction.coulomb(friction), space, *meshes),
    )
