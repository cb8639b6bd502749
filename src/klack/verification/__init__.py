"""Exact and published cases that klack checks itself against."""

from klack.verification.check import Check, compare
from klack.verification.registry import GROUPS, iterate_checks, run_checks

__all__ = ["GROUPS", "Check", "compare", "iterate_checks", "run_checks"]
