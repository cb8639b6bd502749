"""Random networks of lines and junctions: how many run, and how well energy and mass balance.

``uv run python benchmarks/random_lines.py --count 100`` draws trees and rings of lines of any
length and bore that meet in junctions and chambers, fed by pressures that jump and flows that
pulsate, with orifices, losses and openings at the junctions; ``--seed`` begins elsewhere,
``--only N`` runs one draw and prints its case.
"""

import json
from typing import Any

import numpy as np
from drawn_networks import run, run_draws

__all__ = ["draw", "main", "run"]

Rng = np.random.Generator
Part = dict[str, Any]

_OTHER_KINDS = 1000  # draws from here on have turbulent lines and lines of local properties too
FLUIDS: tuple[str, ...] = ("water", "n-heptane", "diesel", "ISO VG 46")


def draw(seed: int) -> str:
    """Return the text of the case of one draw; the same for the same seed."""
    rng = np.random.default_rng([3, seed])
    level = _log(rng, 5e5, 5e7)  # pressure of the supply [Pa]
    bore = _log(rng, 5e-4, 1e-2)  # [m]
    parts: dict[str, Part] = {"source": _source(rng, level)}
    nodes: list[list[str]] = [["source.fluid"]]
    for k in range(int(rng.integers(2, 6))):
        nodes.append([_room(rng, parts, k, bore)])
        _line(rng, parts, nodes, (int(rng.integers(0, k + 1)), k + 1), bore)
    for _ring in range(int(rng.integers(0, 3))):
        a, b = rng.choice(len(nodes), 2, replace=False)
        _line(rng, parts, nodes, (int(a), int(b)), bore)
    for _end in range(int(rng.integers(1, 4))):
        _outlet(rng, parts, nodes[int(rng.integers(1, len(nodes)))], bore)
    parts["needle"] = {
        "type": "rigid-mass",
        "mass": "2 g",
        "points": ["tip"],
    }  # a network needs one
    parts["spring"] = {"type": "spring", "stiffness": "500 N/mm", "preload": "0 N"}
    if seed >= _OTHER_KINDS:
        _other_kinds(np.random.default_rng([4, seed]), parts)
    joints = [*nodes, *parts.pop("joints", []), ["needle.tip", "spring.end"]]
    network = {
        "components": parts,
        "connections": [joint for joint in joints if len(joint) > 1],
        "fluid": _fluid(rng),
    }
    run = {
        "duration": f"{_log(rng, 1e-3, 3e-3)} s",
        "step": str(rng.choice(["50 ns", "100 ns", "200 ns"])),
        "variants": ["wet"],
        "lift": "needle.tip",
    }
    return json.dumps({"klack": 1, "title": f"Draw {seed}", "network": network, "run": run})


def _log(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _source(rng: Rng, level: float) -> Part:
    part: Part = {"type": "pressure-source", "pressure": f"{level} Pa"}
    if rng.random() < 0.7:
        part["step"] = {
            "to": f"{level * rng.uniform(0.8, 1.5)} Pa",
            "at": "0.1 ms",
            "rise": str(rng.choice(["0.1 us", "1 us", "50 us"])),
        }
    return part


def _room(rng: Rng, parts: dict[str, Part], k: int, bore: float) -> str:
    """Add what is at the end of a line: seldom a chamber; its port."""
    if rng.random() < 0.25:
        volume = bore**3 * _log(rng, 0.1, 1e3)
        parts[f"room{k}"] = {"type": "chamber", "volume": f"{volume} m^3"}
        return f"room{k}.fluid"
    parts[f"tee{k}"] = {"type": "junction"}
    return f"tee{k}.fluid"


def _line(
    rng: Rng, parts: dict[str, Part], nodes: list[list[str]], ends: tuple[int, int], bore: float
) -> None:
    name = f"line{sum(part['type'] == 'line' for part in parts.values() if 'type' in part)}"
    parts[name] = {
        "type": "line",
        "length": f"{_log(rng, 0.02, 1.0)} m",
        "diameter": f"{bore * _log(rng, 0.3, 3.0)} m",
        "friction": str(rng.choice(["steady", "kagawa"])),
        "segments": int(rng.integers(1, 5)),
    }
    if rng.random() < 0.2:
        parts[name]["wall"] = {"bulk_modulus": f"{_log(rng, 1e8, 1e10)} Pa"}
    for port, node in zip("ab", ends, strict=True):
        nodes[node].append(f"{name}.{port}")


def _other_kinds(rng: Rng, parts: dict[str, Any]) -> None:
    """Make some lines turbulent, and some of local properties."""
    for part in parts.values():
        if not isinstance(part, dict) or part["type"] != "line":
            continue
        if rng.random() < 0.35:
            part |= {"friction": "turbulent", "roughness": f"{_log(rng, 1e-7, 1e-5)} m"}
        if rng.random() < 0.15:
            part |= {"properties": "local", "cells": int(rng.integers(10, 80))}
            del part["segments"]


def _outlet(rng: Rng, parts: dict[str, Any], node: list[str], bore: float) -> None:
    k = sum("out" in name for name in parts)
    name, kind = f"out{k}", rng.choice(["orifice", "loss", "opening", "flow"])
    hole = bore * rng.uniform(0.05, 1.0)
    part: Part = {"type": "orifice", "diameter": f"{hole} m"}
    if kind == "loss":
        part = {"type": "pressure-loss", "diameter": f"{hole} m", "coefficient": _log(rng, 0.1, 50)}
    elif kind == "opening":
        area = 0.25 * np.pi * hole**2
        points = ["0 s", "0.2 ms", "0.21 ms", "0.6 ms"]
        shares = [float(x) for x in rng.choice([0.0, 0.01, 0.3, 1.0], 4)]
        shares[0] = shares[1]
        areas = [f"{area * x} m^2" for x in shares]
        part = {"type": "variable-orifice", "time": points, "area": areas}
    elif kind == "flow":
        flow = 0.1 * 0.25 * np.pi * hole**2
        sines = [{"frequency": f"{_log(rng, 50.0, 5e4)} Hz", "amplitude": f"{flow} m^3/s"}]
        part = {"type": "pulsating-flow", "mean": f"{flow} m^3/s", "harmonics": sines}
    parts[name] = part
    node.append(f"{name}.b" if kind == "flow" else f"{name}.a")
    if kind != "flow":
        parts.setdefault("joints", []).append([f"{name}.b", "ambient"])


def _fluid(rng: Rng) -> Any:
    name = str(rng.choice(FLUIDS))
    if rng.random() < 0.5:
        return name
    return {"name": name, "gas_fraction": _log(rng, 1e-5, 1e-3)}


def main() -> int:
    """Run draws, and print what failed and the largest residual."""
    return run_draws(draw, about=__doc__, count=100)


if __name__ == "__main__":
    raise SystemExit(main())
