"""Two processes write results into one folder all the time, a third one reads them.

``python rival_writers.py FOLDER SECONDS``; prints a JSON object: how many were read, how many of
these hold numbers of two results, and the errors that came.
"""

import json
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from klack.analyses.store import RecordFormat, load_record, save_record, stored_format
from klack.errors import InputError

os.fsync = lambda handle: None  # type: ignore[assignment]  # more writing in less time


@dataclass(frozen=True, kw_only=True)
class Numbers:
    """Equal numbers in several places."""

    one: float
    some: np.ndarray
    more: np.ndarray


FORM = RecordFormat(name="test", version=1, kind=Numbers, command="klack test", units={})


def write(folder: Path, value: float) -> None:
    numbers = Numbers(one=value, some=np.full(500, value), more=np.full(700, value))
    save_record(numbers, folder, FORM)


def writer(folder: Path, first: int, seconds: float) -> int:
    """Start a process that writes other numbers each time."""
    child = os.fork()
    if child == 0:
        end, value = time.monotonic() + seconds, first
        while time.monotonic() < end:
            write(folder, float(value))
            value += 2
        os._exit(0)
    return child


def main() -> None:
    folder, seconds = Path(sys.argv[1]), float(sys.argv[2])
    writers = [writer(folder, first, seconds) for first in (1, 2)]
    end, read, mixed, errors = time.monotonic() + seconds, 0, 0, []
    while time.monotonic() < end:
        try:
            stored_format(folder)
            found = load_record(folder, FORM)
        except InputError as error:
            errors.append(error.got)
            continue
        read += 1
        mixed += not (np.all(found.some == found.one) and np.all(found.more == found.one))
    codes = [os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in writers]
    left = sorted(path.name for path in folder.iterdir())
    print(
        json.dumps({"read": read, "mixed": mixed, "errors": errors, "left": left, "codes": codes})
    )


if __name__ == "__main__":
    main()
