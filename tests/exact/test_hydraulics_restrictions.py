"""Truth: limits and closed formulas of restrictions, and geometry computed a second way."""

from math import cos, hypot, log, pi, sin, sqrt, tanh

import numpy as np
import pytest
from draws import each
from scipy.integrate import quad

from klack.hydraulics.annulus import Annulus, annulus_step, eccentricity_factor
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.land_face import land_areas
from klack.hydraulics.orifice import Orifice, _tanh, choked_flow, orifice_step
from klack.hydraulics.seat import (
    Seat,
    ball_opening,
    cone_opening,
    flat_opening,
    gap_flow,
    seat_step,
)
from klack.network.rows import Ambient, Rows
from klack.network.step_function import evaluate

BAR = 1e5
MU, RHO, P_V = 4.05e-4, 685.8, 4.7e3  # n-heptane at 20 C
RADIUS, LIFT = 0.75e-3, 60e-6


def orifice(p_a, p_b, rho_a=RHO, rho_b=RHO, mu=MU, **numbers):
    numbers = {"diameter": 0.5e-3, "cavitation": None, **numbers}
    par = Orifice(**numbers).parameters(mu, P_V)
    status, out = evaluate(orifice_step, par, [], [0.0, 2e-8, p_a, p_b, rho_a, rho_b], 3)
    assert status == 0
    return out


def seat(p_a, p_b, lift=LIFT, before=None, h=2e-8, body=0.0, mu=MU, **numbers):
    numbers = {"shape": "cone", "half_angle": 0.8, "cavitation": None, **numbers}
    if numbers["shape"] != "cone":
        del numbers["half_angle"]
    par = Seat(diameter=2 * RADIUS, **numbers).parameters(mu, P_V)
    state = [0.0, 0.0, 0.0, *((0.0, 0.0) if before is None else (before, 1.0))]
    moved = lift + body
    inputs = [0.0, h, p_a, p_b, RHO, RHO, moved, moved, body, body]
    status, out = evaluate(seat_step, par, state, inputs, 10)
    assert status == 0
    return out


# ---- orifice ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("diameter", "p_a", "p_b", "rho", "mu"),
    [(1.0, 2.0, 1.0, 1.0, 1e-6), (0.5e-3, 6 * BAR, 1 * BAR, RHO, MU)],
    ids=["unit scale", "valve"],
)
def test_orifice_is_turbulent_at_a_large_flow_number(diameter, p_a, p_b, rho, mu):
    mdot = orifice(p_a, p_b, rho, rho, mu, diameter=diameter, discharge=0.62)[0]

    exact = 0.62 * pi / 4 * diameter**2 * sqrt(2 * rho * (p_a - p_b))
    assert mdot == pytest.approx(exact, rel=1e-12)


@pytest.mark.parametrize("drop", [0.0, 1e-9, -1e-9, 1e-12])
def test_orifice_at_rest_has_the_slope_of_sampson(drop):
    discharge, size = 0.7, 0.5e-3
    number = 24 * pi * discharge  # pi C_q D^3/(lambda_c mu) = D^3/(24 mu)
    out = orifice(drop, 0.0, diameter=size, discharge=discharge, critical_flow_number=number)

    sampson = RHO * size**3 / (24 * MU)
    assert number == pytest.approx(52.8, rel=1e-3)
    assert out[0] == pytest.approx(sampson * drop, rel=1e-8)  # X^2/3 = 1e-9
    assert out[1] == pytest.approx(sampson, rel=1e-8)
    assert out[2] == -out[1]


@pytest.mark.parametrize("drop", [1e-6, 1.0, 20.0, 30.0, 300.0, 3e3, 1e4, 3e5])
def test_orifice_follows_the_hyperbolic_tangent(drop):
    mu, size = 0.04, 0.5e-3
    out = orifice(2 * BAR + drop, 2 * BAR, mu=mu, diameter=size)

    drop = (2 * BAR + drop) - 2 * BAR  # as it was rounded
    number = size * RHO / mu * sqrt(2 * drop / RHO)
    exact = 0.7 * tanh(2 * number / 1000) * pi / 4 * size**2 * sqrt(2 * RHO * drop)
    assert out[0] == pytest.approx(exact, rel=1e-14)


def test_hyperbolic_tangent_is_that_of_the_library():
    for x in np.concatenate([np.geomspace(1e-12, 30.0, 400), [0.0499999, 0.0500001, 20.0, 20.01]]):
        t, ratio = _tanh(x)

        assert t == pytest.approx(tanh(x), rel=1e-14, abs=0.0)
        assert ratio == pytest.approx(tanh(x) / x, rel=1e-14, abs=0.0)
    assert _tanh(0.0) == (0.0, 1.0)


@each("contraction", [None, 0.62])
@each("p_b", [BAR, 0.4 * BAR, 5.0e3, 4.0e3])
@each("p_a", [4.1e3, 5.2e3, 0.3 * BAR, 1.001 * BAR, 6 * BAR])
def test_orifice_slopes_are_derivatives_and_have_their_signs(p_a, p_b, contraction):
    numbers = {"cavitation": contraction, "mu": 0.04}
    out = orifice(p_a, p_b, 684.0, 686.0, **numbers)
    step = 1e-4 * abs(p_a - p_b)
    by_a = orifice(p_a + step, p_b, 684, 686, **numbers)[0]
    by_a = (by_a - orifice(p_a - step, p_b, 684, 686, **numbers)[0]) / (2 * step)
    by_b = orifice(p_a, p_b + step, 684, 686, **numbers)[0]
    by_b = (by_b - orifice(p_a, p_b - step, 684, 686, **numbers)[0]) / (2 * step)

    scale = max(abs(by_a), abs(by_b))
    # central differences: square of the relative step
    np.testing.assert_allclose(out[1:], [by_a, by_b], rtol=1e-6, atol=1e-7 * scale)
    assert out[1] >= 0.0
    assert out[2] <= 0.0
    assert out[0] * (p_a - p_b) >= 0.0


def test_orifice_runs_backwards_as_forwards():
    there = orifice(6 * BAR, BAR, 690.0, 680.0, cavitation=0.62)
    back = orifice(BAR, 6 * BAR, 680.0, 690.0, cavitation=0.62)

    np.testing.assert_array_equal(back, [-there[0], -there[2], -there[1]])


def test_holes_side_by_side_add_and_area_is_as_good_as_diameter():
    one = orifice(6 * BAR, BAR)
    by_area = Orifice(area=pi / 4 * 0.25e-6).parameters(MU, P_V)

    np.testing.assert_allclose(orifice(6 * BAR, BAR, count=4), 4 * one, rtol=1e-14)
    np.testing.assert_allclose(by_area, Orifice(diameter=0.5e-3).parameters(MU, P_V), rtol=1e-14)


# ---- cavitation -------------------------------------------------------------------------------


def test_choked_flow_is_that_of_nurick_and_knows_no_downstream_pressure():
    flows = [orifice(6 * BAR, p, cavitation=0.6) for p in (BAR, 0.5 * BAR, 10.0)]

    limit = 0.6 * pi / 4 * 0.5e-3**2 * sqrt(2 * RHO * (6 * BAR - P_V))
    for mdot, up, down in flows:
        assert mdot == pytest.approx(limit, rel=1e-14)
        assert up == pytest.approx(0.5 * limit / (6 * BAR - P_V), rel=1e-14)
        assert down == 0.0


def test_limit_joins_its_rounded_foot_and_ends_at_the_vapour_pressure():
    def limit(head):
        return choked_flow(1.0, 1.0, -1.0, P_V + head, RHO, 1e-7, P_V)

    below, above = limit(1e3 - 1e-6), limit(1e3 + 1e-6)
    np.testing.assert_allclose(below, above, rtol=1e-8)
    heads = np.linspace(0.0, 2e3, 81)
    flows = np.array([limit(head)[0] for head in heads])
    assert np.all(np.diff(flows) > 0)
    slopes = np.array([limit(head)[1] for head in heads])
    # central differences over 25 Pa: the root's third derivative, away from the joint
    smooth = (heads[1:-1] > 0) & (np.abs(heads[1:-1] - 1e3) > 30)
    differences = (flows[2:] - flows[:-2]) / (heads[2:] - heads[:-2])
    np.testing.assert_allclose(slopes[1:-1][smooth], differences[smooth], rtol=2e-4)
    assert limit(-1.0) == (0.0, 0.0, 0.0)
    assert choked_flow(1.0, 1.0, -1.0, P_V, RHO, 0.0, P_V) == (1.0, 1.0, -1.0)


# ---- gap and edge in series -------------------------------------------------------------------


@each("drop", [-5e5, -1e-3, 0.0, 1e-12, 1.0, 5e5, 1e8])
@each(("a", "b"), [(1.0, 1.0), (1e12, 1e17), (1e9, 1e20), (1e16, 1e12)])
def test_gap_law_inverts_its_pressure_drop(drop, a, b):
    Q, slope = gap_flow(drop, a, b)

    assert a * Q + b * Q * abs(Q) == pytest.approx(drop, rel=1e-14)
    assert slope == pytest.approx(1.0 / (a + 2 * b * abs(Q)), rel=1e-14)


def test_gap_law_has_both_limits():
    assert gap_flow(1e-4, 1e12, 1e17)[0] == pytest.approx(1e-4 / 1e12, rel=1e-10)
    assert gap_flow(5e5, 1e3, 1e17)[0] == pytest.approx(sqrt(5e5 / 1e17), rel=1e-8)


# ---- seats ------------------------------------------------------------------------------------


def frustum(edge, foot):
    """Area of the cone mantle between two circles given as (radius, height)."""
    return pi * (edge[0] + foot[0]) * hypot(edge[0] - foot[0], edge[1] - foot[1])


@pytest.mark.parametrize("angle", [0.35, 0.7854, 1.2])
@pytest.mark.parametrize("lift", [1e-9, 40e-6, 400e-6])
def test_cone_opens_the_frustum_between_edge_and_foot(angle, lift):
    # cone through the edge (r, 0) when closed; raised by the lift; foot of the normal on it
    along = np.array([sin(angle), cos(angle)])  # apex below, widening upwards
    to_edge = np.array([RADIUS, 0.0]) - np.array([RADIUS, lift])
    foot = np.array([RADIUS, lift]) + along * (to_edge @ along)

    area, gap = cone_opening(lift, RADIUS, sin(angle), cos(angle))

    assert gap == pytest.approx(hypot(foot[0] - RADIUS, foot[1]), rel=1e-12)
    assert area == pytest.approx(frustum((RADIUS, 0.0), foot), rel=1e-12)


@pytest.mark.parametrize("ball", [0.8e-3, 1e-3, 3e-3])
@pytest.mark.parametrize("lift", [1e-9, 40e-6, 400e-6])
def test_ball_opens_the_frustum_between_edge_and_nearest_point(ball, lift):
    x0 = sqrt(ball**2 - RADIUS**2)
    centre = np.array([0.0, x0 + lift])
    away = np.array([RADIUS, 0.0]) - centre
    foot = centre + ball * away / np.linalg.norm(away)

    area, gap = ball_opening(lift, RADIUS, ball, x0)

    # the way round by the foot loses digits at 1 nm: 1 um/1 nm * 1e-16
    tolerance = 1e-12 if lift > 1e-6 else 1e-6
    assert gap == pytest.approx(hypot(foot[0] - RADIUS, foot[1]), rel=tolerance)
    assert area == pytest.approx(frustum((RADIUS, 0.0), foot), rel=tolerance)


def test_flat_opens_a_cylinder():
    assert flat_opening(LIFT, RADIUS) == pytest.approx((2 * pi * RADIUS * LIFT, LIFT), rel=1e-15)


def test_cone_area_stays_where_its_foot_reaches_the_axis():
    s, c = sin(0.8), cos(0.8)
    top = RADIUS / (s * c)

    assert cone_opening(top, RADIUS, s, c)[0] == pytest.approx(pi * RADIUS**2 / c, rel=1e-14)
    assert cone_opening(5 * top, RADIUS, s, c)[0] == pytest.approx(pi * RADIUS**2 / c, rel=1e-14)


SHAPES = [
    {"shape": "flat"},
    {"shape": "cone", "half_angle": 0.6},
    {"shape": "ball", "ball_diameter": 2e-3},
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: s["shape"])
def test_wide_open_seat_is_limited_by_the_bore(shape):
    area = pi / 4 * 1.2e-3**2

    out = seat(6 * BAR, BAR, lift=5e-3, bore_diameter=1.2e-3, **shape)

    assert out[6] == pytest.approx(area, rel=1e-14)
    # the laminar term of 5 mm gap is 1e-5 of the drop
    assert out[0] == pytest.approx(0.7 * area * sqrt(2 * RHO * 5 * BAR), rel=1e-4)


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: s["shape"])
def test_barely_open_seat_is_the_viscous_gap_of_its_land(shape):
    lift, width, drop = 0.3e-6, 0.2e-3, 100.0
    h = lift * sin(Seat(diameter=2 * RADIUS, **shape).surface_angle)

    out = seat(BAR + drop, BAR, lift=lift, land_width=width, **shape)

    slot = RHO * pi * 2 * RADIUS * h**3 * drop / (12 * MU * width)
    # the edge in series: lambda_c h/(100 C_q w) or so
    assert out[0] == pytest.approx(slot, rel=0.04)
    assert out[0] < slot


@pytest.mark.parametrize("lift", [0.0, -3e-6, 1e-15])
@pytest.mark.parametrize("drop", [-5 * BAR, 0.0, 5 * BAR])
def test_closed_seat_is_tight_or_leaks_through_its_leak_area(lift, drop):
    tight = seat(6 * BAR + drop, 6 * BAR, lift=lift)
    leaking = seat(6 * BAR + drop, 6 * BAR, lift=lift, leak_area=1e-12)

    np.testing.assert_array_equal(tight[:5], 0.0)
    assert tight[5] == max(lift, 0.0)
    hole = orifice(6 * BAR + drop, 6 * BAR, diameter=sqrt(4e-12 / pi), critical_flow_number=100.0)
    np.testing.assert_allclose(leaking[:3], hole, rtol=1e-12)
    assert np.all(leaking[3:5] == 0.0)


@pytest.mark.parametrize("lift", [1e-6, 60e-6])
@pytest.mark.parametrize("p_a", [0.3 * BAR, 1.001 * BAR, 6 * BAR])
def test_seat_slopes_are_derivatives(p_a, lift):
    numbers = {"lift": lift, "land_width": 0.2e-3, "leak_area": 1e-11, "cavitation": 0.62}
    step = 1e-4 * abs(p_a - BAR)
    out = seat(p_a, BAR, **numbers)
    by_a = seat(p_a + step, BAR, **numbers)[0] - seat(p_a - step, BAR, **numbers)[0]
    by_b = seat(p_a, BAR + step, **numbers)[0] - seat(p_a, BAR - step, **numbers)[0]

    slopes = np.array([by_a, by_b]) / (2 * step)
    np.testing.assert_allclose(out[1:3], slopes, rtol=1e-6, atol=1e-7 * max(slopes))


def test_only_the_distance_of_needle_and_body_opens_the_seat():
    np.testing.assert_allclose(seat(6 * BAR, BAR, body=25e-6), seat(6 * BAR, BAR), rtol=1e-10)


# ---- flow forces ------------------------------------------------------------------------------


@pytest.mark.parametrize(("p_a", "p_b"), [(6 * BAR, BAR), (BAR, 6 * BAR)])
def test_jet_closes_with_twice_the_pressure_on_the_contracted_area(p_a, p_b):
    out = seat(p_a, p_b, flow_force={"velocity_coefficient": 0.98}, critical_flow_number=1.0)

    area = out[6]
    exact = -2 * 0.7 * 0.98 * area * 5 * BAR * cos(0.8)
    # turbulent but for 1e-4 of the drop in the viscous term, which makes no jet
    assert out[3] == pytest.approx(exact, rel=2e-4)
    assert abs(out[3]) < abs(exact)
    assert out[4] == -out[3]
    momentum = 0.98 * cos(0.8) * out[0] ** 2 / (RHO * 0.7 * area)
    assert out[3] == pytest.approx(-momentum, rel=1e-14)


def test_jet_of_a_flat_seat_leaves_sideways():
    assert abs(seat(6 * BAR, BAR, shape="flat", flow_force={})[3]) < 1e-16


def test_change_of_flow_pushes_the_needle():
    force = {"velocity_coefficient": 0.0, "damping_length": 2e-3}
    first = seat(6 * BAR, BAR, flow_force=force)
    later = seat(6 * BAR, BAR, flow_force=force, before=0.5 * first[0])
    started = seat(6 * BAR, BAR, flow_force=force, before=0.5 * first[0], h=0.0)

    assert first[3] == 0.0  # nothing is known of the flow before
    assert later[3] == pytest.approx(-2e-3 * 0.5 * first[0] / 2e-8, rel=1e-12)
    assert started[3] == 0.0


# ---- annulus ----------------------------------------------------------------------------------

HEPTANE = library_fluid("n-heptane").at(293.15)
VISCOSITY = float(HEPTANE.viscosity(Ambient().pressure))
GUIDE = {"diameter": 4e-3, "length": 10e-3, "clearance": 5e-6}


def annulus(p_a, p_b, needle=0.0, body=0.0, h=2e-8, rho=(RHO, RHO), **numbers):
    handles = {"a": 0, "b": 1, "needle": 0, "body": 1}
    rows = Rows(ambient=Ambient(), fluid=HEPTANE, handles=handles)
    Annulus(**GUIDE, **numbers).add_rows(rows)
    inputs = [0.0, h, p_a, p_b, *rho, 0.0, needle * h, 0.0, body * h]
    status, out = evaluate(annulus_step, rows.branches[0].parameters, [], inputs, 5)
    assert status == 0
    return out


@pytest.mark.parametrize(("eccentricity", "factor"), [(0.0, 1.0), (0.5, 1.375), (1.0, 2.5)])
def test_eccentric_annulus_leaks_more(eccentricity, factor):
    around = quad(lambda t: (1 + eccentricity * cos(t)) ** 3, 0, 2 * pi)[0] / (2 * pi)

    assert eccentricity_factor(eccentricity) == factor
    assert around == pytest.approx(factor, rel=1e-12)


@pytest.mark.parametrize("eccentricity", [0.0, 0.5, 0.9])
def test_annulus_leak_and_drag_are_means_around_it(eccentricity):
    d, length, c = GUIDE.values()
    leak = annulus(3 * BAR, BAR, eccentricity=eccentricity)[0]
    drag = -annulus(BAR, BAR, needle=0.5, eccentricity=eccentricity)[3]

    def gap(t):
        return c * (1 + eccentricity * cos(t))

    slot = quad(lambda t: gap(t) ** 3 * d / 2, 0, 2 * pi)[0] * 2 * BAR / (12 * VISCOSITY * length)
    shear = quad(lambda t: VISCOSITY * 0.5 / gap(t) * d / 2, 0, 2 * pi)[0] * length
    assert leak == pytest.approx(RHO * slot, rel=1e-9)
    assert drag == pytest.approx(shear, rel=1e-9)


def test_annulus_carries_half_of_the_gap_with_the_needle_and_all_of_it_with_both():
    ring = pi * 4e-3 * 5e-6

    assert annulus(BAR, BAR, needle=0.5)[0] == pytest.approx(RHO * ring * 0.25, rel=1e-12)
    together = annulus(BAR, BAR, needle=0.5, body=0.5)
    assert together[0] == pytest.approx(RHO * ring * 0.5, rel=1e-12)
    np.testing.assert_allclose(together[3:], 0.0, atol=1e-18)


@pytest.mark.parametrize(("needle", "density"), [(0.5, 700.0), (-0.5, 600.0)])
def test_annulus_carries_the_fluid_that_enters_it(needle, density):
    """From a to b with the needle, or back: what stood before the gap, whatever the pressures."""
    flow = annulus(BAR, BAR, needle=needle, rho=(700.0, 600.0))[0]

    assert flow == pytest.approx(density * pi * 4e-3 * 5e-6 * 0.5 * needle, rel=1e-12, abs=0.0)


@pytest.mark.parametrize(("pressures", "density"), [((3, 1), 700.0), ((1, 3), 600.0)])
def test_annulus_leaks_the_fluid_that_enters_it(pressures, density):
    alike = annulus(*(p * BAR for p in pressures))[0]
    flow = annulus(*(p * BAR for p in pressures), rho=(700.0, 600.0))[0]

    assert flow == pytest.approx(alike * density / RHO, rel=1e-12, abs=0.0)


def test_pressure_on_the_gap_is_carried_by_both_walls_half_each():
    np.testing.assert_allclose(annulus(3 * BAR, BAR)[3:], pi * 4e-3 * 5e-6 * BAR, rtol=1e-12)


# ---- land -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("r1", "r2"), [(0.5e-3, 0.75e-3), (0.7e-3, 0.701e-3), (1.0, 3.0)])
def test_land_areas_carry_the_laminar_pressure(r1, r2):
    p1, p2 = 7.0, 2.0
    inside, outside = land_areas(r1, r2)

    def pressure(r):
        return p1 + (p2 - p1) * log(r / r1) / log(r2 / r1)

    force = quad(lambda r: 2 * pi * r * pressure(r), r1, r2, epsabs=0.0)[0]
    assert inside * p1 + outside * p2 == pytest.approx(force, rel=1e-10)
