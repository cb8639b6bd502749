"""Into other programs and back: meshes, matrices, reduced models, FMUs, results.

One small body goes through every file form, and the numbers that come back are compared with those
that left.  Programs and packages that are not installed are skipped.
"""

import shutil
from collections.abc import Iterator
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from klack import __version__
from klack.elasticity.body import ElasticBody, elastic_body
from klack.elasticity.eigen import eigenmodes
from klack.elasticity.given_matrices import body_of_matrices
from klack.exchange.modal_model import ModalModel, Provenance, body_model, pair_model
from klack.materials import Material
from klack.mesh.files.mesh_file import read_mesh_file
from klack.model_files.reduced_models import read_state_space
from klack.model_files.system import on_nodes, read_system
from klack.reduction.from_state_space import body_of_state_space
from klack.reduction.reduced_body import ReducedBody, StateSpace
from klack.simulation.bodies import rod_body
from klack.simulation.impact import simulate
from klack.simulation.system import ReducedSystem
from klack.unit_systems import unit_system
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.exchange_programs import calculix_frequencies, fmu_peak_and_lift
from klack.verification.lattice import lattice_mesh
from klack.verification.matrix_files import MATRIX_WRITERS, write_matrices
from klack.verification.mesh_files import MESH_WRITERS, write_mesh
from klack.verification.one_dimension import one_contact

__all__ = ["checks"]

GROUP = "exchange"
STEEL = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
UNITS = unit_system("mm t s")
MODES = 20
SAME, EXACT, ROUNDED, SINGLE = 5e-14, 2e-12, 2e-8, 2e-6
"""Every digit kept; rows in another order; ten digits; single precision."""
_MATRIX_TOLERANCES = {"DMIG": ROUNDED, "OUTPUT4, binary, single": SINGLE}
_MESH_TOLERANCES = {"ANSYS .cdb": EXACT, "Nastran .bdf": ROUNDED}
SPEED, DURATION = 0.4, 40e-6  # [m/s], [s]
FINE, USUAL = 1e-9, 20e-9  # [s]


def checks() -> list[Check]:
    """Frequencies through meshes and matrices, models and FMUs against native runs."""
    body = _block()
    frequencies = eigenmodes(body, count=MODES).frequency
    with TemporaryDirectory(prefix="klack-exchange-") as name:
        folder = Path(name)
        return [
            *_meshes(body, frequencies, folder),
            *_matrices(body, frequencies, folder),
            *_calculix(folder),
            *_models(folder),
            *_fmus(folder),
        ]


def _block() -> ElasticBody:
    """Steel block of about 2 x 2 x 3 mm in quadratic tetrahedra, no coordinate a short decimal."""
    line = np.linspace(-1e-3, 1e-3, 3) * np.pi / 3.0
    mesh = lattice_mesh("tet10", [line, 0.9 * line, np.linspace(0.0, 3e-3, 4) * np.pi / 3.0])
    return elastic_body("block", mesh, {"solid": STEEL})


def _largest(found: NDArray[np.float64], expected: NDArray[np.float64]) -> float:
    return float(np.max(np.abs(found / expected - 1.0)))


def _frequency_check(
    name: str, found: NDArray[np.float64], expected: NDArray[np.float64], tolerance: float
) -> Check:
    return compare(
        GROUP,
        f"{name}: first {MODES} frequencies, largest relative deviation",
        expected=0.0,
        computed=_largest(found, expected),
        tolerance=tolerance,
        source="the same body without the file",
    )


def _meshes(body: ElasticBody, frequencies: NDArray[np.float64], folder: Path) -> Iterator[Check]:
    for form in MESH_WRITERS:
        path = write_mesh(form, folder, body.mesh)
        model = read_mesh_file(path, None if form == "ANSYS .cdb" else 1e-3)
        materials = dict.fromkeys(model.mesh.solids, STEEL)
        found = eigenmodes(elastic_body("block", model.mesh, materials), count=MODES).frequency
        tolerance = _MESH_TOLERANCES.get(form, SAME)
        yield _frequency_check(f"mesh, {form}", found, frequencies, tolerance)


def _matrices(body: ElasticBody, frequencies: NDArray[np.float64], folder: Path) -> Iterator[Check]:
    numbers = 101 + 3 * np.arange(body.mesh.node_count)
    order = np.random.default_rng(3).permutation(body.dof_count)  # rows in no order
    K = (body.K / UNITS.stiffness).tocsr()[order][:, order]
    M = (body.M / UNITS.mass).tocsr()[order][:, order]
    for i, form in enumerate(MATRIX_WRITERS):
        if "7.3" in form and find_spec("h5py") is None:
            continue
        here = folder / f"matrices_{i}"
        here.mkdir()
        files = write_matrices(form, here, K, M, numbers[order // 3], order % 3 + 1)
        system = read_system(files.stiffness, files.mass, dofs=files.dofs)
        placed = on_nodes(system, numbers, 3)
        given = body_of_matrices(
            "block", body.mesh, placed.K * UNITS.stiffness, placed.M * UNITS.mass, fixed_nodes=()
        )
        found = eigenmodes(given, count=MODES).frequency
        tolerance = _MATRIX_TOLERANCES.get(form, EXACT)
        yield _frequency_check(f"matrices, {form}", found, frequencies, tolerance)


def _calculix(folder: Path) -> Iterator[Check]:
    """Hexahedra: the mass of quadratic tetrahedra has four points in CalculiX, fewer than here."""
    if shutil.which("ccx") is None:
        return
    line = np.linspace(-1e-3, 1e-3, 3)
    mesh = lattice_mesh("hex20", [line, 0.9 * line, np.linspace(0.0, 4e-3, 5)])
    expected = eigenmodes(elastic_body("block", mesh, {"solid": STEEL}), count=MODES).frequency
    found = calculix_frequencies(mesh, STEEL, MODES, folder / "calculix")
    yield compare(
        GROUP,
        f"CalculiX on the same mesh: its first {MODES} frequencies, largest relative deviation",
        expected=0.0,
        computed=_largest(found, expected),
        tolerance=2e-5,
        source="CalculiX, *FREQUENCY",
    )


def _provenance() -> Provenance:
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return Provenance(case="rods", title="Two rods", version=__version__, created=now)


def _rod(
    name: str,
    length: float,
    area: float,
    modes: int,
    support: Literal["free", "bottom"],
    damping: float = 0.0,
) -> ReducedBody:
    return rod_body(
        name,
        length=length,
        area=area,
        young=STEEL.young,
        density=STEEL.density,
        elastic_modes=modes,
        support=support,
        damping=damping,
    )


def _needle() -> ReducedBody:
    return _rod("needle", 0.03, 1.2e-5, 10, "free", damping=0.002)


def _models(folder: Path) -> Iterator[Check]:
    """A rod as state space in files and back: frequencies, and what the modes miss."""
    from klack.exchange.matlab_model import write_matlab
    from klack.exchange.text_model import write_text

    rod = _needle()
    model = body_model(rod, provenance=_provenance(), step=USUAL)
    write_matlab([model], folder)
    write_text([model], folder)
    for form, name in (("MATLAB .mat", "needle.mat"), ("CSV", "needle_state_space.csv")):
        back = _from_state_space(folder / name, rod)
        elastic = slice(rod.rigid_count, None)
        yield compare(
            GROUP,
            f"state space, {form}: frequencies, largest relative deviation",
            expected=0.0,
            computed=_largest(back.omega[elastic], rod.omega[elastic]),
            tolerance=SAME,
            source="the rod that left",
        )
        omega = 2.0 * np.pi * np.geomspace(1e3, 1e6, 400)
        left, came = _receptance(rod, omega[::8]), _receptance(back, omega[::8])
        curve = ComparedCurve(
            x_label="frequency [kHz]",
            y_label="receptance by modes [m/N]",
            expected=(omega / (2e3 * np.pi), np.abs(_receptance(rod, omega))),
            computed=(omega / (2e3 * np.pi), np.abs(_receptance(back, omega))),
            x_log=True,
            y_log=True,
        )
        yield compare(
            GROUP,
            f"state space, {form}: receptance from 1 kHz to 1 MHz, largest relative deviation",
            expected=0.0,
            computed=float(np.max(np.abs(came / left - 1))),
            tolerance=EXACT,
            source="the rod that left",
            curve=curve,
        )


def _from_state_space(path: Path, rod: ReducedBody) -> ReducedBody:
    held = read_state_space(path)
    ports = len(rod.port_names)
    plain = StateSpace(
        A=held.A,
        B=held.B,
        C=held.C[:ports],  # displacements come first, velocities after them
        feedthrough=held.D[:ports],
        input_names=rod.port_names,
        output_names=rod.port_names,
    )
    return body_of_state_space("needle", plain, where=str(path))


def _receptance(body: ReducedBody, omega: NDArray[np.float64]) -> NDArray[np.complex128]:
    """At the first port by its modes [m/N]."""
    w, zeta = body.omega[:, None], body.damping[:, None]
    share = body.port_shapes[:, 0, None] ** 2
    return np.sum(share / (w**2 - omega**2 + 2j * zeta * w * omega), axis=0)


def _rods() -> ReducedSystem:
    from klack.contact.laws import TableLaw

    seat = _rod("seat", 0.05, 6e-5, 20, "bottom")
    law = TableLaw(np.array([0.2, 0.5, 1.0, 2.0]) * 1e-6, [20.0, 70.0, 190.0, 520.0])
    return one_contact(_needle(), seat, law, gap=2e-6)


def _pair(step: float) -> ModalModel:
    return pair_model(
        "rods",
        _rods(),
        moving="needle",
        contact_names=["seat"],
        speed=-SPEED,
        step=step,
        duration=DURATION,
        provenance=_provenance(),
    )


def _native(step: float) -> tuple[float, float]:
    """Peak force [N] and lift at the end [m]."""
    system = _rods()
    run = simulate(system, velocities={"needle": -SPEED}, step=step, duration=DURATION)
    v = run.velocity[:, 0]
    lift = system.contacts[0].gap + float(np.sum(0.5 * (v[1:] + v[:-1])) * step)
    return float(run.peak_force.max()), lift


def _fmus(folder: Path) -> Iterator[Check]:
    from klack.errors import KlackError
    from klack.exchange.fmu.compiler import require_compilers

    if find_spec("fmpy") is None:
        return
    try:
        require_compilers(None)
    except KlackError:
        return
    runs = (
        (
            "co-simulation, steps of 20 ns, against the native run",
            USUAL,
            "CoSimulation",
            (5e-13, 5e-13),
        ),
        (
            "model exchange with CVODE, against the native run in 1 ns",
            FINE,
            "ModelExchange",
            (5e-8, 2e-7),
        ),
    )
    for fmi in (2, 3):
        for words, step, kind, (of_force, of_lift) in runs:
            if fmi == 3 and kind == "ModelExchange":
                continue  # the same core; one run through a second wrapper is enough here
            peak, lift = _native(step)
            found, height = fmu_peak_and_lift(_pair(step), folder, fmi=fmi, kind=kind, step=step)
            where = f"FMI {fmi}.0 {words}"
            yield compare(
                GROUP,
                f"{where}: peak force [N]",
                expected=peak,
                computed=found,
                tolerance=of_force,
                source="klack.simulation, the same rods",
                reason="another compiler may fuse products and sums",
            )
            yield compare(
                GROUP,
                f"{where}: lift at the end [m]",
                expected=lift,
                computed=height,
                tolerance=of_lift,
                source="klack.simulation, the same rods",
            )
