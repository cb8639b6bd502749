"""FMUs that crash, end their process, sleep or answer nonsense: klack lives on and says so.

Truth: what the FMU was compiled to do, and the processes that the system knows afterwards.
"""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from energy_ledger import allowed

from klack.cli.main import main
from klack.errors import ConvergenceError
from klack.mechanics.fmu_file import describe_fmu
from klack.mechanics.fmu_slave import FmuSlave, FmuWiring
from klack.mechanics.imported_fmu import ImportedFmu
from klack.mechanics.rigid_mass import RigidMass
from klack.network.network import Network
from klack.simulation.network_run import simulate_network

pytestmark = pytest.mark.filterwarnings("ignore::klack.network.checks.LooseBodyWarning")

Build = Callable[..., Path]
FAULTS = {
    "crash": ("raise(SIGSEGV)", "crashed (signal 11, SIGSEGV)"),
    "abort": ("abort()", "crashed (signal 6, SIGABRT)"),
    "kill": ("raise(SIGKILL)", "crashed (signal 9, SIGKILL)"),
    "exit": ("exit(0)", "ended its process (exit code 0)"),
    "exit at once": ("_exit(3)", "ended its process (exit code 3)"),
    "sleep": ("for (;;) sleep(1)", "did not answer within 0.3 s"),
    "endless loop": ("for (volatile int i = 0;; i++)", "did not answer within 0.3 s"),
    "stopped": ("raise(SIGSTOP)", "did not answer within 0.3 s"),
    "closed pipes": ("for (int i = 0; i < 50; i++) close(i)", "ended its process"),
    "nan": ("m->value[4] = NAN", "answered with nan as its force"),
    "infinite": ("m->value[5] = INFINITY", "answered with"),
    "absurd": ("m->value[4] = 1e300", "answered with a force of"),
    "error": ("return FAILED", "status 3, error"),
}


def wiring() -> FmuWiring:
    return FmuWiring(
        displacement=("x", 1.0), velocity=("v", 1.0), force=("F", 1.0), parameters={"k": 1e3}
    )


def slave_of(path: Path) -> FmuSlave:
    return FmuSlave(describe_fmu(path), wiring(), time_limit=0.3)


def part_of(path: Path) -> ImportedFmu:
    return ImportedFmu(
        file=path, coupling_step=1e-6, displacement="x", velocity="v", force="F", time_limit=0.3
    )


def children() -> set[int]:
    """Processes of this one that live, and those that nobody buried."""
    found = set()
    for task in Path("/proc/self/task").iterdir():
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):  # a thread that has ended
            found |= set(map(int, (task / "children").read_text().split()))
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("version", "fault", "words"),
    [(2, *item) for item in FAULTS.values()] + [(3, *FAULTS["crash"]), (3, *FAULTS["error"])],
    ids=[*FAULTS, "crash of FMI 3", "error of FMI 3"],
)
def test_a_run_stops_with_name_and_time(
    version: int, fault: str, words: str, spring_damper_fmu: Build
):
    slave, before = slave_of(spring_damper_fmu(version, fault=fault)), children()
    slave.begin()
    slave.force(1e-3, 0.1)
    slave.run()
    for k in range(5):  # as it should be until 5 us
        assert slave.advance(k * 1e-6, 1e-6, 1e-3, 0.1) == pytest.approx(-1.0, rel=1e-12)

    with pytest.raises(ConvergenceError) as caught:
        slave.advance(5e-6, 1e-6, 1e-3, 0.1)

    assert words in str(caught.value)
    assert f"{slave.fmu.path.name}: the FMU" in str(caught.value)
    assert "in its step from 5 us to 6 us" in str(caught.value)
    assert children() == before


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("raise(SIGSEGV)", "crashed (signal 11, SIGSEGV)"),
        ("exit(0)", "ended its process (exit code 0)"),
        ("for (;;) sleep(1)", "did not answer within 0.3 s"),
    ],
)
def test_loading_is_foreign_code_too(fault: str, words: str, spring_damper_fmu: Build):
    slave, before = slave_of(spring_damper_fmu(at_load=fault)), children()

    with pytest.raises(ConvergenceError) as caught:
        slave.begin()

    assert words in str(caught.value)
    assert "in its initialisation" in str(caught.value)
    assert children() == before


def test_the_time_loop_stops_and_can_run_again(spring_damper_fmu: Build):
    """The error of the FMU, not that of the loop; the same rows begin anew."""
    part = part_of(spring_damper_fmu(fault="abort()"))
    parts = {"needle": RigidMass(mass=3e-3, speed=0.1), "p": part}
    rows = Network(parts, [["needle.body", "p.end"]]).rows()
    options = {"step": 5e-7, "coarse": 1, "record": 5e-7, "start": "free"}

    for _ in range(2):
        with pytest.raises(ConvergenceError, match=r"the FMU crashed \(signal 6"):
            simulate_network(rows, duration=2e-5, **options)
    with allowed("simulate_network", 1e-5):  # explicit coupling
        result = simulate_network(rows, duration=5e-6, **options)
    assert result.time[-1] == pytest.approx(5e-6)


CASE = """
klack: 1
title: Needle with an FMU
network:
  components:
    needle: {{type: rigid-mass, mass: 3 g, points: [tip, top]}}
    seat: {{type: end-stop, gap: 0 um, law: {{kind: linear, stiffness: 1e8 N/m}}}}
    stop: {{type: end-stop, gap: 80 um, law: {{kind: linear, stiffness: 1e8 N/m}}}}
    push: {{type: constant-force, force: 20 N}}
    damper: {{type: fmu, file: {file}, coupling_step: 2 us, displacement: x, force: F{more}}}
  connections:
    - [needle.tip, seat.upper]
    - [seat.lower, ground]
    - [needle.top, stop.lower, push.end, damper.end]
    - [stop.upper, ground]
run: {{duration: 50 us, step: 0.2 us, coarse: 8, record: 2 us, variants: [dry]}}
"""


@pytest.mark.slow
def test_the_command_ends_with_1_and_one_message(spring_damper_fmu: Build, tmp_path, capsys):
    path = spring_damper_fmu(fault="exit(0)")
    case = tmp_path / "case.yaml"
    case.write_text(CASE.format(file=path, more=""))

    assert main(["stroke", str(case), "-q", "--no-report", "--out", str(tmp_path / "o")]) == 1

    told = capsys.readouterr().err
    assert f"{path.name}: the FMU ended its process (exit code 0), in its step from" in told


def test_what_an_fmu_prints_is_not_an_answer(spring_damper_fmu: Build, capfd):
    fault = 'for (int i = 0; i < 99; i++) { write(1, "abcdefgh", 8); write(2, "x", 1); }'
    slave = slave_of(spring_damper_fmu(fault=fault.replace(", ", ",")))
    slave.begin()
    slave.run()

    assert slave.advance(5e-6 - 5e-6, 1e-6, 1e-3, 0.0) == pytest.approx(-1.0)
    slave.advance(1e-6, 5e-6, 1e-3, 0.0)
    assert slave.advance(6e-6, 1e-6, 2e-3, 0.0) == pytest.approx(-2.0)
    assert capfd.readouterr() == ("", "")


def test_an_interrupted_call_is_not_answered_by_the_next(spring_damper_fmu: Build, monkeypatch):
    slave = slave_of(spring_damper_fmu())
    slave.begin()
    process = slave._process
    assert process is not None

    def interrupted() -> float:
        raise KeyboardInterrupt

    monkeypatch.setattr(process, "_receive", interrupted)
    with pytest.raises(KeyboardInterrupt):
        slave.force(1e-3, 0.0)

    assert process._process.poll() is not None
    monkeypatch.undo()
    slave.begin()
    assert slave.force(1e-3, 0.0) == pytest.approx(-1.0)


PARENT = """
import sys
from pathlib import Path
from klack.mechanics.fmu_file import describe_fmu
from klack.mechanics.fmu_slave import FmuSlave, FmuWiring
wiring = FmuWiring(displacement=("x", 1.0), velocity=None, force=("F", 1.0), parameters={})
slave = FmuSlave(describe_fmu(Path(sys.argv[1])), wiring)
slave.begin()
print(slave._process._process.pid, flush=True)
slave.run()
slave.advance(0.0, 1e-6, 0.0, 0.0)
if sys.argv[2] == "hangs":
    slave.advance(1e-6, 9e-6, 0.0, 0.0)
    slave.advance(1e-5, 1e-6, 0.0, 0.0)
print("idle", flush=True)
if sys.argv[2] == "idle":
    sys.stdin.read()
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="looks into /proc")
@pytest.mark.parametrize("state", ["hangs", "idle", "ends"])
def test_no_process_is_left_alone(state: str, spring_damper_fmu: Build):
    """Killed while the FMU hangs in a call, killed while it waits, and at a usual end."""
    fault = 'fclose(fopen("hanging", "w")); for (;;) sleep(1)'
    command = [sys.executable, "-c", PARENT, str(spring_damper_fmu(fault=fault)), state]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as parent:
        assert parent.stdout is not None
        child = int(parent.stdout.readline())
        if state == "hangs":
            _until(Path(f"/proc/{child}/cwd/hanging").exists, 20.0)
        else:
            parent.stdout.readline()
        if state != "ends":
            os.kill(parent.pid, signal.SIGKILL)
        parent.wait()

    _until(lambda: _state(child) in ("", "Z"), 10.0)  # a Z is buried by the first process


def _state(process: int) -> str:
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return ""


def _until(holds: Callable[[], bool], limit: float) -> None:
    end = time.monotonic() + limit
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.01)
