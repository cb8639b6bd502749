"""Truth: d'Alembert, the exact weighting function of laminar flow, and its characteristic root."""

from math import pi

import numpy as np
import pytest

from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.line import Line
from klack.hydraulics.line_friction import (
    KAGAWA,
    TRIKHA,
    laminar_resistance,
    laminar_weight,
    unsteady_terms,
    vardy_brown_weight,
    zielke_weight,
)
from klack.network.rows import Ambient, LineRow, Rows
from klack.simulation.delay_line import compile_lines, lines_commit, lines_incoming, start_lines
from klack.verification.single_line import (
    End,
    exponential_decay,
    laminar_decay,
    plain_line,
    ringing,
    run_line,
)


@pytest.mark.parametrize(
    ("delay", "impedance", "flow"),
    [(1.0, 1.0, 1.0), (52e-6, 1.6e11, 2e-6)],
    ids=["unit scale", "valve line"],
)
@pytest.mark.parametrize("segments", [1, 3])
def test_front_is_a_jump_of_impedance_times_flow(delay, impedance, flow, segments):
    n = 300  # a multiple of the segments: no fraction of a step
    row = plain_line(delay=delay, impedance=impedance, segments=segments)

    run = run_line(row, End(flow=flow), End(flow=0.0), step=delay / n, lengths=np.ones(4 * n, int))

    far = np.where(np.arange(4 * n) < n, 0.0, np.where(np.arange(4 * n) < 3 * n, 2.0, 4.0))
    np.testing.assert_allclose(run.pressure[: 2 * n, 0], impedance * flow, rtol=1e-13)
    np.testing.assert_allclose(run.pressure[:, 1], far * impedance * flow, rtol=1e-13)


@pytest.mark.parametrize("ratio", [0.25, 1.0, 4.0])
def test_change_of_the_bore_reflects_by_the_areas(ratio):
    rows = [
        LineRow(
            component="line",
            a=k,
            b=k + 1,
            delay=50.0 + 10.0 * k,
            impedance=impedance,
            segments=1 + k,
            resistance=0.0,
            unsteady_gain=np.zeros(0),
            unsteady_rate=np.zeros(0),
            vapour_pressure=-1e9,
        )
        for k, impedance in enumerate((1.0, ratio))
    ]
    lines, state = compile_lines(rows, step=1.0, coarse=1, ambient_pressure=0.0)
    c, Z, q, books = np.zeros(4), np.zeros(4), np.zeros(4), np.zeros((2, 3))

    pressures = []
    for _ in range(105):
        lines_incoming(lines, state, 1, c, Z)
        P = (c[1] / Z[1] + c[2] / Z[2]) / (1.0 / Z[1] + 1.0 / Z[2])  # no volume between them
        q[:] = 1.0, (P - c[1]) / Z[1], (P - c[2]) / Z[2], 0.0
        pressures.append(c[0] + Z[0] * q[0])
        lines_commit(lines, state, 1, q, books)

    reflection = (ratio - 1.0) / (ratio + 1.0)  # of areas A = 1 / Z: (A1 - A2) / (A1 + A2)
    np.testing.assert_allclose(pressures[:100], 1.0, rtol=1e-14)
    np.testing.assert_allclose(pressures[100:], 1.0 + 2.0 * reflection, rtol=1e-14)


@pytest.mark.parametrize("coarse", [1, 16])
def test_steady_flow_stays_as_it_was_started(coarse):
    gain, rate = unsteady_terms(KAGAWA, resistance=3e9, diameter=2.5e-3, kinematic_viscosity=46e-6)
    row = plain_line(
        delay=52.037e-6, segments=4, resistance=3e9, unsteady=(gain, rate), vapour_pressure=0.0
    )
    flow, P = 2e-6, 5e5

    run = run_line(
        row,
        End(pressure=P),
        End(flow=-flow),
        step=20e-9,
        lengths=np.full(3000, coarse),
        pressure=[P, P - 3e9 * flow],
        flow=flow,
    )

    np.testing.assert_allclose(run.pressure[:, 1], P - 3e9 * flow, rtol=1e-12)
    np.testing.assert_allclose(run.flow[:, 0], flow, rtol=1e-10)


def test_whole_delay_is_met_although_the_quotient_is_not_whole():
    row = plain_line(delay=0.3)  # 0.3 / 0.1 is below 3

    lines, _ = compile_lines([row], step=0.1, coarse=1, ambient_pressure=0.0)

    assert lines.depth[0] == 4
    assert lines.fraction[0] == 0.0


def test_coarse_steps_alone_lose_nothing_inside_a_line():
    rng = np.random.default_rng(3)
    row = plain_line(delay=16 * 50 * 20e-9, segments=3)  # not divisible by 3: unequal segments
    ends = 1e5 * rng.standard_normal((2, 2000))

    run = run_line(
        row,
        End(pressure=ends[0]),
        End(pressure=ends[1]),
        step=20e-9,
        lengths=np.full(2000, 16),
    )

    assert run.losses[1] == 0.0


@pytest.mark.parametrize(("weights", "low", "error"), [(KAGAWA, 1e-5, 3e-3), (KAGAWA, 1e-4, 3e-3)])
def test_kagawa_follows_the_exact_weights(weights, low, error):
    tau = np.logspace(np.log10(low), 1.0, 300)

    np.testing.assert_allclose(weights(tau), laminar_weight(tau), rtol=error)


def test_trikha_does_not_reach_the_times_of_a_valve():
    tau = np.logspace(-4.0, 0.0, 300)

    assert np.max(np.abs(TRIKHA(tau) / laminar_weight(tau) - 1.0)) == pytest.approx(0.38, abs=0.01)


def test_zielke_meets_the_exact_weights_on_both_sides_of_the_seam():
    tau = np.array([1e-5, 0.0199, 0.0201, 1.0])

    np.testing.assert_allclose(zielke_weight(tau), laminar_weight(tau), rtol=5e-4)


def test_turbulent_memory_starts_like_the_laminar_one_and_fades_sooner():
    # the laminar weight has a second term -5/4 that is 0.4 % of the first at tau = 1e-6
    early = vardy_brown_weight(1e-6, 1e4) / laminar_weight(1e-6)
    B = 1e4 ** np.log10(15.29 / 1e4**0.0567) / 12.86

    assert early == pytest.approx(1.0, rel=6e-3)
    assert vardy_brown_weight(0.01, 1e4) < 0.5 * laminar_weight(0.01)
    assert vardy_brown_weight(0.02, 1e4) / vardy_brown_weight(0.01, 1e4) == pytest.approx(
        np.exp(-0.01 * B) / np.sqrt(2.0), rel=1e-12
    )


def test_only_a_long_memory_damps_the_first_mode_of_a_fuel_line():
    rho, speed, viscosity, length, radius = 685.8, 1152.0, 4.05e-4, 0.06, 1.25e-3
    delay, nu = length / speed, viscosity / rho
    exact = laminar_decay(delay=delay, radius=radius, kinematic_viscosity=nu).real
    resistance = laminar_resistance(length, 2.0 * radius, viscosity)

    decays = {}
    for name, weights in (("steady", None), ("Trikha", TRIKHA), ("Kagawa", KAGAWA)):
        terms = ((), ())
        if weights is not None:
            terms = unsteady_terms(
                weights, resistance=resistance, diameter=2.0 * radius, kinematic_viscosity=nu
            )
        row = plain_line(
            delay=delay,
            impedance=rho * speed / (pi * radius**2),
            segments=2,
            resistance=resistance,
            unsteady=terms,
        )
        step = delay / 260
        run = run_line(
            row,
            End(pressure=0.0),
            End(flow=0.0),
            step=step,
            lengths=np.ones(round(9e-3 / step), int),
            pressure=[0.0, 1e5],
        )
        tone = ringing(run.time, run.pressure[:, 1], 0.25 / delay, apart=5e-3)
        decays[name] = tone.real / exact

    assert decays["steady"] == pytest.approx(0.02, abs=0.002)  # 4 nu / R^2 = 1.5 1/s of 75.7
    assert decays["Trikha"] == pytest.approx(0.5, abs=0.03)
    assert decays["Kagawa"] == pytest.approx(1.0, abs=0.02)


def test_root_of_exact_friction_approaches_the_thin_layer_formula():
    # zeta = sqrt(2 nu / omega) / (2 R) for a boundary layer much thinner than the bore
    s = laminar_decay(delay=52e-6, radius=1.25e-3, kinematic_viscosity=6e-9)
    thin = np.sqrt(2.0 * 6e-9 * s.imag) / (2.0 * 1.25e-3)

    assert s.real == pytest.approx(-thin, rel=5e-3)  # the layer takes 0.3 % of the radius
    assert exponential_decay(
        TRIKHA, delay=52e-6, radius=1.25e-3, kinematic_viscosity=6e-7
    ).real == pytest.approx(-38.7, rel=0.02)


def test_component_turns_a_bore_into_delay_and_impedance():
    fluid = library_fluid("n-heptane").at(293.15)
    line = Line(length=0.06, diameter=2.5e-3, pressure=6e5, friction="none")
    rows = Rows(ambient=Ambient(), fluid=fluid, component="line", handles={"a": 4, "b": 7})

    line.add_rows(rows)
    row = rows.lines[0]

    area = pi * 2.5e-3**2 / 4.0
    a, rho = float(fluid.sound_speed(6e5)), float(fluid.density(6e5))
    reference = float(fluid.density(101_325.0))
    assert (row.a, row.b, row.segments, len(row.unsteady_gain)) == (4, 7, 1, 0)
    assert row.delay == pytest.approx(0.06 / a, rel=1e-14)
    assert line.echo_time(fluid) == pytest.approx(0.12 / a, rel=1e-14)
    # P = rho_ref dp / rho and q = A rho u / rho_ref, with dp = rho a u
    u = 0.4
    assert row.impedance * area * rho * u / reference == pytest.approx(reference * a * u, rel=1e-13)


def test_elastic_wall_slows_the_wave_down():
    fluid = library_fluid("water").at(293.15)
    tube = {"length": 1.0, "diameter": 10e-3, "pressure": 1e6}
    rigid, soft = Line(**tube), Line(**tube, wall_thickness=1e-3, wall_modulus=70e9)
    K, rho = float(fluid.bulk_modulus(1e6)), float(fluid.density(1e6))

    expected = np.sqrt(K / rho / (1.0 + K * 10.0 / 70e9))  # Korteweg

    assert rigid.wave_speed(fluid) == pytest.approx(np.sqrt(K / rho), rel=1e-13)
    assert soft.wave_speed(fluid) == pytest.approx(expected, rel=1e-13)


def test_start_fills_a_line_with_the_mean_of_a_linear_pressure():
    row = plain_line(delay=10.4, impedance=2.0, segments=2)
    lines, state = compile_lines([row], step=1.0, coarse=1, ambient_pressure=0.0)

    start_lines(lines, state, [1.0, 3.0])
    first = state.samples[lines.start[0, 0] : lines.start[0, 0] + lines.depth[0]]
    last = state.samples[lines.start[1, 0] : lines.start[1, 0] + lines.depth[1]]

    assert first[-1] == pytest.approx(1.0 + 2.0 * 0.5 / 10.4, rel=1e-14)  # half a step from a
    assert last[1] == pytest.approx(1.0 + 2.0 * (10.4 - 0.9) / 10.4, rel=1e-14)
