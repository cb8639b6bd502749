"""Analyses, their pages and commands are named as text, so that each is loaded when asked for."""

from importlib import import_module
from typing import Any

__all__ = ["named"]


def named(place: str) -> Any:
    """What a module below :mod:`klack.analyses` calls so: ``"noise.content:noise_content"``."""
    module, _, name = place.partition(":")
    return getattr(import_module(f"klack.analyses.{module}"), name)
