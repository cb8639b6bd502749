"""``python -m klack.warming GROUP...``: compile groups of functions, one after another.

Ends when the process that started it has gone.  Writes one line for each group: its name, and the
seconds and functions that were compiled.
"""

import os
import sys
import threading
import warnings

from klack.compiling.ahead import mark_ready
from klack.warming.counted import counted
from klack.warming.groups import GROUPS

__all__: list[str] = []


def _end_with_parent() -> None:
    while os.read(0, 1):  # not through sys.stdin, whose lock would be held at the end
        pass
    os._exit(143)


def _main() -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    warnings.simplefilter("ignore")
    for name in sys.argv[1:]:
        with counted() as count:
            GROUPS[name].compute()
        mark_ready(name)
        print(name, f"{count.seconds:.3f}", count.functions, flush=True)


if __name__ == "__main__":
    _main()
