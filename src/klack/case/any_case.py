"""A case of either kind: an impact of two bodies, or a whole valve."""

from typing import Any

from klack.case.schema import Case
from klack.case.valve import ValveCase

__all__ = ["AnyCase", "case_kind"]

AnyCase = Case | ValveCase


def case_kind(data: Any) -> type[Case] | type[ValveCase]:
    """Kind of the case that the parsed text of a file describes: a valve has a network."""
    return ValveCase if "network" in data else Case
