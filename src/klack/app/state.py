"""State of all pages."""

import json
import os
import re
import secrets
import stat
from collections import OrderedDict
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from hashlib import sha256
from typing import Any
from weakref import WeakSet

from klack.app.answers import ResultCard
from klack.app.folder import OWN, OpenFolder
from klack.app.guard import LARGEST_UPLOAD
from klack.app.jobs import Jobs
from klack.app.valve_plan import Plans
from klack.app.worker import Worker
from klack.errors import InputError
from klack.files.held import HeldFolder

__all__ = ["LONGEST_NOTE", "Notes", "Sounds", "State", "Uploads"]


_PLACE = "uploads"
_NAME = re.compile(r"[0-9a-f]{24}\.step")
_MOST = 12  # files; the oldest are removed
_START = b"ISO-10303-21"


class Uploads:
    """Files under random names; their own names are never used."""

    def __init__(self, folder: OpenFolder) -> None:
        self._folder = folder

    async def take(self, parts: AsyncIterator[bytes]) -> str:
        """Keep a file as a whole; return its path from the folder.

        InputError for one that is no STEP file, or larger than is taken.
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
    """Remove the oldest uploads above the limit, nothing else."""
    found = {name: held.state(name) for name in held.names() if _NAME.fullmatch(name)}
    ages = {name: of.st_mtime_ns for name, of in found.items() if of and stat.S_ISREG(of.st_mode)}
    for name in sorted(ages, key=ages.__getitem__)[:-_MOST]:
        held.remove(name)


def _words(head: bytes) -> str:
    """Beginning of a file that is not STEP, for its sender."""
    text = head[:24].decode("utf-8", errors="replace").split("\n")[0]
    return repr(text) if text.isprintable() else "bytes that are not text"


def _refused(got: str) -> InputError:
    return InputError(
        "uploaded file",
        got=got,
        expected=f"a STEP file of at most {LARGEST_UPLOAD // 2**20} MiB, which starts with "
        f"'{_START.decode()};'",
        hint="export the part as STEP (AP214 or AP242) from the CAD program.",
    )


_EXPLORER, _READER = "klack.app.explorer:Explorer", "klack.app.reader:Reader"
_LISTENER = "klack.app.study_points:Listener"
_SHAPES = "klack.app.shapes:Shapes"
_MOST_SCENES = 6
_MOST_EXPLORERS = 3
LONGEST_NOTE = 20_000  # characters


@dataclass
class Sounds:
    """The latest sounds in memory, by names that cannot be guessed; or scenes.

    ``most`` are kept; ``place`` and ``ending`` are those of their addresses.
    """

    most: int = 200
    place: str = "/sound"
    ending: str = ".wav"
    _kept: "OrderedDict[str, bytes]" = field(default_factory=OrderedDict)

    def add(self, wav: bytes) -> str:
        """Keep a sound; return its address."""
        name = secrets.token_urlsafe(16)
        self._kept[name] = wav
        while len(self._kept) > self.most:
            self._kept.popitem(last=False)
        return f"{self.place}/{name}{self.ending}"

    def get(self, name: str) -> bytes | None:
        """A sound, if it is still kept."""
        return self._kept.get(name)


class Notes:
    """Notes on cases and results, and drafts; in ``.klack-app``."""

    def __init__(self, folder: OpenFolder) -> None:
        self._folder = folder

    def note(self, of: str) -> str:
        """Note on a case or result."""
        return str(self._folder.own_json("notes.json").get(of, ""))

    def set_note(self, of: str, text: str) -> None:
        """Keep a note; an empty one is removed."""
        if len(text) > LONGEST_NOTE:
            raise InputError(
                "note",
                got=f"more than {LONGEST_NOTE} characters",
                expected=f"at most {LONGEST_NOTE}",
                hint="make it shorter, or write a file next to the case.",
            )
        self._change("notes.json", of, text)

    def draft(self, of: str) -> str | None:
        """Text of a case that was not saved."""
        found = self._folder.own_json(self._draft_name(of)).get(of)
        return found if isinstance(found, str) else None

    def set_draft(self, of: str, text: str | None) -> None:
        """Keep an unsaved text; None once it is saved."""
        self._change(self._draft_name(of), of, text or "")

    def exchange_draft(self, of: str, known: str | None, text: str | None) -> bool:
        """Keep a text that is not saved yet, unless another page has kept one since ``known``.

        Returns False where the text of another page stays; ``text`` None: it is saved.  A text that
        was kept already and has been discarded since, by a page that came after, stays so.
        """
        now = self.draft(of)
        if now not in (None, known, text):
            return False
        if now is not None or text != known:
            self.set_draft(of, text)
        return True

    @staticmethod
    def _draft_name(of: str) -> str:
        return f"draft-{sha256(of.encode()).hexdigest()[:16]}.json"

    def _change(self, name: str, of: str, text: str) -> None:
        kept = self._folder.own_json(name)
        before = kept.pop(of, None)
        if text:
            kept[of] = text
        if text or before is not None:
            self._folder.keep(name, json.dumps(kept).encode() if kept else None)


class State:
    """Of one server."""

    def __init__(self, folder: OpenFolder) -> None:
        self.folder, self.jobs, self.notes = folder, Jobs(folder), Notes(folder)
        self.sounds, self.reader = Sounds(), Worker(_READER)
        self.scenes = Sounds(most=_MOST_SCENES, place="/scene", ending=".json")
        self.shapes, self.plans, self.uploads = Worker(_SHAPES), Plans(folder), Uploads(folder)
        self.listener = Worker(_LISTENER)
        self.points: dict[str, tuple[str, bytes]] = {}
        self.cards: dict[str, tuple[str, ResultCard]] = {}
        self.editors: WeakSet[Any] = WeakSet()
        self._spare = Worker(_EXPLORER)
        self._explorers: dict[Worker, bool] = {}  # and whether its page was left

    def start(self) -> None:
        """Start the reading process ahead."""
        self.reader.start()

    def start_spare(self) -> None:
        """Start the next processes ahead: their imports take seconds."""
        self._spare.start()
        self.shapes.start()

    def explorer(self) -> Worker:
        """A process for a slider page, to be given back.

        At the limit, that of a left page ends for it: reloading browsers leave one page after
        another, and each may come back for some seconds.
        """
        if len(self._explorers) >= _MOST_EXPLORERS:
            left = next((one for one, is_left in self._explorers.items() if is_left), None)
            if left is None:
                raise InputError(
                    "sliders",
                    got=f"{len(self._explorers)} open slider pages",
                    expected=f"at most {_MOST_EXPLORERS}, each holds its bodies in memory",
                    hint="close one of them.",
                )
            self.give_back(left)
        found, self._spare = self._spare, Worker(_EXPLORER)
        self._explorers[found] = False
        return found

    def mark_left(self, explorer: Worker, *, is_left: bool) -> None:
        """Note that the browser has left the page, or is back."""
        if explorer in self._explorers:
            self._explorers[explorer] = is_left

    def give_back(self, explorer: Worker) -> None:
        """End the process of a page that was closed."""
        if self._explorers.pop(explorer, None) is not None:
            explorer.close()

    def close(self) -> None:
        """End all processes but those of runs."""
        workers = (self.reader, self.listener, self.shapes, self._spare, *self._explorers)
        for worker in workers:
            worker.close()
