"""Every run of every test keeps its energy balance, or the test fails (conservation).

All four solvers hand the residual of their books to ``klack.simulation.energy_balance`` when they
finish.  The product warns there; in the suite the same call raises, with tighter limits, and names
the run. That holds from the import of this module on: in all test folders, in fixtures of any
scope, in runs behind the command line, and in worker processes.  Only runs in interpreters that a
test starts by itself (``subprocess``) still warn as for a user.

A test that spoils a balance on purpose, or whose residual has a reason, says so::

    with allowed("simulate_interface", 1e-3): ...      # other limits, from here on inside
    def test_...(as_for_a_user): ...                   # warn as the product does
"""

import os
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from klack.analyses import workers
from klack.simulation import energy_balance

LIMITS = {
    "simulate": 1e-9,  # a discrete-gradient step is exact; round-off of up to 1e6 steps is left
    "simulate_network": 1e-9,  # of the throughput; what the forces of a step did not settle
    "simulate_full_order": 1e-9,  # both numerical losses are booked
    "simulate_interface": 1e-4,  # what it still owes at the end: 1e-6, and 3e-5 on coarse contacts
}

_limits = dict(LIMITS)
_check, _start = energy_balance.check_energy_balance, workers._start


def judge(
    run: str,
    residual: float,
    least_loss: float,
    *,
    limit: float,
    advice: str,
    loss_limit: float | None = None,
) -> None:
    """Stand in for ``check_energy_balance``: raise where it warns, and at tighter limits."""
    allowed = _limits.get(run, limit)
    least = allowed if loss_limit is None else loss_limit
    if not (abs(residual) <= allowed and least_loss >= -least):
        where = os.environ.get("PYTEST_CURRENT_TEST", "a worker process")
        raise AssertionError(
            f"{where}: a run of {run} leaves an energy residual of {residual:.3e} and has a least "
            f"loss of {least_loss:.3e}; {allowed:.0e} of the energy throughput is allowed"
        )


def start_judged(given: object) -> None:
    """Start a worker process whose runs are judged as well."""
    energy_balance.check_energy_balance = judge
    _start(given)


def name_of_the_judge(_: object = None) -> str:
    """Which function judges the runs of this process."""
    return energy_balance.check_energy_balance.__name__


energy_balance.check_energy_balance = judge
workers._start = start_judged


@contextmanager
def allowed(run: str, limit: float) -> Iterator[None]:
    """Let the runs inside leave a residual of up to ``limit`` (not in worker processes)."""
    before = _limits[run]
    _limits[run] = limit
    try:
        yield
    finally:
        _limits[run] = before


@pytest.fixture
def as_for_a_user(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let runs warn as the product does instead of failing the test."""
    monkeypatch.setattr(energy_balance, "check_energy_balance", _check)
