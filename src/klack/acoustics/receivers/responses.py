r"""Measured frequency responses, as mobilities and pressures per force on one grid of frequencies.

A response is the quantity of one channel per force of another,

.. math:: Y = \frac{v}{F} = i\omega \frac{u}{F} = \frac{1}{i\omega} \frac{a}{F}, \qquad
          H = \frac{p}{F}

A reversed direction turns the sign.  Lines at 0 Hz are left out.  Where responses have other lines
of frequency they are interpolated between their own, within the range that all of them have.
"""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from klack.acoustics.interface import DIRECTIONS, Complexes
from klack.arrays import Vector
from klack.errors import InputError, refuse_if
from klack.measurement.channels import Role
from klack.measurement.unit_text import no_unit, plain_unit, unit_factor

__all__ = [
    "Channel",
    "FrequencyResponses",
    "Response",
    "channel_of",
    "gathered",
    "quantity_of_unit",
    "response",
]


@dataclass(frozen=True, slots=True)
class Channel:
    """A node and a direction: 1 to 6 as of a freedom, 0 for a pressure."""

    node: str
    direction: int

    def __str__(self) -> str:
        """``101.z``; the node alone for a pressure."""
        return f"{self.node}.{DIRECTIONS[self.direction - 1]}" if self.direction else self.node


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Response:
    """One response in SI.

    Parameters
    ----------
    output, source
        Where the motion or pressure is, and the force.
    frequency (k,) [Hz]
        Above 0, rising.
    values (k,)
        Mobility, or pressure per force.
    quantity
        What the file had, for people: ``acceleration [m/s^2] per force``.
    """

    output: Channel
    source: Channel
    frequency: Vector
    values: Complexes
    quantity: str


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrequencyResponses:
    """All responses of a file on one grid.

    Parameters
    ----------
    name
        File, for messages.
    frequency (k,) [Hz]
    outputs, sources
        Channels of the rows and columns.
    values (k, outputs, sources)
        Not a number where a pair was not measured.
    positions
        Node -> coordinates (3,) [m], where the file has them.
    listing
        What was read, one line for each response.
    notes
        What was done to the lines of frequency.
    """

    name: str
    frequency: Vector
    outputs: tuple[Channel, ...]
    sources: tuple[Channel, ...]
    values: Complexes
    positions: Mapping[str, Vector] = field(default_factory=dict)
    listing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def between(self, output: int | None, source: int | None) -> Complexes | None:
        """One response (k,), or none where it was not measured."""
        if output is None or source is None:
            return None
        values = self.values[:, output, source]
        return None if np.any(np.isnan(values)) else values


_PER_TIME = {"displacement": 1, "velocity": 0, "acceleration": -1, "pressure": 0}
"""Factor ``(i omega)^n`` that makes a mobility of a quantity per force."""
_ROLES: Mapping[str, Role] = {
    "displacement": "lift",
    "velocity": "velocity",
    "acceleration": "acceleration",
    "pressure": "pressure",
}
_ANGLES = {"rad": "displacement", "rad/s": "velocity", "rad/s^2": "acceleration"}
_ANGLES |= {"1": "displacement", "1/s": "velocity", "1/s^2": "acceleration"}
_FORCES = {"N": 1.0, "mN": 1e-3, "kN": 1e3, "lbf": 4.4482216152605}
_PER_FORCE = re.compile(r"(?P<of>.+?)\s*/\s*\(?\s*(?P<force>m?N|kN|lbf)\s*\*?\s*(?P<arm>m?)\s*\)?")
_PER_FORCE_SECOND = re.compile(r"(?P<of>m|mm|um|1)\s*/\s*\(\s*(?P<force>m?N|kN)\s*\*?\s*s\s*\)")
_NAMED = re.compile(
    r"(?P<node>.+?)\s*[.:\s]\s*(?P<before>[+-]?)(?P<direction>r?[xyz])(?P<after>[+-]?)",
    re.IGNORECASE,
)


def channel_of(text: str) -> tuple[Channel, float]:
    """Channel and its sign from a name: ``101.z``, ``front.-x``, ``7:rx``, or a node alone.

    >>> channel_of("front.-x"), channel_of("left ear")
    ((Channel(node='front', direction=1), -1.0), (Channel(node='left ear', direction=0), 1.0))
    """
    match = _NAMED.fullmatch(text.strip())
    if match is None:
        return Channel(text.strip(), 0), 1.0
    sign = -1.0 if "-" in (match["before"], match["after"]) else 1.0
    return Channel(match["node"], DIRECTIONS.index(match["direction"].lower()) + 1), sign


def quantity_of_unit(text: str, where: str) -> tuple[str, float]:
    """Quantity and factor to SI of a unit such as ``m/s/N``, ``g/N``, ``Pa/N``, ``rad/s/(N m)``.

    >>> quantity_of_unit("mm/s/N", "file"), quantity_of_unit("m/(N s)", "file")
    (('velocity', 0.001), ('velocity', 1.0))
    """
    unit = plain_unit(text)
    found = _PER_FORCE_SECOND.fullmatch(unit)
    if found is not None:
        top = f"{found['of']}/s"
        force, arm = found["force"], ""
    else:
        found = _PER_FORCE.fullmatch(unit)
        if found is None:
            raise _unknown_unit(text, where)
        top, force, arm = found["of"].strip("() "), found["force"], found["arm"]
        if force == "mN" and arm:
            raise _unknown_unit(text, where)
    if top in _ANGLES:
        return _ANGLES[top], 1.0 / _FORCES[force]
    for quantity, role in _ROLES.items():
        try:
            factor = unit_factor(top, role, where).factor
        except InputError:
            continue
        return quantity, factor / _FORCES[force]
    raise _unknown_unit(text, where)


def _unknown_unit(text: str, where: str) -> InputError:
    return InputError(
        where,
        got="no unit" if no_unit(text) else f"the unit '{text[:40]}'",
        expected="a motion or pressure per force: m/s/N, m/s^2/N, g/N, m/N, Pa/N, rad/s/(N m)",
        hint="state the quantity in the file: accelerance and receptance look like mobility.",
    )


def response(
    where: str,
    channels: tuple[tuple[Channel, float], tuple[Channel, float]],
    quantity: str,
    frequency: Vector,
    values: Complexes,
) -> Response:
    """Make a response of what a file has, in SI but for the quantity and the signs.

    Parameters
    ----------
    where
        File and place, for messages.
    channels
        Output and source, each with the sign of its direction.
    quantity
        ``displacement``, ``velocity``, ``acceleration`` or ``pressure``, in SI.
    frequency, values (k,)
    """
    (output, sign), (source, other) = channels
    refuse_if(
        source.direction == 0,
        where,
        got=f"a force at '{source}' without a direction",
        expected="x, y, z, rx, ry or rz after the name of a node",
        hint="write front.z for the force at 'front' along z.",
    )
    refuse_if(
        (quantity == "pressure") != (output.direction == 0),
        where,
        got=f"a {quantity} at '{output}'",
        expected="a motion with a direction, or a pressure without one",
        hint="check the direction of the channel and the quantity.",
    )
    frequency, values = np.asarray(frequency, dtype=float), np.asarray(values, dtype=complex)
    moving = frequency > 0.0
    frequency, values = frequency[moving], values[moving]
    finite = np.all(np.isfinite(frequency)) and np.all(np.isfinite(values))
    refuse_if(
        frequency.size < 2 or not finite or not np.all(np.diff(frequency) > 0.0),
        where,
        got=f"{frequency.size} lines above 0 Hz, or lines that do not rise or are not finite",
        expected="at least two rising frequencies and a finite value at each",
        hint="the file is damaged, or was not exported over frequency.",
    )
    power = _PER_TIME[quantity]
    values = sign * other * values * (2j * np.pi * frequency) ** power
    return Response(
        output=output,
        source=source,
        frequency=frequency,
        values=values,
        quantity=f"{quantity} per {'moment' if source.direction > 3 else 'force'}",
    )


def gathered(
    name: str, found: Sequence[Response], positions: Mapping[str, Vector] | None = None
) -> FrequencyResponses:
    """Put responses into one matrix on one grid.

    Raises
    ------
    InputError
        If there is none, if one pair is defined twice, or if no range of frequency is common.
    """
    refuse_if(
        not found,
        name,
        got="no frequency response",
        expected="motions or pressures per force over frequency",
        hint="export frequency response functions (of functional type 4 in universal files).",
    )
    outputs = tuple(dict.fromkeys(each.output for each in found))
    sources = tuple(dict.fromkeys(each.source for each in found))
    frequency, notes = _common_grid(name, found)
    values = np.full((frequency.size, len(outputs), len(sources)), np.nan, dtype=complex)
    for each in found:
        place = outputs.index(each.output), sources.index(each.source)
        refuse_if(
            not np.isnan(values[0, place[0], place[1]]),
            f"{name}: {each.output} / {each.source}",
            got="two responses of this pair",
            expected="one",
            hint="export one set of measurements at a time.",
        )
        values[:, place[0], place[1]] = np.interp(frequency, each.frequency, each.values)
    listing = tuple(
        f"{each.output} / {each.source}: {each.quantity}, {each.frequency.size} lines from "
        f"{each.frequency[0]:.4g} to {each.frequency[-1]:.4g} Hz"
        for each in found
    )
    return FrequencyResponses(
        name=name,
        frequency=frequency,
        outputs=outputs,
        sources=sources,
        values=values,
        positions=positions or {},
        listing=listing,
        notes=notes,
    )


def _common_grid(name: str, found: Iterable[Response]) -> tuple[Vector, tuple[str, ...]]:
    """Lines of the coarsest response within the range of all."""
    grids = [each.frequency for each in found]
    first = grids[0]
    if all(g.shape == first.shape and np.allclose(g, first, rtol=1e-6, atol=0.0) for g in grids):
        return first, ()
    low, high = max(g[0] for g in grids), min(g[-1] for g in grids)
    inside = [g[(g >= low * (1 - 1e-9)) & (g <= high * (1 + 1e-9))] for g in grids]
    coarse = min(inside, key=len)
    refuse_if(
        len(coarse) < 2,
        name,
        got="responses without a common frequency range",
        expected="at least two lines that all of them span",
        hint="export all responses over one range.",
    )
    note = (
        f"{name}: responses have different frequency lines; interpolated on the {len(coarse)} "
        f"lines from {low:.4g} to {high:.4g} Hz of the coarsest, linear between lines."
    )
    return np.clip(coarse, low, high), (note,)
