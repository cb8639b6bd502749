"""Frequency responses from text tables and from files of arrays.

A table has one line for each frequency, and two columns for each response::

    frequency [Hz], 101.z/101.z re [m/s/N], 101.z/101.z im [m/s/N], ear/101.z mag [Pa/N], \
ear/101.z phase [deg]

Arrays by name are in MATLAB files (up to 7.2), HDF5, netCDF 3 and 4, and ``.npz``: ``frequency``,
a matrix over frequency, outputs and inputs called by its quantity (``mobility``, ``accelerance``,
``receptance``, ``pressure``) or ``Y`` or ``H`` with a text ``quantity``, and the names
``outputs`` and ``inputs`` of its channels (``ears`` of a pressure).  Where complex numbers cannot
be stored they are two arrays, ``mobility_real`` and ``mobility_imag``.
"""

import csv
import re
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from klack.acoustics.interface import DIRECTIONS, Complexes
from klack.acoustics.isolator import DynamicStiffness, MeasuredIsolator
from klack.acoustics.receivers.responses import (
    FrequencyResponses,
    Response,
    channel_of,
    gathered,
    quantity_of_unit,
    response,
)
from klack.arrays import Vector
from klack.bodies.model_files.mat5 import read_mat5
from klack.bodies.model_files.named_arrays import npy_array
from klack.errors import InputError, foreign_reading, optional_package, refuse_if
from klack.units import STIFFNESS, parse_quantity

__all__ = ["netcdf3_arrays", "read_array_responses", "read_isolator", "read_table_responses"]

_LARGEST = 1 << 30  # bytes
_PART = r"\s+(?P<part>re|real|im|imag|mag|abs|phase|arg)\b\.?\s*(?:[\[(](?P<unit>.*)[\])])?"
_RESPONSE = re.compile(rf"(?P<one>[^/]+)/(?P<other>[^/\[\]]+?){_PART}", re.IGNORECASE)
_STIFFNESS = re.compile(rf"(?P<one>k[12][12])[. ](?P<other>r?[xyz]){_PART}", re.IGNORECASE)
_HEAD = re.compile(r"[#% \"]*f(req|\b)", re.IGNORECASE)
_PARTS = {"re": "re", "real": "re", "im": "im", "imag": "im"}
_PARTS |= {"mag": "mag", "abs": "mag", "phase": "phase", "arg": "phase"}


def read_table_responses(path: Path) -> FrequencyResponses:
    """Read a table of responses: commas, semicolons (with decimal commas) or tabs.

    Raises
    ------
    InputError
        With the line, for what is no table of responses.
    """
    found = []
    f, pairs = _pairs(path, _RESPONSE, "101.z/7.x re [m/s/N]")
    for (out, source), values, unit in pairs:
        where = f"{path.name}: {out}/{source}"
        quantity, factor = quantity_of_unit(unit, where)
        channels = channel_of(out), channel_of(source)
        found.append(response(where, channels, quantity, f, factor * values))
    return gathered(path.name, found)


def read_isolator(path: Path) -> MeasuredIsolator:
    """Read the dynamic stiffness of a resilient element (ISO 10846) from a table.

    Columns are called ``k21.z re [N/um], k21.z im [N/um]``, with k11 and k22 where the element has
    inertia, and rx, ry, rz (N m/rad) for rotations.  The transfer stiffness gets the sign that it
    has at low frequencies, above 0.

    Raises
    ------
    InputError
        With the line or column, for what is no such table, and for an element that gives energy.
    """
    f, pairs = _pairs(path, _STIFFNESS, "k21.z re [N/um]")
    values: dict[int, dict[str, Complexes]] = {}
    for (block, name), k, unit in pairs:
        where, direction = f"{path.name}: {block}.{name}", DIRECTIONS.index(name.lower()) + 1
        k = k * _stiffness_unit(unit, direction > 3, where)
        if block.lower() in ("k12", "k21"):
            block, k = "k21", k * np.sign(k[0].real)
        refuse_if(
            k[0].imag < -1e-3 * abs(k[0]),
            where,
            got=f"a loss factor of {k[0].imag / k[0].real:.3g} at {f[0]:.4g} Hz",
            expected="0 or more: an element loses energy",
            hint="the phase has the sign of exp(-i w t): reverse it.",
        )
        values.setdefault(direction, {})[block.lower()] = k
    for direction, blocks in values.items():
        refuse_if(
            set(blocks) not in ({"k21"}, {"k11", "k21", "k22"}),
            f"{path.name}: {DIRECTIONS[direction - 1]}",
            got=f"the stiffnesses {', '.join(blocks)}",
            expected="only k21, or k11, k21 and k22",
            hint="k12 and k21 are the same.",
        )
    return MeasuredIsolator(
        name=path.name,
        frequency=f,
        values={
            direction: DynamicStiffness(
                transfer=blocks["k21"], driving=blocks.get("k11"), receiving=blocks.get("k22")
            )
            for direction, blocks in values.items()
        },
    )


_TORSION = {"N*m/rad": 1.0, "N*m": 1.0, "N*mm/rad": 1e-3, "N*mm": 1e-3, "kN*m/rad": 1e3}


def _stiffness_unit(unit: str, turned: bool, where: str) -> float:
    """Factor to N/m, or to N m/rad."""
    if not turned:
        return parse_quantity(f"1 {unit}", STIFFNESS, where)
    text = unit.replace(" ", "*").replace("Nm", "N*m")
    refuse_if(
        text not in _TORSION,
        where,
        got=f"the unit '{unit}'",
        expected=f"one of: {', '.join(_TORSION)}",
        hint="rx, ry and rz are rotations.",
    )
    return _TORSION[text]


Pairs = list[tuple[tuple[str, str], Complexes, str]]
"""Two names of a column, its complex values, its unit."""


def _pairs(path: Path, label: re.Pattern[str], example: str) -> tuple[Vector, Pairs]:
    """Frequencies [Hz] and complex columns of a table."""
    names, table = _table(path)
    scale = 1e3 if re.search(r"[\[(]\s*khz", names[0], re.IGNORECASE) else 1.0
    parts: dict[tuple[str, str], dict[str, tuple[Vector, str]]] = {}
    for name, values in zip(names[1:], table.T[1:], strict=True):
        match = label.fullmatch(name)
        if match is None:
            raise InputError(
                f"{path.name}: column '{name}'",
                got="another name",
                expected=f"such as '{example}', with re and im, or mag and phase",
                hint="remove columns that are something else.",
            )
        pair = parts.setdefault((match["one"].strip(), match["other"].strip()), {})
        pair[_PARTS[match["part"].lower()]] = values, match["unit"] or ""
    found: Pairs = []
    for pair_names, columns in parts.items():
        refuse_if(
            set(columns) not in ({"re", "im"}, {"mag", "phase"}),
            f"{path.name}: {'/'.join(pair_names)}",
            got=f"the columns {', '.join(columns)}",
            expected="re and im, or mag and phase",
            hint="a magnitude without a phase cannot be coupled.",
        )
        if "re" in columns:
            whole = columns["re"][0] + 1j * columns["im"][0]
            found.append((pair_names, whole, columns["re"][1]))
        else:
            turn, unit = columns["phase"]
            turn = turn if unit.strip().lower() == "rad" else np.deg2rad(turn)
            found.append((pair_names, columns["mag"][0] * np.exp(1j * turn), columns["mag"][1]))
    return scale * table[:, 0], found


def _table(path: Path) -> tuple[list[str], NDArray[np.float64]]:
    """Names of the columns and rows of numbers, the first column a frequency."""
    lines = [(n, line) for n, line in enumerate(_text(path).splitlines(), 1) if line.strip()]
    at = next((i for i, (_, line) in enumerate(lines) if _HEAD.match(line)), None)
    if at is None:
        raise _no_table(path, "no line of column names")
    head = lines[at][1].lstrip("#% ")
    mark = max(";\t,", key=head.count)
    names = [cell.strip() for cell in next(csv.reader([head], delimiter=mark))]
    rows = []
    for number, line in lines[at + 1 :]:
        if line.lstrip()[0] in "#%":
            continue
        cells = next(csv.reader([line], delimiter=mark))
        if len(cells) != len(names):
            raise _no_table(path, f"line {number} of {len(cells)} columns for {len(names)} names")
        try:
            rows.append([float(c.replace(",", ".") if mark == ";" else c) for c in cells])
        except ValueError:
            raise _no_table(path, f"line {number}, not all of it numbers") from None
    table = np.array(rows)
    rising = len(rows) > 1 and np.all(np.isfinite(table)) and np.all(np.diff(table[:, 0]) > 0.0)
    if len(names) < 3 or not rising:
        raise _no_table(path, f"{len(rows)} lines that do not rise in frequency or are not finite")
    return names, table


def _require_file(path: Path, expected: str) -> None:
    refuse_if(
        not path.is_file() or path.stat().st_size > _LARGEST,
        str(path),
        got="no file, or more than 1 GB",
        expected=expected,
        hint="check the path.",
    )


def _text(path: Path) -> str:
    _require_file(path, "a table over frequency")
    data = path.read_bytes()
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _no_table(path: Path, got: str) -> InputError:
    return InputError(
        str(path),
        got=got,
        expected="a line of names that begins with 'frequency [Hz]', then rows of numbers",
        hint="separate columns with commas, semicolons or tabs; decimal commas need semicolons.",
    )


# --------------------------------------------------------------------------- arrays

_QUANTITIES = {
    **dict.fromkeys(("mobility", "velocity"), "velocity"),
    **dict.fromkeys(("accelerance", "inertance", "acceleration"), "acceleration"),
    **dict.fromkeys(("receptance", "compliance", "displacement"), "displacement"),
    **dict.fromkeys(("pressure", "p"), "pressure"),
}
_UNNAMED = ("y", "h", "frf")
_AXES = ("frequency", "frequencies", "f", "freq")
_KNOWN = {*_QUANTITIES, *_UNNAMED, *_AXES, "outputs", "inputs", "ears", "quantity"}
_KNOWN |= {"nodes", "positions"}

Arrays = Mapping[str, Any]


def read_array_responses(path: Path) -> FrequencyResponses:
    """Read responses from ``.mat``, ``.h5``, ``.nc`` or ``.npz``.

    Raises
    ------
    InputError
        If arrays or names are missing, or their shapes do not fit.
    """
    refuse_if(
        not path.is_file() or path.stat().st_size > _LARGEST,
        str(path),
        got="no file, or more than 1 GB",
        expected="a file of frequency responses",
        hint="check the path.",
    )
    held = {key.lower(): value for key, value in _arrays(path).items()}
    f = next((held[key] for key in _AXES if key in held), None)
    refuse_if(
        f is None,
        str(path),
        got=f"the arrays {', '.join(list(held)[:12]) or '(none)'}",
        expected="frequency [Hz], mobility (frequency, outputs, inputs), outputs, inputs",
        hint="see the guide on receivers for the names.",
    )
    frequency = np.asarray(f, dtype=float).ravel()
    found: list[Response] = []
    for key in (*_QUANTITIES, *_UNNAMED):
        matrix = _complex(held, key)
        if matrix is None:
            continue
        quantity = _quantity(path, key, held)
        found += _of_matrix(path, key, quantity, frequency, matrix, held)
    return gathered(path.name, found, _places(path, held))


def _quantity(path: Path, key: str, held: Arrays) -> str:
    said = " ".join(_words(held.get("quantity", ()))).lower()
    quantity = _QUANTITIES.get(key) or _QUANTITIES.get(said)
    if quantity is None:
        raise InputError(
            f"{path.name}: {key}",
            got=f"the quantity '{said}'" if said else "no quantity",
            expected="a text 'quantity': mobility, accelerance, receptance or pressure",
            hint="accelerance and receptance look like mobility: the file has to state the "
            "quantity.",
        )
    return quantity


def _of_matrix(
    path: Path, key: str, quantity: str, f: Vector, matrix: NDArray[Any], held: Arrays
) -> list[Response]:
    rows = "ears" if quantity == "pressure" and "ears" in held else "outputs"
    names = [_words(held.get(name, ())) for name in (rows, "inputs")]
    wanted = (f.size, len(names[0]), len(names[1]))
    if matrix.shape != wanted and np.moveaxis(np.atleast_3d(matrix), -1, 0).shape == wanted:
        matrix = np.moveaxis(np.atleast_3d(matrix), -1, 0)  # (outputs, inputs, frequency)
    refuse_if(
        matrix.shape != wanted,
        f"{path.name}: {key}",
        got=f"an array of shape {matrix.shape}",
        expected=f"{wanted}: {f.size} frequencies, the names '{rows}' and 'inputs'",
        hint="store lists of channel names such as 101.z with the matrix.",
    )
    return [
        response(
            f"{path.name}: {key} {out}/{source}",
            (channel_of(out), channel_of(source)),
            quantity,
            f,
            matrix[:, i, j],
        )
        for i, out in enumerate(names[0])
        for j, source in enumerate(names[1])
        if not np.any(np.isnan(matrix[:, i, j]))
    ]


def _complex(held: Arrays, key: str) -> NDArray[Any] | None:
    if key in held and isinstance(held[key], np.ndarray):
        return np.asarray(held[key])
    real, imag = held.get(f"{key}_real"), held.get(f"{key}_imag")
    return None if real is None or imag is None else np.asarray(real) + 1j * np.asarray(imag)


def _words(value: Any) -> list[str]:
    """Names from texts, lists of texts, and cells of texts."""
    if isinstance(value, str | bytes):
        value = (value,)
    if isinstance(value, np.ndarray) and value.dtype.kind not in "OSU":
        return []
    items = [v[0] if isinstance(v, tuple | list) and len(v) == 1 else v for v in value]
    return [
        (v.decode("utf-8", "replace") if isinstance(v, bytes) else str(v)).strip() for v in items
    ]


def _places(path: Path, held: Arrays) -> dict[str, Vector]:
    """Places of nodes, where the file has ``nodes`` and ``positions`` (nodes, 3) [m]."""
    names = _words(held.get("nodes", ()))
    if not names or "positions" not in held:
        return {}
    places = np.asarray(held["positions"], dtype=float)
    refuse_if(
        places.shape != (len(names), 3),
        f"{path.name}: positions",
        got=f"an array of shape {places.shape}",
        expected=f"({len(names)}, 3) for the {len(names)} names of 'nodes'",
        hint="one row x, y, z in metres for each node.",
    )
    return dict(zip(names, places, strict=True))


def _arrays(path: Path) -> Arrays:
    with path.open("rb") as stream:
        head = stream.read(8)
    if head[:3] == b"CDF":
        return netcdf3_arrays(path)
    if head[1:4] == b"HDF" or path.suffix.lower() in (".h5", ".hdf5", ".nc"):
        return _hdf5(path)
    if path.suffix.lower() == ".npz":
        return _npz(path)
    return read_mat5(path, largest=_LARGEST)


def _npz(path: Path) -> Arrays:
    hint = "write it again with numpy.savez, only arrays of numbers and texts."
    arrays: dict[str, Any] = {}
    with foreign_reading(str(path), "a NumPy file", hint), zipfile.ZipFile(path) as archive:
        for item in archive.infolist():
            arrays[item.filename.removesuffix(".npy")] = npy_array(
                archive,
                item,
                min(item.file_size, _LARGEST),
                lambda shape, dtype: InputError(
                    str(path),
                    got=f"an array of shape {shape} and type {dtype}",
                    expected="numbers or texts, at most 1 GB",
                    hint=hint,
                ),
            )
    return arrays


def netcdf3_arrays(path: Path) -> dict[str, Any]:
    """Variables and texts of a netCDF 3 file; rows of characters are texts."""
    _require_file(path, "a netCDF file")
    arrays: dict[str, Any] = {}
    damage = "write it again; it may be truncated, or of netCDF 5."
    with (
        foreign_reading(str(path), "a netCDF 3 file", damage),
        scipy.io.netcdf_file(path, mmap=False) as file,
    ):
        arrays |= getattr(file, "_attributes", {})
        for key, variable in file.variables.items():
            values: NDArray[Any] = np.array(variable[:])
            if values.dtype.kind == "S" and values.ndim == 2:
                values = np.array([b"".join(row).rstrip(b"\0 ").decode() for row in values])
            arrays[key] = values.astype(values.dtype.newbyteorder("=")) if values.ndim else values
    return arrays


def _hdf5(path: Path) -> Arrays:
    """Known data sets and texts of the file itself and its attributes; links are not followed."""
    h5py = optional_package("h5py", f"reading {path.name} (HDF5)", "measurement")
    arrays: dict[str, Any] = {}
    with (
        foreign_reading(str(path), "an HDF5 file", "write it again; it may be truncated."),
        h5py.File(path, "r") as file,
    ):
        arrays |= {key: value for key, value in file.attrs.items() if not key.startswith("_")}
        matlab = "MATLAB_class" in {k for key in file for k in _attributes(h5py, file, key)}
        for key in file:
            if key.lower().removesuffix("_real").removesuffix("_imag") not in _KNOWN:
                continue
            item = file.get(key, getlink=True)
            if not isinstance(item, h5py.HardLink) or not isinstance(file[key], h5py.Dataset):
                continue
            data = file[key]
            refuse_if(
                data.external or data.is_virtual or data.nbytes > _LARGEST,
                f"{path.name}: {key}",
                got="values in another file, or more than 1 GB",
                expected="values in this file",
                hint="store only the responses of the interface and the ears.",
            )
            values = data[()]
            fields = (
                getattr(values.dtype, "names", None) if isinstance(values, np.ndarray) else None
            )
            if fields and len(fields) == 2:
                values = values[fields[0]] + 1j * values[fields[1]]
            arrays[key] = values.T if matlab and isinstance(values, np.ndarray) else values
    return arrays


def _attributes(h5py: Any, file: Any, key: str) -> list[str]:
    return list(file[key].attrs) if isinstance(file.get(key, getlink=True), h5py.HardLink) else []
