"""Others on the same reduced model: solve_ivp of scipy, CVODE of SUNDIALS, an FMU under FMPy.

Two rods with 20 + 40 modes fall together (:func:`kernel.two_rods`); the equations for the others
are written here without klack, from the textbook modes of rods, with a compiled right-hand side.
Each takes its best method and the loosest tolerance whose state at the end is as exact as klack's
at 20 ns; the reference is DOP853 at 1e-12.  No program is given the time of contact.  The FMU is
klack's own export, called by ``fmpy.simulate_fmu`` with outputs every 1 us.  Processor time, one
thread each.
"""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from math import pi, sqrt
from pathlib import Path
from time import process_time

import numpy as np
from kernel import STEEL, two_rods
from numba import njit
from number import Number, Size
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from sksundae.cvode import CVODE
from threadpoolctl import threadpool_limits

from klack.contact.laws import LinearLaw
from klack.simulation.impact import simulate

__all__ = ["Model", "numbers"]

Vector = NDArray[np.float64]

_STIFFNESS, _GAP, _SPEED, _STEP = 1e9, 1e-6, 1.0, 20e-9
_RODS = ((0.04, pi * 4e-6), (0.1, pi * 25e-6))  # length [m], area [m^2] of needle and seat
_TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
_TIMINGS = 3
_OUTPUT = 1e-6


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """Both rods as one set of modes.

    Parameters
    ----------
    omega : array, shape (m,) [rad/s]
    row : array, shape (m,) [1/sqrt(kg)]
        Change of the gap by each modal coordinate.
    start : array, shape (2 m,)
        Coordinates and velocities at the start.
    duration : float [s]
    """

    omega: Vector
    row: Vector
    start: Vector
    duration: float

    def distance(self, one: Vector, other: Vector) -> float:
        """Difference of two states in the norm of their energy, over that of the other."""
        m = self.omega.size
        weight = np.concatenate([self.omega, np.ones(m)])
        return float(np.linalg.norm(weight * (one - other)) / np.linalg.norm(weight * other))


def model(modes: tuple[int, int], duration: float) -> Model:
    """Textbook modes: the needle free, the seat held at its far end."""
    c = sqrt(STEEL["young"] / STEEL["density"])
    (a, b) = _RODS
    mass_a, mass_b = (STEEL["density"] * length * area for length, area in _RODS)
    n, k = np.arange(modes[0]), np.arange(modes[1]) + 0.5
    needle = np.where(n == 0, 1.0, sqrt(2.0)) / sqrt(mass_a)
    seat = sqrt(2.0 / mass_b) * np.sin(pi * k)
    start = np.zeros(2 * sum(modes))
    start[sum(modes)] = -_SPEED * sqrt(mass_a)
    return Model(
        omega=np.concatenate([n * pi * c / a[0], k * pi * c / b[0]]),
        row=np.concatenate([needle, -seat]),
        start=start,
        duration=duration,
    )


@njit(cache=True)
def _slopes(y: Vector, omega: Vector, row: Vector, out: Vector) -> None:
    m = omega.size
    gap = _GAP
    for i in range(m):
        gap += row[i] * y[i]
    force = _STIFFNESS * max(-gap, 0.0)
    for i in range(m):
        out[i] = y[m + i]
        out[m + i] = row[i] * force - omega[i] * omega[i] * y[i]


def numbers(size: Size) -> list[Number]:
    """Times of all at equal accuracy, and their ratios to klack."""
    choices: dict[Size, tuple[tuple[int, int], ...]] = {
        "smallest": ((3, 5),),
        "quick": ((20, 40),),
        "full": ((20, 40), (60, 100)),
    }
    duration = 20e-6 if size == "smallest" else 100e-6
    found = []
    # small matrices gain nothing from several threads, and processor times need one
    with threadpool_limits(limits=1):
        for modes in choices[size]:
            found += _one_model(modes, duration, fmu=size != "smallest" and modes == (20, 40))
    return found


def _one_model(modes: tuple[int, int], duration: float, *, fmu: bool) -> list[Number]:
    equations = model(modes, duration)
    exact = _scipy(equations, "DOP853", 1e-12)
    system = two_rods(LinearLaw(_STIFFNESS), gap=_GAP, modes=modes)

    def klack() -> Vector:
        record = simulate(
            system,
            velocities={"needle": -_SPEED},
            step=_STEP,
            duration=duration,
            steps_per_record=round(_OUTPUT / _STEP),
        )
        return np.concatenate([*record.final_position, *record.final_velocity])

    error = equations.distance(klack(), exact)
    ours = _best(klack, 20)
    label = f"{sum(modes)} modes, {duration * 1e6:.0f} us"
    found = [
        Number(
            name=f"{label}: klack at 20 ns",
            value=1e3 * ours,
            unit="ms",
            accuracy=error,
            accuracy_of="state",
        )
    ]
    for program, methods in _programs(equations).items():
        name, seconds, reached = _as_exact(methods, equations, exact, error)
        found += _peer(f"{label}: {program}", seconds, ours, reached, of=f"{name}, state")
    if fmu:
        seconds, reached = _fmpy(system, duration)
        found += _peer(
            f"{label}: FMPy with klack's FMU", seconds, ours, reached, of="force to klack"
        )
    return found


def _peer(name: str, seconds: float, ours: float, error: float, *, of: str) -> list[Number]:
    return [
        Number(name=name, value=1e3 * seconds, unit="ms", accuracy=error, accuracy_of=of),
        Number(
            name=f"{name} over klack",
            value=seconds / ours,
            unit="-",
            accuracy=error,
            accuracy_of=of,
            series="ratio",
        ),
    ]


def _programs(equations: Model) -> dict[str, dict[str, Callable[[float], Vector]]]:
    """Every method of every program, as a function of its tolerance."""

    def scipy(method: str) -> Callable[[float], Vector]:
        return lambda rtol: _scipy(equations, method, rtol)

    def cvode(method: str) -> Callable[[float], Vector]:
        return lambda rtol: _cvode(equations, method, rtol)

    return {
        "solve_ivp": {method: scipy(method) for method in ("RK45", "DOP853", "LSODA")},
        "CVODE": {method: cvode(method) for method in ("Adams", "BDF")},
    }


def _as_exact(
    methods: dict[str, Callable[[float], Vector]], equations: Model, exact: Vector, error: float
) -> tuple[str, float, float]:
    """Method, seconds and error of the fastest way that is as exact as ``error``.

    Without one, of the most exact way.
    """
    ways = []
    for name, run in methods.items():
        for rtol in _TOLERANCES:
            reached = equations.distance(run(rtol), exact)
            if reached <= error or rtol == _TOLERANCES[-1]:
                seconds = _best(lambda run=run, rtol=rtol: run(rtol), _TIMINGS)
                ways.append((f"{name} {rtol:.0e}", seconds, reached))
                break
    enough = [way for way in ways if way[2] <= error]
    return min(enough, key=lambda way: way[1]) if enough else min(ways, key=lambda way: way[2])


def _tolerances(equations: Model, rtol: float) -> Vector:
    """Absolute tolerances: the share ``rtol`` of what a mode holds of the energy at most."""
    speed = abs(equations.start).max()
    return rtol * speed / np.concatenate([equations.omega + 1e4, np.ones(equations.omega.size)])


def _scipy(equations: Model, method: str, rtol: float) -> Vector:
    def slopes(t: float, y: Vector) -> Vector:
        out = np.empty_like(y)
        _slopes(y, equations.omega, equations.row, out)
        return out

    solution = solve_ivp(
        slopes,
        (0.0, equations.duration),
        equations.start,
        method=method,
        rtol=rtol,
        atol=_tolerances(equations, rtol),
        t_eval=[equations.duration],
    )
    if not solution.success:
        raise RuntimeError(f"solve_ivp, {method}: {solution.message}")
    return solution.y[:, -1]


def _cvode(equations: Model, method: str, rtol: float) -> Vector:
    def slopes(t: float, y: Vector, out: Vector) -> None:
        _slopes(y, equations.omega, equations.row, out)

    solver = CVODE(
        slopes,
        method=method,
        rtol=rtol,
        atol=_tolerances(equations, rtol),
        max_num_steps=1_000_000,
    )
    solution = solver.solve(np.array([0.0, 0.5, 1.0]) * equations.duration, equations.start)
    if not solution.success:
        raise RuntimeError(f"CVODE, {method}: {solution.message}")
    return solution.y[-1]


def _best(run: Callable[[], object], repeats: int) -> float:
    run()
    best = np.inf
    for _ in range(repeats):
        begin = process_time()
        run()
        best = min(best, process_time() - begin)
    return best


def _fmpy(system: object, duration: float) -> tuple[float, float]:
    """Seconds of a run under FMPy, unzipped and loaded before, and its deviation from klack."""
    import fmpy

    from klack.exchange.fmu.build import build_fmu
    from klack.exchange.modal_model import Provenance, pair_model

    source = Provenance(case="rods", title="Two rods", version="1", created="2026-01-01T00:00:00")
    described = pair_model(
        "rods",
        system,
        moving="needle",
        contact_names=["seat"],
        speed=-_SPEED,
        step=_STEP,
        duration=duration,
        provenance=source,
    )
    record = simulate(
        system,
        velocities={"needle": -_SPEED},
        step=_STEP,
        duration=duration,
        steps_per_record=round(_OUTPUT / _STEP),
    )
    with tempfile.TemporaryDirectory() as name:
        path = build_fmu(described, Path(name) / "rods.fmu", fmi=2)
        folder = fmpy.extract(str(path), str(Path(name) / "unpacked"))
        description = fmpy.read_model_description(folder)
        instance = fmpy.instantiate_fmu(folder, description, fmi_type="CoSimulation")

        def run() -> NDArray[np.void]:
            instance.reset()
            return fmpy.simulate_fmu(
                folder,
                model_description=description,
                fmu_instance=instance,
                stop_time=duration,
                output_interval=_OUTPUT,
                output=["mean_contact_force"],
            )

        seconds = _best(run, 5)
        force = run()["mean_contact_force"][1:]
    count = min(len(force), len(record.force))
    off = np.abs(force[:count] - record.force[:count, 0]).max() / record.force.max()
    return seconds, float(off)
