"""Missing parts of a stroke: early ends, truncated fine records."""

from collections.abc import Mapping, Sequence

import numpy as np

from klack.analyses.stroke.record import StrokeVariant
from klack.case.valve_roles import ValveRoles
from klack.simulation.network_result import NetworkResult
from klack.units import format_si

__all__ = ["cut_records", "missing_notes", "rest_note"]


def missing_notes(
    variants: Mapping[str, StrokeVariant], not_run: Sequence[str], failure: Exception | None
) -> tuple[str, ...]:
    """What is missing in the variants of a study; empty if nothing is.

    ``not_run`` are asked-for variants without a record, ``failure`` what ended the study.
    """
    notes = []
    for name, variant in variants.items():
        result = variant.result
        if result.failure:
            end = format_si(float(result.time[-1]), "s", 6)
            notes.append(f"'{name}' is incomplete, it ends at {end}: {_line(result.failure)}")
        cut = cut_records(result)
        if cut:
            ends = ", ".join(f"of '{stop}' at {format_si(t, 's', 4)}" for stop, t in cut.items())
            notes.append(
                f"'{name}': the record of the forces in fine steps is full and ends early: {ends}. "
                "Impacts and channels are complete to the end of the run; curves of later impacts "
                "are not."
            )
    if not_run and failure is not None:
        because = "" if any(v.result.failure for v in variants.values()) else f": {_line(failure)}"
        notes.append(f"not computed: {', '.join(not_run)}, because the run failed{because}")
    return tuple(notes)


def cut_records(result: NetworkResult) -> dict[str, float]:
    """Stops whose fine record was full early, and where it ends [s]."""
    return {
        stop: float(record.time[-1] + record.step[-1]) if record.time.size else float("nan")
        for stop, record in result.interfaces.items()
        if not record.complete
    }


def _line(text: object) -> str:
    return " ".join(str(text).split())


def rest_note(variant: str, result: NetworkResult, roles: ValveRoles) -> str:
    """Note that the needle never left its seat; empty if it did.

    It tells the smallest force on the seat, which was missing to lift it; or, where the needle left
    another body that stayed on the seat, that the seat may be another one.
    """
    seat, own = roles.seat, roles.own_seat
    pressing = result.channels.get(f"{seat} contact force")
    if pressing is None or pressing.values.size < 2:
        return ""
    force = pressing.values
    if not np.all(force > 0.0):
        return ""
    left = result.channels.get(f"{own} contact force")
    if left is not None and not np.all(left.values > 0.0):
        return (
            f"'{variant}': '{roles.needle}' opened at '{own}', and the body below stayed on "
            f"'{seat}', with {force.min():.3g} N or more. '{seat}' is taken as the seat. If that "
            f"body is meant to stay, as an insert, write 'run: {{seat: {own}}}'; if it is meant "
            "to open, check the forces on it."
        )
    return (
        f"'{variant}': the needle never left its seat. It was pressed on '{seat}' with "
        f"{force[0]:.3g} N at first, and {force.min():.3g} N were still missing to lift it at "
        f"{1e3 * result.time[int(np.argmin(force))]:.3g} ms. Check the preload of the spring, "
        "the current and the force of the magnet, the pressures, and the signs: forces that open "
        "are positive."
    )
