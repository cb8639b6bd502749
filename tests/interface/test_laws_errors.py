"""Impossible laws are refused with a text that says what to do."""

import numpy as np
import pytest

from klack.contact.laws import (
    HertzLaw,
    HuntCrossley,
    LinearLaw,
    TableLaw,
    gonthier_coefficient,
)
from klack.errors import InputError


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: LinearLaw(0.0), r"LinearLaw.stiffness: got 0 N/m"),
        (lambda: LinearLaw(float("nan")), r"got nan N/m"),
        (lambda: HertzLaw(1e9, exponent=0.5), r"HertzLaw.exponent: got 0.5"),
        (lambda: TableLaw([1e-6, 2e-6], [1.0]), r"2 indentations and 1 forces"),
        (lambda: TableLaw([2e-6, 1e-6], [1.0, 2.0]), r"strictly increasing"),
        (lambda: TableLaw([1e-6, 2e-6], [2.0, 2.0]), r"strictly increasing"),
        (lambda: TableLaw([0.0, 1e-6], [1.0, 2.0]), r"from \(0, 0\)"),
        (lambda: TableLaw(np.array([]), np.array([])), r"at least one"),
        (lambda: HuntCrossley(LinearLaw(1.0), -0.1), r"HuntCrossley.dissipation"),
        (lambda: HuntCrossley(HuntCrossley(LinearLaw(1.0), 0.1), 0.1), r"another HuntCrossley"),
        (lambda: gonthier_coefficient(0.0), r"restitution: got 0"),
        (lambda: gonthier_coefficient(1.2), r"restitution: got 1.2"),
    ],
)
def test_refused(make, text):
    with pytest.raises(InputError, match=text):
        make()
