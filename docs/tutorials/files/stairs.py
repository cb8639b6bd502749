"""Stairs in the rebound velocity against the theory of the feed line: ``python stairs.py``.

Reads the result in the folder ``stairs`` and uses of it, for the theory, only the speed of the
needle and the flow through the seat.  The line begins at a constant pressure, so a wave comes back
with the opposite sign after 2 L / a, and the pressure at the needle is

    p(t) = -p(t - 2 L/a) + Z [q(t) - q(t - 2 L/a)],    Z = rho a / A_line,

with q the flow into the line, above the pressure at rest.  Stair k lasts from k to k + 1 echo times
after the middle of the impact.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import pi

import numpy as np

import klack
from klack.hydraulics.fluid_library import library_fluid

LENGTH, BORE, SEAT = 60e-3, 7e-3, 5e-3  # [m], of stairs/case.yaml
SUPPLY = 6.013e5  # [Pa]
EDGE = 12e-6  # [s], half of the time that an impact, so an edge, takes


@dataclass(frozen=True)
class Stair:
    """Mean pressure force on the needle, and the slope of its velocity, over one stair."""

    force: float
    expected_force: float
    slope: float


def theory():
    """Echo time [s] and impedance of the line [Pa s/m^3]."""
    heptane = library_fluid("n-heptane").at(293.15, gas_fraction=0.0)
    a, rho = float(heptane.sound_speed(SUPPLY)), float(heptane.density(SUPPLY))
    return 2.0 * LENGTH / a, rho * a / (0.25 * pi * BORE**2), rho


def expected_pressure(time, speed, seat_flow):
    """Pressure [Pa] at the needle from its speed and the flow through the seat alone."""
    echo, Z, rho = theory()
    flow = -0.25 * pi * SEAT**2 * speed - seat_flow / rho
    above = np.zeros_like(time)
    for i, t in enumerate(time):
        before = t - echo
        earlier = np.interp(before, time[:i], above[:i]) if before > 0.0 else 0.0
        above[i] = Z * (flow[i] - np.interp(before, time, flow)) - earlier
    return SUPPLY + above


def edge_time(time, pressure, about):
    """Centre [s] of a change of pressure."""
    near = np.abs(time - about) < 1.5 * EDGE
    rate = np.abs(np.gradient(pressure, time))[near]
    return float(np.sum(rate * time[near]) / np.sum(rate))


def stairs(variant, impact, count):
    """Edges [s] and stairs after an impact on the seat."""
    echo, _, _ = theory()
    area = 0.25 * pi * SEAT**2
    channel = {name: variant.result.channels[name].values for name in variant.result.channels}
    time, speed = variant.result.time, channel["needle velocity"]
    pressure, body = channel["mouth pressure"], channel["body pressure"]
    expected = expected_pressure(
        time, channel["needle.tip velocity"], channel["restriction mass flow"]
    )
    middle = impact.time + 0.5 * impact.contact_time
    found = []
    for k in range(count):
        on = (time > middle + k * echo + EDGE) & (time < middle + (k + 1) * echo - EDGE)
        found.append(
            Stair(
                force=area * np.mean((pressure - body)[on]),
                expected_force=area * np.mean((expected - body)[on]),
                slope=np.polyfit(time[on], speed[on], 1)[0],
            )
        )
    edges = [edge_time(time, pressure, middle + k * echo) for k in range(count)]
    return edges, found


def slopes(variant, impact, count):
    """Slope [m/s^2] of the velocity over each of the times that would be stairs."""
    echo, _, _ = theory()
    time, speed = variant.result.time, variant.result.channels["needle velocity"].values
    middle = impact.time + 0.5 * impact.contact_time
    return [
        float(np.polyfit(time[on], speed[on], 1)[0])
        for on in (
            (time > middle + k * echo + EDGE) & (time < middle + (k + 1) * echo - EDGE)
            for k in range(count)
        )
    ]


def main():
    """Print the stairs after the first impact on the seat, and what the dry needle does."""
    study = klack.load_result("stairs").record
    mass = next(body.mass for body in study.bodies if body.name == "needle")
    echo, _, _ = theory()
    wet, dry = study.variants["wet"], study.variants["dry"]
    edges, found = stairs(wet, wet.impacts("seat")[0], 3)
    print(f"length of a stair: 2 L/a = {1e6 * echo:.1f} us")
    for before, after in pairwise(edges):
        print(f"  computed {1e6 * (after - before):.1f} us")
    for k in range(1, len(found)):
        step, theirs = (
            found[k].force - found[k - 1].force,
            found[k].expected_force - found[k - 1].expected_force,
        )
        seen = mass * (found[k].slope - found[k - 1].slope)
        print(
            f"edge {k}: force {theirs:+.2f} N expected, {step:+.2f} N computed, "
            f"{seen:+.2f} N from the velocity; step of the velocity "
            f"{theirs * echo / mass:+.3f} m/s expected, {seen * echo / mass:+.3f} m/s computed"
        )
    flat = slopes(dry, dry.impacts("seat")[0], 3)
    print("dry: slopes " + ", ".join(f"{slope:.0f} m/s^2" for slope in flat))


if __name__ == "__main__":
    main()
