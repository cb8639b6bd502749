"""Checks of parts of a magnetic circuit: hysteretic iron, permanent magnets, measured maps."""

from klack.verification.check import Check
from klack.verification.hysteresis_loops import hysteresis_loops
from klack.verification.magnets_in_circuits import magnets_in_circuits
from klack.verification.maps_from_files import maps_from_files

__all__ = ["checks"]


def checks() -> list[Check]:
    """Return all checks of the group."""
    return [*hysteresis_loops(), *magnets_in_circuits(), *maps_from_files()]
