r"""Checks of magnetic networks given in a case, against node potentials and equations of time.

klack solves loop fluxes; here node potentials are solved: a tube of iron carries
:math:`A\,B(\Delta/l)` at the potential difference :math:`\Delta`, by Froehlich's formula itself.
"""

from collections.abc import Mapping
from functools import cache, partial

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq, fsolve

from klack.magnetics.magnetic_network import MagneticNetwork
from klack.magnetics.static import static_state
from klack.magnetics.voltage_step import VoltageStep
from klack.verification.check import Check, compare
from klack.verification.single_coil import run_coil

__all__ = ["networks_of_tubes"]

_check = partial(compare, "magnetic-parts")
_MU0 = 4e-7 * np.pi
_SATURATION, _INITIAL = 1.5, 1500.0  # Froehlich: [T], relative
_GAP, _RESIDUAL = 100e-6, 40e-6

_IRON = {"froehlich": {"saturation": _SATURATION, "permeability": _INITIAL}}


def _network(elements: Mapping[str, object], gap: float = _GAP) -> MagneticNetwork:
    return MagneticNetwork.model_validate({"resistance": 0.8, "gap": gap, "elements": elements})


@cache
def _e_core() -> MagneticNetwork:
    """Middle leg with the coil and the working gap, two outer legs, one of them with a magnet."""
    return _network(
        {
            "middle": {"kind": "iron", "between": ["top", "m"], "material": _IRON, "length": 20e-3,
                       "area": 30e-6},
            "coil": {"kind": "coil", "between": ["m", "n"], "turns": 80},
            "gap": {"kind": "face", "between": ["n", "bottom"], "area": 30e-6,
                    "fringing_factor": 1.1, "residual_gap": _RESIDUAL},
            "left": {"kind": "iron", "between": ["bottom", "top"], "material": _IRON,
                     "length": 50e-3, "area": 12e-6},
            "right": {"kind": "iron", "between": ["bottom", "r"], "material": _IRON,
                      "length": 50e-3, "area": 18e-6},
            "magnet": {"kind": "magnet", "between": ["r", "top"], "remanence": 0.4,
                       "recoil_permeability": 1.05, "length": 0.3e-3, "area": 18e-6},
            "leakage": {"kind": "leakage", "between": ["m", "bottom"], "permeance": 30e-9},
        }
    )  # fmt: skip


def _iron_flux(drop: float, length: float, area: float) -> float:
    """Flux of a tube of Froehlich's iron at a potential difference."""
    H = abs(drop) / length
    a, b = 1.0 / (_MU0 * (_INITIAL - 1.0)), 1.0 / _SATURATION
    return float(np.sign(drop)) * area * (_MU0 * H + H / (a + b * H))


def _nodal(current: float, gap: float) -> tuple[float, float]:
    """Linkage [Wb] and flux of the working gap [Wb] of the E core, by node potentials."""
    gap_permeance = 1.1 * _MU0 * 30e-6 / (gap + _RESIDUAL)
    magnet = 0.3e-3 / (_MU0 * 1.05)  # [m^2/Wb A] over the area

    def fluxes(v: np.ndarray) -> tuple[float, ...]:
        top, m, r = 100.0 * v  # bottom is 0; n is m plus the mmf of the coil
        middle = _iron_flux(top - m, 20e-3, 30e-6)
        through = (m + 80.0 * current) * gap_permeance
        left = _iron_flux(-top, 50e-3, 12e-6)
        right = _iron_flux(-r, 50e-3, 18e-6)
        of_magnet = (r - top + 0.4 * magnet) * 18e-6 / magnet
        return middle, through, left, right, of_magnet, m * 30e-9

    def rest(v: np.ndarray) -> list[float]:
        middle, through, left, right, of_magnet, leak = fluxes(v)
        return [1e5 * (middle - left - of_magnet), 1e5 * (middle - through - leak),
                1e5 * (right - of_magnet)]  # fmt: skip

    found = fsolve(rest, np.zeros(3), xtol=1e-11)
    through = fluxes(found)[1]
    return 80.0 * through, through


def _at_rest() -> list[Check]:
    circuit, out = _e_core().circuit(), []
    source = "node potentials of Froehlich's iron, SciPy fsolve, written apart"
    for current, gap in ((0.0, 100e-6), (1.5, 100e-6), (6.0, 20e-6)):
        state = static_state(circuit, current=current, gap=gap)
        linkage, through = _nodal(current, gap)
        place = f"E core with a magnet, {current:g} A, {1e6 * gap:.0f} um"
        out.append(
            _check(
                f"{place}: linkage [mWb]",
                expected=1e3 * linkage,
                computed=1e3 * state.linkage,
                tolerance=1e-7,
                source=source,
            )
        )
        force = -0.5 * through**2 / (1.1 * _MU0 * 30e-6)
        out.append(
            _check(
                f"{place}: force [N]",
                expected=force,
                computed=state.force,
                tolerance=1e-7,
                source=f"Maxwell's pull of the flux of that solution; {source}",
            )
        )
    nodes, weights = np.polynomial.legendre.leggauss(80)
    step, current = 0.2e-6, 6.0

    def coenergy(gap: float) -> float:  # above that without current
        currents = 0.5 * current * (nodes + 1.0)
        return float(0.5 * current * weights @ [_nodal(i, gap)[0] for i in currents])

    rise = (coenergy(50e-6 + step) - coenergy(50e-6 - step)) / (2.0 * step)
    forces = [static_state(circuit, current=i, gap=50e-6).force for i in (current, 0.0)]
    out.append(
        _check(
            "E core with a magnet, 6 A, 50 um: force above that of the magnet [N]",
            expected=rise,
            computed=forces[0] - forces[1],
            tolerance=1e-5,
            source="slope of the co-energy, the integral of psi di of the nodal solutions",
        )
    )
    return out


def _transformer() -> list[Check]:
    """Mutual inductance: voltage on one coil, the other closed through a resistance."""
    N1, N2, R1, R2, main, leak1, leak2 = 50.0, 20.0, 0.8, 0.3, 40e-9, 6e-9, 4e-9
    network = _network(
        {
            "coil": {"kind": "coil", "between": ["a", "b"], "turns": N1},
            "leak1": {"kind": "leakage", "between": ["b", "a"], "permeance": leak1},
            "ring": {"kind": "shorted-coil", "between": ["c", "b"], "turns": N2, "resistance": R2},
            "leak2": {"kind": "leakage", "between": ["c", "b"], "permeance": leak2},
            "main": {"kind": "leakage", "between": ["c", "a"], "permeance": main},
            "gap": {"kind": "face", "between": ["c", "a"], "area": 1e-7, "residual_gap": 1e-3},
        }
    )
    both = main + _MU0 * 1e-7 / (1e-3 + _GAP)  # passes both windings, each leakage its own only
    L1, M, L2 = N1**2 * (leak1 + both), N1 * N2 * both, N2**2 * (leak2 + both)
    L = np.array([[L1, M], [M, L2]])
    A = -np.linalg.solve(L, np.diag([R1, R2]))
    t = 300e-6
    final = np.array([12.0 / R1, 0.0])
    current = final - expm(A * t) @ final
    run = run_coil(
        network.circuit(),
        VoltageStep(voltage=12.0).program(),
        resistance=R1,
        gap=_GAP,
        step=0.5e-6,
        lift=np.zeros(601),
    )
    return [
        _check(
            "two coupled windings, 12 V on one, the other closed: current after 300 us [A]",
            expected=float(current[0]),
            computed=float(run.current[-1]),
            tolerance=2e-6,
            source="L di/dt + R i = u with self and mutual inductances; matrix exponential",
        ),
        _check(
            "two coupled windings: heat in the closed one after 300 us [mJ]",
            expected=1e3 * _secondary_heat(A, final, R2, t),
            computed=1e3 * run.eddy,
            tolerance=2e-6,
            source="the integral of R2 i2^2 of that solution",
        ),
    ]


def _secondary_heat(A: np.ndarray, final: np.ndarray, resistance: float, t: float) -> float:
    nodes, weights = np.polynomial.legendre.leggauss(40)
    times = 0.5 * t * (nodes + 1.0)
    second = np.array([(final - expm(A * s) @ final)[1] for s in times])
    return float(0.5 * t * resistance * weights @ second**2)


def _polarised() -> list[Check]:
    """Two gaps, one closing as the other opens, with a magnet between: linear, in closed form."""
    area, turns, half, residual = 20e-6, 60.0, 100e-6, 50e-6
    length, remanence = 2e-3, 1.2
    network = _network(
        {
            "upper": {"kind": "face", "between": ["arm", "up"], "area": area,
                      "residual_gap": residual},
            "lower": {"kind": "face", "between": ["arm", "down"], "area": area,
                      "residual_gap": residual, "opens_from": half},
            "coil_up": {"kind": "coil", "between": ["up", "yoke"], "turns": 0.5 * turns},
            "coil_down": {"kind": "coil", "between": ["yoke", "down"], "turns": 0.5 * turns},
            "magnet": {"kind": "magnet", "between": ["yoke", "arm"], "remanence": remanence,
                       "recoil_permeability": 1.0, "length": length, "area": area},
        },
        gap=half,
    )  # fmt: skip
    out, current = [], 2.0
    reluctance = 1.0 / (_MU0 * area)
    for x in (100e-6, 60e-6):
        upper, lower = (x + residual) * reluctance, (2.0 * half - x + residual) * reluctance
        inner, mmf = length * reluctance, remanence * length / _MU0
        # two loops: magnet - upper - coil up, magnet - lower - coil down
        R = np.array([[upper + inner, inner], [inner, lower + inner]])
        up, down = np.linalg.solve(R, [mmf + 0.5 * turns * current, mmf - 0.5 * turns * current])
        force = -0.5 * reluctance * (up**2 - down**2)
        state = static_state(network.circuit(), current=current, gap=x)
        out.append(
            _check(
                f"polarised magnet with two gaps, 2 A, {1e6 * x:.0f} um: force [N]",
                expected=float(force),
                computed=state.force,
                tolerance=1e-13,
                source="two linear loops by hand, pull phi^2/(2 mu0 A) at each gap",
            )
        )
    return out


def _voltage_step() -> list[Check]:
    """Iron, a moving gap and a damping ring in time, with the armature on a given way."""
    turns, R, S, leak, area, length = 80.0, 0.8, 4e3, 25e-9, 30e-6, 60e-3
    network = _network(
        {
            "iron": {"kind": "iron", "between": ["a", "b"], "material": _IRON, "length": length,
                     "area": area},
            "ring": {"kind": "shorted-coil", "between": ["b", "c"], "turns": 1,
                     "resistance": 1.0 / S},
            "gap": {"kind": "face", "between": ["c", "d"], "area": area, "residual_gap": _RESIDUAL},
            "coil": {"kind": "coil", "between": ["d", "a"], "turns": turns},
            "leakage": {"kind": "leakage", "between": ["a", "d"], "permeance": leak},
        }
    )  # fmt: skip
    end, steps, speed = 400e-6, 4000, 0.15

    def mmf_of_iron(flux: float) -> float:
        return brentq(lambda drop: _iron_flux(drop, length, area) - flux, -1e5, 1e5, xtol=1e-12)

    def rates(t: float, y: np.ndarray) -> list[float]:
        current = y[1] / (leak * turns)
        reluctance = (_GAP - speed * t + _RESIDUAL) / (_MU0 * area)
        main = (turns * current - reluctance * y[0] - mmf_of_iron(y[0])) / S
        return [main, (24.0 - R * current) / turns - main]

    exact = solve_ivp(rates, (0.0, end), [0.0, 0.0], rtol=1e-9, atol=1e-14, method="LSODA")
    current = float(exact.y[1, -1]) / (leak * turns)
    force = 0.5 * float(exact.y[0, -1]) ** 2 / (_MU0 * area)
    run = run_coil(
        network.circuit(),
        VoltageStep(voltage=24.0).program(),
        resistance=R,
        gap=_GAP,
        step=end / steps,
        lift=speed * np.linspace(0.0, end, steps + 1),
    )
    source = "two equations of flux, SciPy LSODA, written apart"
    return [
        _check(
            "24 V on iron with a damping ring and a moving gap: current after 400 us [A]",
            expected=current,
            computed=float(run.current[-1]),
            tolerance=2e-7,
            source=source,
        ),
        _check(
            "24 V on iron with a damping ring and a moving gap: force after 400 us [N]",
            expected=force,
            computed=float(run.force[-1]),
            tolerance=1e-3,
            source=source,
            reason="the mean of the last step of 0.1 us",
        ),
        _check(
            "24 V on iron with a damping ring and a moving gap: energy balance [-]",
            expected=0.0,
            computed=run.residual,
            tolerance=1e-13,
            source="supply = heat + heat of the ring + stored energy + work",
        ),
    ]


def networks_of_tubes() -> list[Check]:
    """Return the checks."""
    return [*_at_rest(), *_transformer(), *_polarised(), *_voltage_step()]
