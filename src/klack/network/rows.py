"""Rows that components add and the solver turns into flat arrays.

Handles are plain integers: of a mechanical port (a degree of freedom along +z of some body) and of
a hydraulic node (one pressure).
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.errors import InputError
from klack.network.across import SideLaw
from klack.network.gas_rows import GasRows
from klack.network.protocols import InterfaceLaw, NetworkFluid, NetworkGas, RunningController
from klack.network.step_function import StepFunction

if TYPE_CHECKING:
    from klack.bodies.reduction.reduced_body import ReducedBody

__all__ = [
    "AMBIENT",
    "GROUND",
    "WAVE_BEGIN",
    "WAVE_END",
    "WAVE_STORE",
    "Ambient",
    "BodyRow",
    "Book",
    "BranchRow",
    "Channel",
    "ControllerRow",
    "ElementRow",
    "FilmRow",
    "InterfaceRow",
    "LimitRow",
    "LineRow",
    "Liquid",
    "MotionCourse",
    "NodeRow",
    "Rows",
    "SideRow",
    "SliderRow",
    "StateInput",
    "WallRow",
    "WaveRow",
]

_ROUND_OFF = 1e-9  # of the ratio of two arms


@dataclass(frozen=True, slots=True, eq=False)
class MotionCourse:
    """Displacement over time, cubic between points, constant beyond them.

    Parameters
    ----------
    time (n,) [s]
        Rising.
    displacement, slope (n,) [m], [m/s]
        At each of them; a jump of the speed has two slopes, ``slope_before`` and ``slope_after``.
    """

    time: NDArray[np.float64]
    displacement: NDArray[np.float64]
    slope_after: NDArray[np.float64]
    slope_before: NDArray[np.float64]

    def numbers(self) -> NDArray[np.float64]:
        """Flat course: ``n | times | displacements | slopes after | slopes before``."""
        arrays = (self.time, self.displacement, self.slope_after, self.slope_before)
        return np.concatenate(([float(len(self.time))], *arrays))


GROUND = -1
"""Handle of the immovable ground as a mechanical port."""

AMBIENT = 0
"""Handle of the surroundings as a hydraulic node."""


@dataclass(frozen=True, slots=True)
class Ambient:
    """Surroundings.

    Parameters
    ----------
    pressure [Pa]
        Absolute; reference of pressure forces.
    temperature [K]
    """

    pressure: float = 101_325.0
    temperature: float = 293.15


@dataclass(frozen=True, slots=True)
class Book:
    """One entry of the energy balance that a row keeps itself; see ``step_function``.

    ``owner`` is its component in a row that stands for several.
    """

    label: str
    kind: Literal["store", "supply", "loss"]
    owner: str = ""


@dataclass(frozen=True, slots=True)
class Channel:
    """A state that is recorded under ``<component> <label>``; ``index`` counts in the state.

    ``derived`` states follow from what else is known: before the first step they are what the step
    function makes of that, not what the state starts with.  ``owner`` as of a :class:`Book`.
    """

    label: str
    unit: str
    index: int
    derived: bool = False
    owner: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BodyRow:
    """A body in modal form; ``ports`` are handles of its ``port_shapes`` columns, in order.

    ``names`` are those of the component.  ``speed`` [m/s] along +z is that of the whole free body
    at the start, undeformed: the rigid modal velocities are ``speed * rigid_axial``.  A body with a
    ``course`` follows it whatever pushes it; it has one mode, of shape 1 at all its ports.
    ``places`` are body and port of the case at each port, default component and name.
    """

    component: str
    body: "ReducedBody"
    ports: tuple[int, ...]
    names: tuple[str, ...]
    speed: float = 0.0
    course: MotionCourse | None = None
    places: tuple[tuple[str, str], ...] = ()

    def face_ratio(self, port: int) -> float:
        """Speed of the face at a port over the one of the body as a whole.

        1 for a body that shifts along its axis; for a lever the arm there over the first one.
        """
        body = self.body
        if body.momentum is not None or not body.mode_count == body.rigid_count == 1:
            return 1.0
        ratio = float(body.rigid_axial[0] * body.port_shapes[0, self.ports.index(port)])
        return ratio if abs(ratio - 1.0) > _ROUND_OFF else 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StateInput:
    """Something that can flow into the states of an element: an input of its linear law.

    ``rates`` gives, by index of a state, its rate per unit at the given states.
    """

    owner: str
    quantity: str
    unit: str
    rates: Callable[[NDArray[np.float64]], Mapping[int, float]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ElementRow:
    """Element that applies forces to ports; see :mod:`klack.network.step_function`.

    ``names`` are those of its ports in the component, or ``component.port`` in a row that stands
    for several, as are the ``state_names``, name and unit of states that no channel records, by
    index.  ``at_rest`` gives the first states once its ports rest at given displacements [m], else
    ``state`` wherever they are; ``at_steady`` does so for an operating point, where they differ.
    ``interval`` [s] is that of its exchange with something outside, in whole steps; no step is
    longer.  ``inflows`` are inputs of its linear law.  ``table`` are times [s] and forces [N] that
    it follows, whatever its ports do.
    """

    component: str
    label: str
    step: StepFunction
    ports: tuple[int, ...]
    names: tuple[str, ...]
    parameters: NDArray[np.float64]
    state: NDArray[np.float64]
    books: tuple[Book, ...]
    channels: tuple[Channel, ...]
    failures: Mapping[int, str]
    at_rest: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None
    at_steady: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None
    interval: float | None = None
    state_names: Mapping[int, tuple[str, str]] = field(default_factory=dict)
    inflows: tuple[StateInput, ...] = ()
    table: tuple[Sequence[float], Sequence[float]] = ((), ())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ControllerRow:
    """A controller that sets one number at its sampling instants.

    Parameters
    ----------
    sensors, channels, units
        Name of each sensor, what it reads, and the unit of its signal.
    period [s]
    begin
        Returns a fresh controller.
    actuator
        The output is the voltage of a coil [V], the first parameter of an element [N], or a
        prescribed pressure [Pa].
    handle
        Electric node of the coil, number of the element, or hydraulic node.
    """

    component: str
    sensors: tuple[str, ...]
    channels: tuple[str, ...]
    units: tuple[str, ...]
    period: float
    begin: Callable[[], RunningController]
    actuator: Literal["voltage", "force", "pressure"]
    handle: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Liquid:
    """What a passage holds: its inertia, and what else the flow through it meets.

    Parameters
    ----------
    inertance [kg/m^4]
        ``rho length/area``.
    length [m]
    resistance, loss [Pa s/m^3], [Pa s^2/m^6]
        Pressure drop ``resistance Q + loss Q^2``.
    thin
        Whether nothing but the diameter of a hole is known, and the length is that of a thin plate.
    """

    inertance: float
    length: float
    resistance: float = 0.0
    loss: float = 0.0
    thin: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BranchRow:
    """Flow between two hydraulic nodes, perhaps pushing mechanical ports.

    ``column`` [J s/kg^2] belongs to a column of fluid whose mass flow is its first state: its
    friction, ``g_a - g_b = column * mdot`` in steady flow.  Other rows leave out the inertia of
    their ``liquid``, where that is known.
    """

    component: str
    label: str
    step: StepFunction
    a: int
    b: int
    ports: tuple[int, ...]
    parameters: NDArray[np.float64]
    state: NDArray[np.float64]
    books: tuple[Book, ...]
    channels: tuple[Channel, ...]
    failures: Mapping[int, str]
    column: float | None = None
    liquid: Liquid | None = None
    state_names: Mapping[int, tuple[str, str]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NodeRow:
    """One pressure: a volume with compliance, a prescribed pressure over time, or a junction.

    ``volume`` [m^3] at zero displacements is 0 for a prescribed pressure, whose ``time`` [s] and
    ``pressure`` [Pa] are a table (constant beyond its ends), and for a ``junction``, whose pressure
    is that at which its flows balance.  A pressure that is not ``stated`` starts at that of steady
    flow.
    """

    component: str
    volume: float
    time: NDArray[np.float64]
    pressure: NDArray[np.float64]
    stated: bool = True
    junction: bool = False

    @property
    def prescribed(self) -> bool:
        """Whether the pressure is given, whatever flows."""
        return self.volume <= 0.0 and not self.junction

    @property
    def at_start(self) -> float:
        """Pressure at time zero [Pa]; if not stated, that of the surroundings."""
        return float(np.interp(0.0, self.time, self.pressure))


@dataclass(frozen=True, slots=True, kw_only=True)
class WallRow:
    """A wall that moves with a port: ``V += area y``, ``F = area (p - p_ambient)`` along +z."""

    component: str
    node: int
    port: int
    area: float


@dataclass(frozen=True, slots=True, kw_only=True)
class FilmRow:
    """Squeeze film ``F = (cubic / h^3 + linear / h) V`` over the gap ``h = max(gap, 0) + cut_off``.

    Parameters
    ----------
    cubic [N s m^2]
    linear [N s]
    cut_off [m]
        Above zero; from the roughness.
    suction [N]
        Greatest pull while the gap opens, ``(p_ambient - p_cavitation) area``.
    """

    cubic: float
    linear: float
    cut_off: float
    suction: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InterfaceRow:
    """Contact and film, parallel, in series with a massless compliance.

    ``gap = gap_0 + y_upper - y_lower``; the force, above zero when it presses, pushes the upper
    port along +z and the lower one along -z.
    """

    component: str
    upper: int
    lower: int
    gap: float
    law: InterfaceLaw | None
    series_compliance: float
    film: FilmRow | None


@dataclass(frozen=True, slots=True, kw_only=True)
class SliderRow:
    """Dry and viscous friction between two ports: see :mod:`klack.simulation.network_sliders`.

    Parameters
    ----------
    upper, lower
        Handles; the friction on the upper port opposes its motion relative to the lower one.
    names
        Those of the component.
    coulomb [N]
        At high speeds of slip.
    breakaway [N]
        Largest friction at rest, not below ``coulomb``.
    stribeck_speed [m/s]
        At which the difference of both has decayed to 1/e.
    viscous [N s/m]
    """

    component: str
    upper: int
    lower: int
    names: tuple[str, ...]
    coulomb: float
    breakaway: float
    stribeck_speed: float
    viscous: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LineRow:
    """Delay line between two nodes, in segments with friction between them.

    Parameters
    ----------
    delay [s]
        Of the whole line.
    impedance [Pa s/m^3]
        Of a wave, ``rho a / A``.
    segments
        Friction acts between segments and, half each, at both ends.
    resistance [Pa s/m^3]
        Steady laminar friction of the whole line.
    unsteady_gain, unsteady_rate (k,) [Pa s/m^3], [1/s]
        Terms of the frequency-dependent friction of the whole line:
        ``dp = resistance q + sum_k gain_k int exp(-rate_k (t - s)) dq/ds ds``.
    vapour_pressure [Pa]
        Below it a cavity opens between two segments.
    laminar_flow [m^3/s]
        At which laminar friction ends to hold, Re = 2300.
    """

    component: str
    a: int
    b: int
    delay: float
    impedance: float
    segments: int
    resistance: float
    unsteady_gain: NDArray[np.float64]
    unsteady_rate: NDArray[np.float64]
    vapour_pressure: float
    laminar_flow: float = inf


WAVE_BEGIN, WAVE_END, WAVE_STORE = 0.0, 1.0, 2.0
"""Requests to the step function of a :class:`WaveRow`, its first input."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class WaveRow:
    """Part that stores fluid between two nodes and answers at both with waves.

    Its step function writes its state in place; with ``B`` [J/kg] the pressure energy per mass of
    the node at an end, and flows [kg/s] into the part:

    ==============  ==================================  ============================================
    first input     inputs behind it                    outputs
    ==============  ==================================  ============================================
    ``WAVE_BEGIN``  ``H``                               ``B, flow, dflow/dB`` of what leaves a, b
    ``WAVE_END``    ``H``, ``B, flow`` found at a, b    losses [J]: friction, waves, outflow
    ``WAVE_STORE``  none                                energy [J], mass [kg], Reynolds number, time
    ==============  ==================================  ============================================

    Parameters
    ----------
    states
        Length of the state.
    start
        State of the steady flow [kg/s] from a to b between two pressures [Pa].
    drop
        Energy per mass [J/kg] that a flow [kg/s] from a to b loses, given the pressure [Pa] at a,
        and its slope.
    parts
        Cells.
    crossing [s]
        Shortest time of a wave through a part; no step may be longer.
    failures
        Meaning of a status.
    losses
        Names of the three losses.
    doubts
        Sentences on a finished run, from losses and throughput [J], largest Reynolds number and its
        time [s].
    """

    component: str
    a: int
    b: int
    step: StepFunction
    parameters: NDArray[np.float64]
    states: int
    start: Callable[[float, float, float], NDArray[np.float64]]
    drop: Callable[[float, float], tuple[float, float]]
    parts: int
    crossing: float
    failures: Mapping[int, str]
    losses: tuple[str, str, str]
    doubts: Callable[[NDArray[np.float64], float, float], Iterable[str]]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SideRow:
    """Force across the axis of the needle, for motions in three dimensions alone.

    Parameters
    ----------
    element, branch
        Number of the row of the law; the other one is -1.
    placement
        First parameter of that row for the placement of the law; -1 without.
    """

    component: str
    law: SideLaw
    element: int = -1
    branch: int = -1
    placement: int = -1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LimitRow:
    """Range in which a law holds, of one quantity that changes while the network runs.

    The quantity is ``start + sum(factor * displacement)`` over ``ports``, or the pressure of
    ``node``, or a recorded ``channel``.

    Parameters
    ----------
    quantity
        As after "the": ``"gap"``.
    valid
        Range of the law.  A motion that the stops allow may not leave it; checked before the run.
    slack
        By which contacts may exceed that range before it is warned of, once.
    usable
        Beyond it the run stops.
    law
        Such as ``"the magnetic circuit of 'coil'"``; of ranges with the same one only the first
        that is left is warned of.
    source
        Of the range; may be empty.
    effect
        What is wrong at a value outside, as a sentence.
    advice
        What to try.
    key
        Of the component, that sets the start; empty where none does.
    ports
        Handle of a mechanical port, and its factor.
    at_start
        Whether it matters at the start of a run alone.
    """

    component: str
    quantity: str
    unit: str
    valid: tuple[float, float]
    usable: tuple[float, float] = (-inf, inf)
    slack: float = 0.0
    law: str
    source: str = ""
    effect: Callable[[float], str]
    advice: str
    key: str = ""
    start: float = 0.0
    ports: tuple[tuple[int, float], ...] = ()
    node: int | None = None
    channel: str = ""
    at_start: bool = False


@dataclass(eq=False)
class Rows:
    """Collects the rows of a network, one component after the other.

    While a component adds its rows, ``component`` is its name and ``handles`` maps its port names
    to handles.  What a component puts into ``closing`` is called once, after all components, under
    one name once.
    """

    ambient: Ambient
    fluid: NetworkFluid | None = None
    gas: NetworkGas | None = None
    component: str = ""
    handles: Mapping[str, int] = field(default_factory=dict)
    partners: Mapping[str, tuple[object, ...]] = field(default_factory=dict)
    bodies: list[BodyRow] = field(default_factory=list)
    elements: list[ElementRow] = field(default_factory=list)
    branches: list[BranchRow] = field(default_factory=list)
    nodes: dict[int, NodeRow] = field(default_factory=dict)
    walls: list[WallRow] = field(default_factory=list)
    interfaces: list[InterfaceRow] = field(default_factory=list)
    sliders: list[SliderRow] = field(default_factory=list)
    lines: list[LineRow] = field(default_factory=list)
    waves: list[WaveRow] = field(default_factory=list)
    limits: list[LimitRow] = field(default_factory=list)
    sides: list[SideRow] = field(default_factory=list)
    controllers: list[ControllerRow] = field(default_factory=list)
    gas_rows: GasRows = field(default_factory=GasRows)
    closing: dict[str, Callable[["Rows"], None]] = field(default_factory=dict)
    # electric node -> element of its coil, and where in its parameters the place of the program is
    coils: dict[int, tuple[int, int]] = field(default_factory=dict)

    @property
    def owners(self) -> dict[int, BodyRow]:
        """Body of each handle that is a port of one."""
        return {handle: row for row in self.bodies for handle in row.ports}

    @property
    def meeting(self) -> list[tuple[BodyRow | None, BodyRow | None]]:
        """Upper and lower body of each interface; None is the ground."""
        owner = self.owners
        return [(owner.get(row.upper), owner.get(row.lower)) for row in self.interfaces]

    @property
    def in_fluid(self) -> set[int]:
        """Ports that pressures and flows push."""
        return {wall.port for wall in self.walls} | {p for row in self.branches for p in row.ports}

    def port(self, name: str) -> int:
        """Handle of the node at the port ``name`` of the present component.

        Mechanical: the port of the body there, or :data:`GROUND`; hydraulic: the node, or
        :data:`AMBIENT`, as for optional ports that are not joined.
        """
        return self.handles[name]

    def partner(self, name: str) -> tuple[object, ...]:
        """Other components at the node of the port ``name``."""
        return self.partners.get(name, ())

    def body(
        self,
        body: "ReducedBody",
        ports: Sequence[str],
        speed: float = 0.0,
        course: MotionCourse | None = None,
        places: Sequence[tuple[str, str]] = (),
    ) -> None:
        """Add a body; ``ports`` are the component's ports, one per port of the body, in order."""
        handles = tuple(self.handles[name] for name in ports)
        row = BodyRow(
            component=self.component,
            body=body,
            ports=handles,
            names=tuple(ports),
            speed=speed,
            course=course,
            places=tuple(places) or tuple((self.component, name) for name in ports),
        )
        self.bodies.append(row)

    def element(
        self,
        step: StepFunction,
        *,
        ports: Sequence[int],
        parameters: ArrayLike,
        state: ArrayLike = (),
        books: Sequence[Book] = (),
        channels: Sequence[Channel] = (),
        failures: Mapping[int, str] | None = None,
        label: str = "",
        at_rest: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
        interval: float | None = None,
        state_names: Mapping[int, tuple[str, str]] | None = None,
        table: tuple[Sequence[float], Sequence[float]] = ((), ()),
    ) -> None:
        """Add something that pushes ports; its forces are recorded by component and port."""
        self.elements.append(
            ElementRow(
                component=self.component,
                label=label,
                step=step,
                ports=tuple(ports),
                names=self._names(ports),
                parameters=np.array(parameters, dtype=float),
                state=np.array(state, dtype=float),
                books=tuple(books),
                channels=tuple(channels),
                failures=failures or {},
                at_rest=at_rest,
                interval=interval,
                state_names=state_names or {},
                table=table,
            )
        )

    def _names(self, ports: Sequence[int]) -> tuple[str, ...]:
        left = dict(self.handles)
        names = []
        for handle in ports:
            name = next((name for name, other in left.items() if other == handle), "")
            left.pop(name, None)
            names.append(name)
        return tuple(names)

    def branch(
        self,
        step: StepFunction,
        *,
        a: int,
        b: int,
        parameters: ArrayLike,
        ports: Sequence[int] = (),
        state: ArrayLike = (),
        books: Sequence[Book] = (),
        channels: Sequence[Channel] = (),
        failures: Mapping[int, str] | None = None,
        label: str = "",
        column: float | None = None,
        liquid: Liquid | None = None,
    ) -> None:
        """Add a flow between the nodes ``a`` and ``b``; its mass flow is recorded."""
        self.branches.append(
            BranchRow(
                component=self.component,
                label=label,
                step=step,
                a=a,
                b=b,
                ports=tuple(ports),
                parameters=np.array(parameters, dtype=float),
                state=np.array(state, dtype=float),
                books=tuple(books),
                channels=tuple(channels),
                failures=failures or {},
                column=column,
                liquid=liquid,
            )
        )

    def side_of_element(self, law: SideLaw) -> None:
        """Let the element that was added last act across the axis as well."""
        self.sides.append(
            SideRow(component=self.component, law=law, element=len(self.elements) - 1)
        )

    def side_of_branch(self, law: SideLaw, placement: int) -> None:
        """Let the branch that was added last act across the axis, and know where the axis is."""
        number = len(self.branches) - 1
        self.sides.append(
            SideRow(component=self.component, law=law, branch=number, placement=placement)
        )

    def chamber(self, node: int, *, volume: float, pressure: float | None) -> None:
        """Make a node a volume [m^3]; adds to a volume already there.

        ``pressure`` [Pa] is that at the start; None for that of steady flow.
        """
        before = self.nodes.get(node)
        if before is not None and before.junction:
            raise self._two_kinds(self.component, before.component)
        if before is not None and before.stated:
            pressure = before.at_start if pressure is None else pressure
        if before is not None and before.stated and before.at_start != pressure:
            raise InputError(
                f"components.{self.component}",
                got=f"{1e-5 * (pressure or 0.0):.5g} bar at the start where '{before.component}'"
                f" has {1e-5 * before.at_start:.5g} bar",
                expected="one start pressure at one node",
                hint="give both the same, or put an orifice between them.",
            )
        self.nodes[node] = NodeRow(
            component=self.component,
            volume=volume + (before.volume if before else 0.0),
            time=np.zeros(1),
            pressure=np.array([self.ambient.pressure if pressure is None else pressure]),
            stated=pressure is not None,
        )

    def junction(self, node: int, *, pressure: float | None) -> None:
        """Make a node the meeting of lines, without a volume; ``pressure`` as of a chamber."""
        if node in self.nodes:
            raise self._two_kinds(self.nodes[node].component, self.component)
        self.nodes[node] = NodeRow(
            component=self.component,
            volume=0.0,
            time=np.zeros(1),
            pressure=np.array([self.ambient.pressure if pressure is None else pressure]),
            stated=pressure is not None,
            junction=True,
        )

    def inner_junction(self, label: str) -> int:
        """Add a junction inside the present component, at no port; return its handle."""
        node = min(self.nodes, default=AMBIENT) - 1
        self.nodes[node] = NodeRow(
            component=f"{self.component} {label}",
            volume=0.0,
            time=np.zeros(1),
            pressure=np.array([self.ambient.pressure]),
            stated=False,
            junction=True,
        )
        return node

    @staticmethod
    def _two_kinds(other: str, junction: str) -> InputError:
        return InputError(
            f"components.{junction}",
            got=f"a junction at the same node as '{other}'",
            expected="one junction, or a volume, at one node",
            hint="remove the junction: where there is a volume, lines meet without one.",
        )

    def pressure(self, node: int, *, time: ArrayLike, pressure: ArrayLike) -> None:
        """Prescribe the pressure [Pa] of a node over time [s], constant beyond the table."""
        self.nodes[node] = NodeRow(
            component=self.component,
            volume=0.0,
            time=np.array(time, dtype=float),
            pressure=np.array(pressure, dtype=float),
        )

    def wall(self, node: int, port: int, area: float) -> None:
        """Apply a pressure to a port along +z over ``area`` [m^2] (negative: along -z)."""
        self.walls.append(WallRow(component=self.component, node=node, port=port, area=area))

    def interface(
        self,
        *,
        upper: int,
        lower: int,
        gap: float,
        law: InterfaceLaw | None,
        series_compliance: float = 0.0,
        film: FilmRow | None = None,
    ) -> None:
        """Add a contact, a film, or both in parallel."""
        self.interfaces.append(
            InterfaceRow(
                component=self.component,
                upper=upper,
                lower=lower,
                gap=gap,
                law=law,
                series_compliance=series_compliance,
                film=film,
            )
        )

    def slider(
        self,
        *,
        upper: int,
        lower: int,
        coulomb: float,
        breakaway: float,
        stribeck_speed: float,
        viscous: float = 0.0,
    ) -> None:
        """Add friction between two ports; its forces are recorded by component and port."""
        self.sliders.append(
            SliderRow(
                component=self.component,
                upper=upper,
                lower=lower,
                names=self._names((upper, lower)),
                coulomb=coulomb,
                breakaway=breakaway,
                stribeck_speed=stribeck_speed,
                viscous=viscous,
            )
        )

    def line(
        self,
        *,
        a: int,
        b: int,
        delay: float,
        impedance: float,
        segments: int = 1,
        resistance: float = 0.0,
        unsteady_gain: ArrayLike = (),
        unsteady_rate: ArrayLike = (),
        vapour_pressure: float = 0.0,
        laminar_flow: float = inf,
    ) -> None:
        """Add a delay line; see :class:`LineRow`."""
        self.lines.append(
            LineRow(
                component=self.component,
                a=a,
                b=b,
                delay=delay,
                impedance=impedance,
                segments=segments,
                resistance=resistance,
                unsteady_gain=np.array(unsteady_gain, dtype=float),
                unsteady_rate=np.array(unsteady_rate, dtype=float),
                vapour_pressure=vapour_pressure,
                laminar_flow=laminar_flow,
            )
        )
