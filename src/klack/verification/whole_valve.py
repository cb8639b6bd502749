"""A whole valve with rods for bodies: every domain at once, and no mesh to wait for."""

from math import pi

from klack.hydraulics.chamber import Chamber
from klack.hydraulics.film import ConeFilm, RingFilm
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.line import Line
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_source import PressureSource
from klack.hydraulics.seat import Seat
from klack.magnetics.driver import Driver
from klack.magnetics.peak_hold import PeakHold
from klack.magnetics.solenoid import Solenoid
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.spring import Spring
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.component import Component
from klack.network.network import Network
from klack.simulation.bodies import rod_body

__all__ = ["LIFT", "PRELOAD", "peak_and_hold", "whole_valve"]

LIFT = 100e-6
"""Gap of the opening stop [m]."""

PRELOAD = 12.0
"""Of the return spring [N]."""

_STEEL = {"young": 2.1e11, "density": 7850.0}
_SUPPLY = 6.013e5  # [Pa]
_SEALING = 1.768e-3  # [m]


def peak_and_hold(*, start: float = 0.0, end: float = 2.5e-3) -> PeakHold:
    """Driver of direct injection: 65 V up to 10 A, then 3.5 A, and back into the capacitor."""
    return PeakHold(
        start=start,
        end=end,
        boost_voltage=65.0,
        peak_current=10.0,
        supply_voltage=14.0,
        hold_current=3.5,
        hold_band=0.8,
        decay=65.0,
    )


def whole_valve(
    *,
    modes: tuple[int, int, int] = (20, 40, 20),
    damping: float = 0.01,
    driver: Driver | None = None,
    gas_fraction: float = 1e-4,
) -> Network:
    """Return a normally closed valve at 5 bar in n-heptane: about 1 ms to open, 0.3 ms to close.

    Needle (3 g), housing with the seat and pole with the stop are rods with their exact modes.
    Line, inlet chamber, ball seat, sac, nozzle; solenoid with two poles, iron, leakage and one eddy
    term.  Both end stops have a contact, a film and a compliance in series.

    Parameters
    ----------
    modes : tuple of int
        Of needle (one of them rigid), housing and pole.
    damping : float [-]
        Of every elastic mode.
    driver : Driver, optional
        :func:`peak_and_hold` by default.
    gas_fraction : float [-]
    """
    parts: dict[str, Component] = {
        "needle": _rod("needle", 0.04, 3e-3 / (0.04 * 7850.0), modes[0] - 1, damping, free=True),
        "housing": _rod("housing", 0.1, pi / 4 * 10e-3**2, modes[1], damping),
        "pole": _rod("pole", 0.04, pi / 4 * 7.6e-3**2, modes[2], damping),
        "spring": Spring(stiffness=1e4, preload=PRELOAD),
        "driver": driver or peak_and_hold(),
        **_stops(),
        **_solenoid(),
        **_hydraulics(),
    }
    connections = [
        ["needle.bottom", "seat.upper", "restriction.needle", "tip_face.body"],
        ["needle.top", "opening.lower", "spring.end", "coil.armature", "top_face.body"],
        ["housing.top", "seat.lower", "restriction.body"],
        ["pole.top", "opening.upper", "coil.base"],
        ["driver.terminals", "coil.terminals"],
        ["supply.fluid", "feed.a"],
        ["feed.b", "inlet.fluid", "restriction.a", "top_face.fluid"],
        ["restriction.b", "sac.fluid", "tip_face.fluid", "nozzle.a"],
        ["nozzle.b", "ambient"],
    ]
    fluid = library_fluid("n-heptane").at(293.15, gas_fraction=gas_fraction)
    return Network(parts, connections, fluid=fluid)


def _rod(
    name: str, length: float, area: float, modes: int, damping: float, *, free: bool = False
) -> FlexibleBody:
    rod = rod_body(
        name,
        length=length,
        area=area,
        elastic_modes=modes,
        support="free" if free else "bottom",
        damping=damping,
        **_STEEL,
    )
    return FlexibleBody.of(rod, ("bottom", "top") if free else ("top",))


def _stops() -> dict[str, Component]:
    law = LinearStopLaw(kind="linear", stiffness=5e8)
    land = ConeFilm(
        shape="cone",
        mean_radius=0.5 * _SEALING,
        width=0.1e-3,
        half_angle=pi / 4,
        roughness=0.2e-6,
        pressure=_SUPPLY,
    )
    ring = RingFilm(
        shape="ring", inner_radius=1.35e-3, outer_radius=1.95e-3, cut_off=1.2e-6, pressure=_SUPPLY
    )
    return {
        "seat": EndStop(gap=0.0, law=law, series_compliance=1e-9, film=land),
        "opening": EndStop(gap=LIFT, law=law, series_compliance=1e-9, film=ring),
    }


def _solenoid() -> dict[str, Component]:
    iron = [(20e-3, 33e-6), (2.5e-3, 70e-6), (40e-3, 60e-6)]
    coil = Solenoid.model_validate(
        {
            "turns": 60.0,
            "resistance": 0.6,
            "gap": LIFT,
            "residual_gap": 50e-6,
            "poles": [
                {"inner_radius": 1.95e-3, "outer_radius": 3.8e-3, "fringing": "none"},
                {"inner_radius": 4.8e-3, "outer_radius": 6e-3, "fringing": "none"},
            ],
            "iron": [{"material": "X6Cr17", "length": x, "area": A} for x, A in iron],
            "leakage_share": 0.1,
            "eddy": [{"conductivity": 1.5e6, "length": 20e-3, "radius": 3.8e-3, "slots": 0.15}],
        }
    )
    return {"coil": coil}


def _hydraulics() -> dict[str, Component]:
    return {
        "supply": PressureSource(pressure=_SUPPLY),
        "feed": Line(length=0.06, diameter=2.5e-3, pressure=_SUPPLY),
        "inlet": Chamber(volume=600e-9, pressure=_SUPPLY),
        "sac": Chamber(volume=2e-9),
        "restriction": Seat(
            shape="ball", diameter=_SEALING, ball_diameter=2.5e-3, bore_diameter=0.9e-3
        ),
        "nozzle": Orifice(diameter=0.4e-3),
        "top_face": PressureFace(direction="closing", outer_diameter=_SEALING),
        "tip_face": PressureFace(direction="opening", outer_diameter=_SEALING),
    }
