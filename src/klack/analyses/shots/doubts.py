"""Doubts of many shots, those that differ in their numbers alone as one."""

import re
from collections.abc import Iterable

__all__ = ["grouped_doubts"]

_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def grouped_doubts(doubts: Iterable[tuple[int, Iterable[str]]], shots: str) -> list[str]:
    """How many shots have each doubt, and the first of them.

    Parameters
    ----------
    doubts : iterable of (int, iterable of str)
        Number of each shot, and its doubts.
    shots : str
        What they are called, ``"shots"``.

    Examples
    --------
    >>> grouped_doubts([(0, ["off by 2 %"]), (1, ["off by 3.5 %"]), (2, [])], "shots")
    ['2 of 3 shots, first shot 0: off by 2 %']
    """
    alike: dict[str, list[tuple[int, str]]] = {}
    count = 0
    for index, own in doubts:
        count += 1
        for doubt in own:
            alike.setdefault(_NUMBER.sub("#", doubt), []).append((index, doubt))
    return [
        f"{len(found)} of {count} {shots}, first {shots.rstrip('s')} {found[0][0]}: {found[0][1]}"
        for found in alike.values()
    ]
