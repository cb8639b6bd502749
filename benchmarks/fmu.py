"""FMU of the dry impact: time to build it, nanoseconds per step beside the kernel, deviation.

``python benchmarks/fmu.py``: two rods with 20 + 40 modes and one contact, as ``kernel.py``.  Times
of both are taken in turn, the best of many, through ``fmi2DoStep`` with communication steps of
1 us (the call from Python included) and of 20 us.
"""

import ctypes
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from kernel import two_rods

from klack.contact.laws import TableLaw
from klack.exchange.fmu.build import build_fmu
from klack.exchange.modal_model import ModalModel, Provenance, pair_model
from klack.simulation.impact import simulate
from klack.simulation.system import ReducedSystem

__all__ = ["FmuTimes", "fmu_times"]

STEP = 20e-9  # [s]
STEPS = 50 * 400
SPEED = 0.5  # [m/s]


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuTimes:
    """What was measured.

    Parameters
    ----------
    build : float [s]
        Sources, binary for this platform, description, documentation, zip.
    kernel, fmu, fmu_long : float [ns]
        Per step: klack's kernel, the FMU with communication steps of 1 us, and of 20 us.
    force : float [-]
        Largest deviation of the force history (means over 1 us) from the kernel's, over its peak.
    velocity : float [-]
        The same of the needle's velocity.
    """

    build: float
    kernel: float
    fmu: float
    fmu_long: float
    force: float
    velocity: float


def fmu_times(repeats: int = 40) -> FmuTimes:
    """Build the FMU and let it and the kernel compute 400 us with an impact."""
    d = np.linspace(0.0, 8e-6, 41)[1:]
    system = two_rods(TableLaw(d, 4e8 * d + 3e14 * d**2), gap=1e-6)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        builds = []
        for _ in range(3):
            begin = time.perf_counter()
            path = build_fmu(_model(system), folder / "rods.fmu", fmi=2)
            builds.append(time.perf_counter() - begin)
        unpacked = fmpy.extract(str(path), str(folder / "unpacked"))
        return _measured(system, unpacked, min(builds), repeats)


def _measured(system: ReducedSystem, unpacked: str, build: float, repeats: int) -> FmuTimes:
    described = fmpy.read_model_description(unpacked)
    references = {v.name: v.valueReference for v in described.modelVariables}
    fmu = FMU2Slave(guid=described.guid, unzipDirectory=unpacked, modelIdentifier="rods")
    fmu.instantiate()
    kernel, short, long = np.inf, np.inf, np.inf
    for _ in range(repeats):
        begin = time.perf_counter()
        record = simulate(
            system,
            velocities={"needle": -SPEED},
            step=STEP,
            duration=STEPS * STEP,
            steps_per_record=50,
        )
        kernel = min(kernel, time.perf_counter() - begin)
        short = min(short, _run_time(fmu, 50))
        long = min(long, _run_time(fmu, 1000))
    _restart(fmu)
    wanted = [references["mean_contact_force"], references["velocity"]]
    found = np.empty((STEPS // 50, 2))
    for i in range(len(found)):
        fmu.doStep(i * 50 * STEP, 50 * STEP)
        found[i] = fmu.getReal(wanted)
    force, velocity = record.force[:, 0], record.velocity[1:, 0]
    return FmuTimes(
        build=build,
        kernel=kernel / STEPS * 1e9,
        fmu=short / STEPS * 1e9,
        fmu_long=long / STEPS * 1e9,
        force=float(np.max(np.abs(found[:, 0] - force)) / force.max()),
        velocity=float(np.max(np.abs(found[:, 1] - velocity)) / SPEED),
    )


def _restart(fmu: FMU2Slave) -> None:
    fmu.reset()
    fmu.setupExperiment()
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()


def _run_time(fmu: FMU2Slave, per_step: int) -> float:
    """Time [s] of all steps, called with as little Python around them as there can be."""
    _restart(fmu)
    step = fmu.dll.fmi2DoStep
    step.argtypes = [ctypes.c_void_p, ctypes.c_double, ctypes.c_double, ctypes.c_int]
    span, component = per_step * STEP, fmu.component
    begin = time.perf_counter()
    for i in range(STEPS // per_step):
        step(component, i * span, span, 1)
    return time.perf_counter() - begin


def _model(system: ReducedSystem) -> ModalModel:
    return pair_model(
        "rods",
        system,
        moving="needle",
        contact_names=["seat"],
        speed=-SPEED,
        step=STEP,
        duration=STEPS * STEP,
        provenance=Provenance(
            case="rods", title="Two rods", version="1", created="2026-01-01T00:00:00"
        ),
    )


if __name__ == "__main__":
    times = fmu_times()
    print(f"built in {times.build:.2f} s (promised: 2 s)")
    print(f"kernel {times.kernel:.1f} ns per step, records of 1 us included")
    for words, value in (("1 us", times.fmu), ("20 us", times.fmu_long)):
        ratio = value / times.kernel
        print(f"FMU {value:.1f} ns with steps of {words}: {ratio:.2f} times (promised: 3)")
    print(f"deviation of force {times.force:.1e}, of velocity {times.velocity:.1e}")
