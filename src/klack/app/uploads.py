"""STEP files that came through the browser, below ``.klack-app`` until they are in a case."""

import secrets
from collections.abc import AsyncIterator

from klack.app.folder import OpenFolder
from klack.app.guard import LARGEST_UPLOAD
from klack.errors import InputError

__all__ = ["Uploads"]

_HOME = ".klack-app/uploads"
_MOST = 12  # files; the oldest are removed
_START = b"ISO-10303-21"


class Uploads:
    """Files under names that cannot be guessed; their own names are never used as names.

    Parameters
    ----------
    folder : OpenFolder
    """

    def __init__(self, folder: OpenFolder) -> None:
        self._place = folder.path / _HOME

    async def take(self, parts: AsyncIterator[bytes]) -> str:
        """Keep a file as a whole; return its path from the folder.

        Raises
        ------
        InputError
            For one that is no STEP file, or larger than is taken.
        """
        self._place.mkdir(mode=0o700, parents=True, exist_ok=True)
        name = f"{secrets.token_hex(12)}.step"
        partial = self._place / f"{name}.part"
        size, head = 0, b""
        try:
            with partial.open("xb") as file:
                async for part in parts:
                    size += len(part)
                    head = (head + part)[:2048]
                    if size > LARGEST_UPLOAD:
                        raise _refused(f"more than {LARGEST_UPLOAD // 2**20} MiB")
                    file.write(part)
            if not head.lstrip().startswith(_START):
                got = "an empty file" if not size else f"a file that begins with {_words(head)}"
                raise _refused(got)
            partial.rename(self._place / name)
        finally:
            partial.unlink(missing_ok=True)
        self._tidy()
        return f"{_HOME}/{name}"

    def _tidy(self) -> None:
        """Remove the oldest files beyond the most that are kept."""
        files = sorted(self._place.glob("*.step"), key=lambda file: file.stat().st_mtime_ns)
        for file in files[:-_MOST]:
            file.unlink(missing_ok=True)


def _words(head: bytes) -> str:
    """Beginning of a file that was no STEP file, to be recognised by who sent it."""
    text = head[:24].decode("utf-8", errors="replace").split("\n")[0]
    return repr(text) if text.isprintable() else "bytes that are no text"


def _refused(got: str) -> InputError:
    return InputError(
        "uploaded file",
        got=got,
        expected=f"a STEP file of at most {LARGEST_UPLOAD // 2**20} MiB, which starts with "
        f"'{_START.decode()};'",
        hint="export the part as STEP (AP214 or AP242) from the CAD program.",
    )
