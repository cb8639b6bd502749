"""Random sensible magnets and drivers of a valve: how many run, and how well their energy balances.

``uv run python benchmarks/random_magnets.py --count 100`` draws valves of one needle or two, each
with a magnet of one to three coils: solenoids and networks with eddy currents, hysteresis, a
permanent magnet and a warm winding, every driver in any order, boost capacitors of their own or
shared.  It runs each, and prints what failed and the largest energy residual; ``--seed`` begins
elsewhere, ``--only N`` runs one draw and prints its case.
"""

import json
from typing import Any

import numpy as np
from drawn_networks import run, run_draws

__all__ = ["draw", "main", "run"]

Rng = np.random.Generator
Part = dict[str, Any]

IRON: tuple[str, ...] = ("X6Cr17", "VACOFER S2", "M330-50A")


def draw(seed: int) -> str:
    """Return the text of the case of one draw; the same for the same seed."""
    rng = np.random.default_rng([4, seed])
    parts: dict[str, Part] = {}
    joints: list[list[str]] = []
    drawing: list[str] = []
    end = _log(rng, 3e-4, 3e-3)
    for name in ("first", "second")[: int(rng.integers(1, 3))]:
        _valve(rng, parts, joints, drawing, name, end)
    if drawing:
        parts["bank"] = {
            "type": "boost-capacitor",
            "capacitance": f"{_log(rng, 1e-6, 1e-3)} F",
            "voltage": f"{_log(rng, 20.0, 150.0)} V",
            "recharge_power": f"{float(rng.choice([0.0, _log(rng, 1.0, 100.0)]))} W",
            "efficiency": float(rng.uniform(0.5, 1.0)),
        }
        joints.append(["bank.outlet", *drawing])
    network = {"components": parts, "connections": joints}
    timing = {"duration": f"{1.5 * end} s", "variants": ["dry"], "lift": "first_needle.tip"}
    return json.dumps({"klack": 1, "title": f"Draw {seed}", "network": network, "run": timing})


def _log(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _valve(
    rng: Rng,
    parts: dict[str, Part],
    joints: list[list[str]],
    drawing: list[str],
    name: str,
    end: float,
) -> None:
    """A needle between two stops on a spring, its magnet, and a driver for each coil."""
    lift = _log(rng, 2e-5, 5e-4)
    radius = _log(rng, 2e-3, 8e-3)
    pull = (0.5 * 1.2) ** 2 / (8e-7 * np.pi) * np.pi * radius**2  # at 0.6 T [N]
    preload = pull * _log(rng, 0.02, 1.0)
    mass = _log(rng, 0.1, 10.0) * 1e3 * radius**3 * 7.8
    law = {"kind": "linear", "stiffness": f"{_log(rng, 1e8, 1e9)} N/m"}
    for stop, gap in (("seat", 0.0), ("stop", lift)):
        parts[f"{name}_{stop}"] = {
            "type": "end-stop",
            "gap": f"{gap} m",
            "law": law,
            "restitution": float(rng.choice([0.1, 0.5, 1.0])),
        }
    parts[f"{name}_needle"] = {"type": "rigid-mass", "mass": f"{mass} kg", "points": ["tip"]}
    parts[f"{name}_spring"] = {
        "type": "spring",
        "stiffness": f"{_log(rng, 0.05, 1.0) * preload / lift} N/m",
        "preload": f"{preload} N",
    }
    tip = [f"{name}_needle.tip", f"{name}_seat.upper", f"{name}_stop.lower", f"{name}_spring.end"]
    joints += [["ground", f"{name}_seat.lower"], ["ground", f"{name}_stop.upper"]]
    turns = _log(rng, 30.0, 600.0)
    ports = ["terminals"]
    if rng.random() < 0.4:
        parts[f"{name}_magnet"] = _solenoid(rng, lift, radius, turns)
    else:
        parts[f"{name}_magnet"] = _network(rng, lift, radius, turns, ports)
    joints.append([*tip, f"{name}_magnet.armature"])
    for port in ports:
        driver = f"{name}_{port}_driver"
        parts[driver] = _driver(rng, end, turns)
        if parts[driver]["type"] == "boost-driver" and "capacitance" not in parts[driver]:
            drawing.append(f"{driver}.supply")
        joints.append([f"{driver}.terminals", f"{name}_magnet.{port}"])


def _resistance(turns: float, radius: float, rng: Rng) -> str:
    """Of copper that fills some square millimetres, times what harness and wire make of it."""
    window = 2.0 * radius**2
    return f"{_log(rng, 0.5, 3.0) * 1.7e-8 * turns**2 * 2 * np.pi * 1.5 * radius / (0.5 * window)}"


def _iron(rng: Rng, radius: float) -> Part:
    part: Part = {
        "material": str(rng.choice(IRON)),
        "length": f"{_log(rng, 3.0, 20.0) * radius} m",
        "area": f"{np.pi * radius**2 * _log(rng, 0.5, 2.0)} m^2",
    }
    if rng.random() < 0.5:
        part["hysteresis"] = {
            "coercivity": f"{_log(rng, 20.0, 1000.0)} A/m",
            "initial_permeability": float(rng.uniform(100.0, 250.0)),
        }
    if rng.random() < 0.5:
        part["eddy"] = {
            "conductivity": f"{_log(rng, 0.5, 8.0)} MS/m",
            "terms": int(rng.integers(1, 4)),
        }
    return part


def _solenoid(rng: Rng, lift: float, radius: float, turns: float) -> Part:
    part: Part = {
        "type": "solenoid",
        "turns": turns,
        "resistance": _resistance(turns, radius, rng) + " ohm",
        "gap": f"{lift * rng.uniform(1.0, 1.5)} m",
        "residual_gap": f"{_log(rng, 1e-5, 2e-4)} m",
        "poles": [
            {"outer_radius": f"{radius} m", "fringing": str(rng.choice(["none", "plane"]))},
        ],
        "iron": [_iron(rng, radius)],
        "leakage_share": float(rng.uniform(0.02, 0.3)),
        "winding_temperature": f"{rng.uniform(-40.0, 160.0)} degC",
    }
    if part["poles"][0]["fringing"] == "plane":
        part["poles"][0]["shoulder"] = f"{0.3 * radius} m"
    if "hysteresis" in part["iron"][0] and rng.random() < 0.3:
        part["start"] = "remanent"
    return part


def _network(rng: Rng, lift: float, radius: float, turns: float, ports: list[str]) -> Part:
    """A pot magnet whose coils lie one above another on the core, each with its leakage."""
    names = ["", "holding", "closing"][: int(rng.integers(1, 4))]
    area, mu = np.pi * radius**2, 4e-7 * np.pi
    residual = _log(rng, 1e-5, 2e-4)
    core = {"kind": "iron", "between": ["bottom", "n0"], **_iron(rng, radius)}
    elements: dict[str, Part] = {"core": core}
    for k, circuit in enumerate(names):
        between = [f"n{k}", f"n{k + 1}"]
        wound = turns * (1.0 if k == 0 else _log(rng, 0.2, 5.0) * float(rng.choice([1.0, -1.0])))
        coil: Part = {"kind": "coil", "between": between, "turns": wound}
        if circuit:
            coil["circuit"] = circuit
            ports.append(circuit)
        elements[f"coil_{k}"] = coil
        leak = mu * area / (lift + residual) * _log(rng, 0.01, 0.2)
        elements[f"leakage_{k}"] = {
            "kind": "leakage",
            "between": between,
            "permeance": f"{leak} H",
        }
    top = f"n{len(names)}"
    elements["working_gap"] = {
        "kind": "face",
        "between": [top, "bottom"],
        "area": f"{area} m^2",
        "residual_gap": f"{residual} m",
    }
    if rng.random() < 0.3:
        elements["magnet"] = {
            "kind": "magnet",
            "between": ["bottom", top] if rng.random() < 0.5 else [top, "bottom"],
            "remanence": f"{rng.uniform(0.3, 1.3)} T",
            "recoil_permeability": 1.05,
            "length": f"{_log(rng, 0.3, 2.0) * radius} m",
            "area": f"{area * _log(rng, 0.05, 0.5)} m^2",
        }
    part: Part = {
        "type": "magnetic-network",
        "resistance": _resistance(turns, radius, rng) + " ohm",
        "gap": f"{lift * rng.uniform(1.0, 1.5)} m",
        "elements": elements,
        "winding_temperature": f"{rng.uniform(-40.0, 160.0)} degC",
    }
    circuits = {
        circuit: {"resistance": _resistance(abs(elements[f"coil_{k}"]["turns"]), radius, rng)
                  + " ohm"}
        for k, circuit in enumerate(names) if circuit
    }  # fmt: skip
    if circuits:
        part["circuits"] = circuits
    if "hysteresis" in core and rng.random() < 0.3:
        part["start"] = "remanent"
    return part


def _driver(rng: Rng, end: float, turns: float) -> Part:
    """One of the drivers, for some hundred ampere turns."""
    peak = _log(rng, 100.0, 2000.0) / turns
    hold = peak * _log(rng, 0.1, 0.6)
    volts = _log(rng, 5.0, 60.0)
    band = hold * _log(rng, 0.02, 0.5)
    start = end * float(rng.choice([0.0, 0.05, 0.3]))
    decay = _log(rng, 0.7, 100.0)
    times: Part = {"start": f"{start} s", "end": f"{end} s"}
    kind = str(
        rng.choice(["voltage-step", "pwm", "two-point", "peak-hold", "table", "boost-driver"])
    )
    if kind == "voltage-step":
        return {"type": kind, "voltage": f"{volts} V", "decay": f"{decay} V", **times}
    if kind == "pwm":
        return {
            "type": kind,
            "voltage": f"{volts} V",
            "period": f"{end * _log(rng, 0.02, 0.3)} s",
            "duty": float(rng.uniform(0.05, 0.95)),
            **times,
        }
    if kind == "two-point":
        edges: Part = {"upper": f"{peak} A", "lower": f"{0.8 * peak} A"}
        return {"type": kind, "voltage": f"{volts} V", "decay": f"{decay} V", **edges, **times}
    if kind == "table":
        return {
            "type": "voltage-table",
            "time": [f"{x * end} s" for x in (0.0, 0.1, 0.5, 0.6, 1.0)],
            "voltage": [f"{x * volts} V" for x in (0.0, 1.0, 1.0, -0.5, 0.0)],
        }
    if kind == "peak-hold":
        return {
            "type": kind,
            "boost_voltage": f"{volts * _log(rng, 1.5, 8.0)} V",
            "peak_current": f"{peak} A",
            "supply_voltage": f"{volts} V",
            "hold_current": f"{hold} A",
            "hold_band": f"{band} A",
            "decay": f"{decay} V",
            **times,
        }
    part: Part = {
        "type": kind,
        "battery": f"{min(volts, 16.0)} V",
        "peak_current": f"{peak} A",
        "hold_current": f"{hold} A",
        "hold_band": f"{band} A",
        "diode_voltage": f"{float(rng.choice([0.0, 0.7]))} V",
        "switch_resistance": f"{float(rng.choice([0.0, 0.03]))} ohm",
        "shots": [
            {"start": f"{start} s", "end": f"{0.6 * end} s"},
            {"start": f"{0.7 * end} s", "end": f"{end} s"},
        ],
    }
    if rng.random() < 0.4:
        part["decay"], part["clamp_voltage"] = "clamp", f"{decay} V"
    if rng.random() < 0.4:
        part["capacitance"] = f"{_log(rng, 1e-6, 1e-3)} F"
        part["boost_voltage"] = f"{_log(rng, 20.0, 150.0)} V"
        part["recharge_power"] = f"{float(rng.choice([0.0, 20.0]))} W"
    return part


def main() -> int:
    """Run draws, and print what failed and the largest residual."""
    return run_draws(draw, about=__doc__, count=100)


if __name__ == "__main__":
    raise SystemExit(main())
