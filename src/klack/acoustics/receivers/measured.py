r"""Receivers by measured responses, at nodes or at virtual points.

**At a node** the measured directions are the freedoms.  Where only one of two reciprocal responses
was measured it stands for both.

**A virtual point** moves as one rigid body with the channels around it (van der Seijs et al. 2013).
With the direction :math:`e_k` of a channel at :math:`r_k` from the point,

.. math:: u = R q, \quad R_k = (e_k, r_k \times e_k), \quad T = (R^T R)^{-1} R^T, \quad
          Y = T_u Y_{meas} T_f^T, \quad H = H_{meas} T_f^T

with :math:`T_u` of the sensors and :math:`T_f` of the hammer blows.  Lengths scale the rotations.
The *consistency* of a channel, between 0 and 1, compares it with its rigid part
:math:`\tilde u = R T u`,

.. math:: \frac{\sum |u_k + \tilde u_k|^2}{2 \sum (|u_k|^2 + |\tilde u_k|^2)}

over lines and blows; below 0.9 the face is not rigid there, or the channel has another place or
direction.

Between lines of frequency values are linear: reciprocity and passivity hold there too.  Nothing is
extrapolated.
"""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from klack.acoustics.interface import (
    DIRECTIONS,
    Complexes,
    Freedom,
    InterfacePoint,
    Receiver,
    ReceiverResponse,
    freedoms_of,
)
from klack.acoustics.isolator import measured_frequency
from klack.acoustics.receivers.responses import Channel, FrequencyResponses
from klack.acoustics.receivers.sanity import (
    check_places,
    check_reciprocity,
    check_resolution,
    check_taken_power,
)
from klack.arrays import Matrix, Vector
from klack.errors import AccuracyWarning, refuse_if

__all__ = [
    "HeardReceiver",
    "MeasuredReceiver",
    "VirtualPoint",
    "heard_receiver",
    "measured_receiver",
]

_CONSISTENT = 0.9
_RANK = 1e-3  # smallest over largest singular value of R, rotations scaled


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class VirtualPoint:
    """A point that moves with the channels around it.

    Parameters
    ----------
    position (3,) [m]
        In the frame of the measurement.
    nodes
        Whose sensors and blows count.
    freedoms
        Names of those to find: six, or fewer where the channels allow no more.
    positions
        Node -> place (3,) [m]; those of the file without.
    """

    position: Vector
    nodes: Sequence[str | int]
    freedoms: Sequence[str] = DIRECTIONS
    positions: Mapping[str, Vector] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MeasuredReceiver:
    """Mobilities and pressures per force at lines of frequency.

    Parameters
    ----------
    name
        File, for messages.
    points, freedoms, ears
        As of any receiver.
    frequency (k,) [Hz]
    mobility (k, n, n)
    transfers (k, ears, n)
    consistency
        ``flange: 5.z`` -> that of a channel of a virtual point.
    notes
        What was taken from what, one sentence each.
    """

    name: str
    points: tuple[InterfacePoint, ...]
    freedoms: tuple[Freedom, ...]
    ears: tuple[str, ...]
    frequency: Vector
    mobility: Complexes
    transfers: Complexes
    consistency: Mapping[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def at(self, s: Complexes) -> ReceiverResponse:
        """Interpolate between the lines; InputError beside the axis and outside the range."""
        f = measured_frequency(self.name, self.frequency, s)
        mobility, transfers = (
            _between(self.frequency, values, f) for values in (self.mobility, self.transfers)
        )
        return ReceiverResponse(mobility=mobility, transfers=transfers)


def _between(known: Vector, values: Complexes, f: Vector) -> Complexes:
    """Straight lines between measured ones, (k, ...)."""
    place = np.clip(np.searchsorted(known, f) - 1, 0, known.size - 2)
    share = ((f - known[place]) / (known[place + 1] - known[place]))[:, None, None]
    return np.asarray((1.0 - share) * values[place] + share * values[place + 1])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HeardReceiver:
    """Any receiver with pressures per force that were measured apart.

    Parameters
    ----------
    receiver
        Its mobility counts; its own ears, if any, do not.
    name, frequency, transfers
        As of a measured receiver, at the freedoms of ``receiver``.
    """

    receiver: Receiver
    name: str
    ears: tuple[str, ...]
    frequency: Vector
    transfers: Complexes

    @property
    def points(self) -> tuple[InterfacePoint, ...]:
        """Those of the receiver."""
        return self.receiver.points

    @property
    def freedoms(self) -> tuple[Freedom, ...]:
        """Those of the receiver."""
        return self.receiver.freedoms

    def at(self, s: Complexes) -> ReceiverResponse:
        """Mobility of the receiver, pressures between the measured lines."""
        f = measured_frequency(self.name, self.frequency, s)
        return ReceiverResponse(
            mobility=self.receiver.at(s).mobility,
            transfers=_between(self.frequency, self.transfers, f),
        )


def heard_receiver(
    receiver: Receiver,
    pressures: FrequencyResponses,
    ears: Mapping[str, str | int],
    *,
    nodes: Mapping[str, str | int] | None = None,
) -> HeardReceiver:
    """Give a receiver ears from a file of pressures per force.

    Parameters
    ----------
    receiver
        A model, or one that was measured.
    pressures
        With a force at every freedom of the receiver.
    ears
        Name -> node of a pressure.
    nodes
        Point of the receiver -> node of the force; that of its name without.
    """
    named = nodes or {}
    rows = []
    for freedom in receiver.freedoms:
        node = str(named.get(freedom.point, freedom.point))
        blow = Channel(node, abs(freedom.direction)), freedom.sign
        rows.append(_Row(freedom=freedom, outputs=None, sources=None, blows=(blow,)))
    return HeardReceiver(
        receiver=receiver,
        name=pressures.name,
        ears=tuple(ears),
        frequency=pressures.frequency,
        transfers=_transfers(pressures, _again(pressures, rows), ears),
    )


def measured_receiver(
    responses: FrequencyResponses,
    points: Mapping[str, str | int | VirtualPoint],
    *,
    ears: Mapping[str, str | int] | None = None,
    axes: Mapping[str, Matrix] | None = None,
    pressures: FrequencyResponses | None = None,
    indicators: Mapping[str, str | int] | None = None,
) -> MeasuredReceiver:
    """Choose the points and ears of a receiver from measured responses, and check them.

    Parameters
    ----------
    responses
        Of a file.
    points
        Name -> node, or a virtual point.
    ears
        Name -> node of a pressure.
    axes
        Name of a point at a node -> rows x, y, z of its directions in the frame of the
        measurement; those of the frame without.
    pressures
        Pressures per force of another file, on the same points.
    indicators
        Name -> node whose motion under forces at the points is known; what it does under forces
        of its own is not used, and 0.

    Raises
    ------
    InputError
        For nodes that are not there, responses that are missing in either direction, and values
        that cannot be mobilities.

    Warns
    -----
    AccuracyWarning
        For what is doubtful: see :mod:`klack.acoustics.receivers.sanity`.
    """
    name = responses.name
    rows: list[_Row] = []
    consistency: dict[str, float] = {}
    found: list[InterfacePoint] = []
    turned = axes or {}
    for point, where in points.items():
        if isinstance(where, VirtualPoint):
            rows += _virtual(responses, point, where, consistency)
            found.append(InterfacePoint(name=point, position=np.asarray(where.position, float)))
        else:
            rows += _node(responses, point, str(where))
            place = responses.positions.get(str(where), np.zeros(3))
            found.append(
                InterfacePoint(name=point, position=place, axes=turned.get(point, np.eye(3)))
            )
    freedoms = tuple(row.freedom for row in rows)
    Y, measured = _mobility(responses, rows)
    if responses.positions:
        check_places(name, np.array(list(responses.positions.values())))
    check_taken_power(name, responses.frequency, freedoms, Y)
    check_reciprocity(name, freedoms, Y, measured)
    check_resolution(name, responses.frequency, Y)
    heard = responses if pressures is None else pressures
    H = _transfers(heard, rows if heard is responses else _again(heard, rows), ears or {})
    seen = [row for key, node in (indicators or {}).items() for row in _seen(responses, key, node)]
    if seen:
        n, k = len(rows), len(seen)
        moved = np.empty((Y.shape[0], k, n), dtype=complex)
        for i, one in enumerate(seen):
            for j, row in enumerate(rows):
                moved[:, i, j] = _summed(responses.values, one.outputs, row.sources)
        whole = np.zeros((Y.shape[0], n + k, n + k), dtype=complex)
        whole[:, :n, :n], whole[:, n:, :n], whole[:, :n, n:] = Y, moved, moved.transpose(0, 2, 1)
        Y, H = whole, np.concatenate([H, np.zeros((*H.shape[:2], k))], axis=2)
        freedoms += tuple(row.freedom for row in seen)
        found += [InterfacePoint(name=key) for key in indicators or {}]
    receiver = MeasuredReceiver(
        name=name,
        points=tuple(found),
        freedoms=freedoms,
        ears=tuple(ears or {}),
        frequency=responses.frequency,
        mobility=Y,
        transfers=H,
        consistency=consistency,
        notes=responses.notes + _reciprocal_notes(name, freedoms, measured),
    )
    return receiver if heard is responses else _on_one_grid(receiver, heard)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Row:
    """A freedom as a sum over measured channels; None where no channel of that side has it."""

    freedom: Freedom
    outputs: Mapping[int, float] | None
    sources: Mapping[int, float] | None
    blows: tuple[tuple[Channel, float], ...] = ()


def _node(responses: FrequencyResponses, point: str, node: str) -> list[_Row]:
    known = {channel.node for channel in responses.outputs + responses.sources if channel.direction}
    refuse_if(
        node not in known,
        f"{responses.name}: point '{point}'",
        got=f"the node '{node}'",
        expected=f"one of: {', '.join(sorted(known)[:20]) or '(none)'}",
        hint="name a node at which a force and its motion were measured.",
    )
    rows = []
    for direction in range(1, 7):
        channel = Channel(node, direction)
        sides = [
            {channels.index(channel): 1.0} if channel in channels else None
            for channels in (responses.outputs, responses.sources)
        ]
        own = (next(iter(side), None) if side else None for side in sides)
        if responses.between(*own) is None:
            continue  # without its driving point it cannot couple
        rows.append(
            _Row(
                freedom=Freedom(point, direction),
                outputs=sides[0],
                sources=sides[1],
                blows=((channel, 1.0),),
            )
        )
    refuse_if(
        not rows,
        f"{responses.name}: point '{point}'",
        got=f"no driving-point response at node '{node}'",
        expected="motion and force at one node in one direction",
        hint="strike the interface where its motion is measured; 'listing' shows what was read.",
    )
    return rows


def _seen(responses: FrequencyResponses, name: str, node: str | int) -> list[_Row]:
    """Directions in which a node is seen to move under every force."""
    rows = [
        _Row(freedom=Freedom(name, channel.direction), outputs={i: 1.0}, sources=None)
        for i, channel in enumerate(responses.outputs)
        if channel.node == str(node)
        and channel.direction
        and not np.any(np.isnan(responses.values[0, i]))
    ]
    refuse_if(
        not rows,
        f"{responses.name}: indicator '{name}'",
        got=f"no motion of node '{node}' under every force of the file",
        expected="a sensor that was measured under all hammer blows at the mounts",
        hint="name a node of the file, or leave the indicator out.",
    )
    return rows


def _virtual(
    responses: FrequencyResponses,
    point: str,
    where: VirtualPoint,
    consistency: dict[str, float],
) -> list[_Row]:
    nodes = {str(node) for node in where.nodes}
    places = {**responses.positions, **{str(k): v for k, v in where.positions.items()}}
    missing = sorted(nodes - set(places))
    refuse_if(
        missing,
        f"{responses.name}: virtual point '{point}'",
        got=f"no position of node {', '.join(missing[:6])}",
        expected="coordinates of every node around it",
        hint="export the nodes (set 15 or 2411), or give positions.",
    )
    freedoms = freedoms_of(point, where.freedoms)
    sides = []
    for kind, channels in (("sensors", responses.outputs), ("blows", responses.sources)):
        chosen = [i for i, c in enumerate(channels) if c.direction and c.node in nodes]
        arms = [np.asarray(places[channels[i].node], float) - where.position for i in chosen]
        R = _rigid([channels[i] for i in chosen], arms, freedoms)
        T = _inverse(f"{responses.name}: {kind} of virtual point '{point}'", R, arms, freedoms)
        sides.append((chosen, R, T))
    (outputs, R, T), (sources, _, T_f) = sides
    block = responses.values[:, outputs][:, :, sources]
    refuse_if(
        bool(np.any(np.isnan(block))),
        f"{responses.name}: virtual point '{point}'",
        got="sensors that were not measured under all of its blows",
        expected="a response of every sensor to every blow around the point",
        hint="leave out the nodes that have only some.",
    )
    names = [f"{point}: {responses.outputs[i]}" for i in outputs]
    consistency |= dict(zip(names, _consistency(R @ T, block).tolist(), strict=True))
    _doubt(responses.name, point, {name: consistency[name] for name in names})
    return [
        _Row(
            freedom=freedom,
            outputs=dict(zip(outputs, T[i].tolist(), strict=True)),
            sources=dict(zip(sources, T_f[i].tolist(), strict=True)),
            blows=tuple((responses.sources[j], float(T_f[i, n])) for n, j in enumerate(sources)),
        )
        for i, freedom in enumerate(freedoms)
    ]


def _rigid(channels: list[Channel], arms: list[Vector], freedoms: tuple[Freedom, ...]) -> Matrix:
    """Motion of each channel for unit motions of the freedoms, (channels, freedoms)."""
    rows = []
    for channel, arm in zip(channels, arms, strict=True):
        axis = np.eye(3)[(channel.direction - 1) % 3]
        turned = channel.direction > 3
        six = np.concatenate([np.zeros(3), axis] if turned else [axis, np.cross(arm, axis)])
        rows.append([freedom.sign * six[freedom.index] for freedom in freedoms])
    return np.array(rows).reshape(len(rows), len(freedoms))


def _inverse(where: str, R: Matrix, arms: list[Vector], freedoms: tuple[Freedom, ...]) -> Matrix:
    """``(R^T R)^-1 R^T``, with rotations scaled by the mean distance of the channels."""
    length = float(np.sqrt(np.mean([arm @ arm for arm in arms]))) if arms else 0.0
    scale = np.array([1.0 / length if f.is_rotation and length > 0.0 else 1.0 for f in freedoms])
    count = R.shape[0]
    _, size, V = np.linalg.svd(R * scale, full_matrices=True)
    size = np.concatenate([size, np.zeros(len(freedoms) - size.size)])
    lost = [
        str(freedoms[int(np.argmax(np.abs(V[i])))]) for i in np.flatnonzero(size <= _RANK * size[0])
    ]
    refuse_if(
        count < len(freedoms) or lost,
        where,
        got=f"{count} channels that do not determine "
        f"{', '.join(dict.fromkeys(lost)) or 'them all'}",
        expected=f"at least {len(freedoms)} independent ones, better 9 (rank {len(freedoms)})",
        hint="spread them over three places that are not in one line and over three directions, "
        "or request fewer degrees of freedom.",
    )
    return np.asarray(scale[:, None] * np.linalg.pinv(R * scale))


def _consistency(rigid: Matrix, block: Complexes) -> Vector:
    """Of each sensor over lines and blows, shape (sensors,)."""
    filtered = rigid @ block
    both = np.sum(np.abs(block + filtered) ** 2, axis=(0, 2))
    each = np.sum(np.abs(block) ** 2 + np.abs(filtered) ** 2, axis=(0, 2))
    return np.asarray(both / np.maximum(2.0 * each, np.finfo(float).tiny))


def _doubt(name: str, point: str, consistency: Mapping[str, float]) -> None:
    worst = min(consistency, key=lambda channel: consistency[channel])
    if consistency[worst] < _CONSISTENT:
        warnings.warn(
            f"{name}: around the virtual point '{point}' the channel {worst.split(': ')[1]} "
            f"moves with a consistency of {consistency[worst]:.2f} (below {_CONSISTENT:g}): the "
            "face is not rigid there, or the position, direction or sign of the channel is "
            "wrong.",
            AccuracyWarning,
            stacklevel=4,
        )


def _mobility(responses: FrequencyResponses, rows: list[_Row]) -> tuple[Complexes, np.ndarray]:
    """Mobility (k, n, n), and where it was measured and not taken from its reciprocal (n, n)."""
    n = len(rows)
    Y = np.full((responses.frequency.size, n, n), np.nan, dtype=complex)
    for i, out in enumerate(rows):
        for j, force in enumerate(rows):
            Y[:, i, j] = _summed(responses.values, out.outputs, force.sources)
    measured = ~np.isnan(Y[0])
    Y = np.where(measured, Y, Y.transpose(0, 2, 1))
    lost = [
        f"{rows[i].freedom} / {rows[j].freedom}" for i, j in np.argwhere(np.isnan(Y[0])) if i > j
    ]
    refuse_if(
        lost,
        responses.name,
        got=f"no response {', '.join(lost[:6])}{', ...' if len(lost) > 6 else ''} and not "
        "its reciprocal either",
        expected="the responses between all freedoms of the interface",
        hint="measure the transfers between the mounts as well: on a plate they are as large "
        "as the driving-point responses.",
    )
    return Y, measured


def _summed(
    values: Complexes, outputs: Mapping[int, float] | None, sources: Mapping[int, float] | None
) -> Complexes | float:
    """Weighted sum of responses; not a number where one is missing."""
    if outputs is None or sources is None:
        return np.nan
    rows, columns = list(outputs), list(sources)
    block = values[:, rows][:, :, columns]
    return np.asarray(
        np.einsum(
            "i,kij,j->k", np.array(list(outputs.values())), block, np.array(list(sources.values()))
        )
    )


def _transfers(
    responses: FrequencyResponses, rows: Sequence[_Row], ears: Mapping[str, str | int]
) -> Complexes:
    """Pressure per force (k, ears, n)."""
    H = np.zeros((responses.frequency.size, len(ears), len(rows)), dtype=complex)
    known = [c.node for c in responses.outputs if not c.direction]
    for e, (ear, node) in enumerate(ears.items()):
        refuse_if(
            str(node) not in known,
            f"{responses.name}: ear '{ear}'",
            got=f"the node '{node}'",
            expected=f"one of: {', '.join(known[:20]) or '(no pressures in this file)'}",
            hint="a pressure per force has the response direction 0 (scalar).",
        )
        place = responses.outputs.index(Channel(str(node), 0))
        for j, row in enumerate(rows):
            values = _summed(responses.values, {place: 1.0}, row.sources)
            refuse_if(
                bool(np.any(np.isnan(values))),
                f"{responses.name}: ear '{ear}'",
                got=f"no pressure per force at {row.freedom}",
                expected="the pressure per force on every degree of freedom of the interface",
                hint="strike there while the microphone records, or leave out the degree of "
                "freedom.",
            )
            H[:, e, j] = values
    return H


def _again(heard: FrequencyResponses, rows: Sequence[_Row]) -> list[_Row]:
    """The same freedoms as sums over the blows of another file."""
    again = []
    for row in rows:
        known = all(channel in heard.sources for channel, _ in row.blows)
        sources = {heard.sources.index(c): w for c, w in row.blows} if known else None
        again.append(_Row(freedom=row.freedom, outputs=None, sources=sources))
    return again


def _on_one_grid(receiver: MeasuredReceiver, heard: FrequencyResponses) -> MeasuredReceiver:
    """Pressures of another file on the lines of the mobilities, within the range of both."""
    known = receiver.frequency
    inside = (known >= heard.frequency[0]) & (known <= heard.frequency[-1])
    refuse_if(
        int(inside.sum()) < 2,
        heard.name,
        got=f"pressures from {heard.frequency[0]:.4g} to {heard.frequency[-1]:.4g} Hz",
        expected=f"some of {known[0]:.4g} to {known[-1]:.4g} Hz, as the mobilities",
        hint="measure both over one range.",
    )
    f = known[inside]
    transfers = _between(heard.frequency, receiver.transfers, f)
    note = (
        f"{heard.name}: pressures interpolated on the {f.size} lines of {receiver.name} in both "
        "ranges."
    )
    return MeasuredReceiver(
        name=receiver.name,
        points=receiver.points,
        freedoms=receiver.freedoms,
        ears=receiver.ears,
        frequency=f,
        mobility=receiver.mobility[inside],
        transfers=transfers,
        consistency=receiver.consistency,
        notes=(*receiver.notes, note),
    )


def _reciprocal_notes(
    name: str, freedoms: tuple[Freedom, ...], measured: np.ndarray
) -> tuple[str, ...]:
    """Which responses stand for their reciprocal ones."""
    taken = [f"{freedoms[i]} / {freedoms[j]}" for i, j in np.argwhere(~measured)]
    if not taken:
        return ()
    return (f"{name}: taken from the reciprocal response: {', '.join(taken)}.",)
