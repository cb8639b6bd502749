"""Memory of a controller or a sensor, as arrays that a run stores."""

from collections.abc import Mapping
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

__all__ = ["Memory", "Remembering", "generator_words", "put_generator_words", "remembered"]

Memory = Mapping[str, NDArray[np.generic]]

_WORD = 2**64


@runtime_checkable
class Remembering(Protocol):
    """A running controller or sensor that can be stored.

    A function of the user becomes one by these two methods.
    """

    def memory(self) -> Memory:
        """All that the next call depends on."""

    def recall(self, memory: Memory) -> None:
        """Continue from what :meth:`memory` returned."""


def remembered(memory: Memory, name: str, size: int | None = None) -> NDArray[np.generic]:
    """Array of a memory; KeyError if it is missing or not of ``size``."""
    found = np.asarray(memory[name])
    if found.ndim != 1 or (size is not None and found.size != size):
        raise KeyError(name)
    return found


def generator_words(generator: np.random.Generator) -> NDArray[np.uint64]:
    """State of a generator of NumPy's default kind (PCG64) as six words of 64 bits."""
    found = generator.bit_generator.state
    whole = (found["state"]["state"], found["state"]["inc"])
    words = [part for number in whole for part in (number % _WORD, number // _WORD)]
    return np.array([*words, found["has_uint32"], found["uinteger"]], dtype=np.uint64)


def put_generator_words(generator: np.random.Generator, words: NDArray[np.generic]) -> None:
    """Put a generator into the state of :func:`generator_words`."""
    low, high, low_step, high_step, kept, rest = (int(word) for word in words)
    whole = {"state": low + _WORD * high, "inc": low_step + _WORD * high_step}
    generator.bit_generator.state = {
        "bit_generator": "PCG64",
        "state": whole,
        "has_uint32": kept,
        "uinteger": rest,
    }
