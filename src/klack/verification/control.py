"""Controllers in the time loop against recursions that are exact for sampled and held outputs."""

from collections.abc import Iterator, Mapping
from functools import partial
from math import exp, sqrt
from typing import ClassVar

import numpy as np

from klack.control.hysteresis import HysteresisController
from klack.control.pid import PidController, Setpoint
from klack.control.sensor import Sensor
from klack.control.state_machine import MachineState, StateMachine, Transition
from klack.magnetics.controlled_voltage import ControlledVoltage
from klack.magnetics.driver import driver_of
from klack.magnetics.flux_step import flux_rows
from klack.mechanics.controlled_force import ControlledForce
from klack.network.component import Component
from klack.network.port import COIL, Port
from klack.network.rows import GROUND, Rows
from klack.simulation.network_result import NetworkResult
from klack.verification.benches import component, run_network
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.drivers import linear_coil

__all__ = ["checks"]

MASS, SAMPLE = 3e-3, 20e-6  # [kg], [s]
RECURSION = "recursion of the sampled plant with a held output, exact, coded independently"

_RESISTANCE = 1.5
_INDUCTANCE = 60.0**2 * (1.0 / 2e7 + 1.0 / 2e8)  # of the coil of klack.verification.drivers


class _Coil(Component):
    """Coil of constant inductance without an armature."""

    type: ClassVar[str] = "linear-coil"
    ports: ClassVar[Mapping[str, Port]] = {"terminals": COIL}

    def add_rows(self, rows: Rows) -> None:
        flux_rows(
            rows,
            linear_coil(),
            resistance=_RESISTANCE,
            driver=driver_of(rows),
            gap=100e-6,
            armature=GROUND,
            base=GROUND,
        )


def checks() -> list[Check]:
    """Return the checks."""
    return [
        *_current(),
        *_hysteresis(),
        *_position(),
        *_machine(),
        *_sensors(),
        *_in_parts(),
    ]


def _driven(driver: ControlledVoltage, duration: float) -> NetworkResult:
    return run_network(
        {
            "mass": component("rigid-mass", mass=1.0),
            "spring": component("spring", stiffness=1.0, preload=0.0),
            "coil": _Coil(),
            "driver": driver,
        },
        [["mass.body", "spring.end"], ["coil.terminals", "driver.terminals"]],
        duration=duration,
        step=100e-9,
        coarse=None,
        record=SAMPLE,
    )


def _moved(force: ControlledForce, duration: float) -> NetworkResult:
    return run_network(
        {"mass": component("rigid-mass", mass=MASS), "force": force},
        [["mass.body", "force.end"]],
        duration=duration,
        step=100e-9,
        coarse=None,
        record=SAMPLE,
    )


def _curve(time: np.ndarray, known: np.ndarray, found: np.ndarray, label: str) -> ComparedCurve:
    return ComparedCurve(
        x_label="time [ms]",
        y_label=label,
        expected=(time * 1e3, known),
        computed=(time * 1e3, found),
    )


_CURRENT = Sensor(channel="coil current", unit="A")


def _current() -> list[Check]:
    tau = _INDUCTANCE / _RESISTANCE
    decay = exp(-SAMPLE / tau)
    gain = 0.3 * decay * _RESISTANCE / (1.0 - decay)  # pole 0.7 of the closed loop
    law = PidController(
        kind="pid",
        sensor="i",
        setpoint=2.0,
        gain=gain,
        integral_time=SAMPLE * decay / (1.0 - decay),  # its zero on the pole of the coil
        lower=-200.0,
        upper=200.0,
    )
    driver = ControlledVoltage(
        sample_time=SAMPLE, diode=False, sensors={"i": _CURRENT}, controller=law
    )
    run = _driven(driver, 1e-3)
    found = run.channels["coil current"].values
    known = np.array(2.0 * (1.0 - 0.7 ** np.arange(len(found))), dtype=float)
    late = _CURRENT.model_copy(update={"delay": 3.0 * SAMPLE})
    slow = PidController(kind="pid", sensor="i", setpoint=2.0, gain=2.5, lower=-100.0, upper=100.0)
    delayed = _driven(driver.model_copy(update={"sensors": {"i": late}, "controller": slow}), 3e-3)
    current = delayed.channels["coil current"].values
    own = [0.0]
    for k in range(len(current) - 1):
        voltage = 2.5 * (2.0 - own[max(k - 3, 0)])
        own.append(own[-1] * decay + voltage / _RESISTANCE * (1.0 - decay))
    balanced = [abs(each.books.relative_residual) for each in (run, delayed)]
    return [
        check(
            "PI control of a current, step response after 5 samples [A]",
            float(known[5]),
            float(found[5]),
            1e-5,
            "zero of the controller on the pole of the coil: 1 - 0.7^k",
            _curve(run.time, known, found, "current [A]"),
        ),
        check(
            "PI control of a current, largest error of 50 samples over the setpoint [-]",
            0.0,
            float(np.abs(found - known).max() / 2.0),
            1e-5,
            "zero of the controller on the pole of the coil: 1 - 0.7^k",
        ),
        check(
            "the same with a sensor 3 samples late, peak current [A]",
            max(own),
            float(current.max()),
            1e-5,
            RECURSION,
            _curve(delayed.time, np.array(own), current, "current [A]"),
        ),
        check("the same, current after 3 ms [A]", own[-1], float(current[-1]), 5e-13, RECURSION),
        check(
            "energy residual of the controlled coil over throughput [-]",
            0.0,
            max(balanced),
            5e-14,
            "energy balance",
        ),
    ]


def _hysteresis() -> list[Check]:
    law = HysteresisController(
        kind="hysteresis", sensor="i", lower=1.8, upper=2.2, low=14.0, high=0.0
    )
    driver = ControlledVoltage(sample_time=SAMPLE, sensors={"i": _CURRENT}, controller=law)
    run = _driven(driver, 4e-3)
    found = run.channels["coil current"].values
    decay, voltage, own = exp(-SAMPLE * _RESISTANCE / _INDUCTANCE), 14.0, [0.0]
    for _ in range(len(found) - 1):
        voltage = 0.0 if own[-1] >= 2.2 else 14.0 if own[-1] <= 1.8 else voltage
        own.append(own[-1] * decay + voltage / _RESISTANCE * (1.0 - decay))
    fallen = _driven(
        ControlledVoltage(sample_time=SAMPLE).by(lambda t, s: 14.0 if t < 4e-4 else -60.0), 2e-3
    )
    return [
        check(
            "hysteresis control of a current, mean over 4 ms [A]",
            float(np.mean(own)),
            float(np.mean(found)),
            1e-6,
            RECURSION,
            _curve(run.time, np.array(own), found, "current [A]"),
        ),
        check(
            "hysteresis control of a current, largest overshoot of the band [A]",
            max(own) - 2.2,
            float(found.max()) - 2.2,
            1e-5,
            RECURSION,
        ),
        check(
            "half bridge at -60 V, lowest current [A]",
            0.0,
            float(fallen.channels["coil current"].values.min()),
            1e-13,
            "a diode: none below zero",
        ),
    ]


def _position() -> Iterator[Check]:
    lift = Sensor(channel="mass.body displacement", unit="um")
    shifted = Setpoint(time=(0.0, 1e-3, 1e-3), value=(0.0, 20.0, 80.0))
    for name, keys, tolerance in (
        ("PID control of a displacement", {"upper": 40.0}, 1e-13),
        ("the same at its limits", {"upper": 1.0}, 1e-13),
        ("the same without anti-windup", {"upper": 1.0, "anti_windup": False}, 1e-13),
    ):
        upper = float(keys["upper"])
        law = PidController(
            kind="pid",
            sensor="lift",
            setpoint=shifted,
            gain=0.05,
            integral_time=1e-3,
            derivative_time=0.5e-3,
            derivative_filter=30e-6,
            lower=-upper,
            upper=upper,
            anti_windup=bool(keys.get("anti_windup", True)),
        )
        force = ControlledForce(sample_time=SAMPLE, sensors={"lift": lift}, controller=law)
        run = _moved(force, 8e-3)
        found = run.channels["mass.body displacement"].values * 1e6
        own = _pid_motion(upper, bool(keys.get("anti_windup", True)), len(found))
        yield check(
            f"{name}, largest displacement [um]",
            float(own.max()),
            float(found.max()),
            tolerance,
            RECURSION,
            _curve(run.time, own, found, "displacement [um]"),
        )
        yield check(
            f"{name}, displacement after 8 ms [um]",
            float(own[-1]),
            float(found[-1]),
            tolerance,
            RECURSION,
        )


def _pid_motion(most: float, waits: bool, count: int) -> np.ndarray:
    """Controlled mass [um] at the samples, from the equations of the page."""
    place, speed, integral, slope, before = 0.0, 0.0, 0.0, 0.0, 0.0
    out = [0.0]
    for k in range(count - 1):
        t = k * SAMPLE
        wanted = 80.0 if t >= 1e-3 - 1e-12 else 20.0 * t / 1e-3
        y = place * 1e6
        e = wanted - y
        slope += (SAMPLE / (30e-6 + SAMPLE)) * (-0.05 * 0.5e-3 * (y - before) / SAMPLE - slope)
        before = y
        more = 0.05 * SAMPLE / 1e-3 * e
        free = 0.05 * e + integral + more + slope
        held = min(max(free, -most), most)
        if not (waits and (free - held) * more > 0.0):
            integral += more
        place += speed * SAMPLE + 0.5 * held / MASS * SAMPLE**2
        speed += held / MASS * SAMPLE
        out.append(place * 1e6)
    return np.array(out)


def _machine() -> list[Check]:
    n, force = 25, 6.0
    way = force / MASS * (n * SAMPLE) ** 2  # half of it in each direction of the force
    half = 0.5 * way * 1e6
    left = 2e-3 - 2 * n * SAMPLE  # with 1 N again, from rest
    place = way + 0.5 / MASS * left**2
    lift = Sensor(channel="mass.body displacement", unit="um")
    machine = StateMachine(
        kind="state-machine",
        states=(
            MachineState(
                name="push",
                output=force,
                transitions=(Transition(to="brake", sensor="lift", above=half * (1 - 1e-6)),),
            ),
            MachineState(
                name="brake",
                output=-force,
                transitions=(Transition(to="leave", after=n * SAMPLE),),
            ),
            MachineState(name="leave", output=1.0),
        ),
    )
    run = _moved(
        ControlledForce(sample_time=SAMPLE, sensors={"lift": lift}, controller=machine), 2e-3
    )

    def bang(time: float, signals: Mapping[str, float]) -> float:
        steps = round(time / SAMPLE)
        return force if steps < n else -force if steps < 2 * n else 1.0

    by_user = _moved(ControlledForce(sample_time=SAMPLE).by(bang), 2e-3)
    truth = "constant accelerations, closed form"
    return [
        check(
            "state machine, displacement of a mass pushed, braked and pushed [m]",
            place,
            float(run.channels["mass.body displacement"].values[-1]),
            1e-12,
            truth,
        ),
        check(
            "state machine, speed of the mass after it [m/s]",
            left / MASS,
            float(run.channels["mass velocity"].values[-1]),
            5e-13,
            truth,
        ),
        check(
            "a function of the user, the same displacement [m]",
            place,
            float(by_user.channels["mass.body displacement"].values[-1]),
            1e-12,
            truth,
        ),
    ]


def _sensors() -> list[Check]:
    time = SAMPLE * np.arange(20_000)
    noisy = Sensor(channel="x", unit="um", noise=0.3, seed=4).begin()
    signals = np.array([noisy(t, 5.0) for t in time])
    steps = Sensor(channel="x", unit="um", quantisation=0.25).begin()
    ramp = np.linspace(0.0, 1000.0, len(time)) + 0.0371
    error = np.array([steps(t, x) for t, x in zip(time, ramp, strict=True)]) - ramp
    late = Sensor(channel="x", unit="um", delay=7.4 * SAMPLE).begin()
    lag = np.array([late(t, 3e4 * t) for t in time[:200]])
    return [
        check(
            "noise of a sensor, standard deviation of 20 000 samples [um]",
            0.3,
            float(signals.std()),
            0.02,
            "normal distribution",
            reason="four standard deviations of the estimate are 2 %",
        ),
        check(
            "quantisation of a sensor, rms error along a ramp [um]",
            0.25 / sqrt(12.0),
            float(np.sqrt(np.mean(error**2))),
            1e-3,
            "uniform distribution, q/sqrt(12)",
        ),
        check(
            "sensor 7.4 samples late, signal of a ramp after 3 ms [um]",
            3e4 * (150 - 7.4) * SAMPLE,
            float(lag[150]),
            1e-13,
            "shifted ramp",
        ),
    ]


def _in_parts() -> list[Check]:
    """A run stored and continued, with a late, noisy sensor and a law with memory."""
    sensor = Sensor(
        channel="mass.body displacement", unit="um", delay=2.3 * SAMPLE, noise=0.4, seed=5,
        quantisation=0.1,
    )  # fmt: skip
    law = PidController(
        kind="pid", sensor="lift", setpoint=60.0, gain=0.05, integral_time=0.2e-3,
        derivative_time=SAMPLE, derivative_filter=SAMPLE, lower=-20.0, upper=20.0,
    )  # fmt: skip
    parts = {
        "mass": component("rigid-mass", mass=MASS),
        "spring": component("spring", stiffness=1e4, preload=0.0),
        "force": ControlledForce(sample_time=SAMPLE, sensors={"lift": sensor}, controller=law),
    }
    run = partial(
        run_network,
        parts,
        [["mass.body", "force.end", "spring.end"]],
        step=100e-9,
        coarse=None,
        record=SAMPLE,
    )
    first = run(duration=25 * SAMPLE)
    second = run(duration=35 * SAMPLE, state=first.state)
    name = "mass.body displacement"
    joined = np.concatenate((first.channels[name].values, second.channels[name].values[1:]))
    differ = np.count_nonzero(joined != run(duration=60 * SAMPLE).channels[name].values)
    return [
        check(
            "run with a PID controller stored and continued, numbers that differ",
            0.0,
            float(differ),
            0.0,
            "determinism: the memory of controller and sensor is complete",
        ),
    ]
