"""``klack app`` as a process, for tests: it never outlives the test that started it."""

import signal
import subprocess
import sys
from pathlib import Path

__all__ = ["Served"]


class Served:
    """A server on a folder; a context manager that ends it, however the test ends.

    Parameters
    ----------
    folder : Path
    options : str
        More of ``klack app``.
    """

    def __init__(self, folder: Path, *options: str) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "klack", "app", str(folder), "--no-open", *options],
            stdout=subprocess.PIPE,
            text=True,
        )
        try:
            assert self.process.stdout is not None
            self.process.stdout.readline()
            self.address = self.process.stdout.readline().strip()
            assert self.address.startswith("http://"), "klack app did not start"
        except BaseException:
            self.kill()
            raise

    @property
    def base(self) -> str:
        """Address without the token."""
        return self.address.partition("/?")[0]

    def kill(self) -> None:
        """End it as a crash would."""
        self.process.kill()
        self.process.wait(20)

    def __enter__(self) -> "Served":
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
            try:
                self.process.wait(20)
            except subprocess.TimeoutExpired:
                self.kill()
        if self.process.stdout is not None:
            self.process.stdout.close()
