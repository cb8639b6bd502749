"""Variants of a stroke: with fluid or dry, with flexible bodies or rigid ones."""

from typing import Literal

__all__ = ["VARIANTS", "Variant"]

Variant = Literal["wet", "dry", "wet-lumped", "dry-lumped"]
VARIANTS: tuple[Variant, ...] = ("wet", "dry", "wet-lumped", "dry-lumped")
