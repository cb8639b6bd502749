r"""What a finished run says of liquid that its bodies displace through passages without inertia.

A body of the speed ``v`` displaces ``A_b v`` of the liquid on its faces, which leaves through
passages of length ``l`` and area ``A``.  The kinetic energy there is that of a mass on the body,

.. math:: m = \varrho\,\frac{l}{A}\,A_b^2 \quad\text{or}\quad
          m = \sum_e L_e\,\Bigl|\frac{Q_e}{v}\Bigr|^2, \qquad L = \varrho\,\frac{l}{A},

with the flows ``Q_e`` that share the displaced one: the amplitudes at the pace of the motion,
``omega = 2 v_max / travel``, by

.. math:: i\omega \frac{V_n}{K} p_n + A_n v + \sum_e Q_e = 0, \qquad
          p_n - p_m = (i\omega L_e + R_e + C_e |Q_e|)\,Q_e .

Other bodies move along by their share ``v' v / v^2`` of the recorded velocities, with their faces
and masses.  ``K`` is that at the mean pressure while the body moves.  So parallel passages share
the flow, a guide that is too tight leaves it to others, and a chamber that is large enough takes
it.  Where chambers swing at that pace they would multiply it; the mass is at most that in rigid
ones.  The sum is over passages whose inertia the rows leave out, except those behind an inertance
or a line that has it: at a volume without a moving wall.

Limits: seats, edges and other restrictions that move, and accumulators, take any flow without
inertia, which makes the mass a lower limit; liquid within chambers is left out.  Source: Lamb,
Hydrodynamics, 1932, ch. VI (kinetic energy as an added mass); Merritt 1967, sec. 3-8.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from klack.arrays import Vector
from klack.network.rows import AMBIENT, BodyRow, BranchRow, Liquid, Rows
from klack.simulation.network_result import ChannelData
from klack.units import format_si

__all__ = ["liquid_doubts", "told_once"]

_SHARE = 0.05  # of the mass of a body, from which on liquid without inertia is doubted
_NAMED = 0.1  # of the liquid that is missing, for a passage to be named, as the largest is
_KEPT = 0.5  # of the inertance of passages, in an inertance before them, that stands for them
_OPEN, _RIGID = 1e-5, 1e-4  # of the least inertance; of the compliance of chambers
_AT_REST = 2e-8  # [m] of travel: bodies that rest tremble on their stops
_TREMBLES = 0.01  # of the longest travel of all bodies
_LEFT_OUT = ", whose inertia is left out"
_SETTLED = 6  # repetitions of the resistance at the amplitude


@dataclass(frozen=True, slots=True)
class _Passage:
    """Ends, and what is there; ``missing`` [kg/m^4] is the inertance that the rows leave out."""

    row: BranchRow | None
    a: int
    b: int
    liquid: Liquid
    missing: float = 0.0


def liquid_doubts(rows: Rows, channels: Mapping[str, ChannelData], record: float) -> Iterator[str]:
    """Sentences on bodies whose displaced liquid lacks inertia of 5 % of their mass or more.

    ``record`` [s] is the time between two values of the channels.
    """
    if rows.fluid is None or not rows.walls:
        return
    passages = tuple(_passages(rows))
    moving = [row for row in rows.bodies if row.body.moves and row.course is None]
    speeds = {row.component: channels[f"{row.component} velocity"].values for row in moving}
    travels = {name: float(np.ptp(np.cumsum(v))) * record for name, v in speeds.items()}
    told = set[frozenset[str]]()
    for row in moving:
        speed, travel = speeds[row.component], travels[row.component]
        if travel <= max(_AT_REST, _TREMBLES * max(travels.values())):
            continue
        share = {name: float(v @ speed) / float(speed @ speed) for name, v in speeds.items()}
        mass = sum(share[other.component] ** 2 * other.body.mass for other in moving)
        areas = _areas(rows, moving, share)
        if all(p.missing * sum(map(abs, areas.values())) ** 2 < _SHARE * mass for p in passages):
            continue
        fastest = float(np.max(np.abs(speed)))
        pressures = _pressures(rows, channels, np.square(speed / fastest))
        masses = _masses(rows, passages, areas, pressures, 2.0 * fastest / travel, fastest)
        along = [
            other.component
            for other in moving
            if other is not row and share[other.component] ** 2 * other.body.mass > _SHARE * mass
        ]
        group = frozenset([row.component, *along])
        if masses.sum() >= _SHARE * mass and group not in told:
            told.add(group)
            yield _sentence(rows, row, along, mass, passages, masses)


def told_once(notes: Sequence[str]) -> Iterator[str]:
    """Leave out sentences on bodies that one before is on: numbers of variants differ a little."""
    told = set[str]()
    for note in notes:
        whose, is_on_liquid, _ = note.partition(_LEFT_OUT)
        if not is_on_liquid or whose not in told:
            yield note
        told.add(whose)


def _pressures(
    rows: Rows, channels: Mapping[str, ChannelData], weights: Vector
) -> dict[int, float]:
    """By node without a prescribed one: mean while the body moves [Pa]."""
    found = {}
    for node, row in rows.nodes.items():
        if node == AMBIENT or row.prescribed:
            continue
        recorded = channels.get(f"{row.component} pressure")
        found[node] = (
            row.at_start
            if recorded is None
            else float(np.average(recorded.values, weights=weights))
        )
    return found


def _areas(rows: Rows, moving: Sequence[BodyRow], share: Mapping[str, float]) -> dict[int, float]:
    """By node: volume [m^2] that opens there per displacement that bodies share."""
    moves: dict[int, float] = {}
    for row in moving:
        body = row.body
        rigid = body.port_shapes[: body.rigid_count].T @ body.rigid_axial
        if body.momentum is not None:
            rigid = body.port_shapes.T @ body.momentum
        moves |= dict(zip(row.ports, share[row.component] * rigid, strict=True))
    areas: dict[int, float] = {}
    for wall in rows.walls:
        if wall.port in moves:
            areas[wall.node] = areas.get(wall.node, 0.0) + float(wall.area * moves[wall.port])
    return areas


def _passages(rows: Rows) -> Iterator[_Passage]:
    """All ways of the liquid but walls that yield and sources of flow."""
    branches = [
        row
        for row in rows.branches
        if row.label != "wall" and not any(book.kind == "supply" for book in row.books)
    ]
    known = [row.liquid.inertance for row in branches if row.liquid is not None]
    open_way = Liquid(inertance=_OPEN * min(known, default=1.0), length=0.0)
    lines = [
        _Passage(None, line.a, line.b, Liquid(inertance=line.delay * line.impedance, length=0.0))
        for line in rows.lines
    ]
    columns = [row for row in branches if row.column is not None and row.liquid is not None]
    kept = [(row.a, row.b, row.liquid.inertance) for row in columns if row.liquid is not None]
    kept += [(line.a, line.b, line.liquid.inertance) for line in lines]
    moved = {wall.node for wall in rows.walls}
    counted = set[int]()  # nodes at which a column stands for the passages that meet there
    for node in {end for a, b, _ in kept for end in (a, b)} - moved - {AMBIENT}:
        if rows.nodes[node].prescribed:
            continue
        column = _parallel(inertance for a, b, inertance in kept if node in (a, b))
        others = [
            row.liquid.inertance
            for row in branches
            if row.column is None and row.liquid is not None and node in (row.a, row.b)
        ]
        if others and column >= _KEPT * _parallel(others):
            counted.add(node)
    yield from lines
    yield from (_Passage(None, wave.a, wave.b, open_way) for wave in rows.waves)
    for row in branches:
        if row.liquid is None:
            yield _Passage(row, row.a, row.b, open_way)
        elif row.column is not None:
            yield _Passage(row, row.a, row.b, row.liquid)
        else:
            is_counted = not counted.isdisjoint((row.a, row.b))
            missing = 0.0 if is_counted else row.liquid.inertance
            yield _Passage(row, row.a, row.b, row.liquid, missing)


def _parallel(inertances: Iterator[float] | Sequence[float]) -> float:
    return 1.0 / sum(1.0 / inertance for inertance in inertances)


def _masses(
    rows: Rows,
    passages: Sequence[_Passage],
    areas: Mapping[int, float],
    pressures: Mapping[int, float],
    omega: float,
    speed: float,
) -> Vector:
    """Mass that each passage leaves out [kg]: the lesser of those with real and rigid chambers."""
    assert rows.fluid is not None
    place = {node: i for i, node in enumerate(pressures)}
    ends = np.zeros((len(passages), len(place)))
    for e, passage in enumerate(passages):
        for node, sign in ((passage.a, 1.0), (passage.b, -1.0)):
            if node in place:
                ends[e, place[node]] += sign
    moved = np.array([areas.get(node, 0.0) for node in place])
    stiff = rows.fluid.bulk_modulus(np.array(list(pressures.values())))
    compliance = np.array([rows.nodes[node].volume for node in place]) / stiff
    inertance = np.array([passage.liquid.inertance for passage in passages])
    resistance = np.array([passage.liquid.resistance for passage in passages])
    loss = np.array([passage.liquid.loss for passage in passages])
    missing = np.array([passage.missing for passage in passages])
    found = []
    for share in (1.0, _RIGID):
        flow = np.zeros(len(passages), dtype=complex)
        store = 1j * omega * (share * compliance + _RIGID * _RIGID * compliance.sum())
        for _ in range(_SETTLED):
            drop = 1j * omega * inertance + resistance + loss * speed * np.abs(flow)
            balance = np.diag(store) + (ends.T / drop) @ ends
            flow = (ends @ np.linalg.solve(balance, -moved)) / drop
        found.append(missing * np.abs(flow) ** 2)
    return min(found, key=np.sum)


def _sentence(
    rows: Rows,
    row: BodyRow,
    along: Sequence[str],
    whole: float,
    passages: Sequence[_Passage],
    masses: Vector,
) -> str:
    total = float(masses.sum())
    named_from = min(_NAMED * total, float(masses.max()))
    ways: dict[frozenset[int], list[_Passage]] = {}
    for passage, mass in zip(passages, masses, strict=True):
        if mass >= named_from:
            ways.setdefault(frozenset((passage.a, passage.b)), []).append(passage)
    named = [passage for way in ways.values() for passage in way]
    names = " and ".join(f"'{passage.row.component}'" for passage in named if passage.row)
    thin = ""
    if any(passage.liquid.thin for passage in named):
        thin = (
            " A hole is taken as one in a thin plate; longer holes contain more liquid: give "
            "the length."
        )
    others = "".join(f" and '{name}'" for name in along)
    weight = format_si(1e3 * whole, "g", 3)
    at = f"at '{row.component}', where {weight} move together" if along else f"on its {weight}"
    return (
        f"'{row.component}'{others} displace{'' if along else 's'} liquid through {names}"
        f"{_LEFT_OUT}: it would act like {format_si(1e3 * total, 'g', 2)} {at}"
        f", so {'their' if along else 'its'} motion is too fast.{thin}\n"
        f"Try: {'; '.join(_advice(rows, way) for way in ways.values())}."
    )


def _advice(rows: Rows, way: Sequence[_Passage]) -> str:
    node = way[0].a
    ports = [f"{p.row.component}.{'a' if p.a == node else 'b'}" for p in way if p.row]
    density = float(rows.fluid.density(rows.ambient.pressure)) if rows.fluid else 0.0
    length = max(passage.liquid.length for passage in way)
    area = density * length / _parallel([passage.liquid.inertance for passage in way])
    whose = "its" if len(ports) == 1 else "their"
    beside = "ambient" if node == AMBIENT else f"'{rows.nodes[node].component}'"
    return (
        f"join {' and '.join(ports)} to a chamber of {whose} own, {{type: chamber, volume: "
        f"{1e9 * length * area:.3g} mm^3}}, and that to {beside} by {{type: inertance, "
        f"length: {1e3 * length:.3g} mm, area: {1e6 * area:.3g} mm^2}}"
    )
