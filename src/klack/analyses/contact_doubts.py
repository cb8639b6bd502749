"""Mesh of a contact, and reasons to doubt its numbers."""

from math import isfinite
from typing import Protocol

from klack.analyses.json_parts import JsonForm, Key, Real
from klack.units import format_si

__all__ = ["CONTACT", "MeshedContact", "contact_doubt", "elastic_above"]


_HARDEST = 2.5e9  # [Pa]; bearing and high-speed steel of 64 HRC has 2.0 to 2.4 GPa


class MeshedContact(Protocol):
    """Mesh of a contact."""

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
        """Loaded contact points across the width; 0 if unknown."""

    @property
    def doubts(self) -> tuple[str, ...]:
        """Reasons why no error can be estimated there."""

    @property
    def needed_yield(self) -> float:
        """Yield stress [Pa] for elastic bodies; nan if unknown."""


CONTACT = JsonForm(
    "ContactJson",
    "Mesh of a contact at the force of the impact; null without a mesh.",
    Key("surfaces", str, "Empty for a stop without surfaces."),
    Key("half_width_m", Real, of="half_width"),
    Key("size_over_half_width", Real, "Good up to 1, doubtful above 1.5.", "size_ratio"),
    Key(
        "points_across",
        int | None,
        "Too few below 5.",
        lambda contact: contact.points_across or None,
    ),
    Key(
        "doubts",
        list[str],
        "Reasons why no error of impacts there can be estimated; empty if none.",
    ),
    Key(
        "needed_yield_Pa",
        Real,
        "Approximate yield stress from which both bodies stay elastic.",
        "needed_yield",
    ),
)
"""Of a :class:`MeshedContact`."""


def contact_doubt(contact: MeshedContact) -> str:
    """Why the numbers of a contact are doubtful; empty if they are not."""
    doubts = " and ".join(contact.doubts)
    return f"The contact {contact.surfaces} cannot be relied on: {doubts}." if doubts else ""


def elastic_above(contact: MeshedContact) -> str:
    """Yield stress for elastic faces, and whether any has it; empty if unknown."""
    if not isfinite(contact.needed_yield):
        return ""
    if contact.needed_yield > _HARDEST:
        return (
            f"The faces {contact.surfaces} would yield: to stay elastic they need a yield stress "
            f"of {format_si(contact.needed_yield, 'Pa', 2)}, and hardened steel has about 2 GPa. "
            "Try: 'yield' or 'hardness' of the material, with which klack computes the yielding."
        )
    return (
        f"The faces {contact.surfaces} stay elastic if the yield stress is at least about "
        f"{format_si(contact.needed_yield, 'Pa', 2)}."
    )
