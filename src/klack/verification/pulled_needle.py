"""Checks of a needle that a magnet pulls off its axis, and of a seat off its axis in a network."""

from functools import partial
from math import hypot

import numpy as np

from klack.hydraulics.off_axis_seat import SeatFace, flow_area
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.seat import Seat
from klack.hydraulics.seat_across import SeatPlace
from klack.magnetics.off_axis_gap import eccentric_ring, tilted_ring_face
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.solenoid_parts import ArmatureBore, ParasiticGap, PoleGap
from klack.magnetics.voltage_step import VoltageStep
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import State as NetworkState
from klack.transient.spatial_run import SpatialValve
from klack.transient.tilting_film import BearingFilm
from klack.verification.check import Check, compare
from klack.verification.rigid_needle import (
    INERTIA,
    MASS,
    fly_in_network,
    guide_of,
    needle_on_ring,
)

__all__ = ["held_coil", "pulled_needle", "pulls", "seat_off_axis"]

_check = partial(compare, "off-axis")
_RADIUS, _CLEARANCE, _LENGTH = 5e-3, 100e-6, 3.5e-3
_INNER, _OUTER, _GAP, _LEFT = 2e-3, 3.3e-3, 100e-6, 50e-6
_ROUND_OFF = "round-off of sums over hundreds of steps"
_ARMS = np.array([[0.0, 0.0, -6e-3]])


def held_coil(bore: ArmatureBore | None, *, tilts: bool = False, current: float = 5.0) -> Solenoid:
    """Coil with a steady current, one working gap and one ring around its armature."""
    return Solenoid(
        turns=60,
        resistance=0.6,
        gap=_GAP,
        residual_gap=_LEFT,
        poles=(PoleGap(inner_radius=_INNER, outer_radius=_OUTER, fringing="none", tilts=tilts),),
        parasitic=(
            ParasiticGap(radius=_RADIUS, clearance=_CLEARANCE, length=_LENGTH, off_axis=bore),
        ),
        start_current=current,
    )


def pulled_needle(
    coil: Solenoid,
    placement: tuple[float, ...],
    duration: float,
    *,
    guided: bool = False,
    held: bool = True,
) -> NetworkResult:
    """A needle in the field of a coil whose armature port is ``held``: its flux is constant.

    Else the coil pulls along z as well, 2 mm from the axis.  ``guided`` by a guide with a film;
    else it is free.
    """
    below = 1e-2 if held else 1e-3  # to the stop
    model = needle_on_ring(below)
    valve = SpatialValve(
        model=model, components=("needle",), stops=("contact",), arms=_ARMS,
        placement=np.array(placement),
        guide=guide_of(model, clearance=4e-6, friction=0.1) if guided else None,
        bearing=BearingFilm(length=1e-3, cut_off=0.3e-6) if guided else None,
    )  # fmt: skip
    driver = VoltageStep(voltage=coil.resistance * coil.start_current, end=1.0)
    return fly_in_network(
        valve,
        {"coil": coil, "driver": driver},
        aside=() if held else ("coil.armature",),
        arm=2e-3,
        joints=(
            *((("coil.armature", "ground"),) if held else ()),
            ("coil.terminals", "driver.terminals"),
        ),
        gap=below,
        wet=guided,
        film=False,
        duration=duration,
    )


def seat_off_axis(
    placement: tuple[float, ...],
    *,
    follows: bool = True,
    velocity: tuple[float, ...] = (0.0,) * 6,
    duration: float = 20e-6,
    state: NetworkState | None = None,
) -> NetworkResult:
    """A ball 60 um over its edge at 5 bar, the needle at a placement, free to move."""
    seat = Seat(
        shape="ball", diameter=1.768e-3, ball_diameter=2.5e-3, lift=60e-6,
        off_axis=SeatPlace(height=-6e-3) if follows else None,
    )  # fmt: skip
    valve = SpatialValve(
        model=needle_on_ring(1e-2), components=("needle",), stops=("contact",), arms=_ARMS,
        placement=np.array(placement), velocity=np.array(velocity),
    )  # fmt: skip
    return fly_in_network(
        valve,
        {"restriction": seat, "supply": PressureSource(pressure=6.013e5)},
        at_tip=("restriction.needle",),
        joints=(("supply.fluid", "restriction.a"), ("restriction.b", "ambient")),
        gap=1e-2,
        wet=True,
        film=False,
        state=state,
        duration=duration,
    )


def pulls() -> list[Check]:
    """Energy that the pull gives, its value in a run, a seat that follows the needle."""
    return [*_aside(), _tilted(), _seat()]


def _aside() -> list[Check]:
    run = pulled_needle(held_coil(ArmatureBore(height=0.0)), (4e-6, -3e-6, 0, 0, 0, 0), 350e-6)
    assert run.path is not None
    flux = float(run.channels["coil flux"].values[-1])
    first, last = (hypot(*run.path.position[k, :2]) for k in (0, -1))
    (P0, _), (P1, slope) = (
        eccentric_ring(_RADIUS, _RADIUS + _CLEARANCE, _LENGTH, e) for e in (first, last)
    )
    speed = hypot(*run.path.velocity[-1, :2])
    force = hypot(*(run.channels[f"coil side force {a}"].values[-1] for a in "xy"))
    return [
        _check(
            "needle pulled aside by a magnet, 5 to 16 um in 0.35 ms, kinetic energy [J]",
            expected=0.5 * flux**2 * float(1.0 / P0 - 1.0 / P1),
            computed=0.5 * MASS * speed**2,
            tolerance=3e-5,
            source="loss of magnetic energy of an eccentric ring at constant flux (Smythe); steps "
            "of 1.28 us",
        ),
        _check(
            "the same: force across the axis at the end [N]",
            expected=float(0.5 * flux**2 / P1**2 * slope),
            computed=force,
            tolerance=1e-12,
            source="slope of that energy",
            reason=_ROUND_OFF,
        ),
        _check(
            "the same: work of the side force over the kinetic energy [-]",
            expected=1.0,
            computed=run.books.supplies["coil side force"] / (0.5 * MASS * speed**2),
            tolerance=1e-12,
            source="energy",
            reason=_ROUND_OFF,
        ),
    ]


def _tilted() -> Check:
    run = pulled_needle(held_coil(None, tilts=True), (0, 0, 0, 0, 1e-3, 0), 300e-6)
    assert run.path is not None
    flux = float(run.channels["coil flux"].values[-1])
    first, last = (hypot(*run.path.position[k, 3:5]) for k in (0, -1))
    P0, P1 = (tilted_ring_face(_INNER, _OUTER, _GAP + _LEFT, t)[0] for t in (first, last))
    return _check(
        "needle tilted by a working gap from 1 mrad on, kinetic energy after 0.3 ms [J]",
        expected=0.5 * flux**2 * float(1.0 / P0 - 1.0 / P1),
        computed=0.5 * INERTIA[1] * float(run.path.velocity[-1, 4]) ** 2,
        tolerance=3e-5,
        source="loss of magnetic energy of a tilted ring face at constant flux; steps of 1.28 us",
    )


def _seat() -> Check:
    run = seat_off_axis((20e-6, -10e-6, 0, 2e-3, 1e-3, 0))
    assert run.path is not None
    x, y, rise, turn_x, turn_y, _ = run.path.position[-1]
    offset = (x - 6e-3 * turn_y, y + 6e-3 * turn_x)
    face = SeatFace(shape="ball", radius=0.884e-3, angle=float(np.arccos(0.884 / 1.25)))
    return _check(
        "seat of a tilted needle 20 um off-axis in a network, flow area [m^2]",
        expected=flow_area(face, [60e-6 + rise, *offset, -turn_y, turn_x]),
        computed=float(run.channels["restriction area"].values[-1]),
        tolerance=1e-7,
        source="mantle between edge and ball, at the end of a step that takes its middle",
    )
