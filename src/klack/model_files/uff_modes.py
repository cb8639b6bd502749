"""Mode shapes of a universal file: datasets 55, with the units of a dataset 164.

Dataset 55 holds one mode: five lines of text, a line of kinds, a line of whole numbers, a line of
frequency, modal mass and damping, then two lines for each node (number; displacements).  Numbers
have five decimals, so shapes are known to about 1e-5.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError

__all__ = ["UffModes", "read_uff_modes"]

Floats = NDArray[np.float64]

_LARGEST = 256 << 20  # bytes
_NORMAL_MODE, _COMPLEX_MODE = 2, 3
_DISPLACEMENT = 8
_DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")


@dataclass(frozen=True, kw_only=True, eq=False)
class UffModes:
    """Real modes of a universal file, in its units.

    Parameters
    ----------
    frequency, damping, modal_mass : array, shape (m,) [Hz], [-], (mass)
    shapes : array, shape (m, n)
    labels : tuple of str
        ``"17 z"``: node and direction of each column.
    length, force : float or None [m], [N]
        Units of dataset 164.
    """

    frequency: Floats
    damping: Floats
    modal_mass: Floats
    shapes: Floats
    labels: tuple[str, ...]
    length: float | None
    force: float | None


@dataclass(frozen=True)
class _Mode:
    line: int
    frequency: float
    mass: float
    damping: float
    nodes: tuple[int, ...]
    shapes: Floats


def read_uff_modes(path: Path) -> UffModes:
    """Read all normal modes.

    Parameters
    ----------
    path : Path

    Raises
    ------
    InputError
        With the line, for a damaged file, complex modes, or a file without dataset 55: frequency
        responses (dataset 58) are no modes; a modal analysis has to find those first.
    """
    if path.stat().st_size > _LARGEST:
        raise InputError(
            str(path), got="more than 256 MB", expected="a file of modes", hint="export fewer nodes"
        )
    lines = path.read_bytes().decode("latin-1").splitlines()
    modes: list[_Mode] = []
    units: tuple[float, float] | None = None
    kinds: list[str] = []
    for kind, first, last in _datasets(path, lines):
        kinds.append(kind)
        if kind == "55":
            modes.append(_mode(path, lines, first, last))
        elif kind == "164":
            units = _units(path, lines, first, last)
    if not modes:
        raise InputError(
            str(path),
            got=f"datasets {', '.join(dict.fromkeys(kinds)) or '(none)'}",
            expected="mode shapes (dataset 55)",
            hint="frequency responses (dataset 58) are no modes; run the modal analysis first and "
            "export its shapes, mass-normalised.",
        )
    if len({mode.nodes for mode in modes}) > 1 or len({m.shapes.shape for m in modes}) > 1:
        odd = next(mode for mode in modes if mode.nodes != modes[0].nodes or mode is modes[-1])
        raise _refused(path, odd.line, "a mode of other nodes than the first", "the same nodes")
    width = modes[0].shapes.shape[1]
    return UffModes(
        frequency=np.array([mode.frequency for mode in modes]),
        damping=np.array([mode.damping for mode in modes]),
        modal_mass=np.array([mode.mass for mode in modes]),
        shapes=np.array([mode.shapes.ravel() for mode in modes]),
        labels=tuple(f"{n} {_DIRECTIONS[d]}" for n in modes[0].nodes for d in range(width)),
        length=units[0] if units else None,
        force=units[1] if units else None,
    )


def _refused(path: Path, line: int, got: str, expected: str) -> InputError:
    return InputError(
        f"{path}, line {line}",
        got=got,
        expected=expected,
        hint="the file is cut off or damaged; export it again.",
    )


def _datasets(path: Path, lines: list[str]) -> Iterator[tuple[str, int, int]]:
    """Kind, first line (from 0) and end of every dataset."""
    i = 0
    while i < len(lines):
        if lines[i].strip() != "-1":
            i += 1
            continue
        if i + 1 >= len(lines):
            raise _refused(path, i + 1, "the start of a dataset at the end", "its number")
        words = lines[i + 1].split()
        kind = words[0].lower() if words else ""
        end = i + 2
        while end < len(lines) and lines[end].strip() != "-1":
            end += 1
        if end == len(lines):
            raise _refused(path, len(lines), f"dataset {kind} without end", "-1")
        yield kind, i + 2, end
        i = end + 1


def _fields(path: Path, lines: list[str], at: int, end: int, count: int) -> list[float]:
    """Numbers from line ``at`` on, as many as asked for, over several lines if need be."""
    values: list[float] = []
    while len(values) < count:
        if at >= end:
            raise _refused(path, at, "the end of a dataset", f"{count} numbers")
        line = lines[at].replace("D", "E").replace("d", "e")
        words = line.split()
        try:
            values += [float(word) for word in words]
        except ValueError:
            values += _fixed(path, at, line)
        if not words:
            raise _refused(path, at + 1, "an empty line", "numbers")
        at += 1
    if not np.all(np.isfinite(values)):
        raise _refused(path, at, "a number that is not finite", "finite numbers")
    return values


def _fixed(path: Path, at: int, line: str) -> list[float]:
    """Fields of 13 characters that touch each other."""
    try:
        return [float(line[k : k + 13]) for k in range(0, len(line.rstrip()), 13)]
    except ValueError:
        raise _refused(path, at + 1, f"'{line.strip()[:60]}'", "numbers") from None


def _whole(path: Path, lines: list[str], at: int, end: int, count: int) -> list[int]:
    values = _fields(path, lines, at, end, count)
    if any(value != round(value) or abs(value) > 1e9 for value in values):
        raise _refused(path, at + 1, f"'{lines[at].strip()[:60]}'", f"{count} whole numbers")
    return [int(value) for value in values]


def _mode(path: Path, lines: list[str], first: int, end: int) -> _Mode:
    if end - first < 8:
        raise _refused(path, first, "a short dataset 55", "a mode with its nodes")
    head = _whole(path, lines, first + 5, end, 6)
    _, analysis, _, quantity, number_type, width = head[:6]
    if analysis == _COMPLEX_MODE or number_type == 5:
        raise InputError(
            f"{path}, line {first + 6}",
            got="a complex mode",
            expected="real normal modes (analysis type 2, real data)",
            hint="export normal modes; klack takes damping as a ratio beside the shape.",
        )
    if analysis != _NORMAL_MODE or quantity not in (0, _DISPLACEMENT) or not 1 <= width <= 6:
        raise _refused(
            path,
            first + 6,
            f"analysis type {analysis}, quantity {quantity}, {width} values per node",
            "normal modes (2) of displacements (8), 1 to 6 values per node",
        )
    about = _whole(path, lines, first + 6, end, 2)
    reals = _fields(path, lines, first + 7, end, max(2, min(about[1], 6)))
    nodes, shapes = [], []
    at = first + 8
    while at < end:
        nodes.append(_whole(path, lines, at, end, 1)[0])
        values = _fields(path, lines, at + 1, end, width)
        if len(values) != width:
            raise _refused(path, at + 2, f"{len(values)} values", f"{width} of one node")
        shapes.append(values)
        at += 2
    if len(set(nodes)) != len(nodes) or not nodes:
        raise _refused(path, first + 9, "a node twice, or none", "each node once")
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
    """Unit of length [m] and of force [N]; the file gives their reciprocals."""
    factors = _fields(path, lines, first + 1, end, 2)
    if not (factors[0] > 0 and factors[1] > 0):
        raise _refused(path, first + 2, f"unit factors {factors[:2]}", "factors above 0")
    return 1.0 / factors[0], 1.0 / factors[1]
