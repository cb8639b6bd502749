"""A small FMU that the tests of several folders need."""

import gc
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from zlib import crc32

import pytest
from threadpoolctl import threadpool_limits

if "PYTEST_XDIST_WORKER" not in os.environ:
    # meshes, modes and contact laws are kept as for a user: of one run, in a store of its own that
    # all workers share
    os.environ["KLACK_CACHE"] = tempfile.mkdtemp(prefix="klack-tests-")
if "PYTEST_XDIST_WORKER" in os.environ:
    # workers share the cores: threads of one would wait for those of the other, up to 15 times
    # as long; plugins load NumPy before this file, everything else comes after it
    threadpool_limits(limits=1)
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(variable, "1")

sys.path.append(str(Path(__file__).parent))  # worker processes look there as well
from c_compiler import untested
from energy_ledger import as_for_a_user  # noqa: F401  (every run keeps its energy balance)

STORE = None if "PYTEST_XDIST_WORKER" in os.environ else os.environ["KLACK_CACHE"]


@pytest.fixture(scope="module")
def computes() -> Iterator[None]:
    """Keep nothing and take nothing kept: for tests that replace or count what klack computes."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("KLACK_CACHE", "off")
        yield


ALL_SLOW = re.compile(r"^pytestmark = (?:\[[^]]*)?pytest\.mark\.slow", re.MULTILINE)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Leave out files without a test of this tier: importing them takes as long as many tests."""
    tier = config.option.markexpr
    if tier not in ("slow", "not slow") or not collection_path.name.startswith("test_"):
        return None
    text = collection_path.read_text("utf-8")
    empty = "mark.slow" not in text if tier == "slow" else ALL_SLOW.search(text)
    return True if empty else None


STROKES = re.compile("stroke|network|film")
SHARED = re.compile(r'scope="(?:module|session)"')


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Strokes first, the first half of two workers: one compiles their loop, none waits for it.

    In each half files with a fixture of their own first: what a worker without tests takes from the
    end of the other's is tests that stand alone, so that no fixture is made twice.
    """
    texts = {path: path.read_text("utf-8") for path in {item.path for item in items}}
    places = {
        path: (not STROKES.search(text), not SHARED.search(text)) for path, text in texts.items()
    }
    items.sort(key=lambda item: places[item.path])


def pytest_collection_finish() -> None:
    """Let the garbage collector leave alone what was imported, which stays."""
    gc.freeze()
    gc.set_threshold(20_000)


def pytest_unconfigure() -> None:
    """Remove the store of this run, which its first process made."""
    if STORE is not None:
        shutil.rmtree(STORE, ignore_errors=True)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say at the end of a run what this machine leaves untested, whatever the options."""
    if missing := untested():
        terminalreporter.section("not tested on this machine", sep="=", yellow=True)
        for line in missing:
            terminalreporter.line(line)


SOURCE = Path(__file__).parent / "data" / "spring_damper.c"

VARIABLES = (  # name, FMI 2 and 3 attributes, unit
    ("time", 'causality="independent" variability="continuous"', ""),
    ("x", 'causality="input" variability="continuous" start="0"', "{length}"),
    ("v", 'causality="input" variability="continuous" start="0"', ""),
    ("F", 'causality="output" variability="continuous"', "N"),
    ("k", 'causality="parameter" variability="tunable" start="1000"', "N/m"),
    ("c", 'causality="parameter" variability="tunable" start="0"', "N*s/m"),
    ("steps", 'causality="local" variability="discrete"', ""),
)

HEAD = {
    2: '<fmiModelDescription fmiVersion="2.0" modelName="spring_damper" guid="spring" '
    'numberOfEventIndicators="0">\n<CoSimulation modelIdentifier="spring_damper" '
    'canHandleVariableCommunicationStepSize="{variable}"/>\n',
    3: '<fmiModelDescription fmiVersion="3.0" modelName="spring_damper" '
    'instantiationToken="spring">\n<CoSimulation modelIdentifier="spring_damper" '
    'canHandleVariableCommunicationStepSize="{variable}"/>\n',
}


def describe(version: int, length: str, variable: bool) -> str:
    """Write the description of the FMU in ``tests/data/spring_damper.c``."""
    lines = [HEAD[version].format(variable=str(variable).lower())]
    units = "".join(f'<Unit name="{unit}"/>' for unit in {length, "N", "N/m", "N*s/m"} if unit)
    lines.append(f"<UnitDefinitions>{units}</UnitDefinitions>\n<ModelVariables>\n")
    for reference, (name, given, plain) in enumerate(VARIABLES):
        text = plain.format(length=length)
        unit = f' unit="{text}"' if text else ""
        if version == 2:
            inner = 'start="0"' if 'start="0"' in given else ""
            inner = 'start="1000"' if "1000" in given else inner
            outer = given.split(" start=")[0]
            lines.append(
                f'<ScalarVariable name="{name}" valueReference="{reference}" {outer}>'
                f"<Real {inner}{unit}/></ScalarVariable>\n"
            )
        else:
            lines.append(f'<Float64 name="{name}" valueReference="{reference}" {given}{unit}/>\n')
    known = '<Outputs><Unknown index="4"/></Outputs>' if version == 2 else (
        '<Output valueReference="3"/>'
    )  # fmt: skip
    lines.append(f"</ModelVariables>\n<ModelStructure>{known}</ModelStructure>\n")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + "".join(lines) + "</fmiModelDescription>\n"


def functions(version: int) -> list[str]:
    """Every function that a library of this version must have."""
    from fmpy.fmi2 import FMU2Slave
    from fmpy.fmi3 import FMU3Slave

    kind = FMU2Slave if version == 2 else FMU3Slave
    return [name for name in dir(kind) if name.startswith(f"fmi{version}")]


@pytest.fixture(scope="session")
def spring_damper_fmu(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Build an FMU with F = -k x - c v; it fails when a step is forgotten or done twice.

    ``fault="abort()"`` does that after 4 us, ``at_load="abort()"`` while it is loaded.
    """
    fmpy = pytest.importorskip("fmpy")
    if shutil.which("gcc") is None:
        pytest.skip("no FMU of another program to test with: gcc is not installed")
    folder = tmp_path_factory.mktemp("fmu")
    headers = Path(fmpy.__file__).parent / "c-code"
    source = SOURCE.read_text()

    def build(version: int = 2, *, length: str = "m", variable: bool = True, **does: str) -> Path:
        wrong = "".join(f"_{crc32(f'{key}{value}'.encode()):x}" for key, value in does.items())
        path = folder / f"spring_{version}_{length}_{variable}{wrong}.fmu"
        if path.exists():
            return path
        library = folder / f"spring_damper_{version}{wrong}.so"
        if not library.exists():
            missing = folder / f"missing_{version}.c"
            missing.write_text(
                "".join(
                    f"int {name}(void) {{ return 3; }}\n"
                    for name in functions(version)
                    if f"{name}(" not in source
                )
            )
            command = ["gcc", "-shared", "-fPIC", "-O1", f"-DFMI={version}", f"-I{headers}"]
            command += [f"-D{key.upper()}={value}" for key, value in does.items()]
            files = [str(SOURCE), str(missing), "-o", str(library)]
            subprocess.run([*command, *files, "-lm"], check=True)
        place = fmpy.platform if version == 2 else fmpy.platform_tuple
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("modelDescription.xml", describe(version, length, variable))
            archive.write(library, f"binaries/{place}/spring_damper{fmpy.sharedLibraryExtension}")
        return path

    return build
