"""Fields of drawn magnets against closed solutions."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import j0, j1, struve

from klack.magnetics.drawn_magnet import DrawnMagnet, DrawnPart, section
from klack.magnetics.iron import VACUUM_PERMEABILITY as MU0
from klack.magnetics.iron import IronCurve

MM, TURNS, CURRENT = 1e-3, 100, 3.0

pytestmark = pytest.mark.slow


def rectangle(inner, outer, low, high):
    return section((MM * inner, MM * low), (MM * outer, MM * high))


def linear(permeability):
    B, slope = np.array([0.0, 30.0]), 1.0 / (MU0 * permeability)
    return IronCurve(B, slope * B, np.full(2, slope))


def test_a_field_that_is_axial_everywhere():
    """Plates of infinite permeability above and below a coil that fills the pot.

    Ampere's law between them: H(r) g = N I s(r) - V, s the share of the turns outside r, V the mmf
    of the narrow clearance round the disc.
    """
    pytest.importorskip("ngsolve")
    a, b, g, clearance, thick = 5.0, 10.0, 2.0, 0.02, 5.0  # [mm]
    iron = linear(1e6)
    magnet = DrawnMagnet(
        fixed=(
            DrawnPart("bottom", rectangle(0, 12, -4, 0), iron),
            DrawnPart("shell", rectangle(b, 12, 0, g + thick), iron),
        ),
        moving=(DrawnPart("disc", rectangle(0, b - clearance, 0, thick), iron),),
        coil=rectangle(a, b, 0, g - clearance),
        turns=TURNS,
    )
    share = (lambda r: 1.0), (lambda r: (b - r) / (b - a))
    ends = (0.0, a), (a, b)
    S = [  # integrals of s^n over the face [m^2]
        sum(
            quad(lambda r, s=s, n=n: 2e-6 * np.pi * r * s(r) ** n, *end)[0]
            for s, end in zip(share, ends, strict=True)
        )
        for n in range(3)
    ]
    mmf, gap = TURNS * CURRENT, g * MM
    around = 2 * np.pi * MU0 * thick * MM / np.log(b / (b - clearance))
    V = MU0 / gap * mmf * S[1] / (around + MU0 / gap * S[0])
    linkage = TURNS * MU0 / gap * (mmf * S[2] - V * S[1])
    force = -0.5 * MU0 / gap**2 * (mmf**2 * S[2] - 2 * mmf * V * S[1] + V**2 * S[0])

    found = magnet.field_map([CURRENT], [gap])

    # of the clearances, 0.02 of 2 mm, the edge fields are not in the formula
    assert found.linkage[0, 0] == pytest.approx(linkage, rel=1e-3)
    assert found.force[0, 0] == pytest.approx(force, rel=3e-3)
    assert found.error < 1e-3


def test_a_coil_in_air_and_the_end_of_the_air():
    """Inductance of a coil of rectangular section, by its Hankel transform.

    ``L = 2 pi mu0 N^2 / (h w)^2 int I(k)^2 (k h - 1 + exp(-k h)) / k^2 dk``, ``I`` the integral
    of ``r J1(k r)`` over the width.  The field far away is one of a dipole: its error falls with
    the cube of the distance, so twice the distance leaves a seventh of the difference.
    """
    pytest.importorskip("ngsolve")
    inner, width, height = 10 * MM, 10 * MM, 10 * MM
    air = linear(1.0 + 1e-7)
    magnet = DrawnMagnet(
        fixed=(DrawnPart("fixed", rectangle(0, 2, 0, 1), air),),
        moving=(DrawnPart("moving", rectangle(0, 2, 5, 6), air),),
        coil=rectangle(10, 20, 0, 10),
        turns=TURNS,
    )

    def integrand(k):
        x = k * np.array([inner, inner + width])
        part = 0.5 * np.pi * x * (j1(x) * struve(0, x) - j0(x) * struve(1, x))
        across = (part[1] - part[0]) / k**2
        return across**2 * (k * height - 1.0 + np.exp(-k * height)) / k**2

    parts = [quad(integrand, *ends, limit=400)[0] for ends in ((1e-3, 2e3), (2e3, 2e4))]
    inductance = 2 * np.pi * MU0 * (TURNS / (height * width)) ** 2 * sum(parts)

    found = magnet.field_map([CURRENT], [0.0])

    missing = inductance * CURRENT - found.linkage[0, 0]
    assert missing == pytest.approx(found.linkage_air[0, 0] / 7.0, rel=0.05)
    assert found.linkage[0, 0] == pytest.approx(inductance * CURRENT, rel=5e-3)
    assert abs(found.linkage_mesh[0, 0]) < 5e-4 * found.linkage[0, 0]
    assert abs(found.force[0, 0]) < 1e-4


def test_the_force_is_the_slope_of_the_coenergy():
    """Of linear iron: half of linkage times current."""
    pytest.importorskip("ngsolve")
    iron, step = linear(500.0), 0.02 * MM
    magnet = DrawnMagnet(
        fixed=(
            DrawnPart("pot", section(*((MM * r, MM * z) for r, z in (
                (0, 0), (3, 0), (3, 8), (6, 8), (6, 0), (8, 0), (8, 10), (0, 10)))), iron),
        ),
        moving=(DrawnPart("plate", rectangle(0, 8, -3, 0), iron),),
        coil=rectangle(3, 6, 2, 8),
        turns=TURNS,
        opens=-1,
    )  # fmt: skip

    found = magnet.field_map([CURRENT], [0.5 * MM - step, 0.5 * MM, 0.5 * MM + step])

    slope = 0.5 * CURRENT * (found.linkage[0, 2] - found.linkage[0, 0]) / (2 * step)
    # difference of linkages whose errors are 1e-4 each, over a rise of 5 %
    assert found.force[0, 1] == pytest.approx(slope, rel=0.01)
    assert found.force[0, 1] < 0.0
