"""A full-order receptance as an entry of the cache, and back."""

import json

import numpy as np

from klack.cache.entry import Entry
from klack.reduction.full_order import FullOrderReceptance
from klack.reduction.receptance import Receptance

__all__ = ["entry_of_receptance", "receptance_of_entry"]


def entry_of_receptance(full: FullOrderReceptance) -> Entry:
    """Numbers and names of a receptance."""
    receptance = full.receptance
    names = {
        "label": receptance.label,
        "ports": list(receptance.port_names),
        "basis size": full.basis_size,
    }
    return Entry(
        arrays={
            "frequencies": np.asarray(receptance.frequencies),
            "values": np.ascontiguousarray(receptance.values),
            "error bound": full.error_bound,
            "checked frequencies": full.checked_frequencies,
            "checked deviations": full.checked_deviations,
        },
        text=json.dumps(names),
    )


def receptance_of_entry(entry: Entry) -> FullOrderReceptance:
    """Inverse of :func:`entry_of_receptance`."""
    names, arrays = json.loads(entry.text), entry.arrays
    return FullOrderReceptance(
        receptance=Receptance(
            label=names["label"],
            port_names=tuple(names["ports"]),
            frequencies=arrays["frequencies"],
            values=arrays["values"],
        ),
        basis_size=names["basis size"],
        error_bound=arrays["error bound"],
        checked_frequencies=arrays["checked frequencies"],
        checked_deviations=arrays["checked deviations"],
    )
