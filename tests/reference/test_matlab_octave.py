"""Octave reads what klack writes for MATLAB, runs its scripts, and meets klack's own numbers."""

import numpy as np
import pytest

from klack.contact.laws import HertzLaw, LinearLaw, TableLaw
from klack.exchange.matlab_model import write_matlab
from klack.exchange.modal_model import Provenance, body_model, pair_model
from klack.network.rows import FilmRow
from klack.simulation.bodies import fixed_body, rigid_mass_body, rod_body
from klack.simulation.propagator import modal_propagator
from klack.simulation.system import ContactPair, ReducedSystem

FILM = FilmRow(cubic=4e-17, linear=2e-7, cut_off=5e-7, suction=1.0)
STEP, COUNT = 2e-8, 200

BODY_SCRIPT = r"""
held = load('rod.mat');
p = held.klack;
n = size(p.A, 1);
u = [1; -0.25];
E = expm([p.A, p.B * u; zeros(1, n + 1)] * STEP);
x = [zeros(n, 1); 1];
for k = 1:COUNT
  x = E * x;
  printf('%.17g ', p.C * x(1:n));
  printf('\n');
end
sys = rod_ss('residual');
printf('%s ', sys.InputName{:}, sys.OutputName{:}, class(p.M), num2str(issparse(p.M)));
printf('\n');
printf('%.17g ', sys.D);
printf('\n');
try
  rod_mechss();
catch problem
  disp(problem.identifier);
end
addpath('stand_in');
two = rod_mechss();
two = two.given;
s = 1i * 2e6;
H = two{5} * ((s^2 * two{1} + s * two{2} + two{3}) \ full(two{4}));
H = H + s * two{6} * ((s^2 * two{1} + s * two{2} + two{3}) \ full(two{4})) + two{7};
G = p.C * ((s * eye(n) - p.A) \ p.B) + p.D;
printf('%.3g\n', norm(H - G) / norm(G));
disp(p.provenance.title);
global SET
rod_block('plant');
for k = 1:2:9
  printf('%s %s %d %d\n', SET{k:k+1}, size(eval(SET{k+1})));
end
"""


def test_body_reads_steps_and_responds(octave, tmp_path):
    rod = rod_body(
        "rod", length=0.03, area=1.2e-5, young=2.1e11, density=7850, elastic_modes=8, damping=0.002
    )
    origin = Provenance(case="rod", title="Stäbe, 5 µm", version="0", created="today")
    write_matlab([body_model(rod, provenance=origin, step=STEP)], tmp_path)
    (tmp_path / "stand_in").mkdir()  # in place of the toolbox: hands its arguments back
    (tmp_path / "stand_in" / "mechss.m").write_text(
        "function sys = mechss(varargin)\nsys = struct('given', {{varargin{:}}});\nend\n"
    )
    for name, head in (("add_block", "b"), ("get_param", "s"), ("set_param", "n")):
        (tmp_path / "stand_in" / f"{name}.m").write_text(
            f"function {head} = {name}(varargin)\nglobal SET\nb = 1; s = struct('X0', 1); n = 0;\n"
            f"if strcmp('{name}', 'set_param')\n  SET = varargin(2:end);\nend\nend\n"
        )
    script = BODY_SCRIPT.replace("STEP", repr(STEP)).replace("COUNT", str(COUNT))
    lines = octave(script).splitlines()
    found = np.array([line.split() for line in lines[:COUNT]], dtype=float)

    P, q, v = modal_propagator(rod.omega, rod.damping, STEP), np.zeros(9), np.zeros(9)
    push, expected = rod.port_shapes @ [1.0, -0.25], []
    for _ in range(COUNT):
        q, v = P.A11 * q + P.A12 * v + P.B1 * push, P.A21 * q + P.A22 * v + P.B2 * push
        expected.append([*(rod.port_shapes.T @ q), *(rod.port_shapes.T @ v)])
    expected = np.array(expected)
    # expm of a matrix with entries of 1e13 keeps ten digits of the state: of its displacements
    # and of its velocities, each kind with one scale
    scale = abs(expected).reshape(COUNT, 2, 2).max(axis=(0, 2)).repeat(2)
    np.testing.assert_array_less(abs(found - expected).max(axis=0), 1e-10 * scale)
    assert lines[COUNT].split() == [
        *("force_bottom", "force_top", "displacement_bottom", "displacement_top"),
        *("velocity_bottom", "velocity_top", "double", "1"),
    ]
    feedthrough = np.array(lines[COUNT + 1].split(), dtype=float).reshape(2, 4).T
    np.testing.assert_allclose(feedthrough[:2], rod.residual_compliance, rtol=1e-14)
    assert not feedthrough[2:].any()
    assert lines[COUNT + 2] == "klack:mechss"
    assert float(lines[COUNT + 3]) < 1e-10
    assert lines[COUNT + 4].strip() == origin.title
    assert lines[COUNT + 5 :] == [
        *("A klack_rod.A 18 18", "B klack_rod.B_block 18 3", "C klack_rod.C 4 18"),
        *("D klack_rod.D_block 4 3", "X0 klack_rod.x0 18 1"),
    ]


LAWS_SCRIPT = """
held = load('laws.mat');
p = held.klack;
x = p.x_start;
for rise = linspace(-4e-6, 1e-6, 101)
  x(1) = rise * p.rise(1);
  [~, y] = laws_rhs(0, x, 0, p);
  printf('%.17g ', y.contact_force);
  printf('\\n');
end
"""


def test_laws_in_series_with_a_compliance(octave, tmp_path):
    laws = (LinearLaw(8e8), HertzLaw(5e11), TableLaw([2e-7, 5e-7, 1e-6], [60, 200, 500]))
    series = 3e-10
    contacts = tuple(
        ContactPair(
            body_a="lump",
            port_a="contact",
            body_b="wall",
            port_b="contact",
            law=law,
            gap=0.0,
            series_compliance=series,
        )
        for law in laws
    )
    bodies = (rigid_mass_body("lump", 2e-3), fixed_body("wall"))
    model = pair_model(
        "laws",
        ReducedSystem(bodies=bodies, contacts=contacts),
        moving="lump",
        contact_names=("one", "two", "three"),
        speed=0.0,
        step=STEP,
        duration=1e-5,
        provenance=Provenance(case="laws", title="", version="0", created="today"),
    )
    write_matlab([model], tmp_path)
    found = np.array([line.split() for line in octave(LAWS_SCRIPT).splitlines()], dtype=float)
    closing = -np.linspace(-4e-6, 1e-6, 101)
    assert not found[closing <= 0].any()
    for force, law in zip(found[closing > 0].T, laws, strict=True):
        depth = closing[closing > 0] - series * force
        np.testing.assert_allclose(law.force(depth), force, rtol=1e-12)


PAIR_SCRIPT = """
run = rods_impact([], 20e-6, TOLERANCE);
printf('%.12g ', run.peak_force, max(run.film_force), run.output(end, 1:2), run.t(end));
"""


@pytest.mark.slow
def test_pair_without_film_runs_as_here(octave, tmp_path, rod_impact):
    impact = rod_impact(series=4e-10)
    write_matlab([impact.pair], tmp_path)
    script = PAIR_SCRIPT.replace("TOLERANCE", "1e-9")
    peak, film, lift, velocity, end = map(float, octave(script).split())
    native = impact.dry(1e-9, 20e-6)
    assert (end, film) == (pytest.approx(20e-6), 0.0)
    assert peak == pytest.approx(native.peak_force.max(), rel=1e-4)  # 20 ns between the outputs
    assert velocity == pytest.approx(native.velocity[-1, 0], rel=2e-6)
    assert lift == pytest.approx(1e-6 + np.trapezoid(native.velocity[:, 0], dx=1e-9), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("series", [0.0, 4e-10])
def test_pair_with_film_runs_as_here(octave, tmp_path, rod_impact, stepped, series):
    impact = rod_impact(series=series, film=FILM)
    write_matlab([impact.pair], tmp_path)
    script = PAIR_SCRIPT.replace("TOLERANCE", "1e-7")
    peak, film, lift, velocity, _ = map(float, octave(script).split())
    pressed, squeezed, here, speed = stepped(impact.pair, 1e-9, 20e-6)
    # the relaxation of 4 ns moves the peak by 5e-5; the film's spike lies between two outputs
    assert peak == pytest.approx(pressed, rel=1e-4)
    assert film == pytest.approx(squeezed, rel=5e-2)
    assert velocity == pytest.approx(speed, rel=5e-5)
    assert lift == pytest.approx(here, rel=5e-5)
