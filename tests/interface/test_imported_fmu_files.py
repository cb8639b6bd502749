"""FMUs as files: what a case may ask of them, and what strangers may hide in them."""

import random
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from klack.errors import ConvergenceError, InputError
from klack.mechanics.fmu_file import describe_fmu, unpack_fmu
from klack.mechanics.imported_fmu import ImportedFmu
from klack.mechanics.rigid_mass import RigidMass
from klack.network.declaration import read_component
from klack.network.network import Network
from klack.network.step_function import evaluate
from klack.simulation.network_run import simulate_network

pytestmark = pytest.mark.filterwarnings("ignore::klack.network.checks.LooseBodyWarning")

Build = Callable[..., Path]
GIVEN = {"coupling_step": 1e-6, "displacement": "x", "velocity": "v", "force": "F"}


@pytest.mark.parametrize("version", [2, 3])
def test_a_description_is_read(version: int, spring_damper_fmu: Build):
    fmu = describe_fmu(spring_damper_fmu(version))

    assert (fmu.version, fmu.identifier, fmu.variable_step) == (version, "spring_damper", True)
    assert fmu.variables["F"].causality == "output"
    assert fmu.variables["k"].unit == "N/m"


@pytest.mark.parametrize("version", [2, 3])
def test_the_test_fmu_is_valid(version: int, spring_damper_fmu: Build):
    """Truth: the schema of the standard, as fmpy has it."""
    pytest.importorskip("fmpy").read_model_description(str(spring_damper_fmu(version)))


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("length", ["m", "mm"])
def test_force_of_the_first_step(version: int, length: str, spring_damper_fmu: Build):
    """F = -k x - c v, its input in the declared unit."""
    per_metre = {"m": 1.0, "mm": 1e3}[length]
    part = ImportedFmu(
        file=spring_damper_fmu(version, length=length),
        parameters={"k": 5e3 / per_metre, "c": 0.5},
        **GIVEN,
    )
    row = rows_of(part).elements[0]

    y, h = 2e-5, 1e-7
    inputs = [0.0, h, y, y + 1e-8, 0.0, 0.0]
    status, out = evaluate(row.step, (), row.state, inputs, 10)

    assert status == 0
    assert out[0] == pytest.approx(-5e3 * y - 0.5 * 1e-8 / h, rel=1e-9)
    assert out[1] == -out[0]
    # the same call again does nothing to the FMU
    assert evaluate(row.step, (), row.state, inputs, 10)[1].tolist() == out.tolist()


def test_a_step_that_is_tried_again_does_not_move_the_fmu_again(spring_damper_fmu: Build):
    """A better end, and fine steps instead of a coarse one; the FMU refuses to be led twice."""
    part = ImportedFmu(file=spring_damper_fmu(), coupling_step=1e-6, displacement="x", force="F")
    row = rows_of(part).elements[0]
    _, out = evaluate(row.step, (), row.state, [0.0, 1e-6, 0.0, 2e-6, 0.0, 0.0], 10)
    forces = []
    for h, end in ((1e-6, 5e-6), (1e-6, 4e-6), (2.5e-7, 3e-6)):
        status, again = evaluate(row.step, (), out[2:8], [1e-6, h, 2e-6, end, 0.0, 0.0], 10)
        assert status == 0
        forces.append(again[0] - again[6] * h / 2)  # linear within the step

    assert forces == pytest.approx([-1000.0 * 2e-6] * 3, rel=1e-12)
    status, out = evaluate(row.step, (), again[2:8], [2e-6, 1e-6, 3e-6, 3e-6, 0.0, 0.0], 10)
    assert (status, out[5]) == (0, pytest.approx(-1000.0 * 3e-6))


def rows_of(part: ImportedFmu):
    return Network({"needle": RigidMass(mass=3e-3), "p": part}, [["needle.body", "p.end"]]).rows()


def test_a_case_file_names_it_with_units(spring_damper_fmu: Build):
    path = spring_damper_fmu()
    text = {"type": "fmu", "file": path.name, "coupling_step": "1 us", "displacement": "x"}

    part = read_component(text | {"force": "F"}, {"folder": path.parent})

    assert isinstance(part, ImportedFmu)
    assert part.file == path
    assert (part.coupling_step, part.extrapolation) == (1e-6, "linear")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"force": "f"}, r"force: got 'f', expected an output .*: F.*did you mean 'F'"),
        ({"force": "x"}, r"'x', which is 'input', expected an output"),
        ({"displacement": "xx"}, r"displacement: got 'xx', expected an input .*: x, v"),
        ({"displacement": "F"}, r"which is 'output'"),
        ({"parameters": {"kk": 1.0}}, r"parameters.kk: .*: F, k, c, steps.*did you mean 'k'"),
        ({"parameters": {"x": 1.0}}, r"parameters.x"),
        ({"displacement": None, "velocity": None}, r"at least one input .*\n?.*x, v"),
        ({"coupling_step": 0.0}, r"coupling_step"),
        ({"file": "no.fmu"}, r"a file that does not exist"),
    ],
)
def test_mistakes_are_named(change: dict, words: str, spring_damper_fmu: Build):
    with pytest.raises(InputError, match=f"(?s){words}"):
        ImportedFmu(**{"file": spring_damper_fmu(), **GIVEN, **change})


def test_a_unit_of_another_kind_is_refused(spring_damper_fmu: Build):
    with pytest.raises(InputError, match="'x' in 'kg', expected a length"):
        ImportedFmu(file=spring_damper_fmu(length="kg"), **GIVEN)


# --------------------------------------------------------------------------- running


def test_an_fmu_that_gives_up_stops_the_run(spring_damper_fmu: Build):
    """It refuses a displacement that is no number."""
    row = rows_of(ImportedFmu(file=spring_damper_fmu(), **GIVEN)).elements[0]
    _, out = evaluate(row.step, (), row.state, [0.0, 1e-6, 0.0, 0.0, 0.0, 0.0], 10)

    nowhere = float("nan")
    status, _ = evaluate(row.step, (), out[2:8], [1e-6, 1e-6, nowhere, 0.0, 0.0, 0.0], 10)

    assert status == -1
    (error,) = row.step.errors
    assert isinstance(error, ConvergenceError)
    assert "the FMU failed (fmi2DoStep gave the status 3, error), in its step from" in str(error)


def test_a_run_cannot_go_on_from_a_stored_state(spring_damper_fmu: Build):
    part = ImportedFmu(file=spring_damper_fmu(), **GIVEN)
    options = {"duration": 2e-5, "step": 5e-7, "coarse": 1, "record": 1e-6}
    first = simulate_network(rows_of(part), start="free", **options)

    with pytest.raises(InputError, match="continued from a stored state"):
        simulate_network(rows_of(part), state=first.state, **options)


@pytest.mark.slow
def test_instances_and_folders_are_given_back(spring_damper_fmu: Build):
    import gc
    from tempfile import gettempdir

    def folders() -> set[Path]:
        return set(Path(gettempdir()).glob("klack-fmu-*"))

    before = folders()
    rows = rows_of(ImportedFmu(file=spring_damper_fmu(3), **GIVEN))
    simulate_network(rows, duration=2e-5, step=5e-7, coarse=1, record=1e-6)
    mine = folders() - before
    assert mine

    del rows
    gc.collect()

    assert not any(folder.exists() for folder in mine)


# --------------------------------------------------------------------------- files of strangers


def rewritten(source: Path, target: Path, change: Callable[[str, bytes], tuple[str, bytes] | None]):
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            kept = change(name, old.read(name))
            if kept is not None:
                new.writestr(*kept)
    return target


def test_another_platform_is_told(spring_damper_fmu: Build, tmp_path: Path):
    path = rewritten(
        spring_damper_fmu(),
        tmp_path / "a.fmu",
        lambda name, data: (name.replace("linux64", "win64"), data),
    )
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("sources/model.c", "")

    part = ImportedFmu(file=path, **GIVEN)

    with pytest.raises(InputError, match=r"(?s)binaries for win64.*fmpy compile a.fmu"):
        rows_of(part)


@pytest.mark.parametrize("name", ["../outside", "/outside", "resources/../../x", "C:x", "a\\b"])
def test_no_file_leaves_the_folder(name: str, spring_damper_fmu: Build, tmp_path: Path):
    path = rewritten(spring_damper_fmu(), tmp_path / "a.fmu", lambda *item: item)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(name, "x")

    with pytest.raises(InputError, match="whose path leaves its folder"):
        ImportedFmu(file=path, **GIVEN)


def test_a_bomb_is_not_unpacked(spring_damper_fmu: Build, tmp_path: Path):
    path = rewritten(spring_damper_fmu(), tmp_path / "a.fmu", lambda *item: item)
    # a size of 3 GiB in the directory of the archive
    data = bytearray(path.read_bytes())
    at = data.rfind(b"PK\x01\x02")
    data[at + 24 : at + 28] = (3 * 2**30).to_bytes(4, "little")
    path.write_bytes(bytes(data))

    with pytest.raises(InputError, match="at most"):
        ImportedFmu(file=path, **GIVEN)


def test_only_what_is_needed_is_unpacked(spring_damper_fmu: Build, tmp_path: Path):
    path = rewritten(spring_damper_fmu(), tmp_path / "a.fmu", lambda *item: item)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("documentation/index.html", "x")
        archive.writestr("resources/table.txt", "x")
    folder = tmp_path / "inside"
    folder.mkdir()

    library = unpack_fmu(describe_fmu(path), folder)

    assert library.is_file()
    assert sorted(item.name for item in folder.iterdir()) == [
        "binaries",
        "modelDescription.xml",
        "resources",
    ]


def test_model_exchange_and_other_files_are_refused(spring_damper_fmu: Build, tmp_path: Path):
    def exchange(name: str, data: bytes) -> tuple[str, bytes]:
        return name, data.replace(b"<CoSimulation", b"<ModelExchange")

    path = rewritten(spring_damper_fmu(), tmp_path / "a.fmu", exchange)
    with pytest.raises(InputError, match="model exchange only"):
        ImportedFmu(file=path, **GIVEN)

    (tmp_path / "b.fmu").write_text("no archive")
    with pytest.raises(InputError, match="cannot be read"):
        ImportedFmu(file=tmp_path / "b.fmu", **GIVEN)


def test_damaged_files_give_a_clear_error(spring_damper_fmu: Build, tmp_path: Path):
    """Cut, with turned bits, with noise: InputError, or a part that works."""
    whole = spring_damper_fmu().read_bytes()
    rng = random.Random(5)
    path = tmp_path / "a.fmu"
    refused = 0
    for k in range(60):
        data = bytearray(whole)
        if k < 20:
            del data[rng.randrange(len(data)) :]
        elif k < 50:
            for _ in range(8):
                at = rng.choice([rng.randrange(len(data)), len(data) - 1 - rng.randrange(300)])
                data[at] ^= 1 << rng.randrange(8)
        else:
            data = bytearray(rng.randbytes(2000))
        path.write_bytes(bytes(data))
        try:
            ImportedFmu(file=path, **GIVEN)
        except InputError:
            refused += 1
    assert refused > 30


@pytest.mark.parametrize("version", [2, 3])
def test_damaged_descriptions_give_a_clear_error(
    version: int, spring_damper_fmu: Build, tmp_path: Path
):
    rng = random.Random(6)
    for k in range(40):

        def spoil(name: str, data: bytes, k: int = k) -> tuple[str, bytes]:
            if not name.endswith(".xml"):
                return name, data
            text = bytearray(data)
            if k % 3 == 0:
                del text[rng.randrange(len(text)) :]
            elif k % 3 == 1:
                lines = data.splitlines()
                rng.shuffle(lines)
                text = bytearray(b"\r\n".join(lines))
            else:
                for _ in range(6):
                    text[rng.randrange(len(text))] = rng.randrange(256)
            return name, bytes(text)

        path = rewritten(spring_damper_fmu(version), tmp_path / f"{k}.fmu", spoil)
        try:
            ImportedFmu(file=path, **GIVEN)
        except InputError:
            pass
