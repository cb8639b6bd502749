"""Results as a MATLAB file (version 5): one structure per run."""

from pathlib import Path
from typing import Any

import numpy as np
import scipy

from klack.errors import refuse_if
from klack.exchange.results.table import ResultRun, ResultTable, identifiers, octave_text
from klack.files.whole import whole_file

__all__ = ["write_mat"]

_LARGEST = 2**31 - 1  # bytes of one variable of a version 5 file
_OWN = ("about", "names", "units", "axes", "numbers", "label", "solver", "name")


def write_mat(table: ResultTable, path: Path) -> Path:
    """Write a file for ``plot(reduced.time, reduced.contact_force)``.

    A run is a structure of axes and channels. ``run.units.X`` is the unit of ``run.X``,
    ``run.names.X`` its name in klack, ``run.axes.X`` the field that it is drawn over;
    ``run.numbers`` holds its numbers, ``about`` what made them. Text beyond ASCII ends in blanks.
    Rejects runs of more than 2 GiB.
    """
    runs = identifiers([run.name for run in table.runs], _OWN)
    variables: dict[str, Any] = {
        name: _run(run, path) for name, run in zip(runs, table.runs, strict=True)
    }
    about = {"kind": table.kind, **table.about, "case_text": table.case_text, "runs": list(runs)}
    variables["about"] = {
        name: np.array(value, dtype=object) if isinstance(value, list) else value
        for name, value in zip(identifiers(list(about)), about.values(), strict=True)
    }
    with whole_file(path) as new:
        scipy.io.savemat(
            new,
            _padded(variables),
            appendmat=False,
            long_field_names=True,
            oned_as="column",
            do_compression=True,
        )
    return path


def _run(run: ResultRun, path: Path) -> dict[str, Any]:
    size = sum(axis.values.nbytes for axis in run.axes)
    size += sum(channel.values.nbytes for channel in run.channels)
    refuse_if(
        size > _LARGEST - 2**20,
        str(path),
        got=f"{size / 2**30:.1f} GiB in run '{run.name}'",
        expected="at most 2 GiB, the limit of MATLAB files of version 5",
        hint="write netCDF, or record with a longer step.",
    )
    axes = identifiers([axis.name for axis in run.axes], _OWN)
    drawn_over = dict(zip([axis.name for axis in run.axes], axes, strict=True))
    names = identifiers([channel.name for channel in run.channels], [*_OWN, *axes])
    fields: dict[str, Any] = {"name": run.name, "label": run.label, "solver": run.solver}
    fields |= {name: axis.values for name, axis in zip(axes, run.axes, strict=True)}
    fields |= {name: channel.values for name, channel in zip(names, run.channels, strict=True)}
    numbers = identifiers([scalar.name for scalar in run.scalars])
    fields["numbers"] = {
        name: scalar.value for name, scalar in zip(numbers, run.scalars, strict=True)
    }
    fields["units"] = {
        **{name: axis.unit for name, axis in zip(axes, run.axes, strict=True)},
        **{name: channel.unit for name, channel in zip(names, run.channels, strict=True)},
        "numbers": {name: item.unit for name, item in zip(numbers, run.scalars, strict=True)},
    }
    fields["names"] = {
        **{name: axis.meaning for name, axis in zip(axes, run.axes, strict=True)},
        **{name: channel.name for name, channel in zip(names, run.channels, strict=True)},
        "numbers": {name: item.name for name, item in zip(numbers, run.scalars, strict=True)},
    }
    fields["axes"] = {
        name: drawn_over[channel.axis] for name, channel in zip(names, run.channels, strict=True)
    }
    return fields


def _padded(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _padded(member) for name, member in value.items()}
    return octave_text(value) if isinstance(value, str) else value
