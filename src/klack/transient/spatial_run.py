"""Bodies that meet point by point, driven by the axial network of a valve.

Modes move under the forces of the network, constant over a macro step; where they may touch,
contact points and guide act in the fine steps of :mod:`klack.transient.interface_kernel`.  What the
guess of the forces missed is repaired by superposition: see :class:`_Moving`.
"""

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from klack.arrays import Index, Vector
from klack.contact.gap_update import ABOVE, BELOW, Pairing
from klack.contact.step_constants import NO_LAW
from klack.errors import AccuracyWarning, ConvergenceError, refuse_if
from klack.machine.compiling.jit import of_one_kind
from klack.simulation.modal_step import ROW, ROW_Q, ROW_V
from klack.simulation.network_arrays import (
    ANSWER,
    COARSE,
    FINE,
    GUESS,
    LAST,
    NEAR,
    PORTS,
    SEEN,
    WORK,
    Y0,
    Y1,
    Recording,
    Scratch,
)
from klack.simulation.network_compile import CompiledNetwork
from klack.simulation.network_kernel import MACRO_REPEATS, MOST_REPEATS, run_network
from klack.simulation.network_record import moment_of, record_moment
from klack.simulation.network_result import ChannelData, StaticStart
from klack.simulation.network_run import everything, put_back
from klack.simulation.phase import (
    STATUS_DONE,
    STATUS_FORCES,
    STATUS_REFUSED,
    STATUS_REPEAT,
)
from klack.simulation.propagator import modal_propagator
from klack.simulation.rest import longest_period
from klack.simulation.spatial_impact import SpatialImpact, SpatialPath
from klack.simulation.spatial_step import BEGINS, ENDS, Stage, spatial_step
from klack.simulation.step_sizes import StepSizes
from klack.transient.impact_recorder import ImpactRecorder, StopRecord, film_lands
from klack.transient.interface_arrays import (
    DAMPING,
    DEBT,
    FRICTION,
    GUIDE,
    GUIDE_STRAIN,
    ActiveSet,
    Guide,
    Modes,
    Outside,
    Record,
    Rubbing,
    State,
)
from klack.transient.interface_friction import (
    across_energy,
    forget_inverse,
    lie_without_friction,
    repair_offsets,
    rubbing_arrays,
)
from klack.transient.interface_kernel import FAILED, LEFT_OUT, march, march_near, safe_flight
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_run import Gaps, contact_points, modes_of_step, near_points
from klack.transient.placed_bodies import (
    modal_energy,
    rigid_coordinates,
    shaft_pressed,
    surely_unguided,
)
from klack.transient.placed_gaps import FRESH, GapCourse, PlacedGaps, gap_course
from klack.transient.ring_arcs import ArcWatch, RingArcs
from klack.transient.side_forces import SideForces
from klack.transient.spatial_kernel import film_changes, repair
from klack.transient.spatial_rest import settle_at_rest
from klack.transient.tilting_films import (
    LOST,
    BearingFilm,
    TiltingFilm,
    bend_faces,
    film_arrays,
    film_strain,
)
from klack.units import format_si

__all__ = ["SpatialValve"]


_AWAY = 1.0  # [m] added to the gaps of the axial interfaces, which then never act
_CLOSING = 1e-6  # gaps that count where others are asked for anew [m]
_SURE = 0.5  # share of the time in which no gap can close, since forces may change meanwhile
_LONGEST = 16  # records of a flight at once
_BALANCES = 6  # of elements and fluid with the points at the start
_BALANCED = 1e-12  # [m]
_FILM_SHARE = 0.01  # of the height of a film that a step without contact may change
_AT_THE_WALL = 8  # fine steps where a shaft with a film touches its guide
_ROOM = 1.0  # of the clearance
_SLOW = 0.5  # of the difference before: it does not vanish
_NOT_AT_REST = 2e-9  # [m]
_STEADY = 0.04  # change of the force of a contact at rest in a step
_AT_REST = 0  # 1: steps are long, and so is the inverse over the points that carry
_LOST = 1  # energy that damping took in flights [J]
_STEADILY = 2  # 1: forces changed little in the last record
_MARGIN, _MORE = 0.5e-6, 3.0  # [m] gaps of points that are looked at, and after one was missed
_EVERY = 1.0  # [m] with all of them
_HALF_BOUNCES = 8.0  # in the time to rest of rigid bodies
_NONE = Outside(1.0, 0.0)  # the force of the network comes as the modal force of one newton


@dataclass(frozen=True, kw_only=True, eq=False)
class SpatialValve:
    """Bodies of a valve that meet point by point: :class:`klack.simulation.network_run`.

    Parameters
    ----------
    model
        Of all bodies, the needle first, at the placement of the meshes (q = 0 is displacement 0 of
        the network).  Further bodies may move too.  Faces stay elastic and have no layer of
        asperities.
    components
        Of each of ``model.bodies``.
    stops
        Component at each of ``model.contacts``.
    arms (contacts, 3) [m]
        Middle of each contact from the centre of mass of the needle; with ``gaps``.
    guided
        At each height of the guide the body whose shaft it holds, among those that move; by default
        the needle everywhere.
    carried
        Of each body that moves: the one on whose shaft it slides, -1 for a fixed bore.
    gaps
        Exact ones at rigid placements of the bodies that move; by default they stay linear.
    course
        Of these gaps; computed by default, for one body that moves.
    pairings
        Bodies of each contact; by default the needle and one that is held.
    placement (6,) [m], [rad]
        Of the needle at the start: translation of its centre of mass and rotation vector, beside
        the axial displacement in the network; then perhaps those of the further bodies.
    velocity (6,) [m/s], [rad/s]
        At the start, beside that in the network; likewise.
    films
        Lands of the squeeze films of stops.
    bearing
        Film in the guide, where the network has a fluid.
    shape_marks (M,)
        Identify the shapes of the modes in records of their coordinates.
    arcs
        For a doubt about short contacts.
    """

    model: InterfaceModel
    components: tuple[str, ...]
    stops: tuple[str, ...]
    arms: Vector = field(default_factory=lambda: np.zeros((1, 3)))
    guide: Guide | None = None
    guided: tuple[int, ...] = ()
    carried: tuple[int, ...] = ()
    gaps: Gaps | None = None
    course: GapCourse | None = None
    pairings: tuple[Pairing, ...] = ()
    placement: Vector = field(default_factory=lambda: np.zeros(6))
    velocity: Vector = field(default_factory=lambda: np.zeros(6))
    films: tuple[TiltingFilm, ...] = ()
    bearing: BearingFilm | None = None
    shape_marks: Vector = field(default_factory=lambda: np.zeros(0))
    arcs: RingArcs | None = None

    def of(self, network: CompiledNetwork, sizes: StepSizes) -> "_Moving":
        """These bodies in a network.

        Raises
        ------
        InputError
            For a network with other bodies, interfaces, or friction along the axis.
        """
        _check(self, network)
        return _Moving(self, network, sizes)


class _Run(NamedTuple):
    recording: Recording
    scratch: Scratch
    clock: Index
    block: int
    look: int
    report: Vector


class _Kept(NamedTuple):
    vectors: tuple[NDArray[np.generic], ...]
    active: NDArray[np.bool_]
    points: Index
    counts: Index
    inverse: NDArray[np.float64]


class _Moving:
    r"""Bodies of a valve in one run.

    The network holds the modes while nothing can touch; else ``state`` does, in the order of the
    model, and the network gets them at the end of each record.

    A repair :math:`\delta q, \delta \dot q` of the modes adds the energy

    .. math:: \delta E = \sum \omega^2 q\,\delta q + \dot q\,\delta\dot q
        + \tfrac12 (\omega^2 \delta q^2 + \delta\dot q^2) ,

    of which :math:`\lambda^T \Phi\,\delta q` belongs to the contact (half to its potential, half to
    the debt of its next step) and :math:`N^T T\,\delta q` to the guide.
    """

    def __init__(self, valve: SpatialValve, network: CompiledNetwork, sizes: StepSizes) -> None:
        self.valve, self.network, self.sizes = valve, network, sizes
        self.arrays = network.arrays
        self.paths = [SpatialPath() for _ in valve.model.moving]
        self.path = self.paths[0]
        self.arcs = None if valve.arcs is None else ArcWatch(valve.arcs)
        model = valve.model
        self.model, self.ports = model, len(network.ports)
        self.place_q, self.place_v, self.P = _places(valve, network)
        self.at = network.bodies.at
        self.sides = SideForces(network, model, self.P)
        h = sizes.step
        steps = {FINE: 1, COARSE: sizes.coarse, NEAR: sizes.near}
        self.steps = steps
        self.kicks = {
            level: modal_propagator(model.omega, model.damping, count * h)
            for level, count in steps.items()
        }
        self.fine, self.whole = modes_of_step(model, h), modes_of_step(model, sizes.coarse * h)
        self.points = contact_points(model, self.fine.B1, h)
        self.resting = contact_points(model, self.whole.B1, sizes.coarse * h)
        self.nothing = self.points.away()
        self.bore = Guide.none(model.mode_count) if valve.guide is None else valve.guide
        wet = {row.component: row.film for row in network.rows.interfaces if row.film is not None}
        self.squeezed = [film for film in valve.films if film.stop in wet]
        series = {row.component: row.series_compliance for row in network.rows.interfaces}
        bearing, room = np.zeros(0), np.zeros(0)
        rows = network.rows
        if valve.bearing is not None and valve.guide is not None and rows.fluid is not None:
            viscosity = float(rows.fluid.viscosity(rows.ambient.pressure))
            bearing, room = valve.bearing.arrays(valve.guide, viscosity)
        self.films = None
        if self.squeezed or len(bearing):
            self.films = film_arrays(model, self.squeezed, wet, series, bearing, room)
            rigid = self.films.rows[:, 0, self.model.omega == 0]
            self.inertia = np.sum(rigid**2, axis=1)  # of the lift, inverse [1/kg]
        heights, films = len(self.bore.clearance), len(self.squeezed)
        sectors = 0 if self.films is None else int(np.max(self.films.sizes[:, 0], initial=0))
        self.state = State.still(
            *(model.mode_count, model.count, heights, model.ways), films=films, sectors=sectors
        )
        self.kept = (
            *(self.state.q, self.state.v, self.state.lam, self.state.guide_force),
            *(self.state.books, self.state.films, self.state.bearing),
            *rubbing_arrays(self.state.rubbing).values(),
        )
        self.coarser = {1: self.fine}  # modes over so many fine steps
        self.q, self.v, self.books = self.state.q, self.state.v, self.state.books
        self.apart = self.state._replace(
            lam=np.zeros(0), contact=ActiveSet.none(0), rubbing=Rubbing.none(0, 0)
        )
        course = valve.course
        if course is None and valve.gaps is not None:
            course = gap_course(valve.gaps, float(np.max(np.linalg.norm(valve.arms, axis=1))))
        sides = [np.sum(model.axial[a:b]) for _, a, b in model.contacts]
        self.pairs = valve.pairings or tuple(ABOVE if side > 0.0 else BELOW for side in sides)
        self.gaps = PlacedGaps(model, valve.gaps, self.pairs, course)
        self.gap0 = self.gaps.values
        self.flags = np.zeros(3)  # see the names above
        self.order = [
            [row.component for row in network.rows.interfaces].index(stop) for stop in valve.stops
        ]
        at = [self.order[valve.stops.index(film.stop)] for film in self.squeezed]
        filmed = {row: k for k, row in enumerate(at)}
        self.rest = network.interfaces.rest[self.order] / h
        self.impacts = _impact_recorder(self, network)
        self.stops = StopRecord(network, model, self.P, self.order, filmed, self.arcs, sizes.step)
        self.fresh = True
        self.way = np.zeros(model.mode_count)
        self.records: dict[tuple[int, bool], Record] = {}
        self.network_step, self.safe_flight, self.part, self.repair = (
            of_one_kind(each) for each in (spatial_step, safe_flight, film_changes, repair)
        )
        self.march = of_one_kind(march), of_one_kind(march)  # without points and with them
        self.march_near, self.margin = of_one_kind(march_near), _MARGIN
        if not model.ways:
            self.near = near_points(model, model.rigid_of(0).stop)

    # ------------------------------------------------------------------ start

    def start(self, balance: Callable[[Vector], StaticStart] | None) -> StaticStart | None:
        self.read()
        for what, given in (self.q, self.valve.placement), (self.v, self.valve.velocity):
            for body, move in zip(self.model.moving, given.reshape(-1, 6), strict=False):
                own = self.model.rigid_of(body.number)
                what[own] += rigid_coordinates(body.rigid[:, own], move)
        self.take_gaps()
        self.sides.place(self.q)
        rests = balance is not None and not np.any(self.v)
        begun = None
        if balance is not None and rests:
            with threadpool_limits(limits=1, user_api="blas"):
                begun = self._settle(balance)
        self._silence_interfaces()
        self.network.interface_state.gap[:] += _AWAY
        if rests:
            self._begin_closed()
        else:
            shaft_pressed(self.bore, self.state)
        self.write()
        here = slice(0, self.ports)
        for row in (Y0, Y1, SEEN):
            self.at[row:][here] = self.P.T @ self.q
        for path in self.paths:
            path.clear()
        return begun

    def _settle(self, balance: Callable[[Vector], StaticStart]) -> StaticStart | None:
        """Rest on the contact points, and where elements and fluid balance there.

        Ports then differ from the law along the axis, each in its own way, which that law does not
        notice.
        """
        begun, here, faces = None, slice(0, self.ports), self.network.interfaces
        gap0, shift = faces.gap0.copy(), np.zeros(self.ports)
        smooth = self.model.without_friction() if self.model.ways else self.model
        left = np.inf
        for balanced in range(_BALANCES):
            force, kept = self.P @ self.at[LAST:][here], self._keep()
            self.sides.begin(self.q, 0.0 * self.v, 0.0, self.network.node_state.p, 0.0)
            force += self.sides.push
            settle_at_rest(smooth, self.state, self._gaps_now, self.bore, force)
            self.sides.place(self.q)
            moved = self.P.T @ self.q - self.at[Y0:][here]
            before, left = left, float(np.max(np.abs(moved), initial=0.0))
            if left < _BALANCED:
                break
            if balanced > 1 and left > _SLOW * before:  # it creeps, or has no force to balance
                self._put_back(kept)
                left = before
                break
            shift += moved
            ports = np.append(shift, np.zeros(PORTS))  # the ground does not move
            faces.gap0[:] = gap0 - ports[faces.upper] + ports[faces.lower]
            try:
                begun = balance(shift)
            except ConvergenceError:  # next to no force is left to balance
                break
        faces.gap0[:] = gap0
        if left > _NOT_AT_REST:
            warnings.warn(
                f"the start is not quite at rest: the bodies are {format_si(left, 'm', 2)} away "
                "from equilibrium, so the valve begins with a small motion. Check the forces at "
                "time zero: the needle should be pressed on a stop.",
                AccuracyWarning,
                stacklevel=2,
            )
        return begun

    def _gaps_now(self) -> Vector:
        self.take_gaps()
        return self.gap0

    def resume(self) -> None:
        self._silence_interfaces()
        self.read()
        self.sides.place(self.q)
        for path in self.paths:
            path.clear()
        self.impacts.resume()

    def _silence_interfaces(self) -> None:
        rows, state = self.network.interfaces, self.network.interface_state
        rows.kind[:] = NO_LAW
        rows.dry[:] = 1
        rows.gap0[:] += _AWAY
        for values in (state.e, state.force, state.chi, state.deepest, state.force_before):
            values[:] = 0.0
        state.since[:] = np.inf

    def _begin_closed(self) -> None:
        for c, (_, a, b) in enumerate(self.model.contacts):
            self.stops.force[c] = abs(float(self.model.axial[a:b] @ self.state.lam[a:b]))
            self.stops.closed[c] = -np.inf if np.any(self.state.lam[a:b] > 0.0) else np.nan
        self.flags[_AT_REST] = float(self._all_on(~np.isnan(self.stops.closed)))
        if self.model.ways:
            lie_without_friction(self.model, self.state.rubbing, self.state.lam)
        self._take_carrying()

    # ------------------------------------------------------------------ what others ask

    def recorded_impacts(self, end: float) -> tuple[SpatialImpact, ...]:
        return self.impacts.impacts(end)

    def gap(self) -> Vector:
        return np.full(len(self.order), -_AWAY)

    def pressing(self) -> Vector:
        """Contact force of each interface at rest [N]."""
        return self.stops.force[np.argsort(self.order)]

    def channels(self, time: Vector) -> dict[str, ChannelData]:
        """Lateral displacement of the axis of the needle, and the forces of the guide."""
        told: dict[str, ChannelData] = {}
        guided = self.valve.guided or (0,) * len(self.bore.heights)
        for number, (body, path) in enumerate(zip(self.model.moving, self.paths, strict=True)):
            name = self.valve.components[body.number]
            at = path.position_at(time)
            arm = self._lower_end(number)
            slope = np.column_stack([at[:, 4], -at[:, 3]])
            place = at[:, :2] + arm * slope
            for i, way in enumerate(("x", "y")):
                told[f"{name} {way}"] = ChannelData(unit="m", values=place[:, i])
                told[f"{name} tilt {way}"] = ChannelData(unit="rad", values=slope[:, i])
            own = [k for k in range(len(self.bore.heights)) if guided[k] == number]
            for count, k in enumerate(own, 1):
                guide = f"{name} guide {count}" if number else f"guide {count}"
                force = np.interp(time, self.path.time, self.path.guide_force[:, k])
                told[f"{guide} force"] = ChannelData(unit="N", values=force)
                here = self.bore.offset[k] + self._axis_at(number, self.bore.heights[k], time)
                below = self.valve.carried[number] if self.valve.carried else -1
                if below >= 0:
                    here = here - self._axis_at(below, self.bore.heights[k], time)
                for i, way in enumerate(("x", "y")):
                    told[f"{guide} {way}"] = ChannelData(unit="m", values=here[:, i])
        return told | self._side_channels(time)

    def _axis_at(self, number: int, height: float, time: Vector) -> Vector:
        """Place (n, 2) [m] of the axis of a body at a height of its drawing."""
        at = self.paths[number].position_at(time)
        arm = float(height - self.model.moving[number].centre[2])
        return np.asarray(at[:, :2] + arm * np.column_stack([at[:, 4], -at[:, 3]]))

    def _lower_end(self, number: int) -> float:
        """Height of the first contact below a body, else of the first one, from its centre [m]."""
        own = [c for c, pair in enumerate(self.pairs) if pair.mover == number]
        below = [c for c in own if self.pairs[c].is_upper]
        return float(self.valve.arms[(below or own)[0], 2]) if own else 0.0

    def _side_channels(self, time: Vector) -> dict[str, ChannelData]:
        told = {}
        self.sides.warn()
        for k, row in enumerate(self.sides.rows):
            for i, name in enumerate(("force x", "force y", "moment x", "moment y")):
                values = np.interp(time, self.path.time, self.path.side_force[:, k, i])
                unit = "N" if i < 2 else "N m"
                told[f"{row.component} side {name}"] = ChannelData(unit=unit, values=values)
        return told

    def turning(self) -> dict[str, tuple[Vector, Vector]]:
        """Times [s] and energies of rotation [J] of each component that moves."""
        found = {}
        for body, path in zip(self.model.moving, self.paths, strict=True):
            inertia = np.linalg.inv(body.rigid[3:] @ body.rigid[3:].T)
            spin = path.velocity[:, 3:]
            energy = 0.5 * np.einsum("ki,ij,kj->k", spin, inertia, spin)
            found[self.valve.components[body.number]] = (path.time, energy)
        return found

    def changing(self) -> dict[str, NDArray[np.generic]]:
        lifts = {} if self.films is None else {"lifts": self.films.offset}
        rubs = rubbing_arrays(self.state.rubbing) if self.model.ways else {}
        sides = {"sides": self.sides.work} if self.sides.acts else {}
        return (
            lifts
            | rubs
            | sides
            | self.impacts.changing()
            | {
                "forces": self.state.lam,
                "guide": self.state.guide_force,
                "films": self.state.films,
                "bearing": self.state.bearing,
                "carried": self.state.carried,
                "books": self.books,
                "gaps": self.gap0,
                "placement": self.gaps.taken_at,
                "followed": self.gaps.followed_to,
                "closed": self.stops.closed,
                "force": self.stops.force,
                "flags": self.flags,
            }
        )

    def stores(self) -> dict[str, float]:
        self.read()
        held, bent = {}, self.gap0.copy()
        for k in range(len(self.squeezed)):
            bend_faces(self.films, k, self.state.films[k, :3], bent)
        for stop, (_, a, b) in zip(self.valve.stops, self.model.contacts, strict=True):
            depth = bent[a:b] + self.model.traces[a:b] @ self.q
            held[f"{stop} contact"] = float(-0.5 * self.state.lam[a:b] @ depth)
            if self.model.ways:
                held[f"{stop} contact"] += across_energy(self.model, self.state.rubbing, a, b)
        if len(self.bore.clearance):
            held["guide strain"] = float(self.books[GUIDE_STRAIN])
        for k, film in enumerate(self.squeezed):
            held[f"{film.stop} under its film"] = film_strain(self.films, k, self.state)
        return held

    def supplies(self) -> dict[str, float]:
        return self.sides.supplies()

    def losses(self) -> dict[str, float]:
        lost = {}
        if np.any(self.model.damping > 0.0):
            lost["bodies damping"] = float(self.books[DAMPING] + self.flags[_LOST])
        if len(self.bore.clearance):
            lost["guide friction"] = float(self.books[GUIDE])
        if self.films is not None and len(self.films.room):
            lost["guide film"] = float(np.sum(self.state.bearing[:, 2]))
        for k, film in enumerate(self.squeezed):
            lost[f"{film.stop} film"] = float(self.state.films[k, LOST])
        for law, stop, (_, a, b) in zip(
            self.model.friction, self.valve.stops, self.model.contacts, strict=False
        ):
            if not law.is_none:
                lost[f"{stop} friction"] = float(np.sum(self.state.rubbing.lost[a:b]))
        return lost

    def forget_losses(self) -> None:
        self.books[[DAMPING, GUIDE, FRICTION]] = 0.0
        self.flags[_LOST] = 0.0
        self.state.films[:, LOST] = 0.0
        self.state.bearing[:, 2] = 0.0
        self.state.rubbing.lost[:] = 0.0
        self.sides.work[:] = 0.0

    # ------------------------------------------------------------------ motion

    def advance(
        self,
        recording: Recording,
        scratch: Scratch,
        clock: Index,
        block: int,
        look: int,
        looks: int,
        report: Vector,
    ) -> int:
        run = _Run(recording, scratch, clock, block, look, report)
        if not looks:
            return self._loop(run, 0, 0)
        self.read()
        self._take_carrying()
        if not self.path.begun:
            self._tell_path(int(clock[0]))
        with threadpool_limits(limits=1, user_api="blas"):
            return self._looks(run, looks)

    def _looks(self, run: _Run, looks: int) -> int:
        done, clock, recording = 0, run.clock, run.recording
        self.fresh = True
        self.stops.begin(recording, run.scratch)
        span = run.look * run.block * self.sizes.step
        while done < looks:
            fly, points = self._outlook(span, looks - done)
            if fly:
                kept, filled = everything(self.network, clock), recording.filled.copy()
                status = self._fly(run, done, fly)
                if status != STATUS_DONE:
                    return status
                if self._clear():
                    done += fly
                    self._tell_path(int(clock[0]))
                    continue
                put_back(kept)
                recording.filled[:] = filled
                self.read()
                points = True
            status = self._watch(run, done, points)
            if status != STATUS_DONE:
                return status
            done += 1
            self._tell_path(int(clock[0]))
        return STATUS_DONE

    def _outlook(self, span: float, most: int) -> tuple[int, bool]:
        """How many records can be flown, and else whether contact points are needed."""
        if self.state.contact.counts[0]:
            return 0, True
        horizon = min(most, _LONGEST) * span / _SURE
        if self.gaps.follow(self.q):
            self._lift_films()
        stale = self.gaps.stale(self.q)
        safe = self._safe(horizon, stale)
        closing = self.gap0 + self.model.traces @ self.q < _CLOSING
        if safe * _SURE < 2.0 * span and np.max(stale[closing], initial=0.0) > FRESH:
            self.take_gaps(careful=True)
            safe = self._safe(horizon, self.gaps.stale(self.q))
        fly = min(most, _LONGEST, int(safe * _SURE / span * (1.0 + 1e-9)))
        if self.films is not None or self.sides.acts:  # they act wherever the needle is
            fly = 0
        while fly and not surely_unguided(self.model, self.bore, self.state, fly * span):
            fly //= 2
        return fly, safe * _SURE < span

    def _fly(self, run: _Run, done: int, looks: int) -> int:
        here = slice(0, self.ports)
        before, work = modal_energy(self.model, self.q, self.v), float(np.sum(self.at[WORK:][here]))
        status = self._loop(run, done, looks)
        self.read()
        if np.any(self.model.damping > 0.0):
            given = float(np.sum(self.at[WORK:][here])) - work
            self.flags[_LOST] += given - (modal_energy(self.model, self.q, self.v) - before)
        self.fresh = True
        return status

    def _loop(self, run: _Run, done: int, looks: int) -> int:
        recording = run.recording
        part = recording._replace(
            means=recording.means[done:],
            peaks=recording.peaks[done:],
            points=recording.points[done:],
        )
        sizes = self.sizes
        return int(
            run_network(
                looks * run.look,
                run.look,
                run.clock,
                run.block,
                sizes.near,
                sizes.middle,
                0.0,
                sizes.step,
                sizes.coarse > 1,
                self.arrays,
                part,
                run.scratch,
                run.report,
            )
        )

    def _watch(self, run: _Run, row: int, points: bool) -> int:
        """One record with contact points or the guide."""
        clock, left = run.clock, run.look * run.block
        time = left * self.sizes.step
        before, flies = self.stops.force.copy(), True
        while left:
            level = NEAR if self.sizes.coarse > 1 else FINE
            if left >= self.steps[COARSE] > 1 and (self._rests(clock) if points else flies):
                level = COARSE
            elif points and self.flags[_AT_REST]:  # what is left of the record is shorter
                self._rest_on(rest=False)
            taken = self.steps[level]
            status = STATUS_REFUSED
            if not self._bends(clock, taken):
                status = self._step(run, level, points, row if left == taken else -1, time)
            if status == STATUS_REFUSED:
                if level == COARSE:
                    flies = False
                    if points:
                        self._rest_on(rest=False)
                        self.stops.closed[~np.isnan(self.stops.closed)] = float(clock[0])
                    continue
                for _ in range(taken):
                    left -= 1
                    status = self._step(run, FINE, points, -1 if left else row, time)
                    if status != STATUS_DONE:
                        return STATUS_FORCES if status == STATUS_REFUSED else status
                continue
            if status != STATUS_DONE:
                return status
            left -= taken
        self._steady(before)
        self.write()
        record_moment(run.recording, row, moment_of(self.arrays))
        return STATUS_DONE

    def _bends(self, clock: Index, steps: int) -> bool:
        at = self.arrays.kinks / self.sizes.step - float(clock[0])
        return steps > 1 and bool(np.any((at > 0.0) & (at < steps)))

    def _step(self, run: _Run, level: int, points: bool, record: int, record_time: float) -> int:
        """One macro step, with bodies in fine steps, or at rest in one."""
        clock, scratch, report = run.clock, run.scratch, run.report
        h, steps, arrays = self.sizes.step, self.steps[level], self.arrays
        t, H = float(clock[0]) * h, steps * h
        last = self._length(int(clock[1]), steps)
        stage = Stage(BEGINS, level, steps, t, H, steps / last, self.fresh)
        bundles = arrays, run.recording, scratch, report
        self.network_step(stage, *bundles)
        self.fresh = False
        rest = points and level == COARSE
        count, modes = (1, self.whole) if rest else self._parts(steps, H, points)
        kept = self._keep()
        at, here = self.at, self.ports
        self.network.interface_state.far[:] = 0.0
        begun, report[2] = self.q.copy(), t
        self.sides.begin(self.q, self.v, H, scratch.nodes.p, t)
        for attempt in range(MOST_REPEATS if level == FINE else MACRO_REPEATS):
            if attempt:
                self._put_back(kept)
                at[GUESS : GUESS + PORTS] = at[ANSWER : ANSWER + PORTS]
                at[GUESS + here] = 0.0
                clock[7] += 1
            push = self.P @ at[GUESS : GUESS + here] + self.sides.push
            found = self._march(modes._replace(push=push), count, points, rest, kept)
            while not rest and self._too_long(found, steps, count):
                self._put_back(kept)
                count, modes = self._cut(steps, 2 * count)
                found = self._march(modes._replace(push=push), count, points, rest, kept)
            if found is None and not rest:
                raise ConvergenceError(
                    f"needle: no contact forces found at {1e6 * t:.4g} us.\n"
                    "Try: a shorter step, or fewer kept modes."
                )
            if found is None or (rest and not self._still(found)):
                self._put_back(kept)
                clock[1] = level
                return STATUS_REFUSED
            record_ = found
            at[Y1 : Y1 + here] = self.P.T @ self.q
            self.sides.place(0.5 * (begun + self.q))
            status = self.network_step(stage._replace(attempt=attempt), *bundles)
            if status != STATUS_REPEAT:
                break
        if status in (STATUS_REPEAT, STATUS_REFUSED):
            self._put_back(kept)
            clock[1] = level  # forces are spaced like this now
            if level == FINE:
                report[2] = t
            return STATUS_REFUSED
        if status != STATUS_DONE:
            return int(status)
        excess = self._repair(level)
        self.sides.move(self.q - begun)
        ends = self.q, self.state.lam, self.gap0
        self.stops.tell(record_, t, H / count, ends, points=points)
        self.impacts.tell(t, H / count, record_, begun)
        clock[0] += steps
        clock[1] = level
        clock[2 if level == FINE else 3 if level == COARSE else 4] += 1
        if level == NEAR:
            clock[5] += steps
            clock[6] += steps
        ended = Stage(ENDS, level, steps, t, H, 1.0, False, excess, record, record_time)
        self.network_step(ended, *bundles)
        return STATUS_DONE

    def _parts(self, steps: int, H: float, points: bool) -> tuple[int, Modes]:
        """Parts of a macro step, and the modes over one.

        Fine ones where points or a dry guide may act; else heights of films change little.
        """
        longest = 1
        films = self.films
        wet = films is not None and len(films.room) > 0 and bool(np.all(films.bearing > 0.0))
        clear = points or (
            self._off_the_wall(H) if wet else surely_unguided(self.model, self.bore, self.state, H)
        )
        if films is None and self.sides.acts and not points and clear:
            longest = steps
        if not points and films is not None and (wet or clear):
            most = self.part(
                *(films.rows, films.offset, films.lowest, films.reach, films.room, self.inertia),
                *(self.state.films, self.bore.offset, self.bore.traces, self.q, self.v, H),
            )
            longest = steps if clear else min(steps, _AT_THE_WALL)
            while longest > 1 and most * longest > _FILM_SHARE * steps:
                longest //= 2
        return self._cut(steps, steps // longest)

    def _too_long(self, record: Record | None, steps: int, count: int) -> bool:
        """Whether shorter steps may find the forces of films or of a guide."""
        if record is None:
            return count < steps
        return count * _AT_THE_WALL < steps and bool(np.any(self.state.guide_force))

    def _off_the_wall(self, time: float) -> bool:
        """Whether the shaft is unlikely to meet its guide within this time."""
        if np.any(self.state.guide_force):
            return False
        place = np.linalg.norm(self.bore.offset + self.bore.traces @ self.q, axis=1)
        way = np.linalg.norm(self.bore.traces @ self.v, axis=1) * time
        return bool(np.all(place + way < _ROOM * self.bore.clearance))

    def _cut(self, steps: int, count: int) -> tuple[int, Modes]:
        length = steps // count
        if length not in self.coarser:
            self.coarser[length] = modes_of_step(self.model, length * self.sizes.step)
        return count, self.coarser[length]

    def _length(self, level: int, default: int) -> int:
        return self.steps.get(level, default) if level >= 0 else default

    def _march(
        self, modes: Modes, count: int, points: bool, rest: bool, kept: _Kept
    ) -> Record | None:
        """Fine steps under the constant modal force ``modes.push``; None where they fail."""
        n, ways = (self.model.count, self.model.ways) if points else (0, 0)
        if (count, points) not in self.records:  # each step fills its rows anew
            self.records[count, points] = Record.empty(
                *(count, len(self.model.bodies), n, ways),
                keep_points=n > 0,
                films=len(self.squeezed),
                modes=self.model.mode_count,
                stops=len(self.order),
            )
        record = self.records[count, points]
        touching = self.nothing
        if points:
            touching = (self.resting if rest else self.points)._replace(gap=self.gap0)
        state = self.state if points else self.apart
        # films share one loop, with a guide and without its heights
        bore = self.bore if len(self.bore.clearance) or self.films is not None else None
        if self.model.ways:
            march_on = self.march[points]
            _, status = march_on(count, 0, modes, _NONE, touching, bore, self.films, state, record)
        else:
            status = LEFT_OUT
            while status == LEFT_OUT:
                status = self.march_near(
                    *(count, float(self.margin), modes, _NONE, touching, self.near),
                    *(bore, self.films, state, record),
                )
                if status == LEFT_OUT:
                    self._put_back(kept)
                    self.margin *= _MORE
                    if self.margin > _EVERY:  # no number is compared with them
                        status, self.margin = FAILED, _MARGIN
        failed = status == FAILED or not np.all(np.isfinite(self.q))
        return None if failed else record

    def _repair(self, level: int) -> float:
        """Let what was missed act; the energy that bodies got beyond what was given to them [J]."""
        kicks, state, model = self.kicks[level], self.state, self.model
        closed = bool(state.contact.counts[0])
        energy = self.repair(
            *(model.omega, kicks.B1, kicks.B2, self.P, self.at, self.sides.push, self.q, self.v),
            *(state.lam if closed else self.apart.lam, model.traces, state.guide_force),
            *(self.bore.traces, self.books, self.way),
        )
        if closed and model.ways:
            rubbed = repair_offsets(model, state.rubbing, self.way)
            self.books[DEBT] += 0.5 * rubbed
            energy -= rubbed
        return float(energy)

    # ------------------------------------------------------------------ rest

    def _rests(self, clock: Index) -> bool:
        """Whether all bodies lie long and steadily enough on a stop."""
        if self.flags[_AT_REST]:
            return True
        long = float(clock[0]) - self.stops.closed >= self.rest
        if self.sizes.coarse > 1 and self._all_on(long) and self.flags[_STEADILY]:
            self._rest_on(rest=True)
            return True
        return False

    def _all_on(self, stops: NDArray[np.bool_]) -> bool:
        """Whether each body that moves is on one of these stops at least."""
        on = {
            number
            for pair, is_on in zip(self.pairs, stops, strict=True)
            if is_on
            for number in (pair.mover, pair.other)
        }
        return on.issuperset(range(len(self.model.moving)))

    def _steady(self, before: Vector) -> None:
        scale = np.maximum(np.abs(before), np.abs(self.stops.force))
        steady = np.all(np.abs(self.stops.force - before) <= _STEADY * scale)
        self.flags[_STEADILY] = float(steady)

    def _still(self, record: Record) -> bool:
        """Whether a long step met nothing that it cannot resolve."""
        now, before = np.abs(record.stops[0, :, 0]), self.stops.force
        steady = np.abs(now - before) <= _STEADY * np.maximum(now, np.abs(before))
        return bool(np.all(steady)) and bool(self.state.contact.counts[0] > 0)

    def _take_carrying(self) -> None:
        """Let the points with a force carry, as in a stored state."""
        contact, carrying = self.state.contact, np.flatnonzero(self.state.lam > 0.0)
        if not self.model.ways:
            contact.active[:] = self.state.lam > 0.0
            contact.points[: len(carrying)] = carrying
        contact.counts[0] = len(carrying)
        self._renew(self.resting.A if self.flags[_AT_REST] else self.points.A)

    def _rest_on(self, *, rest: bool) -> None:
        """Switch between fine steps and those at rest: their contact matrices differ."""
        self.flags[_AT_REST] = float(rest)
        self._renew(self.resting.A if rest else self.points.A)

    def _renew(self, A: NDArray[np.float64]) -> None:
        """Inverse over the carrying points, of another matrix."""
        if self.model.ways:
            forget_inverse(self.state.rubbing)
            return
        carrying = self.state.contact
        m = int(carrying.counts[0])
        index = carrying.points[:m]
        inverse = np.linalg.inv(A[np.ix_(index, index)])
        carrying.inverse[:m, :m] = 0.5 * (inverse + inverse.T)
        carrying.counts[1] = 0

    # ------------------------------------------------------------------ records

    def _tell_path(self, steps: int) -> None:
        time = steps * self.sizes.step
        across = self.state.guide_force, self.sides.now(self.q, time)
        for body, path in zip(self.model.moving, self.paths, strict=True):
            path.add(time, body.rigid @ self.q, body.rigid @ self.v, *across)

    # ------------------------------------------------------------------ state

    def read(self) -> None:
        self.q[:] = self.network.bodies.laid_out[self.place_q]
        self.v[:] = self.network.bodies.laid_out[self.place_v]

    def write(self) -> None:
        self.network.bodies.laid_out[self.place_q] = self.q
        self.network.bodies.laid_out[self.place_v] = self.v

    def take_gaps(self, *, careful: bool = False) -> None:
        """Take the gaps from the geometry at the present placement."""
        if self.gaps.take(self.q, careful=careful):
            self._lift_films()

    def _lift_films(self) -> None:
        """Let films begin at the present gaps."""
        if self.films is None:
            return
        at = {name: slice(first, last) for name, first, last in self.model.contacts}
        gap0 = self.gaps.faced()
        for k, film in enumerate(self.squeezed):
            self.films.offset[k] = film.fit @ gap0[at[film.stop]] - film.base

    def _safe(self, horizon: float, stale: Vector) -> float:
        model = self.model
        force = self.P @ self.at[LAST : LAST + self.ports] + self.sides.push
        args = (model.traces, model.omega, self.q, self.v, force, horizon)
        return float(self.safe_flight(self.gap0 - stale, *args))

    def _clear(self) -> bool:
        open_by = self.gap0 + self.model.traces @ self.q
        return bool(np.min(open_by) > 0.0) and surely_unguided(
            self.model, self.bore, self.state, 0.0
        )

    def _keep(self) -> _Kept:
        contact = self.state.contact
        m = int(contact.counts[0])
        return _Kept(
            tuple(values.copy() for values in self.kept),
            contact.active.copy(),
            contact.points.copy(),
            contact.counts.copy(),
            contact.inverse[:m, :m].copy(),
        )

    def _put_back(self, kept: _Kept) -> None:
        contact = self.state.contact
        for values, old in zip(self.kept, kept.vectors, strict=True):
            values[...] = old
        m = int(kept.counts[0])
        contact.active[:], contact.points[:], contact.counts[:] = kept[1:4]
        contact.inverse[:m, :m] = kept.inverse


def _places(valve: SpatialValve, network: CompiledNetwork) -> tuple[Index, Index, Vector]:
    """Place of each coordinate of the model in the network, and the shapes of its ports."""
    model, rows = valve.model, network.rows
    names = [row.component for row in rows.bodies]
    starts = np.cumsum([0, *(len(row.ports) for row in rows.bodies)])
    place_q, place_v = [], []
    P = np.zeros((model.mode_count, len(network.ports)))
    for number, component in enumerate(valve.components):
        b = names.index(component)
        own = np.flatnonzero(model.owner == number)
        P[own, starts[b] : starts[b + 1]] = rows.bodies[b].body.port_shapes
        local = np.arange(len(own))
        first = network.bodies.start[network.body_blocks[b] + local // ROW]
        place_q.append(first + ROW * ROW_Q + local % ROW)
        place_v.append(first + ROW * ROW_V + local % ROW)
    return np.concatenate(place_q), np.concatenate(place_v), P


def _impact_recorder(moving: _Moving, network: CompiledNetwork) -> ImpactRecorder:
    """Record of impacts with the pauses by which the network tells them apart."""
    rows, order = network.rows, moving.order
    rest = np.asarray(network.interfaces.rest[order])
    pause = longest_period(rows.bodies)
    return ImpactRecorder(
        moving.model,
        moving.valve.stops,
        film_lands(moving.films, moving.squeezed),
        moving.valve.shape_marks,
        felt=network.interfaces.film_felt[order],
        pause=np.full(len(order), pause) if pause > 0.0 else rest / _HALF_BOUNCES,
        rest=rest,
    )


def _check(valve: SpatialValve, network: CompiledNetwork) -> None:
    rows, model = network.rows, valve.model
    modes: Mapping[str, int] = {row.component: row.body.mode_count for row in rows.bodies}
    wanted = {
        component: int(np.sum(model.owner == number))
        for number, component in enumerate(valve.components)
    }
    stops = sorted(row.component for row in rows.interfaces)
    problem = ""
    if modes != wanted:
        problem = f"bodies {modes} in the network and {wanted} in space"
    elif sorted(valve.stops) != stops:
        problem = f"the stops {stops} in the network and {sorted(valve.stops)} in space"
    elif rows.sliders:
        problem = f"friction along the axis ('{rows.sliders[0].component}')"
    elif lands := {row.component for row in rows.interfaces if row.film is not None} - {
        film.stop for film in valve.films
    }:
        problem = f"a film without a land at '{min(lands)}'"
    elif model.limit is not None or model.layer is not None:
        problem = "faces that yield, or with a layer of asperities"
    refuse_if(
        problem,
        "motion in three dimensions",
        got=problem,
        expected="the same bodies and end stops, a guide instead of friction, smooth faces",
        hint="leave it out, or let the needle move along its axis.",
    )
