"""A coil with a driver and an armature on a prescribed course: in the smallest set-up."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.compiling.jit import njit
from klack.errors import ConvergenceError
from klack.magnetics.circuit import MagneticCircuit
from klack.magnetics.driver import DriveProgram
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.flux_step import FAILURES, flux_numbers, flux_state, magnet_step
from klack.network.step_function import address_of, call, first

__all__ = ["CoilRun", "run_coil"]

Vector = NDArray[np.float64]
_FRONT = 8


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CoilRun:
    """A run of one coil.

    Parameters
    ----------
    time : array, shape (n + 1,) [s]
        Ends of the steps, from 0.
    current, flux : array, shape (n + 1,) [A], [Wb]
        At those ends; flux of the main branch (linkage of a map).
    voltage, force : array, shape (n,) [V], [N]
        Means over the steps; the force on the armature along +z.
    state : array, shape (n + 1,)
        Number of the driver's state.
    fluxes : array, shape (n + 1, loops) [Wb]
    electric, ohmic, eddy, hysteresis, work : float [J]
        Supply, losses, and work done on the armature.
    stored : array, shape (2,) [J]
        Magnetic energy before and after.
    most_stored : float [J]
        At the end of any step: it may have come and gone.
    """

    time: Vector
    current: Vector
    flux: Vector
    voltage: Vector
    force: Vector
    state: Vector
    fluxes: Vector
    electric: float
    ohmic: float
    eddy: float
    hysteresis: float
    work: float
    stored: Vector
    most_stored: float

    @property
    def residual(self) -> float:
        """Energy that does not balance, over the largest of the amounts [-]."""
        parts = [self.electric, -self.ohmic, -self.eddy, -self.work, self.stored[0]]
        parts += [-self.hysteresis, -self.stored[1]]
        largest = max(self.most_stored, *(abs(part) for part in parts))
        return abs(sum(parts)) / largest if largest else 0.0

    def switches(self) -> Vector:
        """Ends of the steps in which the driver changed its state [s]."""
        return self.time[1:][np.diff(self.state) != 0]


@njit
def _march(
    address: int, par: Vector, state: Vector, y: Vector, h: float, log: Vector, sums: Vector
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
    plant : MagneticCircuit or FluxMap
    driver : DriveProgram
    resistance : float [ohm]
    gap : float [m]
        At lift zero; the lift closes it.
    step : float [s]
    lift : array, shape (n + 1,) [m]
        At the ends of the steps; straight between.
    fluxes : array [Wb]
        Loop fluxes at the start.

    Raises
    ------
    ConvergenceError
        If a step fails.
    """
    y = np.array(lift, dtype=float)
    par = flux_numbers(plant, resistance=resistance, driver=driver, gap=gap)
    start = flux_state(par, fluxes)
    log, sums = np.zeros((y.size, 1 + start.size)), np.zeros(8)
    status = _march(address_of(magnet_step), par, np.append(start, 0.0), y, step, log, sums)
    if status != 0:
        raise ConvergenceError(f"coil: {FAILURES[status]}.")
    loops = 1 if isinstance(plant, FluxMap) else plant.loops.shape[1]
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
        stored=sums[4:6],
        most_stored=float(sums[6]),
    )
