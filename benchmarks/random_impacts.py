"""Random axisymmetric impacts: ``python benchmarks/random_impacts.py --count 300 --seed 17``.

Each draw is a possible case: a needle with a spherical, conical, toroidal or flat
tip on a conical seat, a rounded edge or a flat one, 0.1 to 20 mm in radius, of steel, ceramic,
polymer or copper, at 0.01 to 10 m/s, on meshes from coarse to fine.  Each runs at the reduced and
the interface level on one mesh.  A line of JSON per draw says what came: failures, energy
residuals, the deviation of the two levels, warnings, and how wide the contact was over what Hertz's
law expects.  ``--finer EVERY`` repeats every so-many-th draw on a mesh of half the size;
``--full`` runs the full order too, at 150 steps of the expected contact and at 900, against which
estimated errors and their margins are to hold.
"""

import argparse
import json
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from math import cos, log, log2, pi, radians, sin, sqrt, tan
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import yaml

from klack.acoustics.comparison import compare_histories
from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.run import run_impact
from klack.case import read_case
from klack.case.schema import Case
from klack.contact.hertz import line_half_width, point_radius
from klack.errors import KlackError

MATERIALS: Mapping[str, tuple[float, float, float]] = {
    "steel": (210e9, 0.3, 7850.0),
    "ceramic": (310e9, 0.27, 3200.0),
    "polymer": (3.5e9, 0.4, 1320.0),
    "copper": (115e9, 0.34, 8900.0),
}
"""Young's modulus [Pa], Poisson's ratio, density [kg/m^3]."""

_DEVIATION = ("peak_force", "contact_time", "history_l2")
_STEPS = (150, 500)  # of the contact time; the usual number is 500
_FULL_STEPS, _FINER = 150, 6  # of the full order, and how much finer its truth is


@dataclass(frozen=True, slots=True)
class _Tip:
    """Lower end of a needle: edges up to its shank, where it touches, how round it is there."""

    start: tuple[float, float]
    edges: list[dict[str, Any]]
    touch: float  # radius of the ring [m]; 0 on the axis
    curvature: float  # [1/m]
    height: float  # [m]


def draw(seed: int, index: int) -> dict[str, Any]:
    """Return one case as plain data, with ``index`` of the series ``seed``."""
    rng = np.random.default_rng([seed, index])
    a = _log(rng, 0.1e-3, 20e-3)
    tip_kind = str(rng.choice(["sphere", "cone", "torus", "flat"]))
    seat_kind = str(rng.choice(["cone", "flat"]))
    angle = radians(rng.uniform(15.0, 65.0))
    tip = _tip(rng, tip_kind, a, angle if seat_kind == "cone" else 0.0)
    length = tip.height + a * _log(rng, 0.5, 12.0)
    bore = float(rng.uniform(0.0, 0.5)) if tip.touch else 0.0
    outer, thick = a * rng.uniform(1.4, 3.0), a * rng.uniform(0.6, 4.0)
    seat, around = _seat(seat_kind, tip, a, bore * tip.touch, outer, thick, angle)
    names = [str(rng.choice(list(MATERIALS))) for _ in range(2)]
    speed = _log(rng, 0.01, 10.0)
    mass = pi * a**2 * length * MATERIALS[names[0]][2]
    half_width, time = _expected(tip, seat_kind, angle, names, mass, speed)
    ratio = _log(rng, 0.3, 4.0)
    size = min(max(ratio * half_width, 2e-4 * a), a / 4.0)
    extent = min(max(3.0 * half_width, 3.0 * size), a / 2.0)
    bulk = a / rng.uniform(2.0, 6.0)
    wave = 2.0 * length / sqrt(MATERIALS[names[0]][0] / MATERIALS[names[0]][2])
    duration = float(rng.uniform(2.0, 4.0)) * max(time, wave)
    step = time / _log(rng, *_STEPS)
    step = min(max(step, duration / 5000.0), duration / 60.0)
    needle: dict[str, Any] = {
        "geometry": _profile(
            tip.start,
            [
                *tip.edges,
                {"line": [a, length], "name": "shank"},
                {"line": [0.0, length], "name": "top"},
                {"close": True, "name": "axis"},
            ],
        ),
        "material": names[0],
        "mesh": {"size": _m(bulk), "contact": {"size": _m(min(size, bulk)), "extent": _m(extent)}},
    }
    housing: dict[str, Any] = {
        "geometry": _profile(seat, around),
        "material": names[1],
        "mesh": dict(needle["mesh"]),
    }
    support = str(rng.choice(["outside", "bottom", "free"]))
    if support != "free":
        housing["fixed"] = [{"surface": support}]
    for body in (needle, housing):
        damping = str(rng.choice(["none", "modal", "loss_factor", "rayleigh"]))
        if damping == "rayleigh":
            body["damping"] = {
                "rayleigh": {
                    "alpha": f"{_log(rng, 1.0, 100.0):.4g} 1/s",
                    "beta": f"{_log(rng, 1e-10, 1e-8):.4g} s",
                }
            }
        elif damping != "none":
            body["damping"] = {damping: f"{_log(rng, 0.1, 10.0):.3g} %"}
    motion: dict[str, Any] = {"speed": f"{speed:.6g} m/s"}
    scale = mass * speed / time  # about the peak force
    if rng.random() < 0.3:
        motion["force"] = f"{scale * _log(rng, 1e-4, 0.05):.4g} N"
    if rng.random() < 0.3:
        motion["spring"] = {
            "stiffness": f"{scale / a * _log(rng, 1e-4, 0.1):.4g} N/m",
            "preload": f"{scale * _log(rng, 1e-4, 0.02):.4g} N",
        }
    gap = 0.0 if rng.random() < 0.5 else speed * duration * float(rng.uniform(0.0, 0.3))
    return {
        "klack": 1,
        "title": f"{names[0]} {tip_kind} on {names[1]} {seat_kind}, {support}",
        "materials": {
            name: {"young": f"{E:.6g} Pa", "poisson": nu, "density": f"{rho:g} kg/m^3"}
            for name, (E, nu, rho) in MATERIALS.items()
        },
        "bodies": {"needle": needle, "housing": housing},
        "contact": {"between": ["needle.tip", "housing.seat"], "gap": _m(gap)},
        "motion": motion,
        "reduction": {"modes": {"needle": {"count": int(rng.integers(4, 40))},
                                "housing": {"count": int(rng.integers(4, 60))}}},
        "run": {"duration": f"{duration:.6g} s", "reduced_step": f"{step:.6g} s",
                "interface_step": f"{step:.6g} s",
            "full_step": f"{time / _FULL_STEPS:.6g} s", "levels": ["reduced", "interface"]},
    }  # fmt: skip


def _tip(rng: np.random.Generator, kind: str, a: float, angle: float) -> _Tip:
    """Draw a tip of radius ``a`` whose lowest point is at z = 0; ``angle`` is that of the seat."""
    if kind == "sphere":
        R = a * _log(rng, 1.02, 4.0)
        if R * sin(angle) > 0.9 * a:  # it has to touch the cone with its sphere
            R = 1.02 * a
        rise = R - sqrt(R**2 - a**2)
        edges = [{"arc": [a, rise], "centre": [0.0, R], "name": "tip"}]
        return _Tip((0.0, 0.0), edges, R * sin(angle), 1.0 / R, rise)
    if kind == "cone":
        nose = a * rng.uniform(0.1, 0.5)
        slope = angle + radians(rng.uniform(3.0, 20.0))  # steeper than the seat: nose touches
        r, z = nose * sin(slope), nose * (1.0 - cos(slope))
        height = z + (a - r) * tan(slope)
        edges = [{"arc": [r, z], "centre": [0.0, nose], "name": "tip"},
                 {"line": [a, height], "name": "tip"}]  # fmt: skip
        return _Tip((0.0, 0.0), edges, nose * sin(angle), 1.0 / nose, height)
    rho = a * rng.uniform(0.04, 0.2)
    if kind == "torus":
        ring = a - rho
        recess = rho * rng.uniform(0.5, 0.9)
        inner = ring - sqrt(rho**2 - (rho - recess) ** 2)
        edges = [{"line": [inner, recess], "name": "recess"},
                 {"arc": [ring, 0.0], "centre": [ring, rho], "name": "tip"},
                 {"arc": [a, rho], "centre": [ring, rho], "name": "tip"}]  # fmt: skip
        return _Tip((0.0, recess), edges, ring + rho * sin(angle), 1.0 / rho, rho)
    edges = [{"line": [a - rho, 0.0], "name": "tip"},
             {"arc": [a, rho], "centre": [a - rho, rho], "name": "tip"}]  # fmt: skip
    # flat on flat is a contact of the whole face
    curvature = 1.0 / rho if angle else 0.0
    return _Tip((0.0, 0.0), edges, a - rho + rho * sin(angle), curvature, rho)


def _seat(
    kind: str, tip: _Tip, a: float, bore: float, outer: float, thick: float, angle: float
) -> tuple[tuple[float, float], list[dict[str, Any]]]:
    """Outline of the housing, wide enough to hold the place of the touch."""
    if kind == "flat":
        edges = [{"line": [outer, -thick], "name": "bottom"}, {"line": [outer, 0.0],
                 "name": "outside"}, {"line": [bore, 0.0], "name": "seat"}]  # fmt: skip
        return (bore, -thick), [*edges, {"close": True, "name": "bore"}]
    rim = 1.1 * a
    low = -(rim - bore) * tan(angle)
    edges = [{"line": [outer, low - thick], "name": "bottom"},
             {"line": [outer, 0.0], "name": "outside"}, {"line": [rim, 0.0], "name": "face"},
             {"line": [bore, low], "name": "seat"}]  # fmt: skip
    return (bore, low - thick), [*edges, {"close": True, "name": "bore"}]


def _expected(
    tip: _Tip, seat: str, angle: float, names: list[str], mass: float, speed: float
) -> tuple[float, float]:
    """Half width of the contact [m] and contact time [s] of a quasi-static impact."""
    modulus = 1.0 / sum((1.0 - MATERIALS[n][1] ** 2) / MATERIALS[n][0] for n in names)
    if not tip.curvature:  # flat face: a punch
        return tip.touch / 2.0, pi * sqrt(mass / (2.0 * modulus * tip.touch))
    if tip.touch == 0.0:
        k = 4.0 / 3.0 * modulus / sqrt(tip.curvature)
        depth = (1.25 * mass * speed**2 / k) ** 0.4
        return point_radius(k * depth**1.5, tip.curvature, modulus), 2.94 * depth / speed
    slope = angle if seat == "cone" else 0.0
    # a line yields nearly in proportion to its load; the logarithm stands for the bodies
    stiffness = 2.0 * pi * tip.touch * modulus * pi / 4.0 / log(50.0) * cos(slope) ** 2
    force = speed * sqrt(mass * stiffness)
    load = force / (2.0 * pi * tip.touch * cos(slope))
    return line_half_width(load, tip.curvature, modulus), pi * sqrt(mass / stiffness)


def _profile(start: tuple[float, float], edges: list[dict[str, Any]]) -> dict[str, Any]:
    """Half section in metres, given in millimetres."""

    def mm(point: Any) -> list[float]:
        return [float(f"{1e3 * x:.12g}") for x in point]

    points = ("line", "arc", "centre")
    scaled = [{k: mm(v) if k in points else v for k, v in edge.items()} for edge in edges]
    outline = {"start": mm(start), "edges": scaled}
    return {"model": "axisymmetric", "profile": {"unit": "mm", "parts": {"part": outline}}}


def _log(rng: np.random.Generator, low: float, high: float) -> float:
    return float(low * 2.0 ** (rng.random() * log2(high / low)))


def _m(value: float) -> str:
    return f"{1e3 * value:.9g} mm"


def finer(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the same case on meshes of half the size, with modes for twice the frequency."""
    bodies = {}
    for name, body in data["bodies"].items():
        mesh, contact = body["mesh"], body["mesh"]["contact"]
        half = {"size": _half(mesh["size"]),
                "contact": {**contact, "size": _half(contact["size"])}}  # fmt: skip
        bodies[name] = {**body, "mesh": half}
    return {**data, "bodies": bodies}


def _half(length: str) -> str:
    return f"{float(length.removesuffix(' mm')) / 2.0:.9g} mm"


def case_of(data: Mapping[str, Any]) -> Case:
    """Check plain data as a case file."""
    return read_case(yaml.safe_dump(dict(data), sort_keys=False), Path("random.yaml"))


def outcome(data: Mapping[str, Any]) -> dict[str, Any]:
    """Run a draw; numbers of both levels, or the error."""
    begin = perf_counter()
    try:
        study = run_impact(case_of(data), levels=("reduced", "interface"))
    except KlackError as error:
        return {"error": f"{type(error).__name__}: {error}"}
    except Exception:
        return {"error": traceback.format_exc()}
    return numbers(study) | {"seconds": round(perf_counter() - begin, 2)}


def numbers(study: ImpactStudy) -> dict[str, Any]:
    """What a draw is judged by."""
    # also where both have doubts, and the study gives no deviation
    histories = (study.levels[name].history for name in ("interface", "reduced"))
    deviation = compare_histories(*histories)
    estimate = study.estimates.get("reduced")
    return {
        "peak": {name: level.measures.peak_force for name, level in study.levels.items()},
        "time": {name: level.measures.contact_time for name, level in study.levels.items()},
        "restitution": {n: level.measures.restitution for n, level in study.levels.items()},
        "residual": {name: level.energy_residual for name, level in study.levels.items()},
        "deviation": [getattr(deviation, name) for name in _DEVIATION],
        "estimate": estimate and [getattr(estimate, name) for name in _DEVIATION],
        "settled": study.estimates_settled,
        "ratio": study.contact.size_ratio,
        "half_width": study.contact.half_width,
        "points": study.contact.points_across,
        "doubts": list(study.contact.doubts),
        "warnings": list(study.warnings),
    }


def beside_full(data: Mapping[str, Any]) -> dict[str, Any]:
    """Estimated errors of the reduced level and of the full order, their margins, and the truth."""
    run = data["run"]
    step = float(run["full_step"].removesuffix(" s")) / _FINER
    fine = {**data, "run": {**run, "full_step": f"{step:.6g} s"}}
    try:
        study = run_impact(case_of(data), levels=("reduced", "full"))
        truth = run_impact(case_of(fine), levels=("full",), certify=False).levels["full"].history
    except KlackError as error:
        return {"error": f"{type(error).__name__}: {error}"}
    of = {name: compare_histories(truth, one.history) for name, one in study.levels.items()}
    names = ("peak_force", "contact_time", "restitution")
    return {
        what: {name: [getattr(one, key) for key in names] for name, one in found.items()}
        for what, found in (
            ("true", of),
            ("estimate", study.estimates),
            ("margin", study.estimate_margins),
        )
    } | {"settled": study.estimates_settled}


def main() -> None:
    """Run the series and write a line per draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=17)
    parser.add_argument("--finer", type=int, default=10, metavar="EVERY")
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--out", type=Path, default=Path("random_impacts.jsonl"))
    asked = parser.parse_args()
    with asked.out.open("a", encoding="utf-8") as stream:
        for index in range(asked.first, asked.first + asked.count):
            data = draw(asked.seed, index)
            line = {"index": index, "title": data["title"], **outcome(data)}
            if asked.finer and index % asked.finer == 0 and "error" not in line:
                line["finer"] = outcome(finer(data))
            if asked.full and "error" not in line:
                line["beside_full"] = beside_full(data)
            stream.write(json.dumps(line) + "\n")
            stream.flush()
            print(index, line["title"], line.get("error", line.get("deviation")), flush=True)


if __name__ == "__main__":
    main()
