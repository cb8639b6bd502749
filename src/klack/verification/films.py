"""Squeeze films and the step of an interface: geometry, impulse, fall, series, energy, order."""

from math import cos, pi, sin

import numpy as np
from scipy.integrate import quad

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.contact.laws import HuntCrossley, LinearLaw, gonthier_coefficient
from klack.hydraulics.film import ConeFilm, DiscFilm, RingFilm, flow_factor, mean_flow_factor
from klack.hydraulics.guide_film import guide_film_force
from klack.hydraulics.tilted_film import SectorFilm, sector_film, sector_forces, sector_step
from klack.network.rows import FilmRow
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.impact import simulate_impact
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.interface_motion import film_by_ode, interface_motion, squeeze_by_volumes
from klack.verification.one_dimension import one_contact, steel_rod
from klack.verification.sphere_in_liquid import (
    GLASS,
    READ_AT,
    STEEL,
    elastohydrodynamic_height,
    film_alone,
    on_compliance,
    restitution,
    settling_error,
)

__all__ = ["checks"]


NEVER = 1e9  # [N] no cavitation
REYNOLDS = "Reynolds (1886): parallel faces, both edges at one pressure"
IDENTITY = "discrete gradient (Gonzalez 1996): energy identity at every step size"


def checks() -> list[Check]:
    """Return the checks."""
    return [
        *_geometry(),
        *_roughness(),
        *_mass(),
        *_series(),
        *_rods(),
        *_spheres(),
        _parallel(),
        _disc(),
        _narrow(),
        _step(),
        *_guide(),
    ]


def _geometry() -> list[Check]:
    ring = RingFilm(shape="ring", inner_radius=1.4e-3, outer_radius=2e-3)
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
        check(
            "ring 1.4 to 2.0 mm at 2 um, 0.3 m/s, 0.4 mPa s: force [N]",
            expected=gridded,
            computed=ring.film_row(4e-4, 1e5).cubic * 0.3 / 2e-6**3,
            tolerance=1e-6,
            source="Reynolds' equation in 2000 finite volumes",
            curve=curve,
        ),
        check(
            "disc of 1 mm radius, coefficient over viscosity [m^4]",
            expected=squeeze_by_volumes(0.0, 1e-3, 2000),
            computed=disc.coefficients()[0],
            tolerance=1e-6,
            source="Reynolds' equation in 2000 finite volumes",
        ),
        check(
            "narrow ring against a long strip, mu L w^3 [m^4]",
            expected=2.0 * pi * 1.0005e-3 * 1e-6**3,
            computed=narrow.coefficients()[0],
            tolerance=1e-6,
            source=f"{REYNOLDS}; curvature acts by (w/r)^2",
        ),
        check(
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
        """``mu (du/dy)^2`` of the flow squeezed to both edges, and of the shear."""
        pressed = 6.0 * normal * s / height**3 * (2.0 * y - height)
        sheared = slide / height
        return float(mu * (pressed + sheared) ** 2)

    length = 2.0 * pi * cone.mean_radius
    return length * float(
        quad(
            lambda s: float(quad(lambda y: rate(s, y), 0.0, height)[0]),
            -0.5 * cone.width,
            0.5 * cone.width,
        )[0]
    )


def _roughness() -> list[Check]:
    lowest = 1.5
    inverse, _ = quad(lambda h: h**-3.0 / flow_factor(h), lowest, np.inf, epsabs=0, epsrel=1e-12)
    return [
        check(
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
    light = interface_motion(
        rigid_mass_body("plate", 1e-10, port="bottom"),
        wall,
        None,
        film=FilmRow(cubic=ring.cubic, linear=0.0, cut_off=1e-12, suction=NEVER),
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
        check(
            "mass through a film, change of momentum in steps of 1 us [N s]",
            expected=impulse,
            computed=3e-3 * (m.upper_speed + 0.02),
            tolerance=1e-10,
            source="film impulse B/2 (1/x1^2 - 1/x0^2) + C ln(x0/x1)",
        ),
        check(
            "fall of a light ring from 20 to 1 um under 10 N [s]",
            expected=ring.cubic / 20.0 * (1e-6**-2 - 20e-6**-2),
            computed=float(times[1] - times[0]),
            tolerance=1e-5,
            source="Stefan (1874): t = B/(2F) (1/h2^2 - 1/h1^2); step 20 ns, mass 0.1 ug",
            curve=ComparedCurve(
                x_label="time since 20 um [us]",
                y_label="gap [um]",
                expected=(since * 1e6, exact * 1e6),
                computed=(since * 1e6, light.gap[falling] * 1e6),
                y_log=True,
            ),
        ),
        check(
            "largest pull of a parting film [N]",
            expected=-0.6,
            computed=float(parting.film_force.min()),
            tolerance=1e-15,
            source="cavitation: (p - p_cav) A",
        ),
        check(
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
        check(
            "3 g, 0.4 m/s on a film before 1e9 N/m: peak force [N]",
            expected=peak,
            computed=m.peak_force,
            tolerance=5e-5,
            source="Radau IIA at 1e-10; ours 20 ns",
        ),
        check(
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
    widths = 60e-6 / steps * 1e9
    both = interface_motion(
        a,
        b,
        HuntCrossley(LinearLaw(1e10), gonthier_coefficient(0.9)),
        film=FilmRow(cubic=5e-17, linear=4e-12, cut_off=0.2e-6, suction=0.6),
        series=1e-9,
        gap=5e-6,
        speed=0.5,
        step=20e-9,
        steps=3000,
    )
    return [
        check(
            "two rods kept apart by a film, state error at 20 ns [-]",
            expected=0.0,
            computed=errors[-1],
            tolerance=2e-5,
            source="Radau IIA at 1e-8, 60 modes",
        ),
        check(
            "two rods kept apart by a film, order of convergence [-]",
            expected=2.0,
            computed=float(-np.polyfit(np.log(steps[:3]), np.log(errors[:3]), 1)[0]),
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
        check(
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
    m = interface_motion(
        a,
        b,
        law,
        film=FilmRow(cubic=1e-28, linear=0.0, cut_off=0.2e-6, suction=NEVER),
        series=1e-9,
        gap=1.23e-6,
        speed=0.5,
        step=20e-9,
        steps=3000,
    )
    known = simulate_impact(
        one_contact(a, b, law, gap=1.23e-6, series=1e-9), speed=0.5, step=20e-9, duration=60e-6
    )
    force = known.force[0] if known.force.ndim > 1 else known.force
    return check(
        "a film that vanishes against no film, largest difference of the force [-]",
        expected=0.0,
        computed=float(np.max(np.abs(m.contact_force - force)) / np.max(force)),
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
        check(
            "sphere on a wall at St = 100, film alone: restitution [-]",
            expected=film_alone(100.0, 0.3e-6),
            computed=restitution(GLASS, 100.0, cut_off=0.3e-6),
            tolerance=5e-7,
            source="Reynolds (1886): 1 - 2 ln(h/h_r)/St",
        ),
        check(
            "smooth steel sphere, film before the bulk: critical Stokes number [-]",
            expected=float(np.log(READ_AT / height)),
            computed=smooth,
            tolerance=0.04,
            source="ln(x_0/x_r), elastohydrodynamic: Davis, Rager & Good (2002)",
            reason="one linear compliance for the bulk, one width for the film",
        ),
        check(
            "rough steel sphere, film before the bulk: critical Stokes number [-]",
            expected=float(np.log(READ_AT / (10.0 * height))),
            computed=rough,
            tolerance=5e-3,
            source="ln(x_0/h_r): the roughness, 10 x_r, acts first",
        ),
        check(
            "sphere that settles from rest, drag with memory: largest error of its speed [-]",
            expected=0.0,
            computed=settling_error(),
            tolerance=3e-3,
            source="Basset, Boussinesq and Oseen, closed form",
            reason="the kernel as a sum of exponentials, right to 0.3 %; Re = 1e-3",
        ),
    ]


def _energy_norm(state: np.ndarray, a: ReducedBody, b: ReducedBody) -> float:
    omega = np.concatenate([a.omega, b.omega])
    return float(
        np.hypot(np.linalg.norm(omega * state[: omega.size]), np.linalg.norm(state[omega.size :]))
    )


_MU, _HEIGHT = 4e-4, 2e-6  # [Pa s], [m]
_SECTORS = "finite volumes round the circumference: order 2, 36 sectors"


def _heights(film: SectorFilm, height: float, tilt: float) -> np.ndarray:
    return (height + tilt * film.rows()[:, 1]).reshape(film.sectors, film.circles)


def _parallel() -> Check:
    film = sector_film(1.4e-3, 2e-3, circles=2)
    flat = _heights(film, _HEIGHT, 0.0)
    ring = RingFilm(shape="ring", inner_radius=1.4e-3, outer_radius=2e-3)
    return check(
        "36 parallel sectors of a ring, force at 0.3 m/s [N]",
        expected=_MU * ring.coefficients()[0] * 0.3 / _HEIGHT**3,
        computed=float(sector_forces(film, flat, np.full_like(flat, 0.3), _MU).sum()),
        tolerance=5e-14,
        source="film of parallel faces",
    )


def _disc() -> Check:
    rate, radius = 100.0, 2e-3
    film = sector_film(0.0, radius, circles=2)
    forces = sector_forces(film, _heights(film, _HEIGHT, 0.0), _heights(film, 0.0, rate), _MU)
    return check(
        "disc of 2 mm radius that begins to tilt, moment [N m]",
        expected=pi * _MU * rate * radius**6 / (8.0 * _HEIGHT**3),
        computed=float((film.rows().T @ forces.ravel())[1]),
        tolerance=3e-3,
        source=f"p = 3 mu w/(2 h^3) (R^2 r - r^3) cos; {_SECTORS}",
    )


def _narrow() -> Check:
    r, w, speed = 1e-3, 2e-6, 0.1
    film = sector_film(r - 0.5 * w, r + 0.5 * w)

    def force(tilt: float) -> float:
        heights = _heights(film, _HEIGHT, tilt * _HEIGHT / r)
        return float(sector_forces(film, heights, np.full_like(heights, speed), _MU).sum())

    def strips(tilt: float) -> float:
        even = 2.0 * pi * r * _MU * w**3 * speed / _HEIGHT**3
        return float(even * (2.0 + tilt**2) / (2.0 * (1.0 - tilt**2) ** 2.5))

    tilts = np.linspace(0.0, 0.8, 17)
    return check(
        "narrow land, tilted by half of its height, force [N]",
        expected=strips(0.5),
        computed=force(0.5),
        tolerance=3e-3,
        source="strips mu w^3 V/h^3 round the circumference, in closed form",
        curve=ComparedCurve(
            x_label="tilt times radius over the mean height [-]",
            y_label="force [N]",
            expected=(tilts, np.array([strips(x) for x in tilts])),
            computed=(tilts, np.array([force(x) for x in tilts])),
        ),
    )


def _step() -> Check:
    film = sector_film(1.4e-3, 2e-3, circles=2)
    before, after = _heights(film, _HEIGHT, 0.5e-3), _heights(film, 0.7 * _HEIGHT, -0.3e-3)
    _, slopes = sector_step(film, before, after, 1e-6, _MU, tension=1e5)
    way = np.cos(np.arange(before.size)).reshape(before.shape) * 1e-11
    ahead, behind = (
        sector_step(film, before, after + sign * way, 1e-6, _MU, tension=1e5)[0] for sign in (1, -1)
    )
    numeric = (ahead - behind).ravel() / 2.0
    return check(
        "slopes of a step of 36 sectors that cavitate, largest deviation [-]",
        expected=0.0,
        computed=float(np.abs(slopes @ way.ravel() - numeric).max() / np.abs(numeric).max()),
        tolerance=1e-8,
        source="central differences",
    )


def _guide() -> list[Check]:
    eps, rate, whirl = 0.6, 1.0, 2.0

    def load(theta: float) -> float:
        return (
            max(float(rate * cos(theta) + eps * whirl * np.sin(theta)), 0.0)
            * cos(theta)
            / (1.0 - eps * cos(theta)) ** 3
        )

    edge = float(np.arctan2(eps * whirl, rate))
    turning = guide_film_force(eps, 0.0, -0.5, True)
    return [
        check(
            "guide, film of 180 degrees, squeeze and whirl: radial force over mu L^3 R/c^2 [1/s]",
            expected=-quad(load, edge - 0.5 * pi, edge + 0.5 * pi, epsrel=1e-12)[0],
            computed=guide_film_force(eps, rate, whirl, True)[0],
            tolerance=5e-14,
            source="short bearing (Ocvirk 1952; Booker 1965) by quadrature",
        ),
        check(
            "the same, journal that turns: tangential force over mu w L^3 R/c^2 [-]",
            expected=pi * eps / (4.0 * (1.0 - eps**2) ** 1.5),
            computed=turning[1],
            tolerance=5e-14,
            source="Ocvirk (1952)",
        ),
    ]
