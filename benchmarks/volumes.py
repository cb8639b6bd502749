"""Growth of the time loop with what is in it: volumes, stops, bodies, contact points, duration.

``uv run --group dev python benchmarks/run.py --only volumes``.  The valve is that of ``stroke.py``.
Beyond it up to 200 chambers of 50 mm^3 hang at its inlet in a row, in a ring, or each of them there
(star); its stop at the open end is shared out over so many, a row of masses and springs hangs at
its pole, or it opens so many times. Two spheres have contact points on so many rings. What is added
is the processor time of the loop less that without; an exponent of 1 is linear.
"""

from time import process_time

import numpy as np
from number import Number, Size, exponent
from stroke import COARSE, RECORD, STEP, valves

from klack.magnetics.pwm import PulseWidth
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.component import Component
from klack.network.network import Network
from klack.simulation.network_run import simulate_network
from klack.transient.interface_model import InterfaceContact
from klack.transient.interface_run import simulate_interface
from klack.verification.benches import component
from klack.verification.interface_bodies import reduce_bodies
from klack.verification.transient import hertz_impact, two_spheres

__all__ = ["joined", "numbers"]

_STRUCTURES = ("chain", "ring", "star", "stops", "bodies", "duration")
_COUNTS: dict[Size, tuple[int, ...]] = {
    "smallest": (2, 4),
    "quick": (5, 50, 200),
    "full": (1, 2, 5, 10, 20, 50, 100, 200),
}
_FEWER: dict[Size, tuple[int, ...]] = {
    "smallest": (2, 4),
    "quick": (2, 4, 8, 16),
    "full": (2, 4, 8, 16, 32),
}
"""Of what is dearer than a volume."""

_FIRST = 5  # volumes that the exponent is fitted from
_PRESSURE = 6.013e5  # [Pa]
_PERIOD = 5e-3  # [s]


def numbers(size: Size) -> list[Number]:
    """Time of the loop and around it over the number of each, with exponents of what is added.

    Beside each stands the energy residual.
    """
    duration, repeats = (50e-6, 1) if size == "smallest" else (2e-3, 3)
    found = []
    for structure in _STRUCTURES:
        volumes = structure in ("chain", "ring", "star")
        counts = _COUNTS[size] if volumes else _FEWER[size]
        found += _curve(structure, counts, duration, repeats)
    return found + _contact_points(_FEWER[size])


def _curve(structure: str, counts: tuple[int, ...], duration: float, repeats: int) -> list[Number]:
    """Times of one structure, and the exponent of what it adds."""
    long = structure == "duration"
    alone = 0.0 if long else _measure(joined(structure, 0), duration, repeats)[0]
    points, found = [], []
    for count in counts:
        length = duration * count * _PERIOD / 2e-3 if long else duration
        loop, around, residual = _measure(joined(structure, count), length, repeats)
        points.append((float(count), loop - alone))
        for what, seconds in (("loop", loop), ("layout, start and record", around)):
            found.append(
                Number(
                    name=f"volumes, {structure} of {count}: {what}",
                    value=seconds,
                    unit="s",
                    accuracy=residual,
                    accuracy_of="energy residual",
                    series=f"{structure}, {what}",
                    at=count,
                )
            )
    volumes = structure in ("chain", "ring", "star")
    fitted = [point for point in points if point[0] >= _FIRST or not volumes] or points
    slope = exponent(*(list(axis) for axis in zip(*fitted, strict=True)))
    name = f"volumes, {structure}: exponent of the time that they add to the loop"
    goal = 1.1 if volumes and len(counts) > 2 else None
    return [*found, Number(name=name, value=slope, unit="-", goal=goal)]


def _contact_points(rings: tuple[int, ...]) -> list[Number]:
    """Impact of two spheres at the level of contact points, 800 steps."""
    hertz = hertz_impact(2e-3, 2e-3, 0.2)
    found, points, times = [], [], []
    for count in rings:
        a, b, space = two_spheres(2e-3, 2e-3, size=hertz.radius / count)
        faces = InterfaceContact(name="face", upper="upper", lower="lower", space=space)
        model, _ = reduce_bodies((a, b), [faces], (12, 12))
        time, spent = hertz.contact_time, []
        for _ in range(6):
            begin = process_time()
            run = simulate_interface(model, speed=0.2, duration=time, step=time / 800, height=1e-9)
            spent.append(process_time() - begin)
        points.append(float(model.count))
        times.append(min(spent))
        found.append(
            Number(
                name=f"volumes, contact points {model.count}: loop",
                value=times[-1],
                unit="s",
                accuracy=abs(run.energy.residual),
                accuracy_of="energy residual",
                series="contact points, loop",
                at=model.count,
            )
        )
    slope = exponent(points, times)
    return [*found, Number(name="volumes, contact points: exponent", value=slope, unit="-")]


def joined(structure: str, count: int) -> Network:
    """The wet valve with so many more parts of one structure."""
    valve = valves()["wet"]
    parts: dict[str, Component] = dict(valve.components)
    joints = [list(joint) for joint in valve.connections]
    if structure == "stops":
        stop = parts["opening"]
        law = LinearStopLaw(kind="linear", stiffness=5e8 / (1 + count))
        parts["opening"] = stop.model_copy(update={"law": law})
        for k in range(count):
            parts[f"stop{k}"] = component("end-stop", gap=stop.gap, law=law)
            _at(joints, "opening.upper").append(f"stop{k}.upper")
            _at(joints, "opening.lower").append(f"stop{k}.lower")
    elif structure == "bodies":
        for k in range(count):
            parts[f"mass{k}"] = component("rigid-mass", mass=1e-4)
            parts[f"link{k}"] = component("spring", stiffness=1e4, preload=0.0)
            _at(joints, f"mass{k - 1}.body" if k else "pole.top").append(f"link{k}.base")
            joints.append([f"mass{k}.body", f"link{k}.end"])
    elif structure == "duration":
        parts["driver"] = PulseWidth(voltage=14.0, period=_PERIOD, duty=0.5)
    else:
        joints += _rooms(structure, count, parts, _at(joints, "inlet.fluid"))
    return Network(parts, joints, fluid=valve.fluid)


def _at(joints: list[list[str]], port: str) -> list[str]:
    return next(joint for joint in joints if port in joint)


def _rooms(
    structure: str, count: int, parts: dict[str, Component], inlet: list[str]
) -> list[list[str]]:
    """Joints of so many more chambers, each behind an orifice."""
    rooms = [inlet] + [[f"room{k}.fluid"] for k in range(count)]
    ways = [(0 if structure == "star" else k, k + 1) for k in range(count)]
    if structure == "ring" and count > 2:
        ways.append((count, 1))
    for k in range(count):
        parts[f"room{k}"] = component("chamber", volume=50e-9, pressure=_PRESSURE)
    for k, (a, b) in enumerate(ways):
        parts[f"way{k}"] = component("orifice", diameter=0.8e-3)
        rooms[a].append(f"way{k}.a")
        rooms[b].append(f"way{k}.b")
    return rooms[1:]


def _measure(network: Network, duration: float, repeats: int) -> tuple[float, float, float]:
    """Processor seconds of the loop and around it, energy residual; best of several.

    What a run of a thousandth of the time takes is around the loop.
    """
    whole, around, residual = np.inf, np.inf, 0.0
    for _ in range(repeats + 1):  # the first one may compile
        spent, _ = _run(network, 1e-3 * duration)
        around = min(around, spent)
        spent, residual = _run(network, duration)
        whole = min(whole, spent)
    return max(whole - around, 0.0), around, residual


def _run(network: Network, duration: float) -> tuple[float, float]:
    begin = process_time()
    run = simulate_network(
        network.rows(), duration=duration, step=STEP, coarse=COARSE, record=RECORD
    )
    return process_time() - begin, run.books.relative_residual
