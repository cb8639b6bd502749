"""Checks of coils in time: switching, eddy currents, energy, motion, order."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import exp, log, pi

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import expm
from scipy.special import jn_zeros

from klack.errors import ConvergenceError
from klack.machine.compiling.jit import njit
from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.driver import DriveProgram
from klack.magnetics.eddy import cylinder_ladder
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.flux_step import FAILURES, flux_numbers, flux_state, magnet_step
from klack.magnetics.iron import VACUUM_PERMEABILITY, froehlich
from klack.magnetics.reluctance import GapReluctance, LinearReluctance
from klack.magnetics.static import static_state
from klack.network.step_function import address_of, call, first
from klack.verification.benches import component
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.coils_in_networks import coupled_coils

__all__ = ["CoilRun", "checks", "injector", "linear_coil", "opening", "run_coil"]


_FRONT = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CoilRun:
    """A run of one coil.

    Parameters
    ----------
    time (n + 1,) [s]
        Ends of the steps.
    current, flux (n + 1,) [A], [Wb]
        Flux of the main branch (linkage of a map).
    voltage, force (n,) [V], [N]
        Means over the steps; force on the armature along +z.
    state (n + 1,)
        Of the driver.
    fluxes (n + 1, loops) [Wb]
    electric, ohmic, eddy, hysteresis, work [J]
        Supply, losses, and work on the armature.
    residual [-]
        Energy that does not balance, at the end of any step, over the largest amount.
    """

    time: np.ndarray
    current: np.ndarray
    flux: np.ndarray
    voltage: np.ndarray
    force: np.ndarray
    state: np.ndarray
    fluxes: np.ndarray
    electric: float
    ohmic: float
    eddy: float
    hysteresis: float
    work: float
    residual: float

    def switches(self) -> np.ndarray:
        """Ends of the steps in which the driver switched [s]."""
        return self.time[1:][np.diff(self.state) != 0]


@njit
def _march(
    address: int,
    par: np.ndarray,
    state: np.ndarray,
    y: np.ndarray,
    h: float,
    log: np.ndarray,
    sums: np.ndarray,
) -> int:
    size, steps = state.size - 1, y.size - 1
    inp, out = np.zeros(6), np.zeros(2 + state.size + 5)
    for k in range(-1, steps):
        inp[0], inp[1] = max(k, 0) * h, h if k >= 0 else 0.0
        inp[2], inp[3] = y[max(k, 0)], y[k + 1]
        status = call(address, first(par), first(state), first(inp), first(out))
        if status != 0:
            return int(status)
        for j in range(size):
            state[j] = out[2 + j]
        log[k + 1, 0] = out[0]
        log[k + 1, 1:] = state[:size]
        if k >= 0:
            sums[0] += out[2 + size]
            sums[1] += out[3 + size]
            sums[2] += out[4 + size]
            sums[3] += out[0] * (inp[3] - inp[2])
        else:
            sums[4] = out[5 + size]
        sums[5] = out[5 + size]
        if k >= 0:
            sums[7] += out[6 + size]
        sums[6] = max(sums[6], out[5 + size])
    return 0


def run_coil(
    plant: MagneticCircuit | FluxMap,
    driver: DriveProgram,
    *,
    resistance: float,
    gap: float,
    step: float,
    lift: ArrayLike,
    fluxes: ArrayLike = (),
) -> CoilRun:
    """Run a coil while its armature follows a course.

    Parameters
    ----------
    resistance [ohm]
    gap [m]
        At lift zero; the lift closes it.
    step [s]
    lift (n + 1,) [m]
        At the ends of the steps; straight between.
    fluxes [Wb]
        Loop fluxes at the start.
    """
    y = np.array(lift, dtype=float)
    par = flux_numbers(plant, resistance=resistance, driver=driver, gap=gap)
    start = flux_state(par, fluxes)
    log, sums = np.zeros((y.size, 1 + start.size)), np.zeros(8)
    status = _march(address_of(magnet_step), par, np.append(start, 0.0), y, step, log, sums)
    if status != 0:
        raise ConvergenceError(f"coil: {FAILURES[status]}.")
    loops = 1 if isinstance(plant, FluxMap) else plant.loops.shape[1]
    parts = [sums[0], -sums[1], -sums[2], -sums[3], sums[4], -sums[7], -sums[5]]
    largest = max(float(sums[6]), *(abs(part) for part in parts))
    return CoilRun(
        time=np.asarray(step * np.arange(y.size), dtype=float),
        current=log[:, 5],
        flux=log[:, 7],
        voltage=log[1:, 6],
        force=log[1:, 0],
        state=log[:, 1],
        fluxes=log[:, 1 + _FRONT : 1 + _FRONT + loops],
        electric=sums[0],
        ohmic=sums[1],
        eddy=sums[2],
        hysteresis=sums[7],
        work=sums[3],
        residual=abs(sum(parts)) / largest if largest else 0.0,
    )


IDENTITY = "discrete gradient (Gonzalez 1996): energy identity at every step size"

_MU0 = VACUUM_PERMEABILITY
_TURNS = 60.0
_MAIN, _LEAK = 2e7, 2e8  # [A/Wb]
_GAP = 100e-6
_INDUCTANCE = _TURNS**2 * (1.0 / _MAIN + 1.0 / _LEAK)
_SHORT = 1e-14  # [ohm] a coil that only integrates its voltage
_INJECTOR = component(
    "peak-hold",
    boost_voltage=65.0,
    peak_current=10.0,
    supply_voltage=14.0,
    hold_current=3.0,
    hold_band=1.0,
    start=10e-6,
    end=0.8e-3,
    decay=50.0,
)


def checks() -> list[Check]:
    """Return all checks of coils in time."""
    return [
        *_linear(),
        *_switching(),
        *_eddy(),
        *_motion(),
        *_energy(),
        *_long_steps(),
        *_map(),
        *coupled_coils(),
    ]


def linear_coil(eddy: float = 0.0) -> MagneticCircuit:
    """Coil of constant inductance: main and leakage path, perhaps a shorted turn [S]."""
    main, leak = LinearReluctance(_MAIN), LinearReluctance(_LEAK)
    return MagneticCircuit(
        branches=(
            MagneticBranch(name="main", law=main, turns=_TURNS, eddy=eddy),
            MagneticBranch(name="leakage", law=leak, turns=_TURNS),
        ),
        loops=np.array([[1, 0], [0, 1]]),
        main="main",
    )


def injector(eddy: float = 1250.0) -> MagneticCircuit:
    """Two poles of 12 mm^2 with 20 um of residual gap, a saturating core, leakage."""
    area = 12e-6
    gaps = np.linspace(-20e-6 + 1e-7, 300e-6, 41)
    gap = GapReluctance(gaps, 2.0 * (gaps + 20e-6) / (_MU0 * area), np.full(41, 2 / (_MU0 * area)))
    return MagneticCircuit(
        branches=(
            MagneticBranch(name="gap", law=gap, turns=_TURNS, eddy=eddy),
            MagneticBranch(name="iron", law=froehlich(1.5, 1500.0).law(60e-3, area)),
            MagneticBranch(
                name="leakage",
                law=LinearReluctance(10.0 * 2.0 * _GAP / (_MU0 * area)),
                turns=_TURNS,
            ),
        ),
        loops=np.array([[1, 0], [1, 0], [0, 1]]),
        main="gap",
    )


def opening(duration: float, step: float) -> np.ndarray:
    """Lift of an armature that opens by 80 um and closes again within ``duration``."""
    t = np.linspace(0.0, 1.0, round(duration / step) + 1)
    return np.asarray(80e-6 * np.sin(pi * t) ** 2)


def _current_curve(time: np.ndarray, exact: np.ndarray, found: np.ndarray) -> ComparedCurve:
    return ComparedCurve(
        x_label="time [ms]",
        y_label="current [A]",
        expected=(time * 1e3, exact),
        computed=(time * 1e3, found),
    )


def _program(voltage: float, **more: float) -> DriveProgram:
    return component("voltage-step", voltage=voltage, **more).program()


def _linear() -> list[Check]:
    tau = _INDUCTANCE / 1.0
    rise = run_coil(
        linear_coil(), _program(12.0), resistance=1.0, gap=_GAP, step=20e-9, lift=np.zeros(20001)
    )
    exact = 12.0 * -np.expm1(-rise.time / tau)
    down = run_coil(
        linear_coil(),
        _program(12.0, end=200e-6, decay=40.0),
        resistance=1.0,
        gap=_GAP,
        step=20e-9,
        lift=np.zeros(15001),
    )
    top = 12.0 * (1.0 - exp(-200e-6 / tau))
    k = int(np.flatnonzero((down.time > 200e-6) & (down.current == 0.0))[0])
    # the last piece of current: a straight line to zero
    slope = (down.current[k - 2] - down.current[k - 1]) / 20e-9
    pulse = component(
        "voltage-table", time=(1e-6, 4e-6, 4e-6, 9.3e-6), voltage=(0.0, 30.0, -6.0, 0.0)
    ).program()
    jumps = run_coil(
        linear_coil(), pulse, resistance=_SHORT, gap=_GAP, step=1.7e-6, lift=np.zeros(8)
    )
    return [
        check(
            "current of a coil of constant inductance, largest deviation [A]",
            expected=0.0,
            computed=float(np.max(np.abs(rise.current - exact))),
            tolerance=1e-8,
            source="i = u/R (1 - exp(-R t/L)); 12 A, 20 ns",
            curve=_current_curve(rise.time, exact, rise.current),
        ),
        check(
            "end of the current against 40 V, then the diode blocks [s]",
            expected=200e-6 + tau * log(1.0 + top / 40.0),
            computed=float(down.time[k - 1] + down.current[k - 1] / slope),
            tolerance=1e-7,
            source="t = (L/R) ln(1 + R i/u) after switching off",
        ),
        check(
            "linkage after ramps and jumps of voltage inside steps [Wb]",
            expected=0.5 * 3e-6 * 30.0 - 0.5 * 5.3e-6 * 6.0,
            computed=float(jumps.fluxes[-1].sum()) * _TURNS,
            tolerance=5e-14,
            source="Faraday: linkage = integral of the voltage; 1.7 us steps",
        ),
    ]


def _switching() -> list[Check]:
    """Without resistance the current is a saw of straight lines, so instants must be exact."""
    driver = component("two-point", voltage=12.0, upper=3.0, lower=2.0, freewheel=6.0).program()
    coil = linear_coil()
    saw = run_coil(coil, driver, resistance=_SHORT, gap=_GAP, step=1e-6, lift=np.zeros(2001))
    first, up, down = 3.0 * _INDUCTANCE / 12.0, _INDUCTANCE / 12.0, _INDUCTANCE / 6.0
    phase = np.where(saw.time < first, 0.0, (saw.time - first) % (up + down))
    exact = np.where(phase < down, 3.0 - phase / down, 2.0 + (phase - down) / up)
    exact = np.where(saw.time < first, 12.0 * saw.time / _INDUCTANCE, exact)

    peak = run_coil(
        coil, _INJECTOR.program(), resistance=_SHORT, gap=_GAP, step=1e-6, lift=np.zeros(501)
    )
    fall = 10e-6 + 10.0 * _INDUCTANCE / 65.0
    settled = (peak.time > fall) & (peak.time < fall + 5e-6)
    line = 10.0 - 0.7 / _INDUCTANCE * (peak.time[settled] - fall)

    pwm = component("pwm", voltage=12.0, period=50e-6, duty=0.3, freewheel=0.0).program()
    ripple = run_coil(coil, pwm, resistance=1.0, gap=_GAP, step=0.1e-6, lift=np.zeros(40001))
    tau = _INDUCTANCE / 1.0
    return [
        check(
            "two-point control after 80 switchings, largest deviation [A]",
            expected=0.0,
            computed=float(np.max(np.abs(saw.current - exact))),
            tolerance=1e-10,
            source="R = 0: straight lines between 2 and 3 A; 1 us steps, instants located in them",
            curve=_current_curve(saw.time, exact, saw.current),
        ),
        check(
            "peak and hold: current after the peak, largest deviation [A]",
            expected=0.0,
            computed=float(np.max(np.abs(peak.current[settled] - line))),
            tolerance=5e-13,
            source="R = 0: rise by 65 V to 10 A, then a line by -0.7 V",
        ),
        check(
            "upper current of settled pulse-width modulation [A]",
            expected=12.0 * (1.0 - exp(-15e-6 / tau)) / (1.0 - exp(-50e-6 / tau)),
            computed=float(ripple.current[-600:].max()),
            tolerance=5e-9,
            source="u/R (1 - exp(-d T/tau))/(1 - exp(-T/tau)); 50 us, duty 0.3",
        ),
    ]


def _eddy() -> list[Check]:
    """A shorted turn: matrix exponential of two states; a core: Bessel's series."""
    S, R, u, n = 1250.0, 0.8, 14.0, _TURNS
    run = run_coil(
        linear_coil(S), _program(u), resistance=R, gap=_GAP, step=20e-9, lift=np.zeros(10001)
    )
    # S f' + R_m f = n i, R_l g = n i, n (f' + g') + R i = u
    A = np.array([[-_MAIN / S, _LEAK / S], [_MAIN / S, -_LEAK / S - R * _LEAK / n**2]])
    exact = np.linalg.solve(A, (expm(A * run.time[-1]) - np.eye(2)) @ [0.0, u / n])

    after = run_coil(
        linear_coil(S),
        _program(u, end=100e-6, decay=60.0),
        resistance=R,
        gap=_GAP,
        step=100e-9,
        lift=np.zeros(3001),
    )
    k = int(np.flatnonzero((after.time > 101e-6) & (after.current == 0.0))[0]) + 1
    return [
        check(
            "main flux behind a shorted turn after 0.2 ms [Wb]",
            expected=float(exact[0]),
            computed=float(run.flux[-1]),
            tolerance=1e-8,
            source="matrix exponential of the two fluxes",
        ),
        check(
            "decay of the flux in the open coil [1/s]",
            expected=_MAIN / S,
            computed=log(after.flux[k] / after.flux[-1]) / (after.time[-1] - after.time[k]),
            tolerance=1e-6,
            source="S dflux/dt + R flux = 0",
        ),
        *_core(),
    ]


def _core() -> Iterator[Check]:
    """Solid round core after a step of the mmf."""
    core = {"conductivity": 2e6, "length": 20e-3, "radius": 2e-3, "permeability": 1000.0}
    tau = _MU0 * 1000.0 * 2e6 * 2e-3**2
    reluctance = 20e-3 / (_MU0 * 1000.0 * pi * 2e-3**2)
    b = jn_zeros(0, 400)
    for terms, tolerance in ((3, 1e-2), (4, 1e-3)):
        ladder = cylinder_ladder(**core, terms=terms)
        branches = [MagneticBranch(name="core", law=LinearReluctance(reluctance), turns=1.0)]
        loops = np.zeros((2 * terms + 1, terms + 1), dtype=np.int64)
        loops[[0, -1], [0, -1]] = 1
        for k in range(terms):
            law = LinearReluctance(0.0)
            branches.append(MagneticBranch(name=f"e{k}", law=law, eddy=ladder.conductances[k]))
            loops[1 + 2 * k, k] = 1
            if k + 1 < terms:
                law = LinearReluctance(ladder.reluctances[k])
                branches.append(MagneticBranch(name=f"r{k}", law=law))
                loops[[1 + 2 * k, 2 + 2 * k], k + 1] = -1, 1
        branches.append(
            MagneticBranch(name="leakage", law=LinearReluctance(1e6 * reluctance), turns=1.0)
        )
        # a source of current: 1 MV behind 1 Mohm
        run = run_coil(
            MagneticCircuit(branches=tuple(branches), loops=loops, main="core"),
            _program(1e6),
            resistance=1e6,
            gap=_GAP,
            step=tau / 20000,
            lift=np.zeros(4001),
        )
        time = np.array([0.05, 0.1, 0.2])
        share = np.interp(time * tau, run.time, run.flux * reluctance)
        exact = 1.0 - 4.0 * np.sum(np.exp(-(b**2) * time[:, None]) / b**2, axis=1)
        axis = np.linspace(0.002, 0.2, 100)
        yield check(
            f"flux into a solid core after a step, ladder of {terms}, largest deviation [-]",
            expected=0.0,
            computed=float(np.max(np.abs(share - exact))),
            tolerance=tolerance,
            source="1 - 4 sum exp(-b_n^2 t/tau)/b_n^2, J0(b_n) = 0; t = 0.05 to 0.2 tau",
            curve=ComparedCurve(
                x_label="time over tau [-]",
                y_label="flux over final flux [-]",
                expected=(axis, 1.0 - 4.0 * np.sum(np.exp(-np.outer(axis, b**2)) / b**2, axis=1)),
                computed=(axis, np.interp(axis * tau, run.time, run.flux * reluctance)),
            ),
        )


def _motion() -> list[Check]:
    """A shorted coil without resistance keeps its linkage while the armature moves."""
    circuit = injector(eddy=0.0)
    start = static_state(circuit, current=4.0, gap=_GAP)
    run = run_coil(
        circuit,
        component("voltage-table", time=(0.0,), voltage=(0.0,)).program(),
        resistance=_SHORT,
        gap=_GAP,
        step=1e-6,
        lift=np.linspace(0.0, 60e-6, 301),
        fluxes=start.loop_fluxes,
    )
    end = static_state(circuit, current=float(run.current[-1]), gap=_GAP - 60e-6)

    held = run_coil(
        injector(),
        _program(5.0),
        resistance=1.0,
        gap=_GAP,
        step=1e-6,
        lift=np.full(20001, 40e-6),
    )
    rest = static_state(injector(), current=5.0, gap=_GAP - 40e-6)
    return [
        check(
            "linkage of a shorted coil without resistance after motion [Wb]",
            expected=start.linkage,
            computed=end.linkage,
            tolerance=1e-12,
            source="u = 0 = d(linkage)/dt; end current looked up in the static circuit",
        ),
        check(
            "force of a settled current [N]",
            expected=-rest.force,
            computed=float(held.force[-1]),
            tolerance=5e-13,
            source="static circuit at 5 A",
        ),
    ]


def _energy() -> Iterator[Check]:
    for name, circuit, step, tolerance in (
        ("peak and hold, opening and closing, 20 ns", injector(), 20e-9, 1e-12),
        ("the same at 1 us", injector(), 1e-6, 1e-13),
        ("the same without eddy currents", injector(0.0), 50e-9, 5e-13),
    ):
        run = run_coil(
            circuit,
            _INJECTOR.program(),
            resistance=0.8,
            gap=_GAP,
            step=step,
            lift=opening(1e-3, step),
        )
        yield check(
            f"energy residual, {name} [-]",
            expected=0.0,
            computed=run.residual,
            tolerance=tolerance,
            source=IDENTITY,
        )


def _long_steps() -> list[Check]:
    """Flux after a pulse with boost, peak, fall and hold, in long steps and in short ones."""

    def flux(steps: int) -> float:
        step = 200e-6 / steps
        run = run_coil(
            injector(),
            _INJECTOR.program(),
            resistance=0.8,
            gap=_GAP,
            step=step,
            lift=opening(200e-6, step),
        )
        return float(run.flux[-1])

    exact = flux(160000)
    return [
        check(
            f"flux after a pulse in steps of {200e3 / steps:.0f} ns, switchings inside steps [Wb]",
            expected=exact,
            computed=flux(steps),
            tolerance=tolerance,
            source="steps of 1.25 ns",
        )
        for steps, tolerance in ((156, 1e-4), (1600, 1e-5))
    ]


def _map() -> list[Check]:
    """The same valve as a circuit without eddy currents and as a map of its linkage."""
    circuit = injector(eddy=0.0)
    current = np.linspace(0.0, 14.0, 57)
    gap = np.linspace(10e-6, 120e-6, 45)
    linkage = [[static_state(circuit, current=i, gap=x).linkage for x in gap] for i in current]
    table = FluxMap.of(current=current, gap=gap, linkage=linkage, force=None)
    runs = [
        run_coil(
            plant,
            _INJECTOR.program(),
            resistance=0.8,
            gap=_GAP,
            step=100e-9,
            lift=opening(1e-3, 100e-9),
        )
        for plant in (circuit, table)
    ]
    return [
        check(
            "energy residual of a coil known by a map [-]",
            expected=0.0,
            computed=runs[1].residual,
            tolerance=5e-14,
            source=IDENTITY,
        ),
        check(
            "force by map and by circuit, largest difference over the peak [-]",
            expected=0.0,
            computed=float(np.max(np.abs(runs[1].force - runs[0].force)) / np.max(runs[0].force)),
            tolerance=1e-3,
            source="the circuit itself; 57 currents and 45 gaps",
        ),
        check(
            "work of the map over a closed course of the armature [J]",
            expected=runs[0].work,
            computed=runs[1].work,
            tolerance=1e-4,
            source="the circuit itself",
        ),
    ]
