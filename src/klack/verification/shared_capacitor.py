r"""Checks of a boost capacitor that two drivers draw from.

A coil without iron at the capacitor is a damped oscillator; with :math:`q = C U`, the capacitor at
one coil, :math:`L\,\mathrm di/\mathrm dt = k U - R i`, :math:`C\,\mathrm dU/\mathrm dt = -k i`:
a matrix exponential for each stretch of time.
"""

from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from klack.magnetics.boost_capacitor import BoostCapacitor
from klack.magnetics.boost_driver import BoostDriver, Shot
from klack.magnetics.magnetic_network import MagneticNetwork
from klack.mechanics.prescribed_motion import PrescribedMotion
from klack.network.network import Network
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.verification.check import Check, compare

__all__ = ["shared_capacitor"]

Vector = NDArray[np.float64]

_check = partial(compare, "output-stage")
_MU0 = 4e-7 * np.pi
_TURNS, _LEAK, _AREA, _GAP, _RESIDUAL = 60.0, 20e-9, 30e-6, 100e-6, 50e-6
_L = _TURNS**2 * (_LEAK + _MU0 * _AREA / (_GAP + _RESIDUAL))
_R, _C, _U = 0.5, 20e-6, 65.0
_STEP = 1e-7


def shared_capacitor() -> list[Check]:
    """Return the checks of a shared capacitor."""
    return [*_in_sequence(), *_overlapping(), *_alike()]


def _magnet() -> MagneticNetwork:
    return MagneticNetwork.model_validate(
        {
            "resistance": _R,
            "gap": _GAP,
            "elements": {
                "coil": {"kind": "coil", "between": ["a", "b"], "turns": _TURNS},
                "leakage": {"kind": "leakage", "between": ["a", "b"], "permeance": _LEAK},
                "gap": {
                    "kind": "face",
                    "between": ["b", "a"],
                    "area": _AREA,
                    "residual_gap": _RESIDUAL,
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


def _run(
    drivers: tuple[BoostDriver, ...],
    capacitor: BoostCapacitor | None,
    *,
    duration: float,
    step: float = _STEP,
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
    network = Network(parts, joined)  # type: ignore[arg-type]
    return simulate_network(
        network.rows(), duration=duration, step=step, coarse=1, record=10.0 * step
    )


def _last(result: NetworkResult, name: str) -> float:
    return float(result.channels[name].values[-1])


def _boosted(start: float, time: float) -> float:
    """Capacitor [V] after one coil was at it for a time, and has returned its energy."""

    def matrix(k: float) -> Vector:
        return np.array([[-_R / _L, k / _L], [-k / _C, 0.0]])

    y = expm(matrix(1.0) * time) @ np.array([0.0, start])
    over = brentq(lambda t: (expm(matrix(-1.0) * t) @ y)[0], 1e-7, 0.25e-3, xtol=1e-18, rtol=1e-14)
    return float((expm(matrix(-1.0) * over) @ y)[1])


def _in_sequence() -> list[Check]:
    """Two discharges one after the other; and the recharge before and between them."""
    first, second, time = (0.0, 40e-6), (0.4e-3, 0.46e-3), 0.8e-3
    still = BoostCapacitor(capacitance=_C, voltage=_U, recharge_power=0.0)
    run = _run((_driver(*first), _driver(*second)), still, duration=time)
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
    late = _run((_driver(1.5e-3, 1.6e-3), _driver(1.5e-3, 1.6e-3)), low, duration=1.5e-3, step=1e-6)
    corner = power / current
    left = 1.5e-3 - _C * (corner - 10.0) / current
    charged = np.sqrt(corner**2 + 2.0 * power * left / _C)
    return [
        _check(
            "shared capacitor after the first of two discharges [V]",
            expected=after,
            computed=between,
            tolerance=1e-7,
            source="damped oscillator, there and back until the current ends",
        ),
        _check(
            "shared capacitor after the second discharge, at another coil [V]",
            expected=_boosted(after, 60e-6),
            computed=_last(run, "bank capacitor voltage"),
            tolerance=1e-7,
            source="damped oscillator, there and back until the current ends",
        ),
        _check(
            "heat of both coils of that sequence [J]",
            expected=0.5 * _C * (_U**2 - _boosted(after, 60e-6) ** 2),
            computed=run.books.losses["m0 ohmic"] + run.books.losses["m1 ohmic"],
            tolerance=2e-5,
            source="what the capacitor has lost; no converter",
        ),
        _check(
            "recharge of a shared capacitor, from 10 V, after 1.5 ms [V]",
            expected=float(charged),
            computed=_last(late, "bank capacitor voltage"),
            tolerance=5e-13,
            source="constant current, then constant power: U^2 = U_0^2 + 2 P t/C",
        ),
        _check(
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
    run = _run((_driver(0.0, 1e-3), _driver(begins, 1e-3)), bank, duration=time)

    def rate(t: float, y: Vector) -> Vector:
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
        _check(
            "overlapping boosts: current of the first coil [A]",
            expected=float(y[0]),
            computed=_last(run, "m0 current"),
            tolerance=5e-6,
            source=source,
        ),
        _check(
            "overlapping boosts: current of the second coil [A]",
            expected=float(y[1]),
            computed=_last(run, "m1 current"),
            tolerance=5e-6,
            source=source,
        ),
        _check(
            "overlapping boosts: voltage of the shared capacitor [V]",
            expected=float(y[2]),
            computed=_last(run, "bank capacitor voltage"),
            tolerance=2e-6,
            source=source,
        ),
        _check(
            "overlapping boosts: energy balance [-]",
            expected=0.0,
            computed=run.books.relative_residual,
            tolerance=1e-12,
            source="battery and converter = losses + magnets + capacitor",
        ),
    ]


def _alike() -> list[Check]:
    """Two equal drivers at 20 uF, against one at 10 uF of its own; whole shots with switching."""
    losses = {"diode_resistance": 0.02, "switch_resistance": 0.03}
    shot = _driver(0.0, 0.4e-3, peak=8.0).model_copy(update=losses)
    bank = BoostCapacitor(capacitance=_C, voltage=_U, recharge_power=10.0)
    both = _run((shot, shot), bank, duration=0.8e-3)
    own = {"capacitance": 0.5 * _C, "boost_voltage": _U, "recharge_power": 5.0}
    alone = _run((shot.model_copy(update=own),), None, duration=0.8e-3)
    apart = both.channels["m1 current"].values - alone.channels["m0 current"].values
    return [
        _check(
            "two equal shots at one capacitor, largest difference from one at half of it [A]",
            expected=0.0,
            computed=float(np.max(np.abs(apart))),
            tolerance=5e-10,
            source="by symmetry; the step of one coil behind an output stage",
        ),
        _check(
            "shared capacitor after two equal shots [V]",
            expected=_last(alone, "m0 capacitor voltage"),
            computed=_last(both, "bank capacitor voltage"),
            tolerance=7e-11,
            source="that of one coil with half the capacitor",
        ),
    ]
