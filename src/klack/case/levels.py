"""Levels of impacts and variants of strokes."""

from typing import Literal, get_args

__all__ = [
    "LEVELS",
    "OBLIQUE_LEVELS",
    "OFF_AXIS_LEVELS",
    "ROUGH_LEVELS",
    "VARIANTS",
    "Level",
    "Variant",
]


Level = Literal[
    "lumped",
    "reduced",
    "reduced-attachment",
    "reduced-none",
    "reduced-participation",
    "interface",
    "full",
]
LEVELS: tuple[Level, ...] = get_args(Level)

ROUGH_LEVELS: tuple[Level, ...] = (
    "lumped",
    "reduced",
    "reduced-participation",
    "interface",
    "full",
)
"""Levels that take rough faces."""

OFF_AXIS_LEVELS: tuple[Level, ...] = ("lumped", "interface")
"""Levels of axisymmetric bodies off-axis."""

OBLIQUE_LEVELS: tuple[Level, ...] = ("interface", "full")
"""Levels of a body that moves sideways or spins."""


Variant = Literal["wet", "dry", "dry-mounted", "wet-lumped", "dry-lumped"]
VARIANTS: tuple[Variant, ...] = get_args(Variant)
