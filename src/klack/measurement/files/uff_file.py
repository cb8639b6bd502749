"""Universal files: sets 58 and 58b of real values over time, read through pyuff.

A universal file names the kind of its values, in SI or in a unit written as text. Sets are read
one at a time; the last one stays in memory.
"""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.errors import foreign_reading, optional_package, refuse_if
from klack.measurement.files.clock import unique_names
from klack.measurement.files.csv_dialect import split_label
from klack.measurement.recording import ChannelInfo, Recording, left_out
from klack.measurement.unit_text import no_unit, plain_unit, unit_factor
from klack.units import TIME

__all__ = ["UffFile"]

Vector = NDArray[np.float64]

_TIME_RESPONSE, _TIME_AXIS = 1, 17
_EVEN = 1
_LARGEST = 2 << 30  # bytes
_SI = {8: "m", 11: "m/s", 12: "m/s^2", 13: "N", 9: "N", 15: "Pa"}
"""Unit of a kind of ordinate (record 9, field 1) if the file has none."""


class UffFile(Recording):
    """Time records of a universal file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._uff = _opened(path)
        self._set: dict[str, int] = {}
        self._last: tuple[int, Any] | None = None
        notes: list[str] = []
        super().__init__(path, self._listed(path, notes), tuple(notes))

    def _listed(self, path: Path, notes: list[str]) -> tuple[ChannelInfo, ...]:
        found, others = [], []
        for number, kind in enumerate(self._uff.get_set_types()):
            if int(kind) != 58:
                continue
            head = _header(path, self._uff, number)
            if head["func_type"] == _TIME_RESPONSE or (
                head["func_type"] == 0 and head["abscissa_spec_data_type"] == _TIME_AXIS
            ):
                found.append((number, head))
            else:
                others.append(f"set {number + 1} ({_name(head)})")
        notes += left_out(path.name, {"not over time": others} if others else {})
        names = unique_names([split_label(_name(head))[0] for _, head in found])
        si = _in_si(self._uff)
        return tuple(
            self._info(path, name, number, head, si)
            for name, (number, head) in zip(names, found, strict=True)
        )

    def _info(self, path: Path, name: str, number: int, head: Any, si: bool) -> ChannelInfo:
        unit = str(head.get("ordinate_axis_units_lab", "")).strip()
        if no_unit(unit):
            kind = int(head["ordinate_spec_data_type"])
            unit = split_label(_name(head))[1] or (_SI.get(kind, "") if si else "")
        count = int(head["num_pts"])
        self._set[name] = number
        second = _second(path, head)
        if int(head["abscissa_spacing"]) == _EVEN:
            start, step, clock = float(head["abscissa_min"]), float(head["abscissa_inc"]), ""
        else:
            times = self._data(number)["x"]
            start, clock = float(times[0]), f"set {number + 1}"
            step = float(times[-1] - times[0]) / max(len(times) - 1, 1)
        refuse_if(
            count < 2 or not step > 0,
            f"{path.name}: set {number + 1} ({name})",
            got=f"{count} values with steps of {step:g} s",
            expected="at least two, and steps above 0",
            hint="remove this set from the file.",
        )
        return ChannelInfo(
            name=name,
            unit=plain_unit(unit),
            count=count,
            start=second * start,
            step=second * step,
            clock=clock,
            label=_name(head),
        )

    def _data(self, number: int) -> Any:
        """Set ``number``, kept until the next."""
        if self._last is None or self._last[0] != number:
            with _damage(f"{self.path.name}: set {number + 1}"):
                self._last = number, self._uff.read_sets(number)
        return self._last[1]

    def _values(self, channel: ChannelInfo, first: int, last: int) -> Vector:
        values = np.asarray(self._data(self._set[channel.name])["data"])
        refuse_if(
            values.size < channel.count or np.iscomplexobj(values),
            f"{self.path.name}: channel '{channel.name}'",
            got=f"{values.size} values of type {values.dtype}",
            expected=f"{channel.count} real values",
            hint="the file was truncated; export it again.",
        )
        return values[first:last].astype(np.float64)

    def _clock_time(self, channel: ChannelInfo, first: int, last: int) -> Vector:
        data = self._data(self._set[channel.name])
        refuse_if(
            len(data["x"]) < channel.count,
            f"{self.path.name}: channel '{channel.name}'",
            got=f"{len(data['x'])} times",
            expected=f"{channel.count}",
            hint="the file was truncated; export it again.",
        )
        return _second(self.path, data) * np.asarray(data["x"][first:last], dtype=np.float64)


def _opened(path: Path) -> Any:
    pyuff = optional_package("pyuff", f"reading {path.name} (UFF)", "measurement")
    size = path.stat().st_size
    refuse_if(
        size > _LARGEST,
        str(path),
        got=f"a universal file of {size / 2**30:.1f} GB",
        expected="at most 2 GB (it is read at once)",
        hint="export MDF4, TDMS or HDF5.",
    )
    with _damage(str(path)):
        return pyuff.UFF(str(path))


def _damage(where: str) -> AbstractContextManager[None]:
    return foreign_reading(
        where, "a universal file", "export it again, as text (58) if binary (58b) fails."
    )


def _in_si(uff: Any) -> bool:
    """False if a set 164 says other units."""
    kinds = [int(kind) for kind in uff.get_set_types()]
    if 164 not in kinds:
        return True
    return int(uff.read_sets(kinds.index(164)).get("units_code", 1)) == 1


def _header(path: Path, uff: Any, number: int) -> Any:
    with _damage(f"{path.name}: set {number + 1}"):
        return uff.read_sets(number, header_only=True)


def _name(head: Any) -> str:
    """Response name, first line of the set, or node and direction."""
    for key in ("id1", "rsp_ent_name", "ordinate_axis_lab"):
        text = str(head.get(key, "")).strip()
        if text and text.upper() != "NONE":
            return text
    return f"node {int(head['rsp_node'])} direction {int(head['rsp_dir'])}"


def _second(path: Path, head: Any) -> float:
    unit = str(head.get("abscissa_axis_units_lab", "")).strip()
    if no_unit(unit):
        return 1.0
    return unit_factor(unit, TIME, f"{path.name}: abscissa").factor
