"""Compiled steps: constants, bundles of arrays, equations of pressures.

Truth: one table.  numba, C, Modelica and MATLAB compute with its values and hold no others.

Bundles of arrays as bundles of pointers, in compiled code.

Truth: the definition, member by member: the same memory, the same numbers.
"""

import ast
import importlib
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import njit

from klack.contact import step_constants
from klack.contact.laws import HertzLaw, LinearLaw, TableLaw
from klack.contact.step_constants import (
    MATLAB_LEFT,
    MATLAB_TURNS,
    MODELICA_POWER_TURNS,
    MODELICA_TABLE_TURNS,
    RELAXATION,
    shared_constants,
)
from klack.exchange.fmu.build import source_texts
from klack.exchange.matlab_model import write_matlab
from klack.exchange.modal_model import ModalModel, Provenance, pair_model
from klack.exchange.modelica import modelica_text
from klack.network.rows import FilmRow
from klack.network.step_function import pointers
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.verification.one_dimension import one_contact

STEP = 40e-9  # [s]
PLAIN = (-1, 0, 1, 2)  # kinds of a law: such numbers stand for other things as well
NUMBER = r"(?<![\w.])(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?(?![\w.])"
USERS = (
    "contact.laws",
    "exchange.fmu.build",
    "exchange.matlab_model",
    "exchange.modelica",
    "exchange.state_space",
    "simulation.contact_step",
    "simulation.interface_step",
    "simulation.kernel",
    "simulation.network_interfaces",
    "simulation.propagator",
    "simulation.single_contact",
)


def pair(law, film: FilmRow | None = None) -> ModalModel:
    bodies = (
        rigid_mass_body("needle", 2e-3, port="bottom"),
        fixed_body("seat", port="top"),
    )
    return pair_model(
        "pair",
        one_contact(*bodies, law, gap=1e-6, series=1e-9),
        moving="needle",
        contact_names=["seat"],
        films=(film,),
        speed=-0.4,
        step=STEP,
        duration=1e-5,
        provenance=Provenance(case="pair", title="", version="1", created="2026-01-01"),
    )


def numbers(text: str) -> set[float]:
    return {float(x) for x in re.findall(NUMBER, text)}


@pytest.fixture(scope="module")
def sources() -> dict[str, str]:
    """C sources without their comments."""
    return {
        name: re.sub(r"/\*.*?\*/", "", text.decode(), flags=re.DOTALL)
        for name, text in source_texts(pair(LinearLaw(1e9)), 3, "guid").items()
        if name.startswith("klack_")
    }


def test_the_header_gives_c_every_constant(sources):
    defined = re.findall(r"#define KLACK_(\w+) \((\S+)\)", sources.pop("klack_constants.h"))
    assert {name: float(value) for name, value in defined} == {
        name: value for name, value, _ in shared_constants("C")
    }
    unused = [
        name for name, _ in defined if not any(f"KLACK_{name}" in s for s in sources.values())
    ]
    assert unused == []


def test_no_c_source_writes_a_shared_value_by_hand(sources):
    shared = {value for _, value, _ in shared_constants("C")} - {*PLAIN, 100}
    for name in ("klack_law.h", "klack_film.h", "klack_propagator.h", "klack_state.h"):
        assert shared & numbers(sources[name]) == set(), name
    assert shared & numbers(sources["klack_model.c"]) == set()
    assert shared & numbers(sources["klack_steps.h"]) == {1e-15}  # of the time, not of a film


@pytest.mark.parametrize("module", USERS)
def test_python_takes_its_constants_from_the_table(module):
    shared = {name: getattr(step_constants, name) for name in step_constants.__all__}
    user = importlib.import_module(f"klack.{module}")
    assert user.__file__
    tree = ast.parse(Path(user.__file__).read_text(encoding="utf-8"))
    imported = {
        alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module == "klack.contact.step_constants"
        for alias in node.names
    }
    assert imported
    assert all(getattr(user, name) is shared[name] for name in imported)
    written = {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and type(node.value) in (int, float)
    }
    # whole numbers, a tenth and a thousandth stand for other things as well
    common = {step_constants.SEPARATED, step_constants.SLOWEST}
    values = {x for x in shared.values() if type(x) is float} - common
    assert written & values == set()


def test_modelica_text_is_made_with_the_table():
    power = modelica_text(pair(HertzLaw(2e11)))
    table = modelica_text(pair(TableLaw(np.array([1e-6, 2e-6]), [50.0, 120.0])))
    assert f"for step in 1:{MODELICA_POWER_TURNS} loop" in power
    assert f"for step in 1:{MODELICA_TABLE_TURNS} loop" in table
    film = FilmRow(cubic=5e-17, linear=4e-12, cut_off=0.3e-6, suction=2.0)
    relaxing = modelica_text(pair(LinearLaw(1e9), film))
    (found,) = re.findall(r'relaxation\(unit="s"\) = (\S+)', relaxing)
    assert float(found) == RELAXATION * STEP


def test_matlab_scripts_are_made_with_the_table(tmp_path):
    write_matlab([pair(LinearLaw(1e9))], tmp_path)
    text = (tmp_path / "pair_rhs.m").read_text()
    assert "@" not in re.sub(r"@\(", "", text)
    assert text.count(f"for step = 1:{MATLAB_TURNS}\n") == 2
    assert text.count(f" {MATLAB_LEFT} * ") == 2
    template = Path(step_constants.__file__).parents[1] / "exchange/matlab_scripts/rhs.m"
    assert {MATLAB_TURNS, MATLAB_LEFT} & numbers(template.read_text()) == set()


class Mixed(NamedTuple):
    count: int
    values: Any
    scale: float
    index: Any
    table: Any


class Alike(NamedTuple):
    a: Any
    b: Any


@njit
def scatter(bundle):
    at = pointers(bundle)
    for k in range(at.count):
        at.values[at.index[k]] += at.scale * at.table[2 * k + 1]


@njit
def swap(bundle):
    at = pointers(bundle)
    at.a[0], at.b[0] = at.b[0], at.a[0]


def test_arrays_become_pointers_and_numbers_stay():
    bundle = Mixed(
        count=2,
        values=np.zeros(4),
        scale=10.0,
        index=np.array([3, 1]),
        table=np.array([[1.0, 2.0], [3.0, 4.0]]),
    )

    scatter(bundle)

    assert bundle.values.tolist() == [0.0, 40.0, 0.0, 20.0]
    assert bundle.index.tolist() == [3, 1]


def test_members_of_one_type_keep_their_names():
    bundle = Alike(np.array([1.0]), np.array([2.0]))

    swap(bundle)

    assert (bundle.a[0], bundle.b[0]) == (2.0, 1.0)
