"""Growth of the kernel with the number of modes: nanoseconds per step of 10 to 640 modes."""

from kernel import kernel_ns_per_step, two_rods
from number import Number, Size, exponent

from klack.contact.laws import LinearLaw
from klack.simulation.impact import simulate_impact

__all__ = ["numbers"]

_COUNTS: dict[Size, tuple[int, ...]] = {
    "smallest": (10, 20),
    "quick": (10, 40, 160, 640),
    "full": (10, 20, 40, 80, 160, 320, 640),
}


def numbers(size: Size) -> list[Number]:
    """One point per number of modes, a third of them in the needle; the exponent of the upper end.

    Beside each stands the energy residual of an impact with that many modes.
    """
    counts = _COUNTS[size]
    repeats = 10 if size == "smallest" else 20
    found = []
    for closed in (False, True):
        words = "contact" if closed else "flight"
        times = []
        for count in counts:
            split = (count // 3, count - count // 3)
            ns = kernel_ns_per_step(
                closed=closed, modes=split, repeats=repeats, steps=max(2000, 400_000 // count)
            )
            times.append(ns)
            found.append(
                Number(
                    name=f"kernel, {count} modes, {words}",
                    value=ns,
                    unit="ns/step",
                    accuracy=_energy_residual(split),
                    accuracy_of="energy residual",
                    series=f"kernel in {words}",
                    at=count,
                )
            )
        found.append(
            Number(
                name=f"kernel, per mode at {counts[-1]} modes, {words}",
                value=(times[-1] - times[-2]) / (counts[-1] - counts[-2]),
                unit="ns",
            )
        )
        found.append(
            Number(
                name=f"kernel, exponent of {counts[-2]} to {counts[-1]} modes, {words}",
                value=exponent(list(counts[-2:]), times[-2:]),
                unit="-",
            )
        )
    return found


def _energy_residual(modes: tuple[int, int]) -> float:
    system = two_rods(LinearLaw(1e9), gap=1e-6, modes=modes)
    return abs(simulate_impact(system, speed=1.0, duration=100e-6, step=20e-9).ledger.residual)
