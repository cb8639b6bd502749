"""Named groups of flat arrays that the time loop of a network works on."""

from typing import NamedTuple

import numpy as np

from klack.arrays import Cube, Index, Matrix, Vector
from klack.simulation.delay_line import Lines, LineState
from klack.simulation.wave_rows import Waves

__all__ = [
    "AHEAD",
    "ANSWER",
    "AT_ONCE",
    "AVERAGE",
    "BEFORE",
    "BEFORE_2",
    "BEFORE_3",
    "BEGIN",
    "COARSE",
    "CUT",
    "EXCESS",
    "FINE",
    "FLUID_IMPULSE",
    "FORCE",
    "FREE",
    "GUESS",
    "KEPT",
    "KEPT_SLIDER",
    "LAST",
    "LOSS",
    "MEAN",
    "MIDDLE",
    "MISSED",
    "NEAR",
    "PARTS",
    "PENDING",
    "PENDING_BEGIN",
    "PORTS",
    "REPAID",
    "RISE",
    "RISE_MISSED",
    "ROWS_AT",
    "SEEN",
    "STORE",
    "SUPPLY",
    "TURN",
    "WITHIN",
    "WITHIN_BEGIN",
    "WORK",
    "WORK_BEGIN",
    "Y0",
    "Y1",
    "Accounts",
    "Bodies",
    "Contacts",
    "FlowTrial",
    "Fluid",
    "InterfaceState",
    "InterfaceTrial",
    "Interfaces",
    "NetworkArrays",
    "NodeState",
    "NodeTrial",
    "Nodes",
    "Recording",
    "Scratch",
    "SliderState",
    "SliderTrial",
    "Sliders",
    "Sliding",
    "Step",
    "StepRows",
    "scratch_memory",
]


STORE, SUPPLY, LOSS = 0, 1, 2

PORTS = 64
"""Length of a row of port numbers; one less is the most a network can have."""

FINE, COARSE, NEAR, MIDDLE, CUT = 0, 1, 2, 3, 4
"""The fine step; macro steps of many of them, in flight and about a touch; sub-steps of a few, for
smooth films; and parts of a sub-step in which a contact closes or opens."""


AT_ONCE = 1e30
"""Rate [1/s] of what follows at once; infinity has no derivative."""

PARTS = 8
"""Parts of each fine step in a sub-step that is cut."""

# Rows at constant distances: the compiler knows that none overlaps another.
Y0 = 0 * PORTS  # displacements at the start of the step
Y1 = 1 * PORTS  # ... at its end
SEEN = 2 * PORTS  # ... as elements and fluid saw them at the end of the last macro step
FREE = 3 * PORTS  # ... without the forces of this step
FORCE = 4 * PORTS  # forces of this step
PENDING = 5 * PORTS  # ... of the last step, not yet in the modes
WORK = 6 * PORTS  # work done by the forces so far
ANSWER = 7 * PORTS  # forces of elements and fluid in this macro step
BEFORE = 8 * PORTS  # ... in the last three, as if these had been as long as this one
BEFORE_2 = 9 * PORTS
BEFORE_3 = 10 * PORTS
GUESS = 11 * PORTS  # ... as the bodies feel them before elements and fluid are asked
MISSED = 12 * PORTS  # what is missing of them in this guess
AHEAD = 13 * PORTS  # displacements that it makes, which elements and fluid see in the next step
BEGIN = 14 * PORTS  # displacements at the start of the macro step
WORK_BEGIN = 15 * PORTS
PENDING_BEGIN = 16 * PORTS
EXCESS = 17 * PORTS  # one number: energy [J] that bodies got beyond what was given to them
WITHIN, WITHIN_BEGIN = EXCESS + 1, EXCESS + 2  # energy [J] that bodies got by RISE
LAST = 18 * PORTS  # forces of elements and fluid in the last macro step
RISE = 19 * PORTS  # change of the guessed forces over the macro step
RISE_MISSED = 20 * PORTS  # what is missing of it
MEAN = 21 * PORTS  # LAST, with what acts at once since then
TURN = 22 * PORTS  # change of all forces over a sub-step, zero once it is in the modes
AVERAGE = 23 * PORTS  # mean displacements over a sub-step without its forces
REPAID = 24 * PORTS  # impulse [N s] so far of the force that takes back EXCESS
FLUID_IMPULSE = 25 * PORTS  # ... of pressures and flows
ROWS_AT = 26


class Bodies(NamedTuple):
    """Modes in blocks and ports in body order; port number ``ports`` is the immovable ground."""

    ports: int
    blocks: int
    size: int  # numbers of all blocks
    laid_out: Vector  # (SIZES, size) all blocks, for each size of step
    start: Index  # (blocks + 1,) first number of each block
    modes: Index  # (blocks,) in use, a multiple of four
    port0: Index  # (blocks,) ports of the body of the block
    port1: Index
    first: Index  # (ports,) first port of the body of each port
    last: Index
    driven: int  # bodies that follow a course
    driven_block: Index  # (driven,) their block
    course0: Index  # (driven,) where their course begins
    course: Vector
    G: Vector  # (SIZES, PORTS, PORTS) displacement at the end of a step per unit force during it
    Gr: Vector  # the same per force that rises evenly by one during it and has no mean
    Gm: Vector  # mean displacement over the step per such a force
    at: Vector  # (ROWS_AT, PORTS) what the ports do, row by row: see ``Y0`` and the following names


class StepRows(NamedTuple):
    """Elements or branches: where the numbers of each row lie."""

    rows: int
    head: int  # numbers of each output before its forces: 0 of elements, 3 of branches
    function: Index  # addresses
    parameters: Vector
    parameter0: Index
    state: Vector
    state0: Index
    states: Index
    inputs: Vector
    input0: Index
    outputs: Vector
    output0: Index
    ports: Index  # flat list
    port0: Index  # (rows + 1,) into ``ports``
    account0: Index  # first account of each row
    accounts: Index  # of each row
    a: Index  # nodes of branches
    b: Index
    supply: Index  # account that takes all power of a source, or -1
    loss: Index  # account that takes the loss of a branch, or -1


class Nodes(NamedTuple):
    """Pressures: volumes first (chambers, then junctions, which hold nothing), then given ones."""

    nodes: int
    volumes: int
    chambers: int
    walls: int
    ends: int
    fluid: Vector  # table
    ambient: float
    density: float  # at ambient pressure
    boiling: float  # pressure of an open cavity at a junction
    volume: Vector  # at zero displacements
    gamma: Vector  # (2, volumes) own compliance of the walls in a fine step, A G A; then zeros
    time: Vector  # tables of the prescribed pressures
    pressure: Vector
    table0: Index
    wall_node: Index
    wall_port: Index
    wall_area: Vector
    end_node: Index  # of line ends
    slow_gas: int  # 1 where gas leaves and enters the liquid with time constants
    settled: Vector  # table of the fluid at equilibrium: that of ``fluid`` without time constants
    gas: Vector  # numbers of the release
    order: Index  # of :class:`klack.hydraulics.mass_balance.Links`, as the following
    first_link: Index
    later: Index
    filled: Index
    place: Index  # (2 branches,)


class NodeState(NamedTuple):
    """Pressures at the end of a step, and what volumes hold."""

    mass: Vector  # of a junction: what is missing in its cavity, below zero
    held: Vector  # volume at the end of the last step
    p: Vector
    before: Vector
    g: Vector
    rate: Vector  # at which flows balance the pressure of a volume [1/s]
    slope: Vector  # of the density over the pressure
    hint: Index
    free: Vector  # share of the gas with which a step begins, after mixing
    dissolved: Vector  # mass of fluid whose gas is dissolved at the end of the last step


class Interfaces(NamedTuple):
    """Contacts and films."""

    interfaces: int
    upper: Index
    lower: Index
    G: Vector  # (SIZES n,) opening of the gap per unit force during a step
    dry: Index  # 1 without a film: no force while open
    gap0: Vector
    kind: Index
    law: Vector  # numbers of all laws; sliders of those with memory are places that change
    law0: Index
    alpha: Vector
    series: Vector
    cubic: Vector
    linear: Vector
    cut_off: Vector
    suction: Vector
    film_small: Vector  # film force that a coarse step may begin with; it may end with twice of it
    film_felt: Vector  # film force from which on fine steps are recorded
    rest: Vector  # closed for so long: at rest [s]


class InterfaceState(NamedTuple):
    """Contacts and films at the end of a step."""

    hint: Index
    e: Vector
    gap: Vector
    rate: Vector
    force: Vector
    chi: Vector
    deepest: Vector  # indentation since the contact was touched
    since: Vector  # closed since; infinity while open
    film_before: Vector  # film force of the last step if the contact closed in it, else 0
    pulled: Vector  # 1 of a film that pulls as much as it can
    force_before: Vector  # force at the end of the macro step before the last
    far: Vector  # 1 of an interface whose film acts among elements
    calm: Vector  # time since when its force has changed little
    bend: Vector  # second derivative of the force in the last step, over 12; infinity: not known
    jerk: Vector  # its largest change per time in the last macro step
    rough: Vector  # time before which no longer steps are tried while the contact is closed


class Sliders(NamedTuple):
    """Friction between ports."""

    sliders: int
    upper: Index
    lower: Index
    coulomb: Vector
    excess: Vector
    stribeck: Vector
    viscous: Vector
    G: Vector  # (SIZES n,) way of slip per unit force during a step
    D: Vector  # (SIZES n,) speed of slip at its end
    kick: Vector  # (SIZES n, PORTS) the same per unit force at each port
    block0: Index  # (2 n,) blocks of the bodies of upper and lower port, none of the ground
    block1: Index
    row: Index  # of the shape of the port in its blocks


class SliderState(NamedTuple):
    """Friction at the end of a step."""

    seen: Vector  # displacement of the upper port relative to the lower one
    force: Vector


class Accounts(NamedTuple):
    """Energies [J] since the start of a run."""

    rows: Vector  # of elements and branches: what they store, supply and lose
    lines: Matrix  # (lines, 3) losses
    waves: Matrix  # (rows of waves, 4) losses, and what passed their ends
    implicit: Vector  # (volumes,) loss of the implicit step
    supply: Vector  # (prescribed nodes,)
    gas: Vector  # (volumes,) energy from gas that left the liquid
    contact: Vector  # (interfaces,) losses
    film: Vector
    friction: Vector  # (sliders,) losses


class NetworkArrays(NamedTuple):
    """A whole network."""

    bodies: Bodies
    elements: StepRows
    branches: StepRows
    nodes: Nodes
    node_state: NodeState
    lines: Lines
    line_state: LineState
    waves: Waves
    interfaces: Interfaces
    interface_state: InterfaceState
    sliders: Sliders
    slider_state: SliderState
    accounts: Accounts
    account_kind: Index
    kinks: Vector  # times [s] at which a table bends sharply, then infinity


class NodeTrial(NamedTuple):
    """Nodes in the step that is tried."""

    rho: Vector  # what flows and walls feel in the step, between both ends
    g: Vector
    p: Vector
    theta: Vector  # share of the end in it
    rho_end: Vector
    g_end: Vector
    end: Vector  # pressure at the end
    slope: Vector  # of the density over the pressure there
    p_used: Vector  # pressure and volume that the compliance of the walls counts from
    V: Vector
    V_used: Vector
    r: Vector  # mass that is missing; the last Newton step of the pressure
    inflow: Vector
    known: Vector  # pressure that the density was looked up for
    lower: Vector  # interval that holds the density
    upper: Vector
    own: Vector
    stored: Vector  # of ``own``: in the volume itself
    balanced: Vector  # what the pressure changes in flows
    cavity: Vector  # of a junction: 1 open, 0 none
    freed: Vector  # way to equilibrium that release goes in the step, first number
    taken: Vector  # the same of absorption
    share: Vector  # free share of the gas that is found
    into: Vector  # what flows over each link for a pressure, both ways


class FlowTrial(NamedTuple):
    """Branches and line ends in the step that is tried."""

    mdot: Vector
    slope_a: Vector
    slope_b: Vector
    c: Vector
    Z: Vector
    q: Vector


class InterfaceTrial(NamedTuple):
    """Interfaces in the step that is tried."""

    contact: Vector
    film: Vector
    force: Vector  # both together
    e: Vector
    gap: Vector  # that film and dashpot saw
    contact_loss: Vector
    film_loss: Vector
    least: Vector  # force in this macro step and at its start
    most: Vector
    chi: Vector  # dissipation factor at the start of the step
    opening: Vector  # speed of the gap then, where it was asked
    first: Vector  # force in the first sub-step, or at its start
    stiffness: Vector  # slope of a force that rises or falls within the step; 0: of its mean alone
    rise: Vector  # change of the force over the step
    bow: Vector  # middle of the gaps at both ends less the mean gap
    kept: Vector  # state at the start of the macro step


KEPT = 18
"""Numbers of an interface that a repeated macro step starts from."""


class SliderTrial(NamedTuple):
    """Friction in the step that is tried."""

    force: Vector
    way: Vector  # of slip
    speed: Vector  # at the end of the step without its forces
    largest: Vector  # dry friction at most
    least: Vector  # force in this macro step and at its start
    most: Vector
    first: Vector  # force in the first sub-step
    kept: Vector  # at the start of the macro step: seen, force, loss, sums of both ports


KEPT_SLIDER = 5
"""The same of a slider."""


class Scratch(NamedTuple):
    """Memory of the time loop, which cannot ask for any."""

    nodes: NodeTrial
    flows: FlowTrial
    interfaces: InterfaceTrial
    sliders: SliderTrial
    sums: Vector  # of a record: what its means are made of
    peaks: Vector


def scratch_memory(
    *, interfaces: int, sliders: int, nodes: int, links: int, branches: int, ends: int, sums: int
) -> Scratch:
    """Memory for a network of these sizes."""
    vectors = np.zeros((len(NodeTrial._fields) - 1, nodes))
    of_interfaces = [*np.zeros((len(InterfaceTrial._fields) - 1, interfaces))]
    of_interfaces.append(np.zeros(KEPT * interfaces))
    of_sliders = [*np.zeros((len(SliderTrial._fields) - 1, sliders))]
    of_sliders.append(np.zeros(KEPT_SLIDER * sliders))
    return Scratch(
        nodes=NodeTrial(*[*vectors, np.zeros(2 * links + 2)]),
        flows=FlowTrial(*np.zeros((3, branches)), *np.zeros((3, ends))),
        interfaces=InterfaceTrial(**dict(zip(InterfaceTrial._fields, of_interfaces, strict=True))),
        sliders=SliderTrial(**dict(zip(SliderTrial._fields, of_sliders, strict=True))),
        sums=np.zeros(sums),
        peaks=np.zeros(interfaces),
    )


class Step(NamedTuple):
    """One step that is tried."""

    level: int  # ``FINE`` or another size
    steps: int  # fine steps in it
    t: float  # start [s]
    H: float  # length [s]
    rate: float  # one over the length [1/s]


class Fluid(NamedTuple):
    """Pressures and flows as pointers, for the phases of a step."""

    nodes: Nodes
    state: NodeState
    trial: NodeTrial
    branches: StepRows
    flows: FlowTrial


class Contacts(NamedTuple):
    """Interfaces as pointers, for the phases of a step."""

    laws: Vector
    rows: Interfaces
    state: InterfaceState
    trial: InterfaceTrial


class Sliding(NamedTuple):
    """Friction as pointers, for the phases of a step."""

    rows: Sliders
    state: SliderState
    trial: SliderTrial


class Recording(NamedTuple):
    """What is kept: means over records, states at their ends, and every fine step in contact."""

    means: Matrix  # (records, element forces + branches + 2 interfaces + 2 sliders)
    peaks: Matrix  # (records, interfaces)
    points: Matrix  # (records, columns), see the compile step
    states: Index  # which states of elements are recorded
    branch_states: Index
    cm_block0: Index  # blocks of each body whose centre of mass is watched
    cm_block1: Index
    port_block0: Index
    port_block1: Index
    fluid_ports: Index  # that pressures and flows push
    port_row: Index
    parting: Index  # (interfaces, 6): blocks of the upper body, none if held, row; of the lower one
    fine: Cube  # (interfaces, most, 6): start, step, contact force, film force, gap, opening
    filled: Index  # (interfaces,)
