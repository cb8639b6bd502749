"""Process of one run: the command, then its exit code in a file.

``python -P -m klack.cli.job_process FOLDER COMMAND ...``, started by :mod:`klack.app.jobs`.
"""

import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from klack.cli.main import main

__all__ = ["run"]


def run(arguments: Sequence[str]) -> int:
    """Run a command of klack and write ``ending.json``, whatever happens."""
    folder, *command = arguments
    code = 70
    try:
        code = main(command)
    finally:
        file = Path(folder) / "ending.json"
        new = file.with_suffix(".new")
        new.write_text(json.dumps({"code": code, "ended": time.time()}), encoding="utf-8")
        new.replace(file)
    return code


if __name__ == "__main__":
    sys.exit(run(sys.argv[1:]))
