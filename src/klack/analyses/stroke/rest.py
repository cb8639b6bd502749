"""Note on a stroke in which nothing moves, with the missing force."""

import numpy as np

from klack.simulation.network_result import NetworkResult

__all__ = ["rest_note"]


def rest_note(variant: str, result: NetworkResult, seat: str) -> str:
    """Note that the needle never left its seat; empty if it did.

    The smallest force on the seat is what was missing to lift it at the best moment.

    Parameters
    ----------
    variant : str
    result : NetworkResult
    seat : str
        Component.
    """
    pressing = result.channels.get(f"{seat} contact force")
    if pressing is None or pressing.values.size < 2:
        return ""
    force = pressing.values
    if not np.all(force > 0.0):
        return ""
    return (
        f"'{variant}': the needle never left its seat. It was pressed on '{seat}' with "
        f"{force[0]:.3g} N at first, and {force.min():.3g} N were still missing to lift it at "
        f"{1e3 * result.time[int(np.argmin(force))]:.3g} ms. Check the preload of the spring, "
        "the current and the force of the magnet, the pressures, and the signs: forces that open "
        "are positive."
    )
