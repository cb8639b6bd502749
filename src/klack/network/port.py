"""Kinds of ports: what may be joined, and which port rules the common node."""

from dataclasses import dataclass
from enum import Enum

__all__ = [
    "COIL",
    "COMPLIANCE",
    "ELEMENT",
    "FED",
    "FEEDS",
    "FLOW",
    "FLUID_DOMAINS",
    "GAS_FLOW",
    "GAS_PRESSURE",
    "GAS_VOLUME",
    "HEAT",
    "HEAT_STORE",
    "MOTION",
    "PRESSURE",
    "TEMPERATURE",
    "VOLTAGE",
    "Port",
    "Role",
]


class Role(Enum):
    """Part that a port plays in its node."""

    MOTION = "moves"  # port of a body: rules the displacement of a mechanical node
    ELEMENT = "pushes"  # exchanges force with a body
    COMPLIANCE = "stores fluid"  # volume with compliance: rules the pressure of its node
    PRESSURE = "prescribes pressure"
    FLOW = "carries flow"
    VOLTAGE = "drives"
    COIL = "is driven"
    FEEDS = "feeds drivers"
    FED = "draws from a capacitor"
    HEAT_STORE = "stores heat"
    TEMPERATURE = "prescribes temperature"
    HEAT = "carries heat"


@dataclass(frozen=True, slots=True)
class Port:
    """One port of a component; only equal domains can be joined.

    Parameters
    ----------
    domain
        ``"mechanical"``, ``"hydraulic"``, ``"pneumatic"``, ``"electric"`` or ``"thermal"``.
    optional
        Whether it may stay unconnected.
    """

    domain: str
    role: Role
    optional: bool = False


FLUID_DOMAINS = ("hydraulic", "pneumatic")
"""Domains of liquid and of gas, whose nodes are pressures and which a dry valve lacks."""

MOTION = Port("mechanical", Role.MOTION)
ELEMENT = Port("mechanical", Role.ELEMENT)
COMPLIANCE = Port("hydraulic", Role.COMPLIANCE)
PRESSURE = Port("hydraulic", Role.PRESSURE)
FLOW = Port("hydraulic", Role.FLOW)
GAS_VOLUME = Port("pneumatic", Role.COMPLIANCE)
GAS_PRESSURE = Port("pneumatic", Role.PRESSURE)
GAS_FLOW = Port("pneumatic", Role.FLOW)
VOLTAGE = Port("electric", Role.VOLTAGE)
COIL = Port("electric", Role.COIL)
FEEDS = Port("electric", Role.FEEDS)
FED = Port("electric", Role.FED)
HEAT_STORE = Port("thermal", Role.HEAT_STORE, optional=True)
TEMPERATURE = Port("thermal", Role.TEMPERATURE, optional=True)
HEAT = Port("thermal", Role.HEAT)
