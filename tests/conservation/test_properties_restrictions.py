"""Truth: second law, odd symmetry and monotony. What holds for every restriction of every size.

Diameters from 1 um to 1 m, viscosities from gas to syrup, pressures from zero to 4000 bar, steps
from 1 ns to 1 ms; the densities are those of the fluid at each pressure.
"""

from math import pi, sqrt

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from property_profiles import examples, log_range

from klack.hydraulics.annulus import Annulus, annulus_step
from klack.hydraulics.film import ConeFilm, DiscFilm, RingFilm, mean_flow_factor
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.fluid_table import fluid_at, fluid_table
from klack.hydraulics.land_face import land_areas
from klack.hydraulics.orifice import Orifice, orifice_flow
from klack.hydraulics.pressure_viscosity import CONSTANT
from klack.hydraulics.seat import Seat, seat_step
from klack.network.step_function import evaluate

AMBIENT = 101_325.0
FLUID = library_fluid("n-heptane").at(293.15, gas_fraction=1e-3)
TABLE = fluid_table(FLUID, AMBIENT)
VAPOUR = FLUID.vapour_pressure

PRESSURES = log_range(1.0, 4e8)
VISCOSITIES = log_range(1e-5, 10.0)
SIZES = log_range(1e-6, 1.0)
SHARES = st.floats(0.05, 1.0)
CAVITATION = st.none() | SHARES

ORIFICES = st.builds(
    Orifice,
    diameter=SIZES,
    count=st.integers(1, 50),
    discharge=SHARES,
    critical_flow_number=log_range(1.0, 1e5),
    cavitation=CAVITATION,
)


@st.composite
def seats(draw) -> Seat:
    """Every shape, from a scratch to a gate."""
    diameter, shape = draw(SIZES), draw(st.sampled_from(["flat", "cone", "ball"]))
    more = {}
    if shape == "cone":
        more["half_angle"] = draw(st.floats(0.02, 1.55))
    if shape == "ball":
        more["ball_diameter"] = diameter * draw(st.floats(1.001, 20.0))
    return Seat(
        shape=shape,
        diameter=diameter,
        discharge=draw(SHARES),
        critical_flow_number=draw(log_range(1.0, 1e4)),
        land_width=draw(st.sampled_from([0.0, 0.1])) * diameter,
        leak_area=draw(st.sampled_from([0.0, 1e-6])) * diameter**2,
        cavitation=draw(CAVITATION),
        **more,
    )


ANNULI = st.builds(
    lambda d, length, clearance, eccentricity: Annulus(
        diameter=d, length=length * d, clearance=clearance * d, eccentricity=eccentricity
    ),
    SIZES,
    log_range(0.01, 10.0),
    log_range(1e-5, 0.1),
    st.floats(0.0, 0.999),
)


def through_orifice(part: Orifice, viscosity: float, p_a: float, p_b: float) -> np.ndarray:
    """Flow and both slopes."""
    densities = (fluid_at(TABLE, p, 0)[0] for p in (p_a, p_b))
    return np.array(orifice_flow(p_a, p_b, *densities, *part.parameters(viscosity, VAPOUR)))


def through_seat(
    part: Seat, viscosity: float, p_a: float, p_b: float, lift: float = 0.0
) -> np.ndarray:
    """Flow, both slopes and both forces, of a needle at rest."""
    rho_a, rho_b = (fluid_at(TABLE, p, 0)[0] for p in (p_a, p_b))
    inputs = [0.0, 1e-6, p_a, p_b, rho_a, rho_b, lift, lift, 0.0, 0.0]
    par = part.parameters(viscosity, VAPOUR)
    status, out = evaluate(seat_step, par, np.zeros(5), inputs, 10)
    assert status == 0
    return out[:5]


def energy_lost(flow: float, p_a: float, p_b: float) -> tuple[float, float]:
    """What a flow loses on its way [W], and the scale of its round-off."""
    g_a, g_b = (fluid_at(TABLE, p, 0)[2] for p in (p_a, p_b))
    return (g_a - g_b) * flow, (abs(g_a) + abs(g_b)) * abs(flow)


def judge_a_flow(values: np.ndarray, mirrored: np.ndarray, p_a: float, p_b: float) -> None:
    flow, slope_a, slope_b = values[:3]
    assert np.all(np.isfinite(values))
    assert flow * (p_a - p_b) >= 0.0  # downhill, and none where both sides are alike
    lost, scale = energy_lost(flow, p_a, p_b)
    assert lost >= -1e-12 * scale
    assert slope_a >= 0.0
    assert slope_b <= 0.0
    # the other way round: the same, with both ends exchanged
    assert np.array_equal(mirrored[:3], [-flow, -slope_b, -slope_a])


@examples(150)
@given(ORIFICES, VISCOSITIES, PRESSURES, PRESSURES)
def test_an_orifice_lets_fluid_run_downhill_alike_both_ways(part, viscosity, p_a, p_b):
    values = through_orifice(part, viscosity, p_a, p_b)
    judge_a_flow(values, through_orifice(part, viscosity, p_b, p_a), p_a, p_b)
    # never more than without friction, nor than a throat at vapour pressure lets through
    up, density = max(p_a, p_b), fluid_at(TABLE, max(p_a, p_b), 0)[0]
    area = part.count * part.hole_area
    most = part.discharge * area * sqrt(2.0 * density * abs(p_a - p_b))
    assert abs(values[0]) <= most * (1.0 + 1e-12)
    if part.cavitation is not None and up > VAPOUR:
        choked = part.cavitation * area * sqrt(2.0 * density * (up - VAPOUR))
        assert abs(values[0]) <= choked * (1.0 + 1e-12)


@examples(100)
@given(ORIFICES, VISCOSITIES, PRESSURES, st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_more_pressure_drives_no_less_through_an_orifice(part, viscosity, p_a, x, y):
    """At one density before it; the pressure behind it falls."""
    least, most = sorted((x, y))
    flows = [through_orifice(part, viscosity, p_a, p_a * (1.0 - z))[0] for z in (least, most)]
    assert flows[1] >= flows[0] * (1.0 - 1e-14)


@examples(60)
@given(ORIFICES, VISCOSITIES, log_range(1e3, 1e8))
def test_an_orifice_is_linear_at_rest_and_a_root_far_from_it(part, viscosity, pressure):
    free = part.model_copy(update={"cavitation": None})
    size, flow_number = part.hole_area * part.count, part.critical_flow_number
    density = fluid_at(TABLE, pressure, 0)[0]
    unit = viscosity**2 * flow_number**2 / (8.0 * density * part.diameter**2)  # [Pa] of 2L/lc = 1
    little = 1e-8 * unit
    if 1e-6 * pressure < little < 0.5 * pressure:
        flow = through_orifice(free, viscosity, pressure, pressure - little)[0]
        slope = 4.0 * part.discharge * size * part.diameter * density / (viscosity * flow_number)
        assert flow == pytest.approx(slope * little, rel=1e-6, abs=0.0)  # tanh: 1e-8/3; drop: 1e-10
    drop = 0.9 * pressure
    if drop > 1e3 * unit:
        flow = through_orifice(free, viscosity, pressure, pressure - drop)[0]
        root = part.discharge * size * sqrt(2.0 * density * drop)
        assert flow == pytest.approx(root, rel=1e-6, abs=0.0)


@examples(150)
@given(seats(), VISCOSITIES, PRESSURES, PRESSURES, log_range(1e-9, 3.0))
def test_a_seat_lets_fluid_run_downhill_alike_both_ways(part, viscosity, p_a, p_b, share):
    lift = share * part.diameter
    values = through_seat(part, viscosity, p_a, p_b, lift)
    mirrored = through_seat(part, viscosity, p_b, p_a, lift)
    judge_a_flow(values, mirrored, p_a, p_b)
    assert np.array_equal(values[3:], -values[3:][::-1])  # what it does to both parts adds to none


@examples(100)
@given(seats(), VISCOSITIES, PRESSURES, PRESSURES, log_range(1e-9, 3.0), st.floats(0.0, 1.0))
def test_a_seat_opens_with_its_lift(part, viscosity, p_a, p_b, share, less):
    lift = share * part.diameter
    wide = abs(through_seat(part, viscosity, p_a, p_b, lift)[0])
    narrow = abs(through_seat(part, viscosity, p_a, p_b, less * lift)[0])
    shut = abs(through_seat(part, viscosity, p_a, p_b, -lift)[0])

    assert shut <= narrow * (1.0 + 1e-12)
    assert narrow <= wide * (1.0 + 1e-12)
    if part.leak_area == 0.0:
        assert shut == 0.0


@examples(150)
@given(
    ANNULI,
    VISCOSITIES,
    PRESSURES,
    PRESSURES,
    log_range(1e-9, 1e-3),
    *[st.floats(-10.0, 10.0)] * 2,
)
def test_an_annulus_turns_into_heat_what_it_takes(part, viscosity, p_a, p_b, h, needle, body):
    rho_a, rho_b = (fluid_at(TABLE, p, 0)[0] for p in (p_a, p_b))
    par = (part.conductance(viscosity), 0.5 * pi * part.diameter * part.clearance)
    par = (*par, part.drag(viscosity), *CONSTANT.numbers)
    moved = [0.0, h * needle, 0.0, h * body]
    status, out = evaluate(annulus_step, par, [], [0.0, h, p_a, p_b, rho_a, rho_b, *moved], 5)

    assert status == 0
    assert np.all(np.isfinite(out))
    assert out[1] >= 0.0 >= out[2]
    # at one density the loss is k dp^2 + drag v^2; the volume that is moved is the same
    status, out = evaluate(annulus_step, par, [], [0.0, h, p_a, p_b, 1.0, 1.0, *moved], 5)
    lost = (p_a - p_b) * out[0] - out[3] * needle - out[4] * body
    wanted = par[0] * (p_a - p_b) ** 2 + par[2] * (needle - body) ** 2
    scale = abs((p_a - p_b) * out[0]) + abs(out[3] * needle) + abs(out[4] * body) + wanted
    assert lost == pytest.approx(wanted, abs=1e-12 * scale)
    status, back = evaluate(
        annulus_step, par, [], [0.0, h, p_b, p_a, 1.0, 1.0, *np.negative(moved)], 5
    )
    np.testing.assert_allclose(back[[0, 3, 4]], -out[[0, 3, 4]], rtol=1e-12, atol=0.0)


@examples(60)
@given(SIZES, log_range(1e-9, 1e3))
def test_a_land_shares_its_ring_between_both_pressures(inner, wider):
    """The sum is the ring; the nearer to the axis, the smaller the ring, so the inside has less."""
    outer = inner * (1.0 + wider)
    assume(outer > inner)
    inside, outside = land_areas(inner, outer)
    ring = pi * (outer - inner) * (outer + inner)

    assert inside > 0.0
    assert outside > 0.0
    assert inside + outside == pytest.approx(ring, rel=1e-12, abs=0.0)
    assert inside <= outside


FILMS = st.one_of(
    st.builds(DiscFilm, shape=st.just("disc"), radius=SIZES),
    st.builds(
        lambda r, x: RingFilm(shape="ring", inner_radius=r, outer_radius=r * (1.0 + x)),
        SIZES,
        log_range(1e-6, 1e3),
    ),
    st.builds(
        lambda r, w, angle: ConeFilm(shape="cone", mean_radius=r, width=w * r, half_angle=angle),
        SIZES,
        log_range(1e-6, 1.9),
        st.floats(0.01, pi / 2),
    ),
)


@examples(100)
@given(FILMS, VISCOSITIES, log_range(1e-6, 2.0))
def test_a_film_resists_and_a_rough_one_resists_more(film, viscosity, roughness):
    """Asperities stand in the way: the factor is 1 - 0.9 exp(-0.28) = 0.32 where the fit ends."""
    row = film.film_row(viscosity, 1e5)
    height = film.lowest_height
    steep = film.normal(1.0)
    rough = film.model_copy(update={"roughness": roughness * height * steep, "cut_off": height})
    harder = rough.film_row(viscosity, 1e5)

    assert row.cubic > 0.0
    assert row.linear >= 0.0
    assert row.suction == pytest.approx(1e5 * film.area, rel=1e-14)
    assert row.cubic * (1.0 - 1e-9) <= harder.cubic <= row.cubic / 0.31
    assert harder.linear == row.linear


@examples(60)
@given(SIZES, log_range(1e-6, 1e-3))
def test_a_narrow_ring_and_a_flat_cone_are_one_film(radius, narrow):
    """Both are a land of length 2 pi r; its curvature counts with the square of its width."""
    width = narrow * radius
    ring = RingFilm(
        shape="ring", inner_radius=radius - 0.5 * width, outer_radius=radius + 0.5 * width
    )
    cone = ConeFilm(shape="cone", mean_radius=radius, width=width, half_angle=pi / 2)
    # differences of radii: 1e-16 / narrow, three times
    assert ring.coefficients()[0] == pytest.approx(cone.coefficients()[0], rel=1e-8 + narrow**2)


@examples(60)
@given(log_range(0.5, 1e6), log_range(1.0, 10.0))
def test_a_flow_factor_rises_to_one_with_the_gap(lowest, more):
    near, far = mean_flow_factor(lowest), mean_flow_factor(more * lowest)
    assert 0.0 < near <= far * (1.0 + 1e-12) <= 1.0 + 1e-9
