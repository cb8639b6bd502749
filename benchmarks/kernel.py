"""Nanoseconds per step of the reduced impact, beside its error: ``python benchmarks/kernel.py``.

Two rods with 20 + 40 modes and one contact.  *Flight* is free ringing, *contact* is a needle
pressed onto its seat so that the contact stays closed; a valve stroke lies near flight.  Best of
several runs.
"""

import time

import numpy as np
from number import Number, Size

from klack.contact.laws import ElasticLaw, LinearLaw, TableLaw
from klack.contact.restitution import measure_impact
from klack.simulation.bodies import rod_body
from klack.simulation.impact import simulate, simulate_impact
from klack.simulation.system import AxialForce, ContactPair, ReducedSystem

__all__ = ["error_at_20_ns", "kernel_ns_per_step", "numbers", "two_rods"]

STEEL = {"young": 2.1e11, "density": 7850.0}


def numbers(size: Size) -> list[Number]:
    """Speed in flight and in contact, and the error at the step that was timed."""
    repeats = {"smallest": 10, "quick": 30, "full": 60}[size]
    errors = error_at_20_ns()
    found = []
    for closed in (False, True):
        words = "contact" if closed else "flight"
        found.append(
            Number(
                name=f"kernel, 60 modes, {words}",
                value=kernel_ns_per_step(closed=closed, repeats=repeats),
                unit="ns/step",
                goal=50.0,
                accuracy=abs(errors["peak force"]),
                accuracy_of="peak force at 20 ns",
            )
        )
    goals = {"peak force": 1e-3, "contact time": 1e-3, "impulse": 1e-3, "energy residual": 1e-9}
    found += [
        Number(
            name=f"kernel, 20 ns against 1.25 ns, {key}", value=abs(errors[key]), unit="-", goal=g
        )
        for key, g in goals.items()
    ]
    return found


def two_rods(
    law: ElasticLaw,
    *,
    gap: float,
    damping: float = 0.0,
    press: float = 0.0,
    modes: tuple[int, int] = (20, 40),
) -> ReducedSystem:
    """Needle 40 x 4 mm (1 + 19 modes) above a rod 100 x 10 mm held at its bottom (40 modes)."""
    needle = rod_body(
        "needle",
        length=0.04,
        area=np.pi * 4e-6,
        elastic_modes=modes[0] - 1,
        damping=damping,
        **STEEL,
    )
    seat = rod_body(
        "seat",
        length=0.1,
        area=np.pi * 25e-6,
        elastic_modes=modes[1],
        support="bottom",
        damping=damping,
        **STEEL,
    )
    contact = ContactPair(
        body_a="needle", port_a="bottom", body_b="seat", port_b="top", law=law, gap=gap
    )
    return ReducedSystem(
        bodies=(needle, seat),
        contacts=(contact,),
        forces=(AxialForce(body="needle", force=-press),),
    )


def kernel_ns_per_step(
    *,
    closed: bool = False,
    table: bool = False,
    damping: float = 0.0,
    modes: tuple[int, int] = (20, 40),
    steps: int = 20_000,
    steps_per_record: int = 5,
    repeats: int = 60,
) -> float:
    """Best time per step [ns], records included.

    Slope between runs of ``steps`` and twice as many steps, each the best of many short ones: short
    enough to find an undisturbed moment on a shared machine, and set-up drops out.  Not a
    number where the machine was so busy that the slope is not above zero.

    Parameters
    ----------
    closed : bool
        Contact closed all the time, else open all the time.
    table : bool
        Table law instead of the linear one.
    damping : float [-]
    modes : pair of int
        Of needle (one of them rigid) and seat.
    steps, steps_per_record, repeats : int
    """
    d = np.linspace(0.0, 8e-6, 41)[1:]
    law = TableLaw(d, 4e8 * d + 3e14 * d**2) if table else LinearLaw(1e9)
    gap, press, speed = (0.0, 2000.0, 0.01) if closed else (1.0, 0.0, 0.5)
    system = two_rods(law, gap=gap, damping=damping, press=press, modes=modes)
    best = {steps: np.inf, 2 * steps: np.inf}
    for _ in range(repeats):
        for count in best:
            begin = time.perf_counter()
            simulate(
                system,
                velocities={"needle": -speed},
                step=20e-9,
                duration=count * 20e-9,
                steps_per_record=steps_per_record,
            )
            best[count] = min(best[count], time.perf_counter() - begin)
    slope = (best[2 * steps] - best[steps]) / steps * 1e9
    return slope if slope > 0.0 else float("nan")


def error_at_20_ns() -> dict[str, float]:
    """Deviation of the first impact at 20 ns from 1.25 ns, and the energy residual at 20 ns."""
    system = two_rods(LinearLaw(1e9), gap=1e-6)
    fine, coarse = (
        simulate_impact(system, speed=1.0, duration=100e-6, step=step) for step in (1.25e-9, 20e-9)
    )
    a, b = measure_impact(fine), measure_impact(coarse)
    return {
        "peak force": b.peak_force / a.peak_force - 1.0,
        "contact time": b.contact_time / a.contact_time - 1.0,
        "impulse": b.impulse / a.impulse - 1.0,
        "restitution (absolute)": b.restitution - a.restitution,
        "energy residual": coarse.ledger.residual,
    }


if __name__ == "__main__":
    for closed in (False, True):
        for table in (False, True) if closed else (False,):
            for damping in (0.0, 0.002):
                ns = kernel_ns_per_step(closed=closed, table=table, damping=damping)
                words = ("contact" if closed else "flight", "table" if table else "linear")
                print(f"{words[0]:8s} {words[1]:7s} damping {damping:5.3f}: {ns:6.1f} ns per step")
    for name, value in error_at_20_ns().items():
        print(f"{name:24s} {value:+.2e}")
