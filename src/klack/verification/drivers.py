"""Checks of coils in time: switching, eddy currents, energy, motion, order."""

from math import exp, log, pi

import numpy as np
from scipy.linalg import expm
from scipy.special import jn_zeros

from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.driver import DriveProgram
from klack.magnetics.eddy import cylinder_ladder
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.iron import VACUUM_PERMEABILITY, froehlich
from klack.magnetics.peak_hold import PeakHold
from klack.magnetics.pwm import PulseWidth
from klack.magnetics.reluctance import GapReluctance, LinearReluctance
from klack.magnetics.static import static_state
from klack.magnetics.two_point import TwoPoint
from klack.magnetics.voltage_step import VoltageStep
from klack.magnetics.voltage_table import VoltageTable
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.coupled_coils import coupled_coils
from klack.verification.single_coil import run_coil

__all__ = ["checks", "injector", "linear_coil", "opening"]

GROUP = "drivers"
IDENTITY = "discrete gradient (Gonzalez 1996): energy identity at every step size"

_MU0 = VACUUM_PERMEABILITY
_TURNS = 60.0
_MAIN, _LEAK = 2e7, 2e8  # [A/Wb]
_GAP = 100e-6
_INDUCTANCE = _TURNS**2 * (1.0 / _MAIN + 1.0 / _LEAK)
_SHORT = 1e-14  # [ohm] a coil that only integrates its voltage
_INJECTOR = PeakHold(
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
    """Coil of constant inductance: a main and a leakage path, and perhaps a shorted turn [S]."""
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
    leak = LinearReluctance(10.0 * 2.0 * _GAP / (_MU0 * area))
    return MagneticCircuit(
        branches=(
            MagneticBranch(name="gap", law=gap, turns=_TURNS, eddy=eddy),
            MagneticBranch(name="iron", law=froehlich(1.5, 1500.0).law(60e-3, area)),
            MagneticBranch(name="leakage", law=leak, turns=_TURNS),
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
    return VoltageStep(voltage=voltage, **more).program()


def _linear() -> list[Check]:
    """Checks of a coil of constant inductance without eddy currents."""
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
    stop = 200e-6 + tau * log(1.0 + top / 40.0)
    k = int(np.flatnonzero((down.time > 200e-6) & (down.current == 0.0))[0])
    # the last piece of current: a straight line to zero
    slope = (down.current[k - 2] - down.current[k - 1]) / 20e-9
    found = float(down.time[k - 1] + down.current[k - 1] / slope)
    pulse = VoltageTable(time=(1e-6, 4e-6, 4e-6, 9.3e-6), voltage=(0.0, 30.0, -6.0, 0.0)).program()
    jumps = run_coil(
        linear_coil(), pulse, resistance=_SHORT, gap=_GAP, step=1.7e-6, lift=np.zeros(8)
    )
    linkage = float(jumps.fluxes[-1].sum()) * _TURNS
    return [
        compare(
            GROUP,
            "current of a coil of constant inductance, largest deviation [A]",
            expected=0.0,
            computed=float(np.max(np.abs(rise.current - exact))),
            tolerance=1e-8,
            source="i = u/R (1 - exp(-R t/L)); 12 A, 20 ns",
            curve=_current_curve(rise.time, exact, rise.current),
        ),
        compare(
            GROUP,
            "end of the current against 40 V, then the diode blocks [s]",
            expected=stop,
            computed=found,
            tolerance=1e-7,
            source="t = (L/R) ln(1 + R i/u) after switching off",
        ),
        compare(
            GROUP,
            "linkage after ramps and jumps of voltage inside steps [Wb]",
            expected=0.5 * 3e-6 * 30.0 - 0.5 * 5.3e-6 * 6.0,
            computed=linkage,
            tolerance=5e-14,
            source="Faraday: linkage = integral of the voltage; 1.7 us steps",
        ),
    ]


def _switching() -> list[Check]:
    """Without resistance the current is a saw of straight lines, so instants must be exact."""
    driver = TwoPoint(voltage=12.0, upper=3.0, lower=2.0, freewheel=6.0).program()
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

    pwm = PulseWidth(voltage=12.0, period=50e-6, duty=0.3, freewheel=0.0).program()
    ripple = run_coil(coil, pwm, resistance=1.0, gap=_GAP, step=0.1e-6, lift=np.zeros(40001))
    tau = _INDUCTANCE / 1.0
    most = 12.0 * (1.0 - exp(-15e-6 / tau)) / (1.0 - exp(-50e-6 / tau))
    return [
        compare(
            GROUP,
            "two-point control after 80 switchings, largest deviation [A]",
            expected=0.0,
            computed=float(np.max(np.abs(saw.current - exact))),
            tolerance=1e-10,
            source="R = 0: straight lines between 2 and 3 A; 1 us steps, instants located in them",
            curve=_current_curve(saw.time, exact, saw.current),
        ),
        compare(
            GROUP,
            "peak and hold: current after the peak, largest deviation [A]",
            expected=0.0,
            computed=float(np.max(np.abs(peak.current[settled] - line))),
            tolerance=5e-13,
            source="R = 0: rise by 65 V to 10 A, then a line by -0.7 V",
        ),
        compare(
            GROUP,
            "upper current of settled pulse-width modulation [A]",
            expected=most,
            computed=float(ripple.current[-600:].max()),
            tolerance=5e-9,
            source="u/R (1 - exp(-d T/tau))/(1 - exp(-T/tau)); 50 us, duty 0.3",
        ),
    ]


def _eddy() -> list[Check]:
    """A shorted turn: two states, exact by the matrix exponential; a core: Bessel's series."""
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
    decay = log(after.flux[k] / after.flux[-1]) / (after.time[-1] - after.time[k])
    return [
        compare(
            GROUP,
            "main flux behind a shorted turn after 0.2 ms [Wb]",
            expected=float(exact[0]),
            computed=float(run.flux[-1]),
            tolerance=1e-8,
            source="matrix exponential of the two fluxes",
        ),
        compare(
            GROUP,
            "decay of the flux in the open coil [1/s]",
            expected=_MAIN / S,
            computed=decay,
            tolerance=1e-6,
            source="S dflux/dt + R flux = 0",
        ),
        *_core(),
    ]


def _core() -> list[Check]:
    """Flux into a solid round core after a step of the mmf."""
    core = {"conductivity": 2e6, "length": 20e-3, "radius": 2e-3, "permeability": 1000.0}
    tau = _MU0 * 1000.0 * 2e6 * 2e-3**2
    reluctance = 20e-3 / (_MU0 * 1000.0 * pi * 2e-3**2)
    b = jn_zeros(0, 400)
    out = []
    for terms, tolerance in ((3, 1e-2), (4, 1e-3)):
        ladder = cylinder_ladder(**core, terms=terms)
        branches = [MagneticBranch(name="core", law=LinearReluctance(reluctance), turns=1.0)]
        rows = [[1] + [0] * terms]
        for k in range(terms):
            row = [0] * (terms + 1)
            row[0 if k == 0 else k] = 1
            if k + 1 < terms:
                row[k + 1] = -1
            law = LinearReluctance(0.0)
            branches.append(MagneticBranch(name=f"e{k}", law=law, eddy=ladder.conductances[k]))
            rows.append(row)
            if k + 1 < terms:
                row = [0] * (terms + 1)
                row[k + 1] = 1
                law = LinearReluctance(ladder.reluctances[k])
                branches.append(MagneticBranch(name=f"r{k}", law=law))
                rows.append(row)
        row = [0] * (terms + 1)
        row[-1] = 1
        leak = LinearReluctance(1e6 * reluctance)
        branches.append(MagneticBranch(name="leakage", law=leak, turns=1.0))
        rows.append(row)
        circuit = MagneticCircuit(branches=tuple(branches), loops=np.array(rows), main="core")
        # a source of current: 1 MV behind 1 Mohm
        run = run_coil(
            circuit,
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
        curve = ComparedCurve(
            x_label="time over tau [-]",
            y_label="flux over final flux [-]",
            expected=(axis, 1.0 - 4.0 * np.sum(np.exp(-np.outer(axis, b**2)) / b**2, axis=1)),
            computed=(axis, np.interp(axis * tau, run.time, run.flux * reluctance)),
        )
        out.append(
            compare(
                GROUP,
                f"flux into a solid core after a step, ladder of {terms}, largest deviation [-]",
                expected=0.0,
                computed=float(np.max(np.abs(share - exact))),
                tolerance=tolerance,
                source="1 - 4 sum exp(-b_n^2 t/tau)/b_n^2, J0(b_n) = 0; t = 0.05 to 0.2 tau",
                curve=curve,
            )
        )
    return out


def _motion() -> list[Check]:
    """A shorted coil without resistance keeps its linkage while the armature moves."""
    circuit = injector(eddy=0.0)
    start = static_state(circuit, current=4.0, gap=_GAP)
    lift = np.linspace(0.0, 60e-6, 301)
    short = VoltageTable(time=(0.0,), voltage=(0.0,)).program()
    run = run_coil(
        circuit,
        short,
        resistance=_SHORT,
        gap=_GAP,
        step=1e-6,
        lift=lift,
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
        compare(
            GROUP,
            "linkage of a shorted coil without resistance after motion [Wb]",
            expected=start.linkage,
            computed=end.linkage,
            tolerance=1e-12,
            source="u = 0 = d(linkage)/dt; end current looked up in the static circuit",
        ),
        compare(
            GROUP,
            "force of a settled current [N]",
            expected=-rest.force,
            computed=float(held.force[-1]),
            tolerance=5e-13,
            source="static circuit at 5 A",
        ),
    ]


def _energy() -> list[Check]:
    cases = (
        ("peak and hold, opening and closing, 20 ns", injector(), 20e-9, 1e-12),
        ("the same at 1 us", injector(), 1e-6, 1e-13),
        ("the same without eddy currents", injector(0.0), 50e-9, 5e-13),
    )
    out = []
    for name, circuit, step, tolerance in cases:
        run = run_coil(
            circuit,
            _INJECTOR.program(),
            resistance=0.8,
            gap=_GAP,
            step=step,
            lift=opening(1e-3, step),
        )
        out.append(
            compare(
                GROUP,
                f"energy residual, {name} [-]",
                expected=0.0,
                computed=run.residual,
                tolerance=tolerance,
                source=IDENTITY,
            )
        )
    return out


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
        compare(
            GROUP,
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
    difference = np.max(np.abs(runs[1].force - runs[0].force)) / np.max(runs[0].force)
    return [
        compare(
            GROUP,
            "energy residual of a coil known by a map [-]",
            expected=0.0,
            computed=runs[1].residual,
            tolerance=5e-14,
            source=IDENTITY,
        ),
        compare(
            GROUP,
            "force by map and by circuit, largest difference over the peak [-]",
            expected=0.0,
            computed=float(difference),
            tolerance=1e-3,
            source="the circuit itself; 57 currents and 45 gaps",
        ),
        compare(
            GROUP,
            "work of the map over a closed course of the armature [J]",
            expected=runs[0].work,
            computed=runs[1].work,
            tolerance=1e-4,
            source="the circuit itself",
        ),
    ]
