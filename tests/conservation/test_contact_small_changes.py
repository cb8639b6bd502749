"""Truth: 40-digit integrals of the force, and the work that every contact step has to account for.

Small changes of the indentation are where nearly all steps of an impact lie, and where a short
series stands for a difference that would lose its digits.
"""

from decimal import Decimal, localcontext

import numpy as np
import pytest
from draws import each

from klack.contact.laws import HertzLaw, LinearLaw, TableLaw
from klack.simulation.contact_step import law_potential, mean_force, solve_step
from klack.simulation.interface_step import film_force, interface_store, solve_interface

DEPTH = np.array([2e-7, 5e-7, 1e-6, 1.8e-6, 3e-6, 4e-6])  # [m]
LAWS = {
    "linear": LinearLaw(1e9),
    "hertz": HertzLaw(7.5e9),
    "power": HertzLaw(3e8, exponent=1.2),
    "table": TableLaw(DEPTH, 7.5e9 * DEPTH**1.5),
}
RATIOS = [9e-1, 2e-1, 2.1e-2, 1.9e-2, 1.2e-2, 9.9e-3, 5e-3, 1e-3, 1e-5, 1e-8]


@each("sign", [1, -1])
@each("change", RATIOS)
@each("exponent", ["1", "1.1", "1.5", "2.5", "3"])
def test_mean_of_a_power_law_keeps_its_digits(exponent, change, sign):
    """``[V(d1) - V(d0)]/(d1 - d0)``, on both sides of 1 % between the ends and their mean."""
    law = HertzLaw(7.5e9, exponent=float(exponent)).flat()
    d0 = 2e-6
    d1 = d0 * (1.0 + sign * change)

    mean, _, _ = mean_force(law.kind, law.parameters, 0, d0, d1, 0)

    with localcontext() as exact:
        exact.prec = 40
        a, b, n = Decimal(d0), Decimal(d1), Decimal(exponent) + 1
        expected = Decimal("7.5e9") / n * (b**n - a**n) / (b - a)
    # just above 1 % the difference of the potentials has lost two digits; exponents are doubles
    assert mean == pytest.approx(float(expected), rel=2e-13, abs=0.0)


@pytest.mark.parametrize("share", np.array([-0.96, -0.5, -0.1, 0.1, 0.5, 0.96, 1.04]) * 0.05)
def test_mean_shear_of_a_film_keeps_its_digits(share):
    """``ln(x0/x1)`` by its series, up to the largest change that it stands for, and beyond."""
    x0, h = 2e-6, 20e-9
    x1 = x0 * (1.0 - share) / (1.0 + share)

    force = film_force(0.0, 4e-12, 1e-7, h, x0 - 1e-7, x1 - 1e-7)

    # six terms leave 2/13 of the sixth power of 0.05^2 over 2: 2e-17; the gaps have lost a digit
    assert force == pytest.approx(
        4e-12 * np.log1p(2.0 * share / (1.0 - share)) / h, rel=4e-14, abs=0.0
    )


@each("G", [1e-12, 1e-10, 1e-8])  # [m/N]
@each("chi_over_h", [1e5, 3e6, 1e8])  # [1/m]
@each("name", list(LAWS))
def test_a_damped_step_books_what_the_store_does_not_get(name, chi_over_h, G):
    """``F (d1 - d0) = V(d1) - V(d0) + loss``, clipped or not, and no loss is negative.

    Between the ends, the force is that of the law where it pushes, and zero where it would pull.
    """
    law = LAWS[name].flat()
    clipped = 0
    for d0 in (-1e-7, 1e-7, 9e-7, 3.5e-6):
        for way in (-4e-6, -1e-6, -2e-7, -1e-8, 1e-8, 2e-7, 1e-6):
            force, _, loss = solve_step(
                law.kind, law.parameters, 0, chi_over_h, G, d0, d0 + way, 0.0, 0
            )
            d1 = d0 + way - G * force
            before, after = (law_potential(law.kind, law.parameters, 0, d) for d in (d0, d1))
            turned = before + after + abs(force * (d1 - d0))
            # the residual of the Newton iteration and the subtraction of two potentials
            assert force * (d1 - d0) == pytest.approx(after - before + loss, abs=2e-9 * turned)
            assert loss >= -1e-12 * turned
            if chi_over_h * (d1 - d0) <= -1.0 and before > 0.0:
                clipped += 1
                assert force == 0.0
                assert loss == pytest.approx(before - after, rel=1e-12, abs=0.0)
    if chi_over_h == 1e8:
        assert clipped >= 8


@pytest.mark.parametrize("series", [0.0, 1e-9])
@pytest.mark.parametrize("name", list(LAWS))
def test_a_clipped_contact_in_a_network_books_its_store(name, series):
    """The same in the step of an interface: pressed in by 0.9 um, and torn out in one step."""
    law = LAWS[name].flat()
    g0, e0 = -0.9e-6, 0.0
    contact, film, g1, e1, _, lost, film_loss = solve_interface(
        law.kind, law.parameters, 0, 1e8, 0.0, 0.0, 1e-7, 0.0, 20e-9, 1e-12, series,
        g0, -0.2e-6, e0, 0.0, 0, 0.0,
    )  # fmt: skip
    before = interface_store(law.kind, law.parameters, 0, series, g0, e0)
    after = interface_store(law.kind, law.parameters, 0, series, g1, e1)

    assert (contact, film, film_loss) == (0.0, 0.0, 0.0)
    assert before > after > 0.0
    assert lost == pytest.approx(before - after, rel=1e-12, abs=0.0)
