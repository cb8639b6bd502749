r"""Coils of one magnet on drivers of their own: a transformer, and two coils of a valve.

Without iron the linkages are linear in the currents, :math:`\psi = L i` with

.. math:: L = \begin{pmatrix} N_1^2(\Lambda + \Lambda_1) & N_1 N_2 \Lambda \\
                              N_1 N_2 \Lambda & N_2^2(\Lambda + \Lambda_2) \end{pmatrix},

and currents follow from matrix exponentials. With iron the linkages are integrated by SciPy, the
main flux being the root of one equation by Froehlich's formula.
"""

from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from klack.magnetics.boost_capacitor import BoostCapacitor
from klack.magnetics.boost_driver import BoostDriver, Shot
from klack.magnetics.driver import Driver
from klack.magnetics.magnetic_network import MagneticNetwork
from klack.magnetics.static import static_state
from klack.magnetics.two_point import TwoPoint
from klack.mechanics.prescribed_motion import PrescribedMotion
from klack.simulation.network_result import NetworkResult
from klack.verification.benches import component, last, run_network
from klack.verification.check import Check, check

__all__ = ["coupled_coils", "shared_capacitor", "two_coils"]


_MU0 = 4e-7 * np.pi
_TURNS = np.array([100.0, 40.0])
_LEAK = np.array([20e-9, 35e-9])
_RESISTANCE = np.array([0.8, 2.0])
_AREA, _GAP, _RESIDUAL = 30e-6, 100e-6, 50e-6
_MAIN = _MU0 * _AREA / (_GAP + _RESIDUAL)
_SATURATION, _INITIAL = 1.5, 1500.0
_IRON, _SECTION = 40e-3, 25e-6
_STEP = 2e-7


def two_coils(*, iron: bool = False) -> MagneticNetwork:
    """Gap with two coils, each with a leakage of its own, in series with iron or not."""
    elements: dict[str, object] = {
        "first": {"kind": "coil", "between": ["a", "b"], "turns": _TURNS[0]},
        "first_leakage": {"kind": "leakage", "between": ["a", "b"], "permeance": _LEAK[0]},
        "second": {
            "kind": "coil",
            "between": ["b", "c"],
            "turns": _TURNS[1],
            "circuit": "other",
        },
        "second_leakage": {"kind": "leakage", "between": ["b", "c"], "permeance": _LEAK[1]},
        "gap": {
            "kind": "face",
            "between": ["d" if iron else "c", "a"],
            "area": _AREA,
            "residual_gap": _RESIDUAL,
        },
    }
    if iron:
        froehlich = {"saturation": _SATURATION, "permeability": _INITIAL}
        elements["core"] = {
            "kind": "iron",
            "between": ["c", "d"],
            "material": {"froehlich": froehlich},
            "length": _IRON,
            "area": _SECTION,
        }
    return MagneticNetwork.model_validate(
        {
            "resistance": _RESISTANCE[0],
            "circuits": {"other": {"resistance": _RESISTANCE[1]}},
            "gap": _GAP,
            "elements": elements,
        }
    )


def coupled_coils() -> list[Check]:
    """Return the checks of several coils."""
    return [*_transformer(), *_flyback(), *_static(), *_saturated(), *_series()]


def _run(
    magnet: MagneticNetwork,
    first: Driver,
    second: Driver | None = None,
    *,
    duration: float,
    motion: PrescribedMotion | None = None,
    step: float = _STEP,
) -> NetworkResult:
    parts: dict[str, object] = {
        "body": motion or PrescribedMotion(time=(0.0, 1.0), displacement=(0.0, 0.0)),
        "magnet": magnet,
        "one": first,
    }
    joints = [["body.body", "magnet.armature"], ["magnet.terminals", "one.terminals"]]
    if second is not None:
        parts["two"] = second
        joints.append(["magnet.other", "two.terminals"])
    return run_network(parts, joints, duration=duration, step=step, record=5.0 * step, start="rest")


def _inductance() -> np.ndarray:
    return np.asarray(np.outer(_TURNS, _TURNS) * _MAIN + np.diag(_TURNS**2 * _LEAK))


def _transformer() -> list[Check]:
    """Step of 12 V at the first coil; the second one closed, or open."""
    end, L = 0.6e-3, _inductance()
    step, none = (
        component("voltage-table", time=(0.0,), voltage=(12.0,)),
        component("voltage-table", time=(0,), voltage=(0,)),
    )
    closed = _run(two_coils(), step, none, duration=end)
    final = np.array([12.0 / float(_RESISTANCE[0]), 0.0])
    rate = -np.linalg.solve(L, np.diag(_RESISTANCE))
    expected = final - expm(rate * end) @ final
    opened = _run(
        two_coils(), step, component("voltage-step", voltage=1.0, start=1.0), duration=end
    )
    rise = np.exp(-_RESISTANCE[0] * end / L[0, 0])
    half = np.exp(0.5 * _STEP * _RESISTANCE[0] / L[0, 0])  # the middle of the last step
    source = "exp(-L^-1 R t) of two coupled circuits"
    return [
        check(
            "transformer with a closed second coil, current of the first after 0.6 ms [A]",
            expected=float(expected[0]),
            computed=last(closed, "magnet current"),
            tolerance=1e-8,
            source=source,
        ),
        check(
            "transformer with a closed second coil, current of the second [A]",
            expected=float(expected[1]),
            computed=last(closed, "magnet other current"),
            tolerance=2e-9,
            source=source,
        ),
        check(
            "transformer with an open second coil, current of the first [A]",
            expected=float(final[0] * (1.0 - rise)),
            computed=last(opened, "magnet current"),
            tolerance=1e-8,
            source="u/R (1 - exp(-R t/L))",
        ),
        check(
            "voltage of the open second coil, mean over the last step [V]",
            expected=float(12.0 * L[0, 1] / L[0, 0] * rise * half),
            computed=last(opened, "magnet other voltage"),
            tolerance=2e-8,
            source="M di/dt",
        ),
        check(
            "work of the first driver of the transformer, the second closed [J]",
            expected=12.0 * float(_charge(np.asarray(rate), final, end)[0]),
            computed=closed.books.supplies["magnet electric"],
            tolerance=1e-7,
            source="u times the charge, integral of the matrix exponential",
        ),
    ]


def _charge(rate: np.ndarray, final: np.ndarray, end: float) -> np.ndarray:
    """Integral of ``final - exp(rate t) final`` [A s]."""
    return np.asarray(final * end - np.linalg.solve(rate, (expm(rate * end) - np.eye(2)) @ final))


def _flyback() -> list[Check]:
    """First coil on, and off against 30 V; the second behind a diode that blocks at first."""
    on, end, forward, down = 0.2e-3, 0.5e-3, 0.7, 30.0
    run = _run(
        two_coils(),
        component("voltage-step", voltage=12.0, end=on, decay=down),
        component("voltage-step", voltage=1.0, start=1.0, freewheel=forward),
        duration=end,
    )
    L, R = _inductance(), np.diag(_RESISTANCE)
    peak = 12.0 / _RESISTANCE[0] * (1.0 - np.exp(-_RESISTANCE[0] * on / L[0, 0]))
    rate, final = -np.linalg.solve(L, R), np.array([-down, -forward]) / _RESISTANCE

    def both(time: float) -> np.ndarray:
        return np.asarray(final + expm(rate * time) @ (np.array([peak, 0.0]) - final))

    over = float(brentq(lambda t: both(t)[0], 1e-9, 0.2e-3, xtol=1e-20, rtol=1e-14))
    left = -forward / _RESISTANCE[1]
    decay = np.exp(-_RESISTANCE[1] * (end - on - over) / L[1, 1])
    current = run.channels["magnet current"].values
    return [
        check(
            "flyback: current of the second coil 0.3 ms after the first is switched off [A]",
            expected=float(left + (both(over)[1] - left) * decay),
            computed=last(run, "magnet other current"),
            tolerance=1e-6,
            source="matrix exponentials until the first current ends, then exp(-R t/L)",
        ),
        check(
            "flyback: the first coil is open then, its current [A]",
            expected=0.0,
            computed=float(np.max(np.abs(current[run.time >= on + over + 5.0 * _STEP]))),
            tolerance=1e-15,
            source="a diode blocks",
        ),
    ]


def _static() -> list[Check]:
    """Reciprocity and force of two coils in saturated iron."""
    circuit = two_coils(iron=True).circuit()
    turns = {name: circuit.turns_of(name) for name in ("", "other")}
    i1, i2, x, small = 6.0, 9.0, 80e-6, 1e-3

    def linkage(of: str, first: float, second: float) -> float:
        state = static_state(circuit, current=first, gap=x, others={"other": second})
        return float(turns[of] @ state.loop_fluxes)

    forth = (linkage("other", i1 + small, i2) - linkage("other", i1 - small, i2)) / (2 * small)
    step = 1e-8
    coenergy = [
        static_state(circuit, current=i1, gap=x + s, others={"other": i2}).coenergy
        for s in (-step, step)
    ]
    held = two_coils(iron=True).model_copy(update={"gap": x, "start_current": i1})
    others = {"other": held.circuits["other"].model_copy(update={"start_current": i2})}
    held = held.model_copy(update={"circuits": others})
    volts = _RESISTANCE * (i1, i2)
    run = _run(
        held,
        component("voltage-table", time=(0.0,), voltage=(float(volts[0]),)),
        component("voltage-table", time=(0.0,), voltage=(float(volts[1]),)),
        duration=20e-6,
    )
    return [
        check(
            "reciprocity in saturated iron: d psi_2/d i_1 [H]",
            expected=(linkage("", i1, i2 + small) - linkage("", i1, i2 - small)) / (2 * small),
            computed=forth,
            tolerance=1e-7,
            source="d psi_1/d i_2: mutual inductance is symmetric, Woodson and Melcher 1968",
        ),
        check(
            "force of two coils with constant currents [N]",
            expected=-(coenergy[1] - coenergy[0]) / (2.0 * step),
            computed=float(run.channels["magnet.armature force"].values[-1]),
            tolerance=2e-9,
            source="slope of the coenergy at constant currents, Woodson and Melcher 1968",
        ),
    ]


def _main_flux(linkage: np.ndarray, x: float) -> tuple[float, np.ndarray]:
    """Flux of the iron [Wb] and currents [A] at linkages [Wb], by one root."""
    share = linkage / _TURNS
    a, b = 1.0 / (_MU0 * (_INITIAL - 1.0)), 1.0 / _SATURATION

    def field(B: float) -> float:
        """Field strength [A/m] of B = mu0 H + H/(a + b H), solved for H."""
        p, q = b * _MU0, a * _MU0 + 1.0 - abs(B) * b
        H = 2.0 * abs(B) * a / (q + np.sqrt(q * q + 4.0 * p * abs(B) * a))
        return float(np.sign(B) * H)

    def rest(flux: float) -> float:
        gap = (x + _RESIDUAL) / (_MU0 * _AREA) * flux
        return float(np.sum((share - flux) / _LEAK) - gap - _IRON * field(flux / _SECTION))

    flux = float(brentq(rest, -2e-4, 2e-4, xtol=1e-20, rtol=1e-15))
    return flux, (share - flux) / (_LEAK * _TURNS)


def _saturated() -> list[Check]:
    """Two coils on voltage courses, iron in saturation, armature moving."""
    end, way = 0.8e-3, 60e-6
    first = component(
        "voltage-table", time=(0.0, 0.5e-3, 0.5e-3 + 1e-7), voltage=(24.0, 24.0, -6.0)
    )
    second = component("voltage-table", time=(0.0, 0.2e-3, 0.2e-3 + 1e-7), voltage=(0.0, 0.0, 30.0))
    motion = PrescribedMotion(
        time=(0.0, 0.1e-3, 0.7e-3, 1.0), displacement=(0.0, 0.0, way, way), between="straight"
    )
    run = _run(two_coils(iron=True), first, second, duration=end, motion=motion, step=0.5 * _STEP)

    def gap(t: float) -> float:
        return _GAP - way * float(np.clip((t - 0.1e-3) / 0.6e-3, 0.0, 1.0))

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        u = np.array(
            [
                np.interp(t, first.time, first.voltage),
                np.interp(t, second.time, second.voltage),
            ]
        )
        flux, i = _main_flux(y[:2], gap(t))
        force = flux * flux / (2.0 * _MU0 * _AREA)
        speed = way / 0.6e-3 if 0.1e-3 < t < 0.7e-3 else 0.0
        return np.array([*(u - _RESISTANCE * i), *(u * i), force * speed])

    y = np.zeros(5)
    for a, b in pairwise((0.0, 0.1e-3, 0.2e-3, 0.2e-3 + 1e-7, 0.5e-3, 0.5e-3 + 1e-7, 0.7e-3, end)):
        found = solve_ivp(rate, (a, b), y, method="DOP853", rtol=1e-11, atol=1e-15)
        y = found.y[:, -1]
    flux, currents = _main_flux(y[:2], gap(end))
    source = "linkages integrated by SciPy (DOP853), main flux by a root"
    return [
        check(
            "two coils, saturated, moving: current of the first after 0.8 ms [A]",
            expected=float(currents[0]),
            computed=last(run, "magnet current"),
            tolerance=2e-6,
            source=source,
        ),
        check(
            "two coils, saturated, moving: current of the second after 0.8 ms [A]",
            expected=float(currents[1]),
            computed=last(run, "magnet other current"),
            tolerance=1e-7,
            source=source,
        ),
        check(
            "two coils, saturated, moving: flux of the gap [Wb]",
            expected=flux,
            computed=last(run, "magnet flux"),
            tolerance=1e-7,
            source=source,
        ),
        check(
            "two coils, saturated, moving: work of the first driver [J]",
            expected=float(y[2]),
            computed=run.books.supplies["magnet electric"],
            tolerance=1e-6,
            source=source,
        ),
        check(
            "two coils, saturated, moving: work of the second driver [J]",
            expected=float(y[3]),
            computed=run.books.supplies["magnet other electric"],
            tolerance=5e-8,
            source=source,
        ),
        check(
            "two coils, saturated, moving: work on the armature [J]",
            expected=-float(y[4]),
            computed=run.books.supplies["body motion"],
            tolerance=2e-7,
            source=source,
        ),
        check(
            "two coils, saturated, moving: energy balance [-]",
            expected=0.0,
            computed=run.books.relative_residual,
            tolerance=1e-13,
            source="both supplies = ohmic losses + work + stored",
        ),
    ]


def _series() -> list[Check]:
    """Two equal halves of a coil on equal choppers, against the coil at twice the voltage."""

    def magnet(parts: int) -> MagneticNetwork:
        elements: dict[str, object] = {
            "gap": {"kind": "face", "between": ["n2", "n0"], "area": _AREA,
                    "residual_gap": _RESIDUAL},
        }  # fmt: skip
        for k in range(2):
            nodes = [f"n{k}", f"n{k + 1}"]
            coil = {"kind": "coil", "between": nodes, "turns": 50}
            elements[f"coil{k}"] = coil | ({"circuit": "other"} if k and parts == 2 else {})
            elements[f"leakage{k}"] = {"kind": "leakage", "between": nodes, "permeance": 20e-9}
        return MagneticNetwork.model_validate(
            {
                "resistance": 1.0 / parts,
                "gap": _GAP,
                "elements": elements,
                "circuits": {"other": {"resistance": 0.5}} if parts == 2 else {},
            }
        )

    def driver(voltage: float) -> TwoPoint:
        return TwoPoint(voltage=voltage, upper=5.0, lower=4.5, end=0.6e-3, freewheel=voltage / 20)

    halves = _run(magnet(2), driver(12.0), driver(12.0), duration=0.8e-3)
    alone = _run(magnet(1), driver(24.0), duration=0.8e-3)
    apart = halves.channels["magnet current"].values - alone.channels["magnet current"].values
    return [
        check(
            "two halves of a coil on two equal choppers, largest difference from the whole [A]",
            expected=0.0,
            computed=float(np.max(np.abs(apart))),
            tolerance=5e-10,
            source="equal currents in series; the step of one coil",
        ),
        check(
            "work of both choppers [J]",
            expected=alone.books.supplies["magnet electric"],
            computed=halves.books.supplies["magnet electric"]
            + halves.books.supplies["magnet other electric"],
            tolerance=4e-11,
            source="that of the whole coil",
        ),
    ]


_TURNS_SHARED, _LEAK_SHARED, _AREA_SHARED, _GAP_SHARED, _RESIDUAL_SHARED = (
    60.0,
    20e-9,
    30e-6,
    100e-6,
    50e-6,
)
_L = _TURNS_SHARED**2 * (_LEAK_SHARED + _MU0 * _AREA_SHARED / (_GAP_SHARED + _RESIDUAL_SHARED))
_R, _C, _U = 0.5, 20e-6, 65.0
_STEP_SHARED = 1e-7


def shared_capacitor() -> list[Check]:
    """Return the checks of a shared capacitor."""
    return [*_in_sequence(), *_overlapping(), *_alike()]


def _magnet() -> MagneticNetwork:
    return MagneticNetwork.model_validate(
        {
            "resistance": _R,
            "gap": _GAP_SHARED,
            "elements": {
                "coil": {"kind": "coil", "between": ["a", "b"], "turns": _TURNS_SHARED},
                "leakage": {"kind": "leakage", "between": ["a", "b"], "permeance": _LEAK_SHARED},
                "gap": {
                    "kind": "face",
                    "between": ["b", "a"],
                    "area": _AREA_SHARED,
                    "residual_gap": _RESIDUAL_SHARED,
                },
            },
        }
    )


def _driver(start: float, end: float, peak: float = 100.0) -> BoostDriver:
    return BoostDriver(
        battery=5.0,
        peak_current=peak,
        hold_current=3.0,
        hold_band=1.0,
        diode_voltage=0.0,
        shots=(Shot(start=start, end=end),),
    )


def _run_shared(
    drivers: tuple[BoostDriver, ...],
    capacitor: BoostCapacitor | None,
    *,
    duration: float,
    step: float = _STEP_SHARED,
) -> NetworkResult:
    parts: dict[str, object] = {
        "body": PrescribedMotion(time=(0.0, 1.0), displacement=(0.0, 0.0)),
    }
    joined = [["body.body"]]
    for k, driver in enumerate(drivers):
        parts |= {f"m{k}": _magnet(), f"d{k}": driver}
        joined[0].append(f"m{k}.armature")
        joined.append([f"m{k}.terminals", f"d{k}.terminals"])
    if capacitor is not None:
        parts["bank"] = capacitor
        joined.append(["bank.outlet", *(f"d{k}.supply" for k in range(len(drivers)))])
    return run_network(
        parts, joined, duration=duration, step=step, record=10.0 * step, start="rest"
    )


def _boosted(start: float, time: float) -> float:
    r"""Capacitor [V] after one coil was at it for a time and returned its energy.

    Without iron it is a damped oscillator, :math:`L\,\mathrm di/\mathrm dt = k U - R i`,
    :math:`C\,\mathrm dU/\mathrm dt = -k i`: a matrix exponential for each stretch of time.
    """

    def matrix(k: float) -> np.ndarray:
        return np.array([[-_R / _L, k / _L], [-k / _C, 0.0]])

    y = expm(matrix(1.0) * time) @ np.array([0.0, start])
    over = brentq(lambda t: (expm(matrix(-1.0) * t) @ y)[0], 1e-7, 0.25e-3, xtol=1e-18, rtol=1e-14)
    return float((expm(matrix(-1.0) * over) @ y)[1])


def _in_sequence() -> list[Check]:
    """Two discharges in sequence; the recharge before and between them."""
    first, second, time = (0.0, 40e-6), (0.4e-3, 0.46e-3), 0.8e-3
    run = _run_shared(
        (_driver(*first), _driver(*second)),
        BoostCapacitor(capacitance=_C, voltage=_U, recharge_power=0.0),
        duration=time,
    )
    after = _boosted(_U, 40e-6)
    between = float(np.interp(0.39e-3, run.time, run.channels["bank capacitor voltage"].values))
    power, current = 20.0, 0.5
    low = BoostCapacitor(
        capacitance=_C,
        voltage=_U,
        start_voltage=10.0,
        recharge_power=power,
        recharge_current=current,
        efficiency=0.8,
    )
    late = _run_shared(
        (_driver(1.5e-3, 1.6e-3), _driver(1.5e-3, 1.6e-3)), low, duration=1.5e-3, step=1e-6
    )
    corner = power / current
    left = 1.5e-3 - _C * (corner - 10.0) / current
    charged = np.sqrt(corner**2 + 2.0 * power * left / _C)
    return [
        check(
            "shared capacitor after the first of two discharges [V]",
            expected=after,
            computed=between,
            tolerance=1e-7,
            source="damped oscillator, there and back until the current ends",
        ),
        check(
            "shared capacitor after the second discharge, at another coil [V]",
            expected=_boosted(after, 60e-6),
            computed=last(run, "bank capacitor voltage"),
            tolerance=1e-7,
            source="damped oscillator, there and back until the current ends",
        ),
        check(
            "heat of both coils of that sequence [J]",
            expected=0.5 * _C * (_U**2 - _boosted(after, 60e-6) ** 2),
            computed=run.books.losses["m0 ohmic"] + run.books.losses["m1 ohmic"],
            tolerance=2e-5,
            source="what the capacitor has lost; no converter",
        ),
        check(
            "recharge of a shared capacitor, from 10 V, after 1.5 ms [V]",
            expected=float(charged),
            computed=last(late, "bank capacitor voltage"),
            tolerance=5e-13,
            source="constant current, then constant power: U^2 = U_0^2 + 2 P t/C",
        ),
        check(
            "what its converter draws from the battery [J]",
            expected=0.5 * _C * (float(charged) ** 2 - 100.0) / 0.8,
            computed=late.books.supplies["bank recharge"],
            tolerance=2e-12,
            source="energy of the capacitor over the efficiency, counted once",
        ),
    ]


def _overlapping() -> list[Check]:
    """Two boosts that overlap while the converter works."""
    power, begins, time = 60.0, 15e-6, 60e-6
    bank = BoostCapacitor(capacitance=_C, voltage=_U, recharge_power=power, start_voltage=60.0)
    run = _run_shared((_driver(0.0, 1e-3), _driver(begins, 1e-3)), bank, duration=time)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        on = np.array([1.0, float(t > begins)])
        charging = power / y[2] if y[2] < _U else 0.0
        draws = -float(on @ y[:2]) + charging
        return np.array([*(on * (y[2] - _R * y[:2]) / _L), draws / _C])

    y = np.array([0.0, 0.0, 60.0])
    for a, b in ((0.0, begins), (begins, time)):
        y = solve_ivp(rate, (a, b), y, method="DOP853", rtol=1e-12, atol=1e-14, max_step=1e-6).y[
            :, -1
        ]
    source = "both coils, the capacitor and its converter integrated by SciPy (DOP853)"
    return [
        check(
            "overlapping boosts: current of the first coil [A]",
            expected=float(y[0]),
            computed=last(run, "m0 current"),
            tolerance=5e-6,
            source=source,
        ),
        check(
            "overlapping boosts: current of the second coil [A]",
            expected=float(y[1]),
            computed=last(run, "m1 current"),
            tolerance=5e-6,
            source=source,
        ),
        check(
            "overlapping boosts: voltage of the shared capacitor [V]",
            expected=float(y[2]),
            computed=last(run, "bank capacitor voltage"),
            tolerance=2e-6,
            source=source,
        ),
        check(
            "overlapping boosts: energy balance [-]",
            expected=0.0,
            computed=run.books.relative_residual,
            tolerance=1e-12,
            source="battery and converter = losses + magnets + capacitor",
        ),
    ]


def _alike() -> list[Check]:
    """Two equal drivers at 20 uF, against one at 10 uF; whole shots with switching."""
    shot = _driver(0.0, 0.4e-3, peak=8.0).model_copy(
        update={"diode_resistance": 0.02, "switch_resistance": 0.03}
    )
    both = _run_shared(
        (shot, shot),
        BoostCapacitor(capacitance=_C, voltage=_U, recharge_power=10.0),
        duration=0.8e-3,
    )
    alone = _run_shared(
        (
            shot.model_copy(
                update={"capacitance": 0.5 * _C, "boost_voltage": _U, "recharge_power": 5.0}
            ),
        ),
        None,
        duration=0.8e-3,
    )
    return [
        check(
            "two equal shots at one capacitor, largest difference from one at half of it [A]",
            expected=0.0,
            computed=float(
                np.max(
                    np.abs(both.channels["m1 current"].values - alone.channels["m0 current"].values)
                )
            ),
            tolerance=5e-10,
            source="by symmetry; the step of one coil behind an output stage",
        ),
        check(
            "shared capacitor after two equal shots [V]",
            expected=last(alone, "m0 capacitor voltage"),
            computed=last(both, "bank capacitor voltage"),
            tolerance=7e-11,
            source="that of one coil with half the capacitor",
        ),
    ]
