"""STEP files that came through the browser, below ``.klack-app`` until they are in a case."""

import os
import re
import secrets
import stat
from collections.abc import AsyncIterator

from klack.app.folder import OWN, OpenFolder
from klack.app.guard import LARGEST_UPLOAD
from klack.errors import InputError
from klack.held_folder import HeldFolder

__all__ = ["Uploads"]

_PLACE = "uploads"
_NAME = re.compile(r"[0-9a-f]{24}\.step")
_MOST = 12  # files; the oldest are removed
_START = b"ISO-10303-21"


class Uploads:
    """Files under names that cannot be guessed; their own names are never used as names.

    Parameters
    ----------
    folder : OpenFolder
    """

    def __init__(self, folder: OpenFolder) -> None:
        self._folder = folder

    async def take(self, parts: AsyncIterator[bytes]) -> str:
        """Keep a file as a whole; return its path from the folder.

        Raises
        ------
        InputError
            For one that is no STEP file, or larger than is taken.
        """
        name = f"{secrets.token_hex(12)}.step"
        with self._folder.own(_PLACE) as held:
            try:
                await _fill(held, f"{name}.part", parts)
                held.rename(f"{name}.part", name)
            finally:
                held.remove(f"{name}.part")
            _tidy(held)
        return f"{OWN}/{_PLACE}/{name}"


async def _fill(held: HeldFolder, name: str, parts: AsyncIterator[bytes]) -> None:
    size, head = 0, b""
    with os.fdopen(held.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL), "wb") as file:
        async for part in parts:
            size += len(part)
            head = (head + part)[:2048]
            if size > LARGEST_UPLOAD:
                raise _refused(f"more than {LARGEST_UPLOAD // 2**20} MiB")
            file.write(part)
    if not head.lstrip().startswith(_START):
        raise _refused("an empty file" if not size else f"a file that begins with {_words(head)}")


def _tidy(held: HeldFolder) -> None:
    """Remove the oldest uploads beyond the most that are kept; files of other names stay."""
    found = {name: held.state(name) for name in held.names() if _NAME.fullmatch(name)}
    ages = {name: of.st_mtime_ns for name, of in found.items() if of and stat.S_ISREG(of.st_mode)}
    for name in sorted(ages, key=ages.__getitem__)[:-_MOST]:
        held.remove(name)


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
