"""Interface: the memory plan of a factorisation, told before it begins, on machines made small.

Double precision where it fits, single precision where only that fits, one error where none does.
"""

import numpy as np
import psutil
import pytest

from klack import memory
from klack.elasticity import budget as budgets
from klack.elasticity.assembly import assemble
from klack.elasticity.body import elastic_body
from klack.elasticity.budget import Budget
from klack.elasticity.factor_memory import FactorMemoryError
from klack.elasticity.factorization import available_backends, factorize
from klack.elasticity.statics import Flexibility
from klack.errors import InputError
from klack.materials import Material
from klack.progress import remark, silent
from klack.stages import StageClock
from klack.terminal.progress import show_progress
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
needs_pardiso = pytest.mark.skipif(
    "pardiso" not in available_backends(), reason="only PARDISO has single precision"
)


class _Machine:
    """Free memory that is set by hand [byte]."""

    available = 1e12


@pytest.fixture
def machine(monkeypatch):
    monkeypatch.setattr(memory, "_WORTH_A_LOOK", 0.0)
    monkeypatch.setattr(budgets, "_WORTH_TELLING", 0.0)
    monkeypatch.setattr(psutil, "virtual_memory", lambda: _Machine)
    yield _Machine
    _Machine.available = 1e12


@pytest.fixture(scope="module")
def block():
    line = np.linspace(0.0, 2e-3, 6)
    mesh = lattice_mesh("tet10", [line, line, line])
    return elastic_body("block", mesh, {"solid": STEEL}, fixed_nodes=mesh.surface("bottom").nodes)


def sizes(block) -> dict[str, float]:
    K = block.K[block.free][:, block.free]
    found = {}
    for precision in ("double", "single"):
        with factorize(K, precision=precision) as factor:
            found[precision] = float(factor.memory)
    return found


def test_the_plan_names_factor_modes_and_machine(machine, block):
    lines: list[str] = []
    Flexibility(block, budget=Budget(later=2e6, reason="7 modes", tell=lines.append)).close()

    assert len(lines) == 1
    start = f"memory of 'block': {len(block.free)} degrees of freedom, factor in double precision"
    assert lines[0].startswith(start)
    assert lines[0].endswith(", then 2 MB for 7 modes, of 1 TB (free memory of this machine)")


@needs_pardiso
def test_where_double_precision_does_not_fit_single_precision_is_refined(machine, block):
    need, lines = sizes(block), []
    load = np.zeros(block.dof_count)
    load[3 * block.mesh.surface("top").nodes + 2] = 1.0
    with Flexibility(block) as plain:
        expected = plain.solve(load)
    machine.available = (need["single"] + need["double"]) / 2 / 0.95

    with Flexibility(block, budget=Budget(tell=lines.append)) as flexibility:
        found = flexibility.solve(load)
        assert "single precision" in flexibility.factorization.backend

    assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()
    assert len(lines) == 2
    assert "taken in single precision, and solutions are refined" in lines[0]
    assert "factor in single precision" in lines[1]


@needs_pardiso
def test_what_follows_counts_as_well(machine, block):
    """A factor that fits alone, but not together with the modes."""
    need = sizes(block)
    machine.available = 1.05 * need["double"] / 0.95
    Flexibility(block).close()

    with pytest.raises(FactorMemoryError) as caught:
        Flexibility(block, budget=Budget(later=need["double"], reason="50 modes"))

    text = str(caught.value)
    for words in (
        "in single precision and with",
        "for 50 modes, that takes about",
        "Try: elements",
    ):
        assert words in text


@pytest.mark.slow
@needs_pardiso
def test_a_body_too_slender_for_single_precision_names_what_double_takes(machine):
    """400 times as long as thick: rounding makes the single factor indefinite."""
    across, along = np.linspace(0.0, 0.5e-3, 3), np.linspace(0.0, 200e-3, 201)
    rod = elastic_body("rod", lattice_mesh("hex20", [across, across, along]), {"solid": STEEL})
    with Flexibility(rod) as flexibility:
        needed = flexibility.factorization.memory
    machine.available = 0.9 * needed

    with pytest.raises(FactorMemoryError) as caught:
        Flexibility(rod)

    assert f"about {memory.in_words(needed)} of memory" in str(caught.value)
    assert "single precision" not in str(caught.value)


def test_other_solvers_have_one_precision(machine, block):
    machine.available = 10e6  # copies of the matrix fit
    with pytest.raises(FactorMemoryError, match=r"\(superlu\) that takes"):
        Flexibility(block, backend="superlu")


def test_copies_of_the_matrix_are_counted_first(machine, block):
    """On the way into the solver, before its symbolic phase can count."""
    machine.available = 1e6
    with pytest.raises(InputError, match=r"factorisation of body 'block': got the stiffness of"):
        Flexibility(block)


def test_matrices_that_do_not_fit_are_refused(machine, block):
    machine.available = 1e6
    with pytest.raises(InputError, match=r"assemble: mesh: got stiffness and mass of \d+ degrees"):
        assemble(block.mesh, {"solid": STEEL})


def test_the_plan_reaches_the_terminal(capsys):
    """Through the clock of stages, as a line on stderr; a plain function shows nothing."""
    with show_progress() as progress:
        remark(StageClock(progress), "memory of 'block': 1 GB")
    remark(silent, "nothing")

    assert capsys.readouterr().err == "memory of 'block': 1 GB\n"
