"""Memory: plans of factorisations, and what is refused before it is tried.

What does not fit into memory is refused before it is tried.

Interface: estimate, what is there and the way out are in the message, with an artificially small
machine and with real limits of a process.  Exact: what the limits of control groups leave.

Interface: the memory plan of a factorisation, told before it begins, on machines made small.

Double precision where it fits, single precision where only that fits, one error where none does.
"""

import re
import subprocess
import sys
import tracemalloc
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
from scipy.sparse import csr_array, diags_array, eye_array, kron

from klack.bodies.elasticity import budget as budgets
from klack.bodies.elasticity import factor_memory
from klack.bodies.elasticity.assembly import assemble
from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.budget import Budget
from klack.bodies.elasticity.condensation import condensation_memory
from klack.bodies.elasticity.eigen import block_lanczos, eigenmodes
from klack.bodies.elasticity.factor_memory import FactorMemoryError
from klack.bodies.elasticity.factorization import available_backends, factorize
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.full_order import full_order_receptance
from klack.bodies.reduction.ports import Port
from klack.case import find_case
from klack.contact import statics
from klack.contact.mortar import contact_space
from klack.contact.statics import contact_compliance
from klack.errors import InputError
from klack.machine import memory
from klack.machine.memory import available_memory, in_words, require_memory
from klack.machine.progress import remark, silent
from klack.machine.stages import StageClock
from klack.materials.material import Material
from klack.mesh.meridian import mesh_meridian
from klack.mesh.profile import Line, Profile
from klack.mesh.sizing import MeshSizing, Refinement, element_count
from klack.mesh.solid import mesh_revolved
from klack.mesh.swept import sweep
from klack.terminal.progress import show_progress
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)


def bar(height: float = 4e-3, foot: float = 0.0) -> Profile:
    low, high = foot, foot + height
    return Profile(
        (0, low),
        (
            Line((1e-3, low), "foot"),
            Line((1e-3, high), "side"),
            Line((0, high), "top"),
            Line((0, low), "axis"),
        ),
    )


def body(foot: float = 0.0) -> ElasticBody:
    mesh = mesh_meridian({"bar": bar(foot=foot)}, MeshSizing(size=0.25e-3))
    fixed = mesh.surface("top" if foot >= 0 else "foot").nodes
    return elastic_body("bar", mesh, {"bar": STEEL}, fixed_nodes=fixed)


def lattice(n: int) -> csr_array:
    """Positive definite matrix of n^3 places that each know their 26 neighbours."""
    line = diags_array([np.ones(n - 1), np.ones(n), np.ones(n - 1)], offsets=[-1, 0, 1])
    near = kron(kron(line, line), line)
    return csr_array(60.0 * eye_array(n**3) - near)


@pytest.fixture
def small_machine(monkeypatch):
    """Let a machine have so many bytes; small things count as well."""

    def let(size: float) -> None:
        monkeypatch.setattr(memory, "_WORTH_A_LOOK", 0.0)
        monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=size))

    return let


def test_the_message_says_estimate_bound_and_way_out(small_machine):
    small_machine(10e9)
    require_memory("thing", 9.4e9, what="a large one", hint="a small one.")

    with pytest.raises(InputError) as caught:
        require_memory("thing", 12e9, what="a large one", hint="a small one.")

    assert str(caught.value) == (
        "thing: got a large one needing about 12 GB of memory, expected at most 9.5 GB "
        "(free memory of this machine).\nTry: a small one."
    )


@pytest.mark.parametrize(
    ("size", "words"),
    [(0, "0 kB"), (-5, "0 kB"), (999_600, "1 MB"), (1.234e9, "1.23 GB"), (7e13, "70 TB"),
     (5e18, "5e+03 PB")],
)  # fmt: skip
def test_sizes_in_words(size, words):
    assert in_words(size) == words


def groups(root: Path, files: dict[str, str], own: str, monkeypatch) -> None:
    for name, text in files.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    (root / "own").write_text(own)
    monkeypatch.setattr(memory, "_CGROUPS", root)
    monkeypatch.setattr(memory, "_OWN_CGROUPS", root / "own")


def test_a_limit_of_a_group_above_counts(tmp_path, monkeypatch):
    """Version 2: job.slice may use 3 GB, its child has no limit of its own."""
    files = {
        "job.slice/memory.max": "3000000000\n",
        "job.slice/memory.current": "2500000000\n",
        "job.slice/memory.stat": "anon 2000000000\ninactive_file 400000000\n",
        "job.slice/step/memory.max": "max\n",
        "job.slice/step/memory.current": "1\n",
        "job.slice/step/memory.stat": "inactive_file 0\n",
    }
    groups(tmp_path, files, "0::/job.slice/step\n", monkeypatch)

    there = available_memory()

    assert there.size == 900_000_000  # files that the system can drop are free
    assert "container" in there.bound


def test_a_container_of_version_one_sees_its_limit_at_the_root(tmp_path, monkeypatch):
    files = {
        "memory/memory.limit_in_bytes": "2000000000\n",
        "memory/memory.usage_in_bytes": "500000000\n",
        "memory/memory.stat": "total_inactive_file 0\n",
    }
    own = "5:devices:/docker/x\n4:memory:/docker/x\n3:cpu,cpuacct:/\n"
    groups(tmp_path, files, own, monkeypatch)

    assert available_memory().size == 1_500_000_000


@pytest.mark.parametrize("own", ["", "0::/\n", "4:memory:/../..\n"])
def test_no_limit_leaves_the_machine(tmp_path, monkeypatch, own):
    groups(tmp_path, {}, own, monkeypatch)

    assert available_memory().bound == "free memory of this machine"


@pytest.mark.parametrize("backend", available_backends())
def test_a_factorisation_that_does_not_fit_is_refused(small_machine, monkeypatch, backend):
    A = lattice(12)
    with factorize(A, backend=backend) as factor:
        memory_of_factor = factor.memory
    small_machine(100e3)

    with pytest.raises(InputError, match="times as large") as caught:
        factorize(A, backend=backend)

    text = str(caught.value)
    assert f"a matrix of 1728 degrees of freedom ({backend})" in text
    assert "expected at most 95 kB" in text
    if backend == "pardiso":  # the analysis tells exactly what the factor takes
        assert f"about {in_words(memory_of_factor)} of memory" in text
    small_machine(100e6)
    factorize(A, backend=backend).close()


def test_the_estimate_follows_the_growth_of_nested_dissection():
    """Twice the rows: 2^(4/3) of the memory in space, a little more than twice in the plane."""
    space = [factor_memory.fill_memory("superlu", n, 80 * n) for n in (10_000, 20_000)]
    plane = [factor_memory.fill_memory("superlu", n, 23 * n) for n in (10_000, 20_000)]

    assert space[1] / space[0] == pytest.approx(2 ** (4 / 3), rel=1e-12)
    assert plane[1] / plane[0] == pytest.approx(2 * (1 + 1 / np.log2(10_000)), rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("backend", [b for b in available_backends() if b != "ngsolve"])
def test_the_estimate_is_near_what_the_solver_reports(backend):
    """In the plane, against the report of the solver: 0.7 to 1.5 of it (measured 1.0 to 1.2)."""
    mesh = mesh_meridian({"bar": bar()}, MeshSizing(size=0.06e-3))
    stiff = elastic_body("bar", mesh, {"bar": STEEL}, fixed_nodes=mesh.surface("foot").nodes)
    K = stiff.K[stiff.free][:, stiff.free]
    with factorize(K, backend=backend) as factor:
        reported = factor.memory
    estimate = reported
    if backend != "pardiso":
        estimate = factor_memory.fill_memory(backend, K.shape[0], K.nnz)

    assert 0.7 < estimate / reported < 1.5


def test_too_many_modes_are_refused(small_machine):
    held = body()
    with Flexibility(held) as flexibility:
        eigenmodes(held, count=20, flexibility=flexibility)
        small_machine(100e3)
        with pytest.raises(InputError, match=r"20 modes of .* degrees of freedom needing"):
            eigenmodes(held, count=20, flexibility=flexibility)


def test_a_basis_that_grows_too_large_is_refused(small_machine):
    n = 2000
    A = diags_array(np.arange(1.0, n + 1))
    start = np.random.default_rng(1).standard_normal((n, 8))
    small_machine(2e6)  # the basis begins with 96 vectors, 1.5 MB

    with pytest.raises(InputError, match=r"block Lanczos: got a basis of 144 vectors .*\n.*fewer"):
        block_lanczos(lambda X: A @ X, csr_array(eye_array(n)), start, lambda v: False, n)


def test_a_contact_of_too_many_points_is_refused(small_machine):
    upper, lower = body(foot=0.0), body(foot=-4e-3)
    faces = (upper.mesh.surface("foot"), lower.mesh.surface("top"))
    space = contact_space(upper.mesh, faces[0], lower.mesh, faces[1])
    with Flexibility(upper) as a, Flexibility(lower) as b:
        small_machine(100e3)
        with pytest.raises(InputError, match=r"contact points needing .* of memory"):
            contact_compliance(space, a, b)


def test_the_rows_that_condensing_keeps_are_counted(small_machine):
    """Truth: the peak that tracemalloc sees, with the full matrix of the points; 0.4 to 1 of it."""
    held = body()
    touched = held.mesh.surface("foot").nodes
    count = touched.size
    places = (np.ones(count), (np.arange(count), 2 * touched + 1))
    G = csr_array(places, shape=(count, held.dof_count))
    with Flexibility(held) as flexibility:
        flexibility.condensed(G)  # what is made once only
        tracemalloc.start()
        flexibility.condensed(G)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    estimate = condensation_memory(*G.shape) + 2 * 8 * count**2

    assert 0.4 < peak / estimate < 1.0

    # 5000 points on 200 000 unknowns: 0.8 GB of matrices, 0.5 GB of rows, 0.3 GB of blocks
    large = csr_array((5000, 200_000))
    small_machine(1.4e9)
    with pytest.raises(InputError, match=r"5000 contact points needing about 1.64 GB"):
        statics._require_memory(large[:, :10], large)


def test_a_krylov_basis_that_grows_too_large_is_refused(small_machine):
    held = body()
    pattern = np.zeros(held.dof_count)
    pattern[2 * held.mesh.surface("foot").nodes + 1] = 1.0
    port = Port("foot", pattern)
    modes = eigenmodes(held, count=60)
    with Flexibility(held) as flexibility:
        small_machine(100e3)
        with pytest.raises(InputError, match=r"Krylov basis of .* vectors"):
            full_order_receptance(
                held, [port], [1e3, 1e6], loss_factor=0.01, flexibility=flexibility, modes=modes
            )


@pytest.mark.parametrize(
    ("sizing", "blamed", "fits"),
    [
        (MeshSizing(size=1e-6), "size", "1 um"),
        (MeshSizing(size=1e-3, surfaces={"foot": 1e-8}), "surfaces.foot", "10 nm"),
        (
            MeshSizing(
                size=1e-3,
                refinements=(Refinement(position=(1e-3, 0.0), size=1e-7, radius=0.2e-3),),
            ),
            "contact.size",
            "100 nm",
        ),
    ],
    ids=["everywhere", "on a surface", "at the contact"],
)
@pytest.mark.parametrize("mesher", [mesh_meridian, mesh_revolved])
def test_a_size_by_mistake_is_refused_at_once(small_machine, sizing, blamed, fits, mesher):
    """Before netgen is asked, and with a size that would fit: it passes the same check."""
    small_machine(50e6)

    with pytest.raises(InputError) as caught:
        mesher({"bar": bar()}, sizing)

    text = str(caught.value)
    assert f"{mesher.__name__}: {blamed}: got {fits}, which gives about " in text
    assert f"Try: a 'mesh: {blamed}' of " in text


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
def test_the_estimate_of_elements_has_the_right_size(dimension):
    """Against netgen, without refinements: 0.5 to 1.5 of its elements (fewest in slim rods)."""
    sizing = MeshSizing(size=0.3e-3)
    if dimension == 2:
        made, measure = mesh_meridian({"bar": bar()}, sizing), bar().area
    else:
        made, measure = mesh_revolved({"bar": bar()}, sizing), bar().volume

    estimate = sum(element_count(sizing, dimension, measure, {}).values())

    assert 0.5 < estimate / made.element_count < 1.5


def test_too_many_layers_are_refused(small_machine):
    meridian = mesh_meridian({"bar": bar()}, MeshSizing(size=0.5e-3))
    small_machine(100e6)

    with pytest.raises(InputError, match="100000 layers, which give "):
        sweep(meridian, 100_000)


LIMITED = """
import resource, sys
import psutil
from klack.cli.main import main
{before}
taken = psutil.Process().memory_info().vms
resource.setrlimit(resource.RLIMIT_AS, (taken + {left}, resource.RLIM_INFINITY))
{after}
"""


def limited(before: str, left: int, after: str, folder: Path) -> subprocess.CompletedProcess:
    code = LIMITED.format(before=before, left=left, after=after)
    return subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False
    )


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="RLIMIT_AS")
def test_a_real_limit_is_seen_before_the_factor_is_computed(tmp_path):
    """46 656 rows take 0.2 GB; 100 MB are left.  The library is not driven into the limit."""
    before = (
        f"sys.path.insert(0, {str(Path(__file__).parent)!r})\n"
        "from test_memory_guard import lattice\n"
        "from klack.bodies.elasticity.factorization import factorize\n"
        "from klack.errors import InputError\n"
        "A = lattice(36)\n"
        "factorize(lattice(6), threads=1).close()"
    )
    after = "try:\n    factorize(A, threads=1)\nexcept InputError as error:\n    print(error)"
    done = limited(before, 100_000_000, after, tmp_path)

    assert done.returncode == 0, done.stderr
    found = re.search(r"needing about (\d+) MB of memory, expected at most (\d+)", done.stdout)
    assert found is not None, done.stdout
    assert 100 < int(found[1]) < 500
    assert int(found[2]) < 100
    assert "limit of this process" in done.stdout


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="RLIMIT_AS")
def test_klack_impact_refuses_and_leaves_nothing(tmp_path):
    text = find_case("demo-valve-axisymmetric").read_text()
    assert "size: 0.004 mm" in text
    (tmp_path / "case.yaml").write_text(text.replace("size: 0.004 mm", "size: 0.004 um", 1))

    done = limited("", 8_000_000_000, "sys.exit(main(['impact', 'case.yaml']))", tmp_path)

    assert done.returncode == 2, done.stderr
    key = "bodies.needle.mesh.contact.size"
    assert f"{key}: got 4 nm, which gives about " in done.stderr
    assert f"Try: a {key} of" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["case.yaml"]


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
    assert "computed in single precision, and solutions are refined" in lines[0]
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
        "for 50 modes, needing about",
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
    with pytest.raises(FactorMemoryError, match=r"\(superlu\) needing"):
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
