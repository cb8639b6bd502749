"""How far points of a scan dominate the front of a search.

Run: python benchmarks/scan_against_front.py SEARCH SCAN, two folders with results of klack optimise
and klack study of the same case.
"""

import re
import sys

import numpy as np

import klack
from klack.units import KINDS, parse_quantity


def main(search: str, scan: str) -> None:
    """Print the largest share of the front's range by which a point of the scan dominates it."""
    record = klack.load_result(search).record
    found = record.optimum
    assert found is not None
    signs = np.array([1.0 if way == "minimise" else -1.0 for way in found.ways])
    front = _table(record, found.objectives)[found.front] * signs
    other = klack.load_result(scan).record
    points = _table(other, found.objectives) * signs
    points = points[np.isfinite(points).all(axis=1) & _keeps(other, found.bounds)]
    spans = np.ptp(front, axis=0)
    # a point dominates one of the front by the smallest of its leads
    lead = np.array([np.min((front - point) / spans, axis=1).max() for point in points])
    print(f"front: {len(front)} points, ranges {spans}")
    print(f"scan: {len(points)} points, {np.sum(lead > 0.0)} dominate a point of the front")
    print(f"largest lead: {100.0 * max(lead.max(), 0.0):.2f} % of the ranges")


def _keeps(record, bounds):
    """Points of a study that keep bounds as an optimisation words them."""
    own = {item.name: item for item in record.measures}
    kept = np.ones(record.count, dtype=bool)
    for text in bounds:
        name, way, value = re.fullmatch(r"(\S+) at (most|least) (.+)", text).groups()
        kind = next(kind for kind in KINDS if kind.unit == own[name].unit)
        sign = 1.0 if way == "most" else -1.0
        kept &= sign * own[name].values <= sign * parse_quantity(value, kind)
    return kept


def _table(record, names):
    own = {item.name: item.values for item in record.measures}
    return np.column_stack([own[name] for name in names])


if __name__ == "__main__":
    main(*sys.argv[1:])
