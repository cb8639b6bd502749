"""The machine below a valve, from its keys: what it is at the mounts, and where its ears are."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from klack.acoustics.coupling import (
    Coupled,
    Junction,
    Missing,
    Placement,
    axes_of,
    joined,
    junction,
)
from klack.acoustics.interface import (
    DIRECTIONS,
    Freedom,
    InterfacePoint,
    Receiver,
    SourceAtMounts,
    freedoms_of,
)
from klack.acoustics.isolator import Isolator, MeasuredIsolator, Spring
from klack.acoustics.plate import Air, Plate
from klack.acoustics.receivers.measured import (
    HeardReceiver,
    MeasuredReceiver,
    VirtualPoint,
    heard_receiver,
    measured_receiver,
)
from klack.acoustics.receivers.modal import grounded, matrix_receiver, rigid_receiver
from klack.acoustics.receivers.opening import read_responses
from klack.acoustics.receivers.plates import InfinitePlate, PlateSound, finite_plate
from klack.acoustics.receivers.tables import read_isolator
from klack.arrays import Matrix
from klack.bodies.model_files.reduced_models import read_reduced_matrices
from klack.bodies.reduction.structure import Structure
from klack.case.bodies import CaseMaterial
from klack.case.machine import NoiseMatrices, NoiseReceiver, NoiseVirtualPoint
from klack.case.noise import CaseNoise
from klack.errors import InputError, refuse_if
from klack.input.problem import one_of
from klack.materials.material import Material
from klack.units import format_si

__all__ = ["Machine", "check_machine", "machine_of", "mounted"]

HIGHEST = 24e3
"""[Hz] to which models are known: sound files end there."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Machine:
    """What stands below the valve, ready to couple.

    Parameters
    ----------
    receiver
        With the indicators of a virtual test as points of their own.
    words
        What it is, and the elements between.
    known [Hz]
        Measured range and distance of lines; None of a model.
    causal
        Whether all laws hold beside the axis of frequency.
    """

    receiver: Receiver
    placements: Mapping[str, Placement]
    isolators: Mapping[str, Isolator]
    missing: Mapping[str, Missing]
    words: tuple[str, str]
    known: tuple[float, float, float] | None
    causal: bool

    def junction(self, source: SourceAtMounts) -> Junction:
        """Put a source on it."""
        return junction(
            source,
            self.receiver,
            placements=self.placements,
            isolators=self.isolators,
            missing=self.missing,
        )

    def coupled(self, source: SourceAtMounts) -> Coupled:
        """Both as they vibrate together."""
        return joined(self.junction(source), source, self.receiver.ears)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was done to measured responses."""
        return self.receiver.notes if isinstance(self.receiver, MeasuredReceiver) else ()


def machine_of(
    noise: CaseNoise,
    materials: Mapping[str, CaseMaterial],
    points: tuple[InterfacePoint, ...],
) -> Machine:
    """Open files and make models; ``points`` are the mounts in the drawing.

    Raises
    ------
    InputError
        For files that cannot be used, and for mounts that are not there.
    """
    given = noise.receiver
    assert given is not None
    pairs = given.axes if isinstance(given.axes, dict) else {p.name: given.axes for p in points}
    turned = {name: axes_of(*pair) for name, pair in pairs.items()}
    zero = np.zeros(3)
    placements = {
        point.name: Placement(
            axes=turned.get(point.name, np.eye(3)),
            offset=np.asarray(given.offset.get(point.name, zero), dtype=float),
        )
        for point in points
    }
    isolators = _isolators(noise)
    if given.file is not None:
        receiver, words = _measured(noise, given, points)
    else:
        receiver, words = _model(noise, given, materials, _in_frame(points, turned))
    if given.pressures is not None and given.file is None:
        pressures = read_responses(given.pressures)
        receiver = heard_receiver(receiver, pressures, _nodes(noise.ears), nodes=_own(given))
    known = [
        (float(item.frequency[0]), float(item.frequency[-1]), float(np.diff(item.frequency).min()))
        for item in (receiver, *isolators.values())
        if isinstance(item, MeasuredReceiver | HeardReceiver | MeasuredIsolator)
    ]
    lossy = any(isinstance(item, Spring) and item.loss_factor > 0.0 for item in isolators.values())
    return Machine(
        receiver=receiver,
        placements=placements,
        isolators=isolators,
        missing=given.missing,
        words=(words, _between(noise)),
        known=(max(k[0] for k in known), min(k[1] for k in known), known[0][2]) if known else None,
        causal=not known and not lossy,
    )


def check_machine(noise: CaseNoise | None, materials: Mapping[str, CaseMaterial]) -> None:
    """Reject a machine that cannot be coupled before anything else is computed.

    Its mounts are taken to have six freedoms each, at places that stand apart.
    """
    if noise is None or noise.receiver is None:
        return
    names = list(noise.mounts or {})
    points = tuple(
        InterfacePoint(name=name, position=np.array([float(i), 0.0, 0.0]))
        for i, name in enumerate(names)
    )
    given = noise.receiver
    if given.plate is not None:  # their places on it are not known yet
        plain = given.model_copy(update={"plate": None, "infinite_plate": given.plate})
        noise = noise.model_copy(update={"receiver": plain, "indicators": None, "ears": None})
    freedoms = tuple(freedom for name in names for freedom in freedoms_of(name))
    one = np.eye(len(freedoms), dtype=complex)[None]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        machine = machine_of(noise, materials, points)
        low, high, _ = machine.known or (100.0, 100.0, 1.0)
        source = SourceAtMounts(
            frequency=np.array([0.5 * (low + high)]),
            points=points,
            freedoms=freedoms,
            free_velocity=one[:, 0],
            blocked_force=one[:, 0],
            mobility=one,
        )
        machine.junction(source)


def mounted(structures: Sequence[Structure], noise: CaseNoise, case: str) -> tuple[Structure, ...]:
    """Structures at mounts, of all held bodies; rejects what nothing but the mounts joins."""
    found = tuple(item for item in structures if item.at_mounts)
    without = [item.name for item in structures if not item.at_mounts]
    if without or not found:
        raise InputError(
            f"result of case {case}: noise.mounts",
            got=f"no mount of {one_of(without)}" if found else "no bodies at mounts in the result",
            expected="every held body at a mount, because all of them carry forces",
            hint="list the surfaces that move together: "
            "mounts: {flange: {surface: [housing.rim, pole.rim]}}."
            if found
            else "run the case again with these mounts, then klack noise.",
        )
    refuse_if(
        any(set(item.at_mounts[0].port_names) - set(item.port_names) for item in found),
        f"result of case {case}: noise.mounts",
        got="bodies of an earlier version, without the positions of reactions",
        expected="bodies with these positions",
        hint="run the case again, then klack noise.",
    )
    joined = {found[0].name}
    mounts = {item.name: set(item.at_mounts[0].mounts) for item in found}
    for _ in found:
        reached = {mount for name in joined for mount in mounts[name]}
        joined |= {name for name, own in mounts.items() if own & reached}
    apart = [name for name in mounts if name not in joined]
    known = {mount for own in mounts.values() for mount in own}
    missing = [name for name in noise.mounts or {} if name not in known]
    if apart or missing:
        raise InputError(
            f"case {case}: noise.mounts",
            got=f"{one_of(apart)} and {found[0].name}, which share no mount"
            if apart
            else f"the mount '{missing[0]}', which is not in the result",
            expected="one vibrating body: held bodies that share a mount",
            hint="list both surfaces in one mount, if they are stiffly joined there: surface: "
            "[housing.rim, pole.rim]."
            if apart
            else "run the case again, then klack noise.",
        )
    return found


def _isolators(noise: CaseNoise) -> dict[str, Isolator]:
    number = {"x": 1, "y": 2, "z": 3}
    found: dict[str, Isolator] = {}
    for name, element in (noise.elements or {}).items():
        if element.file is not None:
            found[name] = read_isolator(element.file)
        else:
            found[name] = Spring(
                values={number[key]: k for key, k in (element.stiffness or {}).items()},
                loss_factor=element.loss_factor,
                damping={number[key]: c for key, c in (element.damping or {}).items()},
            )
    return found


def _nodes(named: Mapping[str, object] | None) -> dict[str, str]:
    return {name: str(node) for name, node in (named or {}).items()}


def _own(given: NoiseReceiver) -> dict[str, str]:
    return _nodes({k: v for k, v in given.points.items() if not isinstance(v, NoiseVirtualPoint)})


def _measured(
    noise: CaseNoise, given: NoiseReceiver, points: tuple[InterfacePoint, ...]
) -> tuple[Receiver, str]:
    assert given.file is not None
    responses = read_responses(given.file, quantity=given.quantity)
    where: dict[str, str | int | VirtualPoint] = {}
    for point in points:
        place = given.points.get(point.name, point.name)
        if isinstance(place, NoiseVirtualPoint):
            where[point.name] = VirtualPoint(
                position=np.array(place.position),
                nodes=place.nodes,
                freedoms=place.freedoms,
                positions={key: np.array(value) for key, value in place.positions.items()},
            )
        else:
            where[point.name] = place
    receiver = measured_receiver(
        responses,
        where,
        ears=_nodes(noise.ears),
        pressures=None if given.pressures is None else read_responses(given.pressures),
        indicators=_nodes(noise.indicators),
    )
    f = receiver.frequency
    return receiver, (
        f"measured responses of {given.file.name}, {f.size} lines from "
        f"{format_si(float(f[0]), 'Hz')} to {format_si(float(f[-1]), 'Hz')}"
    )


def _in_frame(
    points: tuple[InterfacePoint, ...], turned: Mapping[str, Matrix]
) -> tuple[InterfacePoint, ...]:
    """The mounts in the frame of a model."""
    return tuple(
        InterfacePoint(name=point.name, position=point.position @ turned[point.name])
        for point in points
    )


def _model(
    noise: CaseNoise,
    given: NoiseReceiver,
    materials: Mapping[str, CaseMaterial],
    points: tuple[InterfacePoint, ...],
) -> tuple[Receiver, str]:
    first = points[0].position
    points += tuple(
        InterfacePoint(name=name, position=first + np.array(place, dtype=float))
        for name, place in (noise.indicators or {}).items()
    )
    if given.springs is not None:
        stiffness = {"xyz".index(key) + 1: k for key, k in given.springs.items()}
        words = ", ".join(f"{format_si(k, 'N/m')} along {key}" for key, k in given.springs.items())
        return grounded(stiffness, points), f"springs to the ground, {words}"
    if given.matrices is not None:
        return _of_matrices(given.matrices, points)
    if given.body is not None:
        body = given.body
        found = rigid_receiver(body.mass, body.inertia, np.array(body.centre), points)
        return found, f"a free rigid body of {format_si(1e3 * body.mass, 'g')}"
    return _plate(noise, given, materials, points)


def _of_matrices(given: NoiseMatrices, points: tuple[InterfacePoint, ...]) -> tuple[Receiver, str]:
    """By all modes; translations of the file have its length, rotations are radians."""
    held = read_reduced_matrices(given.file)
    size, scale = len(held.K), []
    rows: dict[Freedom, int] = {}
    for name, wanted in given.rows.items():
        mount, _, direction = name.partition(".")
        place = held.names.index(wanted) if wanted in held.names else wanted
        if not isinstance(place, int) or (isinstance(wanted, int) and not 1 <= wanted <= size):
            raise InputError(
                f"noise.receiver.matrices.rows.{name}",
                got=f"the row {wanted!r}",
                expected=f"a number from 1 to {size}"
                + (f", or one of: {one_of(held.names)}" if held.names else ""),
                hint="name a row of the file.",
            )
        row = place - 1 if isinstance(wanted, int) else place
        refuse_if(
            row in rows.values(),
            f"noise.receiver.matrices.rows.{name}",
            got=f"the row {wanted!r}, which belongs to another degree of freedom",
            expected="a separate row for each degree of freedom",
            hint="name the row of this motion, or leave it out and state its assumption in "
            "receiver.missing.",
        )
        freedom = Freedom(mount, DIRECTIONS.index(direction) + 1)
        rows[freedom] = row
        scale.append(1.0 if freedom.is_rotation else given.units.length)
    energy = given.units.length**2
    found = matrix_receiver(
        held.K * (given.units.stiffness * energy),
        held.M * (given.units.mass * energy),
        rows,
        points,
        damping=given.damping,
    )
    kept = replace(found, shapes=found.shapes * scale)
    return kept, f"reduced matrices of {given.file.name}, {size} rows"


def _plate(
    noise: CaseNoise,
    given: NoiseReceiver,
    materials: Mapping[str, CaseMaterial],
    points: tuple[InterfacePoint, ...],
) -> tuple[Receiver, str]:
    drawn = given.is_plate
    assert drawn is not None
    refuse_if(
        drawn.material not in materials,
        "noise.receiver: material",
        got=f"'{drawn.material}'",
        expected=f"one of the materials of the case: {', '.join(materials)}",
        hint="add it to 'materials'.",
    )
    own = materials[drawn.material]
    sides = given.plate.sides if given.plate is not None else (1.0, 1.0)
    plate = Plate(
        thickness=drawn.thickness,
        area=sides[0] * sides[1],
        material=Material(
            name=drawn.material, young=own.young, poisson=own.poisson, density=own.density
        ),
        loss_factor=given.plate.loss_factor if given.plate is not None else 0.01,
    )
    ears = {name: np.array(p) for name, p in (noise.ears or {}).items() if isinstance(p, tuple)}
    air = Air(density=noise.air_density, sound_speed=noise.sound_speed)
    sound = PlateSound(places=ears, air=air) if ears else None
    words = f"{format_si(drawn.thickness, 'm')} of {drawn.material}"
    if given.plate is None:
        infinite = InfinitePlate(plate=plate, points=points, radius=drawn.foot_radius, sound=sound)
        return infinite, f"an infinite plate, {words}"
    moved = np.array([*given.plate.at, 0.0]) - points[0].position
    placed = [InterfacePoint(name=p.name, position=p.position + moved) for p in points]
    finite = finite_plate(
        plate, sides, placed, highest=HIGHEST, radius=drawn.foot_radius, sound=sound
    )
    return finite, (
        f"a supported plate of {sides[0]:.4g} x {sides[1]:.4g} m, {words}, loss factor "
        f"{100 * plate.loss_factor:.3g} %"
    )


def _between(noise: CaseNoise) -> str:
    words = []
    for name, element in (noise.elements or {}).items():
        if element.file is not None:
            words.append(f"{name}: {element.file.name}")
            continue
        parts = [f"{format_si(k, 'N/m')} along {d}" for d, k in (element.stiffness or {}).items()]
        parts += [f"{format_si(c, 'N s/m')} along {d}" for d, c in (element.damping or {}).items()]
        if element.loss_factor:
            parts.append(f"loss factor {100 * element.loss_factor:.3g} %")
        words.append(f"{name}: {', '.join(parts)}")
    return "; ".join(words)
