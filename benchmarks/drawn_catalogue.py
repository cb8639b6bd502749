"""Draw random sensible valves out of every component type, fluid, gas and driver that klack has.

Used by ``random_catalogue.py``.  A draw is a case in the words of a user: values in any unit of
their kind, some of them expressions of parameters, some parts of the network from a file of their
own, once or several times.
"""

import json
from dataclasses import dataclass, field
from math import pi
from typing import Any

import numpy as np

__all__ = ["Drawn", "draw"]

Rng = np.random.Generator
Part = dict[str, Any]

LIQUIDS = {  # lowest and highest temperature [degC], pressure up to which the law holds [Pa]
    "n-heptane": (-40, 140, 4e7),
    "n-decane": (-20, 140, 6e7),
    "n-dodecane": (-9, 140, 7e7),
    "water": (1, 140, 2.5e8),
    "generic mineral oil": (0, 100, 1e8),
    "ISO 4113": (-20, 140, 2e8),
    "diesel": (-20, 140, 2e8),
    "petrol": (-40, 140, 5e7),
    "ISO VG 32": (-20, 140, 1e8),
    "ISO VG 46": (-20, 140, 1e8),
    "ATF": (-40, 140, 1e8),
    "DOT 4": (-40, 140, 1e8),
    "water-glycol": (-20, 65, 1e8),
    "CoolProp:n-Dodecane": (-9, 140, 2e8),
    "own": (-40, 140, 2.5e8),
}
GASES = ("air", "nitrogen", "hydrogen", "methane", "helium", "CNG")
UNITS = {
    "length": {"m": 1.0, "mm": 1e-3, "um": 1e-6},
    "pressure": {"Pa": 1.0, "bar": 1e5, "MPa": 1e6, "kPa": 1e3},
    "area": {"m^2": 1.0, "mm^2": 1e-6, "cm^2": 1e-4},
    "volume": {"m^3": 1.0, "mm^3": 1e-9, "cm^3": 1e-6, "l": 1e-3},
    "flow": {"m^3/s": 1.0, "l/min": 1e-3 / 60},
    "mass": {"kg": 1.0, "g": 1e-3, "mg": 1e-6},
    "stiffness": {"N/m": 1.0, "N/mm": 1e3, "N/um": 1e6},
    "force": {"N": 1.0, "kN": 1e3},
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
}
_STEEL = {"young": "210 GPa", "poisson": 0.3, "density": "7850 kg/m^3"}
_ROD: Part = {  # 2.5 g
    "geometry": {
        "model": "axisymmetric",
        "profile": {
            "unit": "mm",
            "parts": {
                "rod": {
                    "start": [0, 0],
                    "edges": [
                        {"line": [2, 0], "name": "tip"},
                        {"line": [2, 25], "name": "side"},
                        {"line": [0, 25], "name": "top"},
                        {"close": True},
                    ],
                }
            },
        },
    },
    "material": "steel",
    "mesh": {"size": "1 mm"},
    "damping": {"modal": "1 %"},
}


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """Text of a case, texts of its parts by file name, and the types in it."""

    text: str
    parts: dict[str, str]
    types: tuple[str, ...]


@dataclass(kw_only=True)
class _Valve:
    """A valve in the making."""

    rng: Rng
    fmu: str | None
    parts: dict[str, Part] = field(default_factory=dict)
    joints: list[list[str]] = field(default_factory=list)
    parameters: dict[str, str] = field(default_factory=dict)
    include: list[Part] = field(default_factory=list)
    files: dict[str, str] = field(default_factory=dict)
    network: Part = field(default_factory=dict)
    bodies: Part = field(default_factory=dict)
    tip: list[str] = field(default_factory=list)
    top: list[str] = field(default_factory=list)
    lift: float = 0.0
    force: float = 0.0
    end: float = 0.0
    mass: float = 0.0
    hot: float = 20.0

    def q(self, value: float, kind: str) -> str:
        """Quantity in some unit, seldom an expression of a parameter."""
        units = UNITS[kind]
        unit = str(self.rng.choice(list(units)))
        text = f"{value / units[unit]:.6g} {unit}"
        if self.rng.random() < 0.12 and value != 0.0:
            name = f"size{len(self.parameters)}"
            self.parameters[name] = text
            return str(
                self.rng.choice([f"= {name}", f"= 2 * {name} / 2", f"= sqrt({name}^2) * cos(0)"])
                if value > 0.0
                else f"= {name}"
            )
        return text

    def log(self, low: float, high: float) -> float:
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def one(self, *choices: Any) -> Any:
        return choices[int(self.rng.integers(len(choices)))]

    def odds(self, share: float) -> bool:
        return bool(self.rng.random() < share)


def draw(seed: int, fmu: str | None = None) -> Drawn:
    """Return one draw; the same for the same seed, with a damper from an FMU if there is one."""
    v = _Valve(rng=np.random.default_rng([7, seed]), fmu=fmu)
    v.lift, v.mass = v.log(3e-5, 1e-3), v.log(5e-4, 5e-2)
    v.force, v.end = v.log(5.0, 150.0), v.log(1e-3, 3e-3)
    v.hot = float(v.one(20.0, v.rng.uniform(-40.0, 140.0)))
    v.network["ambient"] = {"temperature": f"{v.hot:.4g} degC"}
    medium = str(v.rng.choice(["dry", "liquid", "gas", "both"], p=[0.1, 0.6, 0.22, 0.08]))
    _carrier(v)
    wet = medium in ("liquid", "both")
    _stops(v, wet=wet)
    _springs(v)
    _friction(v)
    _drive(v)
    if wet:
        _liquid(v)
    if medium in ("gas", "both"):
        _gas(v)
    if v.odds(0.2):
        _heat(v)
    v.joints += [joint for joint in (v.tip, v.top) if len(joint) > 1]
    v.network |= {"components": v.parts, "connections": v.joints}
    case: Part = {"klack": 1, "title": f"Draw {seed}", "network": v.network}
    if v.parameters:
        case["parameters"] = v.parameters
    if v.bodies:
        case |= {"bodies": v.bodies, "materials": {"steel": _STEEL}}
        case["reduction"] = {"modes": {"rod": {"count": 10}}, "correction": "none"}
    if v.include:
        case["include"] = v.include
    point = v.tip[0]
    case["run"] = {
        "duration": f"{v.end:.6g} s",
        "variants": ["dry"] if medium == "dry" else ["wet"],
        "lift": point,
    }
    if v.odds(0.3):
        case["run"]["step"] = v.one("20 ns", "50 ns", "100 ns")
    types = [str(part["type"]) for part in v.parts.values()]
    types += [str(p["type"]) for text in v.files.values() for p in _components(text)]
    return Drawn(text=json.dumps(case, indent=1), parts=v.files, types=tuple(types))


def _components(text: str) -> list[Part]:
    return list(json.loads(text)["components"].values())


# --- mechanics -------------------------------------------------------------------------------


def _carrier(v: _Valve) -> None:
    """What moves: a mass, a lever, or a given motion with a mass that follows it."""
    kind = str(v.rng.choice(["mass", "lever", "given", "elastic"], p=[0.65, 0.14, 0.14, 0.07]))
    if kind == "mass":
        v.parts["needle"] = {
            "type": "rigid-mass",
            "mass": v.q(v.mass, "mass"),
            "points": ["tip", "top"],
        }
    elif kind == "elastic":
        v.bodies["rod"] = _ROD
        v.parts["needle"] = {"type": "flexible-body", "body": "rod", "points": ["tip", "top"]}
    elif kind == "lever":
        v.parts["needle"] = {
            "type": "lever",
            "effective_mass": v.q(v.mass, "mass"),
            "arms": {"tip": v.q(0.01, "length"), "top": v.q(0.01 * v.log(0.7, 1.5), "length")},
        }
        if v.odds(0.5):
            v.parts["needle"]["carried"] = {"top": v.q(0.3 * v.mass, "mass")}
    else:
        times = [0.0, 0.2 * v.end, 0.45 * v.end, 0.7 * v.end, 0.95 * v.end]
        lifts = [0.0, 0.0, 0.9 * v.lift, 0.9 * v.lift, 0.05 * v.lift]
        v.parts["needle"] = {
            "type": "prescribed-motion",
            "time": [v.q(t, "time") for t in times],
            "displacement": [v.q(x, "length") for x in lifts],
            "between": v.one("smooth", "straight"),
            "points": ["tip", "top"],
        }
        v.parts["follower"] = {"type": "rigid-mass", "mass": v.q(v.mass, "mass")}
        v.parts["link"] = {
            "type": "spring",
            "stiffness": v.q(v.log(1e3, 1e5), "stiffness"),
            "preload": "0 N",
            "damping": "1 N*s/m",
        }
        v.joints.append(["follower.body", "link.base"])
        v.top.append("link.end")
    v.tip.insert(0, "needle.tip")
    v.top.insert(0, "needle.top")


def _law(v: _Valve) -> Part:
    kind = v.one("linear", "hertz", "table", "asperity")
    if kind == "linear":
        return {"kind": kind, "stiffness": v.q(v.log(2e7, 1e9), "stiffness")}
    if kind == "hertz":
        return {"kind": kind, "radius": v.q(v.log(1e-3, 5e-2), "length"), "modulus": "115 GPa"}
    if kind == "table":
        k, depth = v.log(2e7, 5e8), [2e-7, 1e-6, 4e-6, 1e-5]
        force = [k * x * (1.0 + x / 5e-6) for x in depth]
        return {
            "kind": kind,
            "indentation": [v.q(x, "length") for x in depth],
            "force": [v.q(f, "force") for f in force],
        }
    return {"kind": kind, "force": v.q(v.log(5.0, 50.0), "force"), "height": v.q(3e-7, "length")}


def _film(v: _Valve) -> Part:
    shape = v.one("disc", "ring", "cone", "sphere")
    r = v.log(7e-4, 3e-3)
    part: Part = {"shape": shape}
    if v.odds(0.6):
        part["roughness"] = v.q(v.log(1e-7, 1e-6), "length")
    elif v.odds(0.6):
        part["cut_off"] = v.q(v.log(3e-7, 2e-6), "length")
    part |= {
        "disc": {"radius": v.q(0.4 * r, "length")},
        "ring": {"inner_radius": v.q(r, "length"), "outer_radius": v.q(1.3 * r, "length")},
        "cone": {
            "mean_radius": v.q(r, "length"),
            "width": v.q(0.15 * r, "length"),
            "half_angle": "45 deg",
        },
        "sphere": {"radius": v.q(2 * r, "length")},
    }[shape]
    return part


def _stops(v: _Valve, *, wet: bool) -> None:
    given = v.parts["needle"]["type"] == "prescribed-motion"
    if given:  # stops are for the follower, a given motion needs none
        v.parts["catch"] = {"type": "end-stop", "gap": v.q(2 * v.lift, "length"), "law": _law(v)}
        v.joints[0] += ["catch.lower"]
        v.joints.append(["ground", "catch.upper"])
        return
    for name, gap in (("seat", 0.0), ("stop", v.lift)):
        part: Part = {"type": "end-stop", "gap": f"{gap:.6g} m"}
        law = _law(v)
        part["law"] = law
        if law["kind"] == "asperity" or v.odds(0.15):
            part["series_compliance"] = f"{v.log(5e-10, 1e-8):.4g} m/N"
        if v.odds(0.7):
            part["restitution"] = float(round(v.rng.uniform(0.1, 0.95), 3))
        if wet and v.odds(0.4):
            part["film"] = _film(v)
        v.parts[name] = part
    v.tip.append("seat.upper")
    v.top.append("stop.lower")
    v.joints += [["ground", "seat.lower"], ["ground", "stop.upper"]]
    if v.odds(0.2):
        k = v.force / v.lift
        rubber: Part = {
            "type": "rubber-stop",
            "gap": v.q(v.lift * v.rng.uniform(0.2, 0.9), "length"),
            "stiffness": v.q(k, "stiffness"),
            "maxwell": [
                {"stiffness": v.q(k, "stiffness"), "time": v.q(v.log(1e-5, 1e-3), "time")}
                for _ in range(int(v.rng.integers(0, 3)))
            ],
        }
        if v.odds(0.5):
            rubber |= {"higher": [0, 2], "reference": v.q(v.lift, "length")}
        v.parts["buffer"] = rubber
        v.top.append("buffer.lower")
        v.joints.append(["ground", "buffer.upper"])


def _springs(v: _Valve) -> None:
    kind = v.one("spring", "nonlinear-spring", "surging-spring")
    k = v.log(0.05, 0.6) * v.force / v.lift
    if kind == "spring":
        v.parts["spring"] = {
            "type": kind,
            "stiffness": v.q(k, "stiffness"),
            "preload": v.q(v.force, "force"),
        }
        if v.odds(0.5):
            v.parts["spring"]["damping"] = f"{0.02 * np.sqrt(k * v.mass):.4g} N*s/m"
    elif kind == "surging-spring":
        v.parts["spring"] = {
            "type": kind,
            "stiffness": v.q(k, "stiffness"),
            "preload": v.q(v.force, "force"),
            "mass": v.q(v.mass * v.log(0.05, 0.6), "mass"),
            "modes": int(v.rng.integers(1, 9)),
            "damping": v.one("1 %", "0.5 %", 0),
        }
    elif v.odds(0.5):
        s = [-v.lift, 0.0, v.lift, 3 * v.lift, 6 * v.lift]
        f = [0.0, 0.9 * v.force, v.force, v.force * 1.3, 2.0 * v.force]
        v.parts["spring"] = {
            "type": kind,
            "deflection": [v.q(x, "length") for x in s],
            "force": [v.q(x, "force") for x in f],
            "start": v.q(v.lift, "length"),
        }
    else:
        v.parts["spring"] = {
            "type": kind,
            "stiffness": v.q(k, "stiffness"),
            "higher": [0, float(v.one(0.3, 1.0))],
            "reference": v.q(v.lift, "length"),
            "start": v.q(v.force / k * 0.5, "length"),
        }
    v.top.append("spring.end")


def _friction(v: _Valve) -> None:
    if v.parts["needle"]["type"] == "prescribed-motion":
        pass
    elif v.odds(0.25):
        part: Part = {"type": "guide-friction", "coulomb": v.q(v.log(0.05, 1.0), "force")}
        if v.odds(0.5):
            part["breakaway"] = v.q(v.log(1.0, 2.0), "force")
        v.parts["guide"] = part
        v.top.append("guide.body")
    elif v.odds(0.2):
        v.parts["guide"] = {
            "type": "lugre-friction",
            "coulomb": v.q(v.log(0.05, 1.0), "force"),
            "breakaway": v.q(v.log(1.0, 2.0), "force"),
            "bristle_stiffness": v.q(v.log(1e5, 1e6), "stiffness"),
            "bristle_damping": "1 N*s/m",
        }
        v.top.append("guide.body")
    if v.odds(0.25) and v.parts["needle"]["type"] in ("rigid-mass", "flexible-body"):
        v.parts["weight"] = {"type": "gravity", "inclination": v.one("0 deg", "30 deg", "90 deg")}
        v.tip.append("weight.body")
    if v.odds(0.05) and v.fmu is not None:
        v.parts["damper"] = {
            "type": "fmu",
            "file": v.fmu,
            "coupling_step": "2 us",
            "displacement": "x",
            "velocity": "v",
            "force": "F",
            "parameters": {"k": 0.1 * v.force / v.lift, "c": 0.1},
        }
        v.top.append("damper.end")
    if v.odds(0.12):
        v.parts["hold"] = {"type": "constant-force", "force": v.q(-0.1 * v.force, "force")}
        v.tip.append("hold.end")
    if v.odds(0.12):
        v.parts["field"] = {
            "type": "force-over-stroke",
            "stroke": [v.q(x * v.lift, "length") for x in (-0.5, 0.0, 0.5, 1.5)],
            "force": [v.q(x * v.force, "force") for x in (0.0, 0.0, 0.2, 0.3)],
        }
        v.top.append("field.end")


# --- drives ----------------------------------------------------------------------------------


def _drive(v: _Valve) -> None:
    kind = str(v.rng.choice(["force", "signal", "coil"], p=[0.2, 0.1, 0.7]))
    strong = 3.0 * v.force
    if kind == "force":
        times = [0.1 * v.end, 0.12 * v.end, 0.6 * v.end, 0.62 * v.end]
        v.parts["pull"] = {
            "type": "force-over-time",
            "time": [v.q(t, "time") for t in times],
            "force": ["0 N", v.q(strong, "force"), v.q(strong, "force"), "0 N"],
        }
        v.top.append("pull.end")
        return
    if kind == "signal":
        v.parts["pull"] = {
            "type": "controlled-force",
            **_law_of_signals(v, "needle.tip displacement", 0.5 * v.lift * 1e6, strong),
        }
        v.top.append("pull.end")
        return
    magnet = v.one("solenoid", "magnetic-network", "force-map-solenoid")
    {"solenoid": _solenoid, "magnetic-network": _magnet, "force-map-solenoid": _map}[magnet](v)
    v.top.append("coil.armature")
    v.joints.append(["coil.terminals", "driver.terminals"])
    v.parts["driver"] = _driver(v)


def _law_of_signals(v: _Valve, lift: str, wanted: float, strong: float) -> Part:
    kind = v.one("pid", "hysteresis", "state-machine")
    sensor: Part = {"channel": lift, "unit": "um"}
    if v.odds(0.5):
        sensor |= {"delay": "10 us", "noise": 0.2, "seed": 3, "quantisation": 0.1}
    law: Part = {
        "pid": {
            "kind": "pid",
            "sensor": "lift",
            "setpoint": {"time": ["0 us", "200 us"], "value": [0.0, wanted]},
            "gain": strong / wanted,
            "integral_time": "500 us",
            "lower": 0.0,
            "upper": strong,
        },
        "hysteresis": {
            "kind": "hysteresis",
            "sensor": "lift",
            "lower": 0.3 * wanted,
            "upper": wanted,
            "low": strong,
            "high": 0.0,
        },
        "state-machine": {
            "kind": "state-machine",
            "states": [
                {"name": "wait", "output": 0.0, "transitions": [{"to": "on", "after": "100 us"}]},
                {
                    "name": "on",
                    "output": strong,
                    "transitions": [{"to": "off", "sensor": "lift", "above": wanted}],
                },
                {"name": "off", "output": 0.0},
            ],
        },
    }[kind]
    return {
        "sample_time": v.one("2 us", "5 us", "10 us"),
        "sensors": {"lift": sensor},
        "controller": law,
    }


def _pole(v: _Valve) -> tuple[float, float]:
    """Outer radius and residual gap of a pole that can pull the needle at 1.2 T."""
    area = 8.0 * v.force / (1.2**2 / (2 * 4e-7 * pi))
    return float(np.sqrt(area / pi)), v.log(3e-5, 8e-5)


def _iron(v: _Valve, area: float) -> Part:
    part: Part = {"material": v.one("X6Cr17", _curve(v)), "length": v.q(0.03, "length")}
    part["area"] = v.q(1.2 * area, "area")
    if part["material"] == "X6Cr17" and v.odds(0.3):
        part["hysteresis"] = {"coercivity": "400 A/m", "initial_permeability": 150}
    if v.odds(0.3):
        part["eddy"] = {"conductivity": "1.6 MS/m", "terms": int(v.rng.integers(1, 5))}
    return part


def _curve(v: _Valve) -> Part:
    return v.one(
        {"froehlich": {"saturation": "1.8 T", "permeability": 1500}},
        {"tanh": {"saturation": "1.7 T", "permeability": 900}},
        {"brauer": {"k1": 0.3, "k2": 3.5, "k3": 300}},
        {
            "table": {
                "flux_density": ["0.5 T", "1 T", "1.3 T", "1.5 T"],
                "field_strength": ["200 A/m", "500 A/m", "1500 A/m", "6000 A/m"],
            }
        },
    )


def _solenoid(v: _Valve) -> None:
    r, residual = _pole(v)
    area = pi * r**2
    part: Part = {
        "type": "solenoid",
        "turns": int(v.rng.integers(40, 120)),
        "resistance": v.one("0.8 ohm", "500 mohm", "1.5 ohm"),
        "gap": v.q(1.05 * v.lift, "length"),
        "residual_gap": v.q(residual, "length"),
        "poles": [{"outer_radius": v.q(r, "length"), "fringing": "none"}],
    }
    if v.odds(0.4):
        part["poles"] = [
            {"outer_radius": v.q(r, "length"), "fringing": "equal", "shoulder": "1 mm"}
        ]
    if v.odds(0.7):
        part["iron"] = [_iron(v, area) for _ in range(int(v.rng.integers(1, 3)))]
    if v.odds(0.3):
        part["eddy"] = [{"conductivity": "1.5 MS/m", "length": "15 mm", "radius": v.q(r, "length")}]
    if v.odds(0.2):
        part["parasitic"] = [{"radius": v.q(r, "length"), "clearance": "0.1 mm", "length": "3 mm"}]
    if v.odds(0.15):
        part["magnets"] = [
            {
                "remanence": "1.1 T",
                "recoil_permeability": 1.05,
                "length": "0.3 mm",
                "area": v.q(2 * area, "area"),
                "polarity": v.one("with-coil", "against-coil"),
            }
        ]
    if v.odds(0.2):
        part["winding_temperature"] = "120 degC"
    loops = any("hysteresis" in iron for iron in part.get("iron", []))
    if loops and v.odds(0.5):
        part["start"] = "remanent"
    if not loops and v.odds(0.2):
        part["residual_flux"] = "1 uWb"
    v.parts["coil"] = part


def _magnet(v: _Valve) -> None:
    r, residual = _pole(v)
    area = pi * r**2
    elements: Part = {
        "core": {"kind": "iron", "between": ["bottom", "foot"], **_iron(v, area)},
        "winding": {"kind": "coil", "between": ["foot", "middle"], "turns": 60},
        "gap": {
            "kind": "pole",
            "between": ["pole", "bottom"],
            "outer_radius": v.q(r, "length"),
            "fringing": "none",
            "residual_gap": v.q(residual, "length"),
        },
        "leak": {"kind": "leakage", "between": ["foot", "middle"], "permeance": "12 nH"},
    }
    if v.odds(0.3):
        elements["gap"] = {
            "kind": "face",
            "between": ["pole", "bottom"],
            "area": v.q(area, "area"),
            "fringing_factor": 1.1,
            "residual_gap": v.q(residual, "length"),
        }
    link = v.one("air", "ring", "shorted-coil", "bias-coil", "magnet", "eddy", "coil")
    elements["link"] = {"kind": link, "between": ["middle", "pole"]} | {
        "air": {"length": "20 um", "area": v.q(2 * area, "area")},
        "ring": {"radius": v.q(r, "length"), "clearance": "50 um", "length": "5 mm"},
        "shorted-coil": {"resistance": "2 mohm"},
        "bias-coil": {"turns": 30, "current": "1 A"},
        "magnet": {
            "remanence": "0.9 T",
            "recoil_permeability": 1.05,
            "length": "0.2 mm",
            "area": v.q(2 * area, "area"),
        },
        "eddy": {"conductivity": "1.5 MS/m", "length": "20 mm", "radius": v.q(r, "length")},
        "coil": {"turns": 200, "circuit": "holding"},
    }[link]
    part: Part = {
        "type": "magnetic-network",
        "resistance": "0.8 ohm",
        "gap": v.q(1.05 * v.lift, "length"),
        "elements": elements,
    }
    if link == "coil":
        elements["leak2"] = {"kind": "leakage", "between": ["middle", "pole"], "permeance": "9 nH"}
        part["circuits"] = {"holding": {"resistance": "9 ohm"}}
        v.parts["battery"] = {"type": "voltage-step", "voltage": "12 V", "end": v.q(v.end, "time")}
        v.joints.append(["coil.holding", "battery.terminals"])
    v.parts["coil"] = part


def _map(v: _Valve) -> None:
    r, residual = _pole(v)
    gaps = np.geomspace(0.7 * residual + 2e-5, 1.4 * v.lift + residual + 2e-5, 14) - residual - 2e-5
    current = np.linspace(0.0, 30.0, 7)
    turns, area = 60, pi * r**2
    slope = turns**2 * 4e-7 * pi * area / (gaps + residual + 2e-5)
    full = 1.5 * area * turns
    v.parts["coil"] = {
        "type": "force-map-solenoid",
        "resistance": "0.8 ohm",
        "gap": v.q(1.05 * v.lift, "length"),
        "current": [f"{i:.6g} A" for i in current],
        "gaps": [f"{x:.8g} m" for x in gaps],
        "linkage": [
            [f"{full * np.tanh(L * i / full) + 0.05 * L * i:.10g} Wb" for L in slope]
            for i in current
        ],
    }


def _driver(v: _Valve) -> Part:
    begin, end = 0.05 * v.end, 0.6 * v.end
    on = {"start": v.q(begin, "time"), "end": v.q(end, "time")}
    kind = v.one(
        "voltage-step",
        "voltage-table",
        "drive-profile",
        "two-point",
        "peak-hold",
        "boost-driver",
        "pwm",
        "controlled-voltage",
    )
    hold = {"hold_current": "4 A", "hold_band": "0.5 A"}
    if kind == "voltage-step":
        return {"type": kind, "voltage": "14 V", **on, **v.one({}, {"decay": "30 V"})}
    if kind == "voltage-table":
        return {
            "type": kind,
            "time": ["0 s", v.q(begin, "time"), v.q(end, "time")],
            "voltage": ["0 V", "24 V", "0 V"],
        }
    if kind == "drive-profile":
        times = [v.q(t, "time") for t in (begin, 0.3 * v.end, 0.31 * v.end, end)]
        if v.odds(0.5):
            return {"type": kind, "time": times, "voltage": ["48 V", "48 V", "6 V", "6 V"]}
        return {
            "type": kind,
            "time": times,
            "current": ["0 A", "10 A", "4 A", "4 A"],
            "supply_voltage": "48 V",
        }
    if kind == "two-point":
        return {"type": kind, "voltage": "48 V", "upper": "12 A", "lower": "11 A", **on}
    if kind == "peak-hold":
        boost = {"boost_voltage": "60 V", "peak_current": "12 A", "supply_voltage": "14 V"}
        return {"type": kind, **boost, **hold, **on, **v.one({}, {"decay": "60 V"})}
    if kind == "pwm":
        duty = float(v.one(0.3, 0.6))
        return {"type": kind, "voltage": "48 V", "period": "40 us", "duty": duty, **on}
    if kind == "controlled-voltage":
        wanted = 0.5 * v.lift * 1e6
        return {"type": kind, **_law_of_signals(v, "needle.tip displacement", wanted, 48.0)}
    bank = {"capacitance": "20 uF", "recharge_power": "10 W", "efficiency": "85 %"}
    part: Part = {
        "type": kind,
        "battery": "14 V",
        "peak_current": "12 A",
        **hold,
        "shots": [on],
        "decay": "capacitor",
    }
    if v.odds(0.5):
        return part | bank | {"boost_voltage": "65 V"}
    v.parts["bank"] = {"type": "boost-capacitor", "voltage": "65 V", **bank}
    v.joints.append(["bank.outlet", "driver.supply"])
    return part


# --- liquids ---------------------------------------------------------------------------------


def _liquid(v: _Valve) -> None:
    """Source, link, inlet with its neighbours, opening, sac, drain."""
    name = str(v.one(*LIQUIDS))
    low, high, most = LIQUIDS[name]
    if v.odds(0.8):
        v.hot = float(np.clip(v.hot, low, high))
        v.network["ambient"]["temperature"] = f"{v.hot:.4g} degC"
    fluid: Part = {"name": name}
    if name == "own":
        fluid |= {"density": "820 kg/m^3", "bulk_modulus": "1.5 GPa", "viscosity": "3 mPa*s"}
    if v.odds(0.4):
        fluid["gas_fraction"] = v.one("0.01 %", 1e-3, "0.5 %")
    if v.odds(0.15) and name not in ("n-heptane", "petrol", "own"):
        fluid["viscosity_law"] = v.one("barus", "roelands")
    v.network["fluid"] = fluid if len(fluid) > 1 or v.odds(0.5) else name
    level = float(np.clip(v.log(3e5, 2.5e8), 2e5, most if v.odds(0.9) else 2.5e8))
    bore = float(np.clip(np.sqrt(v.force / level), 2e-4, 6e-3))
    inlet, sac = ["inlet.fluid", "opening.a"], ["sac.fluid", "opening.b"]
    given = v.parts["needle"]["type"] == "prescribed-motion"
    room = bore**2 * v.lift
    for chamber in ("inlet", "sac"):
        volume = 5.0 * room + bore**3 * v.log(1.0, 300.0)
        v.parts[chamber] = {"type": "chamber", "volume": v.q(volume, "volume")}
        if v.odds(0.4):
            start = level if chamber == "inlet" else 1.01325e5
            v.parts[chamber]["pressure"] = v.q(start, "pressure")
        if v.odds(0.15):
            v.parts[chamber]["wall"] = v.one(
                {"bulk_modulus": "2 GPa"},
                {"diameter": v.q(2 * bore, "length"), "thickness": "1 mm", "modulus": "200 GPa"},
            )
    _supply(v, level, bore, inlet)
    _opening(v, bore)
    spool = v.parts["opening"]["type"] == "spool-edge"
    v.tip.append("opening.spool" if spool else "opening.needle")
    area = 0.25 * pi * bore**2
    if v.odds(0.8):
        v.parts["crown"] = {"type": "pressure-face", "direction": "closing"} | v.one(
            {"area": v.q(area, "area")}, {"outer_diameter": v.q(bore, "length")}
        )
        v.tip.append("crown.body")
        inlet.append("crown.fluid")
    if v.odds(0.8):
        v.parts["nose"] = {
            "type": "pressure-face",
            "direction": "opening",
            "outer_diameter": v.q(bore, "length"),
        }
        v.tip.append("nose.body")
        sac.append("nose.fluid")
    if v.odds(0.2):
        v.parts["land"] = {
            "type": "land-face",
            "direction": "opening",
            "inner_diameter": v.q(bore, "length"),
            "outer_diameter": v.q(1.2 * bore, "length"),
        }
        v.tip.append("land.body")
        inlet.append("land.outside")
        sac.append("land.inside")
    if v.odds(0.25) and not given:
        v.parts["back"] = {"type": "chamber", "volume": v.q(10 * room + bore**3, "volume")}
        v.parts["gap"] = {
            "type": "annulus",
            "diameter": v.q(2 * bore, "length"),
            "length": v.q(6e-3, "length"),
            "clearance": v.q(v.log(3e-6, 5e-5), "length"),
            "eccentricity": v.one(0.0, 0.5),
        }
        v.top.append("gap.needle")
        inlet.append("gap.a")
        v.joints.append(["back.fluid", "gap.b"])
    if v.odds(0.15) and not given:
        v.parts["drag"] = {
            "type": "unsteady-drag",
            **(
                {"shape": "sphere", "radius": v.q(bore, "length")}
                if v.odds(0.5)
                else {
                    "shape": "layer",
                    "area": v.q(6.0 * bore**2, "area"),
                    "height": v.q(v.log(2e-5, 3e-4), "length"),
                    "added_mass": v.q(0.2 * v.mass, "mass"),
                }
            ),
            "memory": v.one(True, False),
        }
        v.top.append("drag.body")
    if v.odds(0.15):
        v.parts["relief"] = {
            "type": "relief-valve",
            "set_pressure": v.q(1.1 * level, "pressure"),
            "rated_pressure": v.q(1.3 * level, "pressure"),
            "rated_flow": "2 l/min",
            "diameter": v.q(bore, "length"),
        }
        inlet.append("relief.a")
        v.joints.append(["relief.b", "ambient"])
    if v.odds(0.15):
        v.parts["accumulator"] = {
            "type": "accumulator",
            "volume": "5 cm^3",
            "precharge": v.q(0.6 * level, "pressure"),
        }
        if v.odds(0.5):
            v.parts["accumulator"]["inlet_diameter"] = v.q(bore, "length")
        inlet.append("accumulator.fluid")
    _drain(v, bore, sac)
    v.joints += [inlet, sac]


def _supply(v: _Valve, level: float, bore: float, inlet: list[str]) -> None:
    flow = 0.7 * 0.25 * pi * (0.3 * bore) ** 2 * np.sqrt(2 * level / 800)
    kind = v.one(
        "pressure-source",
        "pressure-source",
        "controlled-pressure",
        "pump",
        "flow-source",
        "pulsating-flow",
    )
    source: Part = {"type": kind}
    if kind == "pressure-source":
        source["pressure"] = v.q(level, "pressure")
        if v.odds(0.3):
            to = v.q(level * v.rng.uniform(0.8, 1.0), "pressure")
            source["step"] = {"to": to, "at": v.q(0.2 * v.end, "time"), "rise": "20 us"}
        elif v.odds(0.3):
            del source["pressure"]
            source["table"] = {
                "time": ["0 s", v.q(0.3 * v.end, "time"), v.q(0.6 * v.end, "time")],
                "pressure": [v.q(level * x, "pressure") for x in (1.0, 0.9, 1.0)],
            }
    elif kind == "controlled-pressure":
        law = _law_of_signals(v, "needle.tip displacement", 0.5 * v.lift * 1e6, level)
        law["controller"] = {
            "kind": "state-machine",
            "states": [
                {
                    "name": "full",
                    "output": level,
                    "transitions": [{"to": "low", "after": v.q(0.4 * v.end, "time")}],
                },
                {"name": "low", "output": 0.9 * level},
            ],
        }
        source |= law | {"start": v.q(level, "pressure")}
    elif kind == "pump":
        source |= {
            "displacement": v.q(flow / 50, "volume"),
            "speed": "3000 rpm",
            "pistons": int(v.rng.integers(1, 10)),
        }
        if v.odds(0.5):
            source |= {"volumetric_efficiency": "90 %", "rated_pressure": v.q(level, "pressure")}
    elif kind == "flow-source":
        source["flow"] = v.q(flow, "flow")
    else:
        source |= {
            "mean": v.q(flow, "flow"),
            "harmonics": [
                {"frequency": "1 kHz", "amplitude": v.q(0.3 * flow, "flow"), "phase": "40 deg"}
            ],
        }
    v.parts["source"] = source
    begin = ["source.fluid"]
    if kind not in ("pressure-source", "controlled-pressure"):
        v.parts["outlet"] = {
            "type": "chamber",
            "volume": v.q(bore**3 * v.log(100, 3000), "volume"),
            "pressure": v.q(level, "pressure"),
        }
        begin = ["source.b", "outlet.fluid"]
        if v.odds(0.5):
            v.joints.append(["source.a", "ambient"])
        v.parts["limiter"] = {
            "type": "relief-valve",
            "set_pressure": v.q(1.05 * level, "pressure"),
            "rated_pressure": v.q(1.2 * level, "pressure"),
            "rated_flow": v.q(2 * flow, "flow"),
            "diameter": v.q(bore, "length"),
        }
        begin.append("limiter.a")
        v.joints.append(["limiter.b", "ambient"])
    tail = inlet
    if v.odds(0.25):  # two lines that meet in a junction
        v.parts["pipe"] = {
            "type": "line",
            "length": v.q(v.log(0.05, 1.0), "length"),
            "diameter": v.q(2 * bore, "length"),
            "pressure": v.q(level, "pressure"),
            "friction": v.one("kagawa", "steady", "turbulent", "none"),
        }
        v.parts["tee"] = {"type": "junction"}
        v.parts["branch"] = {"type": "line", "length": "80 mm", "diameter": v.q(bore, "length")}
        begin.append("pipe.a")
        tail = ["pipe.b", "tee.fluid", "branch.a"]
        v.parts["end"] = {"type": "junction"}
        v.joints += [["branch.b", "end.fluid"], tail]
        middle = _link(v, level, bore)
        tail.append(f"{middle}.a")
        inlet.append(f"{middle}.b")
    else:
        middle = _link(v, level, bore)
        begin.append(f"{middle}.a")
        inlet.append(f"{middle}.b")
    v.joints.append(begin)


def _link(v: _Valve, level: float, bore: float) -> str:
    kind = v.one(
        "line",
        "pipe-friction",
        "pressure-loss",
        "check-valve",
        "inertance",
        "orifice",
        "variable-orifice",
    )
    wide = v.q(bore * v.rng.uniform(0.8, 2.5), "length")
    v.parts["feed"] = {"type": kind} | {
        "line": {
            "length": v.q(v.log(0.03, 1.0), "length"),
            "diameter": wide,
            "pressure": v.q(level, "pressure"),
            **v.one({}, {"properties": "local", "cells": 20}, {"wall": {"bulk_modulus": "5 GPa"}}),
        },
        "pipe-friction": {"length": v.q(0.1, "length"), "diameter": wide, "roughness": "2 um"},
        "pressure-loss": {"diameter": wide, "coefficient": v.log(0.1, 5.0)},
        "check-valve": {
            "cracking_pressure": "0.3 bar",
            "open_pressure": v.one("1 bar", "3 bar"),
            "diameter": wide,
        },
        "inertance": {"length": v.q(0.02, "length"), "diameter": wide},
        "orifice": {"diameter": wide, "discharge": v.one(0.62, 0.8), "count": int(v.one(1, 4))},
        "variable-orifice": {
            "time": ["0 ms", v.q(0.3 * v.end, "time"), v.q(0.35 * v.end, "time")],
            "area": [v.q(x * bore**2, "area") for x in (0.5, 0.5, 0.05)],
        },
    }[kind]
    return "feed"


def _opening(v: _Valve, bore: float) -> None:
    kind = v.one("seat", "conical-seat", "spool-edge", "variable-orifice")
    force = v.one({}, {"flow_force": {}}, {"flow_force": {"damping_length": "2 mm"}})
    if kind == "seat":
        shape = v.one("flat", "cone", "ball")
        part: Part = {"shape": shape, "diameter": v.q(bore, "length"), **force}
        if shape == "cone":
            part["half_angle"] = v.one("45 deg", "30 deg", "60 deg")
        if shape == "ball":
            part["ball_diameter"] = v.q(1.5 * bore, "length")
        if v.odds(0.3):
            part["leak_area"] = "0.5 um^2"
        if v.odds(0.2):
            part["land_width"] = v.q(0.1 * bore, "length")
    elif kind == "conical-seat":
        part = {
            "half_angle": "30 deg",
            "upper_diameter": f"{1.3 * bore:.6g} m",
            "lower_diameter": f"{0.5 * bore:.6g} m",
            "edge_diameter": f"{bore:.6g} m",
            "tip_half_angle": v.one("31 deg", "45 deg"),
            "shank_half_angle": v.one("0 deg", "15 deg"),
            **force,
        }
        if v.odds(0.4):
            part["tip_side"] = "b"
    elif kind == "spool-edge":
        part = {
            "diameter": v.q(3 * bore, "length"),
            "radial_clearance": v.q(v.log(2e-6, 1e-5), "length"),
            "overlap": v.q(v.lift * v.rng.uniform(-0.2, 0.5), "length"),
            "direction": v.one("opening", "closing"),
            **force,
        }
        if v.odds(0.5):
            part["notches"] = [
                {
                    "shape": "triangular",
                    "count": 2,
                    "width": v.q(0.3 * bore, "length"),
                    "length": v.q(0.5 * v.lift, "length"),
                    "depth": v.q(0.2 * bore, "length"),
                }
            ]
    else:
        area = pi * bore * v.lift
        part = {
            "lift": [v.q(x * v.lift, "length") for x in (-0.2, 0.0, 0.5, 1.2)],
            "area": [v.q(x * area, "area") for x in (0.0, 0.001, 0.4, 1.0)],
        }
    v.parts["opening"] = {"type": kind, **part}


def _drain(v: _Valve, bore: float, sac: list[str]) -> None:
    hole = bore * v.rng.uniform(0.2, 0.9)
    if v.odds(0.25):  # holes from a file of their own
        count = int(v.rng.integers(1, 6))
        v.files["hole.yaml"] = json.dumps(
            {
                "klack": 1,
                "part": "A hole",
                "parameters": {"d": None, "share": "0.7"},
                "ports": {"a": "hole.a", "b": "hole.b"},
                "components": {
                    "hole": {"type": "orifice", "diameter": "= d", "discharge": "= share"}
                },
                "connections": [],
            },
            indent=1,
        )
        sizes = [v.q(hole / np.sqrt(count), "length").removeprefix("= ") for _ in range(count)]
        entry: Part = {"file": "hole.yaml", "as": "bore", "with": {"d": sizes}, "count": count}
        if count == 1:
            entry = {"file": "hole.yaml", "as": "bore1", "with": {"d": sizes[0]}}
        v.include.append(entry)
        sac.append("bore*.a" if count > 1 else "bore1.a")
        v.joints.append(["bore*.b" if count > 1 else "bore1.b", "ambient"])
        return
    v.parts["drain"] = {"type": "orifice", "diameter": v.q(hole, "length")}
    sac.append("drain.a")
    if v.odds(0.3):
        v.parts["tank"] = {"type": "pressure-source", "pressure": v.one("2 bar", "5 bar")}
        v.joints.append(["drain.b", "tank.fluid"])
    else:
        v.joints.append(["drain.b", "ambient"])


# --- gas, heat -------------------------------------------------------------------------------


def _gas(v: _Valve) -> None:
    gas = str(v.one(*GASES))
    v.network["gas"] = v.one(gas, {"name": gas}) if v.odds(0.85) else {
        "name": "own gas",
        "gas_constant": "300 J/kg/K",
        "kappa": 1.3,
        "viscosity": "15 uPa*s",
    }  # fmt: skip
    level = v.log(1.5e5, 2e7)
    bore = float(np.clip(np.sqrt(v.force / level), 5e-4, 5e-3))
    v.parts["bottle"] = {"type": "gas-source", "pressure": v.q(level, "pressure")}
    if v.odds(0.3):
        to = v.q(0.7 * level, "pressure")
        v.parts["bottle"]["step"] = {"to": to, "at": v.q(0.3 * v.end, "time")}
    elif v.odds(0.3):
        v.parts["bottle"]["temperature"] = v.one("80 degC", "-20 degC")
    rate = 2e-9 * bore**2 / 1e-6
    v.parts["inflow"] = {"type": "gas-orifice"} | v.one(
        {"conductance": f"{rate * 1e8:.4g} l/s/bar", "critical_ratio": 0.35},
        {"diameter": v.q(bore, "length")},
        {"area": v.q(bore**2, "area"), "discharge": 0.9},
    )
    for name, many in (("before", 50.0), ("behind", 200.0)):
        volume = 5 * bore**2 * v.lift + bore**3 * v.log(1.0, many)
        v.parts[name] = {"type": "gas-chamber", "volume": v.q(volume, "volume")}
        v.parts[name] |= v.one({}, {"heat_conductance": "0.02 W/K"}, {"isothermal": True})
    v.parts["throat"] = {"type": "gas-valve", "diameter": v.q(bore, "length")} | v.one(
        {}, {"leak": "1e-5 l/s/bar"}, {"half_angle": "45 deg"}
    )
    v.parts["exhaust"] = {"type": "gas-orifice", "diameter": v.q(0.4 * bore, "length")}
    before = ["before.gas", "inflow.b", "throat.a"]
    behind = ["behind.gas", "throat.b", "exhaust.a"]
    v.tip.append("throat.needle")
    v.parts["shut"] = {
        "type": "gas-face",
        "direction": "closing",
        "outer_diameter": v.q(bore, "length"),
    }
    v.tip.append("shut.body")
    before.append("shut.gas")
    if v.odds(0.5):
        v.parts["lifted"] = {"type": "gas-face", "direction": "opening", "area": f"{bore**2} m^2"}
        v.tip.append("lifted.body")
        behind.append("lifted.gas")
    if v.odds(0.4):
        v.parts["leakage"] = {
            "type": "gas-gap",
            "diameter": v.q(2 * bore, "length"),
            "length": v.q(6e-3, "length"),
            "clearance": v.q(v.log(5e-6, 3e-5), "length"),
        }
        before.append("leakage.a")
        v.joints.append(["leakage.b", "ambient"])
    v.joints += [["bottle.gas", "inflow.a"], before, behind, ["exhaust.b", "ambient"]]


def _heat(v: _Valve) -> None:
    v.parts["copper"] = {"type": "heat-capacity"} | v.one(
        {"capacity": "3 J/K"}, {"mass": "6 g", "specific_heat": "385 J/kg/K"}
    )
    v.parts["bobbin"] = {"type": "thermal-conductance", "conductance": "0.2 W/K"}
    v.parts["shell"] = {"type": "heat-capacity", "capacity": "30 J/K"}
    v.parts["air"] = {"type": "convection", "coefficient": "12 W/m^2/K", "area": "20 cm^2"}
    v.parts["glow"] = {"type": "heat-radiation", "emissivity": 0.9, "area": "20 cm^2"}
    v.parts["block"] = {"type": "fixed-temperature", "temperature": "60 degC"}
    v.parts["bolt"] = {"type": "thermal-conductance", "conductance": "0.4 W/K"}
    v.parts["current"] = {"type": "heat-source"} | v.one(
        {"power": "2 W"}, {"table": {"time": ["0 s", "10 s"], "power": ["0 W", "2 W"]}}
    )
    v.joints += [
        ["copper.node", "bobbin.a", "current.node"],
        ["bobbin.b", "shell.node", "air.surface", "glow.surface", "bolt.a"],
        ["bolt.b", "block.node"],
    ]
