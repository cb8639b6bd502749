"""Analyses, pages and commands by text, loaded when asked for."""

from importlib import import_module
from typing import Any

__all__ = ["named"]


def named(place: str) -> Any:
    """Object of a module below :mod:`klack.analyses`: ``"noise.content:noise_content"``."""
    module, _, name = place.partition(":")
    return getattr(import_module(f"klack.analyses.{module}"), name)
