"""Stairs in the rebound velocity against the theory of the feed line: ``python stairs.py``.

Reads the result in the folder ``stairs`` and uses of it, for the theory, only the speed of the
needle and the flow through the seat.  The line begins at a constant pressure, so a wave comes back
with the opposite sign after 2 L / a, and the pressure at the needle is

    p(t) = -p(t - 2 L/a) + Z [q(t) - q(t - 2 L/a)],    Z = rho a / A_line,

with q the flow into the line, above the pressure at rest.  The stairs themselves are those that
klack has found.
"""

from math import pi

import numpy as np

import klack
from klack.hydraulics.fluid_library import library_fluid

LENGTH, BORE, SEAT = 60e-3, 7e-3, 5e-3  # [m], of stairs/case.yaml
SUPPLY = 6.013e5  # [Pa]
EDGE = 12e-6  # [s], half of the time that an impact, so an edge, takes


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


def stairs(variant, number):
    """Stairs after an impact on the seat, each with the step of force [N] that theory expects."""
    echo, _, _ = theory()
    channels, time = variant.result.channels, variant.result.time
    speed, flow = channels["needle.tip velocity"].values, channels["restriction mass flow"].values
    pressure = expected_pressure(time, speed, flow)
    found = []
    for stair in variant.stairs:
        if (stair.stop, stair.impact) == ("seat", number):
            before, after = (
                np.mean(pressure[(time > edge + EDGE) & (time < edge + echo - EDGE)])
                for edge in (stair.expected_time - echo, stair.expected_time)
            )
            found.append((stair, 0.25 * pi * SEAT**2 * (after - before)))
    return found


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
    impact = wet.impacts("seat")[0]
    middle = impact.time + 0.5 * impact.contact_time
    print(f"length of a stair: 2 L/a = {1e6 * echo:.1f} us")
    for stair, force in stairs(wet, 1):
        print(
            f"edge {stair.number}: after {1e6 * (stair.time - middle):.1f} us; force "
            f"{force:+.2f} N expected, {stair.force:+.2f} N computed, {stair.seen_force:+.2f} N "
            f"from the velocity; step of the velocity {force * echo / mass:+.3f} m/s expected, "
            f"{stair.velocity_step:+.3f} m/s computed"
        )
    flat = slopes(dry, dry.impacts("seat")[0], 3)
    print("dry: slopes " + ", ".join(f"{slope:.0f} m/s^2" for slope in flat))


if __name__ == "__main__":
    main()
