"""Matrices through files and other programs.

Matrices that other programs have assembled: CalculiX, run here, and a file of ANSYS.

Truth: CalculiX's own frequencies, its matrices, and klack's frequencies of the beam whose ``.full``
ships with ansys-mapdl-reader.

One body through every file form: the same frequencies as klack's own matrices give.

Truth: the matrices themselves; files come from scipy, h5py and Octave where those can write the
form, else from writers after the manuals of the programs.
"""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import coo_array, csr_array
from scipy.sparse.linalg import norm

from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.given_matrices import checked_body
from klack.bodies.elasticity.quadrature import quadrature
from klack.bodies.elasticity.shape_functions import shape_functions
from klack.bodies.model_files.system import on_nodes, read_system
from klack.exchange.calculix_run import find_calculix, run_calculix
from klack.input.unit_systems import unit_system
from klack.materials.material import Material
from klack.mesh.files.ansys.reader import read_ansys_archive
from klack.mesh.files.mesh_file import read_mesh_file
from klack.mesh.mesh import Mesh
from klack.verification.exchange_files import MatrixFiles, write_matrices
from klack.verification.lattice import lattice_mesh

needs_calculix = pytest.mark.skipif(find_calculix() is None, reason="CalculiX is not installed")

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
COUNT = 8


def deck(mesh: Mesh, held: bool, step: list[str]) -> str:
    """Input of CalculiX in mm, t, s; node numbers with gaps."""
    lines = ["*NODE, NSET=ALL"]
    lines += [
        f"{3 * i + 10}, {x:.12e}, {y:.12e}, {z:.12e}"
        for i, (x, y, z) in enumerate((mesh.points * 1e3).tolist())
    ]
    lines.append("*ELEMENT, TYPE=C3D10, ELSET=BODY")
    for k, nodes in enumerate((3 * mesh.blocks[0].connectivity + 10).tolist(), start=1):
        lines.append(f"{k}, " + ", ".join(map(str, nodes)))
    foot = (3 * mesh.surface("bottom").nodes + 10).tolist()
    lines += ["*NSET, NSET=FOOT", *(f"{n}," for n in foot)]
    lines += ["*MATERIAL, NAME=STEEL", "*ELASTIC", "210000., 0.3", "*DENSITY", "7.85e-9,"]
    lines += ["*SOLID SECTION, ELSET=BODY, MATERIAL=STEEL"]
    if held:
        lines += ["*BOUNDARY", "FOOT, 1, 3"]
    return "\n".join([*lines, "*STEP", *step, "*END STEP"]) + "\n"


def four_point_mass(mesh: Mesh, density: float) -> csr_array:
    """Consistent mass of ten-node tetrahedra with the 4-point rule, exact to degree 2 only."""
    xi, weight = quadrature("tet10", "stiffness")
    assert len(weight) == 4
    N, dN = shape_functions("tet10", xi)
    nodes = mesh.blocks[0].connectivity
    J = np.einsum("qnk,end->eqkd", dN, mesh.points[nodes])
    m = density * np.einsum("q,eq,qa,qb->eab", weight, np.linalg.det(J), N, N)
    row, column = np.broadcast_arrays(nodes[:, :, None], nodes[:, None, :])
    n = mesh.dof_count
    parts = [
        coo_array((m.ravel(), (3 * row.ravel() + d, 3 * column.ravel() + d)), shape=(n, n))
        for d in range(3)
    ]
    return csr_array(parts[0] + parts[1] + parts[2])


@pytest.mark.slow
@needs_calculix
@pytest.mark.parametrize("held", [False, True])
def test_matrices_of_calculix_give_its_frequencies(held, tmp_path):
    line = np.linspace(-1e-3, 1e-3, 3)
    mesh = lattice_mesh("tet10", [line, 0.8 * line, np.linspace(0.0, 5e-3, 5)])
    storage = ["*FREQUENCY, SOLVER=MATRIXSTORAGE", "1"]
    (tmp_path / "stored.inp").write_text(deck(mesh, held, storage))
    (tmp_path / "modes.inp").write_text(deck(mesh, held, ["*FREQUENCY", str(COUNT + 6)]))
    for name in ("stored", "modes"):
        run_calculix(tmp_path / f"{name}.inp", duration=1.0)

    units = unit_system("mm t s")
    model = read_mesh_file(tmp_path / "stored.inp", 1e-3)
    system = read_system(tmp_path / "stored.sti", tmp_path / "stored.mas")
    placed = on_nodes(system, model.node_numbers, 3)
    K, M = placed.K * units.stiffness, placed.M * units.mass
    body, report = checked_body(
        "block", model.mesh, K, M, absent=placed.absent, numbers=model.node_numbers, units=units
    )

    fixed = mesh.surface("bottom").nodes if held else ()
    own: ElasticBody = elastic_body("block", mesh, {"solid": STEEL}, fixed_nodes=fixed)
    assert report.rigid == (0 if held else 6)
    np.testing.assert_array_equal(placed.absent, own.fixed)
    free = np.ix_(own.free, own.free)
    # the files hold 14 digits
    assert norm(body.K[free] - own.K[free]) < 1e-10 * norm(own.K)
    assert norm(M[free] - four_point_mass(mesh, 7850.0)[free]) < 1e-10 * norm(own.M)
    # the mass with all points exact differs by the quadrature alone
    assert 0.01 < norm(M[free] - own.M[free]) / norm(own.M) < 0.5
    found = eigenmodes(body, count=COUNT).frequency
    skipped = 6 - 6 * held
    other = own_frequencies_after(tmp_path / "modes.dat", skipped)
    np.testing.assert_allclose(found, other, rtol=1e-4)


def own_frequencies_after(path: Path, skipped: int) -> np.ndarray:
    rows = [line.split() for line in path.read_text().splitlines()]
    table = [row for row in rows if len(row) == 5 and row[0].isdigit() and "." in row[3]]
    return np.array([float(row[3]) for row in table])[skipped : skipped + COUNT]


def test_a_file_of_ansys_vibrates_as_the_beam_that_it_is():
    """Cantilever of 1 x 1 x 5 in, titanium; SOLID186 integrates less and is softer by up to 1 %."""
    package = pytest.importorskip("ansys.mapdl.reader")
    pytest.importorskip("mapdl_archive")
    folder = Path(package.__file__).parent / "examples"
    units = unit_system("in lbf s")
    model = read_ansys_archive(folder / "HexBeam.cdb", units.length)
    placed = on_nodes(
        read_system(folder / "file.full", folder / "file.full"), model.node_numbers, 3
    )

    body, report = checked_body(
        "beam",
        model.mesh,
        placed.K * units.stiffness,
        placed.M * units.mass,
        absent=placed.absent,
        numbers=model.node_numbers,
        units=units,
    )

    titanium = Material(
        name="titanium",
        young=16.9e6 * units.pressure,
        poisson=0.31,
        density=4.1408e-4 * units.density,
    )
    materials = dict.fromkeys(model.mesh.solids, titanium)
    clamped = np.unique(placed.absent // 3)
    own = elastic_body("beam", model.mesh, materials, fixed_nodes=clamped)
    ratio = eigenmodes(body, count=6).frequency / eigenmodes(own, count=6).frequency
    assert np.all((ratio > 0.99) & (ratio < 1.0005))
    assert report.held == 63
    assert report.first_frequency == pytest.approx(1283.2003691, rel=1e-6)


UNITS = unit_system("mm t s")
# DMIG keeps 10 digits, single precision 7
ROUNDED = {"DMIG": 1e-6, "OUTPUT4, binary, single": 1e-6}


@pytest.fixture(scope="module")
def body() -> ElasticBody:
    line = np.linspace(-1e-3, 1e-3, 3)
    mesh = lattice_mesh("tet10", [line, 0.9 * line, np.linspace(0.0, 4e-3, 5)])
    return elastic_body("block", mesh, {"solid": STEEL})


@pytest.fixture(scope="module")
def frequencies(body) -> np.ndarray:
    return eigenmodes(body, count=20).frequency


def in_file_order(body: ElasticBody):
    """K and M in mm, t, s with their rows mixed, node numbers with gaps, and their places."""
    numbers = 101 + 3 * np.arange(body.mesh.node_count)
    order = np.random.default_rng(3).permutation(body.dof_count)
    K = (body.K / UNITS.stiffness).tocsr()[order][:, order]
    M = (body.M / UNITS.mass).tocsr()[order][:, order]
    return K, M, numbers, numbers[order // 3], order % 3 + 1


def frequencies_of(files: MatrixFiles, body: ElasticBody, numbers: np.ndarray) -> np.ndarray:
    placed = on_nodes(read_system(files.stiffness, files.mass, dofs=files.dofs), numbers, 3)
    K, M = placed.K * UNITS.stiffness, placed.M * UNITS.mass
    given, report = checked_body("block", body.mesh, K, M, numbers=numbers, units=UNITS)
    assert report.rigid == 6
    assert report.material.density == pytest.approx(STEEL.density, rel=1e-6)
    modulus = STEEL.young * 0.7 / (1.3 * 0.4)  # lambda + 2 mu
    assert report.material.modulus == pytest.approx(modulus, rel=1e-6)
    return eigenmodes(given, count=20).frequency


@pytest.mark.slow
@pytest.mark.parametrize("form", ["Matrix Market, symmetric", *ROUNDED])
def test_a_form_gives_the_same_frequencies(form, body, frequencies, tmp_path):
    """Every form is a check of ``klack verify``, group exchange."""
    K, M, numbers, node, direction = in_file_order(body)

    found = frequencies_of(write_matrices(form, tmp_path, K, M, node, direction), body, numbers)
    np.testing.assert_allclose(found, frequencies, rtol=ROUNDED.get(form, 1e-8))


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="Octave is not installed")
@pytest.mark.parametrize("version", ["-v6", "-v7"])
def test_octave_saves_what_klack_reads(version, body, frequencies, tmp_path):
    K, M, numbers, node, direction = in_file_order(body)
    savemat(tmp_path / "in.mat", {"K": K.tocsc(), "M": M.tocsc()})
    script = f"load('in.mat'); S.K = K; S.M = M; save('{version}', 'out.mat', 'S');"
    subprocess.run(
        ["octave-cli", "--no-init-file", "--eval", script], cwd=tmp_path, check=True, timeout=60
    )
    dofs = write_matrices("NumPy, csr", tmp_path, K, M, node, direction).dofs

    files = MatrixFiles(stiffness=tmp_path / "out.mat", mass=tmp_path / "out.mat", dofs=dofs)

    np.testing.assert_allclose(frequencies_of(files, body, numbers), frequencies, rtol=1e-8)


def test_rows_without_places_are_x_y_z_of_node_after_node(body, frequencies, tmp_path):
    numbers = np.arange(1, body.mesh.node_count + 1)
    savemat(tmp_path / "m.mat", {"K": body.K / UNITS.stiffness, "M": body.M / UNITS.mass})
    files = MatrixFiles(stiffness=tmp_path / "m.mat", mass=tmp_path / "m.mat")

    np.testing.assert_allclose(frequencies_of(files, body, numbers), frequencies, rtol=1e-8)


@pytest.mark.slow
def test_the_ansys_file_of_the_reader_package_is_read_as_there():
    package = pytest.importorskip("ansys.mapdl.reader")
    path = Path(package.__file__).parent / "examples" / "file.full"
    other = package.read_binary(str(path))
    places, K, M = other.load_km(sort=False)

    system = read_system(path, path)

    at = {(node, way + 1): k for k, (node, way) in enumerate(places.tolist())}
    rows = [at[place] for place in zip(system.node, system.direction, strict=True)]
    for ours, theirs in ((system.K, K), (system.M, M)):
        full = (theirs + theirs.T).toarray() - np.diag(theirs.diagonal())
        np.testing.assert_array_equal(ours.toarray(), full[rows][:, rows])
    held = set(zip(system.held.node.tolist(), (system.held.direction - 1).tolist(), strict=True))
    assert held == {tuple(place) for place in other.const.tolist()}
    assert len(held) == 63
