"""Matrix files of strangers: a clear InputError or a right result, never anything else."""

import tracemalloc
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array

from klack.bodies.model_files.matrices import MATRIX_FORMATS, read_matrix
from klack.bodies.model_files.node_table import read_node_numbers, read_node_table
from klack.bodies.model_files.system import on_nodes, read_system
from klack.bodies.model_files.system_matrix import read_row_places
from klack.errors import InputError
from klack.verification.exchange_files import MATRIX_WRITERS, write_matrices

NODES = 7
FORMS = list(MATRIX_WRITERS)
TEXT = {".mtx", ".hb", ".matrix", ".sti", ".pch", ".op4"}


def chain() -> tuple[csr_array, csr_array, np.ndarray, np.ndarray]:
    """Springs and masses in a row, three directions: entries of many sizes."""
    n = 3 * NODES
    K = np.zeros((n, n))
    for k in range(n - 3):
        ends = np.ix_([k, k + 3], [k, k + 3])
        K[ends] += (1e5 + 1e4 * k / 3.0) * np.array([[1, -1], [-1, 1]])
    K += 1e3 * np.eye(n)
    M = np.diag(np.linspace(1e-6, 3e-6, n)) + 1e-7 * (
        np.abs(np.subtract.outer(range(n), range(n))) == 3
    )
    node, direction = np.divmod(np.arange(n), 3)
    return csr_array(K), csr_array(M), node + 11, direction + 1


@pytest.fixture(params=FORMS)
def files(request, tmp_path):
    return write_matrices(request.param, tmp_path, *chain())


def try_to_read(files, data: bytes) -> csr_array | None:
    """Both matrices of a changed file, or None where it is refused."""
    files.stiffness.write_bytes(data)
    said = ""
    K = None
    try:
        K = read_matrix(files.stiffness, role="stiffness").matrix
        if files.mass == files.stiffness:
            read_matrix(files.mass, role="mass")
    except InputError as error:
        K, said = None, str(error)
    assert K is not None or str(files.stiffness.parent) in said
    assert len(said) < 1500
    return K


def test_cut_off_files(files):
    data = files.stiffness.read_bytes()
    K = read_matrix(files.stiffness, role="stiffness").matrix

    for cut in np.unique(np.linspace(0, len(data) - 1, 14).astype(int)).tolist():
        found = try_to_read(files, data[:cut])
        # a list of entries may end anywhere; it must not invent any
        assert found is None or found.nnz <= K.nnz


def test_flipped_bytes(files):
    data = np.frombuffer(files.stiffness.read_bytes(), np.uint8)
    rng = np.random.default_rng(8)
    for _ in range(18):
        changed = data.copy()
        at = rng.integers(0, len(data), rng.integers(1, 4))
        changed[at] ^= rng.integers(1, 256, len(at)).astype(np.uint8)
        try_to_read(files, changed.tobytes())


def test_noise(files):
    rng = np.random.default_rng(9)
    data = files.stiffness.read_bytes()
    for size in (0, 1, 3, 24, 500, 5000):
        try_to_read(files, rng.integers(0, 256, size).astype(np.uint8).tobytes())
        try_to_read(files, data[:200] + rng.integers(0, 256, size).astype(np.uint8).tobytes())
    try_to_read(files, b"\n" * 1000)
    try_to_read(files, b"1" * 5000)
    try_to_read(files, b"1e999 " * 500)


def test_text_with_windows_ends_other_letters_and_shuffled_lines(files):
    if files.stiffness.suffix not in TEXT:
        pytest.skip("a binary file")
    data = files.stiffness.read_bytes()
    if b"\0" in data:
        pytest.skip("a binary file")
    K = read_matrix(files.stiffness, role="stiffness").matrix
    windows = try_to_read(files, data.replace(b"\n", b"\r\n"))
    assert windows is not None
    assert abs(windows - K).max() == 0
    lines = data.split(b"\n")
    rng = np.random.default_rng(10)
    for _ in range(10):
        try_to_read(files, b"\n".join(lines[k] for k in rng.permutation(len(lines))))
        k = int(rng.integers(len(lines)))
        try_to_read(files, b"\n".join([*lines[:k], "Gr\u00f6\u00dfe \u9488".encode(), *lines[k:]]))
        try_to_read(
            files, b"\n".join([*lines[:k], lines[k][: len(lines[k]) // 2], *lines[k + 1 :]])
        )


@pytest.mark.slow
def test_huge_counts_take_no_memory(files):
    data = files.stiffness.read_bytes()
    changed = []
    for number in (b"21", b"  21", b" 22", b"57", b"93"):
        for huge in (b"99999999", b"2147483647", b"999999999999"):
            at = data.find(number)
            if at >= 0 and b"\0" not in data:
                changed.append(data[:at] + huge + data[at + len(number) :])
    words = np.frombuffer(data[: len(data) // 4 * 4], "<i4")
    for k in range(min(len(words), 30)) if b"\0" in data else ():
        other = words.copy()
        other[k] = 2**31 - 1
        changed.append(other.tobytes() + data[len(words) * 4 :])
    tracemalloc.start()
    try:
        for text in changed:
            try_to_read(files, text)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 60e6


@pytest.mark.parametrize("ending", MATRIX_FORMATS)
def test_any_ending_meets_files_of_another_kind(ending, tmp_path):
    path = tmp_path / f"Ventil-\u9488{ending}"
    for data in (b"", b"hello\n", b"\x1f\x8b\x08\0" * 99, b"PK\x03\x04" + bytes(500), bytes(5000)):
        path.write_bytes(data)
        with pytest.raises(InputError):
            read_matrix(path, role="stiffness")


@pytest.mark.slow
def test_a_damaged_ansys_file_is_refused(tmp_path):
    package = pytest.importorskip("ansys.mapdl.reader")
    data = (Path(package.__file__).parent / "examples" / "file.full").read_bytes()
    path = tmp_path / "file.full"
    rng = np.random.default_rng(11)
    words = np.frombuffer(data, "<i4")
    for k in range(60):
        changed = words.copy()
        if k % 3 == 0:
            changed = changed[: rng.integers(1, len(words))]
        else:
            at = rng.integers(100, 300) if k % 3 == 1 else rng.integers(300, len(words))
            changed[at] = rng.choice([-1, 0, 7, 2**31 - 1, 10**6])
        path.write_bytes(changed.tobytes())
        for role in ("stiffness", "mass"):
            with suppress(InputError):
                read_matrix(path, role=role)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("%%MatrixMarket matrix coordinate complex symmetric\n1 1 1\n1 1 2 0\n", "complex"),
        ("%%MatrixMarket matrix coordinate real skew-symmetric\n1 1 1\n1 1 2\n", "skew"),
        ("%%MatrixMarket matrix coordinate real general\n2 3 2\n1 1 2\n2 2 1\n", "square"),
        (
            "%%MatrixMarket matrix coordinate real general\n2 2 4\n1 1 2\n2 2 1\n1 2 1\n2 1 3\n",
            "|A - A^T| / |A| = 0.73",
        ),
        (
            "%%MatrixMarket matrix coordinate real general\n2 2 2\n1 1 2\n1 1 1\n",
            "duplicate entries",
        ),
        ("%%MatrixMarket matrix coordinate real general\n2 2 2\n1 1 nan\n2 2 1\n", "not finite"),
        ("%%MatrixMarket matrix coordinate real general\n2 2 2\n1 1 2\n2 3 1\n", "row or column 3"),
        ("1,1, 1,1, 5.0\n-2,1, 1,1, 3.0\n", "internal node -2"),
        ("1,1, 1,1, 5.0\n1,11, 1,11, 3.0\n", "direction 11"),
        ("PART-1.1,1, 1,1, 5.0\n", "PART-1.1"),
        ("1 1 5.0\n2 2\n", ":2"),
        ("2 1 -1.0\n2 2 3.0\n3 2 -1\n3 3 2\n", "no entry on the diagonal in row 1 of 3"),
        ("1,1, 2,1, -1.0\n2,1, 2,1, 3.0\n", "no entry on the diagonal in row 1 of 2"),
    ],
)
def test_what_is_no_stiffness_is_refused_with_the_reason(text, complaint, tmp_path):
    path = tmp_path / "K.mtx"
    path.write_text(text)

    with pytest.raises(InputError) as error:
        read_matrix(path)

    assert complaint in str(error.value)


def test_complex_arrays_are_refused(tmp_path):
    from scipy.io import savemat

    A = np.eye(4) * (1 + 1j)
    savemat(tmp_path / "m.mat", {"K": A})
    np.savez(tmp_path / "m.npz", K=A)
    np.savez(tmp_path / "o.npz", K=np.array([[object()]]))
    for name in ("m.mat", "m.npz", "o.npz"):
        with pytest.raises(InputError):
            read_matrix(tmp_path / name, role="stiffness")


def test_several_matrices_need_a_name(tmp_path):
    np.savez(tmp_path / "m.npz", first=np.eye(4), second=2 * np.eye(4))
    path = tmp_path / "m.npz"

    with pytest.raises(InputError, match="one of: 'first', 'second'") as error:
        read_matrix(path, role="stiffness")

    assert "stiffness_name" in str(error.value)
    assert read_matrix(path, name="SECOND").matrix[0, 0] == 2
    with pytest.raises(InputError, match="as stiffness and as mass"):
        read_system(path, path, stiffness_name="first", mass_name="first")


@pytest.mark.parametrize(
    "text",
    [
        "node, direction\n11, x\n11, y\n12, z\n",
        "11.1\n11.2\n12.3\n",
        "  Matrix_Eqn  Node  DOF\n 1 11 UX\n 2 11 UY\n 3 12 UZ\n",
        "# rows\n11;1\n11;2\n12;3\n",
        "11 u1\r\n11 u2\r\n\r\n12 u3\r\n",
    ],
)
def test_tables_of_rows(text, tmp_path):
    path = tmp_path / "rows.dof"
    path.write_bytes(text.encode())

    rows = read_row_places(path)

    assert rows.node.tolist() == [11, 11, 12]
    assert rows.direction.tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("11, x\n11, q\n", ":2"),
        ("11, x\n11, x\n", "twice"),
        ("", "no rows"),
        ("1 11 UX\n3 11 UY\n", "row 3 after row 1"),
        ("0, x\n", "0, x"),
    ],
)
def test_faulty_tables_of_rows(text, complaint, tmp_path):
    path = tmp_path / "rows.csv"
    path.write_text(text)

    with pytest.raises(InputError) as error:
        read_row_places(path)

    assert complaint in str(error.value)


def test_radial_and_axial_rows_of_a_body_of_revolution(tmp_path):
    (tmp_path / "rows.csv").write_text("node, direction\n1, r\n1, z\n2, r\n2, z\n")

    assert read_row_places(tmp_path / "rows.csv").direction.tolist() == [1, 2, 1, 2]


def test_node_tables(tmp_path):
    table = tmp_path / "nodes.csv"
    table.write_bytes(b"\xef\xbb\xbfnode, x, y, z\r\n7, 1, 2, 3\r\n# more\r\n5, 4.5D0, 5, 6\r\n")

    numbers, points = read_node_table(table, 1e-3, 3)

    assert numbers.tolist() == [7, 5]
    np.testing.assert_allclose(points, [[1e-3, 2e-3, 3e-3], [4.5e-3, 5e-3, 6e-3]])
    (tmp_path / "set.txt").write_text("# tip\n7, 5\n5\n")
    assert read_node_numbers(tmp_path / "set.txt").tolist() == [5, 7]
    faults = (b"", b"1, 2, 3\n", b"1, 2, 3, x\n", b"1,0,0,0\n1,0,0,1\n", b"1,0,0,nan\n", bytes(99))
    for bad in faults:
        table.write_bytes(bad)
        with pytest.raises(InputError):
            read_node_table(table, 1.0, 3)


def test_rows_must_belong_to_the_nodes(tmp_path):
    K, M, node, direction = chain()
    files = write_matrices("NumPy, named arrays", tmp_path, K, M, node, direction)
    system = read_system(files.stiffness, files.mass)

    with pytest.raises(InputError, match="the first is 17"):
        on_nodes(system, np.arange(11, 17), 3)
    with pytest.raises(InputError, match="direction 3 at node 11"):
        on_nodes(system, np.arange(11, 18), 2)
    placed = on_nodes(system, np.arange(10, 20), 3)
    assert placed.absent.tolist() == [0, 1, 2, *range(24, 30)]
    turned = write_matrices("NumPy, named arrays", tmp_path, K, M, node, direction + 3)
    with pytest.raises(InputError, match="no shells, beams"):
        on_nodes(read_system(turned.stiffness, turned.mass), np.arange(11, 18), 3)
    plain = write_matrices("NumPy, csr", tmp_path, K, M, node, direction)
    with pytest.raises(InputError, match="21 rows for 5 nodes"):
        on_nodes(read_system(plain.stiffness, plain.mass), np.arange(5), 3)


@pytest.mark.parametrize(
    ("word", "value"), [("1.5D+03", 1500.0), ("2x", None), ("0x10", None), ("1.01e", None)]
)
def test_a_number_of_matrix_market_is_read_to_its_end(word, value, tmp_path):
    """A reader that stops at the first other letter finds 1.5, 2, 0 and 1.01 here."""
    path = tmp_path / "a.mtx"
    path.write_text(f"%%MatrixMarket matrix coordinate real general\n2 2 2\n2 2 1\n1 1 {word}")
    if value is None:
        with pytest.raises(InputError, match=r"a\.mtx:4"):
            read_matrix(path)
    else:
        assert read_matrix(path).matrix[0, 0] == value
