"""Named groups of arrays that the compiled step of the interface level works on."""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Cube, Index, Matrix, Vector
from klack.errors import require_nonnegative
from klack.hydraulics.tilted_film import FilmRoom

__all__ = [
    "CONTACT_STEPS",
    "DAMPING",
    "DEBT",
    "DIRECTION",
    "FRICTION",
    "GUIDE",
    "GUIDE_STRAIN",
    "LAYER",
    "OPEN_STEPS",
    "PLASTIC",
    "ROUNDS",
    "WORK",
    "ActiveSet",
    "Closed",
    "ContactPoints",
    "FilmWork",
    "Films",
    "Grip",
    "Guide",
    "Layer",
    "Limit",
    "Modes",
    "Near",
    "Others",
    "Outside",
    "Pressed",
    "Record",
    "Rings",
    "Rubbing",
    "State",
    "Step",
    "Worn",
]


DAMPING = 0
WORK = 1  # of the constant force
GUIDE = 2  # loss: friction, drag and a numerical part
DEBT = 3  # energy that the contact has still to pay
GUIDE_STRAIN = 4  # energy held
OPEN_STEPS = 5  # since the last contact, -1 before the first
ROUNDS = 6  # of the complementarity solver
CONTACT_STEPS = 7
DIRECTION = 8  # sign of the last axial contact force, 0 before the first
FRICTION = 9  # loss between the faces
PLASTIC = 10  # loss to faces that yield
LAYER = 11  # energy held by layers of asperities, less half the product of force and closure
_BOOKS = 12


class Modes(NamedTuple):
    """Modal coordinates of all bodies over one step."""

    A11: Vector  # (M,) exact propagator, :mod:`klack.simulation.propagator`
    A12: Vector
    A21: Vector
    A22: Vector
    B1: Vector
    B2: Vector
    loss: Matrix  # (6, M) Q11, Q12, Q22, L1, L2, S of the damping; (0, M): undamped
    push: Vector  # (M,) modal force of 1 N along +z on the moving body, spread over its mass
    drift: Matrix  # (bodies, M) centres of mass along z
    step: float  # [s]


class Outside(NamedTuple):
    """Forces along +z on the moving body."""

    constant: float  # [N]
    spring: float  # [N/m] pulls back to where q = 0


class Limit(NamedTuple):
    """Pressure limit of the points, see :mod:`klack.contact.pressure_limit`."""

    area: Vector  # (n,) [m^2]; infinite for a point that stays elastic
    set: Vector  # (m,) [m]
    pressure: Vector  # (m,) [Pa]
    softness: Vector  # (m,) [m/Pa] beyond each of them


class Layer(NamedTuple):
    """Layer of asperities on the points, see :mod:`klack.contact.asperity_layer`."""

    area: Vector  # (n,) [m^2]
    closure: Vector  # (m,) [m]
    pressure: Vector  # (m,) [Pa]
    energy: Vector  # (m,) [J/m^2]


class Rings(NamedTuple):
    """Orders of the compliance of n = R N points at N angles on rings, in three directions.

    Numbers of rows are R c + r in direction c; of the m chosen rings, m c + their place.
    """

    around: Matrix  # (N, N) orthonormal functions of the angle
    back: Matrix  # (N, N) the same transposed
    start: Index  # (K + 1,) first function of each order
    compliance: Cube  # (K, 3 R, 3 R) [m/N] of each order
    place: Index  # (R,) of a ring among the chosen ones, -1: it is not
    ring: Index  # (R,) the first ``chosen[0]`` are chosen
    chosen: Index  # (1,)
    soft: Vector  # the compliance of the chosen ones, (K, 3 m, 3 m) in the first entries
    stiff: Vector  # its inverse, order by order

    @classmethod
    def none(cls) -> Self:
        """Return no ring."""
        cube, index, grid = np.zeros((0, 0, 0)), np.zeros(0, dtype=np.int64), np.zeros((0, 0))
        return cls(grid, grid, index, cube, index, index, index, np.zeros(0), np.zeros(0))


class Grip(NamedTuple):
    """Friction between the faces at the points."""

    tangents: Matrix  # (ways n, M), ways = d - 1
    axial: Vector  # (ways n,)
    static: Vector  # (n,) [-] coefficients of friction
    kinetic: Vector  # (n,) [-]
    fade: Vector  # (n,) [m] slip within a step over which the first fades to the second
    rings: Rings  # on which the points lie, or none


class Others(NamedTuple):
    """Points that are left out of some steps, because no gap of theirs can close in these.

    Their gaps are at least ``room``, less what bodies move otherwise than at their first speed.
    """

    room: float  # [m]
    place: Vector  # (M,) modes at the start
    speed: Vector  # (M,)
    rigid: int  # modes of the needle that are rigid, the first ones
    reach: Vector  # (3,) largest motion of a gap per rigid and per elastic motion, and per force
    bend: Matrix  # (f, 3) force and moments of the films at the start
    arm: float  # [m] farthest point from the axis


class ContactPoints(NamedTuple):
    """Points that may close.

    Of ``grip``, ``limit`` and ``layer`` they have one at most; code for what is None is not
    compiled.
    """

    A: Matrix  # (d n, d n) [m/N] of ``contact_compliance``; d = 1 without friction
    traces: Matrix  # (n, M)
    gap: Vector  # (n,) [m] at q = 0, of the faces as they are: with their set
    axial: Vector  # (n,)
    stop: Index  # (n,) number of the contact that each belongs to
    grip: Grip | None = None  # of points that rub
    limit: Limit | None = None  # of points that yield; then A is changed in place
    layer: Layer | None = None  # of rough points
    others: Others | None = None  # beside these

    def away(self) -> Self:
        """No points, as in flight."""
        return self._replace(A=self.A[:0, :0], traces=self.traces[:0], gap=self.gap[:0])


class Guide(NamedTuple):
    """Clearance contacts of the moving body with a bore along z, at k heights."""

    heights: Vector  # (k,) [m] z of the sections, at the placement of the moving body
    clearance: Vector  # (k,) [m] radial
    offset: Matrix  # (k, 2) [m] position across the axis of the bore (z), at q = 0
    traces: Cube  # (k, 2, M) [1/sqrt(kg)] displacement of the section across the axis
    slide: Matrix  # (k, M) [1/sqrt(kg)] the same along it
    turn: Cube  # (k, 3, M) [1/(m sqrt(kg))] rotation of the section about x, y, z
    radius: Vector  # (k,) [m] of the shaft; below zero where the bore is that of the guided body
    compliance: Cube  # (k, 2, 2) [m/N] of bore and shaft, without that of the kept modes
    friction: Vector  # (k,) [-]
    viscous: Vector  # (k,) [N s/m] drag at each height

    @classmethod
    def none(cls, modes: int) -> Self:
        """Return a guide without a height."""
        none = np.zeros(0)
        across, along, turn = np.zeros((0, 2, modes)), np.zeros((0, modes)), np.zeros((0, 3, modes))
        place, compliance = np.zeros((0, 2)), np.zeros((0, 2, 2))
        return cls(none, none, place, across, along, turn, none, compliance, none, none)

    def with_friction(self, coefficient: float) -> Self:
        """The same guide with another Coulomb coefficient [-]."""
        require_nonnegative("guide: friction", coefficient, "-")
        return self._replace(friction=np.full(len(self.heights), coefficient))


class Films(NamedTuple):
    """Films between faces: heights are lift + r (tilt_x cos + tilt_y sin) + what roughness leaves.

    Lands of several sizes have room in the arrays of the largest: ``sizes`` tells what is used
    (:func:`klack.transient.tilting_films.land_at`).
    """

    rows: Cube  # (k, 3, M) lift and tilts per modal coordinate [-], [1/m]
    offset: Matrix  # (k, 3) [m], [-] the same at q = 0
    lowest: Vector  # (k,) [m] height that roughness leaves
    reach: Vector  # (k,) [m] largest radius
    viscosity: Vector  # (k,) [Pa s]
    tension: Vector  # (k,) [Pa] largest mean one of a sector; [N] of a film without a land
    shear: Vector  # (k,) [N s] force over closing speed, times the height
    axial: Vector  # (k,) [-] axial force per force along the lift
    arms: Cube  # (k, n, 3) lift and tilts per gap of a contact point: force and moments per force
    span: NDArray[np.int64]  # (k, 2) first point of the stop, and the one behind its last
    compliance: Cube  # (k, 3, 3) of the bulk under film and contact, in series with both
    bearing: Vector  # (g,) [N s] of heights of the guide: mu L^3 R / c^2, see ``guide_film``
    room: Vector  # (g,) [m] c: clearance and what roughness leaves
    sizes: NDArray[np.int64]  # (k, 5) sectors, circles, points, functions, shared ones
    ways: NDArray[np.float64]  # (k, 3, N, S) of each land, see hydraulics.tilted_film.Land
    worked: NDArray[np.float64]  # (k, 3, Q, S)
    between: Cube  # (k, G, N)
    along: NDArray[np.float64]  # (k, G, Q, Q)
    around: NDArray[np.float64]  # (k, G, Q, Q)
    load: Cube  # (k, N, Q)
    area: Matrix  # (k, N)


class FilmWork(NamedTuple):
    """What the films of a step work with."""

    room: FilmRoom
    soft: Cube  # (k, 3, 3) lift and tilts at the end of a step per mean force, and of the bulk
    slopes: Matrix  # (3, 3)
    stiffer: Matrix  # (3, 3)
    held: Cube  # (k, 2, 3) force and moments of the contact forces at both ends of the step


class ActiveSet(NamedTuple):
    """Contact points that carry, and the inverse of their compliance."""

    active: NDArray[np.bool_]  # (n,)
    points: NDArray[np.int64]  # (n,) the first ``counts[0]`` of them carry
    inverse: Matrix  # (n, n) [N/m] of A over these points, in this order
    counts: NDArray[np.int64]  # points that carry; changes since the inverse was computed afresh

    @classmethod
    def none(cls, points: int) -> Self:
        """Return the set in which no point carries."""
        order = np.zeros(points, dtype=np.int64)
        inverse, counts = np.zeros((points, points)), np.zeros(2, dtype=np.int64)
        return cls(np.zeros(points, dtype=bool), order, inverse, counts)


class Closed(NamedTuple):
    """Points that may carry with friction, and an inverse over their unknown forces.

    Directions of the point in place s are d s (normal), d s + 1 and, in 3-D, d s + 2 in ``block``;
    unknown forces are numbered likewise: normal, along and across the slip.
    """

    points: NDArray[np.int64]  # (n,) the first ``counts[0]``
    place: NDArray[np.int64]  # (n,) of a point among them, -1: it is not
    block: Matrix  # (d n, d n) [m/N] compliance of those points
    frame: Matrix  # (n, 2) direction of slip, as the inverse has it
    bound: Vector  # (n,) [-] coefficients of friction, as the inverse has them
    yields: Vector  # (n,) [m/N] further compliance across the slip, as the inverse has it
    unknown: NDArray[np.int64]  # (d n,) numbers of the first ``counts[1]`` unknown forces
    row: NDArray[np.int64]  # (d n,) of an unknown force in the inverse, -1: it is not one
    inverse: Matrix  # (d n, d n) [N/m]
    counts: NDArray[np.int64]  # points, unknown forces, rounds beyond two since a fresh inverse
    # (-1: there is none, the unknown forces are only listed)

    @classmethod
    def none(cls, points: int, ways: int) -> Self:
        """Return no closed point."""
        n, size = points, (1 + ways) * points
        return cls(
            np.zeros(n, dtype=np.int64),
            np.full(n, -1, dtype=np.int64),
            np.zeros((size, size)),
            np.zeros((n, 2)),
            np.zeros(n),
            np.zeros(n),
            np.zeros(size, dtype=np.int64),
            np.full(size, -1, dtype=np.int64),
            np.zeros((size, size)),
            np.zeros(3, dtype=np.int64),
        )


class Rubbing(NamedTuple):
    """Memory of points with friction, changed in place; empty without."""

    forces: Vector  # (d n,) [N] last forces, normal ones first
    before: Vector  # (d n,) [N] those a step earlier: both make the first guess
    closed: Closed
    across: Vector  # (ways n,) [N] tangential forces
    bent: Vector  # (ways n,) [m] tangential offset less that of the modes: residual compliance
    doing: NDArray[np.int64]  # (n,) see :mod:`klack.transient.rubbing`
    slip: Vector  # (n,) [m] within the last step, 0 where the point stuck or was open
    lost: Vector  # (n,) [J] what friction has taken at each point

    @classmethod
    def none(cls, points: int, ways: int) -> Self:
        """Return points that do not touch."""
        n = points if ways else 0
        return cls(
            np.zeros((1 + ways) * n),
            np.zeros((1 + ways) * n),
            Closed.none(n, ways),
            np.zeros(ways * n),
            np.zeros(ways * n),
            np.zeros(n, dtype=np.int64),
            np.zeros(n),
            np.zeros(n),
        )


class Worn(NamedTuple):
    """Memory of points that yield, changed in place; empty without."""

    set: Vector  # (n,) [m]
    line: NDArray[np.int64]  # (n,) of the limit, as the inverse has it; -1: elastic
    softness: Vector  # (n,) [m/N] on that line
    row: Vector  # (n,) scratch

    @classmethod
    def none(cls, points: int) -> Self:
        """Return faces as made."""
        n = points
        return cls(np.zeros(n), np.full(n, -1, dtype=np.int64), np.zeros(n), np.zeros(n))


class Pressed(NamedTuple):
    """Memory of rough points, changed in place; empty without."""

    force: Vector  # (n,) [N] last forces
    before: Vector  # (n,) [N] those a step earlier: both make the first guess
    stiffness: Vector  # (n,) [N/m] of the layer, as the inverse has it; 0: open
    points: NDArray[np.int64]  # (n,) the first ``counts[0]`` are in the inverse
    inverse: Matrix  # (n, n) [N/m] of A and of the compliance of the layer over these points
    counts: NDArray[np.int64]  # points in the inverse

    @classmethod
    def none(cls, points: int) -> Self:
        """Return points that do not touch."""
        n = points
        order, counts = np.zeros(n, dtype=np.int64), np.zeros(1, dtype=np.int64)
        return cls(np.zeros(n), np.zeros(n), np.zeros(n), order, np.zeros((n, n)), counts)


class State(NamedTuple):
    """Where the bodies and their contact are, changed in place."""

    q: Vector  # (M,)
    v: Vector  # (M,)
    lam: Vector  # (n,) [N] contact forces
    contact: ActiveSet
    rubbing: Rubbing
    worn: Worn
    pressed: Pressed
    carried: NDArray[np.bool_]  # (n,) points that have carried a force
    guide_force: Matrix  # (k, 2) [N] on the shaft, at the start of the next step
    films: (
        Matrix  # (f, 24 + S) forces of the last step, and more: ``klack.transient.tilting_films``
    )
    bearing: Matrix  # (g, 3) [N] force of the film in the guide in the last step, energy lost [J]
    books: Vector  # sums, see ``DAMPING`` and the following names

    @classmethod
    def still(
        cls,
        modes: int,
        points: int,
        heights: int,
        ways: int = 0,
        *,
        yields: bool = False,
        films: int = 0,
        sectors: int = 0,
        rough: bool = False,
    ) -> Self:
        """State of rest at q = 0, of new faces."""
        return cls(
            np.zeros(modes),
            np.zeros(modes),
            np.zeros(points),
            ActiveSet.none(0 if ways or rough else points),
            Rubbing.none(points, ways),
            Worn.none(points if yields else 0),
            Pressed.none(points if rough else 0),
            np.zeros(points, dtype=bool),
            np.zeros((heights, 2)),
            np.zeros((films, 24 + sectors)),
            np.zeros((heights, 3)),
            np.zeros(_BOOKS),
        )


class Step(NamedTuple):
    """The present step: forces over it, state at its end."""

    share: float  # [N/m] force of the spring per displacement that the step would have without it
    known: Vector  # (M,) modal force from outside and from the guide
    whole: Vector  # (M,) all modal forces
    kick: Vector  # (M,) the modal force that comes next
    q: Vector
    v: Vector
    open_gap: Vector  # (n,) [m] without contact forces at the end
    gap: Vector  # (n,) [m]
    lam: Vector  # (n,) [N]
    both: Vector  # (n,) [N] sum of the contact forces at both ends
    normal: Matrix  # (k, 2) [N] of the guide on the shaft
    dragging: Vector  # (k,) change of the sliding speed per speed that drag has braked [-]
    free: Vector  # (d n,) [m] gaps and increments of offset without contact forces; friction only
    motion: Vector  # (d n,) [m] the same with them
    way: Vector  # (M,) of the modes within the step
    moved: Vector  # (ways n,) [m] the part of the offsets that the modes move
    bent: Vector  # (ways n,) [m] the other part, at the end
    mu: Vector  # (n,) [-]
    film: FilmWork | None  # with films only


class Near(NamedTuple):
    """Memory for the points that may close within a few steps."""

    block: Vector  # (n n,) their part of A
    rows: Vector  # (n M,) of the traces
    chosen: NDArray[np.int64]  # (n,)
    place: NDArray[np.int64]  # (n,) of a point among them, -1: left out
    known: Vector  # (2,) how many, and by which first entry their A is known
    low: Vector  # (n,) [m] least gap of each point at its speed
    reach: Vector  # (3,) as of ``Others``
    rigid: int
    arm: float


class Record(NamedTuple):
    """Out: one entry per step."""

    force: Vector  # [N] mean axial contact force
    gap: Vector  # [m] mean smallest gap
    drift: Matrix  # (steps, bodies) [m/s] speed of the centres of mass at the end of the step
    outside: Vector  # [N] mean axial force from outside
    points: NDArray[np.float32]  # (steps, n) [N] mean force of every point, or (0, n)
    pressed: Vector  # [N] the part of ``force`` that is not friction; (0,) without friction
    across: NDArray[np.float32]  # (steps, ways n) [N] mean friction of every point, or (0, 0)
    doing: NDArray[np.int8]  # (steps, n) open, stuck or slipping at the end, or (0, 0)
    film: Matrix  # (steps, f) [N] mean axial force of each film
    lands: Cube  # (steps, f, 6) lift and tilts that each film had at the start and at the end
    places: Matrix  # (steps, M) modal coordinates at the end of the step, or (0, M)
    stops: Cube  # (steps, c, 2) [N] ``force`` and ``pressed`` of every contact, or (0, 0, 2)

    @classmethod
    def empty(
        cls,
        steps: int,
        bodies: int,
        points: int,
        ways: int = 0,
        *,
        keep_points: bool,
        films: int = 0,
        modes: int = 0,
        stops: int = 0,
    ) -> Self:
        """Room for so many steps, and for ``modes`` modal coordinates in each."""
        force, gap, outside = np.zeros((3, steps))
        kept = steps if keep_points else 0
        return cls(
            force,
            gap,
            np.zeros((steps, bodies)),
            outside,
            np.zeros((kept, points), dtype=np.float32),
            np.zeros(steps if ways else 0),
            np.zeros((kept if ways else 0, ways * points), dtype=np.float32),
            np.zeros((kept if ways else 0, points if ways else 0), dtype=np.int8),
            np.zeros((steps, films)),
            np.zeros((steps, films, 6)),
            np.zeros((steps if modes else 0, modes)),
            np.zeros((kept, stops if kept else 0, 2)),
        )
