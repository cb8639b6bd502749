"""Valves by characteristic, accumulators, pumps: closed formulas, independently coded networks."""

from collections.abc import Iterator
from math import exp, pi, sqrt, tan

import numpy as np
from scipy.integrate import quad

from klack.hydraulics.fluid_store import gas_store
from klack.hydraulics.opening import opening_flow
from klack.hydraulics.pulsating_flow import FlowHarmonic, PulsatingFlow
from klack.verification.benches import (
    AMBIENT,
    BAR,
    MU_OIL,
    OIL,
    RHO_OIL,
    branch_of,
    branch_step,
    component,
)
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.conical_seats import acting_areas, conical_seats
from klack.verification.spool_edges import edges, notched_edges
from klack.verification.supply_networks import gas_release, supply_networks

__all__ = ["checks"]


def checks() -> list[Check]:
    """Return the checks."""
    return [
        *_check_valve(),
        *_relief_valve(),
        *_accumulator(),
        *_variable_orifice(),
        *_pump(),
        _pulsation(),
        *edges(),
        *notched_edges(),
        *conical_seats(),
        *acting_areas(),
        *supply_networks(),
        *gas_release(),
    ]


def _check_valve() -> list[Check]:
    part = component(
        "check-valve",
        cracking_pressure=0.5 * BAR,
        open_pressure=2.5 * BAR,
        diameter=6e-3,
        cavitation=None,
    )
    row, whole = branch_of(part), pi / 4 * 36e-6
    drops = np.linspace(0.0, 4.0, 81) * BAR
    s = np.clip((drops - 0.5 * BAR) / (2.0 * BAR), 0.0, 1.0)
    found = np.array([branch_step(row, 50e5 + drop, 50e5)[0] for drop in drops]) / RHO_OIL * 6e4
    law = "Merritt 1967, sec. 3-3: C_q A sqrt(2 rho dp)"
    reverse = branch_step(row, 1e5, 300e5)
    up, down = (branch_step(row, 50e5 + x, 50e5)[0] for x in (1.2e5 + 20.0, 1.2e5 - 20.0))
    choked = branch_step(branch_of(part.model_copy(update={"cavitation": 0.6})), 3e5, 1e3)
    return [
        check(
            "check valve half open at 1.5 bar, mass flow [kg/s]",
            0.7 * 0.5 * whole * sqrt(2 * RHO_OIL * 1.5 * BAR),
            float(branch_step(row, 50e5 + 1.5 * BAR, 50e5)[0]),
            5e-14,
            law + "; half of the area",
            ComparedCurve(
                x_label="pressure drop [bar]",
                y_label="flow [l/min]",
                expected=(drops / BAR, 0.7 * whole * s * np.sqrt(2.0 * drops / RHO_OIL) * 6e4),
                computed=(drops / BAR, found),
            ),
        ),
        check(
            "check valve fully open at 4 bar, mass flow [kg/s]",
            0.7 * whole * sqrt(2 * RHO_OIL * 4 * BAR),
            float(branch_step(row, 54e5, 50e5)[0]),
            5e-14,
            law,
        ),
        check(
            "check valve at 299 bar in reverse, mass flow [kg/s]",
            0.0,
            float(reverse[0]),
            0.0,
            "closed",
        ),
        check(
            "check valve opening, slope of its flow [kg/(s Pa)]",
            float(up - down) / 40.0,
            float(branch_step(row, 50e5 + 1.2e5, 50e5)[1]),
            1e-7,
            "central difference over 40 Pa",
        ),
        check(
            "check valve that cavitates, mass flow [kg/s]",
            0.6 * whole * sqrt(2 * RHO_OIL * (3e5 - OIL.vapour_pressure)),
            float(choked[0]),
            5e-14,
            "Nurick 1976: C_c A sqrt(2 rho (p - p_v))",
        ),
    ]


def _relief_valve() -> list[Check]:
    part = component(
        "relief-valve",
        **{"set_pressure": 100 * BAR, "rated_pressure": 110 * BAR, "rated_flow": 40 / 6e4},
        diameter=3e-3,
        cavitation=None,
    )
    row, tau = branch_of(part), 2e-3
    drops = np.linspace(95.0, 130.0, 71) * BAR
    found = np.array([branch_step(row, BAR + drop, BAR)[0] for drop in drops]) / RHO_OIL * 6e4
    sticky = branch_of(part.model_copy(update={"hysteresis": 3 * BAR}))
    state = branch_step(sticky, BAR + 108 * BAR, BAR)[3:6]
    held = branch_step(sticky, BAR + 106 * BAR, BAR, state=state)
    closing = branch_step(sticky, BAR + 103 * BAR, BAR, state=state)
    slow = branch_of(part.model_copy(update={"time_constant": tau}))
    late = branch_step(slow, BAR + 104 * BAR, BAR)[3:6]
    first = float(late[1])
    for _ in range(10):
        late = branch_step(slow, BAR + 108 * BAR, BAR, h=0.2 * tau, state=late)[3:6]
    k = 40 / 6e4 / (10 * BAR) * sqrt(0.5 * RHO_OIL) / 0.7
    area = {drop: k * (drop - 100) * BAR / sqrt(drop * BAR) for drop in (106, 108)}
    return [
        check(
            "relief valve 7.5 bar above its set pressure, flow [m^3/s]",
            30 / 6e4,
            float(branch_step(row, BAR + 107.5 * BAR, BAR)[0]) / RHO_OIL,
            5e-14,
            "characteristic: straight through the rated point",
            ComparedCurve(
                x_label="pressure drop [bar]",
                y_label="flow [l/min]",
                expected=(
                    drops / BAR,
                    np.minimum(
                        40.0 * np.maximum(drops / BAR - 100.0, 0.0) / 10.0,
                        0.7 * pi / 4 * 9e-6 * np.sqrt(2.0 * drops / RHO_OIL) * 6e4,
                    ),
                ),
                computed=(drops / BAR, found),
            ),
        ),
        check(
            "relief valve 0.5 bar below its set pressure, flow [m^3/s]",
            0.0,
            float(branch_step(row, BAR + 99.5 * BAR, BAR)[0]),
            0.0,
            "closed",
        ),
        check(
            "relief valve fully open at 130 bar, flow [m^3/s]",
            0.7 * pi / 4 * 9e-6 * sqrt(2 * 130 * BAR / RHO_OIL),
            float(branch_step(row, BAR + 130 * BAR, BAR)[0]) / RHO_OIL,
            5e-14,
            "Merritt 1967, sec. 3-3: orifice of the largest area",
        ),
        check(
            "relief valve back from 108 to 106 bar, hysteresis 3 bar, area [m^2]",
            area[108],
            float(held[4]),
            5e-14,
            "play: the area stays",
        ),
        check(
            "relief valve back from 108 to 103 bar, hysteresis 3 bar, area [m^2]",
            area[106],
            float(closing[4]),
            5e-14,
            "play: the area of 106 bar",
        ),
        check(
            "relief valve after two time constants, area [m^2]",
            area[108] + (first - area[108]) * exp(-2.0),
            float(late[1]),
            5e-14,
            "lag of first order: exp(-t/tau)",
        ),
    ]


def _accumulator() -> list[Check]:
    p0, whole, least = 60 * BAR, 1e-3, 0.1e-3

    def held(p: float, n: float) -> tuple[float, float, float]:
        return gas_store(p, AMBIENT.pressure, p0, whole, n, least)

    gas = whole - held(200 * BAR, 1.4)[0]
    work = -quad(
        lambda volume: p0 * (whole / volume) ** 1.4 - AMBIENT.pressure, whole, gas, epsrel=1e-13
    )[0]
    row, p = (
        branch_of(component("accumulator", volume=whole, precharge=p0)),
        np.geomspace(60.0, 400.0, 60) * BAR,
    )
    volumes = np.array([held(x, 1.4)[0] for x in p])
    in_100 = branch_step(row, 100 * BAR, BAR, h=1e-3, state=[90 * BAR, 0.0, 0.0, 1.0])
    mass = [float(OIL.density(x)) * held(x, 1.4)[0] for x in (90 * BAR, 100 * BAR)]
    empty = branch_step(row, 40 * BAR, BAR, state=[50 * BAR, 0.0, 0.0, 1.0])
    full = held(p0 * 10**1.4 * 1.5, 1.4)
    return [
        check(
            "accumulator at 200 bar, volume of its gas [m^3]",
            whole * (60 / 200) ** (1 / 1.4),
            gas,
            5e-14,
            "p V^n = const, n = 1.4",
            ComparedCurve(
                x_label="fluid inside [l]",
                y_label="pressure [bar]",
                expected=(volumes * 1e3, p0 * (whole / (whole - volumes)) ** 1.4 / BAR),
                computed=(volumes * 1e3, p / BAR),
            ),
        ),
        check(
            "accumulator filled to 200 bar, n = 1.4, energy [J]",
            work,
            held(200 * BAR, 1.4)[2],
            2e-14,
            "quadrature of the pressure over the volume",
        ),
        check(
            "accumulator filled to 200 bar, n = 1, energy [J]",
            float(p0 * whole * np.log(200 / 60) - AMBIENT.pressure * whole * (1 - 60 / 200)),
            held(200 * BAR, 1.0)[2],
            1e-13,
            "p V ln(V_0/V), less the work of the surroundings",
        ),
        check(
            "accumulator from 90 to 100 bar, mass that flows in [kg]",
            mass[1] - mass[0],
            float(in_100[0]) * 1e-3,
            1e-11,
            "density times volume of the fluid at both pressures",
        ),
        check(
            "empty accumulator at 40 bar, flow [kg/s]",
            0.0,
            float(empty[0]),
            0.0,
            "below the precharge it holds nothing",
        ),
        check(
            "full accumulator, volume of its fluid [m^3]",
            whole - least,
            full[0],
            5e-14,
            "the gas shrinks no further",
        ),
    ]


def _variable_orifice() -> list[Check]:
    areas = (0.0, 1e-6, 3e-6)
    by_lift = branch_of(
        component("variable-orifice", lift=(0.0, 1e-4, 2e-4), area=areas, cavitation=None)
    )
    by_time = branch_of(
        component("variable-orifice", time=(0.0, 1e-3, 2e-3), area=areas, cavitation=None)
    )
    at_lift = branch_step(by_lift, 50e5, 20e5, ports=(1.4e-4, 1.6e-4, 0.0, 0.0))
    at_time = branch_step(by_time, 50e5, 20e5, t=0.5e-3 - 5e-7)
    forward = opening_flow(
        50e5, 20e5, RHO_OIL, RHO_OIL, 2e-6, 0.7, 2.0 / (MU_OIL * 100.0), 0.0, 0.0
    )
    return [
        check(
            "table of areas at a mean lift of 150 um, mass flow [kg/s]",
            0.7 * 2e-6 * sqrt(2 * RHO_OIL * 30e5),
            float(at_lift[0]),
            5e-14,
            "Merritt 1967, sec. 3-3: C_q A sqrt(2 rho dp)",
        ),
        check(
            "table of areas at 0.5 ms, area [m^2]",
            0.5e-6,
            float(at_time[-1]),
            5e-14,
            "straight line between its points",
        ),
        check(
            "turbulent opening, slope of its flow with the area [kg/(s m^2)]",
            0.7 * sqrt(2 * RHO_OIL * 30e5),
            forward[3],
            1e-13,
            "C_q sqrt(2 rho dp)",
        ),
    ]


def _pump() -> Iterator[Check]:
    turns, n = 25.0, 5040
    for z in (7, 10):
        row = branch_of(component("pump", displacement=10e-6, speed=turns, pistons=z))
        times = np.arange(n) / (turns * n)
        h = 1.0 / (turns * n)
        flow = np.array([branch_step(row, BAR, BAR, t=t, h=h)[5] for t in times])
        now = np.array([branch_step(row, BAR, BAR, t=t, h=0.0)[5] for t in times])
        share = pi / (2 * z) * tan(pi / (4 * z)) if z % 2 else pi / z * tan(pi / (2 * z))
        whole = np.sum(
            np.maximum(np.sin(2 * pi * turns * times + 2 * pi * np.arange(z)[:, None] / z), 0.0),
            axis=0,
        )
        yield from [
            check(
                f"pump of {z} pistons, mean flow of one turn [m^3/s]",
                250e-6,
                float(flow.mean()),
                1e-13,
                "displacement times speed",
                ComparedCurve(
                    x_label="angle of the shaft [deg]",
                    y_label="flow [l/min]",
                    expected=(360 * turns * times[:720], whole[:720] * pi / z * 250e-6 * 6e4),
                    computed=(360 * turns * times[:720], now[:720] * 6e4),
                ),
            ),
            check(
                f"pump of {z} pistons, strongest order of its ripple [-]",
                float(2 * z if z % 2 else z),
                float(1 + np.argmax(np.abs(np.fft.rfft(flow))[1:])),
                0.0,
                "Ivantysyn & Ivantysynova 2001: 2 z for odd, z for even numbers",
            ),
            check(
                f"pump of {z} pistons, non-uniformity of its flow [-]",
                share,
                float(np.ptp(now) / now.mean()),
                5e-6,
                "Ivantysyn & Ivantysynova 2001: pi/(2z) tan(pi/(4z)) odd, pi/z tan(pi/(2z)) even",
            ),
        ]
    leaking = component(
        "pump", displacement=10e-6, speed=25.0, volumetric_efficiency=0.9, rated_pressure=2e7
    )
    leak = branch_step(branch_of(leaking, 1), BAR, BAR + 1e7)
    yield check(
        "pump of 90 % volumetric efficiency at 200 bar, leakage at 100 bar [m^3/s]",
        0.5 * 0.1 * 250e-6,
        -float(leak[0]) / RHO_OIL,
        5e-14,
        "laminar: half the pressure, half the leakage",
    )


def _pulsation() -> Check:

    def flow(t: float) -> float:
        return 3e-4 + 1e-5 * float(np.sin(2 * pi * 1750.0 * t + 0.3))

    return check(
        "pulsation of 1.75 kHz over a step of 0.4 ms, mean flow [m^3/s]",
        quad(flow, 1e-3, 1.4e-3, epsrel=1e-13)[0] / 0.4e-3,
        float(
            branch_step(
                branch_of(
                    PulsatingFlow(
                        mean=3e-4,
                        harmonics=(FlowHarmonic(frequency=1750.0, amplitude=1e-5, phase=0.3),),
                    )
                ),
                BAR,
                90 * BAR,
                t=1e-3,
                h=0.4e-3,
            )[0]
        )
        / RHO_OIL,
        1e-13,
        "quadrature of the sine",
    )
