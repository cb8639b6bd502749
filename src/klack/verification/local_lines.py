"""Lines with local properties: simple waves, shocks, water hammer, friction, walls, networks."""

from collections.abc import Iterator
from dataclasses import replace
from math import pi, sqrt

import numpy as np
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.line import Line
from klack.hydraulics.line_friction import KAGAWA
from klack.hydraulics.local_line import LocalLine, steady_state
from klack.hydraulics.mixture import EntrainedGas
from klack.network.component import Component
from klack.network.protocols import NetworkFluid
from klack.simulation.network_result import NetworkResult
from klack.verification.benches import AMBIENT, BAR, HEPTANE, component, run_network
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.line_junctions import ROUGH, darcy
from klack.verification.single_line import (
    CellRun,
    End,
    cell_rates,
    cell_state,
    exponential_decay,
    ringing,
    run_cells,
)

__all__ = ["local_line_cells", "local_lines"]


LENGTH, BORE = 0.1, 2e-3  # [m]
AREA = pi / 4 * BORE**2

RANKINE = "Rankine-Hugoniot of the barotropic fluid: (p2 - p1) (1/rho1 - 1/rho2) = u^2"
RIEMANN = "u = int dp/(rho a) along a simple wave; Riemann 1860"


def local_lines() -> list[Check]:
    """Return the checks."""
    return [
        *_simple_wave(),
        *_shock(),
        *_hammer(),
        *_small_waves(),
        *_decay(),
        *_steady_friction(),
        *_balances(),
        *_networks(),
    ]


def _line(cells: int, friction: str = "none", stretch: float = 0.0, **other: float) -> LocalLine:
    return LocalLine(
        friction=friction,
        cells=cells,
        stretch=stretch,
        **{"length": LENGTH, "diameter": BORE, "roughness": 0.0} | other,
    )


def _numbers(line: LocalLine, fluid: NetworkFluid = HEPTANE) -> np.ndarray:
    return line.parameters(fluid, AMBIENT.pressure)


def _energy(p: float, fluid: NetworkFluid = HEPTANE) -> float:
    """``g`` [J/kg] by quadrature."""
    found = quad(lambda x: float(fluid.specific_volume(x)[0]), AMBIENT.pressure, p, epsrel=1e-12)
    return float(found[0])


def _pressure(energy: float, fluid: NetworkFluid) -> float:
    """Pressure [Pa] at which ``g`` is an energy [J/kg]."""
    return float(brentq(lambda p: _energy(p, fluid) - energy, BAR, 1e3 * BAR, rtol=1e-14))


def _speed_behind(low: float, high: float) -> float:
    """Change of velocity [m/s] along a simple wave between two pressures."""

    def by_p(x: float) -> float:
        return 1.0 / float(HEPTANE.density(x) * HEPTANE.sound_speed(x))

    return float(quad(by_p, low, high, epsrel=1e-11)[0])


def _shock_speed(low: float, high: float) -> float:
    """Velocity behind a shock into fluid at rest [m/s]."""
    volumes = 1.0 / HEPTANE.density([low, high])
    return sqrt((high - low) * float(volumes[0] - volumes[1]))


def _middles(cells: int) -> np.ndarray:
    return np.asarray((np.arange(cells) + 0.5) * LENGTH / cells)


def _simple_wave() -> list[Check]:
    """The pressure at a rises by 400 bar in 20 us; the wave steepens on its way."""
    low, rise, lasts = 10 * BAR, 400 * BAR, 20e-6
    leaves = np.linspace(0.0, lasts, 2001)
    p = low + rise * np.sin(0.5 * pi * leaves / lasts) ** 2
    course = solve_ivp(
        lambda x, _: 1.0 / (HEPTANE.density(x) * HEPTANE.sound_speed(x)),
        (low, low + rise),
        [0.0],
        t_eval=p,
        rtol=1e-10,
        atol=1e-10,
    )
    u = course.y[0]
    w = u + HEPTANE.sound_speed(p)
    rate = np.gradient(w, leaves, edge_order=2)
    forms = float(np.min((leaves + w / np.maximum(rate, 1e-3))[1:-1]))
    until = 0.7 * forms
    place = w * (until - leaves)
    total = np.interp(leaves, leaves[::20], np.array([_energy(x) for x in p[::20]])) + 0.5 * u**2
    errors, runs = {}, {}
    for cells in (50, 100, 200):
        parameters = _numbers(_line(cells))
        steps = round(until / (0.3 * LENGTH / cells / float(w[-1])))
        h = until / steps
        run = run_cells(
            parameters,
            cell_state(parameters, low),
            End(total=np.interp(h * (np.arange(steps) + 0.5), leaves, total)),
            End(flow=0.0),
            h,
            steps,
        )
        exact = np.interp(_middles(cells), place[::-1], p[::-1], right=low)
        exact[_middles(cells) < place[-1]] = p[-1]
        errors[cells] = np.abs(run.pressure - exact) / rise
        runs[cells] = run, exact
    run, exact = runs[100]
    late = until - leaves
    steepest = float(np.max(np.abs(np.gradient(p, leaves) / (rate * late - w))))
    slope = float(np.max(np.abs(np.diff(runs[200][0].pressure)))) / (LENGTH / 200)
    means = [float(np.mean(errors[n])) for n in (50, 100, 200)]
    return [
        check(
            "local line of 100 cells, steepening wave of 400 bar, mean error of the pressure [-]",
            expected=0.0,
            computed=means[1],
            tolerance=1e-2,
            source=RIEMANN,
            curve=ComparedCurve(
                x_label="place [mm]",
                y_label="pressure [bar]",
                expected=(1e3 * _middles(100), exact / BAR),
                computed=(1e3 * _middles(100), run.pressure / BAR),
            ),
        ),
        check(
            "local line, steepening wave, error of 100 over that of 200 cells [-]",
            expected=4.0,
            computed=means[1] / means[2],
            tolerance=0.25,
            source="second order; less where the wave begins and ends with a kink of its slope",
        ),
        check(
            "local line of 200 cells, steepest slope at 0.7 of the time of the shock [GPa/m]",
            expected=1e-9 * steepest,
            computed=1e-9 * slope,
            tolerance=0.03,
            source="characteristics that meet: dp/dx = p'/(w' (t - tau) - w), w = u + a",
        ),
    ]


def _shock() -> list[Check]:
    """A piston starts at once; the shock before it has 600 bar."""
    low, high, cells = 10 * BAR, 600 * BAR, 200
    u = _shock_speed(low, high)
    density = HEPTANE.density([low, high])
    front = u * float(density[1] / (density[1] - density[0]))
    flow = AREA * float(density[1]) * u
    parameters = _numbers(_line(cells))
    h = 0.3 * LENGTH / cells / front
    steps = round(0.7 * LENGTH / front / h)
    half = steps // 2
    state = cell_state(parameters, low)
    end, closed = End(flow=flow), End(flow=0.0)
    before = run_cells(parameters, state, end, closed, h, half)
    after = run_cells(parameters, state, end, closed, h, steps - half)
    places = [float(np.sum(run.pressure > 0.5 * (low + high))) for run in (before, after)]
    energy = [_energy(low), _energy(high)]
    gained = float(density[1]) * (0.5 * u * u + energy[1]) - (high - AMBIENT.pressure)
    gained -= float(density[0]) * energy[0] - (low - AMBIENT.pressure)
    exact = np.where(_middles(cells) < front * h * steps, high, low)
    curve = ComparedCurve(
        x_label="place [mm]",
        y_label="pressure [bar]",
        expected=(1e3 * _middles(cells), exact / BAR),
        computed=(1e3 * _middles(cells), after.pressure / BAR),
    )
    return [
        check(
            "shock into fluid at rest, pressure behind it [bar]",
            expected=high / BAR,
            computed=float(np.median(after.pressure[10:100])) / BAR,
            tolerance=2e-4,
            source=RANKINE,
            curve=curve,
        ),
        check(
            "shock into fluid at rest, its speed [m/s]",
            expected=front,
            computed=(places[1] - places[0]) * LENGTH / cells / (h * (steps - half)),
            tolerance=0.02,
            source="u rho2/(rho2 - rho1); told to a cell",
        ),
        check(
            "shock into fluid at rest, power that it dissipates [W]",
            expected=flow * (energy[1] + 0.5 * u * u) - AREA * front * gained,
            computed=float(after.losses[:, 1].sum()) / (h * (steps - half)),
            tolerance=0.01,
            source="what its piston delivers, less the energy behind it",
        ),
        check(
            "shock into fluid at rest, overshoot behind it [-]",
            expected=0.0,
            computed=float(np.max(after.pressure[5:])) / high - 1.0,
            tolerance=1e-3,
            source="a shock is monotone",
            curve=curve,
        ),
    ]


def _hammer() -> list[Check]:
    """Flow stopped, and drawn off, at once."""
    start, u, cells = 100 * BAR, 40.0, 100
    parameters = _numbers(_line(cells))
    h = 0.2 * LENGTH / cells / 1500.0
    steps = round(0.6 * LENGTH / 1400.0 / h)
    run = run_cells(
        parameters,
        cell_state(parameters, start, u),
        End(total=_energy(start) + 0.5 * u * u),
        End(flow=0.0),
        h,
        steps,
    )
    stopped = brentq(lambda p: _shock_speed(start, p) - u, 1.01 * start, 20 * start, rtol=1e-13)
    high, drawn = 600 * BAR, 30.0
    left = brentq(lambda p: _speed_behind(p, high) - drawn, 10 * BAR, high, rtol=1e-13)
    flow = AREA * drawn * float(HEPTANE.density(left))
    open_run = run_cells(
        parameters,
        cell_state(parameters, high),
        End(total=_energy(high)),
        End(flow=-flow),
        h,
        steps,
    )
    acoustic = float(HEPTANE.density(start) * HEPTANE.sound_speed(start)) * u
    return [
        check(
            f"flow of 40 m/s stopped, rise of the pressure [bar] (Joukowsky: {acoustic / BAR:.0f})",
            expected=(stopped - start) / BAR,
            computed=(float(run.pressure[-10]) - start) / BAR,
            tolerance=1e-3,
            source=RANKINE,
        ),
        check(
            "flow of 30 m/s drawn from 600 bar, fall of the pressure [bar]",
            expected=(high - left) / BAR,
            computed=(high - float(open_run.pressure[-10])) / BAR,
            tolerance=1e-3,
            source=RIEMANN,
        ),
    ]


def _ring(
    parameters: np.ndarray, start: float, speed: float, periods: int, fluid: NetworkFluid = HEPTANE
) -> tuple[CellRun, float]:
    """Run of a line, open at a, closed at b, from its first mode; ``B`` at rest."""
    cells = int(parameters[0])
    shape = np.sin(0.5 * pi * _middles(cells) / LENGTH)
    h = 0.4 * LENGTH / cells / speed
    rest = _energy(start, fluid)
    return run_cells(
        parameters,
        cell_state(parameters, start + 1e-4 * start * shape),
        End(total=rest),
        End(flow=0.0),
        h,
        round(periods * 4.0 * LENGTH / speed / h),
    ), rest


def _frequency(run: CellRun, rest: float) -> float:
    """Of the closed end [Hz], by its falls through rest."""
    y, t = run.total[:, 1] - rest, run.time
    k = np.flatnonzero((y[:-1] > 0.0) & (y[1:] <= 0.0))
    zeros = t[k] + (t[1] - t[0]) * y[k] / (y[k] - y[k + 1])
    return float((zeros.size - 1) / (zeros[-1] - zeros[0]))


def _small_waves() -> list[Check]:
    """First mode of a line open at one end: liquid, a hose, one percent of gas."""
    start, hose = 10 * BAR, 0.5e9
    gassy = replace(HEPTANE, gas=EntrainedGas(fraction=0.01))
    liquid = float(HEPTANE.sound_speed(start))
    grown = 1.0 + (start - AMBIENT.pressure) / hose
    soft = 1.0 / sqrt(liquid**-2 + float(HEPTANE.density(start)) / hose / grown)
    found = {}
    for cells in (25, 50):
        run, rest = _ring(_numbers(_line(cells)), start, liquid, 6)
        found[cells] = _frequency(run, rest)
    expected = liquid / (4.0 * LENGTH)
    errors = [found[n] / expected - 1.0 for n in (25, 50)]
    in_hose = _frequency(*_ring(_numbers(_line(50, stretch=1.0 / hose)), start, soft, 6))
    with_gas = float(gassy.sound_speed(start))
    slow = _frequency(*_ring(_numbers(_line(50), gassy), start, with_gas, 6, gassy))
    return [
        check(
            "local line of 50 cells, small waves, first frequency [Hz]",
            expected=expected,
            computed=found[50],
            tolerance=3e-4,
            source="a/(4 L)",
        ),
        check(
            "local line, small waves, error of 25 over that of 50 cells [-]",
            expected=4.0,
            computed=errors[0] / errors[1],
            tolerance=0.1,
            source="second order",
        ),
        check(
            "local line with a wall of 0.5 GPa, first frequency [Hz]",
            expected=soft / (4.0 * LENGTH),
            computed=in_hose,
            tolerance=3e-4,
            source="a/(4 L), 1/a^2 = 1/c^2 + rho A_0/(A K_w)",
        ),
        check(
            "local line with 1 % of gas at 10 bar, first frequency [Hz]",
            expected=with_gas / (4.0 * LENGTH),
            computed=slow,
            tolerance=3e-4,
            source="a/(4 L), a of the mixture",
        ),
    ]


def _decay() -> list[Check]:
    """Ring-down with the memory of laminar friction."""
    start, cells = 10 * BAR, 50
    speed = float(HEPTANE.sound_speed(start))
    root = exponential_decay(
        KAGAWA,
        delay=LENGTH / speed,
        radius=0.5 * BORE,
        kinematic_viscosity=float(HEPTANE.viscosity(start) / HEPTANE.density(start)),
    )
    plain = _ring(_numbers(_line(cells)), start, speed, 50)
    rubbed = _ring(_numbers(_line(cells, "kagawa")), start, speed, 50)
    tones = [
        ringing(
            run.time,
            run.total[:, 1] - rest,
            root.imag / (2.0 * pi),
            apart=20 / (root.imag / 2 / pi),
        )
        for run, rest in (plain, rubbed)
    ]
    return [
        check(
            "local line, first mode with Kagawa's terms, decay less that of the cells [1/s]",
            expected=root.real,
            computed=tones[1].real - tones[0].real,
            tolerance=1e-3,
            source="root with the terms, Zielke 1968",
        ),
        check(
            "local line of 50 cells, decay of the first mode by its cells over the frequency [-]",
            expected=0.0,
            computed=tones[0].real / tones[0].imag,
            tolerance=1e-4,
            source="without friction nothing decays",
        ),
    ]


def _lost(fluid: NetworkFluid, friction: str, length: float, top: float, flow: float) -> float:
    """Energy [J/kg] lost by a steady flow and its outflow, by integration of its pressure."""

    def speed(p: float) -> float:
        return flow / (float(fluid.density(p)) * AREA)

    def slope(_: float, p: np.ndarray) -> list[float]:
        rho, mu, u = float(fluid.density(p[0])), float(fluid.viscosity(p[0])), speed(p[0])
        reynolds = rho * u * BORE / mu
        factor = 64.0 / reynolds if friction == "steady" else darcy(reynolds)
        lost = factor / BORE * 0.5 * rho * u * u
        return [-lost / (1.0 - (u / float(fluid.sound_speed(p[0]))) ** 2)]

    def energy(p: float) -> float:
        return _energy(p, fluid) + 0.5 * speed(p) ** 2

    first = brentq(lambda p: energy(p) - _energy(top, fluid), 0.9 * top, top, rtol=1e-14)
    found = solve_ivp(slope, (0.0, length), [first], rtol=1e-10, atol=1.0)
    return energy(first) - _energy(float(found.y[0, -1]), fluid)


def _steady_friction() -> Iterator[Check]:
    """Steady flow down a fall of pressure; density and viscosity change."""
    for friction, fluid, length, flow, tolerance in (
        ("steady", library_fluid("ISO VG 46").at(313.15), 2.0, 0.02, 5e-4),
        ("turbulent", HEPTANE, 5.0, 0.06, 5e-3),
    ):
        top = 600 * BAR
        parameters = _numbers(_line(50, friction, length=length, roughness=ROUGH), fluid)
        after = _energy(top, fluid) - _lost(fluid, friction, length, top, flow)
        below = _pressure(after, fluid)
        ends = End(total=_energy(top, fluid)), End(total=after)
        run = run_cells(
            parameters,
            steady_state(parameters, top, below, flow),
            *ends,
            0.4 * length / 50 / float(fluid.sound_speed(top)),
            3000,
        )
        drop = (top - below) / BAR
        yield check(
            f"local line, {friction} friction over {drop:.0f} bar, flow [g/s]",
            expected=1e3 * flow,
            computed=1e3 * float(run.flow[-1, 0]),
            tolerance=tolerance,
            source="pressure integrated along the line, density and viscosity of each place",
        )


def _balances() -> list[Check]:
    """Random ends, a wall, friction with memory: balances to round-off."""
    rng = np.random.default_rng(5)
    parameters, steps = _numbers(_line(30, "turbulent", stretch=1e-9)), 4000
    rough = np.repeat(rng.uniform(_energy(250 * BAR), _energy(400 * BAR), steps // 40), 40)
    drawn = np.repeat(rng.uniform(-0.015, 0.015, steps // 25), 25)
    run = run_cells(
        parameters,
        cell_state(parameters, 300 * BAR),
        End(total=rough),
        End(flow=drawn),
        0.3 * LENGTH / 30 / 1500.0,
        steps,
    )
    return [
        check(
            "local line, random ends, a wall, friction: energy that does not balance [-]",
            expected=0.0,
            computed=run.energy_residual,
            tolerance=5e-14,
            source="work at both ends = change of store + losses",
        ),
        check(
            "local line, random ends, a wall, friction: mass that does not balance [-]",
            expected=0.0,
            computed=run.mass_residual,
            tolerance=5e-13,
            source="conservation of mass",
        ),
        check(
            "local line, smallest loss of a step over the mean one is not below zero [-]",
            expected=0.0,
            computed=min(float(np.min(run.losses)), 0.0) / float(np.mean(run.losses)),
            tolerance=5e-14,
            source="second law",
        ),
    ]


def _closing(pieces: int, cells: int, supply: float, area: float, properties: str) -> NetworkResult:
    """A pressure, half a metre of line in pieces, a small chamber, a closing valve."""
    parts: dict[str, Component] = {
        "source": component("pressure-source", pressure=supply),
        "room": component("chamber", volume=20e-9),
        "valve": component("variable-orifice", time=(0.0, 50e-6, 150e-6), area=(area, area, 0.0)),
    }
    joints = [["valve.b", "ambient"]]
    for k in range(pieces):
        size = {
            "length": 0.5 / pieces,
            "diameter": BORE,
            "pressure": supply,
            "friction": "turbulent" if supply > 100 * BAR else "kagawa",
        }
        count = {"cells": cells // pieces} if properties == "local" else {}
        parts[f"l{k}"] = Line.model_validate(size | count | {"properties": properties})
        if k > 0:
            parts[f"tee{k}"] = component("junction")
            joints.append([f"l{k - 1}.b", f"tee{k}.fluid", f"l{k}.a"])
    joints += [["source.fluid", "l0.a"], [f"l{pieces - 1}.b", "room.fluid", "valve.a"]]
    return run_network(
        parts,
        joints,
        still=True,
        fluid=HEPTANE,
        duration=3e-3,
        step=100e-9,
        coarse=None,
        record=1.6e-6,
        start="rest",
    )


def _networks() -> list[Check]:
    """A valve that closes: small waves, a line in two pieces, mass and energy."""
    small = [_closing(1, 100, 50 * BAR, 0.005e-6, kind) for kind in ("fixed", "local")]
    near, local = (run.channels["room pressure"].values for run in small)
    whole = _closing(1, 100, 300 * BAR, 0.2e-6, "local")
    halves = _closing(2, 100, 300 * BAR, 0.2e-6, "local")
    one, two = (run.channels["room pressure"].values for run in (whole, halves))
    time = 1e3 * small[0].time
    return [
        check(
            "local line of 100 cells behind a closing valve, small waves, rms difference from "
            "fixed properties over the jump [-]",
            expected=0.0,
            computed=float(np.sqrt(np.mean((local - near) ** 2)) / (np.max(near) - near[0])),
            tolerance=3e-2,
            source="delay line with the same friction",
            curve=ComparedCurve(
                x_label="time [ms]",
                y_label="pressure at the valve [bar]",
                expected=(time, near / BAR),
                computed=(time, local / BAR),
            ),
        ),
        check(
            "local line in two pieces, rms difference from one line over the jump [-]",
            expected=0.0,
            computed=float(np.sqrt(np.mean((two - one) ** 2)) / (np.max(one) - one[0])),
            tolerance=1e-2,
            source="identity, but for the cells",
        ),
        *(
            check(
                f"local line {words} in a network, energy that does not balance [-]",
                expected=0.0,
                computed=run.books.relative_residual,
                tolerance=1e-12,
                source="conservation of energy",
            )
            for words, run in (("in one piece", whole), ("in two pieces", halves))
        ),
    ]


_CELLS = 4


def local_line_cells() -> list[Check]:
    """Mean mass of the flux where its series acts, and where it does not; wall of a cell."""
    return [*_mean_mass(), *_wave_speed()]


def _gained(low: float, high: float) -> float:
    """Difference of ``g`` between two pressures [J/kg], by quadrature."""
    found = quad(lambda x: float(HEPTANE.specific_volume(x)[0]), low, high, epsrel=1e-13)
    return float(found[0])


def _pressure_at(low: float, gained: float) -> float:
    """Pressure [Pa] up to which ``g`` gains so much [J/kg]."""
    return float(brentq(lambda x: _gained(low, x) - gained, low, 10.0 * low, rtol=1e-15))


def _mean_mass() -> list[Check]:
    """Equal differences of ``g`` and an even velocity: nothing dissipates."""
    low, u, checks = 100 * BAR, 10.0, []
    for words, first in (("with its series", 108 * BAR), ("with its quotient", 150 * BAR)):
        step = _gained(low, first)
        parameters = _line(_CELLS).parameters(HEPTANE, AMBIENT.pressure)
        _, rate = cell_rates(
            parameters,
            cell_state(
                parameters,
                np.array(
                    [low, first, _pressure_at(low, 2.0 * step), _pressure_at(low, 3.0 * step)]
                ),
                u,
            ),
        )
        checks.append(
            check(
                f"local line, mean mass per length of the flux at a face, {words} [g/m]",
                expected=1e3 * AREA * (first - low) / step,
                computed=-1e3 * float(rate[0]) * LENGTH / _CELLS / u,
                tolerance=1e-10,
                source="[Pi]/[g] by quadrature of the specific volume; Tadmor 1987",
            )
        )
    return checks


def _wave_speed() -> list[Check]:
    """A bore that gives way slows the waves of its cell."""
    p, modulus = 60 * BAR, 0.5e9
    parameters = _line(_CELLS, stretch=1.0 / modulus).parameters(HEPTANE, AMBIENT.pressure)
    speed, _ = cell_rates(parameters, cell_state(parameters, p))
    grown = 1.0 + (p - AMBIENT.pressure) / modulus
    slowness = float(HEPTANE.sound_speed(p)) ** -2 + float(HEPTANE.density(p)) / modulus / grown
    return [
        check(
            "local line with a wall of 0.5 GPa, wave speed of a cell [m/s]",
            expected=1.0 / sqrt(slowness),
            computed=float(speed[0]),
            tolerance=2e-9,
            source="1/a^2 = 1/c^2 + rho A_0/(A K_w)",
        )
    ]
