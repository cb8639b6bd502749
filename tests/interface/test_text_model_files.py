"""Text and MATLAB files of models, read back.

Text and MATLAB files of models are read back: bare matrices, named blocks, laws, names.

Bodies that left klack come back by a case: the impact is the same.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.io import loadmat

from klack.assembling.given_bodies import reduced_from_file
from klack.bodies.model_files.modal_data import read_modal_data
from klack.bodies.model_files.reduced_models import read_state_space
from klack.bodies.reduction.from_state_space import body_of_state_space
from klack.bodies.reduction.reduced_body import StateSpace
from klack.case import find_case, load_case
from klack.case.any_case import load_any_case
from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw
from klack.errors import InputError
from klack.exchange.case_models import case_models
from klack.exchange.matlab_model import write_matlab
from klack.exchange.modal_model import Provenance, body_model, pair_model
from klack.exchange.modelica import modelica_text, write_modelica
from klack.exchange.state_space import state_space
from klack.exchange.text_model import write_text
from klack.simulation.bodies import fixed_body, rigid_mass_body, rod_body
from klack.simulation.system import ContactPair, ReducedSystem

ORIGIN = Provenance(
    case="two rods",
    title='Stäbe, "5 µm"\nand <more>',
    version="0",
    created="today",
    meshes={"rod": "3 elements"},
)
TABLE = TableLaw([2e-7, 5e-7, 1e-6], [60.0, 200.0, 500.0])


def _rod(name="rod"):
    return rod_body(
        name,
        length=0.04,
        area=1.2e-5,
        young=2.1e11,
        density=7850,
        elastic_modes=5,
        damping=0.002,
    )


def _body(name="rod"):
    return body_model(_rod(name), provenance=ORIGIN, step=2e-8)


def _pair(*laws, name="pair"):
    bodies = (_rod("needle"), fixed_body("wall"))
    contacts = tuple(
        ContactPair(
            body_a="needle",
            port_a="bottom",
            body_b="wall",
            port_b="contact",
            law=law,
            gap=1e-6,
            series_compliance=2e-10,
        )
        for law in laws
    )
    return pair_model(
        name,
        ReducedSystem(bodies=bodies, contacts=contacts),
        moving="needle",
        contact_names=[f"stop_{i}" for i in range(len(laws))],
        speed=-0.25,
        step=2e-8,
        duration=1e-4,
        provenance=ORIGIN,
    )


@pytest.mark.parametrize("form", ["mat", "csv"])
def test_a_body_comes_back_through_the_reader_of_klack(tmp_path, form):
    if form == "mat":
        path = write_matlab([_body()], tmp_path)[0]
    else:
        path = next(p for p in write_text([_body()], tmp_path) if p.name == "rod_state_space.csv")
    held, wrote, rod = read_state_space(path), state_space(_body()), _rod()
    for key in "ABCD":
        assert np.array_equal(getattr(held, key), getattr(wrote, key))
    assert held.input_names == wrote.input_names
    assert held.output_names == wrote.output_names
    plain = StateSpace(
        A=held.A,
        B=held.B,
        C=held.C[:2],
        feedthrough=held.D[:2],
        input_names=("bottom", "top"),
        output_names=("bottom", "top"),
    )
    again = body_of_state_space("rod", plain, where=str(path))
    np.testing.assert_allclose(again.omega[1:], rod.omega[1:], rtol=1e-9)
    np.testing.assert_allclose(again.damping[1:], rod.damping[1:], rtol=1e-6)
    np.testing.assert_allclose(
        again.port_shapes.T @ again.port_shapes, rod.port_shapes.T @ rod.port_shapes, rtol=1e-7
    )
    assert again.mass == pytest.approx(rod.mass, rel=1e-9)


def test_bare_matrices_are_exact_in_csv_and_columns(tmp_path):
    paths = {path.name: path for path in write_text([_body()], tmp_path / "new")}
    form = state_space(_body())
    for key in "ABCD":
        expected = getattr(form, key)
        comma = np.loadtxt(paths[f"rod_{key}.csv"], delimiter=",", ndmin=2)
        assert np.array_equal(comma, expected)
        assert np.array_equal(np.loadtxt(paths[f"rod_{key}.txt"], ndmin=2), expected)
    residual = np.loadtxt(paths["rod_D_with_residual_compliance.txt"], ndmin=2)
    assert np.array_equal(residual, form.residual_feedthrough)
    modes = read_modal_data(paths["rod_modes.csv"])
    assert np.array_equal(modes.frequency, _rod().omega / (2 * np.pi))
    assert np.array_equal(modes.damping, _rod().damping)
    assert modes.labels == ("bottom", "top")
    assert np.array_equal(modes.shapes, _rod().port_shapes)
    info = paths["rod_info.txt"].read_text(encoding="utf-8")
    for words in ("input 2: force_top [N]", "output 3: velocity_bottom [m/s]", "Stäbe"):
        assert words in info


@pytest.mark.parametrize("law", [LinearLaw(1e9), HertzLaw(1e11), TABLE])
def test_law_as_a_table(tmp_path, law):
    paths = {path.name: path for path in write_text([_pair(law)], tmp_path)}
    depth, force = np.loadtxt(paths["pair_law.csv"], delimiter=",", skiprows=1).T
    assert paths["pair_law.csv"].read_text().startswith("indentation_m,force_N\n0,0\n")
    assert np.array_equal(force, law.force(depth))
    between = np.linspace(0.0, 9e-7, 997)
    # straight lines between the points of the file
    assert np.interp(between, depth, force) == pytest.approx(law.force(between), abs=0.5)


def test_matlab_structure_is_whole(tmp_path):
    paths = write_matlab([_pair(TABLE, HertzLaw(1e11)), _body()], tmp_path)
    assert [path.name for path in paths] == [
        *("pair.mat", "pair_ss.m", "pair_mechss.m", "pair_block.m", "pair_rhs.m", "pair_impact.m"),
        *("rod.mat", "rod_ss.m", "rod_mechss.m", "rod_block.m"),
    ]
    p = loadmat(paths[0], simplify_cells=True)["klack"]
    form = state_space(_pair(TABLE, HertzLaw(1e11)))
    assert np.array_equal(p["A"], form.A)
    assert p["M"].shape == (6, 6)
    assert p["M"].format == "csc"
    assert list(p["input_names"]) == [
        "force",
        "force_top",
        "total_force_stop_0",
        "total_force_stop_1",
    ]
    assert list(p["output_units"]) == ["m", "m/s", "m", "m"]
    assert p["provenance"]["title"].strip() == ORIGIN.title
    assert p["provenance"]["meshes"] == "rod: 3 elements"
    first, second = p["contacts"]
    assert (first["law_kind"], second["law_kind"]) == ("table", "power")
    assert np.array_equal(first["law_force_N"], TABLE.force_points)
    assert first["series_compliance_m_per_N"] == 2e-10
    assert np.array_equal(second["law_parameters"], [1e11, 1.5])
    assert p["start_velocity_m_per_s"] == pytest.approx(-0.25)
    for path in paths:
        if path.suffix == ".m":
            text = path.read_text(encoding="ascii")
            assert "@" not in text.replace("@(", "")
            assert f" {path.stem}" in text.splitlines()[0]


def test_scripts_stay_when_a_later_model_fails(tmp_path):
    write_matlab([_body()], tmp_path)
    before = (tmp_path / "rod.mat").read_bytes()
    with pytest.raises(InputError, match="dissipation"):
        write_matlab([_body(), _pair(HuntCrossley(LinearLaw(1e9), 0.2))], tmp_path)
    assert (tmp_path / "rod.mat").read_bytes() == before
    assert len(list(tmp_path.iterdir())) == 4


@pytest.mark.parametrize("write", [write_matlab, write_text, write_modelica])
def test_refused_models(tmp_path, write):
    (tmp_path / "file").write_text("")
    for models, place, words in (
        ([_body(), _body("Rod")], "", "2 models with the name 'rod'"),
        ([body_model(fixed_body("wall"), provenance=ORIGIN, step=1e-8)], "", "no modes"),
        ([_body("a" * 56)], "", "at most 55"),
        ([_pair(HuntCrossley(LinearLaw(1e9), 0.2))], "", "dissipation"),
        ([_body()], "file/below", "a writable path"),
    ):
        with pytest.raises(InputError, match=words):
            write(models, tmp_path / place)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("write", [write_matlab, write_text])
def test_more_than_two_gigabytes_are_refused_before_they_are_made(tmp_path, write):
    model = body_model(rigid_mass_body("lump", 1e-3), provenance=ORIGIN, step=1e-8)
    large = object.__new__(type(model))
    for key in model.__dataclass_fields__:
        value = getattr(model, key)
        object.__setattr__(large, key, np.ones(9000) if key in ("omega", "damping") else value)
    with pytest.raises(InputError, match=r"18000 states: a dense A of 2\.4 GiB"):
        write([large], tmp_path)


def test_ports_of_one_name_are_told_apart(tmp_path):
    rod = replace(_rod(), port_names=("tip-a", "tip_a"))
    model = body_model(rod, provenance=ORIGIN, step=2e-8)
    p = loadmat(write_matlab([model], tmp_path)[0], simplify_cells=True)["klack"]
    assert list(p["input_names"]) == ["force_tip_a", "force_tip_a_2"]
    assert list(p["output_names"])[:2] == ["displacement_tip_a", "displacement_tip_a_2"]
    assert np.array_equal(p["D_with_residual_compliance"][:2], rod.residual_compliance)
    rumoca = pytest.importorskip("rumoca")
    (path,) = write_modelica([model], tmp_path)
    assert len(rumoca.Session().load(str(path), model="rod").inputs) == 2


def test_modelica_takes_any_title_and_reserved_names(tmp_path):
    (path,) = write_modelica([_body("end")], tmp_path)
    assert path.name == "end_model.mo"
    text = path.read_text(encoding="utf-8")
    assert text.startswith('model end_model "')
    assert '\\"5 µm\\" and &lt;more&gt;' in text
    assert all(line.isprintable() for line in text.splitlines())
    assert max(map(len, modelica_text(_pair(TABLE)).splitlines())) < 900
    rumoca = pytest.importorskip("rumoca")
    assert rumoca.Session().loads(text, model="end_model").name == "end_model"


CASE = """
klack: 1
title: there and back
bodies:
  needle:
    reduced: {{kind: {kind}, file: {needle}, units: m kg s, ports: {{tip: {needle_port}}}}}
  seat:
    reduced: {{kind: {kind}, file: {seat}, units: m kg s, ports: {{face: {seat_port}}}}}
contact:
  between: [needle.tip, seat.face]
  gap: 0 um
  local_law: {{kind: linear, stiffness: 1e9 N/m}}
run: {{levels: [reduced], duration: 40 us}}
motion: {{speed: 0.5 m/s}}
"""


@pytest.fixture(scope="module")
def models():
    return case_models(load_any_case(find_case("demo-valve-axisymmetric")))


@pytest.mark.parametrize("form", ["mat", "state_space.csv", "modes.csv"])
def test_bodies_come_back(tmp_path, models, form):
    bodies = models.body_models()
    write = write_matlab if form == "mat" else write_text
    write(bodies, tmp_path)
    ending = ".mat" if form == "mat" else f"_{form}"
    names = {
        key: f"{{input: force_{port}, output: displacement_{port}}}"
        if form != "modes.csv"
        else f"{{input: {port}}}"
        for key, port in (("needle_port", "contact"), ("seat_port", "contact"))
    }
    text = CASE.format(
        kind="modal" if form == "modes.csv" else "state-space",
        needle=f"needle{ending}",
        seat=f"housing{ending}",
        **names,
    )
    path = tmp_path / "back.yaml"
    path.write_text(text)
    case = load_case(path)
    for name, old in (("needle", models.bodies[0]), ("seat", models.bodies[1])):
        new = reduced_from_file(case, name)
        assert new.mode_count == old.mode_count
        np.testing.assert_allclose(new.omega, old.omega, rtol=1e-8)
        shapes = abs(old.port_shapes[:, 0])
        np.testing.assert_allclose(
            abs(new.port_shapes[:, 0]), shapes, rtol=1e-6, atol=1e-6 * shapes.max()
        )
