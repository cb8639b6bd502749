"""One body through every file form: the same frequencies as klack's own matrices give.

Truth: the matrices themselves; files come from scipy, h5py and Octave where those can write the
form, else from writers after the manuals of the programs.
"""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from klack.elasticity.body import ElasticBody, elastic_body
from klack.elasticity.eigen import eigenmodes
from klack.elasticity.given_matrices import checked_body
from klack.materials import Material
from klack.model_files.system import on_nodes, read_system
from klack.unit_systems import unit_system
from klack.verification.exchange_files import MatrixFiles, write_matrices
from klack.verification.lattice import lattice_mesh

STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
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
