"""Coils behind an output stage: boost capacitor, converter, diodes, clamp, energy."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, exp, log, sqrt

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from klack.errors import ConvergenceError
from klack.magnetics.boost_driver import BoostDriver, Shot
from klack.magnetics.circuit import MagneticCircuit
from klack.magnetics.flux_step import STAGE_BOOKS, flux_numbers, flux_state, magnet_step
from klack.magnetics.peak_hold import PeakHold
from klack.magnetics.steady_coil import steady_fluxes
from klack.network.step_function import evaluate
from klack.verification.check import Check, check
from klack.verification.coils_in_networks import shared_capacitor
from klack.verification.drivers import injector, linear_coil, run_coil

__all__ = ["StageRun", "checks", "random_driver", "run_stage"]


_INDUCTANCE = 60.0**2 * (1.0 / 2e7 + 1.0 / 2e8)  # of linear_coil()
_RESISTANCE = 0.5
_GAP = 100e-6
_IDENTITY = "energy balance: supplies less losses less what is stored"
_RLC = "series circuit of R, L and C, closed form"


def checks() -> list[Check]:
    """Return all checks of output stages."""
    return [
        *_discharge(),
        *_recharge(),
        *_recuperation(),
        *_losses(),
        *_second_shot(),
        *_limits(),
        *_energy(),
        *shared_capacitor(),
    ]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StageRun:
    """A run of one coil behind a stage, its armature on a given course.

    Parameters
    ----------
    time (n + 1,) [s]
    current, capacitor (n + 1,) [A], [V]
    state, entered (n + 1,)
        Of the driver, and when it was entered [s].
    energies [J]
        Supplies, losses, changes of stores, and ``work``.
    """

    time: np.ndarray
    current: np.ndarray
    capacitor: np.ndarray
    state: np.ndarray
    entered: np.ndarray
    energies: dict[str, float]

    @property
    def residual(self) -> float:
        """Energy that does not balance, over the largest amount [-]."""
        signs = {"supply": 1.0, "loss": -1.0, "store": -1.0}
        total = sum(signs[book.kind] * self.energies[book.label] for book in STAGE_BOOKS)
        total -= self.energies["work"]
        return abs(total) / max(abs(value) for value in self.energies.values())

    def leaves(self, states: Sequence[int]) -> list[float]:
        """Times at which states were left, located within the steps [s]."""
        inside = np.isin(self.state, states)
        ends = np.flatnonzero(inside[:-1] & ~inside[1:]) + 1
        return [float(self.entered[k]) for k in ends]


def run_stage(
    plant: MagneticCircuit,
    driver: BoostDriver,
    *,
    resistance: float = _RESISTANCE,
    step: float,
    duration: float,
    lift: ArrayLike = 0.0,
    current: float = 0.0,
) -> StageRun:
    """Run a coil behind a stage; ``lift`` [m] at the ends of all steps, or constant."""
    steps = round(duration / step)
    y = np.broadcast_to(np.asarray(lift, dtype=float), (steps + 1,))
    par = flux_numbers(plant, resistance=resistance, driver=driver.program(), gap=_GAP)
    fluxes = plant.loop_turns * 0.0
    if current:
        fluxes = steady_fluxes(plant, current=current, gap=_GAP)
    state = flux_state(par, fluxes, (), current)
    size, books = state.size, len(STAGE_BOOKS)
    _, out = evaluate(magnet_step, par, state, [0.0, 0.0, y[0], y[0], 0.0, 0.0], 2 + size + books)
    before, sums, work = out[2 + size :].copy(), np.zeros(books), 0.0
    log_of = np.zeros((steps + 1, 4))
    log_of[0] = state[4], state[-2], state[0], state[1]
    for k in range(steps):
        status, out = evaluate(
            magnet_step, par, state, [k * step, step, y[k], y[k + 1], 0.0, 0.0], 2 + size + books
        )
        if status != 0:
            raise ConvergenceError(f"stage: status {status} at {k * step:g} s.")
        state = out[2 : 2 + size].copy()
        sums += out[2 + size :]
        work += float(out[0] * (y[k + 1] - y[k]))
        log_of[k + 1] = state[4], state[-2], state[0], state[1]
    last = out[2 + size :]
    energies = {
        book.label: float(last[i] - before[i] if book.kind == "store" else sums[i])
        for i, book in enumerate(STAGE_BOOKS)
    }
    return StageRun(
        time=np.asarray(step * np.arange(steps + 1), dtype=float),
        current=log_of[:, 0],
        capacitor=log_of[:, 1],
        state=log_of[:, 2],
        entered=log_of[:, 3],
        energies=energies | {"work": work},
    )


def random_driver(seed: int) -> BoostDriver:
    """Driver of a direct or common-rail injector, drawn from usual ranges."""
    draw = np.random.default_rng(seed).uniform
    first = draw(0.0, 50e-6)
    middle, pause = first + draw(0.2e-3, 0.6e-3), draw(5e-6, 0.3e-3)
    shots = (
        Shot(start=first, end=middle),
        Shot(start=middle + pause, end=middle + pause + draw(0.1e-3, 0.4e-3)),
    )
    return BoostDriver(
        battery=draw(8.0, 16.0),
        capacitance=10 ** draw(-5.3, -3.3),
        boost_voltage=draw(40.0, 90.0),
        start_voltage=draw(0.0, 90.0),
        recharge_power=draw(0.0, 60.0),
        recharge_current=draw(0.2, 2.0),
        efficiency=draw(0.6, 1.0),
        peak_current=draw(6.0, 20.0),
        peak_duration=draw(0.02e-3, 0.09e-3) if draw() < 0.5 else None,
        hold_current=draw(1.0, 4.0),
        hold_band=draw(0.3, 1.0),
        fall="decay" if draw() < 0.5 else "freewheel",
        decay="clamp" if draw() < 0.5 else "capacitor",
        clamp_voltage=draw(25.0, 60.0),
        clamp_resistance=draw(0.0, 0.3),
        diode_voltage=draw(0.3, 1.0),
        diode_resistance=draw(0.0, 0.05),
        switch_resistance=draw(0.0, 0.1),
        shots=shots,
    )


def _driver(**changes: object) -> BoostDriver:
    numbers: dict[str, object] = {
        "battery": 14.0,
        "capacitance": 20e-6,
        "boost_voltage": 65.0,
        "recharge_power": 0.0,
        "peak_current": 1e3,
        "hold_current": 3.0,
        "hold_band": 1.0,
        "shots": (Shot(start=0.0, end=5e-3),),
    }
    return BoostDriver.model_validate(numbers | changes)


@dataclass(frozen=True, slots=True)
class _Series:
    """R, L, C in series: L i' = u - still - R i, C u' = -i, from i0 and u0."""

    resistance: float
    capacitance: float
    i0: float
    u0: float
    still: float = 0.0
    sign: float = 1.0  # -1: the current charges the capacitor

    def at(self, time: ArrayLike) -> tuple[np.ndarray, np.ndarray]:
        """Current and capacitor voltage; underdamped."""
        t = np.asarray(time, dtype=float)
        decay, omega, b = self._numbers()
        current = np.exp(-decay * t) * (self.i0 * np.cos(omega * t) + b * np.sin(omega * t))
        # L i' = sign u - still - R i
        rate = np.exp(-decay * t) * (
            (b * omega - decay * self.i0) * np.cos(omega * t)
            - (self.i0 * omega + decay * b) * np.sin(omega * t)
        )
        voltage = _INDUCTANCE * rate + self.resistance * current + self.still
        return current, self.sign * voltage

    def zero(self) -> float:
        """First time at which the current is zero, i0 above it."""
        _, omega, b = self._numbers()
        return atan2(self.i0, -b) / omega

    def _numbers(self) -> tuple[float, float, float]:
        """Decay and angular frequency [1/s], amplitude of the sine [A]."""
        decay = self.resistance / (2.0 * _INDUCTANCE)
        omega = sqrt(1.0 / (_INDUCTANCE * self.capacitance) - decay * decay)
        drive = self.sign * self.u0 - self.still
        slope = (drive - self.resistance * self.i0) / _INDUCTANCE
        return decay, omega, (slope + decay * self.i0) / omega


def _discharge() -> list[Check]:
    circuit = _Series(_RESISTANCE + 0.1, 20e-6, 0.0, 65.0)
    driver = _driver(switch_resistance=0.05)
    errors = []
    for step in (1e-6, 0.5e-6, 0.2e-6, 0.05e-6):
        run = run_stage(linear_coil(), driver, step=step, duration=80e-6)
        current, voltage = circuit.at(run.time)
        errors.append(float(np.max(np.abs(run.current - current))))
    falls = float(np.max(np.abs(run.capacitor - voltage)))
    peaked = run_stage(
        linear_coil(), _driver(switch_resistance=0.05, peak_current=12.0), step=1e-6, duration=80e-6
    )
    rise = float(brentq(lambda t: float(circuit.at(t)[0]) - 12.0, 1e-6, 80e-6, xtol=1e-16))
    run = run_stage(linear_coil(), driver, step=0.2e-6, duration=0.4e-3)
    empty = float(brentq(lambda t: float(circuit.at(t)[1]) - 13.3, 1e-6, 120e-6, xtol=1e-16))
    total = _RESISTANCE + 0.1
    settled = 13.3 / total
    later = settled + (float(circuit.at(empty)[0]) - settled) * exp(
        -(0.4e-3 - empty) * total / _INDUCTANCE
    )
    return [
        check(
            "capacitor discharged into a coil, largest error of the current in 0.5 us steps "
            "over its largest [-]", 0.0, errors[1] / float(np.max(current)), 5e-6,
            source=_RLC,
        ),
        check(
            "the same, largest error of the capacitor voltage over that at the start [-]",
            0.0, falls / 65.0, 1e-6, source=_RLC,
        ),
        check(
            "the same, order of the error in the step [-]", 2.0,
            log(errors[2] / errors[3], 4.0), 5e-2, source="trapezoidal rule: second order",
        ),
        check(
            "the same, time at which the boost ends at 12 A [s]", rise,
            peaked.leaves([1])[0], 1e-5, source=_RLC,
        ),
        check(
            "the same, capacitor voltage left at 12 A [V]", float(circuit.at(rise)[1]),
            float(peaked.capacitor[-1]), 1e-5, source=_RLC,
        ),
        check(
            "capacitor falls to the battery, time at which that takes over [s]", empty,
            run.leaves([1])[0], 1e-6, source=_RLC,
        ),
        check(
            "the same, current from the battery after 0.4 ms [A]", later,
            float(run.current[-1]), 1e-6, source="R and L at 14 V less a diode, closed form",
        ),
    ]  # fmt: skip


def _recharge() -> list[Check]:
    late = (Shot(start=50e-3, end=51e-3),)
    power = _driver(start_voltage=30.0, recharge_power=12.0, capacitance=200e-6, shots=late)
    run = run_stage(linear_coil(), power, step=50e-6, duration=20e-3)
    limited = _driver(
        start_voltage=10.0, recharge_power=12.0, recharge_current=0.3, capacitance=200e-6,
        efficiency=0.8, shots=late,
    )  # fmt: skip
    slow = run_stage(linear_coil(), limited, step=50e-6, duration=25e-3)
    level = 12.0 / 0.3
    first = 200e-6 * (level - 10.0) / 0.3
    full = run_stage(linear_coil(), limited, step=50e-6, duration=45e-3)
    held = 0.5 * 200e-6 * (65.0**2 - 10.0**2)
    return [
        check(
            "recharge at constant power, capacitor voltage after 20 ms [V]",
            sqrt(30.0**2 + 2.0 * 12.0 * 20e-3 / 200e-6), float(run.capacitor[-1]), 3e-14,
            source="C U dU/dt = P: U = sqrt(U0^2 + 2 P t/C)",
        ),
        check(
            "recharge at constant current up to 40 V, then at constant power: 25 ms [V]",
            sqrt(level**2 + 2.0 * 12.0 * (25e-3 - first) / 200e-6), float(slow.capacitor[-1]),
            1e-13, source="U = U0 + I t/C, then U = sqrt(U1^2 + 2 P t/C)",
        ),
        check(
            "energy from the battery for a full recharge at 80 % [J]", held / 0.8,
            full.energies["battery"], 1e-13, source="C (U1^2 - U0^2)/2 over the efficiency",
        ),
    ]  # fmt: skip


def _recuperation() -> list[Check]:
    driver = _driver(
        capacitance=50e-6, diode_voltage=0.8, diode_resistance=0.04,
        shots=(Shot(start=40e-3, end=41e-3),),
    )  # fmt: skip
    run = run_stage(linear_coil(), driver, step=0.5e-6, duration=60e-6, current=8.0)
    circuit = _Series(_RESISTANCE + 0.08, 50e-6, 8.0, 65.0, still=1.6, sign=-1.0)
    voltage = float(circuit.at(circuit.zero())[1])
    return [
        check(
            "coil of 8 A back into the capacitor, its voltage then [V]", voltage,
            float(run.capacitor[-1]), 1e-6, source=_RLC + ", with two diodes",
        ),
        check(
            "the same, energy taken back [J]", 25e-6 * (voltage**2 - 65.0**2),
            run.energies["capacitor"], 1e-5, source=_RLC + ", with two diodes",
        ),
    ]  # fmt: skip


def _losses() -> list[Check]:
    driver = _driver(
        decay="clamp", clamp_voltage=40.0, clamp_resistance=0.5, diode_voltage=0.7,
        diode_resistance=0.1, shots=(Shot(start=40e-3, end=41e-3),),
    )  # fmt: skip
    run = run_stage(linear_coil(), driver, step=0.2e-6, duration=80e-6, current=8.0)
    total, still = _RESISTANCE + 0.6, 40.7
    end, charge, square = _decay(8.0, still, total)
    return [
        check(
            "coil of 8 A into a clamp of 40 V, energy lost in the clamp [J]",
            40.0 * charge + 0.5 * square, run.energies["clamp"], 1e-5,
            source="i = (i0 + u/R) exp(-R t/L) - u/R, integrals of i and i^2",
        ),
        check(
            "the same, energy lost in the diode [J]", 0.7 * charge + 0.1 * square,
            run.energies["diodes"], 1e-5, source="the same integrals",
        ),
        check(
            "the same, without current after so many steps of 0.2 us", np.ceil(end / 0.2e-6),
            float(np.argmax(run.current == 0.0)), 0.0, source="t = (L/R) ln(1 + R i0/u)",
        ),
    ]  # fmt: skip


def _decay(current: float, still: float, resistance: float) -> tuple[float, float, float]:
    """Time, charge and squared integral of a current that falls to zero against a voltage."""
    rate, level = resistance / _INDUCTANCE, still / resistance
    end = log(1.0 + current / level) / rate
    a, x = current + level, exp(-rate * end)
    square = a * a * (1.0 - x * x) / (2.0 * rate) - 2.0 * a * level * (1.0 - x) / rate
    return end, a * (1.0 - x) / rate - level * end, square + level * level * end


def _second_shot() -> list[Check]:
    power, capacitance, pause = 10.0, 20e-6, 0.3e-3
    second = 0.15e-3 + pause
    driver = _driver(
        capacitance=capacitance, recharge_power=power, peak_current=10.0, decay="clamp",
        clamp_voltage=50.0,
        shots=(Shot(start=0.0, end=0.15e-3), Shot(start=second, end=second + 0.15e-3)),
    )  # fmt: skip
    run = run_stage(linear_coil(), driver, step=0.2e-6, duration=0.7e-3)
    ends = run.leaves([1, 7])
    early = run_stage(
        linear_coil(), driver.model_copy(update={"recharge_power": 0.0}), step=0.2e-6,
        duration=0.7e-3,
    )  # fmt: skip
    first = _Series(_RESISTANCE, capacitance, 0.0, 65.0)
    rise = float(brentq(lambda t: float(first.at(t)[0]) - 10.0, 1e-6, 60e-6, xtol=1e-16))
    again = _Series(_RESISTANCE, capacitance, 0.0, float(first.at(rise)[1]))
    slow = float(brentq(lambda t: float(again.at(t)[0]) - 10.0, 1e-6, 90e-6, xtol=1e-16))
    late = early.leaves([1, 7])
    quick, kept = _boost_recharged(65.0, 10.0, power, capacitance)
    charged = sqrt(kept**2 + 2.0 * power * (second - quick) / capacitance)
    again_quick, _ = _boost_recharged(charged, 10.0, power, capacitance)
    return [
        check(
            "second shot without recharge, its delay to 10 A behind that of the first [s]",
            slow - rise, (late[1] - second) - late[0], 1e-5,
            source=_RLC + ", from the voltage left",
        ),
        check(
            "recharged at 10 W, capacitor voltage at the second shot [V]", charged,
            float(run.capacitor[round(second / 0.2e-6)]), 1e-5,
            source="R, L, C and P/U in SciPy (DOP853), then U = sqrt(U0^2 + 2 P t/C)",
        ),
        check(
            "the same, delay of the second shot to 10 A behind that of the first [s]",
            again_quick - quick, (ends[1] - second) - ends[0], 1e-4,
            source="R, L, C and P/U in SciPy (DOP853)",
        ),
    ]  # fmt: skip


def _boost_recharged(
    voltage: float, current: float, power: float, capacitance: float
) -> tuple[float, float]:
    """Time to a current, and the capacitor [V] then, while recharged; by SciPy."""
    # at its nominal voltage the converter gives what the coil takes, until that is all it can
    begin, first = 0.0, 0.0
    if voltage == 65.0:
        first = power / voltage
        begin = -log(1.0 - _RESISTANCE * first / voltage) * _INDUCTANCE / _RESISTANCE

    def rates(_: float, y: np.ndarray) -> list[float]:
        return [(y[1] - _RESISTANCE * y[0]) / _INDUCTANCE, (power / y[1] - y[0]) / capacitance]

    def reached(_: float, y: np.ndarray) -> float:
        return float(y[0]) - current

    reached.terminal = True  # type: ignore[attr-defined]
    found = solve_ivp(rates, (begin, 1e-3), [first, voltage], "DOP853", events=reached,
                      rtol=1e-12, atol=1e-12)  # fmt: skip
    return float(found.t[-1]), float(found.y[1, -1])


def _limits() -> list[Check]:
    huge = _driver(
        capacitance=1e3, peak_current=10.0, peak_duration=0.3e-3, diode_voltage=0.7,
        shots=(Shot(start=10e-6, end=0.8e-3),),
    )  # fmt: skip
    ideal = PeakHold(
        boost_voltage=65.0, peak_current=10.0, supply_voltage=13.3, hold_current=3.0, hold_band=1.0,
        peak_until=0.31e-3, start=10e-6, end=0.8e-3, freewheel=0.7, decay=66.4,
    )  # fmt: skip
    steps = 1000
    run = run_stage(injector(), huge, step=1e-6, duration=steps * 1e-6)
    other = run_coil(
        injector(), ideal.program(), resistance=_RESISTANCE, gap=_GAP, step=1e-6,
        lift=np.zeros(steps + 1),
    )  # fmt: skip
    return [
        check(
            "capacitor of 1000 F against peak-hold, largest difference of the current [A]",
            0.0, float(np.max(np.abs(run.current - other.current))), 5e-4,
            source="ideal sources of the same voltages: the other step function",
            reason="both cut the same steps at their bends but for round-off; steps of 1 us err by "
            "5e-3 A, and those of 0.1 us differ by 6e-6 A",
        ),
    ]  # fmt: skip


def _energy() -> list[Check]:
    step, duration = 1e-6, 1.6e-3
    time = step * np.arange(round(duration / step) + 1)
    lift = 60e-6 * np.clip((time - 0.2e-3) / 0.15e-3, 0.0, 1.0)
    lift -= 60e-6 * np.clip((time - 1.2e-3) / 0.2e-3, 0.0, 1.0)
    worst = least = 0.0
    for seed in range(12):
        run = run_stage(
            injector() if seed % 3 else linear_coil(),
            random_driver(seed),
            step=step,
            duration=duration,
            lift=lift,
        )
        worst = max(worst, run.residual)
        least = min(least, *(run.energies[b.label] for b in STAGE_BOOKS if b.kind == "loss"))
    return [
        check(
            "12 random stages with moving armatures: largest energy residual [-]", 0.0,
            worst, 1e-11, source=_IDENTITY,
        ),
        check(
            "the same, least of all losses [J]", 0.0, least, 1e-15,
            source="second law: no loss may be negative",
        ),
    ]  # fmt: skip
