"""Frequency responses of universal files: sets 58 and 58b, read through pyuff.

Set 58 says of a response its nodes, its signed directions (1 to 3 along x, y, z, 4 to 6 about them,
0 a scalar) and its quantity (8 displacement, 11 velocity, 12 acceleration, 15 pressure per 13
force).  Units are those of its axis, or else those of set 164, or else SI.  Nodes have their
places in sets 15 or 2411.
"""

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from klack.acoustics.receivers.responses import (
    Channel,
    FrequencyResponses,
    Response,
    gathered,
    quantity_of_unit,
    response,
)
from klack.arrays import Vector
from klack.errors import AccuracyWarning, InputError, foreign_reading, optional_package, refuse_if
from klack.measurement.unit_text import no_unit

__all__ = ["read_uff_responses"]

_FREQUENCY_RESPONSE = 4
_QUANTITIES = {8: "displacement", 11: "velocity", 12: "acceleration", 15: "pressure"}
_FORCE = (0, 9, 13)  # unknown, reaction force, excitation force
_LARGEST = 2 << 30  # bytes
_POUND, _FOOT = 4.4482216152605, 0.3048
_SYSTEMS = {
    **{1: (1.0, 1.0), 2: (_FOOT, _POUND), 3: (1.0, 9.80665), 4: (_FOOT, 0.138254954376)},
    **{5: (1e-3, 1e-3), 6: (1e-2, 1e-2), 7: (0.0254, _POUND), 8: (1e-3, 9.80665)},
}
"""Units of length [m] and force [N] by the code of set 164."""


def read_uff_responses(path: Path, *, quantity: str | None = None) -> FrequencyResponses:
    """Read all frequency responses of a universal file.

    Parameters
    ----------
    path
    quantity
        What the motions are where the file does not say: ``displacement``, ``velocity`` or
        ``acceleration``.

    Raises
    ------
    InputError
        For a damaged file, one without responses, and a quantity that is not known.
    """
    pyuff = optional_package("pyuff", f"reading {path.name} (UFF)", "measurement")
    refuse_if(
        not path.is_file() or path.stat().st_size > _LARGEST,
        str(path),
        got="no file, or more than 2 GB",
        expected="a universal file of frequency responses",
        hint="check the path; export only the nodes of the interface and the ears.",
    )
    damage = "export it again, as text (58) if binary (58b) fails."
    with foreign_reading(str(path), "a universal file", damage):
        file = pyuff.UFF(str(path))
        kinds = [int(kind) for kind in file.get_set_types()]

    def read(number: int) -> Any:
        with foreign_reading(f"{path.name}: set {number + 1}", "a universal file", damage):
            return file.read_sets(number)

    units = _units(path, [read(i) for i, kind in enumerate(kinds) if kind == 164])
    found: list[Response] = []
    others = 0
    for number, kind in enumerate(kinds):
        if kind != 58:
            continue
        data = read(number)
        if int(data["func_type"]) != _FREQUENCY_RESPONSE:
            others += 1
            continue
        found.append(_response(f"{path.name}: set {number + 1}", data, units, quantity))
    refuse_if(
        not found,
        str(path),
        got=f"{others} functions of other kinds and no frequency response",
        expected="sets 58 of functional type 4",
        hint="export frequency response functions, not spectra or time records.",
    )
    return gathered(path.name, found, _positions(path, kinds, read, units[0]))


def _units(path: Path, sets: list[Any]) -> tuple[float, float]:
    """Units of length [m] and force [N] of the file."""
    if not sets:
        return 1.0, 1.0
    code = int(sets[0].get("units_code", 1))
    if code in _SYSTEMS:
        return _SYSTEMS[code]
    length, force = float(sets[0]["length"]), float(sets[0]["force"])
    refuse_if(
        not (length > 0.0 and force > 0.0),
        f"{path.name}: set 164",
        got=f"unit factors {length:g} and {force:g}",
        expected="factors above 0, by which values are divided to get SI",
        hint="export the file in SI.",
    )
    return 1.0 / length, 1.0 / force


def _response(where: str, data: Any, units: tuple[float, float], quantity: str | None) -> Response:
    channels = tuple(
        (Channel(str(int(data[f"{end}_node"])), abs(int(data[f"{end}_dir"]))), sign)
        for end in ("rsp", "ref")
        for sign in (-1.0 if int(data[f"{end}_dir"]) < 0 else 1.0,)
    )
    (output, _), (source, _) = channels
    refuse_if(
        max(output.direction, source.direction) > 6,
        where,
        got=f"directions {data['rsp_dir']} and {data['ref_dir']}",
        expected="-6 to 6",
        hint="the file is damaged.",
    )
    kind, below = int(data["ordinate_spec_data_type"]), int(data["orddenom_spec_data_type"])
    what = _QUANTITIES.get(kind, quantity if kind in (0, 1) else None)
    if what is None or below not in _FORCE:
        raise InputError(
            f"{where} ({output} / {source})",
            got=f"a response of quantity {kind} per quantity {below}",
            expected="8 displacement, 11 velocity, 12 acceleration or 15 pressure per 13 force",
            hint="state the quantity: acceleration, velocity or displacement; the file does not "
            "distinguish accelerance from receptance.",
        )
    label = str(data.get("ordinate_axis_units_lab", "")).strip()
    factor = _labelled(where, label, what) if not no_unit(label) else None
    if factor is None:
        factor = _in_units(units, what, output.direction, source.direction)
    values = np.asarray(data["data"])
    x = np.asarray(data["x"], dtype=float)
    count = min(x.size, values.size, int(data["num_pts"]))
    refuse_if(
        count < int(data["num_pts"]) or not np.iscomplexobj(values),
        where,
        got=f"{values.size} values of type {values.dtype} for {int(data['num_pts'])} lines",
        expected="a complex value at each line",
        hint="the file was truncated, or has only magnitudes; export complex responses.",
    )
    return response(
        where,
        (channels[0], channels[1]),
        what,
        x[:count],
        (factor * values[:count]).astype(complex),
    )


def _labelled(where: str, label: str, what: str) -> float | None:
    """Factor of the unit that the axis has; none (and a doubt) where it cannot be used."""
    try:
        named, factor = quantity_of_unit(
            label if "/" in label and "N" in label else f"{label}/N", where
        )
    except InputError:
        named, factor = "", 1.0
    if named == what:
        return factor
    warnings.warn(
        f"{where}: its axis has the unit '{label}', which is not a unit of {what} per force; the "
        "units of the file (set 164, or SI) are used.",
        AccuracyWarning,
        stacklevel=2,
    )
    return None


def _in_units(units: tuple[float, float], what: str, output: int, source: int) -> float:
    length, force = units
    top = force / length**2 if what == "pressure" else 1.0 if output > 3 else length
    return top / (force * length if source > 3 else force)


def _positions(
    path: Path, kinds: list[int], read: Callable[[int], Any], length: float
) -> dict[str, Vector]:
    """Places of the nodes [m]; a doubt where their directions are in systems of their own."""
    places: dict[str, Vector] = {}
    local = []
    for number, kind in enumerate(kinds):
        if kind not in (15, 2411):
            continue
        data = read(number)
        for node, system, *place in zip(
            *(data[key] for key in ("node_nums", "disp_cs", "x", "y", "z")), strict=True
        ):
            places[str(int(node))] = length * np.array(place, dtype=float)
            if int(system) > 1 and 2420 in kinds:
                local.append(str(int(node)))
    if local:
        warnings.warn(
            f"{path.name}: the directions of node {', '.join(local[:5])} are in local coordinate "
            "systems (set 2420), which are not read. State the axes of these points.",
            AccuracyWarning,
            stacklevel=3,
        )
    return places
