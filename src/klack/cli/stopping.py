"""Termination from outside: Ctrl-C, and the termination signal of the system."""

import signal
import sys
import threading
from _thread import interrupt_main
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

__all__ = ["Terminated", "stop_code", "terminable"]

_STOPPED, _TERMINATED = 130, 143  # 128 and the number of the signal, as shells report it
_SOON = 0.2  # [s]; out of the callback by then


class Terminated(KeyboardInterrupt):
    """SIGTERM received: everything is released as after Ctrl-C."""


def stop_code(stop: KeyboardInterrupt) -> int:
    """Exit code of a run that was stopped."""
    return _TERMINATED if isinstance(stop, Terminated) else _STOPPED


@contextmanager
def terminable() -> Iterator[None]:
    """Raise :class:`Terminated` on SIGTERM, which would end the process otherwise.

    A stop that comes inside a callback, as LLVM calls them while functions are compiled, is dropped
    there.  It is raised again shortly after, and an error that the library ends with instead, for
    want of what the callback was to do, is a stop too; both for Ctrl-C as well.
    """
    if threading.current_thread() is not threading.main_thread():  # only there may signals be set
        yield
        return
    came: list[KeyboardInterrupt] = []
    again: list[threading.Thread] = []
    over = threading.Event()

    def stop(number: int, _: FrameType | None) -> None:
        came.append(Terminated() if number == signal.SIGTERM else KeyboardInterrupt())
        raise came[-1]

    def raise_again(number: signal.Signals, begun: threading.Event) -> None:
        begun.wait()
        if not over.wait(_SOON):
            interrupt_main(number)

    def dropped(what: "sys.UnraisableHookArgs") -> None:
        if not isinstance(what.exc_value, KeyboardInterrupt):
            usual(what)
            return
        number = signal.SIGTERM if isinstance(what.exc_value, Terminated) else signal.SIGINT
        begun = threading.Event()
        again.append(threading.Thread(target=raise_again, args=(number, begun)))
        again[-1].start()
        begun.set()  # last: raised in here, it would be dropped once more

    numbers = [signal.SIGTERM]
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # a shell may have it ignored
        numbers.append(signal.SIGINT)
    before = {number: signal.getsignal(number) for number in numbers}
    usual, sys.unraisablehook = sys.unraisablehook, dropped
    try:
        for number in numbers:
            signal.signal(number, stop)
        yield
    except Exception as error:
        if came:
            raise came[0] from error
        raise
    finally:
        sys.unraisablehook = usual
        over.set()
        for thread in again:
            thread.join()
        for number, handler in before.items():
            signal.signal(number, handler)
