"""Bodies that yield under the contact forces that klack finds, in CalculiX.

Truth: CalculiX (ccx), an independent program, whose own contact does not converge with plasticity;
so it gets the forces, on the same mesh with reduced integration, and returns the displacements.
"""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array

from klack.assembling.problem import build_problem
from klack.case import load_case
from klack.contact.plasticity.ladder import YieldingContact
from klack.contact.plasticity.yielding_body import YieldingBody
from klack.exchange.calculix_run import find_calculix

SPHERES = Path(__file__).parents[1] / "data" / "case" / "yielding_spheres.yaml"

pytestmark = pytest.mark.skipif(
    find_calculix() is None, reason="CalculiX is not installed (apt-get install calculix-ccx)"
)


def _deck(body, material, loads):
    """Static steps of a body of revolution under nodal forces; prints all displacements."""
    mesh = body.mesh
    lines = ["*NODE"]
    lines += [f"{i + 1}, {r:.12e}, {z:.12e}, 0." for i, (r, z) in enumerate(mesh.points)]
    count = 0
    for block in mesh.blocks:
        kind = {"quad8": "CAX8R", "tri6": "CAX6"}[block.family]
        lines.append(f"*ELEMENT, TYPE={kind}, ELSET=BODY")
        for nodes in block.connectivity + 1:
            count += 1
            lines.append(f"{count}, " + ", ".join(map(str, nodes)))
    Y, H = material.hardening.yield_stress, material.hardening.isotropic
    lines += ["*NSET, NSET=ALL, GENERATE", f"1, {len(mesh.points)}"]
    lines += ["*MATERIAL, NAME=SOFT", "*ELASTIC", f"{material.young:.6e}, {material.poisson}"]
    lines += ["*PLASTIC", f"{Y:.6e}, 0.", f"{Y + H:.6e}, 1."]
    lines += ["*SOLID SECTION, ELSET=BODY, MATERIAL=SOFT", "*BOUNDARY"]
    lines += [f"{dof // 2 + 1}, {dof % 2 + 1}, {dof % 2 + 1}" for dof in body.fixed]
    for load in loads:
        lines += ["*STEP, INC=1000", "*STATIC", "0.5, 1., 1e-6, 0.5", "*CLOAD, OP=NEW"]
        force = load.reshape(-1, 2)
        where = np.argwhere(force != 0.0)
        lines += [f"{i + 1}, {k + 1}, {force[i, k]:.12e}" for i, k in where]
        lines += ["*NODE PRINT, NSET=ALL, FREQUENCY=1000", "U", "*END STEP"]
    return "\n".join(lines) + "\n"


def _displacements(path, nodes):
    """Of the end of every step, shape (steps, nodes, 2) [m]."""
    fields = []
    for line in path.read_text().splitlines():
        words = line.split()
        if "displacements" in line:
            fields.append(np.zeros((nodes, 2)))
        elif len(words) == 4:
            fields[-1][int(words[0]) - 1] = float(words[1]), float(words[2])
    return np.array(fields)


@pytest.mark.slow
def test_displacements_are_those_of_calculix(tmp_path):
    """Reference: displacement of the loads (their work over the force), pressed and let go; 0.2 %.

    To 25 times first yield; ccx has the same elements with reduced integration.
    """
    problem = build_problem(load_case(SPHERES), lambda *_: None)
    space, one = problem.space, problem.loaded[1]
    rows = csr_array(space.G_a), csr_array(space.G_b)
    bodies = [
        YieldingBody(body, G, np.zeros(2), 5.0 * float(problem.static.half_width[-1]))
        for body, G in zip(problem.loaded, rows, strict=True)
    ]
    contact = YieldingContact(space, problem.static.compliance, bodies)
    loads, fields, forces = [], [], []
    for share in (*np.linspace(0.05, 0.6, 12), 0.5, 0.4, 0.3):
        state = contact.load(share * float(problem.static.approach[-1]))
        load = np.asarray(rows[1].T @ state.pressures)
        plastic = np.zeros_like(load)
        plastic[bodies[1].zone.dofs] = bodies[1].plastic_forces()
        loads.append(load)
        fields.append(one.flexibility.solve(load + plastic).reshape(-1, 2))
        forces.append(state.force)
    (tmp_path / "ball.inp").write_text(_deck(one.body, one.materials["lower"], loads))
    done = subprocess.run(
        [find_calculix(), "ball"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:]

    others = _displacements(tmp_path / "ball.dat", len(fields[0]))
    ratios = [
        float(np.sum(load.reshape(-1, 2) * mine) / np.sum(load.reshape(-1, 2) * other))
        for load, mine, other in zip(loads, fields, others, strict=True)
    ]
    assert forces[11] > 20.0 * 0.014  # of first yield
    assert np.all(np.diff(forces[11:]) < 0.0)
    assert ratios[:12] == pytest.approx([1.0] * 12, abs=0.01)  # one element across at the start
    assert ratios[6:13] == pytest.approx([1.0] * 7, abs=0.002)
    assert ratios[13:] == pytest.approx([1.0] * 2, abs=0.02)  # on the way back, mostly set
    lifted = [float(fields[k][:, 1].min() / others[k][:, 1].min()) for k in (11, 14)]
    assert lifted == pytest.approx([1.0, 1.0], abs=0.03)  # deepest node
