"""Bundles of arrays as bundles of pointers, in compiled code.

Truth: the definition, member by member: the same memory, the same numbers.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from klack.network.step_function import pointers


class Mixed(NamedTuple):
    count: int
    values: Any
    scale: float
    index: Any
    table: Any


class Alike(NamedTuple):
    a: Any
    b: Any


@njit
def scatter(bundle):
    at = pointers(bundle)
    for k in range(at.count):
        at.values[at.index[k]] += at.scale * at.table[2 * k + 1]


@njit
def swap(bundle):
    at = pointers(bundle)
    at.a[0], at.b[0] = at.b[0], at.a[0]


def test_arrays_become_pointers_and_numbers_stay():
    bundle = Mixed(
        count=2,
        values=np.zeros(4),
        scale=10.0,
        index=np.array([3, 1]),
        table=np.array([[1.0, 2.0], [3.0, 4.0]]),
    )

    scatter(bundle)

    assert bundle.values.tolist() == [0.0, 40.0, 0.0, 20.0]
    assert bundle.index.tolist() == [3, 1]


def test_members_of_one_type_keep_their_names():
    bundle = Alike(np.array([1.0]), np.array([2.0]))

    swap(bundle)

    assert (bundle.a[0], bundle.b[0]) == (2.0, 1.0)
