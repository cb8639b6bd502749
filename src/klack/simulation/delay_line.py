r"""Lines with water hammer as pure delays: two waves per segment, exact in volume and energy.

A wave that enters a segment at one end leaves it at the other after the delay ``T`` (d'Alembert).
With the pressure ``P`` about ambient and the flow ``q`` *into* the segment, means over a step, and
the impedance ``Z``,

.. math:: P = c + Z q, \qquad w = P + Z q = c + 2 Z q, \qquad c_b(t) = w_a(t - T),

``c`` arrives at an end, ``w`` leaves it.  Waves are kept as means over fine steps ``h``; a delay
that is no multiple of ``h`` is read by linear interpolation, and a step of ``m`` fine steps reads
the mean of ``m`` samples and writes ``m`` equal ones.  The weights of a read add up to one, so the
volume of a pulse is kept, and by convexity the energy ``h w^2 / (4 Z)`` per sample can only fall:
that loss is counted.

Friction sits between segments and, half each, at both ends: ``R q`` and resistance-inductance
pairs ``dp_k = gain_k (q - i_k)``, ``di_k/dt = rate_k (q - i_k)``, advanced exactly for a flow that
is constant over the step.  Between two segments a cavity opens when the pressure would fall below
``P_v``; differential and common mode of such a junction are independent, so both have closed forms.

``P`` is ``rho_ref g(p)`` with ``g`` the integral of ``dp/rho`` from ambient pressure and
``rho_ref`` the density at ambient pressure; ``q`` is the mass flow over ``rho_ref``.  Then ``P q``
is the power ``g mdot`` of the hydraulic nodes.

In a time loop: :func:`compile_lines` and :func:`start_lines` once; then per step
:func:`lines_incoming`, the solution of the nodes with ``P = c + Z q``, :func:`lines_commit`.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from klack.arrays import Ints, Matrix, Vector
from klack.errors import InputError
from klack.machine.compiling.jit import inner, njit
from klack.network.rows import LineRow
from klack.network.step_function import first, shift
from klack.units import format_si

__all__ = [
    "LINE_LOSSES",
    "LINE_MEMORY",
    "LineState",
    "Lines",
    "compile_lines",
    "line_cavity",
    "line_store",
    "line_volume",
    "lines_commit",
    "lines_incoming",
    "start_lines",
]


LINE_LOSSES = ("friction", "interpolation", "cavity collapse")
"""Columns of the losses in :func:`lines_commit`."""

LINE_MEMORY = ("samples", "head", "memory", "cavity")
"""Arrays of :class:`LineState` that one step hands on to the next."""

_FAST = {"contract", "reassoc", "nsz", "arcp"}  # lets the sums over friction terms use registers
_ROOM = 8  # windows of samples under way that a memory has room for
_MOST_ROOM = 20_000  # samples, unless the window itself is longer
_A_WHOLE = 1e-9  # [-] a delay this close to a whole number of steps is taken as whole


class Lines(NamedTuple):
    """Constants of all lines, ``n`` lines with ``s`` segments in all.

    End ``2 line`` is port a of a line, end ``2 line + 1`` its port b; ``coarse`` and ``near`` steps
    are of so many fine ones.  A lump is what carries the friction between two segments (whole) or
    at an end (half).

    Parameters
    ----------
    step [s]
        Fine step.
    node (2 n,)
        Hydraulic node of each end.
    impedance (n,) [Pa s/m^3]
    resistance (n,) [Pa s/m^3]
        Steady friction of one whole lump.
    vapour (n,) [Pa]
        ``P`` in an open cavity, about ambient.
    first_segment (n + 1,)
        The segments of a line, from a to b, are ``first_segment[line] : first_segment[line + 1]``.
    depth (s,)
        Samples under way in each wave: whole steps of the delay, plus one.
    fraction (s,) [-]
        Rest of the delay, in steps.
    start (s, 2)
        Where the memory of the wave towards b (0) and a (1) starts in the samples; it is several
        times as long as needed: the window of samples under way moves up, then back.
    room (s,)
        By which this window may move up.
    first_term (n + 1,)
        Terms of frequency-dependent friction of each line.
    first_memory (n,)
        Where the memories of a line start; ordered by lump, then by term.
    impedance_of_term (3, k) [Pa s/m^3]
        Mean ``dp / (q - i)`` of one whole lump over a fine (0), a coarse (1) and a near step (2).
    decay (3, k) [-]
        Share of ``q - i`` left after such a step.
    heat (3, k) [Pa s^2/m^3]
        Loss of one whole lump in a step over ``(q - i)^2``.
    inductance (k,) [Pa s^2/m^3]
        Of one whole lump, ``gain / rate``.
    lump (3, n) [Pa s/m^3]
        ``dp / q`` of one whole lump without memory: its resistance and all its terms.
    """

    step: float
    coarse: int
    near: int
    node: Ints
    impedance: Vector
    resistance: Vector
    vapour: Vector
    first_segment: Ints
    depth: Ints
    fraction: Vector
    start: Ints
    room: Ints
    first_term: Ints
    first_memory: Ints
    impedance_of_term: Matrix
    decay: Matrix
    heat: Matrix
    inductance: Vector
    lump: Matrix


class LineState(NamedTuple):
    """State of all lines; the first four are enough to continue to the same bits.

    Parameters
    ----------
    samples [Pa]
        All waves ``w``.
    head (s,)
        Oldest sample under way in both waves of a segment, from its start.
    memory [m^3/s]
        Flows ``i_k`` of the friction terms; counted into the line at its ends, towards b inside.
    cavity (s,) [m^3]
        Vapour between a segment and the next one of its line.
    incoming (s, 2) [Pa]
        Scratch: waves that leave each segment in the present step, as in ``Lines.start``.
    scatter (n,) [J]
        Scratch: energy that interpolation and averaging take in the present step.
    fastest (n,) [m^3/s]
        Largest absolute flow through an end since the start of the run.
    moment (n, 2)
        Fine steps from that start to that flow, and to now.
    """

    samples: Vector
    head: Ints
    memory: Vector
    cavity: Vector
    incoming: Matrix
    scatter: Vector
    fastest: Vector
    moment: Ints


def compile_lines(
    rows: Sequence[LineRow], *, step: float, coarse: int, near: int = 1, ambient_pressure: float
) -> tuple[Lines, LineState]:
    """Lay out lines for steps of 1, ``near`` and ``coarse`` fine steps, at rest.

    Segments have equal delays up to ``coarse`` steps, so that coarse steps find their own samples
    again and lose nothing; only the last segment of a line has a fraction of a step.

    Parameters
    ----------
    step [s]
        Fine step.
    coarse
        1 without coarse steps.
    ambient_pressure [Pa]
        From which ``P`` counts.

    Raises
    ------
    InputError
        If a segment is shorter than a coarse step.
    """
    whole, fraction = [], []
    for row in rows:
        for steps in _segment_steps(row, step, coarse):
            nearest = round(steps)
            if abs(steps - nearest) < _A_WHOLE * steps:
                steps = float(nearest)
            whole.append(int(steps))
            fraction.append(steps - int(steps))
    depth = np.array(whole, dtype=np.int64) + 1
    room = np.minimum(_ROOM * depth, np.maximum(depth, _MOST_ROOM))
    start = _offsets(np.repeat(depth + room + coarse, 2))
    segments = np.array([row.segments for row in rows], dtype=np.int64)
    terms = np.array([len(row.unsteady_gain) for row in rows], dtype=np.int64)
    memories = terms * (segments + 1)
    gain = _concatenate([row.unsteady_gain / row.segments for row in rows])
    rate = _concatenate([row.unsteady_rate for row in rows])
    durations = rate * step * np.array([[1], [coarse], [near]])
    impedance_of_term = gain * -np.expm1(-durations) / durations
    resistance = np.array([row.resistance / row.segments for row in rows], dtype=float)
    line_of_term = np.repeat(np.arange(len(rows)), terms)
    lump = np.tile(resistance, (3, 1))
    for level in range(3):
        np.add.at(lump[level], line_of_term, impedance_of_term[level])
    lines = Lines(
        step=float(step),
        coarse=int(coarse),
        near=int(near),
        node=np.array([node for row in rows for node in (row.a, row.b)], dtype=np.int64),
        impedance=np.array([row.impedance for row in rows], dtype=float),
        resistance=resistance,
        vapour=np.array([row.vapour_pressure - ambient_pressure for row in rows], dtype=float),
        first_segment=_offsets(segments),
        depth=depth,
        fraction=np.array(fraction, dtype=float),
        start=np.ascontiguousarray(start[:-1].reshape(-1, 2)),
        room=room,
        first_term=_offsets(terms),
        first_memory=_offsets(memories)[:-1],
        impedance_of_term=impedance_of_term,
        decay=np.exp(-durations),
        heat=0.5 * gain / rate * -np.expm1(-2.0 * durations),
        inductance=gain / rate,
        lump=lump,
    )
    state = LineState(
        samples=np.zeros(start[-1]),
        head=np.zeros(len(depth), dtype=np.int64),
        memory=np.zeros(int(memories.sum())),
        cavity=np.zeros(len(depth)),
        incoming=np.zeros((len(depth), 2)),
        scatter=np.zeros(len(rows)),
        fastest=np.zeros(len(rows)),
        moment=np.zeros((len(rows), 2), dtype=np.int64),
    )
    return lines, state


def start_lines(lines: Lines, state: LineState, pressure: ArrayLike, flow: ArrayLike = 0.0) -> None:
    """Fill all lines with a steady flow, in place; the rest of the pressure drop is linear.

    Parameters
    ----------
    pressure (2 n,) [Pa]
        ``P`` at ends a and b of each line.
    flow (n,) [m^3/s]
        From a to b.
    """
    ends = np.broadcast_to(np.asarray(pressure, dtype=float), lines.node.shape)
    flows = np.broadcast_to(np.asarray(flow, dtype=float), lines.impedance.shape)
    state.head[:] = 0
    state.cavity[:] = 0.0
    for line, Q in enumerate(flows):
        segments = range(lines.first_segment[line], lines.first_segment[line + 1])
        P_a, P_b = ends[2 * line : 2 * line + 2]
        drop = lines.resistance[line] * Q
        delays = lines.depth[segments.start : segments.stop] - 1.0
        delays += lines.fraction[segments.start : segments.stop]
        slope = (P_b - P_a + drop * len(segments)) / delays.sum()
        before = 0.0
        for k, segment in enumerate(segments):
            level = P_a - (k + 0.5) * drop
            depth = lines.depth[segment]
            age = np.clip(depth - 0.5 - np.arange(depth), 0.0, delays[k])
            places = (before + age, before + delays[k] - age)
            for wave, sign in ((0, 1.0), (1, -1.0)):
                window = slice(lines.start[segment, wave], lines.start[segment, wave] + depth)
                Z = lines.impedance[line]
                state.samples[window] = level + slope * places[wave] + sign * Z * Q
            before += delays[k]
        K = lines.first_term[line + 1] - lines.first_term[line]
        begin = lines.first_memory[line]
        memory = state.memory[begin : begin + K * (len(segments) + 1)].reshape(len(segments) + 1, K)
        memory[:] = Q
        memory[-1:] = -Q


def _segment_steps(row: LineRow, step: float, coarse: int) -> Vector:
    total = row.delay / step
    blocks = total / (row.segments * coarse)
    if blocks < 1.0 - _A_WHOLE:
        fewer = int(total / coarse)
        longest = format_si(row.delay / (row.segments * coarse), "s", 3)
        cure = f"use a fine step of {longest} or less, or fewer fine steps in a coarse one"
        raise InputError(
            f"line '{row.component}'",
            got=f"segments that a wave crosses in {format_si(row.delay / row.segments, 's')}",
            expected=f"at least one step of {format_si(coarse * step, 's')}",
            hint=f"use {fewer} segments, or {cure}." if fewer else f"{cure}.",
        )
    marks = coarse * np.floor(np.arange(row.segments) * blocks * (1.0 + _A_WHOLE))
    return np.diff(np.append(marks, total))


def _offsets(counts: Ints) -> Ints:
    return np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)


def _concatenate(parts: Sequence[Vector]) -> Vector:
    return np.concatenate([np.zeros(0), *parts])


@inner(error_model="numpy", fastmath=_FAST, _nrt=False, forceinline=True)
def _memory(memory: Any, z: Any, count: int) -> float:
    """Part of the pressure drop of a lump that its memory takes back [Pa]."""
    drop = 0.0
    for k in range(count):
        drop += z[k] * memory[k]
    return drop


@inner(error_model="numpy", fastmath=_FAST, _nrt=False, forceinline=True)
def _rub(memory: Any, decay: Any, heat: Any, count: int, q: float) -> float:
    """Advance the terms of a whole lump under the flow ``q``; returns the heat [J]."""
    total = 0.0
    for k in range(count):
        d = q - memory[k]
        memory[k] = q - decay[k] * d
        total += heat[k] * d * d
    return total


@inner(error_model="numpy", fastmath=_FAST, _nrt=False, forceinline=True)
def _mean_of(window: Any, m: int, f: float) -> tuple[float, float]:
    """Mean of ``m`` interpolated samples, and the sum of squares that this reading takes.

    The sums count from one of the samples, so that small differences keep their digits.
    """
    base = window[1]
    total, spread, jumps = 0.0, 0.0, 0.0
    for i in range(m):
        x = window[i + 1]
        jump = window[i] - x
        y = x - base + f * jump
        total += y
        spread += y * y
        jumps += jump * jump
    mean = total / m
    return base + mean, f * (1.0 - f) * jumps + max(spread - mean * total, 0.0)


@inner(error_model="numpy", _nrt=False, forceinline=True)
def _fill(window: Any, m: int, value: float) -> None:
    for i in range(m):
        window[i] = value


@inner(error_model="numpy", _nrt=False, forceinline=True)
def _move_back(window: Any, by: int, count: int) -> None:
    for i in range(count):
        window[i] = window[i + by]


@inner(error_model="numpy", _nrt=False, forceinline=True)
def _level(lines: Lines, m: int) -> int:
    if m == 1:
        return 0
    return 1 if m == lines.coarse else 2


@njit(error_model="numpy", forceinline=True, _nrt=False)  # two dozen arrays to hand over
def lines_incoming(lines: Lines, state: LineState, m: int, c: Vector, Z: Vector) -> None:
    """Fill ``c[e]`` [Pa] and ``Z[e]`` [Pa s/m^3] of every end for a step of ``m`` fine steps.

    ``m`` is 1, ``lines.near`` or ``lines.coarse``.  Then ``P = c[e] + Z[e] q`` at the node of the
    end, means over the step, with end friction included and ``q`` into the line.  Changes only the
    scratch of ``state``: to repeat a discarded step, call it again.
    """
    level = _level(lines, m)
    z = lines.impedance_of_term[level]
    for line in range(lines.impedance.size):
        s0, s1 = lines.first_segment[line], lines.first_segment[line + 1]
        lost = 0.0
        for s in range(s0, s1):
            f = lines.fraction[s]
            for wave in range(2):
                oldest = lines.start[s, wave] + state.head[s]
                if m == 1:
                    before, x = state.samples[oldest], state.samples[oldest + 1]
                    state.incoming[s, wave] = x + f * (before - x)
                    lost += f * (1.0 - f) * (x - before) ** 2
                else:
                    window = shift(first(state.samples), oldest)
                    mean, spread = _mean_of(window, m, f)
                    state.incoming[s, wave] = mean
                    lost += spread
        impedance = lines.impedance[line]
        state.scatter[line] = lines.step / (4.0 * impedance) * lost
        k0, k1 = lines.first_term[line], lines.first_term[line + 1]
        a, b = 2 * line, 2 * line + 1
        c[a], c[b] = state.incoming[s0, 1], state.incoming[s1 - 1, 0]
        Z[a] = Z[b] = impedance + 0.5 * lines.lump[level, line]
        terms = k1 - k0
        if terms > 0:
            own_z, memory = (
                shift(first(z), k0),
                shift(first(state.memory), lines.first_memory[line]),
            )
            c[a] -= 0.5 * _memory(memory, own_z, terms)
            c[b] -= 0.5 * _memory(shift(memory, (s1 - s0) * terms), own_z, terms)


@njit(error_model="numpy", forceinline=True, _nrt=False)  # two dozen arrays to hand over
def lines_commit(lines: Lines, state: LineState, m: int, q: Vector, books: Matrix) -> None:
    """Finish the step that :func:`lines_incoming` began: send the waves, move on by ``m`` steps.

    Parameters
    ----------
    q (2 n,) [m^3/s]
        Flow into each end, mean over the step.  The work that came in is ``(c + Z q) q m h``.
    books (n, 3) [J]
        Losses of each line since the start, see :data:`LINE_LOSSES`; added to.
    """
    level = _level(lines, m)
    duration = m * lines.step
    decay, heating = lines.decay[level], lines.heat[level]
    z = lines.impedance_of_term[level]
    for line in range(lines.impedance.size):
        s0, s1 = lines.first_segment[line], lines.first_segment[line + 1]
        k0, k1 = lines.first_term[line], lines.first_term[line + 1]
        terms = k1 - k0
        memory = shift(first(state.memory), lines.first_memory[line])
        own_z, own_decay = shift(first(z), k0), shift(first(decay), k0)
        own_heat = shift(first(heating), k0)
        Z, R = lines.impedance[line], lines.resistance[line]
        q_a, q_b = q[2 * line], q[2 * line + 1]
        state.moment[line, 1] += m
        if max(abs(q_a), abs(q_b)) > state.fastest[line]:
            state.fastest[line] = max(abs(q_a), abs(q_b))
            state.moment[line, 0] = state.moment[line, 1]
        heat = 0.5 * duration * R * (q_a * q_a + q_b * q_b)
        if terms > 0:
            last = shift(memory, terms * (s1 - s0))
            heat += 0.5 * _rub(memory, own_decay, own_heat, terms, q_a)
            heat += 0.5 * _rub(last, own_decay, own_heat, terms, q_b)
        out = state.incoming[s0, 1] + 2.0 * Z * q_a
        collapse = 0.0
        for s in range(s0, s1):
            depth, head = lines.depth[s], state.head[s]
            newest = lines.start[s, 0] + head + depth
            _fill(shift(first(state.samples), newest), m, out)
            if s + 1 == s1:
                back = state.incoming[s, 0] + 2.0 * Z * q_b
            else:
                # a lump with a cavity in its middle: Q + dQ flows in from the left, Q - dQ out
                left, right = state.incoming[s, 0], state.incoming[s + 1, 1]
                memory = shift(memory, terms)
                Q = left - right + _memory(memory, own_z, terms)
                Q /= 2.0 * Z + lines.lump[level, line]
                if terms > 0:
                    heat += _rub(memory, own_decay, own_heat, terms, Q)
                heat += duration * R * Q * Q
                free = 0.5 * (left + right)
                V0, dQ = state.cavity[s], 0.0
                if V0 > 0.0 or free < lines.vapour[line]:
                    V1 = max(V0 + 2.0 * (lines.vapour[line] - free) * duration / Z, 0.0)
                    dQ = 0.5 * (V0 - V1) / duration
                    collapse += max(free - Z * dQ - lines.vapour[line], 0.0) * (V0 - V1)
                    state.cavity[s] = V1
                back = left - 2.0 * Z * (Q + dQ)
                out = right + 2.0 * Z * (Q - dQ)
            newest = lines.start[s, 1] + head + depth
            _fill(shift(first(state.samples), newest), m, back)
            state.head[s] = head + m
            if head + m > lines.room[s]:
                for wave in range(2):
                    window = shift(first(state.samples), lines.start[s, wave])
                    _move_back(window, head + m, depth)
                state.head[s] = 0
        books[line, 0] += heat
        books[line, 1] += state.scatter[line]
        books[line, 2] += collapse


@njit(error_model="numpy")
def line_store(lines: Lines, state: LineState, line: int) -> float:
    """Energy [J] held in a line now: waves, memory of the friction, cavities.

    Over any steps, ``work in at both ends = change of this + losses`` to round-off.
    """
    energy = 0.0
    for s in range(lines.first_segment[line], lines.first_segment[line + 1]):
        for wave in range(2):
            energy += _held(lines, state, s, wave, 2) * lines.step / (4.0 * lines.impedance[line])
        energy -= lines.vapour[line] * state.cavity[s]
    k0, k1 = lines.first_term[line], lines.first_term[line + 1]
    segments = lines.first_segment[line + 1] - lines.first_segment[line]
    for lump in range(segments + 1):
        share = 0.5 if lump in (0, segments) else 1.0
        for k in range(k0, k1):
            i = state.memory[lines.first_memory[line] + lump * (k1 - k0) + k - k0]
            energy += share * 0.5 * lines.inductance[k] * i * i
    return energy


@njit(error_model="numpy")
def line_volume(lines: Lines, state: LineState, line: int) -> float:
    """Fluid [m^3] that compression stores in a line now, ``P`` over its stiffness.

    Over any steps, ``inflow at both ends + change of line_cavity = change of this`` to round-off.
    """
    volume = 0.0
    for s in range(lines.first_segment[line], lines.first_segment[line + 1]):
        for wave in range(2):
            volume += _held(lines, state, s, wave, 1) * lines.step / (2.0 * lines.impedance[line])
    return volume


@inner(error_model="numpy")
def line_cavity(lines: Lines, state: LineState, line: int) -> float:
    """Vapour [m^3] in all cavities of a line now."""
    return state.cavity[lines.first_segment[line] : lines.first_segment[line + 1]].sum()


@inner(error_model="numpy")
def _held(lines: Lines, state: LineState, segment: int, wave: int, power: int) -> float:
    """Sum of the samples, or of their squares, still in transit."""
    oldest = lines.start[segment, wave] + state.head[segment]
    total = 0.0
    for i in range(oldest, oldest + lines.depth[segment]):
        share = lines.fraction[segment] if i == oldest else 1.0
        x = state.samples[i]
        total += share * x if power == 1 else share * x * x
    return total
