"""Analyses, pages and commands by text, loaded when asked for."""

from pkgutil import resolve_name
from typing import Any

__all__ = ["named"]


def named(place: str) -> Any:
    """Object of a module below :mod:`klack.analyses`: ``"noise.content:noise_content"``."""
    return resolve_name(f"klack.analyses.{place}")
