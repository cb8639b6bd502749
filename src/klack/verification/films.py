"""Squeeze films and the step of an interface: geometry, impulse, fall, series, energy, order."""

from math import pi, sin

import numpy as np
from scipy.integrate import quad

from klack.contact.laws import HuntCrossley, LinearLaw, gonthier_coefficient
from klack.hydraulics.film import ConeFilm, DiscFilm, RingFilm, flow_factor, mean_flow_factor
from klack.network.rows import FilmRow
from klack.reduction.reduced_body import ReducedBody
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.impact import simulate_impact
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.film_reference import film_by_ode, squeeze_by_volumes
from klack.verification.interface_motion import interface_motion
from klack.verification.one_dimension import one_contact, steel_rod
from klack.verification.sphere_in_liquid import (
    GLASS,
    READ_AT,
    STEEL,
    elastohydrodynamic_height,
    film_alone,
    on_compliance,
    restitution,
)
from klack.verification.tilted_films import tilted_films

__all__ = ["checks"]

GROUP = "films"
NEVER = 1e9  # [N] no cavitation
REYNOLDS = "Reynolds (1886): parallel faces, both edges at one pressure"
IDENTITY = "discrete gradient (Gonzalez 1996): energy identity at every step size"


def checks() -> list[Check]:
    """Geometry, rough faces, motion of a mass, series compliance, energy and order."""
    return [
        *_geometry(),
        *_roughness(),
        *_mass(),
        *_series(),
        *_rods(),
        *_spheres(),
        *tilted_films(),
    ]


def _geometry() -> list[Check]:
    ring = RingFilm(shape="ring", inner_radius=1.4e-3, outer_radius=2e-3)
    force = ring.film_row(4e-4, 1e5).cubic * 0.3 / 2e-6**3
    gridded = squeeze_by_volumes(1.4e-3, 2e-3, 2000) * 4e-4 * 0.3 / 2e-6**3
    gaps = np.geomspace(0.5e-6, 50e-6, 60)
    curve = ComparedCurve(
        x_label="gap [um]",
        y_label="force [N]",
        expected=(gaps * 1e6, gridded * (2e-6 / gaps) ** 3),
        computed=(
            gaps * 1e6,
            np.array([_film_force(ring.film_row(4e-4, 1e5), h, 0.3) for h in gaps]),
        ),
        x_log=True,
        y_log=True,
    )
    disc = DiscFilm(shape="disc", radius=1e-3)
    narrow = RingFilm(shape="ring", inner_radius=1e-3, outer_radius=1.001e-3)
    cone = ConeFilm(shape="cone", mean_radius=0.75e-3, width=0.25e-3, half_angle=pi / 4)
    return [
        compare(
            GROUP,
            "ring 1.4 to 2.0 mm at 2 um, 0.3 m/s, 0.4 mPa s: force [N]",
            expected=gridded,
            computed=force,
            tolerance=1e-6,
            source="Reynolds' equation in 2000 finite volumes",
            curve=curve,
        ),
        compare(
            GROUP,
            "disc of 1 mm radius, coefficient over viscosity [m^4]",
            expected=squeeze_by_volumes(0.0, 1e-3, 2000),
            computed=disc.coefficients()[0],
            tolerance=1e-6,
            source="Reynolds' equation in 2000 finite volumes",
        ),
        compare(
            GROUP,
            "narrow ring against a long strip, mu L w^3 [m^4]",
            expected=2.0 * pi * 1.0005e-3 * 1e-6**3,
            computed=narrow.coefficients()[0],
            tolerance=1e-6,
            source=f"{REYNOLDS}; curvature acts by (w/r)^2",
        ),
        compare(
            GROUP,
            "conical land, axial force times speed [W]",
            expected=_cone_dissipation(cone, 2e-6, 0.3, 4e-4),
            computed=_film_force(cone.film_row(4e-4, 1e5), 2e-6, 0.3) * 0.3,
            tolerance=5e-14,
            source="viscous dissipation of squeeze and shear flow, by quadrature",
        ),
    ]


def _film_force(film: FilmRow, height: float, speed: float) -> float:
    return (film.cubic / height**3 + film.linear / height) * speed


def _cone_dissipation(cone: ConeFilm, axial: float, speed: float, mu: float) -> float:
    height, normal = axial * sin(cone.half_angle), speed * sin(cone.half_angle)
    slide = speed * np.cos(cone.half_angle)

    def rate(s: float, y: float) -> float:
        """``mu (du/dy)^2`` of the flow that the squeeze drives to both edges, and of the shear."""
        pressed = 6.0 * normal * s / height**3 * (2.0 * y - height)
        sheared = slide / height
        return float(mu * (pressed + sheared) ** 2)

    def over_height(s: float) -> float:
        return float(quad(lambda y: rate(s, y), 0.0, height)[0])

    length = 2.0 * pi * cone.mean_radius
    return length * float(quad(over_height, -0.5 * cone.width, 0.5 * cone.width)[0])


def _roughness() -> list[Check]:
    lowest = 1.5
    inverse, _ = quad(lambda h: h**-3.0 / flow_factor(h), lowest, np.inf, epsabs=0, epsrel=1e-12)
    return [
        compare(
            GROUP,
            "flow factor of a rough film of equal impulse [-]",
            expected=0.5 / lowest**2 / inverse,
            computed=mean_flow_factor(lowest),
            tolerance=5e-13,
            source="quadrature of 1/(phi h^3); phi of Patir and Cheng (1978)",
        )
    ]


def _mass() -> list[Check]:
    wall = fixed_body("wall", port="top")
    film = FilmRow(cubic=5e-17, linear=4e-12, cut_off=0.3e-6, suction=NEVER)
    m = interface_motion(
        rigid_mass_body("needle", 3e-3, port="bottom"),
        wall,
        None,
        film=film,
        gap=20e-6,
        speed=0.02,
        step=1e-6,
        steps=400,
    )
    x0, x1 = 20e-6 + film.cut_off, float(m.gap[-1]) + film.cut_off
    impulse = 0.5 * film.cubic * (x1**-2 - x0**-2) + film.linear * np.log(x0 / x1)
    ring = RingFilm(shape="ring", inner_radius=1.4e-3, outer_radius=2e-3).film_row(4e-4, 1e5)
    fall = FilmRow(cubic=ring.cubic, linear=0.0, cut_off=1e-12, suction=NEVER)
    light = interface_motion(
        rigid_mass_body("plate", 1e-10, port="bottom"),
        wall,
        None,
        film=fall,
        gap=25e-6,
        press=10.0,
        step=20e-9,
        steps=3000,
    )
    # the impulse of the film, B/(2 h^2), grows evenly over time
    time = light.step * np.arange(light.gap.size)
    times = np.interp([20e-6**-2, 1e-6**-2], light.gap**-2, time)
    falling = (light.gap < 20e-6) & (light.gap > 1e-6)
    since = time[falling] - times[0]
    exact = 1.0 / np.sqrt(20e-6**-2 + 20.0 * since / ring.cubic)
    curve = ComparedCurve(
        x_label="time since 20 um [us]",
        y_label="gap [um]",
        expected=(since * 1e6, exact * 1e6),
        computed=(since * 1e6, light.gap[falling] * 1e6),
        y_log=True,
    )
    parting = interface_motion(
        rigid_mass_body("needle", 3e-3, port="bottom"),
        wall,
        None,
        film=FilmRow(cubic=5e-17, linear=0.0, cut_off=0.3e-6, suction=0.6),
        gap=0.0,
        speed=-0.1,
        step=20e-9,
        steps=2000,
    )
    return [
        compare(
            GROUP,
            "mass through a film, change of momentum in steps of 1 us [N s]",
            expected=impulse,
            computed=3e-3 * (m.upper_speed + 0.02),
            tolerance=1e-10,
            source="film impulse B/2 (1/x1^2 - 1/x0^2) + C ln(x0/x1)",
        ),
        compare(
            GROUP,
            "fall of a light ring from 20 to 1 um under 10 N [s]",
            expected=ring.cubic / 20.0 * (1e-6**-2 - 20e-6**-2),
            computed=float(times[1] - times[0]),
            tolerance=1e-5,
            source="Stefan (1874): t = B/(2F) (1/h2^2 - 1/h1^2); step 20 ns, mass 0.1 ug",
            curve=curve,
        ),
        compare(
            GROUP,
            "largest pull of a parting film [N]",
            expected=-0.6,
            computed=float(parting.film_force.min()),
            tolerance=1e-15,
            source="cavitation: (p - p_cav) A",
        ),
        compare(
            GROUP,
            "energy residual of a cavitating film [-]",
            expected=0.0,
            computed=parting.residual,
            tolerance=5e-12,
            source=IDENTITY,
        ),
    ]


def _series() -> list[Check]:
    film = FilmRow(cubic=5e-17, linear=0.0, cut_off=1e-8, suction=NEVER)
    needle = rigid_mass_body("needle", 3e-3, port="bottom")
    wall = fixed_body("wall", port="top")
    peak, state = film_by_ode(
        needle, wall, film, series=1e-9, gap=10e-6, speed=0.4, duration=40e-6, relative=1e-10
    )
    m = interface_motion(
        needle, wall, None, film=film, series=1e-9, gap=10e-6, speed=0.4, step=20e-9, steps=2000
    )
    return [
        compare(
            GROUP,
            "3 g, 0.4 m/s on a film before 1e9 N/m: peak force [N]",
            expected=peak,
            computed=m.peak_force,
            tolerance=5e-5,
            source="Radau IIA at 1e-10; ours 20 ns",
        ),
        compare(
            GROUP,
            "the same, speed after 40 us [m/s]",
            expected=float(state[1] / np.sqrt(3e-3)),
            computed=m.upper_speed,
            tolerance=5e-4,
            source="Radau IIA at 1e-10; ours 20 ns",
        ),
    ]


def _rods() -> list[Check]:
    a, b = steel_rod("a", 0.04, 20), steel_rod("b", 0.08, 40)
    film = FilmRow(cubic=5e-17, linear=0.0, cut_off=1e-8, suction=NEVER)
    _, exact = film_by_ode(
        a, b, film, series=1e-9, gap=5e-6, speed=0.5, duration=60e-6, relative=1e-8
    )
    steps = np.array([375, 750, 1500, 3000])
    errors = []
    for count in steps:
        m = interface_motion(
            a, b, None, film=film, series=1e-9, gap=5e-6, speed=0.5, step=60e-6 / count, steps=count
        )
        errors.append(_energy_norm(m.state - exact, a, b) / _energy_norm(exact, a, b))
    order = -np.polyfit(np.log(steps[:3]), np.log(errors[:3]), 1)[0]
    widths = 60e-6 / steps * 1e9
    rough = FilmRow(cubic=5e-17, linear=4e-12, cut_off=0.2e-6, suction=0.6)
    law = HuntCrossley(LinearLaw(1e10), gonthier_coefficient(0.9))
    both = interface_motion(
        a, b, law, film=rough, series=1e-9, gap=5e-6, speed=0.5, step=20e-9, steps=3000
    )
    return [
        compare(
            GROUP,
            "two rods kept apart by a film, state error at 20 ns [-]",
            expected=0.0,
            computed=errors[-1],
            tolerance=2e-5,
            source="Radau IIA at 1e-8, 60 modes",
        ),
        compare(
            GROUP,
            "two rods kept apart by a film, order of convergence [-]",
            expected=2.0,
            computed=float(order),
            tolerance=0.1,
            source="steps of 160, 80, 40 ns against Radau IIA",
            absolute=True,
            curve=ComparedCurve(
                x_label="step [ns]",
                y_label="error of the state [-]",
                expected=(widths, errors[0] * (widths / widths[0]) ** 2),
                computed=(widths, np.array(errors)),
                x_log=True,
                y_log=True,
            ),
        ),
        compare(
            GROUP,
            "energy residual of film, damped asperities and compliance [-]",
            expected=0.0,
            computed=both.residual,
            tolerance=5e-12,
            source=IDENTITY,
        ),
        _film_that_vanishes(a, b),
    ]


def _film_that_vanishes(a: ReducedBody, b: ReducedBody) -> Check:
    law = LinearLaw(1e10)
    faint = FilmRow(cubic=1e-28, linear=0.0, cut_off=0.2e-6, suction=NEVER)
    m = interface_motion(
        a, b, law, film=faint, series=1e-9, gap=1.23e-6, speed=0.5, step=20e-9, steps=3000
    )
    known = simulate_impact(
        one_contact(a, b, law, gap=1.23e-6, series=1e-9), speed=0.5, step=20e-9, duration=60e-6
    )
    force = known.force[0] if known.force.ndim > 1 else known.force
    worst = float(np.max(np.abs(m.contact_force - force)) / np.max(force))
    return compare(
        GROUP,
        "a film that vanishes against no film, largest difference of the force [-]",
        expected=0.0,
        computed=worst,
        tolerance=5e-9,
        source="contact loop without films",
    )


def _spheres() -> list[Check]:
    height = elastohydrodynamic_height(STEEL, 100.0)
    smooth, rough = (
        100.0 * (1.0 - on_compliance(STEEL, 100.0, cut_off=share * height, pull=False))
        for share in (1e-3, 10.0)
    )
    return [
        compare(
            GROUP,
            "sphere on a wall at St = 100, film alone: restitution [-]",
            expected=film_alone(100.0, 0.3e-6),
            computed=restitution(GLASS, 100.0, cut_off=0.3e-6),
            tolerance=5e-7,
            source="Reynolds (1886): 1 - 2 ln(h/h_r)/St",
        ),
        compare(
            GROUP,
            "smooth steel sphere, film before the bulk: critical Stokes number [-]",
            expected=float(np.log(READ_AT / height)),
            computed=smooth,
            tolerance=0.04,
            source="ln(x_0/x_r), elastohydrodynamic: Davis, Rager & Good (2002)",
            reason="one linear compliance for the bulk, one width for the film",
        ),
        compare(
            GROUP,
            "rough steel sphere, film before the bulk: critical Stokes number [-]",
            expected=float(np.log(READ_AT / (10.0 * height))),
            computed=rough,
            tolerance=5e-3,
            source="ln(x_0/h_r): the roughness, 10 x_r, acts first",
        ),
    ]


def _energy_norm(state: np.ndarray, a: ReducedBody, b: ReducedBody) -> float:
    omega = np.concatenate([a.omega, b.omega])
    return float(
        np.hypot(np.linalg.norm(omega * state[: omega.size]), np.linalg.norm(state[omega.size :]))
    )
