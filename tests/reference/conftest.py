"""Two elastic rods that meet, as klack gives them to other programs, and their native run."""

import shutil
import subprocess
from dataclasses import dataclass

import numpy as np
import pytest

from klack.contact.laws import TableLaw
from klack.exchange.modal_model import Provenance, pair_model
from klack.network.rows import FilmRow
from klack.simulation.bodies import rod_body
from klack.simulation.impact import simulate
from klack.simulation.interface_step import solve_interface
from klack.simulation.propagator import modal_propagator
from klack.simulation.system import AxialForce, ContactPair, ReducedSystem

STEEL = {"young": 2.1e11, "density": 7850.0}
LAW = TableLaw(np.array([0.2, 0.5, 1.0, 2.0]) * 1e-6, np.array([60.0, 200.0, 500.0, 1400.0]))
FILM = FilmRow(cubic=4e-17, linear=2e-7, cut_off=5e-7, suction=1.0)
SPEED = 0.5


@dataclass
class RodImpact:
    """System, its exported pair, and what klack computes for it."""

    system: ReducedSystem
    pair: object

    def dry(self, step, duration):
        """Record of klack's own integration of the pair without a film."""
        return simulate(self.system, velocities={"needle": -SPEED}, step=step, duration=duration)


def stepped(pair, step, duration):
    """Peak contact force, peak film force, lift and velocity at the end of a pair.

    klack's interface step and propagator in the plainest loop.
    """
    (contact,) = pair.contacts
    P = modal_propagator(pair.omega, pair.damping, step)
    row, law, film = contact.shape, contact.law.flat(), contact.film
    squeeze = (
        (film.cubic, film.linear, film.cut_off, film.suction) if film else (0.0, 0.0, 1.0, 0.0)
    )
    G, q, v = float(row**2 @ P.B1), pair.start.copy(), pair.start_velocity.copy()
    g, e, force, hint, left = contact.gap + row @ q, 0.0, 0.0, 0, 0.0
    fixed = (law.kind, law.parameters, 0, 0.0, *squeeze, step, G, contact.series_compliance)
    peaks = np.zeros(2)
    for _ in range(round(duration / step)):
        q, v = (
            P.A11 * q + P.A12 * v + P.B1 * pair.constant,
            P.A21 * q + P.A22 * v + P.B2 * pair.constant,
        )
        free = contact.gap + row @ q
        pressed, squeezed, g1, e1, hint, _, _ = solve_interface(
            *fixed, g, free, e, force, hint, left
        )
        force = pressed + squeezed
        left = squeezed if g + e > 0.0 and pressed > 0.0 else 0.0
        g, e = g1, e1
        q, v = q + P.B1 * row * force, v + P.B2 * row * force
        peaks = np.maximum(peaks, [pressed, squeezed])
    lift, velocity = pair.outputs
    return *peaks, lift.offset + lift.shape @ q, velocity.shape @ v


@pytest.fixture(scope="session", name="stepped")
def _stepped():
    return stepped


@pytest.fixture(scope="session")
def rod_impact():
    """Return a function that builds the impact for a law, a series compliance and a film."""

    def build(law=LAW, series=0.0, film=None):
        needle = rod_body(
            "needle", length=0.02, area=1.2e-5, elastic_modes=6, damping=1e-3, **STEEL
        )
        seat = rod_body(
            "seat", length=0.05, area=6e-5, elastic_modes=9, damping=2e-3, support="bottom", **STEEL
        )
        system = ReducedSystem(
            bodies=(needle, seat),
            contacts=(
                ContactPair(
                    body_a="needle",
                    port_a="bottom",
                    body_b="seat",
                    port_b="top",
                    law=law,
                    gap=1e-6,
                    series_compliance=series,
                ),
            ),
            forces=(AxialForce(body="needle", force=-12.0),),
        )
        pair = pair_model(
            "rods",
            system,
            moving="needle",
            contact_names=("tip",),
            films=(film,) if film else (),
            speed=-SPEED,
            step=2e-8,
            duration=40e-6,
            provenance=Provenance(
                case="rods", title='Stäbe, "5 µm" \\ <a & b>', version="0", created="today"
            ),
        )
        return RodImpact(system, pair)

    return build


@pytest.fixture
def octave(tmp_path):
    """Return a function that runs a script in Octave and gives the numbers it prints."""
    program = shutil.which("octave")
    if program is None:
        pytest.skip("Octave is not installed")

    def run(script, folder=tmp_path):
        (folder / "run_it.m").write_text(script)
        done = subprocess.run(
            [program, "--no-gui", "--quiet", "--norc", "run_it.m"],
            cwd=folder,
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run
