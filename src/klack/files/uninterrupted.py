"""Work that is completed before Ctrl-C or SIGTERM stops the program."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["uninterrupted"]

_STOPS = (signal.SIGINT, signal.SIGTERM)


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold back the signals that stop a program until the block has ended, well or not.

    Only in the main thread, the only one that signals interrupt, and not for signals that Python
    leaves to the system.

    A mask of signals would not do: the system gives a masked signal to another thread, and
    Python then raises in the main one all the same.
    """
    came: list[tuple[int, FrameType | None]] = []

    def note(number: int, frame: FrameType | None) -> None:
        came.append((number, frame))

    handlers = {}
    if threading.current_thread() is threading.main_thread():
        handlers = {number: signal.getsignal(number) for number in _STOPS}
    callables = {number: handler for number, handler in handlers.items() if callable(handler)}
    try:
        for number in callables:
            signal.signal(number, note)
        yield
    finally:
        for number, handler in callables.items():
            signal.signal(number, handler)
        if came:
            first, frame = came[0]
            callables[signal.Signals(first)](first, frame)
