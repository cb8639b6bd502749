"""A rigid needle and a rigid armature on it, each with six freedoms and a guide of its own.

Nothing but arrays: rings of springs between needle and seat (``seat``), between the collar of the
needle and the armature below it (``driver``), and between the armature and its stop (``stop``).
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from spatial_needle import ring

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.contact.gap_update import Pairing
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Rows
from klack.transient.interface_arrays import Guide
from klack.transient.interface_model import InterfaceModel, MovingBody
from klack.transient.spatial_run import SpatialValve
from klack.verification.interface_bodies import lateral_guide, modal_model

MASSES = np.array([3e-3, 2e-3])
INERTIAS = np.array([[2.4e-7, 2.3e-7, 6e-9], [3e-8, 3.2e-8, 5e-8]])
APART = 4e-3  # [m] centre of mass of the armature above that of the needle
SEAT, COLLAR, TOP = -8e-3, 6e-3, 3e-3  # [m] heights: seat and collar of the needle, armature
STIFFNESS = 2e7  # [N/m] of each point
LIFT, FREE = 40e-6, 25e-6  # [m] gap of the stop, and of the driver: the free travel
COUNT = 6
PAIRS = (
    Pairing(0, -1, np.zeros(3)),
    Pairing(0, 1, np.array([0.0, 0.0, -APART])),
    Pairing(1, -1, np.zeros(3), is_upper=False),
)


def _rigid(number: int) -> np.ndarray:
    rigid = np.zeros((6, 12))
    scale = np.concatenate([np.full(3, MASSES[number]), INERTIAS[number]]) ** -0.5
    rigid[:, 6 * number : 6 * number + 6] = np.diag(scale)
    return rigid


RIGID = (_rigid(0), _rigid(1))


def along(number: int, arms: np.ndarray) -> np.ndarray:
    """Displacement of points of a body along z."""
    R = RIGID[number]
    return R[2] + np.outer(arms[:, 1], R[3]) - np.outer(arms[:, 0], R[4])


def model(apart: float = 0.0, turn: float = 0.1) -> InterfaceModel:
    """Contact points of the three stops, the needle ``apart`` [m] from its seat."""
    seat = ring(COUNT, 0.9e-3, SEAT, turn)
    driver = ring(COUNT, 2e-3, COLLAR, 2 * turn)
    stop = ring(COUNT, 3e-3, APART + TOP, 3 * turn)
    below = np.array([0.0, 0.0, APART])
    traces = np.vstack(
        [along(0, seat), along(0, driver) - along(1, driver - below), -along(1, stop - below)]
    )
    made = modal_model(
        masses=MASSES,
        omega=np.zeros(12),
        traces=traces,
        compliance=np.eye(3 * COUNT) / STIFFNESS,
        gap=np.repeat([apart, FREE, LIFT], COUNT),
        axial=np.repeat([1.0, 1.0, -1.0], COUNT),
        contacts=tuple(
            (name, k * COUNT, (k + 1) * COUNT) for k, name in enumerate(("seat", "driver", "stop"))
        ),
        points=np.vstack([seat, driver, stop]),
        rigid=RIGID[0],
        owner=np.repeat([0, 1], 6),
    )
    return replace(
        made,
        drift=np.array([R[2] for R in RIGID]),
        others=(MovingBody(number=1, rigid=RIGID[1], centre=np.array([0.0, 0.0, APART])),),
    )


def reduced(number: int, arms: Mapping[str, tuple[float, float, float]]) -> ReducedBody:
    """As the network has it."""
    return ReducedBody(
        name=("needle", "armature")[number],
        mass=MASSES[number],
        omega=np.zeros(6),
        damping=np.zeros(6),
        port_names=tuple(arms),
        port_shapes=along(number, np.array(list(arms.values())))[:, 6 * number : 6 * number + 6].T,
        observer_names=(),
        observer_shapes=np.zeros((6, 0)),
        static_compliance=np.zeros((len(arms),) * 2),
        rigid_count=6,
        rigid_axial=np.sqrt(MASSES[number]) * np.eye(6)[2],
        dof_count=6,
    )


def rows(
    joints: Mapping[str, Component],
    *,
    speeds: tuple[float, float] = (0.0, 0.0),
    apart: float = 0.0,
    film: Mapping[str, object] | None = None,
    arms: tuple[float, float] = (0.0, 0.0),
) -> Rows:
    """Network of both bodies; ``joints`` at needle.top and armature.pole, which lie off-axis."""
    parts: dict[str, Component] = {
        "needle": FlexibleBody.of(
            reduced(0, {"tip": (0, 0, SEAT), "collar": (0, 0, COLLAR), "top": (arms[0], 0, 8e-3)}),
            speed=speeds[0],
        ),
        "armature": FlexibleBody.of(
            reduced(
                1, {"face": (0, 0, COLLAR - APART), "land": (0, 0, TOP), "pole": (arms[1], 0, 0)}
            ),
            speed=speeds[1],
        ),
    }
    law = {"kind": "linear", "stiffness": COUNT * STIFFNESS}
    for name, gap in (("seat", apart), ("driver", FREE), ("stop", LIFT)):
        parts[name] = EndStop(gap=gap, law=law, **(film or {}))
    links = [
        ["needle.tip", "seat.upper"],
        ["seat.lower", "ground"],
        ["needle.collar", "driver.upper"],
        ["armature.face", "driver.lower"],
        ["armature.land", "stop.lower"],
        ["stop.upper", "ground"],
    ]
    for port, part in joints.items():
        name = f"at_{port.replace('.', '_')}"
        parts[name] = part
        link = next((link for link in links if port in link), None)
        if link is None:
            links.append([port, f"{name}.end"])
        else:
            link.append(f"{name}.end")
    return Network(parts, links).rows()


def bores(of: InterfaceModel, **more: object) -> Guide:
    """Two heights of fixed bores for each body, 4 um of clearance."""
    found = []
    for body, heights in zip(of.moving, ((-3e-3, 5e-3), (-2e-3, 2.5e-3)), strict=True):
        given = {"clearance": 4e-6, "stiffness": 3e7, "heights": heights, "radius": 1.5e-3}
        offset = [(0.0, 0.0)] * len(heights)
        moved = replace(of, rigid=body.rigid)
        made = lateral_guide(moved, **(given | {"offset": offset} | more))
        found.append(made._replace(heights=made.heights + body.centre[2]))
    return Guide(*(np.concatenate(part) for part in zip(*found, strict=True)))


def valve(*, apart: float = 0.0, **more: object) -> SpatialValve:
    """In three dimensions, without guides."""
    made = model(apart)
    arms = np.array([[0.0, 0.0, SEAT], [0.0, 0.0, COLLAR], [0.0, 0.0, TOP]])
    given = {
        "model": made,
        "components": ("needle", "armature"),
        "stops": ("seat", "driver", "stop"),
        "arms": arms,
        "pairings": PAIRS,
    }
    return SpatialValve(**(given | more))


def sleeve(of: InterfaceModel, **more: object) -> Guide:
    """Two heights at which the armature slides on the needle, with 5 um of clearance."""
    given = {"clearance": 5e-6, "stiffness": 3e7, "radius": -1.5e-3} | more
    heights, offset = np.array([2e-3, 6.5e-3]), [(0.0, 0.0)] * 2
    needle, armature = (
        lateral_guide(
            replace(of, rigid=body.rigid),
            **(given | {"heights": heights - body.centre[2], "offset": offset}),
        )
        for body in of.moving
    )
    return armature._replace(
        heights=heights,
        traces=armature.traces - needle.traces,
        slide=armature.slide - needle.slide,
        turn=armature.turn - needle.turn,
    )
