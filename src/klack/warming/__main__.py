"""``python -m klack.warming GROUP...``: compile groups of functions for another process.

Ends with that process, which closes the standard input.
"""

import os
import sys
import threading
import warnings

from klack.warming.run import warm

__all__: list[str] = []


def _end_with_parent() -> None:
    while os.read(0, 1):  # not through sys.stdin, whose lock would be held at the end
        pass
    os._exit(0)


if __name__ == "__main__":
    threading.Thread(target=_end_with_parent, daemon=True).start()
    warnings.simplefilter("ignore")
    for _ in warm(sys.argv[1:]):
        pass
