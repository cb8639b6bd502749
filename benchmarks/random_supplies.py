"""Random sensible supplies of a valve: how many run, and how well their energy balances.

``uv run python benchmarks/random_supplies.py --count 500`` draws networks of pumps, check valves,
relief valves, accumulators, hoses, fittings, spool edges and openings over the whole range that an
engineer might ask for, runs each, and prints what failed and the largest energy residual;
``--seed`` begins elsewhere, ``--only N`` runs one draw and prints its case.  A run that stops must
say why: one of klack's own errors counts as told, anything else as failed.
"""

import json
from typing import Any

import numpy as np
from drawn_networks import run, run_draws

__all__ = ["draw", "main", "run"]

Rng = np.random.Generator
Part = dict[str, Any]

FLUIDS: tuple[str, ...] = ("water", "n-heptane", "diesel", "ISO VG 46", "ISO VG 32")


def draw(seed: int) -> str:
    """Return the text of the case of one draw; the same for the same seed."""
    rng = np.random.default_rng([2, seed])
    level = _log(rng, 3e5, 4e7)  # pressure of the supply [Pa]
    flow = _log(rng, 1e-6, 1e-3)  # [m^3/s]
    bore = float(np.sqrt(flow / 10.0))  # for some 10 m/s [m]
    parts: dict[str, Part] = {"source": _source(rng, flow, level)}
    joints: list[list[str]] = []
    outlet, rail = ["source.b", "outlet.fluid"], ["rail.fluid"]
    parts["outlet"] = _chamber(rng, bore, level)
    parts["rail"] = _chamber(rng, bore, level)
    _link(rng, parts, bore, level)
    outlet.append("link.a")
    rail.append("link.b")
    if rng.random() < 0.9:
        parts["relief"] = _relief(rng, level, flow)
        rail.append("relief.a")
        joints.append(["relief.b", "ambient"])
    if rng.random() < 0.6:
        parts["accumulator"] = _accumulator(rng, level, flow)
        (rail if rng.random() < 0.7 else outlet).append("accumulator.fluid")
    parts["room"] = _chamber(rng, bore, level)
    room = ["room.fluid", "face.fluid", "drain.a"]
    body = ["needle.tip", "seat.upper", "stop.lower", "spring.end", "face.body"]
    lift = _log(rng, 5e-5, 2e-3)
    force = level * 0.25 * np.pi * bore**2
    parts["needle"] = {
        "type": "rigid-mass",
        "mass": f"{_log(rng, 1e-3, 0.3)} kg",
        "points": ["tip"],
    }
    parts["spring"] = {
        "type": "spring",
        "stiffness": f"{0.3 * force / lift} N/m",
        "preload": f"{force * rng.uniform(0.0, 1.0)} N",
        "damping": "1 N*s/m",
    }
    law = {"kind": "linear", "stiffness": f"{np.clip(3e3 * force / lift, 1e6, 1e9)} N/m"}
    parts["seat"] = {"type": "end-stop", "gap": "0 m", "law": law, "restitution": 0.3}
    parts["stop"] = {"type": "end-stop", "gap": f"{lift} m", "law": law, "restitution": 0.3}
    parts["face"] = {"type": "pressure-face", "direction": "opening", "outer_diameter": f"{bore} m"}
    _opening(rng, parts, body, lift, bore)
    rail.append("inlet.a")
    room.append("inlet.b")
    parts["drain"] = {"type": "orifice", "diameter": f"{bore * rng.uniform(0.1, 0.7)} m"}
    joints += [
        ["drain.b", "ambient"],
        ["seat.lower", "ground"],
        ["stop.upper", "ground"],
        outlet,
        rail,
        room,
        body,
    ]
    network = {"components": parts, "connections": joints, "fluid": _fluid(rng)}
    run = {
        "duration": f"{_log(rng, 1e-3, 6e-3)} s",
        "step": str(rng.choice(["50 ns", "100 ns", "200 ns"])),
        "variants": ["wet"],
        "lift": "needle.tip",
    }
    return json.dumps({"klack": 1, "title": f"Draw {seed}", "network": network, "run": run})


def _log(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _source(rng: Rng, flow: float, level: float) -> Part:
    kind = rng.choice(["pump", "pulsating-flow", "flow-source"])
    if kind == "pump":
        turns = _log(rng, 10.0, 200.0)
        part: Part = {
            "type": "pump",
            "displacement": f"{flow / turns} m^3",
            "speed": f"{turns} 1/s",
        }
        if rng.random() < 0.8:
            part["pistons"] = int(rng.integers(1, 12))
        if rng.random() < 0.6:
            part["volumetric_efficiency"] = float(rng.uniform(0.7, 0.99))
            part["rated_pressure"] = f"{level} Pa"
        return part
    if kind == "pulsating-flow":
        sines = [
            {
                "frequency": f"{_log(rng, 50.0, 5e4)} Hz",
                "amplitude": f"{flow * rng.uniform(0.0, 2.0)} m^3/s",
                "phase": f"{rng.uniform(0.0, 360.0)} deg",
            }
            for _ in range(int(rng.integers(1, 4)))
        ]
        return {"type": "pulsating-flow", "mean": f"{flow} m^3/s", "harmonics": sines}
    step = {"to": f"{flow * rng.uniform(0.0, 3.0)} m^3/s", "at": "0.3 ms", "rise": "10 us"}
    return {"type": "flow-source", "flow": f"{flow} m^3/s", "step": step}


def _chamber(rng: Rng, bore: float, level: float) -> Part:
    part: Part = {"type": "chamber", "volume": f"{bore**3 * _log(rng, 1.0, 1e3)} m^3"}
    if rng.random() < 0.4:
        part["pressure"] = f"{level * _log(rng, 0.01, 1.0)} Pa"
    choice = rng.random()
    if choice < 0.25:
        part["wall"] = {"bulk_modulus": f"{_log(rng, 1e7, 1e10)} Pa"}
    elif choice < 0.5:
        part["wall"] = {
            "diameter": f"{2 * bore} m",
            "thickness": f"{_log(rng, 0.05, 3.0) * bore} m",
            "modulus": "200 GPa",
            "ends": str(rng.choice(["closed", "fixed", "sliding"])),
        }
    return part


def _link(rng: Rng, parts: dict[str, Part], bore: float, level: float) -> None:
    kind = rng.choice(["check-valve", "pressure-loss", "line", "pipe-friction"])
    if kind == "check-valve":
        crack = level * _log(rng, 1e-4, 0.3)
        parts["link"] = {
            "type": "check-valve",
            "cracking_pressure": f"{crack} Pa",
            "open_pressure": f"{crack * _log(rng, 1.01, 10.0)} Pa",
            "diameter": f"{bore * rng.uniform(0.3, 2.0)} m",
        }
        if rng.random() < 0.3:
            parts["link"]["leak_area"] = f"{1e-4 * bore**2} m^2"
    elif kind == "pressure-loss":
        parts["link"] = {
            "type": "pressure-loss",
            "diameter": f"{bore} m",
            "coefficient": _log(rng, 1e-3, 100.0),
            "reverse_coefficient": _log(rng, 1e-3, 100.0),
            "laminar_coefficient": _log(rng, 1.0, 1e4),
        }
    elif kind == "line":
        parts["link"] = {
            "type": "line",
            "length": f"{_log(rng, 0.05, 2.0)} m",
            "diameter": f"{bore} m",
            "pressure": f"{level} Pa",
        }
        if rng.random() < 0.5:
            parts["link"]["wall"] = {"bulk_modulus": f"{_log(rng, 1e8, 1e10)} Pa"}
    else:
        parts["link"] = {
            "type": "pipe-friction",
            "length": f"{_log(rng, 0.01, 3.0)} m",
            "diameter": f"{bore} m",
            "roughness": f"{_log(rng, 1e-6, 0.05) * bore} m",
        }


def _relief(rng: Rng, level: float, flow: float) -> Part:
    above = level * _log(rng, 1e-3, 1.0)
    part: Part = {
        "type": "relief-valve",
        "set_pressure": f"{level} Pa",
        "rated_pressure": f"{level + above} Pa",
        "rated_flow": f"{flow} m^3/s",
        "area": f"{5.0 * flow / np.sqrt(2.0 * level / 1000.0)} m^2",
    }
    if rng.random() < 0.5:
        part["hysteresis"] = f"{level * _log(rng, 1e-3, 0.3)} Pa"
    if rng.random() < 0.5:
        part["time_constant"] = f"{_log(rng, 1e-6, 1e-2)} s"
    return part


def _accumulator(rng: Rng, level: float, flow: float) -> Part:
    part: Part = {
        "type": "accumulator",
        "volume": f"{flow * _log(rng, 1e-4, 1.0)} m^3",
        "precharge": f"{level * _log(rng, 0.1, 1.3)} Pa",
        "exponent": float(rng.uniform(1.0, 1.8)),
        "full_at": _log(rng, 0.05, 0.9),
    }
    if rng.random() < 0.5:
        part["inlet_diameter"] = f"{_log(rng, 2e-4, 2e-2)} m"
    return part


def _opening(rng: Rng, parts: dict[str, Part], body: list[str], lift: float, bore: float) -> None:
    kind = rng.choice(["lift", "time", "spool"])
    area = 0.25 * np.pi * bore**2
    if kind == "spool":
        parts["inlet"] = {
            "type": "spool-edge",
            "diameter": f"{2 * bore} m",
            "radial_clearance": f"{_log(rng, 1e-6, 2e-5)} m",
            "overlap": f"{lift * rng.uniform(-1.0, 1.0)} m",
            "direction": str(rng.choice(["opening", "closing"])),
            "eccentricity": float(rng.uniform(0.0, 1.0)),
        }
        if rng.random() < 0.6:
            parts["inlet"]["flow_force"] = {"velocity_coefficient": 0.98}
        body.append("inlet.spool")
        return
    shares = [float(x) for x in rng.choice([0.0, 0.01, 0.3, 1.0], 4)]
    if kind == "lift":
        points = [f"{lift * x} m" for x in (-0.1, 0.2, 0.5, 1.0)]
        body.append("inlet.needle")
    else:
        points = [f"{x} s" for x in (0.0, 2e-4, 2.1e-4, 8e-4)]
        shares[0] = shares[1]
    parts["inlet"] = {
        "type": "variable-orifice",
        str(kind): points,
        "area": [f"{area * x} m^2" for x in shares],
    }


def _fluid(rng: Rng) -> Any:
    name = str(rng.choice(FLUIDS))
    if rng.random() < 0.5:
        return name
    return {"name": name, "gas_fraction": _log(rng, 1e-5, 1e-2)}


def main() -> int:
    """Run draws, and print what failed and the largest residual."""
    return run_draws(draw, about=__doc__, count=300)


if __name__ == "__main__":
    raise SystemExit(main())
