"""Mistakes found when a case is computed, at file, line and key."""

import re
from collections.abc import Callable
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar

from klack.case.bodies import WrittenCase
from klack.errors import InputError
from klack.input.problem import CaseProblem, Key

__all__ = ["tells_place"]

C = TypeVar("C", bound=WrittenCase)
P = ParamSpec("P")
R = TypeVar("R")

_KEY = re.compile(r"(?P<key>[\w-]+(?:\.[\w-]+|\[\d+\])*)(?P<rest>(?:: .*)?)", re.DOTALL)


def tells_place(
    compute: Callable[Concatenate[C, P], R],
) -> Callable[Concatenate[C, P], R]:
    """Decorate what computes a case: errors that name a key get the place in the file.

    Connections of a variant (dry, lumped) differ from those of the file, which are checked when
    read: only the section is named.
    """

    @wraps(compute)
    def told(case: C, /, *args: P.args, **more: P.kwargs) -> R:
        try:
            return compute(case, *args, **more)
        except InputError as error:
            where = _place(case, error)
            if where is None:
                raise
            raise InputError(
                where, got=error.got, expected=error.expected, hint=error.hint
            ) from error

    return told


def _place(case: WrittenCase, error: InputError) -> str | None:
    """File, line and key, if the error names one and the case has a file."""
    found = _KEY.fullmatch(error.where)
    if case.expanded is None or found is None:
        return None
    key: Key = tuple(
        int(part) if part.isdigit() else part for part in re.findall(r"[\w-]+", found["key"])
    )
    data, on_key = case.expanded.data, False
    if isinstance(error, CaseProblem):
        key, on_key = error.key, error.on_key
    if key[:1] and key[0] in (data.get("network") or {}):
        key = ("network", *key)
    if key[:2] == ("network", "connections"):
        key = key[:2]
    if not key or key[0] not in data:
        return None
    return case.expanded.origin(key).where(on_key=on_key) + found["rest"]
