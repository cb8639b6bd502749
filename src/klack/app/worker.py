"""A process that computes for the pages, so that the server answers while it does.

Requests and answers are pickles through its standard input and output, between two processes of
one user.  One request at a time; a process that dies is an error of the request, and the next
request starts another one.
"""

import asyncio
import contextlib
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from typing import Any

from klack.errors import InputError, KlackError

__all__ = ["Worker", "serve"]


class Worker:
    """A process with one object in it, whose methods are called from here.

    ``kind`` is its class, ``package.module:Class``, made without arguments.
    """

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self._process: subprocess.Popen[bytes] | None = None
        self._thread = ThreadPoolExecutor(1)
        self._is_closed = False

    def start(self) -> None:
        """Start the process ahead of the first request."""
        if self._process is not None and self._process.poll() is None:
            return
        self._process = subprocess.Popen(
            # -P: not from the opened folder, where a stranger's numpy.py may lie
            [sys.executable, "-P", "-m", "klack.app.worker", self._kind],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
        )

    async def call(self, method: str, *arguments: Any) -> Any:
        """Result of a method; KlackError also if the process died or was ended."""
        if self._is_closed:
            raise _closed()
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(self._thread, self._exchange, method, arguments)

    def close(self) -> None:
        """End the process, even within a request."""
        self._is_closed = True
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.wait()
        self._thread.shutdown(wait=False, cancel_futures=True)

    def _exchange(self, method: str, arguments: tuple[Any, ...]) -> Any:
        if self._is_closed:  # since it was asked
            raise _closed()
        self.start()
        process = self._process
        assert process is not None
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            pickle.dump((method, arguments), process.stdin)
            process.stdin.flush()
            is_good, answer = pickle.load(process.stdout)
        except (OSError, EOFError, pickle.UnpicklingError, ValueError):
            raise _dead(process.poll()) from None
        if is_good:
            return answer
        raise answer


def _dead(code: int | None) -> InputError:
    return InputError(
        "computation",
        got=f"a process that ended ({code})",
        expected="an answer",
        hint="try again; with a smaller model if the memory of this machine is exhausted.",
    )


def _closed() -> InputError:
    return InputError(
        "computation",
        got="a page that was left, and whose process ended for another one",
        expected="a page with a process",
        hint="reload the page.",
    )


def serve(make: Callable[[], Any]) -> None:
    """Answer requests from the standard input until it ends."""
    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what is printed is no answer
    made = make()
    while True:
        try:
            method, arguments = pickle.load(requests)
        except EOFError:
            return
        try:
            answer = True, getattr(made, method)(*arguments)
        except KlackError as error:
            answer = False, _plain(error)
        except MemoryError:
            answer = False, KlackError("the memory of this machine is exhausted.")
        except Exception as error:  # a bug: told on the page, and the process stays
            answer = False, KlackError(f"internal error ({type(error).__name__}: {error}).")
        pickle.dump(answer, answers)
        answers.flush()


def _plain(error: KlackError) -> KlackError:
    """Error that can be pickled: klack's take several arguments."""
    with contextlib.suppress(Exception):
        pickle.loads(pickle.dumps(error))
        return error
    return KlackError(str(error))


if __name__ == "__main__":
    module, _, name = sys.argv[1].partition(":")
    serve(getattr(import_module(module), name))
