"""Environment of a command: streams, folders for temporary and compiled files, full disks."""

import errno
import os
import signal
import sys
import threading
from _thread import interrupt_main
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from io import TextIOWrapper
from types import FrameType
from typing import TextIO

from klack.errors import InputError

__all__ = [
    "Terminated",
    "close_quietly",
    "in_words",
    "keep_bytecode",
    "prepare_compiling",
    "prepare_streams",
    "require_present_folder",
    "stop_code",
    "terminable",
]


_STOPPED, _TERMINATED = 130, 143  # 128 and the number of the signal, as shells report it
_SOON = 0.2  # [s]; out of the callback by then


class Terminated(KeyboardInterrupt):
    """SIGTERM received; as after Ctrl-C, everything is released."""


def stop_code(stop: KeyboardInterrupt) -> int:
    """Exit code of a run that was stopped."""
    return _TERMINATED if isinstance(stop, Terminated) else _STOPPED


@contextmanager
def terminable() -> Iterator[None]:
    """Raise :class:`Terminated` on SIGTERM, which would end the process otherwise.

    A stop inside a callback, as LLVM makes them while functions are compiled, is dropped there.
    It is raised again shortly after, and an error that the library ends with instead is a stop
    too; both for Ctrl-C as well.
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


_WORDS: Mapping[int, str] = {
    errno.ENOSPC: "the disk is full.\nTry: free space, or choose another folder (--out; "
    "TMPDIR for temporary files).",
    errno.EDQUOT: "your disk quota is used up.\nTry: free space, or choose another folder "
    "(--out; TMPDIR for temporary files).",
    errno.EROFS: "a folder is read-only.\nTry: another folder (--out; TMPDIR for temporary files).",
    errno.EFBIG: "a file exceeds the size limit of the system.\nTry: ulimit -f unlimited.",
    errno.EMFILE: "too many files are open.\nTry: ulimit -n 4096.",
    errno.ENFILE: "too many files are open.\nTry: close other programs.",
    errno.ENAMETOOLONG: ("a file name is too long for the system.\nTry: a shorter name."),
    errno.ELOOP: "symbolic links form a loop.\nTry: the target itself.",
    errno.EIO: "the disk or the network drive failed.\nTry: another folder (--out).",
}


def prepare_streams() -> None:
    """Make all characters printable, and output to closed streams harmless.

    A terminal without umlauts shows their numbers; a program started with its output closed
    would otherwise get the first file that it opens for its output.
    """
    for name in ("stdin", "stdout", "stderr"):
        stream: TextIO | None = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w"))
        elif name != "stdin" and isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def keep_bytecode() -> None:
    """Keep what Python compiles in a folder of klack, where a variable forbids it beside sources.

    Otherwise each command would compile for some seconds.  Nothing changes where the bytecode
    is there already, or another folder is set.
    """
    if not os.environ.get("PYTHONDONTWRITEBYTECODE") or sys.pycache_prefix:
        return
    places = [find_spec(name) for name in ("klack.cli", "numba", "pydantic")]
    if all(place and place.cached and os.path.exists(place.cached) for place in places):
        return
    from klack.machine.compiling.compiled_folder import bytecode_folder

    folder = bytecode_folder()
    if folder is not None:
        sys.pycache_prefix, sys.dont_write_bytecode = str(folder), False
        os.environ["PYTHONPYCACHEPREFIX"] = str(folder)  # for processes that klack starts
        del os.environ["PYTHONDONTWRITEBYTECODE"]


def prepare_compiling() -> None:
    """Keep compiled functions for one command and its processes where they have no folder."""
    from klack.machine.compiling.compiled_folder import FOLDER_VARIABLE, compiled_folder, is_usable

    folder = compiled_folder()
    if is_usable(folder) or (folder is not None and folder.is_dir()):  # may be read at least
        return
    import atexit
    import shutil
    from tempfile import mkdtemp

    place = mkdtemp(prefix="klack-compiled-")  # not a shared one: what is found there is run
    atexit.register(shutil.rmtree, place, ignore_errors=True)
    os.environ[FOLDER_VARIABLE] = place
    print(
        "klack: note: compiled functions cannot be cached (no writable home directory), "
        "so every command compiles them again.",
        file=sys.stderr,
    )


def require_present_folder() -> None:
    """Refuse to start in a deleted folder, in which every relative name fails."""
    try:
        os.getcwd()
    except OSError as error:
        raise InputError(
            "the present folder",
            got=f"an error: {error.strerror}; it was deleted or is not accessible",
            expected="a folder that exists",
            hint="cd to another one, e.g. cd ~.",
        ) from None


def in_words(error: OSError) -> str | None:
    """Text on a fault of the environment; None for an internal error."""
    if "No usable temporary directory" in str(error):
        return "no folder for temporary files can be written to.\nTry: set TMPDIR to one."
    return _WORDS.get(error.errno or 0)


def close_quietly() -> None:
    """Give up a closed output; Python would complain about it at its end."""
    try:
        sys.stdout.flush()
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
