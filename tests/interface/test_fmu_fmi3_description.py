"""Model descriptions: valid under the standard's schemas and rules, and true about the equations.

The validator is fmpy's.  What it does not see, an index of a wrong variable, is found by comparing
the stated dependencies with differences of the equations written here once more.
"""

from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from klack.contact.laws import HuntCrossley, LinearLaw
from klack.exchange.fmu.documentation import documentation_files
from klack.exchange.fmu.model_description import (
    build_description,
    communication_step,
    model_description,
)
from klack.exchange.fmu.variables import fmu_variables
from klack.exchange.modal_model import (
    ModalModel,
    ModelContact,
    ModelInput,
    ModelOutput,
    Provenance,
)
from klack.network.rows import FilmRow

fmpy = pytest.importorskip("fmpy")

TITLE = 'Nadel <1> & "Sitz" §5 µm 弁\x07\nzweite Zeile'
GUID = "{3f0d2a5c-9f7f-4a5e-9d57-0123456789ab}"
STIFFNESS = 2e8
RNG = np.random.default_rng(7)


def small_model(kind: str, *, film: FilmRow | None = None, law=None, series=0.0) -> ModalModel:
    """Two bodies of two modes each: the first is free, the second is held."""
    omega = np.array([0.0, 6e5, 4e5, 9e5])
    shapes = RNG.uniform(5.0, 20.0, (3, 4)) * [[1, 1, 0, 0], [1, 1, 0, 0], [0, 0, 1, 1]]
    shapes[:2, 0] = 18.0
    outputs = tuple(
        ModelOutput(name=f"{q}_{port}", description=port, quantity=q, shape=shapes[i])
        for q in ("displacement", "velocity")
        for i, port in enumerate(("tip", "top", "seat"))
    )
    contact = ModelContact(
        name="seat",
        shape=shapes[0] - shapes[2],
        gap=-1e-7,
        law=law or LinearLaw(STIFFNESS),
        series_compliance=series,
        film=film,
    )
    rise = np.array([1 / 18.0, 0.0, 0.0, 0.0])
    pair = kind == "pair"
    return ModalModel(
        name="small",
        kind=kind,  # type: ignore[arg-type]
        omega=omega,
        damping=np.array([0.0, 0.01, 0.01, 0.0]),
        mode_names=("needle_1", "needle_2", "seat_1", "seat_2"),
        start=np.array([0.0, 1e-9, 0.0, 0.0]) * pair,
        start_velocity=-0.5 * rise * pair,
        rise=rise,
        constant=np.array([1.0, 0.5, 0.0, 0.0]) * pair,
        inputs=tuple(
            ModelInput(name=f"force_{port}", description=port, shape=shapes[i])
            for i, port in enumerate(("tip", "top"))
        ),
        outputs=outputs,
        contacts=(contact,) if pair else (),
        residual_compliance=1e-10 * np.eye(2),
        step=20e-9,
        duration=1e-4,
        provenance=Provenance(
            case="small",
            title=TITLE,
            version="1.2.3",
            created="2026-01-02T03:04:05+00:00",
            meshes={"needle": "12 elements"},
        ),
    )


FILM = FilmRow(cubic=4e-18, linear=1e-10, cut_off=6e-7, suction=0.2)
MODELS = {
    "body": small_model("body"),
    "pair": small_model("pair"),
    "pair with film": small_model("pair", film=FILM),
    "pair with damped law": small_model(
        "pair", law=HuntCrossley(LinearLaw(STIFFNESS), dissipation=0.1)
    ),
    "pair for co-simulation only": small_model("pair", film=FILM, series=1e-9),
    "damped pair for co-simulation only": small_model(
        "pair", law=HuntCrossley(LinearLaw(STIFFNESS), dissipation=0.1), series=1e-9
    ),
    "pair with compliance": small_model("pair", series=1e-9),
}


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def fmi(request):
    return request.param


def quick(name):
    return name in ("body", "pair with film", "pair for co-simulation only")


@pytest.fixture(
    params=[pytest.param(n, marks=() if quick(n) else pytest.mark.slow) for n in MODELS],
    ids=lambda name: name.replace(" ", "-"),
)
def model(request):
    return MODELS[request.param]


def read(model, fmi, folder):
    """What fmpy finds in the description, with all of its checks."""
    text = model_description(model, fmi=fmi, guid=GUID)
    (folder / "modelDescription.xml").write_text(text, encoding="utf-8")
    return fmpy.read_model_description(
        str(folder), validate=True, validate_variable_names=True, validate_model_structure=True
    )


def test_description_is_valid(model, fmi, tmp_path):
    found = read(model, fmi, tmp_path)

    assert found.fmiVersion == {2: "2.0", 3: "3.0"}[fmi]
    assert found.guid == GUID if fmi == 2 else found.instantiationToken == GUID
    assert found.coSimulation.canSerializeFMUstate
    assert found.coSimulation.canHandleVariableCommunicationStepSize
    alone = [MODELS[name] for name in MODELS if name.endswith("co-simulation only")]
    assert (found.modelExchange is None) == (model in alone)
    assert float(found.defaultExperiment.stopTime) == model.duration
    assert float(found.defaultExperiment.stepSize) == communication_step(model)


def test_words_of_the_user_come_back_on_one_line(fmi, tmp_path):
    found = read(MODELS["body"], fmi, tmp_path)

    assert found.description.startswith('Nadel <1> & "Sitz" §5 µm 弁 zweite Zeile: linear body')


def test_variables_have_their_value_references(model, fmi, tmp_path):
    expected = fmu_variables(model)
    found = read(model, fmi, tmp_path).modelVariables

    for reference, (ours, theirs) in enumerate(zip(expected, found, strict=False)):
        assert theirs.name == ours.name
        assert theirs.valueReference == reference
        assert theirs.unit == ours.unit
        assert theirs.causality == ours.causality
    extra = [v.name for v in found[len(expected) :]]
    assert extra == ([] if fmi == 2 else ["time"])


@pytest.mark.slow
def test_states_and_derivatives_belong_together(model, fmi, tmp_path):
    found = read(model, fmi, tmp_path)
    if found.modelExchange is None:
        assert not found.derivatives
        return
    states = [item.variable.derivative for item in found.derivatives]
    m = model.mode_count

    assert [s.name for s in states] == [f"{k}_{n}" for k in "qv" for n in model.mode_names]
    for state, item in zip(states, found.derivatives, strict=True):
        assert item.variable.name == f"der({state.name})"
    assert found.numberOfContinuousStates == 2 * m
    assert found.numberOfEventIndicators == len(model.contacts)


def rates(model, q, v, u):
    """Derivatives and outputs of the model by their names, from its equations."""
    force, values = np.zeros(len(q)), {}
    for contact in model.contacts:
        g, rate = contact.gap + contact.shape @ q, contact.shape @ v
        law = getattr(contact.law, "law", contact.law)
        damped = 1.0 - 0.3 * rate if isinstance(contact.law, HuntCrossley) else 1.0
        pressed = float(law.force(-g)) * damped
        film = 0.0
        if contact.film is not None:
            x = max(g, 0.0) + contact.film.cut_off
            film = -(contact.film.cubic / x**3 + contact.film.linear / x) * rate
            pressed += 1e-3 * film  # the standard's lists name both kinds of states for both forces
            values["film_force"] = film + 1e6 * g
        names = ("contact_force", "mean_contact_force", "peak_contact_force")
        values |= {"gap": g, **dict.fromkeys(names, pressed)}
        force += contact.shape * (pressed + film)
    for item, u_i in zip(model.inputs, u, strict=True):
        force = force + item.shape * u_i
    for output in model.outputs:
        values[output.name] = output.shape @ (q if output.quantity == "displacement" else v)
    a = model.constant + force - model.omega**2 * q - 2 * model.damping * model.omega * v
    for name, x, y in zip(model.mode_names, v, a, strict=True):
        values |= {f"der(q_{name})": x, f"der(v_{name})": y}
    return values


def test_dependencies_are_those_of_the_equations(model, fmi, tmp_path):
    found = read(model, fmi, tmp_path)
    m, n_u = model.mode_count, len(model.inputs)
    names = [f"q_{n}" for n in model.mode_names] + [f"v_{n}" for n in model.mode_names]
    names += [item.name for item in model.inputs]
    at = np.concatenate([np.full(m, -1e-9), np.full(m, -1e-3), np.full(n_u, 2.0)])
    moved = np.concatenate([np.full(m, 1e-10), np.full(m, 1e-4), np.full(n_u, 0.1)])
    base = rates(model, at[:m], at[m : 2 * m], at[2 * m :])
    expected: dict[str, set[str]] = {name: set() for name in base}
    for name, column in zip(names, np.diag(moved), strict=True):
        shifted = at + column
        for key, value in rates(model, shifted[:m], shifted[m : 2 * m], shifted[2 * m :]).items():
            if abs(value - base[key]) > 1e-13 * abs(base[key]):
                expected[key].add(name)

    for item in (*found.outputs, *found.derivatives):
        assert {v.name for v in item.dependencies} == expected[item.variable.name], item.variable


def test_parameters_set_the_states_of_a_pair(fmi, tmp_path):
    found = read(MODELS["pair"], fmi, tmp_path)
    known = {
        item.variable.name: {v.name for v in item.dependencies} for item in found.initialUnknowns
    }

    assert known["q_needle_1"] == {"start_rise"}
    assert known["v_needle_1"] == {"start_velocity"}
    assert known["q_needle_2"] == set()
    assert known["gap"] == {"start_rise"}
    assert known["der(v_needle_1)"] == {"start_rise", "force_tip", "force_top"}
    assert known["velocity_tip"] == {"start_velocity"}
    assert known["velocity_seat"] == set()


def test_event_indicator_depends_on_what_moves_the_gap(tmp_path):
    (item,) = read(MODELS["pair"], 3, tmp_path).eventIndicators
    assert item.variable.name == "gap"
    assert {v.name for v in item.dependencies} == {f"q_{n}" for n in MODELS["pair"].mode_names}


def test_equal_names_are_told_apart(fmi, tmp_path):
    body = MODELS["body"]
    twice = tuple(replace(item, name="force_a_b") for item in body.inputs)
    found = read(replace(body, inputs=twice), fmi, tmp_path)

    assert [v.name for v in found.modelVariables[:2]] == ["force_a_b", "force_a_b_2"]


def test_units_say_their_exponents_and_modal_ones_none(fmi, tmp_path):
    found = {
        unit.name: unit.baseUnit for unit in read(MODELS["pair"], fmi, tmp_path).unitDefinitions
    }

    assert (found["N"].kg, found["N"].m, found["N"].s) == (1, 1, -2)
    assert found["m.kg1/2"] is None


@pytest.mark.parametrize(
    ("step", "duration", "expected"),
    [(20e-9, 5e-3, 1e-6), (20e-9, 55e-6, 1e-7), (50e-9, 1.0, 2e-6), (10e-9, 1.0, 5e-7)],
)
def test_communication_step_is_a_round_number(step, duration, expected):
    assert communication_step(replace(MODELS["pair"], step=step, duration=duration)) == expected


def test_build_description_follows_its_schema():
    etree = pytest.importorskip("lxml.etree")
    folder = fmpy.__path__[0]
    schema = etree.XMLSchema(etree.parse(f"{folder}/schema/fmi3/fmi3BuildDescription.xsd"))
    found = etree.fromstring(build_description(MODELS["pair"]).encode())

    assert schema.validate(found), schema.error_log
    assert [f.get("name") for f in found.iter("SourceFile")] == ["klack_model.c", "klack_fmi3.c"]


def test_documentation_is_complete_and_escaped(model, fmi):
    files = documentation_files(model, fmi=fmi)
    page = files["documentation/index.html"].decode()

    for variable in fmu_variables(model):
        if variable.causality != "local":
            assert f"<code>{variable.name}</code>" in page
    assert "Nadel &lt;1&gt; &amp; &#34;Sitz&#34; §5 µm 弁" in page
    assert "Nadel <1>" not in page
    for name in ("documentation/diagram.svg", "documentation/answer.svg"):
        assert ET.fromstring(files[name]).tag.endswith("svg")
        assert name.split("/")[1] in page
    icon = files["model.png" if fmi == 2 else "terminalsAndIcons/icon.png"]
    assert icon[:8] == b"\x89PNG\r\n\x1a\n"
    assert tuple(np.frombuffer(icon[16:24], ">u4")) == (100, 100)
    assert b"Redistribution" in files["documentation/licenses/license.txt"]


def test_page_tells_whether_model_exchange_is_there():
    pages = {
        name: documentation_files(MODELS[name])["documentation/index.html"].decode()
        for name in ("pair", "pair for co-simulation only")
    }

    assert "Model exchange:" in pages["pair"]
    assert "Co-simulation only" in pages["pair for co-simulation only"]
