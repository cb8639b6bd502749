"""Results as netCDF-4: one group per run, channels over the dimension of their axis.

Attributes follow the CF conventions (``units``, ``long_name``, ``title``, ``history``, ...);
doubles are compressed without loss.
"""

from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from klack.errors import optional_package
from klack.exchange.results.table import ResultRun, ResultTable, identifiers
from klack.files.whole import whole_file

__all__ = ["write_netcdf"]

_PLACES = {"title": "title", "description": "comment", "created": "date_created"}
"""Table lines with names of their own in the conventions."""

_LONGEST = 15_000
"""Characters of an attribute: HDF5 holds 64 KiB, up to four bytes each."""


def write_netcdf(table: ResultTable, path: Path) -> Path:
    """Write a file for netCDF4, xarray, MATLAB, ParaView and ``ncdump``.

    Group ``/reduced`` holds coordinates (``time``, ``time_edge``), the channels over them and the
    numbers of the run without dimension. Names have underscores for blanks and points;
    ``long_name`` keeps the name of klack.

    Raises
    ------
    MissingExtraError
        Without the package h5netcdf.
    """
    h5netcdf = optional_package("h5netcdf", "writing netCDF", "exchange")
    # HDF5 writes to memory: a full disk is an error of ours then, and no end of the process
    memory = BytesIO()
    with h5netcdf.File(memory, "w", invalid_netcdf=False) as file:
        file.attrs["Conventions"] = "CF-1.11"
        file.attrs["source"] = f"klack {table.about.get('klack', '')}".strip()
        file.attrs["kind"] = table.kind
        lines = {key: text for key, text in table.about.items() if text}
        for name, text in zip(identifiers(list(lines)), lines.items(), strict=True):
            file.attrs[_PLACES.get(text[0], name)] = text[1][:_LONGEST]
        _text(file, "case_text", table.case_text, "case file as read")
        names = identifiers([run.name for run in table.runs], ["case_text"])
        for name, run in zip(names, table.runs, strict=True):
            _write_run(file.create_group(name), run)
    with whole_file(path) as new:
        new.write_bytes(memory.getbuffer())
    return path


def _write_run(group: Any, run: ResultRun) -> None:
    group.attrs["long_name"] = run.label
    group.attrs["name"] = run.name
    if run.solver:
        group.attrs["solver"] = run.solver
    axes = identifiers([axis.name for axis in run.axes])
    dimension = dict(zip([axis.name for axis in run.axes], axes, strict=True))
    for axis in run.axes:
        name = dimension[axis.name]
        group.dimensions[name] = axis.values.size
        variable = _variable(group, name, (name,), axis.values)
        variable.attrs.update({"units": axis.unit, "long_name": axis.meaning})
        if axis.quantity == "time":
            variable.attrs["axis"] = "T"
    names = identifiers([channel.name for channel in run.channels], axes)
    for name, channel in zip(names, run.channels, strict=True):
        variable = _variable(group, name, (dimension[channel.axis],), channel.values)
        about = {"units": channel.unit, "long_name": channel.name, "comment": channel.meaning}
        variable.attrs.update(about)
    for name, scalar in zip(
        identifiers([scalar.name for scalar in run.scalars], [*axes, *names]),
        run.scalars,
        strict=True,
    ):
        variable = group.create_variable(name, (), dtype="f8", data=np.float64(scalar.value))
        about = {"units": scalar.unit, "long_name": scalar.name, "comment": scalar.meaning}
        variable.attrs.update(about)


def _variable(group: Any, name: str, dimensions: tuple[str, ...], values: Any) -> Any:
    return group.create_variable(
        name, dimensions, dtype="f8", data=values, compression="gzip", compression_opts=4,
        shuffle=True,
    )  # fmt: skip


def _text(file: Any, name: str, text: str, meaning: str) -> None:
    import h5py

    # no attribute: a case file with a profile may be long
    variable = file.create_variable(name, (), dtype=h5py.string_dtype("utf-8"))
    variable[...] = text
    variable.attrs["long_name"] = meaning
