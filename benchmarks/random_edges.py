"""Random sensible spools with notches, needle edges on cones, and pneumatic valves.

``uv run python benchmarks/random_edges.py --count 300`` draws one valve after the other over the
whole range that an engineer might ask for, up to its limits: notches as deep as the clearance or
as half of the spool, tips almost parallel to their seat, strokes far beyond either, gases from
vacuum to 200 bar.  Each is run, and what failed is printed with the largest energy residual;
``--seed`` begins elsewhere, ``--only N`` runs one draw and prints its case.  A run that stops must
say why: one of klack's own errors counts as told, anything else as failed.
"""

import json
from math import pi
from typing import Any

import numpy as np
from drawn_networks import run, run_draws

__all__ = ["draw", "main", "run"]

Rng = np.random.Generator
Part = dict[str, Any]

FLUIDS: tuple[str, ...] = ("water", "n-heptane", "diesel", "ISO VG 46", "ISO VG 32")
GASES: tuple[str, ...] = ("air", "nitrogen", "hydrogen", "helium", "methane")


def draw(seed: int) -> str:
    """Return the text of the case of one draw; the same for the same seed."""
    rng = np.random.default_rng([3, seed])
    kind = rng.choice(["spool", "needle", "gas"])
    bore, lift = _log(rng, 5e-4, 2e-2), _log(rng, 2e-5, 3e-3)
    level = _log(rng, 2e5, 2e7) if kind == "gas" else _log(rng, 3e5, 1e8)
    force = level * 0.25 * pi * bore**2
    parts: dict[str, Part] = {
        "body": {"type": "rigid-mass", "mass": f"{_log(rng, 1e-3, 0.3)} kg", "points": ["tip"]},
        "spring": {
            "type": "spring",
            "stiffness": f"{0.3 * force / lift} N/m",
            "preload": f"{force * rng.uniform(0.0, 1.2)} N",
            "damping": "1 N*s/m",
        },
        "push": {
            "type": "force-over-time",
            "time": ["0 ms", "0.1 ms", "0.2 ms", "1.5 ms", "1.6 ms"],
            "force": [f"{force * x} N" for x in (0.0, 0.0, 1.5, 1.5, 0.0)],
        },
    }
    law = {"kind": "linear", "stiffness": f"{np.clip(3e3 * force / lift, 1e6, 1e9)} N/m"}
    parts["seat"] = {"type": "end-stop", "gap": "0 m", "law": law, "restitution": 0.3}
    parts["stop"] = {"type": "end-stop", "gap": f"{lift} m", "law": law, "restitution": 0.3}
    joints = [
        ["body.tip", "seat.upper", "stop.lower", "spring.end", "push.end"],
        ["seat.lower", "ground"],
        ["stop.upper", "ground"],
    ]
    network: dict[str, Any] = {"components": parts, "connections": joints}
    {"spool": _spool, "needle": _needle, "gas": _gas}[str(kind)](rng, network, bore, lift, level)
    times = {"duration": f"{_log(rng, 1e-3, 4e-3)} s"}
    times["step"] = str(rng.choice(["50 ns", "100 ns", "200 ns"]))
    running = {**times, "variants": ["wet"], "lift": "body.tip"}
    return json.dumps({"klack": 1, "title": f"Draw {seed}", "network": network, "run": running})


def _log(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _room(rng: Rng, bore: float, level: float) -> Part:
    part: Part = {"type": "chamber", "volume": f"{bore**3 * _log(rng, 0.3, 1e3)} m^3"}
    if rng.random() < 0.4:
        part["pressure"] = f"{level * _log(rng, 0.01, 1.0)} Pa"
    return part


def _liquid(rng: Rng, network: dict[str, Any], bore: float, level: float) -> None:
    """A rail, a room behind the opening, and its drain."""
    fluid = str(rng.choice(FLUIDS))
    network["fluid"] = fluid
    if rng.random() < 0.5:
        network["fluid"] = {"name": fluid, "gas_fraction": _log(rng, 1e-5, 1e-2)}
    parts, joints = network["components"], network["connections"]
    parts["rail"] = {"type": "pressure-source", "pressure": f"{level} Pa"}
    parts["room"] = _room(rng, bore, level)
    parts["drain"] = {"type": "orifice", "diameter": f"{bore * rng.uniform(0.05, 0.7)} m"}
    joints.append(["drain.b", "ambient"])


def _notch(rng: Rng, bore: float, lift: float, clearance: float) -> Part:
    shape = str(rng.choice(["rectangular", "triangular", "round", "hole"]))
    count = int(rng.integers(1, 7))
    width = pi * bore / count * _log(rng, 0.01, 0.3)
    part: Part = {"shape": shape, "count": count, "width": f"{width} m"}
    length = lift * _log(rng, 0.01, 3.0)
    if shape == "hole":
        part["length"] = f"{width + length} m"
        return part
    part["length"] = f"{length} m"
    part["depth"] = f"{_log(rng, 1.001 * clearance, 0.499 * bore)} m"
    return part


def _spool(rng: Rng, network: dict[str, Any], bore: float, lift: float, level: float) -> None:
    _liquid(rng, network, bore, level)
    parts, joints = network["components"], network["connections"]
    clearance = _log(rng, 1e-6, 2e-5)
    notches = [_notch(rng, bore, lift, clearance) for _ in range(int(rng.integers(1, 4)))]
    parts["edge"] = {
        "type": "spool-edge",
        "diameter": f"{bore} m",
        "radial_clearance": f"{clearance} m",
        "overlap": f"{lift * rng.uniform(-1.0, 1.5)} m",
        "direction": str(rng.choice(["opening", "closing"])),
        "eccentricity": float(rng.uniform(0.0, 1.0)),
        "notches": notches,
    }
    if rng.random() < 0.7:
        parts["edge"]["flow_force"] = {}
    if rng.random() < 0.2:
        parts["edge"]["width"] = "0 m"
    if rng.random() < 0.2:
        parts["edge"]["largest_area"] = f"{0.1 * bore**2} m^2"
    parts["face"] = {"type": "pressure-face", "direction": "opening", "outer_diameter": f"{bore} m"}
    joints[0] += ["edge.spool", "face.body"]
    joints += [["rail.fluid", "edge.a"], ["edge.b", "room.fluid", "drain.a", "face.fluid"]]


def _needle(rng: Rng, network: dict[str, Any], bore: float, lift: float, level: float) -> None:
    _liquid(rng, network, bore, level)
    parts, joints = network["components"], network["connections"]
    seat = rng.uniform(15.0, 70.0)
    tip = seat + _log(rng, 1e-2, 89.0 - seat)
    edge = bore * rng.uniform(0.3, 0.95)
    parts["cone"] = cone = {
        "type": "conical-seat",
        "half_angle": f"{seat} deg",
        "upper_diameter": f"{bore} m",
        "lower_diameter": f"{edge * rng.uniform(0.2, 0.97)} m",
        "edge_diameter": f"{edge} m",
        "tip_half_angle": f"{tip} deg",
        "shank_half_angle": f"{seat * rng.uniform(0.0, 0.98)} deg",
    }
    if rng.random() < 0.7:
        cone["flow_force"] = {}
    if rng.random() < 0.4:
        cone["leak_area"] = f"{1e-4 * bore**2} m^2"
    follows = rng.random() < 0.7
    low, high = ("a", "b") if rng.random() < 0.5 else ("b", "a")
    if follows:
        cone["tip_side"] = low
    parts["above"] = {
        "type": "pressure-face",
        "direction": "opening",
        "outer_diameter": f"{bore * rng.uniform(1.0, 1.5)} m",
        "inner_diameter": f"{edge} m",
    }
    parts["below"] = {
        "type": "pressure-face",
        "direction": "opening",
        "outer_diameter": f"{edge} m",
    }
    joints[0] += ["cone.needle", "above.body", "below.body"]
    outside, inside = [f"cone.{high}", "above.fluid"], [f"cone.{low}", "below.fluid"]
    (outside if rng.random() < 0.5 else inside).append("rail.fluid")
    for node in (outside, inside):
        if "rail.fluid" not in node:
            node += ["room.fluid", "drain.a"]
    joints += [outside, inside]


def _gas(rng: Rng, network: dict[str, Any], bore: float, lift: float, level: float) -> None:
    parts, joints = network["components"], network["connections"]
    network["gas"] = str(rng.choice(GASES))
    parts["rail"] = {"type": "gas-source", "pressure": f"{level} Pa"}
    choice = rng.random()
    if choice < 0.3:
        low = level * _log(rng, 1e-4, 1.0)
        parts["rail"]["step"] = {"to": f"{low} Pa", "at": "0.5 ms", "rise": "50 us"}
    parts["room"] = room = {
        "type": "gas-chamber",
        "volume": f"{bore**2 * lift * _log(rng, 0.5, 1e3)} m^3",
    }
    if rng.random() < 0.5:
        room["pressure"] = f"{_log(rng, 1.0, level)} Pa"
    if rng.random() < 0.3:
        room["isothermal"] = True
    elif rng.random() < 0.5:
        room["heat_conductance"] = f"{_log(rng, 1e-4, 10.0)} W/K"
    parts["drain"] = {
        "type": "gas-orifice",
        "conductance": f"{2e5 * bore**2 * _log(rng, 1e-3, 1.0)} l/s/bar",
        "critical_ratio": float(rng.uniform(0.1, 0.5)),
    }
    parts["throat"] = {
        "type": "gas-valve",
        "diameter": f"{bore * rng.uniform(0.3, 0.9)} m",
    }
    parts["face"] = {
        "type": "gas-face",
        "direction": str(rng.choice(["opening", "closing"])),
        "outer_diameter": f"{bore} m",
    }
    joints[0] += ["throat.needle", "face.body"]
    joints += [
        ["rail.gas", "throat.a"],
        ["throat.b", "room.gas", "drain.a", "face.gas"],
        ["drain.b", "ambient"],
    ]


def main() -> int:
    """Run draws, and print what failed and the largest residual."""
    return run_draws(draw, about=__doc__, count=300)


if __name__ == "__main__":
    raise SystemExit(main())
