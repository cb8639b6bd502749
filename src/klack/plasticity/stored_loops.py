"""Static loops of faces that yield as arrays, to keep them in the cache and to take them back."""

import numpy as np

from klack.cache.entry import Entry
from klack.contact.pressure_limit import PressureLimit
from klack.plasticity.ladder import LoadingState
from klack.plasticity.loops import Opening, YieldingLoops

__all__ = ["loops_of_entry", "loops_to_entry"]


def loops_to_entry(loops: YieldingLoops) -> Entry:
    """Arrays of the loops."""
    openings = (loops.elastic, *loops.openings)
    count = len(loops.elastic.approach)
    points = len(loops.states[0].pressures) if loops.states else 0
    shape, limit = (len(loops.states), points), loops.pressure_limit
    return Entry(
        arrays={
            "first yield": np.array([loops.first_yield]),
            "approach": np.array([one.approach for one in openings]).reshape(-1, count),
            "force": np.array([one.force for one in openings]).reshape(-1, count),
            "states": np.array(
                [
                    (s.approach, s.force, s.plastic_work, s.plastic_strain, float(s.rounds))
                    for s in loops.states
                ]
            ).reshape(-1, 5),
            "pressures": np.array([s.pressures for s in loops.states]).reshape(shape),
            "plastic gap": np.array([s.plastic_gap for s in loops.states]).reshape(shape),
            "taken": loops.taken,
            "half width": loops.half_width,
            "radius": loops.radius,
            "pressure limit": np.zeros((2, 0))
            if limit is None
            else np.array([limit.set, limit.pressure]),
        },
        text=loops.limit,
    )


def loops_of_entry(entry: Entry) -> YieldingLoops:
    """Loops of :func:`loops_to_entry`."""
    arrays = entry.arrays
    sets, pressures = arrays["pressure limit"]
    elastic, *openings = (
        Opening(approach=approach, force=force)
        for approach, force in zip(arrays["approach"], arrays["force"], strict=True)
    )
    rows = zip(arrays["states"], arrays["pressures"], arrays["plastic gap"], strict=True)
    return YieldingLoops(
        first_yield=float(arrays["first yield"][0]),
        elastic=elastic,
        states=tuple(
            LoadingState(
                approach=float(state[0]),
                force=float(state[1]),
                pressures=pressures,
                plastic_gap=plastic_gap,
                plastic_work=float(state[2]),
                plastic_strain=float(state[3]),
                rounds=int(state[4]),
            )
            for state, pressures, plastic_gap in rows
        ),
        openings=tuple(openings),
        taken=arrays["taken"],
        half_width=arrays["half width"],
        radius=arrays["radius"],
        limit=entry.text,
        pressure_limit=PressureLimit(set=sets, pressure=pressures) if len(sets) else None,
    )
