"""Truth: units are words, and neither impacts nor strokes have a length of their own.

Truth: units are words, and elasticity has no length of its own (exact up to round-off).

The same bodies written in mm, m, um or inch are the same bodies.  Bodies ``s`` times as large, of
the same material and hit at the same speed, take ``s`` times as long at ``s^2`` times the force,
with the same restitution: linear elasticity and a contact without cohesion know only the speed of
sound.

Truth: one step of contact and film has no length of its own (exact, bit for bit).

Everything ``s`` times as large, at the same speeds, takes ``s^2`` times the forces.  With ``s`` a
power of four every factor is a power of two, so that not even the last digit may differ.

Truth: the impact of reduced bodies has no length of its own (exact, bit for bit).

Everything ``s`` times as large, of the same materials and at the same speeds, takes ``s`` times as
long at ``s^2`` times the forces.  With ``s`` a power of four all factors are powers of two, also
those of the masses and of Hertz's law: a number in metres, seconds or newtons would show.

Truth: a stroke has no length of its own (exact, bit for bit).

Everything ``s`` times as large, of the same materials, at the same speeds and pressures and in a
fluid of ``s`` times the viscosity, takes ``s`` times as long at ``s^2`` times the forces: inertia,
stiffness, viscosity and compressibility then keep their shares.  With ``s`` a power of four all
factors are powers of two, also those of the masses and of Hertz's law, so that not even the last
digit may differ: a number in metres, seconds or newtons in the time loop would show.
"""

from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np
import pytest

from klack.analyses.impact.record import ImpactStudy
from klack.analyses.impact.run import run_impact
from klack.case import read_case
from klack.contact.history import ImpactHistory
from klack.contact.laws import (
    ContactLaw,
    HertzLaw,
    HuntCrossley,
    LinearLaw,
    TableLaw,
    gonthier_coefficient,
)
from klack.contact.restitution import find_contacts, measure_impact
from klack.contact.step_constants import NO_LAW
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
from klack.simulation.bodies import fixed_body, rigid_mass_body, rod_body
from klack.simulation.impact import simulate
from klack.simulation.interface_step import solve_interface
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.simulation.system import AxialForce, ContactPair, ReducedSystem

METRES = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "inch": 0.0254}

SPHERE_ON_DISC = """
klack: 1
title: Sphere on a disc
materials:
  steel: {{young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}}
bodies:
  sphere:
    geometry:
      model: axisymmetric
      extent: {ball}  # what klack would ask about 4 um and 4 m
      profile:
        unit: {unit}
        parts:
          sphere:
            start: {o}
            edges:
              - {{arc: {a}, centre: {b}, name: tip}}
              - {{arc: {c}, centre: {b}, name: top}}
              - {{close: true, name: axis}}
    material: steel
    mesh: {{size: {size}, contact: {{size: {fine}, extent: {extent}}}}}
  disc:
    geometry:
      model: axisymmetric
      extent: {plate}
      profile:
        unit: {unit}
        parts:
          disc:
            start: {d}
            edges:
              - {{line: {e}, name: foot}}
              - {{line: {f}, name: side}}
              - {{line: {o}, name: end}}
              - {{close: true, name: axis}}
    material: steel
    mesh: {{size: {size}, contact: {{size: {fine}, extent: {extent}}}}}
    fixed:
      - surface: foot
contact:
  between: [sphere.tip, disc.end]
  gap: 0 um
  reach: {reach}
motion: {{speed: 0.5 m/s}}
reduction:
  modes: {{sphere: {{count: 6}}, disc: {{count: 12}}}}
run:
  levels: [reduced, interface, full]
  duration: {duration}
  reduced_step: {step}
  interface_step: {step}
  full_step: {coarse_step}
"""


def study_of(unit: str = "mm", scale: float = 1.0) -> ImpactStudy:
    """Sphere of 4 mm diameter on a disc of 8 mm x 6 mm, everything ``scale`` times as large."""

    def point(r: float, z: float) -> str:
        return f"[{r * scale * 1e-3 / METRES[unit]!r}, {z * scale * 1e-3 / METRES[unit]!r}]"

    def length(mm: float) -> str:
        return f"{mm * scale * 1e-3 / METRES[unit]!r} {unit}"

    text = SPHERE_ON_DISC.format(
        unit=unit,
        o=point(0, 0),
        a=point(2, 2),
        b=point(0, 2),
        c=point(0, 4),
        d=point(0, -6),
        e=point(4, -6),
        f=point(4, 0),
        ball=length(4.0),
        plate=length(8.0),
        size=length(0.8),
        fine=length(0.03),
        extent=length(0.2),
        reach=length(0.02),
        duration=f"{24.0 * scale!r} us",
        step=f"{20.0 * scale!r} ns",
        coarse_step=f"{80.0 * scale!r} ns",
    )
    case = read_case(text, Path("sphere.yaml"))
    return run_impact(case, levels=("reduced", "interface", "full"), certify=False)


@pytest.fixture(scope="module")
def reference() -> ImpactStudy:
    return study_of()


@pytest.mark.slow
@pytest.mark.parametrize("unit", ["m", "um", "inch"])
def test_units_of_a_drawing_change_nothing(reference, unit):
    """Coordinates are rounded to 15 digits when they are read: even the mesh is the same."""
    study = study_of(unit)

    assert set(study.levels) == {"reduced", "interface", "full"}
    for name, level in study.levels.items():
        same = reference.levels[name]
        force = same.history.force
        assert level.degrees_of_freedom == same.degrees_of_freedom, name
        # round-off of sizes and durations that are not rounded
        np.testing.assert_allclose(
            level.history.force, force, rtol=0.0, atol=1e-9 * force.max(), err_msg=name
        )
        assert level.measures.restitution == pytest.approx(same.measures.restitution, abs=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_larger_bodies_hit_longer_and_harder(reference, scale):
    """From 4 um to 4 m.

    Netgen's triangles depend on the last digits of the coordinates (1721 degrees of freedom, 1705
    to 1753 at other sizes), and with them the force: 3e-4 of its peak.  The sphere rebounds nearly
    whole, its losses are a part in 10^4.
    """
    for name, level in study_of(scale=scale).levels.items():
        same = reference.levels[name]
        force = same.history.force
        if name != "full":
            assert level.degrees_of_freedom == same.degrees_of_freedom, name
        count = min(len(force), len(level.history.force))
        np.testing.assert_allclose(
            level.history.force[:count] / scale**2,
            force[:count],
            rtol=0.0,
            atol=2e-3 * force.max(),
            err_msg=name,
        )
        assert level.measures.peak_force / scale**2 == pytest.approx(
            same.measures.peak_force, rel=1e-3
        )
        assert level.measures.contact_time / scale == pytest.approx(
            same.measures.contact_time, rel=1e-3
        )
        assert level.measures.restitution == pytest.approx(same.measures.restitution, abs=1e-5)


DEPTHS = np.array([0.2, 0.5, 1.0, 2.0])


@dataclass(frozen=True, kw_only=True)
class Step:
    """One step in front of a stop: lengths in um, forces in N where ``s`` is 1."""

    gap: float
    reach: float  # gap at its end without a force
    compression: float
    chi: float
    cubic: float
    linear: float
    suction: float
    series: float
    guess: float

    def forces(self, law: str, s: float) -> np.ndarray:
        """Contact force, film force, gap and compression, counted in their scales."""
        kind, numbers = flat(law, s)
        found = solve_interface(
            kind,
            numbers,
            0,
            self.chi * 1e6 / s,
            self.cubic * 1e-16 * s**5,
            self.linear * 1e-11 * s**3,
            0.3e-6 * s,
            self.suction * s**2,
            20e-9 * s,
            1e-9 / s,
            self.series * 1e-9 / s,
            self.gap * 1e-6 * s,
            self.reach * 1e-6 * s,
            self.compression * 1e-6 * s,
            self.guess * s**2,
            0,
            0.0,
        )
        return np.array(found[:4]) / [s**2, s**2, s, s]


def flat(name: str, s: float) -> tuple[int, np.ndarray]:
    laws: dict[str, ContactLaw] = {
        "linear": LinearLaw(1e8 * s),
        "hertz": HertzLaw(1e11 * s**0.5),
        "table": TableLaw(DEPTHS * 1e-6 * s, np.array([20.0, 70.0, 190.0, 520.0]) * s**2),
    }
    if name == "none":
        return NO_LAW, np.zeros(1)
    law = laws[name].flat()
    return law.kind, np.asarray(law.parameters)


def steps(count: int, film: bool) -> list[Step]:
    rng = np.random.default_rng(3)
    found = []
    for _ in range(count):
        gap = rng.uniform(-0.5, 0.5)
        series = float(rng.choice([0.0, 1.0]))
        found.append(
            Step(
                gap=gap,
                reach=gap - rng.uniform(-0.1, 0.1),
                compression=series * rng.uniform(0.0, 0.02),
                chi=float(rng.choice([0.0, 20.0])),
                cubic=film * rng.uniform(0.1, 3.0),
                linear=film * rng.uniform(0.0, 3.0),
                suction=rng.uniform(0.1, 20.0),
                series=series,
                guess=rng.uniform(-1.0, 30.0),
            )
        )
    return found


@pytest.mark.slow
@pytest.mark.parametrize("film", [False, True], ids=["dry", "film"])
@pytest.mark.parametrize("law", ["linear", "hertz", "table", "none"])
def test_a_step_knows_no_length(law, film):
    """A valve of 10 um and a slide of 10 m."""
    for step in steps(300, film):
        whole = step.forces(law, 1.0)
        assert np.all(np.isfinite(whole))
        for s in (4.0**-5, 4.0**-9, 4.0**5):
            np.testing.assert_array_equal(step.forces(law, s), whole)


SIZES = (4.0**-5, 4.0**5)
RESTITUTION = 0.6


def system(kind: str, s: float) -> ReducedSystem:
    """A needle that 1 N presses onto its seat: a mass on one or on two damped stops, or a rod."""
    law = HertzLaw(3e10 * s**0.5)
    needle = rigid_mass_body("needle", 1e-3 * s**3)
    contacts, port = 1, "contact"
    if kind == "rod":
        port = "bottom"
        needle = rod_body(
            "needle",
            length=0.02 * s,
            area=6e-6 * s**2,
            young=2.1e11,
            density=7850.0,
            elastic_modes=12,
        )
    else:
        law = HuntCrossley(law, gonthier_coefficient(RESTITUTION))
        contacts = {"one stop": 1, "two stops": 2}[kind]
    return ReducedSystem(
        bodies=(needle, *(fixed_body(f"seat {c}") for c in range(contacts))),
        contacts=tuple(
            ContactPair(
                body_a="needle",
                port_a=port,
                body_b=f"seat {c}",
                port_b="contact",
                law=law,
                gap=2e-6 * s,
                series_compliance=1e-9 / s,
            )
            for c in range(contacts)
        ),
        forces=(AxialForce(body="needle", force=-1.0 * s**2),),
    )


def impact(kind: str, s: float) -> ImpactHistory:
    record = simulate(
        system(kind, s), velocities={"needle": -0.5}, step=20e-9 * s, duration=1.2e-3 * s
    )
    return record.impact()


@pytest.mark.parametrize("s", SIZES)
@pytest.mark.parametrize(
    "kind", ["one stop", pytest.param("two stops", marks=pytest.mark.slow), "rod"]
)
def test_bounces_know_no_length(kind, s):
    """Several touches, each damped by its own speed; and the numbers of the first impact."""
    whole, scaled = impact(kind, 1.0), impact(kind, s)

    assert len(find_contacts(whole)) >= 2
    np.testing.assert_array_equal(scaled.force / s**2, whole.force, strict=True)
    np.testing.assert_array_equal(scaled.velocity_a, whole.velocity_a, strict=True)
    one, other = measure_impact(whole), measure_impact(scaled)
    assert other.impacts == one.impacts
    assert other.sub_contacts == one.sub_contacts
    for name, factor in (
        ("peak_force", s**2),
        ("contact_time", s),
        ("total_contact_time", s),
        ("restitution", 1.0),
        ("rebound_speed", 1.0),
        ("vibration_share", 1.0),
    ):
        # records are placed by roots of sums, where the last digits differ
        assert getattr(other, name) / factor == pytest.approx(
            getattr(one, name), rel=1e-12, abs=1e-12
        ), name


def test_every_bounce_of_a_small_mass_has_its_own_restitution():
    """A mass of 1 ug rises 45 nm, 16 nm and 6 nm.

    The damped law is exact without a force; during a contact of 20 ns it gives 20 mm/s, and adds
    to the speed before as much as it takes from the speed after.
    """
    s = SIZES[0]
    history = impact("one stop", s)
    contacts = find_contacts(history)

    assert len(contacts) >= 3
    for contact in contacts[:3]:
        before, after = history.velocity_a[[contact.first, contact.last]]
        assert -after / before == pytest.approx(RESTITUTION, abs=0.02 / -before)


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
    scales = (s, 1.0, s**2, s, s, s, s**3, 1.0, s**3, 1.0)
    for one, other in zip(whole.events, scaled.events, strict=True):
        assert other.stop == one.stop
        assert other.besides == one.besides
        found, expected = (astuple(event)[1:-1] for event in (other, one))
        np.testing.assert_array_equal(np.array(found) / scales, expected)
    assert scaled.books.residual / s**3 == pytest.approx(whole.books.residual, abs=1e-15)
