"""Hysteretic iron: loops of the law alone, and a coil on such a core in time."""

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq

from klack.machine.compiling.jit import njit
from klack.magnetics.circuit import MagneticBranch, MagneticCircuit
from klack.magnetics.hysteresis import (
    STOPS_PER_PART,
    LoopWidth,
    constant_width,
    falling_width,
    measured_loop,
    measured_width,
)
from klack.magnetics.iron import VACUUM_PERMEABILITY, IronCurve, froehlich
from klack.magnetics.reluctance import GapReluctance, LinearReluctance
from klack.magnetics.stop_kernel import stops_end, stops_energy, stops_mean, stops_move
from klack.magnetics.voltage_table import VoltageTable
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.drivers import CoilRun, run_coil
from klack.verification.published_magnets import VACOFLUX_48_FALLING, VACOFLUX_48_RISING

__all__ = ["hysteresis_loops"]


_H_C, _B_R, _MU_I = 100.0, 0.9, 300.0
_STOP = "stop model: Matsuo and Shimasaki 2005; "
_LENGTH, _AREA, _TURNS, _GAP = 60e-3, 12e-6, 60.0, 80e-6


def hysteresis_loops() -> list[Check]:
    """Return the checks of hysteretic iron."""
    return [*_law(), *_branches(), *_measured(), *_core()]


def _iron() -> IronCurve:
    return froehlich(1.9, 20000.0)


def _falling() -> LoopWidth:
    return falling_width(_iron(), _H_C, _B_R, _MU_I)


@njit
def _follow(table: np.ndarray, kept: np.ndarray, course: np.ndarray, out: np.ndarray) -> None:
    for k in range(course.size - 1):
        b, db = course[k], course[k + 1] - course[k]
        before = stops_energy(table, 0, kept, 0)
        out[k, 0] = stops_end(table, 0, 0, kept, 0, b, db)[0]
        out[k, 1] = stops_mean(table, 0, 0, kept, 0, b, db)[0] * db
        out[k, 2] = stops_move(table, 0, 0, kept, 0, b, db)
        out[k, 3] = stops_energy(table, 0, kept, 0) - before


def _run(width: LoopWidth, course: np.ndarray) -> np.ndarray:
    """Stops of a cube of 1 m: rows of force, work, heat, storage."""
    part = width.stops(1.0, 1.0)
    n = part.share.size
    pairs = np.column_stack((part.stiffness, part.share)).ravel()
    out = np.zeros((course.size - 1, 4))
    _follow(
        np.concatenate(([1.0, float(n), 3.0 + pairs.size], pairs, part.width)),
        np.zeros(n),
        course,
        out,
    )
    return out


def _steps(*turns: float, size: float = 1e-3) -> np.ndarray:
    """Course through flux densities, in steps of about ``size``."""
    parts = [np.zeros(1)]
    for start, end in zip((0.0, *turns), turns, strict=False):
        parts.append(np.linspace(start, end, max(int(abs(end - start) / size), 1) + 1)[1:])
    return np.concatenate(parts)


def _law() -> list[Check]:
    """Initial curve, loss, memory and energy of the stops alone."""
    width, n = constant_width(_iron(), _H_C, _MU_I), STOPS_PER_PART
    b = width.reversal
    knots = b * np.arange(1, n + 1) / n
    rise = _run(width, np.concatenate(([0.0], knots)))[:, 0]
    parabola = _H_C * (1.0 - (1.0 - knots / b) ** 2)
    cycle = _run(width, _steps(1.2, -1.2, 1.2))
    small = _run(width, _steps(0.8 * b, -0.8 * b, 0.8 * b, size=b / 160))
    back = _run(width, _steps(1.0, 0.2, 0.9, 0.5, 0.8, 0.2, -0.3))
    straight = _run(width, _steps(1.0, -0.3))
    one, two = (
        _run(width, _steps(1.3, low, low + 0.1, low))[-200:, 2].sum() for low in (-0.5, 0.7)
    )
    rng = np.random.default_rng(1)
    wild = _run(_falling(), np.concatenate(([0.0], rng.uniform(-1.8, 1.8, 4000))))
    return [
        check(
            "stops from the demagnetised state against the parabola, at 8 points [A/m]",
            expected=0.0,
            computed=float(np.max(np.abs(rise - parabola))),
            tolerance=1e-13,
            source="H_c [1 - (1 - B/b)^2]: Rayleigh's law with B as its argument; closed form",
        ),
        check(
            "loss of a cycle of 1.2 T, loop of constant width [J/m^3]",
            expected=4.0 * _H_C * 1.2 - _elastic(width, width.coercivity),
            computed=float(cycle[-4800:, 2].sum()),
            tolerance=1e-13,
            source=_STOP + "4 sum r_k (B_m - r_k/c), closed form",
        ),
        check(
            "loss of a cycle within the Rayleigh range, 0.8 b [J/m^3]",
            expected=4.0 / 3.0 * _H_C * (0.8 * b) ** 3 / b**2,
            computed=float(small[-512:, 2].sum()),
            tolerance=2e-3,
            source="Rayleigh 1887: loss with the cube of the amplitude, 4/3 H_c B_m^3/b^2",
        ),
        check(
            "closed minor loops are forgotten: field after two of them [A/m]",
            expected=float(straight[-1, 0]),
            computed=float(back[-1, 0]),
            tolerance=1e-13,
            source="Madelung 1905, wiping-out; the course without the minor loops",
        ),
        check(
            "equal minor loops at -0.5 and 0.7 T have equal losses [J/m^3]",
            expected=float(one),
            computed=float(two),
            tolerance=1e-13,
            source="congruency of loops of constant width; Mayergoyz 1991, ch. 1",
        ),
        check(
            "4000 random steps: work less heat less storage [J/m^3]",
            expected=0.0,
            computed=float(np.max(np.abs(wild[:, 1] - wild[:, 2] - wild[:, 3]))),
            tolerance=2e-14 * float(np.max(np.abs(wild[:, 1]))),
            source="energy balance of each step",
        ),
        check(
            "4000 random steps: least heat of a step [J/m^3]",
            expected=0.0,
            computed=min(float(wild[:, 2].min()), 0.0),
            tolerance=1e-15,
            source="second law: no step may gain energy",
        ),
    ]


def _elastic(width: LoopWidth, tip: float) -> float:
    """Loss per cycle that its branches do not enclose, as each stop is first elastic [J/m^3].

    ``tip``: half width of the loop at its tips [A/m].
    """
    part = width.stops(1.0, 1.0)
    return float(4.0 * np.sum((part.share * tip) ** 2 / part.stiffness))


def _branches() -> list[Check]:
    """Major loop through coercivity and remanence."""
    iron, width = _iron(), _falling()
    course = _steps(2.0, -2.0, 2.0)
    run = _run(width, course)
    H = iron.field(course[1:]) + run[:, 0]
    down = slice(2000, 6000)
    B, falling = course[1:][down], H[down]
    scale = _B_R / np.sqrt(np.log(_H_C / float(iron.field(_B_R))))
    exact = -_H_C * np.exp(-((B / scale) ** 2)) + iron.field(B)
    outer = 4.0 * quad(lambda b: _H_C * np.exp(-((b / scale) ** 2)), 0.0, 2.0, epsabs=1e-12)[0]
    curve = ComparedCurve(
        x_label="field strength [A/m]",
        y_label="flux density [T]",
        expected=(exact[300:-300:20], B[300:-300:20]),
        computed=(falling[300:-300], B[300:-300]),
    )
    return [
        check(
            "remanence of the falling branch [T]",
            expected=_B_R,
            computed=float(np.interp(0.0, falling[::-1], B[::-1])),
            tolerance=3e-8,
            source="H_an(B_r) = w(B_r), given",
            curve=curve,
        ),
        check(
            "coercivity of the falling branch [A/m]",
            expected=_H_C,
            computed=-float(np.interp(0.0, B[::-1], falling[::-1])),
            tolerance=1e-13,
            source="w(0) = H_c, given",
            curve=curve,
        ),
        check(
            "loss of the major loop against the area between its branches [J/m^3]",
            expected=outer - _elastic(width, _H_C * np.exp(-((2.0 / scale) ** 2))),
            computed=float(run[-8000:, 2].sum()),
            tolerance=5e-4,
            source="quadrature of 2 w(B) over B (SciPy), less the turns at both tips",
        ),
    ]


def _measured() -> list[Check]:
    """Loops given by a falling branch: a formula, and the published one of an alloy."""
    B = np.linspace(-1.4, 1.4, 281)
    curve = froehlich(1.9, 4000.0)
    given = curve.field(B) - 60.0 * (1.0 - (B / 1.4) ** 2) ** 2
    mean, width = measured_loop(B[::-1], given[::-1]), measured_width(B[::-1], given[::-1], 400.0)
    at = np.array([0.0, 0.4, 0.8, 1.2])
    back = mean.field(at) - width.at(at)
    wanted = curve.field(at) - 60.0 * (1.0 - (at / 1.4) ** 2) ** 2
    alloy = measured_width(VACOFLUX_48_FALLING[:, 1], VACOFLUX_48_FALLING[:, 0], 1000.0)
    tip = float(alloy.flux_density[-1])
    heat = float(_run(alloy, _steps(tip, -tip, tip))[-2 * int(2.0 * tip / 1e-3) :, 2].sum())
    (H_r, B_r), (H_f, B_f) = VACOFLUX_48_RISING.T, VACOFLUX_48_FALLING.T
    published = "Vacoflux 48 in the Modelica Standard Library (BSD-3), after a data sheet: "
    return [
        check(
            "measured branch: field strength given back, largest difference [A/m]",
            expected=0.0,
            computed=float(np.max(np.abs(back - wanted))),
            tolerance=1e-3,
            source="the branch that was given, at 0, 0.4, 0.8 and 1.2 T",
        ),
        check(
            "measured branch: loss of a cycle [J/m^3]",
            expected=4.0 * 60.0 * 1.4 * 8.0 / 15.0,
            computed=float(_run(width, _steps(1.4, -1.4, 1.4))[-5600:, 2].sum()),
            tolerance=1e-6,
            source="area of the given loop, 4 H_c B_m 8/15; closed form",
        ),
        check(
            "loop of Vacoflux 48 from its falling branch: loss of a cycle [J/m^3]",
            expected=float(np.trapezoid(B_f, H_f) - np.trapezoid(B_r, H_r)),
            computed=heat,
            tolerance=2e-2,
            source=published + "area between both published branches",
        ),
        check(
            "loop of Vacoflux 48: field strength of the rising branch at 1.15022 T [A/m]",
            expected=43.0264,
            computed=float(
                measured_loop(VACOFLUX_48_FALLING[:, 1], VACOFLUX_48_FALLING[:, 0]).field(1.15022)
                + alloy.at(1.15022)
            ),
            tolerance=6e-2,
            source=published + "its rising branch, which was not used",
        ),
    ]


def _pair(width: LoopWidth | None, gap: float = 1.0) -> MagneticCircuit:
    """Iron with a working gap; ``gap`` scales its reluctance."""
    law = GapReluctance(
        [0.0, 1e-3],
        [gap * 1e3, gap * (1e3 + 2e-3 / (VACUUM_PERMEABILITY * _AREA))],
        [gap * 2.0 / (VACUUM_PERMEABILITY * _AREA)] * 2,
    )
    return MagneticCircuit(
        branches=(
            MagneticBranch(name="gap", law=law, turns=_TURNS),
            MagneticBranch(
                name="iron",
                law=_iron().law(_LENGTH, _AREA),
                stops=None if width is None else width.stops(_LENGTH, _AREA),
            ),
            MagneticBranch(name="leakage", law=LinearReluctance(1.0 / 5e-9), turns=_TURNS),
        ),
        loops=np.array([[1, 0], [1, 0], [0, 1]]),
        main="gap",
    )


def _pulse(circuit: MagneticCircuit, gap: float, lift: np.ndarray | None = None) -> CoilRun:
    """A pulse that saturates the iron, then a short-circuited coil."""
    driver = VoltageTable(time=(0.0, 1.5e-3, 1.5e-3), voltage=(12.0, 12.0, 0.0)).program()
    return run_coil(
        circuit,
        driver,
        resistance=1.0,
        gap=gap,
        step=0.5e-6,
        lift=np.zeros(40001) if lift is None else lift,
    )


def _core() -> list[Check]:
    """A coil on hysteretic iron: remanence, and energy."""
    width, iron = _falling(), _iron()
    circuit = _pair(width)
    held = _pulse(circuit, _GAP)
    reluctance = float(circuit.branches[0].law.slope(0.0, _GAP))

    def line(B: float) -> float:
        return float((iron.field(B) - width.at(B)) * _LENGTH + reluctance * B * _AREA)

    left = brentq(line, 0.0, _B_R, xtol=1e-15)
    swing = VoltageTable(
        time=(0.0, 1e-3, 1e-3, 3e-3, 3e-3, 5e-3),
        voltage=(6.0, 6.0, -6.0, -6.0, 6.0, 6.0),
    ).program()
    closed = _pair(width, 1e-2)
    loop = run_coil(closed, swing, resistance=0.5, gap=_GAP, step=0.5e-6, lift=np.zeros(10001))
    moving = _pulse(circuit, _GAP, np.minimum(np.arange(40001) * 2e-9, 60e-6))
    H = _TURNS * loop.current
    mmf = 0.5 * (H[1:] + H[:-1])
    work = float(mmf @ np.diff(loop.fluxes[:, 0])) - float(
        np.diff(closed.branches[0].law.energy(loop.fluxes[[0, -1], 0], _GAP))[0]
        + np.diff(closed.branches[1].law.energy(loop.fluxes[[0, -1], 0], 0.0))[0]
    )
    return [
        check(
            "remanent flux density with an air gap of 80 um [T]",
            expected=left,
            computed=float(held.flux[-1]) / _AREA,
            tolerance=5e-12,
            source="load line: H l + R_gap phi = 0 on the falling branch (SciPy brentq)",
        ),
        check(
            "force that remains without current [N]",
            expected=0.5 * (left * _AREA) ** 2 * 2.0 / (VACUUM_PERMEABILITY * _AREA),
            computed=float(held.force[-1]),
            tolerance=1e-11,
            source="phi^2/(mu0 A) at the remanent flux; Woodson and Melcher 1968, ch. 3",
        ),
        check(
            "flux that remains in the same iron without hysteresis [Wb]",
            expected=0.0,
            computed=float(_pulse(_pair(None), _GAP).flux[-1]),
            tolerance=5e-14,
            source="the mean curve passes the origin",
        ),
        check(
            "heat of the iron against the work at the coil, closed core, +-6 V [J]",
            expected=work - float(_stored(width, loop.fluxes[:, 0])),
            computed=loop.hysteresis,
            tolerance=5e-4,
            source="integral of N i over the flux less what is stored, from the record",
        ),
        check(
            "energy balance of the closed core [-]",
            expected=0.0,
            computed=loop.residual,
            tolerance=1e-14,
            source="supply = ohmic + hysteresis + stored",
        ),
        check(
            "energy balance with an armature that moves and sticks [-]",
            expected=0.0,
            computed=moving.residual,
            tolerance=1e-12,
            source="supply = ohmic + hysteresis + work + stored",
        ),
    ]


def _stored(width: LoopWidth, flux: np.ndarray) -> float:
    """Energy held by the stops after a course of fluxes [J]."""
    run = _run(width, flux / _AREA)
    return float(run[:, 3].sum()) * _LENGTH * _AREA
