"""Damage recordings of every format at random, and read them with little memory.

``python damaged_recordings.py FOLDER SEED COUNT``: FOLDER holds whole files.  Prints a JSON list of
what came out that is neither numbers nor the one error of klack, and how long the slowest took.
"""

import json
import random
import resource
import sys
import time
import warnings
from pathlib import Path

from klack.case.measurement import CaseMeasurement
from klack.errors import InputError
from klack.measurement.files.opening import open_recording
from klack.measurement.loading import load_stroke_set

warnings.simplefilter("ignore")

TRIGGERED = CaseMeasurement.model_validate(
    {"trigger": {"channel": "current", "level": "-2.87 A", "before": "20 us", "after": "50 us"}}
)


def damaged(raw: bytes, draw: random.Random) -> bytes:
    data = bytearray(raw)
    how = draw.choice(["head", "bytes", "digits", "cut", "huge", "noise", "shift"])
    if how == "cut":
        return raw[: draw.randrange(len(raw))]
    if how == "noise":
        return raw[: draw.randrange(min(len(raw), 600))] + draw.randbytes(2000)
    if how == "shift":
        at = draw.randrange(min(len(raw), 4000))
        return raw[:at] + draw.randbytes(draw.randint(1, 9)) + raw[at:]
    end = min(len(data), 2500) if how in ("head", "huge") else len(data)
    if how == "huge":
        at = draw.randrange(max(end - 8, 1))
        data[at : at + 8] = draw.choice(
            [b"\xff" * 8, b"\x00" * 8, b"\x00\x00\x00\x00\x00\x00\x00\x40", b"\x7f" * 8]
        )
        return bytes(data)
    for _ in range(draw.randint(1, 6)):
        at = draw.randrange(end)
        data[at] = ord(draw.choice("0123456789eE+-.,;")) if how == "digits" else draw.randrange(256)
    return bytes(data)


def read(path: Path) -> None:
    """Everything that is in a recording, and what a comparison reads of it."""
    with open_recording(path) as recording:
        for channel in recording.channels:
            recording.read(channel.name)
    load_stroke_set([path], TRIGGERED, roles=("lift",))


def main() -> None:
    folder, draw, count = Path(sys.argv[1]), random.Random(int(sys.argv[2])), int(sys.argv[3])
    whole = {path: path.read_bytes() for path in sorted(folder.iterdir()) if path.is_file()}
    for path in whole:
        read(path)  # loads the libraries, which need more than what follows
    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (used + 2 * 2**30, used + 2 * 2**30))
    place = folder / "damaged"
    place.mkdir(exist_ok=True)
    faults, slowest, refused = [], 0.0, 0
    for k in range(count):
        for path, raw in whole.items():
            other = place / path.name
            other.write_bytes(damaged(raw, draw))
            begin = time.process_time()
            print(f"{k} {path.name}", file=sys.stderr, flush=True)  # the last line before a crash
            try:
                read(other)
            except InputError as error:
                refused += 1
                if len(str(error)) > 3000:
                    faults.append(f"{k} {path.name}: a long message")
            except Exception as error:
                faults.append(f"{k} {path.name}: {error!r}"[:300])
                (folder.parent / f"fault-{k}-{path.name}").write_bytes(other.read_bytes())
            slowest = max(slowest, time.process_time() - begin)
    print(json.dumps({"faults": faults, "slowest": slowest, "refused": refused}))


if __name__ == "__main__":
    main()
