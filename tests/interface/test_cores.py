"""Cores of this process; truth = what the scheduler was told."""

import os

import pytest

from klack.cores import available_cores


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="binds this process to one core")
def test_a_process_bound_to_one_core_has_one():
    before = os.sched_getaffinity(0)
    assert available_cores() == len(before)
    os.sched_setaffinity(0, {min(before)})
    try:
        assert available_cores() == 1
    finally:
        os.sched_setaffinity(0, before)


def test_where_the_scheduler_does_not_say_the_machine_counts(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert available_cores() == 1
    monkeypatch.setattr(os, "cpu_count", lambda: 8)
    assert available_cores() == 8
