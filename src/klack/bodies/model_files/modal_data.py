"""Results of a modal analysis from a file: frequencies, damping and shapes, as they were written.

Three forms are read: universal files (:mod:`klack.bodies.model_files.uff`), arrays by name, and a
table with one mode per row::

    frequency [Hz], damping, modal mass, tip, top
    0, 0, 1, 14.2, 14.2
    51230, 0.001, 1, 20.1, -20.1
"""

import csv
import re
from pathlib import Path

import numpy as np

from klack.arrays import Floats
from klack.bodies.model_files.named_arrays import NamedArrays, read_named_arrays
from klack.bodies.model_files.uff import FileModalData, read_uff_modes
from klack.errors import InputError, refuse_if

__all__ = ["read_modal_data"]


_LARGEST = 256 << 20  # bytes
_UFF = (".uff", ".unv", ".ufb")
_FREQUENCY = ("frequency", "frequencies", "freq", "f", "frequency_hz", "eigenfrequencies")
_DAMPING = ("damping", "zeta", "xi", "damping_ratio", "damping_ratios")
_MASS = ("modal_mass", "modal_masses", "mass", "mr")
_SHAPES = ("shapes", "phi", "mode_shapes", "modes", "Psi")
_RESIDUAL = ("residual", "residual_compliance", "feedthrough", "D")
_LABELS = ("ports", "port_names", "labels", "names", "dofs")


def read_modal_data(path: Path) -> FileModalData:
    """Read modes from ``.uff``/``.unv``, ``.mat``, ``.npz`` or a CSV table."""
    refuse_if(
        not path.is_file(),
        str(path),
        got="no such file",
        expected="a file of modal data",
        hint="check it.",
    )
    suffix = path.suffix.lower()
    if suffix in _UFF:
        data = read_uff_modes(path)
    elif suffix in (".mat", ".npz"):
        data = _of_arrays(read_named_arrays(path))
    else:
        data = _of_table(path)
    numbers = [data.frequency, data.modal_mass, data.shapes]
    numbers += [item for item in (data.damping, data.residual) if item is not None]
    refuse_if(
        not all(np.all(np.isfinite(item)) for item in numbers),
        str(path),
        got="numbers that are not finite",
        expected="finite numbers",
        hint="mend it.",
    )
    if not np.all(data.modal_mass > 0):
        worst = int(np.argmin(data.modal_mass))
        raise InputError(
            f"{path}: mode {worst + 1}",
            got=f"a modal mass of {data.modal_mass[worst]:g}",
            expected="a modal mass above 0 (1 for mass-normalised shapes)",
            hint="export mass-normalised shapes; without the modal mass their scale is undefined.",
        )
    return data


def _of_arrays(held: NamedArrays) -> FileModalData:
    group = held.group_with(_FREQUENCY, _SHAPES)
    frequency = _vector(held, "frequency", held.find(*_FREQUENCY, group=group), None)
    count = len(frequency)
    shapes = held.find(*_SHAPES, group=group)
    if shapes is None or count not in shapes.shape:
        raise InputError(
            f"{held.path}: shapes",
            got="no array" if shapes is None else f"{shapes.shape[0]} x {shapes.shape[1]} numbers",
            expected=f"one column for each of the {count} modes",
            hint="rows are ports, columns are modes, as in the equation u = Phi q.",
        )
    shapes = shapes.T if shapes.shape[1] == count else shapes
    damping = held.find(*_DAMPING, group=group)
    mass = held.find(*_MASS, group=group)
    residual = held.find(*_RESIDUAL, group=group)
    ports = shapes.shape[1]
    if residual is not None and residual.shape != (ports, ports):
        raise InputError(
            f"{held.path}: residual",
            got=f"{residual.shape[0]} x {residual.shape[1]} numbers",
            expected=f"{ports} x {ports}: from every port to every port",
            hint="leave the residual out if it is unknown.",
        )
    labels = held.find_text(*_LABELS, group=group)
    return FileModalData(
        path=held.path,
        frequency=frequency,
        damping=None if damping is None else _vector(held, "damping", damping, count),
        modal_mass=np.ones(count) if mass is None else _vector(held, "modal_mass", mass, count),
        shapes=shapes,
        labels=labels if len(labels) == ports else tuple(str(i + 1) for i in range(ports)),
        residual=residual,
    )


def _vector(held: NamedArrays, name: str, array: Floats | None, count: int | None) -> Floats:
    size = 0 if array is None else array.size
    if array is not None and size == 1 and count:
        return np.full(count, float(array.ravel()[0]))
    if array is None or size == 0 or max(array.shape) != size or (count and size != count):
        raise InputError(
            f"{held.path}: {name}",
            got="no array" if array is None else f"{array.shape[0]} x {array.shape[1]} numbers",
            expected=f"one number for each of the {count} modes" if count else "a vector",
            hint="give frequencies [Hz], damping ratios and modal masses as vectors.",
        )
    return array.ravel()


# --------------------------------------------------------------------------- table


def _of_table(path: Path) -> FileModalData:
    refuse_if(
        path.stat().st_size > _LARGEST,
        str(path),
        got="more than 256 MB",
        expected="a table of modes",
        hint="reduce it.",
    )
    data = path.read_bytes()
    refuse_if(
        b"\0" in data[:4096],
        str(path),
        got="a binary file",
        expected="a CSV table of modes",
        hint="see the guide.",
    )
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    lines = [(i, line) for i, line in enumerate(text.splitlines(), 1) if line.strip()]
    lines = [(i, line) for i, line in lines if not line.lstrip().startswith(("#", "%", "!"))]
    refuse_if(
        len(lines) < 2,
        str(path),
        got=f"{len(lines)} lines",
        expected="a header and one line for each mode",
        hint="the header begins with 'frequency [Hz]'.",
    )
    mark = max(",;\t", key=lines[0][1].count)
    head = _cells(path, *lines[0], mark)
    if len(head) < 2 or not _is(head[0], ("frequency", "frequencies", "freq", "f")):
        raise InputError(
            f"{path}, line {lines[0][0]}",
            got=f"the header '{lines[0][1].strip()[:60]}'",
            expected="frequency [Hz], damping, modal mass, then a column for each port",
            hint="damping and modal mass may be left out.",
        )
    refuse_if(
        "khz" in head[0].lower() or "rad" in head[0].lower(),
        f"{path}, line {lines[0][0]}",
        got=f"'{head[0]}'",
        expected="frequencies in Hz",
        hint="convert the first column.",
    )
    rows = []
    for number, line in lines[1:]:
        cells = _cells(path, number, line, mark)
        try:
            rows.append([float(cell.replace(",", ".") if mark != "," else cell) for cell in cells])
        except ValueError:
            rows.append([])
        if len(rows[-1]) != len(head):
            raise InputError(
                f"{path}, line {number}",
                got=f"'{line.strip()[:60]}'",
                expected=f"{len(head)} numbers",
                hint="one number for each column of the header.",
            )
    table = np.array(rows)
    column = {_kind(name): i for i, name in reversed(list(enumerate(head)))}
    own = [i for i, name in enumerate(head) if _kind(name) == "port"]
    if not own:
        raise InputError(
            f"{path}, line {lines[0][0]}",
            got="no column for a port",
            expected="at least one, with the mass-normalised shape",
            hint="add a column for each port.",
        )
    mass, damping = column.get("mass"), column.get("damping")
    return FileModalData(
        path=path,
        frequency=table[:, 0],
        damping=None if damping is None else table[:, damping],
        modal_mass=np.ones(len(table)) if mass is None else table[:, mass],
        shapes=table[:, own],
        labels=tuple(head[i] for i in own),
    )


def _cells(path: Path, number: int, line: str, mark: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=mark))]
    except (csv.Error, StopIteration) as error:
        raise InputError(
            f"{path}, line {number}",
            got="a broken line",
            expected="a line of a CSV file",
            hint="mend it.",
        ) from error


def _kind(name: str) -> str:
    if _is(name, ("frequency", "frequencies", "freq", "f")):
        return "frequency"
    if _is(name, _DAMPING):
        return "damping"
    return "mass" if _is(name, ("modal_mass", "modal_masses", "generalised_mass")) else "port"


def _is(name: str, words: tuple[str, ...]) -> bool:
    plain = re.sub(r"[\[(].*", "", name).strip().lower().replace(" ", "_")
    return plain in words
