"""Numbers of a text, as programs write them between blanks."""

import warnings
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["plain_numbers"]


def plain_numbers(text: bytes, kind: type = float) -> NDArray[Any] | None:
    """Numbers between blanks and line ends, or None if there is anything else in the text.

    ``kind`` is float, or int for whole numbers.

    Examples
    --------
    >>> plain_numbers(b"1 2.5e3").tolist()
    [1.0, 2500.0]
    >>> plain_numbers(b"1 2.5e3", int) is None
    True
    """
    if not text.strip():
        return np.empty(0, dtype=kind)
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # an unreadable rest, NumPy before 2.4
        try:
            return np.fromstring(text, dtype=kind, sep=" ")
        except (ValueError, OverflowError, DeprecationWarning):
            return None
