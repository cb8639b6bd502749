"""Truth: the energy balance of a whole run, and the same film stepped alone."""

import numpy as np
import pytest

from klack.hydraulics.fluid_library import library_fluid
from klack.mechanics.end_stop import EndStop
from klack.mechanics.rigid_mass import RigidMass
from klack.network.network import Network
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.network_run import simulate_network
from klack.verification.interface_motion import interface_motion

RING = {"shape": "ring", "inner_radius": 0.6e-3, "outer_radius": 0.9e-3}


def landing(coarse):
    seat = EndStop(
        gap=10e-6, law={"kind": "linear", "stiffness": 1e10}, series_compliance=1e-9, film=RING
    )
    network = Network(
        {"needle": RigidMass(mass=3e-3, speed=-0.4), "seat": seat},
        [["needle.body", "seat.upper"], ["seat.lower", "ground"]],
        fluid=library_fluid("n-heptane").at(293.15),
    )
    rows = network.rows()
    result = simulate_network(
        rows, duration=60e-6, step=20e-9, coarse=coarse, record=1e-6, start="free"
    )
    return rows.interfaces[0], result


def test_landing_in_a_network_is_the_landing_alone():
    row, result = landing(coarse=1)
    film = result.channels["seat film force"].values[1:]
    contact = result.channels["seat contact force"].values[1:]

    def alone(parts):
        """Film and contact force in steps of 20 ns over ``parts``, means over 1 us as recorded."""
        motion = interface_motion(
            rigid_mass_body("needle", 3e-3, port="bottom"),
            fixed_body("wall", port="top"),
            row.law,
            film=row.film,
            series=row.series_compliance,
            gap=row.gap,
            speed=0.4,
            step=20e-9 / parts,
            steps=3000 * parts,
        )
        return motion.film_force.reshape(60, -1).mean(1), motion.contact_force.reshape(60, -1).mean(
            1
        )

    alone_film, alone_contact = alone(1)
    assert np.max(contact) > 10.0
    assert np.min(film) < -0.1
    # the network cuts the step in which the contact opens, after which the film pulls
    release = int(np.flatnonzero(contact)[-1])
    other = np.arange(len(film)) != release
    np.testing.assert_allclose(film[other], alone_film[other], atol=1e-5)
    np.testing.assert_allclose(contact[other], alone_contact[other], atol=1e-6)
    # uncut steps of 20 ns miss 1.2e-4 of both there, those of 10 ns 1.6e-3, of 0.6 ns 1e-5
    finer_film, finer_contact = alone(32)
    both = (film + contact)[release]
    assert both == pytest.approx((finer_film + finer_contact)[release], rel=5e-5)


@pytest.mark.parametrize("coarse", [1, 16])
def test_books_close(coarse):
    _, result = landing(coarse)

    assert result.books.relative_residual < 1e-10
