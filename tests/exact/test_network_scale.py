"""Truth: a stroke has no length of its own (exact, bit for bit).

Everything ``s`` times as large, of the same materials, at the same speeds and pressures and in a
fluid of ``s`` times the viscosity, takes ``s`` times as long at ``s^2`` times the forces: inertia,
stiffness, viscosity and compressibility then keep their shares.  With ``s`` a power of four all
factors are powers of two, also those of the masses and of Hertz's law, so that not even the last
digit may differ: a number in metres, seconds or newtons in the time loop would show.
"""

from dataclasses import astuple

import numpy as np
import pytest

from klack.hydraulics.chamber import Chamber
from klack.hydraulics.film import RingFilm
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.liquid import Murnaghan
from klack.hydraulics.mixture import Vapour
from klack.hydraulics.orifice import Orifice
from klack.hydraulics.pressure_face import PressureFace
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.force import ForceOverTime
from klack.mechanics.friction import GuideFriction
from klack.mechanics.rigid_mass import RigidMass
from klack.mechanics.spring import Spring
from klack.network.component import Component
from klack.network.network import Network
from klack.simulation.bodies import rod_body
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network

SIZES = (4.0**-5, 4.0**5)  # needles of 30 um and of 30 m


def needle(kind: str, s: float) -> Component:
    if kind == "rigid":
        return RigidMass(mass=2e-3 * s**3, points=("bottom", "top"))
    rod = rod_body(
        "needle",
        length=0.03 * s,
        area=8e-6 * s**2,
        young=2.1e11,
        density=7850.0,
        elastic_modes=7,
        damping=0.002,
    )
    return FlexibleBody.of(rod, ("bottom", "top"))


def valve(kind: str, s: float) -> Network:
    """A needle that a force lifts off its seat against a spring, into its stop and back."""
    wet = kind == "wet"
    hertz = {"kind": "hertz", "radius": 1e-3 * s, "modulus": 1.1e11}
    linear = {"kind": "linear", "stiffness": 2e8 * s}
    film = RingFilm(
        shape="ring", inner_radius=0.8e-3 * s, outer_radius=1.1e-3 * s, cut_off=0.5e-6 * s
    )
    extra = {
        "restitution": 0.6 if kind == "rigid" else None,
        "series_compliance": 1e-9 / s,
        "film": film if wet else None,
    }
    parts: dict[str, Component] = {
        "needle": needle(kind, s),
        "seat": EndStop(gap=0.0, law=hertz, **extra),
        "stop": EndStop(gap=40e-6 * s, law=linear, **extra),
        "spring": Spring(stiffness=1e4 * s, preload=12.0 * s**2, damping=0.2 * s**2),
        "guide": GuideFriction(coulomb=0.3 * s**2),
        "magnet": ForceOverTime(
            time=tuple(t * s for t in (0.0, 30e-6, 250e-6, 260e-6)),
            force=tuple(f * s**2 for f in (0.0, 40.0, 40.0, 0.0)),
        ),
    }
    connections = [
        ["needle.bottom", "seat.upper"],
        ["needle.top", "stop.lower", "spring.end", "guide.body", "magnet.end"],
        ["seat.lower", "ground"],
        ["stop.upper", "ground"],
    ]
    if not wet:
        return Network(parts, connections)
    parts |= {
        "below": Chamber(volume=40e-9 * s**3, pressure=6e5),
        "face": PressureFace(direction="opening", area=1e-6 * s**2),
        "hole": Orifice(diameter=0.15e-3 * s, critical_flow_number=1000.0),
    }
    connections[0].append("face.body")
    connections += [["below.fluid", "face.fluid", "hole.a"], ["hole.b", "ambient"]]
    liquid = Murnaghan(density_at_reference=684.0, bulk_modulus_at_reference=8e8)
    fluid = Fluid(
        name="liquid",
        temperature=293.15,
        liquid=liquid,
        base_viscosity=4e-4 * s,
        vapour=Vapour(pressure=4700.0, density=0.2),
    )
    return Network(parts, connections, fluid=fluid)


def run(kind: str, s: float) -> NetworkResult:
    return simulate_network(
        valve(kind, s).rows(),
        duration=700e-6 * s,
        step=50e-9 * s,
        coarse=16,
        record=0.8e-6 * s,
    )


@pytest.mark.parametrize("s", SIZES)
@pytest.mark.parametrize("kind", ["rigid", "dry", "wet"])
def test_a_stroke_knows_no_length(kind, s):
    """Static start, lifting, impacts on both stops, rest in coarse steps, and the events of it."""
    whole, scaled = run(kind, 1.0), run(kind, s)

    assert {event.stop for event in whole.events} == {"seat", "stop"}
    assert (scaled.fine_steps, scaled.coarse_steps) == (whole.fine_steps, whole.coarse_steps)
    assert whole.coarse_steps > 100
    lift = "needle.top displacement"
    np.testing.assert_array_equal(
        scaled.channels[lift].values / s, whole.channels[lift].values, strict=True
    )
    assert len(scaled.events) == len(whole.events)
    scales = (1.0, s, 1.0, s**2, s, s, s, s**3, 1.0, s**3)
    for one, other in zip(whole.events, scaled.events, strict=True):
        assert other.stop == one.stop
        np.testing.assert_array_equal(np.array(astuple(other)[1:]) / scales[1:], astuple(one)[1:])
    assert scaled.books.residual / s**3 == pytest.approx(whole.books.residual, abs=1e-15)
