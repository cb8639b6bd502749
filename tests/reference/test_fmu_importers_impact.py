"""Truth: programs of others run the FMUs.

Truth: programs of others run the FMUs, and give what klack's own solvers give.

Importers: fmpy (both versions of the standard; its CVode for model exchange), libcosimpy (the C++
library libcosim with FMI Library), ecospy (the C++ library ecos), and a small C program that knows
nothing but the function names, on Linux and, under wine, with the Windows binary.

Truth: klack's network solver runs bodies and end stops of a valve; fmpy runs their FMU.

Without films, or without series compliances, the same model has model exchange, and CVode of
SUNDIALS runs it.
"""

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from c_compiler import needs_compiler, needs_gcc

from klack.assembling.modes import mode_pools
from klack.assembling.problem import build_problem
from klack.assembling.reduced_pair import first_stiffness, impact_system, own_pair
from klack.assembling.valve import build_valve
from klack.case import find_case, load_case
from klack.case.any_case import load_any_case
from klack.contact.laws import HuntCrossley
from klack.exchange.case_models import case_models
from klack.exchange.fmu.build import build_fmu
from klack.machine.progress import silent
from klack.mechanics.force import ConstantForce
from klack.network.network import Network
from klack.simulation.impact import simulate
from klack.simulation.network_run import simulate_network

pytestmark = [pytest.mark.slow, needs_compiler]


fmpy = pytest.importorskip("fmpy")
validation = pytest.importorskip("fmpy.validation")

HOST = Path(__file__).parents[1] / "data" / "fmu_host.c"
WINDOWS_COMPILER = "x86_64-w64-mingw32-gcc"
STEP, COUNT = 1e-7, 550
OUTPUTS = ["lift", "velocity", "contact_force", "mean_contact_force", "peak_contact_force"]


class Impact:
    """The axisymmetric impact: klack's record at its own step and at a sixteenth, and the FMUs."""

    def __init__(self, folder):
        case = load_case(find_case("demo-valve-axisymmetric"))
        problem = build_problem(case, silent)
        pools = mode_pools(problem, at_least=1, progress=silent)
        reduced = own_pair(problem, pools, stiffness=first_stiffness(problem))
        problem.close()
        system = impact_system(case, reduced.upper, reduced.lower, reduced.law)
        self.native, self.fine = (
            simulate(
                system,
                velocities={reduced.upper.name: -case.motion.speed},
                step=case.run.reduced_step / parts,
                duration=COUNT * STEP,
                steps_per_record=parts,
            )
            for parts in (1, 16)
        )
        self.model = case_models(case).pair
        windows = shutil.which(WINDOWS_COMPILER) is not None
        platforms = ("linux64", "win64") if windows else ("linux64",)
        self.fmu = {
            fmi: str(build_fmu(self.model, folder / f"{fmi}.fmu", fmi=fmi, platforms=platforms))
            for fmi in (2, 3)
        }


@pytest.fixture(scope="module")
def impact(tmp_path_factory):
    return Impact(tmp_path_factory.mktemp("impact"))


@pytest.fixture(params=[2, 3], ids=["fmi2", "fmi3"])
def fmi_impact(request):
    return request.param


def references(path):
    return {v.name: v.valueReference for v in fmpy.read_model_description(path).modelVariables}


def test_validator_finds_nothing(impact, fmi_impact):
    assert validation.validate_fmu(impact.fmu[fmi_impact]) == []


def test_co_simulation_is_the_native_run(impact, fmi_impact):
    native = impact.native
    found = fmpy.simulate_fmu(
        impact.fmu[fmi_impact],
        fmi_type="CoSimulation",
        stop_time=COUNT * STEP,
        output_interval=native.step,
        output=OUTPUTS,
    )
    n = len(native.force)

    # the same steps in another order of summation
    force = found["mean_contact_force"][1 : n + 1]
    peak = native.peak_force.max()
    np.testing.assert_allclose(force, native.force[:, 0], rtol=0.0, atol=1e-11 * peak)
    np.testing.assert_allclose(found["velocity"][: n + 1], native.velocity[:, 0], atol=1e-11)
    assert found["peak_contact_force"].max() == pytest.approx(peak, rel=1e-12)


def test_communication_step_without_inputs_changes_nothing(impact, fmi_impact):
    coarse, fine = (
        fmpy.simulate_fmu(
            impact.fmu[fmi_impact],
            fmi_type="CoSimulation",
            stop_time=COUNT * STEP,
            output_interval=step,
            output=OUTPUTS,
        )
        for step in (1e-6, STEP)
    )

    # the internal steps are the same 20 ns
    np.testing.assert_allclose(coarse["lift"], fine["lift"][::10], rtol=1e-10, atol=1e-18)
    assert coarse["peak_contact_force"].max() == pytest.approx(
        impact.native.peak_force.max(), rel=1e-11
    )


def test_model_exchange_under_cvode_is_the_native_run(impact, fmi_impact):
    fine = impact.fine
    found = fmpy.simulate_fmu(
        impact.fmu[fmi_impact],
        fmi_type="ModelExchange",
        solver="CVode",
        relative_tolerance=1e-10,
        stop_time=COUNT * STEP,
        output_interval=fine.step,
        output=OUTPUTS,
    )
    time = fine.step * np.arange(len(fine.velocity))
    velocity = np.interp(time, found["time"], found["velocity"])

    # klack at 1.25 ns against 20 ns: 4e-6 in the peak
    assert found["contact_force"].max() == pytest.approx(fine.peak_force.max(), rel=1e-5)
    assert impact.native.peak_force.max() == pytest.approx(fine.peak_force.max(), rel=1e-5)
    np.testing.assert_allclose(velocity, fine.velocity[:, 0], rtol=0.0, atol=1e-6)
    impulse = fine.force.sum() * fine.step
    mass = impulse / (fine.velocity[-1, 0] - fine.velocity[0, 0])
    gained = found["velocity"][-1] - found["velocity"][0]
    assert mass * gained == pytest.approx(impulse, rel=1e-6)


def test_lift_of_both_kinds_agrees(impact, fmi_impact):
    runs = [
        fmpy.simulate_fmu(
            impact.fmu[fmi_impact],
            fmi_type=kind,
            stop_time=COUNT * STEP,
            output_interval=STEP,
            output=["lift"],
            **more,
        )
        for kind, more in (
            ("CoSimulation", {}),
            ("ModelExchange", {"solver": "CVode", "relative_tolerance": 1e-10}),
        )
    ]
    lift = np.interp(runs[0]["time"], runs[1]["time"], runs[1]["lift"])

    way = np.ptp(runs[0]["lift"])
    np.testing.assert_allclose(runs[0]["lift"], lift, rtol=0.0, atol=1e-6 * way)


def test_libcosim_gives_the_native_peak(impact):
    pytest.importorskip("libcosimpy")
    from libcosimpy.CosimEnums import CosimVariableType
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    reference = references(impact.fmu[2])
    execution = CosimExecution.from_step_size(round(STEP * 1e9))
    slave = execution.add_local_slave(CosimLocalSlave(impact.fmu[2], "impact"))
    observer = CosimObserver.create_time_series(COUNT + 1)
    execution.add_observer(observer)
    found = {}
    names = ("peak_contact_force", "velocity")
    for name in names:
        observer.start_time_series(slave, reference[name], CosimVariableType.REAL)
    assert execution.step(COUNT)
    for name in names:
        found[name] = observer.time_series_real_samples(slave, reference[name], 1, COUNT)[2]

    assert len(found["velocity"]) == COUNT
    assert max(found["peak_contact_force"]) == pytest.approx(
        impact.native.peak_force.max(), rel=1e-11
    )
    assert found["velocity"][-1] == pytest.approx(impact.native.velocity[-1, 0], rel=1e-10)


def test_ecos_gives_the_native_peak(impact):
    try:
        import ecospy
    except (ImportError, OSError) as error:
        pytest.skip(f"ecospy: {error}")

    with ecospy.EcosSimulationStructure() as structure:
        structure.add_model("impact", impact.fmu[2])
        with ecospy.EcosSimulation(structure=structure, step_size=STEP) as simulation:
            assert simulation.init()
            peak = 0.0
            for _ in range(COUNT):
                simulation.step()
                peak = max(peak, simulation.get_real("impact::peak_contact_force"))
            velocity = simulation.get_real("impact::velocity")

    assert peak == pytest.approx(impact.native.peak_force.max(), rel=1e-11)
    assert velocity == pytest.approx(impact.native.velocity[-1, 0], rel=1e-10)


def by_host(impact, folder, compiler, platform, ending, run):
    """Peak force and last velocity that the small C program prints."""
    unpacked = Path(fmpy.extract(impact.fmu[2], str(folder / "unpacked")))
    host = folder / "host.exe"
    subprocess.run([compiler, "-O1", str(HOST), "-o", str(host), *ending], check=True)
    (library,) = (unpacked / "binaries" / platform).iterdir()
    reference = references(impact.fmu[2])
    numbers = [repr(STEP), str(COUNT)]
    numbers += [str(reference[name]) for name in ("peak_contact_force", "velocity")]
    done = subprocess.run(
        [*run, str(host), str(library), fmpy.read_model_description(impact.fmu[2]).guid, *numbers],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return [float(word) for word in done.stdout.split()]


@needs_gcc
def test_bare_c_program_gives_the_native_peak(impact, tmp_path):
    peak, velocity = by_host(impact, tmp_path, "gcc", "linux64", ["-ldl"], [])

    assert peak == pytest.approx(impact.native.peak_force.max(), rel=1e-11)
    assert velocity == pytest.approx(impact.native.velocity[-1, 0], rel=1e-10)


@pytest.mark.skipif(shutil.which(WINDOWS_COMPILER) is None, reason="no mingw")
@pytest.mark.skipif(shutil.which("wine") is None, reason="no wine")
def test_windows_binary_gives_the_native_peak(impact, tmp_path, monkeypatch):
    monkeypatch.setenv("WINEDEBUG", "-all")
    peak, velocity = by_host(impact, tmp_path, WINDOWS_COMPILER, "win64", [], ["wine"])

    # sin, exp and log of another C library
    assert peak == pytest.approx(impact.native.peak_force.max(), rel=1e-9)
    assert velocity == pytest.approx(impact.native.velocity[-1, 0], rel=1e-9)


OPENING = ("contact_force_opening", "peak_contact_force_opening")
FORCE, DURATION = 20.0, 3e-4  # [N] opening, on the spring face; one impact on the opening stop


@pytest.fixture(scope="module")
def case():
    return load_any_case(find_case("demo-stroke"))


@pytest.fixture(scope="module")
def pair(case):
    return case_models(case).pair


def native(case, step):
    """Flexible bodies and end stops of the valve alone, pushed by a constant force."""
    valve = build_valve(case)
    parts = {
        name: part
        for name, part in valve.network.components.items()
        if part.type in ("flexible-body", "end-stop")
    }
    joined = [
        [port for port in ports if port.split(".")[0] in parts]
        for ports in valve.network.connections
    ]
    joined = [ports + ["drive.end"] * ("needle.spring_face" in ports) for ports in joined]
    network = Network(
        parts | {"drive": ConstantForce(force=FORCE)},
        [ports for ports in joined if len(ports) > 1],
        fluid=valve.network.fluid,
    )
    return simulate_network(
        network.rows(), duration=DURATION, step=step, coarse=1, record=1e-6, start="free"
    )


def by_fmu(path, kind, **more):
    return fmpy.simulate_fmu(
        str(path),
        fmi_type=kind,
        stop_time=DURATION,
        start_values={"force_spring_face": FORCE} | more.pop("start_values", {}),
        output=[*("velocity", "lift", "gap_opening"), *OPENING],
        **more,
    )


@pytest.mark.parametrize("share", [1, 4])
def test_co_simulation_with_films_is_the_native_network(case, pair, tmp_path, share):
    """The same steps up to the touch; those of touch and release the network cuts, the FMU not."""
    pair = replace(pair, step=pair.step / share)
    run = native(case, pair.step)
    path = build_fmu(pair, tmp_path / "v.fmu", fmi=2, platforms=("linux64",))
    found = by_fmu(path, "CoSimulation", output_interval=1e-6)
    record = run.interfaces["opening"]
    before = run.time < record.time[np.flatnonzero(record.contact_force)[0]]

    assert record.contact_force.max() > 500.0  # the needle has hit its stop
    # a step of 20 ns that is not cut: 1.8e-4 was seen, of 5 ns 5e-7
    assert found["peak_contact_force_opening"].max() == pytest.approx(
        record.contact_force.max(), rel=4e-4 / share**2
    )
    velocity = run.channels["needle velocity"].values
    gap = run.channels["opening gap"].values
    # m/s, m; 1.7e-4 m/s and 8e-9 m were seen after the touch, of 1.3 m/s
    for here, speed, way in ((before, 1e-7, 1e-12), (~before, 4e-4, 2e-8)):
        pairs = (found["velocity"][here], velocity[here]), (found["gap_opening"][here], gap[here])
        for two, left in zip(pairs, (speed, way), strict=True):
            np.testing.assert_allclose(*two, rtol=0.0, atol=left)


@pytest.mark.parametrize("fmi", [2, 3])
def test_films_in_series_leave_co_simulation_alone(pair, tmp_path, fmi):
    path = build_fmu(pair, tmp_path / "v.fmu", fmi=fmi, platforms=("linux64",))
    description = fmpy.read_model_description(str(path))

    assert validation.validate_fmu(str(path)) == []
    assert description.modelExchange is None
    assert description.coSimulation is not None


def dry(contact):
    return replace(contact, film=None)


def wet(contact):
    return replace(contact, series_compliance=0.0)


def damped(contact):
    law = HuntCrossley(contact.law, dissipation=0.2)
    return replace(contact, series_compliance=0.0, film=None, law=law)


@pytest.mark.parametrize(
    ("change", "fmi", "force", "way"),
    [(dry, 2, 1e-5, 1e-6), (wet, 3, 1e-4, 3e-6), (damped, 3, 1e-4, 1e-6)],
)
def test_model_exchange_is_co_simulation(pair, tmp_path, change, fmi, force, way):
    changed = replace(pair, contacts=tuple(change(contact) for contact in pair.contacts))
    path = build_fmu(changed, tmp_path / "d.fmu", fmi=fmi, platforms=("linux64",))
    fine = by_fmu(
        path,
        "CoSimulation",
        output_interval=1e-6,
        start_values={"internal_step": 1.25e-9},
    )
    exchanged = by_fmu(
        path, "ModelExchange", solver="CVode", relative_tolerance=1e-8, output_interval=2e-8
    )

    assert validation.validate_fmu(str(path)) == []
    peak = fine["peak_contact_force_opening"].max()
    assert peak > 500.0
    # a film and a damped law begin with a step of order 1; the peak falls between two outputs
    assert exchanged["contact_force_opening"].max() == pytest.approx(peak, rel=force)
    lift = np.interp(fine["time"], exchanged["time"], exchanged["lift"])
    np.testing.assert_allclose(lift, fine["lift"], rtol=0.0, atol=way * 1e-4)
