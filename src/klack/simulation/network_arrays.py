"""What the time loop of a network works on: named groups of flat arrays and their rows."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "BEFORE",
    "ELEMENTS",
    "ELEMENTS_BEFORE",
    "FORCE",
    "FREE",
    "LAST",
    "LOSS",
    "PENDING",
    "PORTS",
    "ROWS_AT",
    "SEEN",
    "STORE",
    "SUPPLY",
    "USED",
    "WORK",
    "Y0",
    "Y1",
    "Bodies",
    "Interfaces",
    "Nodes",
    "Recording",
    "Scratch",
    "StepRows",
    "scratch_memory",
]

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Cube = NDArray[np.float64]
Index = NDArray[np.int64]

STORE, SUPPLY, LOSS = 0, 1, 2

PORTS = 64
"""Length of a row of port numbers; one less is the most a network can have."""

# Rows at constant distances: the compiler knows that none overlaps another.
Y0 = 0 * PORTS  # displacements at the start of the step
Y1 = 1 * PORTS  # ... at its end
USED = 2 * PORTS  # ... as elements and fluid use them in this sweep
SEEN = 3 * PORTS  # ... as they saw them at the end of the last step
FREE = 4 * PORTS  # ... without the forces of this step
FORCE = 5 * PORTS  # forces of this step
PENDING = 6 * PORTS  # ... of the last step, not yet in the modes
LAST = 7 * PORTS  # ... of the last step
BEFORE = 8 * PORTS  # ... of the step before
WORK = 9 * PORTS  # work done by the forces so far
ELEMENTS = 10 * PORTS  # forces of elements and fluid in this sweep
ELEMENTS_BEFORE = 11 * PORTS  # ... at the end of the last step
ROWS_AT = 12


class Bodies(NamedTuple):
    """Modes in blocks and ports in body order; port number ``ports`` is the immovable ground."""

    fine: Vector  # blocks at the fine step
    coarse: Vector  # the same at the coarse step
    start: Index  # (blocks + 1,) first number of each block
    modes: Index  # (blocks,) in use, a multiple of four
    port0: Index  # (blocks,) ports of the body of the block
    port1: Index
    first: Index  # (ports,) first port of the body of each port
    last: Index
    G: Vector  # (2, PORTS, PORTS) displacement at the end of a step per unit force during it
    at: Vector  # (12, PORTS) what the ports do, row by row: see ``Y0`` and the following names


class StepRows(NamedTuple):
    """Elements or branches: where the numbers of each row lie."""

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
    book0: Index
    books: Index
    a: Index  # nodes of branches
    b: Index
    supply: Index  # book that takes all power of a source, or -1
    loss: Index  # book that takes the loss of a branch, or -1


class Nodes(NamedTuple):
    """Pressures: volumes first, then prescribed ones."""

    volumes: int
    fluid: Vector
    ambient: float
    density: float  # at ambient pressure
    hint: Index
    volume: Vector  # at zero displacements
    mass: Vector
    held: Vector  # volume at the end of the last step
    p: Vector
    before: Vector
    g: Vector
    gamma: Matrix  # (2, volumes) own compliance of the walls, A G A
    numeric: Vector  # out: loss of the implicit step
    supply: Vector  # out: energy from prescribed pressures
    time: Vector  # tables of the prescribed pressures
    pressure: Vector
    table0: Index
    wall_node: Index
    wall_port: Index
    wall_area: Vector
    end_node: Index  # of line ends


class Interfaces(NamedTuple):
    """Contacts and films."""

    upper: Index
    lower: Index
    G: Vector  # (2 n,) opening of the gap per unit force during a step, fine and coarse
    dry: Index  # 1 without a film: no force while open
    gap0: Vector
    kind: Index
    law: Vector
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
    hint: Index
    e: Vector
    gap: Vector
    rate: Vector
    force: Vector
    chi: Vector
    deepest: Vector  # indentation since a damped contact was touched
    since: Vector  # closed since; infinity while open
    film_before: Vector  # film force of the last step if the contact closed in it, else 0
    contact_loss: Vector
    film_loss: Vector


class Scratch(NamedTuple):
    """Memory of the time loop: it cannot ask for any itself."""

    interfaces: Matrix
    nodes: Matrix
    branches: Matrix
    ends: Matrix
    matrix: Matrix
    sums: Vector


def scratch_memory(*, interfaces: int, nodes: int, branches: int, ends: int, sums: int) -> Scratch:
    """Memory for a network of these sizes."""
    return Scratch(
        interfaces=np.zeros((8, interfaces)),
        nodes=np.zeros((13, nodes)),
        branches=np.zeros((3, branches)),
        ends=np.zeros((3, ends)),
        matrix=np.zeros((nodes, nodes)),
        sums=np.zeros(sums),
    )


class Recording(NamedTuple):
    """What is kept: means over records, states at their ends, and every fine step in contact."""

    means: Matrix  # (records, element forces + branches + 2 interfaces)
    peaks: Matrix  # (records, interfaces)
    points: Matrix  # (records, columns), see the compile step
    states: Index  # which states of elements are recorded
    branch_states: Index
    cm_block0: Index  # blocks of each body whose centre of mass is watched
    cm_block1: Index
    port_block0: Index
    port_block1: Index
    port_row: Index
    fine: Cube  # (interfaces, most, 5): start, step, contact force, film force, gap
    filled: Index  # (interfaces,)
