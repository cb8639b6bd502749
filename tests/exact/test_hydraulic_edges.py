"""Edges of spools, notches, fittings and pipes.

Truth: closed formulas of spool edges, fittings and pipes, and of elastic walls.

Truth: limits of notched spool edges, and what is refused; areas are checks of `klack verify`.
"""

from math import cos, log10, pi, radians, sqrt

import numpy as np
import pytest
from scipy.optimize import brentq

from klack.errors import InputError
from klack.hydraulics.chamber import Chamber
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.line import Line
from klack.hydraulics.line_friction import laminar_resistance
from klack.hydraulics.notch import Notch, notch_opening
from klack.hydraulics.pipe_friction import PipeFriction
from klack.hydraulics.pressure_face import PressureFace
from klack.hydraulics.pressure_loss import PressureLoss
from klack.hydraulics.spool_edge import SpoolEdge
from klack.hydraulics.wall_compliance import Wall, tube_compliance
from klack.mechanics.rigid_mass import RigidMass
from klack.network.network import Network
from klack.network.rows import Ambient, Rows
from klack.network.step_function import evaluate
from klack.simulation.network_run import simulate_network
from klack.verification.benches import RHO_OIL as RHO
from klack.verification.benches import branch_of, branch_step

AMBIENT = Ambient()
OIL = library_fluid("ISO VG 46").at(313.15)
RHO_EDGES = float(OIL.density(AMBIENT.pressure))
MU = float(OIL.viscosity(AMBIENT.pressure))
HANDLES = {"a": 1, "b": 2, "spool": 0, "body": -1}
EDGE = {"diameter": 6e-3, "radial_clearance": 4e-6, "overlap": 50e-6, "cavitation": None}


def step(part, p_a, p_b, y=0.0, body=0.0):
    rows = Rows(ambient=AMBIENT, fluid=OIL, component="part", handles=HANDLES)
    part.add_rows(rows)
    (row,) = rows.branches
    ports = (y, y, body, body) if row.ports else ()
    size = 3 + len(row.ports) + row.state.size
    status, out = evaluate(
        row.step,
        row.parameters,
        row.state,
        [0.0, 1e-6, p_a, p_b, RHO_EDGES, RHO_EDGES, *ports],
        size,
    )
    assert status == 0
    return out


# ---- spool edge -----------------------------------------------------------------------------


@pytest.mark.parametrize(("direction", "sign"), [("opening", 1.0), ("closing", -1.0)])
@pytest.mark.parametrize("opening", [0.0, 3e-6, 50e-6, 400e-6])
@pytest.mark.parametrize("width", [None, 4e-3])
def test_area_of_an_open_edge_is_that_of_the_aslant_slot(direction, sign, opening, width):
    part = SpoolEdge(**EDGE, direction=direction, width=width, critical_flow_number=1e-8)
    out = step(part, 50e5, 20e5, y=sign * (opening + 50e-6) + 7e-6, body=7e-6)

    area = (width or pi * 6e-3) * sqrt(opening**2 + (4e-6) ** 2)
    assert out[5] == pytest.approx(opening, abs=1e-15)
    assert out[6] == pytest.approx(area, rel=1e-9)
    assert out[0] == pytest.approx(0.7 * area * sqrt(2 * RHO_EDGES * 30e5), rel=1e-8)


@pytest.mark.parametrize("covered", [0.2e-3, 1e-3, 5e-3])
@pytest.mark.parametrize("eccentricity", [0.0, 1.0])
def test_leakage_of_a_closed_edge_is_that_of_its_annulus(covered, eccentricity):
    part = SpoolEdge(**{**EDGE, "overlap": covered}, direction="opening", eccentricity=eccentricity)
    out = step(part, 50e5, 20e5)

    slot = pi * 6e-3 * (4e-6) ** 3 / (12 * MU * covered) * (1 + 1.5 * eccentricity**2)
    # the edge in series takes lambda_c c/(96 C_q L) of the drop, and something of the turbulent one
    edge = 100 * 4e-6 / (96 * 0.7 * covered) * (1 + 1.5 * eccentricity**2)
    assert out[0] / RHO_EDGES == pytest.approx(slot * 30e5, rel=1.2 * edge)
    assert out[0] / RHO_EDGES < slot * 30e5


@pytest.mark.slow
def test_flow_is_continuous_where_the_edge_opens_and_rises_with_the_opening():
    part = SpoolEdge(**EDGE, direction="opening")
    y = 50e-6 + np.linspace(-2e-6, 2e-6, 4001)
    flow = np.array([step(part, 50e5, 20e5, y=x)[0] for x in y])

    assert np.all(np.diff(flow) > -1e-15 * flow.max())
    assert np.max(np.diff(flow)) < 3e-3 * flow.max()  # 1 nm of 4 um


def test_jet_pulls_the_spool_shut_on_either_side():
    for direction, sign in (("opening", 1.0), ("closing", -1.0)):
        for p_a, p_b in ((60e5, 10e5), (10e5, 60e5)):
            part = SpoolEdge(
                **EDGE,
                direction=direction,
                critical_flow_number=1e-6,
                flow_force={"velocity_coefficient": 0.98},
            )
            out = step(part, p_a, p_b, y=sign * 250e-6)
            fade = 200 / sqrt(200**2 + 4**2)
            # 2 C_q C_v A dp cos(theta) of Merritt, eq. 5-32
            force = 2 * 0.7 * 0.98 * out[6] * 50e5 * cos(radians(69.0)) * fade
            assert out[3] == pytest.approx(-sign * force, rel=1e-6)
            assert out[4] == -out[3]


def test_an_underlapped_edge_is_open_at_the_start_and_a_port_limits_it():
    part = SpoolEdge(**{**EDGE, "overlap": -30e-6}, direction="opening", largest_area=1e-6)

    assert step(part, 50e5, 20e5)[5] == pytest.approx(30e-6, rel=1e-12)
    assert step(part, 50e5, 20e5, y=1e-3)[6] == 1e-6


# ---- pressure loss --------------------------------------------------------------------------


@pytest.mark.parametrize("drop", [1.0, 1e3, 1e5, -1e3, -1e5])
def test_pressure_loss_is_that_of_hooper(drop):
    part = PressureLoss(
        diameter=10e-3, coefficient=0.25, reverse_coefficient=0.6, laminar_coefficient=800
    )
    out = step(part, 20e5 + drop, 20e5)

    speed = abs(out[0]) / RHO_EDGES / (pi / 4 * 1e-4)
    reynolds = RHO_EDGES * speed * 10e-3 / MU
    zeta = 800 / reynolds + (0.25 if drop > 0 else 0.6)
    assert zeta * RHO_EDGES / 2 * speed**2 == pytest.approx(abs((20e5 + drop) - 20e5), rel=1e-12)
    assert np.sign(out[0]) == np.sign(drop)
    up, down = (step(part, 20e5 + drop * s, 20e5)[0] for s in (1 + 1e-4, 1 - 1e-4))
    assert out[1] == pytest.approx((up - down) / (2e-4 * abs(drop)) * np.sign(drop), rel=1e-4)
    assert out[2] == -out[1]


def test_a_sudden_expansion_recovers_what_borda_and_carnot_leave():
    small, large = pi / 4 * (5e-3) ** 2, pi / 4 * (8e-3) ** 2
    zeta = (1 - small / large) ** 2
    out = step(PressureLoss(area=small, coefficient=zeta, laminar_coefficient=1e-6), 3e5, 1e5)

    v1 = out[0] / RHO_EDGES / small
    v2 = v1 * small / large
    # momentum over the step, less Bernoulli: rho/2 (v1 - v2)^2
    assert RHO_EDGES / 2 * (v1 - v2) ** 2 == pytest.approx(2e5, rel=1e-9)


# ---- pipe friction --------------------------------------------------------------------------


@pytest.mark.parametrize("roughness", [0.0, 1e-5, 5e-4])
@pytest.mark.parametrize("reynolds", [1e-3, 100.0, 2299.0, 4001.0, 1e5, 1e7])
def test_pipe_friction_is_that_of_hagen_poiseuille_and_colebrook(reynolds, roughness):
    D, L = 10e-3, 2.0
    if reynolds < 2300:
        f = 64 / reynolds
    else:
        f = brentq(
            lambda f: 1 / sqrt(f) + 2 * log10(roughness / D / 3.7 + 2.51 / (reynolds * sqrt(f))),
            1e-3,
            1.0,
            xtol=1e-16,
            rtol=1e-14,
        )
    speed = reynolds * MU / (RHO_EDGES * D)
    drop = f * L / D * RHO_EDGES / 2 * speed**2
    part = PipeFriction(length=L, diameter=D, roughness=roughness)
    for sign in (1.0, -1.0):
        out = step(part, sign * drop, 0.0)
        assert out[0] == pytest.approx(sign * RHO_EDGES * speed * pi / 4 * D**2, rel=1e-10)
        assert out[3] == pytest.approx(reynolds, rel=1e-10)
        up, down = (step(part, sign * drop * s, 0.0)[0] for s in (1 + 1e-5, 1 - 1e-5))
        assert out[1] == pytest.approx(sign * (up - down) / (2e-5 * drop), rel=1e-7)
        assert out[2] == -out[1]


def test_flow_of_a_pipe_rises_through_the_transition_without_a_jump():
    part = PipeFriction(length=2.0, diameter=10e-3, roughness=1e-4)
    drops = np.geomspace(1e4, 3e6, 3000)
    flow = np.array([step(part, drop, 0.0)[0] for drop in drops])
    reynolds = flow / (pi / 4 * 10e-3 * MU)

    assert reynolds[0] < 2300 < 4000 < reynolds[-1]
    assert np.all(np.diff(flow) > 0)
    assert np.max(np.diff(np.log(flow)) / np.diff(np.log(drops))) < 1.001  # laminar is steepest


def test_laminar_resistance_is_that_of_lines():
    out = step(PipeFriction(length=2.0, diameter=3e-3), 10.0, 0.0)

    assert 10.0 / (out[0] / RHO_EDGES) == pytest.approx(
        laminar_resistance(2.0, 3e-3, MU), rel=1e-14
    )


# ---- walls ----------------------------------------------------------------------------------


@pytest.mark.parametrize("thickness", [1e-6, 1e-3, 20e-3])
def test_thick_tubes_are_those_of_wylie_and_streeter(thickness):
    D, E, nu = 10e-3, 210e9, 0.29
    thick = 2 * thickness / D * (1 + nu)
    share = D / (D + thickness)
    known = {"closed": 1 - nu / 2, "fixed": 1 - nu**2, "sliding": 1.0}
    for ends, c in known.items():
        area, _ = tube_compliance(D, thickness, E, nu, ends)
        assert area * E * thickness / D == pytest.approx(thick + share * c, rel=1e-12)


def test_a_closed_tube_grows_by_the_displacements_of_lame():
    D, s, E, nu = 10e-3, 2e-3, 210e9, 0.3
    a, b = 0.5 * D, 0.5 * D + s
    axial = a**2 / (b**2 - a**2)  # stresses over the pressure, at the bore
    hoop, radial = (b**2 + a**2) / (b**2 - a**2), -1.0
    outward = (hoop - nu * (axial + radial)) / E
    along = (axial - nu * (hoop + radial)) / E
    area, length = tube_compliance(D, s, E, nu, "closed")

    assert area == pytest.approx(2 * outward, rel=1e-13)
    assert length == pytest.approx(along, rel=1e-13)


def test_a_bore_in_a_large_body_grows_by_its_shear():
    area, length = tube_compliance(5e-3, float("inf"), 210e9, 0.3, "closed")

    assert area == pytest.approx(2 * 1.3 / 210e9, rel=1e-14)
    assert length == 0.0


@pytest.mark.parametrize("wall", [5e9, 5e8, 1e8])
def test_a_needle_swings_on_fluid_and_wall_in_series(wall):
    area, volume, mass, speed = 1e-5, 1e-7, 3e-3, 0.02
    bulk = 1 / (1 / float(OIL.bulk_modulus(AMBIENT.pressure)) + 1 / wall)
    omega, share = sqrt(bulk * area**2 / (volume * mass)), bulk / wall
    wh = 5e-3
    room = Chamber(volume=volume, pressure=AMBIENT.pressure, wall=Wall(bulk_modulus=wall))
    face = PressureFace(direction="opening", area=area)
    result = simulate_network(
        Network(
            {"needle": RigidMass(mass=mass, speed=-speed), "face": face, "room": room},
            [["needle.body", "face.body"], ["face.fluid", "room.fluid"]],
            AMBIENT,
            OIL,
        ).rows(),
        duration=0.5 * pi / omega,
        step=wh / omega,
        coarse=1,
        record=wh / omega,
        start="free",
    )
    y = result.channels["needle.body displacement"].values
    # a quarter of a period: amplitude v/omega, less the damping omega h/4 of the wall;
    # the stiffness of the fluid rises by 1 % and less on the way
    assert y.min() == pytest.approx(-speed / omega, rel=4e-3)
    energies = result.books.stores_after
    strain = 0.5 * volume / wall * (result.channels["room pressure"].values[-1] - 101325) ** 2
    # that of the wall, and the compression of the fluid that it took: small at these pressures
    assert energies["room wall energy"] == pytest.approx(strain, rel=0.02)
    assert energies["room wall energy"] == pytest.approx(share * 0.5 * mass * speed**2, rel=0.02)
    assert result.books.relative_residual <= 1e-9


def test_a_hose_slows_the_waves_of_a_line():
    rigid = Line(length=1.0, diameter=10e-3, pressure=50e5)
    hose = Line(length=1.0, diameter=10e-3, pressure=50e5, wall=Wall(bulk_modulus=6e8))
    tube = Wall(diameter=10e-3, thickness=1e-6, modulus=210e9, poisson=0.3, ends="sliding")
    thin = Line(length=1.0, diameter=10e-3, pressure=50e5, wall=tube)
    old = Line(length=1.0, diameter=10e-3, pressure=50e5, wall_thickness=1e-6, wall_modulus=210e9)

    a, rho = rigid.wave_speed(OIL), float(OIL.density(50e5))
    assert hose.wave_speed(OIL) == pytest.approx(1 / sqrt(1 / a**2 + rho / 6e8), rel=1e-12)
    assert thin.wave_speed(OIL) == pytest.approx(old.wave_speed(OIL), rel=1e-3)


@pytest.mark.parametrize(
    ("build", "text"),
    [
        (lambda: Chamber(volume=1e-6, wall={}), "no diameter and no thickness and no modulus"),
        (lambda: Chamber(volume=1e-6, wall={"bulk_modulus": 1e9, "diameter": 1e-2}), "no diameter"),
        (lambda: Chamber(volume=1e-6, wall={"diameter": 1e-2, "thickness": 1e-3}), "no modulus"),
        (lambda: Chamber(volume=1e-6, wall={"bulk_modulus": 1e9, "poisson": 0.6}), "less than 0.5"),
        (lambda: PipeFriction(length=1.0, diameter=1e-2, roughness=1e-3), "at most 0.05"),
        (lambda: PressureLoss(coefficient=0.5), "exactly one of diameter, area"),
        (lambda: PressureLoss(diameter=1e-2, coefficient=0.0), "greater than 0"),
        (lambda: SpoolEdge(**{**EDGE, "radial_clearance": 0.0}, direction="opening"), "greater"),
        (lambda: SpoolEdge(**EDGE, direction="up"), "'opening' or 'closing'"),
        (
            lambda: Line(
                length=1.0,
                diameter=1e-2,
                wall={"bulk_modulus": 1e9},
                wall_thickness=1e-3,
                wall_modulus=2e11,
            ),
            "together with wall",
        ),
        (
            lambda: Line(
                length=1.0,
                diameter=1e-2,
                wall={"diameter": 2e-2, "thickness": 1e-3, "modulus": 2e11},
            ),
            "the diameter of the line",
        ),
    ],
)
def test_wrong_numbers_are_refused_in_words(build, text):
    with pytest.raises(InputError, match=r"(?s)Try: ") as caught:
        build()

    assert text in str(caught.value)


EDGE_NOTCHES = {"diameter": 6e-3, "radial_clearance": 4e-6, "overlap": 1e-3, "cavitation": None}
SIZES = {
    "rectangular": {"width": 1e-3, "length": 0.8e-3, "depth": 0.3e-3},
    "triangular": {"width": 1e-3, "length": 0.8e-3, "depth": 0.3e-3},
    "round": {"width": 1e-3, "length": 0.8e-3, "depth": 0.3e-3},
    "hole": {"width": 0.6e-3, "length": 0.8e-3},
}


def notch(shape, **changed):
    return {"shape": shape, "count": 4, **SIZES[shape], **changed}


def edge(*notches, **changed):
    return SpoolEdge(**{**EDGE_NOTCHES, "direction": "opening", "notches": notches, **changed})


def steps(part, displacements, p_a=50e5, p_b=20e5):
    row = branch_of(part)
    return np.array([branch_step(row, p_a, p_b, ports=(y, y, 0.0, 0.0)) for y in displacements])


@pytest.mark.parametrize("shape", SIZES)
def test_flow_rises_without_a_jump_from_covered_to_open(shape):
    y = np.linspace(-0.2e-3, 1.4e-3, 4001)
    flow = steps(edge(notch(shape)), y)[:, 0]

    assert np.all(np.diff(flow) > 0.0)
    # 0.4 um more opens 0.4 um of the whole edge at most
    fully = 0.7 * pi * 6e-3 * 0.4e-6 * sqrt(2 * RHO * 30e5)
    assert np.max(np.diff(flow)) < 1.01 * fully


@pytest.mark.parametrize("shape", SIZES)
def test_slopes_are_those_of_the_flow(shape):
    part, h = edge(notch(shape), cavitation=0.62), 10.0
    for y in (0.1e-3, 0.4e-3, 1.1e-3):
        for p_a, p_b in ((50e5, 20e5), (20e5, 50e5)):
            out = steps(part, [y], p_a, p_b)[0]
            by_a = (steps(part, [y], p_a + h, p_b)[0][0] - steps(part, [y], p_a - h, p_b)[0][0]) / (
                2 * h
            )
            by_b = (steps(part, [y], p_a, p_b + h)[0][0] - steps(part, [y], p_a, p_b - h)[0][0]) / (
                2 * h
            )
            assert out[1] == pytest.approx(by_a, rel=1e-5, abs=0.0)  # round-off over 10 Pa
            assert out[2] == pytest.approx(by_b, rel=1e-5, abs=0.0)


@pytest.mark.parametrize("length", [0.2e-3, 0.5e-3])
def test_a_round_notch_cut_by_the_edge_is_a_segment_of_its_circle(length):
    numbers = np.array(Notch(**notch("round", length=length, depth=2e-3)).numbers)
    area, r = notch_opening(numbers, 0, 0.0, 4e-6, 4e-6)[1], 0.5e-3
    half = np.arccos((r - length) / r)

    assert area == pytest.approx(r * r * (half - np.sin(half) * np.cos(half)), rel=1e-13, abs=0.0)
    assert numbers[5] == pytest.approx(2 * r * np.sin(half), rel=1e-13, abs=0.0)


def test_holes_alone_open_no_edge():
    out = steps(edge(notch("hole"), width=0.0), [5e-3])[0]

    assert out[6] == pytest.approx(4 * pi / 4 * 0.36e-6, rel=1e-12, abs=0.0)


def test_a_port_limits_notches_and_edge_together():
    part = edge(notch("rectangular"), notch("hole"), largest_area=1e-6)

    assert steps(part, [3e-3])[0][6] == pytest.approx(1e-6, rel=1e-15, abs=0.0)


def test_the_length_of_the_column_counts_the_flow_of_the_notches():
    part = edge(
        notch("rectangular"), flow_force={"velocity_coefficient": 0.0, "damping_length": 1e-2}
    )
    row = branch_of(part)
    ports = (0.8e-3, 0.8e-3, 0.0, 0.0)
    known = branch_step(row, 50e5, 20e5, ports=ports)[8] - 1e-4
    state = [0.0, 0.0, 0.0, known, 1.0]
    out = branch_step(row, 50e5, 20e5, h=1e-6, state=state, ports=ports)

    assert out[3] == pytest.approx(-1e-2 * 1e-4 / 1e-6, rel=1e-9)
    assert out[4] == -out[3]


@pytest.mark.parametrize(
    ("build", "text"),
    [
        (lambda: edge(notch("rectangular", depth=3e-6)), "between the clearance of 0.004 mm"),
        (lambda: edge(notch("rectangular", depth=4e-3)), "the radius of the spool, 3 mm"),
        (lambda: edge(notch("triangular", count=40)), "notches with a total width of 40 mm"),
        (lambda: edge(notch("hole", count=40)), "notches with a total width of 24 mm"),
        (lambda: edge(notch("round"), width=3e-3), "at most the 3 mm of the edge"),
        (lambda: edge(notch("hole", length=0.5e-3)), "at least its diameter"),
        (lambda: edge(notch("hole", depth=1e-3)), "it goes through"),
        (lambda: edge({"shape": "round", "count": 1, "width": 1e-3, "length": 1e-3}), "depth"),
        (lambda: edge(width=0.0), "0 mm without notches"),
        (lambda: edge(notch("rectangular", count=0)), "count"),
    ],
)
def test_wrong_notches_are_refused_in_words(build, text):
    with pytest.raises(InputError, match=r"(?s)Try: ") as caught:
        build()

    assert text in str(caught.value)
