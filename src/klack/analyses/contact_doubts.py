"""How a contact is meshed, and what makes its numbers doubtful: of an impact or of an end stop."""

from typing import Protocol

from klack.analyses.json_parts import ContactJson
from klack.analyses.measures import number_or_none

__all__ = ["MeshedContact", "contact_doubt", "contact_to_json"]


class MeshedContact(Protocol):
    """What is known of the mesh of a contact."""

    @property
    def surfaces(self) -> str:
        """``"needle.tip on housing.seat"``."""

    @property
    def half_width(self) -> float:
        """At the force of the impact [m]."""

    @property
    def size_ratio(self) -> float:
        """Element size over half width [-]."""

    @property
    def points_across(self) -> int:
        """Contact points that carry across the whole width; 0 where nobody knows."""

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why no error can be judged there, each in a few words."""


def contact_to_json(contact: MeshedContact) -> ContactJson:
    """Mesh of a contact in plain numbers, SI, the unit in the key."""
    return {
        "surfaces": contact.surfaces,
        "half_width_m": number_or_none(contact.half_width),
        "size_over_half_width": number_or_none(contact.size_ratio),
        "points_across": contact.points_across or None,
        "doubts": list(contact.doubts),
    }


def contact_doubt(contact: MeshedContact) -> str:
    """Say in one sentence why the numbers of a contact are doubtful; empty if they are not."""
    doubts = " and ".join(contact.doubts)
    return f"The contact {contact.surfaces} cannot be relied on: {doubts}." if doubts else ""
