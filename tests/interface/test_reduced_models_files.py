"""Files of reduced models, written by others, come in as they were meant.

Truth: scipy, Octave and pyuff write what klack reads; damaged files are refused in words.
"""

import io
import random
import shutil
import subprocess
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest
import scipy.io
from scipy.sparse import coo_array, csc_array

from klack.bodies.model_files.modal_data import read_modal_data
from klack.bodies.model_files.reduced_models import (
    FileStateSpace,
    read_reduced_matrices,
    read_state_space,
)
from klack.bodies.reduction.reduced_body import StateSpace
from klack.errors import InputError
from klack.simulation.bodies import rod_body

ROD = rod_body(
    "rod", length=0.03, area=1e-5, young=2e11, density=8e3, elastic_modes=4, damping=0.001
)
MODEL = ROD.state_space(with_residual=True)
WITHOUT_RESIDUAL = ROD.state_space(with_residual=False)


def assert_read(found: FileStateSpace, truth: StateSpace = MODEL, rel: float = 0.0) -> None:
    for name in "ABC":
        np.testing.assert_allclose(getattr(found, name), getattr(truth, name), rtol=rel)
    np.testing.assert_allclose(found.D, truth.feedthrough, rtol=rel)


def arrays() -> dict[str, np.ndarray]:
    return {"A": MODEL.A, "B": MODEL.B, "C": MODEL.C, "D": MODEL.feedthrough}


# --------------------------------------------------------------------------- MATLAB, Octave, NumPy


@pytest.mark.parametrize("compressed", [False, True])
def test_arrays_of_a_matlab_file(tmp_path, compressed):
    path = tmp_path / "Modell Düse.mat"
    names = np.array(MODEL.input_names, dtype=object)
    content = {**arrays(), "input_names": names, "comment": "from scipy"}
    scipy.io.savemat(path, content, do_compression=compressed)
    found = read_state_space(path)
    assert_read(found)
    assert found.input_names == ("bottom", "top")
    assert found.output_names == ()


def test_structure_with_small_letters_and_a_sparse_matrix(tmp_path):
    path = tmp_path / "model.mat"
    own = {"a": csc_array(MODEL.A), "b": MODEL.B, "c": MODEL.C, "d": 0.0}
    scipy.io.savemat(path, {"sys": own, "unrelated": np.ones((3, 4))})
    assert_read(
        read_state_space(path), StateSpace(**{**vars(MODEL), "feedthrough": np.zeros((2, 2))})
    )


@pytest.mark.skipif(shutil.which("octave-cli") is None, reason="Octave is not installed")
@pytest.mark.parametrize("option", ["-v6", "-v7", "-text"])
def test_what_octave_saves(tmp_path, option):
    scipy.io.savemat(tmp_path / "in.mat", arrays())
    name = "out.txt" if option == "-text" else "out.mat"
    what = "A B C D" if option == "-text" else "sys"
    script = (
        f"load('{tmp_path}/in.mat'); sys = struct('A', A, 'B', B, 'C', C, 'D', D); "
        f"sys.InputName = {{'tip'; 'top'}}; save('{option}', '{tmp_path}/{name}', "
        + ", ".join(f"'{word}'" for word in what.split())
        + ");"
    )
    subprocess.run(["octave-cli", "--norc", "--eval", script], check=True, timeout=300)
    found = read_state_space(tmp_path / name)
    assert_read(found, rel=1e-15)
    if option != "-text":
        assert found.input_names == ("tip", "top")


def test_arrays_of_a_numpy_file(tmp_path):
    path = tmp_path / "model.npz"
    np.savez_compressed(path, **arrays(), outputs=np.array(["tip", "top"]))
    found = read_state_space(path)
    assert_read(found)
    assert found.output_names == ("tip", "top")


def test_pickled_objects_stay_closed(tmp_path):
    path = tmp_path / "evil.npz"

    class Evil:
        def __reduce__(self):
            return (Path.touch, (tmp_path / "touched",))

    np.savez(path, A=np.array([Evil()], dtype=object), B=np.ones(1), C=np.ones(1))
    with pytest.raises(InputError, match="objects are rejected"):
        read_state_space(path)
    assert not (tmp_path / "touched").exists()


def test_counts_in_a_numpy_header_are_not_believed(tmp_path):
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        head, {"descr": "<f8", "fortran_order": False, "shape": (10**6, 10**6)}
    )
    path = tmp_path / "huge.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("A.npy", head.getvalue() + bytes(64))
    with pytest.raises(InputError, match="no more than the file holds"):
        read_state_space(path)


def test_later_matlab_files_are_named(tmp_path):
    path = tmp_path / "v73.mat"
    path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(600))
    with pytest.raises(InputError, match="v7"):
        read_state_space(path)


def test_matrices_that_do_not_fit_are_named(tmp_path):
    path = tmp_path / "model.mat"
    scipy.io.savemat(path, {**arrays(), "C": MODEL.C[:, :-1]})
    with pytest.raises(InputError, match=r"model.mat: C: got 2 x 9 numbers"):
        read_state_space(path)
    scipy.io.savemat(path, {"A": MODEL.A, "B": MODEL.B})
    with pytest.raises(InputError, match="got the arrays A, B"):
        read_state_space(path)


# --------------------------------------------------------------------------- text


def dense(matrix: np.ndarray, mark: str = " ", form: str = "{:24.16E}") -> str:
    return "\n".join(mark.join(form.format(value) for value in row) for row in matrix)


TITLES = (
    "{name}",
    "{name} matrix",
    "[{name}]",
    "*** MATRIX {name} ***",
    "{name}, {rows}, {columns}",
    "Matrix {name} ({rows} x {columns})",
    "State-space matrix [{name}]: {rows} rows, {columns} columns",
    "{name} = [",
)


@pytest.mark.parametrize("title", TITLES)
@pytest.mark.parametrize("ends", ["\n", "\r\n"])
def test_dense_text_under_many_titles(tmp_path, title, ends):
    """SPMWRITE with its file format 0, and what people make of it."""
    text = "State-space matrices of the needle\nInput labels: tip top\nOutput labels: tip, top\n"
    for name, matrix in arrays().items():
        rows, columns = matrix.shape
        text += title.format(name=name, rows=rows, columns=columns) + "\n" + dense(matrix) + "\n"
    path = tmp_path / "needle.spm"
    path.write_bytes(text.replace("\n", ends).encode())
    found = read_state_space(path)
    assert_read(found)
    assert found.input_names == found.output_names == ("tip", "top")


def test_rows_broken_over_lines_and_fortran_exponents(tmp_path):
    text = ""
    for name, matrix in arrays().items():
        values = [f"{value:.16E}".replace("E", "D") for value in matrix.ravel()]
        lines = [" ".join(values[i : i + 5]) for i in range(0, len(values), 5)]
        text += f"{name} matrix\n" + "\n".join(lines) + "\n"
    path = tmp_path / "needle.spm"
    path.write_text(text)
    assert_read(read_state_space(path))


def test_matrix_market_blocks(tmp_path):
    """SPMWRITE with its file format 1: non-zeros only; D is left out where it is zero."""
    text = ""
    for name, matrix in list(arrays().items())[:3]:
        stream = io.BytesIO()
        scipy.io.mmwrite(stream, coo_array(matrix), precision=17)
        text += f"% Matrix {name}\n" + stream.getvalue().decode()
    path = tmp_path / "needle.spm"
    path.write_text(text)
    assert_read(read_state_space(path), WITHOUT_RESIDUAL, rel=1e-15)


@pytest.mark.parametrize("mark", [",", ";", "\t"])
def test_csv_of_a_spreadsheet(tmp_path, mark):
    text = f"inputs{mark}force_tip{mark}force_top\n"
    for name, matrix in arrays().items():
        text += f"{name}{mark * 9}\n{dense(matrix, mark, '{:.17g}')}\n"
    path = tmp_path / "needle.csv"
    path.write_text("\ufeff" + text)
    found = read_state_space(path)
    assert_read(found)
    assert found.input_names == ("force_tip", "force_top")


def test_text_that_is_no_model_is_placed(tmp_path):
    path = tmp_path / "needle.csv"
    for text, words in (
        ("A\n0,1\n-4,zero\n", r"line 3: got '-4,zero'"),
        ("A,2,2\n0,1\n-4\n", "got 3 numbers of A, expected 2 x 2"),
        ("MODELDEF needle\n{\n}\n", "file format 0 or 1"),
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=words):
            read_state_space(path)


def test_matrices_of_craig_and_bampton(tmp_path):
    K, M = np.diag([1e6, 2e6, 3e6]), np.diag([1e-3, 1.0, 1.0])
    scipy.io.savemat(
        tmp_path / "cb.mat", {"Kr": K, "Mr": M, "labels": np.array(["tip", "q1", "q2"])}
    )
    found = read_reduced_matrices(tmp_path / "cb.mat")
    assert found.names == ("tip", "q1", "q2")
    np.testing.assert_array_equal(found.K, K)
    (tmp_path / "cb.csv").write_text(f"K\n{dense(K, ',')}\nM\n{dense(M, ',')}\n")
    np.testing.assert_array_equal(read_reduced_matrices(tmp_path / "cb.csv").M, M)


def test_superelement_of_nastran(tmp_path):
    """KAA and MAA by columns in OUTPUT4 text, as the format's manual lays it down."""
    K = np.array([[2e6, -1e6, 0.0], [-1e6, 2e6, -5e5], [0.0, -5e5, 3e6]])
    M = np.diag([1e-3, 2e-3, 1.0])
    text = ""
    for name, matrix in (("KAA", K), ("MAA", M)):
        text += f"{3:8d}{3:8d}{6:8d}{2:8d}{name:8s}1P,3E23.16\n"
        for j in range(3):
            numbers = "".join(f"{value:23.16E}" for value in matrix[:, j])
            text += f"{j + 1:8d}{1:8d}{3:8d}\n{numbers}\n"
        text += f"{4:8d}{1:8d}{1:8d}\n{1.0:23.16E}\n"
    (tmp_path / "super.op4").write_text(text)
    found = read_reduced_matrices(tmp_path / "super.op4")
    np.testing.assert_array_equal(found.K, K)
    np.testing.assert_array_equal(found.M, M)


# --------------------------------------------------------------------------- modal data


def written_by_pyuff(path: Path, **changes: object) -> Path:
    pyuff = pytest.importorskip("pyuff")
    path.unlink(missing_ok=True)
    file = pyuff.UFF(str(path))
    units = {"units_code": 9, "units_description": "mm, N", "temp_mode": 1, "temp_offset": 0.0}
    file.write_sets({"type": 164, **units, "length": 1e3, "force": 1.0, "temp": 1.0}, "add")
    for i in range(ROD.mode_count):
        given = {
            "analysis_type": 2,
            "modal_m": 2.0,
            "r3": np.sqrt(2.0) * ROD.port_shapes[i],
            **changes,
        }
        file.write_sets(
            pyuff.prepare_55(
                model_type=1,
                id1="rod",
                id2="NONE",
                id3="NONE",
                id4="NONE",
                id5="NONE",
                data_ch=2,
                spec_data_type=8,
                data_type=2,
                load_case=1,
                mode_n=i + 1,
                freq=float(ROD.frequencies[i]),
                modal_damp_vis=float(ROD.damping[i]),
                modal_damp_his=0.0,
                node_nums=np.array([3, 8]),
                r1=np.zeros(2),
                r2=np.zeros(2),
                **given,
            ),
            "add",
        )
    return path


def test_universal_file_of_pyuff(tmp_path):
    """Five decimals: 1e-5 relative, shapes after division by the modal mass."""
    found = read_modal_data(written_by_pyuff(tmp_path / "rod.uff"))
    assert found.frequency == pytest.approx(ROD.frequencies, rel=1e-5)
    assert found.damping == pytest.approx(ROD.damping, rel=1e-5)
    assert found.labels == ("3 x", "3 y", "3 z", "8 x", "8 y", "8 z")
    shapes = found.shapes[:, [2, 5]] / np.sqrt(found.modal_mass)[:, None]
    assert shapes == pytest.approx(ROD.port_shapes, rel=2e-5)
    assert (found.length, found.force) == (1e-3, 1.0)


def test_universal_file_without_modal_mass_or_modes(tmp_path):
    with pytest.raises(InputError, match="modal mass of 0"):
        read_modal_data(written_by_pyuff(tmp_path / "rod.uff", modal_m=0.0))
    path = tmp_path / "response.uff"
    path.write_text("    -1\n    58\n" + "x\n" * 12 + "    -1\n")
    with pytest.raises(InputError, match="frequency responses \\(dataset 58\\) are not modes"):
        read_modal_data(path)


def test_table_and_arrays_of_modes(tmp_path):
    rows = np.column_stack([ROD.frequencies, ROD.damping, ROD.port_shapes])
    path = tmp_path / "rod.csv"
    head = "# rod\nfrequency [Hz],damping,Spitze,oben\n"
    path.write_text(head + dense(rows, ",", "{:.17g}") + "\n")
    found = read_modal_data(path)
    assert found.labels == ("Spitze", "oben")
    np.testing.assert_array_equal(found.shapes, ROD.port_shapes)
    scipy.io.savemat(
        tmp_path / "rod.mat",
        {"frequencies": ROD.frequencies, "Phi": ROD.port_shapes.T, "zeta": 0.001},
    )
    found = read_modal_data(tmp_path / "rod.mat")
    np.testing.assert_array_equal(found.shapes, ROD.port_shapes)
    assert found.damping == pytest.approx(0.001)
    assert found.labels == ("1", "2")


# --------------------------------------------------------------------------- damage


def damaged(data: bytes, seed: int) -> list[bytes]:
    """Cut short, bits turned, lines shuffled, numbers blown up, other line ends, noise."""
    rng = random.Random(seed)
    out = [data[: len(data) * i // 12] for i in range(12)]
    for _ in range(25):
        flipped = bytearray(data)
        for _ in range(3):
            flipped[rng.randrange(len(flipped))] ^= 1 << rng.randrange(8)
        out.append(bytes(flipped))
    for _ in range(5):
        lines = data.split(b"\n")
        rng.shuffle(lines)
        out.append(b"\n".join(lines))
    for old, new in ((b"2", b"999999999"), (b"10", b"-1"), (b"1", b"nan"), (b"0", b"1e999")):
        out += [data.replace(old, new), data.replace(old, new, 1), data.replace(old, new, 5)]
    out += [data.replace(b"\n", b"\r\n"), data + data, rng.randbytes(500), b"", b"\n", b"\0" * 200]
    return out


def text_model(title: str) -> bytes:
    parts = [
        title.format(name=n, rows=len(m), columns=m.shape[1]) + "\n" + dense(m, ",", "{:.6g}")
        for n, m in arrays().items()
    ]
    return ("inputs,tip,top\n" + "\n".join(parts) + "\n").encode()


def market_model() -> bytes:
    text = b""
    for name, matrix in arrays().items():
        stream = io.BytesIO()
        scipy.io.mmwrite(stream, coo_array(matrix), precision=6)
        text += f"% {name}\n".encode() + stream.getvalue()
    return text


def stored(writer: str) -> bytes:
    stream = io.BytesIO()
    if writer == "npz":
        np.savez(stream, **arrays())
    else:
        scipy.io.savemat(stream, arrays(), do_compression=writer == "compressed")
    return stream.getvalue()


def table() -> bytes:
    rows = np.column_stack([ROD.frequencies, ROD.damping, ROD.port_shapes])
    return ("frequency [Hz],damping,tip,top\n" + dense(rows, ",", "{:.6g}") + "\n").encode()


@pytest.mark.parametrize(
    ("name", "data", "reader"),
    [
        ("m.csv", text_model("{name}"), read_state_space),
        ("m.csv", text_model("{name},{rows},{columns}"), read_state_space),
        ("m.spm", market_model(), read_state_space),
        ("m.npz", stored("npz"), read_state_space),
        ("m.mat", stored("plain"), read_state_space),
        ("m.mat", stored("compressed"), read_state_space),
        ("m.csv", table(), read_modal_data),
    ],
)
def test_damaged_files_are_refused_in_words(tmp_path, name, data, reader):
    path = tmp_path / name
    refused = read = 0
    contents = damaged(data, 7)
    for content in contents:
        path.write_bytes(content)
        try:
            found = reader(path)
        except InputError as error:
            refused += str(path) in str(error)
        else:
            read += 1
            numbers = found.A if reader is read_state_space else found.shapes
            assert np.all(np.isfinite(numbers))
            assert numbers.size <= 4 * max(len(content), 64)
    assert refused + read == len(contents)  # each refusal names the file
    assert refused > 15


@pytest.mark.slow
def test_short_lines_take_no_multiple_of_their_file(tmp_path):
    """One number per line: the text, the numbers and the matrices, nothing per line."""
    path = tmp_path / "m.csv"
    path.write_text("A\n" + "1\n" * 300**2 + "B\n" + "1\n" * 300 + "C\n" + "1\n" * 300)
    tracemalloc.start()
    found = read_state_space(path)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 4 * path.stat().st_size + 3 * found.A.nbytes


def test_damaged_universal_files_are_refused_in_words(tmp_path):
    source = written_by_pyuff(tmp_path / "rod.uff")
    pyuff = pytest.importorskip("pyuff")
    x = np.linspace(1e3, 9e3, 5)
    response = {"func_type": 4, "rsp_node": 3, "rsp_dir": 3, "ref_node": 8, "ref_dir": 3}
    kinds = {"abscissa_spec_data_type": 18, "ordinate_spec_data_type": 8}
    pyuff.UFF(str(source)).write_sets(
        pyuff.prepare_58(
            binary=0,
            data=1e-9 * (x + 1j),
            x=x,
            id1="r",
            rsp_ent_name="a",
            ref_ent_name="a",
            abscissa_spacing=1,
            orddenom_spec_data_type=13,
            **response,
            **kinds,
        ),
        "add",
    )
    found = read_modal_data(source).responses[0]
    assert (found.response, found.reference) == ("3 z", "8 z")
    assert found.values == pytest.approx(1e-9 * (x + 1j), rel=1e-5)
    data = source.read_bytes()
    path = tmp_path / "m.uff"
    refused = read = 0
    contents = damaged(data, 11)
    for content in contents:
        path.write_bytes(content)
        try:
            found = read_modal_data(path)
        except InputError as error:
            refused += str(path) in str(error)
        else:
            read += 1
            assert np.all(np.isfinite(found.shapes))
    assert refused + read == len(contents)
    assert refused > 15
