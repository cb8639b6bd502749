"""Mode shapes of a universal file: datasets 55, with units (164) and frequency responses (58).

Dataset 55 holds one mode: five lines of text, one of kinds, one of whole numbers, one of
frequency, modal mass and damping, then two for each node (number; displacements). Numbers have
five decimals, so shapes are known to about 1e-5.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from klack.arrays import Complexes, Floats
from klack.errors import InputError, refuse_if

__all__ = ["FileModalData", "read_uff_modes"]


def uff_refusal(path: Path, line: int, got: str, expected: str) -> InputError:
    """Error at a line."""
    return InputError(
        f"{path}, line {line}",
        got=got,
        expected=expected,
        hint="the file is truncated or damaged; export it again.",
    )


def uff_datasets(path: Path, lines: list[str]) -> Iterator[tuple[str, int, int]]:
    """Kind, first line (from 0) and end of every dataset."""
    i = 0
    while i < len(lines):
        if lines[i].strip() != "-1":
            i += 1
            continue
        if i + 1 >= len(lines):
            raise uff_refusal(path, i + 1, "the start of a dataset at the end", "its number")
        words = lines[i + 1].split()
        kind = words[0].lower() if words else ""
        end = i + 2
        while end < len(lines) and lines[end].strip() != "-1":
            end += 1
        if end == len(lines):
            raise uff_refusal(path, len(lines), f"dataset {kind} without an end", "-1")
        yield kind, i + 2, end
        i = end + 1


def uff_numbers(
    path: Path, lines: list[str], at: int, end: int, count: int, *, width: int = 13
) -> list[float]:
    """Numbers from line ``at`` on, over several lines if necessary."""
    values: list[float] = []
    while len(values) < count:
        if at >= end:
            raise uff_refusal(path, at, "the end of a dataset", f"{count} numbers")
        line = lines[at].replace("D", "E").replace("d", "e")
        words = line.split()
        try:
            values += [float(word) for word in words]
        except ValueError:
            values += _fixed(path, at, line, width)
        if not words:
            raise uff_refusal(path, at + 1, "an empty line", "numbers")
        at += 1
    if not np.all(np.isfinite(values)):
        raise uff_refusal(path, at, "a number that is not finite", "finite numbers")
    return values


def _fixed(path: Path, at: int, line: str, width: int) -> list[float]:
    """Adjacent fields of fixed width."""
    try:
        return [float(line[k : k + width]) for k in range(0, len(line.rstrip()), width)]
    except ValueError:
        raise uff_refusal(path, at + 1, f"'{line.strip()[:60]}'", "numbers") from None


def uff_whole(path: Path, lines: list[str], at: int, end: int, count: int) -> list[int]:
    """Whole numbers from a line on."""
    values = uff_numbers(path, lines, at, end, count)
    if any(value != round(value) or abs(value) > 1e9 for value in values):
        raise uff_refusal(path, at + 1, f"'{lines[at].strip()[:60]}'", f"{count} whole numbers")
    return [int(value) for value in values]


DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")

_FREQUENCY_RESPONSE, _FREQUENCY, _FORCE = 4, 18, 13
_DERIVATIVES = {8: 0, 11: 1, 12: 2}  # displacement, velocity, acceleration
_COMPLEX_SINGLE, _COMPLEX_DOUBLE = 5, 6
_WIDTH = {_COMPLEX_SINGLE: 13, _COMPLEX_DOUBLE: 20}


@dataclass(frozen=True, kw_only=True, eq=False)
class Receptance:
    """Displacement of one place per force at another, in the units of the file.

    Parameters
    ----------
    response, reference
        Node and direction, as ``"17 z"``; the sign of a negative direction is applied already.
    frequency (n,) [Hz]
        Above 0.
    """

    response: str
    reference: str
    frequency: Floats
    values: Complexes


def read_response(path: Path, lines: list[str], first: int, end: int) -> Receptance | None:
    """Read one dataset 58; None for what is no response of a motion to a force."""
    if end - first < 12:
        raise uff_refusal(path, first, "a short dataset 58", "eleven lines and values")
    kind = lines[first + 5][:5].strip()
    if kind != str(_FREQUENCY_RESPONSE):
        return None
    response = _place(path, first + 6, lines[first + 5][41:55])
    reference = _place(path, first + 6, lines[first + 5][66:80])
    number_type, count, even = uff_whole(path, [lines[first + 6][:30]], 0, 1, 3)
    start, step = uff_numbers(path, [lines[first + 6][30:]], 0, 1, 2)[:2]
    kinds = [uff_whole(path, [lines[first + i][:10]], 0, 1, 1)[0] for i in (7, 8, 9)]
    if kinds[0] != _FREQUENCY or kinds[2] != _FORCE or kinds[1] not in _DERIVATIVES:
        return None
    if number_type not in _WIDTH:
        raise uff_refusal(path, first + 7, f"values of type {number_type}", "complex values")
    own = 2 if even else 3
    if not 0 < count * own <= 20 * sum(len(line) for line in lines[first + 11 : end]):
        raise uff_refusal(path, first + 7, f"{count} values", "as many as there are lines")
    width = _WIDTH[number_type]
    flat = np.array(uff_numbers(path, lines, first + 11, end, count * own, width=width))
    if len(flat) != count * own:
        raise uff_refusal(path, end, f"{len(flat)} numbers", f"{count * own}")
    table = flat.reshape(count, own)
    frequency = np.asarray(start + step * np.arange(count) if even else table[:, 0], np.float64)
    values = table[:, -2] + 1j * table[:, -1]
    moving = frequency > 0
    frequency, values = frequency[moving], values[moving]
    values = values / (2j * np.pi * frequency) ** _DERIVATIVES[kinds[1]]
    sign = response[1] * reference[1]
    return Receptance(
        response=response[0], reference=reference[0], frequency=frequency, values=sign * values
    )


def _place(path: Path, line: int, text: str) -> tuple[str, int]:
    """Node with direction, and the sign of the direction."""
    try:
        node, direction = int(text[:10]), int(text[10:14])
    except ValueError:
        raise uff_refusal(path, line, f"the place '{text.strip()}'", "node, direction") from None
    if not 1 <= abs(direction) <= 6:
        raise uff_refusal(path, line, f"direction {direction}", "1 to 6 or -1 to -6")
    return f"{node} {DIRECTIONS[abs(direction) - 1]}", 1 if direction > 0 else -1


_LARGEST = 256 << 20  # bytes
_NORMAL_MODE, _COMPLEX_MODE = 2, 3
_DISPLACEMENT = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class FileModalData:
    """Modes of a file; frequencies in Hz, all else in the units of the file.

    Parameters
    ----------
    frequency (m,) [Hz]
    damping (m,) [-]
        None where the file gives none.
    modal_mass (m,)
        1 for mass-normalised shapes.
    shapes (m, n)
    labels
        Of the columns of ``shapes``: names, or ``"17 z"`` for node and direction (``by_node``).
    residual (n, n)
        Residual compliance between the columns.
    length, force [m], [N]
        Units that the file itself claims.
    responses
        Between nodes; they show what the modes miss.
    """

    path: Path
    frequency: Floats
    damping: Floats | None
    modal_mass: Floats
    shapes: Floats
    labels: tuple[str, ...]
    residual: Floats | None = None
    by_node: bool = False
    length: float | None = None
    force: float | None = None
    responses: tuple[Receptance, ...] = ()


@dataclass(frozen=True)
class _Mode:
    line: int
    frequency: float
    mass: float
    damping: float
    nodes: tuple[int, ...]
    shapes: Floats


def read_uff_modes(path: Path) -> FileModalData:
    """Read all normal modes.

    Rejects complex modes and a file without dataset 55: frequency responses (dataset 58) need a
    modal analysis first.
    """
    refuse_if(
        path.stat().st_size > _LARGEST,
        str(path),
        got="more than 256 MB",
        expected="a file of modes",
        hint="export fewer nodes",
    )
    lines = path.read_bytes().decode("latin-1").splitlines()
    modes: list[_Mode] = []
    responses: list[Receptance] = []
    units: tuple[float, float] | None = None
    kinds: list[str] = []
    for kind, first, last in uff_datasets(path, lines):
        kinds.append(kind)
        if kind == "55":
            modes.append(_mode(path, lines, first, last))
        elif kind == "58":
            response = read_response(path, lines, first, last)
            responses += [response] if response is not None else []
        elif kind == "164":
            units = _units(path, lines, first, last)
    refuse_if(
        not modes,
        str(path),
        got=f"datasets {', '.join(dict.fromkeys(kinds)) or '(none)'}",
        expected="mode shapes (dataset 55)",
        hint="frequency responses (dataset 58) are not modes; run the modal analysis "
        "first and export its mass-normalised shapes.",
    )
    if len({mode.nodes for mode in modes}) > 1 or len({m.shapes.shape for m in modes}) > 1:
        odd = next(mode for mode in modes if mode.nodes != modes[0].nodes or mode is modes[-1])
        raise uff_refusal(
            path, odd.line, "a mode with different nodes from the first", "the same nodes"
        )
    width = modes[0].shapes.shape[1]
    return FileModalData(
        path=path,
        by_node=True,
        frequency=np.array([mode.frequency for mode in modes]),
        damping=np.array([mode.damping for mode in modes]),
        modal_mass=np.array([mode.mass for mode in modes]),
        shapes=np.array([mode.shapes.ravel() for mode in modes]),
        labels=tuple(f"{n} {DIRECTIONS[d]}" for n in modes[0].nodes for d in range(width)),
        length=units[0] if units else None,
        force=units[1] if units else None,
        responses=tuple(responses),
    )


def _mode(path: Path, lines: list[str], first: int, end: int) -> _Mode:
    if end - first < 8:
        raise uff_refusal(path, first, "a short dataset 55", "a mode with its nodes")
    head = uff_whole(path, lines, first + 5, end, 6)
    _, analysis, _, quantity, number_type, width = head[:6]
    refuse_if(
        analysis == _COMPLEX_MODE or number_type == 5,
        f"{path}, line {first + 6}",
        got="a complex mode",
        expected="real normal modes (analysis type 2, real data)",
        hint="export normal modes; damping is a ratio given with the shape.",
    )
    if analysis != _NORMAL_MODE or quantity not in (0, _DISPLACEMENT) or not 1 <= width <= 6:
        raise uff_refusal(
            path,
            first + 6,
            f"analysis type {analysis}, quantity {quantity}, {width} values per node",
            "normal modes (2) of displacements (8), 1 to 6 values per node",
        )
    about = uff_whole(path, lines, first + 6, end, 2)
    reals = uff_numbers(path, lines, first + 7, end, max(2, min(about[1], 6)))
    nodes, shapes = [], []
    at = first + 8
    while at < end:
        nodes.append(uff_whole(path, lines, at, end, 1)[0])
        values = uff_numbers(path, lines, at + 1, end, width)
        if len(values) != width:
            raise uff_refusal(path, at + 2, f"{len(values)} values", f"{width} of one node")
        shapes.append(values)
        at += 2
    if len(set(nodes)) != len(nodes) or not nodes:
        raise uff_refusal(path, first + 9, "a node twice, or none", "each node once")
    viscous = reals[2] if len(reals) > 2 else 0.0
    hysteretic = reals[3] if len(reals) > 3 else 0.0
    return _Mode(
        line=first + 1,
        frequency=reals[0],
        mass=reals[1],
        damping=viscous if viscous else 0.5 * hysteretic,
        nodes=tuple(nodes),
        shapes=np.array(shapes),
    )


def _units(path: Path, lines: list[str], first: int, end: int) -> tuple[float, float]:
    """Units of length [m] and force [N]; the file has their reciprocals."""
    factors = uff_numbers(path, lines, first + 1, end, 2)
    if not (factors[0] > 0 and factors[1] > 0):
        raise uff_refusal(path, first + 2, f"unit factors {factors[:2]}", "factors above 0")
    return 1.0 / factors[0], 1.0 / factors[1]
