"""Growth with the number of volumes: a wet stroke with chambers and orifices behind its inlet.

``uv run --group dev python benchmarks/run.py --only volumes``.  The valve is that of ``stroke.py``.
Beyond it up to 200 chambers of 50 mm^3 hang at its inlet in a row, in a ring, or each of them there
(star).  What they add is the time of the loop less that without them; an exponent of 1 is linear.
"""

from time import process_time

import numpy as np
from number import Number, Size, exponent
from stroke import COARSE, RECORD, STEP, valves

from klack.network.component import Component
from klack.network.network import Network
from klack.simulation.network_run import simulate_network
from klack.verification.benches import component

__all__ = ["joined", "numbers"]

_COUNTS: dict[Size, tuple[int, ...]] = {
    "smallest": (2, 4),
    "quick": (5, 50, 200),
    "full": (1, 2, 5, 10, 20, 50, 100, 200),
}
_FIRST = 5  # volumes that the exponent is fitted from
_PRESSURE = 6.013e5  # [Pa]


def numbers(size: Size) -> list[Number]:
    """Time of the loop and around it over the number of volumes, with exponents of what is added.

    Beside each stands the energy residual.
    """
    duration, repeats = (50e-6, 1) if size == "smallest" else (2e-3, 3)
    counts, found = _COUNTS[size], []
    for structure in ("chain", "ring", "star"):
        alone, _, _ = _measure(joined(structure, 0), duration, repeats)
        points = []
        for count in counts:
            loop, around, residual = _measure(joined(structure, count), duration, repeats)
            points.append((float(count), loop - alone))
            for what, seconds in (("loop", loop), ("layout, start and record", around)):
                found.append(
                    Number(
                        name=f"volumes, {structure} of {count}: {what}",
                        value=seconds,
                        unit="s",
                        accuracy=residual,
                        accuracy_of="energy residual",
                        series=f"{structure}, {what}",
                        at=count,
                    )
                )
        fitted = [point for point in points if point[0] >= _FIRST] or points
        slope = exponent(*(list(axis) for axis in zip(*fitted, strict=True)))
        name = f"volumes, {structure}: exponent of the time that they add to the loop"
        goal = None if size == "smallest" else 1.1
        found.append(Number(name=name, value=slope, unit="-", goal=goal))
    return found


def joined(structure: str, count: int) -> Network:
    """The wet valve with so many more chambers, each behind an orifice."""
    valve = valves()["wet"]
    parts: dict[str, Component] = dict(valve.components)
    joints = [list(joint) for joint in valve.connections]
    inlet = next(joint for joint in joints if "inlet.fluid" in joint)
    rooms = [inlet] + [[f"room{k}.fluid"] for k in range(count)]
    ways = [(0 if structure == "star" else k, k + 1) for k in range(count)]
    if structure == "ring" and count > 2:
        ways.append((count, 1))
    for k in range(count):
        parts[f"room{k}"] = component("chamber", volume=50e-9, pressure=_PRESSURE)
    for k, (a, b) in enumerate(ways):
        parts[f"way{k}"] = component("orifice", diameter=0.8e-3)
        rooms[a].append(f"way{k}.a")
        rooms[b].append(f"way{k}.b")
    return Network(parts, joints + rooms[1:], fluid=valve.fluid)


def _measure(network: Network, duration: float, repeats: int) -> tuple[float, float, float]:
    """Seconds of the loop, processor seconds around it, energy residual; best of several."""
    loop, around, residual = np.inf, np.inf, 0.0
    for _ in range(repeats + 1):  # the first one may compile
        begin = process_time()
        rows = network.rows()
        run = simulate_network(rows, duration=duration, step=STEP, coarse=COARSE, record=RECORD)
        whole = process_time() - begin
        loop, residual = min(loop, run.wall_time), run.books.relative_residual
        around = min(around, max(whole - run.wall_time, 0.0))
    return loop, around, residual
