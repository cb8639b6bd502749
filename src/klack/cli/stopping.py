"""Termination from outside: Ctrl-C, and the termination signal of the system."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["Terminated", "stop_code", "terminable"]

_STOPPED, _TERMINATED = 130, 143  # 128 and the number of the signal, as shells report it


class Terminated(KeyboardInterrupt):
    """SIGTERM received: everything is released as after Ctrl-C."""


def stop_code(stop: KeyboardInterrupt) -> int:
    """Exit code of a run that was stopped."""
    return _TERMINATED if isinstance(stop, Terminated) else _STOPPED


@contextmanager
def terminable() -> Iterator[None]:
    """Raise :class:`Terminated` on SIGTERM, which would end the process otherwise."""
    if threading.current_thread() is not threading.main_thread():  # only there may signals be set
        yield
        return
    before = signal.signal(signal.SIGTERM, _raise)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _raise(number: int, frame: FrameType | None) -> None:
    raise Terminated
