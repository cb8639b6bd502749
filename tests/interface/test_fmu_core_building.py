"""Building FMUs: sources that compile, binaries, whole files or none, and clear refusals."""

import shutil
import subprocess
import zipfile

import numpy as np
import pytest
from c_compiler import needs_compiler, needs_gcc

from klack.contact.laws import HuntCrossley, LinearLaw, TableLaw
from klack.errors import ConvergenceError, InputError
from klack.exchange.fmu import build, compiler
from klack.exchange.fmu.build import build_fmu, data_header, source_texts
from klack.exchange.fmu.model_description import SOURCE_FILES
from klack.exchange.modal_model import Provenance, body_model, pair_model
from klack.network.rows import FilmRow
from klack.simulation.bodies import rod_body
from klack.verification.one_dimension import one_contact

pytestmark = needs_compiler

STEEL = {"young": 2.1e11, "density": 7850.0}
TABLE = TableLaw(np.array([0.2, 0.5, 1.0, 2.0]) * 1e-6, [20.0, 70.0, 190.0, 520.0])
FILM = FilmRow(cubic=5e-17, linear=4e-12, cut_off=0.3e-6, suction=2.0)
MADE = Provenance(case="rods", title="Rods", version="1", created="2026-01-01T00:00:00")
NEEDLE = rod_body("needle", length=0.03, area=1.2e-5, elastic_modes=6, damping=0.01, **STEEL)
SEAT = rod_body("seat", length=0.05, area=6e-5, elastic_modes=7, support="bottom", **STEEL)
H = 1e-6  # [s]


def pair(law=TABLE, film=None, series=0.0, name="rods"):
    return pair_model(
        name,
        one_contact(NEEDLE, SEAT, law, gap=0.3e-6, series=series),
        moving="needle",
        contact_names=["seat"],
        films=(film,),
        speed=-0.4,
        step=20e-9,
        duration=6e-5,
        provenance=MADE,
    )


MODELS = {
    "dry": pair(),
    "film": pair(film=FILM),
    "film in series": pair(film=FILM, series=2e-9),
    "body": body_model(NEEDLE, provenance=MADE, step=20e-9),
}


@needs_gcc
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", [*MODELS, "Hunt-Crossley"])
def test_sources_compile_without_warnings(name, fmi, tmp_path):
    model = MODELS.get(name) or pair(HuntCrossley(LinearLaw(1e9), 0.2))
    for file, text in source_texts(model, fmi, "guid").items():
        (tmp_path / file).write_bytes(text)
    command = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-fPIC", "-c"]
    subprocess.run([*command, *SOURCE_FILES[fmi]], cwd=tmp_path, check=True)


@pytest.mark.slow
@needs_gcc
def test_static_sources_have_the_prefix_of_the_standard(tmp_path):
    for name, text in source_texts(MODELS["dry"], 2, "guid").items():
        (tmp_path / name).write_bytes(text)
    command = ["gcc", "-DFMI2_FUNCTION_PREFIX=rods_", "-c", *SOURCE_FILES[2]]
    subprocess.run(command, cwd=tmp_path, check=True)
    found = subprocess.run(
        ["nm", "--defined-only", "-g", "klack_fmi2.o", "klack_model.o"],
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    ).stdout
    symbols = [line.split()[-1] for line in found.splitlines() if len(line.split()) == 3]
    assert len(symbols) > 60
    assert all(symbol.startswith("rods_") for symbol in symbols)


def test_every_number_survives_the_header():
    line = data_header(MODELS["film"], "guid").split("klack_omega[")[1].split("{")[1].split("}")[0]
    assert [float(x) for x in line.split(",")] == list(MODELS["film"].omega)


@pytest.mark.slow
@needs_gcc
def test_same_model_gives_the_same_file(tmp_path):
    with zipfile.ZipFile(build_fmu(MODELS["dry"], tmp_path / "a.fmu", fmi=2)) as archive:
        names = set(archive.namelist())
        binary = archive.read("binaries/linux64/rods.so")
    assert {"modelDescription.xml", "sources/klack_model.c", "sources/klack_data.h"} <= names
    assert b"klack_do_step" not in exported(binary, tmp_path)
    assert build._guid(pair(TableLaw([1e-6], [100.0])), 2) != build._guid(MODELS["dry"], 2)
    assert build._guid(pair(), 2) == build._guid(MODELS["dry"], 2)


def exported(binary, folder):
    (folder / "it.so").write_bytes(binary)
    return subprocess.run(
        ["nm", "-D", "--defined-only", str(folder / "it.so")], check=True, capture_output=True
    ).stdout


def test_a_failed_build_leaves_nothing(tmp_path, monkeypatch):
    path = tmp_path / "it.fmu"
    path.write_text("before")
    monkeypatch.setattr(build, "data_header", lambda model, guid: "#error no numbers\n")
    with pytest.raises(ConvergenceError, match="no numbers"):
        build_fmu(MODELS["dry"], path, fmi=2)
    assert path.read_text() == "before"
    assert [file.name for file in tmp_path.iterdir()] == ["it.fmu"]


def test_without_compiler_the_text_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setattr(compiler.shutil, "which", lambda name: None)
    monkeypatch.setattr(compiler.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(InputError, match="the extra 'exchange'"):
        build_fmu(MODELS["dry"], tmp_path / "it.fmu", fmi=2)
    with pytest.raises(InputError, match="mingw-w64"):
        compiler.require_compilers(("win64",))
    with pytest.raises(InputError, match="one of: linux64, win64"):
        compiler.require_compilers(("amiga",))
    with pytest.raises(InputError, match="2 or 3"):
        build_fmu(MODELS["dry"], tmp_path / "it.fmu", fmi=1)


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("x86_64-w64-mingw32-gcc") is None, reason="no mingw")
@pytest.mark.parametrize(("fmi", "folder"), [(2, "win64"), (3, "x86_64-windows")])
def test_windows_library_beside_the_linux_one(fmi, folder, tmp_path):
    path = build_fmu(MODELS["dry"], tmp_path / "it.fmu", fmi=fmi, platforms=("linux64", "win64"))
    with zipfile.ZipFile(path) as archive:
        library = archive.read(f"binaries/{folder}/rods.dll")
        assert any(name.endswith("rods.so") for name in archive.namelist())
    assert library.startswith(b"MZ")
    assert b"libgcc" not in library
