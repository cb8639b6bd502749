"""Random sensible valves, wet and dry: how many run, and how well their energy balances.

``uv run python benchmarks/random_valves.py --count 1000`` draws valves over the whole range that
an engineer might ask for, runs each in all its variants, and prints what failed and the largest
energy residual; ``--seed`` begins elsewhere, ``--only N`` runs one draw and prints its case,
``--chains`` draws valves of two or three bodies.

A draw is a case file: a body of 0.1 to 200 g on a spring of 0.1 to 200 N/mm with a negative, zero
or positive preload, two stops of several laws with restitution or films, friction, a force or a
solenoid with one of four drivers; wet ones have a supply of 1 to 2000 bar, a fluid, a line, an
orifice or an inertance before a chamber, a seat to another chamber, and a drain.
"""

import argparse
import json
import sys
import traceback
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from klack.case.any_case import read_valve_case
from klack.case.valve import ValveCase
from klack.simulation.network_run import simulate_network

__all__ = ["draw", "draw_chain", "main", "residuals"]

Rng = np.random.Generator
Part = dict[str, Any]

FLUIDS: tuple[Any, ...] = ("water", "n-heptane", "diesel", "ISO VG 46")


def draw(seed: int) -> str:
    """Return the text of the case of one draw; the same for the same seed."""
    rng = np.random.default_rng([1, seed])
    parts: dict[str, Part] = {}
    joints: list[list[str]] = []
    mass = _log(rng, 1e-4, 0.2)
    lift = _log(rng, 2e-5, 2e-3)
    stiffness = _log(rng, 1e2, 2e5)
    preload = float(rng.choice([-1.0, 0.0, 1.0, 1.0])) * _log(rng, 0.1, 300.0)
    parts["needle"] = {"type": "rigid-mass", "mass": f"{mass} kg", "points": ["tip", "top"]}
    parts["spring"] = {
        "type": "spring",
        "stiffness": f"{stiffness} N/m",
        "preload": f"{preload} N",
        "damping": f"{float(rng.choice([0.0, 0.01])) * np.sqrt(stiffness * mass)} N*s/m",
    }
    wet = rng.random() < 0.6
    parts["seat"] = _stop(rng, 0.0, mass, wet=wet)
    parts["stop"] = _stop(rng, lift, mass, wet=wet)
    tip, top = ["needle.tip", "seat.upper"], ["needle.top", "stop.lower", "spring.end"]
    joints += [["ground", "seat.lower"], ["ground", "stop.upper"]]
    if rng.random() < 0.4:
        parts["guide"] = {
            "type": "guide-friction",
            "coulomb": f"{_log(rng, 0.01, 1.0)} N",
        }
        top.append("guide.body")
    if rng.random() < 0.3:
        parts["weight"] = {"type": "gravity"}
        tip.append("weight.body")
    _drive(rng, parts, joints, top, abs(preload) + stiffness * lift, lift)
    fluid: Any = None
    if wet:
        fluid = _fluid(rng)
        _hydraulics(rng, parts, joints, tip, lift)
    joints += [tip, top]
    network: Part = {"components": parts, "connections": joints}
    if fluid is not None:
        network["fluid"] = fluid
    run = {
        "duration": f"{_log(rng, 3e-4, 2e-3)} s",
        "step": str(rng.choice(["20 ns", "50 ns", "100 ns"])),
        "variants": ["dry", "wet"] if wet else ["dry"],
        "lift": "needle.tip",
    }
    return json.dumps({"klack": 1, "title": f"Draw {seed}", "network": network, "run": run})


def draw_chain(seed: int) -> str:
    """Return the text of a drawn valve whose armature, and perhaps a piston, is a body of its own.

    The armature has the drive and the stop, travels freely on the needle between ``carry`` and
    ``rest``, and a coupling spring holds it down; a piston lies on the needle, below ``end``.
    """
    case = json.loads(draw(seed))
    rng = np.random.default_rng([2, seed])
    parts, joints = case["network"]["components"], case["network"]["connections"]
    wet = "wet" in case["run"]["variants"]
    mass, lift = _number(parts["needle"]["mass"]), _number(parts["stop"]["gap"])
    free, own = lift * rng.uniform(0.1, 0.7), mass * _log(rng, 0.3, 3.0)
    hold = abs(_number(parts["spring"]["preload"])) + _number(parts["spring"]["stiffness"]) * lift
    parts["armature"] = {"type": "rigid-mass", "mass": f"{own} kg", "points": ["bottom", "top"]}
    parts["needle"]["points"] = ["tip", "top", "ring"]
    parts["carry"] = _stop(rng, free, min(own, mass), wet=wet)
    parts["rest"] = _stop(rng, 0.0, min(own, mass), wet=wet)
    parts["coupling"] = {
        "type": "spring",
        "stiffness": f"{hold * _log(rng, 0.02, 0.5) / lift} N/m",
        "preload": f"{hold * _log(rng, 0.02, 0.5)} N",
    }
    (top,) = (joint for joint in joints if "needle.top" in joint)
    driven = [port for port in top if port.split(".")[0] in ("stop", "magnet", "coil")]
    kept = [port for port in top if port not in driven]
    joints.remove(top)
    joints += [
        [*kept, "carry.upper", "coupling.base"],
        ["armature.top", *driven, "carry.lower", "coupling.end"],
        ["needle.ring", "rest.lower"],
        ["armature.bottom", "rest.upper"],
    ]
    if rng.random() < 0.4:
        parts["piston"] = {"type": "rigid-mass", "mass": f"{mass * _log(rng, 0.3, 3.0)} kg"}
        parts["rod"] = _stop(rng, float(rng.choice([0.0, 0.2])) * lift, mass, wet=wet)
        parts["end"] = _stop(rng, lift * rng.uniform(1.0, 2.0), mass, wet=wet)
        parts["pusher"] = {
            "type": "spring",
            "stiffness": f"{hold * _log(rng, 0.02, 0.5) / lift} N/m",
            "preload": f"{hold * _log(rng, 0.02, 0.5)} N",
        }
        joints[-4].append("rod.lower")
        joints += [
            ["piston.body", "rod.upper", "end.lower", "pusher.end"],
            ["ground", "end.upper"],
        ]
    return json.dumps(case | {"title": f"Chain {seed}"})


def _number(text: str) -> float:
    return float(text.split()[0])


def _log(rng: Rng, low: float, high: float) -> float:
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def _stop(rng: Rng, gap: float, mass: float, *, wet: bool) -> Part:
    stop: Part = {"type": "end-stop", "gap": f"{gap} m"}
    kind = rng.choice(["linear", "hertz", "table", "asperity"])
    if kind == "linear":
        stop["law"] = {"kind": "linear", "stiffness": f"{_log(rng, 1e7, 1e9) * mass**0.25} N/m"}
    elif kind == "hertz":
        stop["law"] = {"kind": "hertz", "radius": f"{_log(rng, 1e-3, 0.1)} m", "modulus": "115 GPa"}
    elif kind == "table":
        k = _log(rng, 1e7, 5e8)
        d = [2e-7, 1e-6, 4e-6, 1e-5]
        stop["law"] = {
            "kind": "table",
            "indentation": [f"{x} m" for x in d],
            "force": [f"{k * x * (1.0 + x / 5e-6)} N" for x in d],
        }
    else:
        stop["law"] = {"kind": "asperity", "force": "20 N", "height": "0.3 um"}
        stop["series_compliance"] = f"{_log(rng, 1e-10, 1e-8)} m/N"
    choice = rng.random()
    if choice < 0.6:
        stop["restitution"] = float(rng.choice([0.05, rng.uniform(0.1, 1.0), 1.0]))
    if wet and rng.random() < 0.5:
        inner = _log(rng, 5e-4, 4e-3)
        ring = {"shape": "ring", "inner_radius": f"{inner} m", "roughness": "0.5 um"}
        stop["film"] = ring | {"outer_radius": f"{inner * rng.uniform(1.1, 2.0)} m"}
    return stop


def _drive(
    rng: Rng,
    parts: dict[str, Part],
    joints: list[list[str]],
    top: list[str],
    hold: float,
    lift: float,
) -> None:
    if rng.random() < 0.5:
        strength = hold * _log(rng, 0.5, 4.0)
        begin = float(rng.choice([0.0, 2e-5, 1e-4]))
        time = [begin, begin + 1e-6, begin + 4e-4, begin + 4.2e-4]
        high = [0.0, strength, strength, 0.0] if rng.random() < 0.8 else [strength] * 2 + [0.0] * 2
        parts["magnet"] = {
            "type": "force-over-time",
            "time": [f"{t} s" for t in time],
            "force": [f"{f} N" for f in high],
        }
        top.append("magnet.end")
        return
    radius, turns = _log(rng, 1.5e-3, 1e-2), int(rng.integers(40, 600))
    air = 0.9 * lift + 3e-5
    if rng.random() < 0.6:
        parts["coil"] = {
            "type": "solenoid",
            "turns": turns,
            "resistance": "0.8 ohm",
            "gap": f"{lift + 2e-5} m",
            "residual_gap": f"{air} m",
            "poles": [{"outer_radius": f"{radius} m", "fringing": "none"}],
            "residual_flux": f"{float(rng.choice([0.0, 1e-7]))} Wb",
        }
    else:
        area, mu = np.pi * radius**2, 4e-7 * np.pi
        gaps = np.linspace(-0.2 * air, 1.2 * lift + 4e-5, 9)
        current = np.linspace(0.0, 20.0, 9)
        permeance = turns**2 * mu * area / (gaps + air + 1e-5)
        bend = current / (1.0 + current / 60.0)
        parts["coil"] = {
            "type": "force-map-solenoid",
            "resistance": "0.8 ohm",
            "gap": f"{lift + 2e-5} m",
            "current": [f"{i} A" for i in current],
            "gaps": [f"{x} m" for x in gaps],
            "linkage": [[f"{L * i} Wb" for L in permeance] for i in bend],
        }
    joints.append(["coil.terminals", "driver.terminals"])
    top.append("coil.armature")
    parts["driver"] = {
        0: {"type": "voltage-step", "voltage": "14 V", "start": "20 us", "end": "800 us"},
        1: {"type": "pwm", "voltage": "14 V", "period": "100 us", "duty": 0.4, "end": "900 us"},
        2: {"type": "voltage-table", "time": ["0 s", "50 us"], "voltage": ["0 V", "12 V"]},
        3: {
            "type": "peak-hold",
            "boost_voltage": "60 V",
            "peak_current": "8 A",
            "supply_voltage": "14 V",
            "hold_current": "2 A",
            "hold_band": "0.5 A",
            "end": "900 us",
        },
    }[int(rng.integers(4))]


def _fluid(rng: Rng) -> Any:
    if rng.random() < 0.6:
        return str(rng.choice(FLUIDS))
    return {
        "name": "thick",
        "density": "860 kg/m^3",
        "bulk_modulus": "1.4 GPa",
        "viscosity": f"{_log(rng, 1e-3, 10.0)} Pa*s",
        "gas_fraction": float(rng.choice([0.0, 1e-3])),
    }


def _hydraulics(
    rng: Rng, parts: dict[str, Part], joints: list[list[str]], tip: list[str], lift: float
) -> None:
    """Supply, feed, chamber, seat, second chamber, drain; faces of both chambers on the needle."""
    supply = _log(rng, 1.1e5, 2e8)
    edge = float(np.clip(np.sqrt(400.0 / supply), 5e-4, 5e-3)) * rng.uniform(0.5, 1.0)
    volume = 4.0 * edge**2 * lift + _log(rng, 5e-9, 2e-6)
    parts["rail"] = {"type": "pressure-source", "pressure": f"{supply} Pa"}
    if rng.random() < 0.3:
        step = {"to": f"{supply * rng.uniform(0.7, 1.3)} Pa", "at": "100 us", "rise": "50 us"}
        parts["rail"]["step"] = step
    bore = edge * rng.uniform(0.5, 2.0)
    feed = rng.choice(["orifice", "line", "inertance"])
    parts["feed"] = {
        "orifice": {"type": "orifice", "diameter": f"{bore} m"},
        "line": {
            "type": "line",
            "length": f"{_log(rng, 0.05, 1.0)} m",
            "diameter": f"{2.0 * bore} m",
            "pressure": f"{supply} Pa",
        },
        "inertance": {"type": "inertance", "length": "20 mm", "diameter": f"{2.0 * bore} m"},
    }[str(feed)]
    parts["inlet"] = {"type": "chamber", "volume": f"{volume} m^3"}
    parts["sac"] = {"type": "chamber", "volume": f"{volume * rng.uniform(0.3, 1.0)} m^3"}
    if rng.random() < 0.4:
        parts["inlet"]["pressure"] = f"{supply} Pa"
    shape = str(rng.choice(["flat", "cone"]))
    parts["opening"] = {"type": "seat", "shape": shape, "diameter": f"{edge} m"}
    if shape == "cone":
        parts["opening"]["half_angle"] = "45 deg"
    parts["opening"]["leak_area"] = f"{float(rng.choice([0.0, 1.0]))} um^2"
    if rng.random() < 0.4:
        parts["opening"]["flow_force"] = {"velocity_coefficient": 0.98}
    parts["drain"] = {"type": "orifice", "diameter": f"{bore * rng.uniform(0.3, 2.0)} m"}
    parts["under"] = {
        "type": "pressure-face",
        "direction": str(rng.choice(["opening", "closing"])),
        "outer_diameter": f"{edge} m",
    }
    parts["nose"] = {"type": "pressure-face", "direction": "opening", "outer_diameter": f"{edge} m"}
    joints += [
        ["rail.fluid", "feed.a"],
        ["feed.b", "inlet.fluid", "opening.a", "under.fluid"],
        ["opening.b", "sac.fluid", "nose.fluid", "drain.a"],
        ["drain.b", "ambient"],
        ["ground", "opening.body"],
    ]
    tip += ["under.body", "nose.body", "opening.needle"]


def residuals(case: ValveCase) -> dict[str, float]:
    """Energy residual of each variant over its scale [-]."""
    found = {}
    for variant in case.run.variants:
        network = case.network.network()
        rows = (network.dry() if variant == "dry" else network).rows()
        result = simulate_network(
            rows,
            duration=case.run.duration,
            step=case.run.step,
            coarse=case.run.coarse,
            record=case.run.record,
        )
        found[variant] = abs(result.books.residual) / (result.books.scale or 1.0)
    return found


def main(arguments: list[str] | None = None) -> int:
    """Run the draws; 1 if one of them failed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", type=int)
    parser.add_argument("--chains", action="store_true", help="two or three bodies")
    options = parser.parse_args(arguments)
    drawn = draw_chain if options.chains else draw
    seeds = range(options.seed, options.seed + options.count)
    if options.only is not None:
        seeds = range(options.only, options.only + 1)
        print(json.dumps(json.loads(drawn(options.only)), indent=1))
    failed, runs, worst, told = 0, 0, (0.0, ""), 0
    for seed in seeds:
        with warnings.catch_warnings(record=True) as notes:
            warnings.simplefilter("always")
            try:
                found = residuals(read_valve_case(drawn(seed), Path(f"draw{seed}.yaml")))
            except Exception as error:
                failed += 1
                print(f"{seed}: {type(error).__name__}: {error}", flush=True)
                if options.only is not None:
                    traceback.print_exc()
                continue
        told += bool(notes)
        if options.only is not None:
            print(found, *(str(note.message) for note in notes), sep="\n")
        for variant, residual in found.items():
            runs += 1
            worst = max(worst, (residual, f"draw {seed} {variant}"))
            if not residual <= 1e-9:
                print(f"{seed} {variant}: energy residual {residual:.2g}", flush=True)
    print(
        f"{len(seeds)} valves, {runs} runs, {failed} failed, {told} with a warning; "
        f"largest energy residual {worst[0]:.2g} ({worst[1]})"
    )
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
