"""Exact and published cases that klack checks itself against."""

from klack.verification.check import (
    COVERS,
    GROUPS,
    LARGEST_HEADROOM,
    Check,
    ComparedCurve,
    compare,
    iterate_checks,
    run_checks,
)

__all__ = [
    "COVERS",
    "GROUPS",
    "LARGEST_HEADROOM",
    "Check",
    "ComparedCurve",
    "compare",
    "iterate_checks",
    "run_checks",
]
