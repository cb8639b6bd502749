"""Forces of stops as forces at the ports of a structure, on one grid of intervals."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.reduction.structure import Structure
from klack.signals import TimeSeries

__all__ = ["aligned_forces", "port_forces"]


def port_forces(
    structure: Structure, stop_forces: Mapping[str, TimeSeries]
) -> dict[str, TimeSeries]:
    """Forces along +z at the ports that the given stops push.

    Parameters
    ----------
    structure : Structure
    stop_forces : mapping of stop name to TimeSeries [N]
        Above zero when the stop presses.
    """
    result = {}
    for port, stop, sign in zip(
        structure.port_names, structure.port_stops, structure.port_signs, strict=True
    ):
        if stop in stop_forces:
            given = stop_forces[stop]
            result[port] = TimeSeries(
                step=given.step,
                values=float(sign) * given.values,
                unit=given.unit,
                start=given.start,
                name=f"{structure.name}.{port}",
            )
    return result


def aligned_forces(
    structure: Structure, forces: Mapping[str, TimeSeries]
) -> tuple[TimeSeries, NDArray[np.float64]]:
    """One of the forces, for its time axis, and the forces at all ports, shape (n, p) [N].

    Raises
    ------
    InputError
        Without a force, for an unknown port, or for forces on different grids.
    """
    if not forces:
        raise InputError(
            f"forces on '{structure.name}'",
            got="none",
            expected=f"a force at one or more of: {', '.join(structure.port_names)}",
            hint="port_forces makes them from the forces of the stops.",
        )
    first = next(iter(forces.values()))
    result = np.zeros((first.values.size, len(structure.port_names)))
    for name, force in forces.items():
        same = (
            force.values.size == first.values.size
            and abs(force.step / first.step - 1.0) < 1e-9
            and abs(force.start - first.start) < 1e-6 * first.step
        )
        if not same:
            raise InputError(
                f"forces on '{structure.name}': '{name}'",
                got=f"{force.values.size} values every {force.step:g} s from {force.start:g} s",
                expected=f"{first.values.size} every {first.step:g} s from {first.start:g} s",
                hint="bring all forces onto one grid.",
            )
        result[:, structure.port_index(name)] = force.values
    return first, result
