"""Other programs that run what klack writes: CalculiX, and FMPy with CVODE."""

import subprocess
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import ConvergenceError
from klack.exchange.modal_model import ModalModel
from klack.materials import Material
from klack.mesh.mesh import Mesh

__all__ = ["calculix_frequencies", "fmu_peak_and_lift"]

_SECONDS = 60
_TYPES = {"tet10": "C3D10", "hex20": "C3D20"}


def calculix_frequencies(
    mesh: Mesh, material: Material, count: int, folder: Path
) -> NDArray[np.float64]:
    """Elastic frequencies [Hz] of a free body, computed by CalculiX.

    Parameters
    ----------
    mesh : Mesh
        Of ``tet10`` or ``hex20``.
    material : Material
    count : int
    folder : Path
        Made for its files.
    """
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
        # the shift of the solver does not like the six rigid modes at zero: it counts them too
        f"*STEP\n*FREQUENCY\n{count + 6}\n*END STEP\n",
    ]
    (folder / "body.inp").write_text("\n".join(lines))
    subprocess.run(
        ["ccx", "-i", "body"], cwd=folder, check=False, capture_output=True, timeout=_SECONDS
    )
    found = _of_dat(folder / "body.dat")
    if len(found) < count:
        raise ConvergenceError(f"CalculiX gave {len(found)} frequencies instead of {count}")
    return found[:count]


def _of_dat(path: Path) -> NDArray[np.float64]:
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
    model : ModalModel
        A pair with one contact.
    folder : Path
    fmi : 2 or 3
    kind : "CoSimulation" or "ModelExchange"
    step : float [s]
        Communication and output step of co-simulation.
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
