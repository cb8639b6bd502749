"""Doubts that a run tells, apart from what other libraries warn of in between."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from klack.errors import AccuracyWarning


@contextmanager
def doubts() -> Iterator[list[str]]:
    """Texts of the doubts told inside, complete when it ends."""
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", AccuracyWarning)
        try:
            yield texts
        finally:
            texts += [
                str(one.message) for one in caught if issubclass(one.category, AccuracyWarning)
            ]
