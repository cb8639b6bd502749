"""Checks of parts of a magnetic circuit: hysteretic iron, permanent magnets, measured maps."""

from klack.verification.check import Check
from klack.verification.hysteresis_loops import hysteresis_loops
from klack.verification.magnets_in_circuits import magnets_in_circuits
from klack.verification.maps_from_files import maps_from_files
from klack.verification.networks_of_tubes import networks_of_tubes
from klack.verification.remanent_starts import remanent_starts
from klack.verification.solid_iron import solid_iron

__all__ = ["checks"]


def checks() -> list[Check]:
    """Return all checks of the group."""
    return [
        *hysteresis_loops(),
        *magnets_in_circuits(),
        *maps_from_files(),
        *networks_of_tubes(),
        *solid_iron(),
        *remanent_starts(),
    ]
