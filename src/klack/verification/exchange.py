"""Into other programs and back: meshes, matrices, reduced models, FMUs, results.

One small body goes through every file form and back. Programs and packages that are not installed
are skipped.
"""

import shutil
import subprocess
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np

from klack import __version__
from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.given_matrices import checked_body
from klack.bodies.model_files.reduced_models import read_state_space
from klack.bodies.model_files.system import on_nodes, read_system
from klack.bodies.reduction.from_state_space import body_of_state_space
from klack.bodies.reduction.reduced_body import ReducedBody, StateSpace
from klack.errors import ConvergenceError
from klack.exchange.modal_model import ModalModel, Provenance, body_model, pair_model
from klack.input.unit_systems import unit_system
from klack.materials.material import Material
from klack.mesh.files.mesh_file import read_mesh_file
from klack.mesh.mesh import Mesh
from klack.simulation.bodies import rod_body
from klack.simulation.impact import simulate
from klack.simulation.system import ReducedSystem
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.exchange_files import (
    MATRIX_WRITERS,
    MESH_WRITERS,
    write_matrices,
    write_mesh,
)
from klack.verification.lattice import STEEL, lattice_mesh
from klack.verification.one_dimension import one_contact

__all__ = ["checks"]


UNITS = unit_system("mm t s")
MODES = 20
SAME, EXACT, ROUNDED, SINGLE = 5e-14, 2e-12, 2e-8, 2e-6
"""Every digit kept; rows in another order; ten digits; single precision."""
_MATRIX_TOLERANCES = {"DMIG": ROUNDED, "OUTPUT4, binary, single": SINGLE}
_MESH_TOLERANCES = {"ANSYS .cdb": EXACT, "Nastran .bdf": ROUNDED}
SPEED, DURATION = 0.4, 40e-6  # [m/s], [s]
FINE, USUAL = 1e-9, 20e-9  # [s]


def checks() -> list[Check]:
    """Return the checks."""
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


def _largest(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.max(np.abs(found / expected - 1.0)))


def _frequency_check(name: str, found: np.ndarray, expected: np.ndarray, tolerance: float) -> Check:
    return check(
        f"{name}: first {MODES} frequencies, largest relative deviation",
        expected=0.0,
        computed=_largest(found, expected),
        tolerance=tolerance,
        source="the same body without the file",
    )


def _meshes(body: ElasticBody, frequencies: np.ndarray, folder: Path) -> Iterator[Check]:
    for form in MESH_WRITERS:
        model = read_mesh_file(
            write_mesh(form, folder, body.mesh), None if form == "ANSYS .cdb" else 1e-3
        )
        found = eigenmodes(
            elastic_body("block", model.mesh, dict.fromkeys(model.mesh.solids, STEEL)), count=MODES
        ).frequency
        yield _frequency_check(
            f"mesh, {form}", found, frequencies, _MESH_TOLERANCES.get(form, SAME)
        )


def _matrices(body: ElasticBody, frequencies: np.ndarray, folder: Path) -> Iterator[Check]:
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
        placed = on_nodes(read_system(files.stiffness, files.mass, dofs=files.dofs), numbers, 3)
        given, _ = checked_body(
            "block", body.mesh, placed.K * UNITS.stiffness, placed.M * UNITS.mass
        )
        yield _frequency_check(
            f"matrices, {form}",
            eigenmodes(given, count=MODES).frequency,
            frequencies,
            _MATRIX_TOLERANCES.get(form, EXACT),
        )


def _calculix(folder: Path) -> Iterator[Check]:
    """Hexahedra: CalculiX integrates the mass of quadratic tetrahedra with four points."""
    if shutil.which("ccx") is None:
        return
    line = np.linspace(-1e-3, 1e-3, 3)
    mesh = lattice_mesh("hex20", [line, 0.9 * line, np.linspace(0.0, 4e-3, 5)])
    expected = eigenmodes(elastic_body("block", mesh, {"solid": STEEL}), count=MODES).frequency
    yield check(
        f"CalculiX on the same mesh: its first {MODES} frequencies, largest relative deviation",
        expected=0.0,
        computed=_largest(calculix_frequencies(mesh, STEEL, MODES, folder / "calculix"), expected),
        tolerance=2e-5,
        source="CalculiX, *FREQUENCY",
    )


def _provenance() -> Provenance:
    return Provenance(
        case="rods",
        title="Two rods",
        version=__version__,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
    )


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
    """A rod as state space in files and back."""
    from klack.exchange.matlab_model import write_matlab
    from klack.exchange.text_model import write_text

    rod = _needle()
    model = body_model(rod, provenance=_provenance(), step=USUAL)
    write_matlab([model], folder)
    write_text([model], folder)
    for form, name in (("MATLAB .mat", "needle.mat"), ("CSV", "needle_state_space.csv")):
        back = _from_state_space(folder / name, rod)
        elastic = slice(rod.rigid_count, None)
        yield check(
            f"state space, {form}: frequencies, largest relative deviation",
            expected=0.0,
            computed=_largest(back.omega[elastic], rod.omega[elastic]),
            tolerance=SAME,
            source="the rod that left",
        )
        omega = 2.0 * np.pi * np.geomspace(1e3, 1e6, 400)
        left, came = _receptance(rod, omega[::8]), _receptance(back, omega[::8])
        yield check(
            f"state space, {form}: receptance from 1 kHz to 1 MHz, largest relative deviation",
            expected=0.0,
            computed=float(np.max(np.abs(came / left - 1))),
            tolerance=EXACT,
            source="the rod that left",
            curve=ComparedCurve(
                x_label="frequency [kHz]",
                y_label="receptance by modes [m/N]",
                expected=(omega / (2e3 * np.pi), np.abs(_receptance(rod, omega))),
                computed=(omega / (2e3 * np.pi), np.abs(_receptance(back, omega))),
                x_log=True,
                y_log=True,
            ),
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


def _receptance(body: ReducedBody, omega: np.ndarray) -> np.ndarray:
    """At the first port by its modes [m/N]."""
    w, zeta = body.omega[:, None], body.damping[:, None]
    share = body.port_shapes[:, 0, None] ** 2
    return np.sum(share / (w**2 - omega**2 + 2j * zeta * w * omega), axis=0)


def _rods() -> ReducedSystem:
    from klack.contact.laws import TableLaw

    law = TableLaw(np.array([0.2, 0.5, 1.0, 2.0]) * 1e-6, [20.0, 70.0, 190.0, 520.0])
    return one_contact(_needle(), _rod("seat", 0.05, 6e-5, 20, "bottom"), law, gap=2e-6)


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
    return float(run.peak_force.max()), system.contacts[0].gap + float(
        np.sum(0.5 * (v[1:] + v[:-1])) * step
    )


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
            yield check(
                f"{where}: peak force [N]",
                expected=peak,
                computed=found,
                tolerance=of_force,
                source="klack.simulation, the same rods",
                reason="another compiler may fuse products and sums",
            )
            yield check(
                f"{where}: lift at the end [m]",
                expected=lift,
                computed=height,
                tolerance=of_lift,
                source="klack.simulation, the same rods",
            )


_TYPES = {"tet10": "C3D10", "hex20": "C3D20"}


def calculix_frequencies(
    mesh: Mesh,
    material: Material,
    count: int,
    folder: Path,
    *,
    held: Iterable[int] = (),
    seconds: float = 60.0,
) -> np.ndarray:
    """Elastic frequencies [Hz] of a body of ``tet10`` or ``hex20``, computed by CalculiX."""
    folder.mkdir()
    lines = ["*NODE"]  # fields have 20 columns at most
    lines += [f"{i},{x:.12e},{y:.12e},{z:.12e}" for i, (x, y, z) in enumerate(mesh.points * 1e3, 1)]
    number = 0
    for block in mesh.blocks:
        lines.append(f"*ELEMENT,TYPE={_TYPES[block.family]},ELSET=all")
        for nodes in block.connectivity + 1:
            number += 1
            words = [str(n) for n in (number, *nodes)]
            lines.append(
                ",\n".join(",".join(words[at : at + 12]) for at in range(0, len(words), 12))
            )
    lines += [
        "*MATERIAL,NAME=m",
        f"*ELASTIC\n{material.young * 1e-6:.12e},{material.poisson:.12e}",
        f"*DENSITY\n{material.density * 1e-12:.12e}",
        "*SOLID SECTION,ELSET=all,MATERIAL=m",
        *("*BOUNDARY\n" + f"{node + 1},1,3" for node in held),
        # the shift of the solver does not like the six rigid modes at zero: it counts them too
        f"*STEP\n*FREQUENCY\n{count + 6}\n*END STEP\n",
    ]
    (folder / "body.inp").write_text("\n".join(lines))
    subprocess.run(
        ["ccx", "-i", "body"], cwd=folder, check=False, capture_output=True, timeout=seconds
    )
    found = _of_dat(folder / "body.dat")
    if len(found) < count:
        raise ConvergenceError(f"CalculiX gave {len(found)} frequencies instead of {count}")
    return found[:count]


def _of_dat(path: Path) -> np.ndarray:
    """Frequencies above 1 Hz from the table ``E I G E N V A L U E   O U T P U T``."""
    found, inside = [], False
    for line in path.read_text().splitlines() if path.is_file() else ():
        words = line.split()
        if "E I G E N V A L U E" in line:
            inside = True
        elif inside and "P A R T I C I P A T I O N" in line:
            break
        elif inside and len(words) == 5 and words[0].isdigit():
            found.append(float(words[3]))
    return np.array([f for f in found if f > 1.0])


def fmu_peak_and_lift(
    model: ModalModel, folder: Path, *, fmi: int, kind: str, step: float
) -> tuple[float, float]:
    """Peak contact force [N] and lift at the end [m] of a pair that FMPy runs as an FMU.

    Parameters
    ----------
    model
        With one contact.
    kind
        ``"CoSimulation"`` or ``"ModelExchange"``.
    step [s]
        Of communication and output.
    """
    import fmpy

    from klack.exchange.fmu.build import build_fmu

    path = folder / f"{model.name}_{fmi}_{kind}_{step * 1e9:g}.fmu"
    build_fmu(model, path, fmi=3 if fmi == 3 else 2)
    exchange = kind == "ModelExchange"
    force = "contact_force" if exchange else "peak_contact_force"
    found = fmpy.simulate_fmu(
        str(path),
        fmi_type=kind,
        stop_time=model.duration,
        output_interval=2e-9 if exchange else step,
        output=["lift", force],
        record_events=False,
        **({"solver": "CVode", "relative_tolerance": 1e-10} if exchange else {}),
    )
    return float(np.max(found[force])), float(found["lift"][-1])
