"""End stops: their rows, their variants without fluid or modes, and what they refuse."""

from math import pi, sqrt

import numpy as np
import pytest

from klack.contact.laws import HertzLaw, HuntCrossley, LinearLaw, TableLaw, gonthier_coefficient
from klack.errors import InputError
from klack.hydraulics.film import RingFilm
from klack.hydraulics.fluid_library import library_fluid
from klack.mechanics.end_stop import EndStop
from klack.network.rows import Ambient, Rows

LINEAR = {"kind": "linear", "stiffness": 1e9}
RING = {"shape": "ring", "inner_radius": 1e-3, "outer_radius": 1.2e-3}


def rows(fluid=True):
    heptane = library_fluid("n-heptane").at(293.15) if fluid else None
    return Rows(
        ambient=Ambient(), fluid=heptane, component="seat", handles={"upper": 3, "lower": -1}
    )


def test_adds_one_interface():
    built = rows()
    EndStop(gap=80e-6, law=LINEAR, series_compliance=2e-10, film=RING).add_rows(built)

    (row,) = built.interfaces
    mu = float(built.fluid.viscosity(101_325.0))
    tension = 101_325.0 - built.fluid.vapour_pressure
    assert (row.component, row.upper, row.lower, row.gap) == ("seat", 3, -1, 80e-6)
    assert row.law == LinearLaw(1e9)
    assert row.series_compliance == 2e-10
    assert row.film.cubic == pytest.approx(mu * RingFilm(**RING).coefficients()[0])
    assert row.film.suction == pytest.approx(tension * pi * (1.2e-3**2 - 1e-3**2))


def test_film_knows_the_pressure_around_it():
    built = rows()
    EndStop(gap=0.0, film={**RING, "pressure": 6e5, "cavitation_pressure": -4e5}).add_rows(built)

    assert built.interfaces[0].law is None
    assert built.interfaces[0].film.suction == pytest.approx(1e6 * RingFilm(**RING).area)


@pytest.mark.parametrize(
    ("given", "law"),
    [
        (LINEAR, LinearLaw(1e9)),
        (
            {"kind": "hertz", "radius": 2e-3, "modulus": 115.4e9},
            HertzLaw(4.0 / 3.0 * 115.4e9 * sqrt(2e-3)),
        ),
    ],
)
def test_laws_with_closed_forms(given, law):
    assert EndStop(gap=0.0, law=given).contact_law() == law


def test_asperity_law_is_the_exponential():
    law = EndStop(gap=0.0, law={"kind": "asperity", "force": 2.0, "height": 0.2e-6}).contact_law()
    d = np.linspace(0.01e-6, 2e-6, 3001)

    # cubic pieces of 1/40 of the height
    np.testing.assert_allclose(law.force(d), 2.0 * np.expm1(d / 0.2e-6), rtol=5e-6)


def test_table_law_passes_its_points():
    law = EndStop(
        gap=0.0, law={"kind": "table", "indentation": [1e-6, 2e-6], "force": [100.0, 250.0]}
    ).contact_law()

    assert isinstance(law, TableLaw)
    np.testing.assert_allclose(law.force([1e-6, 2e-6]), [100.0, 250.0])


def test_restitution_becomes_the_dashpot_of_gonthier():
    law = EndStop(gap=0.0, law=LINEAR, restitution=0.6).contact_law()

    assert law == HuntCrossley(LinearLaw(1e9), gonthier_coefficient(0.6))


def test_consistent_law_is_filled_in_and_kept_by_variants():
    stop = EndStop(gap=0.0, law={"kind": "consistent"}, film=RING)
    law = TableLaw([1e-6, 2e-6], [100.0, 250.0])

    with pytest.raises(InputError, match="has not been computed"):
        stop.contact_law()
    filled = stop.with_law(law, series_compliance=1e-10)

    assert filled.contact_law() is law
    assert filled.series_compliance == 1e-10
    assert filled.dry().contact_law() is law
    assert filled.dry().film is None
    with pytest.raises(InputError, match="has not been computed"):
        stop.contact_law()


def test_lumped_stop_is_one_spring_and_one_dashpot():
    stop = EndStop(gap=5e-6, law={"kind": "consistent"}, film=RING).with_law(
        TableLaw([1e-6], [100.0]), series_compliance=1e-10
    )

    lumped = stop.lumped(2e8, 0.5)

    assert lumped.contact_law() == HuntCrossley(LinearLaw(2e8), gonthier_coefficient(0.5))
    assert stop.lumped(2e8, None).contact_law() == LinearLaw(2e8)
    assert lumped.series_compliance == 0.0
    assert (lumped.gap, lumped.film) == (5e-6, stop.film)


def test_film_alone_is_nothing_without_fluid():
    assert EndStop(gap=0.0, film=RING).dry() is None


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({}, "neither law nor film"),
        ({"film": RING, "restitution": 0.5}, "restitution without a law"),
        ({"law": {"kind": "linear", "stiffness": 0.0}}, "stiffness"),
        ({"film": {**RING, "outer_radius": 0.9e-3}}, "more than the inner radius, 1 mm"),
        ({"film": {**RING, "roughness": 1e-6, "cut_off": 0.1e-6}}, "half the roughness"),
        (
            {"film": {"shape": "cone", "mean_radius": 1e-4, "width": 1e-3, "half_angle": 1.0}},
            "the land must not reach the axis",
        ),
        ({"law": LINEAR, "gap": -1e-6}, "gap"),
    ],
)
def test_refused(given, text):
    with pytest.raises(InputError, match=text):
        EndStop(**{"gap": 0.0, **given})


def test_film_needs_a_fluid():
    with pytest.raises(InputError, match="no fluid in the network"):
        EndStop(gap=0.0, law=LINEAR, film=RING).add_rows(rows(fluid=False))


def test_cavitation_pressure_is_absolute():
    film = {**RING, "cavitation_pressure": 2e5}
    with pytest.raises(InputError, match=r"seat.film.cavitation_pressure: got 2 bar absolute"):
        EndStop(gap=0.0, law=LINEAR, film=film).add_rows(rows())
